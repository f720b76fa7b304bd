//! Settings in use: changed at once, written a little later, on a thread of its own.

use super::settings::{Settings, SettingsFile};
use crossbeam::channel::{Receiver, Sender, unbounded};
use std::io;
use std::thread::JoinHandle;
use std::time::Duration;

/// Time without changes after which settings are written.
const QUIET: Duration = Duration::from_secs(1);

/// Keeps settings; changes are written on drop at the latest.
#[derive(Debug)]
pub struct SettingsKeeper {
    settings: Settings,
    /// The settings last sent to the writer.
    sent: Settings,
    /// The settings at the last tick, and when they last changed.
    seen: (Settings, Duration),
    /// Number of settings sent.
    sends: u64,
    to: Option<Sender<(u64, Settings)>>,
    written: Receiver<Written>,
    writer: Option<JoinHandle<()>>,
}

/// Settings as they were written.
#[derive(Debug)]
struct Written {
    /// Number of the last settings sent that they contain.
    sends: u64,
    settings: Settings,
    notice: Option<String>,
}

impl SettingsKeeper {
    /// Reads the file and takes charge of it. `wake` is called when there is a message.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn open(mut file: SettingsFile, wake: impl Fn() + Send + 'static) -> io::Result<(Self, Option<String>)> {
        let (settings, notice) = file.load();
        let (to, waiting) = unbounded();
        let (tell, written) = unbounded();
        let writer = std::thread::Builder::new().name("settings".to_owned()).spawn(move || {
            while let Ok(newest) = waiting.recv() {
                let (sends, mut settings) = waiting.try_iter().last().unwrap_or(newest);
                let notice = file.save(&mut settings);
                // The receiver is gone after a drop.
                let _ = tell.send(Written { sends, settings, notice });
                wake();
            }
        })?;
        let (sent, seen) = (settings.clone(), (settings.clone(), Duration::ZERO));
        Ok((Self { settings, sent, seen, sends: 0, to: Some(to), written, writer: Some(writer) }, notice))
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The settings, to be changed.
    pub fn settings_mut(&mut self) -> &mut Settings {
        &mut self.settings
    }

    /// Writes changes that are old enough. Returns a message for the user, and when to call again.
    pub fn tick(&mut self, now: Duration) -> (Option<String>, Option<Duration>) {
        let mut told = None;
        while let Ok(written) = self.written.try_recv() {
            told = written.notice.or(told);
            // Recent files and looks of other windows, unless newer settings are being written.
            if self.settings == self.sent && written.sends == self.sends {
                self.settings = written.settings;
                (self.sent, self.seen.0) = (self.settings.clone(), self.settings.clone());
            }
        }
        if self.settings == self.sent {
            return (told, None);
        }
        if self.settings != self.seen.0 {
            self.seen = (self.settings.clone(), now);
        }
        let age = now.saturating_sub(self.seen.1);
        if age < QUIET {
            return (told, Some(QUIET - age));
        }
        self.send();
        (told, None)
    }

    fn send(&mut self) {
        if self.settings != self.sent
            && let Some(to) = &self.to
        {
            self.sent = self.settings.clone();
            self.sends += 1;
            // A writer that ended has reported why.
            let _ = to.send((self.sends, self.sent.clone()));
        }
    }
}

impl Drop for SettingsKeeper {
    fn drop(&mut self) {
        self.send();
        self.to = None;
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn open(folder: &Path) -> SettingsKeeper {
        SettingsKeeper::open(SettingsFile::at(folder), || ()).unwrap().0
    }

    #[test]
    fn changes_are_written_when_it_is_quiet_and_at_the_end() {
        let dir = tempfile::tempdir().unwrap();
        let mut keeper = open(dir.path());
        assert_eq!(keeper.tick(Duration::ZERO), (None, None));
        keeper.settings_mut().image_scale = 0.5;
        assert_eq!(keeper.tick(Duration::from_secs(10)).1, Some(QUIET));
        keeper.settings_mut().image_scale = 0.75;
        assert_eq!(keeper.tick(Duration::from_millis(10_900)).1, Some(QUIET), "another change, another second");
        assert_eq!(SettingsFile::at(dir.path()).load().0.image_scale, 1.0);
        assert_eq!(keeper.tick(Duration::from_secs(12)), (None, None));
        keeper.settings_mut().target_rate = 30.0;
        drop(keeper);
        let (kept, _) = SettingsFile::at(dir.path()).load();
        assert_eq!((kept.image_scale, kept.target_rate), (0.75, 30.0));
    }

    #[test]
    fn settings_that_were_written_before_newer_ones_do_not_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let mut keeper = open(dir.path());
        let (tell, written) = unbounded();
        keeper.written = written;
        for (image_scale, shows_side) in [(1.5, false), (2.0, true)] {
            keeper.settings_mut().shows_side = shows_side;
            keeper.settings_mut().image_scale = image_scale;
            keeper.send();
        }
        let older = Settings { shows_side: false, ..keeper.settings().clone() };
        tell.send(Written { sends: 1, settings: older.clone(), notice: None }).unwrap();
        keeper.tick(Duration::ZERO);
        assert!(keeper.settings().shows_side);
        tell.send(Written { sends: 2, settings: older, notice: None }).unwrap();
        keeper.tick(Duration::ZERO);
        assert!(!keeper.settings().shows_side, "what was written last comes back");
    }

    #[test]
    fn files_that_another_window_opened_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let (mut first, mut second) = (open(dir.path()), open(dir.path()));
        first.settings_mut().remember_file(Path::new("/first.zarr"));
        drop(first);
        second.settings_mut().remember_file(Path::new("/second.zarr"));
        second.tick(Duration::ZERO);
        second.tick(QUIET);
        while second.settings().recent.len() < 2 {
            second.tick(2 * QUIET);
            std::thread::sleep(Duration::from_millis(1));
        }
        let names: Vec<_> = second.settings().recent.iter().map(|file| file.path.clone()).collect();
        assert_eq!(names, [Path::new("/second.zarr"), Path::new("/first.zarr")]);
    }
}

//! Progress bars and messages on stderr, and the end of a run by Ctrl-C.

use super::Interrupted;
use crate::task::{Cancel, Progress};
use crossbeam::channel::{RecvTimeoutError, bounded};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// What a command talks to: bars and messages on stderr, and the flag that Ctrl-C raises.
pub(super) struct Terminal {
    quiet: bool,
    verbose: bool,
    bar: Mutex<Option<ProgressBar>>,
    /// Raised by Ctrl-C; work looks at it between two units.
    pub(super) cancel: Cancel,
}

impl Terminal {
    /// Installs the Ctrl-C handler: the first one raises the flag, so that temporary files are removed.
    pub(super) fn new(quiet: bool, verbose: bool) -> Self {
        let cancel = Cancel::new();
        let flag = cancel.clone();
        // Without a handler Ctrl-C ends the process at once and leaves temporary files: worth a word, no reason to stop.
        // A second one ends it at once, for those who cannot wait.
        let on_signal = move || {
            if flag.is_cancelled() {
                std::process::exit(i32::from(super::EXIT_INTERRUPTED));
            }
            flag.cancel();
        };
        if let Err(error) = ctrlc::set_handler(on_signal) {
            eprintln!("warning: Ctrl-C will not clean up: {error}");
        }
        Self { quiet, verbose, bar: Mutex::new(None), cancel }
    }

    /// A line for the user, unless `--quiet`.
    pub(super) fn say(&self, line: &str) {
        if !self.quiet {
            self.above_bar(line);
        }
    }

    /// A line for the curious, with `--verbose`.
    pub(super) fn detail(&self, line: &str) {
        if self.verbose {
            self.above_bar(line);
        }
    }

    fn above_bar(&self, line: &str) {
        match &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }

    /// Fails if Ctrl-C was pressed.
    pub(super) fn check_interrupted(&self) -> Result<(), Interrupted> {
        if self.cancel.is_cancelled() { Err(Interrupted) } else { Ok(()) }
    }
}

/// How often a wait looks for Ctrl-C.
const TICK: Duration = Duration::from_millis(50);

/// Does something on a thread of its own that looks at no flag and writes nothing. Ctrl-C ends the wait for it, and then the process.
pub(super) fn unless_interrupted<T: Send + 'static>(
    cancel: &Cancel,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Interrupted> {
    let (say, heard) = bounded(1);
    // Nobody listens any more after Ctrl-C.
    let thread = std::thread::spawn(move || _ = say.send(work()));
    loop {
        match heard.recv_timeout(TICK) {
            Ok(done) => return Ok(done),
            Err(RecvTimeoutError::Timeout) if cancel.is_cancelled() => return Err(Interrupted),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => match thread.join() {
                Err(panic) => std::panic::resume_unwind(panic),
                Ok(()) => return Err(Interrupted), // not reached: who ends without a panic has said something
            },
        }
    }
}

impl Progress for Terminal {
    fn begin(&self, stage: &str, total: u64, unit: &str) {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let template = format!("{{msg}} [{{bar:30}}] {{pos}}/{{len}} {unit}, {{per_sec}}, {{eta}} left");
        let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::with_draw_target(Some(total), target).with_style(style.progress_chars("=> "));
        bar.set_message(stage.to_owned());
        *self.bar.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar);
    }

    fn advance(&self, n: u64) {
        if let Some(bar) = &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            bar.inc(n);
        }
    }

    fn end(&self) {
        if let Some(bar) = self.bar.lock().unwrap_or_else(PoisonError::into_inner).take() {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_looks_at_no_flag_is_waited_for_until_somebody_interrupts() {
        let cancel = Cancel::new();
        assert_eq!(unless_interrupted(&cancel, || 7).ok(), Some(7));
        let (end, ended) = bounded::<()>(0);
        cancel.cancel();
        assert!(unless_interrupted(&cancel, move || ended.recv().is_ok()).is_err(), "before the work has ended");
        drop(end);
        let panic = std::panic::catch_unwind(|| unless_interrupted(&Cancel::new(), || -> u8 { panic!("on purpose") }));
        assert!(panic.is_err());
    }
}

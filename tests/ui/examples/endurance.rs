//! Whether memory and time per frame stay what they are over many frames.
//!
//! ```text
//! cargo run --release -p tetreel-ui-tests --example endurance -- STORE.zarr cpu|gpu [FRAMES]
//! ```
//!
//! Plays a store in a loop, as fast as possible, in a window on a screen in memory (Xvfb), and says after each fifth of the
//! frames what the process holds.

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("screens in memory are for Linux");
}

#[cfg(target_os = "linux")]
fn main() {
    linux::main();
}

#[cfg(target_os = "linux")]
mod linux {
    use std::path::PathBuf;
    use std::sync::Arc;
    use std::time::Instant;
    use tetreel::look::Look;
    use tetreel::pipeline::{Backend, PipelinedOptions, Series};
    use tetreel::task::Cancel;
    use tetreel::transfer::TransferFunction;
    use tetreel::ui::settings::SettingsFile;
    use tetreel::ui::window::{PlayerWindow, Start, WindowOptions, run_watched};
    use tetreel_ui_tests::desk::options;
    use tetreel_ui_tests::screen::{Keysym, User, on_a_screen, pause};

    const SIZE: (u32, u32) = (800, 500);

    pub(super) fn main() {
        let arguments: Vec<String> = std::env::args().skip(1).collect();
        let [store, backend, rest @ ..] = &*arguments else {
            eprintln!("usage: endurance STORE.zarr cpu|gpu [FRAMES]");
            std::process::exit(2);
        };
        if let Some(status) = on_a_screen(SIZE).expect("a screen") {
            std::process::exit(status.code().unwrap_or(1));
        }
        let frames: u64 = rest.first().map_or(5000, |frames| frames.parse().expect("a number of frames"));
        let backend: Backend = backend.parse().expect("a backend");
        let folder = tempfile::tempdir().expect("a folder");
        let dress = move |series: &Series| {
            let tf = TransferFunction::parse("viridis").map_err(|error| error.to_string())?;
            Ok(Look { backend, ..Look::default_for(series, tf).map_err(|error| error.to_string())? }.into())
        };
        let options = WindowOptions {
            dress: Arc::new(dress),
            threads: PipelinedOptions { give_way: true, frame_cache_bytes: 0, ..Default::default() },
            size: Some([SIZE.0 as f32, SIZE.1 as f32]),
            settings: SettingsFile::nowhere(),
            ..options(folder.path(), Start::Open(vec![PathBuf::from(store)]))
        };
        let cancel = Cancel::new();
        let play = std::thread::spawn(|| {
            let user = User::of(&std::env::var("DISPLAY").expect("a screen")).expect("the screen");
            user.point(100.0, 100.0).expect("the screen");
            pause(3000);
            user.focus().expect("the window");
            // In a loop, as fast as possible: real time is the one after every step, so the mode is chosen by speed.
            user.key(Keysym(0x6c)).expect("a key");
            for _ in 0..14 {
                user.key(Keysym(0x5d)).expect("a key");
                pause(50);
            }
            user.key(Keysym::SPACE).expect("a key");
        });
        let (mut shown_frames, mut last, mut begin, ended) = (0_u64, None, Instant::now(), cancel.clone());
        let watch = Box::new(move |window: &PlayerWindow| {
            let Some(shown) = window.session().and_then(|session| session.shown()) else { return };
            if last == Some(shown.request.time) {
                return;
            }
            last = Some(shown.request.time);
            shown_frames += 1;
            if shown_frames % (frames / 5).max(1) == 0 {
                let ms = begin.elapsed().as_secs_f64() * 1e3 / (frames / 5) as f64;
                println!("{shown_frames} frames: {ms:.2} ms a frame, {}", resident());
                begin = Instant::now();
            }
            if shown_frames >= frames {
                ended.cancel();
            }
        });
        run_watched(options, &cancel, watch).expect("a window");
        play.join().expect("the user");
    }

    /// The line of the kernel that says how much memory is resident.
    fn resident() -> String {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        status.lines().find(|line| line.starts_with("VmRSS")).unwrap_or("VmRSS unknown").to_owned()
    }
}

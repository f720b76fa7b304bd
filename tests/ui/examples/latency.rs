//! How long after an input the window shows that it has heard of it, while a series is played: measured from outside, as a
//! user sees it.
//!
//! ```text
//! cargo run --release -p tetreel-ui-tests --example latency -- STORE.zarr cpu|gpu [INPUTS]
//! ```
//!
//! On a screen in memory (Xvfb) of 1280 x 720 pixels. Half of the inputs move the mouse from button to button, until the button
//! looks different; half of them turn the volume, until the axes in the corner have turned. Then as many drag a point of the opacity
//! curve: while it plays until the curve looks different, and at rest until the picture does; and a tenth step back, until the histogram
//! of the step shown looks different. The machine should do nothing else.

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
    use egui::{Pos2, Rect, pos2, vec2};
    use std::path::Path;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::sync::{Arc, Mutex};
    use std::time::{Duration, Instant};
    use tetreel::look::Look;
    use tetreel::pipeline::{Backend, FrameTime, PipelinedOptions, Series};
    use tetreel::task::Cancel;
    use tetreel::transfer::TransferFunction;
    use tetreel::ui::settings::{Settings, SettingsFile};
    use tetreel::ui::window::{PlayerWindow, Start, WindowOptions, run_watched};
    use tetreel_ui_tests::desk::{Desk, options, store};
    use tetreel_ui_tests::screen::{Keysym, User, on_a_screen, pause};

    const SIZE: (u32, u32) = (1280, 720);

    /// What the window does meanwhile.
    #[derive(Default)]
    struct Playing {
        frames: AtomicU64,
        last: Mutex<Option<FrameTime>>,
        sizes: Mutex<Vec<(usize, usize)>>,
        first: Mutex<Option<Instant>>,
    }

    pub(super) fn main() {
        let arguments: Vec<String> = std::env::args().skip(1).collect();
        let [store, backend, rest @ ..] = &*arguments else {
            eprintln!("usage: latency STORE.zarr cpu|gpu [INPUTS]");
            std::process::exit(2);
        };
        if let Some(status) = on_a_screen(SIZE).expect("a screen") {
            std::process::exit(status.code().unwrap_or(1));
        }
        let inputs = rest.first().map_or(200, |inputs| inputs.parse().expect("a number of inputs"));
        let backend: Backend = backend.parse().expect("a backend");
        measure(Path::new(store), backend, inputs);
    }

    fn measure(store: &Path, backend: Backend, inputs: usize) {
        let places = Places::find();
        let folder = tempfile::tempdir().expect("a folder");
        let options = WindowOptions {
            threads: PipelinedOptions { give_way: true, ..Default::default() },
            size: Some([SIZE.0 as f32, SIZE.1 as f32]),
            ..curve_options(folder.path(), Start::Open(vec![store.to_owned()]), backend)
        };
        let (playing, cancel, started) = (Arc::new(Playing::default()), Cancel::new(), Instant::now());
        let user = {
            let (playing, cancel) = (playing.clone(), cancel.clone());
            std::thread::spawn(move || {
                let done = std::panic::catch_unwind(|| use_it(&places, &playing, started, inputs));
                cancel.cancel();
                done.expect("the measurement");
            })
        };
        let watch = Box::new(move |window: &PlayerWindow| {
            let Some(shown) = window.session().and_then(|session| session.shown()) else { return };
            let mut last = playing.last.lock().expect("no panic");
            if *last != Some(shown.request.time) {
                *last = Some(shown.request.time);
                playing.frames.fetch_add(1, Ordering::Relaxed);
                playing.sizes.lock().expect("no panic").push(shown.request.size_px);
            }
            if window.is_up_to_date() {
                playing.first.lock().expect("no panic").get_or_insert_with(Instant::now);
            }
        });
        run_watched(options, &cancel, watch).expect("a window");
        user.join().expect("the measurement");
    }

    /// Options of a window with a curve of three points, and the parts of the side panel above it closed.
    fn curve_options(folder: &Path, start: Start, backend: Backend) -> WindowOptions {
        let dress = move |series: &Series| {
            let tf = TransferFunction::parse("viridis@0:0,0.5:0.5,1:1").map_err(|error| error.to_string())?;
            Ok(Look { backend, ..Look::default_for(series, tf).map_err(|error| error.to_string())? }.into())
        };
        let closed = ["Field", "Project", "Colours"].map(|name| (name.to_owned(), false)).into();
        let mut settings = SettingsFile::at(folder.join("settings"));
        settings.save(&mut Settings { open_sections: closed, ..Settings::default() });
        WindowOptions { dress: Arc::new(dress), settings, ..options(folder, start) }
    }

    /// Where things are in a window of this size.
    struct Places {
        /// Two buttons of the timeline, which is at the bottom.
        buttons: [Rect; 2],
        picture: Rect,
        curve: Rect,
        /// The choice of the histogram, and the option of the step shown.
        histogram: [Rect; 2],
    }

    impl Places {
        fn find() -> Self {
            let folder = tempfile::tempdir().expect("a folder");
            let start = Start::Open(vec![store(folder.path())]);
            let options = curve_options(folder.path(), start, Backend::Cpu);
            let size = [SIZE.0 as f32, SIZE.1 as f32];
            let mut desk = Desk::with(size, 1.0, options, folder).expect("a GPU, be it in software");
            desk.begin();
            desk.settle();
            let [stop, back] = ["Stop", "Play backwards"].map(|name| desk.place(name));
            let (picture, curve, choice) =
                (desk.place("Picture of"), desk.place("Opacity curve"), desk.place_of("Histogram"));
            desk.click("Histogram");
            Self { buttons: [stop, back], picture, curve, histogram: [choice, desk.place_of("step shown")] }
        }

        /// The point in the middle of the curve, raised by a share of its height.
        fn handle(&self, raised: f32) -> Pos2 {
            // Margins, and the colours below the curve.
            let curve = self.curve.with_max_y(self.curve.bottom() - 12.0).shrink(4.0);
            curve.center() - vec2(0.0, raised * curve.height())
        }

        /// Where the axes are: in the lower right corner of the picture.
        fn axes(&self) -> Rect {
            Rect::from_min_max(self.picture.max - vec2(110.0, 110.0), self.picture.max - vec2(10.0, 10.0))
        }
    }

    fn look(user: &User, rect: Rect) -> Vec<[u8; 3]> {
        let (x, y) = (rect.left().round() as i16, rect.top().round() as i16);
        user.look(x, y, rect.width().floor() as u16, rect.height().floor() as u16).expect("the screen")
    }

    /// Milliseconds from an input until a place looks different.
    fn until_changed(user: &User, place: Rect, input: impl FnOnce()) -> f64 {
        let before = look(user, place);
        let begin = Instant::now();
        input();
        while look(user, place) == before {
            // Looking all the time would take a core away from what is looked at.
            pause(2);
            assert!(begin.elapsed() < Duration::from_secs(5), "the window does not hear");
        }
        begin.elapsed().as_secs_f64() * 1e3
    }

    fn use_it(places: &Places, playing: &Playing, started: Instant, inputs: usize) {
        let user = User::of(&std::env::var("DISPLAY").expect("a screen")).expect("the screen");
        while playing.first.lock().expect("no panic").is_none() {
            pause(1);
        }
        let first = playing.first.lock().expect("no panic").map_or(0.0, |at| (at - started).as_secs_f64());
        println!("first picture after {first:.2} s");
        let park = places.picture.center();
        user.point(park.x, park.y).expect("the screen");
        user.focus().expect("the window");
        pause(500);
        // A loop, so that it does not end.
        user.key(Keysym(0x6c)).expect("a key");
        user.key(Keysym::SPACE).expect("a key");
        pause(1500);
        let (frames, begin) = (playing.frames.load(Ordering::Relaxed), Instant::now());
        let pointed: Vec<f64> = (0..inputs / 2)
            .map(|i| {
                let button = places.buttons[i % 2];
                let ms = until_changed(&user, button.shrink(2.0), || {
                    user.point(button.center().x, button.center().y).expect("the screen");
                });
                pause(37);
                ms
            })
            .collect();
        let fps = (playing.frames.load(Ordering::Relaxed) - frames) as f64 / begin.elapsed().as_secs_f64();
        report("mouse to button", &pointed, fps);

        user.point(park.x, park.y).expect("the screen");
        pause(300);
        user.button(1, true).expect("the screen");
        let (frames, begin) = (playing.frames.load(Ordering::Relaxed), Instant::now());
        playing.sizes.lock().expect("no panic").clear();
        let at = |i: usize| -> Pos2 {
            let angle = i as f32 * 0.2;
            pos2(park.x, park.y) + 150.0 * vec2(angle.sin(), 0.4 * (2.0 * angle).sin())
        };
        user.point(at(1).x, at(1).y).expect("the screen");
        pause(500);
        let turned: Vec<f64> = (2..inputs / 2 + 2)
            .map(|i| {
                let ms = until_changed(&user, places.axes(), || user.point(at(i).x, at(i).y).expect("the screen"));
                pause(37);
                ms
            })
            .collect();
        let fps = (playing.frames.load(Ordering::Relaxed) - frames) as f64 / begin.elapsed().as_secs_f64();
        user.button(1, false).expect("the screen");
        report("drag to axes", &turned, fps);
        let sizes = playing.sizes.lock().expect("no panic").clone();
        println!("images meanwhile: {:?}", sizes.last());
        let mut all = pointed;
        all.extend(turned);
        report("all", &all, fps);
        edit(&user, places, playing, inputs);
    }

    /// Drags the middle of the curve, and steps on.
    fn edit(user: &User, places: &Places, playing: &Playing, inputs: usize) {
        let point = |at: Pos2| user.point(at.x, at.y).expect("the screen");
        let middle = places.picture.center();
        let seen = Rect::from_center_size(middle, vec2(60.0, 60.0));
        let drag = |name: &str, place: Rect, count: usize| {
            let (frames, begin) = (playing.frames.load(Ordering::Relaxed), Instant::now());
            let ms: Vec<f64> = (1..=count)
                .map(|i| {
                    let raised = 0.3 * (i as f32 * 0.7).sin();
                    let ms = until_changed(user, place, || point(places.handle(raised)));
                    pause(37);
                    ms
                })
                .collect();
            let fps = (playing.frames.load(Ordering::Relaxed) - frames) as f64 / begin.elapsed().as_secs_f64();
            report(name, &ms, fps);
        };
        point(places.handle(0.0));
        pause(300);
        user.button(1, true).expect("the screen");
        drag("handle to curve", places.curve, inputs / 2);
        user.key(Keysym::SPACE).expect("a key");
        // The last step, in which the volume fills the middle of the picture.
        user.key(Keysym(0xff57)).expect("a key");
        pause(1500);
        drag("handle to picture, at rest", seen, inputs / 2);
        user.button(1, false).expect("the screen");
        for place in places.histogram {
            point(place.center());
            pause(300);
            user.button(1, true).expect("the screen");
            user.button(1, false).expect("the screen");
            pause(500);
        }
        point(middle);
        pause(1500);
        let steps: Vec<f64> = (0..inputs / 10)
            .map(|_| {
                let ms = until_changed(user, places.curve, || user.key(Keysym(0xff51)).expect("a key"));
                pause(1000);
                ms
            })
            .collect();
        report("key to histogram of the step", &steps, 0.0);
    }

    fn report(name: &str, ms: &[f64], fps: f64) {
        let mut ms = ms.to_vec();
        ms.sort_by(f64::total_cmp);
        let at = |share: f64| ms[((ms.len() - 1) as f64 * share).round() as usize];
        println!(
            "{name}: {} inputs, median {:.1} ms, p95 {:.1} ms, longest {:.1} ms; {fps:.1} frames/s meanwhile",
            ms.len(),
            at(0.5),
            at(0.95),
            at(1.0)
        );
    }
}

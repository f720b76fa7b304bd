//! A real window on a screen in memory: it is played with keys and mouse, and looked at from outside.
//!
//! The screen needs Xvfb. Without it the test says that it was skipped, and fails if `TETREEL_REQUIRE` names `window`.

#[cfg(not(target_os = "linux"))]
fn main() {
    println!("SKIPPED (window): screens in memory are for Linux");
    assert!(!tetreel_ui_tests::is_required("window"));
}

#[cfg(target_os = "linux")]
fn main() {
    linux::main();
}

#[cfg(target_os = "linux")]
mod linux {
    use egui::{Pos2, Rect};
    use std::panic::AssertUnwindSafe;
    use std::path::Path;
    use std::sync::{Arc, Mutex};
    use std::time::{Duration, Instant};
    use tetreel::camera::Camera;
    use tetreel::look::Look;
    use tetreel::pipeline::{Backend, Series, SharedFrame};
    use tetreel::render::Frame;
    use tetreel::stats::FrameStats;
    use tetreel::task::Cancel;
    use tetreel::ui::window::{Dressed, PlayerWindow, Start, WindowOptions, run_watched};
    use tetreel_ui_tests::desk::{self, Desk, STEPS, options, store};
    use tetreel_ui_tests::is_required;
    use tetreel_ui_tests::screen::{Keysym, User, on_a_screen, pause};

    /// Of screen and window, in pixels.
    const SIZE: (u32, u32) = (1280, 800);

    pub(super) fn main() {
        match on_a_screen(SIZE) {
            Ok(None) => play(),
            Ok(Some(status)) => assert!(status.success(), "the test in front of the screen failed: {status}"),
            Err(why) => {
                println!("SKIPPED (window): {why}");
                assert!(!is_required("window"), "the test of the real window may not be skipped here");
            }
        }
    }

    /// Where things are in the window.
    struct Places {
        picture: Rect,
        play: Pos2,
        slider: Rect,
        bounding_box: Pos2,
        color_map: Pos2,
        inferno: Pos2,
        dismiss: Pos2,
    }

    /// The same window without a screen tells where things are.
    fn places() -> Option<Places> {
        let mut desk = Desk::open()?;
        desk.settle();
        let (picture, play, slider) =
            (desk.place("Picture of"), desk.place_of("Play").center(), desk.place("Step slider"));
        let (color_map, bounding_box) = (desk.place("Colour map").center(), desk.place("box").center());
        desk.press(egui::Key::S);
        desk.until("the file is there", |session| !session.notices().is_empty());
        desk.settle();
        let dismiss = desk.place_of("Dismiss message 1").center();
        desk.click("Colour map");
        desk.settle();
        let inferno = desk.place("inferno").center();
        Some(Places { picture, play, slider, bounding_box, color_map, inferno, dismiss })
    }

    /// What the window showed last, and what it has shown.
    #[derive(Default)]
    struct Seen {
        frame: Option<SharedFrame>,
        stats: FrameStats,
        /// The step that was asked for when a frame came, and that of the frame.
        asked_and_shown: Vec<(usize, usize)>,
        playing: bool,
        color_map: String,
        camera: Option<Camera>,
        notices: Vec<String>,
        is_painted: bool,
        passes: u64,
    }

    impl Seen {
        fn look(&mut self, window: &PlayerWindow) {
            self.passes += 1;
            let Some(session) = window.session() else { return };
            let (state, look) = (session.state(), session.look());
            self.playing = state.playing;
            self.color_map = session.function().map(|tf| tf.color_map().name().to_owned()).unwrap_or_default();
            self.camera = Some(look.camera);
            self.notices = session.notices().iter().map(|notice| notice.text.clone()).collect();
            if let (Some(shown), Some(asked)) = (session.shown(), state.frame) {
                // Both are held, so that their places tell them apart.
                let is_same = |frame: &SharedFrame| std::ptr::eq::<Frame>(&**frame, &*shown.frame);
                if !self.frame.as_ref().is_some_and(is_same) {
                    self.asked_and_shown.push((asked.step(), shown.request.time.step()));
                    self.stats = shown.frame.stats.clone();
                    self.frame = Some(shown.frame.clone());
                }
            }
            self.is_painted = window.is_up_to_date();
        }

        fn shown(&self) -> Option<usize> {
            self.asked_and_shown.last().map(|(_, shown)| *shown)
        }
    }

    fn play() {
        let Some(places) = places() else { return };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().to_owned();
        let options = options(&path, Start::Open(vec![store(&path)]));
        in_front_of(options, move |seen| use_it(&places, seen, &path));

        let folder = tempfile::tempdir().unwrap();
        let options = desk::options(folder.path(), Start::Open(vec![store(folder.path())]));
        let dress = options.dress.clone();
        let on_gpu = move |series: &Series| {
            let dressed = dress(series)?;
            Ok(Dressed { look: Look { backend: Backend::Gpu, ..dressed.look }, ..dressed })
        };
        in_front_of(WindowOptions { dress: Arc::new(on_gpu), ..options }, lose_the_gpu);
        println!("a real window was played, scrubbed, coloured and photographed, and has survived the loss of its GPU");
    }

    /// Opens a window, and has a user in front of it until the user is done.
    fn in_front_of(options: WindowOptions, user: impl FnOnce(&Mutex<Seen>) + Send + 'static) {
        let (seen, cancel) = (Arc::new(Mutex::new(Seen::default())), Cancel::new());
        let user = {
            let (seen, cancel) = (seen.clone(), cancel.clone());
            std::thread::spawn(move || {
                // The window is closed whatever happens.
                let done = std::panic::catch_unwind(AssertUnwindSafe(|| user(&seen)));
                cancel.cancel();
                done
            })
        };
        let watch = Box::new(move |window: &PlayerWindow| seen.lock().unwrap().look(window));
        run_watched(options, &cancel, watch).unwrap();
        if let Err(panic) = user.join().unwrap() {
            std::panic::resume_unwind(panic);
        }
    }

    /// A window whose GPU is lost is opened again, and goes on where it was.
    fn lose_the_gpu(seen: &Mutex<Seen>) {
        let user = User::of(&std::env::var("DISPLAY").unwrap()).unwrap();
        let texture = |seen: &Seen| seen.frame.as_ref().and_then(|frame| frame.texture.clone());
        until("a frame that stays on the GPU", seen, |seen| texture(seen).is_some() && seen.is_painted);
        user.point(300.0, 300.0).unwrap();
        user.focus().unwrap();
        user.key(Keysym::RIGHT).unwrap();
        until("the next step", seen, |seen| seen.shown() == Some(1) && seen.is_painted);
        let lost = texture(&seen.lock().unwrap()).unwrap().context().clone();
        // What is lost between the image that the screen gave and its return ends the program: wgpu's swapchain then panics while
        // it is dropped.
        until_at_rest(seen);
        lost.lose();
        // Something happens, and the window notices.
        user.point(320.0, 320.0).unwrap();
        until("the window is there again", seen, |seen| {
            let is_new = texture(seen).is_some_and(|texture| !Arc::ptr_eq(texture.context(), &lost));
            is_new && seen.is_painted && seen.notices.iter().any(|text| text.contains("opened again"))
        });
        assert_eq!(seen.lock().unwrap().shown(), Some(1), "where it was");
        let picture = || user.look(300, 200, 400, 300).unwrap();
        until("it is painted", seen, |_| picture().into_iter().collect::<std::collections::HashSet<_>>().len() > 50);
    }

    fn until(what: &str, seen: &Mutex<Seen>, holds: impl Fn(&Seen) -> bool) {
        let begin = Instant::now();
        while !holds(&seen.lock().unwrap()) {
            let seen = || seen.lock().unwrap().notices.clone();
            assert!(begin.elapsed() < Duration::from_secs(60), "in vain: {what}; {:?}", seen());
            pause(5);
        }
    }

    /// Waits until nothing has been painted for longer than painting takes.
    fn until_at_rest(seen: &Mutex<Seen>) {
        let passes = || seen.lock().unwrap().passes;
        let (mut before, begin) = (passes(), Instant::now());
        loop {
            pause(1500);
            match passes() {
                now if now == before => return,
                now => before = now,
            }
            assert!(begin.elapsed() < Duration::from_secs(60), "it is painted without end");
        }
    }

    fn use_it(places: &Places, seen: &Mutex<Seen>, folder: &Path) {
        let user = User::of(&std::env::var("DISPLAY").unwrap()).unwrap();
        until("the first picture", seen, |seen| seen.shown() == Some(0) && seen.is_painted);
        until("the volume is on the screen", seen, |_| colours(&user, places) > 50);

        user.click(places.play.x, places.play.y).unwrap();
        user.focus().unwrap();
        until("it plays to the end", seen, |seen| !seen.playing && seen.shown() == Some(STEPS - 1));
        {
            let seen = seen.lock().unwrap();
            let shown: Vec<usize> = seen.asked_and_shown.iter().map(|(_, shown)| *shown).collect();
            let mut steps = shown.clone();
            steps.dedup();
            assert_eq!(steps, (0..STEPS).collect::<Vec<_>>(), "every step once, in order: {shown:?}");
            let stats = &seen.stats;
            assert!(!stats.on_gpu && stats.cells_total > 1000 && stats.steps > 0 && stats.ms_render > 0.0, "{stats:?}");
        }

        scrub(&user, places, seen);

        let before = user.look(0, 0, 1280, 700).unwrap();
        user.click(places.color_map.x, places.color_map.y).unwrap();
        pause(300);
        user.click(places.inferno.x, places.inferno.y).unwrap();
        until("other colours are chosen", seen, |seen| seen.color_map == "inferno");
        until("and seen", seen, |_| user.look(0, 0, 1280, 700).unwrap() != before);

        let camera = seen.lock().unwrap().camera;
        let center = places.picture.center();
        user.point(center.x, center.y).unwrap();
        user.button(4, true).unwrap();
        user.button(4, false).unwrap();
        until("the wheel zooms", seen, |seen| seen.camera != camera);

        // The box of the mesh is not saved.
        until("the closer picture is there", seen, |seen| seen.is_painted);
        pause(500);
        let with_box = look_at(&user, middle(places.picture));
        user.click(places.bounding_box.x, places.bounding_box.y).unwrap();
        until("the box is hidden", seen, |_| look_at(&user, middle(places.picture)) != with_box);

        pause(500);
        user.key(Keysym::S).unwrap();
        until("the picture is saved", seen, |seen| seen.notices.iter().any(|text| text.starts_with("saved")));
        compare(&user, places, seen, folder);
    }

    /// Drags through the series and back; what is shown in the end is what was asked for last, and nothing after it.
    fn scrub(user: &User, places: &Places, seen: &Mutex<Seen>) {
        let slider = places.slider;
        // While it played, the next step was asked for when one came.
        seen.lock().unwrap().asked_and_shown.clear();
        let x = |share: f32| egui::lerp(slider.left() + 8.0..=slider.right() - 8.0, share);
        let y = slider.center().y;
        user.point(x(1.0), y).unwrap();
        pause(80);
        user.button(1, true).unwrap();
        let way = (0..40).map(|i| 1.0 - i as f32 / 39.0).chain((0..20).map(|i| 0.6 * i as f32 / 19.0));
        for share in way {
            user.point(x(share), y).unwrap();
            pause(4);
        }
        user.button(1, false).unwrap();
        let last = (0.6 * (STEPS - 1) as f32).round() as usize;
        until("the last place is shown", seen, |seen| seen.shown() == Some(last) && seen.is_painted);
        pause(300);
        let seen = seen.lock().unwrap();
        for &(asked, shown) in &seen.asked_and_shown {
            assert_eq!(shown, asked, "a frame came that was not asked for any more: {:?}", seen.asked_and_shown);
        }
        assert_eq!(seen.shown(), Some(last));
    }

    /// Different colours in the middle of the picture.
    fn colours(user: &User, places: &Places) -> usize {
        let pixels = look_at(user, middle(places.picture));
        pixels.into_iter().collect::<std::collections::HashSet<_>>().len()
    }

    fn middle(rect: Rect) -> Rect {
        let inner = Rect::from_center_size(rect.center(), 0.4 * rect.size());
        Rect::from_min_max(inner.min.round(), inner.max.round())
    }

    fn look_at(user: &User, rect: Rect) -> Vec<[u8; 3]> {
        user.look(rect.left() as i16, rect.top() as i16, rect.width() as u16, rect.height() as u16).unwrap()
    }

    /// What was saved is what is on the screen.
    fn compare(user: &User, places: &Places, seen: &Mutex<Seen>, folder: &Path) {
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let path = files.into_iter().find(|path| path.extension().is_some_and(|e| e == "png")).unwrap();
        let saved = tetreel::image::read_png(&path).unwrap();
        // Who holds the button for too long has not clicked; a slow machine sees press and release late, and far apart.
        for _ in 0..10 {
            user.click(places.dismiss.x, places.dismiss.y).unwrap();
            pause(2000);
            if seen.lock().unwrap().notices.is_empty() {
                break;
            }
        }
        until("the message is put away", seen, |seen| seen.notices.is_empty() && seen.is_painted);
        pause(500);
        user.point(places.picture.right() - 3.0, places.picture.bottom() - 3.0).unwrap();
        pause(500);
        let rect = middle(places.picture);
        assert_eq!(saved.width, places.picture.width().round() as usize);
        let screen = look_at(user, rect);
        let columns = rect.width() as usize;
        for (i, ours) in screen.iter().enumerate() {
            let (x, y) = (i % columns + rect.left() as usize, i / columns + rect.top() as usize);
            let theirs =
                saved.pixels[(y - places.picture.top() as usize) * saved.width + x].map(|c| (c * 255.0).round());
            // Both are rounded to 8 bits.
            let is_same = (0..3).all(|c| (f32::from(ours[c]) - theirs[c]).abs() <= 1.0);
            assert!(is_same, "({x}, {y}): {ours:?} on the screen, {theirs:?} in the file");
        }
    }
}

//! The player window, used as a user would: found by name, clicked, dragged, typed at. No window is opened; pictures are
//! drawn by whatever adapter there is, in software too.

use egui::{Key, Rect};
use egui_kittest::kittest::Queryable;
use std::path::Path;
use std::time::{Duration, Instant};
use tetreel::camera::Camera;
use tetreel::pipeline::FrameTime;
use tetreel::playback::{Loop, Mode, StepRange};
use tetreel::ui::{NoticeKind, picture};
use tetreel_ui_tests::desk::{BACKGROUND, Desk, STEPS};

#[test]
fn play_shows_every_step_and_ends_with_the_last() {
    let Some(mut desk) = Desk::open() else { return };
    desk.save("opened.png");
    desk.click("Play");
    assert!(desk.session().state().playing);
    desk.until("the end is reached", |session| session.state().ended);
    assert_eq!(desk.session().shown().unwrap().request.time, FrameTime::from(STEPS - 1));
    desk.click("First step (Home)");
    assert_eq!(desk.step(), 0);
    desk.click("One step on (Right)");
    assert_eq!(desk.step(), 1);
    desk.click("Last step (End)");
    desk.click("One step back (Left)");
    assert_eq!(desk.step(), STEPS - 2);
    desk.click("Play backwards");
    desk.until("the beginning is reached", |session| session.state().ended);
    assert_eq!(desk.step(), 0);
    assert!(desk.session().notices().is_empty());
}

#[test]
fn the_picture_moves_while_frames_come_as_fast_as_they_can() {
    let Some(mut desk) = Desk::open() else { return };
    desk.click("Mode");
    desk.click("as fast as possible");
    desk.click("Loop");
    desk.click("loop all");
    for backend in ["CPU", "GPU"] {
        if backend == "GPU" {
            desk.click("Opacity");
            desk.settle();
            desk.click("Backend");
            desk.click(backend);
            desk.settle();
        }
        desk.press(Key::Space);
        let mut seen = std::collections::BTreeSet::new();
        let begin = Instant::now();
        while begin.elapsed() < Duration::from_secs(60) {
            desk.harness.step();
            let label = desk.harness.get_by(|node| node.label().is_some_and(|label| label.starts_with("Picture of")));
            seen.extend(egui_kittest::kittest::NodeT::accesskit_node(&label).label());
            if seen.len() >= STEPS {
                break;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        let state = desk.session().state();
        let shown = desk.session().shown().unwrap().request.time;
        desk.press(Key::Space);
        assert!(seen.len() > STEPS / 2, "{backend}: {seen:?}; {shown:?} of {state:?}");
    }
}

#[test]
fn the_slider_scrubs_at_once() {
    let Some(mut desk) = Desk::open() else { return };
    let slider = desk.place("Step slider");
    desk.drag(slider.left_center() + egui::vec2(8.0, 0.0), slider.right_center() - egui::vec2(8.0, 0.0));
    assert_eq!(desk.step(), STEPS - 1);
    desk.until("its frame is there", |session| session.shown().unwrap().request.time == FrameTime::from(STEPS - 1));
    desk.harness.get_by_label("Step slider").set_value_accesskit(2.0);
    desk.harness.step();
    desk.harness.step();
    assert_eq!(desk.step(), 2);
}

#[test]
fn keys_and_choices_set_the_clock() {
    let Some(mut desk) = Desk::open() else { return };
    desk.press(Key::ArrowRight);
    assert_eq!(desk.step(), 1);
    desk.press(Key::I);
    desk.press(Key::End);
    desk.press(Key::ArrowLeft);
    desk.press(Key::O);
    assert_eq!(desk.session().state().settings.range, Some(StepRange { a: 1, b: STEPS - 2 }));
    desk.harness.step();
    desk.click("Play all steps");
    assert_eq!(desk.session().state().settings.range, None);
    desk.click("Loop");
    desk.click("ping-pong");
    assert_eq!(desk.session().state().settings.repeat, Loop::PingPong);
    desk.click("Mode");
    desk.click("real time");
    assert_eq!(desk.session().state().settings.mode, Mode::RealTime);
    desk.harness.key_press_modifiers(egui::Modifiers::SHIFT, Key::Questionmark);
    desk.harness.step();
    desk.harness.step();
    desk.harness.step();
    assert!(desk.harness.query_by_label("ten steps back or on").is_some());
    desk.save("help.png");
}

#[test]
fn another_colour_map_is_chosen_and_seen() {
    let Some(mut desk) = Desk::open() else { return };
    let before = desk.session().shown().unwrap().frame.planes.color.clone();
    desk.click("Colour map");
    desk.settle();
    desk.save("colour_maps.png");
    desk.click("inferno");
    assert_eq!(desk.session().function().unwrap().color_map().name(), "inferno");
    desk.until("it is drawn", |session| session.shown().unwrap().frame.planes.color != before);
}

#[test]
fn a_screenshot_is_a_file() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    desk.press(Key::S);
    desk.until("the file is there", |session| !session.notices().is_empty());
    assert_eq!(desk.session().notices()[0].kind, NoticeKind::Done, "{:?}", desk.session().notices());
    let is_png = |path: &Path| path.extension().is_some_and(|e| e == "png");
    let files: Vec<_> = std::fs::read_dir(desk.folder.path()).unwrap().map(|e| e.unwrap().path()).collect();
    let images: Vec<_> = files.iter().filter(|path| is_png(path)).collect();
    assert_eq!(images.len(), 1);
    let image = tetreel::image::read_png(images[0]).unwrap();
    assert_eq!((image.width, image.height), desk.session().shown().unwrap().request.size_px);
    desk.settle();
    desk.save("notice.png");
    desk.click("Dismiss message 1");
    assert!(desk.session().notices().is_empty());
}

#[test]
fn dragging_turns_the_camera_and_a_double_click_resets_it() {
    let Some(mut desk) = Desk::open() else { return };
    let before = desk.session().look().camera;
    let picture = desk.place("Picture of");
    desk.drag(picture.center(), picture.center() + egui::vec2(80.0, 20.0));
    let turned = desk.session().look().camera;
    assert!(turned.position != before.position && turned.focal_point == before.focal_point);
    desk.press(Key::R);
    assert_eq!(desk.session().look().camera, before);
    desk.harness.hover_at(picture.center());
    desk.harness.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Line,
        delta: egui::vec2(0.0, 3.0),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Unknown,
        modifiers: egui::Modifiers::NONE,
    });
    (0..10).for_each(|_| desk.harness.step());
    let nearer = desk.session().look().camera;
    let distance = |camera: &Camera| (camera.position - camera.focal_point).length();
    assert!(distance(&nearer) < 0.95 * distance(&before));
}

/// Nothing is written there, whatever fonts there are.
fn middle(rect: Rect) -> Rect {
    Rect::from_center_size(rect.center(), 0.4 * rect.size())
}

#[test]
fn the_window_shows_the_pixels_of_the_frame_over_the_background() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let shown = desk.session().shown().unwrap().clone();
    let expected = picture::over_background(&shown.frame.planes.color.pixels, BACKGROUND);
    // The texture is 8 bits, sampled at its own pixels; a unit for rounding on the way.
    assert_shows(&mut desk, &expected, 1);
}

#[test]
fn a_frame_that_is_rendered_on_the_gpu_of_the_window_is_shown_from_there() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let on_cpu = desk.session().shown().unwrap().clone();
    use_gpu(&mut desk);
    desk.until("it is rendered", |session| session.shown().is_some_and(|shown| shown.frame.stats.on_gpu));
    desk.settle();
    let shown = desk.session().shown().unwrap();
    assert!(shown.frame.texture.is_some() && shown.frame.planes.color.pixels.is_empty(), "nothing was read back");
    let expected = picture::over_background(&on_cpu.frame.planes.color.pixels, BACKGROUND);
    // GPU and CPU agree to 1e-3 (docs/accuracy.md), half precision to 2^-11, and both are rounded to 8 bits: less than
    // two units.
    assert_shows(&mut desk, &expected, 2);

    // A picture that is saved has the size of the screen and is that of the CPU.
    desk.press(Key::S);
    desk.until("the file is there", |session| !session.notices().is_empty());
    let files = std::fs::read_dir(desk.folder.path()).unwrap().map(|e| e.unwrap().path());
    let saved = files.into_iter().find(|path| path.extension().is_some_and(|e| e == "png")).unwrap();
    let saved = tetreel::image::read_png(&saved).unwrap();
    assert_eq!((saved.width, saved.height), on_cpu.request.size_px);
    for (ours, theirs) in saved.pixels.iter().zip(&expected) {
        let is_close = (0..3).all(|c| (ours[c] * 255.0 - f32::from(theirs[c])).abs() <= 2.0);
        assert!(is_close, "{ours:?} is not {theirs:?}");
    }
    desk.until("frames stay on the GPU again", |session| {
        session.shown().is_some_and(|shown| shown.frame.texture.is_some())
    });
}

#[test]
fn a_gpu_that_is_lost_leaves_the_pictures_to_another_device() {
    let Some(mut desk) = Desk::open() else { return };
    use_gpu(&mut desk);
    desk.until("it is on the GPU", |session| session.shown().is_some_and(|shown| shown.frame.texture.is_some()));
    let texture = desk.session().shown().unwrap().frame.texture.clone().unwrap();
    texture.context().lose();
    desk.press(Key::ArrowRight);
    desk.until("the next step is there", |session| {
        session.shown().is_some_and(|shown| shown.request.time == FrameTime::from(1))
    });
    let shown = desk.session().shown().unwrap();
    assert!(shown.frame.texture.is_none() && !shown.frame.planes.color.pixels.is_empty(), "it came through the CPU");
}

/// Chooses the GPU, in a part of the panel below others.
fn use_gpu(desk: &mut Desk) {
    desk.click("Opacity");
    desk.settle();
    desk.click("Backend");
    desk.click("GPU");
}

/// The middle of the picture has these colours, each up to `tolerance`, once the box of the mesh is hidden.
fn assert_shows(desk: &mut Desk, expected: &[[u8; 4]], tolerance: u8) {
    if desk.harness.query_by_label("Curve or shapes").is_some() {
        desk.click("Opacity");
        desk.settle();
    }
    desk.click("box");
    desk.settle();
    let (width, height) = desk.session().shown().unwrap().request.size_px;
    let rect = desk.place("Picture of");
    assert_eq!((rect.width().round() as usize, rect.height().round() as usize), (width, height));
    let image = desk.harness.render().unwrap();
    let inner = middle(rect);
    let (mut compared, mut colours) = (0, std::collections::BTreeSet::new());
    for y in inner.top() as u32..inner.bottom() as u32 {
        for x in inner.left() as u32..inner.right() as u32 {
            let place = (y as usize - rect.top() as usize) * width + x as usize - rect.left() as usize;
            let (ours, theirs) = (image.get_pixel(x, y).0, expected[place]);
            let is_close = (0..3).all(|c| ours[c].abs_diff(theirs[c]) <= tolerance);
            assert!(is_close, "({x}, {y}): {ours:?} is not {theirs:?}");
            compared += 1;
            colours.insert(theirs);
        }
    }
    assert!(compared > 10_000 && colours.len() > 50, "there is something to compare: {compared} {}", colours.len());
}

#[test]
fn a_window_at_rest_is_not_painted() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let passes = |desk: &Desk| desk.harness.ctx.cumulative_pass_nr();
    let before = passes(&desk);
    std::thread::sleep(Duration::from_millis(300));
    let delay = desk.harness.output().viewport_output[&egui::ViewportId::ROOT].repaint_delay;
    assert_eq!((delay, passes(&desk)), (Duration::MAX, before));
    assert!(!desk.harness.ctx.has_requested_repaint(), "nobody has woken it either");
}

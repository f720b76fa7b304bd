//! The window exports what it shows.

use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;
use std::path::Path;
use tetreel::image::read_png;
use tetreel::ui::window::Start;
use tetreel_ui_tests::desk::{Desk, options, store};

/// The button in the timeline.
const BUTTON: &str = "Export images or a movie (Ctrl E)";

fn open(size: [f32; 2]) -> Option<Desk> {
    let folder = tempfile::tempdir().unwrap();
    let options = options(folder.path(), Start::Open(vec![store(folder.path())]));
    let mut desk = Desk::with(size, 1.0, options, folder)?;
    desk.begin();
    desk.settle();
    Some(desk)
}

/// Types a text in place of the one in a box.
fn enter(desk: &mut Desk, label: &str, text: &str) {
    desk.click(label);
    desk.press_with(Modifiers::COMMAND, Key::A);
    desk.harness.get_by_label(label).type_text(text);
    desk.harness.step();
}

/// Chooses an entry of a list.
fn choose(desk: &mut Desk, list: &str, entry: &str) {
    desk.click(list);
    desk.until_there(entry);
    desk.click(entry);
    desk.harness.step();
}

fn until_exported(desk: &mut Desk) -> String {
    desk.until("the end of the export", |session| {
        session.exports().progress().is_none() && !session.notices().is_empty()
    });
    desk.session().notices().last().unwrap().text.clone()
}

fn with_preview(desk: &mut Desk) {
    desk.until_there("Preview of the export");
    desk.settle();
}

#[test]
fn a_picture_of_the_moment_and_images_of_steps_are_exported_from_the_dialog() {
    let Some(mut desk) = open([800.0, 600.0]) else { return };
    desk.click(BUTTON);
    with_preview(&mut desk);
    desk.save("export_moment.png");
    let path = desk.folder.path().join("out.png");
    enter(&mut desk, "File of the export", path.to_str().unwrap());
    enter(&mut desk, "Width of the export", "80");
    desk.press(Key::Enter);
    enter(&mut desk, "Height of the export", "60");
    desk.press(Key::Enter);
    desk.click("Legend in the export");
    desk.until_there("1 frame");
    let choices = desk.session().exports().choices().unwrap().clone();
    assert_eq!((choices.legend, choices.size_px), (true, (80, 60)));
    desk.click("Export");
    let text = until_exported(&mut desk);
    assert!(text.starts_with("wrote ") && text.ends_with("out.png"), "{text}");
    let image = read_png(&path).unwrap();
    assert_eq!((image.width, image.height), (80, 60));
    assert_eq!(desk.session().changes(), (0, 0), "what is shown has not changed");
    desk.click("Export");
    desk.until("a refusal", |session| session.notices().iter().any(|notice| notice.text.contains("of that name")));
    desk.settle();
    desk.save("export_refused.png");
    choose(&mut desk, "Frames of the export", "steps");
    desk.until_there("6 frames");
    assert!(desk.session().exports().choices().unwrap().file.ends_with("out_%04d.png"));
    enter(&mut desk, "Steps of the export", "0..4:2");
    desk.until_there("3 frames");
    with_preview(&mut desk);
    desk.save("export_steps.png");
    let images = desk.folder.path().join("s_%d.png");
    enter(&mut desk, "File of the export", images.to_str().unwrap());
    desk.press(Key::Enter);
    desk.until("images", |session| session.notices().iter().any(|notice| notice.text.starts_with("wrote 3 frames")));
    assert!((0..3).all(|n| desk.folder.path().join(format!("s_{n}.png")).is_file()));
    enter(&mut desk, "Steps of the export", "9..");
    desk.until("a problem", |session| session.exports().frames().is_some_and(|frames| frames.is_err()));
    desk.settle();
    desk.save("export_problem.png");
}

/// Begins to export large images; the dialog is open.
fn begin_large(desk: &mut Desk, name: &str) {
    desk.press_with(Modifiers::CTRL, Key::E);
    with_preview(desk);
    choose(desk, "Frames of the export", "steps");
    let file = desk.folder.path().join(name);
    enter(desk, "File of the export", file.to_str().unwrap());
    choose(desk, "Size of the export", "3840 x 2160");
    // More frames than there are steps, so that it does not end before it is cancelled.
    enter(desk, "Duration of the export", "60");
    desk.click("Export");
    desk.until_there("Cancel");
}

#[test]
fn an_export_goes_on_when_the_dialog_is_closed_and_is_cancelled_in_the_timeline() {
    let Some(mut desk) = open([800.0, 600.0]) else { return };
    begin_large(&mut desk, "f_%04d.png");
    desk.save("export_progress.png");
    desk.press(Key::Escape);
    desk.harness.step();
    assert!(!desk.session().exports().is_open());
    desk.until_there("Cancel the export");
    desk.save("export_timeline.png");
    desk.click("Cancel the export");
    let text = until_exported(&mut desk);
    let is_whole = |name: &Path| read_png(&desk.folder.path().join(name)).is_ok();
    let images: Vec<_> = std::fs::read_dir(desk.folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(images.iter().filter(|path| path.extension().is_some_and(|e| e == "png")).all(|path| is_whole(path)));
    assert!(text.contains("cancelled"), "{text}");
    desk.press_with(Modifiers::CTRL, Key::E);
    desk.until_there("Resume");
    desk.save("export_resume.png");
}

#[test]
fn the_dialog_fits_small_windows() {
    for [width, height] in [[640.0, 480.0], [800.0, 600.0]] {
        let Some(mut desk) = open([width, height]) else { return };
        desk.press_with(Modifiers::CTRL, Key::E);
        with_preview(&mut desk);
        choose(&mut desk, "Frames of the export", "steps");
        enter(&mut desk, "File of the export", "/nowhere/f_%02d.exr");
        with_preview(&mut desk);
        desk.save(&format!("export_{width}.png"));
        let window = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height));
        for name in ["Export", "Close", "Frames of the export", "Size of the export"] {
            let place = desk.harness.get_all_by_label(name).last().unwrap().rect();
            assert!(window.contains_rect(place), "{name}: {place:?}");
        }
        desk.click("Close");
        assert!(!desk.session().exports().is_open());
    }
}

#[test]
fn who_leaves_while_an_export_is_under_way_is_asked() {
    let Some(mut desk) = open([800.0, 600.0]) else { return };
    begin_large(&mut desk, "g_%04d.png");
    desk.press(Key::Escape);
    desk.harness.step();
    let root = egui::ViewportId::ROOT;
    let ask = |desk: &mut Desk| {
        let viewport = desk.harness.input_mut().viewports.entry(root).or_default();
        viewport.events.push(egui::ViewportEvent::Close);
        desk.harness.step();
    };
    ask(&mut desk);
    desk.until_there("Stay here");
    desk.save("export_leave.png");
    assert!(desk.harness.query_by_label("Unsaved changes").is_none());
    desk.click("Stay here");
    desk.harness.step();
    assert!(desk.harness.query_by_label("Stay here").is_none());
    ask(&mut desk);
    desk.until_there("Leave");
    desk.click("Leave");
    desk.harness.step();
    assert!(desk.harness.query_by_label("Leave").is_none());
}

//! Keys on the timeline, the quality, and cameras with names.

use egui::{Key, Rect};
use egui_kittest::kittest::{NodeT, Queryable};
use std::path::Path;
use std::sync::Arc;
use tetreel::pipeline::{RenderMode, Series};
use tetreel::playback::quality::Family;
use tetreel::project::Project;
use tetreel::timeline::Transition;
use tetreel::ui::tracks::{KeyValue, Track, TrackKey};
use tetreel::ui::window::{Dressed, Start, WindowOptions};
use tetreel_ui_tests::desk::{Desk, STEPS, options, store};

fn keys(desk: &Desk, track: Track) -> Vec<TrackKey> {
    track.keys(desk.session().project())
}

fn times(desk: &Desk) -> Vec<f64> {
    desk.session().series().times().values.clone()
}

/// Adds what is shown as a key of a track.
fn add(desk: &mut Desk, track: &str) {
    desk.click("Add key");
    desk.settle();
    desk.click(track);
    desk.settle();
}

#[test]
fn a_key_is_added_dragged_typed_and_undone() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let without_keys = desk.place("Step slider");
    desk.click("Add key");
    desk.settle();
    desk.save("keys_menu.png");
    desk.click("level of detail");
    desk.settle();
    desk.press(Key::End);
    desk.settle();
    add(&mut desk, "level of detail");
    let times = times(&desk);
    let last = times[STEPS - 1];
    let at = |desk: &Desk| keys(desk, Track::Lod).iter().map(|key| key.time).collect::<Vec<_>>();
    assert_eq!(at(&desk), [times[0], last]);
    assert!(desk.place("Step slider").top() < without_keys.top(), "the tracks have room");
    desk.save("keys.png");

    let (from, first) = (desk.place("Key 2 of level").center(), desk.place("Key 1 of level").center());
    let changes = desk.session().changes().0;
    // A little beside the third step.
    let to = egui::pos2(egui::lerp(first.x..=from.x, 3.0 / (STEPS - 1) as f32) + 7.0, from.y);
    desk.drag(from, to);
    desk.settle();
    assert_eq!((at(&desk), desk.session().changes().0), (vec![times[0], times[3]], changes + 1));
    desk.drag(to, first - egui::vec2(30.0, 0.0));
    desk.settle();
    assert_eq!(at(&desk), [times[0], times[1]], "it does not pass the first one");
    desk.click("Undo");
    desk.click("Undo");
    desk.settle();
    assert_eq!(at(&desk), [times[0], last]);

    // A click goes to the time of the key.
    let first = desk.place("Key 1 of level").center();
    desk.harness.drag_at(first);
    desk.harness.step();
    desk.harness.drop_at(first);
    desk.settle();
    assert_eq!(desk.step(), 0);
    desk.harness.get_by_label("Value of the key").set_value_accesskit(25.0);
    desk.settle();
    assert_eq!(keys(&desk, Track::Lod)[0].value, KeyValue::Number(0.25));
    desk.harness.get_by_label("Time of the key").set_value_accesskit(0.5 * times[1] + 0.5 * times[0]);
    desk.settle();
    assert_eq!(at(&desk)[0], 0.5 * times[1] + 0.5 * times[0]);
    desk.click("Copy the key (Ctrl C)");
    desk.press_with(egui::Modifiers::COMMAND, Key::V);
    desk.settle();
    assert_eq!(at(&desk).len(), 3);
    desk.press(Key::Delete);
    desk.settle();
    assert_eq!(at(&desk).len(), 2);
    for _ in 0..20 {
        desk.press_with(egui::Modifiers::COMMAND, Key::Z);
    }
    desk.settle();
    assert!(at(&desk).is_empty() && desk.session().changes().0 == 0);
    assert_eq!(desk.place("Step slider"), without_keys, "as tall as before");
    assert!(desk.session().notices().is_empty(), "{:?}", desk.session().notices());
}

#[test]
fn a_transition_is_a_curve_with_handles() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    add(&mut desk, "camera");
    desk.press(Key::End);
    let middle = desk.place("Picture of").center();
    desk.drag(middle, middle + egui::vec2(80.0, 0.0));
    desk.settle();
    add(&mut desk, "camera");
    assert!(desk.session().follows_path());
    let first = desk.place("Key 1 of camera").center();
    desk.harness.drag_at(first);
    desk.harness.step();
    desk.harness.drop_at(first);
    desk.settle();
    desk.click("Transition to the next key");
    desk.settle();
    desk.click("cubic");
    desk.settle();
    desk.click("curve");
    desk.settle();
    let handles = |desk: &Desk| match keys(desk, Track::Cameras)[0].transition {
        Transition::Cubic { handles } => handles,
        other => panic!("{other:?}"),
    };
    assert_eq!(handles(&desk), [[0.25, 0.1], [0.25, 1.0]]);
    let handle = desk.place("Handle 2 of the curve").center();
    desk.drag(handle, handle + egui::vec2(64.0, 32.0));
    desk.settle();
    let [a, b] = handles(&desk);
    assert!(a == [0.25, 0.1] && (b[0] - 0.75).abs() < 0.02 && (b[1] - 0.75).abs() < 0.02, "{b:?}");
    desk.harness.get_by_label("Handle 1, weight").set_value_accesskit(0.5);
    desk.settle();
    assert_eq!(handles(&desk)[0], [0.25, 0.5]);
    desk.save("keys_curve.png");
    desk.press(Key::Escape);
    desk.settle();
    desk.click("Undo");
    desk.click("Undo");
    desk.settle();
    assert_eq!(handles(&desk), [[0.25, 0.1], [0.25, 1.0]]);
}

#[test]
fn the_quality_is_a_slider_with_a_choice_of_what_is_left_out() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    desk.until_there("Drawn: exact");
    desk.harness.get_by_label("Quality while moving").set_value_accesskit(0.0);
    desk.settle();
    assert_eq!(desk.session().target_fps(), None);
    desk.press(Key::D);
    desk.press(Key::D);
    assert_eq!(desk.session().target_fps(), Some(2.0));
    desk.press(Key::E);
    desk.press(Key::E);
    assert_eq!(desk.session().target_fps(), None);
    desk.click("What is left out for speed");
    desk.settle();
    desk.save("quality.png");
    desk.click("pixels of the image");
    assert_eq!(desk.session().family(), Some(Family::Scaled));
    desk.harness.get_by_label("Level of detail").set_value_accesskit(10.0);
    desk.click("by strata of equal changes");
    desk.harness.get_by_label("Number of intervals of time").set_value_accesskit(3.0);
    desk.harness.step();
    assert_eq!(desk.session().look().faces.sampling.to_string(), "greedy:3");
    desk.press(Key::Escape);
    desk.settle();
    // All cells are drawn in place of faces where that takes no longer.
    assert_eq!((desk.session().look().faces.lod, desk.session().look().mode), (0.1, RenderMode::Auto));
    let drawn = format!("Drawn: {}", desk.session().drawn());
    assert!(desk.harness.query_by_label(&drawn).is_some(), "{drawn}");
}

#[test]
fn a_view_is_kept_under_a_name() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let first = desk.session().camera();
    desk.click("Cameras");
    desk.settle();
    desk.click("Store");
    desk.settle();
    assert_eq!(desk.session().project().cameras[0].camera, first);
    desk.click("Name of the camera");
    desk.harness.get_by_label("Name of the camera").type_text("front");
    desk.harness.step();
    desk.click("Rename the camera view 1 to what is typed above");
    desk.settle();
    desk.save("cameras.png");
    assert_eq!(desk.session().project().cameras[0].name, "front");
    desk.press(Key::Escape);
    desk.press(Key::Escape);
    desk.settle();
    let middle = desk.place("Picture of").center();
    desk.drag(middle, middle + egui::vec2(80.0, 0.0));
    desk.settle();
    assert_ne!(desk.session().camera(), first);
    desk.click("Cameras");
    desk.settle();
    desk.click("front");
    desk.settle();
    assert_eq!(desk.session().camera(), first);
    desk.click("Remove the camera front");
    assert!(desk.session().project().cameras.is_empty());
}

/// Keys of all tracks.
const PROJECT: &str = r#"
version = 1
[data]
source = "tornado.zarr"
[look]
iso = ["-20"]
cut = ["point=0,0,1 normal=0,0,1"]
[[ensembles]]
name = "overview"
[[ensembles.members]]
name = "one"
function = { transfer-function = { color_map = "viridis", points = [[0, 0.1], [1, 0.6]] } }
[[ensembles]]
name = "core"
[[ensembles.members]]
name = "one"
function = { transfer-function = { color_map = "inferno", points = [[0.5, 0.0], [1, 0.9]] } }
[timeline]
lod = [{ time = 0.0, value = 0.5, transition = "smooth" }, { time = 1.0, value = 1.0 }]
optics = [{ time = 0.0, value = "exact" }, { time = 1.0, value = "partial" }]
isovalue = [{ time = -1.0, value = -20.0, transition = { step = { at = 0.3 } } }, { time = 99.0, value = -10.0 }]
iso-opacity = [{ time = 0.5, value = 1.0 }]
cut = [{ time = 0.2, value = 0.0, transition = { cubic = { handles = [[0.5, 0.0], [0.5, 1.0]] } } }, { time = 1.5, value = 1.0 }]
[[timeline.ensembles]]
time = 0.0
value = "overview"
[[timeline.ensembles]]
time = 2.0
value = "core"
[[timeline.maps]]
ensemble = "core"
member = "one"
keys = [{ time = 0.0, value = { points = [[0.5, 0.2]] } }]
[[timeline.cameras]]
time = 0.0
[timeline.cameras.value]
position = [22.0, -28.0, 20.0]
focal_point = [0.0, 0.0, 5.0]
view_up = [0.0, 0.0, 1.0]
near = 0.0
projection = { perspective = { view_angle = 30.0 } }
"#;

#[test]
fn nothing_lies_under_another_thing_in_small_windows() {
    for (width, height) in [(640.0, 480.0), (800.0, 600.0), (1280.0, 720.0)] {
        let folder = tempfile::tempdir().unwrap();
        let project = Arc::new(Project::parse(PROJECT, Path::new("p.toml")).unwrap());
        let plain = options(folder.path(), Start::Open(vec![store(folder.path())]));
        let dress = plain.dress.clone();
        let dress = move |series: &Series| Ok(Dressed { project: Some(project.clone()), ..dress(series)? });
        let options = WindowOptions { dress: Arc::new(dress), ..plain };
        let Some(mut desk) = Desk::with([width, height], 1.0, options, folder) else { return };
        desk.begin();
        desk.settle();
        let key = desk.place("Key 1 of ensemble").center();
        desk.harness.drag_at(key);
        desk.harness.step();
        desk.harness.drop_at(key);
        desk.settle();
        desk.save(&format!("timeline_{width}x{height}.png"));
        let window = Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height));
        let slider = desk.place("Step slider");
        // By the whole name, or how it begins.
        let found = |name: &str| {
            let whole = desk.harness.query_by_label(name);
            let begun =
                || desk.harness.get_by(|node| node.label().or(node.value()).is_some_and(|text| text.starts_with(name)));
            whole.unwrap_or_else(begun).rect()
        };
        let below = |name: &str| (name.to_owned(), found(name));
        let names = [
            "Quality while moving",
            "What is left out for speed",
            "Drawn: ",
            "Add key",
            "First step (Home)",
            "Play",
            "Step",
            "Time",
            "Mode",
            "Loop",
            "Play from here (I)",
            "Side panel",
            "Screenshot (S)",
            "Help (H)",
            "Time of the key",
            "Value of the key",
            "Transition to the next key",
            "Copy the key (Ctrl C)",
            "Copy here",
            "Remove the key (Delete)",
            "Select no key",
            "Key 2 of ensemble",
        ];
        let places: Vec<(String, Rect)> = names.into_iter().map(below).collect();
        for (at, (name, place)) in places.iter().enumerate() {
            assert!(window.contains_rect(*place), "{name} at {place:?} is outside of {width} x {height}");
            for (other, beside) in places.iter().take(at).chain([&("Step slider".to_owned(), slider)]) {
                let shared = place.intersect(*beside);
                assert!(
                    shared.width() < 1.0 || shared.height() < 1.0,
                    "{name} at {place:?} lies under {other} at {beside:?}"
                );
            }
        }
        assert!(desk.place("Picture of").height() > 100.0, "the picture has room");
        let marks = desk.harness.get_by(|node| node.label().is_some_and(|label| label.contains("after the last step")));
        assert!(NodeT::accesskit_node(&marks).label().is_some_and(|label| label.contains("isovalue at 99")));
    }
}

#[test]
fn movements_of_the_camera_are_taken_back_by_key_and_by_button() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let first = desk.session().camera();
    let middle = desk.place("Picture of").center();
    desk.drag(middle, middle + egui::vec2(80.0, 10.0));
    desk.settle();
    let dragged = desk.session().camera();
    assert_ne!(dragged, first);
    desk.press(Key::Backspace);
    assert_eq!(desk.session().camera(), first, "one drag is one movement");
    desk.press_with(egui::Modifiers::SHIFT, Key::Backspace);
    assert_eq!(desk.session().camera(), dragged);
    desk.click("The view before the last movement (Backspace)");
    desk.settle();
    assert_eq!(desk.session().camera(), first);
    desk.click("On to the view after it (Shift Backspace)");
    desk.settle();
    assert_eq!(desk.session().camera(), dragged);
}

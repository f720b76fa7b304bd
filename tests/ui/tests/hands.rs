//! What hands do to the player window, on small screens, too.

use egui::{Key, PointerButton, Pos2, Rect, vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::look::Look;
use tetreel::pipeline::{Backend, RenderMode, Series};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::TransferFunction;
use tetreel::ui::window::{Start, WindowOptions};
use tetreel_ui_tests::desk::{Desk, STEPS, options, store};

/// A window of this size on the small series.
fn desk_of(size: [f32; 2]) -> Option<Desk> {
    let folder = tempfile::tempdir().unwrap();
    let start = Start::Open(vec![store(folder.path())]);
    let mut desk = Desk::with(size, 1.0, options(folder.path(), start), folder)?;
    desk.begin();
    desk.settle();
    Some(desk)
}

/// Another series, whose unit is a long word.
fn long_unit(folder: &Path) -> PathBuf {
    let path = folder.join("slab.zarr");
    let series = generate(&SynthSpec { cells: 2000, steps: STEPS, ..SynthSpec::new(SeriesName::Slab) }).unwrap();
    let units = "kilogram_metres_per_second_squared_and_square_metre_of_surface";
    let units = ["constant", "linear"].map(|field| format!("{field}={units}").parse().unwrap()).to_vec();
    ingest(&series, &path, &IngestOptions { units, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
    path
}

/// The file that is played is changed as a user does it, by the menu.
fn open(desk: &mut Desk, path: &Path) {
    desk.click("Open...");
    desk.settle();
    desk.harness.event(egui::Event::Text(path.to_str().unwrap().to_owned()));
    desk.harness.key_press(Key::Enter);
    desk.harness.step();
    desk.harness.step();
}

#[test]
fn the_last_point_of_the_opacity_curve_is_dragged_though_the_panel_has_a_scroll_bar() {
    for size in [[640.0, 480.0], [1280.0, 800.0]] {
        let Some(mut desk) = desk_of(size) else { return };
        // In the smallest window the curve lies below the sections above it.
        if size[1] < 600.0 {
            ["Field", "Colours"].into_iter().for_each(|section| desk.click(section));
            desk.settle();
        }
        let place = desk.place("Opacity curve of");
        // Colours are below the curve; the last point has 0.6 of 1.
        let curve = Rect::from_min_max(place.min, place.max - vec2(0.0, 12.0)).shrink(4.0);
        let at = |value: f32| Pos2::new(curve.right(), curve.bottom() - value * curve.height());
        // Where the bar is when the mouse is over the panel.
        desk.harness.hover_at(at(0.6) - vec2(20.0, 0.0));
        (0..20).for_each(|_| desk.harness.step());
        desk.drag(at(0.6), at(0.9));
        let last = *desk.session().function().unwrap().points().last().unwrap();
        assert!((last.value - 0.9).abs() < 0.02 && last.position == 1.0, "{size:?}: {last:?}");
    }
}

#[test]
fn a_click_that_is_over_before_the_window_looks_goes_there() {
    let Some(mut desk) = desk_of([1280.0, 800.0]) else { return };
    for (name, share, step) in [("Step slider", 0.4, 2), ("Least, mean and greatest", 0.8, 4), ("Step slider", 1.0, 5)]
    {
        let place = desk.place(name);
        let at = Pos2::new(egui::lerp(place.left() + 8.0..=place.right() - 8.0, share), place.center().y);
        desk.harness.hover_at(at);
        desk.harness.step();
        let button = |pressed| {
            let (button, modifiers) = (PointerButton::Primary, egui::Modifiers::NONE);
            egui::Event::PointerButton { pos: at, button, pressed, modifiers }
        };
        // Both in one pass.
        desk.harness.input_mut().events.extend([true, false].map(button));
        desk.harness.step();
        desk.harness.step();
        assert_eq!(desk.step(), step, "{name}");
    }
}

#[test]
fn a_path_is_typed_at_once_and_its_letters_are_no_shortcuts() {
    let Some(mut desk) = desk_of([1280.0, 800.0]) else { return };
    let (look, playing) = (desk.session().look().clone(), desk.session().state().playing);
    desk.click("Open...");
    for (key, letter) in [(Key::S, "s"), (Key::X, "x"), (Key::I, "i"), (Key::Space, " "), (Key::ArrowRight, "")] {
        desk.harness.key_press(key);
        if !letter.is_empty() {
            desk.harness.event(egui::Event::Text(letter.to_owned()));
        }
        desk.harness.step();
    }
    desk.settle();
    let typed = desk.harness.get_by_label("Path to open").accesskit_node().value();
    assert_eq!(typed.as_deref(), Some("sxi "));
    assert_eq!((desk.session().look(), desk.session().state().playing, desk.step()), (&look, playing, 0));
    assert!(desk.session().notices().is_empty() && desk.session().state().settings.range.is_none());
}

#[test]
fn the_field_of_the_command_line_is_that_of_the_first_file_only() {
    let folder = tempfile::tempdir().unwrap();
    let (first, other) = (store(folder.path()), long_unit(folder.path()));
    let mut options = options(folder.path(), Start::Open(vec![first]));
    options.opening.field = Some("velocity:mag".parse().unwrap());
    let Some(mut desk) = Desk::with([1280.0, 800.0], 1.0, options, folder) else { return };
    desk.begin();
    assert_eq!(desk.session().series().field().name, "velocity:mag");
    open(&mut desk, &other);
    desk.until("the other file is open", |session| session.store().fields().iter().any(|f| f.name == "linear"));
}

#[test]
fn all_of_the_help_can_be_seen_on_a_small_screen() {
    for size in [[640.0, 480.0], [800.0, 600.0]] {
        let Some(mut desk) = desk_of(size) else { return };
        let screen = Rect::from_min_size(Pos2::ZERO, size.into()).expand(0.5);
        desk.press(Key::H);
        desk.settle();
        let is_seen = |desk: &Desk, text: &str| screen.contains_rect(desk.place_of(text));
        assert!(is_seen(&desk, "play or pause") && is_seen(&desk, "Keys and mouse"), "{size:?}");
        desk.harness.hover_at(screen.center());
        for _ in 0..40 {
            desk.harness.event(egui::Event::MouseWheel {
                unit: egui::MouseWheelUnit::Line,
                delta: vec2(0.0, -3.0),
                phase: egui::TouchPhase::Move,
                source: egui::MouseWheelSource::Unknown,
                modifiers: egui::Modifiers::NONE,
            });
        }
        desk.settle();
        assert!(is_seen(&desk, "follow the point over time"), "{size:?}");
        assert!(is_seen(&desk, "Keys and mouse"), "{size:?}: it can be closed");
        desk.save(&format!("help_{}.png", size[0]));
    }
}

#[test]
fn the_picture_keeps_its_size_whatever_the_panel_shows() {
    let folder = tempfile::tempdir().unwrap();
    let start = Start::Open(vec![long_unit(folder.path())]);
    let Some(mut desk) = Desk::with([1280.0, 1600.0], 1.0, options(folder.path(), start), folder) else { return };
    desk.begin();
    desk.settle();
    let place = desk.place("Picture of");
    assert!((place.width() - (1280.0 - 250.0)).abs() < 1.0, "the panel is as wide as it should be: {place:?}");
    let check = |desk: &mut Desk, what: &str| {
        desk.settle();
        assert_eq!(desk.place("Picture of"), place, "{what}");
    };
    desk.click("Points as numbers");
    check(&mut desk, "points as numbers");
    desk.harness.hover_at(place.center());
    desk.until("the value is known", |session| session.hover().is_some());
    desk.harness.drag_at(place.center());
    desk.harness.drop_at(place.center());
    desk.until("a point is picked", |session| session.picked().and_then(|p| p.curve).is_some_and(|c| c.done == STEPS));
    check(&mut desk, "a point");
    desk.click("Field to show");
    desk.settle();
    desk.click("linear");
    desk.until("the field is there", |session| session.series().field().name == "linear");
    check(&mut desk, "another field");
    for (combo, choice) in [("Range of the colours", "symmetric about 0"), ("Renderer", "reference (float64, slow)")] {
        desk.click(combo);
        desk.settle();
        desk.click(choice);
        // Frames of the reference take their time.
        (0..20).for_each(|_| desk.harness.step());
        assert_eq!(desk.place("Picture of"), place, "{choice}");
    }
    desk.save("long_unit.png");
}

#[test]
fn the_statistics_say_which_share_of_the_faces_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let start = Start::Open(vec![store(folder.path())]);
    let dress = |series: &Series| {
        let look = Look::default_for(series, TransferFunction::parse("viridis@0:0.1,1:0.6").unwrap()).unwrap();
        let faces = tetreel::pipeline::FaceDetail { lod: 0.2, ..look.faces };
        Ok(Look { mode: RenderMode::Havs, backend: Backend::Cpu, faces, ..look }.into())
    };
    let options = WindowOptions { dress: Arc::new(dress), ..options(folder.path(), start) };
    let Some(mut desk) = Desk::with([1280.0, 1400.0], 1.0, options, folder) else { return };
    desk.begin();
    desk.settle();
    let stats = &desk.session().shown().unwrap().frame.stats;
    let (drawn, total) = (stats.faces_drawn, stats.faces_total);
    let share = 100.0 * drawn as f64 / total as f64;
    assert!((share - 20.0).abs() > 1.0, "the case is told from the level: {share}");
    let said = format!("{drawn} of {total} ({share:.1} %)");
    assert!(desk.harness.query_by_label(&said).is_some(), "{said}");
    // The names of the curves are not over them.
    let plot = desk.place("Milliseconds of decode");
    for name in ["decode", "order", "render"] {
        let names: Vec<Rect> = desk.harness.query_all_by_label(name).map(|node| node.rect()).collect();
        let beside = |rect: &&Rect| !plot.intersects(**rect) && rect.bottom() <= plot.top();
        assert_eq!(names.iter().filter(beside).count(), 1, "{name}: {names:?} {plot:?}");
    }
}

//! Two figures of Callahan's dissertation (*Adaptive Visualization of Dynamic Unstructured Meshes*, University of Utah, 2008, chapter 7),
//! made in the window as a user makes them who has read the guide: no file is edited.
//!
//! With `TETREEL_FIGURES=FOLDER` they are made on `FOLDER/torso.zarr` and `FOLDER/jet.zarr`, and end there as movies and pictures.

use egui::{Key, Modifiers, Pos2, Rect, pos2};
use egui_kittest::kittest::Queryable;
use std::path::{Path, PathBuf};
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::project::Project;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::timeline::At;
use tetreel::transfer::Space;
use tetreel::ui::tracks::Track;
use tetreel::ui::window::Start;
use tetreel_ui_tests::desk::{Desk, options};

/// Steps of the generated series.
const STEPS: usize = 8;

/// Where figures of real series are wanted.
fn figures() -> Option<PathBuf> {
    std::env::var_os("TETREEL_FIGURES").map(PathBuf::from)
}

/// A window on a series, which is generated unless the real one is there.
fn open(real: &str, name: SeriesName) -> Option<Desk> {
    let folder = tempfile::tempdir().unwrap();
    let path = figures().map(|figures| figures.join(real)).unwrap_or_else(|| {
        let path = folder.path().join(real);
        let series = generate(&SynthSpec { cells: 4000, steps: STEPS, ..SynthSpec::new(name) }).unwrap();
        ingest(&series, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        path
    });
    let options = options(folder.path(), Start::Open(vec![path]));
    let mut desk = Desk::with([1280.0, 1000.0], 1.0, options, folder)?;
    desk.begin();
    desk.settle();
    Some(desk)
}

fn choose(desk: &mut Desk, list: &str, entry: &str) {
    desk.click(list);
    desk.until_there(entry);
    desk.click(entry);
    desk.settle();
}

fn enter(desk: &mut Desk, label: &str, text: &str) {
    desk.click(label);
    desk.press_with(Modifiers::COMMAND, Key::A);
    desk.harness.get_by_label(label).type_text(text);
    desk.press(Key::Enter);
    desk.settle();
}

/// The point of positions 0..=1 in the picture of the editor: it has a margin, and a curve has colours below it.
fn on(rect: Rect, [x, y]: [f64; 2], colors: f32) -> Pos2 {
    let inner = rect.with_max_y(rect.bottom() - colors).shrink(4.0);
    pos2(egui::lerp(inner.x_range(), x as f32), egui::lerp(inner.bottom()..=inner.top(), y as f32))
}

/// Raises or lowers the curve: a click adds a point, a drag moves it.
fn draw_curve(desk: &mut Desk, points: &[[f64; 2]]) {
    for &point in points {
        let curve = desk.place("Opacity curve");
        let at = on(curve, point, 12.0);
        desk.harness.hover_at(at);
        desk.harness.step();
        desk.harness.drag_at(at);
        desk.harness.step();
        desk.harness.drop_at(at);
        desk.settle();
    }
}

/// Takes the series' figure, or looks at nothing.
fn figure(desk: &mut Desk, name: &str) {
    if let Some(figures) = figures() {
        desk.harness.render().unwrap().save(figures.join(name)).unwrap();
    }
}

/// Saves the project through the window, reads it again, and exports frames from the window.
fn save_and_export(desk: &mut Desk, name: &str) -> (Project, usize) {
    let folder = figures().unwrap_or_else(|| desk.folder.path().to_owned());
    let file = folder.join(format!("{name}.toml"));
    let _ = std::fs::remove_file(&file);
    desk.click("Save...");
    desk.settle();
    enter(desk, "Path of the project file", file.to_str().unwrap());
    desk.until("it is saved", |session| !session.is_saving() && session.project_file().is_some());
    desk.settle();
    let saved = Project::read(&file).unwrap();
    let is_movie = figures().is_some();
    let output = folder.join(if is_movie { format!("{name}.mp4") } else { format!("{name}_%02d.png") });
    let _ = std::fs::remove_file(&output);
    desk.press(Key::Escape);
    desk.press_with(Modifiers::CTRL, Key::E);
    desk.until_there("Preview of the export");
    choose(desk, "Frames of the export", "steps");
    enter(desk, "File of the export", output.to_str().unwrap());
    let before = desk.session().notices().len();
    if desk.session().exports().progress().is_none() && before == 0 {
        desk.click("Export");
    }
    let begun = std::time::Instant::now();
    while desk.session().exports().progress().is_some() || desk.session().notices().is_empty() {
        desk.harness.step();
        assert!(begun.elapsed().as_secs() < 600, "the export does not end");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let text = desk.session().notices().last().unwrap().text.clone();
    assert!(text.starts_with("wrote"), "{text}");
    let count = |folder: &Path| {
        let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|file| file.starts_with(&format!("{name}_")) && file.ends_with(".png")).count()
    };
    (saved, if is_movie { STEPS } else { count(&folder) })
}

fn picture(desk: &Desk) -> Vec<[f32; 4]> {
    desk.session().shown().unwrap().frame.planes.color.pixels.clone()
}

#[test]
fn figure_7_1_potentials_by_a_curve_changes_over_time_by_a_shape_both_together_and_a_stretched_range() {
    let Some(mut desk) = open("torso.zarr", SeriesName::Dipole) else { return };
    // (a) A curve over the scalars: both signs.
    choose(&mut desk, "Range of the colours", "symmetric about 0");
    choose(&mut desk, "Colour map", "cool-to-warm");
    desk.click("Field");
    desk.settle();
    draw_curve(&mut desk, &[[0.3, 0.1], [0.5, 0.01], [0.7, 0.1]]);
    let a = picture(&desk);
    figure(&mut desk, "torso_a.png");
    // (b) A member over scalar and CoV, as a shape where much changes.
    desk.click("Project");
    desk.settle();
    desk.click("Add a member");
    desk.settle();
    choose(&mut desk, "Quantities", "over scalar and CoV");
    desk.until("a histogram", |session| session.histogram().is_some_and(|shown| shown.kind == Space::ScalarCov));
    desk.click("Use the member colours");
    desk.settle();
    let b = picture(&desk);
    figure(&mut desk, "torso_b.png");
    // (c) Both, blended.
    desk.click("Use the member colours");
    choose(&mut desk, "Colours of the ensemble", "colours by opacity");
    let c = picture(&desk);
    figure(&mut desk, "torso_c.png");
    // (d) The range of the first one remapped.
    desk.click("colours");
    desk.settle();
    desk.click("Axis and units");
    desk.settle();
    desk.until("a histogram", |session| session.histogram().is_some_and(|shown| shown.kind == Space::Scalar));
    desk.click("Equalise");
    desk.settle();
    let d = picture(&desk);
    figure(&mut desk, "torso_d.png");
    let all = [&a, &b, &c, &d];
    for (i, one) in all.iter().enumerate() {
        assert!(one.iter().any(|pixel| pixel[3] > 0.05), "figure {i} shows nothing");
        assert!(all[..i].iter().all(|other| other != one), "figure {i} is that of another");
    }
    let (saved, frames) = save_and_export(&mut desk, "torso");
    let members = &saved.ensembles[0].members;
    assert_eq!((members.len(), members[1].space, frames), (2, Space::ScalarCov, STEPS));
    assert!(members[0].map.points().len() > 2);
}

#[test]
fn figure_7_7_the_focus_moves_from_one_curve_to_another_by_two_keys() {
    let Some(mut desk) = open("jet.zarr", SeriesName::Jet) else { return };
    desk.click("Project");
    desk.click("Field");
    desk.settle();
    // The first ensemble is shown at the beginning.
    enter(&mut desk, "Name of the ensemble", "early");
    draw_curve(&mut desk, &[[0.2, 0.3], [0.4, 0.01]]);
    desk.click("Add key");
    desk.settle();
    desk.click("ensemble");
    desk.settle();
    // The second one at the end: a copy with another curve and other colours.
    desk.press(Key::End);
    desk.settle();
    desk.click("Copy the ensemble");
    desk.settle();
    desk.click("early 2");
    desk.settle();
    enter(&mut desk, "Name of the ensemble", "late");
    choose(&mut desk, "Colour map", "inferno");
    draw_curve(&mut desk, &[[0.6, 0.4], [0.8, 0.5]]);
    desk.click("Add key");
    desk.settle();
    desk.click("ensemble");
    desk.settle();
    let keys = Track::Ensembles.keys(desk.session().project());
    assert_eq!(keys.len(), 2, "{keys:?}");
    // Scrubbing shows one, a mixture, the other.
    let mut seen = Vec::new();
    let last = desk.session().state().steps - 1;
    desk.press(Key::Home);
    desk.settle();
    for step in 0..=last {
        if step == 0 || step == last / 2 || step == last {
            figure(&mut desk, &format!("jet_{step}.png"));
            let at = desk.session().series().times().values[step];
            seen.push(match desk.session().project().timeline.ensembles.at(at) {
                Some(At::One(name)) => name.clone(),
                Some(At::Between { a, b, .. }) => format!("{a} and {b}"),
                None => "none".to_owned(),
            });
        }
        if step < last {
            desk.press(Key::ArrowRight);
            desk.settle();
        }
    }
    assert_eq!(seen, ["early", "early and late", "late"]);
    let (saved, frames) = save_and_export(&mut desk, "jet");
    assert_eq!((saved.ensembles.len(), saved.timeline.ensembles.keys().len(), frames), (2, 2, STEPS));
    assert!(saved.ensembles.iter().all(|ensemble| ensemble.members.len() == 1));
}

//! The pictures of `docs/guide.md`: what a user sees on the tour. They are compared with what is drawn now; after a change that
//! is wanted, `UPDATE_SNAPSHOTS=1 cargo test -p tetreel-ui-tests --test guide` makes them anew.

use egui::{Key, Modifiers};
use egui_kittest::SnapshotOptions;
use egui_kittest::kittest::Queryable;
use std::sync::Arc;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::look::Look;
use tetreel::pipeline::{Backend, Series};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::TransferFunction;
use tetreel::ui::window::{Start, WindowOptions};
use tetreel_ui_tests::desk::{Desk, options};

/// As `tetreel demo` has it, but coarser.
const TRANSFER_FUNCTION: &str = "cool-to-warm@0:0.008,0.04:0.004,0.15:0.02,0.4:0.05,0.6:0.15,0.8:0.65,1:0.95";
const STEPS: usize = 24;
/// The step that is shown.
const STEP: usize = 14;

fn open() -> Option<Desk> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jet.zarr");
    let series = generate(&SynthSpec { cells: 60_000, steps: STEPS, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    ingest(&series, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
    let dress = |series: &Series| {
        let tf = TransferFunction::parse(TRANSFER_FUNCTION).unwrap();
        let look = Look { backend: Backend::Cpu, ..Look::default_for(series, tf).unwrap() };
        let camera = tetreel::camera::Camera::parse("angle=20", &look.camera).unwrap();
        Ok(Look { camera, ..look }.into())
    };
    let start = Start::Open(vec![path]);
    let background = Some([0.086, 0.094, 0.114]);
    let options = WindowOptions { dress: Arc::new(dress), background, ..options(folder.path(), start) };
    let mut desk = Desk::with([1280.0, 800.0], 1.0, options, folder)?;
    desk.begin();
    desk.until("all steps were looked at", |session| session.survey().is_over);
    for _ in 0..STEP {
        desk.press(Key::ArrowRight);
    }
    desk.until("the step is shown", |session| session.shown().is_some_and(|shown| shown.request.time.step() == STEP));
    desk.settle();
    Some(desk)
}

/// Compares with the picture of the guide. Other drivers blend and round differently: a pixel in two thousand may look
/// different, and none of a text that has moved.
fn shot(desk: &mut Desk, name: &str) {
    let options = SnapshotOptions::new().output_path("../../docs/images").threshold(1.0).max_failed_pixels(500_usize);
    desk.harness.snapshot_options(name, &options);
}

#[test]
fn the_tour() {
    let Some(mut desk) = open() else { return };
    shot(&mut desk, "guide_overview");

    let middle = desk.place("Picture of").center();
    desk.harness.hover_at(middle);
    desk.until("the value is known", |session| session.hover().is_some());
    desk.harness.drag_at(middle);
    desk.harness.step();
    desk.harness.drop_at(middle);
    desk.harness.step();
    desk.harness.hover_at(middle + egui::vec2(0.5, 0.0));
    desk.until("its curve is known", |session| {
        session.picked().and_then(|picked| picked.curve).is_some_and(|curve| curve.done == STEPS)
    });
    desk.settle();
    shot(&mut desk, "guide_point");
    desk.harness.hover_at(egui::pos2(5.0, 300.0));

    let slider = desk.place("Step slider");
    desk.harness.hover_at(egui::pos2(egui::lerp(slider.x_range(), 0.35), slider.center().y));
    desk.until_there("Small picture of the step");
    desk.settle();
    shot(&mut desk, "guide_timeline");
    desk.harness.hover_at(egui::pos2(5.0, 300.0));

    desk.click("Colour map");
    desk.settle();
    shot(&mut desk, "guide_colours");
    desk.press(Key::Escape);
    desk.settle();

    desk.harness.key_press_modifiers(Modifiers::SHIFT, Key::Questionmark);
    desk.settle();
    assert!(desk.harness.query_by_label("ten steps back or on").is_some());
    shot(&mut desk, "guide_keys");
    desk.press(Key::Escape);

    desk.click("Second view");
    desk.settle();
    desk.click("Same data");
    desk.settle();
    desk.click("Colour map");
    desk.settle();
    desk.click("inferno");
    desk.harness.hover_at(egui::pos2(5.0, 795.0));
    desk.settle();
    shot(&mut desk, "guide_views");
}

#[test]
fn nothing_is_open_yet() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut desk) = Desk::with([900.0, 560.0], 1.0, options(folder.path(), Start::Nothing), folder) else {
        return;
    };
    desk.harness.step();
    desk.harness.step();
    shot(&mut desk, "guide_welcome");
}

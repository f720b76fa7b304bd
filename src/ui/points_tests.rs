//! Cells as points, in a session.

use super::desk::{Desk, slow};
use super::worker::tests::wait_for;
use super::*;
use crate::ingest::{IngestOptions, ingest};
use crate::look::Look;
use crate::mesh::ConnectivityChoice;
use crate::pipeline::{Backend, RenderMode, Series};
use crate::playback::Command;
use crate::playback::quality::{Family, Quality};
use crate::render::points::{Compositing, Footprint, PointStyle};
use crate::store::Store;
use crate::synth::{SeriesName, SynthSpec, generate};
use crate::task::{Cancel, Silent};
use crate::transfer::TransferFunction;
use glam::DVec2;
use std::path::Path;
use std::sync::Arc;

fn drawn_style(desk: &Desk) -> PointStyle {
    desk.shown().request.tets().unwrap().draw.drawn_by().points().expect("points")
}

#[test]
fn the_style_of_points_is_drawn_said_and_undone() {
    let mut desk = Desk::open();
    desk.act(Action::Backend(Backend::Cpu));
    desk.act(Action::Renderer(RenderMode::Points));
    desk.settle();
    assert_eq!((drawn_style(&desk), desk.session.drawn()), (PointStyle::EXACT, "exact".to_owned()));
    let style = PointStyle {
        footprint: Footprint::Ellipse,
        compositing: Compositing::Gap,
        radius: 0.5,
        exact_order: false,
        ..PointStyle::EXACT
    };
    desk.act(Action::Points(style));
    desk.settle();
    assert_eq!((drawn_style(&desk), desk.session.drawn()), (style, "all drawn".to_owned()));
    desk.act(Action::LevelOfDetail(0.5));
    desk.settle();
    assert_eq!((drawn_style(&desk).lod, desk.session.drawn()), (0.5, "points: 50 %".to_owned()));
    for radius in [0.0, -1.0, 8.5, f64::NAN] {
        desk.act(Action::Points(PointStyle { radius, ..style }));
    }
    assert_eq!(desk.session.look().points, style);
    desk.act(Action::Undo);
    desk.act(Action::Undo);
    desk.settle();
    assert_eq!(drawn_style(&desk), PointStyle::EXACT);
    desk.act(Action::Redo);
    assert_eq!(desk.session.look().points, style);
    let saved = desk.session.to_project(std::path::Path::new("/p.toml"));
    assert_eq!((saved.look.footprint, saved.look.compositing), (Some(Footprint::Ellipse), Some(Compositing::Gap)));
}

/// A session of a series that has no connectivity.
fn desk_of(source: &dyn crate::field::SeriesSource, folder: &Path) -> Desk {
    let path = folder.join("a.zarr");
    let options = IngestOptions { connectivity: ConnectivityChoice::None, ..Default::default() };
    ingest(source, &path, &options, &Silent, &Cancel::new()).unwrap();
    let series = Arc::new(Series::open(&Store::open(&path).unwrap(), None).unwrap());
    assert!(!series.mesh().is_connected);
    let look = Look::default_for(&series, TransferFunction::parse("viridis").unwrap()).unwrap();
    let look = Look { backend: Backend::Cpu, ..look };
    Desk::with_look(series, folder, look, None)
}

/// Turns, steps and rests in a session of a series that has no connectivity, on machines that are too slow for the target rate. `coarser`:
/// the footprint of fewer points.
fn is_played(source: &dyn crate::field::SeriesSource, coarser: Footprint) {
    let folder = tempfile::tempdir().unwrap();
    let mut desk = desk_of(source, folder.path());
    desk.settle();
    assert_eq!(desk.session.notices(), []);
    let at_rest = (drawn_style(&desk), desk.shown().frame.planes.clone());
    assert!(at_rest.1.color.pixels.iter().any(|p| p[3] > 0.01), "an empty picture proves nothing");
    desk.act(Action::TargetRate(Some(25.0)));
    let said_at_rest = desk.session.drawn();
    // A frame in full takes 100 ms, of 40: a smaller image is within that. Of 2000 points are, if small images take as long as large ones.
    for (ms, family, are_fewer) in [
        (100.0, None, false),
        (2000.0, None, true),
        (2000.0, Some(Family::Scaled), false),
        (100.0, Some(Family::Points), true),
        (100.0, Some(Family::Faces), true),
        (100.0, Some(Family::Rays), false),
    ] {
        desk.act(Action::GiveUp(family));
        let to_the_other = if desk.step() == 0 { 1 } else { -1 };
        for action in [
            Action::Orbit(DVec2::new(0.1, 0.0)),
            Action::Play(Command::Step(to_the_other)),
            Action::Orbit(DVec2::new(-0.1, 0.0)),
        ] {
            let case = format!("{ms} ms, {family:?}, {action:?}");
            slow(&mut desk, ms);
            if family.is_none() && are_fewer {
                desk.session.quality.measured(Quality::Scaled(0.125), ms);
            }
            desk.act(action);
            desk.settle();
            assert_eq!(desk.session.notices(), [], "{case}");
            let (style, quality, lacks) =
                (drawn_style(&desk), desk.shown().quality, desk.session.lacks().expect(&case));
            if are_fewer {
                let Quality::Points(share) = quality else { panic!("{case}: {quality:?}") };
                assert!(share < 0.5 && style.lod < 0.5, "{case}: {share} {style:?}");
                assert_eq!(style, PointStyle { footprint: coarser, lod: style.lod, ..at_rest.0 }, "{case}");
                let percent = (1e3 * style.lod).round() / 10.0;
                assert_eq!(lacks, format!("fewer points: {percent} %"), "{case}");
                assert_eq!(desk.session.drawn(), format!("points: {percent} %"), "{case}");
                assert_eq!(desk.shown().request.size_px, (40, 20), "{case}");
            } else {
                assert!(
                    matches!(quality, Quality::Scaled(_)) && lacks.contains("smaller image"),
                    "{case}: {quality:?}"
                );
                assert_eq!(style, at_rest.0, "{case}");
            }
            slow(&mut desk, ms);
            desk.later(10_000);
            desk.settle();
            assert_eq!((desk.session.notices(), desk.session.lacks()), (&[][..], None), "{case}");
            assert_eq!((drawn_style(&desk), desk.session.drawn()), (at_rest.0, said_at_rest.clone()), "{case}");
            let error = wait_for("error of the motion", || {
                desk.session.tick(desk.now);
                desk.session.motion_error().filter(|error| error.quality == quality)
            });
            assert!(error.error.is_some_and(|error| error.rmse > 0.0), "{case}: {error:?}");
        }
    }
}

#[test]
fn a_soup_is_played_by_smaller_images_or_fewer_ellipses() {
    let soup = generate(&SynthSpec { cells: 600, steps: 2, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
    is_played(&soup, Footprint::Ellipse);
}

#[test]
fn a_cloud_is_played_by_smaller_images_or_fewer_points() {
    let cloud = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/npz/cloud.npz");
    is_played(&*crate::import::open(&cloud).unwrap(), Footprint::Circle);
}

#[test]
fn points_that_are_chosen_for_rest_are_never_more_while_something_moves() {
    let folder = tempfile::tempdir().unwrap();
    let soup = generate(&SynthSpec { cells: 600, steps: 2, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
    let mut desk = desk_of(&soup, folder.path());
    let style = PointStyle { footprint: Footprint::Circle, ..PointStyle::EXACT };
    for action in [
        Action::Points(style),
        Action::LevelOfDetail(0.4),
        Action::TargetRate(Some(25.0)),
        Action::GiveUp(Some(Family::Points)),
    ] {
        desk.act(action);
    }
    desk.settle();
    let at_rest = drawn_style(&desk);
    assert_eq!((at_rest, desk.session.drawn()), (PointStyle { lod: 0.4, ..style }, "points: 40 %".to_owned()));
    assert_eq!((desk.shown().quality, desk.session.lacks()), (Quality::Exact, None));
    slow(&mut desk, 60.0);
    desk.act(Action::Orbit(DVec2::new(0.1, 0.0)));
    desk.settle();
    assert_eq!(drawn_style(&desk), PointStyle { lod: 0.4 * 0.5, ..style });
    assert_eq!(desk.session.lacks(), Some("fewer points: 20 %".to_owned()));
    desk.later(10_000);
    desk.settle();
    assert_eq!((drawn_style(&desk), desk.session.lacks()), (at_rest, None));
}

#[test]
fn isosurfaces_among_points_leave_all_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let soup = generate(&SynthSpec { cells: 600, steps: 2, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
    let mut desk = desk_of(&soup, folder.path());
    for action in [Action::NextShown, Action::TargetRate(Some(25.0)), Action::GiveUp(Some(Family::Points))] {
        desk.act(action);
    }
    desk.settle();
    assert!(!desk.shown().request.tets().unwrap().surfaces.is_empty());
    slow(&mut desk, 2000.0);
    desk.act(Action::Orbit(DVec2::new(0.1, 0.0)));
    desk.settle();
    assert_eq!((desk.session.notices(), drawn_style(&desk)), (&[][..], PointStyle::EXACT));
    assert!(matches!(desk.shown().quality, Quality::Scaled(_)));
}

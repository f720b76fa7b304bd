//! How much is drawn while something moves, and at rest.

use super::desk::{Desk, slow, store};
use super::worker::tests::wait_for;
use super::*;
use crate::optics::OpticsKind;
use crate::pipeline::{RenderMode, SampleSet, Sampling, Series};
use crate::playback::quality::{Family, Quality};
use crate::playback::{Command, Loop};
use glam::DVec2;
use std::sync::Arc;

#[test]
fn while_the_camera_moves_less_is_drawn_if_it_is_slow_and_all_of_it_afterwards() {
    let mut desk = Desk::open();
    desk.settle();
    let whole = desk.shown().frame.planes.clone();
    let turn = |desk: &mut Desk, by: f64| {
        desk.act(Action::Orbit(DVec2::new(by, 0.0)));
        desk.settle();
        desk.shown().clone()
    };
    // No target rate is set.
    slow(&mut desk, 160.0);
    assert_eq!(turn(&mut desk, 0.1).quality, Quality::Exact);
    for (family, expected) in [(None, "rays"), (Some(Family::Scaled), "image"), (Some(Family::Faces), "faces")] {
        desk.act(Action::TargetRate(Some(25.0)));
        desk.act(Action::GiveUp(family));
        slow(&mut desk, 160.0);
        let shown = turn(&mut desk, -0.1);
        let lacks = desk.session.lacks().expect("it is not all there is");
        assert!(lacks.contains(expected), "{lacks}");
        match shown.quality {
            Quality::Rays(contrast) => assert_eq!(shown.request.samples, SampleSet::Adaptive { contrast }),
            Quality::Scaled(share) => {
                assert_eq!(shown.request.size_px, ((40.0 * share).round() as usize, (20.0 * share).round() as usize));
            }
            Quality::Faces(level) => assert_eq!((shown.request.lod(), level < 0.5), (level, true)),
            Quality::Exact | Quality::Details | Quality::Points(_) => panic!("{family:?}: {:?}", shown.quality),
        }
        assert_ne!(desk.session.drawn(), "exact");
        let (_, wait) = desk.session.tick(desk.now);
        desk.now += wait.expect("to be called when the camera is still");
        assert!(desk.settle() > 0);
        let rest = desk.shown().clone();
        assert_eq!((rest.quality, rest.request.size_px, desk.session.lacks()), (Quality::Exact, (40, 20), None));
        assert_eq!(rest.request.samples, SampleSet::All);
        if family.is_none() {
            assert!(rest.frame.planes == whole, "the view is that of the beginning");
        }
        // The comparison is done by then or a little later.
        let error = wait_for("error of the motion", || {
            desk.session.tick(desk.now);
            desk.session.motion_error().filter(|error| error.quality == shown.quality)
        });
        assert_eq!(error.rays.is_some(), family.is_none());
        assert!(error.error.is_some_and(|error| error.rmse > 0.0 && error.max < 1.0), "{error:?}");
        turn(&mut desk, 0.1);
        desk.later(1000);
        desk.settle();
    }
    desk.act(Action::TargetRate(Some(f64::NAN)));
    assert_eq!(desk.session.target_fps(), Some(25.0));
    desk.act(Action::TargetRate(Some(1e9)));
    assert_eq!(desk.session.target_fps(), Some(*TARGET_FPS.end()));
}

#[test]
fn keys_change_the_quality_by_notches_and_what_is_drawn_is_said() {
    let mut desk = Desk::open();
    assert_eq!(desk.session.drawn(), "nothing yet");
    desk.settle();
    assert_eq!(desk.session.drawn(), "exact");
    let press = |desk: &mut Desk, key: &str| {
        desk.act(super::keys::action(key, [false; 2]).unwrap());
        desk.session.target_fps()
    };
    assert_eq!(press(&mut desk, "E"), None, "all is drawn");
    assert_eq!((press(&mut desk, "D"), press(&mut desk, "D")), (Some(1.0), Some(2.0)));
    desk.act(Action::TargetRate(Some(30.0)));
    assert_eq!(
        (press(&mut desk, "D"), press(&mut desk, "E"), press(&mut desk, "E")),
        (Some(40.0), Some(25.0), Some(15.0))
    );
    let most = (0..20).map(|_| press(&mut desk, "D")).last().unwrap();
    assert_eq!(most, Some(*TARGET_FPS.end()));
    assert_eq!((0..20).map(|_| press(&mut desk, "E")).last().unwrap(), None);
    desk.act(Action::Renderer(RenderMode::Havs));
    desk.act(Action::LevelOfDetail(0.25));
    desk.settle();
    assert_eq!((desk.session.drawn().as_str(), desk.session.lacks()), ("faces: 25 %", None));
    desk.act(Action::LevelOfDetail(1.0));
    desk.act(Action::Optics(OpticsKind::Partial));
    desk.settle();
    assert_eq!(desk.session.drawn(), "all drawn");
    desk.act(Action::Optics(OpticsKind::Exact));
    let changes = desk.session.changes().0;
    desk.act(Action::Sampling(Sampling::Random));
    assert_eq!((desk.session.look().faces.sampling, desk.session.changes().0), (Sampling::Random, changes + 1));
}

/// A frame on the GPU of the window has no pixels on the CPU, which does not make it transparent.
#[test]
fn nothing_is_said_of_the_error_of_pictures_that_are_elsewhere() {
    let mut desk = Desk::open();
    desk.settle();
    let here = desk.shown().clone();
    let planes = here.frame.planes.color.clone();
    assert!(MotionError::of(&here, &planes).error.is_some_and(|error| error.max == 0.0));
    assert_eq!(MotionError::of(&here, &Default::default()).error, None);
    assert_eq!(MotionError::between(&Default::default(), &planes), None);
}

#[test]
fn a_slow_picture_comes_in_steps_and_is_exact_in_the_end() {
    let mut desk = Desk::open();
    desk.session.set_viewport(120, 90);
    desk.settle();
    let whole = desk.shown().frame.planes.clone();
    let mut previews = 0;
    for _ in 0..20 {
        desk.act(Action::TargetRate(Some(25.0)));
        for by in [0.1, -0.1] {
            slow(&mut desk, 500.0);
            desk.act(Action::Orbit(DVec2::new(by, 0.0)));
            desk.settle();
        }
        assert!(desk.session.lacks().is_some());
        slow(&mut desk, 500.0);
        desk.later(1000);
        let mut is_final = false;
        while !is_final || desk.session.is_waiting() {
            let (is_new, _) = desk.session.tick(desk.now);
            let shown = desk.shown();
            if is_new && shown.is_final {
                assert!(!is_final && shown.frame.planes == whole);
                assert_eq!((shown.quality, desk.session.lacks()), (Quality::Exact, None));
                is_final = true;
            } else if is_new {
                assert!(!is_final && shown.frame.planes.color != whole.color);
                assert!(desk.session.lacks().is_some_and(|lacks| lacks.contains("contrast")));
                previews += 1;
            }
        }
        assert_eq!(desk.session.tick(desk.now), (false, None), "nothing more is asked for");
    }
    assert!(previews > 0, "none was there in time");
}

#[test]
fn a_rate_is_held_while_it_plays_and_not_at_rest() {
    let mut desk = Desk::open();
    desk.act(Action::Play(Command::Loop(Loop::All)));
    desk.act(Action::Renderer(RenderMode::Havs));
    desk.settle();
    // Simulates a machine that is far too slow: a few frames are not enough for the level to rise to 1 again.
    let play = |desk: &mut Desk| {
        desk.act(Action::Play(Command::Play));
        desk.settle();
        desk.session.quality.forget_all();
        (0..3).for_each(|_| desk.session.quality.measured(Quality::Faces(1.0), 1e9));
        // The first frames may have been requested before.
        for _ in 0..5 {
            desk.later(1000);
            assert!(desk.settle() > 0);
        }
        desk.shown().request.lod()
    };
    let rest = |desk: &mut Desk| {
        desk.act(Action::Play(Command::Pause));
        desk.later(1000);
        desk.settle();
        desk.shown().request.lod()
    };
    assert_eq!(play(&mut desk), 1.0, "nobody asked for it");
    rest(&mut desk);
    desk.act(Action::TargetRate(Some(25.0)));
    let lod = play(&mut desk);
    let stats = &desk.shown().frame.stats;
    assert!(lod < 1.0 && 0 < stats.faces_drawn && stats.faces_drawn < stats.faces_total, "{lod}");
    assert!(desk.session.lacks().is_some_and(|lacks| lacks.contains("fewer faces")));
    assert_eq!((rest(&mut desk), desk.session.lacks()), (1.0, None));
    // The chosen level is the upper limit, however fast frames are.
    desk.act(Action::LevelOfDetail(0.25));
    desk.act(Action::LevelOfDetail(f64::NAN));
    desk.settle();
    assert_eq!((desk.shown().request.lod(), desk.session.lacks()), (0.25, None));
    desk.act(Action::LevelOfDetail(7.0));
    assert_eq!(desk.session.look().faces.lod, 1.0);
}

#[test]
fn a_screenshot_is_exact_while_it_plays_too() {
    let dir = tempfile::tempdir().unwrap();
    let mut desk = Desk::of(Arc::new(Series::open(store(), None).unwrap()), dir.path());
    desk.act(Action::Play(Command::Loop(Loop::All)));
    desk.act(Action::TargetRate(Some(25.0)));
    desk.settle();
    desk.act(Action::Play(Command::Play));
    (0..3).for_each(|_| desk.session.quality.measured(Quality::Exact, 1e9));
    let play = |desk: &mut Desk| {
        desk.later(1000);
        desk.settle();
    };
    (0..5).for_each(|_| play(&mut desk));
    assert!(desk.session.lacks().is_some());
    desk.act(Action::Screenshot);
    let mut frames = 0;
    while desk.session.notices().is_empty() {
        play(&mut desk);
        frames += 1;
        assert!(frames < 100_000, "it is never taken");
    }
    assert_eq!(desk.session.notices()[0].kind, NoticeKind::Done, "{:?}", desk.session.notices());
}

//! User actions and their effects.

use super::desk::{Desk, store};
use super::worker::tests::wait_for;
use super::*;
use crate::camera::{Axis, Camera, Projection};
use crate::pipeline::test_series::logged;
use crate::pipeline::{FrameTime, RenderMode, Series};
use crate::playback::{Command, Direction, Loop, Mode, StepRange};
use crate::transfer::{ColorMap, OpacityPoint, RangePolicy};
use glam::DVec2;
use std::sync::Arc;

#[test]
fn paused_and_still_nothing_is_asked_of_the_pipeline() {
    let (mut desk, log) = Desk::fake(5);
    assert_eq!(desk.settle(), 1);
    wait_for("end of the survey", || desk.session.survey().is_over.then_some(()));
    let decoded = log.decoded();
    for _ in 0..100 {
        desk.later(100);
        assert_eq!(desk.session.tick(desk.now), (false, None), "nothing to show, and no time to come back at");
        assert_eq!(desk.session.player.pipelined().wanted(), 0);
    }
    assert_eq!(log.decoded(), decoded);
    desk.act(Action::Orbit(DVec2::new(0.1, 0.0)));
    assert!(desk.settle() > 0, "the test can fail");
}

#[test]
fn what_changes_nothing_in_the_picture_renders_nothing() {
    let (mut desk, _) = Desk::fake(5);
    desk.settle();
    let backend = desk.session.look().backend;
    for action in [
        Action::Background([1.0; 3]),
        Action::Help,
        Action::Backend(backend),
        Action::Range(RangePolicy::Series),
        Action::NextLoop,
        Action::Faster,
        Action::RangeFromHere,
        Action::Zoom { factor: 1.0, cursor: DVec2::ZERO },
    ] {
        desk.act(action.clone());
        desk.later(1000);
        assert_eq!(desk.settle(), 0, "{action:?}");
    }
}

#[test]
fn every_change_of_the_look_is_drawn() {
    let mut desk = Desk::open();
    desk.settle();
    let gray = ColorMap::built_in("gray").unwrap().clone();
    let points = vec![OpacityPoint { position: 0.0, value: 0.3 }, OpacityPoint { position: 1.0, value: 0.4 }];
    for action in [
        Action::Colors(gray.clone()),
        Action::Opacities(points),
        Action::Range(RangePolicy::Manual(-1.0, 3.0)),
        Action::Orbit(DVec2::new(0.2, 0.1)),
        Action::Pan(DVec2::new(0.2, 0.1)),
        Action::Zoom { factor: 2.0, cursor: DVec2::ONE },
        Action::ViewAlong { axis: Axis::Y, from_positive: true },
        Action::OtherProjection,
        Action::ResetView,
        Action::NextShown,
        Action::MoveIsovalue(-7.0),
        Action::NextShown,
        Action::ImageScale(0.5),
    ] {
        let before = desk.shown().frame.planes.color.clone();
        desk.act(action.clone());
        desk.later(1000);
        assert!(desk.settle() > 0, "{action:?}");
        assert!(desk.shown().frame.planes.color != before, "{action:?}");
    }
    assert_eq!((desk.session.function().unwrap().color_map(), desk.session.notices()), (&gray, &[][..]));
    assert_eq!(desk.shown().request.size_px, (20, 10));
}

#[test]
fn at_rest_on_the_last_step_a_growing_series_is_followed() {
    for (at, expected) in [(2, 4), (1, 1)] {
        let (mut desk, _) = Desk::fake(3);
        desk.act(Action::Play(Command::SeekStep(at)));
        desk.settle();
        desk.session.grow(store().clone(), logged(5).0, desk.now);
        desk.settle();
        assert_eq!((desk.step(), desk.session.state().steps), (expected, 5));
    }
    let (mut desk, _) = Desk::fake(3);
    desk.act(Action::Play(Command::SeekStep(1)));
    desk.act(Action::Play(Command::Play));
    desk.session.grow(store().clone(), logged(5).0, desk.now);
    assert!(desk.session.state().playing && desk.step() == 1, "a clock that runs goes on");
}

#[test]
fn what_is_open_is_closed_one_after_the_other() {
    let (mut desk, _) = Desk::fake(2);
    desk.act(Action::Help);
    desk.session.fail("first".to_owned());
    desk.session.fail("second".to_owned());
    let seen = |desk: &Desk| (desk.session.help_is_open(), desk.session.notices().len());
    let mut after = vec![seen(&desk)];
    for _ in 0..4 {
        desk.act(Action::Close);
        after.push(seen(&desk));
    }
    assert_eq!(after, [(true, 2), (false, 2), (false, 1), (false, 0), (false, 0)]);
    desk.act(Action::Fullscreen);
    assert!(desk.session.is_fullscreen());
    desk.act(Action::Fullscreen);
    assert!(!desk.session.is_fullscreen());
}

#[test]
fn the_way_back_to_what_was_opened_is_undone_too() {
    let mut desk = Desk::open();
    let first = desk.session.project().clone();
    desk.act(Action::Colors(ColorMap::built_in("gray").unwrap().clone()));
    desk.act(Action::Renderer(RenderMode::Havs));
    let changed = desk.session.project().clone();
    desk.act(Action::Revert);
    assert!(**desk.session.project() == *first && desk.session.look().mode != RenderMode::Havs);
    assert!(!desk.session.is_changed());
    desk.act(Action::Undo);
    assert!(**desk.session.project() == *changed && desk.session.look().mode == RenderMode::Havs);
}

#[test]
fn images_have_the_size_of_the_viewport_times_the_scale() {
    let (mut desk, _) = Desk::fake(2);
    desk.settle();
    assert_eq!(desk.shown().request.size_px, (40, 20));
    desk.session.set_viewport(31, 17);
    desk.act(Action::ImageScale(0.5));
    desk.settle();
    assert_eq!(desk.shown().request.size_px, (16, 9));
    desk.session.set_viewport(0, 17);
    assert_eq!((desk.session.size_px(), desk.settle()), (None, 0), "a minimised window renders nothing");
    desk.session.set_viewport(100_000, 10);
    assert_eq!(desk.session.size_px(), Some((8192, 1)));
}

#[test]
fn the_mesh_follows_the_mouse() {
    let (mut desk, _) = Desk::fake(2);
    let point = |desk: &Desk| {
        let view = desk.session.look().camera.view(40, 20).unwrap();
        // A point on the near side of the focal point.
        let camera = desk.session.look().camera;
        let near = camera.focal_point;
        (view.to_view(near), camera)
    };
    let (_, before) = point(&desk);
    let near = before.focal_point + 0.1 * (before.position - before.focal_point);
    let place = |camera: &Camera| {
        let p = camera.view(40, 20).unwrap().to_view(near);
        DVec2::new(p.x / p.z, p.y / p.z)
    };
    desk.act(Action::Orbit(DVec2::new(0.05, 0.0)));
    assert!(place(&desk.session.look().camera).x > 1e-3, "dragged to the right, the near side goes to the right");
    desk.act(Action::ResetView);
    desk.act(Action::Orbit(DVec2::new(0.0, 0.05)));
    assert!(place(&desk.session.look().camera).y > 1e-3, "dragged upwards, it goes upwards");
    desk.act(Action::ResetView);
    assert_eq!(desk.session.look().camera, before);
}

#[test]
fn a_camera_cannot_be_lost() {
    let (mut desk, _) = Desk::fake(2);
    for _ in 0..10_000 {
        desk.act(Action::Zoom { factor: 3.0, cursor: DVec2::new(0.9, 0.9) });
    }
    assert!(desk.session.look().camera.view(4, 4).is_ok());
    assert!(desk.settle() > 0 && desk.session.notices().is_empty(), "{:?}", desk.session.notices());
    desk.act(Action::OtherProjection);
    desk.act(Action::ResetView);
    assert!(matches!(desk.session.look().camera.projection, Projection::Perspective { .. }));
}

#[test]
fn keys_play_the_series() {
    let (mut desk, _) = Desk::fake(30);
    desk.settle();
    let press = |desk: &mut Desk, key, shift| {
        let action = keys::action(key, [false, shift]).unwrap();
        desk.act(action);
        desk.settle();
    };
    press(&mut desk, "Right", false);
    press(&mut desk, "Right", true);
    assert_eq!((desk.step(), desk.shown().request.time), (11, FrameTime::from(11)));
    press(&mut desk, "Left", false);
    assert_eq!(desk.step(), 10);
    press(&mut desk, "End", false);
    assert_eq!(desk.step(), 29);
    press(&mut desk, "Home", false);
    assert_eq!(desk.step(), 0);
    press(&mut desk, "]", false);
    press(&mut desk, "]", false);
    // Two factors that are not powers of two. Measured: 7.1e-15, a unit of the last place.
    assert!((desk.session.state().speed.unwrap() - 50.0).abs() < 5e-14);
    press(&mut desk, "[", false);
    let settings = |desk: &Desk| desk.session.state().settings;
    let loops: Vec<Loop> = (0..3)
        .map(|_| {
            press(&mut desk, "L", false);
            settings(&desk).repeat
        })
        .collect();
    assert_eq!(loops, [Loop::All, Loop::Range, Loop::Off]);
    press(&mut desk, "P", false);
    assert_eq!(settings(&desk).repeat, Loop::PingPong);
    press(&mut desk, "P", false);
    assert_eq!(settings(&desk).repeat, Loop::Off);
    press(&mut desk, "A", false);
    assert_eq!(settings(&desk).mode, Mode::RealTime);
    press(&mut desk, "A", false);
    assert_eq!(settings(&desk).mode, Mode::EveryStep);
    press(&mut desk, "B", false);
    assert_eq!(settings(&desk).direction, Direction::Backward);
    press(&mut desk, "?", false);
    assert!(desk.session.help_is_open());
}

#[test]
fn a_range_is_marked_from_here_to_there() {
    let (mut desk, _) = Desk::fake(30);
    let mark = |desk: &mut Desk, step, action| {
        desk.act(Action::Play(Command::SeekStep(step)));
        desk.act(action);
        desk.session.state().settings.range.unwrap()
    };
    assert_eq!(mark(&mut desk, 5, Action::RangeFromHere), StepRange { a: 5, b: 29 });
    assert_eq!(mark(&mut desk, 9, Action::RangeToHere), StepRange { a: 5, b: 9 });
    assert_eq!(mark(&mut desk, 20, Action::RangeFromHere), StepRange { a: 20, b: 20 }, "the other end gives way");
    assert_eq!(mark(&mut desk, 3, Action::RangeToHere), StepRange { a: 3, b: 3 });
}

#[test]
fn a_step_that_fails_is_named_and_the_others_are_shown() {
    let (mut desk, log) = Desk::fake(5);
    desk.settle();
    log.fail_at(1);
    desk.act(Action::Play(Command::Step(1)));
    desk.settle();
    assert!(desk.session.shown().is_none(), "no picture of another step passes for this one");
    let text = desk.session.notices()[0].text.clone();
    assert!(text.contains("step 1") && text.contains("damaged"), "{text}");
    desk.act(Action::Dismiss(0));
    desk.act(Action::Dismiss(7));
    desk.act(Action::Play(Command::Step(1)));
    desk.settle();
    assert_eq!(desk.shown().request.time, FrameTime::from(2));
    assert!(desk.session.notices().is_empty());
}

#[test]
fn a_range_without_meaning_is_an_error_and_shows_nothing() {
    let (mut desk, _) = Desk::fake(5);
    desk.settle();
    desk.act(Action::Range(RangePolicy::Manual(2.0, 1.0)));
    desk.settle();
    assert!(desk.session.notices()[0].text.contains("2..1"), "{:?}", desk.session.notices());
    assert!(desk.shown().frame.planes.color.pixels.iter().all(|p| p[3] == 0.0));
    desk.act(Action::Play(Command::Speed(-1.0)));
    assert!(desk.session.notices()[1].text.contains("speed"));
}

#[test]
fn another_field_is_opened_aside_and_played_at_the_same_step() {
    let mut desk = Desk::open();
    let names: Vec<String> = store().fields().iter().map(|f| f.name.clone()).collect();
    let other = names.iter().find(|name| **name != desk.session.series().field().name).expect("a second field");
    desk.settle();
    desk.act(Action::Play(Command::SeekStep(2)));
    desk.settle();
    let before = desk.shown().frame.planes.color.clone();
    desk.act(Action::Field(other.parse().unwrap()));
    assert!(desk.session.opens_field());
    desk.wait_for_field();
    desk.settle();
    assert_eq!((&desk.session.series().field().name, desk.step()), (other, 2));
    assert!(desk.shown().frame.planes.color != before);
    desk.act(Action::Field("nothing".parse().unwrap()));
    desk.wait_for_field();
    assert!(desk.session.notices()[0].text.contains("'nothing'"), "{:?}", desk.session.notices());
    assert_eq!(&desk.session.series().field().name, other);
}

#[test]
fn another_field_is_undone_with_all_that_came_before_it() {
    let mut desk = Desk::open();
    let first = desk.session.series().field().name.clone();
    let names: Vec<String> = store().fields().iter().map(|f| f.name.clone()).collect();
    let other = names.iter().find(|name| **name != first).expect("a second field").clone();
    desk.settle();
    let seen = |desk: &mut Desk| {
        desk.wait_for_field();
        desk.settle();
        let name = desk.session.series().field().name.clone();
        (name, desk.session.project().clone(), desk.shown().frame.planes.color.clone())
    };
    let map = |name: &str| Action::Colors(ColorMap::built_in(name).unwrap().clone());
    let mut states = vec![seen(&mut desk)];
    for action in [map("gray"), Action::Field(other.parse().unwrap()), map("turbo")] {
        desk.act(action);
        states.push(seen(&mut desk));
    }
    assert_eq!((&states[1].0, &states[2].0, desk.session.changes()), (&first, &other, (3, 0)));
    for turn in [Action::Undo, Action::Redo] {
        let order: Vec<usize> = if turn == Action::Undo { vec![2, 1, 0] } else { vec![1, 2, 3] };
        for at in order {
            desk.act(turn.clone());
            let now = seen(&mut desk);
            assert!(now == states[at], "{turn:?} to {at}: {} with {:?}", now.0, desk.session.changes());
        }
    }
    desk.act(Action::Revert);
    assert!(seen(&mut desk) == states[0]);
    desk.act(Action::Undo);
    assert!(seen(&mut desk) == states[3], "what was reverted is a change, too");
    // Two at once: the second one meets a field that is still being opened, and waits for no other.
    desk.act(Action::Undo);
    desk.act(Action::Undo);
    desk.act(map("plasma"));
    let now = seen(&mut desk);
    assert!(now.0 == other && desk.session.changes().1 == 0, "a change in between wins: {:?}", desk.session.changes());
}

#[test]
fn screenshots_are_the_picture_in_full_and_never_overwrite() {
    let dir = tempfile::tempdir().unwrap();
    let mut desk = Desk::of(Arc::new(Series::open(store(), None).unwrap()), dir.path());
    desk.act(Action::Background([0.25, 0.5, 0.75]));
    desk.settle();
    for _ in 0..2 {
        desk.act(Action::Screenshot);
        desk.session.tick(desk.now);
        wait_for("notice", || {
            desk.session.tick(desk.now);
            (!desk.session.notices().is_empty()).then_some(())
        });
        assert_eq!(desk.session.notices()[0].kind, NoticeKind::Done, "{:?}", desk.session.notices());
        desk.act(Action::Dismiss(0));
    }
    let field = desk.session.series().field().name.replace(':', "-");
    let names = [format!("{field}_step0000.png"), format!("{field}_step0000_2.png")];
    let mut found: Vec<String> =
        std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    found.sort();
    let mut expected = names.to_vec();
    expected.sort();
    assert_eq!(found, expected);
    let image = crate::image::read_png(&dir.path().join(&names[0])).unwrap();
    assert_eq!((image.width, image.height), (40, 20));
    let behind = desk.shown().frame.planes.color.over([0.25, 0.5, 0.75]);
    for (saved, shown) in image.pixels.iter().zip(&behind) {
        // Half a unit of 8 bits.
        assert!(saved.iter().zip(shown).all(|(a, b)| (a - b).abs() <= 0.5001 / 255.0), "{saved:?} {shown:?}");
    }
}

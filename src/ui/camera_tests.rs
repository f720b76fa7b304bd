//! The way back from movements of the camera.

use super::camera_history::CameraTurn;
use super::desk::Desk;
use super::*;
use crate::camera::{Axis, Camera};
use glam::DVec2;

fn camera(desk: &Desk) -> Camera {
    desk.session.look().camera
}

fn turn(desk: &mut Desk, turn: CameraTurn) -> Camera {
    desk.act(Action::TurnCamera(turn));
    camera(desk)
}

#[test]
fn movements_of_the_camera_are_taken_back_one_gesture_at_a_time() {
    let (mut desk, _) = Desk::fake(2);
    let home = camera(&desk);
    desk.session.hold(true);
    for _ in 0..5 {
        desk.act(Action::Orbit(DVec2::new(0.1, 0.02)));
        desk.later(20);
    }
    desk.session.hold(false);
    let dragged = camera(&desk);
    desk.act(Action::ViewAlong { axis: Axis::X, from_positive: false });
    let along = camera(&desk);
    assert_eq!(desk.session.camera_turns(), [2, 0]);
    assert_eq!(turn(&mut desk, CameraTurn::Back), dragged);
    assert_eq!(turn(&mut desk, CameraTurn::Back), home, "the whole drag");
    assert_eq!(turn(&mut desk, CameraTurn::Back), home, "there is none before it");
    assert_eq!(turn(&mut desk, CameraTurn::On), dragged);
    assert_eq!(turn(&mut desk, CameraTurn::On), along);
    assert_eq!(turn(&mut desk, CameraTurn::On), along);
    turn(&mut desk, CameraTurn::Back);
    desk.act(Action::OtherProjection);
    assert_eq!(desk.session.camera_turns(), [2, 0], "a new movement ends what lay ahead");
}

#[test]
fn notches_of_the_wheel_are_one_movement_until_it_rests() {
    let (mut desk, _) = Desk::fake(2);
    let home = camera(&desk);
    let notch = |desk: &mut Desk| desk.act(Action::Zoom { factor: 1.1, cursor: DVec2::ZERO });
    (0..3).for_each(|_| notch(&mut desk));
    let nearer = camera(&desk);
    desk.later(10_000);
    notch(&mut desk);
    assert_eq!(desk.session.camera_turns(), [2, 0]);
    assert_eq!(turn(&mut desk, CameraTurn::Back), nearer);
    notch(&mut desk);
    assert_eq!(desk.session.camera_turns(), [2, 0], "after a turn begins another movement");
    turn(&mut desk, CameraTurn::Back);
    assert_eq!(turn(&mut desk, CameraTurn::Back), home);
}

#[test]
fn changes_and_movements_are_undone_apart() {
    let (mut desk, _) = Desk::fake(2);
    let home = camera(&desk);
    let unit = desk.session.look().lengths.unit_distance;
    desk.act(Action::UnitDistance(2.0 * unit));
    desk.act(Action::Orbit(DVec2::new(0.1, 0.0)));
    let turned = camera(&desk);
    desk.act(Action::Undo);
    assert_eq!((camera(&desk), desk.session.look().lengths.unit_distance), (turned, unit));
    desk.act(Action::Redo);
    assert_eq!(turn(&mut desk, CameraTurn::Back), home);
    assert_eq!(desk.session.look().lengths.unit_distance, 2.0 * unit);
}

//! Dragging for ten seconds: no frame is older than it should be.

use super::Action;
use super::desk::{Desk, LONG, slow, store};
use crate::camera::Camera;
use crate::pipeline::{RenderMode, Series};
use crate::playback::Command;
use crate::playback::quality::Quality;
use crate::transfer::RangePolicy;
use glam::DVec2;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Inputs of ten seconds, at 60 a second.
const INPUTS: usize = 600;

/// For each shown frame, the number of its input and of the newest one at that time.
fn drag(desk: &mut Desk) -> Vec<[usize; 2]> {
    let mut inputs: Vec<Camera> = vec![desk.session.look().camera];
    let mut shown = Vec::new();
    for input in 1..=INPUTS {
        desk.act(Action::Orbit(DVec2::new(0.01, 0.002)));
        inputs.push(desk.session.look().camera);
        desk.later(16);
        loop {
            let (is_new, _) = desk.session.tick(desk.now);
            if is_new && desk.shown().is_final {
                let of = inputs.iter().rposition(|camera| *camera == desk.shown().request.camera);
                shown.push([of.expect("a frame of an input"), input]);
            }
            // The mouse does not wait for frames: inputs come while some are pending.
            if !is_new {
                break;
            }
        }
        // Some frames are ready before the next input, some are not; on the slowest machine one of sixteen inputs is shown.
        let is_awaited = input.is_multiple_of(16);
        desk.session.player.wait(if is_awaited { LONG } else { Duration::from_micros(200 * (input % 7) as u64) });
    }
    shown
}

#[test]
fn while_a_hand_drags_no_frame_is_older_than_the_input_by_more_than_two_frames() {
    let series = Series::open(store(), None).unwrap();
    let mut desk = Desk::of(Arc::new(series), Path::new("."));
    desk.session.set_viewport(240, 180);
    desk.settle();
    desk.act(Action::TargetRate(Some(25.0)));
    slow(&mut desk, 500.0);
    let shown = drag(&mut desk);
    assert!(shown.len() > 20, "{} frames", shown.len());
    // A frame shows the newest input of when the last but one was shown, or a newer one.
    for frames in shown.windows(3) {
        let ([_, at], [of, now]) = (frames[0], frames[2]);
        assert!(of >= at, "input {of} is shown at {now}, and two frames before it was {at}: {frames:?}");
    }
    assert!(shown.array_windows().all(|[before, after]| before[0] <= after[0]), "no frame goes back");
    // Most requests were dropped.
    assert!(shown.len() < INPUTS);
    desk.later(1000);
    desk.settle();
    assert_eq!((desk.shown().quality, desk.shown().request.camera), (Quality::Exact, desk.session.look().camera));
}

/// A session on a machine where a frame in full takes four times what the target rate allows.
fn slow_desk() -> Desk {
    let mut desk = Desk::open();
    desk.settle();
    desk.act(Action::TargetRate(Some(25.0)));
    slow(&mut desk, 160.0);
    desk
}

/// Waits until nothing moves any more: the picture is in full then.
fn rest(desk: &mut Desk) {
    assert_ne!(desk.shown().quality, Quality::Exact);
    let (_, wait) = desk.session.tick(desk.now);
    desk.now += wait.expect("to be called when nothing moves");
    assert!(desk.settle() > 0);
    assert_eq!((desk.shown().quality, desk.session.lacks()), (Quality::Exact, None));
}

#[test]
fn while_a_handle_is_dragged_less_is_drawn_if_it_is_slow_and_all_of_it_afterwards() {
    let mut desk = slow_desk();
    desk.session.hold(true);
    for to in [2.0, 2.5, 3.0] {
        let exact_ms = desk.session.quality.exact_ms();
        desk.act(Action::Range(RangePolicy::Manual(0.0, to)));
        let _ = desk.session.tick(desk.now);
        assert_eq!(desk.session.quality.exact_ms(), exact_ms, "costs are those of the last table, as a first guess");
        desk.settle();
        assert_ne!(desk.shown().quality, Quality::Exact);
        desk.later(50);
    }
    desk.session.hold(false);
    rest(&mut desk);
    // A change that is no gesture, such as by a key, may be of anything: it is drawn in full.
    desk.act(Action::Range(RangePolicy::Manual(0.0, 1.5)));
    desk.settle();
    assert_eq!(desk.shown().quality, Quality::Exact);
}

#[test]
fn another_renderer_by_a_click_has_costs_of_its_own() {
    let mut desk = slow_desk();
    desk.session.quality.measured(Quality::Scaled(0.5), 60.0);
    let exact_ms = desk.session.quality.exact_ms();
    // A click is a gesture, too.
    desk.session.hold(true);
    desk.act(Action::Renderer(RenderMode::Raycast));
    let _ = desk.session.tick(desk.now);
    assert_ne!(desk.session.quality.exact_ms(), exact_ms, "all costs but the last one are forgotten");
}

#[test]
fn a_step_at_rest_is_a_motion_and_then_in_full() {
    let mut desk = slow_desk();
    for step in [2, 1] {
        desk.act(Action::Play(Command::SeekStep(step)));
        desk.settle();
        assert_eq!(desk.step(), step);
        rest(&mut desk);
        slow(&mut desk, 160.0);
    }
}

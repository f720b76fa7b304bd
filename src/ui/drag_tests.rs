//! Dragging for ten seconds: no frame is older than it should be.

use super::Action;
use super::desk::{Desk, LONG, slow, store};
use crate::camera::Camera;
use crate::pipeline::Series;
use crate::playback::quality::Quality;
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

//! Smaller images while the camera moves, so that it follows the mouse.

use std::time::Duration;

/// So long after the last motion the camera counts as still, and the image is drawn in full.
pub(super) const SETTLE: Duration = Duration::from_millis(200);

/// Frames per second that are aimed at while the camera moves, unless somebody chooses.
pub const DEFAULT_TARGET_FPS: f64 = 25.0;

/// What can be chosen.
pub const TARGET_FPS: std::ops::RangeInclusive<f64> = 1.0..=120.0;

/// Below this share of the width and the height nothing can be made out.
const SCALE_MIN: f64 = 0.2;

/// Above this share the loss is not worth the gain.
const SCALE_MAX: f64 = 0.85;

/// Whether the camera moves, and how small its images are meanwhile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Motion {
    /// While it moves: until when, and the share of width and height.
    moving: Option<(Duration, f64)>,
}

impl Motion {
    /// The camera has moved; an image in full takes `full_ms`, if that is known, and should take no longer than `target_ms`. The
    /// share is decided when the motion begins.
    pub(super) fn moved(&mut self, now: Duration, full_ms: Option<f64>, target_ms: f64) {
        let scale = self.scale_at(now).unwrap_or_else(|| full_ms.map_or(1.0, |full_ms| share_for(full_ms, target_ms)));
        self.moving = Some((now.saturating_add(SETTLE), scale));
    }

    /// The share of width and height; `None` if nothing moves.
    pub(super) fn scale_at(&self, now: Duration) -> Option<f64> {
        self.moving.filter(|(until, _)| now < *until).map(|(_, scale)| scale)
    }

    /// How long until it counts as still; `None` if it does.
    pub(super) fn rest(&self, now: Duration) -> Option<Duration> {
        self.moving.and_then(|(until, _)| until.checked_sub(now)).filter(|rest| !rest.is_zero())
    }
}

/// The share of width and height at which a frame takes `target_ms`: time goes with the number of pixels.
fn share_for(full_ms: f64, target_ms: f64) -> f64 {
    let share = (target_ms / full_ms).sqrt();
    if share >= SCALE_MAX || share.is_nan() { 1.0 } else { share.max(SCALE_MIN) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    const TARGET_MS: f64 = 40.0;

    #[test]
    fn fast_frames_stay_in_full_and_slow_ones_become_smaller() {
        let share_for = |full_ms| super::share_for(full_ms, TARGET_MS);
        assert_eq!([0.0, 5.0, TARGET_MS].map(share_for), [1.0; 3]);
        assert_eq!(share_for(4.0 * TARGET_MS), 0.5, "a quarter and its root are exact");
        assert_eq!([share_for(1e9), share_for(f64::NAN)], [SCALE_MIN, 1.0]);
    }

    #[test]
    fn the_share_stays_during_a_motion_and_ends_with_it() {
        let mut motion = Motion::default();
        assert_eq!((motion.scale_at(ms(0)), motion.rest(ms(0))), (None, None));
        motion.moved(ms(0), Some(4.0 * TARGET_MS), TARGET_MS);
        motion.moved(ms(100), Some(TARGET_MS), TARGET_MS);
        assert_eq!(motion.scale_at(ms(299)), Some(0.5));
        assert_eq!(motion.rest(ms(299)), Some(ms(1)));
        assert_eq!((motion.scale_at(ms(300)), motion.rest(ms(300))), (None, None));
        motion.moved(ms(300), Some(TARGET_MS), TARGET_MS);
        assert_eq!(motion.scale_at(ms(301)), Some(1.0), "the next motion decides anew");
    }
}

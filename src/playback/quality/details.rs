//! Error of frames of few rays with details of an earlier one, compared to that of other rungs.

use super::Quality;
use crate::render::residual::RENEWAL_FRAMES;
use std::collections::VecDeque;

/// Measurements expire after this many frames.
const LIFE: u32 = 250;
/// Lower bound of an adaptive image's root mean square error over its contrast (docs/sampling.md, *What it costs*: 0.0031 to 0.008).
const LEAST_OF_CONTRAST: f64 = 0.0031;
/// Once in use, details stay until their error exceeds the other rung's by this factor.
const STAY: f64 = 1.25;
/// The share of width and height that has as many rays as a frame with details.
const SHARE: f64 = 0.25;

/// Errors of the last frames with details.
#[derive(Clone, Debug, Default)]
pub(super) struct DetailsError {
    /// Root mean square errors with details and without, the newest at the end: each of another part of the image, together of all of it.
    recent: VecDeque<[f64; 2]>,
    /// Frames since the newest error.
    age: u32,
    /// Whether the last frame was drawn with details.
    pub(super) is_in_use: bool,
}

impl DetailsError {
    /// Adds the errors of a frame; ignores errors that are not finite.
    pub(super) fn add(&mut self, rmse: [f64; 2]) {
        if !rmse.iter().all(|rmse| rmse.is_finite()) {
            return;
        }
        if self.recent.len() == RENEWAL_FRAMES {
            self.recent.pop_front();
        }
        self.recent.push_back(rmse);
        self.age = 0;
    }

    /// Counts a frame of any rung.
    pub(super) fn pass(&mut self) {
        self.age += 1;
        if self.age > LIFE {
            self.recent.clear();
        }
    }

    /// Whether frames with details have a smaller error than the least of `other`, or no error is known yet.
    pub(super) fn is_better_than(&self, other: Quality) -> bool {
        if self.recent.is_empty() {
            return !matches!(other, Quality::Faces(_) | Quality::Points(_));
        }
        let mean = |which: usize| {
            let sum: f64 = self.recent.iter().map(|rmse| rmse[which] * rmse[which]).sum();
            (sum / self.recent.len() as f64).sqrt()
        };
        let least = match other {
            Quality::Rays(contrast) => LEAST_OF_CONTRAST * f64::from(contrast.get()),
            // Bilinear interpolation is of second order where an image is smooth, and falls more slowly where it is not.
            Quality::Scaled(share) => mean(1) * (SHARE / share).powi(2),
            Quality::Exact | Quality::Details | Quality::Faces(_) | Quality::Points(_) => return false,
        };
        mean(0) < if self.is_in_use { STAY * least } else { least }
    }
}

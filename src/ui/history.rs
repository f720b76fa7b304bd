//! Costs of the last frames, to be plotted.

use crate::pipeline::SharedFrame;
use std::collections::VecDeque;
use std::time::Duration;

/// Number of frames kept.
pub const HISTORY_FRAMES: usize = 240;

/// Cost of a shown frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Time on the caller's clock.
    pub at: Duration,
    /// Milliseconds of decode, order and render; zeros for a cached frame.
    pub ms: [f64; 3],
    /// Milliseconds since the frame before.
    pub ms_between: f64,
}

/// The last frames, oldest first.
#[derive(Clone, Debug, Default)]
pub struct History {
    frames: VecDeque<Cost>,
}

impl History {
    /// Adds a shown frame.
    pub(super) fn add(&mut self, at: Duration, frame: &SharedFrame, is_kept: bool) {
        let stats = &frame.stats;
        let ms = if is_kept {
            [0.0; 3]
        } else {
            [stats.ms_decode, stats.ms_order + stats.ms_place, stats.ms_begin + stats.ms_render]
        };
        self.push(at, ms);
    }

    fn push(&mut self, at: Duration, ms: [f64; 3]) {
        let between = self.frames.back().map_or(Duration::ZERO, |last| at.saturating_sub(last.at));
        if self.frames.len() == HISTORY_FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back(Cost { at, ms, ms_between: between.as_secs_f64() * 1e3 });
    }

    /// The frames, oldest first.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = &Cost> {
        self.frames.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_frames_are_forgotten() {
        let mut history = History::default();
        for i in 0..2 * HISTORY_FRAMES as u64 {
            history.push(Duration::from_millis(10 * i), [i as f64, 0.0, 0.0]);
        }
        assert_eq!(history.frames().len(), HISTORY_FRAMES);
        let first = history.frames().next().unwrap();
        assert_eq!((first.ms[0], first.ms_between), (HISTORY_FRAMES as f64, 10.0));
    }
}

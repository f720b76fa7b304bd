//! The frame on the screen, frames on their way there, and dropped steps.

use crate::pipeline::FrameTime;
use std::collections::VecDeque;

/// Largest number of frames on their way to the screen; for older ones the steps between are no longer known.
const ON_THE_WAY: usize = 16;

/// The frames that were handed out and shown. Steps are counted as the clock passes them, so that those in between are known.
#[derive(Clone, Debug, Default)]
pub struct Screen {
    shown: Option<FrameTime>,
    /// Number of the shown step in the count `passed`.
    shown_at: u64,
    /// Number of steps passed.
    passed: u64,
    /// Frames handed out and not shown, with the number of their step.
    on_the_way: VecDeque<(FrameTime, u64)>,
    dropped: u64,
    moves: u64,
}

impl Screen {
    /// Whether this frame is on the screen.
    pub fn shows(&self, frame: FrameTime) -> bool {
        self.shown == Some(frame)
    }

    /// Counts steps that the clock has passed.
    pub fn passed(&mut self, steps: u64) {
        self.passed = self.passed.saturating_add(steps);
    }

    /// The clock has jumped: steps in between were not dropped.
    pub fn moved(&mut self) {
        self.moves = self.moves.wrapping_add(1);
        self.on_the_way.clear();
        self.passed = self.passed.saturating_add(1);
        self.shown_at = self.passed - 1;
    }

    /// The frame on the screen is that of the clock.
    pub fn caught_up(&mut self) {
        self.on_the_way.clear();
        self.shown_at = self.passed;
    }

    /// Number of jumps (wrapping), to detect one between two calls.
    pub fn moves(&self) -> u64 {
        self.moves
    }

    /// Hands out a frame; returns how many steps were passed over since the shown one.
    pub fn hand_out(&mut self, frame: FrameTime) -> u64 {
        if self.on_the_way.back() != Some(&(frame, self.passed)) {
            if self.on_the_way.len() == ON_THE_WAY {
                self.on_the_way.pop_front();
            }
            self.on_the_way.push_back((frame, self.passed));
        }
        between(self.shown_at, self.passed)
    }

    /// Records a shown frame; returns whether it differs from the one before.
    pub fn show(&mut self, frame: FrameTime) -> bool {
        if let Some(at) = self.on_the_way.iter().position(|&(handed_out, _)| handed_out == frame)
            && let Some((_, number)) = self.on_the_way.drain(..=at).next_back()
        {
            self.dropped = self.dropped.saturating_add(between(self.shown_at, number));
            self.shown_at = number;
        }
        self.shown.replace(frame) != Some(frame)
    }

    /// Number of steps dropped between shown frames.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Resets the count of dropped steps.
    pub fn forget_dropped(&mut self) {
        self.dropped = 0;
    }
}

/// How many integers lie between two.
fn between(first: u64, last: u64) -> u64 {
    last.saturating_sub(first).saturating_sub(1)
}

//! What is on the screen, what is on its way there, and what never got there.

use crate::pipeline::FrameTime;
use std::collections::VecDeque;

/// So many frames may be on their way to the screen; of older ones it is no longer known how many steps lay between.
const ON_THE_WAY: usize = 16;

/// The frames that were handed out and shown. Steps are counted as the clock passes them, so that those in between are known.
#[derive(Clone, Debug, Default)]
pub struct Screen {
    shown: Option<FrameTime>,
    /// Number of the step shown, among those passed.
    shown_at: u64,
    /// Steps passed up to now.
    passed: u64,
    /// Frames handed out and not shown, with the number of their step.
    on_the_way: VecDeque<(FrameTime, u64)>,
    dropped: u64,
    moves: u64,
}

impl Screen {
    /// Whether this is what is on the screen.
    pub fn shows(&self, frame: FrameTime) -> bool {
        self.shown == Some(frame)
    }

    /// The clock has passed so many steps.
    pub fn passed(&mut self, steps: u64) {
        self.passed = self.passed.saturating_add(steps);
    }

    /// The clock has gone elsewhere: what lies between was not dropped.
    pub fn moved(&mut self) {
        self.moves = self.moves.wrapping_add(1);
        self.on_the_way.clear();
        self.passed = self.passed.saturating_add(1);
        self.shown_at = self.passed - 1;
    }

    /// What is on the screen is what the clock stands at.
    pub fn caught_up(&mut self) {
        self.on_the_way.clear();
        self.shown_at = self.passed;
    }

    /// Tells two moments apart between which the clock has gone elsewhere.
    pub fn moves(&self) -> u64 {
        self.moves
    }

    /// A frame goes on its way; how many steps were passed over since the one that is shown.
    pub fn hand_out(&mut self, frame: FrameTime) -> u64 {
        if self.on_the_way.back() != Some(&(frame, self.passed)) {
            if self.on_the_way.len() == ON_THE_WAY {
                self.on_the_way.pop_front();
            }
            self.on_the_way.push_back((frame, self.passed));
        }
        between(self.shown_at, self.passed)
    }

    /// A frame is there; whether it is another than before.
    pub fn show(&mut self, frame: FrameTime) -> bool {
        if let Some(at) = self.on_the_way.iter().position(|&(handed_out, _)| handed_out == frame)
            && let Some((_, number)) = self.on_the_way.drain(..=at).next_back()
        {
            self.dropped = self.dropped.saturating_add(between(self.shown_at, number));
            self.shown_at = number;
        }
        self.shown.replace(frame) != Some(frame)
    }

    /// Steps dropped in what was shown.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Counts them anew.
    pub fn forget_dropped(&mut self) {
        self.dropped = 0;
    }
}

/// How many numbers lie between two.
fn between(first: u64, last: u64) -> u64 {
    last.saturating_sub(first).saturating_sub(1)
}

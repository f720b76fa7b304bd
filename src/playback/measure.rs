//! Elapsed time of a playback, and the rate of shown frames.

use std::collections::VecDeque;
use std::time::Duration;

/// A gap between two calls that exceeds the announced wait by this much means that the machine or process was suspended: no time passes in
/// it.
const SUSPENDED: Duration = Duration::from_secs(10);

/// A stopwatch with an initial reading. Its reading is exact however long the clock has run before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stopwatch {
    started: Duration,
    ahead_secs: f64,
}

/// Elapsed time, derived from the caller's, which may jump.
#[derive(Clone, Debug, Default)]
pub struct Elapsed {
    last: Option<Duration>,
    total: Duration,
}

impl Elapsed {
    /// Advances to the caller's time `now`. Time that goes back counts as no time, and so does a leap of more than the expected wait and
    /// [`SUSPENDED`]. With `None` a gap may be of any length.
    pub fn tick(&mut self, now: Duration, expected_wait: Option<Duration>) {
        let passed = now.saturating_sub(self.last.unwrap_or(now));
        self.last = Some(now);
        if expected_wait.is_none_or(|wait| passed <= wait.saturating_add(SUSPENDED)) {
            self.total = self.total.saturating_add(passed);
        }
    }

    /// Time since the first call.
    pub fn total(&self) -> Duration {
        self.total
    }

    /// A stopwatch that reads `ahead_secs` now.
    pub fn stopwatch(&self, ahead_secs: f64) -> Stopwatch {
        Stopwatch { started: self.total, ahead_secs }
    }

    /// Current reading of a stopwatch, seconds.
    pub fn secs(&self, stopwatch: Stopwatch) -> f64 {
        self.total.saturating_sub(stopwatch.started).as_secs_f64() + stopwatch.ahead_secs
    }
}

/// Measures the recent frame rate.
#[derive(Clone, Debug, Default)]
pub struct RateMeter {
    shown: VecDeque<Duration>,
}

/// The rate is over the last frames that span at least this long. One screen refresh at 60 Hz, which a frame may be late by, is less than a
/// hundredth of it.
const WINDOW: Duration = Duration::from_secs(2);

/// Largest number of frames in the window.
const WINDOW_FRAMES: usize = 1024;

impl RateMeter {
    /// Counts a shown frame.
    pub fn frame(&mut self, now: Duration) {
        self.shown.push_back(now);
        // The oldest frame is needed until the others span the window.
        let old = |shown: &VecDeque<Duration>| shown.get(1).is_some_and(|second| now.saturating_sub(*second) >= WINDOW);
        while self.shown.len() > 2 && (old(&self.shown) || self.shown.len() > WINDOW_FRAMES) {
            self.shown.pop_front();
        }
    }

    /// Forgets earlier frames.
    pub fn restart(&mut self) {
        self.shown.clear();
    }

    /// Frames per second, from two frames on.
    pub fn rate(&self) -> Option<f64> {
        let duration = self.shown.back()?.saturating_sub(*self.shown.front()?);
        let rate = (self.shown.len() - 1) as f64 / duration.as_secs_f64();
        (rate > 0.0 && rate.is_finite()).then_some(rate)
    }
}

//! Time as the clock counts it, and the rate at which frames were shown.

use std::collections::VecDeque;
use std::time::Duration;

/// A gap between two calls that is so much longer than the clock had said it could wait is not a renderer at work but a machine
/// that slept or a process that was stopped: no time passes in it.
const SUSPENDED: Duration = Duration::from_secs(10);

/// Started at some moment, at so many seconds. What it says is exact however long the clock has run before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stopwatch {
    started: Duration,
    ahead_secs: f64,
}

/// Time that has passed, from the caller's, which may jump.
#[derive(Clone, Debug, Default)]
pub struct Elapsed {
    last: Option<Duration>,
    total: Duration,
}

impl Elapsed {
    /// The caller's time is `now`. Time that goes back stands still, and goes on from there; so does time that leaps by more
    /// than the wait expected and [`SUSPENDED`]. With `None` it may take as long as it likes.
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

    /// A stopwatch that says `ahead_secs` now.
    pub fn stopwatch(&self, ahead_secs: f64) -> Stopwatch {
        Stopwatch { started: self.total, ahead_secs }
    }

    /// What a stopwatch says now.
    pub fn secs(&self, stopwatch: Stopwatch) -> f64 {
        self.total.saturating_sub(stopwatch.started).as_secs_f64() + stopwatch.ahead_secs
    }
}

/// How many frames a second were shown lately.
#[derive(Clone, Debug, Default)]
pub struct RateMeter {
    shown: VecDeque<Duration>,
}

/// The last frames that took at least so long count. One screen refresh at 60 Hz, which a frame may be late for, is less than a
/// hundredth of it.
const WINDOW: Duration = Duration::from_secs(2);

/// So many frames count at most.
const WINDOW_FRAMES: usize = 1024;

impl RateMeter {
    /// A frame was shown.
    pub fn frame(&mut self, now: Duration) {
        self.shown.push_back(now);
        // The first one is needed as long as the others have not taken long enough.
        let old = |shown: &VecDeque<Duration>| shown.get(1).is_some_and(|second| now.saturating_sub(*second) >= WINDOW);
        while self.shown.len() > 2 && (old(&self.shown) || self.shown.len() > WINDOW_FRAMES) {
            self.shown.pop_front();
        }
    }

    /// What was shown up to here does not count.
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

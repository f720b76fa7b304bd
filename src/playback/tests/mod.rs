//! The clock as a user meets it, with a fake time.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on should panic")]

mod commands;
mod growth;
mod modes;
mod properties;
mod real_time;

use super::*;
use crate::field::TimeAxis;
use crate::pipeline::FrameTime;
use std::time::Duration;

/// Times of the tests are sums of a few durations, each rounded to a nanosecond. Measured: 4e-9 of a time.
const FEW_NANOSECONDS: f64 = 1e-8;

/// The same time, or the same rate.
fn is_same(found: f64, expected: f64) -> bool {
    (found / expected - 1.0).abs() <= FEW_NANOSECONDS
}

#[test]
fn the_comparison_of_times_notices_a_microsecond() {
    assert!(is_same(0.25, 0.25) && !is_same(0.25, 0.250_001) && !is_same(f64::NAN, 0.25));
}

fn secs(secs: f64) -> Duration {
    Duration::from_secs_f64(secs)
}

/// 0, 1, 2, ..
fn uniform(steps: usize) -> TimeAxis {
    TimeAxis { values: (0..steps).map(|step| step as f64).collect() }
}

/// A clock, a time, and a screen that shows what is due.
struct Player {
    clock: Clock,
    now: Duration,
    /// What was shown and when.
    shown: Vec<(f64, FrameTime)>,
    /// How long it takes to show a frame.
    render: Duration,
}

impl Player {
    fn new(times: TimeAxis) -> Self {
        Self { clock: Clock::new(times), now: Duration::ZERO, shown: Vec::new(), render: Duration::ZERO }
    }

    fn with(steps: usize, commands: &[Command]) -> Self {
        let mut player = Self::new(uniform(steps));
        commands.iter().for_each(|&command| player.apply(command));
        player
    }

    fn apply(&mut self, command: Command) {
        self.clock.apply(command, self.now).unwrap();
    }

    /// Shows what is due; how long there is nothing to do.
    fn refresh(&mut self) -> Option<Duration> {
        let due = self.clock.due(self.now);
        let Some(frame) = due.frame else { return due.wait };
        self.now += self.render;
        self.clock.frame_shown(frame, self.now);
        self.shown.push((self.now.as_secs_f64(), frame));
        Some(Duration::ZERO)
    }

    /// Looks every `period` for so many seconds; it sleeps instead if there is a wait and `period` is zero.
    fn run(&mut self, duration_secs: f64, period: Duration) {
        let end = self.now + secs(duration_secs);
        while self.now < end {
            let wait = self.refresh();
            let pause = if period.is_zero() { wait.unwrap_or(end) } else { period };
            self.now += pause.min(end.saturating_sub(self.now));
        }
    }

    /// Sleeps as long as the clock says, until it has shown so many frames in all or there is nothing to come.
    fn show(&mut self, frames: usize) {
        while self.shown.len() < frames {
            let Some(wait) = self.refresh() else { break };
            self.now += wait;
        }
    }

    fn steps(&self) -> Vec<usize> {
        self.shown.iter().map(|(_, frame)| frame.step()).collect()
    }

    fn state(&self) -> State {
        self.clock.state()
    }

    fn upcoming(&self, n: usize) -> Vec<usize> {
        self.clock.upcoming(n).map(FrameTime::step).collect()
    }
}

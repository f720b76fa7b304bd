//! Tests of the clock's public interface, with a fake time.
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

/// Whether two times or rates are equal but for rounding.
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

/// A clock, a time, and a screen that shows the due frame.
struct Player {
    clock: Clock,
    now: Duration,
    /// Frames shown and their times.
    shown: Vec<(f64, FrameTime)>,
    /// Time to render a frame.
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

    /// Shows the due frame; returns the clock's wait.
    fn refresh(&mut self) -> Option<Duration> {
        let due = self.clock.due(self.now);
        let Some(frame) = due.frame else { return due.wait };
        self.now += self.render;
        self.clock.frame_shown(frame, self.now);
        self.shown.push((self.now.as_secs_f64(), frame));
        Some(Duration::ZERO)
    }

    /// Refreshes every `period` for `duration_secs`; it sleeps instead if there is a wait and `period` is zero.
    fn run(&mut self, duration_secs: f64, period: Duration) {
        let end = self.now + secs(duration_secs);
        while self.now < end {
            let wait = self.refresh();
            let pause = if period.is_zero() { wait.unwrap_or(end) } else { period };
            self.now += pause.min(end.saturating_sub(self.now));
        }
    }

    /// Sleeps as the clock asks, until it has shown `frames` frames in all or none is to come.
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

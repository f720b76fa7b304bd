//! The position of a playback between two steps, and the next step.

use super::command::{Direction, Mode, Settings};
use super::sequence::{Sequence, Successor};
use crate::field::TimeAxis;
use crate::pipeline::FrameTime;

/// Shortest and longest interval, in seconds, whatever the times and the speed: quotients and sums stay finite. The first is below any
/// frame's cost, the second thirty million years.
const INTERVAL_SECS: (f64, f64) = (1e-9, 1e15);

/// An interpolation weight below this counts as 0: it would change no f32 by more than its rounding unit, unless the two steps differ by a
/// factor of 64.
const SMALLEST_WEIGHT: f64 = 1e-9;

/// A series and how it is played.
#[derive(Clone, Copy, Debug)]
pub struct Score<'a> {
    pub times: &'a TimeAxis,
    pub settings: &'a Settings,
    pub sequence: Sequence,
}

impl Score<'_> {
    /// Whether steps are interpolated.
    pub fn mixes(&self) -> bool {
        self.settings.mode == Mode::RealTime && self.settings.interpolate
    }
}

/// The interval from one step to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// The step on the screen unless steps are interpolated: the last one reached. Differs from `from` after a turn in between two steps,
    /// until the next one is reached.
    pub held: usize,
    pub from: usize,
    /// The next step; `None` at the end, or if there is no other step.
    pub next: Option<Successor>,
    /// Whether ping-pong is on its way back.
    pub returning: bool,
}

impl Course {
    /// A course exactly at a step.
    pub fn at_step(step: usize, returning: bool, score: &Score<'_>) -> Self {
        let next = score.sequence.after(step, heading(score.settings, returning));
        Self { held: step, from: step, next, returning }
    }

    /// The course where playing begins.
    pub fn start(score: &Score<'_>) -> Self {
        Self::at_step(score.sequence.start(score.settings.direction), false, score)
    }

    /// The course at a time of the series, and the share of the interval that has passed. `held` stays on the screen until a step is
    /// reached; with `None` it is the step shown at that time.
    ///
    /// The interval is between neighbouring steps of the lattice: only steps that are played are interpolated.
    pub fn at_time(time: f64, held: Option<usize>, returning: bool, score: &Score<'_>) -> (Self, f64) {
        let values = &score.times.values;
        let step = values.partition_point(|&t| t <= time).saturating_sub(1);
        let next = (step + 1).min(values.len().saturating_sub(1));
        let mixes = held.is_some() || score.mixes();
        let nearest = FrameTime::at(score.times, &[step, next], time, mixes).map_or(step, FrameTime::step);
        if nearest != step || next == step || time_of(step, score) >= time {
            return (Self::at_step(nearest, returning, score), 0.0);
        }
        let (lower, upper) = score.sequence.around(step).unwrap_or((step, next));
        let (from, to) = match heading(score.settings, returning) {
            Direction::Forward => (lower, upper),
            Direction::Backward => (upper, lower),
        };
        let next = Some(Successor { step: to, jump: false, turned: false });
        let (begin, end, time) = (0.5 * time_of(from, score), 0.5 * time_of(to, score), 0.5 * time);
        let progress = ((time - begin) / (end - begin)).clamp(0.0, 1.0);
        (Self { held: held.unwrap_or(step), from, next, returning }, progress)
    }

    /// Advances to the next step, if there is one; returns whether the shown step changed.
    pub fn arrive(&mut self, score: &Score<'_>) -> bool {
        let Some(next) = self.next else { return false };
        let changed = next.step != self.held;
        *self = Self::at_step(next.step, self.returning != next.turned, score);
        changed
    }

    /// Duration of the interval in seconds; `None` if there is no next step.
    ///
    /// In real time, the interval between the two times of the file; a jump takes as long as the interval before it.
    pub fn duration_secs(&self, score: &Score<'_>) -> Option<f64> {
        let next = self.next?;
        let duration = match score.settings.mode {
            Mode::AsFastAsPossible => return Some(0.0),
            Mode::EveryStep => 1.0 / score.settings.frames_per_second,
            Mode::RealTime => {
                let to = if next.jump { self.step_before(score) } else { next.step };
                let half_interval = (0.5 * time_of(to, score) - 0.5 * time_of(self.from, score)).abs();
                half_interval / (0.5 * speed(score))
            }
        };
        // In this order a NaN, from times that are NaN, becomes the shortest.
        Some(duration.max(INTERVAL_SECS.0).min(INTERVAL_SECS.1))
    }

    /// The step one stride before `from`; at the end of the series the one a stride after it.
    fn step_before(&self, score: &Score<'_>) -> usize {
        let last = score.times.len().saturating_sub(1);
        let stride = score.settings.stride;
        let (earlier, later) = (self.from.saturating_sub(stride), self.from.saturating_add(stride).min(last));
        let (before, behind) = match heading(score.settings, self.returning) {
            Direction::Forward => (earlier, later),
            Direction::Backward => (later, earlier),
        };
        if before == self.from { behind } else { before }
    }

    /// The file's time after a share of the interval; outside of real time, that of the step.
    pub fn time(&self, progress: f64, score: &Score<'_>) -> f64 {
        let from = time_of(self.from, score);
        let moves = progress > 0.0 && score.settings.mode == Mode::RealTime;
        let Some(next) = self.next.filter(|next| moves && !next.jump) else { return from };
        let to = time_of(next.step, score);
        // Rounding could leave the interval.
        (from * (1.0 - progress) + to * progress).max(from.min(to)).min(from.max(to))
    }

    /// The frame to show after a share of the interval.
    pub fn frame(&self, progress: f64, score: &Score<'_>) -> FrameTime {
        if !score.mixes() {
            return self.held.into();
        }
        match self.next.filter(|next| !next.jump) {
            Some(next) if progress > 1.0 - SMALLEST_WEIGHT => next.step.into(),
            // The earlier step comes first, so that interpolation is the same in both directions.
            Some(next) if progress > SMALLEST_WEIGHT && self.from < next.step => {
                FrameTime::between(self.from, next.step, progress)
            }
            Some(next) if progress > SMALLEST_WEIGHT => FrameTime::between(next.step, self.from, 1.0 - progress),
            _ => self.from.into(),
        }
    }
}

/// Current direction.
pub fn heading(settings: &Settings, returning: bool) -> Direction {
    if returning { settings.direction.reversed() } else { settings.direction }
}

/// The file's time units per second in real time.
pub fn speed(score: &Score<'_>) -> f64 {
    score.settings.time_per_second.unwrap_or_else(|| default_speed(score.times))
}

/// The speed at which the series lasts [`Settings::DEFAULT_DURATION_SECS`]; 1 if it has no extent.
pub fn default_speed(times: &TimeAxis) -> f64 {
    let (Some(first), Some(last)) = (times.values.first(), times.values.last()) else { return 1.0 };
    // Divided before the difference, which could overflow.
    let speed = last / Settings::DEFAULT_DURATION_SECS - first / Settings::DEFAULT_DURATION_SECS;
    if speed > 0.0 && speed.is_finite() { speed } else { 1.0 }
}

fn time_of(step: usize, score: &Score<'_>) -> f64 {
    score.times.values.get(step).copied().unwrap_or(f64::NAN)
}

//! Intervals of a series, each with its own ranking (dissertation 6.1.4.1).

use serde::{Deserialize, Serialize};

/// An interval of steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Interval {
    /// First step.
    pub first: usize,
    /// Step after the last one.
    pub end: usize,
    /// The step whose scalars represent the interval: the middle one, the earlier of two.
    pub sampled: usize,
}

/// How to partition a series into intervals. A count of 0 means 1, and there are no more intervals than steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Partition {
    /// This number of intervals of equal length, to a step.
    Regular(usize),
    /// This number of intervals whose lengths grow by a constant factor, the n-th root of [`Partition::GROWTH`]: for early events that
    /// fade.
    Logarithmic(usize),
    /// This number of intervals, each with an equal share of the change from step to step: short where much changes. Repeatedly splits the
    /// interval with the most change at half of it.
    Greedy(usize),
}

impl Default for Partition {
    fn default() -> Self {
        Self::Regular(Self::USUAL)
    }
}

impl Partition {
    /// Default number of intervals.
    pub const USUAL: usize = 6;
    /// Growth of the lengths in a logarithmic partition of n intervals, extrapolated over n + 1 of them.
    pub const GROWTH: f64 = 64.0;

    /// The requested number of intervals.
    pub fn count(self) -> usize {
        match self {
            Self::Regular(n) | Self::Logarithmic(n) | Self::Greedy(n) => n.max(1),
        }
    }

    /// The same with another number of intervals.
    #[must_use]
    pub fn of(self, count: usize) -> Self {
        match self {
            Self::Regular(_) => Self::Regular(count),
            Self::Logarithmic(_) => Self::Logarithmic(count),
            Self::Greedy(_) => Self::Greedy(count),
        }
    }

    /// The intervals of a series of `steps` steps; none if it has none. `changes` are the [`step_change`]s into each step from the one
    /// before (entry 0 is ignored), for [`Partition::Greedy`] only; missing and non-finite ones count as 0.
    pub fn intervals(self, steps: usize, changes: &[f64]) -> Vec<Interval> {
        if steps == 0 {
            return Vec::new();
        }
        let count = self.count().min(steps);
        let ends = match self {
            Self::Regular(_) => (1..=count).map(|i| (i as u128 * steps as u128 / count as u128) as usize).collect(),
            Self::Logarithmic(_) => logarithmic(steps, count),
            Self::Greedy(_) => greedy(steps, count, changes),
        };
        let mut first = 0;
        let interval = |end: usize| {
            let begin = std::mem::replace(&mut first, end);
            Interval { first: begin, end, sampled: begin + (end - begin - 1) / 2 }
        };
        ends.into_iter().map(interval).collect()
    }
}

/// The interval of `step`; the last one if it is beyond all of them.
pub fn interval_at(intervals: &[Interval], step: usize) -> Option<&Interval> {
    intervals.get(intervals.partition_point(|interval| interval.end <= step)).or(intervals.last())
}

/// Change of a field from one step to the next: mean squared difference over the vertices with finite values in both. 0 if there are none.
pub fn step_change(before: &[f32], after: &[f32]) -> f64 {
    let differences = before.iter().zip(after).map(|(&a, &b)| f64::from(b) - f64::from(a)).filter(|d| d.is_finite());
    let (sum, count) = differences.fold((0.0, 0u64), |(sum, count), d| (sum + d * d, count + 1));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// Ends of intervals of geometrically growing lengths, one step at least each.
fn logarithmic(steps: usize, count: usize) -> Vec<usize> {
    let mut end = 0;
    let at = |i: usize| {
        let share = (Partition::GROWTH.powf(i as f64 / count as f64) - 1.0) / (Partition::GROWTH - 1.0);
        let ideal = (share * steps as f64).round() as usize;
        // One step for this interval, and one for each later interval.
        end = ideal.clamp(end + 1, steps - (count - i));
        end
    };
    (1..=count).map(at).collect()
}

/// Ends of intervals with equal shares of change.
fn greedy(steps: usize, count: usize, changes: &[f64]) -> Vec<usize> {
    // total[t]: change up to step t.
    let mut total = Vec::with_capacity(steps);
    let mut sum = 0.0;
    for step in 0..steps {
        let change = if step == 0 { 0.0 } else { changes.get(step).copied().unwrap_or_default() };
        sum += if change.is_finite() { change.max(0.0) } else { 0.0 };
        total.push(sum);
    }
    // Change within first..end: into its second step and all later ones.
    let within = |first: usize, end: usize| total[end - 1] - total[first];
    let mut ends = vec![steps];
    while ends.len() < count {
        let first = |i: usize| if i == 0 { 0 } else { ends[i - 1] };
        // The interval with the most change; if nothing changes, the longest; the earliest of equals.
        let rank = |i: usize| (within(first(i), ends[i]), ends[i] - first(i));
        let better = |a: usize, b: usize| if rank(b) > rank(a) { b } else { a };
        let Some(cut) = (0..ends.len()).filter(|&i| ends[i] - first(i) > 1).reduce(better) else { break };
        let (begin, end) = (first(cut), ends[cut]);
        let change = within(begin, end);
        let middle = if change > 0.0 {
            // The first step at which half of the change is exceeded.
            let half = total[begin] + 0.5 * change;
            begin + total[begin..end].partition_point(|&so_far| so_far <= half)
        } else {
            begin + (end - begin) / 2
        };
        ends.insert(cut, middle.clamp(begin + 1, end - 1));
    }
    ends
}

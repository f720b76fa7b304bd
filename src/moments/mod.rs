//! One-pass statistics of a series: ranges per step and over all steps, mean and variance per vertex; histograms.
//!
//! The mean and the sum of squared deviations follow Welford, "Note on a method for calculating corrected sums of
//! squares and products", Technometrics 4 (1962): in f64, one division a sample, no large intermediate sums. A constant
//! series has a variance of exactly 0, and a large common offset costs nothing. Non-finite samples are left out and
//! counted; -0 counts as smaller than +0, so that a range has one answer whatever the order of the comparisons.

mod bins;
mod distribution;
mod histogram;
#[cfg(test)]
mod histogram_tests;
mod spread;
#[cfg(test)]
mod tests;

pub use bins::{AxisScale, Bins, shares};
pub use distribution::Distribution;
pub use histogram::{CountScale, Histogram1d, Histogram2d};
pub use spread::{CovDenominator, VertexStatistics};

use rayon::prelude::*;

/// Vertices that one task accumulates; fixed, so that the result cannot depend on the number of threads.
const CHUNK: usize = 8192;

/// Range and non-finite count of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepSummary {
    /// Least and greatest finite value; `None` if there is none.
    pub range: Option<[f32; 2]>,
    /// Number of NaN and infinite values.
    pub nonfinite: u64,
}

impl StepSummary {
    /// The summary of no values.
    pub const EMPTY: Self = Self { range: None, nonfinite: 0 };

    /// The summary of both sets of values together.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let range = match (self.range, other.range) {
            (Some(a), Some(b)) => Some([least(a[0], b[0]), greatest(a[1], b[1])]),
            (a, b) => a.or(b),
        };
        Self { range, nonfinite: self.nonfinite + other.nonfinite }
    }

    /// The summary of a step's values.
    pub fn of(values: &[f32]) -> Self {
        values.iter().fold(Self::EMPTY, |summary, &v| {
            summary.merge(if v.is_finite() {
                Self { range: Some([v, v]), nonfinite: 0 }
            } else {
                Self { range: None, nonfinite: 1 }
            })
        })
    }
}

/// The lesser by total order (-0 before +0); neither may be NaN.
fn least(a: f32, b: f32) -> f32 {
    if b.total_cmp(&a).is_lt() { b } else { a }
}

/// The greater by total order (-0 before +0); neither may be NaN.
fn greatest(a: f32, b: f32) -> f32 {
    if b.total_cmp(&a).is_gt() { b } else { a }
}

/// Running statistics of one vertex.
#[derive(Clone, Copy, Debug, Default)]
struct Accumulator {
    /// Mean of the finite samples.
    mean: f64,
    /// Sum of squared deviations from the mean.
    m2: f64,
    /// Number of finite samples.
    count: u32,
}

impl Accumulator {
    fn add(&mut self, value: f64) {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / f64::from(self.count);
        self.m2 += before * (value - self.mean);
    }
}

/// Statistics of a series that arrives one step at a time. Memory: 24 bytes a vertex.
#[derive(Clone, Debug)]
pub struct Moments {
    vertices: Vec<Accumulator>,
    steps: Vec<StepSummary>,
    /// Summaries of the chunks of the current step, kept for their memory.
    parts: Vec<StepSummary>,
    /// Non-finite values of earlier steps, whose summaries do not count them.
    nonfinite_before: u64,
}

/// All numbers of a [`Moments`], from which [`Moments::from_state`] goes on bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct MomentsState {
    /// Mean of each vertex's finite samples.
    pub means: Vec<f64>,
    /// Sum of the squared deviations from it.
    pub squares: Vec<f64>,
    /// Number of each vertex's finite samples.
    pub counts: Vec<u32>,
    /// Range of each step; NaN if it has no finite value.
    pub ranges: Vec<[f32; 2]>,
    /// Number of non-finite values of each step.
    pub nonfinite: Vec<u64>,
    /// Number of those of steps before [`Moments::resume`].
    pub nonfinite_before: u64,
}

impl Moments {
    /// Statistics without steps, for `vertex_count` values a step.
    pub fn new(vertex_count: usize) -> Self {
        let vertices = vec![Accumulator::default(); vertex_count];
        Self { vertices, steps: Vec::new(), parts: Vec::new(), nonfinite_before: 0 }
    }

    /// Resumes from the statistics of the steps so far: those of the vertices, the range of each step, and the number of non-finite values
    /// of all steps. `None` if they are not valid.
    ///
    /// Means, ranges and counts continue bit for bit as if there had been no interruption. The variance does not: the sum of squared
    /// deviations is the product of a rounded quotient. With u = 2^-53 that product is within 2 u of the original sum (relatively, to first
    /// order); each step added to either sum rounds by at most u of it, and both only grow (every term is at least 0), so that nothing is
    /// amplified; the last quotient rounds either. After r interruptions and k steps since the first, variances differ by at most a share
    /// of 2 u (r + k + 1) from those of one pass. A variance of 0 stays 0.
    pub fn resume(statistics: &VertexStatistics, ranges: &[Option<[f32; 2]>], nonfinite: u64) -> Option<Self> {
        let VertexStatistics { mean, variance, finite_count } = statistics;
        let vertex = |((&mean, &variance), &count): ((&f64, &f64), &f64)| {
            if count == 0.0 {
                return Some(Accumulator::default());
            }
            let whole = (1.0..=ranges.len() as f64).contains(&count) && count.fract() == 0.0;
            let sound = whole && mean.is_finite() && variance.is_finite() && variance >= 0.0;
            sound.then_some(Accumulator { mean, m2: variance * count, count: count as u32 })
        };
        let vertices = mean.iter().zip(variance).zip(finite_count).map(vertex).collect::<Option<Vec<_>>>()?;
        let steps = ranges.iter().map(|&range| StepSummary { range, nonfinite: 0 }).collect();
        Some(Self { vertices, steps, parts: Vec::new(), nonfinite_before: nonfinite })
    }

    /// Number of values of a step.
    pub fn vertex_count(&self) -> usize {
        self.vertices.len()
    }

    /// All numbers, as they are.
    pub fn state(&self) -> MomentsState {
        MomentsState {
            means: self.vertices.iter().map(|v| v.mean).collect(),
            squares: self.vertices.iter().map(|v| v.m2).collect(),
            counts: self.vertices.iter().map(|v| v.count).collect(),
            ranges: self.steps.iter().map(|step| step.range.unwrap_or([f32::NAN; 2])).collect(),
            nonfinite: self.steps.iter().map(|step| step.nonfinite).collect(),
            nonfinite_before: self.nonfinite_before,
        }
    }

    /// The statistics that [`Moments::state`] was taken from, bit for bit; `None` if the numbers are not valid.
    pub fn from_state(state: &MomentsState) -> Option<Self> {
        let MomentsState { means, squares, counts, ranges, nonfinite, nonfinite_before } = state;
        // Half of what fits, so that no sum overflows.
        let is_count = *nonfinite_before <= u64::MAX / 2;
        if [squares.len(), counts.len()] != [means.len(); 2] || nonfinite.len() != ranges.len() || !is_count {
            return None;
        }
        let vertex = |((&mean, &m2), &count): ((&f64, &f64), &u32)| {
            let sound = mean.is_finite() && m2.is_finite() && m2 >= 0.0 && count as usize <= ranges.len();
            sound.then_some(Accumulator { mean, m2, count })
        };
        let vertices = means.iter().zip(squares).zip(counts).map(vertex).collect::<Option<Vec<_>>>()?;
        let step = |(&range, &nonfinite): (&[f32; 2], &u64)| {
            let is_none = range.iter().all(|end| end.is_nan());
            let sound = is_none || range.iter().all(|end| end.is_finite()) && range[0] <= range[1];
            let sound = sound && nonfinite <= means.len() as u64;
            sound.then_some(StepSummary { range: (!is_none).then_some(range), nonfinite })
        };
        let steps = ranges.iter().zip(nonfinite).map(step).collect::<Option<Vec<_>>>()?;
        Some(Self { vertices, steps, parts: Vec::new(), nonfinite_before: *nonfinite_before })
    }

    /// Adds the next step, one value per vertex. The result is the same for any number of threads.
    ///
    /// # Panics
    /// If the number of values is not the number of vertices.
    pub fn add_step(&mut self, values: &[f32]) -> StepSummary {
        assert_eq!(values.len(), self.vertices.len(), "one value per vertex");
        self.vertices
            .par_chunks_mut(CHUNK)
            .zip(values.par_chunks(CHUNK))
            .map(|(vertices, values)| add_chunk(vertices, values))
            .collect_into_vec(&mut self.parts);
        let summary = self.parts.iter().fold(StepSummary::EMPTY, |all, &part| all.merge(part));
        self.steps.push(summary);
        summary
    }

    /// Range and non-finite count of each step so far; the count is 0 for those before [`Moments::resume`].
    pub fn steps(&self) -> &[StepSummary] {
        &self.steps
    }

    /// Range and non-finite count over all steps so far.
    pub fn series(&self) -> StepSummary {
        let before = StepSummary { range: None, nonfinite: self.nonfinite_before };
        self.steps.iter().fold(before, |all, &step| all.merge(step))
    }

    /// Mean, variance and number of finite samples of every vertex so far.
    pub fn vertex_statistics(&self) -> VertexStatistics {
        let of = |f: fn(&Accumulator) -> f64| self.vertices.iter().map(f).collect();
        VertexStatistics {
            mean: of(|v| if v.count == 0 { f64::NAN } else { v.mean }),
            // The population variance: the steps are the whole series, not a sample of it.
            variance: of(|v| if v.count == 0 { f64::NAN } else { v.m2 / f64::from(v.count) }),
            finite_count: of(|v| f64::from(v.count)),
        }
    }
}

fn add_chunk(vertices: &mut [Accumulator], values: &[f32]) -> StepSummary {
    // Starting from the reversed infinite range keeps an Option out of the loop.
    let mut range = [f32::INFINITY, f32::NEG_INFINITY];
    let mut nonfinite = 0;
    for (vertex, &value) in vertices.iter_mut().zip(values) {
        if value.is_finite() {
            vertex.add(f64::from(value));
            range = [least(range[0], value), greatest(range[1], value)];
        } else {
            nonfinite += 1;
        }
    }
    StepSummary { range: (range[0] <= range[1]).then_some(range), nonfinite }
}

//! Errors of decoded values.
//!
//! The signal-to-noise ratio is 10 log10(variance of the whole set / mean squared error): of all steps together, and the
//! least and greatest of any single step, all against the variance of the whole set. Values that are not finite do not
//! count; codecs give them back exactly.

use crate::moments::VertexStatistics;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Vertices that one task compares; fixed, so that no sum depends on the number of threads.
const TASK: usize = 4096;

/// Errors of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct StepError {
    squares: f64,
    count: u64,
    largest: f64,
}

/// Sums of the errors of a field, step by step and vertex by vertex. Memory: 8 bytes a vertex.
#[derive(Clone, Debug, Default)]
pub struct ErrorTally {
    steps: Vec<StepError>,
    vertices: Vec<f64>,
}

impl ErrorTally {
    /// Numbers of a step in [`ErrorTally::parts`].
    pub(super) const PER_STEP: usize = 3;

    /// A tally without steps, of a field with `vertices` values a step.
    pub fn new(vertices: usize) -> Self {
        Self { steps: Vec::new(), vertices: vec![0.0; vertices] }
    }

    /// The sums as numbers: for each step its sum of squares, number of values and largest error; for each vertex its sum of squares.
    pub fn parts(&self) -> (Vec<[f64; Self::PER_STEP]>, &[f64]) {
        (self.steps.iter().map(|s| [s.squares, s.count as f64, s.largest]).collect(), &self.vertices)
    }

    /// The tally that [`ErrorTally::parts`] was taken from, bit for bit; `None` if the parts are not valid.
    pub fn from_parts(steps: &[[f64; Self::PER_STEP]], vertices: Vec<f64>) -> Option<Self> {
        let sound = |x: f64| x.is_finite() && x >= 0.0;
        let step = |&[squares, count, largest]: &[f64; Self::PER_STEP]| {
            let whole = count <= vertices.len() as f64 && count.fract() == 0.0;
            let sound = sound(squares) && sound(count) && whole && sound(largest);
            sound.then_some(StepError { squares, count: count as u64, largest })
        };
        let steps = steps.iter().map(step).collect::<Option<Vec<_>>>()?;
        vertices.iter().all(|&x| sound(x)).then_some(Self { steps, vertices })
    }

    /// Adds the next `values.len() / vertices` steps. `decode(step, first, out)` fills `out` with the decoded values of the vertices from
    /// `first` on; non-finite ones do not count.
    pub(super) fn add(&mut self, values: &[f32], decode: impl Fn(usize, usize, &mut [f32]) + Sync) {
        let vertices = self.vertices.len();
        if vertices == 0 {
            return;
        }
        let compare = |(task, squares): (usize, &mut [f64])| -> Vec<StepError> {
            let first = task * TASK;
            let mut decoded = vec![0.0; squares.len()];
            let of_step = |(step, row): (usize, &[f32])| {
                decode(step, first, &mut decoded);
                let mut error = StepError::default();
                for ((&x, &y), square) in row[first..].iter().zip(&decoded).zip(squares.iter_mut()) {
                    let difference = f64::from(x) - f64::from(y);
                    if difference.is_finite() {
                        error.squares += difference * difference;
                        error.count += 1;
                        error.largest = error.largest.max(difference.abs());
                        *square += difference * difference;
                    }
                }
                error
            };
            values.chunks_exact(vertices).enumerate().map(of_step).collect()
        };
        let parts: Vec<Vec<StepError>> = self.vertices.par_chunks_mut(TASK).enumerate().map(compare).collect();
        let begin = self.steps.len();
        self.steps.resize(begin + values.len() / vertices, StepError::default());
        for part in &parts {
            for (step, part) in self.steps[begin..].iter_mut().zip(part) {
                step.squares += part.squares;
                step.count += part.count;
                step.largest = step.largest.max(part.largest);
            }
        }
    }

    /// The error figures, given the statistics of the original values.
    pub fn quality(&self, statistics: &VertexStatistics) -> Quality {
        let squares: f64 = self.steps.iter().map(|s| s.squares).sum();
        let count: u64 = self.steps.iter().map(|s| s.count).sum();
        let variance = series_variance(statistics);
        let mean = |squares: f64, count: u64| squares / (count.max(1) as f64);
        let snr = |mse: f64| (mse > 0.0).then(|| 10.0 * (variance / mse).log10());
        let each = || self.steps.iter().filter(|s| s.count > 0).map(|s| mean(s.squares, s.count));
        let mse = mean(squares, count);
        let largest_mse = each().fold(0.0, f64::max);
        let least_mse = each().reduce(f64::min).unwrap_or(0.0);
        let rmse = mse.sqrt();
        Quality {
            snr_db: snr(mse),
            snr_min_db: snr(largest_mse),
            snr_max_db: snr(least_mse),
            max_error: self.steps.iter().map(|s| s.largest).fold(0.0, f64::max),
            rmse,
            over_sigma: self.over_sigma(statistics),
        }
    }

    fn over_sigma(&self, statistics: &VertexStatistics) -> OverSigma {
        let vertices = self.vertices.iter().zip(&statistics.variance).zip(&statistics.finite_count);
        let moving = vertices.filter(|((_, variance), _)| **variance > 0.0);
        let mut ratios: Vec<f64> =
            moving.map(|((squares, variance), count)| (squares / count / variance).sqrt()).collect();
        ratios.par_sort_unstable_by(f64::total_cmp);
        // Nearest rank.
        let at = |part: f64| {
            let rank = (part * ratios.len() as f64).ceil() as usize;
            ratios.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
        };
        OverSigma { median: at(0.5), p99: at(0.99), max: at(1.0) }
    }
}

/// Variance of all finite values: that within vertices plus that of their means.
fn series_variance(statistics: &VertexStatistics) -> f64 {
    let each = || {
        let vertices = statistics.mean.iter().zip(&statistics.variance).zip(&statistics.finite_count);
        vertices.map(|((&mean, &variance), &count)| (mean, variance, count)).filter(|&(.., count)| count > 0.0)
    };
    let count: f64 = each().map(|(.., count)| count).sum::<f64>().max(1.0);
    let mean = each().map(|(mean, _, n)| n * mean).sum::<f64>() / count;
    each().map(|(m, variance, n)| n * (variance + (m - mean) * (m - mean))).sum::<f64>() / count
}

/// Errors of decoded values. Signal-to-noise ratios without noise are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Signal-to-noise ratio of all values, in dB.
    pub snr_db: Option<f64>,
    /// Signal-to-noise ratio of the step with the largest error, in dB.
    pub snr_min_db: Option<f64>,
    /// Signal-to-noise ratio of the step with the smallest error, in dB.
    pub snr_max_db: Option<f64>,
    /// Largest absolute error of a value.
    pub max_error: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Root mean squared error of each vertex over the standard deviation of its values.
    pub over_sigma: OverSigma,
}

/// Order statistics of the error, relative to its own variation, over the vertices that change.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OverSigma {
    /// Median over the vertices.
    pub median: f64,
    /// 99th percentile over the vertices.
    pub p99: f64,
    /// Maximum over the vertices.
    pub max: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moments::Moments;

    /// Quality of `decoded` against `values`, both of `steps` steps.
    fn quality(values: &[f32], decoded: &[f32], vertices: usize) -> Quality {
        let mut moments = Moments::new(vertices);
        values.chunks_exact(vertices).for_each(|row| _ = moments.add_step(row));
        let mut tally = ErrorTally::new(vertices);
        // In two parts, as blocks come.
        let (head, tail) = values.split_at(vertices);
        let of = |skip: usize| {
            move |step: usize, first: usize, out: &mut [f32]| {
                out.copy_from_slice(&decoded[(skip + step) * vertices + first..][..out.len()]);
            }
        };
        tally.add(head, of(0));
        tally.add(tail, of(1));
        tally.quality(&moments.vertex_statistics())
    }

    #[test]
    fn figures_are_those_of_the_definition() {
        // Variance 5 (0, 2, 4, 6); squared errors 1 and 1, then 4 and 0.
        let found = quality(&[0.0, 2.0, 4.0, 6.0], &[1.0, 1.0, 6.0, 6.0], 2);
        let db = |ratio: f64| Some(10.0 * ratio.log10());
        assert_eq!((found.snr_db, found.snr_min_db, found.snr_max_db), (db(5.0 / 1.5), db(5.0 / 2.0), db(5.0)));
        assert_eq!((found.max_error, found.rmse), (2.0, 1.5f64.sqrt()));
        // Both vertices have a standard deviation of 2, and errors of root 2.5 and root 0.5.
        let sigma = found.over_sigma;
        // Numbers below 1, of which root and quotient are rounded here and there: four times 2^-54.
        assert!((sigma.max - 2.5f64.sqrt() / 2.0).abs() < 1e-15 && (sigma.median - 0.5f64.sqrt() / 2.0).abs() < 1e-15);
        assert_eq!(sigma.p99, sigma.max);
    }

    #[test]
    fn without_an_error_there_is_no_ratio_and_special_values_do_not_count() {
        let values = [1.0, f32::NAN, 3.0, f32::INFINITY];
        let found = quality(&values, &values, 2);
        assert_eq!((found.snr_db, found.snr_min_db, found.max_error, found.rmse), (None, None, 0.0, 0.0));
        let found = quality(&values, &[1.0, f32::NAN, 4.0, f32::INFINITY], 2);
        assert_eq!((found.max_error, found.rmse, found.snr_max_db), (1.0, 0.5f64.sqrt(), None));
        assert_eq!(found.snr_db, Some(10.0 * (1.0f64 / 0.5).log10()));
    }

    #[test]
    fn constant_data_have_no_ratio_and_no_share_of_a_deviation() {
        for value in [0.0, 5.0, -1e30, f32::MIN_POSITIVE] {
            let found = quality(&[value; 6], &[value; 6], 2);
            assert_eq!((found.snr_db, found.snr_min_db, found.snr_max_db), (None, None, None), "{value:e}");
            assert_eq!((found.max_error, found.rmse, found.over_sigma.max), (0.0, 0.0, 0.0));
        }
        // The definition as it stands is zero by zero.
        let naive = |variance: f64, mse: f64| 10.0 * (variance / mse).log10();
        assert!(naive(0.0, 0.0).is_nan());
        // Noise without a signal is all noise; a vertex that never moves has no deviation that it could be a share of.
        let found = quality(&[5.0; 4], &[5.0, 6.0, 5.0, 5.0], 2);
        assert_eq!((found.snr_db, found.over_sigma.max), (Some(f64::NEG_INFINITY), 0.0));
    }

    #[test]
    fn sums_go_on_from_their_numbers_as_if_nothing_had_been() {
        let values: Vec<f32> = (0..12).map(|i| (i as f32).sin()).collect();
        let add = |tally: &mut ErrorTally, steps: &[f32]| tally.add(steps, |_, _, out| out.fill(0.1));
        let mut whole = ErrorTally::new(3);
        add(&mut whole, &values[..6]);
        let (steps, vertices) = whole.parts();
        let mut resumed = ErrorTally::from_parts(&steps, vertices.to_vec()).unwrap();
        assert_eq!(resumed.parts(), whole.parts());
        [&mut whole, &mut resumed].into_iter().for_each(|tally| add(tally, &values[6..]));
        assert_eq!(resumed.parts(), whole.parts());
        assert_eq!(whole.parts().0.len(), 4);
        for bad in [[-1.0, 1.0, 1.0], [1.0, 0.5, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, f64::NAN]] {
            assert!(ErrorTally::from_parts(&[bad], vec![0.0; 3]).is_none(), "{bad:?}");
        }
        assert!(ErrorTally::from_parts(&[], vec![f64::INFINITY]).is_none());
    }

    #[test]
    fn many_vertices_are_compared_in_parts() {
        let vertices = 2 * TASK + 3;
        let values: Vec<f32> = (0..2 * vertices).map(|i| i as f32).collect();
        let mut decoded = values.clone();
        decoded[vertices - 1] += 3.0;
        let found = quality(&values, &decoded, vertices);
        assert_eq!((found.max_error, found.rmse), (3.0, (9.0 / (2 * vertices) as f64).sqrt()));
    }
}

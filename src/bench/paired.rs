//! Paired comparison of the run times of two pieces of work.
//!
//! Pairs run in the order A B, B A, A B and so on: drift of the machine within a pair hits both sides alike. The figure
//! is the median over pairs of time(B) / time(A), which a few disturbed pairs do not move; its interval is the percentile
//! bootstrap over pairs (Efron and Tibshirani 1993, chapter 13).

use super::statistics::{Spread, median, median_of_sorted, percentile};
use crate::random::SplitMix64;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Number of bootstrap samples: the ends of the interval are ranks 50 and 1950.
const RESAMPLES: usize = 2000;
/// Share of the bootstrap medians that lie in the interval, in per cent.
const CONFIDENCE: f64 = 95.0;
/// Runs of each side before the first is timed: caches, page tables, the branch predictor, lazy initialisation.
const WARM_UP: usize = 1;

/// Times of paired runs, pair by pair, in milliseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timings {
    /// Times of the first side.
    pub a: Vec<f64>,
    /// Times of the second side.
    pub b: Vec<f64>,
}

/// How the run time of B compares with that of A.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Paired {
    /// Number of pairs.
    pub pairs: usize,
    /// Milliseconds of A.
    pub a: Spread,
    /// Milliseconds of B.
    pub b: Spread,
    /// Median over pairs of time(B) / time(A): above 1 if B is slower.
    pub ratio: f64,
    /// Ends of the 95 % bootstrap interval of the ratio.
    pub interval: [f64; 2],
}

/// Times `pairs` pairs (at least one) of runs of `a` and `b` after a warm-up. Results must pass through [`std::hint::black_box`] or a
/// captured variable, or the compiler may remove the work.
///
/// The same timings and `seed` give the same interval.
pub fn paired(mut a: impl FnMut(), mut b: impl FnMut(), pairs: usize, seed: u64) -> Paired {
    for _ in 0..WARM_UP {
        a();
        b();
    }
    let mut timings = Timings::default();
    for pair in 0..pairs.max(1) {
        let (ms_a, ms_b);
        if pair % 2 == 0 {
            ms_a = milliseconds(&mut a);
            ms_b = milliseconds(&mut b);
        } else {
            ms_b = milliseconds(&mut b);
            ms_a = milliseconds(&mut a);
        }
        timings.a.push(ms_a);
        timings.b.push(ms_b);
    }
    Paired::of(&timings, seed)
}

fn milliseconds(work: &mut impl FnMut()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}

impl Paired {
    /// Compares `timings`; the longer side is truncated. Without pairs all figures are NaN.
    pub fn of(timings: &Timings, seed: u64) -> Self {
        /// Shortest measurable time, which also avoids division by zero.
        const SHORTEST_MS: f64 = 1e-6;
        let pairs = timings.a.len().min(timings.b.len());
        let (a, b) = (&timings.a[..pairs], &timings.b[..pairs]);
        let ratio = |(a, b): (&f64, &f64)| b.max(SHORTEST_MS) / a.max(SHORTEST_MS);
        let ratios: Vec<f64> = a.iter().zip(b).map(ratio).collect();
        Self {
            pairs,
            a: Spread::of(a),
            b: Spread::of(b),
            ratio: median(&ratios),
            interval: bootstrap_interval(&ratios, seed),
        }
    }

    /// Whether B is at most `factor` times as slow as A over the whole interval.
    pub fn is_at_most(&self, factor: f64) -> bool {
        self.interval[1] <= factor
    }
}

/// Ends of the percentile bootstrap interval of the median of `values`.
fn bootstrap_interval(values: &[f64], seed: u64) -> [f64; 2] {
    let mut random = SplitMix64::new(seed);
    let mut sample = values.to_vec();
    let mut resampled_median = |_| {
        // An empty list draws no index and has no slot.
        sample.iter_mut().for_each(|slot| *slot = values[random.below(values.len())]);
        sample.sort_unstable_by(f64::total_cmp);
        median_of_sorted(&sample)
    };
    let medians: Vec<f64> = (0..RESAMPLES).map(&mut resampled_median).collect();
    let tail = (100.0 - CONFIDENCE) / 2.0;
    [percentile(&medians, tail), percentile(&medians, 100.0 - tail)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    /// Timings with a known ratio, a drift shared by both sides, noise, and occasional disturbed runs.
    fn synthetic(ratio: f64, pairs: usize, seed: u64) -> Timings {
        let mut random = SplitMix64::new(seed);
        let mut timings = Timings::default();
        for pair in 0..pairs {
            let base = 10.0 * (1.0 + 0.5 * pair as f64 / pairs as f64);
            // A symmetric factor keeps the median of the quotient at the true ratio.
            let mut noise = || random.between(-0.05, 0.05).exp() * if random.unit() < 0.05 { 3.0 } else { 1.0 };
            timings.a.push(base * noise());
            timings.b.push(base * ratio * noise());
        }
        timings
    }

    #[test]
    fn a_known_ratio_is_recovered_through_drift_and_disturbances() {
        for ratio in [0.5, 1.0, 1.03, 4.0] {
            let found = Paired::of(&synthetic(ratio, 101, 1), 7);
            // Quotients spread by 4 % (two triangular noises); the median of 101 by 0.5 %; three of those.
            assert!((found.ratio / ratio - 1.0).abs() < 0.015, "{found:?}");
            assert!(found.interval[0] <= found.ratio && found.ratio <= found.interval[1], "{found:?}");
            // Twice 0.5 % to either side, and as much again. Measured: 2 %.
            assert!(found.interval[1] / found.interval[0] < 1.05, "{found:?}");
        }
        assert!((Paired::of(&synthetic(1.04, 101, 1), 7).ratio - 1.0).abs() > 0.015, "4 % more are noticed");
    }

    #[test]
    fn the_interval_covers_the_truth_about_as_often_as_it_says() {
        let trials = 200;
        let covers = |seed: &u64| {
            let [lo, hi] = Paired::of(&synthetic(1.2, 41, *seed), 7).interval;
            (lo..=hi).contains(&1.2)
        };
        let covered = (0..trials).filter(covers).count();
        // Binomial with 0.95: 190 +- 3.1; four of those below, and it may well be above (the bootstrap of a median is
        // conservative), but not always, or the interval would say nothing.
        assert!((177..200).contains(&covered), "{covered} of {trials}");
    }

    #[test]
    fn the_same_timings_and_seed_give_the_same_bits() {
        let timings = synthetic(1.1, 20, 3);
        assert_eq!(Paired::of(&timings, 5), Paired::of(&timings, 5));
        let intervals: Vec<[f64; 2]> = (0..20).map(|seed| Paired::of(&timings, seed).interval).collect();
        assert!(intervals.iter().any(|i| *i != intervals[0]), "the seed is used");
    }

    #[test]
    fn one_pair_has_an_interval_of_no_width_and_none_has_no_figures() {
        let one = Paired::of(&Timings { a: vec![2.0], b: vec![3.0] }, 1);
        assert_eq!((one.pairs, one.ratio, one.interval), (1, 1.5, [1.5, 1.5]));
        let none = Paired::of(&Timings::default(), 1);
        assert!(none.ratio.is_nan() && none.interval[0].is_nan() && none.a.median.is_nan());
        assert!(!none.is_at_most(f64::INFINITY), "no evidence is no proof");
    }

    #[test]
    fn work_below_the_clock_has_a_finite_ratio() {
        let found = Paired::of(&Timings { a: vec![0.0; 3], b: vec![0.0; 3] }, 1);
        assert_eq!(found.ratio, 1.0);
    }

    #[test]
    fn the_verdict_is_that_of_the_upper_end() {
        let found = Paired { interval: [0.9, 1.04], ..Paired::of(&Timings { a: vec![1.0], b: vec![1.0] }, 1) };
        assert!(found.is_at_most(1.05) && !found.is_at_most(1.03));
    }

    #[test]
    fn runs_alternate_after_the_warm_up_and_each_side_runs_equally_often() {
        let log = RefCell::new(String::new());
        let found = paired(|| log.borrow_mut().push('A'), || log.borrow_mut().push('B'), 3, 1);
        assert_eq!(log.into_inner(), "ABABBAAB");
        assert_eq!(found.pairs, 3);
        assert_eq!(paired(|| {}, || {}, 0, 1).pairs, 1, "at least one pair");
    }
}

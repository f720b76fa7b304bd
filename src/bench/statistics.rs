//! Order statistics of timings.

use serde::{Deserialize, Serialize};

/// Value at or below which `percent` per cent of `values` lie, by nearest rank: always one of the values. NaN without values. `percent` is
/// clamped to [0, 100]; 0 gives the smallest value.
pub fn percentile(values: &[f64], percent: f64) -> f64 {
    let sorted = sorted(values);
    let rank = (percent.clamp(0.0, 100.0) / 100.0 * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

/// The middle value, or the mean of the two in the middle; NaN without values.
pub fn median(values: &[f64]) -> f64 {
    median_of_sorted(&sorted(values))
}

/// [`median`] of sorted values.
pub(super) fn median_of_sorted(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    match (sorted.get(middle), sorted.len() % 2) {
        (None, _) => f64::NAN,
        (Some(value), 1) => *value,
        // Halved first, so that the sum of two large values is finite.
        (Some(value), _) => 0.5 * sorted[middle - 1] + 0.5 * value,
    }
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

/// Median and spread of repeated measurements, in their unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Smallest value.
    pub min: f64,
    /// First quartile, by nearest rank.
    pub q1: f64,
    /// Median.
    pub median: f64,
    /// Third quartile, by nearest rank.
    pub q3: f64,
    /// Largest value.
    pub max: f64,
}

impl Spread {
    /// The spread of `values`; all NaN without values.
    pub fn of(values: &[f64]) -> Self {
        Self {
            min: percentile(values, 0.0),
            q1: percentile(values, 25.0),
            median: median(values),
            q3: percentile(values, 75.0),
            max: percentile(values, 100.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_the_textbooks_nearest_ranks_in_any_order() {
        let values = [50.0, 15.0, 40.0, 20.0, 35.0];
        let ranks = [(0.0, 15.0), (5.0, 15.0), (30.0, 20.0), (40.0, 20.0), (50.0, 35.0), (95.0, 50.0), (100.0, 50.0)];
        for (percent, expected) in ranks {
            assert_eq!(percentile(&values, percent), expected, "{percent}");
        }
        assert_eq!(percentile(&values, -5.0), 15.0);
        assert_eq!(percentile(&values, 500.0), 50.0);
    }

    #[test]
    fn one_value_is_every_percentile_and_none_is_nan() {
        for percent in [0.0, 50.0, 95.0, 100.0] {
            assert_eq!(percentile(&[7.0], percent), 7.0);
            assert!(percentile(&[], percent).is_nan());
        }
        assert_eq!(Spread::of(&[7.0]), Spread { min: 7.0, q1: 7.0, median: 7.0, q3: 7.0, max: 7.0 });
        assert!(median(&[]).is_nan());
    }

    #[test]
    fn the_median_of_an_even_number_lies_between_the_middle_two() {
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), 2.5);
        assert_eq!(median(&[f64::MAX, f64::MAX]), f64::MAX);
    }
}

//! [`Distribution`]: the distribution of values over a volume.

/// Sorted values, each with its share of the volume.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distribution {
    values: Vec<f32>,
    /// Cumulative share of each value and those before it; 1 at the last one.
    shares: Vec<f64>,
}

impl Distribution {
    /// The distribution of (value, weight) pairs in any order. Pairs without a finite value or a positive, finite weight are ignored.
    pub fn new(samples: impl IntoIterator<Item = (f32, f64)>) -> Self {
        let is_usable = |(value, weight): &(f32, f64)| value.is_finite() && *weight > 0.0 && weight.is_finite();
        let mut samples: Vec<(f32, f64)> = samples.into_iter().filter(is_usable).collect();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Weights are relative to the largest one, so that no sum of them overflows.
        let largest = samples.iter().map(|sample| sample.1).fold(0.0, f64::max);
        let sums = samples.iter().scan(0.0, |sum, sample| {
            *sum += sample.1 / largest;
            Some(*sum)
        });
        let sums: Vec<f64> = sums.collect();
        let all = sums.last().copied().unwrap_or(1.0);
        Self {
            values: samples.iter().map(|sample| sample.0).collect(),
            shares: sums.iter().map(|sum| sum / all).collect(),
        }
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The least value such that at least this share (0..=1) of the volume lies at or below it; `None` if there is no value.
    pub fn value_at(&self, share: f64) -> Option<f32> {
        let index = self.shares.partition_point(|&s| s < share);
        self.values.get(index).or(self.values.last()).copied()
    }

    /// The narrowest range with at least this share (above 0) of the volume; of several the lowest one. `None` if there is no value.
    pub fn narrowest(&self, share: f64) -> Option<[f32; 2]> {
        let mut narrowest: Option<[f32; 2]> = None;
        let width = |[lo, hi]: [f32; 2]| f64::from(hi) - f64::from(lo);
        let mut to = 0;
        for from in 0..self.values.len() {
            let before = if from == 0 { 0.0 } else { self.shares[from - 1] };
            // The rounding of the last shares must not make a range of all values too small.
            while self.shares[to] - before < share.min(1.0 - before) && to + 1 < self.values.len() {
                to += 1;
            }
            if self.shares[to] - before < share && from > 0 {
                break;
            }
            let range = [self.values[from], self.values[to]];
            if narrowest.is_none_or(|known| width(range) < width(known)) {
                narrowest = Some(range);
            }
        }
        narrowest
    }

    /// Each value and its share of the volume, in order.
    pub fn parts(&self) -> impl Iterator<Item = (f32, f64)> {
        let before = std::iter::once(0.0).chain(self.shares.iter().copied());
        self.values.iter().zip(&self.shares).zip(before).map(|((&value, share), before)| (value, share - before))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn even(values: &[f32]) -> Distribution {
        Distribution::new(values.iter().map(|&value| (value, 1.0)))
    }

    #[test]
    fn a_part_of_the_volume_lies_below_each_percentile() {
        let values: Vec<f32> = (0..100).rev().map(|i| i as f32).collect();
        let all = even(&values);
        assert_eq!(
            [0.0, 0.01, 0.5, 0.505, 0.99, 1.0].map(|share| all.value_at(share)),
            [0.0, 0.0, 49.0, 50.0, 98.0, 99.0].map(Some)
        );
        // Weights count, not the number of values.
        let heavy = Distribution::new([(1.0, 1.0), (2.0, 98.0), (3.0, 1.0)]);
        assert_eq!([0.005, 0.5, 0.995].map(|share| heavy.value_at(share)), [1.0, 2.0, 3.0].map(Some));
        let parts: Vec<(f32, f64)> = heavy.parts().collect();
        assert_eq!(parts.iter().map(|part| part.0).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
        assert!(
            (parts[1].1 - 0.98).abs() < 1e-15 && (parts.iter().map(|part| part.1).sum::<f64>() - 1.0).abs() < 1e-15
        );
    }

    #[test]
    fn what_is_no_value_or_has_no_weight_is_left_out_and_huge_weights_do_not_overflow() {
        let none = Distribution::new([(f32::NAN, 1.0), (f32::INFINITY, 1.0), (3.0, 0.0), (4.0, f64::NAN), (5.0, -1.0)]);
        assert!(none.is_empty() && none.value_at(0.5).is_none() && none.narrowest(0.5).is_none());
        assert_eq!(none.parts().count(), 0);
        let huge = Distribution::new([(1.0, 1e308), (2.0, 1e308), (3.0, 1e308)]);
        assert_eq!([0.1, 0.5, 0.9].map(|share| huge.value_at(share)), [1.0, 2.0, 3.0].map(Some));
        let wide = even(&[f32::MIN, f32::MAX]);
        assert_eq!(wide.narrowest(0.9), Some([f32::MIN, f32::MAX]));
    }

    #[test]
    fn the_narrowest_range_is_where_most_values_are() {
        let peaked =
            Distribution::new((0..1000).map(|i| (if i < 600 { 5.0 + i as f32 * 1e-4 } else { i as f32 }, 1.0)));
        let [lo, hi] = peaked.narrowest(0.5).unwrap();
        assert!(lo >= 5.0 && hi <= 5.06, "{lo} {hi}");
        assert_eq!(even(&[7.0; 5]).narrowest(0.5), Some([7.0, 7.0]));
        assert_eq!(even(&[1.0, 2.0, 9.0]).narrowest(1.0), Some([1.0, 9.0]));
    }

    proptest! {
        #[test]
        fn the_narrowest_range_is_that_of_a_search(values in prop::collection::vec((-8i32..8, 1u32..4), 1..12), share in 0.05..1.0_f64) {
            let all = Distribution::new(values.iter().map(|&(v, w)| (v as f32, f64::from(w))));
            let total: u32 = values.iter().map(|v| v.1).sum();
            let held = |lo: i32, hi: i32| {
                let inside: u32 = values.iter().filter(|v| (lo..=hi).contains(&v.0)).map(|v| v.1).sum();
                f64::from(inside) / f64::from(total)
            };
            // Shares decided by rounding are skipped.
            let decided = (-8..8).all(|lo| (lo..8).all(|hi| (held(lo, hi) - share).abs() > 1e-9));
            let search = (-8..8).flat_map(|lo| (lo..8).map(move |hi| (lo, hi))).filter(|&(lo, hi)| held(lo, hi) >= share).map(|(lo, hi)| hi - lo).min().unwrap();
            let [lo, hi] = all.narrowest(share).unwrap();
            prop_assert!(!decided || hi - lo == search as f32, "{lo} {hi} {search}");
        }
    }
}

//! How often which values occur.

/// Counts of values in bins of equal width over a range.
///
/// Bin i of n covers `lo + (hi - lo) * [i / n, (i + 1) / n)`; the last one includes `hi`. Values beyond the range are in the
/// bin at its end. If the range is one value, or there is none, the first bin has all. NaN and infinities are in no bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram1d {
    range: Option<[f32; 2]>,
    counts: Vec<u64>,
    nonfinite: u64,
}

impl Histogram1d {
    /// Bins of [`Histogram1d::new`].
    pub const BINS: usize = 256;

    /// No value yet, over the range of a field; [`Self::BINS`] bins.
    pub fn new(range: Option<[f32; 2]>) -> Self {
        Self { range, counts: vec![0; Self::BINS], nonfinite: 0 }
    }

    /// The range that the bins cover.
    pub fn range(&self) -> Option<[f32; 2]> {
        self.range
    }

    /// Number of values in each bin, the lowest first.
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// Number of NaN and infinite values.
    pub fn nonfinite(&self) -> u64 {
        self.nonfinite
    }

    /// Number of values in all bins.
    pub fn finite(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Least and greatest value of a bin; `None` without a range.
    pub fn bounds(&self, bin: usize) -> Option<[f64; 2]> {
        let [lo, hi] = self.range?.map(f64::from);
        let at = |edge: usize| lo + (hi - lo) * (edge as f64 / self.counts.len() as f64);
        Some([at(bin), at(bin + 1)])
    }

    /// Counts values.
    pub fn add(&mut self, values: &[f32]) {
        let bins = self.counts.len() as f64;
        let [lo, hi] = self.range.unwrap_or_default().map(f64::from);
        let last = self.counts.len() - 1;
        for &value in values {
            if !value.is_finite() {
                self.nonfinite += 1;
                continue;
            }
            // The width of the widest range of f32 is finite here. Casts saturate, and 0 / 0 becomes 0.
            let bin = ((f64::from(value) - lo) / (hi - lo) * bins) as usize;
            self.counts[if hi > lo { bin.min(last) } else { 0 }] += 1;
        }
    }

    /// Counts what another histogram has counted.
    ///
    /// # Panics
    /// If its bins are others.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.range, other.range, "histograms of one range");
        self.counts.iter_mut().zip(&other.counts).for_each(|(all, more)| *all += more);
        self.nonfinite += other.nonfinite;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The bin that a value is in by the definition, over a range of whole numbers: in integers, one bin after the other.
    fn naive(range: [i64; 2], value: i64) -> usize {
        let n = Histogram1d::BINS as i64;
        let [lo, hi] = range;
        let is_below_end = |bin: &i64| (value - lo) * n < (hi - lo) * (bin + 1);
        (0..n).find(is_below_end).unwrap_or(n - 1) as usize
    }

    fn of(range: [f32; 2], values: &[f32]) -> Histogram1d {
        let mut histogram = Histogram1d::new(Some(range));
        histogram.add(values);
        histogram
    }

    proptest! {
        #[test]
        fn every_value_is_in_the_bin_of_the_definition(
            lo in -5000_i64..5000,
            // A power of two: the quotient is then exact, as the bins of the definition are.
            width in (0_u32..13).prop_map(|bits| 1_i64 << bits),
            values in prop::collection::vec(-10_000_i64..10_000, 0..200),
        ) {
            let range = [lo, lo + width];
            let floats: Vec<f32> = values.iter().map(|&v| v as f32).collect();
            let ours = of(range.map(|v| v as f32), &floats);
            let mut expected = vec![0; Histogram1d::BINS];
            values.iter().for_each(|&v| expected[naive(range, v)] += 1);
            prop_assert_eq!(ours.counts(), &expected[..]);
            prop_assert_eq!(ours.finite(), values.len() as u64);
            // The test can fail.
            if !values.is_empty() {
                let moved: Vec<f32> = floats.iter().map(|_| range[1] as f32).chain([lo as f32]).collect();
                prop_assert_ne!(of(range.map(|v| v as f32), &moved), ours);
            }
        }

        #[test]
        fn a_value_lies_within_the_bounds_of_its_bin(
            a: f32, b: f32, share in 0.0..=1.0_f64,
        ) {
            prop_assume!(a.is_finite() && b.is_finite() && a != b);
            let range = [a.min(b), a.max(b)];
            let [lo, hi] = range.map(f64::from);
            let value = ((lo + share * (hi - lo)) as f32).clamp(range[0], range[1]);
            let histogram = of(range, &[value]);
            let bin = histogram.counts().iter().position(|&count| count == 1).unwrap();
            let [from, to] = histogram.bounds(bin).unwrap();
            // Difference, quotient and edge are rounded, each by 2^-53 of the range's numbers.
            let rounding = 4.0 * f64::EPSILON * lo.abs().max(hi.abs());
            prop_assert!(f64::from(value) >= from - rounding && f64::from(value) <= to + rounding);
        }

        #[test]
        fn parts_together_are_the_whole(
            values in prop::collection::vec(any::<f32>(), 0..100), at in 0_usize..100,
        ) {
            let (a, b) = values.split_at(at.min(values.len()));
            let range = [-1e20, 1e30];
            let mut merged = of(range, a);
            merged.merge(&of(range, b));
            prop_assert_eq!(merged, of(range, &values));
        }
    }

    #[test]
    fn the_greatest_value_is_in_the_last_bin_whatever_the_range() {
        for range in [[0.0, 1.0], [f32::MIN, f32::MAX], [-0.3, 0.7], [1e-45, 3e-45], [1.0, 1.0_f32.next_up()]] {
            let histogram = of(range, &range);
            let counts = histogram.counts();
            assert_eq!((counts[0], counts[Histogram1d::BINS - 1]), (1, 1), "{range:?}");
            assert_eq!(histogram.bounds(Histogram1d::BINS - 1).unwrap()[1], f64::from(range[1]), "{range:?}");
        }
    }

    #[test]
    fn a_range_of_one_value_or_none_has_one_bin() {
        let histogram = of([2.5, 2.5], &[2.5, 2.5, f32::NAN]);
        assert_eq!((histogram.counts()[0], histogram.finite(), histogram.nonfinite()), (2, 2, 1));
        assert_eq!(histogram.bounds(7), Some([2.5, 2.5]));
        let mut none = Histogram1d::new(None);
        none.add(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        assert_eq!((none.finite(), none.nonfinite(), none.bounds(0)), (0, 3, None));
    }
}

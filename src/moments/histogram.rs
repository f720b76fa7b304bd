//! Histograms of values and of pairs of values.

use super::bins::{AxisScale, Bins, shares};

/// Counts of values in [`Bins`]. NaN and infinities are in no bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram1d {
    bins: Bins,
    counts: Vec<u64>,
    nonfinite: u64,
}

impl Histogram1d {
    /// Bins of [`Histogram1d::new`].
    pub const BINS: usize = 256;

    /// An empty histogram over the range of a field; [`Self::BINS`] bins of equal width.
    pub fn new(range: Option<[f32; 2]>) -> Self {
        Self::over(Bins::new(range, AxisScale::Linear, Self::BINS))
    }

    /// An empty histogram.
    pub fn over(bins: Bins) -> Self {
        Self { counts: vec![0; bins.count()], bins, nonfinite: 0 }
    }

    /// A histogram of stored counts; `None` if there is not one for each bin.
    pub fn from_counts(bins: Bins, counts: Vec<u64>, nonfinite: u64) -> Option<Self> {
        (counts.len() == bins.count()).then_some(Self { bins, counts, nonfinite })
    }

    /// As [`Self::from_counts`], for octaves of older stores, whose last bin was that of the greatest value: exact, except that up to three
    /// bins at the low end are merged into the first.
    pub fn from_tight_counts(bins: Bins, mut counts: Vec<u64>, nonfinite: u64) -> Option<Self> {
        move_down(&mut counts, 1, bins.raised_by());
        Self::from_counts(bins, counts, nonfinite)
    }

    /// The bins.
    pub fn bins(&self) -> &Bins {
        &self.bins
    }

    /// The range that the bins cover.
    pub fn range(&self) -> Option<[f32; 2]> {
        self.bins.range()
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
        self.bins.bounds(bin)
    }

    /// Number of values between each two of these scalars, which must be ascending. A bin that lies in several of these intervals is shared
    /// in proportion to its width in each.
    pub fn between(&self, scalars: &[f64]) -> Vec<f64> {
        let mut found = vec![0.0; scalars.len().saturating_sub(1)];
        for (bin, &count) in self.counts.iter().enumerate().filter(|(_, count)| **count > 0) {
            for (interval, share) in self.bounds(bin).into_iter().flat_map(|ends| shares(ends, scalars)) {
                found[interval] += count as f64 * share;
            }
        }
        found
    }

    /// Counts values.
    pub fn add(&mut self, values: &[f32]) {
        for &value in values {
            match self.bins.bin(value) {
                Some(bin) => self.counts[bin] += 1,
                None => self.nonfinite += 1,
            }
        }
    }

    /// Widens an axis of octaves to cover `range` too; no effect on others. The counts are then those over the wider range.
    pub fn widen(&mut self, range: Option<[f32; 2]>) {
        if let Some((bins, down)) = self.bins.widened(range) {
            move_down(&mut self.counts, 1, down);
            self.bins = bins;
        }
    }

    /// Adds the counts of another histogram.
    ///
    /// # Panics
    /// If its bins differ.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.bins, other.bins, "histograms of one range");
        add_up(&mut self.counts, &other.counts);
        self.nonfinite += other.nonfinite;
    }
}

/// Counts of pairs of values. A pair with a NaN or infinity is in no bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram2d {
    x: Bins,
    y: Bins,
    /// Row by row, x fastest.
    counts: Vec<u64>,
    nonfinite: u64,
}

impl Histogram2d {
    /// An empty histogram.
    pub fn over(x: Bins, y: Bins) -> Self {
        Self { counts: vec![0; x.count() * y.count()], x, y, nonfinite: 0 }
    }

    /// A histogram of stored counts; `None` if there is not one for each bin.
    pub fn from_counts(x: Bins, y: Bins, counts: Vec<u64>, nonfinite: u64) -> Option<Self> {
        (counts.len() == x.count() * y.count()).then_some(Self { x, y, counts, nonfinite })
    }

    /// The bins of first values, along a row.
    pub fn x(&self) -> &Bins {
        &self.x
    }

    /// The bins of second values, one for each row.
    pub fn y(&self) -> &Bins {
        &self.y
    }

    /// Number of pairs in each bin: `[y][x]`, from the lowest second value on, in each row from the lowest first value on.
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// Number of pairs with a NaN or infinity.
    pub fn nonfinite(&self) -> u64 {
        self.nonfinite
    }

    /// Number of pairs in all bins.
    pub fn finite(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Counts pairs.
    ///
    /// # Panics
    /// If `xs` and `ys` differ in length.
    pub fn add(&mut self, xs: &[f32], ys: &[f32]) {
        assert_eq!(xs.len(), ys.len(), "pairs");
        let width = self.x.count();
        for (&x, &y) in xs.iter().zip(ys) {
            match (self.x.bin(x), self.y.bin(y)) {
                (Some(x), Some(y)) => self.counts[y * width + x] += 1,
                _ => self.nonfinite += 1,
            }
        }
    }

    /// Widens axes of octaves to cover the ranges too; no effect on others. The counts are then those over the wider ranges.
    pub fn widen(&mut self, x: Option<[f32; 2]>, y: Option<[f32; 2]>) {
        if let Some((bins, down)) = self.x.widened(x) {
            self.counts.chunks_mut(bins.count()).for_each(|row| move_down(row, 1, down));
            self.x = bins;
        }
        if let Some((bins, down)) = self.y.widened(y) {
            move_down(&mut self.counts, self.x.count(), down);
            self.y = bins;
        }
    }

    /// Adds the counts of another histogram.
    ///
    /// # Panics
    /// If its bins differ.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!((&self.x, &self.y), (&other.x, &other.y), "histograms of one range");
        add_up(&mut self.counts, &other.counts);
        self.nonfinite += other.nonfinite;
    }
}

/// Adds each row of `width` counts to the row `down` rows before it, or to the first one.
fn move_down(counts: &mut [u64], width: usize, down: usize) {
    if down == 0 {
        return;
    }
    for from in width..counts.len() {
        let (row, column) = (from / width, from % width);
        let count = std::mem::take(&mut counts[from]);
        counts[row.saturating_sub(down) * width + column] += count;
    }
}

fn add_up(counts: &mut [u64], more: &[u64]) {
    counts.iter_mut().zip(more).for_each(|(all, more)| *all += more);
}

/// Scaling of counts for drawing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CountScale {
    /// Relative to the greatest count.
    #[default]
    Linear,
    /// ln(1 + count), relative to that of the greatest: a single value is visible beside a million.
    Log,
}

impl CountScale {
    /// Counts as heights or shades in 0..=1: 0 for an empty bin, 1 for the fullest; all 0 if all are empty.
    pub fn heights(self, counts: &[u64]) -> Vec<f32> {
        self.heights_of_shares(&counts.iter().map(|&count| count as f64).collect::<Vec<_>>())
    }

    /// As [`Self::heights`], of counts that need not be whole.
    pub fn heights_of_shares(self, counts: &[f64]) -> Vec<f32> {
        let of = |count: f64| match self {
            Self::Linear => count,
            Self::Log => count.ln_1p(),
        };
        let most = of(counts.iter().copied().fold(0.0, f64::max));
        counts.iter().map(|&count| if count > 0.0 { (of(count) / most) as f32 } else { 0.0 }).collect()
    }
}

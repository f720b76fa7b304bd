//! Bins of a histogram along one axis.

/// How an axis is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AxisScale {
    /// Bins of equal width.
    #[default]
    Linear,
    /// Equally many bins in every octave, over [`AxisScale::OCTAVES`] of them down from the greatest value; of equal width within an
    /// octave. For non-negative values that may be 0 and span decades. Nearly a logarithm, but exact: floats are ordered like their bits,
    /// the first of which are the bin. So bins of a range are also bins of every wider one.
    Octaves,
}

impl AxisScale {
    /// Octaves of an axis: nearly five decades. Smaller values are in the first bin.
    pub const OCTAVES: usize = 16;
}

/// The intervals between each two of `cuts`, which must be ascending, in which a bin from `from` to `to` lies: their index and the share of the
/// bin's width, above 0 and at most 1. A bin without width is in one interval, the last that contains it.
pub fn shares([from, to]: [f64; 2], cuts: &[f64]) -> impl Iterator<Item = (usize, f64)> {
    let intervals = cuts.len().saturating_sub(1);
    let first = cuts.partition_point(|&cut| cut <= from).saturating_sub(1).min(intervals.saturating_sub(1));
    let is_wide = from < to;
    let behind = if is_wide { intervals } else { intervals.min(first + 1) };
    let share = move |i: usize| match is_wide {
        true => (cuts[i + 1].min(to) - cuts[i].max(from)) / (to - from),
        false => f64::from(u8::from((cuts[i]..=cuts[i + 1]).contains(&from))),
    };
    let reaches = move |&i: &usize| !is_wide || cuts[i] < to;
    (first..behind).take_while(reaches).map(move |i| (i, share(i))).filter(|&(_, share)| share > 0.0)
}

/// Mantissa bits of an f32.
const FRACTION_BITS: u32 = f32::MANTISSA_DIGITS - 1;

/// Bins over a range.
///
/// *Linear*: bin i of n covers values from `edge(i)` to below `edge(i + 1)`, where `edge(i) = lo + (hi - lo) * i / n`, rounded to f64; the
/// last one includes `hi`. If the range is one value, the first bin contains it. A range symmetric about 0 has symmetric edges, one at 0
/// exactly if n is even, so that mirrored values (except those on an edge) are in mirrored bins.
///
/// *Octaves*: edges are powers of two and, with n / 16 = p bins in an octave, the divisions of the next octave into p; the first bin has
/// all values below the second; `lo` is always 0. The last edge is the next quarter of an octave above `hi` (with p < 4 the next edge there
/// is), so that positions of a quantity do not depend on the number of bins.
///
/// Values beyond the range are in the bin at its end. Without a range the first bin has all values.
#[derive(Clone, Debug, PartialEq)]
pub struct Bins {
    range: Option<[f32; 2]>,
    scale: AxisScale,
    /// Edges, one more than there are bins; all 0 without a range.
    edges: Vec<f64>,
    /// With octaves, the leading bits of the values of the first bin.
    first_key: u32,
}

impl Bins {
    /// `count` bins over a range.
    ///
    /// # Panics
    /// If `count` is 0 or above 65,536, or, with octaves, not 16 times a power of two; if the ends of the range are not finite or not in
    /// order.
    pub fn new(range: Option<[f32; 2]>, scale: AxisScale, count: usize) -> Self {
        assert!((1..=1 << 16).contains(&count), "1 to 65,536 bins");
        assert!(range.is_none_or(|[lo, hi]| lo <= hi && lo.is_finite() && hi.is_finite()), "{range:?} is no range");
        match scale {
            AxisScale::Linear => Self::linear(range, count),
            AxisScale::Octaves => Self::octaves(range, count),
        }
    }

    fn linear(range: Option<[f32; 2]>, count: usize) -> Self {
        let [lo, hi] = range.unwrap_or_default().map(f64::from);
        // Products of 24 and 17 bits are exact, and so is a quotient by a power of two: only the sum rounds.
        let edge = |i: usize| (lo * (count - i) as f64 + hi * i as f64) / count as f64;
        Self { range, scale: AxisScale::Linear, edges: (0..=count).map(edge).collect(), first_key: 0 }
    }

    fn octaves(range: Option<[f32; 2]>, count: usize) -> Self {
        let per_octave = count / AxisScale::OCTAVES;
        assert!(per_octave.is_power_of_two() && count == per_octave * AxisScale::OCTAVES, "16, 32, 64 ... bins");
        let range = range.map(|[_, hi]| [0.0, hi.max(0.0)]);
        let mut bins = Self { range, scale: AxisScale::Octaves, edges: vec![0.0; count + 1], first_key: 0 };
        let Some([_, hi]) = range else { return bins };
        let shift = bins.key_shift();
        // The least keys are those of 0 and subnormal numbers.
        bins.first_key = bins.last_key(hi).saturating_sub(count as u32);
        let edge = |key: u32| match f32::from_bits(key << shift) {
            edge if edge.is_finite() => f64::from(edge),
            // Behind the greatest key.
            _ => 2.0 * f64::from(f32::from_bits(254 << FRACTION_BITS)),
        };
        bins.edges = (bins.first_key..=bins.first_key + count as u32).map(edge).collect();
        bins.edges[0] = 0.0;
        bins
    }

    /// With octaves, the key behind the last bin for this greatest value.
    fn last_key(&self, hi: f32) -> u32 {
        let shift = self.key_shift();
        // Shift of four bins in an octave.
        let quarters = shift.max(FRACTION_BITS - 2);
        ((hi.to_bits() >> quarters) + 1) << (quarters - shift)
    }

    /// How many bins further up octaves end now than in stores whose last bin was that of the greatest value.
    pub(super) fn raised_by(&self) -> usize {
        match (self.range, self.scale) {
            (Some([_, hi]), AxisScale::Octaves) => {
                let tight = ((hi.to_bits() >> self.key_shift()) + 1).saturating_sub(self.count() as u32);
                (self.first_key - tight) as usize
            }
            _ => 0,
        }
    }

    /// Number of trailing bits of a value that do not affect its bin.
    fn key_shift(&self) -> u32 {
        FRACTION_BITS - (self.count() / AxisScale::OCTAVES).ilog2()
    }

    /// The range that the bins cover.
    pub fn range(&self) -> Option<[f32; 2]> {
        self.range
    }

    /// How the range is divided.
    pub fn scale(&self) -> AxisScale {
        self.scale
    }

    /// Number of bins.
    pub fn count(&self) -> usize {
        self.edges.len() - 1
    }

    /// Least and greatest value of a bin; `None` without a range.
    ///
    /// # Panics
    /// If there is no such bin.
    pub fn bounds(&self, bin: usize) -> Option<[f64; 2]> {
        self.range.map(|_| [self.edges[bin], self.edges[bin + 1]])
    }

    /// Whether the range is one value or missing: the axis then has no extent.
    fn is_one_value(&self) -> bool {
        self.range.is_none_or(|[lo, hi]| lo == hi)
    }

    /// Position of a value on the axis: 0 at and below the low end, 1 at and above the high end; 0 if the range is one value or missing.
    /// Bins are equally wide in positions.
    pub fn position(&self, value: f32) -> f64 {
        if self.is_one_value() {
            return 0.0;
        }
        let (lo, hi) = (self.edges[0], self.edges[self.count()]);
        let share = match self.scale {
            AxisScale::Linear => (f64::from(value) - lo) / (hi - lo),
            AxisScale::Octaves => {
                let keys = f64::from(value.max(0.0).to_bits()) / f64::from(1_u32 << self.key_shift());
                (keys - f64::from(self.first_key)) / self.count() as f64
            }
        };
        share.clamp(0.0, 1.0)
    }

    /// The value at a position 0..=1 of the axis, the inverse of [`Self::position`] but for rounding. With octaves position 0 gives the
    /// greatest value that has it. If the range is one value it is returned everywhere; 0 if there is no range.
    pub fn value_at(&self, position: f64) -> f64 {
        if self.is_one_value() {
            return self.edges[0];
        }
        let (lo, hi) = (self.edges[0], self.edges[self.count()]);
        let position = position.clamp(0.0, 1.0);
        match self.scale {
            AxisScale::Linear => lo * (1.0 - position) + hi * position,
            AxisScale::Octaves => {
                let keys = f64::from(self.first_key) + position * self.count() as f64;
                let bits = (keys * f64::from(1_u32 << self.key_shift())).round() as u32;
                // Behind the greatest number is only infinity.
                f64::from(f32::from_bits(bits).min(f32::MAX))
            }
        }
    }

    /// The bin of a value; `None` if it is not finite.
    pub fn bin(&self, value: f32) -> Option<usize> {
        if !value.is_finite() {
            return None;
        }
        let last = self.count() - 1;
        if self.scale == AxisScale::Octaves {
            let key = if value > 0.0 { value.to_bits() >> self.key_shift() } else { 0 };
            return Some(if self.range.is_none() {
                0
            } else {
                (key.saturating_sub(self.first_key) as usize).min(last)
            });
        }
        let mut bin = ((self.position(value) * (last + 1) as f64) as usize).min(last);
        if self.edges[0] < self.edges[last + 1] {
            let value = f64::from(value);
            // The position is rounded; the edges decide.
            while bin > 0 && value < self.edges[bin] {
                bin -= 1;
            }
            while bin < last && value >= self.edges[bin + 1] {
                bin += 1;
            }
        }
        Some(bin)
    }

    /// Bins of octaves that also cover `range`, and by how many bins the old ones move down in them; old bins below the first are merged
    /// into it, otherwise this is exact. `None` if they cover it already, or are not octaves.
    pub(super) fn widened(&self, range: Option<[f32; 2]>) -> Option<(Self, usize)> {
        let [_, hi] = range?;
        if self.scale != AxisScale::Octaves || self.range.is_some_and(|[_, before]| hi <= before) {
            return None;
        }
        let wider = Self::octaves(range, self.count());
        // Without a range the old bins are empty.
        let down = wider.first_key - if self.range.is_some() { self.first_key } else { wider.first_key };
        Some((wider, down as usize))
    }
}

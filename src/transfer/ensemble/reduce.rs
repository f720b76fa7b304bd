//! Reduction of members of two-dimensional spaces to the scalar by counts of values (dissertation 7.3).
//!
//! The dissertation has "the number of scalar values within a 2D widget and the number outside" and lets the fraction reduce the intensity
//! of the colour. That it also reduces opacity, and the means where opacity is not constant, are decisions made here.

use crate::moments::Histogram2d;
use crate::transfer::profile::{ProfilePoint, Side};
use serde::{Deserialize, Serialize};

/// Counts of values in bins of equal size over the positions 0..=1 of two axes: the scalar, over the series' range, and the second axis of
/// a [`Space`](super::Space).
pub trait Counts2d: Sync {
    /// Number of bins along the scalar and along the second axis.
    fn bins(&self) -> [usize; 2];

    /// Number of values in a bin.
    fn count(&self, x: usize, y: usize) -> u64;

    /// The value of the second quantity at a position 0..=1 of its axis.
    fn second_at(&self, position: f64) -> f64;
}

impl Counts2d for Histogram2d {
    fn bins(&self) -> [usize; 2] {
        [self.x().count(), self.y().count()]
    }

    fn count(&self, x: usize, y: usize) -> u64 {
        self.counts().get(y * self.x().count() + x).copied().unwrap_or(0)
    }

    fn second_at(&self, position: f64) -> f64 {
        self.y().value_at(position)
    }
}

/// What is scaled by the share of values inside a member's widgets when the member is reduced to the scalar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reduction {
    /// Colour and opacity.
    #[default]
    Intensity,
    /// Opacity only: rare values keep their colour.
    Opacity,
    /// Nothing: the member keeps its axes in [`Ensemble::joint_table`](super::Ensemble::joint_table).
    /// [`Ensemble::curve`](super::Ensemble::curve) reduces it as `Intensity`.
    Keep,
}

impl Reduction {
    /// The reduced curve over the scalar; `side` gives colour and opacity at a scalar and a second position, `scalar_at` the scalar at a
    /// position of the series' range.
    ///
    /// In a column of the counts, with f the share of its values at which opacity is above 0, C and a the means over these
    /// (of colour with the weight of opacity), the curve has f C and f a in the middle of the column, and is linear from
    /// there to the next column that has values.
    pub(super) fn curve(
        self,
        counts: &dyn Counts2d,
        scalar_at: impl Fn(f64) -> f64,
        side: impl Fn(f64, f64) -> Side,
    ) -> Vec<ProfilePoint> {
        let [columns, rows] = counts.bins();
        let middle = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
        let point = |x: usize| {
            let scalar = scalar_at(middle(x, columns));
            let values = (0..rows).map(|y| (counts.count(x, y) as f64, middle(y, rows))).filter(|(n, _)| *n > 0.0);
            let side = self.mean(values.map(|(n, y)| (n, side(scalar, y))))?;
            Some(ProfilePoint { scalar, left: side, right: side })
        };
        let mut points: Vec<ProfilePoint> = (0..columns).filter_map(point).collect();
        points.dedup_by(|next, kept| next.scalar <= kept.scalar);
        points
    }

    /// The reduced values of a column of counts; `None` if it is empty.
    fn mean(self, column: impl Iterator<Item = (f64, Side)>) -> Option<Side> {
        let (mut all, mut inside, mut opacity, mut color) = (0.0, 0.0, 0.0, [0.0; 3]);
        for (n, side) in column {
            all += n;
            opacity += n * side.value;
            inside += if side.value > 0.0 { n } else { 0.0 };
            color = std::array::from_fn(|c| color[c] + n * side.value * side.rgb[c]);
        }
        let share = match self {
            Self::Intensity | Self::Keep => inside / all,
            Self::Opacity => 1.0,
        };
        let mean = |c: f64| if opacity > 0.0 { (share * (c / opacity)).clamp(0.0, 1.0) } else { 0.0 };
        // The share times the mean over the values inside.
        (all > 0.0).then(|| Side { rgb: color.map(mean), value: opacity / all })
    }
}

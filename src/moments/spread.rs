//! Statistics of each vertex over time.

use serde::{Deserialize, Serialize};

/// Denominator of the coefficient of variation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum CovDenominator {
    /// max(|mean|, `share` of the series range): finite wherever the mean is near zero. Default: 1 %.
    Floored {
        /// Share of the series range below which the mean is not used, in 0..=1.
        share: f64,
    },
    /// |mean|, the formula of Callahan's dissertation (6.1.4): infinite where the mean is zero and the variance is not.
    Plain,
}

impl Default for CovDenominator {
    fn default() -> Self {
        Self::Floored { share: 0.01 }
    }
}

/// Mean and variance over time of every vertex, over its finite samples.
#[derive(Clone, Debug, PartialEq)]
pub struct VertexStatistics {
    /// Mean; NaN for a vertex without a finite sample.
    pub mean: Vec<f64>,
    /// Variance (mean squared deviation); NaN for a vertex without a finite sample.
    pub variance: Vec<f64>,
    /// Number of finite samples, a whole number.
    pub finite_count: Vec<f64>,
}

impl VertexStatistics {
    /// Standard deviation over the chosen denominator, for each vertex. 0 where a vertex never changes, whatever its mean, and where it has
    /// no finite sample. `series_range` is the range of the whole field.
    pub fn coefficient_of_variation(&self, series_range: Option<[f32; 2]>, denominator: CovDenominator) -> Vec<f64> {
        let width = series_range.map_or(0.0, |[lo, hi]| f64::from(hi) - f64::from(lo));
        let floor = match denominator {
            CovDenominator::Floored { share } => share * width,
            CovDenominator::Plain => 0.0,
        };
        let of = |(mean, variance): (&f64, &f64)| match *variance > 0.0 {
            true => variance.sqrt() / mean.abs().max(floor),
            false => 0.0,
        };
        self.mean.iter().zip(&self.variance).map(of).collect()
    }
}

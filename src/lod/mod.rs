//! Level of detail: which subset of the faces is drawn.
//!
//! Sample-based, as in Callahan's dissertation (6.1.4): a [`Ranking`] orders the interior faces once, and a frame draws the first of them.
//! [`importance`] is its global strategy (6.1.4.2): faces whose scalars change much over time come first, one ranking for the whole series.
//! [`Ranking::by_strata`] is its local one (6.1.4.1): faces are drawn at random from a histogram of their scalars at one step, and each
//! [`Interval`] of the series has its own ranking. Neither is safe: on four of seven series a random subset is closer to the full image
//! (figures in docs/performance.md). The default is therefore a random subset that is denser where faces matter: [`sampling_density`],
//! [`Ranking::by_density`]. [`select()`] takes the first faces between active cells, and all faces of their surface.
//!
//! # Deviations from the dissertation
//! 1. The coefficient of variation is divided by max(|mean|, 1 % of the series' range), not by the mean
//!    ([`CovDenominator`](crate::moments::CovDenominator) offers the plain formula too): means near zero make it rounding
//!    noise. Where nothing ever changes it is 0.
//! 2. Equal importances are ordered by a hash of their ids. Ids follow the vertices along a curve: in id order, a
//!    subset of the static faces would be those of one corner of the mesh.
//! 3. The default ranking is neither of the dissertation's two.
//! 4. The surface of the active cells is drawn whole at every level: it bounds the first and the last gap on a ray.
//!
//! [`Selector`] and [`crate::visibility::DepthOrder`] do nothing while their inputs stay the same: the depth order depends on a direction
//! and a list, so neither time nor panning costs a sort, and the active set filters the sorted list. A store has coefficients of variation
//! and intervals from its import (`lod/FIELD/global`, `local_6`); missing ones are computed.

#[cfg(test)]
mod density_tests;
mod importance;
mod interpolation_error;
mod intervals;
mod ranking;
mod selection;
mod strata;
#[cfg(test)]
mod tests;

pub use importance::{cell_density, importance};
pub use interpolation_error::sampling_density;
pub use intervals::{Interval, Partition, interval_at, step_change};
pub use ranking::{Ranking, list_change};
pub use selection::{CellSelector, Selector, select};

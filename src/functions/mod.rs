//! Fields as sums of functions: a value at any place from smooth functions instead of cells.
//!
//! With the distance d from a function's centre in units of its widths, and its value v,
//!
//! ```text
//! f(x) = sum v_i phi(d_i(x)) / sum phi(d_i(x)),    d_i^2 = (x - mu_i)^T S_i^-1 (x - mu_i),    S_i = L_i L_i^T
//! ```
//!
//! (Neophytou and Mueller 2006, section 3: normalised ellipsoidal Gaussians.) A function is **compact by definition**,
//!
//! ```text
//! phi(d) = max(0, exp(-d^2 / 2) - exp(-c^2 / 2)),    c = 3 unless told otherwise
//! ```
//!
//! so that f is continuous and the same wherever it is evaluated: functions cut afterwards, as the paper's, jump by exp(-c^2 / 2) where they
//! end. Between the least and the greatest value of the functions that reach a place, f is there: it is their weighted mean.
//!
//! [`Kernels`] are the functions without their values, in the local units of a mesh. The fit [`vertices`] puts one at each vertex, as wide as
//! the edges there are long; its values are the scalars of a step as they are, so that a series needs no fitting, and every codec serves.
//! `points` does so without cells.
//!
//! What has the field (the mesh) is not said by the functions: they reach beyond its boundary. Where there is no mesh, [`coverage`] says it.

pub mod coverage;
pub mod eval;
mod factor;
mod kernels;
#[cfg(feature = "clouds")]
pub mod points;
pub mod report;
pub mod vertices;

#[cfg(test)]
pub(crate) use kernels::tests::random_factor;
pub use kernels::{Kernels, Placed, value_at};

//! [`Lengths`] for which a table is made, and how far it may then be from its transfer function.

use super::TransferError;
use super::opacity::{OPAQUE_DEPTH, OpacityKind};
use serde::{Deserialize, Serialize};

/// Largest error of the optical depth of a path of any length up to the longest one, if that is larger than
/// [`DEPTH_SHARE`] of it.
///
/// x e^-x is at most 1/e, so that an error of 2.7e-5 x of an optical depth x is one of 1e-5 of opacity.
pub const DEPTH_TOLERANCE: f64 = 1e-5;

/// Largest error of the optical depth of a path, as a share of it, if that is larger than [`DEPTH_TOLERANCE`].
pub const DEPTH_SHARE: f64 = 2.7e-5;

/// Largest error of a colour channel of a pixel: the error of the colour at a scalar, times the opacity of that scalar over the longest
/// path.
pub const COLOR_TOLERANCE: f64 = 1e-5;

/// The part of [`COLOR_TOLERANCE`] that one scalar may use. A path has scalars that keep the absolute tolerance and scalars that keep the
/// relative one, so the errors of both add up.
const COLOR_PART: f64 = 0.5;

/// The part of [`DEPTH_TOLERANCE`] that one scalar may use. Small because the absolute tolerance holds only at the foot of ramps, where few
/// lines follow it.
const DEPTH_PART: f64 = 1.0 / 16.0;

/// The part of [`DEPTH_SHARE`] that one scalar may use: the rest, because this tolerance decides how long lines are where the function is
/// visible.
const SHARE_PART: f64 = 1.0 - DEPTH_PART;

/// Tolerance of the lines of a joint table, which differ by more from their neighbours: for colours, and for the optical depth d of a unit
/// distance the larger of this and this part of d.
pub const JOINT_TOLERANCE: f64 = 1.0 / 4096.0;

/// The lengths for which a table is made, in world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lengths {
    /// The length that opacities refer to.
    pub unit_distance: f64,
    /// Length of the longest path on which the table keeps its tolerance: the diagonal of the mesh's box.
    pub longest_path: f64,
}

impl Lengths {
    /// A unit distance in a mesh whose box has a diagonal of `longest_path`.
    pub fn new(unit_distance: f64, longest_path: f64) -> Self {
        Self { unit_distance, longest_path }
    }

    /// The default: opacities refer to 1 % of the diagonal of the mesh's box.
    pub fn of_diagonal(diagonal: f64) -> Self {
        Self::new(0.01 * diagonal, diagonal)
    }

    /// A unit distance, and a longest path of a hundred of them.
    pub fn of_unit_distance(unit_distance: f64) -> Self {
        Self::new(unit_distance, 100.0 * unit_distance)
    }

    /// Fails if a length is not positive and finite, or the unit distance so small that extinction overflows.
    pub(super) fn check(&self) -> Result<(), TransferError> {
        let Self { unit_distance, longest_path } = *self;
        let is_usable = |length: f64| length > 0.0 && length.is_finite();
        if !is_usable(unit_distance) || !(OPAQUE_DEPTH / unit_distance).is_finite() {
            return Err(TransferError::BadUnitDistance(unit_distance));
        }
        if is_usable(longest_path) { Ok(()) } else { Err(TransferError::BadLongestPath(longest_path)) }
    }
}

/// Allowed distance from a transfer function at a scalar.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// Error of a colour channel where the longest path is opaque.
    color: f64,
    /// Error of the optical depth of a unit distance: this,
    pub depth: f64,
    /// or this part of the depth, whichever is larger.
    pub share: f64,
    /// Length of the longest path in unit distances.
    units: f64,
}

impl Tolerance {
    /// The tolerance that keeps paths of up to the longest length within [`DEPTH_TOLERANCE`] or [`DEPTH_SHARE`], and [`COLOR_TOLERANCE`].
    pub fn of_paths(lengths: &Lengths) -> Self {
        // Paths shorter than a unit distance need no closer tolerance.
        let units = (lengths.longest_path / lengths.unit_distance).max(1.0);
        let (depth, share) = (DEPTH_PART * DEPTH_TOLERANCE / units, SHARE_PART * DEPTH_SHARE);
        Self { color: COLOR_PART * COLOR_TOLERANCE, depth, share, units }
    }

    /// The tolerance of a line of a joint table.
    pub fn of_joint() -> Self {
        Self { color: JOINT_TOLERANCE, depth: JOINT_TOLERANCE, share: JOINT_TOLERANCE, units: f64::INFINITY }
    }

    /// The tolerance times `part`.
    pub fn part(self, part: f64) -> Self {
        Self { color: part * self.color, depth: part * self.depth, share: part * self.share, ..self }
    }

    /// The tolerance with colours checked even where transparent.
    pub fn everywhere(self) -> Self {
        Self { units: f64::INFINITY, ..self }
    }

    /// Allowed error of a colour channel where the optical depth of a unit distance is `depth`: nearly transparent colours may be off by
    /// more.
    pub fn of_color(&self, depth: f64) -> f64 {
        self.color / (depth * self.units).min(1.0)
    }

    /// Error allowed of a value between `least` and `most`, which are opacities or optical depths of a unit distance.
    pub fn of_value(&self, kind: OpacityKind, least: f64, most: f64) -> f64 {
        match kind {
            OpacityKind::Extinction => self.depth.max(self.share * least),
            // The depth -ln(1 - a) changes 1 / (1 - a) times as fast as a; a table caps it at 24 ln 2.
            OpacityKind::Alpha => {
                let transparent = (1.0 - most).max(1.0 / f64::from(1 << 24));
                transparent * self.depth.max(self.share * -(-least).ln_1p())
            }
        }
    }
}

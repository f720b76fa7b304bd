//! What the opacity values of a transfer function mean.

use crate::words::words;
use serde::{Deserialize, Serialize};

/// Meaning of opacity values, a, over the unit distance u.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OpacityKind {
    /// a is the opacity of a layer of thickness u, 0..=1; between two points opacity is linear. tau = -ln(1 - a) / u.
    #[default]
    Alpha,
    /// a is the optical depth of such a layer, unbounded; between two points extinction is linear. tau = a / u. This is
    /// what the unstructured-grid mappers of VTK and ParaView do.
    Extinction,
}

impl OpacityKind {
    /// Optical depth of a unit distance with this value; infinite for opacity 1.
    pub(super) fn depth(self, value: f64) -> f64 {
        match self {
            Self::Alpha => -(-value).ln_1p(),
            Self::Extinction => value,
        }
    }
}

words!(OpacityKind, "there is no opacity kind", ["alpha" = Alpha, "extinction" = Extinction]);

/// Optical depth of a unit distance where opacity is 1 over an interval. So large that a ray that meets the interval at all is
/// opaque: with 2^20 a ray that clipped an edge of the mesh for 1.5e-6 of a unit distance had an opacity of 0.8 that hung on the tenth
/// digit of its length, which single precision does not have.
pub(super) const OPAQUE_DEPTH: f64 = (1u64 << 40) as f64;

//! Integration of the emission-absorption model over one segment of a ray.
//!
//! The model (dissertation 1.1.2, eq. 1.2, low albedo): along a ray of length t with colour c and extinction tau,
//!
//! ```text
//! C = integral of c(t) tau(t) T(t) dt,    T(t) = exp(-integral from 0 to t of tau),    alpha = 1 - T(end)
//! ```
//!
//! with premultiplied C composited front to back. Inside a cell the scalar is linear in t, between two nodes of the
//! [`NodeTable`](crate::node_table::NodeTable) colour and extinction are linear in the scalar: a segment that is split at
//! the nodes has pieces on which everything is linear in t. [`exact`] integrates those.

pub mod exact;
mod scalar_map;
mod weights;

use glam::Vec4;
pub use scalar_map::ScalarMap;
pub use weights::{PieceWeights, piece_weights};

/// Light gathered along a ray from the front: premultiplied colour and opacity, and what still shines through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accumulator {
    /// Premultiplied red, green, blue, and opacity, summed without cancellation.
    rgba: Vec4,
    /// Transmittance.
    pub transmittance: f32,
}

/// A ray is stopped when less than this shines through: what lies behind can change no channel by more than 2^-17,
/// which is below the 1e-5 that the fast paths may differ from the reference.
pub const OPAQUE_TRANSMITTANCE: f32 = 1.0 / 131_072.0;

impl Accumulator {
    /// Nothing gathered, everything shines through.
    pub const CLEAR: Self = Self { rgba: Vec4::ZERO, transmittance: 1.0 };

    /// Whether what lies behind no longer matters; see [`OPAQUE_TRANSMITTANCE`].
    #[inline]
    pub fn is_opaque(&self) -> bool {
        self.transmittance < OPAQUE_TRANSMITTANCE
    }

    /// Composites a piece with linear colour from `near` to `far` (red, green, blue, 1) behind what has been gathered.
    #[inline]
    pub fn add(&mut self, weights: PieceWeights, near: Vec4, far: Vec4) {
        self.rgba += near * (self.transmittance * weights.near) + far * (self.transmittance * weights.far);
        self.transmittance *= weights.transmittance;
    }

    /// The gathered light as a pixel.
    pub fn pixel(&self) -> [f32; 4] {
        self.rgba.to_array()
    }
}

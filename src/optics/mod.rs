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
mod weights;

pub use weights::{PieceWeights, piece_weights};

/// Light gathered along a ray from the front: premultiplied colour, opacity, and what still shines through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accumulator {
    /// Premultiplied red, green, blue.
    pub rgb: [f32; 3],
    /// Opacity, 1 - transmittance, summed without cancellation.
    pub alpha: f32,
    /// Transmittance.
    pub transmittance: f32,
}

/// A ray is stopped when less than this shines through: what lies behind can change no channel by more than 2^-17,
/// which is below the 1e-5 that the fast paths may differ from the reference.
pub const OPAQUE_TRANSMITTANCE: f32 = 1.0 / 131_072.0;

impl Accumulator {
    /// Nothing gathered, everything shines through.
    pub const CLEAR: Self = Self { rgb: [0.0; 3], alpha: 0.0, transmittance: 1.0 };

    /// Whether what lies behind no longer matters; see [`OPAQUE_TRANSMITTANCE`].
    #[inline]
    pub fn is_opaque(&self) -> bool {
        self.transmittance < OPAQUE_TRANSMITTANCE
    }

    /// Composites a piece with linear colour from `near` to `far` behind what has been gathered.
    #[inline]
    pub fn add(&mut self, w: PieceWeights, near: [f32; 3], far: [f32; 3]) {
        let (wn, wf) = (self.transmittance * w.near, self.transmittance * w.far);
        for i in 0..3 {
            self.rgb[i] += wn * near[i] + wf * far[i];
        }
        self.alpha += wn + wf;
        self.transmittance *= w.transmittance;
    }

    /// The gathered light as a pixel.
    pub fn pixel(&self) -> [f32; 4] {
        [self.rgb[0], self.rgb[1], self.rgb[2], self.alpha]
    }
}

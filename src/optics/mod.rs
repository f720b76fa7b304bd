//! Integration of the emission-absorption model over one segment of a ray.
//!
//! The model (dissertation 1.1.2, eq. 1.2, low albedo): along a ray of length t with colour c and extinction tau,
//!
//! ```text
//! C = integral of c(t) tau(t) T(t) dt,    T(t) = exp(-integral from 0 to t of tau),    alpha = 1 - T(end)
//! ```
//!
//! with premultiplied C composited front to back. Inside a cell the scalar is linear in t, between two nodes of the
//! [`NodeTable`](crate::node_table::NodeTable) colour and extinction are linear in the scalar: a segment that is split at the nodes has
//! pieces on which everything is linear in t. [`exact`] integrates those, [`partial`] combines precomputed integrals over the nodes,
//! [`table3d`] looks segments up in a three-dimensional table. Renderers are generic over [`Integrator`]. [`joint`] is [`exact`] for a
//! transfer function of more than the scalar.

pub mod exact;
pub mod joint;
pub mod partial;
pub mod quadrature;
mod scalar_map;
pub mod table3d;
mod table3d_entries;
mod thick;
mod weights;

use crate::words::words;
use glam::Vec4;
pub use scalar_map::ScalarMap;
use serde::{Deserialize, Serialize};
pub(crate) use thick::exp_neg;
pub(crate) use weights::{DEPTH_MAX, WEIGHED_AT_ONCE, weigh_thick, weigh_thin};
pub use weights::{PieceWeights, homogeneous_weights, piece_weights};

/// How segments are integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OpticsKind {
    /// Split at the nodes of the transfer function, [`exact`].
    #[default]
    Exact,
    /// Pre-integrated table, [`table3d`].
    Table3d,
    /// Opacity from integrals over the scalar, colour from two moments, [`partial`].
    Partial,
}

words!(OpticsKind, "there are no optics", ["exact" = Exact, "table3d" = Table3d, "partial" = Partial]);

/// A transfer function prepared for the integration of segments of rays.
pub trait Integrator: Sync {
    /// State of a ray in the transfer function, kept from segment to segment.
    type Place: Copy;

    /// The state of a ray that enters the volume, or continues after a gap, at this scalar.
    fn enter(&self, scalar: f64) -> Self::Place;

    /// Composites a segment of length `length` (> 0) along which the scalar goes linearly from `s0` to `s1` (both finite).
    /// `s0` is the scalar at which the ray entered or the `s1` of the segment before. Returns the number of pieces that
    /// were integrated; 0 if nothing was visible.
    fn segment(&self, place: &mut Self::Place, s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64;

    /// Composites segments one after the other, given as scalar at the end and length: the same as [`Self::segment`] for each, which begins
    /// at the scalar where the one before ended, the first at `s0`. Faster, as work that does not depend on the segment before is done side
    /// by side.
    #[inline(always)]
    fn segments(
        &self,
        place: &mut Self::Place,
        mut s0: f64,
        segments: impl Iterator<Item = (f64, f64)>,
        out: &mut Accumulator,
    ) -> u64 {
        let mut pieces = 0;
        for (s1, length) in segments {
            pieces += self.segment(place, s0, s1, length, out);
            s0 = s1;
        }
        pieces
    }

    /// The transfer function itself, whatever the integration method: where it is transparent.
    fn exact(&self) -> &exact::ExactTable;

    /// The table of the exact integrator, if this is one.
    #[inline(always)]
    fn as_exact(&self) -> Option<&exact::ExactTable> {
        None
    }
}

/// Light gathered along a ray from the front: premultiplied colour, opacity, and transmittance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accumulator {
    /// Premultiplied red, green, blue, and opacity, summed without cancellation.
    rgba: Vec4,
    /// Transmittance.
    pub transmittance: f32,
    /// Rounding error carried by `transmittance`: 10^4 pieces of depth 1e-7 would otherwise make it 1.9e-4 too small.
    carried: f32,
    /// Depth of the first visible point, if a caller that knows depths has set it; infinite before.
    pub visible_from: f64,
}

/// A ray is stopped when its transmittance is below this: what lies behind can change no channel by more than 2^-17, which is below the
/// 1e-5 that the fast paths may differ from the reference.
pub const OPAQUE_TRANSMITTANCE: f32 = 1.0 / 131_072.0;

impl Accumulator {
    /// The light of a ray that has met no extinction: transmittance 1.
    pub const TRANSPARENT: Self =
        Self { rgba: Vec4::ZERO, transmittance: 1.0, carried: 0.0, visible_from: f64::INFINITY };

    /// An accumulator of these parts: red, green, blue and opacity; transmittance; its carried rounding error.
    #[inline(always)]
    pub(crate) fn of_parts(rgba: [f32; 4], transmittance: f32, carried: f32) -> Self {
        Self { rgba: Vec4::from_array(rgba), transmittance, carried, ..Self::TRANSPARENT }
    }

    /// The arguments of [`Self::of_parts`].
    #[inline(always)]
    pub(crate) fn parts(&self) -> ([f32; 4], f32, f32) {
        (self.rgba.to_array(), self.transmittance, self.carried)
    }

    /// Whether what lies behind no longer matters; see [`OPAQUE_TRANSMITTANCE`].
    #[inline]
    pub fn is_opaque(&self) -> bool {
        self.transmittance < OPAQUE_TRANSMITTANCE
    }

    /// Composites a piece with linear colour from `near` to `far` (red, green, blue, 1) behind what has been gathered.
    ///
    /// Transmittance is decreased by the gathered opacity. Multiplied by one less the piece's opacity instead, it would be off by the
    /// rounding of that factor for each piece, alike for equal pieces: 7e-5 after 10^4 of them.
    #[inline]
    pub fn add(&mut self, weights: PieceWeights, near: Vec4, far: Vec4) {
        let (of_near, of_far) = (self.transmittance * weights.near, self.transmittance * weights.far);
        self.rgba += near * of_near + far * of_far;
        // Not the sum in `rgba`, which would be known an operation later.
        self.dim(self.transmittance * (weights.near + weights.far));
    }

    /// Decreases transmittance by the gathered opacity. The rounding error of a difference goes into the next one (Kahan summation), so
    /// that it does not grow with the number of pieces. 0 changes nothing: at most half a bit is carried.
    #[inline(always)]
    fn dim(&mut self, gathered: f32) {
        let change = self.carried - gathered;
        let left = self.transmittance + change;
        self.carried = change - (left - self.transmittance);
        self.transmittance = left;
    }

    /// An empty accumulator behind this one, with its transmittance: for light that is shaded before it counts.
    pub(crate) fn behind(&self) -> Self {
        Self { rgba: Vec4::ZERO, ..*self }
    }

    /// Adds light gathered [behind](Self::behind) this accumulator, its colour times `share`.
    pub(crate) fn add_lit(&mut self, behind: Self, share: f32) {
        let rgba = self.rgba + behind.rgba * Vec4::new(share, share, share, 1.0);
        *self = Self { rgba, ..behind };
    }

    /// Composites premultiplied light (red, green, blue, alpha) of opacity `alpha` behind what has been gathered.
    #[inline]
    pub fn add_premultiplied(&mut self, light: Vec4, alpha: f32) {
        self.rgba += light * self.transmittance;
        self.dim(self.transmittance * alpha);
    }

    /// The gathered light as a pixel.
    pub fn pixel(&self) -> [f32; 4] {
        self.rgba.to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How far opacity and transmittance are off at most after any number of equal pieces of depth `a`, composited by `add`.
    fn worst(a: f32, pieces: u32, add: impl Fn(&mut Accumulator)) -> [f64; 2] {
        let mut light = Accumulator::TRANSPARENT;
        let mut worst = [0.0f64; 2];
        for n in 1..=pieces {
            // As a renderer ends a ray; what is behind is below the bound.
            if light.is_opaque() {
                break;
            }
            add(&mut light);
            let depth = f64::from(a) * f64::from(n);
            let opacity = (f64::from(light.pixel()[3]) + (-depth).exp_m1()).abs();
            let through = (f64::from(light.transmittance) - (-depth).exp()).abs();
            worst = [worst[0].max(opacity), worst[1].max(through)];
        }
        worst
    }

    #[test]
    fn ten_thousand_pieces_are_as_exact_as_one() {
        let white = Vec4::ONE;
        let mut naive_worst = 0.0f64;
        for a in [1e-9, 1e-7, 1e-6, 3.3e-6, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.1, 0.24, 0.26, 2.0, 20.0] {
            let weights = piece_weights(a, a);
            let [off, through] = worst(a, 10_000, |light| light.add(weights, white, white));
            // Measured: 5.9e-6 at most (a = 1e-3, where what is added comes near to the rounding of the sum), else below 2e-6.
            assert!(off < 1e-5 && through < 1e-6, "{a:e}: off by {off:.1e}, {through:.1e}");
            let alpha = weights.near + weights.far;
            let [off, through] = worst(a, 10_000, |light| light.add_premultiplied(white * alpha, alpha));
            assert!(off < 1e-5 && through < 1e-6, "premultiplied, {a:e}: off by {off:.1e}, {through:.1e}");
            // The product of what the pieces let through.
            let [naive, _] = worst(a, 10_000, |light| {
                light.rgba += white * (light.transmittance * alpha);
                light.transmittance *= 1.0 - alpha;
            });
            naive_worst = naive_worst.max(naive);
        }
        assert!(naive_worst > 5e-5, "the product is off by {naive_worst:.1e} only");
    }

    #[test]
    fn ten_thousand_thin_pieces_behind_anything_dim_as_one() {
        let weights = piece_weights(1e-7, 1e-7);
        let mut naive_worst = 0.0f64;
        for opacity in [0.0f32, 0.01, 0.1, 0.3, 0.45, 0.6, 0.9] {
            let mut light = Accumulator::TRANSPARENT;
            light.add_premultiplied(Vec4::ONE * opacity, opacity);
            let mut naive = light.transmittance;
            for _ in 0..10_000 {
                light.add(weights, Vec4::ONE, Vec4::ONE);
                naive -= naive * weights.near + naive * weights.far;
            }
            let expected = (1.0 - f64::from(opacity)) * (-1e4 * f64::from(1e-7f32)).exp();
            let off = (f64::from(light.transmittance) - expected).abs();
            // Weights are off by 3e-7 of themselves, and their sum is a thousandth: what is left is half a bit of the sum. Measured: 3e-8.
            assert!(off < 1e-6, "{opacity}: {off:.1e}");
            naive_worst = naive_worst.max((f64::from(naive) - expected).abs());
        }
        assert!(naive_worst > 1e-4, "without what is carried, {naive_worst:.1e} only");
    }

    #[test]
    fn an_opaque_piece_lets_nothing_through() {
        for a in [17.0, 18.0, 30.0, 1e7, 1e30] {
            for b in [17.0, 18.0, 30.0, 1e7, 1e30] {
                let mut light = Accumulator::TRANSPARENT;
                light.add(piece_weights(0.3, 0.1), Vec4::ONE, Vec4::ONE);
                light.add(piece_weights(a, b), Vec4::ONE, Vec4::ONE);
                // But exp(-17) = 4e-8 of it, a bit (6e-8) that the weights' sum is rounded by, and what was carried, half a bit.
                assert!(light.transmittance.abs() < 1.4e-7 && light.is_opaque(), "{a} {b}: {light:?}");
            }
        }
    }
}

//! The light of successive whole pieces by itself: it waits for the transmittance in front of them once for all of them.

use super::super::{Accumulator, PieceWeights};
use glam::Vec4;

/// Most pieces of a run.
pub(crate) const RUN: usize = 8;

/// Whole pieces that are composited together, each at its place: the first one may be invisible.
///
/// One piece after the other, an [`Accumulator`] takes four dependent operations each, and a ray crosses dozens of nodes in a cell. Here the
/// transmittance in front of each piece is a product, and light a sum, both of pairs of pairs, in vectors the same to the last bit
/// (`render::cpu::lanes::exact::whole`).
///
/// The product has up to 7 factors rounded by 2^-24 of themselves and is rounded 3 times, a piece's part 2 times, their sum 3 times: the opacity
/// of a run is off by at most 15 x 2^-24 = 9e-7 of itself, besides its weights. So is the optical depth x of all runs, whose transmittance is off by
/// 9e-7 x exp(-x) <= 3.3e-7.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    weights: [PieceWeights; RUN],
    /// Red, green, blue and 1 at the near and the far ends.
    colors: [[Vec4; 2]; RUN],
    /// Places up to the last piece.
    count: usize,
}

impl Run {
    pub(crate) const EMPTY: Self =
        Self { weights: [PieceWeights { near: 0.0, far: 0.0 }; RUN], colors: [[Vec4::ZERO; 2]; RUN], count: 0 };

    /// Puts a piece at its place, behind those before.
    #[inline(always)]
    pub(crate) fn put(&mut self, place: usize, weights: PieceWeights, colors: [Vec4; 2]) {
        (self.weights[place], self.colors[place]) = (weights, colors);
        self.count = place + 1;
    }

    /// Composites the run behind other light, and empties it.
    #[inline(always)]
    pub(crate) fn end(&mut self, out: &mut Accumulator) {
        if self.count > 0 {
            let light = self.light();
            out.add_premultiplied(light, light.w);
            (self.weights, self.count) = (Self::EMPTY.weights, 0);
        }
    }

    /// Premultiplied red, green, blue, and opacity: of empty places behind the pieces there is none.
    #[inline(never)]
    fn light(&self) -> Vec4 {
        match self.count {
            0..=1 => self.light_of::<1>(),
            2 => self.light_of::<2>(),
            3..=4 => self.light_of::<4>(),
            _ => self.light_of::<RUN>(),
        }
    }

    /// The light of the first `N` places, a power of two.
    #[inline(always)]
    fn light_of<const N: usize>(&self) -> Vec4 {
        let opacity: [f32; N] = std::array::from_fn(|i| self.weights[i].near + self.weights[i].far);
        // What the piece in front of each lets through, then two, four, all of them.
        let mut through: [f32; N] = std::array::from_fn(|i| if i < 1 { 1.0 } else { 1.0 - opacity[i - 1] });
        for by in [1, 2, 4] {
            through = std::array::from_fn(|i| if i < by { through[i] } else { through[i] * through[i - by] });
        }
        let mut light: [Vec4; N] = std::array::from_fn(|i| {
            let (PieceWeights { near, far }, [near_color, far_color]) = (self.weights[i], self.colors[i]);
            let color = near_color * (through[i] * near) + far_color * (through[i] * far);
            color.with_w(through[i] * opacity[i])
        });
        let mut left = N;
        while left > 1 {
            left /= 2;
            (0..left).for_each(|i| light[i] = light[2 * i] + light[2 * i + 1]);
        }
        light[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::piece_weights;

    #[test]
    fn runs_of_any_depth_are_as_exact_as_pieces() {
        let mut without_run = 0.0f64;
        for a in [1e-9, 1e-7, 1e-6, 3.3e-6, 1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.1, 0.24, 0.26, 2.0, 20.0] {
            let weights = piece_weights(a, a);
            let (mut light, mut depth, mut naive) = (Accumulator::TRANSPARENT, 0.0, 1.0f32);
            for (index, pieces) in (1..RUN).chain([RUN, 3]).cycle().take(2000).enumerate() {
                let mut run = Run::EMPTY;
                // At the end of the run, or at its beginning.
                let first = (RUN - pieces) * (index % 2);
                for place in first..first + pieces {
                    run.put(place, weights, [Vec4::ONE; 2]);
                    naive -= naive * (weights.near + weights.far);
                }
                run.end(&mut light);
                depth += f64::from(a) * pieces as f64;
                let through = (f64::from(light.transmittance) - (-depth).exp()).abs();
                let opacity = (f64::from(light.pixel()[3]) + (-depth).exp_m1()).abs();
                // The bound of runs, that of weights, which is 4e-7 of each and of equal ones adds up to 4e-7 / e, and half a bit of T; of
                // opacity also half a bit of the sum for each of its parts, as of pieces.
                assert!(through < 6e-7 && opacity < 1e-5, "{a:e}, {depth}: {through:.1e}, {opacity:.1e}");
                without_run = without_run.max((f64::from(naive) - (-depth).exp()).abs());
                if light.is_opaque() {
                    break;
                }
            }
        }
        assert!(without_run > 6e-6, "a sum that carries nothing is off by {without_run:.1e} only");
    }

    #[test]
    fn a_run_of_one_piece_is_that_piece() {
        for place in 0..RUN {
            for (near, far) in [(0.1, 0.3), (1e-8, 2e-8), (3.0, 0.0)] {
                let (weights, colors) = (piece_weights(near, far), [Vec4::new(0.3, 0.7, 0.1, 1.0), Vec4::ONE]);
                let (mut alone, mut light, mut run) = (Accumulator::TRANSPARENT, Accumulator::TRANSPARENT, Run::EMPTY);
                alone.add(weights, colors[0], colors[1]);
                run.put(place, weights, colors);
                run.end(&mut light);
                assert_eq!(light, alone);
            }
        }
    }
}

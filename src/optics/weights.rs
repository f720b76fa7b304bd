//! Weights of the two end colours of a piece on which colour and extinction are linear.
//!
//! Let u in [0, 1] run along the piece, Theta(u) = a0 u + (a1 - a0) u^2 / 2 be the optical depth (a0, a1: extinction at
//! the ends times the length of the piece), and c(u) = c0 + (c1 - c0) u. Integration by parts gives
//!
//! ```text
//! C = c0 A + c1 B,    A = integral over [0,1] of (1 - exp(-Theta(u))) du,    A + B = alpha = 1 - exp(-Theta(1))
//! ```
//!
//! so all channels share the two weights and one integral is left. It has a closed form in erfcx and Dawson functions
//! that cancels for small optical depths, which is the usual case; instead:
//!
//! 1. Theta(1) <= [`SERIES_MAX`]: no exponential. With x = Theta(1), h = (a1 - a0) / 2 and g = u (1 - u),
//!    Theta(u) = x u - h g, so exp(-Theta) = exp(-x u) (1 + h g + (h g)^2 / 2 + ...) and
//!
//!    ```text
//!    A = (1 - (1 - exp(-x)) / x) - h P1(x) - h^2 P2(x) / 2 - h^3 P3(x) / 6 - h^4 P4(x) / 24,
//!    Pk(x) = integral of g^k exp(-x u) du
//!    ```
//!
//!    The four power series in x (alpha / x, the first term / x, P1, P2) are summed side by side in the lanes of a vector.
//!    With |h| <= x <= 1/4 the first terms left out are x^7 / 40320 of alpha, h^5 / (120 * 2772), h^3 x^3 / (6 * 5040) and
//!    h^4 x / (24 * 1260): all below 4e-8, the rounding of an f32 accumulator.
//! 2. else, with M the mean transmittance, A = 1 - M: [`thick`](super::thick) has it by a quadrature rule up to an optical depth of 5/2,
//!    and by closed forms beyond, of error and Dawson functions.
//!
//! With all roundings a weight of a piece is off by less than 4e-7.

use super::thick::{RULE_MAX, exp_neg, mean_by_rule, mean_of_fall, mean_of_rise};
use glam::Vec4;

/// Largest optical depth for which the series is used.
const SERIES_MAX: f32 = 0.25;
/// Beyond this optical depth exp(-x) is below f32's rounding of 1: nothing behind such a piece is visible.
pub(crate) const DEPTH_MAX: f32 = 18.0;

/// Weights of the colours at the two ends of a piece; their sum is its opacity, up to rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PieceWeights {
    /// Weight of the colour at the near end.
    pub near: f32,
    /// Weight of the colour at the far end.
    pub far: f32,
}

/// Weights of a piece whose extinction times length is `a0` at the near and `a1` at the far end (both finite and >= 0).
#[inline(always)]
pub fn piece_weights(a0: f32, a1: f32) -> PieceWeights {
    let depth = 0.5 * (a0 + a1);
    if depth <= SERIES_MAX { series(a0, a1, depth) } else { thick(a0, a1, depth) }
}

/// Coefficients of x^n in alpha / x, the first term / x, P1 and P2.
const SERIES: [Vec4; 6] = [
    Vec4::new(1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 30.0),
    Vec4::new(-1.0 / 2.0, -1.0 / 6.0, -1.0 / 12.0, -1.0 / 60.0),
    Vec4::new(1.0 / 6.0, 1.0 / 24.0, 1.0 / 40.0, 1.0 / 210.0),
    Vec4::new(-1.0 / 24.0, -1.0 / 120.0, -1.0 / 180.0, -1.0 / 1008.0),
    Vec4::new(1.0 / 120.0, 1.0 / 720.0, 1.0 / 1008.0, 1.0 / 6048.0),
    Vec4::new(-1.0 / 720.0, -1.0 / 5040.0, -1.0 / 6720.0, -1.0 / 43_200.0),
];

#[inline]
fn series(a0: f32, a1: f32, depth: f32) -> PieceWeights {
    let x = Vec4::splat(depth);
    let [c0, c1, c2, c3, c4, c5] = SERIES;
    let [alpha, first, p1, p2] = (c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))).to_array();
    // P3 / 6.
    let p3 = 1.0 / 840.0 - depth * (1.0 / 1680.0 - depth * (1.0 / 6048.0));
    let h = 0.5 * (a1 - a0);
    let bend = h * (p1 + h * (0.5 * p2 + h * (p3 + h * (1.0 / (24.0 * 630.0)))));
    let alpha = depth * alpha;
    let near = depth * first - bend;
    PieceWeights { near, far: alpha - near }
}

/// Weights of a piece of this optical depth (finite and >= 0) with constant extinction: there A has the closed form 1 - alpha / x, which
/// cancels for small depths only.
#[inline]
pub fn homogeneous_weights(depth: f32) -> PieceWeights {
    if depth <= SERIES_MAX {
        return series(depth, depth, depth);
    }
    let alpha = 1.0 - exp_neg(depth);
    let near = 1.0 - alpha / depth;
    PieceWeights { near, far: alpha - near }
}

/// [`SERIES`] as plain numbers, by order.
const fn series_by_order() -> [[f32; 4]; 6] {
    let mut orders = [[0.0; 4]; 6];
    let mut n = 0;
    while n < orders.len() {
        orders[n] = SERIES[n].to_array();
        n += 1;
    }
    orders
}

/// Number of pieces that [`weigh`] takes.
pub(crate) const WEIGHED_AT_ONCE: usize = 16;

/// [`piece_weights`] of many pieces, to the last bit: near and far. The lanes of a vector are pieces here, not series.
#[inline(always)]
pub(crate) fn weigh(a0: &[f32; WEIGHED_AT_ONCE], a1: &[f32; WEIGHED_AT_ONCE]) -> [[f32; WEIGHED_AT_ONCE]; 2] {
    let (mut weights, has_thick) = weigh_thin(a0, a1);
    if has_thick {
        weigh_thick(a0, a1, &mut weights);
    }
    weights
}

/// [`weigh`] for pieces of small optical depth; returns whether there are others, for [`weigh_thick`].
#[inline(always)]
pub(crate) fn weigh_thin(
    a0: &[f32; WEIGHED_AT_ONCE],
    a1: &[f32; WEIGHED_AT_ONCE],
) -> ([[f32; WEIGHED_AT_ONCE]; 2], bool) {
    let [c0, c1, c2, c3, c4, c5] = const { series_by_order() };
    let mut weights = [[0.0; WEIGHED_AT_ONCE]; 2];
    let mut has_thick = false;
    for l in 0..WEIGHED_AT_ONCE {
        let x = 0.5 * (a0[l] + a1[l]);
        let sum = |i: usize| c0[i] + x * (c1[i] + x * (c2[i] + x * (c3[i] + x * (c4[i] + x * c5[i]))));
        let p3 = 1.0 / 840.0 - x * (1.0 / 1680.0 - x * (1.0 / 6048.0));
        let h = 0.5 * (a1[l] - a0[l]);
        let bend = h * (sum(2) + h * (0.5 * sum(3) + h * (p3 + h * (1.0 / (24.0 * 630.0)))));
        let alpha = x * sum(0);
        let near = x * sum(1) - bend;
        (weights[0][l], weights[1][l]) = (near, alpha - near);
        has_thick |= x > SERIES_MAX;
    }
    (weights, has_thick)
}

/// Replaces the results of [`weigh_thin`] for thick pieces. Should not be inlined where pieces are weighed, which are mostly thin, but be
/// compiled with all of the processor's instructions.
#[inline(always)]
pub(crate) fn weigh_thick(
    a0: &[f32; WEIGHED_AT_ONCE],
    a1: &[f32; WEIGHED_AT_ONCE],
    weights: &mut [[f32; WEIGHED_AT_ONCE]; 2],
) {
    let [mut depth, mut through, mut mean] = [[0.0; WEIGHED_AT_ONCE]; 3];
    let [mut by_rule, mut rises, mut falls] = [false; 3];
    for l in 0..WEIGHED_AT_ONCE {
        let x = 0.5 * (a0[l] + a1[l]);
        (depth[l], through[l]) = (x, exp_neg(x));
    }
    // Without short circuits, which would prevent vectorization.
    for l in 0..WEIGHED_AT_ONCE {
        let (is_deep, ascends) = (depth[l] > RULE_MAX, a1[l] > a0[l]);
        by_rule |= (depth[l] > SERIES_MAX) & !is_deep;
        rises |= is_deep & ascends;
        falls |= is_deep & !ascends;
    }
    if by_rule {
        for l in 0..WEIGHED_AT_ONCE {
            mean[l] = mean_by_rule(a0[l], a1[l]);
        }
    }
    if rises {
        for l in 0..WEIGHED_AT_ONCE {
            let of_rise = mean_of_rise(a0[l], a1[l], through[l]);
            mean[l] = if depth[l] > RULE_MAX { of_rise } else { mean[l] };
        }
    }
    if falls {
        for l in 0..WEIGHED_AT_ONCE {
            let of_fall = mean_of_fall(a0[l], a1[l], through[l]);
            mean[l] = if (depth[l] > RULE_MAX) & (a1[l] <= a0[l]) { of_fall } else { mean[l] };
        }
    }
    for l in 0..WEIGHED_AT_ONCE {
        let thick = weights_of(mean[l], through[l]);
        let is_thick = depth[l] > SERIES_MAX;
        weights[0][l] = if is_thick { thick.near } else { weights[0][l] };
        weights[1][l] = if is_thick { thick.far } else { weights[1][l] };
    }
}

/// Weights of a piece whose optical depth is above [`SERIES_MAX`].
#[inline(never)]
fn thick(a0: f32, a1: f32, depth: f32) -> PieceWeights {
    let through = exp_neg(depth);
    let mean = if depth <= RULE_MAX {
        mean_by_rule(a0, a1)
    } else if a1 > a0 {
        mean_of_rise(a0, a1, through)
    } else {
        mean_of_fall(a0, a1, through)
    };
    weights_of(mean, through)
}

/// The weights of a piece with mean transmittance `mean` and transmittance `through`.
#[inline(always)]
fn weights_of(mean: f32, through: f32) -> PieceWeights {
    let alpha = 1.0 - through;
    let near = 1.0 - mean;
    let near = if near > 0.0 { near } else { 0.0 };
    let near = if near < alpha { near } else { alpha };
    PieceWeights { near, far: alpha - near }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, in f64 with many midpoint samples uniform in optical depth.
    fn oracle(a0: f64, a1: f64) -> (f64, f64) {
        let n = 200_000;
        let b = 0.5 * (a1 - a0);
        let depth = 0.5 * (a0 + a1);
        let limit = depth.min(60.0);
        let inverse = |x: f64| if x == 0.0 { 0.0 } else { 2.0 * x / (a0 + (a0 * a0 + 4.0 * b * x).max(0.0).sqrt()) };
        let (mut near, mut from) = (0.0, 0.0);
        for i in 0..n {
            let to =
                if limit == depth && i + 1 == n { 1.0 } else { inverse(limit * (i + 1) as f64 / n as f64).min(1.0) };
            let u = 0.5 * (from + to);
            near += -(-u * (a0 + b * u)).exp_m1() * (to - from);
            from = to;
        }
        near += 1.0 - from; // where transmittance is 0
        (near, -(-depth).exp_m1() - near)
    }

    #[test]
    fn weights_agree_with_the_definition_over_eight_decades() {
        let ends = [0.0, 1e-30, 1e-4, 0.003, 0.05, 0.119, 0.121, 0.24, 0.5, 1.0, 1.9, 3.0, 8.0, 30.0, 300.0, 1e6];
        let mut worst: f64 = 0.0;
        for a0 in ends {
            for a1 in ends {
                let w = piece_weights(a0 as f32, a1 as f32);
                let (near, far) = oracle(f64::from(a0 as f32), f64::from(a1 as f32));
                worst = worst.max((f64::from(w.near) - near).abs()).max((f64::from(w.far) - far).abs());
                // Their sum, below 1, is rounded once (6e-8), and what is taken from it once more. Measured: never beyond.
                assert!(w.near >= 0.0 && w.far >= -1e-7 && w.near + w.far <= 1.0 + f32::EPSILON, "{a0} {a1} {w:?}");
            }
        }
        // 4e-8 and 9e-8 of the two branches plus a few f32 roundings of numbers up to 1 (6e-8 each).
        assert!(worst < 4e-7, "worst {worst:e}");
        // An extinction that is off by a ten thousandth would be seen, in either branch.
        for a0 in [0.1, 0.5] {
            let (near, _) = oracle(a0 * 1.0001, 0.1);
            assert!((f64::from(piece_weights(a0 as f32, 0.1).near) - near).abs() > 1e-6);
        }
    }

    #[test]
    fn weights_side_by_side_are_those_one_by_one_to_the_last_bit() {
        let ends: [f32; 13] = [0.0, 1e-30, 1e-7, 1e-3, 0.01, 0.03, 0.1, 0.12, 0.249, 0.26, 1.0, 30.0, 1e6];
        let pairs: Vec<[f32; 2]> = ends.iter().flat_map(|&a0| ends.map(|a1| [a0, a1])).collect();
        let mut other_bits = 0;
        // The first rows are of small depths alone, later ones mixed.
        for some in pairs.chunks(WEIGHED_AT_ONCE) {
            let (mut a0, mut a1) = ([0.0; WEIGHED_AT_ONCE], [0.0; WEIGHED_AT_ONCE]);
            for (l, pair) in some.iter().enumerate() {
                [a0[l], a1[l]] = *pair;
            }
            let of = |[near, far]: [[f32; WEIGHED_AT_ONCE]; 2], l: usize| PieceWeights { near: near[l], far: far[l] };
            let (weights, other) = (weigh(&a0, &a1), weigh(&a0.map(|a| a * 1.000_001), &a1));
            for (l, &[a0, a1]) in some.iter().enumerate() {
                assert_eq!(of(weights, l), piece_weights(a0, a1), "{a0} {a1}");
                other_bits += usize::from(of(other, l) != piece_weights(a0, a1));
            }
        }
        // And the comparison would see a relative difference of 1e-6.
        assert!(other_bits > 50, "{other_bits} pairs");
    }

    #[test]
    fn weights_of_constant_extinction_are_those_of_the_definition() {
        let mut worst: f64 = 0.0;
        for depth in [0.0, 1e-30, 1e-7, 1e-3, 0.1, 0.249, 0.251, 0.7, 3.0, 17.0, 30.0, 1e6, 1e30] {
            let w = homogeneous_weights(depth as f32);
            let (near, far) = oracle(f64::from(depth as f32), f64::from(depth as f32));
            worst = worst.max((f64::from(w.near) - near).abs()).max((f64::from(w.far) - far).abs());
        }
        // As for `piece_weights`; a depth that is off by a hundred thousandth would be seen.
        assert!(worst < 4e-7, "worst {worst:e}");
        let (near, _) = oracle(0.7 * 1.00001, 0.7 * 1.00001);
        assert!((f64::from(homogeneous_weights(0.7).near) - near).abs() > 1e-6);
    }

    #[test]
    fn small_depths_keep_relative_accuracy() {
        for a in [1e-38f32, 1e-20, 1e-7, 1e-3] {
            let w = piece_weights(a, a);
            // The next terms of the series, 1/3 and 2/3 of a; and roundings, of a denormal where a is the smallest (3e-7 of it).
            let bound = 0.667 * a + 1e-6;
            assert!((w.near / (a / 2.0) - 1.0).abs() < bound && (w.far / (a / 2.0) - 1.0).abs() < bound, "{a} {w:?}");
        }
        // The definition, evaluated naively, is 0 for a depth below the rounding of 1.
        let naive = |a: f32| 1.0 - (-a).exp();
        assert!((naive(1e-7) / 1e-7 - 1.0).abs() > 0.1 && naive(1e-8) == 0.0, "{:e}", naive(1e-7));
        // A ramp from nothing: Theta = b u^2, A = b / 3, B = 2 b / 3.
        let off = |w: PieceWeights| (w.near / w.far - 0.5).abs();
        // The next term is 0.15 b, and a few roundings (6e-8) come to that; a ramp that begins at a ten thousandth is noticed.
        assert!(off(piece_weights(0.0, 2e-6)) < 5e-7 && off(piece_weights(2e-10, 2e-6)) > 5e-5);
    }

    #[test]
    fn a_constant_opaque_piece_shows_its_near_colour() {
        let w = piece_weights(1e7, 1e7);
        // B = 1 / x, from two numbers near 1 that are rounded by 6e-8 each. A depth of 1e6 has more of it.
        assert!((w.near + w.far - 1.0).abs() <= f32::EPSILON && w.far < 3e-7, "{w:?}");
        assert!(piece_weights(1e6, 1e6).far > 5e-7);
    }
}

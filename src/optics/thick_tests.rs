//! Mean transmittances against their integrals in f64, and as weights of pieces against the definition of a segment.

use super::super::exact::ExactTable;
use super::super::quadrature::quadrature;
use super::super::weights::{WEIGHED_AT_ONCE, weigh};
use super::super::{Accumulator, Integrator, PieceWeights, piece_weights};
use super::*;
use crate::node_table::{Node, NodeTable};
use proptest::prelude::*;

/// Simpson's rule on 20,000 parts.
fn integral(to: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (parts, h) = (20_000, to / 20_000.0);
    let weight = |i: u32| if i == 0 || i == parts { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
    (0..=parts).map(|i| weight(i) * f(h * f64::from(i))).sum::<f64>() * h / 3.0
}

/// Relative error.
fn off(found: f32, expected: f64) -> f64 {
    (f64::from(found) / expected - 1.0).abs()
}

#[test]
fn the_exponential_is_within_its_bound() {
    let mut worst = 0.0f64;
    for i in -800_000..870_000 {
        let x = i as f32 * 1e-4;
        worst = worst.max(off(exp_neg(x), (-f64::from(x)).exp()));
    }
    println!("exp: {worst:.1e}");
    // The polynomial leaves out 6e-9, and rounding is the rest. An argument that is off by 1e-6 is noticed.
    assert!(worst < 2e-7, "{worst:e}");
    assert!(off(exp_neg(1.000_001), (-1.0f64).exp()) > 5e-7);
    assert!(exp_neg(0.0) == 1.0 && exp_neg(1e30) == exp_neg(87.0) && exp_neg(87.0) < 2e-38);
}

#[test]
fn the_functions_of_rise_and_fall_are_their_integrals() {
    let (mut rise, mut fall) = (0.0f64, 0.0f64);
    for i in 0..400 {
        let z = f64::from((0.03 * (f64::from(i) * 0.03).sinh()) as f32);
        let a = 2.0 * z as f32;
        // Beyond 7, and beyond 25 / z, the integrand is less than 1e-21.
        rise = rise
            .max(off(behind_rise(1.0, a), integral(7f64.min(25.0 / z.max(1e-3)), |t| (-t * t - 2.0 * z * t).exp())));
        // With z - t for t.
        let dawson = integral(z.min(50.0 / z.max(1e-3)), |t| (t * (t - 2.0 * z)).exp());
        if z > 0.0 {
            fall = fall.max(off(behind_fall(8.0, a), dawson));
        }
    }
    println!("rise: {rise:.1e}, fall: {fall:.1e}");
    // What the coefficients leave (4e-8 and 1.6e-7) and roundings of up to 6e-8, of which few add up. Measured: 2.7e-7 and 4.5e-7.
    assert!(rise < 3.5e-7, "{rise:e}");
    assert!(fall < 5e-7, "{fall:e}");
    // An argument that is off by two millionths is noticed.
    assert!(off(behind_rise(1.0, 2.000_004), integral(7.0, |t| (-t * t - 2.0 * t).exp())) > 3.5e-7);
    assert!(off(behind_fall(8.0, 0.500_001), integral(0.25, |t| (t * (t - 0.5)).exp())) > 5e-7);
}

/// Red and green are the weights of the near and the far end.
fn table(a0: f64, a1: f64) -> NodeTable {
    let node = |scalar: f64, rgb: [f64; 3], tau: f64| Node { scalar, rgb, tau };
    NodeTable::new(vec![node(0.0, [1.0, 0.0, 0.0], a0), node(1.0, [0.0, 1.0, 0.0], a1)]).unwrap()
}

/// The largest error of a weight, and of opacity, with ends as in f32.
fn weight_error(a0: f32, a1: f32, weights: PieceWeights) -> f64 {
    let [near, far, _, alpha] = quadrature(&table(f64::from(a0), f64::from(a1)), 0.0, 1.0, 1.0, 0.5);
    let (w_near, w_far) = (f64::from(weights.near), f64::from(weights.far));
    (w_near - near).abs().max((w_far - far).abs()).max((w_near + w_far - alpha).abs())
}

/// Ends of a piece of this mean depth whose extinction changes by `skew` (-1 to 1) of it from the middle to the ends.
fn ends(depth: f64, skew: f64) -> (f32, f32) {
    ((depth * (1.0 - skew)) as f32, (depth * (1.0 + skew)) as f32)
}

/// Depths and skews: equal ends, ends without extinction, hardly different ones, and any.
fn pieces() -> impl Strategy<Value = (f32, f32)> {
    let skew = prop_oneof![
        Just(0.0),
        Just(1.0),
        Just(-1.0),
        -1.0..1.0f64,
        (-9.0..0.0f64).prop_map(|e| 10f64.powf(e)),
        (-9.0..0.0f64).prop_map(|e| 10f64.powf(e) - 1.0),
        (-9.0..0.0f64).prop_map(|e| -(10f64.powf(e))),
        (-9.0..0.0f64).prop_map(|e| 1.0 - 10f64.powf(e)),
    ];
    let depth = prop_oneof![(-9.0..9.0f64).prop_map(|e| 10f64.powf(e)), 0.2..3.0f64, 2.4..20.0f64];
    (depth, skew).prop_map(|(depth, skew)| ends(depth, skew))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn weights_of_any_piece_are_those_of_the_definition((a0, a1) in pieces()) {
        let w = piece_weights(a0, a1);
        // M is off by 2.7e-7 at most, opacity by 2.2e-7 (where the depth is just beyond the series), and a weight by half of a bit of 1 more.
        let error = weight_error(a0, a1, w);
        prop_assert!(error < 4e-7, "{a0} {a1}: {error:e} {w:?}");
        prop_assert!(w.near >= 0.0 && w.far >= -1e-7 && w.near + w.far <= 1.0 + f32::EPSILON, "{a0} {a1} {w:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn weights_side_by_side_are_those_one_by_one_for_any_pieces(some in prop::collection::vec(pieces(), WEIGHED_AT_ONCE)) {
        let of = |end: fn(&(f32, f32)) -> f32| std::array::from_fn(|l| end(&some[l]));
        let [near, far] = weigh(&of(|p| p.0), &of(|p| p.1));
        for (l, &(a0, a1)) in some.iter().enumerate() {
            prop_assert_eq!(PieceWeights { near: near[l], far: far[l] }, piece_weights(a0, a1), "{} {}", a0, a1);
        }
    }
}

#[test]
fn an_error_of_a_millionth_in_a_weight_would_be_seen() {
    for (a0, a1) in [(1.0, 0.2), (0.3, 3.0), (6.0, 2.0), (0.0, 9.0), (9.0, 0.0), (30.0, 1e3)] {
        let w = piece_weights(a0, a1);
        let other = PieceWeights { near: w.near + 1e-6, far: w.far };
        assert!(weight_error(a0, a1, w) < 4e-7 && weight_error(a0, a1, other) > 4e-7, "{a0} {a1}");
        let error = weight_error(a0 * 1.000_01, a1, w);
        assert!(error > 4e-7 || a0 == 0.0 || a0 > 20.0, "a depth that is off by 1e-5: {a0} {a1} {error:e}");
    }
}

/// Nodes of random colours, some 1e-6 apart or at one place, plateaus that are opaque or transparent, and ramps.
fn hard_table() -> impl Strategy<Value = NodeTable> {
    let gap = prop_oneof![Just(0.0), Just(1e-6), 1e-3..0.3f64];
    let tau = prop_oneof![Just(0.0), Just(1e12), (-3.0..6.0f64).prop_map(|e| 10f64.powf(e))];
    let node = (gap, tau, any::<bool>(), [0.0..1.0f64, 0.0..1.0, 0.0..1.0]);
    prop::collection::vec(node, 2..12).prop_map(|of| {
        let (mut scalar, mut last, mut at_place) = (0.0, 0.0, 0);
        let mut nodes = Vec::new();
        for (gap, tau, is_plateau, rgb) in of {
            // Two nodes at one place are a step, more are not allowed.
            at_place = if gap == 0.0 { at_place + 1 } else { 0 };
            scalar += if at_place > 1 { 1e-6 } else { gap };
            at_place = if at_place > 1 { 0 } else { at_place };
            last = if is_plateau { last } else { tau };
            nodes.push(Node { scalar, rgb, tau: last });
        }
        NodeTable::new(nodes).unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn segments_through_hard_tables_are_those_of_the_definition(
        table in hard_table(),
        s0 in -0.1..2.0f64,
        rise in prop_oneof![Just(0.0), -2.0..2.0f64, -1e-5..1e-5f64],
        length in (-9.0..3.0f64).prop_map(|e| 10f64.powf(e)),
    ) {
        let exact = ExactTable::new(&table, 1.0);
        let s1 = s0 + rise;
        let truth = quadrature(&table, s0, s1, length, 0.5);
        let mut light = Accumulator::TRANSPARENT;
        let pieces = exact.segment(&mut exact.enter(s0), s0, s1, length, &mut light);
        // Each piece has weights that are off by 4e-7 of what shines through in front of it, and its ends' depths are rounded three times
        // (2e-7 of a depth x changes what shines through, x exp(-x) < 0.37 of it): 5e-7 a piece, and at most a dozen.
        let error = light.pixel().iter().zip(truth).map(|(f, t)| (f64::from(*f) - t).abs()).fold(0.0, f64::max);
        prop_assert!(error < 5e-7 * (pieces as f64 + 1.0), "{s0} {s1} {length}: {error:e} of {pieces} pieces");
    }
}

/// A ramp falls by tau 188 over its width, and the segment lies a thousandth of that in front of its end: interpolated from the upper end the
/// depth was off by 2^-24 of 188, the opacity by 6.6e-6 (falling) where what rises was exact.
#[test]
fn extinction_keeps_its_digits_down_a_steep_ramp_in_either_direction() {
    let width = 0.287_772_290_478_903_57;
    for (top, part) in [(188.105_567_225_906_1, 8.7e-4), (1e5, 1e-5), (1e9, 3e-10), (1e12, 1e-9)] {
        let s = width * (1.0 - part);
        let node = |scalar: f64, tau: f64| Node { scalar, rgb: [1.0, 0.5, 0.0], tau };
        let falls = NodeTable::new(vec![node(0.0, top), node(width, 0.0)]).unwrap();
        let rises = NodeTable::new(vec![node(-width, 0.0), node(0.0, top)]).unwrap();
        for (table, s) in [(falls, s), (rises, -s)] {
            let mut light = Accumulator::TRANSPARENT;
            let exact = ExactTable::new(&table, 1.0);
            exact.segment(&mut exact.enter(s), s, s, 1.0, &mut light);
            let expected = 1.0 - (-top * (width - s.abs()) / width).exp();
            // Weights are off by 4e-7, and an end's depth by three roundings of itself, which move its opacity by a third of them.
            assert!(
                (f64::from(light.pixel()[3]) - expected).abs() < 5e-7,
                "{top} {s}: {} {expected}",
                light.pixel()[3]
            );
        }
    }
}

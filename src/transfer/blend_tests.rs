use super::*;
use crate::transfer::Lengths;
use crate::transfer::curve::Curve;
use crate::transfer::profile::ProfilePoint;
use proptest::prelude::*;

const RULES: [Blend; 4] = [Blend::Add, Blend::And, Blend::Xor, Blend::Xor8];
const WEIGHTINGS: [ColorWeighting; 2] = [ColorWeighting::Plain, ColorWeighting::Opacity];

/// Bound of rounding between a curve and its formula: points are at least 2^-10 apart and scalars below 2, so that a cut, rounded to 2^-53
/// of its scalar, moves a value by 2^-43 at most; a crossing lies between two such slopes.
const ROUNDING: f64 = 1.0 / (1_u64 << 42) as f64;

fn side() -> impl Strategy<Value = Side> {
    let number = || prop_oneof![0.0..=1.0_f64, Just(0.0), Just(1.0), Just(0.5)];
    ([number(), number(), number()], number()).prop_map(|(rgb, value)| Side { rgb, value })
}

/// Curves with steps and plateaus, between -1 and 2.
fn curve() -> impl Strategy<Value = Curve> {
    let point = (0_u16..=3072, side(), prop::option::of(side()));
    prop::collection::btree_map(0_u16..=3072, point, 2..8).prop_map(|points| {
        let point = |(at, (_, left, right)): (u16, (u16, Side, Option<Side>))| ProfilePoint {
            scalar: f64::from(at) / 1024.0 - 1.0,
            left,
            right: right.unwrap_or(left),
        };
        Curve::new(points.into_iter().map(point).collect(), OpacityKind::Alpha)
    })
}

fn blended(rule: Blend, a: &Curve, b: &Curve, weighting: ColorWeighting) -> Curve {
    let pieces = rule.pieces(
        &Pieces::of(a.points(), weighting),
        &Pieces::of(b.points(), weighting),
        weighting,
        OpacityKind::Alpha,
    );
    Curve::new(pieces.to_curve(weighting).unwrap(), OpacityKind::Alpha)
}

fn formula(rule: Blend, a: &Curve, b: &Curve, weighting: ColorWeighting, scalar: f64) -> Side {
    let [a, b] = [a, b].map(|c| c.sides(scalar)[1]);
    rule.sides(&a, &b, weighting, OpacityKind::Alpha)
}

/// Largest difference of a channel; with weighting, of colours times opacity.
fn distance(a: &Side, b: &Side, weighting: ColorWeighting) -> f64 {
    let factor = |s: &Side| if weighting == ColorWeighting::Plain { 1.0 } else { s.value };
    let colour = (0..3).map(|c| (a.rgb[c] * factor(a) - b.rgb[c] * factor(b)).abs()).fold(0.0, f64::max);
    colour.max((a.value - b.value).abs())
}

/// Whether a level of either curve changes so near to the scalar that rounding decides the level.
fn is_between_levels(a: &Curve, b: &Curve, weighting: ColorWeighting, scalar: f64) -> bool {
    let near = |x: f64| ((255.0 * x).fract() - 0.5).abs() < 1e-6;
    [a, b].iter().any(|c| {
        let side = c.sides(scalar)[1];
        let factor = if weighting == ColorWeighting::Plain { 1.0 } else { side.value };
        near(side.value) || side.rgb.iter().any(|x| near(x * factor))
    })
}

#[test]
fn rules_give_what_is_printed() {
    let (a, b) = (Side { rgb: [0.2, 0.9, 0.5], value: 0.75 }, Side { rgb: [0.5, 0.4, 0.5], value: 0.5 });
    let plain = |rule: Blend| {
        let side = rule.sides(&a, &b, ColorWeighting::Plain, OpacityKind::Alpha);
        [side.rgb[0], side.rgb[1], side.rgb[2], side.value]
    };
    assert_eq!(plain(Blend::Add), [0.7, 1.0, 1.0, 1.0]);
    assert_eq!(plain(Blend::And), [0.5, 0.9, 0.5, 0.5]);
    assert_eq!(plain(Blend::Xor), [0.3, 0.5, 0.0, 0.25]);
    // 51 ^ 128 = 179, 230 ^ 102 = 128, 191 ^ 128 = 63.
    assert_eq!(plain(Blend::Xor8), [179.0 / 255.0, 128.0 / 255.0, 0.0, 63.0 / 255.0]);
    let weighted = Blend::Add.sides(&a, &b, ColorWeighting::Opacity, OpacityKind::Extinction);
    assert_eq!(weighted.value, 1.25);
    // 0.32, but for some roundings of 2^-54; the plain sum is 0.7.
    assert!((weighted.rgb[0] - (0.2 * 0.75 + 0.5 * 0.5) / 1.25).abs() < 1e-15);
    let bounded = Blend::And.sides(&a, &b, ColorWeighting::Opacity, OpacityKind::Alpha);
    assert_eq!((bounded.rgb[1], bounded.value), (1.0, 0.5), "0.675 / 0.5 is no colour");
}

#[test]
fn exclusive_or_on_levels_is_that_of_integers() {
    for (x, y) in (0..=255_u8).flat_map(|x| (0..=255_u8).map(move |y| (x, y))) {
        assert_eq!(xor8(f64::from(x) / 255.0, f64::from(y) / 255.0), f64::from(x ^ y) / 255.0);
    }
}

#[test]
fn a_lost_crossing_is_noticed() {
    /// The minimum without its cuts.
    struct Uncut;
    impl Rule for Uncut {
        const CONTINUOUS: [bool; 4] = [true; 4];
        fn cuts(&self, _: &Piece, _: &Piece, _: &mut Vec<f64>) {}
        fn put_together(&self, a: &Piece, b: &Piece) -> Piece {
            And.put_together(a, b)
        }
    }
    let ramp = |from: f64, to: f64| {
        let point = |scalar: f64, value: f64| {
            let side = Side { rgb: [value; 3], value };
            ProfilePoint { scalar, left: side, right: side }
        };
        Curve::new(vec![point(0.0, from), point(1.0, to)], OpacityKind::Alpha)
    };
    let (a, b) = (ramp(0.0, 1.0), ramp(0.625, 0.375));
    let [pa, pb] = [&a, &b].map(|c| Pieces::of(c.points(), ColorWeighting::Plain));
    let off = |curve: &Curve| {
        let places = (0..=64).map(|i| f64::from(i) / 64.0);
        let error = |s: f64| {
            distance(&curve.sides(s)[1], &formula(Blend::And, &a, &b, ColorWeighting::Plain, s), ColorWeighting::Plain)
        };
        places.map(error).fold(0.0, f64::max)
    };
    let uncut = Curve::new(pa.combine(&pb, &Uncut).plain_points(), OpacityKind::Alpha);
    assert!(off(&blended(Blend::And, &a, &b, ColorWeighting::Plain)) <= ROUNDING);
    assert!(off(&uncut) > 0.3, "{}", off(&uncut));
}

/// Two points from 0 to 1, or one value throughout: a multiple of a hundredth or of an eighth, so that curves touch.
fn coarse_curve() -> impl Strategy<Value = Curve> {
    let number =
        || prop_oneof![(0..=8_u8).prop_map(|i| f64::from(i) / 8.0), (0..=100_u8).prop_map(|i| f64::from(i) / 100.0)];
    let side = move || (number(), number()).prop_map(|(c, value)| Side { rgb: [c, 0.5, 1.0 - c], value });
    (side(), side(), any::<bool>()).prop_map(|(a, b, is_constant)| line_from(&a, if is_constant { &a } else { &b }))
}

fn line_from(a: &Side, b: &Side) -> Curve {
    let point = |scalar: f64, side: &Side| ProfilePoint { scalar, left: *side, right: *side };
    Curve::new(vec![point(0.0, a), point(1.0, b)], OpacityKind::Alpha)
}

/// Checks the weighted blend of two curves against its formula along 0..1.
fn check_weighted(rule: Blend, a: &Curve, b: &Curve) {
    let curve = blended(rule, a, b, ColorWeighting::Opacity);
    for scalar in (0..=100).map(|i| f64::from(i) / 100.0) {
        let (got, expected) = (curve.sides(scalar)[1], formula(rule, a, b, ColorWeighting::Opacity, scalar));
        // As in `curves_are_blended_as_their_values_are`.
        let bound = ROUNDING + expected.value / 262_144.0;
        let off = distance(&got, &expected, ColorWeighting::Opacity);
        assert!(off <= bound, "{rule:?} {scalar}: {got:?} {expected:?}");
    }
}

#[test]
fn weighted_curves_that_touch_in_the_middle_are_blended_as_their_values_are() {
    let gray = |c: f64, value: f64| Side { rgb: [c; 3], value };
    // s (1 - s), which is 1/4 in the middle.
    let (parabola, flat) = (line_from(&gray(0.0, 1.0), &gray(1.0, 0.0)), line_from(&gray(0.25, 1.0), &gray(0.25, 1.0)));
    check_weighted(Blend::Xor, &parabola, &flat);
    let got = blended(Blend::Xor, &parabola, &flat, ColorWeighting::Opacity);
    // The formula as numbers: (1/4 - s (1 - s)) / s. The quotient has 2^-18.
    for (s, c) in [(0.5, 0.0), (0.75, 0.0625 / 0.75), (0.99, 0.2401 / 0.99)] {
        assert!((got.eval(s).0[0] - c).abs() < 1.0 / 262_144.0 + 1e-12, "{s}: {:?}", got.eval(s));
    }
    let ramp = line_from(&gray(0.4, 1.0), &gray(0.8, 0.5));
    check_weighted(Blend::And, &ramp, &line_from(&gray(0.0, 0.45), &gray(0.0, 0.45)));
}

#[test]
fn weighted_curves_of_which_nothing_is_left_are_clear_at_once() {
    let line = |a: (f64, f64), b: (f64, f64)| {
        let [a, b] = [a, b].map(|(c, value)| Side { rgb: [c; 3], value });
        line_from(&a, &b)
    };
    let (a, b) = (line((0.83, 0.21), (0.62, 0.0)), line((0.40, 0.0), (0.67, 0.21)));
    let sum = blended(Blend::Add, &a, &b, ColorWeighting::Opacity);
    let none = blended(Blend::Xor, &sum, &line((0.71, 0.21), (0.55, 0.21)), ColorWeighting::Opacity);
    assert!(none.knots().count() < 8000, "{}", none.knots().count());
    // Sums of opacities near 0.21 are off by a rounding at most.
    assert!(none.points().iter().all(|p| p.left.value <= 1e-16 && p.right.value <= 1e-16));
}

// `a_lost_crossing_is_noticed` shows that `distance` exceeds these bounds where a rule is violated.
proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn curves_are_blended_as_their_values_are(
        a in curve(), b in curve(), rule in prop::sample::select(RULES.to_vec()),
        weighting in prop::sample::select(WEIGHTINGS.to_vec()), at in prop::collection::vec(-1.5..2.5_f64, 40),
    ) {
        let curve = blended(rule, &a, &b, weighting);
        let knots: Vec<f64> = a.knots().chain(b.knots()).collect();
        prop_assert!(curve.knots().is_sorted_by(|x, y| x < y));
        for scalar in at.into_iter().chain(knots).filter(|&s| rule != Blend::Xor8 || !is_between_levels(&a, &b, weighting, s)) {
            let (got, expected) = (curve.sides(scalar)[1], formula(rule, &a, &b, weighting, scalar));
            // The division of weighted colours has a quarter of 2^-16.
            let bound = ROUNDING + if weighting == ColorWeighting::Plain { 0.0 } else { expected.value / 262_144.0 };
            prop_assert!(distance(&got, &expected, weighting) <= bound, "{rule:?} {scalar}: {got:?} {expected:?}");
        }
    }

    #[test]
    fn coarse_curves_that_touch_are_blended_as_their_values_are(
        a in coarse_curve(), b in coarse_curve(), rule in prop::sample::select(vec![Blend::Add, Blend::And, Blend::Xor]),
    ) {
        check_weighted(rule, &a, &b);
    }

    #[test]
    fn sums_do_not_depend_on_the_order(a in curve(), b in curve(), c in curve(), at in prop::collection::vec(-1.5..2.5_f64, 20)) {
        let add = |x: &Curve, y: &Curve| blended(Blend::Add, x, y, ColorWeighting::Plain);
        let (ab, ba) = (add(&a, &b), add(&b, &a));
        let (left, right) = (add(&ab, &c), add(&a, &add(&b, &c)));
        for s in at {
            prop_assert!(distance(&ab.sides(s)[1], &ba.sides(s)[1], ColorWeighting::Plain) <= ROUNDING);
            // min(1, min(1, a + b) + c) = min(1, a + b + c), since nothing is negative.
            prop_assert!(distance(&left.sides(s)[1], &right.sides(s)[1], ColorWeighting::Plain) <= 2.0 * ROUNDING);
        }
    }

    #[test]
    fn and_never_raises_opacity_and_is_idempotent(a in curve(), b in curve(), weighting in prop::sample::select(WEIGHTINGS.to_vec()), s in -1.5..2.5_f64) {
        let both = blended(Blend::And, &a, &b, weighting).eval(s).1;
        prop_assert!(both <= a.eval(s).1 + ROUNDING && both <= b.eval(s).1 + ROUNDING);
        let same = blended(Blend::And, &a, &a, ColorWeighting::Plain).sides(s)[1];
        prop_assert!(distance(&same, &a.sides(s)[1], ColorWeighting::Plain) <= ROUNDING);
    }

    #[test]
    fn exclusive_or_of_equals_is_empty(a in curve(), weighting in prop::sample::select(WEIGHTINGS.to_vec())) {
        for rule in [Blend::Xor, Blend::Xor8] {
            let none = blended(rule, &a, &a, weighting);
            prop_assert!(none.points().iter().all(|p| p.left.value == 0.0 && p.right.value == 0.0), "{rule:?}");
            prop_assert!(none.node_table(&Lengths::of_unit_distance(1.0)).unwrap().nodes().iter().all(|n| n.tau == 0.0));
        }
    }

    #[test]
    fn levels_cut_curves_a_bounded_number_of_times(a in curve(), b in curve()) {
        let knots = |c: &Curve| c.knots().count();
        // Between two knots each of four channels passes at most 255 levels.
        let most = knots(&a) + knots(&b) + 4 * 255 * (knots(&a) + knots(&b) - 2);
        prop_assert!(knots(&blended(Blend::Xor8, &a, &b, ColorWeighting::Plain)) <= most);
    }
}

use super::*;
use crate::transfer::Curve;
use proptest::prelude::*;

fn quadratic() -> impl Strategy<Value = Quadratic> {
    [-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64]
}

fn found(a: &Quadratic, b: &Quadratic) -> Vec<f64> {
    let mut cuts = Vec::new();
    crossings(a, b, &mut cuts);
    cuts
}

#[test]
fn crossings_have_their_closed_form() {
    assert_eq!(found(&[0.0, 0.5, 1.0], &[0.25; 3]), [0.25]);
    assert_eq!(found(&[1.0, 0.5, 0.0], &[0.25; 3]), [0.75]);
    // 4 f (1 - f) = 3/4 at 1/4 and 3/4.
    assert_eq!(found(&[0.0, 2.0, 0.0], &[0.75; 3]), [0.25, 0.75]);
    assert!(found(&[0.0, 2.0, 0.0], &[1.0; 3]).is_empty(), "they touch");
    assert!(found(&[0.3; 3], &[0.3; 3]).is_empty(), "they are equal");
    assert!(found(&[0.0, 0.5, 1.0], &[0.0, 0.25, 0.5]).is_empty(), "they meet at an end");
    // Equal but for rounding, however often they cross.
    assert!(found(&[0.1 + 0.2, 0.5, 0.3], &[0.3, 0.5, 0.1 + 0.2]).is_empty());
}

proptest! {
    #[test]
    fn between_crossings_nothing_changes_places(a in quadratic(), b in quadratic(), at in prop::collection::vec(0.0..1.0_f64, 30)) {
        let mut ends = vec![0.0];
        ends.extend(found(&a, &b));
        ends.push(1.0);
        prop_assert!(ends.is_sorted() && ends.len() <= 4);
        let d = |f: f64| eval(&a, f) - eval(&b, f);
        for pair in ends.windows(2) {
            let sign = d(0.5 * (pair[0] + pair[1])).signum();
            for f in at.iter().map(|f| lerp(pair[0], pair[1], *f)) {
                // The slope of a difference is at most 8, and a root of it, near which it is flat, off by the square root
                // of a rounding of its coefficients at most, over which a quadratic falls by as many roundings.
                prop_assert!(sign * d(f) >= -64.0 * f64::EPSILON, "{} {:?}", f, ends);
            }
        }
        // A missed crossing is noticed: the signs of both sides differ by more than that.
        if let [_, root, _] = ends[..] && (0.1..0.9).contains(&root) && d(0.0).abs() > 0.1 && d(1.0).abs() > 0.1 {
            prop_assert!(d(0.0) * d(1.0) < -1e-3);
        }
    }

    #[test]
    fn a_part_of_a_piece_has_its_values(q in quadratic(), a in 0.0..0.5_f64, b in 0.5..1.0_f64, f in 0.0..=1.0_f64) {
        let whole = Piece { from: 0.0, to: 1.0, channels: [q; 4] };
        // Six nested interpolations of numbers below 1.
        prop_assert!((whole.part(a, b).at(0, f) - whole.at(0, lerp(a, b, f))).abs() <= 16.0 * f64::EPSILON);
        let ramp = Piece { channels: [[0.0, 0.5, 1.0]; 4], ..whole };
        prop_assert!((ramp.part(a, b).at(0, f) - ramp.at(0, lerp(a, b, f) + 1e-9)).abs() > 16.0 * f64::EPSILON);
        prop_assert_eq!(whole.part(0.0, b).channels[0][2], whole.part(b, 1.0).channels[0][0]);
    }

    #[test]
    fn colours_divided_by_opacity_are_within_tolerance(
        rgb in [[0.0..=1.0_f64, 0.0..=1.0, 0.0..=1.0], [0.0..=1.0_f64, 0.0..=1.0, 0.0..=1.0]],
        value in (prop_oneof![Just(0.0), 1e-9..1.0_f64], 1e-9..1.0_f64), others in [0.0..=1.0_f64, 0.0..=1.0],
        at in prop::collection::vec(0.0..=1.0_f64, 20),
    ) {
        // Two layers of colour and opacity, added: the colour is a quotient of a quadratic and a linear function.
        let value = [value.0, value.1];
        let side = |i: usize| Side { rgb: rgb[i], value: value[i] };
        let second = |i: usize| Side { rgb: [0.5, 1.0, 0.0], value: others[i] };
        let pieces = |a: Side, b: Side| Pieces(vec![
            piece(f64::NEG_INFINITY, 0.0, &a, &a, ColorWeighting::Opacity),
            piece(0.0, 1.0, &a, &b, ColorWeighting::Opacity),
            piece(1.0, f64::INFINITY, &b, &b, ColorWeighting::Opacity),
        ]);
        let sum = |a: &Pieces, b: &Pieces| Pieces(a.0.iter().zip(&b.0).map(|(p, q)|
            p.with(|c| std::array::from_fn(|i| p.channels[c][i] + q.channels[c][i]))).collect());
        let curve = Curve::new(
            sum(&pieces(side(0), side(1)), &pieces(second(0), second(1))).to_curve(ColorWeighting::Opacity).unwrap(),
            crate::transfer::OpacityKind::Extinction,
        );
        for &f in &at {
            let (a, b) = (Side::mix(&side(0), &side(1), f), Side::mix(&second(0), &second(1), f));
            let total = a.value + b.value;
            let (rgb, got) = curve.eval(f);
            prop_assert!((got - total).abs() <= 8.0 * f64::EPSILON);
            prop_assume!(total > 0.0);
            for (c, got) in rgb.iter().enumerate() {
                let expected = (a.rgb[c] * a.value + b.rgb[c] * b.value) / total;
                // Rounding of sums below 2, before they are divided.
                // That a quotient can be farther off: `a_quotient_without_refinement_is_farther_off`.
                prop_assert!((got - expected).abs() <= DIVISION_TOLERANCE + 16.0 * f64::EPSILON / total, "{f} {c}");
            }
        }
    }
}

/// Rules for curves that touch in the middle of a piece, where neither lies below the other.
#[test]
fn curves_that_touch_in_the_middle_are_told_apart() {
    // (1 - 2 f)^2 and its mirror image.
    let (above, below, zero) = ([1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [0.0; 3]);
    assert!(found(&above, &zero).is_empty() && eval(&above, 0.5) == 0.0);
    assert!(is_below(&zero, &above) && !is_below(&above, &zero));
    assert!(is_below(&below, &zero) && !is_below(&zero, &below));
    assert_eq!([absolute_difference(&above, &zero), absolute_difference(&zero, &above)], [above; 2]);
}

#[test]
fn what_is_clear_is_black_and_has_no_more_points_whatever_its_colours() {
    let transparent =
        Piece { from: 0.0, to: 1.0, channels: [[1e-17, 0.0, 3e-17], [0.0, 0.1, 0.0], [0.0; 3], [0.0; 3]] };
    let mut sides = Vec::new();
    divide(&transparent, &mut sides).unwrap();
    assert_eq!(sides, [(0.0, [Side { rgb: [0.0; 3], value: 0.0 }; 2])]);
}

#[test]
fn one_piece_that_needs_too_many_points_is_an_error() {
    // A colour that is not linear where opacity is nearly 0, which no rule gives: halved down to neighbouring doubles.
    let noise = Piece { from: 0.0, to: 1.0, channels: [[0.0, 0.1, 0.0], [0.0; 3], [0.0; 3], [1e-300; 3]] };
    let mut sides = Vec::new();
    assert!(matches!(divide(&noise, &mut sides), Err(TransferError::TooManyPoints { .. })));
    assert!(sides.len() <= MOST_POINTS + 1);
}

#[test]
fn a_quotient_without_refinement_is_farther_off() {
    // Red at opacity 1 is interpolated to blue at opacity 0.01: the closed form of the chord's error is the measured one.
    let (a, b) = (Side { rgb: [1.0, 0.0, 0.0], value: 1.0 }, Side { rgb: [0.0, 0.0, 1.0], value: 0.01 });
    let weighted = piece(0.0, 1.0, &a, &b, ColorWeighting::Opacity);
    // Red and blue of constant colour with linear weights a and b: the sum of two transparent ramps.
    let red = weighted.with(|c| match c {
        0 => [1.0, 0.5, 0.0],
        2 => [0.0, 0.005, 0.01],
        VALUE => [1.0, 0.505, 0.01],
        _ => [0.0; 3],
    });
    let closed = (1.0 * 0.01 - 2.0 * 0.5 + 0.0 * 1.0_f64).abs() / (1.0 + 0.1_f64).powi(2);
    let farthest =
        (0..=10_000).map(|i| f64::from(i) / 10_000.0).map(|f| ((1.0 - f) - red.at(0, f) / red.at(VALUE, f)).abs());
    let farthest = farthest.fold(0.0, f64::max);
    // Ten thousand places miss the farthest one by at most half a distance, 5e-5, where the error is flat and bends by 20.
    assert!((farthest - closed).abs() < 3e-8 && farthest > 0.5, "{farthest} {closed}");
    let mut sides = Vec::new();
    divide(&red, &mut sides).unwrap();
    assert!(sides.len() > 100 && sides.len() < 16_000, "{}", sides.len());
}

use super::*;
use crate::transfer::{Context, Ensemble, Function, Member};
use crate::transfer::{MappedRange, RangePolicy, TransferFunction};

fn curve(text: &str) -> Curve {
    let tf = TransferFunction::parse(text).unwrap();
    let mut member = Member::new("only", Function::TransferFunction(tf));
    member.range = RangePolicy::Manual(0.0, 1.0);
    let ensemble = Ensemble { members: vec![member], ..Ensemble::default() };
    ensemble.curve(&Context::new((0.0, 1.0), (0.0, 1.0), OpacityKind::Alpha, Lengths::of_unit_distance(1.0))).unwrap()
}

#[test]
fn a_step_has_both_sides() {
    let curve = curve("gray@0:0.1,0.5:0.1,0.5:0.7,1:0.7");
    assert_eq!(curve.sides(0.5).map(|s| s.value), [0.1, 0.7]);
    assert_eq!((curve.eval(0.5).1, curve.eval(-9.0).1, curve.eval(9.0).1), (0.7, 0.1, 0.7));
    assert_eq!(curve.eval(f64::NEG_INFINITY).1, 0.1);
    assert_eq!(curve.eval(f64::INFINITY).1, 0.7);
}

#[test]
fn a_curve_has_the_table_of_its_transfer_function() {
    for text in ["viridis", "turbo@0:0,0.3:0.5,0.3:0,0.7:1,1:0.2", "gray@0.5:1"] {
        let range = MappedRange::new(0.0, 1.0, false).unwrap();
        let tf = TransferFunction::parse(text).unwrap();
        let direct =
            crate::transfer::build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_unit_distance(0.3))
                .unwrap();
        assert_eq!(curve(text).node_table(&Lengths::of_unit_distance(0.3)).unwrap(), direct, "{text}");
    }
    assert!(matches!(
        curve("gray").node_table(&Lengths::of_unit_distance(f64::NAN)),
        Err(TransferError::BadUnitDistance(_))
    ));
}

#[test]
fn a_mix_begins_and_ends_with_its_curves_and_is_linear_between() {
    let (a, b) = (curve("viridis@0:0,0.4:1,1:0"), curve("vik@0:0.5,0.6:0,0.6:1,1:1"));
    for weighting in [ColorWeighting::Plain, ColorWeighting::Opacity] {
        assert_eq!(Curve::mix(&a, &b, 0.0, weighting).unwrap(), a);
        assert_eq!(Curve::mix(&a, &b, 1.0, weighting).unwrap(), b);
        assert_eq!(Curve::mix(&a, &a, 0.3, weighting).unwrap(), a);
        let mixed = Curve::mix(&a, &b, 0.25, weighting).unwrap();
        for s in (-10..=1010).map(|i| f64::from(i) / 1000.0) {
            let [x, y] = [&a, &b].map(|c| c.eval(s));
            let (rgb, value) = mixed.eval(s);
            // A step is at 0.6 as a double, which 600 / 1000 is, too. Values are below 1 and rise at most by 2.5 times the scalar,
            // colours by 10 times: some roundings of 2^-53 (measured: two). A quotient has a quarter of 2^-16.
            assert!((value - (0.75 * x.1 + 0.25 * y.1)).abs() < 2e-15, "{s}");
            for (c, got) in rgb.iter().enumerate() {
                let [p, q] = if weighting == ColorWeighting::Plain { [1.0; 2] } else { [x.1, y.1] };
                let expected = 0.75 * x.0[c] * p + 0.25 * y.0[c] * q;
                let got = got * if weighting == ColorWeighting::Plain { 1.0 } else { value };
                let quotient = if weighting == ColorWeighting::Plain { 0.0 } else { value / 262_144.0 };
                assert!((got - expected).abs() <= 2e-15 + quotient, "{s} {got} {expected}");
            }
        }
        // A weight that is off by a hundredth is noticed.
        let [(other_rgb, other), (rgb, value)] =
            [Curve::mix(&a, &b, 0.26, weighting).unwrap().eval(0.4), mixed.eval(0.4)];
        assert!((other - value).abs() > 1e-3 && (other_rgb[0] * other - rgb[0] * value).abs() > 1e-5);
    }
}

#[test]
fn opacities_and_depths_are_not_mixed_unless_one_of_them_shows_nothing() {
    let side = |value: f64| Side { rgb: [0.5; 3], value };
    let point = |scalar: f64, value: f64| ProfilePoint { scalar, left: side(value), right: side(value) };
    let depths = Curve::new(vec![point(0.0, 40.0), point(1.0, 0.0)], OpacityKind::Extinction);
    for weighting in [ColorWeighting::Plain, ColorWeighting::Opacity] {
        let mix = |a: &Curve, b: &Curve| Curve::mix(a, b, 0.25, weighting);
        for pair in [[&curve("gray"), &depths], [&depths, &curve("gray")]] {
            assert!(matches!(mix(pair[0], pair[1]), Err(TransferError::MixedKinds)));
        }
        for transparent in [Curve::new(Vec::new(), OpacityKind::Alpha), curve("gray@0:0")] {
            let (going, coming) = (mix(&depths, &transparent).unwrap(), mix(&transparent, &depths).unwrap());
            assert_eq!([going.kind(), coming.kind()], [OpacityKind::Extinction; 2]);
            assert_eq!((going.eval(0.0).1, coming.eval(0.0).1), (30.0, 10.0));
        }
    }
    let none = Curve::new(Vec::new(), OpacityKind::Extinction);
    assert_eq!(none.node_table(&Lengths::of_unit_distance(1.0)).unwrap().nodes().len(), 1);
    assert_eq!(none.eval(3.0), ([0.0; 3], 0.0));
}

use super::*;
use crate::timeline::{Key, Transition};
use crate::transfer::{Function, Member, OpacityKind, Rectangle, Space, TransferFunction, Widget};

fn context() -> Context<'static> {
    Context::new((0.0, 1.0), (0.0, 1.0), OpacityKind::Alpha, 1.0)
}

fn ensemble(text: &str) -> Ensemble {
    let function = Function::TransferFunction(TransferFunction::parse(text).unwrap());
    Ensemble { members: vec![Member::new(text, function)], ..Ensemble::default() }
}

fn two() -> Keyframed<Ensemble> {
    let key = |time, text| Key { time, transition: Transition::Smooth, value: ensemble(text) };
    vec![key(1.0, "gray@0:0.25,1:0.75"), key(3.0, "viridis@0:1,0.5:0,1:0.5")].try_into().unwrap()
}

#[test]
fn at_a_key_and_beyond_the_curve_is_that_of_its_ensemble() {
    let keys = two();
    for colors in [ColorWeighting::Plain, ColorWeighting::Opacity] {
        for (time, index) in [(-5.0, 0), (1.0, 0), (3.0, 1), (99.0, 1)] {
            let own = keys.keys()[index].value.curve(&context()).unwrap();
            assert_eq!(keys.curve(time, &context(), colors).unwrap(), own);
        }
        let none = Keyframed::<Ensemble>::default();
        assert_eq!(none.curve(0.0, &context(), colors).unwrap().eval(0.5), ([0.0; 3], 0.0));
    }
}

#[test]
fn between_keys_the_curve_is_the_printed_sum_of_true_values() {
    let keys = two();
    let weight = Transition::Smooth.weight(0.25);
    for colors in [ColorWeighting::Plain, ColorWeighting::Opacity] {
        let curve = keys.curve(1.5, &context(), colors).unwrap();
        for scalar in (0..=1000).map(|i| f64::from(i) / 1000.0) {
            let sample = Sample { scalar, gradient: 0.0, cov: 0.0 };
            let (rgb, value) = keys.eval(1.5, &context(), colors, &sample).unwrap();
            let ends = [0, 1].map(|i| keys.keys()[i].value.evaluator(&context()).unwrap().eval(&sample));
            let mix = |a: f64, b: f64| a * (1.0 - weight) + b * weight;
            // Sums of two products of numbers up to 1, and slopes up to 2: a few roundings of 2^-53. Measured: two.
            assert!((value - mix(ends[0].1, ends[1].1)).abs() < 1e-15);
            let got = curve.eval(scalar);
            assert!((got.1 - value).abs() < 2e-15, "{scalar}");
            for (c, true_rgb) in rgb.iter().enumerate() {
                let expected = match colors {
                    ColorWeighting::Plain => mix(ends[0].0[c], ends[1].0[c]),
                    ColorWeighting::Opacity => mix(ends[0].0[c] * ends[0].1, ends[1].0[c] * ends[1].1) / value,
                };
                // The quotient has a quarter of 2^-16.
                let quotient = if colors == ColorWeighting::Plain { 0.0 } else { 1.0 / 262_144.0 };
                assert!((true_rgb - expected).abs() < 2e-15, "{scalar}");
                assert!((got.0[c] - expected).abs() < 2e-15 + quotient, "{scalar}");
            }
            // Another time shows.
            let later = keys.eval(1.6, &context(), colors, &sample).unwrap();
            assert!((later.1 - value).abs() > 1e-3 || (ends[0].1 - ends[1].1).abs() < 0.1);
            let both_have_color =
                ends.iter().all(|(_, value)| *value > 0.1) && (ends[0].0[0] - ends[1].0[0]).abs() > 0.1;
            assert!((later.0[0] - rgb[0]).abs() > 1e-5 || !both_have_color);
        }
    }
}

#[test]
fn ensembles_on_different_spaces_are_blended_over_both() {
    let on_cov = Rectangle { x: [0.5, 1.0], y: [0.0, 1.0], rgb: [1.0; 3], opacity: [0.5; 2] };
    let mut member = Member::new("changing", Function::Widgets(vec![Widget::Rectangle(on_cov)]));
    member.space = Space::Cov;
    let key = |time, value| Key { time, transition: Transition::Linear, value };
    let changing = Ensemble { members: vec![member], ..Ensemble::default() };
    let keys: Keyframed<Ensemble> = vec![key(0.0, ensemble("gray@0:1")), key(1.0, changing)].try_into().unwrap();
    let eval =
        |cov| keys.eval(0.5, &context(), ColorWeighting::Plain, &Sample { scalar: 0.5, gradient: 0.0, cov }).unwrap();
    assert_eq!((eval(0.75), eval(0.25)), (([0.75; 3], 0.75), ([0.25; 3], 0.5)));
}

#[test]
fn range_maps_go_over_into_each_other() {
    let map = |y: f64| RangeMap::new(&[[0.5, y]]).unwrap();
    let key = |time, y| Key { time, transition: Transition::Linear, value: map(y) };
    let keys: Keyframed<RangeMap> = vec![key(0.0, 0.25), key(2.0, 0.75)].try_into().unwrap();
    assert_eq!([-1.0, 0.0, 0.5, 1.0, 2.0, 7.0].map(|t| keys.map(t)), [0.25, 0.25, 0.375, 0.5, 0.75, 0.75].map(map));
    assert_eq!(Keyframed::<RangeMap>::default().map(3.0), RangeMap::default());
}

#[test]
fn keyframes_of_ensembles_are_the_same_after_a_round_trip() {
    let text = serde_json::to_string(&two()).unwrap();
    assert_eq!(serde_json::from_str::<Keyframed<Ensemble>>(&text).unwrap(), two());
}

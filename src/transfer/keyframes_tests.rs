use super::*;
use crate::timeline::{Key, Transition};
use crate::transfer::{
    ColorWeighting, Context, Curve, Ensemble, Function, Lengths, Member, OpacityKind, Sample, TransferFunction,
};

fn context() -> Context<'static> {
    Context::new((0.0, 1.0), (0.0, 1.0), OpacityKind::Alpha, Lengths::of_unit_distance(1.0))
}

fn ensemble(text: &str, colors: ColorWeighting) -> Ensemble {
    let function = Function::TransferFunction(TransferFunction::parse(text).unwrap());
    Ensemble { members: vec![Member::new(text, function)], colors, ..Ensemble::default() }
}

/// A key of the timeline for each of two ensembles.
fn two(colors: ColorWeighting) -> Keyframed<Ensemble> {
    let key = |time, text| Key { time, transition: Transition::Smooth, value: ensemble(text, colors) };
    vec![key(1.0, "gray@0:0.25,1:0.75"), key(3.0, "viridis@0:1,0.4:0,0.6:0,1:0.5")].try_into().unwrap()
}

#[test]
fn between_keys_the_curve_is_the_printed_sum_of_true_values() {
    for colors in [ColorWeighting::Plain, ColorWeighting::Opacity] {
        let keys = two(colors);
        let curve = |time: f64| match keys.at(time).unwrap() {
            At::One(ensemble) => ensemble.curve(&context()).unwrap(),
            At::Between { a, b, weight } => {
                let [a, b] = [a, b].map(|ensemble| ensemble.curve(&context()).unwrap());
                Curve::mix(&a, &b, weight, colors).unwrap()
            }
        };
        let (at, later) = (curve(1.5), curve(1.6));
        let weight = Transition::Smooth.weight(0.25);
        let judges = [0, 1].map(|i| keys.keys()[i].value.evaluator(&context()).unwrap());
        for scalar in (0..=1000).map(|i| f64::from(i) / 1000.0) {
            let ends = judges.each_ref().map(|judge| judge.eval(&Sample { scalar, gradient: 0.0, cov: 0.0 }));
            let mix = |a: f64, b: f64| a * (1.0 - weight) + b * weight;
            let value = mix(ends[0].1, ends[1].1);
            // Sums of two products of numbers up to 1, and slopes up to 2.5: a few roundings of 2^-53. Measured: three.
            let got = at.eval(scalar);
            assert!((got.1 - value).abs() < 2e-15, "{scalar}");
            for (c, rgb) in got.0.iter().enumerate() {
                let (expected, quotient) = match colors {
                    ColorWeighting::Plain => (mix(ends[0].0[c], ends[1].0[c]), 0.0),
                    // The quotient has a quarter of 2^-16.
                    ColorWeighting::Opacity => {
                        (mix(ends[0].0[c] * ends[0].1, ends[1].0[c] * ends[1].1) / value, 1.0 / 262_144.0)
                    }
                };
                assert!((rgb - expected).abs() < 2e-15 + quotient, "{scalar}: {rgb} is not {expected}");
            }
            // Another time shows.
            let other = later.eval(scalar);
            assert!((other.1 - value).abs() > 1e-3 || (ends[0].1 - ends[1].1).abs() < 0.1);
            let both_have_color =
                ends.iter().all(|(_, value)| *value > 0.1) && (ends[0].0[0] - ends[1].0[0]).abs() > 0.1;
            assert!((other.0[0] - got.0[0]).abs() > 1e-5 || !both_have_color);
        }
    }
}

#[test]
fn range_maps_go_over_into_each_other() {
    let map = |y: f64| RangeMap::new(&[[0.5, y]]).unwrap();
    let key = |time, y| Key { time, transition: Transition::Linear, value: map(y) };
    let keys: Keyframed<RangeMap> = vec![key(0.0, 0.25), key(2.0, 0.75)].try_into().unwrap();
    let expected = [0.25, 0.25, 0.375, 0.5, 0.75, 0.75].map(|y| Some(map(y)));
    assert_eq!([-1.0, 0.0, 0.5, 1.0, 2.0, 7.0].map(|t| keys.map(t)), expected);
    assert_eq!(Keyframed::<RangeMap>::default().map(3.0), None);
}

#[test]
fn keyframes_of_ensembles_are_the_same_after_a_round_trip() {
    let keys = two(ColorWeighting::Opacity);
    let text = serde_json::to_string(&keys).unwrap();
    assert_eq!(serde_json::from_str::<Keyframed<Ensemble>>(&text).unwrap(), keys);
}

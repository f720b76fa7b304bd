//! [`Transition`]: the weight of the next key between two keys.

use super::TimelineError;
use serde::{Deserialize, Serialize};

/// Interpolation to the next key: its weight f(t) at the share t of the time in between. f(0) = 0 and f(1) = 1 exactly, and f stays within
/// 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Transition {
    /// f(t) = t.
    #[default]
    Linear,
    /// f(t) = 3 t^2 - 2 t^3: begins and ends at rest.
    Smooth,
    /// 0 before t = `at`, 1 from there on.
    Step {
        /// Share of the time between two keys, 0..=1.
        at: f64,
    },
    /// A cubic Bezier curve from (0, 0) to (1, 1) over t, like cubic-bezier of CSS.
    Cubic {
        /// The two handles [t, f], each 0..=1: t then never decreases along the curve, and f stays within 0..=1.
        handles: [[f64; 2]; 2],
    },
}

impl Transition {
    /// The transition, if its numbers are within 0..=1.
    ///
    /// # Errors
    /// If a number is outside 0..=1.
    pub fn checked(self) -> Result<Self, TimelineError> {
        let numbers: &[f64] = match &self {
            Self::Linear | Self::Smooth => &[],
            Self::Step { at } => std::slice::from_ref(at),
            Self::Cubic { handles } => handles.as_flattened(),
        };
        let is_valid = numbers.iter().all(|x| (0.0..=1.0).contains(x));
        if is_valid { Ok(self) } else { Err(TimelineError::BadTransition) }
    }

    /// The weight of the next key at the share `t` of the time between both.
    pub fn weight(&self, t: f64) -> f64 {
        if t <= 0.0 {
            return 0.0;
        }
        if t >= 1.0 {
            return 1.0;
        }
        match *self {
            Self::Linear => t,
            Self::Smooth => t * t * (3.0 - 2.0 * t),
            Self::Step { at } => f64::from(u8::from(t >= at)),
            Self::Cubic { handles: [a, b] } => {
                let s = parameter(a[0], b[0], t);
                bezier(a[1], b[1], s).clamp(0.0, 1.0)
            }
        }
    }
}

/// A coordinate of a cubic Bezier curve from 0 by `a` and `b` to 1.
fn bezier(a: f64, b: f64, s: f64) -> f64 {
    let r = 1.0 - s;
    3.0 * r * r * s * a + 3.0 * r * s * s * b + s * s * s
}

/// The parameter at which a coordinate with handles in 0..=1 is `x`. The coordinate never falls, so that bisection always finds it, also
/// where its slope is zero. The bits of the parameter are bisected, which have the order of the numbers: so it takes at most one step per
/// bit, however small the parameter is.
fn parameter(a: f64, b: f64, x: f64) -> f64 {
    let (mut low, mut high) = (0.0_f64.to_bits(), 1.0_f64.to_bits());
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if bezier(a, b, f64::from_bits(middle)) < x { low = middle } else { high = middle }
    }
    f64::from_bits(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn transition() -> impl Strategy<Value = Transition> {
        prop_oneof![
            Just(Transition::Linear),
            Just(Transition::Smooth),
            (0.0..=1.0).prop_map(|at| Transition::Step { at }),
            [[0.0..=1.0, 0.0..=1.0], [0.0..=1.0, 0.0..=1.0]].prop_map(|handles| Transition::Cubic { handles }),
        ]
    }

    fn cubic(handles: [[f64; 2]; 2]) -> Transition {
        Transition::Cubic { handles }.checked().unwrap()
    }

    #[test]
    fn each_curve_has_its_formula() {
        assert_eq!(Transition::Linear.weight(0.3), 0.3);
        assert_eq!(Transition::Smooth.weight(0.25), 0.15625);
        assert_eq!([0.39, 0.4, 0.41].map(|t| Transition::Step { at: 0.4 }.weight(t)), [0.0, 1.0, 1.0]);
        // Handles at thirds make a straight line; the middle of CSS's "ease" was found by halving exact fractions.
        let third = cubic([[1.0 / 3.0; 2], [2.0 / 3.0; 2]]);
        let ease = cubic([[0.25, 0.1], [0.25, 1.0]]);
        for t in [1e-300, 1e-9, 0.1, 0.5, 0.9, 1.0 - 1e-12] {
            // Four products and two sums, each rounded once.
            assert!((third.weight(t) - t).abs() <= 8.0 * f64::EPSILON, "{t}: {}", third.weight(t));
        }
        // Half a unit of the last digit, and as many roundings.
        let is_ease = |curve: Transition| (curve.weight(0.5) - 0.802_403_387_584_857).abs() <= 3e-15;
        assert!(is_ease(ease) && !is_ease(cubic([[0.25, 0.1], [0.25, 1.0 - 1e-12]])), "{}", ease.weight(0.5));
        assert!((third.weight(0.5 + 1e-14) - 0.5).abs() > 8.0 * f64::EPSILON);
    }

    #[test]
    fn a_curve_that_stands_still_or_jumps_is_solved() {
        // t has zero slope in the middle: dt/ds = 0 at s = 1/2, where a rounding of t is the cube root of one in s (5e-6). Measured:
        // 3.1e-6.
        let upright = cubic([[1.0, 0.0], [0.0, 1.0]]);
        assert!((upright.weight(0.5) - 0.5).abs() < 1e-5 && upright.weight(0.4) < 0.2 && upright.weight(0.6) > 0.8);
        let late = cubic([[1.0, 0.0], [1.0, 0.0]]);
        assert!(late.weight(0.5) < 0.01 && late.weight(1.0) == 1.0);
    }

    #[test]
    fn numbers_outside_of_the_unit_square_are_errors() {
        for bad in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
            assert_eq!(Transition::Step { at: bad }.checked(), Err(TimelineError::BadTransition));
            let handles = [[0.1, 0.2], [0.3, bad]];
            assert_eq!(Transition::Cubic { handles }.checked(), Err(TimelineError::BadTransition));
        }
    }

    proptest! {
        #[test]
        fn ends_are_exact_and_weights_stay_within_the_ends(transition in transition(), t in -1.0..2.0_f64) {
            prop_assert_eq!((transition.weight(0.0), transition.weight(1.0)), (0.0, 1.0));
            prop_assert!((0.0..=1.0).contains(&transition.weight(t)));
        }

        #[test]
        fn a_cubic_goes_through_its_points(handles in [[0.0..=1.0, 0.0..=1.0_f64], [0.0..=1.0, 0.0..=1.0_f64]], s in 0.0..=1.0_f64) {
            let [a, b] = handles;
            let (t, weight) = (bezier(a[0], b[0], s), bezier(a[1], b[1], s));
            // Where t has zero slope, a rounding of it is the cube root of one in s; 8 such roundings, times the largest slope of the other
            // coordinate, 3.
            let bound = 3.0 * (8.0 * f64::EPSILON).cbrt();
            let got = cubic(handles).weight(t);
            prop_assert!((got - weight).abs() <= bound, "{} {}", got, weight);
            prop_assert!((cubic([a, [b[0], (b[1] + 0.5) % 1.0]]).weight(0.5) - cubic(handles).weight(0.5)).abs() > bound);
        }

        #[test]
        fn a_transition_is_the_same_after_a_round_trip(transition in transition()) {
            let text = serde_json::to_string(&transition).unwrap();
            prop_assert_eq!(serde_json::from_str::<Transition>(&text).unwrap(), transition);
        }
    }
}

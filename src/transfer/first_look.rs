//! [`FirstLook`]: default colours, opacities and range for a series.

use super::range::RangePolicy;
use super::{MappedRange, TransferFunction};
use crate::moments::Distribution;

/// The colour maps of values of one sign, and of both signs.
const MAPS: (&str, &str) = ("viridis", "cool-to-warm");

/// Values have both signs if their extents on the two sides of 0 have at least this ratio: more than overshoots do.
const SIGNED: f64 = 0.15;

/// A series is peaked if its percentiles span less than this share of its range.
const PEAKED: f64 = 0.5;

/// Values in the narrowest range with this share of the volume are transparent,
const BACKGROUND: f64 = 0.5;

/// if that range is no wider than this share of the axis: otherwise no values are distinctly frequent.
const BACKGROUND_WIDTH: f64 = 0.35;

/// A remainder of the axis below this share, beside the transparent part, is transparent too.
const MARGIN: f64 = 0.1;

/// Optical depth along the mean chord.
const DEPTH: f64 = 0.6;

/// Number of opacity levels that are distinguished.
const LEVELS: usize = 1024;

/// Least and greatest opacity per unit distance.
const OPACITY: (f64, f64) = (0.001, 0.95);

/// The default look of a series: its most frequent values are transparent, and the others as opaque as lets one look through.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstLook {
    /// Colours and opacities,
    pub tf: TransferFunction,
    /// and their text, in the grammar of `--tf`.
    pub text: String,
    /// The scalars that they cover.
    pub range: RangePolicy,
}

impl FirstLook {
    /// The look of a series with values from `lo` to `hi` and the volume distribution `values`, in a mesh whose mean chord is `chord` unit
    /// distances long. Values of both signs get a diverging map over a symmetric range; where few values lie far from the others, the range
    /// is that of the 1st to the 99th percentile.
    ///
    /// Opacities are a ramp from the most frequent values, the narrowest range of half the volume, to the ends of the range. Their height is
    /// such that the optical depth along the mean chord is 0.6, or as close to that as opacities of 0.1 to 95 % a unit distance come.
    ///
    /// A `given` range is kept.
    pub fn new((lo, hi): (f64, f64), values: &Distribution, chord: f64, given: Option<RangePolicy>) -> Self {
        let (from, to) = RangePolicy::PERCENTILES;
        let percentile = |percent: f64| values.value_at(percent / 100.0).map_or(f64::NAN, f64::from);
        let inner = [from, to].map(percentile);
        let is_peaked = inner[0] < inner[1] && inner[1] - inner[0] < PEAKED * (hi - lo);
        let [below, above] = if is_peaked { [-inner[0], inner[1]] } else { [-lo, hi] };
        let is_signed = below.min(above) > SIGNED * below.max(above);
        let range = given.unwrap_or(match (is_signed, is_peaked) {
            (true, true) => RangePolicy::SymmetricPercentile(from, to),
            (true, false) => RangePolicy::Symmetric,
            (false, true) => RangePolicy::Percentile(from, to),
            (false, false) => RangePolicy::Series,
        });
        let mapped = range.settled(values).resolve((lo, hi), (lo, hi)).ok();
        let diverges = is_signed && mapped.is_some_and(|mapped| mapped.lo() == -mapped.hi());
        let map = if diverges { MAPS.1 } else { MAPS.0 };
        let text = match mapped {
            Some(mapped) => Curve::new(values, &mapped, diverges).text(map, values, &mapped, chord),
            None => map.to_owned(),
        };
        let tf = TransferFunction::parse(&text);
        let tf = tf.unwrap_or_else(|e| unreachable!("'{text}' has a built-in map and sorted points: {e}"));
        Self { tf, text, range }
    }
}

/// Opacity over positions 0..=1 as a share of the largest one.
struct Curve(Vec<[f64; 2]>);

impl Curve {
    fn new(values: &Distribution, range: &MappedRange, diverges: bool) -> Self {
        if values.narrowest(1.0).is_some_and(|[lo, hi]| lo == hi) {
            // All values are the same.
            return Self(vec![[0.0, 1.0]]);
        }
        let position = |value: f32| range.position_of(f64::from(value)).clamp(0.0, 1.0);
        let [from, to] = values.narrowest(BACKGROUND).map_or([0.0, 1.0], |ends| ends.map(position));
        let rounded = |position: f64| (position * 1e3).round() / 1e3;
        let points = if to - from > BACKGROUND_WIDTH {
            if diverges { vec![[0.0, 1.0], [0.5, 0.0], [1.0, 1.0]] } else { vec![[0.0, 0.0], [1.0, 1.0]] }
        } else {
            let end = |room: f64| if room > MARGIN { 1.0 } else { 0.0 };
            let points = [[0.0, end(from)], [rounded(from), 0.0], [rounded(to), 0.0], [1.0, end(1.0 - to)]];
            let mut points = points.to_vec();
            points.dedup();
            points
        };
        Self(points)
    }

    /// The share of the largest opacity at a position.
    fn at(&self, position: f64) -> f64 {
        let last = self.0.len() - 1;
        match self.0.iter().position(|point| point[0] > position) {
            None => self.0[last][1],
            Some(0) => self.0[0][1],
            Some(i) => {
                let ([a, low], [b, high]) = (self.0[i - 1], self.0[i]);
                low + (position - a) / (b - a) * (high - low)
            }
        }
    }

    /// The `--tf` text, with the opacity (two digits) that gives the mean chord the optical depth [`DEPTH`].
    fn text(&self, map: &str, values: &Distribution, range: &MappedRange, chord: f64) -> String {
        // Shares of the volume by opacity level.
        let mut volume = [0.0; LEVELS + 1];
        for (value, part) in values.parts() {
            let position = range.position_of(f64::from(value)).clamp(0.0, 1.0);
            volume[(self.at(position) * LEVELS as f64).round() as usize] += part;
        }
        let share = |level: usize| level as f64 / LEVELS as f64;
        let depth = |largest: f64| {
            let depths = volume.iter().enumerate().map(|(level, part)| part * -(-largest * share(level)).ln_1p());
            chord * depths.sum::<f64>()
        };
        let (mut low, mut high) = OPACITY;
        for _ in 0..40 {
            let middle = (low * high).sqrt();
            if depth(middle) < DEPTH { low = middle } else { high = middle }
        }
        let scale = 10.0_f64.powf(1.0 - low.log10().floor());
        let largest = ((low * scale).round() / scale).min(OPACITY.1);
        let points = self.0.iter().map(|[position, share]| format!("{position}:{}", share * largest));
        format!("{map}@{}", points.collect::<Vec<_>>().join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn look(values: impl Iterator<Item = f64>) -> FirstLook {
        let values: Vec<f32> = values.map(|v| v as f32).collect();
        let ends = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &v| (lo.min(f64::from(v)), hi.max(f64::from(v))));
        FirstLook::new(ends, &Distribution::new(values.into_iter().map(|v| (v, 1.0))), 40.0, None)
    }

    fn evenly(from: f64, to: f64) -> impl Iterator<Item = f64> {
        (0..10_000).map(move |i| from + (to - from) * f64::from(i) / 9_999.0)
    }

    /// Opacity over the range of a look.
    fn opacity(look: &FirstLook, position: f64) -> f64 {
        let points = look.tf.points().to_vec();
        Curve(points.iter().map(|p| [p.position, p.value]).collect()).at(position)
    }

    proptest! {
        #[test]
        fn any_values_have_a_look(values in prop::collection::vec((prop::num::f32::ANY, 0.0..1.0_f64), 0..20), chord in prop::num::f64::ANY) {
            let finite = || values.iter().map(|v| f64::from(v.0)).filter(|v| v.is_finite());
            let ends = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
            for given in [None, Some(RangePolicy::Log), Some(RangePolicy::Percentile(1.0, 99.0))] {
                let look = FirstLook::new(ends, &Distribution::new(values.iter().copied()), chord, given);
                prop_assert_eq!(TransferFunction::parse(&look.text).unwrap(), look.tf);
            }
        }
    }

    #[test]
    fn values_of_both_signs_diverge_about_zero_and_others_do_not() {
        for (from, to) in [(-1.0, 1.0), (-0.3, 1.0), (-1e9, 2e8), (-1e-30, 1e-30)] {
            let look = look(evenly(from, to));
            assert!(look.text.starts_with("cool-to-warm@"), "{look:?}");
            assert_eq!(look.range, RangePolicy::Symmetric);
        }
        for (from, to) in [(0.0, 1.0), (-0.05, 1.0), (-5.0, -1.0), (280.0, 300.0), (-1.0, 0.05)] {
            let look = look(evenly(from, to));
            assert!(look.text.starts_with("viridis@"), "{look:?}");
            assert_eq!(look.range, RangePolicy::Series);
        }
    }

    #[test]
    fn a_peak_is_shown_over_its_percentiles_and_its_most_frequent_values_are_clear() {
        // A dipole: nearly all values near 0, few of them far out on both sides.
        let dipole = look(evenly(-1.0, 1.0).map(|x| 0.004 * x / (1.0 - x.abs() + 0.001)));
        assert_eq!(dipole.range, RangePolicy::SymmetricPercentile(1.0, 99.0));
        assert_eq!(opacity(&dipole, 0.5), 0.0);
        assert!(opacity(&dipole, 0.02) > 0.01 && opacity(&dipole, 0.98) > 0.01, "{dipole:?}");
        // A background of one value, with a plume in it.
        let plume = look(evenly(0.0, 1.0).map(|x| if x < 0.8 { 3.0 } else { 3.0 + 10.0 * (x - 0.8) }));
        assert_eq!(plume.range, RangePolicy::Series);
        assert_eq!(opacity(&plume, 0.0), 0.0);
        assert!(opacity(&plume, 1.0) > 0.05);
        // The opposite: low values are rare.
        let hole = look(evenly(0.0, 1.0).map(|x| if x < 0.8 { 3.0 } else { 3.0 - 10.0 * (x - 0.8) }));
        assert!(opacity(&hole, 0.0) > 0.05 && opacity(&hole, 1.0) == 0.0, "{hole:?}");
    }

    #[test]
    fn a_range_that_is_given_is_kept_and_diverges_only_about_zero() {
        let values = Distribution::new(evenly(-1.0, 1.0).map(|v| (v as f32, 1.0)));
        for (range, map) in
            [("0,0.5", "viridis@"), ("-0.5,0.5", "cool-to-warm@"), ("log", "viridis@"), ("step", "cool-to-warm@")]
        {
            let range = range.parse().unwrap();
            let look = FirstLook::new((-1.0, 1.0), &values, 40.0, Some(range));
            assert!(look.range == range && look.text.starts_with(map), "{look:?}");
        }
    }

    #[test]
    fn the_mean_path_has_the_depth_that_one_can_look_through() {
        for look in [look(evenly(0.0, 1.0)), look(evenly(-1.0, 1.0))] {
            let depth = evenly(0.0, 1.0).map(|x| -(-opacity(&look, x)).ln_1p()).sum::<f64>() / 10_000.0 * 40.0;
            // Opacities have two digits.
            assert!((depth / DEPTH - 1.0).abs() < 0.06, "{depth} {look:?}");
        }
    }

    #[test]
    fn what_has_no_range_or_one_value_has_a_look_that_can_be_read() {
        let none = FirstLook::new((f64::NAN, f64::NAN), &Distribution::default(), f64::NAN, None);
        let constant = look(std::iter::repeat_n(5.0, 10));
        assert!(opacity(&constant, 0.5) > 0.0, "{constant:?}");
        for look in [none, constant, look(evenly(-3e38, 3e38)), look(evenly(1e-45, 1e-40))] {
            assert!(look.tf.points().iter().all(|point| point.value <= OPACITY.1), "{look:?}");
        }
    }
}

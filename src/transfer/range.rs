//! The scalars that the axis 0..1 of a transfer function covers.

use super::TransferError;
use crate::moments::Distribution;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Source of the mapped range.
///
/// As text (`--range`): `series`, `step`, `LO,HI`, `symmetric`, `percentile`, `percentile:P,Q`, `symmetric:P,Q`, `log` or `log:LO,HI`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RangePolicy {
    /// From the smallest to the largest scalar of all steps: colours mean the same at every step.
    #[default]
    Series,
    /// From the smallest to the largest scalar of the step shown.
    Step,
    /// These two scalars.
    Manual(f64, f64),
    /// The series' range made symmetric about 0.
    Symmetric,
    /// From one percentile (0..=100) of the series' volume to another; values beyond have the colours of the ends.
    Percentile(f64, f64),
    /// Symmetric about 0, out to the larger magnitude of two percentiles.
    #[serde(rename = "symmetric-percentile")]
    SymmetricPercentile(f64, f64),
    /// The positive part of the series' range, log-spaced.
    Log,
    /// These two scalars, log-spaced.
    LogManual(f64, f64),
}

/// Lower end of a logarithmic axis, as a share of the upper end (six decades), if the series reaches down to zero or below.
const LOG_FLOOR: f64 = 1e-6;

/// The scalars that the axis 0..=1 of a transfer function covers: linear or log-spaced from `lo` to `hi`, `lo` < `hi`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RangeText")]
pub struct MappedRange {
    lo: f64,
    hi: f64,
    log: bool,
}

/// The serialized form of a range.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RangeText {
    lo: f64,
    hi: f64,
    log: bool,
}

impl TryFrom<RangeText> for MappedRange {
    type Error = TransferError;

    fn try_from(RangeText { lo, hi, log }: RangeText) -> Result<Self, TransferError> {
        Self::new(lo, hi, log)
    }
}

impl MappedRange {
    /// A linear range, or a log-spaced one.
    ///
    /// # Errors
    /// If an end or the width is not finite, `lo` is not below `hi`, or a log-spaced range is not positive.
    pub fn new(lo: f64, hi: f64, log: bool) -> Result<Self, TransferError> {
        let bad = |problem| Err(TransferError::BadRange { lo, hi, problem });
        if !(lo.is_finite() && hi.is_finite()) {
            return bad("both ends must be finite");
        }
        if lo >= hi {
            return bad("the lower end must lie below the upper one");
        }
        if !(hi - lo).is_finite() {
            return bad("is too wide for a double");
        }
        if log && lo <= 0.0 {
            return bad("a logarithmic range must be positive");
        }
        if log && !(hi / lo).is_finite() {
            return bad("spans more decades than a double");
        }
        Ok(Self { lo, hi, log })
    }

    /// The lower end.
    pub fn lo(&self) -> f64 {
        self.lo
    }

    /// The upper end.
    pub fn hi(&self) -> f64 {
        self.hi
    }

    /// Whether positions are log-spaced.
    pub fn is_log(&self) -> bool {
        self.log
    }

    /// The scalar at a position 0..=1 of the axis; exactly `lo` at 0 and `hi` at 1, and never falling in between.
    pub fn scalar_at(&self, position: f64) -> f64 {
        let (lo, hi) = (self.lo, self.hi);
        if position >= 1.0 {
            return hi;
        }
        let scalar = if self.log { lo * (position * (hi / lo).ln()).exp() } else { lo + position * (hi - lo) };
        scalar.clamp(lo, hi)
    }

    /// The position of a scalar on the axis, also outside of 0..=1; minus infinity on a log-spaced range if the scalar is not positive.
    pub fn position_of(&self, scalar: f64) -> f64 {
        if !self.log {
            return (scalar - self.lo) / (self.hi - self.lo);
        }
        if scalar <= 0.0 { f64::NEG_INFINITY } else { (scalar / self.lo).ln() / (self.hi / self.lo).ln() }
    }
}

impl RangePolicy {
    /// The mapped range, given the smallest and largest scalar of the whole `series` and of the `step` shown.
    ///
    /// A constant field (both equal to v) is shown with the colour and opacity of the middle of the axis: its range is
    /// v/2..3v/2 (v/2..2v if log-spaced), or -1/2..1/2 for v = 0.
    ///
    /// # Errors
    /// If the range is not finite (for one, because no scalar is), has no positive part where one is needed, or a manual range is empty.
    pub fn resolve(&self, series: (f64, f64), step: (f64, f64)) -> Result<MappedRange, TransferError> {
        match *self {
            Self::Series => linear(series),
            Self::Step => linear(step),
            Self::Manual(lo, hi) => MappedRange::new(lo, hi, false),
            Self::Symmetric => {
                let (lo, hi) = measured(series)?;
                let reach = lo.abs().max(hi.abs());
                linear((-reach, reach))
            }
            Self::Percentile(..) | Self::SymmetricPercentile(..) => {
                let problem = "percentiles need the values of the series; give the range as LO,HI";
                Err(TransferError::BadRange { lo: series.0, hi: series.1, problem })
            }
            Self::Log => log_spaced(series),
            Self::LogManual(lo, hi) => MappedRange::new(lo, hi, true),
        }
    }

    /// The 1st and the 99th percentile.
    pub const PERCENTILES: (f64, f64) = (1.0, 99.0);

    /// Whether [`Self::settled`] is needed before [`Self::resolve`].
    pub fn has_percentiles(&self) -> bool {
        matches!(self, Self::Percentile(..) | Self::SymmetricPercentile(..))
    }

    /// The policy with percentiles replaced by scalars. Where both percentiles are the same scalar, or there is none, the range of the
    /// series is used.
    #[must_use]
    pub fn settled(&self, values: &Distribution) -> Self {
        let (Self::Percentile(from, to) | Self::SymmetricPercentile(from, to)) = *self else { return *self };
        let is_symmetric = matches!(self, Self::SymmetricPercentile(..));
        let ends = [from, to].map(|percent| values.value_at(percent / 100.0).map(f64::from));
        match ends {
            [Some(lo), Some(hi)] if is_symmetric && (lo, hi) != (0.0, 0.0) => {
                let reach = lo.abs().max(hi.abs());
                Self::Manual(-reach, reach)
            }
            [Some(lo), Some(hi)] if !is_symmetric && lo < hi => Self::Manual(lo, hi),
            _ if is_symmetric => Self::Symmetric,
            _ => Self::Series,
        }
    }
}

/// A range measured on data; fails if it is not finite or empty.
fn measured((lo, hi): (f64, f64)) -> Result<(f64, f64), TransferError> {
    let bad = |problem| Err(TransferError::BadRange { lo, hi, problem });
    if !(lo.is_finite() && hi.is_finite()) {
        return bad("the field has no finite range; are all its values missing?");
    }
    if lo > hi { bad("the field has no range; are all its values missing?") } else { Ok((lo, hi)) }
}

fn linear(range: (f64, f64)) -> Result<MappedRange, TransferError> {
    let (lo, hi) = measured(range)?;
    if lo < hi {
        return MappedRange::new(lo, hi, false);
    }
    let half = if lo == 0.0 { 0.5 } else { 0.5 * lo.abs() };
    MappedRange::new(lo - half, hi + half, false)
}

fn log_spaced(range: (f64, f64)) -> Result<MappedRange, TransferError> {
    let (lo, hi) = measured(range)?;
    if hi <= 0.0 {
        let problem = "a logarithmic range needs positive values; give one as log:LO,HI";
        return Err(TransferError::BadRange { lo, hi, problem });
    }
    if lo == hi {
        return MappedRange::new(0.5 * lo, 2.0 * hi, true);
    }
    MappedRange::new(if lo > 0.0 { lo } else { hi * LOG_FLOOR }, hi, true)
}

impl FromStr for RangePolicy {
    type Err = TransferError;

    fn from_str(text: &str) -> Result<Self, TransferError> {
        let bad = |problem: &str| TransferError::BadText { part: text.to_owned(), problem: problem.to_owned() };
        let two = |pair: &str| -> Result<(f64, f64), TransferError> {
            let known = "is no range; known are series, step, LO,HI, symmetric, percentile, percentile:P,Q, symmetric:P,Q, log and log:LO,HI";
            let (lo, hi) = pair.split_once(',').ok_or_else(|| bad(known))?;
            let number = |part: &str| {
                let problem = format!("is no number in the range '{text}'");
                let error = TransferError::BadText { part: part.to_owned(), problem };
                part.trim().parse::<f64>().map_err(|_| error)
            };
            Ok((number(lo)?, number(hi)?))
        };
        let percentiles = |pair: &str| {
            let (from, to) = two(pair)?;
            let is_usable = 0.0 <= from && from < to && to <= 100.0;
            if is_usable {
                Ok((from, to))
            } else {
                Err(bad("percentiles are two numbers from 0 to 100, the lower one first"))
            }
        };
        let policy = match (text, text.split_once(':')) {
            ("series", _) => Self::Series,
            ("step", _) => Self::Step,
            ("symmetric", _) => Self::Symmetric,
            ("percentile", _) => Self::Percentile(Self::PERCENTILES.0, Self::PERCENTILES.1),
            ("log", _) => Self::Log,
            (_, Some(("log", pair))) => two(pair).map(|(lo, hi)| Self::LogManual(lo, hi))?,
            (_, Some(("percentile", pair))) => percentiles(pair).map(|(from, to)| Self::Percentile(from, to))?,
            (_, Some(("symmetric", pair))) => {
                percentiles(pair).map(|(from, to)| Self::SymmetricPercentile(from, to))?
            }
            _ => two(text).map(|(lo, hi)| Self::Manual(lo, hi))?,
        };
        if let Self::Manual(lo, hi) | Self::LogManual(lo, hi) = policy {
            MappedRange::new(lo, hi, matches!(policy, Self::LogManual(..)))?;
        }
        Ok(policy)
    }
}

impl fmt::Display for RangePolicy {
    /// The text that reads back as the same policy.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Series => f.write_str("series"),
            Self::Step => f.write_str("step"),
            Self::Manual(lo, hi) => write!(f, "{lo:?},{hi:?}"),
            Self::Symmetric => f.write_str("symmetric"),
            Self::Percentile(from, to) if (*from, *to) == Self::PERCENTILES => f.write_str("percentile"),
            Self::Percentile(from, to) => write!(f, "percentile:{from:?},{to:?}"),
            Self::SymmetricPercentile(from, to) => write!(f, "symmetric:{from:?},{to:?}"),
            Self::Log => f.write_str("log"),
            Self::LogManual(lo, hi) => write!(f, "log:{lo:?},{hi:?}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SERIES: (f64, f64) = (-2.0, 6.0);
    const STEP: (f64, f64) = (1.0, 3.0);

    fn ends(policy: &str) -> (f64, f64, bool) {
        let range = policy.parse::<RangePolicy>().unwrap().resolve(SERIES, STEP).unwrap();
        (range.lo(), range.hi(), range.is_log())
    }

    #[test]
    fn each_policy_takes_its_range() {
        assert_eq!(ends("series"), (-2.0, 6.0, false));
        assert_eq!(ends("step"), (1.0, 3.0, false));
        assert_eq!(ends("-1e3, 2.5"), (-1000.0, 2.5, false));
        assert_eq!(ends("symmetric"), (-6.0, 6.0, false));
        assert_eq!(ends("log"), (6e-6, 6.0, true));
        assert_eq!(ends("log:1e-3,10"), (1e-3, 10.0, true));
        let positive = RangePolicy::Log.resolve((0.5, 8.0), STEP).unwrap();
        assert_eq!((positive.lo(), positive.hi()), (0.5, 8.0));
    }

    #[test]
    fn text_round_trips() {
        for policy in [
            RangePolicy::Series,
            RangePolicy::Step,
            RangePolicy::Manual(-3e38, 1e-45),
            RangePolicy::Symmetric,
            RangePolicy::Percentile(1.0, 99.0),
            RangePolicy::Percentile(0.0, 99.5),
            RangePolicy::SymmetricPercentile(1.0, 99.0),
            RangePolicy::Log,
            RangePolicy::LogManual(1e-40, 1e-39),
        ] {
            assert_eq!(policy.to_string().parse::<RangePolicy>().unwrap(), policy);
        }
    }

    #[test]
    fn bad_text_is_named() {
        for (text, named) in [
            ("auto", "'auto'"),
            ("1,x", "'x'"),
            ("log:a,2", "'a'"),
            ("", "''"),
            ("log:5", "'log:5'"),
            ("percentile:5,1", "'percentile:5,1'"),
            ("percentile:-1,5", "lower one first"),
            ("symmetric:1,101", "0 to 100"),
            ("percentile:a,2", "'a'"),
            ("decade:1,2", "'decade:1'"),
        ] {
            let error = text.parse::<RangePolicy>().unwrap_err().to_string();
            assert!(error.contains(named), "{text}: {error}");
        }
        for text in ["2,1", "1,1", "nan,1", "0,inf", "log:0,1", "log:-1,1", "-1.7e308,1.7e308"] {
            assert!(matches!(text.parse::<RangePolicy>(), Err(TransferError::BadRange { .. })), "{text}");
        }
    }

    #[test]
    fn percentiles_become_scalars_and_all_of_the_series_where_they_are_one() {
        let even = Distribution::new((0..=1000).map(|i| (i as f32 - 300.0, 1.0)));
        let settled = |policy: &str, values: &Distribution| policy.parse::<RangePolicy>().unwrap().settled(values);
        assert_eq!(settled("percentile", &even), RangePolicy::Manual(-290.0, 690.0));
        assert_eq!(settled("percentile:10,50", &even), RangePolicy::Manual(-200.0, 200.0));
        assert_eq!(settled("symmetric:1,99", &even), RangePolicy::Manual(-690.0, 690.0));
        assert_eq!(settled("step", &even), RangePolicy::Step);
        // All but a thousandth of the volume has one value; or there is no value.
        let same = Distribution::new([(0.0, 999.0), (5.0, 1.0)]);
        for values in [same, Distribution::default()] {
            assert_eq!(settled("percentile", &values), RangePolicy::Series);
            assert_eq!(settled("symmetric:1,99", &values), RangePolicy::Symmetric);
        }
        let unsettled = RangePolicy::Percentile(1.0, 99.0);
        assert!(unsettled.has_percentiles() && !RangePolicy::Series.has_percentiles());
        assert!(unsettled.resolve(SERIES, STEP).unwrap_err().to_string().contains("LO,HI"));
    }

    #[test]
    fn a_constant_field_lies_in_the_middle_of_its_range() {
        for v in [0.0, 5.0, -5.0, 1e-45, 3e38, -1e-40] {
            for policy in [RangePolicy::Series, RangePolicy::Log] {
                if policy == RangePolicy::Log && v <= 0.0 {
                    continue;
                }
                let range = policy.resolve((v, v), (v, v)).unwrap();
                // A difference and a quotient, or two logarithms below 1.4 and theirs: some roundings of 2^-53.
                assert!((range.position_of(v) - 0.5).abs() < 1e-15, "{policy} {v}");
            }
            let symmetric = RangePolicy::Symmetric.resolve((v, v), (v, v)).unwrap();
            assert!(symmetric.lo() < symmetric.hi() && symmetric.lo() == -symmetric.hi());
            // The range v..v has no axis: every position would be NaN.
            assert!(((v - v) / (v - v)).is_nan() && MappedRange::new(v, v, false).is_err());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn an_axis_never_falls_and_is_its_own_inverse(
            (lo, width) in (-1e6..1e6_f64, 1e-3..1e6_f64), log: bool, at in prop::collection::vec(0.0..=1.0, 2..20),
        ) {
            let range = if log { MappedRange::new(width, width * 1e3, true) } else { MappedRange::new(lo, lo + width, false) };
            let range = range.unwrap();
            let mut at = at;
            at.sort_by(f64::total_cmp);
            let scalars: Vec<f64> = at.iter().map(|&t| range.scalar_at(t)).collect();
            prop_assert!(scalars.is_sorted() && scalars.iter().all(|s| (range.lo()..=range.hi()).contains(s)));
            // A scalar is rounded by an ulp or two of the larger end; the axis is `width` long, and a logarithm rounds as little.
            let bound = 8.0 * f64::EPSILON * (1.0 + range.lo().abs().max(range.hi().abs()) / (range.hi() - range.lo()));
            for (t, s) in at.iter().zip(&scalars) {
                prop_assert!((range.position_of(*s) - t).abs() <= bound, "{t} {s}");
                let other = if *t < 0.5 { t + 1e-4 } else { t - 1e-4 };
                prop_assert!((range.position_of(range.scalar_at(other)) - t).abs() > bound, "{other} is taken for {t}");
            }
        }

        #[test]
        fn what_was_measured_lies_on_the_axis_of_every_policy(a in prop::num::f32::NORMAL | prop::num::f32::ZERO, b in prop::num::f32::NORMAL | prop::num::f32::ZERO) {
            let (lo, hi) = (f64::from(a.min(b)), f64::from(a.max(b)));
            for policy in [RangePolicy::Series, RangePolicy::Step, RangePolicy::Symmetric] {
                let range = policy.resolve((lo, hi), (lo, hi)).unwrap();
                prop_assert!(range.lo() <= lo && hi <= range.hi() && range.lo() < range.hi(), "{policy}: {range:?}");
            }
            let log = RangePolicy::Log.resolve((lo, hi), (lo, hi));
            prop_assert_eq!(log.is_ok(), hi > 0.0);
            prop_assert!(log.is_ok_and(|range| range.lo() > 0.0 && hi <= range.hi()) || hi <= 0.0);
        }
    }

    #[test]
    fn fields_without_a_range_are_errors() {
        let nan = (f64::NAN, f64::NAN);
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        for policy in [RangePolicy::Series, RangePolicy::Symmetric, RangePolicy::Log] {
            for range in [nan, none, (0.0, f64::INFINITY), (1.0, 0.0)] {
                assert!(policy.resolve(range, STEP).is_err(), "{policy} {range:?}");
            }
        }
        assert!(RangePolicy::Step.resolve(SERIES, nan).is_err());
        assert!(RangePolicy::Log.resolve((-3.0, 0.0), STEP).unwrap_err().to_string().contains("log:LO,HI"));
        assert!(RangePolicy::Series.resolve(SERIES, nan).is_ok(), "the step does not matter there");
    }

    #[test]
    fn positions_and_scalars_are_inverses_at_any_magnitude() {
        for (lo, hi, log) in [(1e-40, 1e-39, false), (1e-40, 1e-39, true), (-3e38, 3e38, false), (1e-45, 3e38, true)] {
            let range = MappedRange::new(lo, hi, log).unwrap();
            assert_eq!((range.scalar_at(0.0), range.scalar_at(1.0)), (lo, hi));
            for i in 0..=100 {
                let t = f64::from(i) / 100.0;
                // A few roundings of positions below 1: a logarithm rounds as little. Measured: 1.1e-16.
                assert!((range.position_of(range.scalar_at(t)) - t).abs() < 1e-15, "{lo} {hi} {t}");
            }
            assert!((range.position_of(range.scalar_at(0.25 + 1e-12)) - 0.25).abs() > 1e-15, "{lo} {hi}");
        }
        assert_eq!(MappedRange::new(1.0, 2.0, true).unwrap().position_of(0.0), f64::NEG_INFINITY);
    }
}

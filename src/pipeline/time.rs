//! The time that a frame shows.

use super::text::TimeText;
use crate::field::TimeAxis;
use crate::store::StoredField;
use serde::{Deserialize, Serialize};

/// The time that a frame shows: a step, or a linear mixture of two.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "TimeText")]
pub struct FrameTime {
    step: usize,
    /// The other step and its weight, in (0, 1).
    #[serde(skip_serializing_if = "Option::is_none")]
    toward: Option<(usize, f64)>,
}

/// A step counts as reached when all but this share of the interval before it has passed: times are stored with few digits,
/// and k / n of a range is rounded. Without it a step whose time was rounded up would be shown one frame late.
const REACHED_HELD: f64 = 1e-3;

/// As [`REACHED_HELD`], between steps that are interpolated. A smaller weight than this changes no f32 by more than its rounding unit,
/// unless the two steps differ by a factor of 64.
const REACHED_INTERPOLATED: f64 = 1e-9;

impl From<usize> for FrameTime {
    /// The time of a step.
    fn from(step: usize) -> Self {
        Self { step, toward: None }
    }
}

impl FrameTime {
    /// The mixture `(1 - weight) * step + weight * next` of two steps. A weight of 0 or below (or NaN) is `step` itself, one of 1 or above
    /// `next`.
    pub fn between(step: usize, next: usize, weight: f64) -> Self {
        if weight >= 1.0 || step == next {
            return next.into();
        }
        Self { step, toward: (weight > 0.0).then_some((next, weight)) }
    }

    /// The time to show at `time` (in the file's unit) with only `steps` (ascending): the last one reached, held until the next, or with
    /// `interpolate` a mixture of the two around. Before the first step it is the first, behind the last the last; `None` if there is no
    /// step.
    pub fn at(times: &TimeAxis, steps: &[usize], time: f64, interpolate: bool) -> Option<Self> {
        let time_of = |step: usize| times.values.get(step).copied().unwrap_or(f64::INFINITY);
        let behind = steps.partition_point(|&step| time_of(step) <= time);
        let Some(&next) = steps.get(behind) else { return steps.last().map(|&step| step.into()) };
        let Some(&step) = behind.checked_sub(1).and_then(|i| steps.get(i)) else { return Some(next.into()) };
        // Halved before the differences, which could overflow.
        let (begin, end, time) = (0.5 * time_of(step), 0.5 * time_of(next), 0.5 * time);
        let weight = (time - begin) / (end - begin);
        let reached = if interpolate { REACHED_INTERPOLATED } else { REACHED_HELD };
        Some(if weight > 1.0 - reached {
            next.into()
        } else if !interpolate || weight < reached {
            step.into()
        } else {
            Self::between(step, next, weight)
        })
    }

    /// The step, or the first of the two.
    pub fn step(self) -> usize {
        self.step
    }

    /// The second step and its weight in (0, 1), if there are two.
    pub fn toward(self) -> Option<(usize, f64)> {
        self.toward
    }

    /// The time in the file's unit: of the step, or interpolated between the two.
    pub fn time(self, times: &TimeAxis) -> f64 {
        let time_of = |step: usize| times.values.get(step).copied().unwrap_or(f64::NAN);
        self.mix(time_of(self.step), time_of)
    }

    /// Smallest and largest scalar of the whole series and of this time; NaN if there is no finite one.
    ///
    /// Between two steps their ranges are interpolated as the scalars are: no mixed scalar lies outside, and colours do not jump at a step.
    /// A step without a finite value shows nothing, so it has the range of the series.
    pub fn scalar_ranges(self, field: &StoredField) -> ((f64, f64), (f64, f64)) {
        let ends = |[lo, hi]: [f32; 2]| (f64::from(lo), f64::from(hi));
        let series = field.range.map_or((f64::NAN, f64::NAN), ends);
        let of = |step: usize| field.range_per_step.get(step).copied().flatten().map_or(series, ends);
        let (lo, hi) = of(self.step);
        (series, (self.mix(lo, |next| of(next).0), self.mix(hi, |next| of(next).1)))
    }

    /// `first` at a step; between two steps, its mixture with `of` the second one.
    pub fn mix(self, first: f64, of: impl FnOnce(usize) -> f64) -> f64 {
        match self.toward {
            None => first,
            Some((next, weight)) => mix(first, of(next), weight),
        }
    }
}

/// Linear interpolation; not finite if either end is not.
pub(super) fn mix(a: f64, b: f64, weight: f64) -> f64 {
    a * (1.0 - weight) + b * weight
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::test_series;

    /// Not uniform, with rounded digits as in files.
    fn times() -> TimeAxis {
        TimeAxis { values: vec![0.0, 0.333333, 0.666667, 1.0, 3.0] }
    }

    fn held(steps: &[usize], time: f64) -> FrameTime {
        FrameTime::at(&times(), steps, time, false).unwrap()
    }

    fn interpolated(steps: &[usize], time: f64) -> FrameTime {
        FrameTime::at(&times(), steps, time, true).unwrap()
    }

    const ALL: [usize; 5] = [0, 1, 2, 3, 4];

    #[test]
    fn a_step_is_held_until_the_next_one() {
        for (time, step) in
            [(-1.0, 0), (0.0, 0), (0.3, 0), (0.333333, 1), (0.6, 1), (1.0, 3), (2.99, 3), (3.0, 4), (9.0, 4)]
        {
            assert_eq!(held(&ALL, time), step.into(), "{time}");
        }
    }

    #[test]
    fn a_step_whose_time_was_rounded_up_in_the_file_is_not_missed() {
        let thirds: Vec<FrameTime> = (0..=3).map(|k| held(&ALL, f64::from(k) / 3.0)).collect();
        assert_eq!(thirds, [0, 1, 2, 3].map(FrameTime::from));
    }

    #[test]
    fn interpolation_follows_the_times_of_the_file() {
        let (next, weight) = interpolated(&ALL, 1.5).toward().unwrap();
        assert_eq!((interpolated(&ALL, 1.5).step(), next, weight), (3, 4, 0.25));
        assert_eq!(interpolated(&ALL, 1.5).time(&times()), 1.5);
        assert_eq!(interpolated(&[0, 3], 0.25), FrameTime::between(0, 3, 0.25), "only the steps given are used");
        for step in ALL {
            assert_eq!(interpolated(&ALL, times().values[step]), step.into(), "at the step itself");
        }
        assert_eq!((interpolated(&ALL, -1.0), interpolated(&ALL, 9.0)), (0.into(), 4.into()));
        assert_eq!(FrameTime::at(&times(), &[], 0.0, true), None);
    }

    #[test]
    fn times_at_the_ends_of_a_double_have_a_middle() {
        let times = TimeAxis { values: vec![-f64::MAX, f64::MAX] };
        assert_eq!(FrameTime::at(&times, &[0, 1], 0.0, true), Some(FrameTime::between(0, 1, 0.5)));
    }

    #[test]
    fn the_range_between_two_steps_is_mixed_as_their_scalars_are() {
        let series = test_series::jet();
        let field = series.field();
        let of = |step: usize| field.range_per_step[step].map(|range| range.map(f64::from)).unwrap();
        let ([a, b], [c, d]) = (of(1), of(2));
        assert!(b != d, "steps of the same range would tell nothing");
        let (whole, (lo, hi)) = FrameTime::between(1, 2, 0.25).scalar_ranges(field);
        // Weights in quarters are exact; summed in the order of the definition.
        assert_eq!((lo, hi), (0.75 * a + 0.25 * c, 0.75 * b + 0.25 * d));
        assert_eq!(FrameTime::from(2).scalar_ranges(field), (whole, (c, d)));
        let steps = field.range_per_step.iter().flatten().map(|range| range.map(f64::from));
        let ends = steps.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], [a, b]| [lo.min(a), hi.max(b)]);
        assert_eq!(whole, (ends[0], ends[1]));
    }

    #[test]
    fn weights_out_of_range_are_one_of_the_steps() {
        assert_eq!([0.0, -1.0, f64::NAN].map(|w| FrameTime::between(2, 3, w)), [2.into(); 3]);
        assert_eq!([1.0, 7.0].map(|w| FrameTime::between(2, 3, w)), [3.into(); 2]);
    }
}

//! The times and turntable angles of a run's frames.

use crate::export::movie::FrameRate;
use crate::field::TimeAxis;
use crate::ingest::{StepRange, StepRangeError};
use crate::pipeline::FrameTime;
use crate::short::Short;

/// Selection of the times of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Times {
    /// Range of steps.
    pub steps: StepRange,
    /// Time range, both ends included: the steps in it, or with a duration that part of the series.
    pub range: Option<(f64, f64)>,
    /// Frames per second; `None`: 25.
    pub rate: Option<FrameRate>,
    /// Duration in seconds over which the time range is spread evenly, from the first frame to the last; `None`: a frame per step.
    pub duration_s: Option<f64>,
    /// With a duration: scalars between two steps are interpolated linearly; otherwise the last step is held.
    pub interpolate: bool,
    /// Degrees by which the camera turns around the up axis through the focal point over the run.
    pub turntable_deg: Option<f64>,
}

/// A selection without valid frames.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The series does not have these steps.
    #[error(transparent)]
    Steps(#[from] StepRangeError),
    /// No step lies in the time range `range`; the selected ones go from `extent.0` to `extent.1`.
    #[error("no step lies in time {}", ranges_text(*.range, *.extent))]
    NoStep {
        /// The time range.
        range: (f64, f64),
        /// First and last time of the selected steps.
        extent: (f64, f64),
    },
    /// The selected steps do not cover any time of the range.
    #[error("the series has no time in {}", ranges_text(*.range, *.extent))]
    NoTime {
        /// The time range.
        range: (f64, f64),
        /// First and last time of the selected steps.
        extent: (f64, f64),
    },
    /// The duration gives no frame, or more than [`FRAMES_MAX`].
    #[error("{} s at {rate} frames per second are {problem} --duration", Short(.duration_s))]
    Frames {
        /// Duration in seconds.
        duration_s: f64,
        /// Frames per second.
        rate: FrameRate,
        /// What is wrong with it.
        problem: String,
    },
    /// A turntable needs more than one frame.
    #[error("one frame cannot turn; give --turntable more of them with --duration or --steps")]
    OneFrame,
}

/// The time range asked for, and the times of the series.
fn ranges_text((from, to): (f64, f64), (first, last): (f64, f64)) -> String {
    format!("{}..{}; the series goes from {} to {}", Short(from), Short(to), Short(first), Short(last))
}

/// A planned frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedFrame {
    /// Time of the series that it shows.
    pub time: FrameTime,
    /// Its time on a project's timeline: with `--duration` the exact one, even if a step is held.
    pub at: f64,
    /// Turntable angle in degrees.
    pub azimuth_deg: f64,
    /// Where all frames show one step, for how long that has been held: its flow goes on meanwhile.
    pub held: Option<Held>,
    /// Time of the series over which patterns of flow are averaged: that until the next frame, where the run is seen as motion.
    pub shutter: f64,
}

/// A step that is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Seconds since the first frame.
    pub since_s: f64,
    /// Seconds that a frame lasts.
    pub frame_s: f64,
}

/// The planned frames of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The frames in order.
    pub frames: Vec<PlannedFrame>,
    /// The steps that they use, ascending.
    pub steps: Vec<usize>,
}

/// Most output frames, as more are a mistake: eleven hours at 25 per second.
const FRAMES_MAX: usize = 1_000_000;

impl Plan {
    /// A frame for each of these steps.
    pub fn of_steps(steps: &[usize], times: &TimeAxis) -> Self {
        let frame = |&step: &usize| {
            let time = FrameTime::from(step);
            PlannedFrame { time, at: time.time(times), azimuth_deg: 0.0, held: None, shutter: 0.0 }
        };
        Self { frames: steps.iter().map(frame).collect(), steps: steps.to_vec() }
    }

    /// Gives each frame a shutter: the time of the series until the next one, the last the time since the one before. Where all show one
    /// time there is none.
    fn open_shutters(&mut self, times: &TimeAxis) {
        let shown: Vec<f64> = self.frames.iter().map(|frame| frame.time.time(times)).collect();
        // Frames that repeat a picture are that picture: the next one is another.
        let pictures: Vec<&[f64]> = shown.chunk_by(|a, b| a == b).collect();
        let until = |pair: &[&[f64]]| Some((pair[1][0] - pair[0][0]).abs()).filter(|time| time.is_finite());
        let mut shutters: Vec<f64> = pictures.windows(2).map(|pair| until(pair).unwrap_or(0.0)).collect();
        shutters.extend(shutters.last().copied());
        let of_frames = pictures.iter().zip(shutters).flat_map(|(of, shutter)| std::iter::repeat_n(shutter, of.len()));
        self.frames.iter_mut().zip(of_frames).for_each(|(frame, shutter)| frame.shutter = shutter);
    }

    /// The steps that `count` frames from frame `first` on use, in order.
    pub fn steps_from(&self, first: usize, count: usize) -> Vec<usize> {
        let times = self.frames.iter().skip(first).take(count).map(|frame| frame.time);
        times.flat_map(|time| [Some(time.step()), time.toward().map(|(next, _)| next)]).flatten().collect()
    }
}

impl Times {
    /// Frames per second.
    pub fn rate(&self) -> FrameRate {
        self.rate.unwrap_or_default()
    }

    /// Number of frames for the duration; `None` without one.
    ///
    /// # Errors
    /// If there are none, or too many.
    pub fn frame_count(&self) -> Result<Option<usize>, PlanError> {
        let Some(duration_s) = self.duration_s else { return Ok(None) };
        let rate = self.rate();
        let frames = (rate.per_second() * duration_s).round();
        let refused = |problem: String| Err(PlanError::Frames { duration_s, rate, problem });
        if frames.is_nan() || frames < 1.0 {
            return refused("no frame; give a longer".to_owned());
        }
        if frames > FRAMES_MAX as f64 {
            return refused(format!("more than {FRAMES_MAX} frames; give a shorter"));
        }
        Ok(Some(frames as usize))
    }

    /// Refuses settings that have no effect, whatever the series.
    ///
    /// # Errors
    /// If there are any.
    pub fn check(&self, is_movie: bool) -> Result<(), String> {
        if self.rate.is_some() && !is_movie && self.duration_s.is_none() {
            let problem =
                "--fps has no effect on images that show one step each; add --duration, or write a movie: -o movie.mp4";
            return Err(problem.to_owned());
        }
        if self.interpolate && self.duration_s.is_none() {
            return Err("--interpolate has no effect without --duration; add it".to_owned());
        }
        Ok(())
    }

    /// Plans the frames of a series with these times. Those of a movie, or of a duration, are seen as motion.
    ///
    /// # Errors
    /// If there are none.
    pub fn plan(&self, times: &TimeAxis, is_movie: bool) -> Result<Plan, PlanError> {
        let selected = self.steps.select(times.len())?;
        let mut plan = match self.frame_count()? {
            None => Plan::of_steps(&self.steps_within(&selected, times)?, times),
            Some(count) => self.spread(&selected, times, count)?,
        };
        if is_movie || self.duration_s.is_some() {
            plan.open_shutters(times);
        }
        if let Some(degrees) = self.turntable_deg.filter(|degrees| *degrees != 0.0) {
            let count = plan.frames.len();
            if count < 2 {
                return Err(PlanError::OneFrame);
            }
            for (n, frame) in plan.frames.iter_mut().enumerate() {
                frame.azimuth_deg = degrees * (n as f64 / count as f64);
            }
        }
        Ok(plan)
    }

    /// The selected steps in the time range.
    fn steps_within(&self, selected: &[usize], times: &TimeAxis) -> Result<Vec<usize>, PlanError> {
        let Some((from, to)) = self.range else { return Ok(selected.to_vec()) };
        let within: Vec<usize> = selected.iter().copied().filter(|&s| (from..=to).contains(&times.values[s])).collect();
        if within.is_empty() {
            return Err(PlanError::NoStep { range: (from, to), extent: extent(selected, times) });
        }
        Ok(within)
    }

    /// `count` frames over the part of the time range that the selected steps cover.
    fn spread(&self, selected: &[usize], times: &TimeAxis, count: usize) -> Result<Plan, PlanError> {
        let (from, to) = self.range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let covered = extent(selected, times);
        let (begin, end) = (from.max(covered.0), to.min(covered.1));
        if begin.is_nan() || end.is_nan() || begin > end {
            return Err(PlanError::NoTime { range: (from, to), extent: covered });
        }
        let (mut frames, frame_s) = (Vec::with_capacity(count), self.rate().per_second().recip());
        let is_held = selected.len() == 1 && count > 1;
        for n in 0..count {
            let share = if count > 1 { n as f64 / (count - 1) as f64 } else { 0.0 };
            // Exact at both ends, and without a difference that could overflow.
            let at = begin * (1.0 - share) + end * share;
            if let Some(time) = FrameTime::at(times, selected, at, self.interpolate) {
                let held = is_held.then_some(Held { since_s: n as f64 * frame_s, frame_s });
                frames.push(PlannedFrame { time, at, azimuth_deg: 0.0, held, shutter: 0.0 });
            }
        }
        let shown = frames.iter().flat_map(|f| [Some(f.time.step()), f.time.toward().map(|(next, _)| next)]);
        let mut steps: Vec<usize> = shown.flatten().collect();
        steps.sort_unstable();
        steps.dedup();
        Ok(Plan { frames, steps })
    }
}

/// Parses a time range `T0..T1` with T0 <= T1; an end left out is open.
///
/// # Errors
/// If the text is none.
pub fn parse_times(text: &str) -> Result<(f64, f64), String> {
    let number = |part: &str, open: f64| if part.trim().is_empty() { Some(open) } else { part.trim().parse().ok() };
    let ends = text
        .split_once("..")
        .and_then(|(a, b)| Some((number(a, f64::NEG_INFINITY)?, number(b, f64::INFINITY)?)))
        .filter(|(a, b)| a <= b);
    ends.ok_or_else(|| "write T0..T1 with T0 <= T1, as in 0.5..2".to_owned())
}

/// Parses a duration in seconds.
///
/// # Errors
/// If the text is no positive number.
pub fn parse_duration(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0 && s.is_finite());
    seconds.ok_or_else(|| "a duration is a positive number of seconds".to_owned())
}

/// Parses an angle in degrees.
///
/// # Errors
/// If the text is no number.
pub fn parse_angle(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|d: &f64| d.is_finite());
    degrees.ok_or_else(|| "an angle is a number of degrees, negative to turn the other way".to_owned())
}

/// First and last time of these steps.
fn extent(selected: &[usize], times: &TimeAxis) -> (f64, f64) {
    let time_of = |step: Option<&usize>| step.map_or(f64::NAN, |&s| times.values[s]);
    (time_of(selected.first()), time_of(selected.last()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times() -> TimeAxis {
        TimeAxis { values: vec![0.0, 0.1, 0.3, 0.7, 1.5] }
    }

    fn steps_of(plan: &Plan) -> Vec<usize> {
        plan.frames.iter().map(|f| f.time.step()).collect()
    }

    #[test]
    fn without_a_duration_each_step_is_a_frame() {
        let args = Times { steps: "1..4:3".parse().unwrap(), ..Default::default() };
        assert_eq!(args.plan(&times(), false).unwrap(), Plan::of_steps(&[1, 4], &times()));
        let args = Times { range: Some((0.1, 0.7)), ..Default::default() };
        assert_eq!(args.plan(&times(), false).unwrap(), Plan::of_steps(&[1, 2, 3], &times()));
    }

    #[test]
    fn a_duration_is_spread_over_the_time_range_ends_included() {
        let args = Times { duration_s: Some(0.64), ..Default::default() };
        let plan = args.plan(&times(), false).unwrap();
        // A frame every 0.1: steps are held until the next one.
        assert_eq!(steps_of(&plan), [0, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3, 4]);
        assert_eq!(plan.steps, [0, 1, 2, 3, 4]);
        let args = Times { duration_s: Some(0.2), interpolate: true, range: Some((0.4, 0.6)), ..args };
        let plan = args.plan(&times(), false).unwrap();
        assert_eq!((plan.frames.len(), &plan.steps[..]), (5, &[2, 3][..]), "no step lies in the range itself");
        let shown: Vec<f64> = plan.frames.iter().map(|f| f.time.time(&times())).collect();
        for (time, expected) in shown.iter().zip([0.4, 0.45, 0.5, 0.55, 0.6]) {
            // A few roundings of numbers below 1, 1.1e-16 each (measured: one).
            assert!((time - expected).abs() < 1e-15, "{shown:?}");
        }
    }

    #[test]
    fn a_turntable_divides_its_angle_by_the_frames_and_never_comes_round_to_the_first() {
        let one_step = Times { steps: "2".parse().unwrap(), turntable_deg: Some(360.0), ..Default::default() };
        assert!(one_step.plan(&times(), false).unwrap_err().to_string().contains("--duration"));
        let args = Times { duration_s: Some(4.0), ..one_step };
        let plan = args.plan(&times(), false).unwrap();
        assert_eq!(plan.frames.len(), 100);
        let held = Some(Held { since_s: 1.0, frame_s: 0.04 });
        assert_eq!(plan.frames[25], PlannedFrame { time: 2.into(), at: 0.3, azimuth_deg: 90.0, held, shutter: 0.0 });
        assert_eq!((plan.frames[0].azimuth_deg, plan.frames[99].azimuth_deg), (0.0, 356.4));
        let args = Times { turntable_deg: Some(-50.0), ..Default::default() };
        let angles: Vec<f64> = args.plan(&times(), false).unwrap().frames.iter().map(|f| f.azimuth_deg).collect();
        assert_eq!(angles, [-0.0, -10.0, -20.0, -30.0, -40.0]);
        assert!(args.plan(&times(), false).unwrap().frames.iter().all(|frame| frame.held.is_none()));
    }

    #[test]
    fn a_frame_of_a_motion_is_open_until_the_next_one_and_a_still_is_not() {
        let shutters = |args: Times, is_movie: bool| -> Vec<f64> {
            args.plan(&times(), is_movie).unwrap().frames.iter().map(|frame| frame.shutter).collect()
        };
        let are = |found: Vec<f64>, expected: &[f64]| {
            let close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-15;
            assert!(found.len() == expected.len() && found.iter().zip(expected).all(close), "{found:?}");
        };
        let steps = |text: &str| Times { steps: text.parse().unwrap(), ..Times::default() };
        are(shutters(Times::default(), true), &[0.1, 0.2, 0.4, 0.8, 0.8]);
        are(shutters(steps("0..4:2"), true), &[0.3, 1.2, 1.2]);
        are(shutters(steps("0..4:2"), false), &[0.0; 3]);
        are(shutters(steps("2"), true), &[0.0]);
        // Pictures between two steps follow one another evenly.
        let spread = |duration: f64, interpolate| Times { duration_s: Some(duration), interpolate, ..Times::default() };
        are(shutters(spread(0.2, true), false), &[0.375; 5]);
        // A step that is shown by several frames is open until the next step: the picture does not change before.
        let found = shutters(spread(0.64, false), false);
        assert_eq!(found, shutters(spread(0.64, false), true));
        are(found, &[[0.1].as_slice(), &[0.2; 2], &[0.4; 4], &[0.8; 9]].concat());
        are(shutters(spread(0.04, true), true), &[0.0]);
        // A step that is held, or one time, has a shutter of its own or none.
        are(shutters(Times { steps: "2".parse().unwrap(), ..spread(0.2, false) }, true), &[0.0; 5]);
        are(shutters(Times { range: Some((0.2, 0.2)), ..spread(0.2, true) }, true), &[0.0; 5]);
        let endless = TimeAxis { values: vec![-f64::MAX, f64::MAX] };
        let plan = Times::default().plan(&endless, true).unwrap();
        assert!(plan.frames.iter().all(|frame| frame.shutter == 0.0));
    }

    #[test]
    fn a_rate_of_images_of_one_step_each_has_no_meaning() {
        let fps_alone = Times { rate: Some("30".parse().unwrap()), ..Default::default() };
        assert!(fps_alone.check(false).is_err() && fps_alone.check(true).is_ok());
        let interpolated = Times { interpolate: true, ..Default::default() };
        assert!(interpolated.check(true).is_err());
    }

    #[test]
    fn what_makes_no_frame_is_refused() {
        for (duration, fps) in [(0.01, None), (1e9, None), (1.0, Some("0.2"))] {
            let rate = fps.map(|text: &str| text.parse().unwrap());
            let refused = Times { duration_s: Some(duration), rate, ..Default::default() }.frame_count().unwrap_err();
            assert!(refused.to_string().contains("--duration"), "{refused}");
        }
        let elsewhere = Times { range: Some((2.0, 3.0)), duration_s: Some(1.0), ..Default::default() };
        assert!(elsewhere.plan(&times(), false).unwrap_err().to_string().contains("0 to 1.5"));
    }
}

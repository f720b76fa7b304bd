//! Which moments a run shows, and from where.

use crate::cli::progress::Terminal;
use crate::cli::steps;
use crate::export::movie::FrameRate;
use crate::field::TimeAxis;
use crate::ingest::StepRange;
use crate::pipeline::FrameTime;
use crate::short::Short;
use anyhow::{bail, ensure};

/// Which moments are shown.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct TimeArgs {
    /// Steps A..B:S, zero-based, both ends included
    #[arg(long, value_name = "A..B:S", default_value = "0..")]
    steps: StepRange,
    /// From time T0 to T1, both included: the steps there, or with --duration that part of the series
    #[arg(long, value_name = "T0..T1", value_parser = parse_times, allow_hyphen_values = true)]
    times: Option<(f64, f64)>,
    /// Frames per second, for movies and --duration [default: 25]
    #[arg(long, value_name = "F", allow_hyphen_values = true)]
    fps: Option<FrameRate>,
    /// Spread the time range over S seconds: F * S frames, evenly spaced in time, the first and the last at its ends.
    /// Each shows the last step that its time has reached
    #[arg(long, value_name = "S", value_parser = parse_duration, allow_hyphen_values = true)]
    duration: Option<f64>,
    /// With --duration: between two steps, interpolate the scalars linearly in time
    #[arg(long)]
    interpolate: bool,
    /// Turn the camera by DEG degrees around the focal point and the up axis while the frames pass, the eye to its right:
    /// frame n of N by n / N of it, so that 360 makes a loop without a frame twice
    #[arg(long, value_name = "DEG", value_parser = parse_angle, allow_hyphen_values = true)]
    turntable: Option<f64>,
}

/// One frame to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlannedFrame {
    /// What it shows.
    pub(super) time: FrameTime,
    /// Where it is on a project's timeline: with `--duration` the time that it stands for, though a step is held.
    pub(super) at: f64,
    /// How far the camera has turned, degrees.
    pub(super) azimuth_deg: f64,
}

/// The frames of a run.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    pub(super) frames: Vec<PlannedFrame>,
    /// The steps that they show, ascending.
    pub(super) steps: Vec<usize>,
}

/// Frame rate unless another is asked for.
const DEFAULT_RATE: &str = "25";
/// More output frames than this are a mistake: eleven hours at 25 a second.
const FRAMES_MAX: usize = 1_000_000;

impl Plan {
    /// One frame for each of these steps.
    pub(super) fn of_steps(steps: &[usize], times: &TimeAxis) -> Self {
        let frame = |&step: &usize| {
            let time = FrameTime::from(step);
            PlannedFrame { time, at: time.time(times), azimuth_deg: 0.0 }
        };
        Self { frames: steps.iter().map(frame).collect(), steps: steps.to_vec() }
    }

    /// The steps that `count` frames from frame `first` on show, in their order.
    pub(super) fn steps_from(&self, first: usize, count: usize) -> Vec<usize> {
        let moments = self.frames.iter().skip(first).take(count).map(|frame| frame.time);
        moments.flat_map(|time| [Some(time.step()), time.toward().map(|(next, _)| next)]).flatten().collect()
    }
}

impl TimeArgs {
    /// Frames per second.
    pub(super) fn rate(&self) -> anyhow::Result<FrameRate> {
        match self.fps {
            Some(rate) => Ok(rate),
            None => DEFAULT_RATE.parse().map_err(anyhow::Error::msg),
        }
    }

    /// Refuses what has no meaning, whatever the series.
    pub(super) fn check(&self, is_movie: bool) -> anyhow::Result<()> {
        if self.fps.is_some() && !is_movie && self.duration.is_none() {
            bail!(
                "--fps has no effect on images that show one step each; add --duration, or write a movie: -o movie.mp4"
            );
        }
        ensure!(!self.interpolate || self.duration.is_some(), "--interpolate has no effect without --duration; add it");
        self.frame_count().map(|_| ())
    }

    /// Frames that `--duration` asks for.
    fn frame_count(&self) -> anyhow::Result<Option<usize>> {
        let Some(duration) = self.duration else { return Ok(None) };
        let rate = self.rate()?;
        let frames = (rate.per_second() * duration).round();
        ensure!(
            frames >= 1.0,
            "{} s at {rate} frames per second are no frame; give a longer --duration",
            Short(duration)
        );
        ensure!(
            frames <= FRAMES_MAX as f64,
            "{} s at {rate} frames per second are more than {FRAMES_MAX} frames; give a shorter --duration",
            Short(duration)
        );
        Ok(Some(frames as usize))
    }

    /// The same for a series of so many steps: steps behind its last one are left out, which is said.
    pub(super) fn within_series(self, count: usize, terminal: &Terminal) -> Self {
        Self { steps: steps::within_series(self.steps, count, terminal), ..self }
    }

    /// The frames to render of a series with these times.
    pub(super) fn plan(&self, times: &TimeAxis) -> anyhow::Result<Plan> {
        let selected = self.steps.select(times.len())?;
        let mut plan = match self.frame_count()? {
            None => Plan::of_steps(&self.steps_within(&selected, times)?, times),
            Some(count) => self.spread(&selected, times, count)?,
        };
        if let Some(degrees) = self.turntable {
            let count = plan.frames.len();
            ensure!(count > 1, "one frame cannot turn; give --turntable more of them with --duration or --steps");
            for (n, frame) in plan.frames.iter_mut().enumerate() {
                frame.azimuth_deg = degrees * (n as f64 / count as f64);
            }
        }
        Ok(plan)
    }

    /// The selected steps that lie in the time range.
    fn steps_within(&self, selected: &[usize], times: &TimeAxis) -> anyhow::Result<Vec<usize>> {
        let Some((from, to)) = self.times else { return Ok(selected.to_vec()) };
        let within: Vec<usize> = selected.iter().copied().filter(|&s| (from..=to).contains(&times.values[s])).collect();
        ensure!(!within.is_empty(), "no step lies in time {}..{}; {}", Short(from), Short(to), extent(selected, times));
        Ok(within)
    }

    /// `count` frames over the part of the time range that the selected steps cover.
    fn spread(&self, selected: &[usize], times: &TimeAxis, count: usize) -> anyhow::Result<Plan> {
        let (from, to) = self.times.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let time_of = |step: Option<&usize>| step.map_or(f64::NAN, |&s| times.values[s]);
        let (begin, end) = (from.max(time_of(selected.first())), to.min(time_of(selected.last())));
        ensure!(begin <= end, "the series has no time in {}..{}; {}", Short(from), Short(to), extent(selected, times));
        let mut frames = Vec::with_capacity(count);
        for n in 0..count {
            let share = if count > 1 { n as f64 / (count - 1) as f64 } else { 0.0 };
            // Exact at both ends, and without a difference that could overflow.
            let at = begin * (1.0 - share) + end * share;
            if let Some(time) = FrameTime::at(times, selected, at, self.interpolate) {
                frames.push(PlannedFrame { time, at, azimuth_deg: 0.0 });
            }
        }
        let shown = frames.iter().flat_map(|f| [Some(f.time.step()), f.time.toward().map(|(next, _)| next)]);
        let mut steps: Vec<usize> = shown.flatten().collect();
        steps.sort_unstable();
        steps.dedup();
        Ok(Plan { frames, steps })
    }
}

/// From when to when these steps go.
fn extent(selected: &[usize], times: &TimeAxis) -> String {
    let time_of = |step: Option<&usize>| step.map_or(f64::NAN, |&s| times.values[s]);
    let (first, last) = (time_of(selected.first()), time_of(selected.last()));
    format!("the series goes from {} to {}", Short(first), Short(last))
}

fn parse_times(text: &str) -> Result<(f64, f64), String> {
    let number = |part: &str, open: f64| if part.trim().is_empty() { Some(open) } else { part.trim().parse().ok() };
    let ends = text
        .split_once("..")
        .and_then(|(a, b)| Some((number(a, f64::NEG_INFINITY)?, number(b, f64::INFINITY)?)))
        .filter(|(a, b)| a <= b);
    ends.ok_or_else(|| "write T0..T1 with T0 <= T1, as in 0.5..2".to_owned())
}

fn parse_duration(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0 && s.is_finite());
    seconds.ok_or_else(|| "a duration is a positive number of seconds".to_owned())
}

fn parse_angle(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|d: &f64| d.is_finite());
    degrees.ok_or_else(|| "an angle is a number of degrees, negative to turn the other way".to_owned())
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
        let args = TimeArgs { steps: "1..4:3".parse().unwrap(), ..Default::default() };
        assert_eq!(args.plan(&times()).unwrap(), Plan::of_steps(&[1, 4], &times()));
        let args = TimeArgs { times: Some((0.1, 0.7)), ..Default::default() };
        assert_eq!(args.plan(&times()).unwrap(), Plan::of_steps(&[1, 2, 3], &times()));
    }

    #[test]
    fn a_duration_is_spread_over_the_time_range_ends_included() {
        let args = TimeArgs { duration: Some(0.64), ..Default::default() };
        let plan = args.plan(&times()).unwrap();
        // A frame every 0.1: steps are held until the next one.
        assert_eq!(steps_of(&plan), [0, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3, 4]);
        assert_eq!(plan.steps, [0, 1, 2, 3, 4]);
        let args = TimeArgs { duration: Some(0.2), interpolate: true, times: Some((0.4, 0.6)), ..args };
        let plan = args.plan(&times()).unwrap();
        assert_eq!((plan.frames.len(), &plan.steps[..]), (5, &[2, 3][..]), "no step lies in the range itself");
        let shown: Vec<f64> = plan.frames.iter().map(|f| f.time.time(&times())).collect();
        for (time, expected) in shown.iter().zip([0.4, 0.45, 0.5, 0.55, 0.6]) {
            // A few roundings of numbers below 1, 1.1e-16 each. Measured: one.
            assert!((time - expected).abs() < 1e-15, "{shown:?}");
        }
    }

    #[test]
    fn a_turntable_divides_its_angle_by_the_frames_and_never_comes_round_to_the_first() {
        let one_step = TimeArgs { steps: "2".parse().unwrap(), turntable: Some(360.0), ..Default::default() };
        assert!(one_step.plan(&times()).unwrap_err().to_string().contains("--duration"));
        let args = TimeArgs { duration: Some(4.0), ..one_step };
        let plan = args.plan(&times()).unwrap();
        assert_eq!(plan.frames.len(), 100);
        assert_eq!(plan.frames[25], PlannedFrame { time: 2.into(), at: 0.3, azimuth_deg: 90.0 });
        assert_eq!((plan.frames[0].azimuth_deg, plan.frames[99].azimuth_deg), (0.0, 356.4));
        let args = TimeArgs { turntable: Some(-50.0), ..Default::default() };
        let angles: Vec<f64> = args.plan(&times()).unwrap().frames.iter().map(|f| f.azimuth_deg).collect();
        assert_eq!(angles, [-0.0, -10.0, -20.0, -30.0, -40.0]);
    }

    #[test]
    fn what_makes_no_frame_is_refused() {
        for (duration, fps) in [(0.01, None), (1e9, None), (1.0, Some("0.2"))] {
            let fps = fps.map(|text: &str| text.parse().unwrap());
            assert!(TimeArgs { duration: Some(duration), fps, ..Default::default() }.check(true).is_err());
        }
        let fps_alone = TimeArgs { fps: Some("30".parse().unwrap()), ..Default::default() };
        assert!(fps_alone.check(false).is_err() && fps_alone.check(true).is_ok());
        let elsewhere = TimeArgs { times: Some((2.0, 3.0)), duration: Some(1.0), ..Default::default() };
        assert!(elsewhere.plan(&times()).unwrap_err().to_string().contains("0 to 1.5"));
    }
}

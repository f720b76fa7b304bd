//! Options for the times that a run shows, and for the turning camera.

use crate::export::movie::FrameRate;
use crate::export::run::Times;
use crate::ingest::StepRange;
use anyhow::{bail, ensure};

/// Options for the times shown.
#[derive(Debug, Default, clap::Args)]
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

impl TimeArgs {
    /// The times of these options.
    pub(super) fn times(&self) -> Times {
        Times {
            steps: self.steps,
            range: self.times,
            rate: self.fps,
            duration_s: self.duration,
            interpolate: self.interpolate,
            turntable_deg: self.turntable,
        }
    }

    /// Refuses inconsistent options, whatever the series.
    pub(super) fn check(&self, is_movie: bool) -> anyhow::Result<()> {
        if self.fps.is_some() && !is_movie && self.duration.is_none() {
            bail!(
                "--fps has no effect on images that show one step each; add --duration, or write a movie: -o movie.mp4"
            );
        }
        ensure!(!self.interpolate || self.duration.is_some(), "--interpolate has no effect without --duration; add it");
        self.times().frame_count()?;
        Ok(())
    }
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

    #[test]
    fn a_rate_of_images_of_one_step_each_has_no_meaning() {
        let fps_alone = TimeArgs { fps: Some("30".parse().unwrap()), ..Default::default() };
        assert!(fps_alone.check(false).is_err() && fps_alone.check(true).is_ok());
        let interpolated = TimeArgs { interpolate: true, ..Default::default() };
        assert!(interpolated.check(true).is_err());
        let too_short = TimeArgs { duration: Some(0.01), ..Default::default() };
        assert!(too_short.check(true).unwrap_err().to_string().contains("--duration"));
    }
}

//! Options for the times that a run shows, and for the turning camera.

use crate::export::movie::FrameRate;
use crate::export::run::{Times, parse_angle, parse_duration, parse_times};
use crate::ingest::StepRange;
use anyhow::bail;

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
    /// Hold the step of --steps, or the only one, for S seconds while its flow goes on (--flow-rate), as --duration does
    #[arg(long, value_name = "S", value_parser = parse_duration, allow_hyphen_values = true)]
    #[arg(conflicts_with_all = ["duration", "times"])]
    flow_hold: Option<f64>,
    /// With --duration: between two steps, interpolate the scalars linearly in time
    #[arg(long)]
    interpolate: bool,
    /// Turn the camera by DEG degrees around the focal point and the up axis while the frames pass, the eye to its right:
    /// frame n of N by n / N of it, so that 360 makes a loop without a frame twice
    #[arg(long, value_name = "DEG", value_parser = parse_angle, allow_hyphen_values = true)]
    turntable: Option<f64>,
}

impl TimeArgs {
    /// Refuses to hold several steps, or one without flow, whatever the series.
    pub(super) fn check(&self, has_flow: bool) -> anyhow::Result<()> {
        if self.flow_hold.is_some() && !has_flow {
            bail!("--flow-hold is about flow; name a field of vectors by --flow FIELD, or choose --duration");
        }
        self.check_held(self.steps.last.map_or(1, |last| last.saturating_sub(self.steps.first).saturating_add(1)))
    }

    /// Refuses to hold so many steps.
    pub(super) fn check_held(&self, count: usize) -> anyhow::Result<()> {
        if self.flow_hold.is_some() && count > 1 {
            bail!("--flow-hold holds one step; choose it with --steps N");
        }
        Ok(())
    }

    /// The times of these options.
    pub(super) fn times(&self) -> Times {
        Times {
            steps: self.steps,
            range: self.times,
            rate: self.fps,
            duration_s: self.duration.or(self.flow_hold),
            interpolate: self.interpolate,
            turntable_deg: self.turntable,
        }
    }
}

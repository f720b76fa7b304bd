//! The record of a benchmark, as JSON.
//!
//! Figures that were not measured are `null`, and so are those that JSON cannot express: the PSNR of two equal images is
//! infinite.

use super::{Machine, PlaybackRun, percentile};
use crate::stats::FrameStats;
use serde::{Deserialize, Serialize};

/// [`RunError::judge`] of errors against the f64 reference renderer.
pub const JUDGE_REFERENCE: &str = "reference";

/// Everything that a benchmark has measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchReport {
    /// Where.
    pub machine: Machine,
    /// What.
    pub runs: Vec<BenchRun>,
    /// How playing compares with standing still.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub playback: Vec<PlaybackRun>,
}

/// One combination of data and settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchRun {
    /// Name of the data set.
    pub dataset: String,
    /// Cells of its mesh.
    pub cells: u64,
    /// Vertices of its mesh.
    pub vertices: u64,
    /// Number of cameras the frames are spread over.
    pub viewpoints: usize,
    /// Whether the step changes from frame to frame.
    pub time_moves: bool,
    /// Whether the camera changes from frame to frame.
    pub camera_moves: bool,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// `cpu` or `gpu`.
    pub backend: String,
    /// `raycast`, `havs` or `reference`.
    pub mode: String,
    /// Level of detail: fraction of the interior faces that is drawn.
    pub lod: f64,
    /// `exact`, `table3d` or `partial`.
    pub optics: String,
    /// `raw`, `vq` or `bounded`.
    pub codec: String,
    /// Whether cells that cannot be seen are skipped.
    pub skip: bool,
    /// Threads in use.
    pub threads: usize,
    /// Times.
    pub ms: RunTimes,
    /// Frames per second: 1000 / `ms.frame`.
    pub fps: f64,
    /// Cells per second: `cells` times `fps`.
    pub cells_per_s: f64,
    /// How wrong the frames are; `None` if that was not measured.
    pub error: Option<RunError>,
    /// Counts of one typical frame.
    pub stats: FrameStats,
}

/// Milliseconds a frame takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunTimes {
    /// Mean from request to image.
    pub frame: f64,
    /// Mean of decoding.
    pub decode: f64,
    /// Mean of ordering.
    pub order: f64,
    /// Mean of rendering.
    pub render: f64,
    /// Median frame (nearest rank).
    pub p50: f64,
    /// The frame that 95 % are not slower than (nearest rank).
    pub p95: f64,
}

/// How wrong frames are, on raw accumulators, all pixels, no background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunError {
    /// Root mean square over pixels and channels.
    pub rmse: f64,
    /// Largest absolute difference.
    pub max: f64,
    /// Peak signal-to-noise ratio in decibels; `None` for equal images.
    pub psnr: Option<f64>,
    /// FLIP; `None` if it was not measured.
    pub flip: Option<f64>,
    /// What the frames were compared with.
    pub judge: String,
}

impl RunTimes {
    /// Means and percentiles over frames; all 0 without frames.
    pub fn of(frames: &[FrameStats]) -> Self {
        if frames.is_empty() {
            return Self::default();
        }
        let mean = |ms: fn(&FrameStats) -> f64| frames.iter().map(ms).sum::<f64>() / frames.len() as f64;
        let all: Vec<f64> = frames.iter().map(|f| f.ms_frame).collect();
        Self {
            frame: mean(|f| f.ms_frame),
            decode: mean(|f| f.ms_decode),
            order: mean(|f| f.ms_order),
            render: mean(|f| f.ms_render),
            p50: percentile(&all, 50.0),
            p95: percentile(&all, 95.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run() -> BenchRun {
        BenchRun {
            dataset: "jet".to_owned(),
            cells: 1000,
            vertices: 300,
            viewpoints: 2,
            time_moves: true,
            camera_moves: false,
            size: [640, 480],
            backend: "cpu".to_owned(),
            mode: "raycast".to_owned(),
            lod: 1.0,
            optics: "exact".to_owned(),
            codec: "raw".to_owned(),
            skip: true,
            threads: 2,
            ms: RunTimes { frame: 20.0, decode: 1.0, order: 2.0, render: 17.0, p50: 19.0, p95: 25.0 },
            fps: 50.0,
            cells_per_s: 50_000.0,
            error: Some(RunError { rmse: 0.0, max: 0.0, psnr: None, flip: None, judge: JUDGE_REFERENCE.to_owned() }),
            stats: FrameStats::default(),
        }
    }

    #[test]
    fn the_json_has_the_documented_keys_and_reads_back() {
        let report = BenchReport { machine: Machine::detect(), runs: vec![run()], playback: Vec::new() };
        let json = serde_json::to_value(&report).unwrap();
        let sorted = |mut names: Vec<String>| {
            names.sort();
            names
        };
        let keys = |value: &serde_json::Value| sorted(value.as_object().unwrap().keys().cloned().collect());
        let listed = |text: &str| sorted(text.split_whitespace().map(str::to_owned).collect());
        assert_eq!(keys(&json), listed("machine runs"));
        assert_eq!(keys(&json["machine"]), listed("cpu cores adapter"));
        let run = &json["runs"][0];
        let documented = "dataset cells vertices viewpoints time_moves camera_moves size backend mode lod optics codec skip \
            threads ms fps cells_per_s error stats";
        assert_eq!(keys(run), listed(documented));
        assert_eq!(keys(&run["ms"]), listed("frame decode order render p50 p95"));
        assert_eq!(keys(&run["error"]), listed("rmse max psnr flip judge"));
        assert!(run["error"]["psnr"].is_null());
        assert_eq!(serde_json::from_value::<BenchReport>(json).unwrap(), report);
    }

    #[test]
    fn times_are_means_and_ranks_of_the_frames() {
        let frame = |ms| FrameStats { ms_frame: ms, ms_decode: ms / 2.0, ..FrameStats::default() };
        let times = RunTimes::of(&[frame(1.0), frame(2.0), frame(9.0)]);
        assert_eq!((times.frame, times.decode, times.p50, times.p95), (4.0, 2.0, 2.0, 9.0));
        assert_eq!(RunTimes::of(&[frame(5.0)]).p95, 5.0);
        assert_eq!(RunTimes::of(&[]), RunTimes::default());
    }
}

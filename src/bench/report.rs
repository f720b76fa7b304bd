//! The record of a benchmark, as JSON.
//!
//! Figures that were not measured are `null`, and so are those that JSON cannot express: the PSNR of two equal images is infinite.

use super::accuracy::IntegrationRun;
use super::{HeldRun, Machine, PlaybackRun, PointsRun, StillRun, percentile};
use crate::image::{RgbaImage, compare};
use crate::render::functions::SheetSpacing;
use crate::stats::FrameStats;
use serde::{Deserialize, Serialize};
use std::fmt;

/// [`RunError::judge`] of errors against the f64 reference renderer.
pub const JUDGE_REFERENCE: &str = "reference";
/// [`RunError::judge`] of errors against the f64 integration of the table, if a request does not carry its formula.
pub const JUDGE_TABLE: &str = "reference-table";
/// [`RunError::judge`] of errors against the f64 reference renderer with the uncompressed values.
pub const JUDGE_RAW: &str = "reference of raw values";

/// The record of a benchmark.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchReport {
    /// The machine.
    pub machine: Machine,
    /// The measured runs.
    pub runs: Vec<BenchRun>,
    /// The cost of moving time (playback suite).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub playback: Vec<PlaybackRun>,
    /// How well a frame rate is held while camera and time move (motion suite).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held: Vec<HeldRun>,
    /// Reuse of details of earlier steps (motion suite).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub still: Vec<StillRun>,
    /// Cells as points in all their ways (points suite).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<PointsRun>,
    /// Errors of integrating one segment (accuracy suite).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub integration: Vec<IntegrationRun>,
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
    /// Number of cameras over which the frames are spread.
    pub viewpoints: usize,
    /// Whether the step changes from frame to frame.
    pub time_moves: bool,
    /// Whether the camera changes from frame to frame.
    pub camera_moves: bool,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// `cpu` or `gpu`.
    pub backend: String,
    /// `raycast`, `havs`, `reference` (by the formula of the transfer function) or `reference-table` (by its table).
    pub mode: String,
    /// Level of detail: fraction of the interior faces that is drawn.
    pub lod: f64,
    /// `exact`, `table3d` or `partial`.
    pub optics: String,
    /// `raw`, `vq` or `bounded`.
    pub codec: String,
    /// Whether invisible cells are skipped.
    pub skip: bool,
    /// Size of the k-buffer; `None` without faces.
    #[serde(default)]
    pub k: Option<u8>,
    /// Whether fragments out of order are corrected; `None` without faces.
    #[serde(default)]
    pub exact_order: Option<bool>,
    /// How far sheets are apart; `None` without functions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheets: Option<SheetSpacing>,
    /// Entries of the pre-integrated table along a scalar axis; `None` without a table.
    #[serde(default)]
    pub table_size: Option<usize>,
    /// Scale of the rendered image before it was enlarged to `size`.
    #[serde(default = "whole")]
    pub image_scale: f64,
    /// Upsampling filter; `None` at full size, and for bilinear in older reports.
    #[serde(default)]
    pub upsample: Option<String>,
    /// The contrast that decided which rays were cast; `None` if all were.
    #[serde(default)]
    pub contrast: Option<f64>,
    /// Compression ratio: bytes of the values as f32 over those in the store; `None` if not determined.
    #[serde(default)]
    pub ratio: Option<f64>,
    /// Scene of the run, if all paths share it (accuracy suite).
    #[serde(default)]
    pub scene: Option<SceneName>,
    /// Threads in use.
    pub threads: usize,
    /// Times.
    pub ms: RunTimes,
    /// Frames per second: 1000 / `ms.frame`.
    pub fps: f64,
    /// Cells per second: `cells` times `fps`.
    pub cells_per_s: f64,
    /// Error of the frames; `None` if not measured.
    pub error: Option<RunError>,
    /// Counts of one typical frame.
    pub stats: FrameStats,
}

fn whole() -> f64 {
    1.0
}

/// A scene of the accuracy suite.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneName {
    /// The data set whose values are the truth.
    pub series: String,
    /// Name of the transfer function.
    pub transfer_function: String,
    /// Zero-based step.
    pub step: usize,
    /// Name of the view.
    pub view: String,
}

impl fmt::Display for SceneName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}, step {}, {}", self.series, self.transfer_function, self.step, self.view)
    }
}

/// Milliseconds per frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunTimes {
    /// Mean from request to image.
    pub frame: f64,
    /// Mean of decoding.
    pub decode: f64,
    /// Mean of ordering.
    pub order: f64,
    /// Mean of placing in the view; 0 in older reports, which count it in `order` (CPU).
    #[serde(default)]
    pub place: f64,
    /// Mean of rendering, set-up included.
    pub render: f64,
    /// Median frame (nearest rank).
    pub p50: f64,
    /// 95th percentile (nearest rank).
    pub p95: f64,
}

/// Error of frames, on raw accumulators, all pixels, no background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunError {
    /// Root mean square over pixels and channels.
    pub rmse: f64,
    /// Largest absolute difference.
    pub max: f64,
    /// Peak signal-to-noise ratio in decibels; `None` for equal images.
    pub psnr: Option<f64>,
    /// FLIP; `None` if not measured.
    pub flip: Option<f64>,
    /// Mean distance of colours over black, on a scale of 0 to 255, over the pixels: the dissertation's unit of error; `None` if not
    /// measured.
    #[serde(default)]
    pub distance: Option<f64>,
    /// Name of the judge.
    pub judge: String,
}

impl RunError {
    /// The error of `image` against `truth`. Images that cannot be compared (different sizes, or not finite) have the largest error.
    pub fn between(truth: &RgbaImage, image: &RgbaImage, judge: &str) -> Self {
        let wrong =
            Self { rmse: f64::MAX, max: f64::MAX, psnr: None, flip: None, distance: None, judge: judge.to_owned() };
        compare(truth, image, [0.0; 3]).map_or(wrong.clone(), |m| Self {
            rmse: m.rmse,
            max: m.max,
            psnr: m.psnr.is_finite().then_some(m.psnr),
            flip: Some(m.flip),
            distance: Some(mean_distance(truth, image)),
            ..wrong
        })
    }
}

/// Mean distance of colours over black, on a scale of 0 to 255, over the pixels of two images of equal size.
fn mean_distance(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let distance = |(a, b): (&[f32; 4], &[f32; 4])| {
        let square = |c: usize| (f64::from(a[c]) - f64::from(b[c])).powi(2);
        255.0 * (square(0) + square(1) + square(2)).sqrt()
    };
    a.pixels.iter().zip(&b.pixels).map(distance).sum::<f64>() / a.pixels.len().max(1) as f64
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
            place: mean(|f| f.ms_place),
            render: mean(|f| f.ms_begin + f.ms_render),
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
            sheets: None,
            k: Some(8),
            exact_order: Some(true),
            table_size: None,
            image_scale: 0.5,
            upsample: Some("joint".to_owned()),
            contrast: None,
            ratio: Some(12.5),
            scene: Some(SceneName {
                series: "jet".to_owned(),
                transfer_function: "dense".to_owned(),
                step: 3,
                view: "front".to_owned(),
            }),
            threads: 2,
            ms: RunTimes { frame: 20.0, decode: 1.0, order: 2.0, place: 3.0, render: 14.0, p50: 19.0, p95: 25.0 },
            fps: 50.0,
            cells_per_s: 50_000.0,
            error: Some(RunError {
                rmse: 0.0,
                max: 0.0,
                psnr: None,
                flip: None,
                distance: None,
                judge: JUDGE_REFERENCE.to_owned(),
            }),
            stats: FrameStats::default(),
        }
    }

    #[test]
    fn the_json_has_the_documented_keys_and_reads_back() {
        let report = BenchReport {
            machine: Machine::detect(),
            runs: vec![run()],
            playback: Vec::new(),
            held: Vec::new(),
            still: Vec::new(),
            points: Vec::new(),
            integration: Vec::new(),
        };
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
        let documented = "dataset cells vertices viewpoints time_moves camera_moves size backend mode lod optics codec skip k \
            exact_order table_size image_scale upsample contrast ratio scene threads ms fps cells_per_s error stats";
        assert_eq!(keys(run), listed(documented));
        assert_eq!(keys(&run["ms"]), listed("frame decode order place render p50 p95"));
        assert_eq!(keys(&run["error"]), listed("rmse max psnr flip distance judge"));
        assert_eq!(keys(&run["scene"]), listed("series transfer_function step view"));
        assert!(run["error"]["psnr"].is_null());
        assert_eq!(serde_json::from_value::<BenchReport>(json).unwrap(), report);
    }

    #[test]
    fn a_record_from_before_the_accuracy_suite_still_reads() {
        let mut json = serde_json::to_value(run()).unwrap();
        for key in ["k", "exact_order", "table_size", "image_scale", "upsample", "contrast", "ratio", "scene"] {
            json.as_object_mut().unwrap().remove(key);
        }
        let old: BenchRun = serde_json::from_value(json).unwrap();
        assert_eq!((old.k, old.image_scale, old.scene), (None, 1.0, None));
    }

    #[test]
    fn errors_are_those_of_the_images_and_what_cannot_be_compared_is_wrong() {
        let truth = RgbaImage::new(4, 2);
        let mut image = truth.clone();
        image.pixels[3][1] = 0.25;
        let error = RunError::between(&truth, &image, JUDGE_RAW);
        // One channel in 32 differs.
        assert_eq!((error.max, error.rmse, error.judge.as_str()), (0.25, (0.0625_f64 / 32.0).sqrt(), JUDGE_RAW));
        assert_eq!(RunError::between(&truth, &truth, JUDGE_RAW).psnr, None);
        assert_eq!(RunError::between(&truth, &RgbaImage::new(2, 4), JUDGE_RAW).rmse, f64::MAX);
        image.pixels[0][0] = f32::NAN;
        assert_eq!(RunError::between(&truth, &image, JUDGE_RAW).max, f64::MAX);
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

//! The frame and accuracy suites: time and error of frames.

use super::{BenchRun, JUDGE_REFERENCE, JUDGE_TABLE, RunError, RunTimes};
use crate::optics::OpticsKind;
use crate::optics::table3d::Table3dResolution;
use crate::pipeline::{DrawnBy, FrameRequest, Pipeline, PipelineError};
use crate::stats::FrameStats;
use crate::task::{Cancel, Progress};

/// What changes from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motion {
    /// The step advances.
    pub time: bool,
    /// The camera turns around the focal point.
    pub camera: bool,
}

/// The three kinds of motion.
pub const MOTIONS: [Motion; 3] =
    [Motion { time: true, camera: false }, Motion { time: true, camera: true }, Motion { time: false, camera: true }];

/// Degrees that a moving camera turns from frame to frame.
const TURN_DEG: f64 = 5.625;

/// Untimed frames before the clock starts.
const WARM_UP: usize = 2;

/// Input of a run.
#[derive(Clone, Debug)]
pub struct FrameBench {
    /// Name of the data set.
    pub dataset: String,
    /// Request of the first frame; others differ in what moves.
    pub request: FrameRequest,
    /// What moves.
    pub motion: Motion,
    /// Number of measured frames.
    pub frames: usize,
    /// Whether every eighth frame is compared with the reference, untimed.
    pub judged: bool,
}

/// Interval of judged frames.
const JUDGE_EVERY: usize = 8;

/// Renders and measures the frames of a run; `progress` is told of each.
///
/// # Errors
/// If a step cannot be read, a camera has no view, or `cancel` was raised.
pub fn run_frames(
    pipeline: &mut Pipeline,
    bench: &FrameBench,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<BenchRun, PipelineError> {
    let mut measured: Vec<FrameStats> = Vec::with_capacity(bench.frames);
    let mut worst: Option<RunError> = None;
    for index in 0..WARM_UP + bench.frames {
        let request = request_of(pipeline, bench, index)?;
        let frame = pipeline.render_unless(&request, cancel)?;
        if index < WARM_UP {
            continue;
        }
        measured.push(frame.stats.clone());
        if bench.judged && (index - WARM_UP).is_multiple_of(JUDGE_EVERY) {
            let fast = frame.planes.color.clone();
            let judge = pipeline.render_unless(&judge_of(&request), cancel)?;
            let judged_by = if judge.stats.by_formula { JUDGE_REFERENCE } else { JUDGE_TABLE };
            let error = RunError::between(&judge.planes.color, &fast, judged_by);
            worst = Some(match worst {
                Some(w) if w.rmse >= error.rmse => RunError { max: w.max.max(error.max), ..w },
                Some(w) => RunError { max: w.max.max(error.max), ..error },
                None => error,
            });
        }
        progress.advance(1);
    }
    Ok(BenchRun {
        viewpoints: if bench.motion.camera { bench.frames } else { 1 },
        time_moves: bench.motion.time,
        camera_moves: bench.motion.camera,
        error: worst,
        ..describe(pipeline, &bench.dataset, &bench.request, &measured)
    })
}

/// The request of frame `index`.
fn request_of(pipeline: &Pipeline, bench: &FrameBench, index: usize) -> Result<FrameRequest, PipelineError> {
    let mut request = bench.request.clone();
    if bench.motion.time {
        request.time = ((request.time.step() + index) % pipeline.times().len().max(1)).into();
    }
    if bench.motion.camera {
        request.camera = request.camera.orbit(TURN_DEG * index as f64, 0.0)?;
    }
    Ok(request)
}

/// The request of a frame by the float64 reference.
fn judge_of(request: &FrameRequest) -> FrameRequest {
    request.clone().with_tets(|tets| tets.draw = tets.draw.judge())
}

/// The record of a request's frames, without motion and error.
pub(super) fn describe(
    pipeline: &Pipeline,
    dataset: &str,
    request: &FrameRequest,
    measured: &[FrameStats],
) -> BenchRun {
    let ms = RunTimes::of(measured);
    let fps = if ms.frame > 0.0 { 1e3 / ms.frame } else { 0.0 };
    let mesh = pipeline.mesh();
    let cells = mesh.topology.tets.len() as u64;
    let tets = request.tets();
    let drawn_by = tets.map_or(DrawnBy::Raycast, |tets| tets.draw.drawn_by());
    let k_buffer = drawn_by.faces().map(|detail| detail.k_buffer);
    // The reference integrates exactly, whatever was requested.
    let optics = tets.filter(|_| !drawn_by.is_reference()).map_or(OpticsKind::Exact, |tets| tets.optics);
    BenchRun {
        dataset: dataset.to_owned(),
        cells,
        vertices: mesh.positions.local.len() as u64,
        viewpoints: 1,
        time_moves: false,
        camera_moves: false,
        size: [request.size_px.0 as u32, request.size_px.1 as u32],
        backend: if measured.iter().any(|stats| stats.on_gpu) { "gpu" } else { "cpu" }.to_owned(),
        mode: match drawn_by {
            DrawnBy::Reference | DrawnBy::Judge if !measured.iter().all(|stats| stats.by_formula) => "reference-table",
            by => by.name(),
        }
        .to_owned(),
        lod: request.lod(),
        optics: optics.to_string(),
        codec: pipeline.field().codec.clone(),
        skip: request.skip.transparent_cells && !drawn_by.is_reference(),
        k: k_buffer.map(|buffer| buffer.k),
        exact_order: k_buffer.map(|buffer| buffer.exact_order),
        sheets: match drawn_by {
            DrawnBy::Sheets(style) => Some(style.spacing),
            _ => None,
        },
        table_size: (optics == OpticsKind::Table3d).then_some(Table3dResolution::default().scalars),
        image_scale: request.upsampling.map_or(1.0, |of| 1.0 / of.scale.factor() as f64),
        upsample: request.upsampling.map(|of| of.filter.kind().to_string()),
        contrast: request.samples.contrast().map(|contrast| f64::from(contrast.get())),
        ratio: None,
        scene: None,
        threads: rayon::current_num_threads(),
        ms,
        fps,
        cells_per_s: cells as f64 * fps,
        error: None,
        stats: measured.get(measured.len() / 2).cloned().unwrap_or_default(),
    }
}

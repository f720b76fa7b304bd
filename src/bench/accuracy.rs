//! The accuracy suite: the error of every path from scalars to pixels against the judge, and its time, on the same scenes.
//!
//! A *path* ([`AccuracyPath`]) is one choice of renderer, backend, optics, level of detail, k-buffer and image scale; [`paths`] lists them.
//! A *scene* ([`AccuracyScene`]) is a step, a camera and a transfer function. The judge, the float64 reference at full size, renders each
//! scene once ([`judge`]); all paths, and all codecs of the same values, are compared with these images ([`run_accuracy`]).
//!
//! Frames are timed without reuse of the previous frame ([`Skip::unchanged`] off): each pays for decode, order and render, and the timed
//! frame is the judged one. Data made once per mesh or transfer function (face rankings, pre-integrated tables, GPU pipelines) is made
//! before the clock starts.

mod equal_time;
mod integration;
mod paths;
mod scenes;
mod summary;

pub use equal_time::{BUDGETS, Curves, EqualTime, EqualTimeTable, Family, Setting, curves, equal_time};
pub use integration::{IntegrationRun, IntegrationTable, LENGTH_DECADES, integration_errors};
pub use paths::{
    AccuracyPath, CODEC_PATHS, IMAGE_SCALES, KS, LODS, SHEET_COUNTS, SHEET_ERRORS, TABLE_SIZES, function_paths,
    on_backends, paths,
};
pub use scenes::{AccuracyScene, TRANSFER_FUNCTIONS, VIEWS, View, scenes};
pub(in crate::bench) use summary::is_judged_by;
pub use summary::{AccuracyTable, PathSummary, front_of, path_label, summaries};
#[cfg(feature = "cli")]
pub(in crate::bench) use summary::{series_of, transfer_functions_of};

use super::frames::describe;
use super::report::{BenchRun, RunError};
use crate::image::RgbaImage;
use crate::optics::OpticsKind;
use crate::optics::table3d::Table3dResolution;
use crate::pipeline::{
    FrameRequest, Pipeline, PipelineError, RenderMode, Representation, SampleSet, TetDraw, TetLayer,
};
use crate::render::cpu::raycast::Raycast;
use crate::render::functions::SheetStyle;
use crate::render::points::PointStyle;
use crate::render::{Frame, RenderError, RenderJob, Renderer};
use crate::stats::FrameStats;
use crate::task::{Cancel, Progress};
use crate::visibility::Skip;

/// Scenes with their reference images.
#[derive(Clone, Debug)]
pub struct Judged {
    /// What the judge drew: the truth for paths of cells or of functions.
    pub representation: Representation,
    /// The scenes.
    pub scenes: Vec<AccuracyScene>,
    /// The judge's image of each, at full size.
    pub images: Vec<RgbaImage>,
    /// The judge's statistics of each scene.
    pub stats: Vec<FrameStats>,
}

/// Renders every scene with the judge of cells or functions; `progress` is told of each.
///
/// # Errors
/// If a step cannot be read, a camera has no view, or `cancel` was raised.
pub fn judge(
    pipeline: &mut Pipeline,
    scenes: Vec<AccuracyScene>,
    representation: Representation,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Judged, PipelineError> {
    let (mut images, mut stats) = (Vec::new(), Vec::new());
    for scene in &scenes {
        let request = scene.judged(representation);
        let frame = pipeline.render_unless(&request, cancel)?;
        images.push(frame.planes.color.clone());
        stats.push(frame.stats.clone());
        progress.advance(1);
    }
    Ok(Judged { representation, scenes, images, stats })
}

impl AccuracyScene {
    /// The request of the judge.
    fn judged(&self, representation: Representation) -> FrameRequest {
        let draw = TetDraw::Reference.of(representation);
        FrameRequest { skip: ALONE, ..self.request.clone().with_draw(draw) }
    }
}

/// All skipping except reuse of the previous frame.
const ALONE: Skip = Skip { unchanged: false, ..Skip::ALL };

/// Input of the suite for one series.
#[derive(Clone, Copy, Debug)]
pub struct AccuracyBench<'a> {
    /// Name of the data set.
    pub dataset: &'a str,
    /// The scenes and their reference images.
    pub judged: &'a Judged,
    /// Values that the judge rendered: [`JUDGE_REFERENCE`](super::JUDGE_REFERENCE) for those of this series,
    /// [`JUDGE_RAW`](super::JUDGE_RAW) for those before compression.
    pub judge: &'a str,
    /// The paths to measure.
    pub paths: &'a [AccuracyPath],
    /// Timed frames of each path and scene, at least one.
    pub frames: usize,
    /// Compression ratio: bytes of the values as f32 over those in the store.
    pub ratio: Option<f64>,
}

/// Results of the suite for one series.
#[derive(Clone, Debug, Default)]
pub struct AccuracyRuns {
    /// A run for each path and scene, path by path.
    pub runs: Vec<BenchRun>,
    /// Paths that the GPU rejected, and why.
    pub refused: Vec<String>,
}

/// Renders every scene on every path; `progress` is told of each path and scene.
///
/// # Errors
/// If a step cannot be read, a device fails, or `cancel` was raised. Paths beyond a GPU's limits are reported as refused.
pub fn run_accuracy(
    pipeline: &mut Pipeline,
    bench: &AccuracyBench<'_>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<AccuracyRuns, PipelineError> {
    let mut measured = AccuracyRuns::default();
    for path in bench.paths {
        let mut renderer = path.own_table().map(Raycast::with_table3d_resolution);
        for (scene, truth) in bench.judged.scenes.iter().zip(&bench.judged.images) {
            match run_path(pipeline, renderer.as_mut(), bench, (path, scene, truth), cancel) {
                Ok(run) => measured.runs.push(run),
                Err(PipelineError::Render(error @ RenderError::BeyondGpu { .. })) => {
                    measured.refused.push(format!("{}, {}: {error}", path.mode_name(), scene.name));
                }
                Err(error) => return Err(error),
            }
            progress.advance(1);
        }
    }
    Ok(measured)
}

/// The runs of the judge itself, for its times. They have no error.
pub fn judge_runs(pipeline: &Pipeline, bench: &AccuracyBench<'_>) -> Vec<BenchRun> {
    let runs = bench.judged.scenes.iter().zip(&bench.judged.stats).map(|(scene, stats)| {
        let request = scene.judged(bench.judged.representation);
        let run = describe(pipeline, bench.dataset, &request, std::slice::from_ref(stats));
        BenchRun { scene: Some(scene.name.clone()), ratio: bench.ratio, ..run }
    });
    runs.collect()
}

/// Measures one path on one scene.
fn run_path(
    pipeline: &mut Pipeline,
    mut own: Option<&mut Raycast>,
    bench: &AccuracyBench<'_>,
    (path, scene, truth): (&AccuracyPath, &AccuracyScene, &RgbaImage),
    cancel: &Cancel,
) -> Result<BenchRun, PipelineError> {
    let request = path.request(&scene.request);
    let mut measured: Vec<FrameStats> = Vec::with_capacity(bench.frames);
    let mut error = None;
    // One more frame, which fills caches; it is the one compared, as all are equal. The reference has no caches and is slow.
    let is_once = path.mode == RenderMode::Reference;
    for index in 0..=if is_once { 0 } else { bench.frames.max(1) } {
        let frame = match &mut own {
            Some(renderer) => render_with(pipeline, renderer, &request, path.optics, cancel)?,
            None => pipeline.render_unless(&request, cancel)?,
        };
        if index == 0 {
            error = Some(RunError::between(truth, &frame.planes.color, bench.judge));
        }
        if index > 0 || is_once {
            measured.push(frame.stats.clone());
        }
    }
    let run = describe(pipeline, bench.dataset, &request, &measured);
    Ok(BenchRun { table_size: path.table_size(), scene: Some(scene.name.clone()), ratio: bench.ratio, error, ..run })
}

/// Renders a request with one of our renderers and these optics.
fn render_with<'a>(
    pipeline: &mut Pipeline,
    renderer: &'a mut Raycast,
    request: &FrameRequest,
    optics: OpticsKind,
    cancel: &Cancel,
) -> Result<&'a Frame, PipelineError> {
    // The renderer brings its own table: the pipeline's is not needed.
    let plain = request.clone().with_tets(|tets| tets.optics = OpticsKind::Exact);
    let job = RenderJob { optics, ..pipeline.prepare_unless(&plain, cancel)? };
    renderer.render_unless_cancelled(job)?.ok_or(PipelineError::Cancelled)
}

impl AccuracyPath {
    /// The request for a scene on this path.
    fn request(&self, scene: &FrameRequest) -> FrameRequest {
        // Transparent cells are known only for the pipeline's own table.
        let knows_transparent = self.own_table().is_none();
        let with_path = |tets: &mut TetLayer| {
            (tets.draw, tets.optics) = (TetDraw::chosen(self.mode, self.faces(), PointStyle::EXACT), self.optics);
            tets.draw = tets.draw.with_sheets(SheetStyle { spacing: self.sheets });
            tets.formula.take_if(|_| self.mode == RenderMode::Reference);
        };
        FrameRequest {
            backend: self.backend,
            samples: self.contrast.map_or(SampleSet::All, |contrast| SampleSet::Adaptive { contrast }),
            upsampling: self.upsampling,
            skip: Skip { transparent_cells: knows_transparent, transparent_chunks: knows_transparent, ..ALONE },
            ..scene.clone().with_tets(with_path)
        }
    }

    /// The resolution of the pre-integrated table, if it differs from the pipeline's.
    fn own_table(&self) -> Option<Table3dResolution> {
        let default = Table3dResolution::default();
        let scalars = self.table_size().filter(|&size| size != default.scalars)?;
        Some(Table3dResolution { scalars, ..default })
    }
}

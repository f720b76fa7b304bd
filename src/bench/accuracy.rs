//! The accuracy suite: every path from scalars to pixels against the judge, on the same scenes, milliseconds beside error.
//!
//! A *path* ([`AccuracyPath`]) is one choice of renderer, backend, optics, level of detail, buffer and image scale; the list
//! of them is data ([`paths`]). A *scene* ([`AccuracyScene`]) is a step, a camera and a transfer function. The judge, the
//! float64 reference at full size, renders each scene once ([`judge`]); all paths, and all codecs of the same values, are
//! compared with these images ([`run_accuracy`]).
//!
//! A frame is timed as if it shared nothing with the one before ([`Skip::unchanged`] off): decode, order and render are all
//! paid, and the frame timed is the one that is judged. What is made once for a mesh or a transfer function (rankings of
//! faces, pre-integrated tables, pipelines of a GPU) is made before the clock starts.

mod equal_time;
mod integration;
mod paths;
mod scenes;
mod summary;

pub use equal_time::{BUDGETS, Curves, EqualTime, EqualTimeTable, Family, Setting, curves, equal_time};
pub use integration::{IntegrationRun, IntegrationTable, LENGTH_DECADES, integration_errors};
pub use paths::{AccuracyPath, CODEC_PATHS, IMAGE_SCALES, KS, LODS, TABLE_SIZES, on_backends, paths};
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
use crate::pipeline::{FrameRequest, Pipeline, PipelineError, RenderMode, SampleSet, TetDraw, TetLayer};
use crate::render::cpu::raycast::Raycast;
use crate::render::{Frame, RenderError, RenderJob, Renderer};
use crate::stats::FrameStats;
use crate::task::{Cancel, Progress};
use crate::visibility::Skip;

/// Scenes and what they should look like.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The scenes.
    pub scenes: Vec<AccuracyScene>,
    /// The judge's image of each, at full size.
    pub images: Vec<RgbaImage>,
    /// What the judge paid for each.
    pub stats: Vec<FrameStats>,
}

/// Renders every scene with the judge; `progress` hears of each.
///
/// # Errors
/// If a step cannot be read, there is no view through a camera, or `cancel` was raised.
pub fn judge(
    pipeline: &mut Pipeline,
    scenes: Vec<AccuracyScene>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Judged, PipelineError> {
    let (mut images, mut stats) = (Vec::new(), Vec::new());
    for scene in &scenes {
        let request = FrameRequest { skip: ALONE, ..scene.request.clone().with_draw(TetDraw::Reference) };
        let frame = pipeline.render_unless(&request, cancel)?;
        images.push(frame.planes.color.clone());
        stats.push(frame.stats.clone());
        progress.advance(1);
    }
    Ok(Judged { scenes, images, stats })
}

/// Everything may be left out that the image does not need, but for what is known from the frame before.
const ALONE: Skip = Skip { unchanged: false, ..Skip::ALL };

/// What the suite measures of one series.
#[derive(Clone, Copy, Debug)]
pub struct AccuracyBench<'a> {
    /// Name of the data set.
    pub dataset: &'a str,
    /// The scenes, and what they should look like.
    pub judged: &'a Judged,
    /// What the judge has seen: [`JUDGE_REFERENCE`](super::JUDGE_REFERENCE) for the values of this series,
    /// [`JUDGE_RAW`](super::JUDGE_RAW) for those that it was compressed from.
    pub judge: &'a str,
    /// The paths to measure.
    pub paths: &'a [AccuracyPath],
    /// Frames timed of each path and scene, at least one.
    pub frames: usize,
    /// Bytes of the values as f32 over those in the store.
    pub ratio: Option<f64>,
}

/// What the suite has measured of one series.
#[derive(Clone, Debug, Default)]
pub struct AccuracyRuns {
    /// A run for each path and scene, path by path.
    pub runs: Vec<BenchRun>,
    /// Paths that the GPU refused, and why.
    pub refused: Vec<String>,
}

/// Renders every scene on every path; `progress` hears of each path and scene.
///
/// # Errors
/// If a step cannot be read, a device fails, or `cancel` was raised. What is beyond a GPU is no error, but refused.
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

/// The runs of the judge itself, for the record: what being right costs. They have no error, being compared with nothing.
pub fn judge_runs(pipeline: &Pipeline, bench: &AccuracyBench<'_>) -> Vec<BenchRun> {
    let runs = bench.judged.scenes.iter().zip(&bench.judged.stats).map(|(scene, stats)| {
        let request = FrameRequest { skip: ALONE, ..scene.request.clone().with_draw(TetDraw::Reference) };
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
    // One more, in which caches are filled; it is the one compared, as all of them are the same. The reference has no caches, nor haste.
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

/// The frame of a request from a renderer of ours, with these optics.
fn render_with<'a>(
    pipeline: &mut Pipeline,
    renderer: &'a mut Raycast,
    request: &FrameRequest,
    optics: OpticsKind,
    cancel: &Cancel,
) -> Result<&'a Frame, PipelineError> {
    // The table is the renderer's: the one of the product is not needed.
    let plain = request.clone().with_tets(|tets| tets.optics = OpticsKind::Exact);
    let job = RenderJob { optics, ..pipeline.prepare_unless(&plain, cancel)? };
    renderer.render_unless_cancelled(job)?.ok_or(PipelineError::Cancelled)
}

impl AccuracyPath {
    /// The request for a scene on this path.
    fn request(&self, scene: &FrameRequest) -> FrameRequest {
        // Which cells are transparent is known for the product's own table only.
        let knows_transparent = self.own_table().is_none();
        let with_path = |tets: &mut TetLayer| {
            (tets.draw, tets.optics) = (TetDraw::chosen(self.mode, self.faces()), self.optics);
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

    /// The resolution of the pre-integrated table, if it is not the product's.
    fn own_table(&self) -> Option<Table3dResolution> {
        let default = Table3dResolution::default();
        let scalars = self.table_size().filter(|&size| size != default.scalars)?;
        Some(Table3dResolution { scalars, ..default })
    }
}

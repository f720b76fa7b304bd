//! [`Run`]: exports frames of a scene to image files or to a movie, for the command line, a dialog or a server.

mod frames;
mod memory;
mod options;
mod plan;
mod resume;
mod sink;
mod summary;
mod target;

pub use frames::picture;
pub use memory::check_memory;
pub use options::{Naming, OptionsError, RunOptions, SIZE_MAX_PX, parse_size};
pub use plan::{Held, Plan, PlanError, PlannedFrame, Times, parse_angle, parse_duration, parse_times};
pub use target::{Target, pattern_in};

use super::Written;
use super::annotate::Annotator;
use super::movie::{Ffmpeg, MovieError, MovieOptions, MovieWriter};
use super::sequence::{FramePattern, FrameWriter};
use super::still::{FrameAttributes, StillFormat, StillOptions};
use crate::camera::CameraError;
use crate::error::{FileError, FileResult};
use crate::field::FieldSelector;
use crate::files;
use crate::pipeline::{
    FrameRequest, Pipeline, PipelineError, PipelinedOptions, RequestError, UpsampleFilter, Upsampling,
};
use crate::render::RenderError;
use crate::scene::{Scene, SceneError};
use crate::short::Short;
use crate::stats::FrameStats;
use crate::task::Progress;
use frames::Job;
use resume::Fingerprints;
use serde::Serialize;
use sink::Sink;
use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;

/// The frames to render, and their output.
#[derive(Clone, Debug)]
pub struct Run {
    /// The frames to render.
    pub plan: Plan,
    /// The files to write.
    pub output: Output,
    /// Draws annotations over all frames.
    pub annotator: Option<Annotator>,
    /// Whether existing images of the same request are kept.
    pub resume: bool,
    /// Whether other files at the places of the output are replaced.
    pub replaces: bool,
    /// Threads that render.
    pub threads: PipelinedOptions,
    /// Counts the bytes of the files.
    pub written: Written,
}

/// Format of the files.
#[derive(Clone, Debug)]
pub enum Output {
    /// Images, numbered or a single one.
    Images {
        /// File name pattern.
        pattern: FramePattern,
        /// How the images are written.
        options: StillOptions,
    },
    /// A movie.
    Movie {
        /// Path of the movie.
        path: PathBuf,
        /// The encoder.
        ffmpeg: Ffmpeg,
        /// Size, frame rate, background and texts.
        options: MovieOptions,
    },
}

impl Output {
    /// The file of a frame.
    pub fn path(&self, frame: usize) -> PathBuf {
        match self {
            Self::Images { pattern, .. } => pattern.path(frame),
            Self::Movie { path, .. } => path.clone(),
        }
    }
}

/// Origin of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// The frame was rendered.
    Rendered,
    /// It repeats the frame before it.
    Repeated,
    /// Its file already had it.
    Kept,
}

/// Report of a frame.
#[derive(Clone, Debug, Serialize)]
pub struct FrameRecord {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// The step that it shows, or the first of two.
    pub step: usize,
    /// The second step of an interpolation and its weight.
    pub toward: Option<(usize, f64)>,
    /// Time of the series, in its unit.
    pub time: f64,
    /// The file.
    #[serde(serialize_with = "files::serialize_path")]
    pub file: PathBuf,
    /// How it came about.
    pub origin: Origin,
    /// Whether the image is empty; `None` for a file that was kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub empty: Option<bool>,
    /// Counts and times; rendered frames only.
    pub stats: Option<FrameStats>,
}

/// Why a run ended early. Earlier images are written; a movie is kept only after the loss of a GPU.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The request is invalid.
    #[error(transparent)]
    Scene(Box<SceneError>),
    /// A frame could not be rendered.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// A file could not be written, or a step could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The camera cannot turn.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The request has no text for its fingerprint.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// The metadata of a frame have no text.
    #[error(transparent)]
    Attributes(#[from] serde_json::Error),
    /// Threads could not be started.
    #[error(transparent)]
    Threads(#[from] io::Error),
    /// The pipeline's queue was full.
    #[error("more frames were asked for than the pipeline takes; please report this")]
    Full,
    /// The pipeline has stopped.
    #[error("the pipeline has stopped without a reason; please report this")]
    Stopped,
    /// The run was cancelled.
    #[error("cancelled")]
    Cancelled,
}

impl From<SceneError> for RunError {
    fn from(error: SceneError) -> Self {
        Self::Scene(Box::new(error))
    }
}

impl From<MovieError> for RunError {
    fn from(error: MovieError) -> Self {
        match error {
            MovieError::File(error) => Self::File(error),
            MovieError::Cancelled => Self::Cancelled,
        }
    }
}

impl RunError {
    /// Whether the run was cancelled.
    pub fn is_cancelled(&self) -> bool {
        match self {
            Self::Cancelled | Self::Pipeline(PipelineError::Cancelled) => true,
            Self::Scene(error) => error.is_cancelled(),
            _ => false,
        }
    }

    /// Whether a GPU failed on the way: the frames before are valid.
    fn is_device_failure(&self) -> bool {
        use RenderError::{DeviceLost, Gpu};
        matches!(self, Self::Pipeline(PipelineError::Render(DeviceLost { .. } | Gpu { .. })))
    }
}

impl Run {
    /// A run that draws no annotations and replaces what is there.
    pub fn new(plan: Plan, output: Output) -> Self {
        // A run requests no frame twice, except one after the other.
        let threads = PipelinedOptions { frame_cache_bytes: 0, ..Default::default() };
        Self { plan, output, annotator: None, resume: false, replaces: true, threads, written: Written::default() }
    }

    /// Renders all frames; files that were begun are finished or removed in any case. The scene's own `cancel` ends the run.
    ///
    /// # Errors
    /// If a file is in the way or a step is damaged, which is found before the first frame is written; else the error of the first frame that fails.
    pub fn render(&self, scene: &mut Scene, progress: &dyn Progress) -> Result<Vec<FrameRecord>, RunError> {
        self.check_places()?;
        let fields = 1 + fields_beside(scene).len();
        progress.begin("check", (fields * self.plan.steps.len()) as u64, "steps");
        let checked = self.check_steps(scene, progress);
        progress.end();
        let checksums = checked?;
        let (sink, fingerprints) = match &self.output {
            Output::Movie { path, ffmpeg, options } => {
                (Sink::Movie(Box::new(MovieWriter::start(ffmpeg, path, options)?), self.written.clone()), None)
            }
            Output::Images { pattern, options } => {
                // An EXR can store all planes.
                scene.guides = StillFormat::of(&pattern.path(0)) == Some(StillFormat::Exr);
                // The file stores units, drawn or not.
                let written_as = format!("{options:?} {:?} {:?}", self.annotator, scene.pipeline.field().units);
                let flow = scene.look.flow.as_ref();
                let travel = flow.and_then(|flow| flow.layer.travel(scene.pipeline.series()));
                let mut fingerprints = Fingerprints::new(scene.pipeline.mesh(), &self.plan, &checksums, &written_as);
                fingerprints.travel = travel;
                (Sink::Images(FrameWriter::new(*options, self.written.clone())), Some(fingerprints))
            }
        };
        Job { run: self, fingerprints }.run(scene, sink, progress)
    }

    /// Checks that no folder is in the way of an image, nor a file that may not be replaced. Images that may be kept are looked at later.
    fn check_places(&self) -> FileResult<()> {
        let count = if matches!(self.output, Output::Movie { .. }) { 1 } else { self.plan.frames.len() };
        for path in (0..count).map(|frame| self.output.path(frame)) {
            if path.is_dir() {
                return Err(FileError::invalid(path, "", "is a folder").remedy("choose another name"));
            }
            if !self.replaces && !self.resume && path.exists() {
                return Err(files::taken(&path));
            }
        }
        Ok(())
    }

    /// Checks that all steps can be read, since half a sequence would look like a whole one; returns the checksum of each.
    fn check_steps(&self, scene: &Scene, progress: &dyn Progress) -> Result<Vec<u32>, RunError> {
        let mut checksums = scene.pipeline.check_steps(&self.plan.steps, progress, scene.cancel())?;
        for field in fields_beside(scene) {
            let other = Pipeline::new(scene.pipeline.series().beside(&field)?);
            let others = other.check_steps(&self.plan.steps, progress, scene.cancel())?;
            let pairs = checksums.iter_mut().zip(others);
            pairs.for_each(|(sum, other)| *sum = crc32c::crc32c_append(*sum, &other.to_le_bytes()));
        }
        Ok(checksums)
    }
}

/// The fields beside a scene's own that its pictures show: those that colour surfaces, and those of flow.
fn fields_beside(scene: &Scene) -> Vec<FieldSelector> {
    let of_surfaces = scene.look.surfaces.beside.iter().map(|of| {
        let Ok(field) = of.field.parse();
        field
    });
    of_surfaces.chain(scene.look.flow.iter().flat_map(|flow| flow.layer.fields())).collect()
}

/// The metadata of a scene's last request, as frame number `frame` of the run.
fn attributes_of(scene: &Scene, request: &FrameRequest, frame: usize) -> FrameAttributes {
    let field = scene.pipeline.field();
    FrameAttributes {
        time: request.time.time(scene.pipeline.times()),
        step: request.time.step(),
        frame,
        field: field.name.clone(),
        units: field.units.clone(),
        camera: request.camera.to_string(),
        transfer_function: scene.transfer_function(),
        range: scene.range(),
        opacity_kind: scene.look.opacity_kind,
        unit_distance: scene.look.lengths.unit_distance,
        software: FrameAttributes::SOFTWARE.to_owned(),
        extras: sampling_of(request),
    }
}

/// Rays and enlargement of a frame; empty if it has all of its own rays.
fn sampling_of(request: &FrameRequest) -> BTreeMap<String, String> {
    let mut says = BTreeMap::new();
    let mut say = |key: &str, value: String| says.insert(key.to_owned(), value);
    if let Some(contrast) = request.samples.contrast() {
        say("contrast", contrast.to_string());
    }
    if let Some(Upsampling { scale, filter }) = request.upsampling {
        say("image_scale", scale.to_string());
        say("upsample", filter.kind().to_string());
        if let UpsampleFilter::Joint { kernel_px, .. } = filter {
            say("kernel", kernel_px.to_string());
        }
        if let Some(edges) = filter.edges() {
            say("sigma_depth", Short(edges.sigma_depth).to_string());
            say("layers", edges.layers.to_string());
        }
    }
    says
}

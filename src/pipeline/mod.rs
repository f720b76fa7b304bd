//! From a request to a frame: decode, order, render.
//!
//! [`Pipeline`] plays one field of one store. What did not change since the last request is not done again: the same step
//! is not decoded twice. A frame shows a step or, between two steps, their linear mixture ([`FrameTime`]).

mod backend;
#[cfg(feature = "gpu")]
mod gpu;
mod steps;
mod time;

pub use backend::Backend;
pub use time::FrameTime;

use crate::camera::{Camera, CameraError};
use crate::codec::vq;
use crate::error::{FileError, FileResult};
use crate::field::{FieldSelector, TimeAxis};
use crate::mesh::Mesh;
use crate::node_table::NodeTable;
use crate::optics::OpticsKind;
#[cfg(feature = "gpu")]
use crate::render::gpu::context::{Context, ContextOptions};
use crate::render::{CompressedStep, Frame, RenderError, RenderJob};
use crate::stats::FrameStats;
use crate::store::{FieldReader, Store, StoredField};
use crate::task::{Cancel, Progress};
use backend::Renderers;
use rayon::prelude::*;
use serde::{Deserialize, Serialize, Serializer};
use std::str::FromStr;
use std::sync::Arc;
use std::time::Instant;
use steps::StepCache;

/// How a frame is rendered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RenderMode {
    /// The fastest that is within the accuracy bounds: the ray caster.
    #[default]
    Auto,
    /// Cell walk, [`crate::render::cpu::raycast`].
    Raycast,
    /// The float64 judge, [`mod@crate::render::reference`]; on the CPU whatever the backend.
    Reference,
}

impl FromStr for RenderMode {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "raycast" => Ok(Self::Raycast),
            "reference" => Ok(Self::Reference),
            _ => Err(format!("there is no mode '{text}'; choose auto, raycast or reference")),
        }
    }
}

/// All that a frame of a series depends on. Plain data: cheap to clone, and what it serialises to tells it from others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameRequest {
    /// Zero-based step of the store, or a moment between two.
    pub time: FrameTime,
    /// Where from.
    pub camera: Camera,
    /// Transfer function over the field's scalars.
    #[serde(serialize_with = "serialize_table")]
    pub table: Arc<NodeTable>,
    /// Width and height in pixels.
    pub size_px: (usize, usize),
    /// Which renderer.
    pub mode: RenderMode,
    /// How segments are integrated; the reference does it in its own way.
    pub optics: OpticsKind,
    /// Where it is rendered.
    pub backend: Backend,
}

impl FrameRequest {
    /// A frame with everything else as by default: the fastest accurate mode, exact optics.
    ///
    /// `time` is a step or a [`FrameTime`]; `table` covers the field's scalars; `size_px` is width and height.
    pub fn new(time: impl Into<FrameTime>, camera: Camera, table: Arc<NodeTable>, size_px: (usize, usize)) -> Self {
        let (mode, optics, backend) = Default::default();
        Self { time: time.into(), camera, table, size_px, mode, optics, backend }
    }
}

/// What the table is, not where.
fn serialize_table<S: Serializer>(table: &Arc<NodeTable>, serializer: S) -> Result<S::Ok, S::Error> {
    NodeTable::serialize(table, serializer)
}

/// Why a request did not become a frame.
#[derive(Clone, Debug, thiserror::Error)]
pub enum PipelineError {
    /// The step could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// There is no view through the camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Somebody asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// Mesh and field do not belong together.
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// Turns requests into frames, one after the other.
pub struct Pipeline {
    mesh: Arc<Mesh>,
    times: TimeAxis,
    reader: FieldReader,
    steps: StepCache,
    renderers: Renderers,
}

impl Pipeline {
    /// Opens one field of a store for playing; the first field if none is named.
    ///
    /// # Errors
    /// If the store has no such field, or mesh or field are damaged.
    pub fn open(store: &Store, field: Option<&FieldSelector>) -> FileResult<Self> {
        let first = || {
            let name = store.fields().first().map(|f| f.name.clone());
            name.ok_or_else(|| FileError::invalid(store.path(), "fields", "the store has no field"))
        };
        let selector = match field {
            Some(selector) => selector.clone(),
            None => FieldSelector { name: first()?, component: None },
        };
        let reader = store.field(&selector)?;
        let mesh = Arc::new(store.mesh()?);
        let steps = StepCache::new(mesh.topology.tets.len());
        let times = store.times().clone();
        Ok(Self { mesh, times, reader, steps, renderers: Renderers::default() })
    }

    /// The mesh of the series.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// Times of the steps.
    pub fn times(&self) -> &TimeAxis {
        &self.times
    }

    /// The field that is played.
    pub fn field(&self) -> &StoredField {
        self.reader.info()
    }

    /// Reads steps as a frame would and forgets them: whether the store can give them all. Reports each to `progress`.
    /// Returns the CRC-32C of each step's scalars in memory, by which their content is told from another.
    ///
    /// # Errors
    /// That of the first step that cannot be read, or `Cancelled`.
    pub fn check_steps(
        &self,
        steps: &[usize],
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Vec<u32>, PipelineError> {
        let vertices = self.mesh.positions.local.len();
        let read = |buffer: &mut Vec<f32>, &step: &usize| {
            if cancel.is_cancelled() {
                return Err(PipelineError::Cancelled);
            }
            progress.advance(1);
            self.reader.decode_step(step, buffer)?;
            Ok(crc32c::crc32c(bytemuck::cast_slice(buffer)))
        };
        // All results before the first error among them: which one that is must not depend on threads.
        let checked: Vec<Result<u32, PipelineError>> =
            steps.par_iter().map_init(|| vec![0.0; vertices], read).collect();
        checked.into_iter().collect()
    }

    /// Whether there is what a backend needs: what cannot work fails here, before the first frame.
    ///
    /// # Errors
    /// `NoGpu` if a GPU is asked for and there is none.
    pub fn check_backend(&mut self, backend: Backend) -> Result<(), RenderError> {
        self.renderers.check(backend)
    }

    /// Another GPU, or other limits, than by default.
    #[cfg(feature = "gpu")]
    pub fn choose_gpu(&mut self, options: ContextOptions) {
        self.renderers.gpu.choose(options);
    }

    /// The GPU in use, once one was needed.
    #[cfg(feature = "gpu")]
    pub fn gpu(&self) -> Option<&Arc<Context>> {
        self.renderers.gpu.context()
    }

    /// Why the last frame that should have been rendered on the GPU was not: [`Backend::Auto`] then uses the CPU.
    #[cfg(feature = "gpu")]
    pub fn gpu_problem(&self) -> Option<&RenderError> {
        self.renderers.gpu.problem()
    }

    /// Renders a frame of exactly the moment asked for. If the GPU is lost on the way, another device begins it again.
    ///
    /// # Errors
    /// If a step cannot be read or there is no view through the camera.
    pub fn render(&mut self, request: &FrameRequest) -> Result<&Frame, PipelineError> {
        self.render_unless(request, &Cancel::new())
    }

    /// As [`Self::render`], unless `cancel` is raised.
    ///
    /// # Errors
    /// As [`Self::render`], or `Cancelled`.
    pub fn render_unless(&mut self, request: &FrameRequest, cancel: &Cancel) -> Result<&Frame, PipelineError> {
        let job = self.prepare(request)?;
        let drawn = self.renderers.render(job, request.mode, request.backend, cancel)?;
        drawn.ok_or(PipelineError::Cancelled)
    }

    /// The job of a request: decodes what it shows and finds its active cells, unless the last request showed the same.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn prepare(&mut self, request: &FrameRequest) -> Result<RenderJob, PipelineError> {
        let started = Instant::now();
        let view = request.camera.view(request.size_px.0, request.size_px.1)?;
        let mut stats = FrameStats::default();
        let decode = |step: usize, out: &mut [f32]| self.reader.decode_step(step, out);
        let shown = self.steps.show(request.time, &self.mesh, &decode, &mut stats)?;
        // A mixture of two steps is not in any block.
        let compressed = match request.time.toward() {
            None => self.reader.vq_block(request.time.step())?,
            Some(_) => None,
        };
        stats.ms_decode = started.elapsed().as_secs_f64() * 1e3;
        Ok(RenderJob {
            mesh: self.mesh.clone(),
            scalars: shown.scalars,
            compressed: compressed.map(|block| CompressedStep { block, step: request.time.step() % vq::STEPS }),
            active: shown.active,
            view,
            table: request.table.clone(),
            optics: request.optics,
            early_termination: true,
            stats,
        })
    }
}

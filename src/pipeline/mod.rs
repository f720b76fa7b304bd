//! From a request to a frame: decode, order, render.
//!
//! [`Series`] is one field of a store. [`Pipeline`] turns requests for its frames into frames, one after the other;
//! [`Pipelined`] does the same with a thread for each stage: while a frame is rendered, the next one is decoded and ordered.
//! Results of the last request that still hold are reused. A frame shows a step or, between two steps, their linear
//! mixture ([`FrameTime`]), and depends on nothing but its request.

mod apart;
mod backend;
mod device;
mod distribution;
mod draw;
mod enlarging;
mod flow;
mod frames;
mod functions;
#[cfg(feature = "gpu")]
mod gpu;
mod in_sight;
mod kept;
mod layer;
mod pipelined;
mod points;
mod prefetch;
mod preparation;
mod priority;
mod quantities;
mod queue;
mod ranges;
mod rankings;
mod region_values;
mod request;
mod residual;
mod samples;
mod series;
mod shells;
mod stages;
mod steps;
#[cfg(test)]
pub(crate) mod test_series;
mod text;
mod time;
mod transparent;
mod unconnected;
#[cfg(feature = "gpu")]
mod window_gpu;

pub use crate::render::upsampling::{DepthEdges, ImageScale, UpsampleFilter, UpsampleKind, Upsampling};
pub use device::Backend;
pub use draw::{DrawnBy, FaceDetail, RenderMode, Representation, TetDraw};
pub(crate) use flow::vector_components;
pub use flow::{FlowLayer, FlowMeasure, vector_fields};
pub use frames::SharedFrame;
pub use layer::{ColorsBeside, KeyedSurfaces, Layer, RequestError, Shown, SurfaceLook, TetLayer};
pub use pipelined::{Pipelined, PipelinedOptions};
pub(crate) use priority::give_way;
pub use queue::{FrameId, Preparations};
pub use rankings::Sampling;
pub use request::{FrameRequest, PipelineError};
pub use residual::{ResidualBase, ResidualRequest};
pub use samples::SampleSet;
pub use series::Series;
pub use stages::Delivery;
pub use time::FrameTime;
#[cfg(feature = "gpu")]
pub use window_gpu::WindowGpu;

use crate::codec::StepRequest;
use crate::error::FileResult;
use crate::field::{FieldSelector, TimeAxis};
use crate::mesh::Mesh;
#[cfg(feature = "gpu")]
use crate::render::gpu::context::{Context, ContextOptions};
use crate::render::{Frame, RenderError, RenderJob};
use crate::slowdown::{Slow, frames_before, waste};
use crate::store::{Store, StoredField};
use crate::task::{Cancel, Progress};
use backend::Renderers;
use glam::DVec3;
use preparation::{Decode, Order, Ordered};
use rayon::prelude::*;
use std::sync::Arc;

/// Turns requests into frames, one after the other, each stage on all threads.
pub struct Pipeline {
    series: Arc<Series>,
    decode: Decode,
    order: Order,
    renderers: Renderers,
}

impl Pipeline {
    /// Opens one field of a store for playing; the first field if none is named.
    ///
    /// # Errors
    /// If the store has no such field, or mesh or field are damaged.
    pub fn open(store: &Store, field: Option<&FieldSelector>) -> FileResult<Self> {
        Ok(Self::new(Arc::new(Series::open(store, field)?)))
    }

    /// A pipeline of a series that is open.
    pub fn new(series: Arc<Series>) -> Self {
        Self { series, decode: Decode::default(), order: Order::default(), renderers: Renderers::default() }
    }

    /// The series that is played.
    pub fn series(&self) -> &Arc<Series> {
        &self.series
    }

    /// The mesh of the series.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.series.mesh
    }

    /// Times of the steps.
    pub fn times(&self) -> &TimeAxis {
        &self.series.times
    }

    /// The field that is played.
    pub fn field(&self) -> &StoredField {
        &self.series.field
    }

    /// Decodes steps as a frame would and discards them, to check that the store can give all. Reports each to `progress`. Returns the
    /// CRC-32C of each step's scalars in memory, which identifies their content.
    ///
    /// # Errors
    /// The error of the first unreadable step, or `Cancelled`.
    pub fn check_steps(
        &self,
        steps: &[usize],
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Vec<u32>, PipelineError> {
        let read = |buffer: &mut Vec<f32>, &step: &usize| {
            let cost = self.series.source.decode_step(StepRequest::whole(step, cancel), buffer)?;
            progress.advance(1);
            cost.map(|_| crc32c::crc32c(bytemuck::cast_slice(buffer))).ok_or(PipelineError::Cancelled)
        };
        // All results are collected before the first error is picked: it must not depend on thread timing.
        let checked: Vec<Result<u32, PipelineError>> =
            steps.par_iter().map_init(|| vec![0.0; self.series.scalar_count()], read).collect();
        checked.into_iter().collect()
    }

    /// Checks that the backend is available, so that a missing one fails before the first frame.
    ///
    /// # Errors
    /// `NoGpu` if a GPU is asked for and there is none.
    pub fn check_backend(&mut self, backend: Backend) -> Result<(), RenderError> {
        self.renderers.check(backend)
    }

    /// Sets the GPU and its limits.
    #[cfg(feature = "gpu")]
    pub fn choose_gpu(&mut self, options: ContextOptions) {
        self.renderers.gpu.choose(options);
    }

    /// Renders on a window's GPU while it works.
    #[cfg(feature = "gpu")]
    pub fn share_gpu(&mut self, gpu: WindowGpu) {
        self.renderers.gpu.share(gpu);
    }

    /// The GPU in use; `None` before the first need.
    #[cfg(feature = "gpu")]
    pub fn gpu(&self) -> Option<&Arc<Context>> {
        self.renderers.gpu.context()
    }

    /// Why the last frame meant for the GPU was not rendered there: [`Backend::Auto`] then uses the CPU.
    #[cfg(feature = "gpu")]
    pub fn gpu_problem(&self) -> Option<&RenderError> {
        self.renderers.gpu.problem()
    }

    /// Renders the frame of exactly the requested time. If the GPU is lost on the way, another device begins it again.
    ///
    /// # Errors
    /// If a step cannot be read or there is no view through the camera.
    pub fn render(&mut self, request: &FrameRequest) -> Result<&Frame, PipelineError> {
        self.render_unless(request, &Cancel::new())
    }

    /// As [`Self::render`], unless `cancel` is raised: rendering then stops within 5 ms of CPU time.
    ///
    /// # Errors
    /// As [`Self::render`], or `Cancelled`.
    pub fn render_unless(&mut self, request: &FrameRequest, cancel: &Cancel) -> Result<&Frame, PipelineError> {
        // The judge has no use for a GPU.
        let is_judged = request.tets().is_some_and(|tets| tets.draw.drawn_by().is_reference());
        let has_flow = matches!(request.flow(), Ok(Some(_))) && !is_judged;
        let draws_flow = has_flow && self.renderers.draws_flow(request.backend);
        let ordered = self.order(request, draws_flow, cancel)?;
        waste(Slow::LateFrames, frames_before());
        let drawn = self.renderers.render(ordered, request.backend)?;
        drawn.ok_or(PipelineError::Cancelled)
    }

    /// The render job of a request: decodes its scalars and finds its active cells, unless the last request showed the same.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn prepare(&mut self, request: &FrameRequest) -> Result<RenderJob, PipelineError> {
        self.prepare_unless(request, &Cancel::new())
    }

    /// As [`Self::prepare`], unless `cancel` is raised.
    ///
    /// # Errors
    /// As [`Self::render`], or `Cancelled`.
    pub fn prepare_unless(&mut self, request: &FrameRequest, cancel: &Cancel) -> Result<RenderJob, PipelineError> {
        Ok(self.order(request, false, cancel)?.job)
    }

    /// The vector of a request's flow at a point of a cell, linear between the vertices; NaN where one of theirs is, `None` without flow. The
    /// point is a cell of the mesh and weights of its vertices, as in a [`Probe`](crate::render::probe::Probe).
    ///
    /// # Errors
    /// If the series has no such vectors, they cannot be read, or there is no such cell, or `Cancelled`.
    pub fn flow_vector(
        &mut self,
        request: &FrameRequest,
        point: (u32, [f64; 4]),
        cancel: &Cancel,
    ) -> Result<Option<DVec3>, PipelineError> {
        self.decode.flow_vector(&self.series, request, point, cancel)
    }

    fn order(&mut self, request: &FrameRequest, draws_flow: bool, cancel: &Cancel) -> Result<Ordered, PipelineError> {
        let decoded = self.decode.run(&self.series, request, cancel)?;
        self.order.run(&self.series, request, decoded, draws_flow, cancel)
    }
}

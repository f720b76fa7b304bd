//! The GPU of a pipeline: opened when first needed, reopened when it was lost.

use super::device::Primitive;
use super::{Backend, WindowGpu};
use crate::camera::View;
use crate::mesh::Mesh;
use crate::render::gpu::context::{Context, ContextOptions};
use crate::render::gpu::havs::Havs;
use crate::render::gpu::points::Points;
use crate::render::gpu::raycast::Raycast;
use crate::render::points::PointStyle;
use crate::render::surfaces::SurfaceScene;
use crate::render::{Contrast, Frame, RenderError, RenderJob, Renderer};
use std::sync::Arc;

/// Most restarts of a frame on a new device before its failure counts.
const RESTARTS_MAX: u64 = 2;

/// The renderers on one GPU. Each is created when it is first needed.
struct Renderers {
    context: Arc<Context>,
    raycast: Option<Raycast>,
    havs: Option<Havs>,
    points: Option<Points>,
}

impl Renderers {
    fn new(context: Arc<Context>) -> Box<Self> {
        Box::new(Self { context, raycast: None, havs: None, points: None })
    }

    /// The renderer of a primitive.
    fn of(&mut self, primitive: Primitive) -> &mut dyn Renderer {
        let context = || self.context.clone();
        match primitive {
            Primitive::Faces => self.havs.get_or_insert_with(|| Havs::new(context())),
            Primitive::Points => self.points.get_or_insert_with(|| Points::new(context())),
            Primitive::Cells => self.raycast.get_or_insert_with(|| Raycast::new(context())),
        }
    }
}

/// Signature and error of a job that was beyond the GPU.
struct Beyond {
    mesh: Arc<Mesh>,
    view: View,
    primitive: Primitive,
    elements: usize,
    /// How its points are drawn.
    style: Option<PointStyle>,
    /// Number of values of its joint table.
    joint_values: usize,
    extras: [bool; 7],
    error: RenderError,
}

impl Beyond {
    fn new(job: RenderJob, primitive: Primitive, error: RenderError) -> Self {
        let (elements, joint_values, extras) = (elements_of(&job), joint_values_of(&job), extras_of(&job));
        let style = style_of(&job);
        let RenderJob { mesh, view, .. } = job;
        Self { mesh, view, primitive, elements, style, joint_values, extras, error }
    }

    /// Whether a job would be beyond the GPU too.
    fn holds_for(&self, job: &RenderJob, primitive: Primitive) -> bool {
        let is_same = self.view == job.view && self.primitive == primitive && self.elements == elements_of(job);
        let is_same = is_same && self.extras == extras_of(job) && self.style == style_of(job);
        Arc::ptr_eq(&self.mesh, &job.mesh) && is_same && self.joint_values == joint_values_of(job)
    }
}

/// Features of a job beside a volume: fragments, surfaces, cuts, light on the volume, colours of other fields, contrast-adaptive rays, and
/// scalars of cells.
fn extras_of(job: &RenderJob) -> [bool; 7] {
    let of_scene = |has: fn(&SurfaceScene) -> bool| job.surfaces.as_ref().is_some_and(has);
    let is_cut = of_scene(|scene| !scene.planes().is_empty());
    let is_colored = of_scene(SurfaceScene::has_beside);
    let lights_volume = of_scene(SurfaceScene::lights_volume);
    let has_contrasts = !job.contrasts().is_empty();
    let of_cells = job.scalars.of_cells().is_some();
    [job.has_other_layers(), job.surfaces.is_some(), is_cut, lights_volume, is_colored, has_contrasts, of_cells]
}

fn style_of(job: &RenderJob) -> Option<PointStyle> {
    job.points.as_ref().map(|points| points.style)
}

fn joint_values_of(job: &RenderJob) -> usize {
    job.joint.as_ref().map_or(0, |scene| scene.table.values().len())
}

/// Number of faces, or of points, that a job draws.
fn elements_of(job: &RenderJob) -> usize {
    let points = job.points.as_ref().map(|points| &points.cells);
    job.faces.as_ref().or(points).map_or(0, |drawn| drawn.ids.len())
}

/// The GPU that frames are rendered on, if there is one.
pub(in crate::pipeline) struct Gpu {
    options: ContextOptions,
    /// [`Context::new`], or in tests a function that gives unusable devices.
    open: fn(&ContextOptions) -> Result<Context, RenderError>,
    /// The GPU of the window that shows the frames; takes precedence.
    window: WindowGpu,
    state: State,
    /// The last job that was beyond the GPU; similar jobs skip it.
    beyond: Option<Beyond>,
    /// Why the last frame meant for the GPU was not rendered there.
    problem: Option<RenderError>,
}

#[derive(Default)]
enum State {
    #[default]
    NotLookedFor,
    /// No hardware GPU; a software one is possible.
    NoHardware(RenderError),
    Absent(RenderError),
    Ready(Box<Renderers>),
}

impl Default for Gpu {
    fn default() -> Self {
        Self {
            options: ContextOptions::default(),
            open: Context::new,
            window: WindowGpu::none(),
            state: State::default(),
            beyond: None,
            problem: None,
        }
    }
}

impl Gpu {
    /// Chooses another GPU than the best one; all state of the last one is dropped.
    pub(in crate::pipeline) fn choose(&mut self, options: ContextOptions) {
        *self = Self { options, open: self.open, window: self.window.clone(), ..Self::default() };
    }

    /// Renders on a window's GPU while it works.
    pub(in crate::pipeline) fn share(&mut self, window: WindowGpu) {
        self.window = window;
    }

    /// Resets the state, so that the same GPU is opened again when it is needed.
    pub(in crate::pipeline) fn begin_afresh(&mut self) {
        self.choose(self.options.clone());
    }

    /// The GPU in use; `None` before the first need.
    pub(in crate::pipeline) fn context(&self) -> Option<&Arc<Context>> {
        match &self.state {
            State::Ready(renderers) => Some(&renderers.context),
            State::NotLookedFor | State::NoHardware(_) | State::Absent(_) => None,
        }
    }

    /// Why the last frame meant for the GPU was not rendered there.
    pub(in crate::pipeline) fn problem(&self) -> Option<&RenderError> {
        self.problem.as_ref()
    }

    /// Whether frames of a backend are rendered on the GPU.
    ///
    /// # Errors
    /// `NoGpu` if the backend requires a GPU and there is none.
    pub(in crate::pipeline) fn is_wanted(&mut self, backend: Backend) -> Result<bool, RenderError> {
        let is_named = !self.options.adapter.is_empty();
        match backend {
            Backend::Cpu => Ok(false),
            Backend::Gpu => self.renderers(false).map(|_| true),
            // A named GPU that is missing is an error; one that was lost for good is not.
            Backend::Auto if is_named => match self.renderers(false) {
                Err(error @ RenderError::NoGpu(_)) => Err(error),
                found => Ok(found.is_ok()),
            },
            Backend::Auto => Ok(self.renderers(true).is_ok_and(|r| r.context.adapter().is_hardware)),
        }
    }

    fn renderers(&mut self, hardware_only: bool) -> Result<&mut Renderers, RenderError> {
        if let Some(of_window) = self.window.get() {
            let is_in_use = self.context().is_some_and(|context| Arc::ptr_eq(context, &of_window));
            if !is_in_use {
                (self.state, self.beyond) = (State::Ready(Renderers::new(of_window)), None);
            }
        }
        let is_new = match &self.state {
            State::NotLookedFor => true,
            State::NoHardware(_) => !hardware_only,
            State::Absent(_) | State::Ready(_) => false,
        };
        if is_new {
            let options = ContextOptions { hardware_only, ..self.options.clone() };
            self.state = match (self.open)(&options) {
                Ok(context) => State::Ready(Renderers::new(Arc::new(context))),
                Err(error) if hardware_only => State::NoHardware(error),
                Err(error) => State::Absent(error),
            };
        }
        match &mut self.state {
            State::Ready(renderers) => Ok(renderers),
            State::NoHardware(error) | State::Absent(error) => Err(error.clone()),
            State::NotLookedFor => Err(RenderError::NoGpu("it has not been looked for".to_owned())),
        }
    }

    /// Renders the primitives of a job; whether [`Self::renderer_in_use`] has its frame, which it has not if the job was cancelled.
    /// `previewed` gets its previews. A device that is lost or fails is replaced and the frame begun again, [`RESTARTS_MAX`] times at most.
    ///
    /// # Errors
    /// The error of the last device, or that the job is beyond the GPU.
    pub(in crate::pipeline) fn draw(
        &mut self,
        job: &RenderJob,
        primitive: Primitive,
        backend: Backend,
        previewed: &mut dyn FnMut(&Frame, Contrast),
    ) -> Result<bool, RenderError> {
        let hardware_only = backend == Backend::Auto && self.options.adapter.is_empty();
        let drawn = self.draw_again(job, primitive, hardware_only, previewed);
        self.problem = drawn.as_ref().err().cloned();
        drawn
    }

    fn draw_again(
        &mut self,
        job: &RenderJob,
        primitive: Primitive,
        hardware_only: bool,
        previewed: &mut dyn FnMut(&Frame, Contrast),
    ) -> Result<bool, RenderError> {
        if let Some(beyond) = self.beyond.as_ref().filter(|beyond| beyond.holds_for(job, primitive)) {
            return Err(beyond.error.clone());
        }
        let mut job = job.clone();
        loop {
            let renderer = self.renderers(hardware_only)?.of(primitive);
            let error = match renderer.render_with_previews(job.clone(), previewed) {
                Ok(frame) => return Ok(frame.is_some()),
                Err(error) => error,
            };
            match error {
                RenderError::DeviceLost { .. } | RenderError::Gpu { .. } => {
                    self.state = State::NotLookedFor;
                    // Software does not replace lost hardware, unless it was asked for.
                    if job.stats.gpu_restarts == RESTARTS_MAX || self.renderers(hardware_only).is_err() {
                        // Without another device, the error is the loss of this one.
                        self.state = State::Absent(error.clone());
                        return Err(error);
                    }
                    job.stats.gpu_restarts += 1;
                }
                RenderError::BeyondGpu { .. } => {
                    self.beyond = Some(Beyond::new(job, primitive, error.clone()));
                    return Err(error);
                }
                RenderError::NoGpu(_)
                | RenderError::ScalarCount { .. }
                | RenderError::CellCount { .. }
                | RenderError::NoFormula(_)
                | RenderError::NoFaces
                | RenderError::NoSuchFace { .. }
                | RenderError::NoPoints
                | RenderError::NoSuchCell { .. }
                | RenderError::BadPoints(_)
                | RenderError::JointValueCount { .. }
                | RenderError::JointAssociation
                | RenderError::BadLayerFragment { .. }
                | RenderError::LayerPixels { .. }
                | RenderError::SampleSize { .. }
                | RenderError::EnlargedSize { .. }
                | RenderError::TooMuchFlow { .. }
                | RenderError::BadFunctions(_)
                | RenderError::BadK(_) => return Err(error),
            }
        }
    }

    /// The renderer of a primitive on the device in use.
    pub(in crate::pipeline) fn renderer_in_use(&mut self, primitive: Primitive) -> Option<&mut dyn Renderer> {
        match &mut self.state {
            State::Ready(renderers) => Some(renderers.of(primitive)),
            State::NotLookedFor | State::NoHardware(_) | State::Absent(_) => None,
        }
    }
}

#[cfg(test)]
#[path = "gpu_tests.rs"]
mod tests;

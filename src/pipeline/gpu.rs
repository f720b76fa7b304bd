//! The GPU of a pipeline: looked for when first wanted, started again when it was lost.

use super::{Backend, WindowGpu};
use crate::camera::View;
use crate::mesh::Mesh;
use crate::render::gpu::context::{Context, ContextOptions};
use crate::render::gpu::raycast::Raycast;
use crate::render::{RenderError, RenderJob, Renderer};
use std::sync::Arc;

/// Times that a frame is begun again on a new device before its failure counts.
const RESTARTS_MAX: u64 = 2;

/// The ray caster on the GPU, if there is one.
pub(in crate::pipeline) struct Gpu {
    options: ContextOptions,
    /// [`Context::new`], or in tests one that gives devices of no use.
    open: fn(&ContextOptions) -> Result<Context, RenderError>,
    /// The GPU of the window that shows the frames comes before all others.
    window: WindowGpu,
    state: State,
    /// Mesh and view of the last job that was beyond it: the next like it would be too.
    beyond: Option<(Arc<Mesh>, View, RenderError)>,
    /// Why the last frame that should have been rendered here was not.
    problem: Option<RenderError>,
}

#[derive(Default)]
enum State {
    #[default]
    NotLookedFor,
    /// None but perhaps software.
    NoHardware(RenderError),
    Absent(RenderError),
    Ready(Box<Raycast>),
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
    /// Another GPU than the best one; what was begun on the last one is forgotten.
    pub(in crate::pipeline) fn choose(&mut self, options: ContextOptions) {
        *self = Self { options, open: self.open, window: self.window.clone(), ..Self::default() };
    }

    /// Renders on a window's GPU while that works.
    pub(in crate::pipeline) fn share(&mut self, window: WindowGpu) {
        self.window = window;
    }

    /// Looks for the same GPU again when it is needed.
    pub(in crate::pipeline) fn begin_afresh(&mut self) {
        self.choose(self.options.clone());
    }

    /// The GPU in use, if one has been needed so far.
    pub(in crate::pipeline) fn context(&self) -> Option<&Arc<Context>> {
        match &self.state {
            State::Ready(renderer) => Some(renderer.context()),
            State::NotLookedFor | State::NoHardware(_) | State::Absent(_) => None,
        }
    }

    /// Why the last frame that should have been rendered here was not.
    pub(in crate::pipeline) fn problem(&self) -> Option<&RenderError> {
        self.problem.as_ref()
    }

    /// Whether frames of a backend are rendered here.
    ///
    /// # Errors
    /// `NoGpu` if they must be, and there is no GPU.
    pub(in crate::pipeline) fn is_wanted(&mut self, backend: Backend) -> Result<bool, RenderError> {
        let is_named = !self.options.adapter.is_empty();
        match backend {
            Backend::Cpu => Ok(false),
            Backend::Gpu => self.renderer(false).map(|_| true),
            // A GPU that was asked for by name and is not there is a mistake; one that was lost for good is not.
            Backend::Auto if is_named => match self.renderer(false) {
                Err(error @ RenderError::NoGpu(_)) => Err(error),
                found => Ok(found.is_ok()),
            },
            Backend::Auto => Ok(self.renderer(true).is_ok_and(|r| r.context().adapter().is_hardware)),
        }
    }

    fn renderer(&mut self, hardware_only: bool) -> Result<&mut Raycast, RenderError> {
        if let Some(of_window) = self.window.get() {
            let is_in_use = self.context().is_some_and(|context| Arc::ptr_eq(context, &of_window));
            if !is_in_use {
                (self.state, self.beyond) = (State::Ready(Box::new(Raycast::new(of_window))), None);
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
                Ok(context) => State::Ready(Box::new(Raycast::new(Arc::new(context)))),
                Err(error) if hardware_only => State::NoHardware(error),
                Err(error) => State::Absent(error),
            };
        }
        match &mut self.state {
            State::Ready(renderer) => Ok(renderer),
            State::NoHardware(error) | State::Absent(error) => Err(error.clone()),
            State::NotLookedFor => Err(RenderError::NoGpu("it has not been looked for".to_owned())),
        }
    }

    /// Renders a job, unless it is cancelled: whether [`Self::renderer_in_use`] has its frame. A device that is lost or fails
    /// is replaced and the frame begun again, [`RESTARTS_MAX`] times at most.
    ///
    /// # Errors
    /// Of the last device, or that the job is beyond the GPU.
    pub(in crate::pipeline) fn draw(&mut self, job: &RenderJob, backend: Backend) -> Result<bool, RenderError> {
        let hardware_only = backend == Backend::Auto && self.options.adapter.is_empty();
        let drawn = self.draw_again(job, hardware_only);
        self.problem = drawn.as_ref().err().cloned();
        drawn
    }

    fn draw_again(&mut self, job: &RenderJob, hardware_only: bool) -> Result<bool, RenderError> {
        if let Some((mesh, view, error)) = &self.beyond
            && Arc::ptr_eq(mesh, &job.mesh)
            && *view == job.view
        {
            return Err(error.clone());
        }
        let mut job = job.clone();
        loop {
            let error = match self.renderer(hardware_only)?.render_unless_cancelled(job.clone()) {
                Ok(frame) => return Ok(frame.is_some()),
                Err(error) => error,
            };
            match error {
                RenderError::DeviceLost { .. } | RenderError::Gpu { .. } => {
                    self.state = State::NotLookedFor;
                    // Software does not stand in for hardware that has been lost, unless it was asked for.
                    if job.stats.gpu_restarts == RESTARTS_MAX || self.renderer(hardware_only).is_err() {
                        // Without a device to go on with, the loss of this one is what has happened.
                        self.state = State::Absent(error.clone());
                        return Err(error);
                    }
                    job.stats.gpu_restarts += 1;
                }
                RenderError::BeyondGpu { .. } => {
                    self.beyond = Some((job.mesh.clone(), job.view, error.clone()));
                    return Err(error);
                }
                RenderError::NoGpu(_)
                | RenderError::ScalarCount { .. }
                | RenderError::CellCount { .. }
                | RenderError::NoFaces
                | RenderError::NoSuchFace { .. }
                | RenderError::BadK(_) => return Err(error),
            }
        }
    }

    /// The renderer on the device in use.
    pub(in crate::pipeline) fn renderer_in_use(&mut self) -> Option<&mut Raycast> {
        match &mut self.state {
            State::Ready(renderer) => Some(renderer),
            State::NotLookedFor | State::NoHardware(_) | State::Absent(_) => None,
        }
    }
}

#[cfg(test)]
#[path = "gpu_tests.rs"]
mod tests;

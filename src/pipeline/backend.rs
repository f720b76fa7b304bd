//! Where frames are rendered.

use super::RenderMode;
#[cfg(feature = "gpu")]
use super::gpu::Gpu;
use crate::render::cpu::raycast::Raycast;
use crate::render::reference::Reference;
use crate::render::{Frame, RenderError, RenderJob, Renderer};
use crate::task::Cancel;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// Where a frame is rendered. Frames of both backends agree within the bounds of `docs/architecture.md`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// On the GPU if there is one, else on the CPU, as all frames that the GPU cannot do. A driver that is software counts
    /// only if it was asked for by name.
    #[default]
    Auto,
    /// On the CPU.
    Cpu,
    /// On a GPU, be it one in software; without one there is no frame.
    Gpu,
}

impl FromStr for Backend {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "gpu" => Ok(Self::Gpu),
            _ => Err(format!("there is no backend '{text}'; choose auto, cpu or gpu")),
        }
    }
}

/// All renderers of a pipeline.
#[derive(Default)]
pub(super) struct Renderers {
    raycast: Raycast,
    reference: Reference,
    #[cfg(feature = "gpu")]
    pub(super) gpu: Gpu,
}

impl Renderers {
    /// Whether there is what the backend needs.
    ///
    /// # Errors
    /// `NoGpu` if a GPU is asked for and there is none.
    pub(super) fn check(&mut self, backend: Backend) -> Result<(), RenderError> {
        #[cfg(feature = "gpu")]
        self.gpu.is_wanted(backend)?;
        #[cfg(not(feature = "gpu"))]
        if backend == Backend::Gpu {
            return Err(RenderError::NoGpu("this tetreel was built without the feature gpu".to_owned()));
        }
        Ok(())
    }

    /// The frame of a job; `None` if `cancel` was raised.
    ///
    /// # Errors
    /// As [`Renderer::render_unless`], and `NoGpu`.
    pub(super) fn render(
        &mut self,
        job: RenderJob,
        mode: RenderMode,
        backend: Backend,
        cancel: &Cancel,
    ) -> Result<Option<&Frame>, RenderError> {
        let renderer: &mut dyn Renderer = match mode {
            RenderMode::Reference => &mut self.reference,
            RenderMode::Auto | RenderMode::Raycast => {
                self.check(backend)?;
                #[cfg(feature = "gpu")]
                if self.gpu.is_wanted(backend)? {
                    match self.gpu.draw(&job, backend, cancel) {
                        Ok(is_drawn) => return Ok(if is_drawn { self.gpu.last_frame() } else { None }),
                        Err(error) if backend == Backend::Gpu => return Err(error),
                        // The CPU can do it, and the GPU has noted why it did not.
                        Err(_) => {}
                    }
                }
                &mut self.raycast
            }
        };
        renderer.render_unless(job, cancel)
    }
}

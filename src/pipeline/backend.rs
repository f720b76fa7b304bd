//! Where frames are rendered.

use super::DrawnBy;
#[cfg(feature = "gpu")]
use super::gpu::Gpu;
use super::preparation::Ordered;
use crate::render::cpu::havs::Havs;
use crate::render::cpu::raycast::Raycast;
use crate::render::reference::Reference;
use crate::render::{Contrast, Frame, RenderError, RenderJob, Renderer};
use crate::words::words;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

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

words!(Backend, "there is no backend", ["auto" = Auto, "cpu" = Cpu, "gpu" = Gpu]);

/// What a renderer that both backends have goes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Primitive {
    /// Cells, from one to the next along rays.
    Cells,
    /// Faces, in the order of their depths.
    Faces,
}

/// All renderers of a pipeline.
#[derive(Default)]
pub(super) struct Renderers {
    cpu: CpuRenderers,
    /// For normals and numbers of surfaces, whatever renders the frame.
    guides: CpuRenderers,
    #[cfg(feature = "gpu")]
    pub(super) gpu: Gpu,
}

/// Renderers on the CPU.
#[derive(Default)]
struct CpuRenderers {
    raycast: Raycast,
    havs: Havs,
    reference: Reference,
}

impl CpuRenderers {
    fn of(&mut self, by: DrawnBy) -> &mut dyn Renderer {
        match by {
            DrawnBy::Raycast => &mut self.raycast,
            DrawnBy::Faces(_) => &mut self.havs,
            DrawnBy::Reference => &mut self.reference,
        }
    }
}

impl Renderers {
    /// Forgets what a renderer that panicked may have left behind; the GPU is looked for again.
    pub(super) fn begin_afresh(&mut self) {
        (self.cpu, self.guides) = Default::default();
        #[cfg(feature = "gpu")]
        self.gpu.begin_afresh();
    }

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

    /// The frame of a job; `None` if it was cancelled.
    ///
    /// # Errors
    /// As [`Renderer::render_unless_cancelled`], and `NoGpu`.
    pub(super) fn render(&mut self, ordered: Ordered, backend: Backend) -> Result<Option<&Frame>, RenderError> {
        let Some(renderer) = self.draw(ordered, backend, &mut |_, _| ())? else { return Ok(None) };
        // Without a job, the last frame.
        Ok(Some(renderer.advance(Duration::ZERO)?.frame()))
    }

    /// The same frame to keep, and its previews on the way; the next one is rendered to the memory that `replacement` gives.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub(super) fn render_to_keep(
        &mut self,
        ordered: Ordered,
        backend: Backend,
        previewed: &mut dyn FnMut(&Frame, Contrast),
        replacement: impl FnOnce() -> Frame,
    ) -> Result<Option<Frame>, RenderError> {
        Ok(self.draw(ordered, backend, previewed)?.map(|renderer| renderer.take_frame(replacement())))
    }

    /// The renderer that has drawn a job, with what is found on its image; `None` if it was cancelled.
    fn draw(
        &mut self,
        ordered: Ordered,
        backend: Backend,
        previewed: &mut dyn FnMut(&Frame, Contrast),
    ) -> Result<Option<&mut dyn Renderer>, RenderError> {
        let Ordered { job, by, on_image } = ordered;
        let started = Instant::now();
        let guides = match on_image.as_ref().and_then(|_| job.of_guides()) {
            None => None,
            Some(job) => match self.guides.of(by).render_unless_cancelled(job)? {
                None => return Ok(None),
                Some(frame) => Some(frame.planes.clone()),
            },
        };
        let guided = started.elapsed();
        let Some(renderer) = self.draw_job(job, by, backend, previewed)? else { return Ok(None) };
        let frame = renderer.frame_mut();
        frame.stats.ms_guides = 0.0;
        if let (Some(on_image), Some(guides)) = (on_image, guides) {
            let lit = Instant::now();
            on_image.finish(&mut frame.planes, &guides);
            frame.stats.ms_guides = (guided + lit.elapsed()).as_secs_f64() * 1e3;
        }
        Ok(Some(renderer))
    }

    fn draw_job(
        &mut self,
        job: RenderJob,
        by: DrawnBy,
        backend: Backend,
        previewed: &mut dyn FnMut(&Frame, Contrast),
    ) -> Result<Option<&mut dyn Renderer>, RenderError> {
        let primitive = match by {
            DrawnBy::Raycast => Some(Primitive::Cells),
            DrawnBy::Faces(_) => Some(Primitive::Faces),
            DrawnBy::Reference => None,
        };
        if primitive.is_some() {
            self.check(backend)?;
        }
        #[cfg(feature = "gpu")]
        if let Some(primitive) = primitive
            && self.gpu.is_wanted(backend)?
        {
            match self.gpu.draw(&job, primitive, backend) {
                Ok(false) => return Ok(None),
                Ok(true) => return Ok(self.gpu.renderer_in_use(primitive)),
                Err(error) if backend == Backend::Gpu => return Err(error),
                // The CPU can do it, and the GPU has noted why it did not.
                Err(_) => {}
            }
        }
        let renderer = self.cpu.of(by);
        let is_drawn = renderer.render_with_previews(job, previewed)?.is_some();
        Ok(is_drawn.then_some(renderer))
    }
}

//! The backends of a pipeline and their renderers.

use super::DrawnBy;
use super::device::{Backend, Primitive};
#[cfg(feature = "gpu")]
use super::gpu::Gpu;
use super::preparation::Ordered;
use super::residual::AddDetails;
use crate::render::cpu::functions::Sheets;
use crate::render::cpu::havs::Havs;
use crate::render::cpu::points::Points;
use crate::render::cpu::raycast::Raycast;
use crate::render::reference::Reference;
use crate::render::{Contrast, Frame, Planes, RenderError, RenderJob, Renderer};
use std::time::{Duration, Instant};

/// All renderers of a pipeline.
#[derive(Default)]
pub(super) struct Renderers {
    cpu: CpuRenderers,
    /// Render the normals and surface numbers, whatever renders the frame.
    guides: CpuRenderers,
    /// Renders the rows that all rays are cast for, whatever renders the few rays of their frame.
    rows: Raycast,
    #[cfg(feature = "gpu")]
    pub(super) gpu: Gpu,
}

/// Renderers on the CPU.
#[derive(Default)]
struct CpuRenderers {
    raycast: Raycast,
    havs: Havs,
    points: Points,
    sheets: Sheets,
    reference: Reference,
}

impl CpuRenderers {
    fn of(&mut self, by: DrawnBy) -> &mut dyn Renderer {
        match by {
            DrawnBy::Raycast => &mut self.raycast,
            DrawnBy::Faces(_) => &mut self.havs,
            DrawnBy::Points(_) => &mut self.points,
            DrawnBy::Sheets(_) => &mut self.sheets,
            DrawnBy::Reference | DrawnBy::Judge => &mut self.reference,
        }
    }
}

/// Planes of a job that is rendered beside a frame, if there is one; `None` if it was cancelled.
fn planes_of(renderer: &mut dyn Renderer, job: Option<RenderJob>) -> Result<Option<Option<Planes>>, RenderError> {
    let Some(job) = job else { return Ok(Some(None)) };
    Ok(renderer.render_unless_cancelled(job)?.map(|frame| Some(frame.planes.clone())))
}

impl Renderers {
    /// Resets the renderers after a panic; the GPU is looked for again.
    pub(super) fn begin_afresh(&mut self) {
        (self.cpu, self.guides, self.rows) = Default::default();
        #[cfg(feature = "gpu")]
        self.gpu.begin_afresh();
    }

    /// Checks that the backend is available.
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

    /// Whether splats of flow are probably drawn by a GPU for a backend, so that they need no fragments.
    pub(super) fn draws_flow(&mut self, backend: Backend) -> bool {
        self.check(backend).is_ok() && backend != Backend::Cpu && self.gpu_draws_flow()
    }

    /// Whether the GPU in use draws splats of flow.
    pub(super) fn gpu_draws_flow(&self) -> bool {
        #[cfg(feature = "gpu")]
        return self.gpu.context().is_some_and(|context| context.draws_flow());
        #[cfg(not(feature = "gpu"))]
        false
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

    /// As [`Self::render`], with a frame to keep and its previews on the way; the next frame uses the memory that `replacement` gives.
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

    /// The renderer that has drawn a job, with the post-processing of its image; `None` if it was cancelled.
    fn draw(
        &mut self,
        ordered: Ordered,
        backend: Backend,
        previewed: &mut dyn FnMut(&Frame, Contrast),
    ) -> Result<Option<&mut dyn Renderer>, RenderError> {
        let Ordered { job, by, on_image, enlarge, mut add_details } = ordered;
        let guided = Instant::now();
        let of_guides = on_image.as_ref().and_then(|_| job.of_guides());
        let Some(guides) = planes_of(self.guides.of(by), of_guides)? else { return Ok(None) };
        let (guided, renewed) = (guided.elapsed(), Instant::now());
        let of_rows = add_details.as_mut().and_then(AddDetails::rows);
        let Some(rows) = planes_of(&mut self.rows, of_rows)? else { return Ok(None) };
        let renewed = renewed.elapsed();
        let Some(renderer) = self.draw_job(job, by, backend, previewed)? else { return Ok(None) };
        let Frame { planes, stats, details, .. } = renderer.frame_mut();
        (stats.ms_guides, *details) = (0.0, None);
        if let (Some(on_image), Some(guides)) = (on_image, guides) {
            let lit = Instant::now();
            on_image.finish(planes, &guides);
            stats.ms_guides = (guided + lit.elapsed()).as_secs_f64() * 1e3;
        }
        let enlarge = enlarge.filter(|_| !stats.upsampled_on_gpu);
        let is_whole = enlarge.is_none_or(|enlarge| enlarge.finish(planes, stats));
        *details = add_details.map(|add_details| add_details.finish(planes, rows.as_ref(), renewed, stats));
        Ok(is_whole.then_some(renderer))
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
            DrawnBy::Points(_) => Some(Primitive::Points),
            DrawnBy::Sheets(_) | DrawnBy::Reference | DrawnBy::Judge => None,
        };
        if primitive.is_some() {
            self.check(backend)?;
        }
        #[cfg(feature = "gpu")]
        if let Some(primitive) = primitive
            && self.gpu.is_wanted(backend)?
        {
            match self.gpu.draw(&job, primitive, backend, previewed) {
                Ok(false) => return Ok(None),
                Ok(true) => return Ok(self.gpu.renderer_in_use(primitive)),
                Err(error) if backend == Backend::Gpu => return Err(error),
                // The CPU renders the job instead; the GPU has noted its error.
                Err(_) => {}
            }
        }
        let renderer = self.cpu.of(by);
        let is_drawn = renderer.render_with_previews(job, previewed)?.is_some();
        Ok(is_drawn.then_some(renderer))
    }
}

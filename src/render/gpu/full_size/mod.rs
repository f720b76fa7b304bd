//! Images that are upsampled to the size of their frame on the GPU that renders them ([`crate::image::upsample`]).
//!
//! A renderer leaves a small image, and the vertices of the mesh in view coordinates, which do not depend on the number of pixels. Its
//! planes are not read back; then, slice by slice:
//!
//! ```text
//! for filters that keep edges:
//!     faces, pieces, range, reference     depth layers at the pixels of the full image (super::layers)
//!     faces, pieces, reference            depth layers at the samples (joint2x2 only)
//! bilinear                                for the joint filter
//! filter                                  the image that is read back, or that a window samples
//! ```
//! A slice of pieces reads back how many of them are done; nothing else is read before the image.

mod limits;
mod scene;
#[cfg(test)]
pub(super) mod stage_tests;
mod steps;

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::Params;
use super::target::Target;
use crate::render::{Contrast, Frame, FrameRun, LayerRenderer, RenderError, RenderJob};
use crate::stats::FrameStats;
use std::sync::Arc;
use std::time::{Duration, Instant};
use steps::Enlarger;
pub use steps::Work;

/// Resources of a finished image that its renderer leaves on the GPU.
pub struct ImageLeft<'a> {
    pub(super) target: &'a Arc<Target>,
    pub(super) params: &'a Params,
    /// Vertices in view coordinates.
    pub(super) vertices: &'a GrowingBuffer,
}

/// A renderer that leaves its image on the GPU.
pub trait LeavesImage: LayerRenderer {
    /// The GPU that it renders on.
    fn context(&self) -> &Arc<Context>;

    /// The resources of a finished job.
    fn left<'a>(&'a self, job: &'a Self::Job) -> ImageLeft<'a>;
}

/// Whether a renderer reads its pixels back: not for a window, nor for an image that is enlarged first.
pub(super) fn reads_pixels(job: &RenderJob, frame: &Frame) -> bool {
    frame.texture.is_none() && job.enlarge.is_none()
}

/// A renderer whose images are enlarged on the GPU to the size of their frames. An image that does not fit there comes back as drawn, for
/// the CPU to enlarge: [`FrameStats::upsampled_on_gpu`] tells which.
pub struct AtFullSize<L> {
    pub(super) layer: L,
    enlarger: Enlarger,
}

/// A job of [`AtFullSize`].
pub struct SizedJob<J> {
    image: J,
    is_drawn: bool,
    /// `None` if the image comes back as drawn.
    sizing: Option<Box<Sizing>>,
}

/// State of an image that is enlarged.
struct Sizing {
    /// The job of the full image.
    full: RenderJob,
    work: Option<Work>,
    /// The job without enlargement, and the statistics before it, used if the full image does not fit.
    as_it_is: RenderJob,
    stats: FrameStats,
}

/// The same job without enlargement, previews or window.
fn as_it_is(job: RenderJob) -> RenderJob {
    RenderJob { enlarge: None, for_window: false, previews: Vec::new(), ..job }
}

impl<L: LeavesImage> FrameRun<AtFullSize<L>> {
    /// The GPU that it renders on.
    pub fn context(&self) -> &Arc<Context> {
        self.layer.layer.context()
    }
}

impl<L> AtFullSize<L> {
    pub(super) fn of(layer: L) -> Self {
        Self { layer, enlarger: Enlarger::new() }
    }
}

impl<L: LeavesImage> AtFullSize<L> {
    /// Begins a job whose image is not enlarged, and frees what enlarging had allocated.
    fn begin_as_it_is(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<SizedJob<L::Job>>, RenderError> {
        self.enlarger.release();
        self.enlarger.give_texture(frame);
        Ok(self.layer.begin(job, frame)?.map(|image| SizedJob { image, is_drawn: false, sizing: None }))
    }

    /// Draws an image again that does not fit at full size, so that it comes back as drawn. Later images of its mesh, filter and size do so
    /// at once.
    fn come_back(&mut self, job: &mut SizedJob<L::Job>, frame: &mut Frame) -> Result<(), RenderError> {
        let Some(sizing) = job.sizing.take() else { return Ok(()) };
        self.enlarger.abandon(self.layer.context())?;
        self.enlarger.refuse(&sizing.full);
        let Sizing { as_it_is, stats, .. } = *sizing;
        let (ms_begin, ms_render) = (frame.stats.ms_begin, frame.stats.ms_render);
        frame.stats = FrameStats { ms_begin, ms_render, ..stats };
        let image = self.layer.begin(as_it_is, frame)?;
        job.is_drawn = image.is_none();
        if let Some(image) = image {
            job.image = image;
        }
        Ok(())
    }
}

impl<L: LeavesImage> LayerRenderer for AtFullSize<L> {
    type Job = SizedJob<L::Job>;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<Self::Job>, RenderError> {
        let Some(enlargement) = job.enlarge.clone() else {
            return self.begin_as_it_is(job, frame);
        };
        let full = RenderJob { view: enlargement.view.clone(), ..job.clone() };
        if !self.enlarger.can_do(self.layer.context(), &full, &enlargement) {
            return self.begin_as_it_is(as_it_is(job), frame);
        }
        self.enlarger.keep_texture(frame);
        self.enlarger.scene.let_go(&job);
        let stats = frame.stats.clone();
        // The small image is never shown.
        let small = RenderJob { for_window: false, previews: Vec::new(), ..job.clone() };
        let image = self.layer.begin(small, frame)?;
        frame.stats.upsampled_on_gpu = true;
        if image.is_none() {
            // All pixels are transparent: the frame is complete.
            frame.clear(full.view.plane_px());
        }
        let sizing = || Some(Box::new(Sizing { full, work: None, as_it_is: as_it_is(job), stats }));
        Ok(image.map(|image| SizedJob { image, is_drawn: false, sizing: sizing() }))
    }

    fn advance(&mut self, budget: Duration, job: &mut Self::Job, frame: &mut Frame) -> Result<bool, RenderError> {
        let started = Instant::now();
        if !job.is_drawn {
            job.is_drawn = self.layer.advance(budget, &mut job.image, frame)?;
            if !job.is_drawn {
                return Ok(false);
            }
        }
        let Some(sizing) = &mut job.sizing else { return Ok(true) };
        let budget = if budget == Duration::MAX { budget } else { budget.saturating_sub(started.elapsed()) };
        let enlarging = Instant::now();
        let advanced = self.enlarger.enlarge(budget, sizing, self.layer.context(), &self.layer.left(&job.image), frame);
        if matches!(advanced, Err(RenderError::BeyondGpu { .. })) {
            self.come_back(job, frame)?;
            // With a budget of `Duration::MAX` the frame must be complete on return.
            return self.advance(budget, job, frame);
        }
        // Enlarging has its own times in the statistics.
        frame.stats.ms_render -= enlarging.elapsed().as_secs_f64() * 1e3;
        advanced
    }

    fn draws_flow(&self) -> bool {
        self.layer.draws_flow()
    }

    fn preview(&self) -> Option<Contrast> {
        self.layer.preview()
    }

    fn abandon(&mut self) -> Result<(), RenderError> {
        let came_back = self.layer.abandon();
        came_back.and(self.enlarger.abandon(self.layer.context()))
    }

    fn slice(&self) -> Duration {
        self.layer.slice()
    }
}

//! Images that come to the size of their frame on the GPU that they are rendered on ([`crate::image::upsample`]).
//!
//! A renderer leaves a small image, and the vertices of the mesh in view coordinates, which are the same for any number of pixels. Its planes do
//! not come back; then, slice by slice:
//!
//! ```text
//! for filters that keep edges:
//!     faces, pieces, range, reference     layers of depth at the pixels of the full image (super::layers)
//!     faces, pieces, reference            and, for joint2x2, at the samples
//! bilinear                                for the joint filter
//! filter                                  the image that comes back, or that a window is given
//! ```
//! What a slice of pieces brings back is how far they are; nothing else is read before the image.

mod scene;
#[cfg(test)]
pub(super) mod stage_tests;
mod steps;

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::Params;
use super::target::Target;
use crate::render::{Contrast, Frame, LayerRenderer, RenderError, RenderJob};
use std::sync::Arc;
use std::time::{Duration, Instant};
use steps::Enlarger;
pub use steps::Work;

/// What a renderer leaves on the GPU when its image is done.
pub struct ImageLeft<'a> {
    pub(super) target: &'a Arc<Target>,
    pub(super) params: &'a Params,
    /// In view coordinates.
    pub(super) vertices: &'a GrowingBuffer,
}

/// A renderer that leaves its image on the GPU.
pub trait LeavesImage: LayerRenderer {
    /// The GPU that it renders on.
    fn context(&self) -> &Arc<Context>;

    /// What it has left of a job that is done.
    fn left<'a>(&'a self, job: &'a Self::Job) -> ImageLeft<'a>;
}

/// Whether pixels of a job come back as its renderer draws them: not those for a window, nor those of an image that is enlarged first.
pub(super) fn reads_pixels(job: &RenderJob, frame: &Frame) -> bool {
    frame.texture.is_none() && job.enlarge.is_none()
}

/// A renderer whose images come to the size of their frames.
pub struct AtFullSize<L> {
    pub(super) layer: L,
    enlarger: Enlarger,
}

/// A job of [`AtFullSize`].
pub struct SizedJob<J> {
    image: J,
    is_drawn: bool,
    /// The job of the full image, if the one that is rendered is smaller.
    full: Option<Box<RenderJob>>,
    work: Option<Work>,
}

impl<L> AtFullSize<L> {
    pub(super) fn of(layer: L) -> Self {
        Self { layer, enlarger: Enlarger::new() }
    }
}

impl<L: LeavesImage> LayerRenderer for AtFullSize<L> {
    type Job = SizedJob<L::Job>;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<Self::Job>, RenderError> {
        let full = job.enlarge.as_ref().map(|to| Box::new(RenderJob { view: to.view.clone(), ..job.clone() }));
        let small = match &full {
            None => job,
            Some(_) => RenderJob { for_window: false, ..job },
        };
        if full.is_some() {
            self.enlarger.keep_texture(frame);
        }
        let image = self.layer.begin(small, frame)?;
        if let (None, Some(full)) = (&image, &full) {
            // All pixels are clear, and here.
            frame.clear(full.view.plane_px());
        }
        Ok(image.map(|image| SizedJob { image, is_drawn: false, full, work: None }))
    }

    fn advance(&mut self, budget: Duration, job: &mut Self::Job, frame: &mut Frame) -> Result<bool, RenderError> {
        let started = Instant::now();
        if !job.is_drawn {
            job.is_drawn = self.layer.advance(budget, &mut job.image, frame)?;
            if !job.is_drawn {
                return Ok(false);
            }
        }
        let Some(full) = &job.full else { return Ok(true) };
        let budget = if budget == Duration::MAX { budget } else { budget.saturating_sub(started.elapsed()) };
        let _span = tracing::info_span!("upsample").entered();
        let (context, left) = (self.layer.context(), self.layer.left(&job.image));
        let enlarging = Instant::now();
        let work = match &mut job.work {
            Some(work) => work,
            None => job.work.insert(self.enlarger.begin(context, full, &left, frame)?),
        };
        let is_done = self.enlarger.advance(context, budget, work, &left, frame)?;
        // It has its own numbers.
        frame.stats.ms_render -= enlarging.elapsed().as_secs_f64() * 1e3;
        Ok(is_done)
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

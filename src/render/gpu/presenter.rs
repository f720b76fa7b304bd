//! Frames that are shown in a window on the same GPU stay there.

use super::FrameTexture;
use super::context::Context;
use super::pipelines::Present;
use crate::render::{Frame, RenderError, RenderJob};
use std::sync::Arc;

/// Brings finished frames to the texture that their window samples.
pub(super) struct Presenter {
    /// Made for the first frame of a window.
    present: Option<Present>,
}

impl Presenter {
    pub(super) fn new() -> Self {
        Self { present: None }
    }

    /// Clears the frame for a job, and gives it a texture if the job is for this GPU's window: the one that there is if it
    /// fits.
    pub(super) fn prepare(
        &mut self,
        context: &Arc<Context>,
        job: &RenderJob,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        let size_px = (job.view.width_px, job.view.height_px);
        let last = frame.texture.take();
        if !job.for_window || !context.is_of_window() {
            frame.clear(size_px.0, size_px.1);
            return Ok(());
        }
        frame.clear(0, 0);
        if self.present.is_none() {
            self.present = Some(Present::new(context)?);
        }
        frame.texture = Some(match last.filter(|texture| texture.fits(context, size_px)) {
            Some(texture) => texture,
            None => FrameTexture::new(context, size_px)?,
        });
        Ok(())
    }

    /// Has a finished frame copied to its texture, if it has one. Whoever samples that does it after the copy, on the same
    /// queue.
    pub(super) fn present(&self, context: &Context, color: &wgpu::Texture, frame: &mut Frame) {
        if let (Some(texture), Some(present)) = (&mut frame.texture, &self.present) {
            present.submit(context, color, texture);
        }
    }
}

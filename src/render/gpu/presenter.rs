//! Copies finished frames to the texture that a window on the same GPU samples.

use super::FrameTexture;
use super::context::Context;
use super::pipelines::{NO_RECORDS, Pipeline};
use super::resources::Resource;
use super::shaders::Stage;
use crate::render::{Frame, RenderError, RenderJob};
use std::sync::Arc;

/// Copies finished frames to the texture that their window samples.
#[derive(Default)]
pub(super) struct Presenter {
    /// Made for the first frame of a window.
    present: Option<Pipeline>,
}

impl Presenter {
    /// Clears the frame for a job, and gives it a texture if the job is for this GPU's window: its present one if that fits.
    pub(super) fn prepare(
        &mut self,
        context: &Arc<Context>,
        job: &RenderJob,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        let size_px = job.view.plane_px();
        let last = frame.texture.take();
        if !job.for_window || !context.is_of_window() {
            frame.clear(size_px);
            return Ok(());
        }
        frame.clear((0, 0));
        if self.present.is_none() {
            self.present = Some(Pipeline::new(context, Stage::Present, NO_RECORDS)?);
        }
        frame.texture = Some(match last.filter(|texture| texture.fits(context, size_px)) {
            Some(texture) => texture,
            None => FrameTexture::new(context, size_px)?,
        });
        Ok(())
    }

    /// Replaces the frame's texture, if any: the window still shows the old one.
    pub(super) fn renew(&self, context: &Arc<Context>, frame: &mut Frame) -> Result<(), RenderError> {
        if let Some(texture) = &mut frame.texture {
            let size = texture.texture().size();
            *texture = FrameTexture::new(context, (size.width as usize, size.height as usize))?;
        }
        Ok(())
    }

    /// Submits the copy of a finished frame to its texture, if any, which has the same size; sampling on the same queue comes after it.
    pub(super) fn present(
        &self,
        context: &Context,
        color: &wgpu::Texture,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        let Some(texture) = &mut frame.texture else { return Ok(()) };
        let missing = || context.beyond("present has not been prepared".to_owned());
        let present = self.present.as_ref().ok_or_else(missing)?;
        let group = match texture.source.take() {
            Some((source, group)) if source == *color => group,
            _ => {
                let [from, to] = [color, texture.texture()].map(|texture| texture.create_view(&Default::default()));
                present.group(context, &[], &[(Resource::Color, &from), (Resource::Screen, &to)])?
            }
        };
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            present.set(&group, &mut pass);
            pass.dispatch_workgroups(color.width().div_ceil(8), color.height().div_ceil(8), 1);
        }
        context.queue.submit([encoder.finish()]);
        texture.source = Some((color.clone(), group));
        Ok(())
    }
}

//! Frames that stay on the GPU of a window.

use super::context::Context;
use super::resources::Resource;
use super::target::texture;
use crate::render::RenderError;
use std::sync::Arc;

/// A frame on the GPU of a window, as `Rgba16Float`: premultiplied accumulators, row 0 on top. The format is filterable and writable on
/// every GPU; its 11 significant bits are three more than a screen shows.
#[derive(Clone, Debug)]
pub struct FrameTexture {
    context: Arc<Context>,
    texture: wgpu::Texture,
    /// Source of the last copy to it, and that copy's bind group.
    pub(super) source: Option<(wgpu::Texture, wgpu::BindGroup)>,
}

impl FrameTexture {
    pub(super) fn new(context: &Arc<Context>, size_px: (usize, usize)) -> Result<Self, RenderError> {
        let texture = texture(context, Resource::Screen, size_px, wgpu::TextureUsages::empty())?;
        Ok(Self { context: context.clone(), texture, source: None })
    }

    /// Whether it is on this GPU and has this width and height.
    pub(super) fn fits(&self, context: &Arc<Context>, (width, height): (usize, usize)) -> bool {
        let size = self.texture.size();
        Arc::ptr_eq(&self.context, context) && (size.width as usize, size.height as usize) == (width, height)
    }

    /// The texture, for whoever samples it on the same device.
    pub fn texture(&self) -> &wgpu::Texture {
        &self.texture
    }

    /// The GPU that it is on.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let size = self.texture.size();
        8 * u64::from(size.width) * u64::from(size.height)
    }
}

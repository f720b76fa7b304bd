//! Frames that stay on the GPU of a window.

use super::context::Context;
use super::resources::Resource;
use std::sync::Arc;

/// A frame on the GPU of a window, in [`FrameTexture::FORMAT`]: premultiplied accumulators, row 0 on top.
#[derive(Clone, Debug)]
pub struct FrameTexture {
    context: Arc<Context>,
    texture: wgpu::Texture,
    /// Source of the last copy to it, and that copy's bind group.
    pub(super) source: Option<(wgpu::Texture, wgpu::BindGroup)>,
}

impl FrameTexture {
    /// Filterable and writable on every GPU; its 11 significant bits are three more than a screen shows.
    pub const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

    pub(super) fn new(
        context: &Arc<Context>,
        (width, height): (usize, usize),
    ) -> Result<Self, crate::render::RenderError> {
        let descriptor = wgpu::TextureDescriptor {
            label: Some(Resource::Screen.label()),
            size: wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: Self::FORMAT,
            usage: wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        };
        let texture = context.create(|device| device.create_texture(&descriptor))?;
        context.count_created(1);
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

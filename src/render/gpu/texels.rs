//! Lists in textures (`shaders/lib/texels.wgsl`): stages have no storage buffer left.

use super::context::Context;
use super::layout::TEXELS_WIDE;
use super::resources::Resource;
use crate::render::RenderError;
use std::sync::{Arc, Weak};

/// Four numbers.
pub(super) type Texel = [f32; 4];

/// A list of texels in the GPU's memory, row by row of a texture that is made anew only when it is too small.
pub(super) struct TexelList {
    resource: Resource,
    usage: wgpu::TextureUsages,
    texture: Option<(wgpu::Texture, wgpu::TextureView)>,
    /// What is sent next; afterwards its memory is used again.
    pub(super) texels: Vec<Texel>,
}

impl TexelList {
    /// A list without texels that stages bind as `resource`.
    pub(super) fn new(resource: Resource) -> Self {
        Self { resource, usage: wgpu::TextureUsages::COPY_DST, texture: None, texels: Vec::new() }
    }

    /// A list that stages write.
    pub(super) fn written(resource: Resource) -> Self {
        // Tests read it back.
        Self { usage: wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_SRC, ..Self::new(resource) }
    }

    /// The texture, as stages bind it.
    pub(super) fn view(&self) -> Option<(Resource, &wgpu::TextureView)> {
        self.texture.as_ref().map(|(_, view)| (self.resource, view))
    }

    /// The texture itself.
    #[cfg(test)]
    pub(super) fn texture(&self) -> Option<&wgpu::Texture> {
        self.texture.as_ref().map(|(texture, _)| texture)
    }

    /// Most texels of a list.
    pub(super) fn most(context: &Context) -> usize {
        TEXELS_WIDE * context.device.limits().max_texture_dimension_2d as usize
    }

    /// Sends the texels. Returns whether the texture was made, and the bytes sent.
    pub(super) fn send(&mut self, context: &Context) -> Result<(bool, u64), RenderError> {
        let made = self.reserve(context, self.texels.len().div_ceil(TEXELS_WIDE))?;
        self.texels.resize(self.texels.len().next_multiple_of(TEXELS_WIDE), [0.0; 4]);
        let Some((texture, _)) = &self.texture else { return Ok((made, 0)) };
        let bytes = bytemuck::cast_slice(&self.texels);
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some((TEXELS_WIDE * size_of::<Texel>()) as u32),
            rows_per_image: None,
        };
        context.queue.write_texture(texture.as_image_copy(), bytes, layout, extent(self.texels.len() / TEXELS_WIDE));
        Ok((made, bytes.len() as u64))
    }

    /// Frees the texels. A row is left, since stages that were made for jobs with some are bound to a texture still, and where `is_bound`,
    /// since one will be. Returns whether the texture was made.
    pub(super) fn release(&mut self, context: &Context, is_bound: bool) -> Result<bool, RenderError> {
        self.texels = Vec::new();
        let was_large = self.texture.take_if(|(texture, _)| texture.height() > 1).is_some();
        if was_large || is_bound { self.reserve(context, 1) } else { Ok(false) }
    }

    /// Texels for which there is room.
    pub(super) fn capacity(&self) -> u64 {
        self.texture.as_ref().map_or(0, |(texture, _)| TEXELS_WIDE as u64 * u64::from(texture.height()))
    }

    /// Makes room for so many rows of texels. Returns whether the texture was made anew.
    pub(super) fn reserve(&mut self, context: &Context, rows: usize) -> Result<bool, RenderError> {
        let rows = rows.max(1);
        if self.texture.as_ref().is_some_and(|(texture, _)| texture.height() as usize >= rows) {
            return Ok(false);
        }
        let most = context.device.limits().max_texture_dimension_2d as usize;
        if rows > most {
            let what = self.resource.label();
            return Err(context.beyond(format!("{what} take {rows} rows of a texture, and it has at most {most}")));
        }
        // The old texture is freed first: two large ones may not fit.
        self.texture = None;
        let descriptor = wgpu::TextureDescriptor {
            label: Some(self.resource.label()),
            // Powers of two, so that a moving camera seldom makes another.
            size: extent(rows.next_power_of_two().min(most)),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | self.usage,
            view_formats: &[],
        };
        let texture = context.create(|device| device.create_texture(&descriptor))?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        context.count_created(1);
        self.texture = Some((texture, view));
        Ok(true)
    }
}

/// What a list was made of, with depths counted from a place.
pub(super) struct Sent<T> {
    of: Weak<T>,
    origin: f64,
}

impl<T> Sent<T> {
    pub(super) fn new(of: &Arc<T>, origin: f64) -> Self {
        Self { of: Arc::downgrade(of), origin }
    }

    /// Compares by pointer, and the place to the bit.
    pub(super) fn is_of(&self, of: &Arc<T>, origin: f64) -> bool {
        self.of.as_ptr() == Arc::as_ptr(of) && self.origin.to_bits() == origin.to_bits()
    }
}

fn extent(rows: usize) -> wgpu::Extent3d {
    wgpu::Extent3d { width: TEXELS_WIDE as u32, height: rows as u32, depth_or_array_layers: 1 }
}

//! Fragments of other layers in the GPU's memory (`shaders/lib/fragments_ahead.wgsl`).

use super::context::Context;
use super::layout::{Params, two_parts};
use super::resources::Resource;
use crate::render::{LayerFragment, LayerFragments, RenderError, RenderJob};
use std::sync::{Arc, Weak};

/// Texels in a row of the texture: a quarter of what every device has.
const WIDTH: usize = 2048;

/// Texels of a fragment.
const FRAGMENT_TEXELS: usize = 2;

/// Base of the numbers of two digits, each of which is an f32.
const COUNT_BASE: u32 = 1 << 16;

/// A texture of fragments: for each pixel where they begin and how many they are, then the fragments.
pub(super) struct LayerTexture {
    /// The fragments that it holds, and the depth from which theirs are counted.
    sent: Option<(Weak<LayerFragments>, u64)>,
    texture: Option<(wgpu::Texture, wgpu::TextureView)>,
    texels: Vec<[f32; 4]>,
}

impl LayerTexture {
    pub(super) fn new() -> Self {
        Self { sent: None, texture: None, texels: Vec::new() }
    }

    /// The texture, as stages bind it.
    pub(super) fn view(&self) -> Option<(Resource, &wgpu::TextureView)> {
        self.texture.as_ref().map(|(_, view)| (Resource::LayerFragments, view))
    }

    /// Uploads the fragments of a job, if it has some, unless they are there. Returns whether the texture was made, and the bytes sent.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        params: &Params,
    ) -> Result<(bool, u64), RenderError> {
        let Some(fragments) = &job.fragments else { return self.release(context) };
        let origin = params.depth_behind_eye();
        let is_there = |(of, from): &(Weak<LayerFragments>, u64)| {
            of.as_ptr() == Arc::as_ptr(fragments) && *from == origin.to_bits()
        };
        if self.sent.as_ref().is_some_and(is_there) {
            return Ok((false, 0));
        }
        self.sent = None;
        let view = job.local_view();
        let per_world = 1.0 / job.mesh.positions.scale;
        pack(fragments, view.near_depth(), per_world, origin, &mut self.texels);
        let made = self.reserve(context, self.texels.len().div_ceil(WIDTH))?;
        self.texels.resize(self.texels.len().next_multiple_of(WIDTH), [0.0; 4]);
        let sent = self.write(context);
        self.sent = Some((Arc::downgrade(fragments), origin.to_bits()));
        Ok((made, sent))
    }

    /// Frees the fragments. Stages that were made for jobs with some are bound to a texture still: a row is left.
    fn release(&mut self, context: &Context) -> Result<(bool, u64), RenderError> {
        (self.sent, self.texels) = (None, Vec::new());
        if self.texture.take_if(|(texture, _)| texture.height() > 1).is_none() {
            return Ok((false, 0));
        }
        Ok((self.reserve(context, 1)?, 0))
    }

    /// Makes room for so many rows of texels. Returns whether the texture was made anew.
    fn reserve(&mut self, context: &Context, rows: usize) -> Result<bool, RenderError> {
        if self.texture.as_ref().is_some_and(|(texture, _)| texture.height() as usize >= rows) {
            return Ok(false);
        }
        let most = context.device.limits().max_texture_dimension_2d as usize;
        if rows > most {
            let problem = format!("fragments of other layers take {rows} rows of a texture, and it has at most {most}");
            return Err(context.beyond(problem));
        }
        // The old texture is freed first: two large ones may not fit.
        self.texture = None;
        let descriptor = wgpu::TextureDescriptor {
            label: Some(Resource::LayerFragments.label()),
            // Powers of two, so that a moving camera seldom makes another.
            size: extent(rows.next_power_of_two().min(most)),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        };
        let texture = context.create(|device| device.create_texture(&descriptor))?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        context.count_created(1);
        self.texture = Some((texture, view));
        Ok(true)
    }

    fn write(&self, context: &Context) -> u64 {
        let Some((texture, _)) = &self.texture else { return 0 };
        let bytes = bytemuck::cast_slice(&self.texels);
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some((WIDTH * size_of::<[f32; 4]>()) as u32),
            rows_per_image: None,
        };
        context.queue.write_texture(texture.as_image_copy(), bytes, layout, extent(self.texels.len() / WIDTH));
        bytes.len() as u64
    }
}

fn extent(rows: usize) -> wgpu::Extent3d {
    wgpu::Extent3d { width: WIDTH as u32, height: rows as u32, depth_or_array_layers: 1 }
}

/// The texels of fragments. Those nearer than `near` are left out; depths are counted from `origin`, both in local units, of which a world
/// unit is `per_world`.
fn pack(fragments: &LayerFragments, near: f64, per_world: f64, origin: f64, texels: &mut Vec<[f32; 4]>) {
    texels.clear();
    texels.resize(fragments.pixels(), [0.0; 4]);
    texels.reserve(FRAGMENT_TEXELS * fragments.count() + WIDTH);
    for pixel in 0..fragments.pixels() {
        let of_pixel = fragments.of_pixel(pixel);
        let seen = &of_pixel[of_pixel.partition_point(|fragment| fragment.depth * per_world < near)..];
        texels[pixel] = digits([texels.len() as u32, seen.len() as u32]);
        for LayerFragment { depth, rgba: [r, g, b, a] } in seen {
            let [whole, rest] = two_parts(depth * per_world - origin);
            texels.extend([[whole, rest, *r, *g], [*b, *a, 0.0, 0.0]]);
        }
    }
}

/// Two numbers in two digits each.
fn digits(numbers: [u32; 2]) -> [f32; 4] {
    let [first, count] = numbers.map(|number| [(number / COUNT_BASE) as f32, (number % COUNT_BASE) as f32]);
    [first[0], first[1], count[0], count[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fragments_lie_where_their_pixel_says_and_those_before_the_near_plane_nowhere() {
        let at = |pixel, depth, light: f32| (pixel, LayerFragment { depth, rgba: [light, 0.5, 0.25, 1.0] });
        let found = [at(1, 3.0, 0.1), at(1, 0.5, 0.2), at(1, 5.0 + 1e-9, 0.3), at(3, 4.0, 0.4)];
        let fragments = LayerFragments::new(4, found).unwrap();
        let mut texels = Vec::new();
        // A world unit is half a local one: the near plane at 0.5 hides what is nearer than 1 in the world.
        pack(&fragments, 0.5, 0.5, 1.0, &mut texels);
        assert_eq!(texels.len(), 4 + FRAGMENT_TEXELS * 3);
        assert_eq!(texels[0][2..], [0.0, 0.0]);
        assert_eq!(texels[1], [0.0, 4.0, 0.0, 2.0]);
        assert_eq!(texels[3], [0.0, 8.0, 0.0, 1.0]);
        assert_eq!(texels[4..6], [[0.5, 0.0, 0.1, 0.5], [0.25, 1.0, 0.0, 0.0]]);
        let [whole, rest, ..] = texels[6];
        // Two f32 have 48 bits.
        assert!((f64::from(whole) + f64::from(rest) - (1.5 + 0.5e-9)).abs() < 1e-14 && rest != 0.0);
        assert_eq!(digits([(1 << 27) + 5, 65_535]), [2048.0, 5.0, 0.0, 65_535.0]);
    }
}

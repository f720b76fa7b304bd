//! Fragments of other layers in the GPU's memory (`shaders/lib/layer_fragments.wgsl`).

use super::context::Context;
use super::layout::{Params, TEXELS_WIDE, integer_digits, two_parts};
use super::resources::Resource;
use super::texels::{Sent, Texel, TexelList};
use crate::render::{LayerFragment, LayerFragments, RenderError, RenderJob};

/// Texels of a fragment.
const FRAGMENT_TEXELS: usize = 2;

/// A texture of fragments: for each pixel where they begin and how many they are, then the fragments.
pub(super) struct LayerTexture {
    sent: Option<Sent<LayerFragments>>,
    list: TexelList,
}

impl LayerTexture {
    pub(super) fn new() -> Self {
        Self { sent: None, list: TexelList::new(Resource::LayerFragments) }
    }

    /// The texture, as stages bind it.
    pub(super) fn view(&self) -> Option<(Resource, &wgpu::TextureView)> {
        self.list.view()
    }

    /// Uploads the fragments of a job, if it has some, unless they are there. Returns whether the texture was made, and the bytes sent.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        params: &Params,
    ) -> Result<(bool, u64), RenderError> {
        let Some(fragments) = &job.fragments else {
            self.sent = None;
            return Ok((self.list.release(context, job.flow.is_some())?, 0));
        };
        let origin = params.depth_behind_eye();
        if self.sent.as_ref().is_some_and(|sent| sent.is_of(fragments, origin)) {
            return Ok((false, 0));
        }
        self.sent = None;
        let view = job.local_view();
        let per_world = 1.0 / job.mesh.positions.scale;
        pack(fragments, view.near_depth(), per_world, origin, &mut self.list.texels);
        let sent = self.list.send(context)?;
        self.sent = Some(Sent::new(fragments, origin));
        Ok(sent)
    }
}

/// The texels of fragments. Those nearer than `near` are left out; depths are counted from `origin`, both in local units, of which a world
/// unit is `per_world`.
fn pack(fragments: &LayerFragments, near: f64, per_world: f64, origin: f64, texels: &mut Vec<Texel>) {
    texels.clear();
    texels.resize(fragments.pixels(), [0.0; 4]);
    texels.reserve(FRAGMENT_TEXELS * fragments.count() + TEXELS_WIDE);
    for pixel in 0..fragments.pixels() {
        let of_pixel = fragments.of_pixel(pixel);
        let seen = &of_pixel[of_pixel.partition_point(|fragment| fragment.depth * per_world < near)..];
        texels[pixel] = integer_digits([texels.len() as u32, seen.len() as u32]);
        for LayerFragment { depth, rgba: [r, g, b, a] } in seen {
            let [whole, rest] = two_parts(depth * per_world - origin);
            texels.extend([[whole, rest, *r, *g], [*b, *a, 0.0, 0.0]]);
        }
    }
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
        assert_eq!(integer_digits([(1 << 27) + 5, 65_535]), [2048.0, 5.0, 0.0, 65_535.0]);
    }
}

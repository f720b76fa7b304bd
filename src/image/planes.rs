//! The planes of an image.

use super::{DepthImage, RgbaImage};

/// A plane of one value per pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plane<P> {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` pixels, top row first.
    pub pixels: Vec<P>,
}

impl<P: Clone> Plane<P> {
    /// Sets all pixels to `value`, in its own memory.
    fn fill(&mut self, width: usize, height: usize, value: P) {
        (self.width, self.height) = (width, height);
        self.pixels.clear();
        self.pixels.resize(width * height, value);
    }
}

/// All planes of an image. Each has its own size; one that was not made has no pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planes {
    /// Raw accumulators.
    pub color: RgbaImage,
    /// Depth of the first visible point of each ray: the near end of the first segment with extinction. World units along the viewing
    /// direction from the eye (parallel projection: from the camera's position, may be negative); infinite if the ray meets nothing.
    pub depth: DepthImage,
    /// Normal of the nearest surface, world coordinates, unit length, towards the eye; zero without a surface.
    pub normal: Plane<[f32; 3]>,
    /// Id of that surface: its index in the request counted from 1, isosurfaces first, then sections; 0 without a surface.
    pub id: Plane<u32>,
}

/// A plane as samples, of any pixel type.
#[derive(Clone, Copy, Debug)]
pub struct PlaneSamples<'a> {
    /// Name of the plane.
    pub name: &'static str,
    /// Samples per pixel.
    pub channels: usize,
    /// Width and height in pixels.
    pub size_px: (usize, usize),
    /// Interleaved channels, top row first; integers as the bits of an f32.
    pub samples: &'a [f32],
}

impl Planes {
    /// All planes, for code that treats them alike.
    pub fn list(&self) -> [PlaneSamples<'_>; 4] {
        fn listed<'a, P>(name: &'static str, plane: &Plane<P>, samples: &'a [f32]) -> PlaneSamples<'a> {
            let channels = size_of::<P>() / size_of::<f32>();
            PlaneSamples { name, channels, size_px: (plane.width, plane.height), samples }
        }
        let Self { color, depth, normal, id } = self;
        [
            listed("color", color, color.pixels.as_flattened()),
            listed("depth", depth, &depth.pixels),
            listed("normal", normal, normal.pixels.as_flattened()),
            listed("id", id, bytemuck::cast_slice(&id.pixels)),
        ]
    }

    /// Sets colour and depth to a ray that meets nothing, in their own memory; the other planes become empty.
    pub fn clear(&mut self, width: usize, height: usize) {
        let Self { color, depth, normal, id } = self;
        normal.fill(0, 0, [0.0; 3]);
        id.fill(0, 0, 0);
        color.fill(width, height, [0.0; 4]);
        depth.fill(width, height, f32::INFINITY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_has_all_samples_of_each_plane_in_its_own_size() {
        let mut planes = Planes::default();
        assert!(planes.list().iter().all(|plane| plane.samples.is_empty()));
        planes.clear(3, 2);
        planes.color.pixels[1] = [0.1, 0.2, 0.3, 0.4];
        planes.depth = DepthImage { width: 1, height: 2, pixels: vec![5.0, 6.0] };
        let [color, depth, normal, id] = planes.list();
        assert_eq!((color.name, color.channels, color.size_px), ("color", 4, (3, 2)));
        assert_eq!(color.samples[..8], [0.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.4]);
        assert_eq!((depth.name, depth.channels, depth.size_px), ("depth", 1, (1, 2)));
        assert_eq!(depth.samples, [5.0, 6.0]);
        assert_eq!((normal.channels, id.channels, normal.samples.len() + id.samples.len()), (3, 1, 0));
        for plane in planes.list() {
            assert_eq!(plane.samples.len(), plane.channels * plane.size_px.0 * plane.size_px.1);
        }
    }

    #[test]
    fn clearing_keeps_the_memory() {
        let mut planes = Planes::default();
        planes.clear(8, 8);
        let place = planes.depth.pixels.as_ptr();
        planes.depth.pixels[0] = 1.0;
        planes.clear(4, 2);
        assert_eq!((planes.depth.pixels.len(), planes.depth.pixels.as_ptr()), (8, place));
        assert!(planes.depth.pixels.iter().all(|d| *d == f32::INFINITY));
        assert_eq!((planes.color.width, planes.color.height), (4, 2));
    }
}

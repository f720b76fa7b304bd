//! The nearest depths of a tile's pixels.

use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::lists::TileFace;
use super::super::raster::{FACES_AT_ONCE, Faces, TileRays};
use super::super::ray::ViewVertex;
use super::super::tiles::TILE_PX;
use crate::camera::View;
use pulp::{Arch, NullaryFnOnce, Scalar, Simd};

/// Maximum number of depth layers.
pub const MAX_LAYERS: usize = 3;

/// Scratch memory of a thread for drawing tiles.
pub(super) struct Scratch {
    faces: Faces,
    list: PixelList,
    /// The nearest depths of each pixel of the tile (row times [`TILE_PX`] plus column), ascending.
    pub(super) depths: [[f64; MAX_LAYERS]; TILE_PX * TILE_PX],
    /// Least and greatest of all depths.
    pub(super) range: [f64; 2],
}

impl Default for Scratch {
    fn default() -> Self {
        let depths = [[f64::INFINITY; MAX_LAYERS]; TILE_PX * TILE_PX];
        let range = [f64::INFINITY, f64::NEG_INFINITY];
        Self { faces: Faces::NONE, list: [0; TILE_PX * TILE_PX + BLOCK], depths, range }
    }
}

impl Scratch {
    /// Resets the depths for a new tile.
    pub(super) fn begin(&mut self) {
        self.depths = [[f64::INFINITY; MAX_LAYERS]; TILE_PX * TILE_PX];
        self.range = [f64::INFINITY, f64::NEG_INFINITY];
    }
}

/// Scene data shared by all tiles.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) view: &'a View,
    pub(super) vertices: &'a [ViewVertex],
    /// Number of depth layers, at most [`MAX_LAYERS`].
    pub(super) layers: usize,
}

impl Scene<'_> {
    /// Draws faces into a tile.
    pub(super) fn draw(self, faces: &[TileFace], rays: &TileRays, scratch: &mut Scratch) {
        match Arch::new() {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(lanes) => lanes.vectorize(Draw { lanes, scene: self, faces, rays, scratch }),
            #[cfg(target_arch = "x86_64")]
            Arch::V3(lanes) => lanes.vectorize(Draw { lanes, scene: self, faces, rays, scratch }),
            _ => Scalar.vectorize(Draw { lanes: Scalar, scene: self, faces, rays, scratch }),
        }
    }
}

struct Draw<'a, L> {
    lanes: L,
    scene: Scene<'a>,
    faces: &'a [TileFace],
    rays: &'a TileRays,
    scratch: &'a mut Scratch,
}

impl<L: Lanes> NullaryFnOnce for Draw<'_, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, scene: Scene { view, vertices, layers }, faces: all, rays, scratch } = self;
        let Scratch { faces, list, depths, range } = scratch;
        let near = view.near_depth();
        for some in all.chunks(FACES_AT_ONCE) {
            faces.set(view, vertices, rays, some);
            for i in 0..some.len() {
                faces.hits(lanes, i, (view, vertices), rays, list, |pixel, hit| {
                    if hit.depth >= near {
                        *range = [range[0].min(hit.depth), range[1].max(hit.depth)];
                        insert(&mut depths[pixel % (TILE_PX * TILE_PX)][..layers], hit.depth);
                    }
                });
            }
        }
    }
}

/// Inserts a depth into the sorted nearest ones, dropping the largest.
#[inline(always)]
fn insert(nearest: &mut [f64], mut depth: f64) {
    for kept in nearest {
        if depth < *kept {
            std::mem::swap(kept, &mut depth);
        }
    }
}

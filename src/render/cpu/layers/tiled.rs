//! Faces in the tiles of an image, and the points at which rays pass through them.

use super::super::raster::boxes::{Bounds, BoxSource, project};
use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::lists::{ListedFace, TileFace, TileLists};
use super::super::raster::{FACES_AT_ONCE, Faces, Hit, TileRays};
use super::super::ray::ViewVertex;
use super::super::tiles::{PixelRect, TILE_PX, TileGrid};
use crate::camera::View;
use crate::task::Cancel;
use pulp::{Arch, NullaryFnOnce, Scalar, Simd};
use rayon::prelude::*;

/// Faces sorted into tiles by one thread: enough to hide the cost of a list per tile.
const FACES_PER_LIST: usize = 8 * 1024;

/// Faces sorted into the tiles of a view's image.
pub(super) struct TiledFaces<'a> {
    view: &'a View,
    vertices: &'a [ViewVertex],
    pub(super) grid: TileGrid,
    lists: Vec<TileLists<ListedFace>>,
}

/// Memory of a thread for drawing tiles.
pub(super) struct Scratch {
    faces: Faces,
    list: PixelList,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { faces: Faces::NONE, list: [0; TILE_PX * TILE_PX + BLOCK] }
    }
}

impl<'a> TiledFaces<'a> {
    /// Sorts faces; not all of them if `cancel` is raised.
    pub(super) fn of(view: &'a View, vertices: &'a [ViewVertex], faces: &[ListedFace], cancel: &Cancel) -> Self {
        let mut screen = Vec::new();
        project(view, vertices, None, cancel, &mut screen);
        let grid = TileGrid::of(view);
        let source = BoxSource { view, vertices, screen: &screen };
        let sorted = |faces: &[ListedFace]| {
            let mut lists = TileLists::default();
            if cancel.is_cancelled() {
                lists.begin(grid);
            } else {
                lists.fill(source, grid, faces, &mut Vec::new());
            }
            lists
        };
        let lists = faces.par_chunks(FACES_PER_LIST).map(sorted).collect();
        Self { view, vertices, grid, lists }
    }

    /// Calls `hit` with each pixel of a tile (row times [`TILE_PX`] plus column) whose ray is cast and passes through a face in front of the
    /// eye, and with that point; face by face.
    pub(super) fn draw(&self, tile: usize, scratch: &mut Scratch, mut hit: impl FnMut(usize, Hit)) {
        let rays = TileRays::new(self.view, bounds_of(self.grid.rect(tile)));
        for faces in self.lists.iter().map(|list| list.items(tile)) {
            let hit = &mut hit;
            match Arch::new() {
                #[cfg(target_arch = "x86_64")]
                Arch::V4(lanes) => lanes.vectorize(Draw { lanes, of: self, faces, rays: &rays, scratch, hit }),
                #[cfg(target_arch = "x86_64")]
                Arch::V3(lanes) => lanes.vectorize(Draw { lanes, of: self, faces, rays: &rays, scratch, hit }),
                _ => Scalar.vectorize(Draw { lanes: Scalar, of: self, faces, rays: &rays, scratch, hit }),
            }
        }
    }
}

struct Draw<'a, L, F> {
    lanes: L,
    of: &'a TiledFaces<'a>,
    faces: &'a [TileFace],
    rays: &'a TileRays,
    scratch: &'a mut Scratch,
    hit: &'a mut F,
}

impl<L: Lanes, F: FnMut(usize, Hit)> NullaryFnOnce for Draw<'_, L, F> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, of: TiledFaces { view, vertices, .. }, faces: all, rays, scratch, hit } = self;
        let Scratch { faces, list } = scratch;
        for some in all.chunks(FACES_AT_ONCE) {
            faces.set(view, vertices, rays, some);
            for i in 0..some.len() {
                faces.hits(lanes, i, (view, vertices), rays, list, &mut *hit);
            }
        }
    }
}

fn bounds_of(PixelRect { x, y, width, height }: PixelRect) -> Bounds {
    Bounds { x0: x, x1: x + width, y0: y, y1: y + height }
}

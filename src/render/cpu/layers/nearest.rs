//! The nearest depths of a tile's pixels.

use super::super::tiles::TILE_PX;
use super::tiled;

/// Maximum number of depth layers.
pub const MAX_LAYERS: usize = 3;

/// The nearest depths of a tile, and a thread's memory for drawing tiles.
pub(super) struct Nearest {
    /// Those of each pixel of the tile (row times [`TILE_PX`] plus column), ascending.
    pub(super) depths: [[f64; MAX_LAYERS]; TILE_PX * TILE_PX],
    /// Least and greatest of all depths.
    pub(super) range: [f64; 2],
    pub(super) scratch: tiled::Scratch,
}

impl Default for Nearest {
    fn default() -> Self {
        let (depths, range) = ([[f64::INFINITY; MAX_LAYERS]; TILE_PX * TILE_PX], [f64::INFINITY, f64::NEG_INFINITY]);
        Self { depths, range, scratch: tiled::Scratch::default() }
    }
}

impl Nearest {
    /// The nearest `layers` depths of a tile from `near` on.
    pub(super) fn find(&mut self, faces: &tiled::TiledFaces<'_>, tile: usize, layers: usize, near: f64) {
        let Self { depths, range, scratch } = self;
        *depths = [[f64::INFINITY; MAX_LAYERS]; TILE_PX * TILE_PX];
        *range = [f64::INFINITY, f64::NEG_INFINITY];
        let layers = layers.min(MAX_LAYERS);
        faces.draw(tile, scratch, |pixel, hit| {
            if hit.depth >= near {
                *range = [range[0].min(hit.depth), range[1].max(hit.depth)];
                insert(&mut depths[pixel % (TILE_PX * TILE_PX)][..layers], hit.depth);
            }
        });
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

//! Where the rays of a tile begin their paths through the active cells.
//!
//! A path begins where a ray enters an active cell through a face that has no active cell behind it, in front of the eye, or
//! within a cell that the eye is in. Exactly those starts are found that [`crossing`](super::super::ray::crossing) finds pixel
//! by pixel ([`raster`](super::super::raster) says why); depths, by which the paths of a ray are put in order, are right to a
//! few 2^-20 of the extent of the face.

use super::super::raster::boxes::Bounds;
use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::lists::TileFace;
use super::super::raster::{FACES_AT_ONCE, Faces, TileRays};
use super::super::ray::{Ray, ViewVertex};
use super::super::tiles::{PixelRect, TILE_PX};
use super::entries::{EntryBins, EyeCell};
use crate::camera::View;
use crate::mesh::Topology;
use pulp::{Arch, NullaryFnOnce, Scalar, Simd};

/// Where a path begins: in `cell`, through the face opposite its vertex `opposite`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    /// For the order of the paths of a ray only.
    pub(super) depth: f64,
    pub(super) cell: u32,
    pub(super) opposite: u32,
}

/// A start, and the pixel of its ray: row times the tile's width plus column.
pub(super) type PixelStart = (u32, Start);

/// Where all rays of a frame may begin.
#[derive(Clone, Copy)]
pub(super) struct Entries<'a> {
    pub(super) topology: &'a Topology,
    pub(super) view: &'a View,
    pub(super) vertices: &'a [ViewVertex],
    pub(super) bins: &'a EntryBins,
    /// Active cells that may contain the eye.
    pub(super) eye_cells: &'a [u32],
    /// Use no instructions that not every processor of its kind has.
    pub(super) portable: bool,
}

/// Buffers of a tile, used again from tile to tile.
pub(super) struct StartScratch {
    faces: Faces,
    /// Faces that are made ready together.
    batch: [TileFace; FACES_AT_ONCE],
    /// Pixels that a face may cover.
    candidates: PixelList,
    /// As they are found.
    found: Vec<PixelStart>,
    /// In order.
    starts: Vec<PixelStart>,
}

impl Default for StartScratch {
    fn default() -> Self {
        Self {
            faces: Faces::NONE,
            batch: [TileFace::UNUSED; FACES_AT_ONCE],
            candidates: [0; TILE_PX * TILE_PX + BLOCK],
            found: Vec::new(),
            starts: Vec::new(),
        }
    }
}

impl Entries<'_> {
    /// All starts of paths in a tile, by pixel and depth.
    pub(super) fn starts<'s>(&self, tile: usize, scratch: &'s mut StartScratch) -> &'s [PixelStart] {
        scratch.found.clear();
        let rect = self.bins.grid.rect(tile);
        let entries = *self;
        match if self.portable { Arch::Scalar } else { Arch::new() } {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(lanes) => lanes.vectorize(FindEntries { lanes, entries, tile, rect, scratch }),
            #[cfg(target_arch = "x86_64")]
            Arch::V3(lanes) => lanes.vectorize(FindEntries { lanes, entries, tile, rect, scratch }),
            _ => Scalar.vectorize(FindEntries { lanes: Scalar, entries, tile, rect, scratch }),
        }
        self.find_at_eye(rect, &mut scratch.found);
        sort(&scratch.found, &mut scratch.starts);
        &scratch.starts
    }

    /// The starts of rays in cells that they enter behind (or at) the eye and leave in front of it.
    fn find_at_eye(&self, rect: PixelRect, found: &mut Vec<PixelStart>) {
        for &cell in self.eye_cells {
            for pixel in 0..rect.width * rect.height {
                let (column, row) = (rect.x + pixel % rect.width, rect.y + pixel / rect.width);
                if !self.view.renders(column, row) {
                    continue;
                }
                let ray = Ray::of_pixel(self.view, column, row);
                if let Some(EyeCell { entry, opposite, .. }) = EyeCell::new(self.topology, self.vertices, &ray, cell) {
                    found.push((pixel as u32, Start { depth: entry.depth, cell, opposite }));
                }
            }
        }
    }
}

/// Finds the starts of a tile at entry faces.
struct FindEntries<'a, L> {
    lanes: L,
    entries: Entries<'a>,
    tile: usize,
    rect: PixelRect,
    scratch: &'a mut StartScratch,
}

impl<L: Lanes> NullaryFnOnce for FindEntries<'_, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, entries, tile, rect, scratch } = self;
        let bounds = Bounds { x0: rect.x, x1: rect.x + rect.width, y0: rect.y, y1: rect.y + rect.height };
        let rays = TileRays::new(entries.view, bounds);
        let StartScratch { faces, batch, candidates, found, .. } = scratch;
        let mut lists = entries.bins.faces(tile);
        let mut rest: &[TileFace] = &[];
        loop {
            let mut ready = 0;
            while ready < FACES_AT_ONCE {
                if rest.is_empty() {
                    let Some(next) = lists.next() else { break };
                    rest = next;
                    continue;
                }
                let (now, after) = rest.split_at(rest.len().min(FACES_AT_ONCE - ready));
                batch[ready..ready + now.len()].copy_from_slice(now);
                ready += now.len();
                rest = after;
            }
            if ready == 0 {
                return;
            }
            faces.set(entries.view, entries.vertices, &rays, &batch[..ready]);
            for i in 0..ready {
                faces.hits(lanes, i, (entries.view, entries.vertices), &rays, candidates, |pixel, hit| {
                    // A cell may be entered through the front of its faces only.
                    if !hit.is_turned {
                        let pixel = pixel / TILE_PX * rect.width + pixel % TILE_PX;
                        let [opposite, cell] = hit.cells;
                        found.push((pixel as u32, Start { depth: hit.depth, cell, opposite }));
                    }
                });
            }
        }
    }
}

/// Puts starts in order: by pixel, depth, and cell, so that the order does not depend on how they were found.
fn sort(found: &[PixelStart], sorted: &mut Vec<PixelStart>) {
    const PIXELS: usize = TILE_PX * TILE_PX;
    let mut ends = [0u32; PIXELS];
    for (pixel, _) in found {
        ends[*pixel as usize % PIXELS] += 1;
    }
    let mut sum = 0;
    for end in &mut ends {
        sum += std::mem::replace(end, sum);
    }
    sorted.clear();
    sorted.extend_from_slice(found);
    for start in found {
        // `ends` serves as the cursor, from where the starts of a pixel begin to where they end.
        let end = &mut ends[start.0 as usize % PIXELS];
        sorted[*end as usize] = *start;
        *end += 1;
    }
    let mut begin = 0;
    for end in ends {
        let end = end as usize;
        if end > begin + 1 {
            sorted[begin..end].sort_unstable_by(|(_, a), (_, b)| {
                a.depth.total_cmp(&b.depth).then(a.cell.cmp(&b.cell)).then(a.opposite.cmp(&b.opposite))
            });
        }
        begin = end;
    }
}

#[cfg(test)]
#[path = "starts_tests.rs"]
mod tests;

//! Starts of the paths of a tile's rays through the active cells.
//!
//! A path begins where a ray enters an active cell through a face that has no active cell behind it, in front of the eye, or within a
//! cell that contains the eye. The starts are exactly those that [`crossing`](super::super::ray::crossing) finds pixel by pixel (see
//! [`raster`](super::super::raster)); depths, by which the paths of a ray are sorted, are accurate to 2^-17 of the extent of the face,
//! and recomputed where that leaves the order open.

use super::super::raster::boxes::is_back_facing;
use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::lists::TileFace;
use super::super::raster::{FACES_AT_ONCE, Faces, TileRays};
use super::super::ray::{Ray, ViewVertex, crossing};
use super::super::tiles::{PixelRect, TILE_PX};
use super::entries::{EntryBins, EyeCell, face_of};
use super::place::EntryLists;
use super::rays::{RayPlane, TilesInLine};
use crate::camera::View;
use crate::mesh::Topology;
use pulp::{Arch, NullaryFnOnce, Scalar, Simd};
use std::cmp::Ordering;
use std::ops::Range;

/// Start of a path: in `cell`, through the face opposite its vertex `opposite`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    /// Depth, for the order of the paths of a ray only.
    pub(super) depth: f64,
    pub(super) cell: u32,
    pub(super) opposite: u32,
}

/// A start, and the pixel of its ray: row times the tile's width plus column.
pub(super) type PixelStart = (u32, Start);

/// Candidate entries of all rays of a frame.
#[derive(Clone, Copy)]
pub(super) struct Entries<'a> {
    pub(super) topology: &'a Topology,
    pub(super) view: &'a View,
    pub(super) vertices: &'a [ViewVertex],
    pub(super) bins: &'a EntryBins,
    /// Active cells that may contain the eye.
    pub(super) eye_cells: &'a [u32],
    /// Whether to avoid instructions that not every processor of the architecture has.
    pub(super) portable: bool,
}

/// Buffers of a tile, reused from tile to tile.
pub(super) struct StartScratch {
    faces: Faces,
    /// Faces set up together.
    batch: [TileFace; FACES_AT_ONCE],
    /// Pixels that a face may cover.
    candidates: PixelList,
    /// Starts as they are found.
    found: Vec<PixelStart>,
    /// Sorted starts.
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

impl<'a> Entries<'a> {
    /// The entries of a view.
    pub(super) fn of(topology: &'a Topology, view: &'a View, lists: &'a EntryLists, portable: bool) -> Self {
        let EntryLists { vertices, bins, eye_cells, .. } = lists;
        Self { topology, view, vertices, bins, eye_cells, portable }
    }

    /// Whether the box of an entry face overlaps some columns and rows of pixels.
    pub(super) fn reach(&self, columns: Range<usize>, rows: Range<usize>) -> bool {
        let is_back = |ids: [u32; 3]| is_back_facing(self.view, ids.map(|v| self.vertices[v as usize]));
        self.bins.reach(columns, rows, is_back)
    }

    /// All starts of paths in a tile of rays, sorted by pixel and depth.
    pub(super) fn starts<'s>(
        &self,
        plane: &RayPlane<'_>,
        rect: PixelRect,
        scratch: &'s mut StartScratch,
    ) -> &'s [PixelStart] {
        scratch.found.clear();
        let (entries, rays) = (*self, plane.tile_rays(rect));
        let feed = FaceFeed::new(self.bins, plane, rect);
        match if self.portable { Arch::Scalar } else { Arch::new() } {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(lanes) => lanes.vectorize(FindEntries { lanes, entries, feed, rays: &rays, rect, scratch }),
            #[cfg(target_arch = "x86_64")]
            Arch::V3(lanes) => lanes.vectorize(FindEntries { lanes, entries, feed, rays: &rays, rect, scratch }),
            _ => Scalar.vectorize(FindEntries { lanes: Scalar, entries, feed, rays: &rays, rect, scratch }),
        }
        self.find_at_eye(plane, (rect, &rays), &mut scratch.found);
        sort(&scratch.found, &mut scratch.starts);
        for starts in scratch.starts.chunk_by_mut(|a, b| a.0 == b.0) {
            if starts.array_windows().any(|[(_, a), (_, b)]| b.depth - a.depth < NEAR) {
                self.sort_near(&plane.ray(rect, starts[0].0 as usize), starts);
            }
        }
        &scratch.starts
    }

    /// Sorts the starts of a ray by depths recomputed independently of the tile.
    #[cold]
    #[inline(never)]
    fn sort_near(&self, ray: &Ray, starts: &mut [PixelStart]) {
        for (_, start) in &mut *starts {
            let ids = face_of(self.topology, start.cell, start.opposite as usize).vertices;
            start.depth = crossing(ray, self.vertices, ids).map_or(start.depth, |crossing| crossing.point.depth);
        }
        starts.sort_unstable_by(by_depth);
    }

    /// Finds the starts of rays in cells that they enter behind (or at) the eye and leave in front of it.
    fn find_at_eye(&self, plane: &RayPlane<'_>, (rect, rays): (PixelRect, &TileRays), found: &mut Vec<PixelStart>) {
        for &cell in self.eye_cells {
            for pixel in 0..rect.width * rect.height {
                if rays.rendered[pixel / rect.width] >> (pixel % rect.width) & 1 == 0 {
                    continue;
                }
                let ray = plane.ray(rect, pixel);
                if let Some(EyeCell { entry, opposite, .. }) = EyeCell::new(self.topology, self.vertices, &ray, cell) {
                    found.push((pixel as u32, Start { depth: entry.point.depth, cell, opposite }));
                }
            }
        }
    }
}

/// The entry faces that may cover a tile of rays.
struct FaceFeed<'a> {
    bins: &'a EntryBins,
    /// Columns and rows of the image tiles, with their lattice points.
    tiles: [TilesInLine; 2],
    /// Whether boxes apply unchanged, as every pixel is a lattice point.
    is_of_pixels: bool,
    /// The next tile, its next list, and the rest of the last list.
    tile: usize,
    list: usize,
    rest: &'a [TileFace],
}

impl<'a> FaceFeed<'a> {
    fn new(bins: &'a EntryBins, plane: &RayPlane<'_>, rect: PixelRect) -> Self {
        let (tiles, is_of_pixels) = (plane.image_tiles(rect), plane.has_all_places());
        Self { bins, tiles, is_of_pixels, tile: 0, list: 0, rest: &[] }
    }

    /// Writes the next faces to the front of `batch`; returns their number, 0 at the end.
    fn next(&mut self, batch: &mut [TileFace; FACES_AT_ONCE]) -> usize {
        let [columns, rows] = &self.tiles;
        let mut ready = 0;
        while ready < FACES_AT_ONCE {
            let Some((_, in_columns)) = columns.get(self.tile % columns.len()) else { break };
            let Some((row, in_rows)) = rows.get(self.tile / columns.len()) else { break };
            if self.rest.is_empty() {
                let tile = row * self.bins.grid.columns + columns[self.tile % columns.len()].0;
                match self.bins.list(self.list, tile) {
                    Some(list) => (self.rest, self.list) = (list, self.list + 1),
                    None => (self.tile, self.list) = (self.tile + 1, 0),
                }
                continue;
            }
            if self.is_of_pixels {
                let (now, after) = self.rest.split_at(self.rest.len().min(FACES_AT_ONCE - ready));
                batch[ready..ready + now.len()].copy_from_slice(now);
                (ready, self.rest) = (ready + now.len(), after);
                continue;
            }
            while let Some((face, after)) = self.rest.split_first()
                && ready < FACES_AT_ONCE
            {
                self.rest = after;
                if let Some(face) = face.in_places(in_columns, in_rows) {
                    batch[ready] = face;
                    ready += 1;
                }
            }
        }
        ready
    }
}

/// Finds the starts of a tile of rays at entry faces.
struct FindEntries<'a, L> {
    lanes: L,
    entries: Entries<'a>,
    feed: FaceFeed<'a>,
    rays: &'a TileRays,
    rect: PixelRect,
    scratch: &'a mut StartScratch,
}

impl<L: Lanes> NullaryFnOnce for FindEntries<'_, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, entries, mut feed, rays, rect, scratch } = self;
        let StartScratch { faces, batch, candidates, found, .. } = scratch;
        loop {
            let ready = feed.next(batch);
            if ready == 0 {
                return;
            }
            faces.set(entries.view, entries.vertices, rays, &batch[..ready]);
            for i in 0..ready {
                faces.hits(lanes, i, (entries.view, entries.vertices), rays, candidates, |pixel, hit| {
                    // A cell is entered only through the front of its faces.
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

/// Depths (local units) that differ by less are recomputed: in a tile they are accurate to 2^-17 of the extent of a face, which is below
/// 4.
const NEAR: f64 = 1.0 / (1 << 14) as f64;

fn by_depth((_, a): &PixelStart, (_, b): &PixelStart) -> Ordering {
    a.depth.total_cmp(&b.depth).then(a.cell.cmp(&b.cell)).then(a.opposite.cmp(&b.opposite))
}

/// Sorts starts by pixel, depth, and cell, so that the order does not depend on how they were found.
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
        // `ends` serves as the cursor, from the start of a pixel's range to its end.
        let end = &mut ends[start.0 as usize % PIXELS];
        sorted[*end as usize] = *start;
        *end += 1;
    }
    let mut begin = 0;
    for end in ends {
        let end = end as usize;
        if end > begin + 1 {
            sorted[begin..end].sort_unstable_by(by_depth);
        }
        begin = end;
    }
}

#[cfg(test)]
#[path = "starts_tests.rs"]
mod tests;

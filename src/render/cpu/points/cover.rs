//! The fragments of the points of a tile.

use super::super::super::medium::RayPoint;
use super::super::raster::TileRays;
use super::super::raster::boxes::Bounds;
use super::super::raster::fragments::PIXELS;
use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::lists::TileItem;
use super::super::ray::ViewVertex;
use super::super::tiles::{TILE_PX, TileBits};
use super::fragment::{self, Fragment, Fragments};
use super::shape::{Point, Shape, ShapeSource};
use super::tets::{Corners, Ends, TETS_AT_ONCE, Tets};
use super::tile::Scene;
use crate::render::points::{Compositing, Footprint, PointStyle};
use crate::task::Cancel;
use pulp::{Arch, NullaryFnOnce, Scalar, Simd};

/// Points drawn between two checks of the cancel flag.
const POINTS_AT_ONCE: usize = 1024;

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct CoverScratch {
    /// The points of the tile.
    points: Vec<TileItem<u32>>,
    tets: TetScratch,
}

/// Tets drawn together.
struct TetScratch {
    tets: Tets,
    corners: [Corners; TETS_AT_ONCE],
    cells: [TetCell; TETS_AT_ONCE],
    /// Pixels that a tet may cover.
    candidates: PixelList,
}

/// The cell of a tet.
#[derive(Clone, Copy)]
struct TetCell {
    cell: u32,
    bounds: Bounds,
    /// Length of the tet along a ray over that of the cell for which it stands.
    longer: f64,
    /// Depth of its centroid and its mean scalar.
    middle: RayPoint,
}

impl Default for TetScratch {
    fn default() -> Self {
        let middle = RayPoint { depth: 0.0, scalar: 0.0 };
        let cell = TetCell { cell: 0, bounds: Bounds { x0: 0, x1: 0, y0: 0, y1: 0 }, longer: 1.0, middle };
        Self {
            tets: Tets::NONE,
            corners: [[ViewVertex::default(); 4]; TETS_AT_ONCE],
            cells: [cell; TETS_AT_ONCE],
            candidates: [0; PIXELS + BLOCK],
        }
    }
}

impl<M, Y> Scene<'_, M, Y> {
    /// Lists the points of a tile. If their fragments are to be sorted, those nearer come first, so that little is left to be sorted.
    pub(super) fn list(&self, tile: usize, CoverScratch { points, .. }: &mut CoverScratch) {
        points.clear();
        (0..self.bins.chunk_count()).for_each(|chunk| points.extend(self.bins.items(chunk, tile)));
        if self.source.style.exact_order {
            points.sort_unstable_by_key(TileItem::depth_order);
        }
    }

    /// Finds the fragments of the wanted pixels, in list order, with the vectors of a processor; only some if the job is cancelled.
    pub(super) fn collect(&self, wanted: (&TileRays, &TileBits), scratch: &mut CoverScratch, found: &mut Fragments) {
        let finder = Finder { source: &self.source, cancel: self.cancel };
        match self.arch {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(lanes) => lanes.vectorize(Collect { lanes, finder, wanted, scratch, found }),
            #[cfg(target_arch = "x86_64")]
            Arch::V3(lanes) => lanes.vectorize(Collect { lanes, finder, wanted, scratch, found }),
            _ => Scalar.vectorize(Collect { lanes: Scalar, finder, wanted, scratch, found }),
        }
    }
}

/// What fragments are found by, whatever the medium.
#[derive(Clone, Copy)]
struct Finder<'a> {
    source: &'a ShapeSource<'a>,
    cancel: &'a Cancel,
}

/// Finds fragments; compiled for the vectors of each processor.
struct Collect<'a, L> {
    lanes: L,
    finder: Finder<'a>,
    wanted: (&'a TileRays, &'a TileBits),
    scratch: &'a mut CoverScratch,
    found: &'a mut Fragments,
}

impl<L: Lanes> NullaryFnOnce for Collect<'_, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, finder, wanted, scratch, found } = self;
        finder.collect(lanes, wanted, scratch, found);
    }
}

impl Finder<'_> {
    #[inline(always)]
    fn collect<L: Lanes>(
        &self,
        lanes: L,
        wanted: (&TileRays, &TileBits),
        scratch: &mut CoverScratch,
        found: &mut Fragments,
    ) {
        found.clear();
        let CoverScratch { points, tets, .. } = scratch;
        for points in points.chunks(POINTS_AT_ONCE) {
            if self.cancel.is_cancelled() {
                return;
            }
            if self.source.style.footprint == Footprint::Exact {
                // Not by a closure, which would be compiled without the processor's instructions.
                for points in points.chunks(TETS_AT_ONCE) {
                    self.cover_by_tets(lanes, points, wanted, tets, found);
                }
                continue;
            }
            for point in points {
                if let Some(shape) = self.source.point(point.item) {
                    self.cover(&shape, point.bounds(), wanted, found);
                }
            }
        }
    }

    /// Finds the fragments of some tets, of [`TETS_AT_ONCE`] at most.
    #[inline(always)]
    fn cover_by_tets<L: Lanes>(
        &self,
        lanes: L,
        items: &[TileItem<u32>],
        (rays, wanted): (&TileRays, &TileBits),
        TetScratch { tets, corners, cells, candidates }: &mut TetScratch,
        found: &mut Fragments,
    ) {
        let (view, style) = (self.source.view, self.source.style);
        let mut count = 0;
        for item in items.iter().take(TETS_AT_ONCE) {
            let Some(Point { cell, shape: Shape::Tet(tet, longer), center, mean, .. }) = self.source.point(item.item)
            else {
                continue;
            };
            let middle = RayPoint { depth: center.z, scalar: mean };
            (corners[count], cells[count]) = (tet, TetCell { cell, bounds: item.bounds(), longer, middle });
            count += 1;
        }
        tets.set(view, rays, corners, count);
        let are_as_hit = style.compositing == Compositing::Own && !style.constant_scalar;
        for (i, &TetCell { cell, bounds, longer, middle }) in cells.iter().enumerate().take(count) {
            tets.hits(lanes, i, (view, rays), bounds, (wanted, candidates), |pixels, mut which, ends| {
                if view.perspective {
                    which &= lanes.less_f64([0.0; 8], ends.depth[1]);
                }
                if are_as_hit && longer == 1.0 {
                    fragment::push_some(found, cell, which, pixels, ends);
                } else {
                    fragment::push_some(found, cell, which, pixels, &styled(ends, style, (middle, longer)));
                }
            });
        }
    }

    /// Finds the fragments of a point.
    #[inline(always)]
    fn cover(&self, point: &Point, bounds: Bounds, (rays, wanted): (&TileRays, &TileBits), found: &mut Fragments) {
        let is_gap = self.source.style.compositing == Compositing::Gap;
        let columns = ((1u32 << bounds.x1) - (1u32 << bounds.x0)) as u16;
        for (row, wanted) in wanted.iter().enumerate().take(bounds.y1).skip(bounds.y0) {
            let mut asked = wanted & columns;
            while asked != 0 {
                let pixel = row * TILE_PX + asked.trailing_zeros() as usize;
                asked &= asked - 1;
                if let Some(slab) = point.slab(self.source, rays.at(pixel)) {
                    let depth = [slab.middle, if is_gap { slab.middle } else { slab.thickness }];
                    fragment::push(found, pixel, Fragment { depth, scalar: [slab.scalar; 2], cell: point.cell });
                }
            }
        }
    }
}

/// Fragments that are not where rays enter and leave a cell and have not the scalars there: `middle` are depth and scalar of its centroid, its
/// length is to be multiplied by `longer`.
#[inline(never)]
fn styled(ends: &Ends, style: PointStyle, (middle, longer): (RayPoint, f64)) -> Ends {
    if style.compositing == Compositing::Gap {
        return Ends { depth: [[middle.depth; 8]; 2], scalar: [[middle.scalar; 8]; 2] };
    }
    let mut styled = *ends;
    if style.constant_scalar {
        styled.scalar = [[middle.scalar; 8]; 2];
    }
    if longer != 1.0 {
        let [entry, exit] = ends.depth;
        for l in 0..8 {
            let (middle, half) = (0.5 * (entry[l] + exit[l]), 0.5 * longer * (exit[l] - entry[l]));
            (styled.depth[0][l], styled.depth[1][l]) = (middle - half, middle + half);
        }
    }
    styled
}

//! The light of the rays of a tile whose segments are known, eight rays side by side.

use super::super::super::medium::RayLine;
use super::super::raster::TileRays;
use super::super::raster::fragments::{PIXELS, SegmentEnds};
use super::super::tiles::{TILE_PX, TilePixel};
use super::exact::{ExactLights, Optics};
use super::rows::{Lights, Out, RayEnd, Rows, RowsAhead, Unfinished};
use super::vector::{LANES, Lanes};
use super::{Rays, composite};
use crate::camera::View;
use crate::optics::exact::ExactTable;
use crate::stats::FrameStats;
use pulp::{Arch, NullaryFnOnce};
use std::ops::Range;

/// Segments of the rays of a tile, those of a ray in order.
pub(in crate::render::cpu) trait SegmentsByPixel {
    /// Where the segments of a pixel are.
    fn range(&self, pixel: usize) -> Range<usize>;

    /// Some of them.
    fn some(&self, range: Range<usize>) -> impl Iterator<Item = SegmentEnds>;
}

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(in crate::render::cpu) struct RowScratch {
    rows: Box<Rows>,
    ahead: RowsAhead,
}

/// Where the light of a tile goes.
pub(in crate::render::cpu) struct Target<'a> {
    pub(in crate::render::cpu) scratch: &'a mut RowScratch,
    /// The pixels of the tile, row by row.
    pub(in crate::render::cpu) pixels: &'a mut [TilePixel],
    /// What else is known of the rays if they go on later.
    pub(in crate::render::cpu) unfinished: Option<&'a mut [Unfinished]>,
}

/// The rays of a tile with their segments.
pub(in crate::render::cpu) struct SegmentRays<'a, S> {
    view: &'a View,
    rays: &'a TileRays,
    segments: S,
    /// The pixel to be looked at next.
    pixel: usize,
    own: [Option<Own>; LANES],
}

/// The ray of a lane.
struct Own {
    pixel: usize,
    /// Its segments still to come.
    rest: Range<usize>,
}

impl<'a, S: SegmentsByPixel> SegmentRays<'a, S> {
    pub(in crate::render::cpu) fn new((view, rays): (&'a View, &'a TileRays), segments: S) -> Self {
        Self { view, rays, segments, pixel: 0, own: [const { None }; LANES] }
    }

    /// Composites all of them; `None` if there are no vectors for that.
    pub(in crate::render::cpu) fn composite(
        self,
        arch: Arch,
        table: &'a ExactTable,
        early_termination: bool,
        into: Target<'a>,
    ) -> Option<FrameStats> {
        match arch {
            Arch::V4(lanes) => Some(lanes.vectorize(Composite { lanes, rays: self, table, early_termination, into })),
            Arch::V3(lanes) => Some(lanes.vectorize(Composite { lanes, rays: self, table, early_termination, into })),
            _ => None,
        }
    }

    #[inline(always)]
    fn composite_in<L: Lanes>(
        mut self,
        (lanes, table): (L, &ExactTable),
        early_termination: bool,
        Target { scratch: RowScratch { rows, ahead }, pixels, unfinished }: Target<'_>,
    ) -> FrameStats {
        let mut stats = FrameStats::default();
        let mut out = Out { pixels, unfinished, stats: &mut stats, early_termination };
        let mut lights = ExactLights::new(Optics { lanes, table }, self.view.near_depth());
        composite(&mut self, (rows, ahead), &mut out, &mut lights);
        // Fragments are counted as such.
        FrameStats { steps: 0, ..stats }
    }

    /// Writes segments of a lane into rows from `first` on.
    #[inline(always)]
    fn write(&self, rows: &mut Rows, lane: usize, first: usize, some: Range<usize>) {
        for (row, SegmentEnds { depth, scalar }) in (first..).zip(self.segments.some(some)) {
            [rows.from_depth[row][lane], rows.to_depth[row][lane]] = depth;
            [rows.from_scalar[row][lane], rows.to_scalar[row][lane]] = scalar;
            rows.alive[row] |= 1 << lane;
        }
    }
}

impl<S: SegmentsByPixel> Rays for SegmentRays<'_, S> {
    fn next(&mut self, lane: usize) -> Option<RayLine> {
        let mut rest = 0..0;
        while rest.is_empty() && self.pixel < PIXELS {
            rest = self.segments.range(self.pixel);
            self.pixel += 1;
        }
        self.own[lane] = None;
        if rest.is_empty() {
            return None;
        }
        let (pixel, width) = (self.pixel - 1, self.rays.bounds.x1 - self.rays.bounds.x0);
        self.own[lane] = Some(Own { pixel: pixel / TILE_PX * width + pixel % TILE_PX, rest });
        Some(self.rays.ray(self.view, pixel).line)
    }

    fn pixel(&self, lane: usize) -> Option<usize> {
        self.own[lane].as_ref().map(|own| own.pixel)
    }

    #[inline(always)]
    fn go_on<K: Lights>(&mut self, rows: &mut Rows, most: usize, alive: &mut u8, out: &mut Out<'_>) {
        rows.alive[..most].fill(0);
        for lane in 0..LANES {
            let mut row = 0;
            while row < most
                && let Some(Own { pixel, rest }) = &mut self.own[lane]
            {
                let some = rest.start..rest.end.min(rest.start + most - row);
                (rest.start, row) = (some.end, row + some.len());
                let (pixel, is_over) = (*pixel, rest.start == rest.end);
                self.write(rows, lane, row - some.len(), some);
                if is_over {
                    let next = self.next(lane);
                    if next.is_none() {
                        *alive &= !(1 << lane);
                    }
                    let (line, next) = (next.unwrap_or_default(), self.pixel(lane));
                    rows.ends.push(RayEnd { row: row - 1, lane, pixel, line, next });
                }
            }
            out.stats.steps += row as u64;
            rows.count = rows.count.max(row);
        }
        rows.ends.sort_unstable_by_key(|end| (end.row, end.lane));
    }
}

/// Composites rays; compiled for the vectors of each processor that has room for eight.
struct Composite<'a, S, L> {
    lanes: L,
    rays: SegmentRays<'a, S>,
    table: &'a ExactTable,
    early_termination: bool,
    into: Target<'a>,
}

impl<S: SegmentsByPixel, L: Lanes> NullaryFnOnce for Composite<'_, S, L> {
    type Output = FrameStats;

    #[inline(always)]
    fn call(self) -> FrameStats {
        let Self { lanes, rays, table, early_termination, into } = self;
        rays.composite_in((lanes, table), early_termination, into)
    }
}

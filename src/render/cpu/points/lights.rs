//! The light of the rays of a tile, eight side by side.

use super::super::super::medium::RayLine;
use super::super::lanes::exact::{ExactLights, Optics};
use super::super::lanes::rows::{Lights, Out, RayEnd, Rows, RowsAhead};
use super::super::lanes::vector::{LANES, Lanes};
use super::super::lanes::{Rays, composite};
use super::super::raster::TileRays;
use super::super::tiles::{TILE_PX, TilePixel};
use super::fragment::{FragmentsByPixel, PIXELS};
use crate::camera::View;
use crate::optics::exact::ExactTable;
use crate::stats::FrameStats;
use pulp::{Arch, NullaryFnOnce};
use std::ops::Range;

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct RowScratch {
    rows: Box<Rows>,
    ahead: RowsAhead,
}

/// The rays of a tile, each with its fragments in order.
pub(super) struct FragmentRays<'a> {
    view: &'a View,
    rays: &'a TileRays,
    fragments: &'a FragmentsByPixel<'a>,
    /// One scalar per cell, instead of those of fragments.
    scalars: Option<&'a [f32]>,
    /// The pixel to be looked at next.
    pixel: usize,
    own: [Option<Own>; LANES],
}

/// The ray of a lane.
struct Own {
    pixel: usize,
    /// Its fragments still to come.
    rest: Range<usize>,
}

impl<'a> FragmentRays<'a> {
    pub(super) fn new(
        (view, rays): (&'a View, &'a TileRays),
        fragments: &'a FragmentsByPixel<'a>,
        scalars: Option<&'a [f32]>,
    ) -> Self {
        Self { view, rays, fragments, scalars, pixel: 0, own: [const { None }; LANES] }
    }

    /// Composites all of them into the pixels of the tile, row by row; `None` if there are no vectors for that.
    pub(super) fn composite(
        self,
        arch: Arch,
        table: &'a ExactTable,
        early_termination: bool,
        into: (&'a mut RowScratch, &'a mut [TilePixel]),
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
        (RowScratch { rows, ahead }, pixels): (&mut RowScratch, &mut [TilePixel]),
    ) -> FrameStats {
        let mut stats = FrameStats::default();
        let mut out = Out { pixels, stats: &mut stats, early_termination };
        let mut lights = ExactLights::new(Optics { lanes, table }, self.view.near_depth());
        composite(&mut self, (rows, ahead), &mut out, &mut lights);
        // Fragments are counted as such.
        FrameStats { steps: 0, ..stats }
    }

    /// Writes fragments of a lane into rows from `first` on.
    #[inline(always)]
    fn write(&self, rows: &mut Rows, lane: usize, first: usize, some: Range<usize>) {
        for (row, &word) in (first..).zip(self.fragments.words(some)) {
            let fragment = self.fragments.of_word(word);
            [rows.from_depth[row][lane], rows.to_depth[row][lane]] = fragment.depth;
            let scalar = match self.scalars {
                None => fragment.scalar,
                Some(scalars) => [f64::from(scalars[fragment.cell as usize]); 2],
            };
            [rows.from_scalar[row][lane], rows.to_scalar[row][lane]] = scalar;
            rows.alive[row] |= 1 << lane;
        }
    }
}

impl Rays for FragmentRays<'_> {
    fn next(&mut self, lane: usize) -> Option<RayLine> {
        let mut rest = 0..0;
        while rest.is_empty() && self.pixel < PIXELS {
            rest = self.fragments.range(self.pixel);
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
struct Composite<'a, L> {
    lanes: L,
    rays: FragmentRays<'a>,
    table: &'a ExactTable,
    early_termination: bool,
    into: (&'a mut RowScratch, &'a mut [TilePixel]),
}

impl<L: Lanes> NullaryFnOnce for Composite<'_, L> {
    type Output = FrameStats;

    #[inline(always)]
    fn call(self) -> FrameStats {
        let Self { lanes, rays, table, early_termination, into } = self;
        rays.composite_in((lanes, table), early_termination, into)
    }
}

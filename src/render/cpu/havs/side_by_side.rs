//! The segments of paths, round by round, and the light of eight rays side by side.

use super::super::lanes::rows::Unfinished;
use super::super::lanes::segments::{RowScratch, SegmentRays, SegmentsByPixel, Target};
use super::super::raster::TileRays;
use super::super::raster::fragments::{PIXELS, SegmentEnds};
use super::super::tiles::TilePixel;
use super::fragment::Fragment;
use super::path::{Path, Way};
use crate::camera::View;
use crate::optics::exact::ExactTable;
use pulp::Arch;
use std::ops::Range;

/// Buffers of a tile, reused from tile to tile.
pub(super) struct SideBySide {
    segments: Segments,
    /// The paths before a round.
    before: [Path; PIXELS],
    unfinished: [Unfinished; PIXELS],
    rows: RowScratch,
}

/// Segments of a round, pixel by pixel.
struct Segments {
    all: Vec<SegmentEnds>,
    /// Where those of each pixel end; they begin where those of the pixel before end.
    ends: [u32; PIXELS],
}

impl Default for SideBySide {
    fn default() -> Self {
        Self {
            segments: Segments { all: Vec::new(), ends: [0; PIXELS] },
            before: [Path::START; PIXELS],
            unfinished: [Unfinished::NONE; PIXELS],
            rows: RowScratch::default(),
        }
    }
}

impl SegmentsByPixel for &Segments {
    fn range(&self, pixel: usize) -> Range<usize> {
        let begin = pixel.checked_sub(1).map_or(0, |before| self.ends[before]);
        begin as usize..self.ends[pixel] as usize
    }

    #[inline(always)]
    fn some(&self, range: Range<usize>) -> impl Iterator<Item = SegmentEnds> {
        self.all[range].iter().copied()
    }
}

impl SideBySide {
    /// Begins with rays without light.
    pub(super) fn begin_tile(&mut self) {
        self.unfinished.fill(Unfinished::NONE);
    }

    pub(super) fn begin_round(&mut self, paths: &[Path; PIXELS]) {
        self.before = *paths;
        self.segments.all.clear();
    }

    /// Advances a pixel's path; one scalar per cell, if `scalars` has these, counts instead of those of fragments. Pixels come in their order.
    #[inline(always)]
    pub(super) fn advance(&mut self, path: &mut Path, fragments: &[Fragment], (tie, scalars): (f64, Option<&[f32]>)) {
        for to in fragments {
            let Way::Cell(from, cell) = path.go_on(to, tie) else { continue };
            let scalar = match scalars {
                None => [from.scalar, to.scalar],
                Some(scalars) => [f64::from(scalars[cell as usize]); 2],
            };
            self.segments.all.push(SegmentEnds { depth: [from.depth, to.depth], scalar });
        }
    }

    /// Advances a pixel's path along fragments in the order of their depths, up to the depth `bound`; returns how many that are. `None`, and nothing is
    /// done, if two are closer than `tie`, whose order others decide.
    #[inline(always)]
    pub(super) fn advance_in_order(
        &mut self,
        path: &mut Path,
        fragments: impl Iterator<Item = Fragment>,
        (tie, bound, scalars): (f64, f64, Option<&[f32]>),
    ) -> Option<usize> {
        let (before, first) = (*path, self.segments.all.len());
        let (mut last, mut count) = (f64::NEG_INFINITY, 0);
        for to in fragments {
            let is_behind = to.depth - last > tie;
            if !is_behind {
                *path = before;
                self.segments.all.truncate(first);
                return None;
            }
            if to.depth >= bound - tie {
                break;
            }
            self.advance(path, &[to], (tie, scalars));
            (last, count) = (to.depth, count + 1);
        }
        Some(count)
    }

    /// Ends a pixel, whether it has been advanced or not.
    #[inline(always)]
    pub(super) fn end(&mut self, pixel: usize) {
        self.segments.ends[pixel] = self.segments.all.len() as u32;
    }

    /// Composites the segments of the round; returns the number of their pieces.
    pub(super) fn composite(
        &mut self,
        of_rays: (&View, &TileRays),
        (arch, table, early_termination): (Arch, &ExactTable, bool),
        pixels: &mut [TilePixel],
    ) -> u64 {
        let into = Target { scratch: &mut self.rows, pixels, unfinished: Some(&mut self.unfinished) };
        let rays = SegmentRays::new(of_rays, &self.segments);
        rays.composite(arch, table, early_termination, into).map_or(0, |counts| counts.segments)
    }

    /// Depth from which nothing is visible on the ray of a pixel, at this place in the image, if it came to that in this round.
    pub(super) fn became_opaque(&self, pixel: usize, place: usize) -> Option<f64> {
        let from = self.unfinished[place].opaque_from;
        (from < f64::INFINITY && !(&self.segments).range(pixel).is_empty()).then_some(from)
    }

    /// The path of a pixel that became opaque at this depth, along the fragments of the round.
    pub(super) fn path_to(&self, pixel: usize, opaque_from: f64, fragments: &[Fragment], tie: f64) -> Path {
        let mut path = self.before[pixel];
        for to in fragments {
            if let Way::Cell(from, _) = path.go_on(to, tie) {
                path.is_opaque = from.depth < to.depth && to.depth == opaque_from;
            }
        }
        path
    }
}

//! What the walk leaves for the light: segments of eight rays, row by row.

use super::super::super::super::medium::{RayLine, RayPoint};
use super::super::super::tiles::TilePixel;
use super::vector::{Eight, LANES};
use crate::stats::FrameStats;

/// Steps that are walked before their segments are composited, at most.
pub(super) const ROWS: usize = 32;

/// How many steps are walked before their segments are composited: few where rays become opaque, whose steps beyond are in vain, more
/// where they live. An image does not depend on it.
#[derive(Clone, Copy)]
pub(super) struct RowsAhead(usize);

impl Default for RowsAhead {
    fn default() -> Self {
        Self(2)
    }
}

impl RowsAhead {
    /// As many as there is room for.
    pub(super) fn all() -> Self {
        Self(ROWS)
    }

    pub(super) fn count(self) -> usize {
        self.0
    }

    /// After rows with so many steps, some of them in vain, in which some rays have become opaque. Half as many from a quarter in vain on,
    /// since beginning anew costs little beside that; twice as many if less than an eighth would be, with as many rays that end at any step.
    pub(super) fn learn(&mut self, steps: u64, in_vain: u64, opaque: u64) {
        if 4 * in_vain > steps {
            self.0 = (self.0 / 2).max(1);
        } else if 8 * (in_vain + opaque * self.0 as u64) < 2 * steps {
            self.0 = (2 * self.0).min(ROWS);
        }
    }
}

/// The last steps of eight rays: in each row the segment of each lane, from one (depth, scalar) place to the next.
#[repr(C, align(64))]
pub(super) struct Rows {
    pub(super) from_depth: [Eight; ROWS],
    pub(super) from_scalar: [Eight; ROWS],
    pub(super) to_depth: [Eight; ROWS],
    pub(super) to_scalar: [Eight; ROWS],
    /// The cells, as in [`CellNeighbour`](crate::mesh::CellNeighbour), for light that [asks for them](Lights::CELLS).
    pub(super) cell: [[u32; LANES]; ROWS],
    /// Bits of the lanes that have a segment.
    pub(super) alive: [u8; ROWS],
    pub(super) count: usize,
    /// Rays that end here, by row.
    pub(super) ends: Vec<RayEnd>,
}

/// A ray is at its end, and another one has its lane from the next row on.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayEnd {
    pub(super) row: usize,
    pub(super) lane: usize,
    /// Of the ray that ends.
    pub(super) pixel: usize,
    /// The next one.
    pub(super) line: RayLine,
}

impl Default for Rows {
    fn default() -> Self {
        let zero = [[0.0; LANES]; ROWS];
        Self {
            from_depth: zero,
            from_scalar: zero,
            to_depth: zero,
            to_scalar: zero,
            cell: [[0; LANES]; ROWS],
            alive: [0; ROWS],
            count: 0,
            ends: Vec::new(),
        }
    }
}

impl Rows {
    /// Where a step of a lane begins.
    #[inline(always)]
    pub(super) fn from(&self, row: usize, lane: usize) -> RayPoint {
        RayPoint { depth: self.from_depth[row][lane], scalar: self.from_scalar[row][lane] }
    }

    /// Where it ends.
    #[inline(always)]
    pub(super) fn to(&self, row: usize, lane: usize) -> RayPoint {
        RayPoint { depth: self.to_depth[row][lane], scalar: self.to_scalar[row][lane] }
    }

    /// Last row of the ray that has a lane in this one.
    #[cold]
    pub(super) fn last_row_of(&self, lane: usize, row: usize) -> usize {
        let end = self.ends.iter().find(|end| end.lane == lane && end.row >= row);
        end.map_or(self.count - 1, |end| end.row)
    }
}

/// Where rays leave their light.
pub(super) struct Out<'a> {
    pub(super) pixels: &'a mut [TilePixel],
    pub(super) stats: &'a mut FrameStats,
    /// Whether rays end where nothing behind can be seen: steps beyond have not been made.
    pub(super) early_termination: bool,
}

impl Out<'_> {
    /// A ray became opaque in this row.
    #[cold]
    pub(super) fn stop_early(&mut self, rows: &Rows, lane: usize, row: usize) {
        if self.early_termination {
            self.stats.rays_stopped_early += 1;
            self.stats.steps -= (rows.last_row_of(lane, row) - row) as u64;
        }
    }
}

/// The light of eight rays, one in each lane.
pub(super) trait Lights {
    /// Whether it asks in which cells segments are.
    const CELLS: bool;

    /// Composites all rows.
    fn composite(&mut self, rows: &mut Rows, out: &mut Out<'_>);

    /// Lanes with a ray that has nothing yet.
    fn begin(&mut self, lane: usize, line: RayLine);

    /// The light of a ray at its end.
    fn finish(&mut self, lane: usize, out: &mut Out<'_>, pixel: usize);

    /// Bits of the lanes whose rays are opaque.
    fn opaque(&self) -> u8;
}

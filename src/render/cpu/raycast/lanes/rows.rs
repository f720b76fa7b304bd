//! Buffer between walk and compositing: segments of eight rays, row by row.

use super::super::super::super::medium::{RayLine, RayPoint};
use super::super::super::tiles::TilePixel;
use super::vector::{Eight, LANES};
use crate::stats::FrameStats;

/// Maximum number of steps walked before their segments are composited.
pub(super) const ROWS: usize = 32;

/// Number of steps walked before their segments are composited: few where rays become opaque, as further steps are wasted, more
/// elsewhere. The image does not depend on it.
#[derive(Clone, Copy)]
pub(super) struct RowsAhead(usize);

impl Default for RowsAhead {
    fn default() -> Self {
        Self(2)
    }
}

impl RowsAhead {
    /// The maximum number of rows.
    pub(super) fn all() -> Self {
        Self(ROWS)
    }

    pub(super) fn count(self) -> usize {
        self.0
    }

    /// Adapts to rows with `steps` steps, `in_vain` of them wasted, in which `opaque` rays became opaque. Halves from a quarter wasted
    /// on, since restarting is cheap by comparison; doubles if less than an eighth would be, with as many rays that end at any step.
    pub(super) fn learn(&mut self, steps: u64, in_vain: u64, opaque: u64) {
        if 4 * in_vain > steps {
            self.0 = (self.0 / 2).max(1);
        } else if 8 * (in_vain + opaque * self.0 as u64) < 2 * steps {
            self.0 = (2 * self.0).min(ROWS);
        }
    }
}

/// The latest steps of eight rays: each row has one segment per lane, between two points of depth and scalar.
#[repr(C, align(64))]
pub(super) struct Rows {
    pub(super) from_depth: [Eight; ROWS],
    pub(super) from_scalar: [Eight; ROWS],
    pub(super) to_depth: [Eight; ROWS],
    pub(super) to_scalar: [Eight; ROWS],
    /// The cells, as in [`CellNeighbour`](crate::mesh::CellNeighbour), for light that [needs them](Lights::CELLS).
    pub(super) cell: [[u32; LANES]; ROWS],
    /// Bits of the lanes that have a segment.
    pub(super) alive: [u8; ROWS],
    pub(super) count: usize,
    /// Ends of rays, by row.
    pub(super) ends: Vec<RayEnd>,
}

/// The end of a ray; another one takes its lane from the next row on.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayEnd {
    pub(super) row: usize,
    pub(super) lane: usize,
    /// Pixel of the ray that ends.
    pub(super) pixel: usize,
    /// Line of the next ray.
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
    /// Start of a lane's step.
    #[inline(always)]
    pub(super) fn from(&self, row: usize, lane: usize) -> RayPoint {
        RayPoint { depth: self.from_depth[row][lane], scalar: self.from_scalar[row][lane] }
    }

    /// End of a lane's step.
    #[inline(always)]
    pub(super) fn to(&self, row: usize, lane: usize) -> RayPoint {
        RayPoint { depth: self.to_depth[row][lane], scalar: self.to_scalar[row][lane] }
    }

    /// Last row of the ray that occupies a lane in this row.
    #[cold]
    pub(super) fn last_row_of(&self, lane: usize, row: usize) -> usize {
        let end = self.ends.iter().find(|end| end.lane == lane && end.row >= row);
        end.map_or(self.count - 1, |end| end.row)
    }
}

/// Output of finished rays.
pub(super) struct Out<'a> {
    pub(super) pixels: &'a mut [TilePixel],
    pub(super) stats: &'a mut FrameStats,
    /// Whether rays end once opaque: further steps are then not counted.
    pub(super) early_termination: bool,
}

impl Out<'_> {
    /// Records that a ray became opaque in this row.
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
    /// Whether compositing needs the cells of segments.
    const CELLS: bool;

    /// Composites all rows.
    fn composite(&mut self, rows: &mut Rows, out: &mut Out<'_>);

    /// Starts a ray without light in a lane.
    fn begin(&mut self, lane: usize, line: RayLine);

    /// Outputs the light of a finished ray.
    fn finish(&mut self, lane: usize, out: &mut Out<'_>, pixel: usize);

    /// Bits of the lanes whose rays are opaque.
    fn opaque(&self) -> u8;
}

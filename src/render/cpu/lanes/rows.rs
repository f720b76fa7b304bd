//! Buffer between walk and compositing: segments of eight rays, row by row.

use super::super::super::medium::{RayLine, RayPoint};
use super::super::tiles::TilePixel;
use super::cut::Cuts;
use super::vector::{Eight, LANES};
use crate::stats::FrameStats;

/// Maximum number of steps walked before their segments are composited.
pub(in crate::render::cpu) const ROWS: usize = 32;

/// Number of steps walked before their segments are composited: few where rays become opaque, as further steps are wasted, more
/// elsewhere. The image does not depend on it.
#[derive(Clone, Copy)]
pub(in crate::render::cpu) struct RowsAhead(usize);

impl Default for RowsAhead {
    fn default() -> Self {
        Self(2)
    }
}

impl RowsAhead {
    /// The maximum number of rows.
    pub(in crate::render::cpu) fn all() -> Self {
        Self(ROWS)
    }

    pub(in crate::render::cpu) fn count(self) -> usize {
        self.0
    }

    /// Adapts to rows with `steps` steps, `in_vain` of them wasted, in which `opaque` rays became opaque. Halves from a quarter wasted
    /// on, since restarting is cheap by comparison; doubles if less than an eighth would be, with as many rays that end at any step.
    pub(in crate::render::cpu) fn learn(&mut self, steps: u64, in_vain: u64, opaque: u64) {
        if 4 * in_vain > steps {
            self.0 = (self.0 / 2).max(1);
        } else if 8 * (in_vain + opaque * self.0 as u64) < 2 * steps {
            self.0 = (2 * self.0).min(ROWS);
        }
    }
}

/// The latest steps of eight rays: each row has one segment per lane, between two points of depth and scalar.
#[repr(C, align(64))]
pub(in crate::render::cpu) struct Rows {
    pub(in crate::render::cpu) from_depth: [Eight; ROWS],
    pub(in crate::render::cpu) from_scalar: [Eight; ROWS],
    pub(in crate::render::cpu) to_depth: [Eight; ROWS],
    pub(in crate::render::cpu) to_scalar: [Eight; ROWS],
    /// The cells, as in [`CellNeighbour`](crate::mesh::CellNeighbour), for light that [needs them](Lights::CELLS).
    pub(in crate::render::cpu) cell: [[u32; LANES]; ROWS],
    /// Bits of the lanes that have a segment.
    pub(in crate::render::cpu) alive: [u8; ROWS],
    pub(in crate::render::cpu) count: usize,
    /// Ends of rays, by row.
    pub(in crate::render::cpu) ends: Vec<RayEnd>,
    /// What there is besides where segments were cut at fragments of other layers.
    pub(in crate::render::cpu) cuts: Option<Box<Cuts>>,
}

/// The end of a ray; another one takes its lane from the next row on.
#[derive(Clone, Copy, Debug)]
pub(in crate::render::cpu) struct RayEnd {
    pub(in crate::render::cpu) row: usize,
    pub(in crate::render::cpu) lane: usize,
    /// Pixel of the ray that ends.
    pub(in crate::render::cpu) pixel: usize,
    /// Line of the next ray.
    pub(in crate::render::cpu) line: RayLine,
    /// Pixel of the next ray, if there is one.
    pub(in crate::render::cpu) next: Option<usize>,
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
            cuts: None,
        }
    }
}

impl Rows {
    /// Start of a lane's step.
    #[inline(always)]
    pub(in crate::render::cpu) fn from(&self, row: usize, lane: usize) -> RayPoint {
        RayPoint { depth: self.from_depth[row][lane], scalar: self.from_scalar[row][lane] }
    }

    /// End of a lane's step.
    #[inline(always)]
    pub(in crate::render::cpu) fn to(&self, row: usize, lane: usize) -> RayPoint {
        RayPoint { depth: self.to_depth[row][lane], scalar: self.to_scalar[row][lane] }
    }

    /// Steps that a lane's ray has made behind the one in a row; `None` if the row is behind all of them.
    #[cold]
    fn steps_behind(&self, lane: usize, row: usize) -> Option<u64> {
        let end = self.ends.iter().find(|end| end.lane == lane && end.row >= row);
        match &self.cuts {
            None => Some((end.map_or(self.count - 1, |end| end.row) - row) as u64),
            Some(cuts) => cuts.steps_behind(lane, row, end.map(|end| end.row)),
        }
    }
}

/// What is known of a ray that goes on later, besides its pixel.
#[derive(Clone, Copy, Debug)]
pub(in crate::render::cpu) struct Unfinished {
    /// As in [`Accumulator`](crate::optics::Accumulator).
    pub(in crate::render::cpu) transmittance: f32,
    pub(in crate::render::cpu) carried: f32,
    /// Depth from which nothing is visible; infinite if there is none.
    pub(in crate::render::cpu) opaque_from: f64,
}

impl Unfinished {
    /// A ray without light.
    pub(in crate::render::cpu) const NONE: Self = Self { transmittance: 1.0, carried: 0.0, opaque_from: f64::INFINITY };
}

/// Output of finished rays.
pub(in crate::render::cpu) struct Out<'a> {
    pub(in crate::render::cpu) pixels: &'a mut [TilePixel],
    /// What else is known of the rays of pixels that go on later; `None` if all of a ray comes at once.
    pub(in crate::render::cpu) unfinished: Option<&'a mut [Unfinished]>,
    pub(in crate::render::cpu) stats: &'a mut FrameStats,
    /// Whether rays end once opaque: further steps are then not counted.
    pub(in crate::render::cpu) early_termination: bool,
}

impl Out<'_> {
    /// Records that a ray became opaque in this row.
    #[cold]
    pub(in crate::render::cpu) fn stop_early(&mut self, rows: &Rows, lane: usize, row: usize) {
        if self.early_termination
            && let Some(behind) = rows.steps_behind(lane, row)
        {
            self.stats.rays_stopped_early += 1;
            self.stats.steps -= behind;
        }
    }
}

/// The light of eight rays, one in each lane.
pub(in crate::render::cpu) trait Lights {
    /// Whether compositing needs the cells of segments.
    const CELLS: bool;

    /// Composites all rows.
    fn composite(&mut self, rows: &mut Rows, out: &mut Out<'_>);

    /// Starts a ray in a lane, with the pixel if there is a ray: without light, unless it was unfinished.
    fn begin(&mut self, lane: usize, line: RayLine, pixel: Option<usize>, out: &Out<'_>);

    /// Outputs the light of a finished ray.
    fn finish(&mut self, lane: usize, out: &mut Out<'_>, pixel: usize);

    /// Bits of the lanes whose rays are opaque.
    fn opaque(&self) -> u8;
}

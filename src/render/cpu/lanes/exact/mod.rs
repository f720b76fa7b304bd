//! The light of eight rays side by side, for the exact integrator.
//!
//! ```text
//! for each row of segments
//!     drop those behind an opaque piece
//!     cut those that begin in front of `front`, drop those that end there
//!     the parts of its segments up to the next node of the transfer function
//!         a step: two optical depths and two colours for each lane, zero where a lane has no piece
//!     for each lane with nodes on the way: the pieces from node to node, a run: two optical depths and the place in the table
//!     the parts behind the last nodes, another step
//! for each pair of steps or runs of up to eight
//!     weigh their pieces side by side
//!     add them to the light of their lanes, one step or run after the other
//!     at the end of a row: opaque lanes take no more light, the others that of the fragments of other layers there
//! ```
//!
//! Every operation is one of [`RayLight`](super::super::light::RayLight) and [`ExactTable`], on the same numbers. Pieces of no
//! optical depth have no weight: a lane without a piece is one with such a piece. An opaque ray is one with no
//! transmittance left.
//!
//! Shares of a frame's time (samples of `perf`; two threads of an EPYC with AVX-512; graded Delaunay meshes):
//!
//! | | whole pieces | weights of pieces | steps from cell to cell | entries |
//! |---|---|---|---|---|
//! | 105k cells, tents of 0.8 | 59 % | 8 % | 8 % | 1 % |
//! | 11.6k cells, dense | 48 % | 8 % | 7 % | 2 % |
//! | 1.007M cells, dense | 36 % | 7 % | 22 % | 1 % |
//! | 105k cells, three tents linear in extinction, few nodes | 11 % | 4 % | 35 % | 4 % |
//! | 1.007M cells, the same | 9 % | 3 % | 23 % | 13 % |
//!
//! These are of before runs were composited in themselves, and behind the ray once, and looked for only where a segment crosses more than one
//! node: with tents of 0.8 a frame takes 0.66 to 0.71 of that time, dense 0.81 to 0.92, in haze 0.88 to 0.98 (Xeon).
//!
//! Tried and not kept (ratios of times, new over old):
//! - Runs behind the ray in all lanes at once: tents 0.95 to 1.01, dense 1.06 to 1.10.
//! - Whole pieces of eight rays side by side, one of each: tents 1.7 to 2.0, dense 1.1 to 1.3, since few rays cross as many nodes at once.
//! - The light of up to eight whole pieces as a polynomial of their optical depth, by moments of the table: dense, 11.6k cells 0.83 to 0.90, but
//!   1.007M cells 1.09 to 1.14, and haze there 1.15 to 1.20.
//! - No light in clear cells that rays go through, by the bit of the cell: 0.99 to 1.02.
//! - The optical depth of a lane summed up while its segments are split, so that nothing is split behind 14, and thick pieces weighed in the loop of
//!   the thin ones, which then does not stay in registers: together they cost 4 to 10 % of a dense frame.

mod intervals;
mod split;
mod steps;
mod whole;

use super::super::super::medium::RayLine;
use super::super::tiles::TilePixel;
use super::rows::{Lights, Out, Rows, Unfinished};
use super::vector::{Eight, LANES, Lanes};
use crate::optics::exact::ExactTable;
use intervals::Intervals;
use steps::{ROOM, Step, Steps};

/// One f32 per lane.
type EightF32 = [f32; LANES];

/// State shared by all rays.
#[derive(Clone, Copy)]
pub(in crate::render::cpu) struct Optics<'a, L> {
    pub(in crate::render::cpu) lanes: L,
    pub(in crate::render::cpu) table: &'a ExactTable,
}

/// The light of eight rays.
#[repr(C, align(64))]
pub(in crate::render::cpu) struct ExactLights<'a, L> {
    optics: Optics<'a, L>,
    intervals: Intervals<Eight, EightF32>,
    /// Indices of these intervals in the table.
    interval: [usize; LANES],
    steps: Steps,
    length_per_depth: Eight,
    /// Depth up to which the rays have been composited, or the near distance.
    front: Eight,
    /// Bits of the lanes whose `front` is the end of a segment.
    composited: u8,
    /// Bits of the lanes that have passed an opaque piece: their segments are no longer split.
    closed: u8,
    near_distance: f64,
    /// Red, green, blue and opacity.
    rgba: [EightF32; 4],
    transmittance: EightF32,
    carried: EightF32,
    /// Depth of the first visible point.
    visible_from: Eight,
    /// Bits of the lanes whose rays have met something visible, and of those that are opaque.
    seen: u8,
    opaque: u8,
    /// Depth from which nothing is visible.
    opaque_from: Eight,
    /// Bits of the lanes with a visible piece in the current row of steps.
    row_visible: u8,
    /// Ray ends already processed.
    ends_passed: usize,
}

impl<'a, L: Lanes> ExactLights<'a, L> {
    pub(in crate::render::cpu) fn new(optics: Optics<'a, L>, near_distance: f64) -> Self {
        let zero = [0.0; LANES];
        // An empty interval.
        let intervals = Intervals {
            lo: [f64::INFINITY; LANES],
            hi: [f64::NEG_INFINITY; LANES],
            below: [f64::NEG_INFINITY; LANES],
            above: [f64::INFINITY; LANES],
            origin: zero,
            per_width: zero,
            at_foot: [[0.0; LANES]; 4],
            rise: [[0.0; LANES]; 4],
        };
        let empty = [[0.0; LANES]; ROOM];
        let steps = Steps {
            near_depth: empty,
            far_depth: empty,
            near: [[[0.0; LANES]; 3]; ROOM],
            far: [[[0.0; LANES]; 3]; ROOM],
            about: [Step::default(); ROOM],
            count: 0,
        };
        Self {
            optics,
            intervals,
            interval: [0; LANES],
            steps,
            length_per_depth: zero,
            front: [near_distance; LANES],
            composited: 0,
            closed: 0,
            near_distance,
            rgba: [[0.0; LANES]; 4],
            transmittance: [1.0; LANES],
            carried: [0.0; LANES],
            visible_from: [f64::INFINITY; LANES],
            seen: 0,
            opaque: 0,
            opaque_from: [f64::INFINITY; LANES],
            row_visible: 0,
            ends_passed: 0,
        }
    }

    /// Resets a lane's splitting state for a new ray.
    #[inline(always)]
    fn change_ray(&mut self, lane: usize, line: RayLine) {
        self.length_per_depth[lane] = line.length_per_depth;
        self.front[lane] = self.near_distance;
        self.composited &= !(1 << lane);
        self.closed &= !(1 << lane);
    }

    /// Takes up the light of a ray that was unfinished, in a lane without light.
    #[inline(always)]
    fn take_up(&mut self, lane: usize, pixel: Option<usize>, out: &Out<'_>) {
        let (Some(unfinished), Some(pixel)) = (&out.unfinished, pixel) else { return };
        let Unfinished { transmittance, carried, opaque_from } = unfinished[pixel];
        let TilePixel { rgba, depth } = out.pixels[pixel];
        for (channel, value) in self.rgba.iter_mut().zip(rgba) {
            channel[lane] = value;
        }
        (self.transmittance[lane], self.carried[lane]) = (transmittance, carried);
        (self.visible_from[lane], self.opaque_from[lane]) = (depth, opaque_from);
        self.seen |= u8::from(depth < f64::INFINITY) << lane;
        self.opaque |= u8::from(opaque_from < f64::INFINITY) << lane;
    }
}

impl<L: Lanes> Lights for ExactLights<'_, L> {
    const CELLS: bool = false;

    #[inline(always)]
    fn composite(&mut self, rows: &mut Rows, out: &mut Out<'_>) {
        let lanes = self.optics.lanes;
        let mut ends = 0;
        self.ends_passed = 0;
        let mut intervals = self.intervals.load(lanes);
        for row in 0..rows.count {
            while let Some(end) = rows.ends.get(ends)
                && end.row < row
            {
                self.change_ray(end.lane, end.line);
                ends += 1;
            }
            self.split_row(&mut intervals, rows, row, out);
        }
        self.intervals = intervals.store(lanes);
        for end in &rows.ends[ends..] {
            self.change_ray(end.lane, end.line);
        }
        self.add_steps(rows, out);
        self.pass_ends(rows, rows.count, out);
        debug_assert!(self.closed & !self.opaque == 0, "what is not split is not seen");
    }

    fn begin(&mut self, lane: usize, line: RayLine, pixel: Option<usize>, out: &Out<'_>) {
        self.change_ray(lane, line);
        self.take_up(lane, pixel, out);
    }

    fn finish(&mut self, lane: usize, out: &mut Out<'_>, pixel: usize) {
        out.stats.rays_hit += 1;
        let rgba = self.rgba.map(|channel| channel[lane]);
        out.pixels[pixel] = TilePixel { rgba, depth: self.visible_from[lane] };
        if let Some(unfinished) = &mut out.unfinished {
            let (transmittance, carried) = (self.transmittance[lane], self.carried[lane]);
            unfinished[pixel] = Unfinished { transmittance, carried, opaque_from: self.opaque_from[lane] };
        }
        self.rgba.iter_mut().for_each(|channel| channel[lane] = 0.0);
        (self.transmittance[lane], self.carried[lane]) = (1.0, 0.0);
        self.visible_from[lane] = f64::INFINITY;
        self.seen &= !(1 << lane);
        self.opaque &= !(1 << lane);
        self.opaque_from[lane] = f64::INFINITY;
    }

    fn opaque(&self) -> u8 {
        self.opaque
    }
}

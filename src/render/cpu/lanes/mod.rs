//! Eight rays side by side, one in each lane of a vector: their segments and their light.
//!
//! ```text
//! while there are rays
//!     while there is room for a row, of few where rays have become opaque
//!         the next segment of each lane is a part of the row
//!         at the end of its ray the next ray takes the lane
//!     the rows are composited
//! ```
//!
//! Where segments come from is left to [`Rays`], what becomes of them to [`Lights`]. Fragments of other layers [cut](cut) them before.

pub(in crate::render::cpu) mod cut;
pub(in crate::render::cpu) mod exact;
pub(in crate::render::cpu) mod rows;
pub(in crate::render::cpu) mod segments;
pub(in crate::render::cpu) mod vector;

use super::super::medium::RayLine;
use rows::{Lights, Out, Rows, RowsAhead};
use vector::LANES;

/// Where segments of rays come from.
pub(in crate::render::cpu) trait Rays {
    /// Gives a lane the next ray; its line, or `None` if there is none.
    fn next(&mut self, lane: usize) -> Option<RayLine>;

    /// The pixel of the ray in a lane.
    fn pixel(&self, lane: usize) -> Option<usize>;

    /// Appends rows up to `most` in all, at least one, and the ends of rays in them, whose lanes are given the next rays. Clears the bits
    /// of `alive` of the lanes without one, and counts the segments as steps.
    fn go_on<K: Lights>(&mut self, rows: &mut Rows, most: usize, alive: &mut u8, out: &mut Out<'_>);
}

/// Composites all rays, each from its first segment on until it ends or is opaque. `ahead` is carried over between tiles, since
/// neighbours are similar.
#[inline(always)]
pub(in crate::render::cpu) fn composite<R: Rays, K: Lights>(
    rays: &mut R,
    (rows, ahead): (&mut Rows, &mut RowsAhead),
    out: &mut Out<'_>,
    lights: &mut K,
) {
    let mut alive = 0u8;
    for lane in 0..LANES {
        if let Some(line) = rays.next(lane) {
            alive |= 1 << lane;
            lights.begin(lane, line, rays.pixel(lane), out);
        }
    }
    while alive != 0 {
        rows.count = 0;
        rows.ends.clear();
        let before = (out.stats.steps, out.stats.rays_stopped_early);
        rays.go_on::<K>(rows, ahead.count(), &mut alive, out);
        let walked = out.stats.steps;
        lights.composite(rows, out);
        if !out.early_termination {
            *ahead = RowsAhead::all();
            continue;
        }
        ahead.learn(walked - before.0, walked - out.stats.steps, out.stats.rays_stopped_early - before.1);
        let mut opaque = alive & lights.opaque();
        while opaque != 0 {
            let lane = opaque.trailing_zeros() as usize;
            opaque &= opaque - 1;
            if let Some(pixel) = rays.pixel(lane) {
                lights.finish(lane, out, pixel);
            }
            let next = rays.next(lane);
            if next.is_none() {
                alive &= !(1 << lane);
            }
            lights.begin(lane, next.unwrap_or_default(), rays.pixel(lane), out);
        }
    }
}

//! What a ray has gathered on its way, segment by segment.
//!
//! An image does not depend on which clear cells are left out: nothing here changes where a segment shows nothing, and the
//! place in the table is the same whether the ray has come to it through clear cells or begins there.

use super::super::tiles::TilePixel;
use super::super::visible::{first_visible, first_visible_in_joint_table};
use crate::optics::joint::JointSegment;
use crate::optics::{Accumulator, Integrator};
use crate::stats::FrameStats;

/// The light of a ray.
#[derive(Clone, Copy)]
pub(super) struct RayLight<P> {
    light: Accumulator,
    /// Place in the table, if it is known for the place from which the ray goes on.
    place: Option<P>,
    /// Depth of the first visible place.
    visible_from: f64,
    /// Depth up to which the ray has been composited, or the near distance.
    front: f64,
    /// Whether `front` is the end of a segment rather than the near distance.
    composited: bool,
    segments: u32,
    out_of_order: u32,
}

impl<P: Copy> RayLight<P> {
    /// A ray that sees nothing nearer than this.
    pub(super) fn new(near_distance: f64) -> Self {
        Self {
            light: Accumulator::CLEAR,
            place: None,
            visible_from: f64::INFINITY,
            front: near_distance,
            composited: false,
            segments: 0,
            out_of_order: 0,
        }
    }

    /// The ray goes on somewhere else.
    #[inline(always)]
    pub(super) fn leave(&mut self) {
        self.place = None;
    }

    /// Goes on from one (depth, scalar) place to the next: composites the segment between them, or the part of it behind
    /// what there is, unless nothing behind can be seen.
    #[inline(always)]
    pub(super) fn go_on<I: Integrator<Place = P>>(
        &mut self,
        table: &I,
        length_per_depth: f64,
        from: (f64, f64),
        to: (f64, f64),
    ) {
        let Some(from) = self.behind_front(from, to) else { return };
        let place = self.place.get_or_insert_with(|| table.enter(from.1));
        let length = (to.0 - from.0) * length_per_depth;
        let pieces = table.segment(place, from.1, to.1, length, &mut self.light) as u32;
        if pieces == 0 {
            return;
        }
        // A table may show light before the transfer function has any: the ray is then asked again.
        if self.visible_from == f64::INFINITY {
            self.visible_from = first_visible(table, from, to);
        }
        self.segments += pieces;
        (self.front, self.composited) = (to.0, true);
    }

    /// As [`Self::go_on`], along a segment between two depths through a cell; its length is in the unit of extinctions.
    pub(super) fn go_on_in_grid(&mut self, segment: &JointSegment, length_per_depth: f64, from: f64, to: f64) {
        // In place of scalars, shares of the segment.
        let Some((front, share)) = self.behind_front((from, 0.0), (to, 1.0)) else { return };
        let length = (to - front) * length_per_depth;
        let pieces = segment.composite(share, 1.0, length, &mut self.light) as u32;
        if pieces == 0 {
            return;
        }
        if self.visible_from == f64::INFINITY {
            self.visible_from = first_visible_in_joint_table(segment, (from, to), share);
        }
        self.segments += pieces;
        (self.front, self.composited) = (to, true);
    }

    /// Where a segment between two places begins to lie behind what has been composited; `None` if it does not, or if nothing behind
    /// can be seen.
    #[inline(always)]
    fn behind_front(&mut self, from: (f64, f64), to: (f64, f64)) -> Option<(f64, f64)> {
        let is_forward = to.0 > from.0;
        if !is_forward || self.light.is_opaque() {
            self.place = None;
            return None;
        }
        if from.0 >= self.front {
            return Some(from);
        }
        self.place = None;
        if to.0 <= self.front {
            self.out_of_order += u32::from(self.composited);
            return None;
        }
        Some(cut(from, to, self.front))
    }

    /// Whether nothing behind can be seen.
    #[inline(always)]
    pub(super) fn is_opaque(&self) -> bool {
        self.light.is_opaque()
    }

    pub(super) fn pixel(&self) -> TilePixel {
        TilePixel { rgba: self.light.pixel(), depth: self.visible_from }
    }

    /// Adds what compositing has cost.
    pub(super) fn count(&self, stats: &mut FrameStats) {
        stats.segments += u64::from(self.segments);
        stats.out_of_order += u64::from(self.out_of_order);
    }
}

/// Where a segment that begins in front of a depth passes it.
#[inline(always)]
pub(super) fn cut(from: (f64, f64), to: (f64, f64), depth: f64) -> (f64, f64) {
    let share = (depth - from.0) / (to.0 - from.0);
    (depth, from.1 + share * (to.1 - from.1))
}

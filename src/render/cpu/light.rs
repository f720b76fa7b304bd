//! What a ray has gathered on its way, segment by segment.
//!
//! An image does not depend on which transparent cells are left out: nothing here changes where a segment shows nothing, and the
//! place in the table is the same whether the ray has come to it through transparent cells or begins there.

use super::super::layers::Ahead;
use super::super::medium::{Medium, Segment};
use super::tiles::TilePixel;
use crate::optics::Accumulator;
use glam::Vec4;

/// The light of a ray. `R` is what its medium knows of it, `A` the fragments of other layers that it has not met yet.
#[derive(Clone, Copy)]
pub(super) struct RayLight<R, A> {
    light: Accumulator,
    ray: R,
    ahead: A,
    /// Depth up to which the ray has been composited, or the near distance.
    front: f64,
    /// Whether `front` is a place where something was composited rather than the near distance.
    composited: bool,
    pub(super) segments: u32,
    /// Segments that lay before what was already composited.
    pub(super) out_of_order: u32,
}

impl<R: Copy + Default, A: Ahead> RayLight<R, A> {
    /// A ray that sees nothing nearer than this.
    #[inline(always)]
    pub(super) fn new(near_distance: f64, ahead: A) -> Self {
        let (light, ray) = (Accumulator::TRANSPARENT, R::default());
        Self { light, ray, ahead, front: near_distance, composited: false, segments: 0, out_of_order: 0 }
    }

    /// The ray goes on somewhere else.
    #[inline(always)]
    pub(super) fn leave(&mut self) {
        self.ray = R::default();
    }

    /// Goes on along a segment: composites what is left of it behind what there is, unless nothing behind can be seen. Fragments of
    /// other layers up to its end are composited in their places.
    #[inline(always)]
    pub(super) fn go_on<M: Medium<Ray = R, Light = Accumulator>>(&mut self, medium: &M, segment: Segment) {
        let mut rest = segment;
        while let Some((depth, rgba)) = self.ahead.take_before(segment.part[1]) {
            let (near, behind) = rest.split(depth);
            if let Some(near) = near {
                self.pass(medium, near);
            }
            self.meet(depth, rgba);
            rest = behind;
        }
        self.pass(medium, rest);
    }

    #[inline(always)]
    fn pass<M: Medium<Ray = R, Light = Accumulator>>(&mut self, medium: &M, mut segment: Segment) {
        let [from, to] = segment.part;
        let is_forward = to > from;
        if !is_forward || self.is_opaque() {
            self.leave();
            return;
        }
        if from < self.front {
            self.leave();
            if to <= self.front {
                self.out_of_order += u32::from(self.composited);
                return;
            }
            segment = segment.split(self.front).1;
        }
        let pieces = medium.pass(&mut self.ray, &segment, &mut self.light);
        if pieces > 0 {
            self.segments += pieces;
            (self.front, self.composited) = (to, true);
        }
    }

    /// Goes on along whole segments that follow each other up to depth `to`, before all fragments that are ahead.
    #[inline(always)]
    pub(super) fn go_on_in_run<M: Medium<Ray = R, Light = Accumulator>>(
        &mut self,
        medium: &M,
        from_scalar: f64,
        run: impl Iterator<Item = Segment>,
        to: f64,
    ) {
        self.segments += medium.pass_run(&mut self.ray, from_scalar, run, &mut self.light);
        self.front = to;
    }

    /// Depth up to which [`Self::go_on_in_run`] is faster than one segment after the other, of a ray that has seen something before;
    /// minus infinity if it is nowhere.
    #[inline(always)]
    pub(super) fn runs_up_to<M: Medium<Ray = R, Light = Accumulator>>(&self, medium: &M) -> f64 {
        let is_fast = medium.is_fast_in_runs(&self.ray) && self.light.visible_from < f64::INFINITY && !self.is_opaque();
        if is_fast { self.ahead.next_depth() } else { f64::NEG_INFINITY }
    }

    /// Composites a fragment of another layer, unless nothing behind can be seen.
    fn meet(&mut self, depth: f64, rgba: [f32; 4]) {
        if self.is_opaque() || rgba == [0.0; 4] {
            return;
        }
        self.light.add_premultiplied(Vec4::from_array(rgba), rgba[3]);
        self.light.visible_from = self.light.visible_from.min(depth);
        (self.front, self.composited) = (self.front.max(depth), true);
    }

    /// Whether nothing behind can be seen.
    #[inline(always)]
    pub(super) fn is_opaque(&self) -> bool {
        self.light.is_opaque()
    }

    /// What the ray has seen at its end: the fragments that are still ahead lie behind all cells.
    #[inline(always)]
    pub(super) fn pixel(mut self) -> TilePixel {
        while let Some((depth, rgba)) = self.ahead.take_before(f64::INFINITY) {
            self.meet(depth, rgba);
        }
        TilePixel { rgba: self.light.pixel(), depth: self.light.visible_from }
    }
}

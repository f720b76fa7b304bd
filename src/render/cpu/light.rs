//! Compositing of a ray, segment by segment.
//!
//! An image does not depend on which transparent cells are skipped: invisible segments change nothing here, and the position in the table
//! is the same whether the ray has come to it through transparent cells or begins there.

use super::super::layers::Ahead;
use super::super::medium::{Medium, Segment};
use super::tiles::TilePixel;
use crate::optics::Accumulator;
use glam::Vec4;

/// The light of a ray. `R` is its medium's state, `A` the fragments of other layers still ahead.
#[derive(Clone, Copy)]
pub(super) struct RayLight<R, A> {
    light: Accumulator,
    ray: R,
    ahead: A,
    /// Depth up to which the ray has been composited, or the near distance.
    front: f64,
    /// Whether `front` is the end of a composited segment instead of the near distance.
    composited: bool,
    pub(super) segments: u32,
    /// Segments in front of what was already composited.
    pub(super) out_of_order: u32,
}

impl<R: Copy + Default, A: Ahead> RayLight<R, A> {
    /// A ray that starts at the near distance.
    #[inline(always)]
    pub(super) fn new(near_distance: f64, ahead: A) -> Self {
        let (light, ray) = (Accumulator::TRANSPARENT, R::default());
        Self { light, ray, ahead, front: near_distance, composited: false, segments: 0, out_of_order: 0 }
    }

    /// Resets the medium's state: the ray continues after a gap.
    #[inline(always)]
    pub(super) fn leave(&mut self) {
        self.ray = R::default();
    }

    /// Advances along a segment: composites the part of it behind `front`, unless the ray is opaque. Fragments of other layers up to its
    /// end are composited at their depths.
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

    /// Advances along successive whole segments up to depth `to`, in front of all fragments ahead.
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

    /// Depth up to which [`Self::go_on_in_run`] is faster than single segments, for a ray on which something was visible; minus infinity
    /// if nowhere.
    #[inline(always)]
    pub(super) fn runs_up_to<M: Medium<Ray = R, Light = Accumulator>>(&self, medium: &M) -> f64 {
        let is_fast = medium.is_fast_in_runs(&self.ray) && self.light.visible_from < f64::INFINITY && !self.is_opaque();
        if is_fast { self.ahead.next_depth() } else { f64::NEG_INFINITY }
    }

    /// Whether nothing behind a depth has been composited.
    #[inline(always)]
    pub(super) fn is_at(&self, depth: f64) -> bool {
        self.front <= depth
    }

    /// Adds a segment that others may overlap: all of it behind the near distance `near`, whatever was composited before. Fragments of
    /// other layers in front of its middle come first.
    #[inline(always)]
    pub(super) fn add<M: Medium<Ray = R, Light = Accumulator>>(&mut self, medium: &M, segment: Segment, near: f64) {
        let [from, to] = segment.part;
        while let Some((depth, rgba)) = self.ahead.take_before(0.5 * (from + to)) {
            self.meet(depth, rgba);
        }
        self.leave();
        if let Some(segment) = segment.behind(near)
            && to > from
            && !self.is_opaque()
        {
            self.segments += medium.pass(&mut self.ray, &segment, &mut self.light);
        }
    }

    /// Composites a fragment of another layer, unless the ray is opaque.
    fn meet(&mut self, depth: f64, rgba: [f32; 4]) {
        if self.is_opaque() || rgba == [0.0; 4] {
            return;
        }
        self.light.add_premultiplied(Vec4::from_array(rgba), rgba[3]);
        self.light.visible_from = self.light.visible_from.min(depth);
        (self.front, self.composited) = (self.front.max(depth), true);
    }

    /// Whether nothing behind is visible.
    #[inline(always)]
    pub(super) fn is_opaque(&self) -> bool {
        self.light.is_opaque()
    }

    /// The pixel of a finished ray: fragments still ahead lie behind all cells.
    #[inline(always)]
    pub(super) fn pixel(mut self) -> TilePixel {
        while let Some((depth, rgba)) = self.ahead.take_before(f64::INFINITY) {
            self.meet(depth, rgba);
        }
        TilePixel { rgba: self.light.pixel(), depth: self.light.visible_from }
    }
}

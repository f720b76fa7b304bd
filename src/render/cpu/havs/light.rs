//! Compositing the fragments of a ray.

use super::super::joint::JointRay;
use super::super::tiles::TilePixel;
use super::super::visible::{first_visible, first_visible_in_joint_table};
use super::fragment::Fragment;
use crate::mesh::NONE;
use crate::optics::{Accumulator, Integrator};

/// What is the same for all fragments of a ray.
pub(super) struct RayOptics<'a, I> {
    pub(super) table: &'a I,
    /// The transfer function in place of `table`, if it is of more than the scalar.
    pub(super) grid: Option<JointRay<'a>>,
    pub(super) length_per_depth: f64,
    /// Depths closer than that may be in the wrong order.
    pub(super) tie: f64,
    pub(super) early_termination: bool,
}

/// A ray that has come as far as its last fragment.
#[derive(Clone, Copy)]
pub(super) struct RayLight<P> {
    light: Accumulator,
    /// Place in the table, if the last segment was composited up to the last fragment.
    place: Option<P>,
    /// Depth and scalar of the last fragment.
    pub(super) last: (f64, f64),
    /// The active cell behind it.
    far: u32,
    /// Depth up to which the ray has been composited, or the near distance.
    front: f64,
    /// Depth of the first visible place.
    visible_from: f64,
    pub(super) segments: u32,
    /// Fragments nearer than one composited before.
    pub(super) out_of_order: u32,
    /// The ray did not pass from each cell into the next.
    is_broken: bool,
    /// Nothing behind the last fragment can be seen.
    pub(super) is_opaque: bool,
}

impl<P: Copy> RayLight<P> {
    pub(super) fn new(near_distance: f64) -> Self {
        Self {
            light: Accumulator::CLEAR,
            place: None,
            last: (f64::NEG_INFINITY, 0.0),
            far: NONE,
            front: near_distance,
            visible_from: f64::INFINITY,
            segments: 0,
            out_of_order: 0,
            is_broken: false,
            is_opaque: false,
        }
    }

    /// Goes on to a fragment that ought not to lie in front of the last one.
    #[inline(always)]
    pub(super) fn advance<I: Integrator<Place = P>>(&mut self, optics: &RayOptics<'_, I>, to: &Fragment) {
        if to.depth < self.last.0 {
            if to.near != self.far || to.depth < self.last.0 - optics.tie {
                self.out_of_order += 1;
            } else {
                // Put in its place by the cell between the two: within rounding there is nothing to integrate.
                self.far = to.far;
            }
            return;
        }
        if self.is_opaque {
            return;
        }
        self.is_broken |= to.near != self.far;
        if self.far == NONE {
            self.place = None;
        } else {
            self.composite(optics, to);
        }
        (self.last, self.far) = ((to.depth, to.scalar), to.far);
        self.is_opaque = optics.early_termination && self.light.is_opaque();
    }

    /// Goes on to all of these fragments, one after the other: the same as [`Self::advance`] for each.
    #[inline(always)]
    pub(super) fn advance_all<I: Integrator<Place = P>>(&mut self, optics: &RayOptics<'_, I>, to: &[Fragment]) {
        let mut rest = to;
        while let Some((first, after)) = rest.split_first() {
            let run = self.run_length(rest);
            if run <= 1 {
                self.advance(optics, first);
                rest = after;
                continue;
            }
            let before = *self;
            if !self.advance_run(optics, &rest[..run]) {
                // Rays become opaque once: then the run is gone through again, up to there.
                *self = before;
                rest[..run].iter().for_each(|to| self.advance(optics, to));
            }
            rest = &rest[run..];
        }
    }

    /// How many of the fragments follow one behind the other through active cells, of a ray that has seen something
    /// before.
    #[inline(always)]
    fn run_length(&self, fragments: &[Fragment]) -> usize {
        if self.place.is_none() || self.visible_from == f64::INFINITY || self.light.is_opaque() {
            return 0;
        }
        let (mut last, mut far) = (self.last.0, self.far);
        let goes_on = |to: &&Fragment| {
            let goes_on = to.depth > last && far != NONE;
            (last, far) = (to.depth, to.far);
            goes_on
        };
        fragments.iter().take_while(goes_on).count()
    }

    /// Goes on along a run of fragments (at least one); false, and in a state of no meaning, if the ray becomes opaque.
    #[inline(always)]
    fn advance_run<I: Integrator<Place = P>>(&mut self, optics: &RayOptics<'_, I>, run: &[Fragment]) -> bool {
        let (Some(place), Some(end)) = (&mut self.place, run.last()) else { return false };
        let (mut from, mut far, mut is_broken) = (self.last.0, self.far, false);
        let segments = run.iter().map(|to| {
            let length = (to.depth - from) * optics.length_per_depth;
            is_broken |= to.near != far;
            (from, far) = (to.depth, to.far);
            (to.scalar, length)
        });
        self.segments += optics.table.segments(place, self.last.1, segments, &mut self.light) as u32;
        self.is_broken |= is_broken;
        (self.last, self.far, self.front) = ((end.depth, end.scalar), end.far, end.depth);
        !self.light.is_opaque()
    }

    /// Goes through one path, from an entry to an exit, of a ray whose paths come in the order of their entries. False if
    /// the ray ends within it.
    pub(super) fn follow<'f, I: Integrator<Place = P>>(
        &mut self,
        optics: &RayOptics<'_, I>,
        path: impl Iterator<Item = &'f Fragment>,
    ) -> bool {
        self.place = None;
        self.last.0 = f64::NEG_INFINITY;
        for to in path {
            if self.last.0 != f64::NEG_INFINITY {
                self.composite(optics, to);
            }
            (self.last, self.far) = ((to.depth, to.scalar), to.far);
            if optics.early_termination && self.light.is_opaque() {
                self.is_opaque = true;
                return false;
            }
        }
        true
    }

    /// Composites the segment from the last fragment to this one, or the part of it behind what there is, unless nothing
    /// behind can be seen.
    #[inline(always)]
    fn composite<I: Integrator<Place = P>>(&mut self, optics: &RayOptics<'_, I>, to: &Fragment) {
        if let Some(ray) = &optics.grid {
            return self.composite_in_grid(ray, optics, to);
        }
        let mut from = self.last;
        let is_forward = to.depth > from.0;
        if !is_forward || self.light.is_opaque() {
            // The scalar may be another one.
            self.place = None;
            return;
        }
        if from.0 < self.front {
            self.place = None;
            if to.depth <= self.front {
                return;
            }
            let share = (self.front - from.0) / (to.depth - from.0);
            from = (self.front, from.1 + share * (to.scalar - from.1));
        }
        let place = self.place.get_or_insert_with(|| optics.table.enter(from.1));
        let length = (to.depth - from.0) * optics.length_per_depth;
        let pieces = optics.table.segment(place, from.1, to.scalar, length, &mut self.light) as u32;
        if pieces == 0 {
            return;
        }
        // A table may show light before the transfer function has any: the ray is then asked again.
        if self.visible_from == f64::INFINITY {
            self.visible_from = first_visible(optics.table, from, (to.depth, to.scalar));
        }
        self.segments += pieces;
        self.front = to.depth;
    }

    /// As [`Self::composite`]. The gap is one segment in the cell behind its nearer end; if some faces are not drawn, it may be longer
    /// than that: the cell's quantity then holds on to its end.
    #[inline(never)]
    fn composite_in_grid<I>(&mut self, ray: &JointRay<'_>, optics: &RayOptics<'_, I>, to: &Fragment) {
        let (depth, scalar) = self.last;
        if to.depth <= depth || to.depth <= self.front || self.light.is_opaque() {
            return;
        }
        let values = ray.along(self.far, depth, optics.tie, to.near_or(self.far));
        let segment = ray.grid.segment(self.far, [scalar, to.scalar], values);
        let front = depth.max(self.front);
        let share = (front - depth) / (to.depth - depth);
        let length = (to.depth - front) * optics.length_per_depth * ray.scale;
        let pieces = segment.composite(share, 1.0, length, &mut self.light) as u32;
        if pieces == 0 {
            return;
        }
        if self.visible_from == f64::INFINITY {
            self.visible_from = first_visible_in_joint_table(&segment, (depth, to.depth), share);
        }
        self.segments += pieces;
        self.front = to.depth;
    }

    /// Whether the ray, at its end, has passed from each cell into the next, or has become opaque before it did not.
    pub(super) fn is_whole(&self) -> bool {
        !self.is_broken && (self.is_opaque || self.far == NONE)
    }

    pub(super) fn pixel(&self) -> TilePixel {
        TilePixel { rgba: self.light.pixel(), depth: self.visible_from }
    }
}

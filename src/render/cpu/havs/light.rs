//! Compositing the fragments of a ray.

use super::super::super::layers::{Ahead, NothingAhead};
use super::super::super::medium::{Medium, RayPoint, Segment};
use super::super::light::RayLight;
use super::super::tiles::TilePixel;
use super::super::values::ValuesOnRay;
use super::fragment::Fragment;
use crate::mesh::NONE;
use crate::optics::Accumulator;
use crate::optics::exact::ExactRay;

/// State shared by all fragments of a ray.
pub(super) struct RayOptics<'a, M> {
    pub(super) values: ValuesOnRay<'a, M>,
    /// Depths closer than this may be in the wrong order.
    pub(super) tie: f64,
    pub(super) early_termination: bool,
}

impl<M: Medium> RayOptics<'_, M> {
    /// The gap behind a point at which the ray enters the cell `far`: one segment in that cell. If some faces are not drawn, the gap may
    /// extend beyond the cell, whose cell value then applies to the whole gap.
    #[inline(always)]
    fn segment(&self, from: RayPoint, far: u32, to: &Fragment) -> Segment {
        let depth = [from.depth, to.depth];
        let value = if M::HAS_VALUES && to.depth > from.depth {
            self.values.along(far, from.depth, self.tie, to.near_or(far))
        } else {
            [0.0; 2]
        };
        Segment::new(far, depth, [from.scalar, to.scalar], value, self.values.ray.line)
    }
}

/// A ray composited up to its last fragment.
#[derive(Clone, Copy)]
pub(super) struct FragmentRay<R, A> {
    light: RayLight<R, A>,
    /// Position of the last fragment; depth -infinity before the first.
    pub(super) last: RayPoint,
    /// The active cell behind the last fragment.
    far: u32,
    /// Fragments nearer than one already composited.
    pub(super) out_of_order: u32,
    /// Whether the ray failed to pass from each cell into the next.
    is_broken: bool,
    /// Whether nothing behind the last fragment is visible.
    pub(super) is_opaque: bool,
}

impl<R: Copy + Default, A: Ahead> FragmentRay<R, A> {
    pub(super) fn new(near_distance: f64, ahead: A) -> Self {
        Self {
            light: RayLight::new(near_distance, ahead),
            last: RayPoint { depth: f64::NEG_INFINITY, scalar: 0.0 },
            far: NONE,
            out_of_order: 0,
            is_broken: false,
            is_opaque: false,
        }
    }

    /// Advances to a fragment, which should not lie in front of the last one.
    #[inline(always)]
    pub(super) fn advance<M: Medium<Ray = R, Light = Accumulator>>(
        &mut self,
        optics: &RayOptics<'_, M>,
        to: &Fragment,
    ) {
        if to.depth < self.last.depth {
            if to.near != self.far || to.depth < self.last.depth - optics.tie {
                self.out_of_order += 1;
            } else {
                // Ordered by the cell between the two: a segment within rounding has nothing to integrate.
                self.far = to.far;
            }
            return;
        }
        if self.is_opaque {
            return;
        }
        self.is_broken |= to.near != self.far;
        if self.far == NONE {
            self.light.leave();
        } else {
            self.composite(optics, to);
        }
        (self.last, self.far) = (to.point(), to.far);
        self.is_opaque = optics.early_termination && self.light.is_opaque();
    }

    /// Advances to these fragments in turn; equals [`Self::advance`] for each.
    #[inline(always)]
    pub(super) fn advance_all<M: Medium<Ray = R, Light = Accumulator>>(
        &mut self,
        optics: &RayOptics<'_, M>,
        to: &[Fragment],
    ) {
        let mut rest = to;
        while let Some((first, after)) = rest.split_first() {
            let run = self.run_length(optics, rest);
            if run <= 1 {
                self.advance(optics, first);
                rest = after;
                continue;
            }
            let before = *self;
            if !self.advance_run(optics, &rest[..run]) {
                // A ray becomes opaque only once: the run is then repeated fragment by fragment.
                *self = before;
                rest[..run].iter().for_each(|to| self.advance(optics, to));
            }
            rest = &rest[run..];
        }
    }

    /// Number of fragments that follow each other through active cells and are composited together.
    #[inline(always)]
    fn run_length<M: Medium<Ray = R, Light = Accumulator>>(
        &self,
        optics: &RayOptics<'_, M>,
        fragments: &[Fragment],
    ) -> usize {
        let up_to = self.light.runs_up_to(optics.values.medium);
        if up_to == f64::NEG_INFINITY {
            return 0;
        }
        let (mut last, mut far) = (self.last.depth, self.far);
        let goes_on = |to: &&Fragment| {
            let goes_on = to.depth > last && far != NONE && to.depth <= up_to;
            (last, far) = (to.depth, to.far);
            goes_on
        };
        fragments.iter().take_while(goes_on).count()
    }

    /// Advances along a run of at least one fragment; false, with an undefined state, if the ray becomes opaque.
    #[inline(always)]
    fn advance_run<M: Medium<Ray = R, Light = Accumulator>>(
        &mut self,
        optics: &RayOptics<'_, M>,
        run: &[Fragment],
    ) -> bool {
        let Some(end) = run.last() else { return false };
        let (mut from, mut far, mut is_broken) = (self.last, self.far, false);
        let segments = run.iter().map(|to| {
            let segment = optics.segment(from, far, to);
            is_broken |= to.near != far;
            (from, far) = (to.point(), to.far);
            segment
        });
        self.light.go_on_in_run(optics.values.medium, self.last.scalar, segments, end.depth);
        self.is_broken |= is_broken;
        (self.last, self.far) = (end.point(), end.far);
        !self.light.is_opaque()
    }

    /// Follows one path, from an entry to an exit, of a ray whose paths come in the order of their entries. False if the ray ends within
    /// it.
    pub(super) fn follow<'f, M: Medium<Ray = R, Light = Accumulator>>(
        &mut self,
        optics: &RayOptics<'_, M>,
        path: impl Iterator<Item = &'f Fragment>,
    ) -> bool {
        self.light.leave();
        self.last.depth = f64::NEG_INFINITY;
        for to in path {
            if self.last.depth != f64::NEG_INFINITY {
                self.composite(optics, to);
            }
            (self.last, self.far) = (to.point(), to.far);
            if optics.early_termination && self.light.is_opaque() {
                self.is_opaque = true;
                return false;
            }
        }
        true
    }

    /// Composites the gap from the last fragment to this one.
    #[inline(always)]
    fn composite<M: Medium<Ray = R, Light = Accumulator>>(&mut self, optics: &RayOptics<'_, M>, to: &Fragment) {
        self.light.go_on(optics.values.medium, optics.segment(self.last, self.far, to));
    }

    /// Whether the finished ray passed from each cell into the next, or became opaque before it failed to.
    pub(super) fn is_whole(&self) -> bool {
        !self.is_broken && (self.is_opaque || self.far == NONE)
    }

    pub(super) fn segments(&self) -> u32 {
        self.light.segments
    }

    pub(super) fn pixel(&self) -> TilePixel {
        self.light.pixel()
    }
}

// A tile keeps 256 of them in cache beside its fragments.
const _: () = assert!(size_of::<FragmentRay<Option<ExactRay>, NothingAhead>>() <= 128);

//! The light of a ray along its path, one segment after the other or in runs.

use super::super::super::layers::Ahead;
use super::super::super::medium::{Medium, RayPoint, Segment};
use super::super::light::RayLight;
use super::super::values::ValuesOnRay;
use super::fragment::Fragment;
use super::path::{Path, Way};
use crate::mesh::NONE;
use crate::optics::Accumulator;

/// State shared by all fragments of a ray.
pub(super) struct RayOptics<'a, M> {
    pub(super) values: ValuesOnRay<'a, M>,
    /// Depths closer than this may be in the wrong order.
    pub(super) tie: f64,
    pub(super) early_termination: bool,
}

impl<M: Medium<Light = Accumulator>> RayOptics<'_, M> {
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

    /// Advances to a fragment, which should not lie in front of the last one.
    #[inline(always)]
    fn advance<A: Ahead>(&self, path: &mut Path, light: &mut RayLight<M::Ray, A>, to: &Fragment) {
        match path.go_on(to, self.tie) {
            Way::None => return,
            Way::Gap => light.leave(),
            Way::Cell(from, cell) => light.go_on(self.values.medium, self.segment(from, cell, to)),
        }
        path.is_opaque = self.early_termination && light.is_opaque();
    }

    /// Advances to these fragments in turn.
    #[inline(always)]
    pub(super) fn advance_all<A: Ahead>(
        &self,
        path: &mut Path,
        light: &mut RayLight<M::Ray, A>,
        fragments: &[Fragment],
    ) {
        let mut rest = fragments;
        while let Some((first, after)) = rest.split_first() {
            let run = self.run_length(path, light, rest);
            if run <= 1 {
                self.advance(path, light, first);
                rest = after;
                continue;
            }
            let before = (*path, *light);
            if !self.advance_run(path, light, &rest[..run]) {
                // A ray becomes opaque only once: the run is then repeated fragment by fragment.
                (*path, *light) = before;
                rest[..run].iter().for_each(|to| self.advance(path, light, to));
            }
            rest = &rest[run..];
        }
    }

    /// Number of fragments that follow each other through active cells and are composited together.
    #[inline(always)]
    fn run_length<A: Ahead>(&self, path: &Path, light: &RayLight<M::Ray, A>, fragments: &[Fragment]) -> usize {
        let up_to = light.runs_up_to(self.values.medium);
        if up_to == f64::NEG_INFINITY {
            return 0;
        }
        let (mut last, mut far) = (path.last.depth, path.far);
        let goes_on = |to: &&Fragment| {
            let goes_on = to.depth > last && far != NONE && to.depth <= up_to;
            (last, far) = (to.depth, to.far);
            goes_on
        };
        fragments.iter().take_while(goes_on).count()
    }

    /// Advances along a run of at least one fragment; false, with an undefined state, if the ray becomes opaque.
    #[inline(always)]
    fn advance_run<A: Ahead>(&self, path: &mut Path, light: &mut RayLight<M::Ray, A>, run: &[Fragment]) -> bool {
        let Some(end) = run.last() else { return false };
        let from = path.last.scalar;
        let segments = run.iter().map(|to| {
            let segment = self.segment(path.last, path.far, to);
            path.run(to);
            segment
        });
        light.go_on_in_run(self.values.medium, from, segments, end.depth);
        !light.is_opaque()
    }

    /// Follows one path, from an entry to an exit, of a ray whose paths come in the order of their entries. False if the ray ends within
    /// it.
    pub(super) fn follow<'f, A: Ahead>(
        &self,
        path: &mut Path,
        light: &mut RayLight<M::Ray, A>,
        fragments: impl Iterator<Item = &'f Fragment>,
    ) -> bool {
        light.leave();
        path.last.depth = f64::NEG_INFINITY;
        for to in fragments {
            if path.last.depth != f64::NEG_INFINITY {
                light.go_on(self.values.medium, self.segment(path.last, path.far, to));
            }
            (path.last, path.far) = (to.point(), to.far);
            if self.early_termination && light.is_opaque() {
                path.is_opaque = true;
                return false;
            }
        }
        true
    }
}

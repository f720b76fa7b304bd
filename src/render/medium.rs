//! What happens to light inside a cell: [`Segment`] is the part of a ray in it, a [`Medium`] what it passes through.
//!
//! Renderers find out through which cells a ray goes, and in which order; what is in them they leave to a medium. A medium may be
//! a transfer function of the scalar ([`ScalarMedium`]) or of more ([`JointMedium`](super::joint::JointMedium)); the
//! [reference](mod@super::reference) has its own, in float64.
//!
//! A renderer on the CPU is compiled for each medium; vectors of rays and runs of fragments are fast paths of media of the scalar alone. In
//! shaders, functions of a medium begin with `medium_`. Isosurfaces and cuts are a medium around that of the volume.

use crate::optics::exact::ExactTable;
use crate::optics::{Accumulator, Integrator};

/// The part of a ray inside a cell, or what is left of that. Scalars and values are linear in depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::render) struct Segment {
    /// The cell.
    pub(in crate::render) cell: u32,
    /// Depths at which the ray enters the cell and leaves it, or begins in it.
    pub(in crate::render) depth: [f64; 2],
    /// Scalars there.
    pub(in crate::render) scalar: [f64; 2],
    /// The quantity of vertices there, for media that [have one](Medium::HAS_VALUES).
    pub(in crate::render) value: [f64; 2],
    /// Depths between which light passes: all of `depth`, or a part of it.
    pub(in crate::render) part: [f64; 2],
    /// Scalars at the ends of `part`.
    pub(in crate::render) part_scalar: [f64; 2],
    /// The ray.
    pub(in crate::render) line: RayLine,
}

/// A point on a ray: its depth, in units of view coordinates, and the scalar there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::render) struct RayPoint {
    pub(in crate::render) depth: f64,
    pub(in crate::render) scalar: f64,
}

/// The ray of a point of the image plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::render) struct RayLine {
    /// Coordinates of the point.
    pub(in crate::render) px: f64,
    pub(in crate::render) py: f64,
    /// Length per unit of depth.
    pub(in crate::render) length_per_depth: f64,
}

impl Segment {
    /// The whole way through a cell.
    #[inline(always)]
    pub(in crate::render) fn new(cell: u32, depth: [f64; 2], scalar: [f64; 2], value: [f64; 2], line: RayLine) -> Self {
        Self { cell, depth, scalar, value, part: depth, part_scalar: scalar, line }
    }

    /// The segment between two points in a cell, for media that [have no values](Medium::HAS_VALUES).
    #[inline(always)]
    pub(in crate::render) fn of_scalars(cell: u32, from: RayPoint, to: RayPoint, line: RayLine) -> Self {
        Self::new(cell, [from.depth, to.depth], [from.scalar, to.scalar], [0.0; 2], line)
    }

    /// The near end of the part.
    #[inline(always)]
    fn part_start(&self) -> RayPoint {
        RayPoint { depth: self.part[0], scalar: self.part_scalar[0] }
    }

    /// The far end of the part.
    #[inline(always)]
    fn part_end(&self) -> RayPoint {
        RayPoint { depth: self.part[1], scalar: self.part_scalar[1] }
    }

    /// The scalar at a depth.
    #[inline(always)]
    pub(in crate::render) fn scalar_at(&self, depth: f64) -> f64 {
        between(self.scalar, self.share(depth))
    }

    /// What of it lies between two depths in it.
    #[inline(always)]
    pub(in crate::render) fn between(self, [from, to]: [f64; 2]) -> Self {
        let ([near, far], [near_scalar, far_scalar]) = (self.part, self.part_scalar);
        let from_scalar = if from == near { near_scalar } else { self.scalar_at(from) };
        let to_scalar = if to == far { far_scalar } else { self.scalar_at(to) };
        Self { part: [from, to], part_scalar: [from_scalar, to_scalar], ..self }
    }

    /// What is left of it from a depth on, if there is something.
    #[inline(always)]
    pub(in crate::render) fn behind(self, depth: f64) -> Option<Self> {
        (self.part[1] > depth).then_some(self.split(depth).1)
    }

    /// What lies before a depth in front of its far end, if there is something, and what lies behind.
    #[inline(always)]
    pub(in crate::render) fn split(self, depth: f64) -> (Option<Self>, Self) {
        let ([near, far], [near_scalar, far_scalar]) = (self.part, self.part_scalar);
        if near >= depth {
            return (None, self);
        }
        let scalar = self.scalar_at(depth);
        let before = Self { part: [near, depth], part_scalar: [near_scalar, scalar], ..self };
        (Some(before), Self { part: [depth, far], part_scalar: [scalar, far_scalar], ..self })
    }

    /// A depth as a share of the way through the cell.
    #[inline(always)]
    fn share(&self, depth: f64) -> f64 {
        (depth - self.depth[0]) / (self.depth[1] - self.depth[0])
    }

    /// The ends of what is left as shares of the way through the cell.
    pub(in crate::render) fn shares(&self) -> [f64; 2] {
        let ([enter, exit], [near, far]) = (self.depth, self.part);
        [if near == enter { 0.0 } else { self.share(near) }, if far == exit { 1.0 } else { self.share(far) }]
    }

    /// The quantity of vertices at the ends of what is left.
    pub(in crate::render) fn part_value(&self) -> [f64; 2] {
        let [near, far] = self.shares();
        let value = |share: f64| between(self.value, share);
        [if near == 0.0 { self.value[0] } else { value(near) }, if far == 1.0 { self.value[1] } else { value(far) }]
    }

    /// Length of what is left.
    #[inline(always)]
    pub(in crate::render) fn length(&self) -> f64 {
        (self.part[1] - self.part[0]) * self.line.length_per_depth
    }
}

/// What has these values at both ends of the way through a cell, at a share of it.
#[inline(always)]
fn between([enter, exit]: [f64; 2], share: f64) -> f64 {
    enter + share * (exit - enter)
}

/// What rays pass through in cells.
pub(in crate::render) trait Medium: Sync {
    /// What is known of a ray from the segment before; by default of a ray that enters the volume, or goes on after a gap.
    type Ray: Copy + Default;
    /// What light is gathered in.
    type Light;
    /// Whether segments need the quantity of vertices at their ends; renderers do not find it out otherwise. Rays through media that do
    /// are walked one by one.
    const HAS_VALUES: bool;

    /// Passes light through what is left of a segment; returns the number of pieces that were integrated, 0 if nothing was to be
    /// seen.
    fn pass(&self, ray: &mut Self::Ray, segment: &Segment, light: &mut Self::Light) -> u32;

    /// Passes light through whole segments that follow each other without a gap, the first of which begins at the scalar `from`, where
    /// something has been visible before: the same as [`Self::pass`] for each.
    #[inline(always)]
    fn pass_run(
        &self,
        ray: &mut Self::Ray,
        _from: f64,
        run: impl Iterator<Item = Segment>,
        light: &mut Self::Light,
    ) -> u32 {
        run.map(|segment| self.pass(ray, &segment, light)).sum()
    }

    /// Whether [`Self::pass_run`] is faster for a ray than one segment after the other.
    #[inline(always)]
    fn is_fast_in_runs(&self, _: &Self::Ray) -> bool {
        false
    }

    /// The quantity of a vertex.
    #[inline(always)]
    fn vertex_value(&self, _: u32) -> f64 {
        0.0
    }

    /// The table of a transfer function of the scalar that is integrated exactly, if that is all that it is: vectors of rays know
    /// it.
    #[inline(always)]
    fn exact_table(&self) -> Option<&ExactTable> {
        None
    }
}

/// A transfer function of the scalar.
pub(in crate::render) struct ScalarMedium<'a, I>(pub(in crate::render) &'a I);

impl<I: Integrator> Medium for ScalarMedium<'_, I> {
    /// The place in the table at which the last segment ended.
    type Ray = Option<I::Place>;
    type Light = Accumulator;
    const HAS_VALUES: bool = false;

    #[inline(always)]
    fn pass(&self, place: &mut Option<I::Place>, segment: &Segment, light: &mut Accumulator) -> u32 {
        let [from, to] = segment.part_scalar;
        let place = place.get_or_insert_with(|| self.0.enter(from));
        let pieces = self.0.segment(place, from, to, segment.length(), light) as u32;
        if pieces > 0 && light.visible_from == f64::INFINITY {
            light.visible_from = first_visible(self.0, segment.part_start(), segment.part_end());
        }
        pieces
    }

    #[inline(always)]
    fn pass_run(
        &self,
        place: &mut Option<I::Place>,
        from: f64,
        run: impl Iterator<Item = Segment>,
        light: &mut Accumulator,
    ) -> u32 {
        let place = place.get_or_insert_with(|| self.0.enter(from));
        let ends = run.map(|segment| (segment.scalar[1], segment.length()));
        self.0.segments(place, from, ends, light) as u32
    }

    #[inline(always)]
    fn is_fast_in_runs(&self, place: &Option<I::Place>) -> bool {
        place.is_some()
    }

    #[inline(always)]
    fn exact_table(&self) -> Option<&ExactTable> {
        self.0.as_exact()
    }
}

/// Depth at which a segment between two points becomes visible; infinite if it does not. A pre-integrated table may show light where
/// the transfer function has none.
#[cold]
#[inline(never)]
pub(in crate::render) fn first_visible<I: Integrator>(table: &I, from: RayPoint, to: RayPoint) -> f64 {
    let share = table.transparent_share(from.scalar, to.scalar);
    if share < 1.0 { from.depth + share * (to.depth - from.depth) } else { f64::INFINITY }
}

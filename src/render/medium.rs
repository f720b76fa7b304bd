//! Light inside a cell: [`Segment`] is the part of a ray in it, a [`Medium`] what it passes through.
//!
//! Renderers find the cells on a ray and their order; integrating them is left to a medium. A medium may be a transfer function of the
//! scalar ([`ScalarMedium`]) or of more values ([`JointMedium`](super::joint::JointMedium)); the [reference](mod@super::reference) has
//! its own, in float64.
//!
//! Renderers on the CPU are compiled for each medium; vectors of rays and runs of fragments are fast paths for media of the scalar alone.
//! In shaders, functions of a medium begin with `medium_`. Isosurfaces and cuts are a medium around that of the volume.

use crate::optics::exact::ExactTable;
use crate::optics::{Accumulator, Integrator};

/// The part of a ray inside a cell, or a piece of that part. Scalars and values are linear in depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::render) struct Segment {
    /// The cell.
    pub(in crate::render) cell: u32,
    /// Depths at which the ray enters (or begins in) the cell and leaves it.
    pub(in crate::render) depth: [f64; 2],
    /// Scalars at these depths.
    pub(in crate::render) scalar: [f64; 2],
    /// Values at these depths, for media that [have them](Medium::HAS_VALUES).
    pub(in crate::render) value: [f64; 2],
    /// Depths between which light is integrated: all of `depth`, or a part of it.
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

/// The ray through a point of the image plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::render) struct RayLine {
    /// Coordinates of the point on the image plane.
    pub(in crate::render) px: f64,
    pub(in crate::render) py: f64,
    /// Length per unit of depth.
    pub(in crate::render) length_per_depth: f64,
}

impl Segment {
    /// The whole segment of a cell.
    #[inline(always)]
    pub(in crate::render) fn new(cell: u32, depth: [f64; 2], scalar: [f64; 2], value: [f64; 2], line: RayLine) -> Self {
        Self { cell, depth, scalar, value, part: depth, part_scalar: scalar, line }
    }

    /// The segment between two points in a cell, for media that [have no values](Medium::HAS_VALUES).
    #[inline(always)]
    pub(in crate::render) fn of_scalars(cell: u32, from: RayPoint, to: RayPoint, line: RayLine) -> Self {
        Self::new(cell, [from.depth, to.depth], [from.scalar, to.scalar], [0.0; 2], line)
    }

    /// The scalar at a depth.
    #[inline(always)]
    pub(in crate::render) fn scalar_at(&self, depth: f64) -> f64 {
        between(self.scalar, self.share(depth))
    }

    /// The part between two depths in the segment.
    #[inline(always)]
    pub(in crate::render) fn between(self, [from, to]: [f64; 2]) -> Self {
        let ([near, far], [near_scalar, far_scalar]) = (self.part, self.part_scalar);
        let from_scalar = if from == near { near_scalar } else { self.scalar_at(from) };
        let to_scalar = if to == far { far_scalar } else { self.scalar_at(to) };
        Self { part: [from, to], part_scalar: [from_scalar, to_scalar], ..self }
    }

    /// The part behind a depth; `None` if it is empty.
    #[inline(always)]
    pub(in crate::render) fn behind(self, depth: f64) -> Option<Self> {
        (self.part[1] > depth).then_some(self.split(depth).1)
    }

    /// The parts before and behind a depth in front of the far end; the first is `None` if empty.
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

    /// A depth as a fraction of the cell's depth interval.
    #[inline(always)]
    fn share(&self, depth: f64) -> f64 {
        (depth - self.depth[0]) / (self.depth[1] - self.depth[0])
    }

    /// The ends of the part as fractions of the cell's depth interval.
    pub(in crate::render) fn shares(&self) -> [f64; 2] {
        let ([enter, exit], [near, far]) = (self.depth, self.part);
        [if near == enter { 0.0 } else { self.share(near) }, if far == exit { 1.0 } else { self.share(far) }]
    }

    /// Values at the ends of the part.
    pub(in crate::render) fn part_value(&self) -> [f64; 2] {
        let [near, far] = self.shares();
        let value = |share: f64| between(self.value, share);
        [if near == 0.0 { self.value[0] } else { value(near) }, if far == 1.0 { self.value[1] } else { value(far) }]
    }

    /// Length of the part.
    #[inline(always)]
    pub(in crate::render) fn length(&self) -> f64 {
        (self.part[1] - self.part[0]) * self.line.length_per_depth
    }
}

/// Linear interpolation between entry and exit.
#[inline(always)]
fn between([enter, exit]: [f64; 2], share: f64) -> f64 {
    enter + share * (exit - enter)
}

/// The participating medium in the cells.
pub(in crate::render) trait Medium: Sync {
    /// State of a ray carried from the segment before; the default is for a ray that enters the volume, or goes on after a gap.
    type Ray: Copy + Default;
    /// The accumulator of light.
    type Light;
    /// Whether segments need values at their ends; renderers compute them only then, and walk rays through such media one by one.
    const HAS_VALUES: bool;

    /// Composites the part of a segment; returns the number of pieces integrated, 0 if nothing was visible.
    fn pass(&self, ray: &mut Self::Ray, segment: &Segment, light: &mut Self::Light) -> u32;

    /// Composites whole segments that follow each other without a gap, the first of which begins at the scalar `from`, where something
    /// has been visible before; equals [`Self::pass`] for each.
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

    /// Value at a vertex.
    #[inline(always)]
    fn vertex_value(&self, _: u32) -> f64 {
        0.0
    }

    /// Value in a cell, of media that are of values of cells.
    #[inline(always)]
    fn value_in_cell(&self, _: u32) -> f64 {
        0.0
    }

    /// The table, if the medium is nothing but an exactly integrated transfer function of the scalar; vectors of rays have a fast path
    /// for it.
    #[inline(always)]
    fn exact_table(&self) -> Option<&ExactTable> {
        None
    }

    /// One scalar per cell, if the medium has these instead of those at the ends of segments.
    #[inline(always)]
    fn cell_scalars(&self) -> Option<&[f32]> {
        None
    }
}

/// A transfer function of the scalar.
pub(in crate::render) struct ScalarMedium<'a, I>(pub(in crate::render) &'a I);

impl<I: Integrator> Medium for ScalarMedium<'_, I> {
    /// The position in the table at which the last segment ended.
    type Ray = Option<I::Place>;
    type Light = Accumulator;
    const HAS_VALUES: bool = false;

    #[inline(always)]
    fn pass(&self, place: &mut Option<I::Place>, segment: &Segment, light: &mut Accumulator) -> u32 {
        let [from, to] = segment.part_scalar;
        let place = place.get_or_insert_with(|| self.0.enter(from));
        let pieces = self.0.segment(place, from, to, segment.length(), light) as u32;
        if pieces > 0 && light.visible_from == f64::INFINITY {
            let [near, far] = [0, 1].map(|end| RayPoint { depth: segment.part[end], scalar: segment.part_scalar[end] });
            light.visible_from = first_visible(self.0, near, far);
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

/// A medium in which every cell has one scalar, whatever its vertices have.
///
/// A step between two cells is exact: each segment has the scalar of its own cell at both ends, and the ray begins anew in each.
pub(in crate::render) struct CellMedium<'a, M> {
    pub(in crate::render) medium: &'a M,
    /// One scalar per cell.
    pub(in crate::render) scalars: &'a [f32],
}

impl<M: Medium> Medium for CellMedium<'_, M> {
    type Ray = M::Ray;
    type Light = M::Light;
    const HAS_VALUES: bool = M::HAS_VALUES;

    #[inline(always)]
    fn pass(&self, ray: &mut M::Ray, segment: &Segment, light: &mut M::Light) -> u32 {
        let scalar = [f64::from(self.scalars[segment.cell as usize]); 2];
        let value = if M::HAS_VALUES { [self.medium.value_in_cell(segment.cell); 2] } else { segment.value };
        *ray = M::Ray::default();
        self.medium.pass(ray, &Segment { scalar, value, part_scalar: scalar, ..*segment }, light)
    }

    #[inline(always)]
    fn exact_table(&self) -> Option<&ExactTable> {
        self.medium.exact_table()
    }

    #[inline(always)]
    fn cell_scalars(&self) -> Option<&[f32]> {
        Some(self.scalars)
    }
}

/// Depth at which a segment between two points becomes visible; infinite if it does not. A pre-integrated table may show light where
/// the transfer function has none.
#[cold]
#[inline(never)]
pub(in crate::render) fn first_visible<I: Integrator>(table: &I, from: RayPoint, to: RayPoint) -> f64 {
    let share = table.exact().transparent_share(from.scalar, to.scalar);
    if share < 1.0 { from.depth + share * (to.depth - from.depth) } else { f64::INFINITY }
}

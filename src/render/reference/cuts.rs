//! Cuts, by their definition: a point of the ray is visible if no clip has it on its outer side, and a section where the ray passes from
//! one side of its plane to the other.

use super::integrate::Sum;
use super::surfaces::toward_eye;
use crate::mesh::Plane;
use crate::render::medium::{Medium, Segment};
use crate::visibility::CutPlanes;
use glam::DVec3;

/// Points this close to a clip (local units) lie on it, and a section there is visible.
const ON_PLANE: f64 = 1e-12;

/// A medium that is cut, for one ray.
pub(super) struct WithCuts<'a, M, C> {
    pub(super) inner: &'a M,
    pub(super) planes: &'a CutPlanes,
    /// The number of the first section.
    pub(super) first_number: u32,
    /// Whether normals and numbers are rendered.
    pub(super) guides: bool,
    /// The colour of a section (number from 1) at the start of a segment.
    pub(super) color: C,
    /// The eye, or where the ray meets the plane of the eye, local coordinates.
    pub(super) origin: DVec3,
    /// Direction of the ray, per unit of depth.
    pub(super) direction: DVec3,
}

impl<M, C> WithCuts<'_, M, C> {
    fn distance(&self, plane: &Plane, depth: f64) -> f64 {
        plane.distance(self.origin + depth * self.direction)
    }

    fn is_cut_away(&self, depth: f64) -> bool {
        self.planes.clips.iter().any(|clip| self.distance(clip, depth) > ON_PLANE)
    }

    /// Depths at which planes meet a part of the ray; for sections also the normal and number.
    fn met(&self, [near, far]: [f64; 2]) -> Vec<(f64, Option<(DVec3, u32)>)> {
        let CutPlanes { sections, clips } = self.planes;
        let sections = sections.iter().zip(self.first_number..).map(|(plane, n)| (plane, Some((plane.normal, n))));
        let planes = sections.chain(clips.iter().map(|plane| (plane, None)));
        let mut met: Vec<_> = planes
            .filter_map(|(plane, section)| {
                let [a, b] = [near, far].map(|depth| self.distance(plane, depth));
                ((a >= 0.0) != (b >= 0.0)).then(|| (near + a / (a - b) * (far - near), section))
            })
            .collect();
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        met
    }
}

impl<M: Medium<Light = Sum>, C: Fn(&Segment, usize) -> [f64; 3] + Sync> Medium for WithCuts<'_, M, C> {
    type Ray = M::Ray;
    type Light = Sum;
    const HAS_VALUES: bool = M::HAS_VALUES;

    fn pass(&self, ray: &mut M::Ray, segment: &Segment, sum: &mut Sum) -> u32 {
        let (mut rest, mut count) = (Some(*segment), 0);
        let mut pass = |part: Segment, sum: &mut Sum| {
            if part.part[1] > part.part[0] && !self.is_cut_away(0.5 * part.part[0] + 0.5 * part.part[1]) {
                count += self.inner.pass(ray, &part, sum);
            }
        };
        for (depth, section) in self.met(segment.part) {
            let Some((before, behind)) = rest.map(|rest| rest.split(depth)) else { break };
            before.into_iter().for_each(|part| pass(part, sum));
            if let Some((normal, number)) = section.filter(|_| !self.is_cut_away(depth)) {
                if self.guides {
                    sum.end_with_guide(depth, toward_eye(normal, self.direction), number);
                    return count + 1;
                }
                let of_sections = (number - self.first_number) as usize + 1;
                sum.add_surface(depth, (self.color)(&behind, of_sections), 1.0);
            }
            rest = Some(behind);
        }
        rest.into_iter().for_each(|part| pass(part, sum));
        count
    }
}

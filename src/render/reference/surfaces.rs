//! Isosurfaces, by their definition: points where the scalar on the ray, linear in a cell, passes an isovalue.
//!
//! Only the request is shared with [`surfaces::medium`](crate::render::surfaces): points, their order, normals and gradients at vertices
//! are computed independently, in f64 and without optimisation.

use super::integrate::Sum;
use crate::render::RenderJob;
use crate::render::medium::{Medium, RayPoint, Segment};
use crate::render::surfaces::{FieldBeside, Light, Normals, Sheet, SurfaceScene};
use glam::{DMat3, DVec3};

/// Corners of a cell, local coordinates.
fn corners(job: &RenderJob, cell: u32) -> [DVec3; 4] {
    job.mesh.topology.tets[cell as usize].map(|v| job.mesh.positions.local[v as usize].as_dvec3())
}

/// The gradient of the scalar in a cell: the solution g of the equations (corner i - corner 0) . g = scalar i - scalar 0.
fn gradient(job: &RenderJob, cell: u32) -> DVec3 {
    let [o, a, b, c] = corners(job, cell);
    let [so, sa, sb, sc] = job.scalars.at_corners(cell, job.mesh.topology.tets[cell as usize]).map(f64::from);
    let edges = DMat3::from_cols(a - o, b - o, c - o).transpose();
    edges.inverse() * DVec3::new(sa - so, sb - so, sc - so)
}

/// The direction of the volume-weighted mean gradient of the finite cells around each vertex, of unit length, or zero; for smooth normals.
pub(super) fn gradients_at_vertices(job: &RenderJob) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; job.mesh.positions.local.len()];
    for (cell, tet) in (0..).zip(&job.mesh.topology.tets) {
        if job.scalars.at_corners(cell, *tet).iter().any(|scalar| !scalar.is_finite()) {
            continue;
        }
        let [o, a, b, c] = corners(job, cell);
        let volume = (a - o).dot((b - o).cross(c - o)).abs();
        for &v in tet {
            sums[v as usize] += volume * gradient(job, cell);
        }
    }
    sums.iter().map(|sum| sum.try_normalize().unwrap_or(DVec3::ZERO)).collect()
}

/// A normal turned against the direction of a ray.
pub(super) fn toward_eye(normal: DVec3, direction: DVec3) -> DVec3 {
    if normal.dot(direction) > 0.0 { -normal } else { normal }
}

/// A medium with surfaces in it, for one ray.
pub(super) struct WithSurfaces<'a, M> {
    pub(super) volume: &'a M,
    /// The direction of the gradient at each vertex, for smooth normals.
    pub(super) gradients: &'a [DVec3],
    pub(super) job: &'a RenderJob,
    pub(super) scene: &'a SurfaceScene,
    /// The eye, or where the ray meets the plane of the eye, local coordinates.
    pub(super) origin: DVec3,
    /// Direction of the ray, per unit of depth.
    pub(super) direction: DVec3,
}

/// Gaps between segments up to this length, local units, are rounding: cells are inflated by a tenth of it.
const ROUNDING: f64 = 1e-9;

impl<M: Medium<Ray = (), Light = Sum>> Medium for WithSurfaces<'_, M> {
    /// The end of the last segment.
    type Ray = Option<RayPoint>;
    type Light = Sum;
    const HAS_VALUES: bool = M::HAS_VALUES;

    fn pass(&self, last: &mut Self::Ray, segment: &Segment, sum: &mut Sum) -> u32 {
        let [near, far] = segment.part;
        let [mut s0, s1] = segment.part_scalar.map(|scalar| self.within_cell(segment.cell, scalar));
        // Two cells compute the scalar on their shared face differently: the ray must be above, or below, in both.
        if let Some(before) = last.replace(RayPoint { depth: far, scalar: s1 })
            && near - before.depth < ROUNDING
        {
            s0 = before.scalar;
        }
        // Surfaces met, by their fraction of the segment.
        let mut met: Vec<(f64, &Sheet)> = self
            .scene
            .sheets()
            .iter()
            .filter(|sheet| (s0 >= sheet.value) != (s1 >= sheet.value))
            .map(|sheet| ((sheet.value - s0) / (s1 - s0), sheet))
            .collect();
        // Stable sort: of surfaces at one value the last one comes first from above.
        if s1 < s0 {
            met.reverse();
        }
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut rest, mut count) = (*segment, 0);
        for (share, sheet) in met {
            let depth = near + share * (far - near);
            let before =
                Segment { part: [rest.part[0], depth], part_scalar: [rest.part_scalar[0], sheet.value], ..rest };
            if before.part[1] > before.part[0] {
                count += self.pass_volume(&before, sum);
            }
            if self.scene.shows_guides() && sheet.opacity > 0.0 {
                let normal = self.normal(segment.cell, depth).try_normalize().unwrap_or_default();
                sum.end_with_guide(depth, toward_eye(normal, self.direction), sheet.number);
                return count + 1;
            }
            let rgb = match self.scene.beside(sheet.by) {
                Some(beside) => self.color_by(beside, segment.cell, depth),
                None if s1 > s0 => sheet.front,
                None => sheet.back,
            };
            sum.add_surface(depth, rgb.map(|c| c * self.light_on(segment.cell, depth)), sheet.opacity);
            (rest.part[0], rest.part_scalar[0]) = (depth, sheet.value);
        }
        if rest.part[1] > rest.part[0] {
            count += self.pass_volume(&rest, sum);
        }
        count
    }
}

impl<M: Medium<Ray = (), Light = Sum>> WithSurfaces<'_, M> {
    /// Integrates a segment without surfaces, lit by the gradient in its middle if the volume is lit.
    fn pass_volume(&self, segment: &Segment, sum: &mut Sum) -> u32 {
        if !self.scene.lights_volume() {
            return self.volume.pass(&mut (), segment, sum);
        }
        let before = std::mem::take(&mut sum.rgb);
        let count = self.volume.pass(&mut (), segment, sum);
        let lit = self.light_on(segment.cell, 0.5 * (segment.part[0] + segment.part[1]));
        sum.rgb = [0, 1, 2].map(|c| before[c] + lit * sum.rgb[c]);
        count
    }
}

impl<M> WithSurfaces<'_, M> {
    /// Clamps a scalar to the range of a cell against rounding.
    fn within_cell(&self, cell: u32, scalar: f64) -> f64 {
        let corners = self.job.scalars.at_corners(cell, self.job.mesh.topology.tets[cell as usize]).map(f64::from);
        scalar.clamp(corners.into_iter().fold(f64::MAX, f64::min), corners.into_iter().fold(f64::MIN, f64::max))
    }

    /// The colour by another field at a depth in a cell.
    pub(super) fn color_by(&self, beside: &FieldBeside, cell: u32, depth: f64) -> [f64; 3] {
        let tet = self.job.mesh.topology.tets[cell as usize];
        beside.color(cell, tet, self.weights(cell, depth))
    }

    /// Barycentric coordinates of the ray at a depth in a cell.
    fn weights(&self, cell: u32, depth: f64) -> [f64; 4] {
        let [o, a, b, c] = corners(self.job, cell);
        let point = self.origin + depth * self.direction;
        let weights = DMat3::from_cols(a - o, b - o, c - o).inverse() * (point - o);
        [1.0 - weights.element_sum(), weights.x, weights.y, weights.z]
    }

    /// Normal of a surface in a cell, of any length.
    fn normal(&self, cell: u32, depth: f64) -> DVec3 {
        match self.scene.shading().normals {
            Normals::None | Normals::Cell | Normals::Screen | Normals::Depth => gradient(self.job, cell),
            Normals::Vertex => {
                let weights = self.weights(cell, depth);
                let tet = self.job.mesh.topology.tets[cell as usize];
                let gradients = tet.map(|v| self.gradients[v as usize]);
                (0..4).map(|i| weights[i] * gradients[i]).sum()
            }
        }
    }

    /// The cosine between the normal, turned towards the eye, and the light; 1 without a normal.
    fn light_on(&self, cell: u32, depth: f64) -> f64 {
        if matches!(self.scene.shading().normals, Normals::None | Normals::Screen | Normals::Depth) {
            return 1.0;
        }
        let Some(normal) = self.normal(cell, depth).try_normalize() else { return 1.0 };
        let (to_eye, turned) = (-self.direction.normalize(), toward_eye(normal, self.direction));
        match self.scene.shading().light {
            Light::Headlight => turned.dot(to_eye),
            Light::From([x, y, z]) => {
                let length = x.hypot(y).hypot(z);
                turned.dot(DVec3::new(x / length, y / length, z / length)).max(0.0)
            }
        }
    }
}

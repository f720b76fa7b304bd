//! Isosurfaces and cuts within a segment, as a [`Medium`] around that of the volume.

use super::cuts_in_view::CutsInView;
use super::{FieldBeside, Normals, Sheet, SurfaceScene, brightness};
use crate::camera::View;
use crate::field::Scalars;
use crate::mesh::{self, Mesh};
use crate::optics::exact::ExactTable;
use crate::optics::partial::PartialTable;
use crate::optics::table3d::Table3d;
use crate::optics::{Accumulator, Integrator};
use crate::render::medium::{Medium, RayLine, ScalarMedium, Segment};
use crate::render::{OpticsTable, RenderJob};
use glam::{DVec3, Vec4};

/// A medium with isosurfaces and cuts in it.
pub(in crate::render) struct SurfaceMedium<'a, M> {
    volume: M,
    scene: &'a SurfaceScene,
    sheets: &'a [Sheet],
    shader: Shader<'a>,
    cuts: CutsInView,
}

impl<'a, M> SurfaceMedium<'a, M> {
    /// The surfaces of a job with this local view, in the medium of its volume.
    pub(in crate::render) fn new(volume: M, scene: &'a SurfaceScene, job: &'a RenderJob, view: &'a View) -> Self {
        let cuts = CutsInView::new(scene.planes(), view);
        Self { volume, scene, sheets: scene.sheets(), shader: Shader::new(scene, job, view), cuts }
    }

    /// Number of surfaces at or below a scalar: the sheets before this index.
    #[inline(always)]
    fn below(&self, scalar: f64) -> usize {
        self.sheets.iter().map(|sheet| usize::from(sheet.value <= scalar)).sum()
    }
}

impl<M: Medium<Light = Accumulator>> SurfaceMedium<'_, M> {
    /// Composites the part of a segment with the surfaces in it.
    #[inline(always)]
    fn pass_uncut(&self, ray: &mut M::Ray, segment: &Segment, light: &mut Accumulator) -> u32 {
        let passed = segment.part_scalar.map(|scalar| self.below(scalar));
        if passed[0] == passed[1] {
            self.pass_volume(ray, segment, light)
        } else {
            self.pass_surfaces(ray, segment, passed, light)
        }
    }

    /// Composites the part of a segment without surfaces in it.
    #[inline(always)]
    fn pass_volume(&self, ray: &mut M::Ray, segment: &Segment, light: &mut Accumulator) -> u32 {
        if self.scene.shading().volume {
            self.pass_shaded(ray, segment, light)
        } else {
            self.volume.pass(ray, segment, light)
        }
    }

    /// Composites such a part, lit by the gradient in its middle.
    #[inline(never)]
    fn pass_shaded(&self, ray: &mut M::Ray, segment: &Segment, light: &mut Accumulator) -> u32 {
        let lit = self.shader.light_on(segment, 0.5 * segment.part[0] + 0.5 * segment.part[1]) as f32;
        // Accumulated separately: a difference of sums would lose the digits of the segment's light.
        let mut behind = light.behind();
        let pieces = self.volume.pass(ray, segment, &mut behind);
        light.add_lit(behind, lit);
        pieces
    }

    /// Composites the part of a segment that clips leave, with the sections on it, nearest first, equal depths in their order. A section
    /// at the depth of a clip is visible.
    #[inline(never)]
    fn pass_cut(&self, ray: &mut M::Ray, segment: &Segment, light: &mut Accumulator) -> u32 {
        let [near, far] = segment.part;
        let Some([from, to]) = self.cuts.left_of(segment) else { return 0 };
        let mut rest = segment.between([from, to]);
        if from > near {
            // The ray has skipped the part before.
            *ray = M::Ray::default();
        }
        let (mut pieces, mut last) = (0, (f64::NEG_INFINITY, 0));
        while let Some((depth, number)) = self.cuts.next_section(segment, [from, to], last) {
            let (before, behind) = rest.split(depth);
            pieces += before.map_or(0, |before| self.pass_uncut(ray, &before, light));
            if light.is_opaque() {
                return pieces;
            }
            let [r, g, b, a] = if self.scene.shows_guides() {
                let normal = self.shader.turned(self.cuts.section_normal(number), segment);
                guide(normal, (self.sheets.len() + number) as u32)
            } else {
                let rgb = match self.scene.beside_section(number) {
                    None => self.scene.section_color(behind.part_scalar[0]),
                    Some(beside) => self.shader.color_by(beside, segment, depth),
                };
                let [r, g, b] = rgb.map(|c| c as f32);
                [r, g, b, 1.0]
            };
            light.add_premultiplied(Vec4::new(r, g, b, a), 1.0);
            light.visible_from = light.visible_from.min(depth);
            (rest, last, pieces) = (behind, (depth, number), pieces + 1);
        }
        if rest.part[1] > rest.part[0] && !light.is_opaque() {
            pieces += self.pass_uncut(ray, &rest, light);
        }
        if to < far {
            *ray = M::Ray::default();
        }
        pieces
    }

    /// Composites a segment that passes surfaces: those between the counts `passed` at its ends, in order.
    #[inline(never)]
    fn pass_surfaces(&self, ray: &mut M::Ray, segment: &Segment, passed: [usize; 2], light: &mut Accumulator) -> u32 {
        let ([near, far], [near_scalar, far_scalar]) = (segment.part, segment.part_scalar);
        let [first, end] = passed;
        let ascends = first < end;
        let met = &self.sheets[first.min(end)..first.max(end)];
        let (mut rest, mut pieces) = (*segment, 0);
        for at in 0..met.len() {
            let sheet = &met[if ascends { at } else { met.len() - 1 - at }];
            let share = (sheet.value - near_scalar) / (far_scalar - near_scalar);
            let depth = (near + share * (far - near)).clamp(rest.part[0], far);
            let [from, _] = rest.part;
            if depth > from {
                let before = Segment { part: [from, depth], part_scalar: [rest.part_scalar[0], sheet.value], ..rest };
                pieces += self.pass_volume(ray, &before, light);
            }
            (rest.part[0], rest.part_scalar[0]) = (depth, sheet.value);
            if light.is_opaque() {
                return pieces;
            }
            if sheet.opacity > 0.0 && self.scene.shows_guides() {
                let normal = self.shader.turned(self.shader.normal_on(segment, depth), segment);
                light.add_premultiplied(guide(normal, sheet.number).into(), 1.0);
                light.visible_from = light.visible_from.min(depth);
                return pieces + 1;
            }
            if sheet.opacity > 0.0 {
                let rgb = match self.scene.beside(sheet.by) {
                    Some(beside) => self.shader.color_by(beside, segment, depth),
                    None if ascends => sheet.front,
                    None => sheet.back,
                };
                let lit = self.shader.light_on(segment, depth);
                let [r, g, b] = rgb.map(|c| (c * lit * sheet.opacity) as f32);
                light.add_premultiplied(Vec4::new(r, g, b, sheet.opacity as f32), sheet.opacity as f32);
                light.visible_from = light.visible_from.min(depth);
                pieces += 1;
            }
        }
        if rest.part[1] > rest.part[0] && !light.is_opaque() {
            pieces += self.pass_volume(ray, &rest, light);
        }
        pieces
    }
}

impl<M: Medium<Light = Accumulator>> Medium for SurfaceMedium<'_, M> {
    type Ray = M::Ray;
    type Light = Accumulator;
    const HAS_VALUES: bool = M::HAS_VALUES;

    #[inline(always)]
    fn pass(&self, ray: &mut M::Ray, segment: &Segment, light: &mut Accumulator) -> u32 {
        if self.cuts.is_empty() { self.pass_uncut(ray, segment, light) } else { self.pass_cut(ray, segment, light) }
    }

    #[inline(always)]
    fn vertex_value(&self, vertex: u32) -> f64 {
        self.volume.vertex_value(vertex)
    }

    #[inline(always)]
    fn value_in_cell(&self, cell: u32) -> f64 {
        self.volume.value_in_cell(cell)
    }
}

/// The guide pixel of the nearest surface.
fn guide(normal: DVec3, number: u32) -> [f32; 4] {
    let [x, y, z] = normal.as_vec3().to_array();
    // Exact: numbers are below 2^24.
    [x, y, z, number as f32]
}

/// Lighting of surfaces.
struct Shader<'a> {
    normals: Normals,
    /// Unit vector towards the light, world coordinates; `None` for a light at the eye.
    light: Option<DVec3>,
    mesh: &'a Mesh,
    scalars: &'a Scalars,
    /// Gradient vectors at vertices, for [`Normals::Vertex`].
    gradients: Option<&'a [[f32; 3]]>,
    view: &'a View,
}

impl<'a> Shader<'a> {
    fn new(scene: &'a SurfaceScene, job: &'a RenderJob, view: &'a View) -> Self {
        let shading = scene.shading();
        let light = shading.towards_light();
        let gradients = scene.gradients().map(|gradients| gradients.as_slice());
        Self { normals: shading.normals, light, mesh: &job.mesh, scalars: &job.scalars, gradients, view }
    }

    /// Brightness of a surface at a depth in the cell of a segment: the cosine between its normal, turned towards the eye, and the light.
    /// 1 without a normal, as in a cell too flat for one.
    fn light_on(&self, segment: &Segment, depth: f64) -> f64 {
        if matches!(self.normals, Normals::None | Normals::Screen | Normals::Depth) {
            return 1.0;
        }
        brightness(self.normal_on(segment, depth), self.along(segment), self.light)
    }

    /// Normal of an isosurface at a depth in the cell of a segment, of any length; 0 if undefined.
    fn normal_on(&self, segment: &Segment, depth: f64) -> DVec3 {
        match (self.normals, self.gradients) {
            (Normals::Vertex, Some(gradients)) => self.smooth_normal(segment, depth, gradients),
            _ => self.normal(segment.cell),
        }
    }

    /// Direction of the ray of a segment, per unit of depth.
    fn along(&self, segment: &Segment) -> DVec3 {
        let View { right, up, forward, perspective, .. } = *self.view;
        let RayLine { px, py, .. } = segment.line;
        if perspective { px * right + py * up + forward } else { forward }
    }

    /// Unit normal turned towards the eye; 0 if there is none.
    fn turned(&self, normal: DVec3, segment: &Segment) -> DVec3 {
        let normal = normal.normalize_or_zero();
        if normal.dot(self.along(segment)) > 0.0 { -normal } else { normal }
    }

    /// The gradient in a cell.
    fn normal(&self, cell: u32) -> DVec3 {
        let tet = self.mesh.topology.tets[cell as usize];
        let scalars = self.scalars.at_corners(cell, tet);
        mesh::tet_gradient(self.mesh.positions.corners(tet), scalars).unwrap_or(DVec3::ZERO)
    }

    /// The vertex gradients of a segment's cell, interpolated on the ray at a depth.
    fn smooth_normal(&self, segment: &Segment, depth: f64, gradients: &[[f32; 3]]) -> DVec3 {
        let (tet, weights) = self.place(segment, depth);
        tet.iter().zip(weights).map(|(&v, weight)| weight * DVec3::from(gradients[v as usize].map(f64::from))).sum()
    }

    /// The colour by another field on the ray at a depth.
    fn color_by(&self, beside: &FieldBeside, segment: &Segment, depth: f64) -> [f64; 3] {
        let (tet, weights) = self.place(segment, depth);
        beside.color(segment.cell, tet, weights)
    }

    /// Position on the ray at a depth: the vertices of a segment's cell, and barycentric coordinates.
    fn place(&self, segment: &Segment, depth: f64) -> ([u32; 4], [f64; 4]) {
        let View { right, up, forward, perspective, eye, .. } = *self.view;
        let RayLine { px, py, .. } = segment.line;
        let (x, y) = if perspective { (px * depth, py * depth) } else { (px, py) };
        let tet = self.mesh.topology.tets[segment.cell as usize];
        // Relative to the first corner, as the eye may be far away.
        let corners = self.mesh.positions.corners(tet).map(|corner| corner.as_dvec3());
        let point = (eye - corners[0]) + x * right + y * up + depth * forward;
        (tet, weights(corners, point))
    }
}

/// Barycentric coordinates of a point, given relative to the first corner, clamped to the tet.
fn weights(corners: [DVec3; 4], point: DVec3) -> [f64; 4] {
    let [a, b, c] = [1, 2, 3].map(|i| corners[i] - corners[0]);
    let determinant = a.dot(b.cross(c));
    let of = |normal: DVec3| (point.dot(normal) / determinant).clamp(0.0, 1.0);
    let (a, b, c) = (of(b.cross(c)), of(c.cross(a)), of(a.cross(b)));
    [(1.0 - a - b - c).max(0.0), a, b, c]
}

/// The volume of a job whose transfer function is of the scalar alone, for all optics in one type, since a renderer is compiled for each
/// type.
pub(in crate::render) enum VolumeMedium<'a> {
    /// Nothing is visible.
    Transparent,
    /// Integrated exactly.
    Exact(ScalarMedium<'a, ExactTable>),
    /// Looked up in a pre-integrated table.
    Table3d(ScalarMedium<'a, Table3d>),
    /// Looked up in sums over nodes.
    Partial(ScalarMedium<'a, PartialTable>),
}

/// State of a ray in a [`VolumeMedium`].
#[derive(Clone, Copy, Default)]
pub(in crate::render) enum VolumeRay {
    /// No position in a table.
    #[default]
    New,
    Exact(<ExactTable as Integrator>::Place),
    Table3d(<Table3d as Integrator>::Place),
    Partial(<PartialTable as Integrator>::Place),
}

impl<'a> VolumeMedium<'a> {
    pub(in crate::render) fn new(table: &'a OpticsTable) -> Self {
        match table {
            _ if table.exact().is_transparent() => Self::Transparent,
            OpticsTable::Exact(table) => Self::Exact(ScalarMedium(&**table)),
            OpticsTable::Table3d(table) => Self::Table3d(ScalarMedium(&**table)),
            OpticsTable::Partial(table) => Self::Partial(ScalarMedium(&**table)),
        }
    }
}

impl Medium for VolumeMedium<'_> {
    type Ray = VolumeRay;
    type Light = Accumulator;
    const HAS_VALUES: bool = false;

    fn pass(&self, ray: &mut VolumeRay, segment: &Segment, light: &mut Accumulator) -> u32 {
        /// Composites a segment, continuing at the ray's position if it is in this table.
        macro_rules! pass {
            ($medium:expr, $kind:ident) => {{
                let mut place = if let VolumeRay::$kind(place) = *ray { Some(place) } else { None };
                let pieces = $medium.pass(&mut place, segment, light);
                *ray = place.map_or(VolumeRay::New, VolumeRay::$kind);
                pieces
            }};
        }
        match self {
            Self::Transparent => 0,
            Self::Exact(medium) => pass!(medium, Exact),
            Self::Table3d(medium) => pass!(medium, Table3d),
            Self::Partial(medium) => pass!(medium, Partial),
        }
    }
}

//! The cells around the eye.

use super::context::Context;
use super::layout::Params;
use crate::camera::View;
use crate::mesh::FACE_VERTICES;
use crate::render::cpu::raycast::entries::cells_at_eye;
use crate::render::{RenderError, RenderJob};
use glam::DVec3;

/// Distance from the eye, local units, within which a cell may be the first on a ray: sheared coordinates are right to 2^-24 of the mesh's
/// extent, which is 2, and a cell too many only costs time.
const EYE_TOLERANCE: f64 = 1.0 / (1u64 << 20) as f64;

/// The parameters of a view.
///
/// # Errors
/// If single precision is not enough for it.
pub(super) fn params(context: &Context, local_view: &View) -> Result<Params, RenderError> {
    let far = || "the eye is too far from the mesh, or the view too wide, for single precision".to_owned();
    Params::of_view(local_view).ok_or_else(|| context.beyond(far()))
}

/// Active cells that may be the first on a ray.
pub(super) fn cells(job: &RenderJob, local_view: &View) -> Vec<u32> {
    cells_at_eye(&job.mesh, &job.active, local_view, EYE_TOLERANCE)
}

/// On which side of the faces of a cell the eye is, exactly: bit i if it is outside face i, bit 4 + i if it is strictly
/// inside, neither if it is in the face's plane.
pub(super) fn sides(job: &RenderJob, local_view: &View, cell: u32) -> u32 {
    let tet = job.mesh.topology.tets[cell as usize];
    let coord = |p: DVec3| robust::Coord3D { x: p.x, y: p.y, z: p.z };
    let at = |v: u32| coord(job.mesh.positions.local[v as usize].as_dvec3());
    let side_of = |i: usize| {
        let [a, b, c] = FACE_VERTICES[i].map(|v| at(tet[v]));
        // Positive for a point below a triangle that is seen counter-clockwise from above: inside the cell.
        let volume = robust::orient3d(a, b, c, coord(local_view.eye));
        u32::from(volume < 0.0) << i | u32::from(volume > 0.0) << (4 + i)
    };
    (0..4).map(side_of).sum()
}

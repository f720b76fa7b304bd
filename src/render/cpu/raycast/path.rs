//! Where a path begins, as if the ray came from further ahead.
//!
//! Depth and scalar where a ray hits a face depend in their last bits on the order of its corners; the walk has them in
//! the order that follows from the cell it comes from: the vertex that was new there is the last. If that cell is left out
//! because nothing is to be seen in it, the path begins with the same order, and so with the same bits.

use super::super::ray::{Crossing, Ray, Sheared, ViewVertex, crossing, hit, signed_edge};
use super::entries::face_of;
use super::walk::Scene;
use crate::mesh::Mesh;

/// Which corner of a triangle around the origin another vertex replaces so that the triangle is still around it, from the signs
/// of edge(vertex, corner i) as bits i; see the module's essay for why the first and the last entry do not occur.
pub(super) const REPLACED: [u8; 8] = [3, 2, 0, 0, 1, 2, 1, 3];

/// The corner that comes after another one, and the one after that.
pub(super) const TURNED: [(usize, usize); 3] = [(1, 2), (2, 0), (0, 1)];

/// Where a ray passes through face `opposite` of `cell` from outside, with the ids of the face's corners; `None` if it
/// does not.
pub(super) fn enter<M>(scene: &Scene<'_, M>, ray: &Ray, cell: u32, opposite: u32) -> Option<([u32; 3], Crossing)> {
    let ids = face_of(&scene.mesh.topology, cell, opposite as usize).vertices;
    let at = crossing(ray, scene.vertices, ids)?;
    let last = newest_corner(scene, ray, [cell, opposite], &ids, &at.corners).unwrap_or(2);
    let (next, after) = TURNED[last];
    let turn = [next, after, last];
    let (corners, edges) = (turn.map(|i| at.corners[i]), turn.map(|i| at.edges[i]));
    let point = hit(edges, &corners[0], &corners[1], &corners[2]);
    Some((turn.map(|i| ids[i]), Crossing { corners, edges, point }))
}

/// The corner of the face that the ray does not see on its way into the cell across it; `None` if there is no such cell
/// with finite scalars.
fn newest_corner<M>(
    scene: &Scene<'_, M>,
    ray: &Ray,
    [cell, opposite]: [u32; 2],
    ids: &[u32; 3],
    corners: &[Sheared; 3],
) -> Option<usize> {
    let Mesh { topology, positions, .. } = scene.mesh;
    let across = topology.neighbours[cell as usize][opposite as usize & 3];
    let far = topology.tets[across.cell()? as usize][across.opposite() as usize];
    let scalar = scene.scalars[far as usize];
    if !scalar.is_finite() {
        return None;
    }
    // It may be a vertex of transparent cells only: nobody has brought it into view coordinates.
    let sheared = ray.shear(&ViewVertex::of(scene.view, positions.local[far as usize], scalar));
    let is_positive = |i: usize| usize::from(signed_edge(&sheared, &corners[i], far, ids[i]).1) << i;
    let k = REPLACED[is_positive(0) | is_positive(1) | is_positive(2)];
    (k < 3).then_some(usize::from(k))
}

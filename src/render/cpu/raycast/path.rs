//! The start of a path, as if the ray came from the cell before.
//!
//! Depth and scalar of a hit depend in their last bits on the order of the face's corners; the walk has them in the order that follows
//! from the previous cell: the vertex that was new there is the last. If that cell is skipped because nothing is visible in it, the path
//! begins with the same order, and so with the same bits.

use super::super::ray::{Crossing, Ray, Sheared, ViewVertex, crossing, hit, signed_edge};
use super::entries::face_of;
use super::walk::Scene;
use crate::field::Scalars;
use crate::mesh::Mesh;

/// Index of the corner that a new vertex replaces so that the triangle stays around the origin, from the signs of edge(vertex, corner i)
/// as bits i; the first and the last entry do not occur (see the module's essay).
pub(super) const REPLACED: [u8; 8] = [3, 2, 0, 0, 1, 2, 1, 3];

/// The next corner and the one after it, cyclically.
pub(super) const TURNED: [(usize, usize); 3] = [(1, 2), (2, 0), (0, 1)];

/// The crossing of a ray with face `opposite` of `cell` from outside, and the ids of the face's corners; `None` if it misses the face.
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

/// The corner of the face that was the newest vertex of the cell across it; `None` if there is no such cell with finite scalars.
fn newest_corner<M>(
    scene: &Scene<'_, M>,
    ray: &Ray,
    [cell, opposite]: [u32; 2],
    ids: &[u32; 3],
    corners: &[Sheared; 3],
) -> Option<usize> {
    let Mesh { topology, positions, .. } = scene.mesh;
    let across = scene.neighbours[cell as usize][opposite as usize & 3];
    let behind = across.cell()?;
    let far = topology.tets[behind as usize][across.opposite() as usize];
    let scalar = match scene.scalars {
        Scalars::Vertices(scalars) => scalars[far as usize],
        Scalars::Cells(scalars) => scalars[behind as usize],
    };
    if !scalar.is_finite() {
        return None;
    }
    // A vertex of transparent cells only may not have been transformed.
    let sheared = ray.shear(&ViewVertex::of(scene.view, positions.local[far as usize], scalar));
    let is_positive = |i: usize| usize::from(signed_edge(&sheared, &corners[i], far, ids[i]).1) << i;
    let k = REPLACED[is_positive(0) | is_positive(1) | is_positive(2)];
    (k < 3).then_some(usize::from(k))
}

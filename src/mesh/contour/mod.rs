//! Surfaces of a mesh as triangles: isosurfaces, plane sections and the boundary.
//!
//! Marching tetrahedra (A. Doi, A. Koide, *An efficient method of triangulating equi-valued surfaces by using tetrahedral cells*,
//! IEICE Transactions E74, 1991): a scalar is linear in a cell, so its isosurface there is a triangle or a plane quadrilateral, which is
//! split into two triangles. A scalar counts as above if it is at least the isovalue, as in the renderers. The case table depends on
//! nothing else, so the surfaces of two neighbouring cells match on their face, also where vertices have exactly the isovalue.
//!
//! - A point belongs to an edge of the mesh and is computed from its lower to its higher vertex, in f64: all cells around the edge
//!   agree on it. A point that rounds to an end of the edge, or an end that has the isovalue, becomes that vertex, shared by its edges.
//! - Triangles with two equal corners have no area; they are dropped and counted. The rest is closed: next to a triangle's edge
//!   from a to b there is one from b to a, unless the edge lies on the boundary of the mesh or of a hole. It is the only one, unless
//!   a and b are both vertices of the mesh: where these have the isovalue, surfaces may touch, and as many triangles go from a to b as
//!   from b to a.
//! - Normals point towards lower values (corners are counter-clockwise seen from there). On the boundary they point outward.
//! - Results do not depend on the number of threads: triangles are in cell order, points in the order of their edges.

mod cells;
#[cfg(test)]
mod tests;

use super::{FACE_VERTICES, Topology};
use cells::{Cut, Key, Triangles};
use glam::DVec3;
use rayon::prelude::*;

/// A mesh at one step, with the vertices that have no finite value marked.
#[derive(Clone, Copy, Debug)]
pub struct Domain<'a> {
    /// Connectivity.
    pub topology: &'a Topology,
    /// World coordinates of the vertices, in the file's units.
    pub points: &'a [DVec3],
    /// Whether each vertex lacks a finite value; its cells are holes.
    pub missing: &'a [bool],
    /// Whether each cell lacks one; empty if none does.
    pub missing_cells: &'a [bool],
}

/// A point on an edge of the mesh, or at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The lower vertex of the edge.
    pub low: u32,
    /// The higher vertex of the edge; equal to `low` for a point at a vertex.
    pub high: u32,
    /// Position between them: 0 at the lower vertex, 1 at the higher.
    pub t: f64,
}

/// Triangles that share their points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// World coordinates, in the file's units.
    pub points: Vec<DVec3>,
    /// Position of each point on the mesh, ascending.
    pub crossings: Vec<Crossing>,
    /// Indices of points.
    pub triangles: Vec<[u32; 3]>,
    /// The cell of each triangle, ascending.
    pub cells: Vec<u32>,
    /// Triangles without area that were left out.
    pub dropped: u64,
}

impl Crossing {
    /// Value of a field at the point: linear along the edge, never beyond the values at its ends, and exact at a vertex. `values` holds one
    /// per vertex of the mesh, finite at this edge.
    pub fn value(&self, values: &[f32]) -> f32 {
        let [low, high] = [self.low, self.high].map(|v| f64::from(values[v as usize]));
        if self.low == self.high {
            return values[self.low as usize];
        }
        (low + self.t * (high - low)).clamp(low.min(high), low.max(high)) as f32
    }
}

impl Surface {
    /// Interpolates a field to all points ([`Crossing::value`]), one value per point, into `out`.
    pub fn interpolate(&self, values: &[f32], out: &mut Vec<f32>) {
        self.crossings.par_iter().map(|crossing| crossing.value(values)).collect_into_vec(out);
    }
}

impl Domain<'_> {
    /// The isosurface at which `level`, a scalar per vertex, is `value`. `level` must be finite at all vertices that are not missing.
    ///
    /// # Panics
    /// If the mesh has more vertices than `points` or `missing`.
    pub fn contour(&self, level: impl Fn(u32) -> f64 + Sync, value: f64) -> Surface {
        let cut = Cut { points: self.points, level, value };
        let triangles = Triangles::collect(&self.topology.tets, |cell, tet, out| {
            if !self.is_hole(cell, *tet) {
                cut.add_cell(*tet, out);
            }
        });
        self.surface(triangles, |key| cut.crossing(key))
    }

    /// The section of the mesh by a plane, from signed distances of the vertices. Normals point to the side of lower distances.
    ///
    /// # Panics
    /// As [`Domain::contour`].
    pub fn section(&self, distances: &[f64]) -> Surface {
        self.contour(|v| distances[v as usize], 0.0)
    }

    /// The faces with a cell on one side only; holes count as outside. Normals point outward.
    ///
    /// # Panics
    /// As [`Domain::contour`].
    pub fn boundary(&self) -> Surface {
        let (tets, neighbours) = (&self.topology.tets, &self.topology.connectivity().neighbours);
        let triangles = Triangles::collect(tets, |cell, tet, out| {
            if self.is_hole(cell, *tet) {
                return;
            }
            for (face, neighbour) in FACE_VERTICES.iter().zip(neighbours[cell as usize]) {
                if neighbour.cell().is_none_or(|other| self.is_hole(other, tets[other as usize])) {
                    out.push(face.map(|i| Key::vertex(tet[i])));
                }
            }
        });
        self.surface(triangles, |key| (key.crossing(0.0), self.points[key.low() as usize]))
    }

    fn is_hole(&self, cell: u32, tet: [u32; 4]) -> bool {
        let is_missing = self.missing_cells.get(cell as usize).copied().unwrap_or(false);
        is_missing || tet.iter().any(|&v| self.missing[v as usize])
    }

    /// Builds the surface: unique points, and triangles that index them.
    fn surface(&self, triangles: Triangles, point: impl Fn(Key) -> (Crossing, DVec3) + Sync) -> Surface {
        let mut keys = triangles.keys.as_flattened().to_vec();
        keys.par_sort_unstable();
        keys.dedup();
        // Edges number fewer than 4/3 of 2^30 cells plus as many vertices, so u32 counts them. Every key is in the list.
        let rank = |key: Key| keys.partition_point(|&other| other < key) as u32;
        let (crossings, points) = keys.par_iter().map(|&key| point(key)).unzip();
        Surface {
            crossings,
            points,
            triangles: triangles.keys.par_iter().map(|corners| corners.map(rank)).collect(),
            cells: triangles.cells,
            dropped: triangles.dropped,
        }
    }
}

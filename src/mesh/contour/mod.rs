//! Surfaces of a mesh as triangles: where a scalar has a value, and the boundary of the mesh.
//!
//! Marching tetrahedra (A. Doi, A. Koide, *An efficient method of triangulating equi-valued surfaces by using tetrahedral cells*,
//! IEICE Transactions E74, 1991): a scalar is linear in a cell, so that its surface there is a triangle or a plane quadrilateral, which
//! is two triangles. A value counts as above if it is at least the value of the surface, as in the renderers. What the table of cases
//! says depends on nothing but this, so that the surfaces of two neighbours fit together on their face, also where vertices have the
//! very value.
//!
//! - A point belongs to an edge of the mesh and is computed from its lower to its higher vertex, in f64: all cells around the edge
//!   agree on it. One that is rounded to an end of the edge, or has its value, belongs to that vertex instead, and edges share it.
//! - Triangles of which two corners are then one have no area; they are dropped and counted. What is left is closed: beside a triangle's
//!   edge from a to b there is one from b to a, unless the edge lies on the boundary of the mesh or of a hole. It is the only one,
//!   unless a and b are both vertices of the mesh: where these have the value, surfaces may touch, and as many triangles go from a to b
//!   as from b to a.
//! - Normals point towards lower values (corners are counter-clockwise seen from there). On the boundary they point outward.
//! - Results do not depend on the number of threads: triangles are in the order of cells, points in that of their edges.

mod cells;
#[cfg(test)]
mod tests;

use super::{FACE_VERTICES, Topology};
use cells::{Cut, Key, Triangles};
use glam::DVec3;
use rayon::prelude::*;

/// The part of a mesh in which there are values at a step.
#[derive(Clone, Copy, Debug)]
pub struct Domain<'a> {
    /// Cells.
    pub topology: &'a Topology,
    /// World coordinates of the vertices, in the file's units.
    pub points: &'a [DVec3],
    /// Of each vertex whether it has no finite value. Its cells are holes.
    pub missing: &'a [bool],
}

/// A point on an edge of the mesh, or at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The lower vertex of the edge.
    pub low: u32,
    /// Its higher vertex; the same for a point at a vertex.
    pub high: u32,
    /// Where between them the point is: 0 at the lower, 1 at the higher.
    pub t: f64,
}

/// Triangles that share their points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// World coordinates, in the file's units.
    pub points: Vec<DVec3>,
    /// For each point where in the mesh it is, ascending.
    pub crossings: Vec<Crossing>,
    /// Indices of points.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles without area that were left out.
    pub dropped: u64,
}

impl Crossing {
    /// A field at the point: linear along the edge, never beyond the values at its ends, and exact at a vertex. `values` are those of
    /// the vertices of the mesh, finite here.
    pub fn value(&self, values: &[f32]) -> f32 {
        let [low, high] = [self.low, self.high].map(|v| f64::from(values[v as usize]));
        if self.low == self.high {
            return values[self.low as usize];
        }
        (low + self.t * (high - low)).clamp(low.min(high), low.max(high)) as f32
    }
}

impl Surface {
    /// A field at all points ([`Crossing::value`]), one value for each, into `out`.
    pub fn interpolate(&self, values: &[f32], out: &mut Vec<f32>) {
        self.crossings.par_iter().map(|crossing| crossing.value(values)).collect_into_vec(out);
    }
}

impl Domain<'_> {
    /// Where `level`, a scalar of the vertices, is `value`. It is finite at all vertices that are not missing.
    ///
    /// # Panics
    /// If the mesh has more vertices than `points` or `missing`.
    pub fn contour(&self, level: impl Fn(u32) -> f64 + Sync, value: f64) -> Surface {
        let cut = Cut { points: self.points, level, value };
        let triangles = Triangles::collect(&self.topology.tets, |_, tet, out| {
            if !self.is_hole(*tet) {
                cut.add_cell(*tet, out);
            }
        });
        self.surface(&triangles, |key| cut.crossing(key))
    }

    /// Where a plane cuts the mesh. Normals point against that of the plane, whose side counts as higher.
    ///
    /// # Panics
    /// As [`Domain::contour`].
    pub fn section(&self, distances: &[f64]) -> Surface {
        self.contour(|v| distances[v as usize], 0.0)
    }

    /// The faces with a cell on one side only; holes count as outside.
    ///
    /// # Panics
    /// As [`Domain::contour`].
    pub fn boundary(&self) -> Surface {
        let Topology { tets, neighbours, .. } = self.topology;
        let triangles = Triangles::collect(tets, |cell, tet, out| {
            if self.is_hole(*tet) {
                return;
            }
            for (face, neighbour) in FACE_VERTICES.iter().zip(neighbours[cell]) {
                if neighbour.cell().is_none_or(|other| self.is_hole(tets[other as usize])) {
                    out.keys.push(face.map(|i| Key::vertex(tet[i])));
                }
            }
        });
        self.surface(&triangles, |key| (key.crossing(0.0), self.points[key.low() as usize]))
    }

    fn is_hole(&self, tet: [u32; 4]) -> bool {
        tet.iter().any(|&v| self.missing[v as usize])
    }

    /// Numbers the points.
    fn surface(&self, triangles: &Triangles, point: impl Fn(Key) -> (Crossing, DVec3) + Sync) -> Surface {
        let mut keys = triangles.keys.as_flattened().to_vec();
        keys.par_sort_unstable();
        keys.dedup();
        // There are fewer edges than 4/3 of 2^30 cells and as many vertices, so that u32 counts them. Each key is in the list.
        let rank = |key: Key| keys.partition_point(|&other| other < key) as u32;
        let (crossings, points) = keys.par_iter().map(|&key| point(key)).unzip();
        Surface {
            crossings,
            points,
            triangles: triangles.keys.par_iter().map(|corners| corners.map(rank)).collect(),
            dropped: triangles.dropped,
        }
    }
}

//! How the cells around each vertex are shaped: the mean of e e^T over the edges e that end there.

use super::Mesh;
use super::cells_around::CellsByVertex;
use glam::DVec3;
use rayon::prelude::*;

/// A symmetric matrix: xx, xy, xz, yy, yz, zz.
pub type Symmetric = [f64; 6];

/// Vertices per parallel task.
const CHUNK: usize = 4096;

impl Mesh {
    /// The mean of e e^T over the edges e from each vertex to the vertices that it shares a cell with, in local units squared. Each edge
    /// counts once, however many cells have it. Zero where a vertex has no edge, as in a cloud.
    pub fn vertex_shapes(&self) -> Vec<Symmetric> {
        let (tets, positions) = (&self.topology.tets, &self.positions.local);
        let around = CellsByVertex::of(tets, positions.len());
        let mut shapes = vec![Symmetric::default(); positions.len()];
        shapes.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, shapes)| {
            let mut others = Vec::new();
            for (vertex, shape) in (chunk * CHUNK..).zip(shapes) {
                others.clear();
                others.extend(around.at(vertex).iter().flat_map(|&cell| tets[cell as usize]));
                others.retain(|&other| other as usize != vertex);
                // Sums go by ascending ids.
                others.sort_unstable();
                others.dedup();
                let from = positions[vertex].as_dvec3();
                *shape = mean_of_edges(others.iter().map(|&other| positions[other as usize].as_dvec3() - from));
            }
        });
        shapes
    }

    /// The mean of e e^T over the six edges of each cell, in local units squared.
    pub fn cell_shapes(&self) -> Vec<Symmetric> {
        let shape = |tet: &[u32; 4]| {
            let [a, b, c, d] = self.positions.corners(*tet).map(|corner| corner.as_dvec3());
            mean_of_edges([b - a, c - a, d - a, c - b, d - b, d - c].into_iter())
        };
        self.topology.tets.par_iter().map(shape).collect()
    }
}

/// The mean of e e^T; zero without an edge.
fn mean_of_edges(edges: impl ExactSizeIterator<Item = DVec3>) -> Symmetric {
    let per_edge = if edges.len() == 0 { 0.0 } else { 1.0 / edges.len() as f64 };
    let mut sum = Symmetric::default();
    for e in edges {
        let terms = [e.x * e.x, e.x * e.y, e.x * e.z, e.y * e.y, e.y * e.z, e.z * e.z];
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
    sum.map(|sum| sum * per_edge)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::RawMesh;
    use crate::mesh::test_meshes::kuhn_grid;

    #[test]
    fn a_cell_has_the_mean_of_its_six_edges() {
        let points = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::Y, DVec3::Z];
        let mesh = Mesh::build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }).unwrap().0;
        let scale = mesh.positions.scale;
        // Edges (1, 0, 0), (0, 2, 0), (0, 0, 1), (-1, 2, 0), (-1, 0, 1), (0, -2, 1).
        let expected = [3.0, -2.0, -1.0, 12.0, -2.0, 3.0].map(|sum| sum / 6.0 / scale / scale);
        let [found] = mesh.cell_shapes()[..] else { panic!("one cell") };
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 4.0 * f64::EPSILON), "{found:?} {expected:?}");
    }

    #[test]
    fn a_corner_of_a_cell_has_the_mean_of_its_three_edges() {
        let points = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::Y, DVec3::Z];
        let mesh = Mesh::build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }).unwrap().0;
        let shapes = mesh.vertex_shapes();
        let at_origin = mesh.vertex_source.iter().position(|&source| source == 0).unwrap();
        let unit = 1.0 / mesh.positions.scale.powi(2);
        let expected = [1.0, 0.0, 0.0, 4.0, 0.0, 1.0].map(|length: f64| length * unit / 3.0);
        for (found, expected) in shapes[at_origin].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6 * unit, "{:?}", shapes[at_origin]);
        }
    }

    #[test]
    fn an_edge_counts_once_however_many_cells_have_it() {
        let (mesh, _) = Mesh::build(kuhn_grid([2; 3])).unwrap();
        let shapes = mesh.vertex_shapes();
        // The middle vertex has fourteen edges: six along the axes, six along diagonals of squares, two of cubes.
        let middle = mesh.vertex_source.iter().position(|&source| source == 13).unwrap();
        let h = (mesh.positions.local[0] - mesh.positions.local[middle]).abs().max_element();
        let [xx, xy, .., yz, zz] = shapes[middle];
        let unit = f64::from(h).powi(2) / 14.0;
        // Along each axis: both edges along it, four of six diagonals, two of the cubes; xy: two diagonals and the cubes' two.
        assert!((xx - 8.0 * unit).abs() < 1e-6 * unit && (zz - xx).abs() < 1e-6 * unit, "{xx} {zz} {unit}");
        assert!((xy.abs() - 4.0 * unit).abs() < 1e-6 * unit && (yz.abs() - 4.0 * unit).abs() < 1e-6 * unit);
    }
}

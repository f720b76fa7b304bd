//! Means of values of cells at the vertices: each cell of the source counts once at a vertex, weighted by its volume.

use super::{Mesh, SourceCells};
use rayon::prelude::*;

/// Values per parallel task.
const CHUNK: usize = 16_384;

/// The cells that have each vertex.
pub(super) struct CellsByVertex {
    /// First index into `cells` of each vertex, and the end of the last.
    starts: Vec<usize>,
    /// Cells, ascending at each vertex.
    cells: Vec<u32>,
}

impl CellsByVertex {
    /// Counting sort of the corners by vertex.
    pub(super) fn of(tets: &[[u32; 4]], vertices: usize) -> Self {
        let mut starts = vec![0usize; vertices + 1];
        for &vertex in tets.as_flattened() {
            starts[vertex as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut cells = vec![0u32; 4 * tets.len()];
        for (cell, tet) in (0..).zip(tets) {
            for &vertex in tet {
                cells[next[vertex as usize]] = cell;
                next[vertex as usize] += 1;
            }
        }
        Self { starts, cells }
    }

    /// The cells that have a vertex.
    pub(super) fn at(&self, vertex: usize) -> &[u32] {
        &self.cells[self.starts[vertex]..self.starts[vertex + 1]]
    }
}

/// The cells of a mesh's source around each vertex.
#[derive(Clone, Debug)]
pub struct CellsAround {
    /// First index into `cells` of each vertex, and the end of the last.
    starts: Vec<usize>,
    /// The first part of each cell, as the mesh has it, ascending at each vertex.
    cells: Vec<u32>,
    /// Volume of all parts of the cell that each cell is the first part of.
    volumes: Vec<f64>,
}

impl CellsAround {
    /// The cells around each vertex of a mesh.
    pub fn of(mesh: &Mesh) -> Self {
        let tets = &mesh.topology.tets;
        let parts = SourceCells::of(&mesh.cell_source);
        let mut first: Vec<u32> = vec![0; tets.len()];
        parts.expand(&parts.firsts().collect::<Vec<_>>(), &mut first);
        let CellsByVertex { starts, mut cells } = CellsByVertex::of(tets, mesh.positions.local.len());
        cells.iter_mut().for_each(|cell| *cell = first[*cell as usize]);
        let mut volumes = vec![0.0; tets.len()];
        for (cell, &first) in (0..).zip(&first) {
            volumes[first as usize] += mesh.cell_volume(cell);
        }
        let mut around = Self { starts, cells, volumes };
        if !parts.are_whole() {
            around.drop_repeats();
        }
        around
    }

    /// Leaves each cell of the source once at a vertex, whichever number of its parts meet there.
    fn drop_repeats(&mut self) {
        let Self { starts, cells, .. } = self;
        let (mut begin, mut kept) = (0, 0);
        for start in starts.iter_mut().skip(1) {
            let first = kept;
            for i in begin..*start {
                let cell = cells[i];
                if !cells[first..kept].contains(&cell) {
                    cells[kept] = cell;
                    kept += 1;
                }
            }
            (begin, *start) = (*start, kept);
        }
        cells.truncate(kept);
    }

    /// The weighted mean around each vertex, summed in f64: `value` and `weight` are asked for the first part of a cell, and for its volume.
    /// NaN where all weights are 0.
    ///
    /// # Panics
    /// If there is not one mean per vertex.
    pub fn means(&self, value: impl Fn(u32) -> f32 + Sync, weight: impl Fn(f32, f64) -> f64 + Sync, out: &mut [f32]) {
        assert_eq!(out.len() + 1, self.starts.len(), "one mean a vertex");
        out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (vertex, out) in (chunk * CHUNK..).zip(out) {
                let (mut sum, mut weights) = (0.0, 0.0);
                for &cell in &self.cells[self.starts[vertex]..self.starts[vertex + 1]] {
                    let value = value(cell);
                    let weight = weight(value, self.volumes[cell as usize]);
                    if weight != 0.0 {
                        (sum, weights) = (sum + weight * f64::from(value), weights + weight);
                    }
                }
                *out = (sum / weights) as f32;
            }
        });
    }
}

impl Mesh {
    /// Values of cells brought to the vertices: the mean of those around each that are numbers, weighted by the volumes of the cells. A cell
    /// of the source that was split counts as one. NaN where there is none.
    ///
    /// # Panics
    /// If there is not one value per cell.
    pub fn means_at_vertices(&self, values: &[f32]) -> Vec<f32> {
        assert_eq!(values.len(), self.topology.tets.len(), "one value a cell");
        let around = self.cells_around.get_or_init(|| CellsAround::of(self));
        let mut out = vec![0.0; self.positions.local.len()];
        let weight = |value: f32, volume: f64| if value.is_nan() { 0.0 } else { volume };
        around.means(|cell| values[cell as usize], weight, &mut out);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_meshes::kuhn_grid;
    use crate::mesh::{RawMesh, SolidShape};
    use glam::DVec3;

    #[test]
    fn means_at_vertices_are_those_of_the_cells_around_weighted_by_volume() {
        let (mesh, _) = Mesh::build(kuhn_grid([2, 1, 1])).unwrap();
        let mut values: Vec<f32> = (0..mesh.topology.tets.len()).map(|cell| cell as f32).collect();
        values[3] = f32::NAN;
        let found = mesh.means_at_vertices(&values);
        for (vertex, &found) in (0..).zip(&found) {
            // All cells have one volume.
            let around = (0..values.len()).filter(|&c| c != 3 && mesh.topology.tets[c].contains(&vertex));
            let around: Vec<f64> = around.map(|c| f64::from(values[c])).collect();
            let expected = around.iter().sum::<f64>() / around.len() as f64;
            assert!((f64::from(found) - expected).abs() < 1e-5, "{vertex}: {found}");
        }
        values[3] = f32::INFINITY;
        let found = mesh.means_at_vertices(&values);
        assert!(mesh.topology.tets[3].iter().all(|&vertex| found[vertex as usize] == f32::INFINITY));
        assert!(mesh.means_at_vertices(&vec![f32::NAN; values.len()]).iter().all(|mean| mean.is_nan()));
    }

    #[test]
    fn a_split_cell_counts_once_at_each_of_its_vertices() {
        // Two boxes side by side, the first twice as wide.
        let at = |i: i32| DVec3::new([0.0, 2.0, 3.0][i as usize % 3], f64::from(i / 3 % 2), f64::from(i / 6));
        let mut raw = RawMesh { points: (0..12).map(at).collect(), ..RawMesh::default() };
        for x in 0..2 {
            let corners = [0, 1, 4, 3, 6, 7, 10, 9].map(|corner| corner + x);
            raw.cells.solids.push(SolidShape::Hexahedron, corners.into_iter());
        }
        let (mesh, _) = Mesh::build(raw).unwrap();
        let values: Vec<f32> = mesh.cell_source.iter().map(|&source| [1.0, 4.0][source as usize]).collect();
        for (value, source) in mesh.means_at_vertices(&values).into_iter().zip(&mesh.vertex_source) {
            assert_eq!(value, [1.0, 2.0, 4.0][*source as usize % 3]);
        }
    }
}

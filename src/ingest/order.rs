//! Reordering from the file's numbering to the mesh's: one value per vertex in curve order.

use crate::mesh::{Mesh, Positions};
use rayon::prelude::*;

/// Vertices per parallel task.
const CHUNK: usize = 16_384;

/// Source of each vertex's value.
pub(super) struct VertexOrder {
    vertex_source: Vec<u32>,
    cells: Option<CellsAround>,
}

/// The source's cells around each vertex, for those that are in the mesh.
struct CellsAround {
    /// First index into `cells` of each vertex, and the end of the last.
    starts: Vec<usize>,
    /// Cell indices in the source, ascending along the mesh's cell order.
    cells: Vec<u32>,
}

impl VertexOrder {
    /// The order of a mesh, and its vertex positions; most of the mesh is freed. `with_cells` prepares for values per cell.
    pub(super) fn new(mesh: Mesh, with_cells: bool) -> (Self, Positions) {
        let cells = with_cells.then(|| CellsAround::of(&mesh));
        (Self { vertex_source: mesh.vertex_source, cells }, mesh.positions)
    }

    /// The source point of each vertex.
    pub(super) fn vertex_source(&self) -> &[u32] {
        &self.vertex_source
    }

    /// Gathers values per source point into values per mesh vertex.
    pub(super) fn gather_points(&self, values: &[f32], out: &mut [f32]) {
        let pairs = out.par_chunks_mut(CHUNK).zip(self.vertex_source.par_chunks(CHUNK));
        pairs.for_each(|(out, source)| out.iter_mut().zip(source).for_each(|(out, &s)| *out = values[s as usize]));
    }

    /// Averages values per source cell into values per mesh vertex: the unweighted mean over the cells of the source around each vertex, summed
    /// in f64.
    /// NaN and infinities of a cell propagate to its vertices. Cells that the mesh has dropped do not count.
    ///
    /// # Panics
    /// If the order was made without cells.
    pub(super) fn average_cells(&self, values: &[f32], out: &mut [f32]) {
        let Some(around) = &self.cells else { panic!("the order was made without cells") };
        out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            let first = chunk * CHUNK;
            for (i, out) in out.iter_mut().enumerate() {
                let cells = &around.cells[around.starts[first + i]..around.starts[first + i + 1]];
                let sum: f64 = cells.iter().map(|&cell| f64::from(values[cell as usize])).sum();
                *out = (sum / cells.len() as f64) as f32;
            }
        });
    }
}

impl CellsAround {
    /// Counting sort of the corners by vertex.
    fn of(mesh: &Mesh) -> Self {
        let tets = &mesh.topology.tets;
        let mut starts = vec![0usize; mesh.vertex_source.len() + 1];
        for &vertex in tets.as_flattened() {
            starts[vertex as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut cells = vec![0u32; 4 * tets.len()];
        for (tet, &source) in tets.iter().zip(&mesh.cell_source) {
            for &vertex in tet {
                cells[next[vertex as usize]] = source;
                next[vertex as usize] += 1;
            }
        }
        let mut around = Self { starts, cells };
        if has_repeats(&mesh.cell_source) {
            around.drop_repeats();
        }
        around
    }

    /// Leaves each source cell once at a vertex, whichever number of its tetrahedra meet there.
    fn drop_repeats(&mut self) {
        let Self { starts, cells } = self;
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
}

/// Whether a number occurs twice.
fn has_repeats(numbers: &[u32]) -> bool {
    let mut seen = vec![false; numbers.iter().max().map_or(0, |&most| most as usize + 1)];
    numbers.iter().any(|&number| std::mem::replace(&mut seen[number as usize], true))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{RawMesh, SolidShape};
    use glam::DVec3;

    #[test]
    fn a_split_cell_counts_once_at_each_of_its_vertices() {
        // Two cubes side by side.
        let points = (0..12).map(|i| DVec3::new(f64::from(i % 3), f64::from(i / 3 % 2), f64::from(i / 6))).collect();
        let mut raw = RawMesh { points, ..RawMesh::default() };
        for x in 0..2 {
            let corners = [0, 1, 4, 3, 6, 7, 10, 9].map(|corner| corner + x);
            raw.cells.solids.push(SolidShape::Hexahedron, corners.into_iter());
        }
        let (mesh, report) = Mesh::build(raw).unwrap();
        assert_eq!((report.cells_in, report.split_cells, report.cells_out), (2, 2, 12));
        let (order, _) = VertexOrder::new(mesh, true);
        let mut out = [0.0; 12];
        order.average_cells(&[1.0, 4.0], &mut out);
        for (value, source) in out.into_iter().zip(order.vertex_source()) {
            assert_eq!(value, [1.0, 2.5, 4.0][*source as usize % 3]);
        }
    }
}

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

    /// Averages values per source cell into values per mesh vertex: the unweighted mean over the cells around each vertex, summed in f64.
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
        Self { starts, cells }
    }
}

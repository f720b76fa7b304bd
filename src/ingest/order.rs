//! Reordering from the file's numbering to the store's: values of vertices and of cells in curve order.

use super::plan::{Means, PlannedField};
use crate::field::Association;
use crate::mesh::{Mesh, Positions, SourceCells};
use rayon::prelude::*;

/// Values per parallel task.
const CHUNK: usize = 16_384;

/// Source of each value of the store.
pub(super) struct ValueOrder {
    vertex_source: Vec<u32>,
    /// The source's cells, in the order of the store.
    cell_source: Vec<u32>,
    around: Option<CellsAround>,
}

/// The source's cells around each vertex, for those that are in the mesh.
struct CellsAround {
    /// First index into `cells` of each vertex, and the end of the last.
    starts: Vec<usize>,
    /// Cell indices in the source, ascending along the mesh's cell order.
    cells: Vec<u32>,
    /// Volume of each cell of the source, as far as it is in the mesh.
    volumes: Vec<f64>,
}

impl ValueOrder {
    /// The order of a mesh for these fields, and its vertex positions; most of the mesh is freed.
    pub(super) fn new(mesh: Mesh, fields: &[PlannedField]) -> (Self, Positions) {
        let around = fields.iter().any(|field| field.means.is_some()).then(|| CellsAround::of(&mesh));
        let parts = SourceCells::of(&mesh.cell_source);
        let cell_source = parts.firsts().map(|cell| mesh.cell_source[cell as usize]).collect();
        (Self { vertex_source: mesh.vertex_source, cell_source, around }, mesh.positions)
    }

    /// The source point of each vertex.
    pub(super) fn vertex_source(&self) -> &[u32] {
        &self.vertex_source
    }

    /// Number of values of a step in the store.
    pub(super) fn count(&self, values_of: Association) -> usize {
        match values_of {
            Association::Point => self.vertex_source.len(),
            Association::Cell => self.cell_source.len(),
        }
    }

    /// Gathers values per source point into values per mesh vertex.
    pub(super) fn gather_points(&self, values: &[f32], out: &mut [f32]) {
        gather(&self.vertex_source, values, out);
    }

    /// Gathers values per source cell in the order of the store.
    pub(super) fn gather_cells(&self, values: &[f32], out: &mut [f32]) {
        gather(&self.cell_source, values, out);
    }

    /// Averages values per source cell into values per mesh vertex: the mean over the cells of the source around each vertex, summed in f64.
    /// NaN and infinities of a cell propagate to its vertices. Cells that the mesh has dropped do not count.
    ///
    /// # Panics
    /// If the order was made for fields that have no means.
    pub(super) fn average_cells(&self, values: &[f32], means: Means, out: &mut [f32]) {
        let Some(around) = &self.around else { panic!("the order was made without means") };
        out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            let first = chunk * CHUNK;
            for (i, out) in out.iter_mut().enumerate() {
                let cells = &around.cells[around.starts[first + i]..around.starts[first + i + 1]];
                let value = |&cell: &u32| f64::from(values[cell as usize]);
                let volume = |&cell: &u32| around.volumes[cell as usize];
                let mean = match means {
                    Means::Unweighted => cells.iter().map(value).sum::<f64>() / cells.len() as f64,
                    Means::ByVolume => {
                        let weighted = cells.iter().map(|cell| volume(cell) * value(cell)).sum::<f64>();
                        weighted / cells.iter().map(volume).sum::<f64>()
                    }
                };
                *out = mean as f32;
            }
        });
    }
}

fn gather(sources: &[u32], values: &[f32], out: &mut [f32]) {
    let pairs = out.par_chunks_mut(CHUNK).zip(sources.par_chunks(CHUNK));
    pairs.for_each(|(out, source)| out.iter_mut().zip(source).for_each(|(out, &s)| *out = values[s as usize]));
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
        let mut volumes = vec![0.0; mesh.cell_source.iter().max().map_or(0, |&most| most as usize + 1)];
        for (tet, &source) in (0..).zip(&mesh.cell_source) {
            volumes[source as usize] += mesh.cell_volume(tet);
        }
        let mut around = Self { starts, cells, volumes };
        if !SourceCells::of(&mesh.cell_source).are_whole() {
            around.drop_repeats();
        }
        around
    }

    /// Leaves each source cell once at a vertex, whichever number of its tetrahedra meet there.
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::FieldInfo;
    use crate::mesh::{RawMesh, SolidShape};
    use glam::DVec3;

    #[test]
    fn a_split_cell_counts_once_at_each_of_its_vertices() {
        // Two boxes side by side, the first twice as wide.
        let at = |i: i32| DVec3::new([0.0, 2.0, 3.0][i as usize % 3], f64::from(i / 3 % 2), f64::from(i / 6));
        let points = (0..12).map(at).collect();
        let mut raw = RawMesh { points, ..RawMesh::default() };
        for x in 0..2 {
            let corners = [0, 1, 4, 3, 6, 7, 10, 9].map(|corner| corner + x);
            raw.cells.solids.push(SolidShape::Hexahedron, corners.into_iter());
        }
        let (mesh, report) = Mesh::build(raw).unwrap();
        assert_eq!((report.cells_in, report.split_cells, report.cells_out), (2, 2, 12));
        let info = FieldInfo { name: "c".to_owned(), components: 1, association: Association::Cell };
        let field = PlannedField { info, reads: vec![0], outputs: Vec::new(), means: Some(Means::ByVolume) };
        let (order, _) = ValueOrder::new(mesh, &[field]);
        for (means, middle) in [(Means::Unweighted, 2.5), (Means::ByVolume, (2.0 + 4.0) / 3.0)] {
            let mut out = [0.0; 12];
            order.average_cells(&[1.0, 4.0], means, &mut out);
            for (value, source) in out.into_iter().zip(order.vertex_source()) {
                assert_eq!(value, [1.0, middle, 4.0][*source as usize % 3]);
            }
        }
        assert_eq!((order.count(Association::Point), order.count(Association::Cell)), (12, 2));
        let mut out = [0.0; 2];
        order.gather_cells(&[1.0, 4.0], &mut out);
        assert!(out == [1.0, 4.0] || out == [4.0, 1.0]);
    }
}

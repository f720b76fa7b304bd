//! Reordering from the file's numbering to the store's: values of vertices and of cells in curve order. A vertex that was added in the
//! middle of a cell has the mean of the cell's corners.

use super::plan::{Means, PlannedField};
use crate::field::Association;
use crate::mesh::{CellsAround, Mesh, Positions, SourceCells};
use rayon::prelude::*;

/// Values per parallel task.
const CHUNK: usize = 16_384;

/// Source of each value of the store.
pub(super) struct ValueOrder {
    vertex_source: Vec<u32>,
    /// The vertices that are no points of the source, with the vertices whose mean they have.
    steiner: Vec<(u32, Vec<u32>)>,
    /// The source's cells, in the order of the store.
    cell_source: Vec<u32>,
    /// For fields that are averaged: the cells around each vertex, and the source of each cell of the mesh.
    around: Option<(CellsAround, Vec<u32>)>,
}

impl ValueOrder {
    /// The order of a mesh for these fields, and its vertex positions; most of the mesh is freed.
    pub(super) fn new(mesh: Mesh, fields: &[PlannedField]) -> (Self, Positions) {
        let around = fields.iter().any(|field| field.means.is_some()).then(|| CellsAround::of(&mesh));
        let parts = SourceCells::of(&mesh.cell_source);
        let cell_source = parts.firsts().map(|cell| mesh.cell_source[cell as usize]).collect();
        let around = around.map(|around| (around, mesh.cell_source));
        let steiner = mesh.split_cells.steiner_corners().collect();
        (Self { vertex_source: mesh.vertex_source, steiner, cell_source, around }, mesh.positions)
    }

    /// The source point of each vertex; a number beyond the points for those that were added.
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

    /// Gathers values per source point into values per mesh vertex. A vertex that was added has the mean of its cell's corners, each once,
    /// summed in f64: NaN if one of them is NaN or infinite.
    pub(super) fn gather_points(&self, values: &[f32], out: &mut [f32]) {
        gather(&self.vertex_source, values, out);
        let mean = |(_, corners): &(u32, Vec<u32>)| {
            let sum: f64 = corners.iter().map(|&corner| f64::from(out[corner as usize])).sum();
            if sum.is_finite() { (sum / corners.len() as f64) as f32 } else { f32::NAN }
        };
        let means: Vec<f32> = self.steiner.par_iter().map(mean).collect();
        self.steiner.iter().zip(means).for_each(|((vertex, _), mean)| out[*vertex as usize] = mean);
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
        let Some((around, cell_source)) = &self.around else { panic!("the order was made without means") };
        let value = |cell: u32| values[cell_source[cell as usize] as usize];
        match means {
            Means::Unweighted => around.means(value, |_, _| 1.0, out),
            Means::ByVolume => around.means(value, |_, volume| volume, out),
        }
    }
}

/// NaN where a source is beyond the values.
fn gather(sources: &[u32], values: &[f32], out: &mut [f32]) {
    let pairs = out.par_chunks_mut(CHUNK).zip(sources.par_chunks(CHUNK));
    let value = |source: u32| values.get(source as usize).copied().unwrap_or(f32::NAN);
    pairs.for_each(|(out, sources)| out.iter_mut().zip(sources).for_each(|(out, &source)| *out = value(source)));
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

    #[test]
    fn an_added_vertex_has_the_mean_of_its_corners_and_nan_if_one_is_not_finite() {
        let corner = |i: u32| DVec3::new(f64::from((i ^ (i >> 1)) & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
        let mut raw = RawMesh { points: (0..8).map(corner).collect(), ..RawMesh::default() };
        raw.points[1] = DVec3::new(0.4375, 0.5, 0.5);
        raw.cells.solids.push(SolidShape::Hexahedron, 0..8);
        let (order, _) = ValueOrder::new(Mesh::build(raw).unwrap().0, &[]);
        let gathered = |values: [f32; 8]| {
            let mut out = [0.0; 9];
            order.gather_points(&values, &mut out);
            let of = |source: u32| out[order.vertex_source().iter().position(|&of| of == source).unwrap()];
            assert!((0..8).all(|i| of(i).to_bits() == values[i as usize].to_bits()));
            of(8)
        };
        let values = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];
        assert_eq!(gathered(values), 255.0 / 8.0);
        // In f32 the small ones would be lost.
        assert_eq!(gathered([1e8, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1e8]), 0.75);
        assert_eq!(gathered([f32::MAX; 8]), f32::MAX);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut values = values;
            values[3] = bad;
            assert!(gathered(values).is_nan());
            values[4] = f32::NEG_INFINITY;
            assert!(gathered(values).is_nan());
        }
    }
}

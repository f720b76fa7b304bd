//! Cells of a mesh that are parts of one cell of its source, and values of cells at vertices.

use super::{Mesh, NONE};

/// The cells of a mesh's source, in the order of the mesh: each is numbered where the mesh has its first part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceCells {
    /// The cell of the mesh that is the first part of each; `None` if all cells of the mesh are whole ones.
    first: Option<Vec<u32>>,
    /// The number of the source's cell that each cell of the mesh is a part of; empty if all are whole ones.
    of_cell: Vec<u32>,
    cells: usize,
}

impl SourceCells {
    /// The source's cells of a mesh with these [sources](Mesh::cell_source) of its cells.
    pub fn of(cell_source: &[u32]) -> Self {
        let cells = cell_source.len();
        let sources = cell_source.iter().max().map_or(0, |&most| most as usize + 1);
        // Most meshes have whole cells only, which is known from a byte for each.
        let mut is_met = vec![false; sources];
        if !cell_source.iter().any(|&source| std::mem::replace(&mut is_met[source as usize], true)) {
            return Self { first: None, of_cell: Vec::new(), cells };
        }
        let mut number = vec![NONE; sources];
        let (mut first, mut of_cell) = (Vec::new(), Vec::with_capacity(cells));
        for (cell, &source) in (0u32..).zip(cell_source) {
            let known = &mut number[source as usize];
            if *known == NONE {
                *known = first.len() as u32;
                first.push(cell);
            }
            of_cell.push(*known);
        }
        Self { first: Some(first), of_cell, cells }
    }

    /// Number of the source's cells.
    pub fn len(&self) -> usize {
        self.first.as_ref().map_or(self.cells, Vec::len)
    }

    /// Number of the mesh's cells.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether all cells of the mesh are whole ones.
    pub fn are_whole(&self) -> bool {
        self.first.is_none()
    }

    /// The cell of the mesh that is the first part of each.
    pub fn firsts(&self) -> impl Iterator<Item = u32> {
        let all = if self.first.is_none() { 0..self.cells as u32 } else { 0..0 };
        self.first.iter().flatten().copied().chain(all)
    }

    /// Copies values of the source's cells to the cells of the mesh.
    ///
    /// # Panics
    /// If there are not as many values as cells of either.
    pub fn expand<T: Copy>(&self, values: &[T], out: &mut [T]) {
        assert_eq!([values.len(), out.len()], [self.len(), self.cells], "one value a cell");
        if self.are_whole() {
            out.copy_from_slice(values);
            return;
        }
        out.iter_mut().zip(&self.of_cell).for_each(|(out, &of)| *out = values[of as usize]);
    }
}

impl Mesh {
    /// Values of cells brought to the vertices: the mean of the finite ones around each, weighted by the volumes of the cells, summed in
    /// f64; NaN where there is none.
    ///
    /// # Panics
    /// If there is not one value per cell.
    pub fn means_at_vertices(&self, values: &[f32]) -> Vec<f32> {
        assert_eq!(values.len(), self.topology.tets.len(), "one value a cell");
        let mut sums = vec![[0.0f64; 2]; self.positions.local.len()];
        for ((cell, tet), &value) in (0..).zip(&self.topology.tets).zip(values).filter(|(_, value)| value.is_finite()) {
            let volume = self.cell_volume(cell);
            for &vertex in tet {
                let [weighted, weights] = &mut sums[vertex as usize];
                *weighted += volume * f64::from(value);
                *weights += volume;
            }
        }
        sums.iter().map(|[weighted, weights]| (weighted / weights) as f32).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_meshes::kuhn_grid;

    #[test]
    fn cells_of_the_source_are_numbered_by_their_first_part_and_give_it_their_value() {
        let cells = SourceCells::of(&[7, 2, 7, 0, 2, 2]);
        assert_eq!((cells.len(), cells.are_whole(), cells.firsts().collect::<Vec<_>>()), (3, false, vec![0, 1, 3]));
        let mut out = [0.0; 6];
        cells.expand(&[70.0, 20.0, 1.0], &mut out);
        assert_eq!(out, [70.0, 20.0, 70.0, 1.0, 20.0, 20.0]);

        let whole = SourceCells::of(&[5, 0, 3]);
        assert_eq!((whole.len(), whole.are_whole(), whole.firsts().collect::<Vec<_>>()), (3, true, vec![0, 1, 2]));
        whole.expand(&[1.0, 2.0, 3.0], &mut out[..3]);
        assert_eq!(out[..3], [1.0, 2.0, 3.0]);
        assert!(SourceCells::of(&[]).is_empty());
    }

    #[test]
    fn means_at_vertices_are_those_of_the_finite_cells_around_weighted_by_volume() {
        let (mesh, _) = Mesh::build(kuhn_grid([2, 1, 1])).unwrap();
        let mut values: Vec<f32> = (0..mesh.topology.tets.len()).map(|cell| cell as f32).collect();
        values[3] = f32::INFINITY;
        let found = mesh.means_at_vertices(&values);
        for (vertex, &found) in (0..).zip(&found) {
            // All cells have one volume.
            let around = (0..values.len()).filter(|&c| c != 3 && mesh.topology.tets[c].contains(&vertex));
            let around: Vec<f64> = around.map(|c| f64::from(values[c])).collect();
            let expected = around.iter().sum::<f64>() / around.len() as f64;
            assert!((f64::from(found) - expected).abs() < 1e-5, "{vertex}: {found}");
        }
        assert!(mesh.means_at_vertices(&vec![f32::NAN; values.len()]).iter().all(|mean| mean.is_nan()));
    }
}

//! Cells of a mesh that are parts of one cell of its source.

use super::NONE;

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
    /// The source's cells of a mesh with these [sources](super::Mesh::cell_source) of its cells.
    pub fn of(cell_source: &[u32]) -> Self {
        let cells = cell_source.len();
        let sources = cell_source.iter().max().map_or(0, |&most| most as usize + 1);
        // Memory is for cells that there are, not for numbers that a file claims.
        if sources / 64 > cells {
            let mut sorted = cell_source.to_vec();
            sorted.sort_unstable();
            sorted.dedup();
            let rank = |source: &u32| sorted.partition_point(|other| other < source) as u32;
            return Self::of(&cell_source.iter().map(rank).collect::<Vec<_>>());
        }
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

    /// For each cell of the mesh the source's cell that it is a part of; `None` if all are whole ones.
    pub fn of_parts(&self) -> Option<&[u32]> {
        self.first.as_ref().map(|_| &self.of_cell[..])
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
        self.expand_from(0, values, out);
    }

    /// As [`Self::expand`], for the cells of the mesh from `first` on, one for each place of `out`.
    ///
    /// # Panics
    /// If there are not as many values as cells of the source, or the mesh has no such cells.
    pub fn expand_from<T: Copy>(&self, first: usize, values: &[T], out: &mut [T]) {
        assert_eq!(values.len(), self.len(), "one value a cell of the source");
        let range = first..first + out.len();
        if self.are_whole() {
            out.copy_from_slice(&values[range]);
            return;
        }
        out.iter_mut().zip(&self.of_cell[range]).for_each(|(out, &of)| *out = values[of as usize]);
    }

    /// Which chunks of `length` values of the source's cells the wanted chunks of as many cells of the mesh need.
    ///
    /// # Panics
    /// If there is not one wish for each chunk.
    pub fn needed_chunks(&self, length: usize, wanted: &[bool]) -> Vec<bool> {
        assert_eq!(wanted.len(), self.cells.div_ceil(length), "a wish for each chunk");
        if self.are_whole() {
            return wanted.to_vec();
        }
        let mut needed = vec![false; self.len().div_ceil(length)];
        for (cells, _) in self.of_cell.chunks(length).zip(wanted).filter(|(_, wanted)| **wanted) {
            cells.iter().for_each(|&of| needed[of as usize / length] = true);
        }
        needed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_the_source_are_numbered_by_their_first_part_and_give_it_their_value() {
        let cells = SourceCells::of(&[7, 2, 7, 0, 2, 2]);
        assert_eq!((cells.len(), cells.are_whole(), cells.firsts().collect::<Vec<_>>()), (3, false, vec![0, 1, 3]));
        assert_eq!(cells.of_parts(), Some(&[0, 1, 0, 2, 1, 1][..]));
        let mut out = [0.0; 6];
        cells.expand(&[70.0, 20.0, 1.0], &mut out);
        assert_eq!(out, [70.0, 20.0, 70.0, 1.0, 20.0, 20.0]);

        let mut some = [0.0; 2];
        cells.expand_from(3, &[70.0, 20.0, 1.0], &mut some);
        assert_eq!(some, [1.0, 20.0]);
        // Cells 2 and 3 are parts of the first and third of the source; the others of the first two.
        assert_eq!(cells.needed_chunks(2, &[false, true, false]), [true, true]);
        assert_eq!(cells.needed_chunks(2, &[true, false, false]), [true, false]);
        assert_eq!(cells.needed_chunks(1, &[false, false, false, false, true, false]), [false, true, false]);

        let whole = SourceCells::of(&[5, 0, 3]);
        assert_eq!(whole.needed_chunks(2, &[false, true]), [false, true]);
        assert_eq!((whole.len(), whole.are_whole(), whole.firsts().collect::<Vec<_>>()), (3, true, vec![0, 1, 2]));
        assert_eq!(whole.of_parts(), None);
        whole.expand(&[1.0, 2.0, 3.0], &mut out[..3]);
        assert_eq!(out[..3], [1.0, 2.0, 3.0]);
        assert!(SourceCells::of(&[]).is_empty());
        // Numbers far beyond the cells take no memory of their own.
        let far = SourceCells::of(&[u32::MAX, 5, u32::MAX]);
        assert_eq!((far.len(), far.firsts().collect::<Vec<_>>()), (2, vec![0, 1]));
    }
}

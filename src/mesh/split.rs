//! Splits the cells of a file into tetrahedra: the only place that knows other shapes.

use std::ops::Range;

/// The cells of a [`RawMesh`](super::RawMesh), numbered in file order. A new shape is a new field, and its split in [`split`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Vertex indices of the linear tetrahedra.
    pub tets: Vec<[u32; 4]>,
}

impl Cells {
    /// Number of cells.
    pub fn len(&self) -> usize {
        self.tets.len()
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl From<Vec<[u32; 4]>> for Cells {
    fn from(tets: Vec<[u32; 4]>) -> Self {
        Self { tets }
    }
}

/// Tetrahedra that fill the cells of a file, cell by cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Vertex indices.
    pub tets: Vec<[u32; 4]>,
    /// Cell of each tetrahedron, ascending; `None` if tetrahedron i is cell i.
    pub cell_of_tet: Option<Vec<u32>>,
}

impl Split {
    /// The tetrahedra of a cell.
    pub fn of_cell(&self, cell: u32) -> &[[u32; 4]] {
        let range = match &self.cell_of_tet {
            None => cell as usize..cell as usize + 1,
            Some(cells) => {
                Range { start: cells.partition_point(|&c| c < cell), end: cells.partition_point(|&c| c <= cell) }
            }
        };
        self.tets.get(range).unwrap_or_default()
    }

    /// Replaces indices of tetrahedra by those of their cells.
    pub(super) fn to_cells(&self, tets: &mut [u32]) {
        if let Some(cells) = &self.cell_of_tet {
            tets.iter_mut().for_each(|tet| *tet = cells[*tet as usize]);
        }
    }
}

/// Splits cells into tetrahedra; a tetrahedron stays as it is.
pub fn split(cells: Cells) -> Split {
    Split { tets: cells.tets, cell_of_tet: None }
}

/// Replaces the values of all cells of a file by those of `sources`, the source cells of its mesh: in place if no source lies before its
/// target, as when cells are only left out; else through a copy, as when a split makes several tetrahedra of a cell.
pub fn gather(values: &mut Vec<f32>, sources: &[u32]) {
    if sources.iter().enumerate().all(|(to, &from)| from as usize >= to) {
        for (to, &from) in sources.iter().enumerate() {
            values[to] = values[from as usize];
        }
        values.truncate(sources.len());
    } else {
        *values = sources.iter().map(|&from| values[from as usize]).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three cells of two, one and three tetrahedra.
    fn synthetic() -> Split {
        Split { tets: (0..6).map(|i| [i, i + 1, i + 2, i + 3]).collect(), cell_of_tet: Some(vec![0, 0, 1, 2, 2, 2]) }
    }

    #[test]
    fn tetrahedra_are_their_own_cells() {
        let tets = vec![[0, 1, 2, 3], [1, 2, 3, 4]];
        let cells = Cells::from(tets.clone());
        assert_eq!((cells.len(), cells.is_empty(), Cells::default().is_empty()), (2, false, true));
        let split = split(cells);
        assert_eq!(split, Split { tets: tets.clone(), cell_of_tet: None });
        assert_eq!((split.of_cell(1), split.of_cell(2)), (&tets[1..], &[][..]));
    }

    #[test]
    fn tetrahedra_of_a_split_know_their_cell_and_cells_their_tetrahedra() {
        let split = synthetic();
        let lengths = [0, 1, 2, 3].map(|cell| split.of_cell(cell).len());
        assert_eq!((lengths, split.of_cell(1)), ([2, 1, 3, 0], &split.tets[2..3]));
        let mut tets = vec![5, 0, 2];
        split.to_cells(&mut tets);
        assert_eq!(tets, [2, 0, 1]);
    }

    #[test]
    fn values_of_cells_are_gathered_where_cells_are_left_out_and_where_they_are_split() {
        let gathered = |sources: &[u32]| {
            let mut values = vec![10.0, 11.0, 12.0];
            gather(&mut values, sources);
            values
        };
        assert_eq!(gathered(&[1, 2]), [11.0, 12.0]);
        assert_eq!(gathered(&synthetic().cell_of_tet.unwrap()), [10.0, 10.0, 11.0, 12.0, 12.0, 12.0]);
        // In place, the first of these would be overwritten.
        assert_eq!(gathered(&[2, 0, 1, 0]), [12.0, 10.0, 11.0, 10.0]);
    }
}

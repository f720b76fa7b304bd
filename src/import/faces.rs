//! Faces of polyhedra in whatever file, cell by cell.

use super::cell_list::{Faces, listed_faces};

/// The faces of a piece's polyhedra.
pub(super) enum FacesOfCells {
    /// A list of words for each polyhedron, and the range of each cell's.
    Lists { words: Vec<u64>, ends: Vec<Option<usize>> },
    /// Faces by their ends in a list of corners, and cells by their ends in a list of faces.
    Shared { corners: Vec<u64>, face_ends: Vec<u64>, faces: Vec<u64>, cell_ends: Vec<u64> },
}

impl FacesOfCells {
    /// The faces of each cell in turn, `None` for one that is no polyhedron; an error says what is wrong with the cell.
    pub(super) fn of_cells(&self, cells: usize) -> impl Iterator<Item = Faces> {
        let mut begin = 0;
        (0..cells).map(move |cell| match self {
            Self::Lists { words, ends } => {
                let Some(end) = ends.get(cell).copied().flatten() else { return Ok(None) };
                let list = words.get(begin..end).ok_or("has a list of faces that begins behind its end")?;
                begin = end;
                listed_faces(list)
            }
            Self::Shared { corners, face_ends, faces, cell_ends } => {
                let end = cell_ends.get(cell).map_or(0, |&end| end as usize);
                let of_cell = faces.get(begin..end).ok_or("has no faces")?;
                begin = end;
                let mut named = of_cell.to_vec();
                named.sort_unstable();
                if named.windows(2).any(|pair| pair[0] == pair[1]) {
                    return Err("has a face twice");
                }
                let face = |&face: &u64| {
                    let face = face as usize;
                    let from = if face == 0 { 0 } else { face_ends.get(face - 1).copied()? };
                    Some(corners.get(from as usize..*face_ends.get(face)? as usize)?.to_vec())
                };
                let found =
                    of_cell.iter().map(face).collect::<Option<Vec<_>>>().ok_or("has a face that is not there")?;
                Ok((!found.is_empty()).then_some(found))
            }
        })
    }
}

/// Cells that may have one face. There are two in a mesh; more are overlapping cells. What a face has is copied for each.
pub(super) const CELLS_OF_A_FACE: u8 = 64;

/// A face that more cells name.
pub(super) fn of_too_many(faces: &[u64], count: usize) -> Option<u64> {
    let mut cells = vec![0u8; count];
    faces.iter().copied().find(|&face| {
        let cells = &mut cells[face as usize];
        *cells = cells.saturating_add(1);
        *cells > CELLS_OF_A_FACE
    })
}

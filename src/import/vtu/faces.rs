//! Faces of the polyhedra of `.vtu` files.
//!
//! Files of version 2.3 (VTK 9.4) list faces and say which each cell has: `face_connectivity`, `face_offsets`, `polyhedron_to_faces`,
//! `polyhedron_offsets`. Older ones have for each polyhedron the number of its faces, and for each face the number of its corners and
//! these: `faces`, with the end of each cell's list in `faceoffsets`, -1 for a cell without one.

use super::super::cell_list::{Faces, listed_faces};
use super::cells::indices;
use super::{ArrayInfo, Piece, VtuFile};
use crate::error::{FileError, FileResult};

/// Names of the arrays.
pub(super) const FACE_ARRAYS: [&str; 6] =
    ["faces", "faceoffsets", "face_connectivity", "face_offsets", "polyhedron_to_faces", "polyhedron_offsets"];

/// The faces of a piece's polyhedra.
pub(super) enum FacesOfCells {
    /// A list of words for each polyhedron, and the range of each cell's.
    Lists { words: Vec<u64>, ends: Vec<Option<usize>> },
    /// Faces by their ends in a list of corners, and cells by their ends in a list of faces.
    Shared { corners: Vec<u64>, face_ends: Vec<u64>, faces: Vec<u64>, cell_ends: Vec<u64> },
}

impl FacesOfCells {
    /// Reads the arrays of a piece that has polyhedra.
    ///
    /// # Errors
    /// If it lacks an array, or one is damaged.
    pub(super) fn read(file: &VtuFile, piece: &Piece) -> FileResult<Self> {
        let find = |name: &str| piece.face_arrays.iter().find(|array| array.name == name);
        let needed = |name: &str| {
            find(name).ok_or_else(|| {
                FileError::invalid(&file.path, "<Cells>", format!("has polyhedra, but lacks the array '{name}'"))
            })
        };
        if find("polyhedron_offsets").is_some() {
            let cell_ends = ascending(file, needed("polyhedron_offsets")?, piece.cells)?;
            let faces = indices(file, needed("polyhedron_to_faces")?, last(&cell_ends))?;
            // A number beyond memory is beyond the array, too.
            let count =
                faces.iter().max().map_or(0, |&most| usize::try_from(most).unwrap_or(usize::MAX).saturating_add(1));
            let face_ends = ascending(file, needed("face_offsets")?, count)?;
            let corners = indices(file, needed("face_connectivity")?, last(&face_ends))?;
            if let Some(face) = of_too_many(&faces, count) {
                let problem = format!("name face {face} for more than {CELLS_OF_A_FACE} cells");
                let array = needed("polyhedron_to_faces")?;
                return Err(file.invalid(array, array.byte, problem));
            }
            return Ok(Self::Shared { corners, face_ends, faces, cell_ends });
        }
        let array = needed("faceoffsets")?;
        let ends = file.values(&file.decode(array, piece.cells)?).to_f64();
        let ends: Vec<Option<usize>> = ends.into_iter().map(|end| (end >= 0.0).then_some(end as usize)).collect();
        let length = ends.iter().flatten().max().copied().unwrap_or(0);
        Ok(Self::Lists { words: indices(file, needed("faces")?, length)?, ends })
    }

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

/// An array of ends, which do not decrease.
fn ascending(file: &VtuFile, array: &ArrayInfo, count: usize) -> FileResult<Vec<u64>> {
    let ends = indices(file, array, count)?;
    match ends.windows(2).position(|pair| pair[1] < pair[0]) {
        None => Ok(ends),
        Some(i) => Err(file.invalid(array, array.byte, format!("decrease at number {}", i + 1))),
    }
}

/// Cells that may have one face. There are two in a mesh; more are overlapping cells. What a face has is copied for each.
const CELLS_OF_A_FACE: u8 = 64;

/// A face that more cells name.
fn of_too_many(faces: &[u64], count: usize) -> Option<u64> {
    let mut cells = vec![0u8; count];
    faces.iter().copied().find(|&face| {
        let cells = &mut cells[face as usize];
        *cells = cells.saturating_add(1);
        *cells > CELLS_OF_A_FACE
    })
}

/// The last of some ends; beyond every array if it is beyond memory.
fn last(ends: &[u64]) -> usize {
    ends.last().map_or(0, |&end| usize::try_from(end).unwrap_or(usize::MAX))
}

//! Faces of the polyhedra of `.vtu` files.
//!
//! Files of version 2.3 (VTK 9.4) list faces and say which each cell has: `face_connectivity`, `face_offsets`, `polyhedron_to_faces`,
//! `polyhedron_offsets`. Older ones have for each polyhedron the number of its faces, and for each face the number of its corners and
//! these: `faces`, with the end of each cell's list in `faceoffsets`, -1 for a cell without one.

use super::super::faces::{CELLS_OF_A_FACE, FacesOfCells, of_too_many};
use super::cells::indices;
use super::{ArrayInfo, Piece, VtuFile};
use crate::error::{FileError, FileResult};

/// Names of the arrays.
pub(super) const FACE_ARRAYS: [&str; 6] =
    ["faces", "faceoffsets", "face_connectivity", "face_offsets", "polyhedron_to_faces", "polyhedron_offsets"];

/// Reads the faces of a piece that has polyhedra.
///
/// # Errors
/// If it lacks an array, or one is damaged.
pub(super) fn read_faces(file: &VtuFile, piece: &Piece) -> FileResult<FacesOfCells> {
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
        let count = faces.iter().max().map_or(0, |&most| usize::try_from(most).unwrap_or(usize::MAX).saturating_add(1));
        let face_ends = ascending(file, needed("face_offsets")?, count)?;
        let corners = indices(file, needed("face_connectivity")?, last(&face_ends))?;
        if let Some(face) = of_too_many(&faces, count) {
            let problem = format!("name face {face} for more than {CELLS_OF_A_FACE} cells");
            let array = needed("polyhedron_to_faces")?;
            return Err(file.invalid(array, array.byte, problem));
        }
        return Ok(FacesOfCells::Shared { corners, face_ends, faces, cell_ends });
    }
    let array = needed("faceoffsets")?;
    let ends = file.values(&file.decode(array, piece.cells)?).to_f64();
    let ends: Vec<Option<usize>> = ends.into_iter().map(|end| (end >= 0.0).then_some(end as usize)).collect();
    let length = ends.iter().flatten().max().copied().unwrap_or(0);
    Ok(FacesOfCells::Lists { words: indices(file, needed("faces")?, length)?, ends })
}

/// An array of ends, which do not decrease.
fn ascending(file: &VtuFile, array: &ArrayInfo, count: usize) -> FileResult<Vec<u64>> {
    let ends = indices(file, array, count)?;
    match ends.windows(2).position(|pair| pair[1] < pair[0]) {
        None => Ok(ends),
        Some(i) => Err(file.invalid(array, array.byte, format!("decrease at number {}", i + 1))),
    }
}

/// The last of some ends; beyond every array if it is beyond memory.
fn last(ends: &[u64]) -> usize {
    ends.last().map_or(0, |&end| usize::try_from(end).unwrap_or(usize::MAX))
}

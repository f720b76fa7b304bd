//! Cells as VTK lists them, in whatever file: a type each, and where its vertices end in one list of all.

use super::cells::{GridReader, Kind, VERTEX_TYPES, kind_of, name_of, refuse_solid};
use crate::error::{FileError, FileResult};
use crate::mesh::polyhedron::take_faces;
use std::path::Path;

/// Bits of the cell array `vtkGhostType` that drop a cell: a duplicate of another piece's, refined, or hidden
/// (`vtkDataSetAttributes::CellGhostTypes`).
pub(super) const GHOST_BITS: u64 = 1 | 8 | 32;

/// The cell array in which parallel writers flag duplicates.
pub(super) const GHOST_ARRAY: &str = "vtkGhostType";

/// Whether the flags of a cell in [`GHOST_ARRAY`] drop it.
pub(super) fn is_ghost(flags: u64) -> bool {
    flags & GHOST_BITS != 0
}

/// The faces of a polyhedron, or what is wrong with them; `None` if the list has none for this cell.
pub(super) type Faces = Result<Option<Vec<Vec<u64>>>, &'static str>;

/// The faces of a list: their number, then for each the number of its corners, and these.
pub(super) fn listed_faces(list: &[u64]) -> Faces {
    match take_faces(list) {
        Some((faces, [])) => Ok(Some(faces)),
        _ => Err("has a list of faces that is cut"),
    }
}

/// The cells of a piece.
pub(super) struct CellList<'a> {
    /// The file, and the place in it that errors name.
    pub(super) path: &'a Path,
    pub(super) place: &'a str,
    /// The VTK type of each cell.
    pub(super) types: &'a [u64],
    /// Where the vertices of each cell end in `connectivity`, as many as types.
    pub(super) ends: &'a [u64],
    /// Indices of the piece's points.
    pub(super) connectivity: &'a [u64],
    /// Flags of [`GHOST_ARRAY`]; empty if the piece has none.
    pub(super) ghosts: &'a [u64],
}

impl CellList<'_> {
    /// Adds the cells to a mesh that has the piece's points, `points` from `first_point` on. `faces` yields those of each cell in turn.
    ///
    /// # Errors
    /// If ends decrease or lie beyond the list, or if a cell is of a type that is not read, or has vertices that are no points.
    pub(super) fn add_to(
        &self,
        grid: &mut GridReader,
        mut faces: impl Iterator<Item = Faces>,
        (points, first_point): (usize, usize),
    ) -> FileResult<()> {
        let invalid = |problem: String| {
            FileError::invalid(self.path, self.place, problem)
                .remedy("write the file again, or copy it again if it was cut")
        };
        let mut begin = 0;
        for (i, (&cell_type, &end)) in self.types.iter().zip(self.ends).enumerate() {
            let end = usize::try_from(end).unwrap_or(usize::MAX);
            let vertices = self.connectivity.get(begin..end).ok_or_else(|| {
                let (length, list) = (self.connectivity.len(), "the list of vertices");
                invalid(format!("offsets decrease at cell {i}, or it ends at {end} of {list}, which has {length}"))
            })?;
            begin = end;
            let of_cell = faces.next();
            if self.ghosts.get(i).is_some_and(|&flags| is_ghost(flags)) {
                grid.ghosts += 1;
                continue;
            }
            let named = |problem: String| FileError::invalid(self.path, format!("cell {i}"), problem);
            match self.read_type(i, cell_type)? {
                (number, Kind::Flat) if VERTEX_TYPES.contains(&number) => {
                    grid.push_points(i, number, vertices, points, first_point).map_err(invalid)?;
                }
                (flat, Kind::Flat) => grid.skip(flat, 1),
                (_, Kind::Polyhedron) => {
                    let faces = of_cell.unwrap_or(Ok(None)).map_err(|problem| named(problem.to_owned()))?;
                    let faces = faces.ok_or_else(|| named("is a polyhedron without faces".to_owned()))?;
                    grid.push_polyhedron(self.path, i, &faces, points, first_point).map_err(named)?;
                }
                read => grid.push(i, read, vertices, points, first_point).map_err(invalid)?,
            }
        }
        Ok(())
    }

    /// The VTK type of a cell that is read or skipped, and its kind. Any other type is an error.
    fn read_type(&self, cell: usize, cell_type: u64) -> FileResult<(u8, Kind)> {
        let place = || format!("cell {cell}");
        match kind_of(cell_type) {
            Some((number, Kind::Unread)) => {
                Err(refuse_solid(self.path, place(), &format!("is of type {number} ({})", name_of(number))))
            }
            Some(read) => Ok(read),
            None => {
                Err(FileError::invalid(self.path, place(), format!("is of type {cell_type}, which VTK does not know")))
            }
        }
    }
}

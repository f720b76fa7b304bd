//! Points and cells of `.vtu` files.

use super::super::cells::{GridReader, Kind, kind_of, name_of, refuse_solid};
use super::faces::FacesOfCells;
use super::{ArrayInfo, Piece, VtuFile};
use crate::error::{FileError, FileResult};
use crate::mesh::POLYHEDRON_VTK_TYPE;
use glam::DVec3;

/// Bits of the cell array `vtkGhostType` that drop a cell: a duplicate of another piece's, refined, or hidden
/// (`vtkDataSetAttributes::CellGhostTypes`).
const GHOST_BITS: u64 = 1 | 8 | 32;

/// Adds a piece of `file` to `grid`.
///
/// # Errors
/// If its arrays are damaged or contradict each other, or if a cell has a volume and a shape that is not read.
pub(crate) fn add_piece(grid: &mut GridReader, file: &VtuFile, piece: &Piece) -> FileResult<()> {
    grid.check_room(&file.path, "<Piece>", piece.points, piece.cells)?;
    let first_point = grid.mesh.points.len();
    add_points(grid, file, piece)?;
    if piece.cells > 0 {
        add_cells(grid, file, piece, first_point)?;
    }
    grid.cells += piece.cells;
    Ok(())
}

fn add_points(grid: &mut GridReader, file: &VtuFile, piece: &Piece) -> FileResult<()> {
    if piece.points == 0 {
        return Ok(());
    }
    let array = needed(file, &piece.coordinates, "Points")?;
    if array.components != 3 {
        return Err(file.invalid(array, array.byte, format!("has {} coordinates a point, not 3", array.components)));
    }
    let bytes = file.decode(array, piece.points)?;
    let coordinates = file.values(&bytes).to_f64();
    grid.mesh.points.extend(coordinates.chunks_exact(3).map(DVec3::from_slice));
    Ok(())
}

fn add_cells(grid: &mut GridReader, file: &VtuFile, piece: &Piece, first_point: usize) -> FileResult<()> {
    let types = indices(file, needed(file, &piece.types, "types")?, piece.cells)?;
    let offsets_array = needed(file, &piece.offsets, "offsets")?;
    let offsets = indices(file, offsets_array, piece.cells)?;
    let bad_offset = |i: usize| file.invalid(offsets_array, offsets_array.byte, format!("decrease at cell {i}"));
    if let Some(i) = offsets.windows(2).position(|pair| pair[1] < pair[0]) {
        return Err(bad_offset(i + 1));
    }
    let connectivity_array = needed(file, &piece.connectivity, "connectivity")?;
    let length = offsets.last().and_then(|&end| usize::try_from(end).ok()).ok_or_else(|| bad_offset(piece.cells))?;
    let connectivity = indices(file, connectivity_array, length)?;
    let ghosts = ghost_flags(file, piece)?;
    let has_polyhedra = types.contains(&u64::from(POLYHEDRON_VTK_TYPE));
    let faces = if has_polyhedra { Some(FacesOfCells::read(file, piece)?) } else { None };
    let mut faces = faces.as_ref().map(|faces| faces.of_cells(piece.cells));
    let mut begin = 0;
    for (i, (&cell_type, &end)) in types.iter().zip(&offsets).enumerate() {
        // In range: offsets do not decrease, and the last is the length.
        let vertices = &connectivity[begin..end as usize];
        begin = end as usize;
        let of_cell = faces.as_mut().and_then(Iterator::next);
        if ghosts.get(i).is_some_and(|flags| flags & GHOST_BITS != 0) {
            grid.ghosts += 1;
            continue;
        }
        let bad_cell = |problem: String| file.invalid(connectivity_array, connectivity_array.byte, problem);
        match read_type(file, i, cell_type)? {
            (flat, Kind::Flat) => grid.skip(flat, 1),
            (_, Kind::Polyhedron) => {
                let invalid = |problem: String| FileError::invalid(&file.path, format!("cell {i}"), problem);
                let faces = of_cell.unwrap_or(Ok(None)).map_err(|problem| invalid(problem.to_owned()))?;
                let faces = faces.ok_or_else(|| invalid("is a polyhedron without faces".to_owned()))?;
                grid.push_polyhedron(&file.path, i, &faces, piece.points, first_point).map_err(invalid)?;
            }
            read => grid.push(i, read, vertices, piece.points, first_point).map_err(bad_cell)?,
        }
    }
    Ok(())
}

/// The VTK type of a cell that is read or skipped, and its kind. Any other type is an error.
fn read_type(file: &VtuFile, cell: usize, cell_type: u64) -> FileResult<(u8, Kind)> {
    let place = || format!("cell {cell}");
    match kind_of(cell_type) {
        Some((number, Kind::Unread)) => {
            Err(refuse_solid(&file.path, place(), &format!("is of type {number} ({})", name_of(number))))
        }
        Some(read) => Ok(read),
        None => {
            Err(FileError::invalid(&file.path, place(), format!("is of type {cell_type}, which VTK does not know")))
        }
    }
}

fn ghost_flags(file: &VtuFile, piece: &Piece) -> FileResult<Vec<u64>> {
    let array = piece.cell_data.iter().find(|array| array.name == GHOST_ARRAY && array.components == 1);
    array.map_or(Ok(Vec::new()), |array| indices(file, array, piece.cells))
}

/// The cell array in which parallel writers flag duplicates.
pub(crate) const GHOST_ARRAY: &str = "vtkGhostType";

pub(super) fn indices(file: &VtuFile, array: &ArrayInfo, count: usize) -> FileResult<Vec<u64>> {
    let bytes = file.decode(array, count)?;
    file.values(&bytes)
        .to_indices()
        .map_err(|i| file.invalid(array, array.byte, format!("number {i} is negative or no integer")))
}

fn needed<'a>(file: &VtuFile, array: &'a Option<ArrayInfo>, name: &str) -> FileResult<&'a ArrayInfo> {
    array.as_ref().ok_or_else(|| FileError::invalid(&file.path, "<Piece>", format!("lacks the array '{name}'")))
}

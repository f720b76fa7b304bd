//! Points and cells of `.vtu` files.

use super::super::cell_list::{CellList, GHOST_ARRAY};
use super::super::cells::GridReader;
use super::faces::read_faces;
use super::{ArrayInfo, Piece, VtuFile};
use crate::error::{FileError, FileResult};
use crate::mesh::POLYHEDRON_VTK_TYPE;
use glam::DVec3;

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

pub(super) fn add_points(grid: &mut GridReader, file: &VtuFile, piece: &Piece) -> FileResult<()> {
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
    let faces = if has_polyhedra { Some(read_faces(file, piece)?) } else { None };
    let place = format!("array 'connectivity' (data at byte {})", connectivity_array.byte);
    let (types, ends, connectivity, ghosts) = (&types[..], &offsets[..], &connectivity[..], &ghosts[..]);
    let list = CellList { path: &file.path, place: &place, types, ends, connectivity, ghosts };
    list.add_to(grid, faces.iter().flat_map(|faces| faces.of_cells(piece.cells)), (piece.points, first_point))
}

pub(super) fn ghost_flags(file: &VtuFile, piece: &Piece) -> FileResult<Vec<u64>> {
    let array = piece.cell_data.iter().find(|array| array.name == GHOST_ARRAY && array.components == 1);
    array.map_or(Ok(Vec::new()), |array| indices(file, array, piece.cells))
}

pub(super) fn indices(file: &VtuFile, array: &ArrayInfo, count: usize) -> FileResult<Vec<u64>> {
    let bytes = file.decode(array, count)?;
    file.values(&bytes)
        .to_indices()
        .map_err(|i| file.invalid(array, array.byte, format!("number {i} is negative or no integer")))
}

fn needed<'a>(file: &VtuFile, array: &'a Option<ArrayInfo>, name: &str) -> FileResult<&'a ArrayInfo> {
    array.as_ref().ok_or_else(|| FileError::invalid(&file.path, "<Piece>", format!("lacks the array '{name}'")))
}

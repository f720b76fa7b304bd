//! Points and tetrahedra of `.vtu` files: which cell types are taken, skipped or refused.

use super::{ArrayInfo, Piece, VtuFile};
use crate::error::{FileError, FileResult};
use crate::mesh::RawMesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// What is done with a cell type of VTK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// A linear tetrahedron.
    Tet,
    /// A cell of 0, 1 or 2 dimensions: nothing to integrate through.
    Flat,
    /// Another cell with a volume.
    Solid,
}

/// Number, name and kind of the cell types of VTK (`vtkCellType.h`).
#[rustfmt::skip]
const CELL_TYPES: &[(u8, &str, Kind)] = &[
    (0, "empty cell", Kind::Flat), (1, "vertex", Kind::Flat), (2, "poly-vertex", Kind::Flat), (3, "line", Kind::Flat),
    (4, "polyline", Kind::Flat), (5, "triangle", Kind::Flat), (6, "triangle strip", Kind::Flat),
    (7, "polygon", Kind::Flat), (8, "pixel", Kind::Flat), (9, "quad", Kind::Flat), (10, "tetrahedron", Kind::Tet),
    (11, "voxel", Kind::Solid), (12, "hexahedron", Kind::Solid), (13, "wedge", Kind::Solid),
    (14, "pyramid", Kind::Solid), (15, "pentagonal prism", Kind::Solid), (16, "hexagonal prism", Kind::Solid),
    (21, "quadratic edge", Kind::Flat), (22, "quadratic triangle", Kind::Flat), (23, "quadratic quad", Kind::Flat),
    (24, "quadratic tetrahedron", Kind::Solid), (25, "quadratic hexahedron", Kind::Solid),
    (26, "quadratic wedge", Kind::Solid), (27, "quadratic pyramid", Kind::Solid),
    (28, "biquadratic quad", Kind::Flat), (29, "triquadratic hexahedron", Kind::Solid),
    (30, "quadratic linear quad", Kind::Flat), (31, "quadratic linear wedge", Kind::Solid),
    (32, "biquadratic quadratic wedge", Kind::Solid), (33, "biquadratic quadratic hexahedron", Kind::Solid),
    (34, "biquadratic triangle", Kind::Flat), (35, "cubic line", Kind::Flat), (36, "quadratic polygon", Kind::Flat),
    (37, "triquadratic pyramid", Kind::Solid), (41, "convex point set", Kind::Solid), (42, "polyhedron", Kind::Solid),
    (51, "parametric curve", Kind::Flat), (52, "parametric surface", Kind::Flat),
    (53, "parametric triangle surface", Kind::Flat), (54, "parametric quad surface", Kind::Flat),
    (55, "parametric tetrahedron region", Kind::Solid), (56, "parametric hexahedron region", Kind::Solid),
    (60, "higher order edge", Kind::Flat), (61, "higher order triangle", Kind::Flat),
    (62, "higher order quad", Kind::Flat), (63, "higher order polygon", Kind::Flat),
    (64, "higher order tetrahedron", Kind::Solid), (65, "higher order wedge", Kind::Solid),
    (66, "higher order pyramid", Kind::Solid), (67, "higher order hexahedron", Kind::Solid),
    (68, "Lagrange curve", Kind::Flat), (69, "Lagrange triangle", Kind::Flat), (70, "Lagrange quad", Kind::Flat),
    (71, "Lagrange tetrahedron", Kind::Solid), (72, "Lagrange hexahedron", Kind::Solid),
    (73, "Lagrange wedge", Kind::Solid), (74, "Lagrange pyramid", Kind::Solid), (75, "Bezier curve", Kind::Flat),
    (76, "Bezier triangle", Kind::Flat), (77, "Bezier quad", Kind::Flat), (78, "Bezier tetrahedron", Kind::Solid),
    (79, "Bezier hexahedron", Kind::Solid), (80, "Bezier wedge", Kind::Solid), (81, "Bezier pyramid", Kind::Solid),
];

/// Bits of the cell array `vtkGhostType` that take a cell out: it is a copy of one of another piece, was refined away,
/// or is hidden (`vtkDataSetAttributes::CellGhostTypes`).
const GHOST_BITS: u64 = 1 | 8 | 32;

/// Collects the mesh of a step, piece by piece.
#[derive(Default)]
pub(crate) struct GridReader {
    /// Points of all pieces, tetrahedra only.
    pub(crate) mesh: RawMesh,
    /// For each tetrahedron its index among all cells of all pieces.
    pub(crate) kept: Vec<u32>,
    /// Number of cells of all pieces.
    pub(crate) cells: usize,
    /// Number of skipped cells by type.
    skipped: BTreeMap<u8, usize>,
    ghosts: usize,
}

impl GridReader {
    /// Adds a piece of `file`.
    ///
    /// # Errors
    /// If its arrays are damaged or contradict each other, or if a cell has a volume and is no tetrahedron.
    pub(crate) fn add(&mut self, file: &VtuFile, piece: &Piece) -> FileResult<()> {
        let first_point = self.mesh.points.len();
        let first_cell = self.cells;
        let (points, cells) = (first_point.checked_add(piece.points), first_cell.checked_add(piece.cells));
        let limit = u32::MAX as usize;
        let fits = points.is_some_and(|n| n < limit) && cells.is_some_and(|n| n < limit);
        if !fits {
            return Err(FileError::unsupported(
                file.path(),
                "<Piece>",
                format!("has more than {limit} points or cells"),
            ));
        }
        self.add_points(file, piece)?;
        if piece.cells > 0 {
            self.add_cells(file, piece, first_point)?;
        }
        self.cells = first_cell + piece.cells;
        Ok(())
    }

    fn add_points(&mut self, file: &VtuFile, piece: &Piece) -> FileResult<()> {
        if piece.points == 0 {
            return Ok(());
        }
        let array = needed(file, &piece.coordinates, "Points")?;
        if array.components != 3 {
            return Err(file.invalid(
                array,
                array.byte,
                format!("has {} coordinates a point, not 3", array.components),
            ));
        }
        let bytes = file.decode(array, piece.points)?;
        let coordinates = file.values(&bytes).to_f64();
        self.mesh.points.extend(coordinates.chunks_exact(3).map(DVec3::from_slice));
        Ok(())
    }

    fn add_cells(&mut self, file: &VtuFile, piece: &Piece, first_point: usize) -> FileResult<()> {
        let types = indices(file, needed(file, &piece.types, "types")?, piece.cells)?;
        let offsets_array = needed(file, &piece.offsets, "offsets")?;
        let offsets = indices(file, offsets_array, piece.cells)?;
        let bad_offset = |i: usize| file.invalid(offsets_array, offsets_array.byte, format!("decrease at cell {i}"));
        if let Some(i) = offsets.windows(2).position(|pair| pair[1] < pair[0]) {
            return Err(bad_offset(i + 1));
        }
        let connectivity_array = needed(file, &piece.connectivity, "connectivity")?;
        let length =
            offsets.last().and_then(|&end| usize::try_from(end).ok()).ok_or_else(|| bad_offset(piece.cells))?;
        let connectivity = indices(file, connectivity_array, length)?;
        let ghosts = ghost_flags(file, piece)?;
        let mut begin = 0;
        for (i, (&cell_type, &end)) in types.iter().zip(&offsets).enumerate() {
            // In range: offsets do not decrease, and the last is the length.
            let vertices = &connectivity[begin..end as usize];
            begin = end as usize;
            if ghosts.get(i).is_some_and(|flags| flags & GHOST_BITS != 0) {
                self.ghosts += 1;
                continue;
            }
            match kind_of(file, i, cell_type)? {
                (Kind::Flat, number) => *self.skipped.entry(number).or_default() += 1,
                _ => {
                    self.mesh.tets.push(tet(file, connectivity_array, i, vertices, piece.points, first_point)?);
                    self.kept.push((self.cells + i) as u32);
                }
            }
        }
        Ok(())
    }

    /// What was skipped, one line each.
    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.skipped.is_empty() {
            let total: usize = self.skipped.values().sum();
            let by_type: Vec<_> = self.skipped.iter().map(|(&number, n)| format!("{n} {}", name_of(number))).collect();
            notes.push(format!("skipped {total} cells without volume: {}", by_type.join(", ")));
        }
        if self.ghosts > 0 {
            notes.push(format!("skipped {} ghost cells (array vtkGhostType)", self.ghosts));
        }
        notes
    }
}

fn name_of(number: u8) -> &'static str {
    CELL_TYPES.iter().find(|(n, ..)| *n == number).map_or("unknown", |(_, name, _)| name)
}

/// Kind and number of a cell type, if it is one that does not end the import.
fn kind_of(file: &VtuFile, cell: usize, cell_type: u64) -> FileResult<(Kind, u8)> {
    let place = format!("cell {cell}");
    match CELL_TYPES.iter().find(|(number, ..)| u64::from(*number) == cell_type) {
        Some(&(number, name, Kind::Solid)) => Err(FileError::unsupported(
            file.path(),
            place,
            format!("is of type {number} ({name}); only tetrahedra are read"),
        )
        .remedy("split it into tetrahedra, for example with ParaView's filter Tetrahedralize")),
        Some(&(number, _, kind)) => Ok((kind, number)),
        None => Err(FileError::invalid(file.path(), place, format!("is of type {cell_type}, which VTK does not know"))),
    }
}

/// The vertices of tetrahedron `cell` in the numbering of the whole step.
fn tet(
    file: &VtuFile,
    array: &ArrayInfo,
    cell: usize,
    vertices: &[u64],
    points: usize,
    first_point: usize,
) -> FileResult<[u32; 4]> {
    let &[a, b, c, d] = vertices else {
        let problem = format!("tetrahedron {cell} has {} vertices", vertices.len());
        return Err(file.invalid(array, array.byte, problem));
    };
    let mut tet = [0; 4];
    for (slot, vertex) in tet.iter_mut().zip([a, b, c, d]) {
        if vertex >= points as u64 {
            let problem = format!("cell {cell} has vertex {vertex}, but there are {points} points");
            return Err(file.invalid(array, array.byte, problem));
        }
        // Fits: the number of points of all pieces does.
        *slot = (first_point + vertex as usize) as u32;
    }
    Ok(tet)
}

fn ghost_flags(file: &VtuFile, piece: &Piece) -> FileResult<Vec<u64>> {
    let array = piece.cell_data.iter().find(|array| array.name == GHOST_ARRAY && array.components == 1);
    array.map_or(Ok(Vec::new()), |array| indices(file, array, piece.cells))
}

/// The cell array by which parallel writers mark copies.
pub(crate) const GHOST_ARRAY: &str = "vtkGhostType";

fn indices(file: &VtuFile, array: &ArrayInfo, count: usize) -> FileResult<Vec<u64>> {
    let bytes = file.decode(array, count)?;
    file.values(&bytes)
        .to_indices()
        .map_err(|i| file.invalid(array, array.byte, format!("number {i} is negative or no integer")))
}

fn needed<'a>(file: &VtuFile, array: &'a Option<ArrayInfo>, name: &str) -> FileResult<&'a ArrayInfo> {
    array.as_ref().ok_or_else(|| FileError::invalid(file.path(), "<Piece>", format!("lacks the array '{name}'")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cell_types_are_sorted_and_unique_and_only_one_is_taken() {
        assert!(CELL_TYPES.windows(2).all(|pair| pair[0].0 < pair[1].0));
        let taken: Vec<_> = CELL_TYPES.iter().filter(|(.., kind)| *kind == Kind::Tet).map(|(n, ..)| *n).collect();
        assert_eq!(taken, [10]);
    }
}

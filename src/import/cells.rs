//! Points and tetrahedra of a step, collected piece by piece, and which cell types are kept, skipped or refused.

use crate::error::{FileError, FileResult};
use crate::mesh::RawMesh;
use std::collections::BTreeMap;
use std::path::Path;

/// The treatment of a VTK cell type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A linear tetrahedron.
    Tet,
    /// A cell of 0, 1 or 2 dimensions, without a volume to integrate through.
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

/// Collects the mesh of a step, piece by piece.
#[derive(Default)]
pub(super) struct GridReader {
    /// Points and tetrahedra of all pieces.
    pub(super) mesh: RawMesh,
    /// Index of each tetrahedron among all cells of all pieces.
    pub(super) kept: Vec<u32>,
    /// Number of cells of all complete pieces.
    pub(super) cells: usize,
    /// Number of skipped cells by type.
    skipped: BTreeMap<u8, usize>,
    /// Number of skipped duplicates of another piece's cells.
    pub(super) ghosts: usize,
}

impl GridReader {
    /// Checks that the points and cells of another piece fit the index types.
    ///
    /// # Errors
    /// If there are too many.
    pub(super) fn check_room(&self, path: &Path, place: &str, points: usize, cells: usize) -> FileResult<()> {
        let limit = u32::MAX as usize;
        let fits = |so_far: usize, more: usize| so_far.checked_add(more).is_some_and(|n| n < limit);
        if fits(self.mesh.points.len(), points) && fits(self.cells, cells) {
            return Ok(());
        }
        Err(FileError::unsupported(path, place, format!("has more than {limit} points or cells"))
            .remedy("correct the count if it is wrong, or import a part of the mesh"))
    }

    /// Counts skipped cells without volume, by their VTK type.
    pub(super) fn skip(&mut self, cell_type: u8, cells: usize) {
        if cells > 0 {
            *self.skipped.entry(cell_type).or_default() += cells;
        }
    }

    /// Adds cell `cell` of the current piece, which has `points` points, the first of them `first_point`.
    ///
    /// # Errors
    /// If it has not four vertices, or one that is no point; the message says which.
    pub(super) fn push_tet(
        &mut self,
        cell: usize,
        vertices: &[u64],
        points: usize,
        first_point: usize,
    ) -> Result<(), String> {
        let &[a, b, c, d] = vertices else {
            return Err(format!("tetrahedron {cell} has {} vertices", vertices.len()));
        };
        let mut tet = [0; 4];
        for (slot, vertex) in tet.iter_mut().zip([a, b, c, d]) {
            if vertex >= points as u64 {
                return Err(format!("cell {cell} has vertex {vertex}, but there are {points} points"));
            }
            // In range: the number of points of all pieces is.
            *slot = (first_point + vertex as usize) as u32;
        }
        self.mesh.cells.tets.push(tet);
        self.kept.push((self.cells + cell) as u32);
        Ok(())
    }

    /// What was skipped, one line each.
    pub(super) fn notes(&self) -> Vec<String> {
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

/// Name of a VTK cell type.
pub(super) fn name_of(number: u8) -> &'static str {
    CELL_TYPES.iter().find(|(n, ..)| *n == number).map_or("unknown", |(_, name, _)| name)
}

/// The treatment of a VTK cell type; `None` if VTK does not know it.
pub(super) fn kind_of(number: u64) -> Option<(u8, Kind)> {
    CELL_TYPES.iter().find(|(n, ..)| u64::from(*n) == number).map(|&(n, _, kind)| (n, kind))
}

/// The error for a cell with a volume that is not a tetrahedron; `what` names its type.
pub(super) fn refuse_solid(path: &Path, place: String, what: &str) -> FileError {
    FileError::unsupported(path, place, format!("{what}; only tetrahedra are read"))
        .remedy("split it into tetrahedra, for example with ParaView's filter Tetrahedralize")
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

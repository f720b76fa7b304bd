//! Points and cells of a step, collected piece by piece, and which cell types are kept, skipped or refused.

use crate::error::{FileError, FileResult};
use crate::mesh::polyhedron::close;
use crate::mesh::{POLYHEDRON_VTK_TYPE, RawMesh, SolidShape};
use std::collections::BTreeMap;
use std::path::Path;

use Sides::{AnyOrder, Linear, Quadratic};
use SolidShape::{HexagonalPrism, Hexahedron, PentagonalPrism, Pyramid, Wedge};

/// The treatment of a VTK cell type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A cell of 0, 1 or 2 dimensions, without a volume to integrate through.
    Flat,
    /// A tetrahedron.
    Tet(Sides),
    /// A hexahedron with axis-parallel edges, whose corners are in another order.
    Voxel,
    /// A cell that is split.
    Solid(SolidShape, Sides),
    /// A cell with faces of its own, which is split.
    Polyhedron,
    /// Another cell with a volume.
    Unread,
}

/// The vertices of a cell: the corners come first, and alone are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sides {
    /// The corners alone.
    Linear,
    /// This number.
    Quadratic(usize),
    /// The corners, and as many more as the cell's order has.
    AnyOrder,
}

/// Number, name and kind of the cell types of VTK (`vtkCellType.h`).
#[rustfmt::skip]
const CELL_TYPES: &[(u8, &str, Kind)] = &[
    (0, "empty cell", Kind::Flat), (1, "vertex", Kind::Flat), (2, "poly-vertex", Kind::Flat), (3, "line", Kind::Flat),
    (4, "polyline", Kind::Flat), (5, "triangle", Kind::Flat), (6, "triangle strip", Kind::Flat),
    (7, "polygon", Kind::Flat), (8, "pixel", Kind::Flat), (9, "quad", Kind::Flat),
    (10, "tetrahedron", Kind::Tet(Linear)), (11, "voxel", Kind::Voxel),
    (12, "hexahedron", Kind::Solid(Hexahedron, Linear)), (13, "wedge", Kind::Solid(Wedge, Linear)),
    (14, "pyramid", Kind::Solid(Pyramid, Linear)), (15, "pentagonal prism", Kind::Solid(PentagonalPrism, Linear)),
    (16, "hexagonal prism", Kind::Solid(HexagonalPrism, Linear)),
    (21, "quadratic edge", Kind::Flat), (22, "quadratic triangle", Kind::Flat), (23, "quadratic quad", Kind::Flat),
    (24, "quadratic tetrahedron", Kind::Tet(Quadratic(10))), (25, "quadratic hexahedron", Kind::Solid(Hexahedron, Quadratic(20))),
    (26, "quadratic wedge", Kind::Solid(Wedge, Quadratic(15))), (27, "quadratic pyramid", Kind::Solid(Pyramid, Quadratic(13))),
    (28, "biquadratic quad", Kind::Flat), (29, "triquadratic hexahedron", Kind::Solid(Hexahedron, Quadratic(27))),
    (30, "quadratic linear quad", Kind::Flat), (31, "quadratic linear wedge", Kind::Solid(Wedge, Quadratic(12))),
    (32, "biquadratic quadratic wedge", Kind::Solid(Wedge, Quadratic(18))),
    (33, "biquadratic quadratic hexahedron", Kind::Solid(Hexahedron, Quadratic(24))),
    (34, "biquadratic triangle", Kind::Flat), (35, "cubic line", Kind::Flat), (36, "quadratic polygon", Kind::Flat),
    (37, "triquadratic pyramid", Kind::Solid(Pyramid, Quadratic(19))), (41, "convex point set", Kind::Unread),
    (42, "polyhedron", Kind::Polyhedron),
    (51, "parametric curve", Kind::Flat), (52, "parametric surface", Kind::Flat),
    (53, "parametric triangle surface", Kind::Flat), (54, "parametric quad surface", Kind::Flat),
    (55, "parametric tetrahedron region", Kind::Unread), (56, "parametric hexahedron region", Kind::Unread),
    (60, "higher order edge", Kind::Flat), (61, "higher order triangle", Kind::Flat),
    (62, "higher order quad", Kind::Flat), (63, "higher order polygon", Kind::Flat),
    (64, "higher order tetrahedron", Kind::Unread), (65, "higher order wedge", Kind::Unread),
    (66, "higher order pyramid", Kind::Unread), (67, "higher order hexahedron", Kind::Unread),
    (68, "Lagrange curve", Kind::Flat), (69, "Lagrange triangle", Kind::Flat), (70, "Lagrange quad", Kind::Flat),
    (71, "Lagrange tetrahedron", Kind::Tet(AnyOrder)), (72, "Lagrange hexahedron", Kind::Solid(Hexahedron, AnyOrder)),
    (73, "Lagrange wedge", Kind::Solid(Wedge, AnyOrder)), (74, "Lagrange pyramid", Kind::Solid(Pyramid, AnyOrder)),
    (75, "Bezier curve", Kind::Flat), (76, "Bezier triangle", Kind::Flat), (77, "Bezier quad", Kind::Flat),
    (78, "Bezier tetrahedron", Kind::Tet(AnyOrder)), (79, "Bezier hexahedron", Kind::Solid(Hexahedron, AnyOrder)),
    (80, "Bezier wedge", Kind::Solid(Wedge, AnyOrder)), (81, "Bezier pyramid", Kind::Solid(Pyramid, AnyOrder)),
];

/// VTK's numbers of a vertex, and of several as one cell.
pub(super) const VERTEX_TYPES: [u8; 2] = [1, 2];

/// Collects the mesh of a step, piece by piece.
#[derive(Default)]
pub(super) struct GridReader {
    /// Points and cells of all pieces.
    pub(super) mesh: RawMesh,
    /// Index of each tetrahedron among all cells of all pieces.
    tets: Vec<u32>,
    /// Likewise for the cells of other shapes.
    solids: Vec<u32>,
    /// Likewise for points that are cells, which are the mesh where there are no other cells.
    points: Vec<u32>,
    /// Number of cells of all complete pieces.
    pub(super) cells: usize,
    /// Number of cells that are split, by type.
    split: BTreeMap<u8, usize>,
    /// Number of curved cells, by type.
    curved: BTreeMap<u8, usize>,
    /// Number of skipped cells by type.
    skipped: BTreeMap<u8, usize>,
    /// Number of skipped duplicates of another piece's cells.
    pub(super) ghosts: usize,
    /// Number of polyhedra that are left out because their faces do not close.
    open_polyhedra: usize,
    /// The first of these, and what is wrong with it.
    first_open: Option<String>,
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

    /// Adds cell `cell` of the current piece, which has `points` points, the first of them `first_point`, by its VTK type and kind.
    ///
    /// # Errors
    /// If it has a wrong number of vertices, or one that is no point, or is of a kind that is not read; the message says which.
    pub(super) fn push(
        &mut self,
        cell: usize,
        (number, kind): (u8, Kind),
        vertices: &[u64],
        points: usize,
        first_point: usize,
    ) -> Result<(), String> {
        let (shape, sides) = match kind {
            Kind::Tet(sides) => (None, sides),
            Kind::Voxel => (Some(Hexahedron), Linear),
            Kind::Solid(shape, sides) => (Some(shape), sides),
            Kind::Flat | Kind::Polyhedron | Kind::Unread => {
                return Err(format!("cell {cell} is of type {number}, which is not read"));
            }
        };
        let corners = shape.map_or(4, SolidShape::corners);
        let is_right = match sides {
            Linear => vertices.len() == corners,
            Quadratic(count) => vertices.len() == count,
            AnyOrder => vertices.len() >= corners,
        };
        if !is_right {
            return Err(format!("{} {cell} has {} vertices", name_of(number), vertices.len()));
        }
        if let Some(vertex) = vertices.iter().find(|&&vertex| vertex >= points as u64) {
            return Err(format!("cell {cell} has vertex {vertex}, but there are {points} points"));
        }
        // In range: the number of points of all pieces is.
        let vertex = |i: usize| (first_point + vertices[i] as usize) as u32;
        let index = (self.cells + cell) as u32;
        if vertices.len() > corners {
            *self.curved.entry(number).or_default() += 1;
        }
        let Some(shape) = shape else {
            self.mesh.cells.tets.push([0, 1, 2, 3].map(vertex));
            self.tets.push(index);
            return Ok(());
        };
        // The last two corners of each quadrilateral of a voxel are the other way round.
        let corner = |i: usize| vertex(if kind == Kind::Voxel && i & 2 != 0 { i ^ 1 } else { i });
        self.mesh.cells.solids.push(shape, (0..corners).map(corner));
        self.solids.push(index);
        *self.split.entry(number).or_default() += 1;
        Ok(())
    }

    /// Adds the points of cell `cell` of the current piece, a vertex or several, as [`Self::push`]. They are the mesh if there is nothing with
    /// a volume.
    ///
    /// # Errors
    /// If one is no point.
    pub(super) fn push_points(
        &mut self,
        cell: usize,
        number: u8,
        vertices: &[u64],
        points: usize,
        first_point: usize,
    ) -> Result<(), String> {
        if let Some(vertex) = vertices.iter().find(|&&vertex| vertex >= points as u64) {
            return Err(format!("cell {cell} has vertex {vertex}, but there are {points} points"));
        }
        self.skip(number, 1);
        self.mesh.cells.points.extend(vertices.iter().map(|&vertex| (first_point + vertex as usize) as u32));
        self.points.resize(self.mesh.cells.points.len(), (self.cells + cell) as u32);
        Ok(())
    }

    /// Ends the mesh: points are its cells if there are no others.
    pub(super) fn finish(&mut self) {
        if self.tets.is_empty() && self.solids.is_empty() {
            VERTEX_TYPES.iter().for_each(|number| _ = self.skipped.remove(number));
        } else {
            let cells = &mut self.mesh.cells;
            (self.points, cells.points, cells.radii, cells.volumes) = Default::default();
        }
    }

    /// Adds cell `cell` of the current piece, of this file, a polyhedron with these faces, as [`Self::push`]. One whose faces do not
    /// close is left out, and counted.
    ///
    /// # Errors
    /// If a vertex is no point.
    pub(super) fn push_polyhedron(
        &mut self,
        path: &Path,
        cell: usize,
        faces: &[Vec<u64>],
        points: usize,
        first_point: usize,
    ) -> Result<(), String> {
        if let Some(vertex) = faces.iter().flatten().find(|&&vertex| vertex >= points as u64) {
            return Err(format!("has vertex {vertex}, but there are {points} points"));
        }
        // In range: the number of points of all pieces is.
        let numbered = |face: &Vec<u64>| face.iter().map(|&vertex| vertex as u32).collect();
        let mut faces: Vec<Vec<u32>> = faces.iter().map(numbered).collect();
        if let Err(problem) = close(&mut faces) {
            self.open_polyhedra += 1;
            self.first_open.get_or_insert_with(|| format!("cell {cell} of {} {problem}", path.display()));
            return Ok(());
        }
        faces.iter_mut().flatten().for_each(|vertex| *vertex += first_point as u32);
        self.mesh.cells.solids.push_polyhedron(faces.iter().map(Vec::as_slice));
        self.solids.push((self.cells + cell) as u32);
        *self.split.entry(POLYHEDRON_VTK_TYPE).or_default() += 1;
        Ok(())
    }

    /// Index of each cell of the mesh among all cells of all pieces; `None` if it is the same.
    pub(super) fn kept(&self) -> Option<Vec<u32>> {
        let kept = || self.tets.iter().chain(&self.solids).chain(&self.points).copied();
        let all = self.mesh.cells.len() == self.cells && kept().is_sorted_by(|a, b| a < b);
        (!all).then(|| kept().collect())
    }

    /// What was skipped or changed, one line each.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (counts, before, after) in [
            (&self.skipped, "skipped", "cells without volume"),
            (&self.split, "split", "cells into tetrahedra"),
            (&self.curved, "read the corners alone of", "curved cells"),
        ] {
            if !counts.is_empty() {
                let total: usize = counts.values().sum();
                let by_type: Vec<_> = counts.iter().map(|(&number, n)| format!("{n} {}", name_of(number))).collect();
                notes.push(format!("{before} {total} {after}: {}", by_type.join(", ")));
            }
        }
        if let Some(first) = &self.first_open {
            notes.push(format!(
                "left out {} polyhedra whose faces do not close; the first: {first}",
                self.open_polyhedra
            ));
        }
        if self.ghosts > 0 {
            notes.push(format!("skipped {} ghost cells", self.ghosts));
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

/// The treatment of a cell type that VTK knows.
pub(super) fn kind(number: u8) -> Kind {
    kind_of(number.into()).map_or(Kind::Unread, |(_, kind)| kind)
}

/// The error for a cell with a volume of a shape that is not read; `what` names its type.
pub(super) fn refuse_solid(path: &Path, place: String, what: &str) -> FileError {
    FileError::unsupported(path, place, format!("{what}, which is not read"))
        .remedy("split it into tetrahedra, for example with ParaView's filter Tetrahedralize")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cell_types_are_sorted_and_unique() {
        assert!(CELL_TYPES.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn cells_of_all_shapes_are_numbered_as_in_the_file_wherever_they_stand() {
        let of = |number| kind_of(number).unwrap();
        let mut grid = GridReader::default();
        grid.push(0, of(12), &[0, 1, 2, 3, 4, 5, 6, 7], 8, 0).unwrap();
        grid.push(1, of(10), &[0, 1, 2, 4], 8, 0).unwrap();
        grid.cells = 2;
        assert_eq!(grid.kept(), Some(vec![1, 0]), "tetrahedra come first");
        grid.push(1, of(11), &[0, 1, 2, 3, 4, 5, 6, 7], 8, 8).unwrap();
        grid.cells = 4;
        assert_eq!(grid.kept(), Some(vec![1, 0, 3]));
        let voxel: Vec<_> = grid.mesh.cells.iter().nth(2).unwrap().to_vec();
        assert_eq!(voxel, [8, 9, 11, 10, 12, 13, 15, 14]);
        let mut alone = GridReader::default();
        alone.push(0, of(25), &(0..20).collect::<Vec<u64>>(), 20, 0).unwrap();
        alone.cells = 1;
        assert_eq!((alone.kept(), alone.mesh.cells.len()), (None, 1));
        assert_eq!(alone.notes().len(), 2, "{:?}", alone.notes());
        assert_eq!(alone.push(1, of(12), &[0, 1, 2], 20, 0), Err("hexahedron 1 has 3 vertices".to_owned()));
        assert!(alone.push(1, of(13), &[0, 1, 2, 3, 4, 20], 20, 0).unwrap_err().contains("vertex 20"));
        assert!(alone.push(1, of(24), &[0, 1, 2, 3], 20, 0).is_err(), "a quadratic tetrahedron has ten");
        assert!(
            alone.push(1, of(25), &(0..19).collect::<Vec<u64>>(), 20, 0).is_err(),
            "a quadratic hexahedron has twenty"
        );
        assert!(alone.push(1, of(71), &[0, 1, 2], 20, 0).is_err());
        assert!(alone.push(1, of(71), &[0, 1, 2, 3, 20], 20, 0).unwrap_err().contains("vertex 20"), "corner or not");
        alone.push(1, of(71), &[0, 1, 2, 3], 20, 0).unwrap();
        assert_eq!(
            (alone.curved.get(&71), alone.curved.get(&25)),
            (None, Some(&1)),
            "a Lagrange cell of order one is linear"
        );
        assert!(alone.push(1, of(42), &[0, 1, 2, 3], 20, 0).is_err());
    }
}

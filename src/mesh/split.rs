//! Splits the cells of a file into tetrahedra: the only place that knows other shapes.
//!
//! A cell is pulled to pieces from its corner of least number: that corner and every triangle of the faces that it does not belong to
//! are a tetrahedron, and a face with more than three corners is cut into triangles from its own corner of least number. So a face is cut
//! by its corners alone: two cells that share it cut it alike, whatever their shapes (the rule of least numbers of Dompierre, Labbe,
//! Vallet and Camarero, "How to subdivide pyramids, prisms, and hexahedra into tetrahedra", 8th International Meshing Roundtable 1999; pulling
//! cuts a hexahedron into six tetrahedra, never five, and needs no table). The tetrahedra fill a convex cell with plane faces. Cells
//! with a corner named twice are cut as what is left of them. Polyhedra with any faces are cut in the same way; their hanging nodes count
//! as lower than all other corners (`hanging.rs`).
//!
//! Faces that are not plane are two triangles. A cell that they warp so far that its corner of least number does not see all of its faces
//! is cut from a point in its middle instead, where one sees them all (`steiner.rs`). Where none was found its tetrahedra overlap:
//! [`Mesh::build`](super::Mesh::build) counts it.

use super::polyhedron::Polyhedron;
use super::steiner::{self, SteinerPoints};
use super::{NONE, hanging};
use glam::DVec3;
use std::collections::HashSet;
use std::ops::Range;

/// A shape of cells that is split, with the corners as VTK numbers them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SolidShape {
    /// Four corners, then the apex.
    Pyramid,
    /// A triangle, then the one above it.
    Wedge,
    /// A quadrilateral, then the one above it.
    Hexahedron,
    /// A pentagon, then the one above it.
    PentagonalPrism,
    /// A hexagon, then the one above it.
    HexagonalPrism,
}

impl SolidShape {
    /// All shapes.
    pub const ALL: [Self; 5] =
        [Self::Pyramid, Self::Wedge, Self::Hexahedron, Self::PentagonalPrism, Self::HexagonalPrism];

    /// Its number in VTK (`vtkCellType.h`).
    pub const fn vtk_type(self) -> u8 {
        match self {
            Self::Hexahedron => 12,
            Self::Wedge => 13,
            Self::Pyramid => 14,
            Self::PentagonalPrism => 15,
            Self::HexagonalPrism => 16,
        }
    }

    /// Number of corners.
    pub const fn corners(self) -> usize {
        match self {
            Self::Pyramid => 5,
            Self::Wedge => 6,
            Self::Hexahedron => 8,
            Self::PentagonalPrism => 10,
            Self::HexagonalPrism => 12,
        }
    }

    /// Corners of the faces, counter-clockwise as seen from outside.
    const fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Self::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
            Self::Wedge => &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
            Self::Hexahedron => {
                &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]]
            }
            Self::PentagonalPrism => &[
                &[0, 4, 3, 2, 1],
                &[5, 6, 7, 8, 9],
                &[0, 1, 6, 5],
                &[1, 2, 7, 6],
                &[2, 3, 8, 7],
                &[3, 4, 9, 8],
                &[4, 0, 5, 9],
            ],
            Self::HexagonalPrism => &[
                &[0, 5, 4, 3, 2, 1],
                &[6, 7, 8, 9, 10, 11],
                &[0, 1, 7, 6],
                &[1, 2, 8, 7],
                &[2, 3, 9, 8],
                &[3, 4, 10, 9],
                &[4, 5, 11, 10],
                &[5, 0, 6, 11],
            ],
        }
    }
}

/// A cell that is split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solid<'a> {
    /// A cell of a shape with its corners.
    Shape(SolidShape, &'a [u32]),
    /// A cell with faces of its own.
    Polyhedron(Polyhedron<'a>),
}

impl<'a> Solid<'a> {
    /// Its vertices.
    pub fn vertices(self) -> &'a [u32] {
        match self {
            Self::Shape(_, corners) => corners,
            Self::Polyhedron(Polyhedron { vertices, .. }) => vertices,
        }
    }

    /// Its number in VTK (`vtkCellType.h`).
    pub fn vtk_type(self) -> u8 {
        match self {
            Self::Shape(shape, _) => shape.vtk_type(),
            Self::Polyhedron(_) => POLYHEDRON_VTK_TYPE,
        }
    }
}

/// VTK's number of a polyhedron.
pub const POLYHEDRON_VTK_TYPE: u8 = 42;

/// Cells that are split.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Solids {
    /// Shape of each; `None` for a polyhedron.
    shapes: Vec<Option<SolidShape>>,
    /// Vertex indices of all cells, cell by cell.
    vertices: Vec<u32>,
    /// For each polyhedron the number of its vertices, and the length of its list of faces.
    polyhedra: Vec<[u32; 2]>,
    /// The lists of faces ([`Polyhedron`]).
    faces: Vec<u32>,
}

impl Solids {
    /// Number of cells.
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Adds a cell; the number of vertices must be that of the shape's corners.
    pub fn push(&mut self, shape: SolidShape, corners: impl ExactSizeIterator<Item = u32>) {
        assert_eq!(corners.len(), shape.corners(), "{shape:?}");
        self.shapes.push(Some(shape));
        self.vertices.extend(corners);
    }

    /// Adds a polyhedron with these faces, ordered as by [`close`](super::polyhedron::close).
    pub fn push_polyhedron<'a>(&mut self, faces: impl ExactSizeIterator<Item = &'a [u32]>) {
        let [first_vertex, first_word] = [self.vertices.len(), self.faces.len()];
        self.faces.push(faces.len() as u32);
        let mut many = HashSet::new();
        for face in faces {
            self.faces.push(face.len() as u32);
            self.faces.extend(face);
            // A list is faster than a set while it is short.
            for &vertex in face {
                let known = &self.vertices[first_vertex..];
                let is_new = if known.len() < 64 { !known.contains(&vertex) } else { many.insert(vertex) };
                if is_new {
                    self.vertices.push(vertex);
                }
                if self.vertices.len() - first_vertex == 64 && many.is_empty() {
                    many.extend(&self.vertices[first_vertex..]);
                }
            }
        }
        self.shapes.push(None);
        self.polyhedra.push([self.vertices.len() - first_vertex, self.faces.len() - first_word].map(|n| n as u32));
    }

    /// Adds a cell with other numbers of its vertices.
    pub fn push_renumbered(&mut self, solid: Solid<'_>, number: impl Fn(u32) -> u32) {
        match solid {
            Solid::Shape(shape, corners) => self.push(shape, corners.iter().map(|&vertex| number(vertex))),
            Solid::Polyhedron(polyhedron) => {
                let faces: Vec<Vec<u32>> =
                    polyhedron.faces().map(|face| face.iter().map(|&vertex| number(vertex)).collect()).collect();
                self.push_polyhedron(faces.iter().map(Vec::as_slice));
            }
        }
    }

    /// The cells.
    pub fn iter(&self) -> impl Iterator<Item = Solid<'_>> {
        let (mut vertices, mut faces) = (self.vertices.as_slice(), self.faces.as_slice());
        let mut polyhedra = self.polyhedra.iter();
        self.shapes.iter().filter_map(move |shape| match shape {
            Some(shape) => Some(Solid::Shape(*shape, take_front(&mut vertices, shape.corners()))),
            None => {
                let &[of_cell, words] = polyhedra.next()?;
                let vertices = take_front(&mut vertices, of_cell as usize);
                Some(Solid::Polyhedron(Polyhedron { vertices, faces: take_front(&mut faces, words as usize) }))
            }
        })
    }
}

/// Takes some numbers from the front of a list.
fn take_front<'a>(list: &mut &'a [u32], count: usize) -> &'a [u32] {
    let (front, rest) = list.split_at(count);
    *list = rest;
    front
}

/// The cells of a [`RawMesh`](super::RawMesh): tetrahedra, then those of other shapes; or points alone, which are a cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Vertex indices of the linear tetrahedra.
    pub tets: Vec<[u32; 4]>,
    /// The other cells, numbered on from the tetrahedra.
    pub solids: Solids,
    /// Cells of one point each; there are others only where there are none of these.
    pub points: Vec<u32>,
    /// Radius of each of these, in world units; empty if they are not known.
    pub radii: Vec<f64>,
    /// Volume of each of these, in world units; empty if they are those of balls of the radii.
    pub volumes: Vec<f64>,
}

impl Cells {
    /// Number of cells.
    pub fn len(&self) -> usize {
        self.tets.len() + self.solids.len() + self.points.len()
    }

    /// Whether the cells are points.
    pub fn are_points(&self) -> bool {
        !self.points.is_empty()
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The cells of these numbers, which ascend.
    pub fn gathered(&self, numbers: &[u32]) -> Self {
        if self.are_points() {
            let of = |sizes: &[f64]| numbers.iter().filter_map(|&number| sizes.get(number as usize).copied()).collect();
            let points = numbers.iter().map(|&number| self.points[number as usize]).collect();
            return Self { points, radii: of(&self.radii), volumes: of(&self.volumes), ..Self::default() };
        }
        let (tets, solids) = numbers.split_at(numbers.partition_point(|&number| (number as usize) < self.tets.len()));
        let mut gathered = Self::from(tets.iter().map(|&tet| self.tets[tet as usize]).collect::<Vec<_>>());
        let mut wanted = solids.iter().map(|&number| number as usize - self.tets.len()).peekable();
        for (at, solid) in self.solids.iter().enumerate() {
            if wanted.next_if_eq(&at).is_some() {
                gathered.solids.push_renumbered(solid, |vertex| vertex);
            }
        }
        gathered
    }

    /// Vertex indices of each cell.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let cells = self.tets.iter().map(<[u32; 4]>::as_slice).chain(self.solids.iter().map(Solid::vertices));
        cells.chain(self.points.iter().map(std::slice::from_ref))
    }
}

impl From<Vec<[u32; 4]>> for Cells {
    fn from(tets: Vec<[u32; 4]>) -> Self {
        Self { tets, ..Self::default() }
    }
}

/// The cells of a mesh's source that were split. One is missing if a vertex of it is not in the mesh, as only flat parts of it had it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SplitCells {
    /// Index of each in the source, ascending.
    pub source: Vec<u32>,
    /// Their shapes, and their vertices in the mesh.
    pub solids: Solids,
    /// Those that are cut from a point in their middle, by their place in this list, ascending, and that vertex of the mesh. It is no point
    /// of the source: its number there is the count of the source's points, or more.
    pub steiner: Vec<[u32; 2]>,
}

impl SplitCells {
    /// The vertices of the mesh that are no points of the source, each with the distinct corners of its cell, in ascending order.
    pub fn steiner_corners(&self) -> impl Iterator<Item = (u32, Vec<u32>)> {
        steiner::corners(&self.solids, &self.steiner)
    }
}

/// Tetrahedra that fill the cells of a file, cell by cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Vertex indices.
    pub tets: Vec<[u32; 4]>,
    /// Cell of each tetrahedron, ascending; `None` if tetrahedron i is cell i.
    pub cell_of_tet: Option<Vec<u32>>,
    /// The cells that were split: the last ones, each with one tetrahedron at least.
    pub solids: Solids,
    /// The points that were added in the middle of cells.
    pub steiner: SteinerPoints,
}

impl Split {
    /// The tetrahedra of a cell.
    pub fn of_cell(&self, cell: u32) -> &[[u32; 4]] {
        let range = match &self.cell_of_tet {
            None => cell as usize..cell as usize + 1,
            Some(cells) => cells.partition_point(|&c| c < cell)..cells.partition_point(|&c| c <= cell),
        };
        self.tets.get(range).unwrap_or_default()
    }

    /// The points that were added, by their numbers, each with the distinct corners of its cell, in ascending order.
    pub fn steiner_corners(&self) -> impl Iterator<Item = (u32, Vec<u32>)> {
        steiner::corners(&self.solids, &self.steiner.of_solids)
    }

    /// Number of cells: each has a tetrahedron.
    pub fn cell_count(&self) -> usize {
        self.cell_of_tet.as_ref().map_or(self.tets.len(), |cells| cells.last().map_or(0, |&last| last as usize + 1))
    }

    /// The ranges of tetrahedra of the cells that were split, or are of several.
    pub(super) fn groups(&self) -> impl Iterator<Item = Range<usize>> {
        let (mut next, first_solid) = (0, self.cell_count() - self.solids.len());
        let groups = self.cell_of_tet.iter().flat_map(|cells| cells.chunk_by(|a, b| a == b));
        let ranges = groups.enumerate().map(move |(cell, group)| {
            next += group.len();
            (cell, next - group.len()..next)
        });
        ranges.filter(move |(cell, range)| *cell >= first_solid || range.len() > 1).map(|(_, range)| range)
    }

    /// The split cells of a mesh whose cells are of these source cells, and whose vertices are of these points; `points` counts them with
    /// those that were added.
    pub(super) fn split_cells(&self, cell_source: &[u32], vertex_source: &[u32], points: usize) -> SplitCells {
        let mut kept = SplitCells::default();
        if self.solids.is_empty() {
            return kept;
        }
        let cells = self.cell_count();
        let mut is_kept = vec![false; cells];
        cell_source.iter().for_each(|&cell| is_kept[cell as usize] = true);
        let mut vertex_of_point = vec![NONE; points];
        for (vertex, &point) in (0..).zip(vertex_source) {
            vertex_of_point[point as usize] = vertex;
        }
        let first = cells - self.solids.len();
        // A point that no tetrahedron has need not exist.
        let vertex = |point: u32| vertex_of_point.get(point as usize).copied().unwrap_or(NONE);
        let mut steiner = self.steiner.of_solids.iter().peekable();
        for (number, solid) in (0u32..).zip(self.solids.iter()) {
            let middle = steiner.next_if(|[of, _]| *of == number).map(|&[_, point]| vertex(point));
            let cell = first + number as usize;
            if is_kept[cell] && solid.vertices().iter().all(|&point| vertex(point) != NONE) {
                kept.steiner.extend(middle.map(|middle| [kept.source.len() as u32, middle]));
                kept.source.push(cell as u32);
                kept.solids.push_renumbered(solid, vertex);
            }
        }
        kept
    }

    /// Replaces indices of tetrahedra by those of their cells.
    pub(super) fn to_cells(&self, tets: &mut [u32]) {
        if let Some(cells) = &self.cell_of_tet {
            tets.iter_mut().for_each(|tet| *tet = cells[*tet as usize]);
        }
    }
}

/// Splits cells into tetrahedra; a tetrahedron stays as it is. `points` are those of the cells; the points that are added
/// ([`Split::steiner`]) are numbered on from them.
pub fn split(cells: Cells, points: &[DVec3]) -> Split {
    let order = face_order(&cells.solids, points);
    steiner::cut_again(split_by(cells, &order), points, &order)
}

/// [`split`] without added points, as older versions did it: some cells may have tetrahedra that overlap.
pub(crate) fn split_from_corners(cells: Cells, points: &[DVec3]) -> Split {
    let order = face_order(&cells.solids, points);
    split_by(cells, &order)
}

/// The order of points in which faces and cells are cut from them.
fn face_order(solids: &Solids, points: &[DVec3]) -> impl Fn(u32) -> (u8, u32) + Sync + use<> {
    let ranks = hanging::ranks(solids, points);
    move |vertex| (ranks.get(vertex as usize).copied().unwrap_or_default(), vertex)
}

fn split_by(cells: Cells, order: impl Fn(u32) -> (u8, u32)) -> Split {
    let Cells { mut tets, solids, points, .. } = cells;
    // A point is a cell without a volume.
    tets.extend(points.into_iter().map(|vertex| [vertex; 4]));
    let steiner = SteinerPoints::default();
    if solids.is_empty() {
        return Split { tets, cell_of_tet: None, solids, steiner };
    }
    let mut cell_of_tet: Vec<u32> = (0..tets.len() as u32).collect();
    let first = cell_of_tet.len() as u32;
    for (cell, solid) in (first..).zip(solids.iter()) {
        if let Some(&apex) = solid.vertices().iter().min_by_key(|&&vertex| order(vertex)) {
            pull(solid, apex, &order, &mut tets);
        }
        if tets.len() == cell_of_tet.len() {
            // A cell without a volume, which is counted as such.
            tets.push([solid.vertices().first().copied().unwrap_or_default(); 4]);
        }
        cell_of_tet.resize(tets.len(), cell);
    }
    Split { tets, cell_of_tet: Some(cell_of_tet), solids, steiner }
}

/// Adds the tetrahedra between the apex and the faces of a cell that do not have it, those without a vertex named twice.
pub(super) fn pull(solid: Solid<'_>, apex: u32, order: impl Fn(u32) -> (u8, u32), tets: &mut Vec<[u32; 4]>) {
    match solid {
        Solid::Shape(shape, corners) => {
            for face in shape.faces() {
                pull_face(apex, face.len(), |i| corners[face[i]], &order, tets);
            }
        }
        Solid::Polyhedron(polyhedron) => {
            for face in polyhedron.faces() {
                pull_face(apex, face.len(), |i| face[i], &order, tets);
            }
        }
    }
}

/// Adds the tetrahedra between the apex and a face of this many corners, cut into triangles from its first corner by `order`.
#[inline(always)]
fn pull_face(
    apex: u32,
    count: usize,
    corner: impl Fn(usize) -> u32,
    order: impl Fn(u32) -> (u8, u32),
    tets: &mut Vec<[u32; 4]>,
) {
    let vertex = |i: usize| corner(i % count);
    let Some(first) = (0..count).min_by_key(|&i| order(vertex(i))) else { return };
    if vertex(first) == apex {
        return;
    }
    for i in first + 1..first + count - 1 {
        let tet = [vertex(first), vertex(i + 1), vertex(i), apex];
        if tet[0] != tet[1] && tet[0] != tet[2] && tet[1] != tet[2] {
            tets.push(tet);
        }
    }
}

/// Replaces the values of all cells of a file by those of `sources`, the source cells of its mesh: in place if no source lies before its
/// target, as when cells are only left out; else through a copy, as when a split makes several tetrahedra of a cell.
pub fn gather<T: Copy>(values: &mut Vec<T>, sources: &[u32]) {
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
        let tets = (0..6).map(|i| [i, i + 1, i + 2, i + 3]).collect();
        Split { tets, cell_of_tet: Some(vec![0, 0, 1, 2, 2, 2]), ..split(Cells::default(), &[]) }
    }

    #[test]
    fn tetrahedra_are_their_own_cells() {
        let tets = vec![[0, 1, 2, 3], [1, 2, 3, 4]];
        let cells = Cells::from(tets.clone());
        assert_eq!((cells.len(), cells.is_empty(), Cells::default().is_empty()), (2, false, true));
        let split = split(cells, &[]);
        let (solids, steiner) = Default::default();
        assert_eq!(split, Split { tets: tets.clone(), cell_of_tet: None, solids, steiner });
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

//! Connectivity of a tetrahedral mesh.

use rayon::prelude::*;

use super::geometry::tet_volume;
use super::repair::{check_counts, check_indices};
use super::{MeshError, Positions, faces};

/// Marks the missing cell on the other side of a boundary face.
pub const NONE: u32 = u32::MAX;

/// Neighbour across one face of a cell: the cell and its vertex opposite that face, packed as
/// `cell << 2 | local vertex`, or [`NONE`]. Meshes have fewer than 2^30 cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct CellNeighbour(pub u32);

impl CellNeighbour {
    /// No neighbour: the face is on the boundary.
    pub const NONE: Self = Self(NONE);

    /// The neighbour `cell`, whose vertex `opposite` (0..4) is not on the shared face.
    pub fn new(cell: u32, opposite: u32) -> Self {
        debug_assert!(cell < 1 << 30 && opposite < 4);
        Self(cell << 2 | opposite)
    }

    /// The neighbouring cell, if there is one.
    pub fn cell(self) -> Option<u32> {
        (self != Self::NONE).then_some(self.0 >> 2)
    }

    /// Local vertex of the neighbour (0..4) opposite the shared face.
    pub fn opposite(self) -> u32 {
        self.0 & 3
    }
}

/// Cells, their unique faces and their neighbours.
///
/// Every tet is positively oriented: with vertices a, b, c, d, det(b - a, c - a, d - a) > 0. Local face i of a tet is the
/// one opposite its vertex i.
#[derive(Clone, Debug, PartialEq)]
pub struct Topology {
    /// Number of vertices; every one is used by a tet.
    pub vertex_count: u32,
    /// Vertices of the cells, positively oriented.
    pub tets: Vec<[u32; 4]>,
    /// Neighbours of each cell, across its four local faces.
    pub neighbours: Vec<[CellNeighbour; 4]>,
    /// Vertices of the unique faces, ascending; the faces are sorted lexicographically. A triangle shared by more than two
    /// cells, or by two on the same side of it, is listed once for each of them (ascending by cell), as a boundary face.
    pub faces: Vec<[u32; 3]>,
    /// The cells on both sides of each unique face, the lower id first, [`NONE`] second on the boundary.
    pub face_cells: Vec<[u32; 2]>,
}

/// Vertices of local face i (opposite vertex i) of a positively oriented tet, counter-clockwise seen from outside.
pub const FACE_VERTICES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

impl Topology {
    /// Derives faces and neighbours of `tets`. Also returns the number of non-manifold triangles: shared by more than two cells, or by two
    /// on the same side; these count as boundary for each of their cells.
    ///
    /// # Errors
    /// If there are too many cells or vertices, `positions` does not have `vertex_count` entries, or a cell names a missing
    /// vertex or is not positively oriented. Cells of a [`RawMesh`](super::RawMesh) go through
    /// [`Mesh::build`](super::Mesh::build) instead.
    pub fn from_tets(vertex_count: u32, tets: Vec<[u32; 4]>, positions: &Positions) -> Result<(Self, u64), MeshError> {
        check_counts(tets.len(), vertex_count as usize)?;
        check_length("points", positions.local.len(), vertex_count as usize)?;
        check_indices(&tets, vertex_count as usize)?;
        check_orientation(&tets, positions)?;
        Ok(faces::connect(vertex_count, tets))
    }

    /// A topology from stored arrays; neighbours are packed as [`CellNeighbour`] describes. All lengths and ranges are checked, so that no
    /// index is out of bounds; [`Topology::check`] checks that the arrays agree with each other.
    ///
    /// # Errors
    /// If lengths do not match or an index is out of range.
    pub fn from_parts(
        vertex_count: u32,
        tets: Vec<[u32; 4]>,
        faces: Vec<[u32; 3]>,
        face_cells: Vec<[u32; 2]>,
        neighbours: Vec<[u32; 4]>,
    ) -> Result<Self, MeshError> {
        let neighbours = neighbours.into_iter().map(|packed| packed.map(CellNeighbour)).collect();
        let topology = Self { vertex_count, tets, neighbours, faces, face_cells };
        topology.check_ranges()?;
        Ok(topology)
    }

    /// Ids of the faces with a cell on one side only.
    pub fn boundary_faces(&self) -> impl Iterator<Item = u32> + '_ {
        (0u32..).zip(&self.face_cells).filter(|(_, cells)| cells[1] == NONE).map(|(face, _)| face)
    }

    /// Connected components of the mesh, through faces: the part of each cell, and the number of cells of each part. Parts are sorted by
    /// descending size; among equal ones, the part with the lower cell comes first.
    pub fn parts(&self) -> (Vec<u32>, Vec<usize>) {
        let mut part = vec![NONE; self.tets.len()];
        let (mut sizes, mut front) = (Vec::new(), Vec::new());
        for seed in 0..self.tets.len() as u32 {
            if part[seed as usize] != NONE {
                continue;
            }
            let (number, mut size) = (sizes.len() as u32, 0);
            part[seed as usize] = number;
            front.push(seed);
            while let Some(cell) = front.pop() {
                size += 1;
                for next in self.neighbours[cell as usize].into_iter().filter_map(CellNeighbour::cell) {
                    if std::mem::replace(&mut part[next as usize], number) != number {
                        front.push(next);
                    }
                }
            }
            sizes.push(size);
        }
        // Stable: parts were found by their lowest cells.
        let mut by_size: Vec<usize> = (0..sizes.len()).collect();
        by_size.sort_by_key(|&found| std::cmp::Reverse(sizes[found]));
        let mut number = vec![0; sizes.len()];
        by_size.iter().zip(0..).for_each(|(&found, rank)| number[found] = rank);
        part.iter_mut().for_each(|part| *part = number[*part as usize]);
        (part, by_size.into_iter().map(|found| sizes[found]).collect())
    }

    /// Number of connected parts.
    pub fn count_parts(&self) -> u64 {
        self.parts().1.len() as u64
    }
}

/// # Errors
/// If the length of an array differs from the expected one.
pub(super) fn check_length(array: &'static str, found: usize, expected: usize) -> Result<(), MeshError> {
    if found == expected { Ok(()) } else { Err(MeshError::WrongLength { array, found, expected }) }
}

/// # Errors
/// If a cell is not positively oriented, exactly (the first such cell). Indices are in range.
pub(super) fn check_orientation(tets: &[[u32; 4]], positions: &Positions) -> Result<(), MeshError> {
    let is_not_positive = |tet: &[u32; 4]| tet_volume(positions.corners(*tet)) <= 0.0;
    match tets.par_iter().position_first(is_not_positive) {
        None => Ok(()),
        Some(cell) => Err(MeshError::bad_entry("tets", cell, "the cell is flat or turned inside out")),
    }
}

//! Connectivity of a tetrahedral mesh.

/// No such cell: the other side of a boundary face.
pub const NONE: u32 = u32::MAX;

/// What lies across one face of a cell: the cell and which of its vertices is opposite that face, packed as
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

    /// Which vertex of the neighbour (0..4) is opposite the shared face.
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
    /// Across each of the four local faces.
    pub neighbours: Vec<[CellNeighbour; 4]>,
    /// Vertices of the unique faces, ascending; the faces are sorted lexicographically.
    pub faces: Vec<[u32; 3]>,
    /// The cells on both sides of each unique face, the lower id first, [`NONE`] second on the boundary.
    pub face_cells: Vec<[u32; 2]>,
}

/// Vertices of local face i (opposite vertex i) of a positively oriented tet, counter-clockwise seen from outside.
pub const FACE_VERTICES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

impl Topology {
    /// Ids of the faces with a cell on one side only.
    pub fn boundary_faces(&self) -> impl Iterator<Item = u32> + '_ {
        (0u32..).zip(&self.face_cells).filter(|(_, cells)| cells[1] == NONE).map(|(face, _)| face)
    }
}

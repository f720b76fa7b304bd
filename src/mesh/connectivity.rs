//! Faces and neighbours of the cells of a mesh.

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

/// The unique faces of cells, and the neighbours across them ([`Topology::connectivity`](super::Topology::connectivity)).
#[derive(Clone, Debug, PartialEq)]
pub struct Connectivity {
    /// Neighbours of each cell, across its four local faces.
    pub neighbours: Vec<[CellNeighbour; 4]>,
    /// Vertices of the unique faces, ascending; the faces are sorted lexicographically. A triangle shared by more than two
    /// cells, or by two on the same side of it, is listed once for each of them (ascending by cell), as a boundary face.
    pub faces: Vec<[u32; 3]>,
    /// The cells on both sides of each unique face, the lower id first, [`NONE`] second on the boundary.
    pub face_cells: Vec<[u32; 2]>,
}

impl Connectivity {
    /// Ids of the faces with a cell on one side only.
    pub fn boundary_faces(&self) -> impl Iterator<Item = u32> + '_ {
        (0u32..).zip(&self.face_cells).filter(|(_, cells)| cells[1] == NONE).map(|(face, _)| face)
    }

    /// Number of non-manifold triangles: shared by more than two cells, or by two on the same side.
    pub fn non_manifold_faces(&self) -> u64 {
        self.faces.chunk_by(|a, b| a == b).filter(|of_triangle| of_triangle.len() > 1).count() as u64
    }

    /// Connected components of the mesh, through faces: the part of each cell, and the number of cells of each part. Parts are sorted by
    /// descending size; among equal ones, the part with the lower cell comes first.
    pub fn parts(&self) -> (Vec<u32>, Vec<usize>) {
        let mut part = vec![NONE; self.neighbours.len()];
        let (mut sizes, mut front) = (Vec::new(), Vec::new());
        for seed in 0..self.neighbours.len() as u32 {
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

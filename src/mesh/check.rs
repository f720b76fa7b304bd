//! Checks whether the arrays of a mesh are consistent: ranges for arrays read from files, everything for tests.

use super::faces::{ascending_face, winding_is_even};
use super::repair::{check_counts, check_indices};
use super::topology::{check_length, check_orientation};
use super::{CellNeighbour, Connectivity, Mesh, MeshError, NONE, Topology};

impl Connectivity {
    /// Checks the lengths and index ranges of all arrays.
    fn check_ranges(&self, cells: usize, vertices: u32) -> Result<(), MeshError> {
        check_length("neighbours", self.neighbours.len(), cells)?;
        check_length("face_cells", self.face_cells.len(), self.faces.len())?;
        let is_cell = |cell: u32| (cell as usize) < cells;

        let is_bad = |[a, b, c]: [u32; 3]| !(a < b && b < c && c < vertices);
        if let Some(face) = self.faces.iter().position(|face| is_bad(*face)) {
            let problem = format!("{:?} are not three ascending vertices below {vertices}", self.faces[face]);
            return Err(MeshError::bad_entry("faces", face, problem));
        }
        let is_bad =
            |[first, second]: [u32; 2]| !is_cell(first) || second <= first || !(is_cell(second) || second == NONE);
        if let Some(face) = self.face_cells.iter().position(|pair| is_bad(*pair)) {
            let problem = format!("{:?} are not two ascending cells below {cells}", self.face_cells[face]);
            return Err(MeshError::bad_entry("face_cells", face, problem));
        }
        let is_bad = |side: &CellNeighbour| side.cell().is_some_and(|cell| !is_cell(cell));
        if let Some(cell) = self.neighbours.iter().position(|sides| sides.iter().any(is_bad)) {
            let problem = format!("{:?} are not cells below {cells}", self.neighbours[cell].map(CellNeighbour::cell));
            return Err(MeshError::bad_entry("neighbours", cell, problem));
        }
        let boundary = self.boundary_faces().count();
        check_length("faces of all cells", 2 * self.faces.len() - boundary, 4 * cells)
    }
}

impl Topology {
    /// Checks the lengths and index ranges of all arrays.
    pub(super) fn check_ranges(&self) -> Result<(), MeshError> {
        let vertices = self.vertex_count;
        check_counts(self.tets.len(), vertices as usize)?;
        check_indices(&self.tets, vertices as usize)?;
        self.connectivity().check_ranges(self.tets.len(), vertices)
    }

    /// Checks that all arrays agree: neighbours are mutual, share the face between them and lie on opposite sides of it; faces are sorted
    /// and are those of their cells; every face of every cell is listed.
    ///
    /// # Errors
    /// The first contradiction.
    pub fn check(&self) -> Result<(), MeshError> {
        self.check_ranges()?;
        let connectivity = self.connectivity();
        for (cell, sides) in (0u32..).zip(&connectivity.neighbours) {
            for (local, &across) in (0u32..).zip(sides) {
                self.check_side(CellNeighbour::new(cell, local), across)
                    .map_err(|problem| MeshError::bad_entry("neighbours", cell as usize, problem))?;
            }
        }
        let keys = || connectivity.faces.iter().zip(&connectivity.face_cells);
        if let Some(face) = keys().zip(keys().skip(1)).position(|(a, b)| a >= b) {
            return Err(MeshError::bad_entry("faces", face + 1, "not in ascending order"));
        }
        match keys().position(|(face, cells)| !self.is_between(*face, *cells)) {
            None => Ok(()),
            Some(face) => Err(MeshError::bad_entry("face_cells", face, "not the cells on both sides of the face")),
        }
    }

    /// Checks that `across` is a valid neighbour across this face of a cell.
    fn check_side(&self, side: CellNeighbour, across: CellNeighbour) -> Result<(), &'static str> {
        let Some(other) = across.cell() else { return Ok(()) };
        let cell = side.0 >> 2;
        if self.connectivity().neighbours[other as usize][across.opposite() as usize] != side {
            return Err("not mutual");
        }
        let face_of = |cell: u32, side: CellNeighbour| ascending_face(self.tets[cell as usize], side.opposite());
        if face_of(cell, side) != face_of(other, across) {
            return Err("the cells do not share the face");
        }
        if winding_is_even(side, &self.tets) == winding_is_even(across, &self.tets) {
            return Err("both cells lie on the same side of their face");
        }
        Ok(())
    }

    /// Whether, according to the neighbours, this face lies between these two cells.
    fn is_between(&self, face: [u32; 3], [first, second]: [u32; 2]) -> bool {
        let tet = self.tets[first as usize];
        let local = (0..4).find(|&local| ascending_face(tet, local) == face);
        local.is_some_and(|local| {
            self.connectivity().neighbours[first as usize][local as usize].cell() == (second != NONE).then_some(second)
        })
    }
}

impl Mesh {
    /// Checks all invariants of the mesh: those of [`Topology::check`]; every cell is positively oriented; every vertex has a position and
    /// is used; both permutations have the right length. Takes some 0.2 s for a million cells; meant for tests.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn check(&self) -> Result<(), MeshError> {
        let (cells, vertices) = (self.topology.tets.len(), self.topology.vertex_count as usize);
        check_length("points", self.positions.local.len(), vertices)?;
        check_length("vertex_source", self.vertex_source.len(), vertices)?;
        check_length("cell_source", self.cell_source.len(), cells)?;
        check_length("split_cells.source", self.split_cells.source.len(), self.split_cells.solids.len())?;
        let is_missing =
            |[cell, vertex]: &[u32; 2]| *cell as usize >= self.split_cells.source.len() || *vertex as usize >= vertices;
        if let Some(entry) = self.split_cells.steiner.iter().position(is_missing) {
            return Err(MeshError::bad_entry("split_cells.steiner", entry, "names a cell or vertex that is missing"));
        }
        self.topology.check()?;
        check_orientation(&self.topology.tets, &self.positions)?;
        match super::repair::used_vertices(self.topology.tets.iter(), vertices).iter().position(|used| !used) {
            None => Ok(()),
            Some(vertex) => Err(MeshError::bad_entry("points", vertex, "no cell uses the vertex")),
        }
    }
}

//! Connectivity of a tetrahedral mesh.

use rayon::prelude::*;

use super::geometry::tet_volume;
use super::repair::{check_counts, check_indices};
use super::{Connectivity, MeshError, Positions, faces};
use std::sync::OnceLock;

/// Cells, and their connectivity when it is first asked for.
///
/// Every tet is positively oriented: with vertices a, b, c, d, det(b - a, c - a, d - a) > 0. Local face i of a tet is the
/// one opposite its vertex i.
#[derive(Clone, Debug)]
pub struct Topology {
    /// Number of vertices; every one is used by a tet.
    pub vertex_count: u32,
    /// Vertices of the cells, positively oriented.
    pub tets: Vec<[u32; 4]>,
    /// Made when first asked for.
    pub(super) connectivity: OnceLock<Connectivity>,
}

impl PartialEq for Topology {
    /// Compares the cells, and connectivity only where both have it already: it follows from the cells.
    fn eq(&self, other: &Self) -> bool {
        let same_connectivity = match (self.connectivity.get(), other.connectivity.get()) {
            (Some(ours), Some(theirs)) => ours == theirs,
            _ => true,
        };
        (self.vertex_count, &self.tets) == (other.vertex_count, &other.tets) && same_connectivity
    }
}

/// Vertices of local face i (opposite vertex i) of a positively oriented tet, counter-clockwise seen from outside.
pub const FACE_VERTICES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

impl Topology {
    /// The topology of `tets`, whose connectivity is derived when it is first asked for.
    ///
    /// # Errors
    /// If there are too many cells or vertices, `positions` does not have `vertex_count` entries, or a cell names a missing
    /// vertex or is not positively oriented. Cells of a [`RawMesh`](super::RawMesh) go through
    /// [`Mesh::build`](super::Mesh::build) instead.
    pub fn from_tets(vertex_count: u32, tets: Vec<[u32; 4]>, positions: &Positions) -> Result<Self, MeshError> {
        check_counts(tets.len(), vertex_count as usize)?;
        check_length("points", positions.local.len(), vertex_count as usize)?;
        check_indices(&tets, vertex_count as usize)?;
        check_orientation(&tets, positions)?;
        Ok(Self::of_cells(vertex_count, tets))
    }

    /// A topology from stored arrays. All lengths and ranges are checked, so that no index is out of bounds; [`Topology::check`] checks
    /// that the arrays agree with each other.
    ///
    /// # Errors
    /// If lengths do not match or an index is out of range.
    pub fn from_parts(vertex_count: u32, tets: Vec<[u32; 4]>, connectivity: Connectivity) -> Result<Self, MeshError> {
        let topology = Self { connectivity: connectivity.into(), ..Self::of_cells(vertex_count, tets) };
        topology.check_ranges()?;
        Ok(topology)
    }

    /// The topology of positively oriented cells with indices below `vertex_count`.
    pub(super) fn of_cells(vertex_count: u32, tets: Vec<[u32; 4]>) -> Self {
        Self { vertex_count, tets, connectivity: OnceLock::new() }
    }

    /// Faces and neighbours. They are derived at the first call, unless they come from a store; what draws cells one by one has no need to
    /// ask.
    pub fn connectivity(&self) -> &Connectivity {
        self.connectivity.get_or_init(|| faces::connect(self.vertex_count, &self.tets))
    }

    /// Faces and neighbours, if they are there already.
    pub fn known_connectivity(&self) -> Option<&Connectivity> {
        self.connectivity.get()
    }

    /// Lets connectivity be derived again, if it is asked for.
    pub(super) fn forget_connectivity(&mut self) {
        self.connectivity = OnceLock::new();
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

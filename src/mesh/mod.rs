//! Tetrahedral meshes: connectivity ([`Topology`]) and coordinates ([`Positions`]) apart from each other, because the
//! first stays the same when the second moves.

mod build;
mod check;
pub mod contour;
mod curve;
mod error;
mod faces;
mod geometry;
mod gradient;
#[cfg(test)]
mod gradient_tests;
mod locate;
mod plane;
mod positions;
mod repair;
mod report;
mod split;
#[cfg(test)]
pub(crate) mod test_meshes;
#[cfg(test)]
mod tests;
mod topology;

pub use error::MeshError;
pub use geometry::tet_volume;
pub use gradient::{tet_gradient, tet_gradient_magnitude};
pub use plane::Plane;
pub use positions::Positions;
pub use report::RepairReport;
pub use split::{Cells, Split, gather, split};
pub use topology::{CellNeighbour, FACE_VERTICES, NONE, Topology};

use glam::DVec3;

/// A mesh as a file holds it: any vertex order, any winding, possibly with defects. [`Mesh::build`] makes a [`Mesh`] of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMesh {
    /// Vertex coordinates in world units.
    pub points: Vec<DVec3>,
    /// The cells, by the indices of their vertices.
    pub cells: Cells,
}

/// A repaired mesh in curve order, with the way back to the file's numbering.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Connectivity.
    pub topology: Topology,
    /// Coordinates.
    pub positions: Positions,
    /// For each vertex the index it had in the [`RawMesh`].
    pub vertex_source: Vec<u32>,
    /// For each cell the index that it, or the cell it is a part of, had in the [`RawMesh`].
    pub cell_source: Vec<u32>,
    /// For each cell whether its last two vertices were swapped to make its volume positive.
    pub cell_turned: Vec<bool>,
}

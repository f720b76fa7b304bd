//! Tetrahedral meshes. Cells and their connectivity ([`Topology`]) are apart from coordinates ([`Positions`]), because they stay the same when vertices move.

mod build;
mod cells_around;
mod check;
mod cloud;
#[cfg(feature = "clouds")]
mod cloud_radii;
mod connectivity;
pub mod contour;
mod curve;
mod error;
mod faces;
mod far;
mod geometry;
mod gradient;
#[cfg(test)]
mod gradient_tests;
mod hanging;
mod locate;
mod plane;
pub mod polyhedron;
mod positions;
mod repair;
mod report;
mod soup;
mod source_cells;
mod split;
mod steiner;
#[cfg(test)]
mod steiner_tests;
#[cfg(test)]
pub(crate) mod test_meshes;
#[cfg(test)]
mod tests;
mod topology;
mod vertex_shapes;

pub use cells_around::CellsAround;
pub use cloud::CloudReport;
pub use connectivity::{CellNeighbour, Connectivity, NONE};
pub use error::MeshError;
pub use far::FarParts;
pub use geometry::{ball_volume, tet_aspect_ratio, tet_volume};
pub use gradient::{tet_gradient, tet_gradient_magnitude};
pub use plane::Plane;
pub use positions::Positions;
pub use report::{RepairReport, WorstCell};
pub use soup::{ConnectivityChoice, Unconnected};
pub use source_cells::SourceCells;
pub(crate) use split::split_from_corners;
pub use split::{Cells, POLYHEDRON_VTK_TYPE, Solid, SolidShape, Solids, Split, SplitCells, gather, split};
pub use steiner::SteinerPoints;
pub use topology::{FACE_VERTICES, Topology};
pub use vertex_shapes::Symmetric;

use glam::DVec3;
use std::sync::OnceLock;

/// A mesh as a file holds it: any vertex order, any winding, possibly with defects. [`Mesh::build`] makes a [`Mesh`] of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMesh {
    /// Vertex coordinates in world units.
    pub points: Vec<DVec3>,
    /// The cells, by the indices of their vertices.
    pub cells: Cells,
}

/// A repaired mesh in curve order, with maps back to the file's numbering.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Cells and their connectivity.
    pub topology: Topology,
    /// Coordinates.
    pub positions: Positions,
    /// Index of each vertex in the [`RawMesh`]. Vertices that were added ([`SplitCells::steiner`]) are numbered on from its points.
    pub vertex_source: Vec<u32>,
    /// Index in the [`RawMesh`] of each cell, or of the cell that it is a part of.
    pub cell_source: Vec<u32>,
    /// Whether the last two vertices of each cell were swapped to make its volume positive.
    pub cell_turned: Vec<bool>,
    /// The cells of the [`RawMesh`] of which several cells were made.
    pub split_cells: SplitCells,
    /// The box of the mesh without parts that are far away, in world coordinates; `None` if there are none.
    pub without_far_parts: Option<(DVec3, DVec3)>,
    /// Whether the mesh was imported with its connectivity. Without it cells are drawn one by one, and what needs faces is refused.
    pub is_connected: bool,
    /// Radius of the ball around each vertex, in local units, of a cloud, whose cells are its vertices, each four times; `None` for a mesh of
    /// tetrahedra.
    pub radii: Option<Vec<f32>>,
    /// Volume of each vertex over that of its ball, above zero, of a cloud that has volumes.
    pub filling: Option<Vec<f32>>,
    /// Made when values of cells are first brought to the vertices.
    cells_around: OnceLock<CellsAround>,
}

impl Mesh {
    /// A mesh of parts that fit: what [`Self::build`] makes, and a store has.
    pub(crate) fn of_parts(
        topology: Topology,
        positions: Positions,
        [vertex_source, cell_source]: [Vec<u32>; 2],
        cell_turned: Vec<bool>,
        split_cells: SplitCells,
    ) -> Self {
        let cells_around = OnceLock::new();
        let without_far_parts = None;
        Self {
            topology,
            positions,
            vertex_source,
            cell_source,
            cell_turned,
            split_cells,
            without_far_parts,
            is_connected: true,
            radii: None,
            filling: None,
            cells_around,
        }
    }

    /// The box that a picture shows unless told otherwise, in world coordinates: that of the mesh without parts that are far away.
    pub fn frame(&self) -> (DVec3, DVec3) {
        self.without_far_parts.unwrap_or_else(|| self.positions.world_bounds())
    }
}

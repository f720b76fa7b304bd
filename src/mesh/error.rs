//! Errors of points and cells that do not make a mesh.

use glam::DVec3;

/// A mesh that cannot be built, or stored arrays that contradict each other. Importers wrap it in a
/// [`FileError`](crate::error::FileError), which adds the file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A neighbour is packed as `cell << 2 | local vertex` in 32 bits.
    #[error("{0} cells are too many: a mesh has fewer than 2^30; split it into parts")]
    TooManyCells(usize),
    /// Vertices are numbered in 32 bits, of which one value means "none".
    #[error("{0} points are too many: a mesh has fewer than 2^32 - 1; split it into parts")]
    TooManyVertices(usize),
    /// A cell names a point that does not exist.
    #[error("cell {cell} names point {index}, but there are {vertex_count} points (numbered from 0)")]
    VertexOutOfRange {
        /// The cell.
        cell: usize,
        /// The missing point's index.
        index: u32,
        /// Number of points.
        vertex_count: usize,
    },
    /// A point that a cell uses is NaN or infinite.
    #[error("point {point} is used by a cell, but its position {position} is not finite")]
    NotFinite {
        /// The point.
        point: usize,
        /// Its position.
        position: DVec3,
    },
    /// Half the extent of the mesh exceeds the largest power of two.
    #[error("the mesh extends over {0:e}, beyond what f64 can scale; use a larger unit of length")]
    TooLarge(f64),
    /// The source has no cells.
    #[error("the mesh has no cells")]
    NoCells,
    /// All cells were dropped.
    #[error(
        "none of the {0} cells has a volume: their points coincide or lie in planes, to 24 bits of the mesh's extent"
    )]
    AllFlat(usize),
    /// All points of a cloud were dropped.
    #[error(
        "none of the {0} points has a radius: all are zero, negative or not finite, or the nearest points are at the same place; import with --radius R"
    )]
    NoRadii(usize),
    /// No point has a volume.
    #[error("none of the {0} points has a volume: all are zero, negative or not finite; import with --volume V")]
    NoVolumes(usize),
    /// Points have no radii, and this build estimates none.
    #[error("the points have no radii, and this build without the feature clouds estimates none; give a radius")]
    NoNeighbours,
    /// Two stored arrays that belong together differ in length.
    #[error("{array} has {found} entries instead of {expected}")]
    WrongLength {
        /// Name of the array.
        array: &'static str,
        /// Its length.
        found: usize,
        /// Length implied by the other arrays.
        expected: usize,
    },
    /// An entry of a stored array is invalid.
    #[error("{array}, entry {entry}: {problem}")]
    BadEntry {
        /// Name of the array.
        array: &'static str,
        /// The index of the entry.
        entry: usize,
        /// Description of the error.
        problem: String,
    },
    /// The origin or scale of stored positions is not finite, or the scale not a power of two.
    #[error(
        "origin {origin} and scale {scale:e} are no local frame: both are finite, the scale a positive power of two"
    )]
    BadFrame {
        /// The origin.
        origin: DVec3,
        /// The scale.
        scale: f64,
    },
}

impl MeshError {
    /// The error that entry `entry` of `array` is invalid.
    pub(super) fn bad_entry(array: &'static str, entry: usize, problem: impl Into<String>) -> Self {
        Self::BadEntry { array, entry, problem: problem.into() }
    }
}

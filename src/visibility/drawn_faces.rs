//! The faces that a frame draws.

/// Faces of a mesh front to back, for renderers that draw faces (`render::cpu::havs`).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DrawnFaces {
    /// Ids of unique faces, each once, ascending by the depth of their centroids.
    pub faces: Vec<u32>,
    /// Whether all faces of the active cells are included (level of detail 100 %): two successive faces on a ray then belong to one cell,
    /// or bound a gap between cells.
    pub is_complete: bool,
}

//! The faces or cells that a frame draws.

use super::Selection;
use super::depth_order::list;

/// Faces of a mesh front to back, for renderers that draw faces (`render::cpu::havs`), or cells (`render::cpu::points`).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Their ids, each once, ascending by the depth of their centroids.
    pub ids: Vec<u32>,
    /// Whether all active cells, or all of their faces, are included (level of detail 100 %): two successive faces on a ray then belong to
    /// one cell, or bound a gap between cells.
    pub is_complete: bool,
}

impl Drawn {
    /// Becomes a selection in the order of ids, in its own memory; `ends` is scratch memory.
    pub fn list(&mut self, selection: &Selection, ends: &mut Vec<u32>) {
        list(&selection.ids, ends, &mut self.ids);
        self.is_complete = selection.is_complete;
    }
}

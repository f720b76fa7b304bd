//! The set of faces or cells that a frame draws.

use super::parts::CHUNK;
use super::{CellSet, IdSet};
use rayon::prelude::*;

/// A set of faces, or of cells, of one mesh, and whether it is complete.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// The faces or cells.
    pub ids: IdSet,
    /// Whether all active cells, or all of their faces, are included (level of detail 100 %).
    pub is_complete: bool,
}

impl IdSet {
    /// Becomes the set of faces between an active cell and an inactive one or the outside; `inner` becomes that of the faces between two
    /// active cells. `face_cells`: as in [`Topology`](crate::mesh::Topology).
    pub fn set_boundary_of(&mut self, active: &CellSet, face_cells: &[[u32; 2]], inner: &mut Self) {
        self.resize(face_cells.len());
        inner.resize(face_cells.len());
        let words = self.words_mut().par_chunks_mut(CHUNK / 64).zip(inner.words_mut().par_chunks_mut(CHUNK / 64));
        words.zip(face_cells.par_chunks(CHUNK)).for_each(|((boundary, inner), face_cells)| {
            for ((boundary, inner), face_cells) in boundary.iter_mut().zip(inner).zip(face_cells.chunks(64)) {
                let (mut one, mut both) = (0, 0);
                for (place, &cells) in face_cells.iter().enumerate() {
                    let [a, b] = cells.map(|cell| active.bit(cell));
                    one |= (a ^ b) << place;
                    both |= (a & b) << place;
                }
                (*boundary, *inner) = (one, both);
            }
        });
    }
}

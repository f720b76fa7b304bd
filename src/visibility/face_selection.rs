//! The set of faces that a frame draws.

use super::parts::CHUNK;
use crate::visibility::CellSet;
use rayon::prelude::*;

/// A set of faces of one mesh, one bit each, and whether it is complete.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FaceSelection {
    pub(super) words: Vec<u64>,
    pub(super) len: usize,
    /// Whether all faces of the active cells are included (level of detail 100 %).
    pub is_complete: bool,
}

impl FaceSelection {
    /// Becomes empty for a mesh of `len` faces, in its own memory.
    pub fn clear(&mut self, len: usize) {
        self.words.clear();
        self.words.resize(len.div_ceil(64), 0);
        (self.len, self.is_complete) = (len, false);
    }

    /// Becomes equal to `other`, in its own memory.
    pub fn copy_from(&mut self, other: &Self) {
        self.words.clone_from(&other.words);
        self.len = other.len;
        self.is_complete = other.is_complete;
    }

    /// Number of faces of the mesh (not of the set).
    pub fn universe(&self) -> usize {
        self.len
    }

    /// Number of faces in the set.
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Whether `face` is in the set.
    #[inline]
    pub fn contains(&self, face: u32) -> bool {
        self.words[face as usize / 64] >> (face % 64) & 1 == 1
    }

    /// Adds `face`.
    #[inline]
    pub fn insert(&mut self, face: u32) {
        self.words[face as usize / 64] |= 1 << (face % 64);
    }

    /// Adds all faces of `other`, which is of the same mesh.
    pub fn insert_all(&mut self, other: &Self) {
        self.words.iter_mut().zip(&other.words).for_each(|(word, more)| *word |= more);
    }

    /// Whether all faces of the set are in `other`, which is of the same mesh.
    pub(super) fn is_within(&self, other: &Self) -> bool {
        self.len == other.len && self.words.iter().zip(&other.words).all(|(word, other)| word & !other == 0)
    }

    /// Adds all faces of a mesh of `len` faces.
    pub(super) fn fill(&mut self, len: usize) {
        self.clear(len);
        self.words.fill(u64::MAX);
        if let Some(last) = self.words.last_mut()
            && !len.is_multiple_of(64)
        {
            *last = (1 << (len % 64)) - 1;
        }
    }

    /// Becomes the set of faces between an active cell and an inactive one or the outside; `inner` becomes that of the faces between two
    /// active cells. `face_cells`: as in [`Topology`](crate::mesh::Topology).
    pub fn set_boundary_of(&mut self, active: &CellSet, face_cells: &[[u32; 2]], inner: &mut Self) {
        self.clear(face_cells.len());
        inner.clear(face_cells.len());
        let words = self.words.par_chunks_mut(CHUNK / 64).zip(inner.words.par_chunks_mut(CHUNK / 64));
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

//! A set of cells, one bit each.

use rayon::prelude::*;

/// A set of cells of one mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CellSet {
    words: Vec<u64>,
    len: usize,
}

impl CellSet {
    /// All cells of a mesh of `len` cells.
    pub fn all(len: usize) -> Self {
        let mut words = vec![u64::MAX; len.div_ceil(64)];
        if let Some(last) = words.last_mut()
            && !len.is_multiple_of(64)
        {
            *last = (1 << (len % 64)) - 1;
        }
        Self { words, len }
    }

    /// No cell of a mesh of `len` cells.
    pub fn none(len: usize) -> Self {
        Self { words: vec![0; len.div_ceil(64)], len }
    }

    /// The cells of a mesh of `len` cells for which `is_member` holds, evaluated on all threads.
    pub fn of(len: usize, is_member: impl Fn(usize) -> bool + Sync) -> Self {
        let word = |at: usize| {
            (64 * at..len.min(64 * at + 64)).fold(0, |word, cell| word | u64::from(is_member(cell)) << (cell % 64))
        };
        Self { words: (0..len.div_ceil(64)).into_par_iter().with_min_len(256).map(word).collect(), len }
    }

    /// The set as bits: cell c is bit c % 64 of word c / 64; bits beyond the last cell are zero.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Resizes to a mesh of `len` cells in its own memory; the members are undefined until [`Self::words_mut`] sets them.
    pub(super) fn resize(&mut self, len: usize) {
        self.words.resize(len.div_ceil(64), 0);
        self.len = len;
    }

    /// The bits; those beyond the last cell must stay zero.
    pub(super) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Number of cells of the mesh (not of the set).
    pub fn universe(&self) -> usize {
        self.len
    }

    /// Number of cells in the set.
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Whether `cell` is in the set.
    #[inline]
    pub fn contains(&self, cell: u32) -> bool {
        self.words[cell as usize / 64] >> (cell % 64) & 1 == 1
    }

    /// 1 if `cell` is in the set, else 0, also for [`NONE`](crate::mesh::NONE).
    #[inline]
    pub(super) fn bit(&self, cell: u32) -> u64 {
        self.words.get(cell as usize / 64).map_or(0, |word| word >> (cell % 64) & 1)
    }

    /// Adds or removes `cell`.
    pub fn set(&mut self, cell: u32, member: bool) {
        let bit = 1 << (cell % 64);
        let word = &mut self.words[cell as usize / 64];
        if member { *word |= bit } else { *word &= !bit }
    }
}

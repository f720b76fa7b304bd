//! A set of cells or faces, one bit each.

use rayon::prelude::*;

/// A set of cells or of faces of one mesh, by their ids.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IdSet {
    words: Vec<u64>,
    len: usize,
}

/// A set of cells.
pub type CellSet = IdSet;

impl IdSet {
    /// All ids of `len`.
    pub fn all(len: usize) -> Self {
        let mut all = Self::none(len);
        fill_words(&mut all.words, len, true);
        all
    }

    /// No id of `len`.
    pub fn none(len: usize) -> Self {
        Self { words: vec![0; len.div_ceil(64)], len }
    }

    /// The ids of `len` for which `is_member` holds, evaluated on all threads.
    pub fn of(len: usize, is_member: impl Fn(usize) -> bool + Sync) -> Self {
        let word = |at: usize| {
            (64 * at..len.min(64 * at + 64)).fold(0, |word, id| word | u64::from(is_member(id)) << (id % 64))
        };
        Self { words: (0..len.div_ceil(64)).into_par_iter().with_min_len(256).map(word).collect(), len }
    }

    /// The set as bits: id i is bit i % 64 of word i / 64; bits beyond the last id are zero.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Resizes to `len` ids in its own memory; the members are undefined until [`Self::words_mut`] sets them.
    pub(super) fn resize(&mut self, len: usize) {
        self.words.resize(len.div_ceil(64), 0);
        self.len = len;
    }

    /// The bits; those beyond the last id must stay zero.
    pub(super) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Number of cells or faces of the mesh (not of the set).
    pub fn universe(&self) -> usize {
        self.len
    }

    /// Number of ids in the set.
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Whether `id` is in the set.
    #[inline]
    pub fn contains(&self, id: u32) -> bool {
        self.words[id as usize / 64] >> (id % 64) & 1 == 1
    }

    /// Whether all ids of the set are in `other`, which is of the same mesh.
    pub(super) fn is_within(&self, other: &Self) -> bool {
        self.len == other.len && self.words.iter().zip(&other.words).all(|(word, other)| word & !other == 0)
    }

    /// 1 if `id` is in the set, else 0, also for [`NONE`](crate::mesh::NONE).
    #[inline]
    pub(super) fn bit(&self, id: u32) -> u64 {
        self.words.get(id as usize / 64).map_or(0, |word| word >> (id % 64) & 1)
    }

    /// Adds or removes `id`.
    #[inline]
    pub fn set(&mut self, id: u32, member: bool) {
        let bit = 1 << (id % 64);
        let word = &mut self.words[id as usize / 64];
        if member { *word |= bit } else { *word &= !bit }
    }

    /// Adds all ids of `other`, which is of the same mesh.
    pub fn insert_all(&mut self, other: &Self) {
        self.words.iter_mut().zip(&other.words).for_each(|(word, more)| *word |= more);
    }

    /// Becomes the empty set of `len` ids, in its own memory.
    pub fn clear_to(&mut self, len: usize) {
        self.resize(len);
        self.words.fill(0);
    }

    /// Becomes equal to `other`, in its own memory.
    pub fn copy_from(&mut self, other: &Self) {
        self.words.clone_from(&other.words);
        self.len = other.len;
    }
}

/// Sets all of `count` bits, or none.
pub(super) fn fill_words(words: &mut [u64], count: usize, members: bool) {
    words.fill(if members { u64::MAX } else { 0 });
    if let Some(last) = words.last_mut()
        && members
        && !count.is_multiple_of(64)
    {
        *last = (1 << (count % 64)) - 1;
    }
}

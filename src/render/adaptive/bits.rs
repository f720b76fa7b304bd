//! A bit for each pixel of an image.

use rayon::prelude::*;

/// A set of pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(in crate::render) struct PixelBits {
    width: usize,
    height: usize,
    /// Words per row; bits beyond the last column are unused.
    words_per_row: usize,
    words: Vec<u64>,
}

impl PixelBits {
    /// Becomes the empty set for an image of this width and height, keeping the memory.
    pub(in crate::render) fn clear(&mut self, (width, height): (usize, usize)) {
        (self.width, self.height, self.words_per_row) = (width, height, width.div_ceil(64));
        self.words.clear();
        self.words.resize(self.words_per_row * height, 0);
    }

    /// Adds a pixel.
    pub(in crate::render) fn insert(&mut self, column: usize, row: usize) {
        self.words[row * self.words_per_row + column / 64] |= 1 << (column % 64);
    }

    /// Whether the set has a pixel.
    #[inline]
    pub(in crate::render) fn contains(&self, column: usize, row: usize) -> bool {
        self.words[row * self.words_per_row + column / 64] >> (column % 64) & 1 == 1
    }

    /// Adds the pixels of another set over the same image.
    pub(super) fn insert_all(&mut self, other: &Self) {
        self.words.iter_mut().zip(&other.words).for_each(|(word, other)| *word |= other);
    }

    /// Becomes the complement of another set over the same image.
    pub(super) fn become_rest_of(&mut self, other: &Self) {
        self.clear((other.width, other.height));
        let width = self.width;
        self.words
            .par_chunks_mut(self.words_per_row.max(1))
            .zip(other.words.par_chunks(other.words_per_row.max(1)))
            .for_each(|(words, others)| {
                for (at, (word, other)) in words.iter_mut().zip(others).enumerate() {
                    // Bits beyond the width stay 0.
                    *word = !other & (u64::MAX >> 64_usize.saturating_sub(width - at * 64));
                }
            });
    }

    /// Whether the set is empty.
    pub(in crate::render) fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    /// Number of pixels in the set.
    pub(super) fn count(&self) -> u64 {
        self.words.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    /// The rows of the image, each as words: pixel c is bit c % 64 of word c / 64.
    pub(in crate::render) fn par_rows_mut(&mut self) -> rayon::slice::ChunksMut<'_, u64> {
        self.words.par_chunks_mut(self.words_per_row.max(1))
    }
}

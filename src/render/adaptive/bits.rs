//! A bit for each pixel of an image.

use rayon::prelude::*;

/// A set of pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(in crate::render) struct PixelBits {
    width: usize,
    height: usize,
    /// Words of a row; its last bits are no pixels.
    words_per_row: usize,
    words: Vec<u64>,
}

impl PixelBits {
    /// Becomes the empty set of pixels of an image of so many columns and rows, in the memory that there is.
    pub(in crate::render) fn clear(&mut self, (width, height): (usize, usize)) {
        (self.width, self.height, self.words_per_row) = (width, height, width.div_ceil(64));
        self.words.clear();
        self.words.resize(self.words_per_row * height, 0);
    }

    /// Puts a pixel in.
    pub(in crate::render) fn insert(&mut self, column: usize, row: usize) {
        self.words[row * self.words_per_row + column / 64] |= 1 << (column % 64);
    }

    /// Whether a pixel is in it.
    #[inline]
    pub(in crate::render) fn contains(&self, column: usize, row: usize) -> bool {
        self.words[row * self.words_per_row + column / 64] >> (column % 64) & 1 == 1
    }

    /// Puts the pixels of another set over the same image in.
    pub(super) fn insert_all(&mut self, other: &Self) {
        self.words.iter_mut().zip(&other.words).for_each(|(word, other)| *word |= other);
    }

    /// Becomes the pixels of the same image that are not in another set.
    pub(super) fn become_rest_of(&mut self, other: &Self) {
        self.clear((other.width, other.height));
        let width = self.width;
        self.words
            .par_chunks_mut(self.words_per_row.max(1))
            .zip(other.words.par_chunks(other.words_per_row.max(1)))
            .for_each(|(words, others)| {
                for (at, (word, other)) in words.iter_mut().zip(others).enumerate() {
                    // The last word of a row may have bits beyond it.
                    *word = !other & (u64::MAX >> 64_usize.saturating_sub(width - at * 64));
                }
            });
    }

    /// Whether there are none.
    pub(in crate::render) fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    /// How many there are.
    pub(super) fn count(&self) -> u64 {
        self.words.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    /// The rows of the image: of each the words, of which pixel c is bit c % 64 of word c / 64.
    pub(in crate::render) fn par_rows_mut(&mut self) -> rayon::slice::ChunksMut<'_, u64> {
        self.words.par_chunks_mut(self.words_per_row.max(1))
    }
}

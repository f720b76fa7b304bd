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

    /// How many there are.
    pub(super) fn count(&self) -> u64 {
        self.words.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    /// The rows of the image: of each the words, of which pixel c is bit c % 64 of word c / 64.
    pub(in crate::render) fn par_rows_mut(&mut self) -> rayon::slice::ChunksMut<'_, u64> {
        self.words.par_chunks_mut(self.words_per_row.max(1))
    }
}

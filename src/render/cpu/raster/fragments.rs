//! Fragments of a tile, found item by item, then pixel by pixel.

use super::super::tiles::TILE_PX;
use crate::visibility::ascending_bits;
use std::ops::Range;

/// Pixels of a tile.
pub(in crate::render::cpu) const PIXELS: usize = TILE_PX * TILE_PX;

/// Fragments found together.
const EIGHT: usize = 8;

/// Depths and scalars of the ends of a segment, in one line of the cache.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub(in crate::render::cpu) struct SegmentEnds {
    pub(in crate::render::cpu) depth: [f64; 2],
    pub(in crate::render::cpu) scalar: [f64; 2],
}

/// The upper half of the word of a fragment at this depth.
#[inline(always)]
fn word(depth: f64) -> u64 {
    u64::from(ascending_bits(depth as f32)) << 32
}

/// Fragments of a tile: places `P`, and cells `C`.
///
/// They stay where they are; words of their depth, rounded to f32, and their index are put in order. Indices ascend as fragments are found.
pub(in crate::render::cpu) struct Fragments<P, C> {
    count: usize,
    /// As long as the next three, and longer than `count`, so that eight can be written at once.
    found: Vec<P>,
    cells: Vec<C>,
    pixels: Vec<u8>,
    /// Their words as listed, and by pixel.
    listed: Vec<u64>,
    words: Vec<u64>,
    /// Per pixel the number of its words, then their end; they begin where those of the pixel before end.
    ends: [u32; PIXELS],
}

const _: () = assert!(PIXELS == u8::MAX as usize + 1);

impl<P, C> Default for Fragments<P, C> {
    fn default() -> Self {
        let (found, cells, pixels, listed, words) = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { count: 0, found, cells, pixels, listed, words, ends: [0; PIXELS] }
    }
}

impl<P: Copy + Default, C: Copy + Default> Fragments<P, C> {
    pub(in crate::render::cpu) fn clear(&mut self) {
        self.count = 0;
        self.ends.fill(0);
    }

    pub(in crate::render::cpu) fn len(&self) -> usize {
        self.count
    }

    /// Adds the fragment of a pixel at this depth.
    #[inline(always)]
    pub(in crate::render::cpu) fn push(&mut self, pixel: usize, depth: f64, place: P, cells: C) {
        let at = self.count;
        if self.found.len() == at {
            self.make_room();
        }
        (self.found[at], self.cells[at]) = (place, cells);
        (self.pixels[at], self.listed[at]) = (pixel as u8, word(depth) | at as u64);
        self.ends[pixel % PIXELS] += 1;
        self.count += 1;
    }

    /// Adds fragments of the same cells, those of eight whose bits are set, with their pixels, depths and places.
    #[inline(always)]
    pub(in crate::render::cpu) fn push_some(
        &mut self,
        cells: C,
        mut which: u8,
        pixels: &[u32; EIGHT],
        depths: &[f64; EIGHT],
        place: impl Fn(usize) -> P,
    ) {
        let first = self.count;
        if self.found.len() < first + EIGHT {
            self.make_room();
        }
        let Some(found) = self.found[first..].first_chunk_mut::<EIGHT>() else { return };
        let Some(of_cells) = self.cells[first..].first_chunk_mut::<EIGHT>() else { return };
        let Some(into_pixels) = self.pixels[first..].first_chunk_mut::<EIGHT>() else { return };
        let Some(listed) = self.listed[first..].first_chunk_mut::<EIGHT>() else { return };
        *of_cells = [cells; EIGHT];
        let mut words = [0u64; EIGHT];
        for l in 0..EIGHT {
            words[l] = word(depths[l]);
        }
        let mut at = 0;
        while which != 0 {
            let l = which.trailing_zeros() as usize % EIGHT;
            which &= which - 1;
            found[at % EIGHT] = place(l);
            listed[at % EIGHT] = words[l] | (first + at) as u64;
            into_pixels[at % EIGHT] = pixels[l] as u8;
            self.ends[pixels[l] as usize % PIXELS] += 1;
            at += 1;
        }
        self.count = first + at;
    }

    #[cold]
    #[inline(never)]
    fn make_room(&mut self) {
        const LEAST: usize = 4096;
        let room = (2 * self.found.len()).max(LEAST);
        self.found.resize(room, P::default());
        self.cells.resize(room, C::default());
        self.pixels.resize(room, 0);
        self.listed.resize(room, 0);
    }

    /// Puts all in the order of their pixels, and those of a pixel, if `sort` does nothing, as listed.
    #[inline(always)]
    pub(in crate::render::cpu) fn by_pixel(
        &mut self,
        mut sort: impl FnMut(&mut [u64], &FragmentsByPixel<'_, P, C>),
    ) -> FragmentsByPixel<'_, P, C> {
        let Self { count, found, cells, pixels, listed, words, ends } = self;
        let mut sum = 0;
        for end in ends.iter_mut() {
            sum += std::mem::replace(end, sum);
        }
        // Old entries need no reset: all of them are overwritten.
        words.resize(*count, 0);
        for (&word, &pixel) in listed.iter().zip(pixels.iter()).take(*count) {
            let end = &mut ends[usize::from(pixel)];
            words[*end as usize] = word;
            *end += 1;
        }
        let fragments = FragmentsByPixel { found, cells, words: &[], ends };
        let mut begin = 0;
        for &end in ends.iter() {
            sort(&mut words[begin..end as usize], &fragments);
            begin = end as usize;
        }
        FragmentsByPixel { words, ..fragments }
    }
}

/// Fragments of a tile by pixel.
#[derive(Clone, Copy)]
pub(in crate::render::cpu) struct FragmentsByPixel<'a, P, C> {
    found: &'a [P],
    cells: &'a [C],
    words: &'a [u64],
    ends: &'a [u32; PIXELS],
}

impl<'a, P: Copy, C: Copy> FragmentsByPixel<'a, P, C> {
    /// Where the fragments of a pixel are.
    pub(in crate::render::cpu) fn range(&self, pixel: usize) -> Range<usize> {
        let begin = pixel.checked_sub(1).map_or(0, |before| self.ends[before]);
        begin as usize..self.ends[pixel] as usize
    }

    /// Some fragments in order.
    #[inline(always)]
    pub(in crate::render::cpu) fn some(
        self,
        range: Range<usize>,
    ) -> impl Iterator<Item = (P, C)> + Clone + use<'a, P, C> {
        self.words[range].iter().map(move |&word| self.of_word(word))
    }

    /// The fragment of a word.
    #[inline(always)]
    pub(in crate::render::cpu) fn of_word(&self, word: u64) -> (P, C) {
        let at = word as u32 as usize;
        (self.found[at], self.cells[at])
    }
}

/// Sorts the words of a pixel, most of which are near their places, by rounded depth and index; returns whether some depths may be alike.
#[inline(always)]
pub(in crate::render::cpu) fn sort_words(words: &mut [u64]) -> bool {
    /// Words moved per word, on average, before a sort that does not depend on their order is faster.
    const MOVES: usize = 8;
    let mut moves_left = MOVES * words.len();
    let mut has_alike = false;
    for i in 1..words.len() {
        let word = words[i];
        let mut at = i;
        while at > 0 && words[at - 1] > word {
            words[at] = words[at - 1];
            at -= 1;
        }
        words[at] = word;
        has_alike |= at > 0 && words[at - 1] >> 32 == word >> 32 || at < i && words[at + 1] >> 32 == word >> 32;
        moves_left = moves_left.saturating_sub(i - at);
        if moves_left == 0 {
            words.sort_unstable();
            return true;
        }
    }
    has_alike
}

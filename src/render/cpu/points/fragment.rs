//! Fragments of points, and their order on a ray.

use super::tets::Ends;
use crate::render::medium::RayPoint;
use crate::visibility::ascending_bits;
use std::cmp::Ordering;
use std::ops::Range;

/// Pixels of a tile.
pub(super) const PIXELS: usize = super::tile::PIXELS;

/// A point on a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fragment {
    /// Depths of entry and exit; of a slab of one scalar, its middle and its thickness.
    pub(super) depth: [f64; 2],
    /// Scalars at both ends.
    pub(super) scalar: [f64; 2],
    pub(super) cell: u32,
}

impl Fragment {
    /// The points at its ends.
    #[inline(always)]
    pub(super) fn ends(&self) -> [RayPoint; 2] {
        let ([entry, exit], [near, far]) = (self.depth, self.scalar);
        [RayPoint { depth: entry, scalar: near }, RayPoint { depth: exit, scalar: far }]
    }

    /// The points at the ends of a slab.
    #[inline(always)]
    pub(super) fn ends_of_slab(&self) -> [RayPoint; 2] {
        let [middle, thickness] = self.depth;
        let [from, to] = [middle - 0.5 * thickness, middle + 0.5 * thickness];
        Self { depth: [from, to], ..*self }.ends()
    }

    /// By depths, then by scalars; the last tie goes by cell.
    fn in_order(&self, other: &Self) -> Ordering {
        let [a, b] = [self, other].map(|of| [of.depth[0], of.depth[1], of.scalar[0], of.scalar[1]]);
        let ends = a.iter().zip(&b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
        ends.unwrap_or_else(|| self.cell.cmp(&other.cell))
    }
}

/// Depths and scalars of a [`Fragment`], in one line of the cache.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct FragmentEnds {
    depth: [f64; 2],
    scalar: [f64; 2],
}

/// The upper half of the word of a fragment at this depth.
#[inline(always)]
fn word(depth: f64) -> u64 {
    u64::from(ascending_bits(depth as f32)) << 32
}

/// Fragments found together.
const EIGHT: usize = 8;

/// Fragments of a tile, found cell by cell, then pixel by pixel.
///
/// They stay where they are; words of their depth, rounded to f32, and their index are sorted, and then those of one rounded depth.
pub(super) struct Fragments {
    count: usize,
    /// As long as the next three, and longer than `count`, so that eight can be written at once.
    found: Vec<FragmentEnds>,
    cells: Vec<u32>,
    pixels: Vec<u8>,
    /// Their words as listed, and by pixel.
    listed: Vec<u64>,
    words: Vec<u64>,
    /// Per pixel the number of its words, then their end; they begin where those of the pixel before end.
    ends: [u32; PIXELS],
}

const _: () = assert!(PIXELS == u8::MAX as usize + 1);

impl Default for Fragments {
    fn default() -> Self {
        let (found, cells, pixels, listed, words) = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { count: 0, found, cells, pixels, listed, words, ends: [0; PIXELS] }
    }
}

impl Fragments {
    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.ends.fill(0);
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Adds the fragment of a pixel.
    #[inline(always)]
    pub(super) fn push(&mut self, pixel: usize, Fragment { depth, scalar, cell }: Fragment) {
        let at = self.count;
        if self.found.len() == at {
            self.make_room();
        }
        self.found[at] = FragmentEnds { depth, scalar };
        (self.cells[at], self.pixels[at], self.listed[at]) = (cell, pixel as u8, word(depth[0]) | at as u64);
        self.ends[pixel % PIXELS] += 1;
        self.count += 1;
    }

    /// Adds fragments of a cell, those of eight whose bits are set, with their pixels.
    #[inline(always)]
    pub(super) fn push_some(&mut self, cell: u32, mut which: u8, pixels: &[u32; EIGHT], ends: &Ends) {
        let first = self.count;
        if self.found.len() < first + EIGHT {
            self.make_room();
        }
        let Some(found) = self.found[first..].first_chunk_mut::<EIGHT>() else { return };
        let Some(cells) = self.cells[first..].first_chunk_mut::<EIGHT>() else { return };
        let Some(into_pixels) = self.pixels[first..].first_chunk_mut::<EIGHT>() else { return };
        let Some(listed) = self.listed[first..].first_chunk_mut::<EIGHT>() else { return };
        *cells = [cell; EIGHT];
        let Ends { depth: [entry, exit], scalar: [near, far] } = ends;
        let mut words = [0u64; EIGHT];
        for l in 0..EIGHT {
            words[l] = word(entry[l]);
        }
        let mut at = 0;
        while which != 0 {
            let l = which.trailing_zeros() as usize % EIGHT;
            which &= which - 1;
            found[at % EIGHT] = FragmentEnds { depth: [entry[l], exit[l]], scalar: [near[l], far[l]] };
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
        self.found.resize(room, FragmentEnds::default());
        self.cells.resize(room, 0);
        self.pixels.resize(room, 0);
        self.listed.resize(room, 0);
    }

    /// Puts all in the order of their pixels, and those of a pixel in order, or as listed.
    pub(super) fn by_pixel(&mut self, are_sorted: bool) -> FragmentsByPixel<'_> {
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
        if are_sorted {
            let mut begin = 0;
            for &end in ends.iter() {
                sort(&mut words[begin..end as usize], &fragments);
                begin = end as usize;
            }
        }
        FragmentsByPixel { words, ..fragments }
    }
}

/// Fragments of a tile by pixel.
#[derive(Clone, Copy)]
pub(super) struct FragmentsByPixel<'a> {
    found: &'a [FragmentEnds],
    cells: &'a [u32],
    words: &'a [u64],
    ends: &'a [u32; PIXELS],
}

impl<'a> FragmentsByPixel<'a> {
    /// Where the fragments of a pixel are.
    pub(super) fn range(&self, pixel: usize) -> Range<usize> {
        let begin = pixel.checked_sub(1).map_or(0, |before| self.ends[before]);
        begin as usize..self.ends[pixel] as usize
    }

    /// Words of some fragments, in order.
    #[inline(always)]
    pub(super) fn words(&self, range: Range<usize>) -> &'a [u64] {
        &self.words[range]
    }

    /// Some fragments in order.
    #[inline(always)]
    pub(super) fn some(self, range: Range<usize>) -> impl Iterator<Item = Fragment> + Clone + use<'a> {
        self.words(range).iter().map(move |&word| self.of_word(word))
    }

    /// The fragment of a word.
    #[inline(always)]
    pub(super) fn of_word(&self, word: u64) -> Fragment {
        let at = word as u32 as usize;
        let FragmentEnds { depth, scalar } = self.found[at];
        Fragment { depth, scalar, cell: self.cells[at] }
    }
}

/// Sorts the words of a pixel, most of which are near their places.
#[inline(always)]
fn sort(words: &mut [u64], fragments: &FragmentsByPixel<'_>) {
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
            has_alike = true;
            break;
        }
    }
    if has_alike {
        sort_alike(words, fragments);
    }
}

/// Sorts sorted words among those of one rounded depth.
#[cold]
#[inline(never)]
fn sort_alike(words: &mut [u64], fragments: &FragmentsByPixel<'_>) {
    for alike in words.chunk_by_mut(|a, b| a >> 32 == b >> 32).filter(|alike| alike.len() > 1) {
        alike.sort_unstable_by(|&a, &b| fragments.of_word(a).in_order(&fragments.of_word(b)));
    }
}

//! Fragments of points, and their order on a ray.

use super::super::raster::fragments::{self, SegmentEnds, sort_words};
use super::tets::Ends;
use crate::render::medium::RayPoint;
use std::cmp::Ordering;

/// A point on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Fragments of a tile.
pub(super) type Fragments = fragments::Fragments<SegmentEnds, u32>;
/// Fragments of a tile by pixel.
pub(super) type FragmentsByPixel<'a> = fragments::FragmentsByPixel<'a, SegmentEnds, u32>;

impl From<(SegmentEnds, u32)> for Fragment {
    #[inline(always)]
    fn from((SegmentEnds { depth, scalar }, cell): (SegmentEnds, u32)) -> Self {
        Self { depth, scalar, cell }
    }
}

/// Adds the fragment of a pixel.
#[inline(always)]
pub(super) fn push(found: &mut Fragments, pixel: usize, Fragment { depth, scalar, cell }: Fragment) {
    found.push(pixel, depth[0], SegmentEnds { depth, scalar }, cell);
}

/// Adds fragments of a cell, those of eight whose bits are set, with their pixels.
#[inline(always)]
pub(super) fn push_some(found: &mut Fragments, cell: u32, which: u8, pixels: &[u32; 8], ends: &Ends) {
    let Ends { depth: [entry, exit], scalar: [near, far] } = ends;
    let place = |l: usize| SegmentEnds { depth: [entry[l], exit[l]], scalar: [near[l], far[l]] };
    found.push_some(cell, which, pixels, entry, place);
}

/// Sorts the words of a pixel, most of which are near their places.
#[inline(always)]
pub(super) fn sort(words: &mut [u64], fragments: &FragmentsByPixel<'_>) {
    if sort_words(words) {
        sort_alike(words, fragments);
    }
}

/// Sorts sorted words among those of one rounded depth.
#[cold]
#[inline(never)]
fn sort_alike(words: &mut [u64], fragments: &FragmentsByPixel<'_>) {
    for alike in words.chunk_by_mut(|a, b| a >> 32 == b >> 32).filter(|alike| alike.len() > 1) {
        let of_word = |word: u64| Fragment::from(fragments.of_word(word));
        alike.sort_unstable_by(|&a, &b| of_word(a).in_order(&of_word(b)));
    }
}

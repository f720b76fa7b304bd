//! Fragments of points, and their order on a ray.

use crate::render::medium::RayPoint;
use crate::visibility::ascending_bits;
use std::cmp::Ordering;

/// Pixels of a tile.
pub(super) const PIXELS: usize = super::tile::PIXELS;

/// A point on a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fragment {
    /// Depths between which the ray is in the point.
    pub(super) depth: [f64; 2],
    /// Scalars there.
    pub(super) scalar: [f64; 2],
    pub(super) cell: u32,
    /// Pixel of the tile.
    pub(super) pixel: u32,
}

impl Fragment {
    /// The points at its ends.
    #[inline(always)]
    pub(super) fn ends(&self) -> [RayPoint; 2] {
        [0, 1].map(|end| RayPoint { depth: self.depth[end], scalar: self.scalar[end] })
    }

    /// By entry, then by exit and scalars; the last tie goes by cell.
    fn by_entry(&self, other: &Self) -> Ordering {
        let [a, b] = [self, other].map(|of| [of.depth[0], of.depth[1], of.scalar[0], of.scalar[1]]);
        let ends = a.iter().zip(&b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
        ends.unwrap_or_else(|| self.cell.cmp(&other.cell))
    }
}

/// What the fragments of a pixel are sorted by; ties go by entry, exit, scalars and cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// As listed.
    Listed,
    /// By entry.
    Entry,
    /// By the middle.
    Middle,
}

impl Order {
    #[inline(always)]
    fn key(self, of: &Fragment) -> f64 {
        match self {
            Self::Listed | Self::Entry => of.depth[0],
            Self::Middle => 0.5 * (of.depth[0] + of.depth[1]),
        }
    }
}

/// Fragments of a tile, found cell by cell, then pixel by pixel.
///
/// They stay where they are; words of their depth, rounded to f32, and their index are sorted, and then those of one rounded depth.
#[derive(Default)]
pub(super) struct Fragments {
    pub(super) found: Vec<Fragment>,
    words: Vec<u64>,
}

impl Fragments {
    /// Calls `each` with each pixel that has some, all fragments, and words for those of the pixel in order: the index is in the lower half.
    pub(super) fn each_pixel(&mut self, order: Order, mut each: impl FnMut(usize, &[Fragment], &[u64])) {
        let Self { found, words } = self;
        let mut ends = [0usize; PIXELS];
        found.iter().for_each(|fragment| ends[fragment.pixel as usize % PIXELS] += 1);
        let mut sum = 0;
        for end in &mut ends {
            sum += std::mem::replace(end, sum);
        }
        // Old entries need no reset: all of them are overwritten.
        words.resize(found.len(), 0);
        for (at, fragment) in found.iter().enumerate() {
            let end = &mut ends[fragment.pixel as usize % PIXELS];
            words[*end] = u64::from(ascending_bits(order.key(fragment) as f32)) << 32 | at as u64;
            *end += 1;
        }
        let mut begin = 0;
        for (pixel, end) in ends.into_iter().enumerate() {
            if end > begin {
                let words = &mut words[begin..end];
                if order != Order::Listed {
                    sort(words, found, order);
                }
                each(pixel, found, words);
            }
            begin = end;
        }
    }
}

/// Sorts the words of a pixel.
fn sort(words: &mut [u64], found: &[Fragment], order: Order) {
    words.sort_unstable();
    let of = |word: u64| &found[word as u32 as usize];
    for alike in words.chunk_by_mut(|a, b| a >> 32 == b >> 32).filter(|alike| alike.len() > 1) {
        alike.sort_unstable_by(|&a, &b| {
            let [key, other] = [a, b].map(|word| order.key(of(word)));
            key.total_cmp(&other).then_with(|| of(a).by_entry(of(b)))
        });
    }
}

//! Fragments, and their order on a ray.

use super::super::super::medium::RayPoint;
use super::super::raster::Hit;
use super::super::raster::fragments::Fragments;
use crate::mesh::NONE;

/// The point at which a ray passes through a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fragment {
    pub(super) depth: f64,
    pub(super) scalar: f64,
    /// The active cell that the ray leaves; [`NONE`] if there is none.
    pub(super) near: u32,
    /// The active cell that the ray enters; [`NONE`] if there is none.
    pub(super) far: u32,
}

impl Fragment {
    #[inline(always)]
    pub(super) fn point(&self) -> RayPoint {
        RayPoint { depth: self.depth, scalar: self.scalar }
    }

    #[inline(always)]
    pub(super) fn at(hit: Hit) -> Self {
        let Hit { depth, scalar, cells: [near, far], .. } = hit;
        Self { depth, scalar, near, far }
    }

    /// Adds it to those of a pixel.
    pub(super) fn push_to(&self, fragments: &mut Fragments<RayPoint, [u32; 2]>, pixel: usize) {
        fragments.push(pixel, self.depth, self.point(), [self.near, self.far]);
    }

    /// The active cell that the ray leaves, or `other` if there is none.
    pub(super) fn near_or(&self, other: u32) -> u32 {
        if self.near == NONE { other } else { self.near }
    }

    /// Whether this fragment belongs in front of `other`, which arrived earlier. Depths that differ by no more than `tie` are undecided:
    /// the cell between the two then decides, and an exit comes before an entry.
    #[inline(always)]
    pub(super) fn is_before(&self, other: &Self, tie: f64) -> bool {
        let by = self.depth - other.depth;
        if by.abs() > tie { by < 0.0 } else { self.is_before_in_chain(other) }
    }

    #[cold]
    #[inline(never)]
    fn is_before_in_chain(&self, other: &Self) -> bool {
        if self.far != NONE && self.far == other.near {
            return true;
        }
        if other.far != NONE && other.far == self.near {
            return false;
        }
        match (self.far == NONE && other.near == NONE, other.far == NONE && self.near == NONE) {
            (true, false) => true,
            (false, true) => false,
            _ => self.depth < other.depth,
        }
    }
}

impl From<(RayPoint, [u32; 2])> for Fragment {
    #[inline(always)]
    fn from((RayPoint { depth, scalar }, [near, far]): (RayPoint, [u32; 2])) -> Self {
        Self { depth, scalar, near, far }
    }
}

/// Depths that differ by less than this may be in the wrong order, of corners at depths up to `furthest`: a view coordinate
/// is a sum of three products of magnitudes up to sqrt(3) times the distance, rounded to 6 2^-53 of that, a depth between
/// three of them to 4 2^-53 more, and there are two depths.
pub(super) fn tie(furthest: f64) -> f64 {
    furthest * (1.0 / (1u64 << 48) as f64)
}

/// Sorts `fragments[sorted..]`, in order of arrival, into the `k` before each: the output order of a buffer of `k` fragments that emits
/// its nearest one per arrival. `fragments[..sorted]` are in order.
#[inline(always)]
pub(super) fn sort_in_window(fragments: &mut [Fragment], sorted: usize, k: usize, tie: f64) {
    for i in sorted..fragments.len() {
        let fragment = fragments[i];
        let mut at = i;
        let first = i.saturating_sub(k);
        while at > first && fragment.is_before(&fragments[at - 1], tie) {
            fragments[at] = fragments[at - 1];
            at -= 1;
        }
        fragments[at] = fragment;
    }
}

/// Sorts all fragments of a ray, given in order of arrival.
pub(super) fn sort_all(fragments: &mut [Fragment], tie: f64) {
    // Stable sort: equal depths stay in order of arrival. Fragments within rounding then swap with their neighbours.
    fragments.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    sort_in_window(fragments, 1.min(fragments.len()), fragments.len(), tie);
}

//! The way of a ray through its fragments.

use super::super::super::medium::RayPoint;
use super::fragment::Fragment;
use crate::mesh::NONE;

/// How far a ray has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    /// The last fragment; at depth -infinity before the first.
    pub(super) last: RayPoint,
    /// The active cell behind the last fragment.
    pub(super) far: u32,
    /// Fragments nearer than one that the ray has passed.
    pub(super) out_of_order: u32,
    /// Whether the ray failed to pass from each cell into the next.
    is_broken: bool,
    /// Whether nothing behind the last fragment is visible.
    pub(super) is_opaque: bool,
}

/// How a ray gets to a fragment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Way {
    /// It does not go there.
    None,
    /// Not through an active cell.
    Gap,
    /// From a point through an active cell.
    Cell(RayPoint, u32),
}

impl Path {
    /// A ray before its first fragment.
    pub(super) const START: Self = Self {
        last: RayPoint { depth: f64::NEG_INFINITY, scalar: 0.0 },
        far: NONE,
        out_of_order: 0,
        is_broken: false,
        is_opaque: false,
    };

    /// Goes on to a fragment, which should not lie in front of the last one; depths closer than `tie` may be in the wrong order.
    #[inline(always)]
    pub(super) fn go_on(&mut self, to: &Fragment, tie: f64) -> Way {
        if to.depth < self.last.depth {
            if to.near != self.far || to.depth < self.last.depth - tie {
                self.out_of_order += 1;
            } else {
                // Ordered by the cell between the two: a segment within rounding has nothing to integrate.
                self.far = to.far;
            }
            return Way::None;
        }
        if self.is_opaque {
            return Way::None;
        }
        self.is_broken |= to.near != self.far;
        let way = if self.far == NONE { Way::Gap } else { Way::Cell(self.last, self.far) };
        (self.last, self.far) = (to.point(), to.far);
        way
    }

    /// Goes on along a run of fragments, each behind the one before.
    #[inline(always)]
    pub(super) fn run(&mut self, to: &Fragment) {
        self.is_broken |= to.near != self.far;
        (self.last, self.far) = (to.point(), to.far);
    }

    /// Whether the finished ray passed from each cell into the next, or became opaque before it failed to.
    pub(super) fn is_whole(&self) -> bool {
        !self.is_broken && (self.is_opaque || self.far == NONE)
    }
}

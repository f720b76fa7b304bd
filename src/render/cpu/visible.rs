//! Where segments become visible.

use crate::optics::Integrator;
use crate::optics::joint::JointSegment;

/// Depth where a segment from one (depth, scalar) place to another becomes visible; infinite if it does not.
#[cold]
#[inline(never)]
pub(super) fn first_visible<I: Integrator>(table: &I, from: (f64, f64), to: (f64, f64)) -> f64 {
    let share = table.clear_share(from.1, to.1);
    if share < 1.0 { from.0 + share * (to.0 - from.0) } else { f64::INFINITY }
}

/// The same for a segment between two depths, from a share of it on.
pub(super) fn first_visible_in_joint_table(segment: &JointSegment, (from, to): (f64, f64), share: f64) -> f64 {
    segment.first_visible(share, 1.0).map_or(f64::INFINITY, |share| from + share * (to - from))
}

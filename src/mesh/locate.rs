//! Which cells are near a point.
//!
//! A linear scan: boxes reject nearly all cells at memory speed (a million take a few milliseconds), and the question
//! is asked once per camera position, not per ray. What it must never do is miss the cell that the eye is in, hence
//! every test errs towards keeping a cell.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{FACE_VERTICES, Mesh};

impl Mesh {
    /// Ids, ascending, of all cells that contain a point or come within `tolerance` of it, both in local units. Some that
    /// are slightly further away may be among them (each is within `tolerance` of the point's side of every plane of its
    /// faces, and of its box), but none is missed. Empty if the point is not finite; a tolerance that is negative or NaN
    /// counts as zero.
    pub fn cells_near(&self, point_local: DVec3, tolerance: f64) -> Vec<u32> {
        if !point_local.is_finite() {
            return Vec::new();
        }
        let tolerance = tolerance.max(0.0);
        let tets = self.topology.tets.par_iter().enumerate();
        let near = tets.filter(|(_, tet)| is_near(self.positions.corners(**tet), point_local, tolerance));
        near.map(|(cell, _)| cell as u32).collect()
    }
}

/// Whether a point may be within `tolerance` of a positively oriented tet; errs towards yes.
fn is_near(corners: [Vec3; 4], point: DVec3, tolerance: f64) -> bool {
    let [a, b, c, d] = corners;
    let (lo, hi) = (a.min(b).min(c).min(d).as_dvec3(), a.max(b).max(c).max(d).as_dvec3());
    // Rounding is monotonic: a difference of at most the tolerance is not rounded to above it.
    let outside_by = (lo - point).max(point - hi).max_element();
    outside_by <= tolerance && FACE_VERTICES.iter().all(|face| !is_beyond(face.map(|i| corners[i]), point, tolerance))
}

/// Whether a point is certainly further than `tolerance` on the outer side of a face's plane.
///
/// With u = 2^-53, each difference of coordinates is off by at most u relative to itself, so a component of the normal
/// n = e x f by at most 4u |e||f| (two differences and one product in each term, one subtraction), n by at most
/// 4 sqrt(3) u |e||f| < 7u |e||f|. Then n . (p - a) is off by at most that times |p - a| and 4u |n||p - a| of its own
/// operations, and tolerance * |n| by at most 7u |e||f| + 4u |n| times the tolerance. Together less than
/// 12u |e||f| (|p - a| + tolerance); 16u also covers the rounding of this bound itself.
fn is_beyond([a, b, c]: [Vec3; 3], point: DVec3, tolerance: f64) -> bool {
    const U16: f64 = 8.0 * f64::EPSILON;
    let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
    let (e, f, to_point) = (b - a, c - a, point - a);
    let normal = e.cross(f);
    let slack = U16 * (e.length() * f.length()) * (to_point.length() + tolerance);
    normal.dot(to_point) > tolerance * normal.length() + slack
}

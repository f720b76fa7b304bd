//! View transform, and the planar geometry of a ray.

use crate::camera::View;
use glam::Vec3;
use rayon::prelude::*;

/// A vertex in view coordinates (local units): x right, y up, w forward, and its scalar.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ViewVertex {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) w: f64,
    pub(super) s: f64,
}

/// Transforms all vertices into the view.
pub(super) fn transform(view: &View, local: &[Vec3], scalars: &[f32], out: &mut Vec<ViewVertex>) {
    local
        .par_iter()
        .zip(scalars)
        .with_min_len(4096)
        .map(|(&p, &s)| {
            let d = p.as_dvec3() - view.eye;
            ViewVertex { x: view.right.dot(d), y: view.up.dot(d), w: view.forward.dot(d), s: f64::from(s) }
        })
        .collect_into_vec(out);
}

/// The ray of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) px: f64,
    pub(super) py: f64,
    pub(super) perspective: bool,
    /// Length of the ray per unit of depth.
    pub(super) length_per_depth: f64,
}

/// A vertex sheared along a ray, which becomes the origin of the plane (x, y).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sheared {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) w: f64,
    pub(super) s: f64,
}

impl Ray {
    pub(super) fn of_pixel(view: &View, i: usize, j: usize) -> Self {
        let (px, py) = view.ray(i, j);
        Self { px, py, perspective: view.perspective, length_per_depth: view.length_per_depth(px, py) }
    }

    #[inline]
    pub(super) fn shear(&self, v: &ViewVertex) -> Sheared {
        let h = if self.perspective { v.w } else { 1.0 };
        Sheared { x: v.x - self.px * h, y: v.y - self.py * h, w: v.w, s: v.s }
    }
}

/// The edge function of two vertices: twice the signed area of the triangle (origin, a, b), positive if b lies
/// counter-clockwise of a seen from the ray. Antisymmetric to the last bit.
#[inline]
pub(super) fn edge(a: &Sheared, b: &Sheared) -> f64 {
    a.x * b.y - b.x * a.y
}

/// How far the sign of an edge function of points with these reaches (|x| + |y|) can be trusted: each of its two products
/// is rounded by at most 2^-53 of itself and so is their difference, and the products are at most the product of the
/// reaches. Twice the bound, and never zero.
#[inline]
pub(super) fn uncertainty(reach_a: f64, reach_b: f64) -> f64 {
    const ROUNDING: f64 = 1.0 / (1u64 << 51) as f64;
    ROUNDING * reach_a * reach_b + f64::MIN_POSITIVE
}

impl Sheared {
    /// |x| + |y|.
    #[inline]
    pub(super) fn reach(&self) -> f64 {
        self.x.abs() + self.y.abs()
    }
}

/// Whether an edge function is positive: exact, never undecided, and antisymmetric.
///
/// What rounding leaves in doubt goes through the exact predicate. A true zero is decided for the ray shifted by (d, d^2),
/// d -> 0: the function gains d (a.y - b.y) + d^2 (b.x - a.x). Where the two vertices coincide in the plane, their ids
/// decide: no triangle with such an edge contains the origin, since its two other edges have opposite signs.
#[inline]
pub(super) fn is_positive(value: f64, a: &Sheared, b: &Sheared, a_id: u32, b_id: u32) -> bool {
    if value.abs() > uncertainty(a.reach(), b.reach()) { value > 0.0 } else { exact_sign(a, b, a_id, b_id) }
}

#[cold]
#[inline(never)]
pub(super) fn exact_sign(a: &Sheared, b: &Sheared, a_id: u32, b_id: u32) -> bool {
    let at = |v: &Sheared| robust::Coord { x: v.x, y: v.y };
    let area = robust::orient2d(robust::Coord { x: 0.0, y: 0.0 }, at(a), at(b));
    if area != 0.0 {
        area > 0.0
    } else if a.y != b.y {
        a.y > b.y
    } else if a.x != b.x {
        b.x > a.x
    } else {
        a_id < b_id
    }
}

/// Depth and scalar where the ray hits a triangle, from its edge functions opposite p, q, r, all of them positive.
///
/// The convex combination keeps the depth within the triangle's; the determinant form does not. The scalar is taken relative
/// to one corner's, so that a constant one stays what it is: it may lie exactly on a step of the table. Values that rounding has
/// made negative count as zero; a triangle of nothing but rounding is hit in its middle.
#[inline]
pub(super) fn hit(e: [f64; 3], p: &Sheared, q: &Sheared, r: &Sheared) -> (f64, f64) {
    let e = [e[0].max(0.0), e[1].max(0.0), e[2].max(0.0)];
    let sum = e[0] + e[1] + e[2];
    let (e, per_sum) = if sum > 0.0 { (e, 1.0 / sum) } else { ([1.0; 3], 1.0 / 3.0) };
    let (wp, wq, wr) = (e[0] * per_sum, e[1] * per_sum, e[2] * per_sum);
    (wp * p.w + wq * q.w + wr * r.w, p.s + wq * (q.s - p.s) + wr * (r.s - p.s))
}

//! The projection of an ellipsoid.
//!
//! An [`Ellipsoid`] is the image of the unit sphere under x -> A x + c, in view coordinates (x right, y up, w forward, eye at the origin):
//! its `center` c, and the rows r_x, r_y, r_w of A. S = A A^T is its covariance up to a factor; the rows are kept instead, since S squares
//! the condition of A. A need not have an inverse.
//!
//! **A ray.** The ray of image-plane point (px, py) becomes the w axis by a shear: r_x - px r_w and r_y - py r_w, likewise for c (in parallel
//! projection c alone is moved). Points of the sphere on the ray satisfy r_x . u = -c_x and r_y . u = -c_y: a line in the sphere's
//! space, along n = r_x x r_y. With w = c_x r_y - c_y r_x its point nearest to the sphere's centre is
//!
//! ```text
//! u = (n x w) / |n|^2,    q = |u|^2 = |w|^2 / |n|^2        (w is at right angles to n)
//! ```
//!
//! and the ray hits iff q <= 1. The middle of the chord is u, at depth c_w + r_w . u, and its length in depth is
//! 2 sqrt(1 - q) |det A| / |n|. n = 0 is an ellipsoid seen edge-on: no hit.
//!
//! **Rounding.** w and n are differences of two products, each rounded by a few units of |r_x| |r_y|: relative to |n| that is a few units
//! times k = |r_x| |r_y| / |n|, the inverse sine of the angle between the rows: less than 8 for q and for the depth of the middle (over
//! |r_w|), slivers of 1e-6 included. The normal equations (B B^T)^-1, and any inverse of A, err by units times k^2: all digits of f32 for
//! cells of 1 : 10^4.
//!
//! **Bounds.** The plane x = t w through the eye touches the ellipsoid iff (c_x - t c_w)^2 = |r_x - t r_w|^2, a quadratic in t. Its
//! discriminant |c_w r_x - c_x r_w|^2 - |r_x x r_w|^2 is negative if the eye is in the shadow along y: every t is hit then. If
//! the plane w = 0 meets the ellipsoid, one of the two planes touches it in front of the eye, and the bounds reach from there to
//! infinity, on the side on which the ellipsoid is at w = 0.
//!
//! **A tet.** [`Ellipsoid::of_tet`] is the ellipsoid of least volume around it (dissertation 3.1.2.2): v_i are the corners of the
//! regular tet in the unit sphere, and A = 3/4 sum_i (p_i - c) v_i^T takes them to the corners p_i about the centroid c, since sum_i v_i v_i^T
//! is 4/3 of the identity. Barycentric coordinates of A u + c are 1/4 + 3/4 v_i . u, also where the tet is flat. |det A| is
//! 27 V / (8 sqrt 3), V the tet's volume.

use crate::camera::View;
use glam::{DMat2, DVec2, DVec3};
use std::ops::{Add, Div, Mul, Sub};

/// Corners of the regular tet in the unit sphere, times sqrt 3.
const CORNERS: [DVec3; 4] =
    [DVec3::new(1.0, 1.0, 1.0), DVec3::new(1.0, -1.0, -1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(-1.0, -1.0, 1.0)];

/// 1 / sqrt 3.
const PER_SQRT_3: f64 = 0.577_350_269_189_625_8;

/// The image of the unit sphere under x -> A x + `center`, in view coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// The centre: x right, y up, w forward.
    pub center: DVec3,
    /// The rows of A: those of x, y and w.
    pub rows: [DVec3; 3],
}

/// The chord of a ray, which is the w axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chord<T> {
    /// Squared distance of the ray from the centre in the space of the unit sphere, at most 1.
    pub q: T,
    /// Depth of the middle.
    pub middle: T,
    /// The middle in the space of the unit sphere.
    pub at: [T; 3],
    /// |n|: the area of the ellipsoid's section across the ray, over pi.
    pub area: T,
}

/// A real number: f64, or f32 as on the GPU.
pub trait Real:
    Copy + PartialOrd + Default + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// 1.
    const ONE: Self;

    /// The square root.
    #[must_use]
    fn sqrt(self) -> Self;
}

impl Real for f32 {
    const ONE: Self = 1.0;

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
}

impl Real for f64 {
    const ONE: Self = 1.0;

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
}

#[inline(always)]
fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl<T: Real> Chord<T> {
    /// The chord of the w axis in an ellipsoid with these rows and this centre; `None` if it misses.
    #[inline(always)]
    pub fn of(rows: [[T; 3]; 3], center: [T; 3]) -> Option<Self> {
        let [rx, ry, rw] = rows;
        let n = cross(rx, ry);
        let w = [0, 1, 2].map(|i| center[0] * ry[i] - center[1] * rx[i]);
        let (n2, w2) = (dot(n, n), dot(w, w));
        // False for n = 0, and for NaN.
        if !(w2 <= n2 && n2 > T::default()) {
            return None;
        }
        let at = cross(n, w).map(|u| u / n2);
        Some(Self { q: w2 / n2, middle: center[2] + dot(rw, at), at, area: n2.sqrt() })
    }

    /// Half of its length in depth in an ellipsoid with this |det A|.
    #[inline(always)]
    pub fn half_depth(&self, det: T) -> T {
        (T::ONE - self.q).sqrt() * det / self.area
    }
}

/// A section of an ellipsoid: the points p of a plane with (p - center)^T matrix (p - center) <= level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conic {
    /// The centre.
    pub center: DVec2,
    /// The matrix: the same for all depths.
    pub matrix: DMat2,
    /// The level: negative where the plane misses.
    pub level: f64,
}

impl Ellipsoid {
    /// The ellipsoid of least volume around a tet with these corners.
    pub fn of_tet(corners: [DVec3; 4]) -> Self {
        let center = 0.25 * ((corners[0] + corners[1]) + (corners[2] + corners[3]));
        let row = |axis: usize| {
            let terms = corners.iter().zip(CORNERS).map(|(p, v)| (p[axis] - center[axis]) * v);
            0.75 * PER_SQRT_3 * terms.sum::<DVec3>()
        };
        Self { center, rows: [row(0), row(1), row(2)] }
    }

    /// The ball of this radius.
    pub fn ball(center: DVec3, radius: f64) -> Self {
        Self { center, rows: [DVec3::X * radius, DVec3::Y * radius, DVec3::Z * radius] }
    }

    /// The ellipsoid scaled about its centre.
    #[must_use]
    pub fn scaled(self, by: f64) -> Self {
        Self { rows: self.rows.map(|row| by * row), ..self }
    }

    /// |det A|.
    pub fn det(&self) -> f64 {
        let [x, y, w] = self.rows;
        x.cross(y).dot(w).abs()
    }

    /// Rows and centre after the shear that makes the ray of an image-plane point the w axis.
    #[inline(always)]
    pub fn sheared(&self, perspective: bool, (px, py): (f64, f64)) -> ([[f64; 3]; 3], [f64; 3]) {
        let ([x, y, w], c) = (self.rows, self.center);
        if perspective {
            let rows = [x - px * w, y - py * w, w].map(|row| row.to_array());
            (rows, [c.x - px * c.z, c.y - py * c.z, c.z])
        } else {
            ([x, y, w].map(|row| row.to_array()), [c.x - px, c.y - py, c.z])
        }
    }

    /// The chord of the ray (the line, also behind the eye) of an image-plane point; `None` if it misses.
    #[inline(always)]
    pub fn chord(&self, perspective: bool, at: (f64, f64)) -> Option<Chord<f64>> {
        let (rows, center) = self.sheared(perspective, at);
        Chord::of(rows, center)
    }

    /// Least and greatest x and y, in this order, of the image-plane points whose rays meet it in front of the eye, infinite where it
    /// reaches around the eye; `None` if all of it is behind the eye. Exact up to rounding.
    pub fn bounds(&self, perspective: bool) -> Option<[[f64; 2]; 2]> {
        let ([x, y, w], c) = (self.rows, self.center);
        if perspective {
            Some([shadow(x, w, c.x, c.z)?, shadow(y, w, c.y, c.z)?])
        } else {
            Some([[c.x - x.length(), c.x + x.length()], [c.y - y.length(), c.y + y.length()]])
        }
    }

    /// Its section at a depth, in view coordinates. Needs an inverse of A: not for flat ones.
    pub fn section(&self, depth: f64) -> Conic {
        let ([x, y, w], c) = (self.rows, self.center);
        let (xw, yw, det, beyond) = (x.cross(w), y.cross(w), self.det(), depth - c.z);
        let off = -xw.dot(yw);
        let matrix =
            DMat2::from_cols_array(&[yw.length_squared(), off, off, xw.length_squared()]) * (1.0 / (det * det));
        let per_ww = 1.0 / w.length_squared();
        let center = DVec2::new(c.x, c.y) + DVec2::new(x.dot(w), y.dot(w)) * (per_ww * beyond);
        Conic { center, matrix, level: 1.0 - beyond * beyond * per_ww }
    }

    /// J S J^T, with J the derivative of the projection to the image plane at the centre, which is in front of the eye.
    pub fn spread(&self, perspective: bool) -> DMat2 {
        let [x, y] = self.on_plane(perspective);
        DMat2::from_cols_array(&[x.dot(x), x.dot(y), x.dot(y), y.dot(y)])
    }

    /// J A: the rows on the image plane at the centre.
    fn on_plane(&self, perspective: bool) -> [DVec3; 2] {
        let ([x, y, w], c) = (self.rows, self.center);
        if perspective { [(x - c.x / c.z * w) / c.z, (y - c.y / c.z * w) / c.z] } else { [x, y] }
    }

    /// The ellipsoid widened across the ray of its centre so that both half axes of its projection are at least `least`, an image-plane
    /// length; `None` if they are, or if the centre is not in front of the eye.
    #[must_use]
    pub fn widened(&self, perspective: bool, least: f64) -> Option<Self> {
        if perspective && self.center.z <= 0.0 {
            return None;
        }
        let [x, y] = self.on_plane(perspective);
        let (xx, xy, yy) = (x.dot(x), x.dot(y), y.dot(y));
        // The rotation that makes the rows orthogonal (one of Jacobi's): the first is the longer one.
        let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
        let (long, short) = (cos * x + sin * y, cos * y - sin * x);
        if short.length() >= least {
            return None;
        }
        let wide_long = if long.length() >= least { long } else { unit_or(long, DVec3::X) * least };
        let along = wide_long.normalize_or_zero();
        // A flat ellipsoid's short row is rounding, of any direction.
        let wide_short = unit_or(short - short.dot(along) * along, along.any_orthonormal_vector()) * least;
        let (dx, dy) = (wide_long - long, wide_short - short);
        let per_plane = if perspective { self.center.z } else { 1.0 };
        let [rx, ry, rw] = self.rows;
        Some(Self {
            rows: [rx + per_plane * (cos * dx - sin * dy), ry + per_plane * (sin * dx + cos * dy), rw],
            ..*self
        })
    }
}

/// The direction of a vector, or `other` for one of no length.
fn unit_or(v: DVec3, other: DVec3) -> DVec3 {
    v.try_normalize().unwrap_or(other)
}

/// Barycentric coordinates in a tet of a point `at` in the unit sphere of its [`Ellipsoid::of_tet`].
#[inline(always)]
pub fn weights_in_tet(at: [f64; 3]) -> [f64; 4] {
    let at = DVec3::from_array(at);
    CORNERS.map(|v| 0.25 + 0.75 * PER_SQRT_3 * v.dot(at))
}

/// Half an image pixel as an image-plane length.
pub fn half_pixel(view: &View) -> f64 {
    view.half_height / view.height_px as f64
}

/// Least and greatest x / w of the points with w > 0 of an ellipsoid with rows `x` and `w` about (`cx`, `cw`); `None` without such
/// points.
fn shadow(x: DVec3, w: DVec3, cx: f64, cw: f64) -> Option<[f64; 2]> {
    let half = w.length();
    // Not behind for NaN: bounds then are without end.
    if cw + half <= 0.0 {
        return None;
    }
    let everywhere = Some([f64::NEG_INFINITY, f64::INFINITY]);
    let (a, b, c) = ((cw - half) * (cw + half), cx * cw - x.dot(w), (cx - x.length()) * (cx + x.length()));
    let discriminant = (cw * x - cx * w).length_squared() - x.cross(w).length_squared();
    let root = discriminant.sqrt();
    // Negative, or NaN.
    if root.is_nan() {
        return everywhere;
    }
    if a > 0.0 {
        return Some([(b - root) / a, (b + root) / a]);
    }
    let sum = b + root.copysign(b);
    let is_in_front = |t: &f64| {
        let across = x - *t * w;
        cw - w.dot(across) * (cx - *t * cw) / across.length_squared() > 0.0
    };
    let Some(end) = [sum / a, c / sum].into_iter().find(is_in_front) else { return everywhere };
    let at_eye = cx - cw * x.dot(w) / w.length_squared();
    Some(if at_eye > 0.0 { [end, f64::INFINITY] } else { [f64::NEG_INFINITY, end] })
}

#[cfg(test)]
#[path = "ellipsoid_tests.rs"]
mod tests;

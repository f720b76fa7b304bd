//! Gradients of scalars that are linear within each cell.
//!
//! With edges a, b, c from one vertex of a cell to the others and the differences s of their scalars, the gradient is
//!
//! ```text
//! g = (s_a b x c + s_b c x a + s_c a x b) / det(a, b, c)
//! ```
//!
//! Slivers make numerator and determinant small beside their terms, so that rounding may dominate. Both are therefore computed with a bound
//! of their error, which has to be below [`TOLERANCE`] of them: first in f64, then in double-word arithmetic. Cells that fail there too
//! have no gradient.
//!
//! The bound: each component of the numerator, and the determinant, is a sum of products of three factors. Each product meets at most 8
//! roundings on its way into the sum: of the factors (3), the multiplications (2), the difference of two in a cross product (1) and the sum
//! of three (2). The magnitudes of all products add up to at most the product of the factors' sums |x| + |y| + |z|, since they are some of
//! its terms.

use super::Mesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::{Add, Mul, Sub};

/// Relative error that numerator and determinant may have. The quotient is then within 2^-25, and the result, rounded to f32,
/// within 1.5 * 2^-24.
const TOLERANCE: f64 = 1.0 / (1 << 26) as f64;

/// Cells per task; their part of the mesh is some hundred KB.
const CHUNK: usize = 8192;

impl Mesh {
    /// Magnitude of the gradient of the scalar in a cell, in units of the scalar per world length; `scalars` has one per vertex. The
    /// relative error is below 2^-23 in the normal range of f32; beyond it, infinity. A constant has exactly 0. NaN if a scalar is not
    /// finite, or the cell is too flat for double-word arithmetic.
    ///
    /// # Panics
    /// If there is no such cell, or a vertex of it has no scalar.
    pub fn gradient_magnitude(&self, cell: usize, scalars: &[f32]) -> f32 {
        let [a, b, c, d] = self.topology.tets[cell];
        let (corner, scalar) = (|v: u32| self.positions.local[v as usize], |v: u32| scalars[v as usize]);
        let corners = [corner(a), corner(b), corner(c), corner(d)];
        let local = tet_gradient_magnitude(corners, [scalar(a), scalar(b), scalar(c), scalar(d)]);
        (local / self.positions.scale) as f32
    }

    /// [`Self::gradient_magnitude`] of every cell into `out`, the same for any number of threads. Returns how many are NaN.
    ///
    /// # Panics
    /// If there is not one scalar per vertex and one slot of `out` per cell.
    pub fn gradient_magnitudes(&self, scalars: &[f32], out: &mut [f32]) -> usize {
        assert_eq!(scalars.len(), self.vertex_source.len(), "one scalar a vertex");
        assert_eq!(out.len(), self.topology.tets.len(), "one place a cell");
        let fill = |(chunk, out): (usize, &mut [f32])| {
            out.iter_mut().zip(chunk * CHUNK..).for_each(|(out, cell)| *out = self.gradient_magnitude(cell, scalars));
            out.iter().filter(|g| g.is_nan()).count()
        };
        out.par_chunks_mut(CHUNK).enumerate().map(fill).sum()
    }
}

/// Magnitude of the gradient in a tet, like [`Mesh::gradient_magnitude`], for lengths in the units of the corners.
pub fn tet_gradient_magnitude(corners: [Vec3; 4], scalars: [f32; 4]) -> f64 {
    quotient(corners, scalars).map_or(f64::NAN, |Quotient { numerator, determinant }| {
        let [x, y, z] = numerator;
        (x * x + y * y + z * z).sqrt() / determinant.abs()
    })
}

/// Gradient in a tet, in units of the scalar per unit of the corners: each component is within 2^-24 of the gradient's length. `None` if a
/// scalar is not finite, or the tet is too flat for double-word arithmetic.
pub fn tet_gradient(corners: [Vec3; 4], scalars: [f32; 4]) -> Option<DVec3> {
    let Quotient { numerator, determinant } = quotient(corners, scalars)?;
    Some(DVec3::from(numerator) / determinant)
}

/// The gradient as a quotient; `None` if a scalar is not finite, or the tet is too flat.
fn quotient(corners: [Vec3; 4], scalars: [f32; 4]) -> Option<Quotient> {
    let is_finite = scalars.iter().all(|s| s.is_finite());
    is_finite.then(|| bounded::<f64>(corners, scalars).or_else(|| of_sliver(corners, scalars))).flatten()
}

/// Rare, and kept apart from the f64 code.
#[cold]
#[inline(never)]
fn of_sliver(corners: [Vec3; 4], scalars: [f32; 4]) -> Option<Quotient> {
    bounded::<Double>(corners, scalars)
}

/// The gradient as numerator and determinant.
struct Quotient {
    numerator: [f64; 3],
    determinant: f64,
}

/// Number type of the computation.
trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Bound of the relative error of a product after eight roundings.
    const EIGHT_ROUNDINGS: f64;
    fn difference(a: f32, b: f32) -> Self;
    fn value(self) -> f64;
}

/// The gradient, if its error is within the tolerance. No product of three differences of f32 leaves the range of f64, nor does the square
/// of one.
fn bounded<N: Number>(corners: [Vec3; 4], scalars: [f32; 4]) -> Option<Quotient> {
    let [o, p, q, r] = corners;
    let edge = |p: Vec3| [N::difference(p.x, o.x), N::difference(p.y, o.y), N::difference(p.z, o.z)];
    let (a, b, c) = (edge(p), edge(q), edge(r));
    let rise = |i: usize| N::difference(scalars[i], scalars[0]);
    let (ra, rb, rc) = (rise(1), rise(2), rise(3));
    let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
    let determinant = (a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2]).value();
    let along = |i: usize| (ra * bc[i] + rb * ca[i] + rc * ab[i]).value();
    let (x, y, z) = (along(0), along(1), along(2));
    let length = (x * x + y * y + z * z).sqrt();

    let size = |e: [N; 3]| e[0].value().abs() + e[1].value().abs() + e[2].value().abs();
    let (la, lb, lc) = (size(a), size(b), size(c));
    let (ra, rb, rc) = (ra.value().abs(), rb.value().abs(), rc.value().abs());
    let most = N::EIGHT_ROUNDINGS / TOLERANCE;
    let is_sure =
        most * (la * lb * lc) <= determinant.abs() && most * (ra * lb * lc + rb * lc * la + rc * la * lb) <= length;
    (is_sure && determinant != 0.0).then_some(Quotient { numerator: [x, y, z], determinant })
}

fn cross<N: Number>(a: [N; 3], b: [N; 3]) -> [N; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Number for f64 {
    /// Eight of 2^-53 each, and 2 more for their products and the rounding of the bound itself.
    const EIGHT_ROUNDINGS: f64 = 10.0 * 0.5 * f64::EPSILON;

    fn difference(a: f32, b: f32) -> Self {
        Self::from(a) - Self::from(b)
    }

    fn value(self) -> f64 {
        self
    }
}

/// A sum of two f64 of which the second is at most half an ulp of the first: twice the precision (T. J. Dekker 1971; the bounds
/// are those of M. Joldes, J.-M. Muller, V. Popescu, "Tight and rigorous error bounds for basic building blocks of double-word
/// arithmetic", ACM TOMS 44, 2017).
#[derive(Clone, Copy)]
struct Double(f64, f64);

impl Double {
    /// a + b without error (D. E. Knuth, TwoSum).
    fn sum(a: f64, b: f64) -> Self {
        let sum = a + b;
        let b_part = sum - a;
        Self(sum, (a - (sum - b_part)) + (b - b_part))
    }

    /// [`Self::sum`] for |a| >= |b|.
    fn ordered_sum(a: f64, b: f64) -> Self {
        let sum = a + b;
        Self(sum, b - (sum - a))
    }
}

impl Number for Double {
    /// A sum has a relative error of at most 3 * 2^-106, a product of 5 * 2^-106: eight are below 2^-100.
    const EIGHT_ROUNDINGS: f64 = 1.0 / (1_u128 << 100) as f64;

    fn difference(a: f32, b: f32) -> Self {
        Self::sum(f64::from(a), -f64::from(b))
    }

    fn value(self) -> f64 {
        self.0
    }
}

impl Add for Double {
    type Output = Self;

    /// Algorithm 6 of the paper.
    fn add(self, other: Self) -> Self {
        let (high, low) = (Self::sum(self.0, other.0), Self::sum(self.1, other.1));
        let first = Self::ordered_sum(high.0, high.1 + low.0);
        Self::ordered_sum(first.0, first.1 + low.1)
    }
}

impl Sub for Double {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + Self(-other.0, -other.1)
    }
}

impl Mul for Double {
    type Output = Self;

    /// Algorithm 12 of the paper.
    fn mul(self, other: Self) -> Self {
        let high = self.0 * other.0;
        let error = self.0.mul_add(other.0, -high);
        let low = self.1.mul_add(other.0, self.0.mul_add(other.1, self.1 * other.1));
        Self::ordered_sum(high, error + low)
    }
}

//! The mean transmittance of a piece on which extinction is linear, for [`weights`](super::weights): M = integral over [0,1] of
//! exp(-Theta(u)) du with Theta(u) = a0 u + (a1 - a0) u^2 / 2, x = Theta(1) > 1/4.
//!
//! 1. x <= [`RULE_MAX`]: seven-point Gauss-Legendre. Within the ellipse around [0, 1] with semi-axes that sum to rho / 2 the integrand is at
//!    most exp(x ((1 + (rho + 1 / rho) / 2)^2 / 4 - 1)): its exponent is linear in (a1 - a0) / x, hence greatest where a1 = 0. The rule
//!    is off by 32 / 15 of that times rho^-14 / (1 - rho^-2), which is 8e-8 at rho = 6 and x = 5/2.
//! 2. else, extinction rises: completing the square, with b = |a1 - a0| / 2, p = a0 / (2 sqrt b) and q = a1 / (2 sqrt b),
//!
//!    ```text
//!    M = (E(p) - exp(-x) E(q)) / sqrt b,    E(z) = exp(z^2) integral from z to infinity of exp(-t^2) dt
//!    ```
//!
//! E(z) (1 + z / 2) is smooth in t = 1 / (1 + z / 2) on [0, 1]: a polynomial of degree 10. Its arguments, t and 1 / (sqrt b + a / 4), stay
//! finite where b is zero, and the latter is 1 / a there.
//! 3. else it falls, and
//!
//!    ```text
//!    M = (D(p) - exp(-x) D(q)) / sqrt b,    D(z) = exp(-z^2) integral from 0 to z of exp(t^2) dt
//!    ```
//!
//!    with Dawson's function. D(z) (1 + z^2 / 2) / z is a quotient of polynomials in v = 1 / (1 + z^2 / 2), and
//!    D / sqrt b = 4 a / (8 b + a^2) times it: no square root.
//!
//! Nothing cancels in the differences beyond x = 5/2, where exp(-x) is below 0.083. The coefficients (fitted in f64 for the least largest
//! relative error, then rounded) leave errors of 4e-8 of E and 1.6e-7 of D; with all roundings both are within 3.5e-7 and 5e-7 of their
//! integrals, as a test checks. The first terms are at most 0.886 / sqrt(5/2) and 0.541 / sqrt(5/2), the second ones a twelfth of them;
//! with two roundings more, of b and of the difference, M is off by 2.7e-7 at most.
//!
//! Below x = 5/2 the differences lose digits, 2.1 of them at 1/4 (Dawson's function from 3/2 on leaves M off by
//! 3.4e-7 instead of 1.9e-7), and the power series of the thin pieces needs too many terms.
//!
//! The same function serves one piece and many side by side: there are no branches, so that loops over it are vectorized, and unwanted
//! results (also quotients without a value) are not selected. All operations are rounded alike everywhere; none is contracted.

/// Largest optical depth for which the rule is used.
pub(super) const RULE_MAX: f32 = 2.5;
/// Larger depths are capped to this: M changes by less than 1e-9, and its square is finite.
const END_MAX: f32 = 1e18;
/// Beyond this exp(-x) is not a normal number.
const EXP_MAX: f32 = 87.0;

/// exp(-x) for -80 <= x, to 2e-7 of it; 1.7e-38 from 87 on. As `exp_neg` in `shaders/lib/math.wgsl`.
///
/// x is k ln 2 - y with |y| <= 0.35. The Taylor polynomial of degree 7 leaves out 0.35^8 / 40320 = 6e-9; Horner's last two steps round by
/// 2^-24 each, and those before by as much in sum, since |y| is small.
#[inline(always)]
pub(crate) fn exp_neg(x: f32) -> f32 {
    // 1.5 * 2^23: a sum with it has no fraction bits, and its last bits are the integer.
    const TO_INTEGER: f32 = 12_582_912.0;
    let x = if x < EXP_MAX { x } else { EXP_MAX };
    let shifted = x * std::f32::consts::LOG2_E + TO_INTEGER;
    let k = shifted - TO_INTEGER;
    // ln 2 in two parts, the first of 9 bits: k times it is exact.
    let y = (k * (355.0 / 512.0) - x) + k * -2.121_944_4e-4;
    let tail = 1.0 / 24.0 + y * (1.0 / 120.0 + y * (1.0 / 720.0 + y * (1.0 / 5040.0)));
    let p = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * tail)));
    let exponent = (TO_INTEGER.to_bits() + 127).wrapping_sub(shifted.to_bits());
    p * f32::from_bits(exponent << 23)
}

/// Seven-point Gauss-Legendre on [0, 1]: abscissae and weights.
const RULE: [(f32, f32); 7] = [
    (0.025_446_044, 0.064_742_48),
    (0.129_234_4, 0.139_852_7),
    (0.297_077_42, 0.190_915_02),
    (0.5, 0.208_979_6),
    (0.702_922_6, 0.190_915_02),
    (0.870_765_57, 0.139_852_7),
    (0.974_553_94, 0.064_742_48),
];

/// M by the rule, for depths up to [`RULE_MAX`].
#[inline(always)]
pub(super) fn mean_by_rule(a0: f32, a1: f32) -> f32 {
    let b = 0.5 * (a1 - a0);
    let mut mean = 0.0;
    for (u, weight) in RULE {
        mean += weight * exp_neg(u * (a0 + b * u));
    }
    mean
}

/// Coefficients of E(z) (1 + z / 2) as a polynomial in 2 t - 1.
const E: [f32; 11] = [
    0.452_677_04,
    0.304_490_12,
    0.123_837_57,
    0.016_148_534,
    -0.009_528_381,
    -0.002_874_434_5,
    0.001_355_180_3,
    0.000_381_671_8,
    -0.000_265_321_02,
    -3.243_757e-5,
    3.736_439e-5,
];

/// M where extinction rises or is constant; `through` is exp(-x).
#[inline(always)]
pub(super) fn mean_of_rise(a0: f32, a1: f32, through: f32) -> f32 {
    let (a0, a1) = (at_most(a0, END_MAX), at_most(a1, END_MAX));
    let root = (0.5 * (a1 - a0)).sqrt();
    behind_rise(root, a0) - through * behind_rise(root, a1)
}

/// E(z) / root, the mean transmittance if extinction continued to rise from `a`.
#[inline(always)]
fn behind_rise(root: f32, a: f32) -> f32 {
    let per = 1.0 / (root + 0.25 * a);
    horner(&E, 2.0 * (root * per) - 1.0) * per
}

/// Coefficients of D(z) (1 + z^2 / 2) / z as a quotient of polynomials in v.
const D: [f32; 8] = [0.249_999_97, -1.437_773, 9.257_574, -11.419_598, 57.154_068, 111.841_33, -94.946_94, 1_638.391_7];
const PER_D: [f32; 9] =
    [1.0, -7.001_166_3, 44.104_385, -92.071_71, 296.275_12, -46.030_792, 637.145_3, 488.144_68, 387.524_7];

/// M where extinction falls or is constant; `through` is exp(-x).
#[inline(always)]
pub(super) fn mean_of_fall(a0: f32, a1: f32, through: f32) -> f32 {
    let (a0, a1) = (at_most(a0, END_MAX), at_most(a1, END_MAX));
    let slope = 4.0 * (a0 - a1);
    behind_fall(slope, a0) - through * behind_fall(slope, a1)
}

/// D(z) / sqrt b, with 8 b as `slope`.
#[inline(always)]
fn behind_fall(slope: f32, a: f32) -> f32 {
    let per = 1.0 / (slope + a * a);
    let v = slope * per;
    4.0 * a * per * (horner(&D, v) / horner(&PER_D, v))
}

#[inline(always)]
fn horner<const N: usize>(coefficients: &[f32; N], x: f32) -> f32 {
    let mut sum = coefficients[N - 1];
    for i in (0..N - 1).rev() {
        sum = sum * x + coefficients[i];
    }
    sum
}

/// The lesser of both; `most` if `x` is NaN.
#[inline(always)]
fn at_most(x: f32, most: f32) -> f32 {
    if x < most { x } else { most }
}

#[cfg(test)]
#[path = "thick_tests.rs"]
mod tests;

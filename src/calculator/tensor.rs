//! Invariants of tensors. The components of a tuple are in VTK's order: XX YY ZZ XY YZ XZ of a symmetric tensor, else row by row.

/// The symmetric part: XX, YY, ZZ, XY, YZ, XZ. `None` unless there are 6 or 9 components.
fn symmetric(t: &[f64]) -> Option<[f64; 6]> {
    match *t {
        [xx, yy, zz, xy, yz, xz] => Some([xx, yy, zz, xy, yz, xz]),
        [xx, xy, xz, yx, yy, yz, zx, zy, zz] => Some([xx, yy, zz, 0.5 * (xy + yx), 0.5 * (yz + zy), 0.5 * (xz + zx)]),
        _ => None,
    }
}

/// Von Mises' equivalent of a stress: sqrt(((xx - yy)^2 + (yy - zz)^2 + (zz - xx)^2) / 2 + 3 (xy^2 + yz^2 + xz^2)), of the symmetric part.
pub(super) fn mises(t: &[f64]) -> f64 {
    let Some([xx, yy, zz, xy, yz, xz]) = symmetric(t) else { return f64::NAN };
    let (a, b, c) = (xx - yy, yy - zz, zz - xx);
    (0.5 * (a * a + b * b + c * c) + 3.0 * (xy * xy + yz * yz + xz * xz)).sqrt()
}

/// Sum of the diagonal.
pub(super) fn trace(t: &[f64]) -> f64 {
    match *t {
        [xx, yy, zz, _, _, _] => xx + yy + zz,
        [xx, _, _, _, yy, _, _, _, zz] => xx + yy + zz,
        _ => f64::NAN,
    }
}

/// Determinant.
pub(super) fn determinant(t: &[f64]) -> f64 {
    let of = |[a, b, c, d, e, f, g, h, i]: [f64; 9]| a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    match *t {
        [xx, yy, zz, xy, yz, xz] => of([xx, xy, xz, xy, yy, yz, xz, yz, zz]),
        [a, b, c, d, e, f, g, h, i] => of([a, b, c, d, e, f, g, h, i]),
        _ => f64::NAN,
    }
}

/// Most sweeps of [`principal`]: convergence is quadratic, and five suffice for any matrix of f64.
const SWEEPS: usize = 12;

/// Eigenvalues of the symmetric part, the greatest first, by Jacobi's rotations: errors are some roundings of the greatest in magnitude.
/// NaN if a component is not finite.
pub(super) fn principal(t: &[f64]) -> [f64; 3] {
    let Some([xx, yy, zz, xy, yz, xz]) = symmetric(t) else { return [f64::NAN; 3] };
    let mut m = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    if m.iter().flatten().any(|v| !v.is_finite()) {
        return [f64::NAN; 3];
    }
    for _ in 0..SWEEPS {
        if m[0][1] == 0.0 && m[0][2] == 0.0 && m[1][2] == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut m, p, q);
        }
    }
    let mut values = [m[0][0], m[1][1], m[2][2]];
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// Turns the axes p and q so that the element between them becomes 0.
fn rotate(m: &mut [[f64; 3]; 3], p: usize, q: usize) {
    let between = m[p][q];
    if between == 0.0 {
        return;
    }
    let theta = (m[q][q] - m[p][p]) / (2.0 * between);
    // The smaller root of t^2 + 2 theta t - 1; theta may be infinite, and t then 0.
    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let c = 1.0 / t.hypot(1.0);
    let s = t * c;
    let r = 3 - p - q;
    m[p][p] -= t * between;
    m[q][q] += t * between;
    let (rp, rq) = (m[r][p], m[r][q]);
    (m[p][q], m[q][p]) = (0.0, 0.0);
    (m[r][p], m[p][r]) = (c * rp - s * rq, c * rp - s * rq);
    (m[r][q], m[q][r]) = (s * rp + c * rq, s * rp + c * rq);
}

/// Twice the antisymmetric part of a gradient (rows are components, columns directions) as a vector: the curl.
pub(super) fn curl(g: &[f64]) -> [f64; 3] {
    match *g {
        [_, xy, xz, yx, _, yz, zx, zy, _] => [zy - yz, xz - zx, yx - xy],
        _ => [f64::NAN; 3],
    }
}

/// Q = (|rotation|^2 - |strain|^2) / 2 of a gradient (J. Hunt, A. Wray, P. Moin 1988), which is -tr(g g) / 2.
pub(super) fn q_criterion(g: &[f64]) -> f64 {
    match *g {
        [xx, xy, xz, yx, yy, yz, zx, zy, zz] => -0.5 * (xx * xx + yy * yy + zz * zz) - (xy * yx + xz * zx + yz * zy),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariants_of_known_stresses() {
        // Uniaxial tension, pure shear, pressure.
        assert_eq!(mises(&[5.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 5.0);
        assert!((mises(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]) - 2.0 * 3f64.sqrt()).abs() < 1e-15);
        assert_eq!(mises(&[7.0, 7.0, 7.0, 0.0, 0.0, 0.0]), 0.0);
        // A matrix with the eigenvalues 1, 2 and 4: 2 + sqrt 2 and the like are avoided.
        let t = [2.0, 2.0, 3.0, 0.0, 1.0, 1.0];
        let full = [2.0, 0.0, 1.0, 0.0, 2.0, 1.0, 1.0, 1.0, 3.0];
        for t in [&t[..], &full] {
            let [a, b, c] = principal(t);
            assert!((a - 4.0).abs() + (b - 2.0).abs() + (c - 1.0).abs() < 1e-14, "{a} {b} {c}");
            assert!((determinant(t) - 8.0).abs() < 1e-14);
            assert_eq!(trace(t), 7.0);
            let by_principal = 0.5 * ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2));
            assert!((mises(t) - by_principal.sqrt()).abs() < 1e-14);
        }
        // Only the symmetric part counts, but for the determinant.
        let skew = [2.0, 1.0, 1.0, -1.0, 2.0, 1.0, 1.0, 1.0, 3.0];
        assert_eq!((mises(&skew), principal(&skew)), (mises(&full), principal(&full)));
        assert!((determinant(&skew) - 11.0).abs() < 1e-14);
    }

    #[test]
    fn eigenvalues_are_right_whatever_the_scale_and_however_close_they_are() {
        // T has the eigenvalues d, turned by a rotation about (1, 1, 1); a check by the invariants is independent of the rotations.
        for d in [[3.0, 2.0, 1.0], [1.0, 1.0, 1.0 - 1e-12], [1e150, 1.0, -1e150], [1e-160, 0.0, -1e-160], [0.0; 3]] {
            let (c, s) = (-1.0 / 3.0, 2.0 / 3.0);
            let r = [[c, s, s], [s, c, s], [s, s, c]];
            let entry = |i: usize, j: usize| (0..3).map(|k| r[i][k] * d[k] * r[j][k]).sum::<f64>();
            let t = [entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(1, 2), entry(0, 2)];
            let most = d.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            for (found, expected) in principal(&t).iter().zip(d) {
                assert!((found - expected).abs() <= 1e-15 * 8.0 * most, "{d:?}: {:?}", principal(&t));
            }
        }
        assert!(principal(&[f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0])[0].is_nan());
        assert!(principal(&[1.0, 2.0]).iter().all(|v| v.is_nan()));
    }

    #[test]
    fn a_rotation_has_its_curl_and_q_and_a_shear_has_no_q() {
        // u = w x r with w = (1, 2, 3).
        let g = [0.0, -3.0, 2.0, 3.0, 0.0, -1.0, -2.0, 1.0, 0.0];
        assert_eq!(curl(&g), [2.0, 4.0, 6.0]);
        assert_eq!(q_criterion(&g), 14.0);
        let shear = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!((q_criterion(&shear), curl(&shear)), (0.0, [0.0, 0.0, -1.0]));
        assert_eq!(trace(&[1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0]), 6.0, "the divergence");
    }
}

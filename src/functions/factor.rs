//! L of S = L L^T: how wide functions are.

use crate::mesh::Symmetric;

/// Share of the trace of S that is added in every direction.
const THICKEN: f64 = 1e-6;

/// L of L L^T = width^2 times a mean of e e^T, thickened: rows of the lower triangle.
pub(super) fn factor(&[xx, xy, xz, yy, yz, zz]: &Symmetric, width: f64) -> [f32; 6] {
    let more = THICKEN * (xx + yy + zz);
    let (xx, yy, zz) = (xx + more, yy + more, zz + more);
    let l00 = xx.sqrt();
    let per = if l00 > 0.0 { 1.0 / l00 } else { 0.0 };
    let (l10, l20) = (xy * per, xz * per);
    // At least what thickening adds, whatever rounding leaves.
    let rest = |of: f64| of.max(0.5 * more).sqrt();
    let l11 = rest(yy - l10 * l10);
    let l21 = if l11 > 0.0 { (yz - l20 * l10) / l11 } else { 0.0 };
    let l22 = rest(zz - l20 * l20 - l21 * l21);
    [l00, l10, l11, l20, l21, l22].map(|l| (width * l) as f32)
}

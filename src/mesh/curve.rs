//! Order along a 3-D Hilbert curve: what is near in space is near in memory.
//!
//! The index follows J. Skilling, "Programming the Hilbert curve", AIP Conference Proceedings 707 (2004), 381-387:
//! undo the rotations from the coarsest bit down, then Gray-encode; the result is the index with its bits dealt out to
//! the three axes in turn. About 60 branch-poor steps a point, no table.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Bits of the index per axis: 3 * 21 = 63 fit a u64, and 2^-20 of the box is finer than a cell of any mesh of fewer
/// than 2^30 roughly equal cells. What falls together is ordered by source index.
const BITS: u32 = 21;

/// A place along the curve, and the index of what lies there. Tuples are unique, so that an unstable sort is
/// deterministic.
pub(super) type CurveKey = (u64, u32);

/// The curve index of a local position in [-1, 1]^3.
pub(super) fn curve_index(local: DVec3) -> u64 {
    let steps = f64::from(1u32 << BITS);
    // Saturating casts: +1 falls into the last step, and nothing else can leave the range.
    let step = |x: f64| (((x + 1.0) * 0.5 * steps) as u32).min((1 << BITS) - 1);
    hilbert([step(local.x), step(local.y), step(local.z)], BITS)
}

/// The curve index of a cell's centroid. The vertices are summed in ascending order, so that cells of the same
/// vertices have the same index whatever their winding.
pub(super) fn cell_curve_index(tet: [u32; 4], local: &[Vec3]) -> u64 {
    let sum: DVec3 = ascending(tet).iter().map(|&v| local[v as usize].as_dvec3()).sum();
    curve_index(0.25 * sum)
}

/// The vertices of a cell in ascending order.
pub(super) fn ascending(mut tet: [u32; 4]) -> [u32; 4] {
    tet.sort_unstable();
    tet
}

/// Sorts along the curve, ties by index.
pub(super) fn sort_along_curve(mut keys: Vec<CurveKey>) -> Vec<CurveKey> {
    keys.par_sort_unstable();
    keys
}

/// Index of a point with integer coordinates below 2^bits along the Hilbert curve of that order.
fn hilbert(mut x: [u32; 3], bits: u32) -> u64 {
    for level in (1..bits).rev() {
        let (bit, below) = (1 << level, (1 << level) - 1);
        for axis in 0..3 {
            if x[axis] & bit != 0 {
                x[0] ^= below;
            } else {
                let swap = (x[0] ^ x[axis]) & below;
                x[0] ^= swap;
                x[axis] ^= swap;
            }
        }
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let flips = (1..bits).filter(|level| x[2] >> level & 1 != 0).fold(0, |flips, level| flips ^ ((1 << level) - 1));
    (0..bits).rev().fold(0, |index, level| {
        x.iter().fold(index, |index, &axis| index << 1 | u64::from((axis ^ flips) >> level & 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_every_point_once_and_moves_one_step_at_a_time() {
        for bits in 1..=4 {
            let n = 1u32 << bits;
            let mut path = vec![None; 1 << (3 * bits)];
            for (x, y, z) in (0..n).flat_map(|x| (0..n).flat_map(move |y| (0..n).map(move |z| (x, y, z)))) {
                let index = hilbert([x, y, z], bits) as usize;
                assert!(path[index].replace([x, y, z]).is_none(), "{bits} bits: index {index} twice");
            }
            for pair in path.windows(2) {
                let [a, b] = [pair[0].unwrap(), pair[1].unwrap()];
                let step: u32 = (0..3).map(|i| a[i].abs_diff(b[i])).sum();
                assert_eq!(step, 1, "{bits} bits: {a:?} to {b:?}");
            }
        }
    }

    #[test]
    fn the_corners_of_the_local_cube_lie_within_63_bits() {
        for corner in 0..8 {
            let p = DVec3::from_array(std::array::from_fn(|axis| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 }));
            assert!(curve_index(p) < 1 << 63, "{p}");
        }
        assert_eq!(curve_index(DVec3::NEG_ONE), 0);
    }

    #[test]
    fn cells_of_the_same_vertices_have_the_same_index() {
        // Sums that depend on the order of the terms.
        let local = [Vec3::new(1.0, 1e-20, 0.3), Vec3::new(-1.0, 1.0, 0.1), Vec3::new(3e-17, -1.0, 0.7), Vec3::ZERO];
        assert_eq!(cell_curve_index([0, 1, 2, 3], &local), cell_curve_index([2, 0, 3, 1], &local));
    }
}

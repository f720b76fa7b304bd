//! Order along a 3-D Hilbert curve, so that cells and vertices near in space are near in memory.
//!
//! The index follows J. Skilling, "Programming the Hilbert curve", AIP Conference Proceedings 707 (2004), 381-387:
//! undo the rotations from the coarsest bit down, then Gray-encode; the result is the index with its bits dealt out to
//! the three axes in turn. No table, and no branch on coordinates: those would be mispredicted every other time.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Bits of the index per axis: 3 * 21 = 63 fit a u64, and 2^-20 of the box is finer than a cell of any mesh of fewer
/// than 2^30 roughly equal cells. Equal indices are ordered by source index.
const BITS: u32 = 21;

/// A curve index and the source index of its vertex or cell. Tuples are unique, so an unstable sort is deterministic.
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
        let below = (1 << level) - 1;
        for axis in 0..3 {
            // All ones where the bit is set: then x[0] is mirrored, else x[0] and x[axis] change places, below the bit.
            let is_set = (x[axis] >> level & 1).wrapping_neg();
            let swap = (x[0] ^ x[axis]) & below & !is_set;
            x[axis] ^= swap;
            x[0] ^= swap | (below & is_set);
        }
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    // Every bit of the last axis flips all lower ones: each is flipped by the parity of the bits above it.
    let flips = [1, 2, 4, 8, 16].into_iter().fold(x[2] >> 1, |parity, distance| parity ^ parity >> distance);
    let [x, y, z] = x.map(|axis| every_third_bit(axis ^ flips));
    x << 2 | y << 1 | z
}

/// Moves bit i of 21 bits to bit 3 i, by halves of ever shorter groups.
fn every_third_bit(x: u32) -> u64 {
    let groups = [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ];
    groups.into_iter().fold(u64::from(x), |x, (distance, mask)| (x | x << distance) & mask)
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
    fn every_bit_moves_to_three_times_its_place() {
        for bit in 0..BITS {
            assert_eq!(every_third_bit(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(every_third_bit((1 << BITS) - 1).count_ones(), BITS);
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
        // Beside a step of the curve, where the last bit of the sum decides: x adds up to -1 - 2^-52 or to twice
        // as much below -1.
        let tiny = -1.125 * 2f32.powi(-52);
        let local = [-1.0, -1.0, 1.0, tiny].map(|x| Vec3::new(x, 0.0, 0.0));
        let sum_of = |order: [usize; 4]| order.iter().map(|&i| f64::from(local[i].x)).sum::<f64>();
        assert_ne!(
            curve_index(DVec3::X * 0.25 * sum_of([0, 1, 2, 3])),
            curve_index(DVec3::X * 0.25 * sum_of([0, 1, 3, 2]))
        );
        let index = cell_curve_index([0, 1, 2, 3], &local);
        for same in [[0, 1, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]] {
            assert_eq!(cell_curve_index(same, &local), index);
        }
    }
}

//! Gradient noise (Perlin: *Improving noise*, SIGGRAPH 2002) with three independent values from one hash per lattice corner, on an
//! unbounded lattice and with any seed.

use crate::random::hash;
use glam::{DVec3, I64Vec3};

/// Multipliers that spread lattice coordinates over 64 bits before they are hashed; odd, otherwise arbitrary.
const SPREAD: [u64; 3] = [0x8DA6_B343_0F5F_21C1, 0xD816_3841_7A3D_9E0B, 0xCB1A_B31F_93D7_6D35];

/// Three independent noise values at `p`, each smooth (C2), of mean 0 and within about [-1, 1]; features are one unit
/// wide.
pub fn vector_noise(seed: u64, p: DVec3) -> DVec3 {
    let cell = p.floor();
    let f = p - cell;
    let corner = cell.as_i64vec3();
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let mut sum = DVec3::ZERO;
    for i in 0..8u8 {
        let offset = I64Vec3::new(i64::from(i & 1), i64::from(i >> 1 & 1), i64::from(i >> 2));
        let weight = DVec3::select(offset.cmpeq(I64Vec3::ONE), fade, 1.0 - fade).element_product();
        sum += weight * corner_values(seed, corner.wrapping_add(offset), f - offset.as_dvec3());
    }
    sum
}

/// The three linear functions of one lattice corner, at offset `d` from it.
fn corner_values(seed: u64, corner: I64Vec3, d: DVec3) -> DVec3 {
    let index = (corner.x as u64).wrapping_mul(SPREAD[0])
        ^ (corner.y as u64).wrapping_mul(SPREAD[1])
        ^ (corner.z as u64).wrapping_mul(SPREAD[2]);
    let bits = hash(seed, index);
    DVec3::new(slope(bits & 0xFFFF, d), slope(bits >> 16 & 0xFFFF, d), slope(bits >> 32 & 0xFFFF, d))
}

/// Dot product of `d` with one of Perlin's twelve gradients, the directions to the edges of a cube.
fn slope(bits: u64, d: DVec3) -> f64 {
    let (u, v) = match bits % 3 {
        0 => (d.x, d.y),
        1 => (d.y, d.z),
        _ => (d.z, d.x),
    };
    (if bits & 0x4000 == 0 { u } else { -u }) + (if bits & 0x8000 == 0 { v } else { -v })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    #[test]
    fn noise_vanishes_at_lattice_points_also_far_from_the_origin() {
        for p in [DVec3::ZERO, DVec3::new(-3.0, 7.0, 1e6), DVec3::splat(-1e12)] {
            assert_eq!(vector_noise(5, p), DVec3::ZERO);
        }
    }

    #[test]
    fn noise_is_continuous_across_lattice_planes() {
        let mut random = SplitMix64::new(11);
        for _ in 0..100 {
            let p = DVec3::new(3.0, random.between(-9.0, 9.0), random.between(-9.0, 9.0));
            let step = 1e-9;
            let across = vector_noise(5, p + DVec3::X * step) - vector_noise(5, p - DVec3::X * step);
            // Slopes of the sum are below 2 * (sqrt 2 + 15/8 * 3), so 2e-9 in x moves it by less than 4e-8.
            assert!(across.abs().max_element() < 4e-8, "{across}");
        }
    }

    #[test]
    fn the_three_values_are_uncorrelated_centred_and_bounded() {
        let mut random = SplitMix64::new(12);
        let n = 20_000;
        let samples: Vec<DVec3> =
            (0..n).map(|_| vector_noise(9, DVec3::new(random.unit(), random.unit(), random.unit()) * 200.0)).collect();
        let mean = samples.iter().sum::<DVec3>() / f64::from(n);
        let covariance = samples.iter().map(|s| (*s - mean) * (s.yzx() - mean.yzx())).sum::<DVec3>() / f64::from(n);
        let variance = samples.iter().map(|s| (*s - mean) * (*s - mean)).sum::<DVec3>() / f64::from(n);
        assert!(samples.iter().all(|s| s.abs().max_element() <= 1.1));
        assert!(variance.min_element() > 0.05 && variance.max_element() < 0.12, "{variance}");
        // Standard errors at 20,000 samples: mean sqrt(0.08 / n) = 2e-3, covariance 0.08 / sqrt(n) = 6e-4; five of each.
        assert!(mean.abs().max_element() < 1e-2, "{mean}");
        assert!(covariance.abs().max_element() < 3e-3, "{covariance}");
    }

    use glam::Vec3Swizzles as _;
}

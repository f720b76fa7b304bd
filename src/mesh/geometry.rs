//! Volumes of cells.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use robust::{Coord3D, orient3d};

use super::Mesh;

/// Signed volume of a tet with vertices a, b, c, d: det(b - a, c - a, d - a) / 6. The sign is exact, also that of zero
/// (J. R. Shewchuk's adaptive predicate): products of three f32 neither overflow nor underflow in f64.
pub fn tet_volume(corners: [Vec3; 4]) -> f64 {
    let [a, b, c, d] = corners.map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
    // Shewchuk's sign is positive for d below the plane of a, b, c (counter-clockwise seen from above); ours is negative.
    -orient3d(a, b, c, d) / 6.0
}

/// Aspect ratio from which on the rounding of a volume shows.
const FLAT: f64 = 1e6;

/// Aspect ratio of a tet with a volume: its longest edge over sqrt(24) times the radius of its inscribed sphere, which is 1 for a regular
/// one and grows without bound for flat ones.
pub fn tet_aspect_ratio(corners: [Vec3; 4]) -> f64 {
    let [a, b, c, d] = corners.map(|p| p.as_dvec3());
    let area = |p: DVec3, q: DVec3, r: DVec3| 0.5 * (q - p).cross(r - p).length();
    let surface = area(a, b, c) + area(a, b, d) + area(a, c, d) + area(b, c, d);
    let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
    let longest = edges.iter().map(|edge| edge.length_squared()).fold(0.0, f64::max).sqrt();
    // The inscribed sphere has radius 3 V / S. Rounding may leave nothing of the volume of a flat cell: that one is computed exactly.
    let ratio = |volume: f64| longest * surface / (24f64.sqrt() * 3.0 * volume.abs());
    let rounded = ratio((b - a).dot((c - a).cross(d - a)) / 6.0);
    if rounded < FLAT { rounded } else { ratio(tet_volume(corners)) }
}

/// Volume over that of a ball of the radius: neither the cube of the radius nor what is smaller than the result leaves f64.
pub(super) fn filling(volume: f64, radius: f64) -> f64 {
    volume / ball_volume(1.0) / radius / radius / radius
}

/// Volume of a ball.
pub fn ball_volume(radius: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)
}

impl Mesh {
    /// Volume of a point of a cloud over that of its ball.
    pub fn filling_of(&self, point: u32) -> f64 {
        self.filling.as_ref().map_or(1.0, |filling| filling[point as usize].into())
    }

    /// Volume of a cell, or of a cloud's point, in local units, above zero. The world volume is `scale^3` times it.
    pub fn cell_volume(&self, cell: u32) -> f64 {
        if let Some(radii) = &self.radii {
            return ball_volume(radii[cell as usize].into()) * self.filling_of(cell);
        }
        tet_volume(self.positions.corners(self.topology.tets[cell as usize]))
    }

    /// Total volume of all cells in local units, the same for any number of threads.
    pub fn total_volume(&self) -> f64 {
        /// Cells per partial sum; fixed, so that rounding does not depend on the number of threads.
        const RUN: usize = 4096;
        if let Some(radii) = &self.radii {
            return (0..radii.len() as u32).map(|point| self.cell_volume(point)).sum();
        }
        let run_volume = |run: &[[u32; 4]]| run.iter().map(|&tet| tet_volume(self.positions.corners(tet))).sum::<f64>();
        let runs: Vec<f64> = self.topology.tets.par_chunks(RUN).map(run_volume).collect();
        runs.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];

    #[test]
    fn the_unit_tet_has_a_sixth_and_its_mirror_image_minus_a_sixth() {
        let [a, b, c, d] = UNIT;
        assert_eq!(tet_volume([a, b, c, d]), 1.0 / 6.0);
        assert_eq!(tet_volume([a, b, d, c]), -1.0 / 6.0);
    }

    #[test]
    fn the_aspect_ratio_is_1_for_a_regular_tet_and_that_of_the_unit_tet_by_hand() {
        let regular = [[1.0f32, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(Vec3::from);
        assert!((tet_aspect_ratio(regular) - 1.0).abs() < 1e-14);
        // Longest edge sqrt 2, surface (3 + sqrt 3) / 2, volume 1/6.
        let unit = 2f64.sqrt() * (3.0 + 3f64.sqrt()) / 24f64.sqrt();
        assert!((tet_aspect_ratio(UNIT) - unit).abs() < 1e-14);
        let [a, b, c, d] = UNIT;
        assert!(tet_aspect_ratio([a, b, c, d * 1e-4]) > 1e3);
    }

    #[test]
    fn the_sign_of_a_sliver_is_exact() {
        // All four lie on the plane x + y + z = 1, in multiples of 1/8; then the last is moved off it by one bit.
        let eighths = |x: f32, y: f32| Vec3::new(x, y, 8.0 - x - y) / 8.0;
        let [a, b, c, d] = [eighths(1.0, 1.0), eighths(5.0, 2.0), eighths(2.0, 3.0), eighths(3.0, 3.0)];
        assert_eq!(tet_volume([a, b, c, d]), 0.0);
        assert!(tet_volume([a, b, c, d.with_x(d.x.next_up())]) > 0.0, "outside, where the plane's normal points");
        assert!(tet_volume([a, b, c, d.with_x(d.x.next_down())]) < 0.0);
        let tiny = f32::from_bits(1);
        let flat = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.3, 0.3, 0.0)];
        assert_eq!(tet_volume(flat), 0.0);
        for z in [tiny, -tiny] {
            let volume = tet_volume([flat[0], flat[1], flat[2], flat[3] + Vec3::new(0.0, 0.0, z)]);
            assert_eq!(volume, f64::from(z) / 6.0);
        }
        // Three edges of subnormal length: the volume does not underflow.
        assert!(tet_volume(UNIT.map(|p| p * tiny)) > 0.0);
    }
}

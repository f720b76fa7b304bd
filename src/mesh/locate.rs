//! Finds the cells near a point.
//!
//! A linear scan: boxes reject nearly all cells (a million take some ten milliseconds on two cores), and it runs once per camera position,
//! not per ray. It must never miss the cell that the eye is in, hence every test errs towards keeping a cell.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{FACE_VERTICES, Mesh};

impl Mesh {
    /// Ids, ascending, of all cells that contain a point or come within `tolerance` of it, both in local units. Some cells slightly further
    /// away may be included (each has the point within `tolerance` of the inner side of every face plane, and of its box), but none is
    /// missed. Empty if the point is not finite; a tolerance that is negative or NaN counts as zero.
    pub fn cells_near(&self, point_local: DVec3, tolerance: f64) -> Vec<u32> {
        if !point_local.is_finite() {
            return Vec::new();
        }
        let tolerance = tolerance.max(0.0);
        let tets = self.topology.tets.par_iter().enumerate();
        let near = tets.filter(|(_, tet)| is_near(self.positions.corners(**tet), point_local, tolerance));
        near.map(|(cell, _)| cell as u32).collect()
    }
}

/// Whether a point may be within `tolerance` of a positively oriented tet; errs towards true.
fn is_near(corners: [Vec3; 4], point: DVec3, tolerance: f64) -> bool {
    // One axis after the other, since the first rejects most cells. Rounding is monotonic: a difference of at most the
    // tolerance is not rounded to above it.
    let is_in_slab = |axis: usize| {
        let [a, b, c, d] = corners.map(|p| p[axis]);
        let (lo, hi) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        f64::from(lo) - point[axis] <= tolerance && point[axis] - f64::from(hi) <= tolerance
    };
    (0..3).all(is_in_slab) && FACE_VERTICES.iter().all(|face| !is_beyond(face.map(|i| corners[i]), point, tolerance))
}

/// Whether a point is certainly further than `tolerance` on the outer side of a face's plane.
///
/// With u = 2^-53, each difference of coordinates is off by at most u relative to itself, so a component of the normal
/// n = e x f by at most 4u |e||f| (two differences and one product in each term, one subtraction), n by at most
/// 4 sqrt(3) u |e||f| < 7u |e||f|. Then n . (p - a) is off by at most that times |p - a| and 4u |n||p - a| of its own
/// operations, and tolerance * |n| by at most 7u |e||f| + 4u |n| times the tolerance. Together less than
/// 12u |e||f| (|p - a| + tolerance); 16u also covers the rounding of this bound itself.
fn is_beyond([a, b, c]: [Vec3; 3], point: DVec3, tolerance: f64) -> bool {
    const U16: f64 = 8.0 * f64::EPSILON;
    let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
    let (e, f, to_point) = (b - a, c - a, point - a);
    let normal = e.cross(f);
    let slack = U16 * (e.length() * f.length()) * (to_point.length() + tolerance);
    normal.dot(to_point) > tolerance * normal.length() + slack
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::RawMesh;
    use super::super::test_meshes::{Random, jittered, kuhn_grid};
    use super::*;

    fn corners(mesh: &Mesh, cell: u32) -> [DVec3; 4] {
        mesh.positions.corners(mesh.topology.tets[cell as usize]).map(|p| p.as_dvec3())
    }

    /// Whether a point lies in a closed tet, exactly.
    fn contains(corners: [DVec3; 4], point: DVec3) -> bool {
        let coord = |p: DVec3| robust::Coord3D { x: p.x, y: p.y, z: p.z };
        FACE_VERTICES.iter().all(|&[i, j, k]| {
            robust::orient3d(coord(corners[i]), coord(corners[j]), coord(corners[k]), coord(point)) >= 0.0
        })
    }

    /// Distance of a point from a tet: zero inside, else to the nearest vertex, edge or face.
    fn naive_distance(corners: [DVec3; 4], point: DVec3) -> f64 {
        if contains(corners, point) {
            return 0.0;
        }
        let mut nearest = f64::INFINITY;
        for face in FACE_VERTICES {
            let triangle = face.map(|i| corners[i]);
            let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize();
            let mut above_face = true;
            for i in 0..3 {
                let (from, edge) = (triangle[i], triangle[(i + 1) % 3] - triangle[i]);
                above_face &= edge.cross(point - from).dot(normal) >= 0.0;
                let along = ((point - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
                nearest = nearest.min(point.distance(from + along * edge));
            }
            if above_face {
                nearest = nearest.min((point - triangle[0]).dot(normal).abs());
            }
        }
        nearest
    }

    /// Greatest distance, in tolerances, of a point that passes all plane tests of a tet: moved outwards by t, the planes bound the tet
    /// scaled by 1 + t / r about the centre of its inscribed ball of radius r.
    fn reach(corners: [DVec3; 4]) -> f64 {
        let area = |[i, j, k]: [usize; 3]| 0.5 * (corners[j] - corners[i]).cross(corners[k] - corners[i]).length();
        let areas = FACE_VERTICES.map(area);
        let total: f64 = areas.iter().sum();
        let centre = (0..4).map(|i| areas[i] * corners[i]).sum::<DVec3>() / total;
        let volume = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(corners[3] - corners[0]) / 6.0;
        let furthest = corners.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        furthest * total / (3.0 * volume)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn all_cells_within_the_tolerance_are_found_and_none_far_away(
            seed: u64,
            point in prop::array::uniform3(-1.2f64..1.2),
            tolerance in prop_oneof![Just(0.0), 1e-9f64..0.5],
        ) {
            let raw = jittered(kuhn_grid([3, 2, 2]), &mut Random::new(seed));
            let (mesh, _) = Mesh::build(raw).unwrap();
            let point = DVec3::from_array(point);
            let found = mesh.cells_near(point, tolerance);
            prop_assert!(found.is_sorted_by(|a, b| a < b));
            for cell in 0..mesh.topology.tets.len() as u32 {
                let corners = corners(&mesh, cell);
                let distance = naive_distance(corners, point);
                // The naive distance rounds, too: well-shaped cells of edges below 2, a few ulps of that.
                const ROUNDING: f64 = 64.0 * f64::EPSILON;
                let is_found = found.contains(&cell);
                prop_assert!(is_found || distance > tolerance - ROUNDING, "cell {} at {} missed", cell, distance);
                let furthest = tolerance * reach(corners) + ROUNDING;
                prop_assert!(!is_found || distance <= furthest, "cell {} at {} found", cell, distance);
            }
        }

        #[test]
        fn a_sliver_is_never_missed_at_points_on_its_faces_and_inside(seed: u64, flatness in 0i32..20) {
            // Overlapping cells, up to 2^20 times flatter than wide. Weights of a few bits keep the points exact, whereas
            // the normals of the planes through them round.
            let mut random = Random::new(seed);
            let flatten = DVec3::new(1.0, 1.0, 2f64.powi(-flatness));
            let points = (0..12).map(|_| flatten * DVec3::from_array(std::array::from_fn(|_| random.signed()))).collect();
            let tets: Vec<_> = (0..30).map(|_| std::array::from_fn(|_| random.below(12) as u32)).collect();
            let Ok((mesh, _)) = Mesh::build(RawMesh { points, cells: tets.into() }) else { return Ok(()) };
            for probe in 0..mesh.topology.tets.len() as u32 {
                let [a, b, c, d] = corners(&mesh, probe);
                for (wa, wb, wc, wd) in [(16, 0, 0, 0), (0, 0, 5, 11), (4, 0, 5, 7), (0, 3, 6, 7), (1, 5, 10, 0), (1, 2, 4, 9)] {
                    let [wa, wb, wc, wd] = [wa, wb, wc, wd].map(|weight| f64::from(weight) / 16.0);
                    let point = wa * a + wb * b + wc * c + wd * d;
                    let found = mesh.cells_near(point, 0.0);
                    prop_assert!(found.contains(&probe), "cell {} misses its own {}", probe, point);
                    for cell in 0..mesh.topology.tets.len() as u32 {
                        prop_assert!(found.contains(&cell) || !contains(corners(&mesh, cell), point));
                    }
                }
            }
        }
    }

    #[test]
    fn of_two_cells_one_is_found_a_picometre_beside_their_face() {
        // The plane x = y of the cube from -1 to 1; the slack for rounding is some 1e-14 there.
        let (mesh, _) = Mesh::build(kuhn_grid([1, 1, 1])).unwrap();
        let found = |offset| mesh.cells_near(DVec3::new(0.5, 0.5 + offset, 0.1), 0.0).len();
        assert_eq!([-1e-12, 0.0, 1e-12].map(found), [1, 2, 1]);
    }

    #[test]
    fn the_cells_at_a_vertex_are_those_that_use_it() {
        let (mesh, _) = Mesh::build(kuhn_grid([3, 3, 3])).unwrap();
        for (vertex, position) in (0u32..).zip(&mesh.positions.local) {
            let users: Vec<u32> = (0u32..)
                .zip(&mesh.topology.tets)
                .filter(|(_, tet)| tet.contains(&vertex))
                .map(|(cell, _)| cell)
                .collect();
            assert_eq!(mesh.cells_near(position.as_dvec3(), 0.0), users);
        }
    }

    #[test]
    fn points_and_tolerances_that_are_no_numbers_are_harmless() {
        let (mesh, _) = Mesh::build(kuhn_grid([1, 1, 1])).unwrap();
        assert!(mesh.cells_near(DVec3::NAN, 1.0).is_empty());
        assert!(mesh.cells_near(DVec3::new(0.0, f64::INFINITY, 0.0), f64::INFINITY).is_empty());
        assert!(mesh.cells_near(DVec3::splat(1e300), 0.5).is_empty());
        assert_eq!(mesh.cells_near(DVec3::splat(1e300), f64::INFINITY), [0, 1, 2, 3, 4, 5]);
        let inside = DVec3::new(0.1, 0.2, 0.15);
        assert_eq!(mesh.cells_near(inside, 0.0).len(), 1);
        assert_eq!(mesh.cells_near(inside, f64::NAN), mesh.cells_near(inside, 0.0));
        assert_eq!(mesh.cells_near(inside, -1.0), mesh.cells_near(inside, 0.0));
    }
}

//! Random meshes, cameras and lists.

use super::*;
use crate::meshes::{build, grid, sample};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn random_meshes_in_exact_order_agree_with_the_ray_caster(
        seed: u64,
        cubes in 2usize..6,
        kept in 0.3f64..1.0,
        flatness in 0i32..24,
        k in 2u8..=32,
        eye in prop::array::uniform3(-4.0f64..4.0),
        parallel: bool,
    ) {
        // Cubes left out at random, flattened by up to 2^-24 along z.
        let cube = |c: DVec3| (c * 1000.0).as_ivec3().to_array().iter().fold(7u64, |h, &v| h.wrapping_mul(31).wrapping_add(v as u64));
        let mut raw = grid(cubes, 0.16, seed, |c| 0.5 + 0.5 * noise(seed, cube(c)) < kept);
        prop_assume!(!raw.cells.tets.is_empty());
        let squash = 2f64.powi(-flatness);
        raw.points.iter_mut().for_each(|p| p.z *= squash);
        let mesh = Arc::new(build(raw));
        let scalars = sample(&mesh, |p| wave(DVec3::new(p.x, p.y, p.z / squash)));
        let tables = dense().nodes().iter().map(|n| Node { tau: n.tau / squash, ..*n }).collect();
        let eye = DVec3::from_array(eye);
        let projection =
            if parallel { Projection::Parallel { scale: 1.3 } } else { Projection::Perspective { view_angle: 50.0 } };
        let job = job(&mesh, scalars, &camera(eye, projection), (33, 31), NodeTable::new(tables).unwrap());
        let frame = havs(&with_buffer(&with_all_faces(&job), k, true));
        // That this can fail: `complete::the_comparison_notices_a_missing_face_and_a_wrong_order`.
        let judge = raycast(&job);
        prop_assert!(is_within(&frame.planes.color, &judge), "rmse and max {:?}", difference(&frame.planes.color, &judge));
    }
}

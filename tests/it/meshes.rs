//! Small meshes and fields for tests, built without the generators under test.

use glam::DVec3;
use tetreel::mesh::{Mesh, RawMesh};

/// A number in [-1, 1) from a seed and an index (splitmix64).
pub fn noise(seed: u64, index: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(index.wrapping_mul(0xD1B5_4A32_D192_ED03));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// The box [-1, 1]^3 in n^3 cubes of six tets each; inner vertices moved by up to `jitter` of a cube's edge.
/// `keep` decides by cube centre which cubes stay.
///
/// Below a jitter of 1/6 no tet is inverted: the edges of a tet along the axes are then (I + E) h with |E| < 1/3, a
/// diagonally dominant matrix.
pub fn grid(n: usize, jitter: f64, seed: u64, keep: impl Fn(DVec3) -> bool) -> RawMesh {
    assert!(jitter < 1.0 / 6.0);
    let m = n + 1;
    let id = |i: usize, j: usize, k: usize| (i + m * (j + m * k)) as u32;
    let h = 2.0 / n as f64;
    let mut points = Vec::with_capacity(m * m * m);
    for k in 0..m {
        for j in 0..m {
            for i in 0..m {
                let at = u64::from(id(i, j, k));
                let inner = |c: usize| c > 0 && c < n;
                let move_by = |c, axis| if inner(c) { jitter * h * noise(seed, 3 * at + axis) } else { 0.0 };
                points.push(DVec3::new(
                    i as f64 * h - 1.0 + move_by(i, 0),
                    j as f64 * h - 1.0 + move_by(j, 1),
                    k as f64 * h - 1.0 + move_by(k, 2),
                ));
            }
        }
    }
    let mut tets = Vec::new();
    for (k, j, i) in (0..n * n * n).map(|c| (c / (n * n), c / n % n, c % n)) {
        if !keep(DVec3::new(i as f64 + 0.5, j as f64 + 0.5, k as f64 + 0.5) * h - DVec3::ONE) {
            continue;
        }
        let corner = |b: usize| id(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2 & 1));
        for path in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            tets.push([corner(0), corner(path[0]), corner(path[1]), corner(7)]);
        }
    }
    RawMesh { points, cells: tets.into() }
}

/// The repaired mesh.
pub fn build(raw: RawMesh) -> Mesh {
    Mesh::build(raw).expect("a valid mesh").0
}

/// A scalar per vertex from its world position.
pub fn sample(mesh: &Mesh, f: impl Fn(DVec3) -> f64) -> Vec<f32> {
    (0..mesh.positions.local.len()).map(|v| f(mesh.positions.world(v)) as f32).collect()
}

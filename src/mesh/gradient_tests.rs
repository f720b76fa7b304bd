//! Gradients against exact integer arithmetic and closed forms, and their invariances.

use super::test_meshes::{Random, jittered, kuhn_grid};
use super::{Mesh, RawMesh, tet_gradient_magnitude};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

/// Relative error that a gradient may have: 2^-25 of the quotient and half an ulp of its rounding to f32, rounded up.
const BOUND: f64 = 1.0 / (1 << 23) as f64;

/// [`BOUND`] before rounding to f32.
const LOCAL_BOUND: f64 = 1.0 / (1 << 25) as f64 + 8.0 * f64::EPSILON;

fn build(raw: RawMesh) -> Mesh {
    Mesh::build(raw).unwrap().0
}

/// Scalars of the vertices by a formula of the file's points.
fn scalars(mesh: &Mesh, points: &[DVec3], value: impl Fn(DVec3) -> f32) -> Vec<f32> {
    mesh.vertex_source.iter().map(|&v| value(points[v as usize])).collect()
}

fn gradients(mesh: &Mesh, scalars: &[f32]) -> Vec<f32> {
    let mut out = vec![-1.0; mesh.topology.tets.len()];
    mesh.gradient_magnitudes(scalars, &mut out);
    out
}

/// Cramer's rule in integers: only the last three divisions and the norm round. `None` without a volume.
fn in_whole_numbers(corners: [[i64; 3]; 4], scalars: [i64; 4]) -> Option<f64> {
    let edges = [1, 2, 3].map(|i| [0, 1, 2].map(|k| i128::from(corners[i][k] - corners[0][k])));
    let rises = [1, 2, 3].map(|i| i128::from(scalars[i] - scalars[0]));
    let determinant = |m: [[i128; 3]; 3]| {
        let minor = |j: usize, k: usize| m[1][j] * m[2][k] - m[1][k] * m[2][j];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    };
    let volume = determinant(edges);
    let with_rises = |k: usize| {
        let mut m = edges;
        m.iter_mut().zip(rises).for_each(|(edge, rise)| edge[k] = rise);
        determinant(m) as f64 / volume as f64
    };
    (volume != 0).then(|| [0, 1, 2].map(with_rises).iter().map(|g| g * g).sum::<f64>().sqrt())
}

/// Coordinates are multiples of 1 / GRID.
const GRID: i64 = 1 << 20;

fn corner(p: [i64; 3]) -> Vec3 {
    Vec3::from_array(p.map(|x| x as f32 / GRID as f32))
}

/// The straightforward formula, all in f32.
fn careless(corners: [Vec3; 4], scalars: [f32; 4]) -> f32 {
    let [a, b, c] = [1, 2, 3].map(|i| corners[i] - corners[0]);
    let [ra, rb, rc] = [1, 2, 3].map(|i| scalars[i] - scalars[0]);
    ((ra * b.cross(c) + rb * c.cross(a) + rc * a.cross(b)) / a.dot(b.cross(c))).length()
}

proptest! {
    #[test]
    fn any_tet_and_any_sliver_has_the_gradient_of_whole_numbers(
        points in prop::array::uniform4(prop::array::uniform3(-GRID..=GRID)),
        values in prop::array::uniform4(-(1_i64 << 24)..=1 << 24),
        off in prop::array::uniform3(-2_i64..=2),
        is_sliver: bool,
    ) {
        let mut corners = points;
        if is_sliver {
            // In the plane of the others, up to some 2^-20.
            corners[3] = [0, 1, 2].map(|k| (points[0][k] + points[1][k] + 2 * points[2][k]) / 4 + off[k]);
        }
        let found = tet_gradient_magnitude(corners.map(corner), values.map(|v| v as f32));
        // Integers, in units of 2^-20.
        match in_whole_numbers(corners, values).map(|g| g * GRID as f64) {
            Some(expected) => prop_assert!((found - expected).abs() <= LOCAL_BOUND * expected, "{found:e}, {expected:e}"),
            None => prop_assert!(found.is_nan(), "{found:e}"),
        }
    }
}

#[test]
fn slivers_need_the_double_precision_and_carelessness_is_noticed() {
    let mut random = Random::new(5);
    let mut number = |n: i64| random.below(2 * n as usize + 1) as i64 - n;
    let (mut worse, mut slivers) = (0, 0);
    for _ in 0..1000 {
        let mut corners = [[0; 3]; 4].map(|p: [i64; 3]| p.map(|_| number(GRID)));
        corners[3] = [0, 1, 2].map(|k| (corners[0][k] + corners[1][k] + 2 * corners[2][k]) / 4 + number(1));
        let values = [0; 4].map(|_| number(1 << 24));
        let Some(expected) = in_whole_numbers(corners, values).map(|g| g * GRID as f64) else { continue };
        let floats = values.map(|v| v as f32);
        slivers += 1;
        worse += usize::from((f64::from(careless(corners.map(corner), floats)) / expected - 1.0).abs() > BOUND);
        let found = tet_gradient_magnitude(corners.map(corner), floats);
        assert!((found / expected - 1.0).abs() <= LOCAL_BOUND, "{found:e} instead of {expected:e}");
    }
    assert!(slivers > 900 && worse > 900, "{worse} of {slivers}");
}

/// A tet whose last corner is this high above the plane of the others.
fn of_height(height: f32) -> [Vec3; 4] {
    [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.25, 0.25, height)]
}

#[test]
fn a_cell_without_volume_or_with_a_hole_has_no_gradient() {
    assert!(tet_gradient_magnitude(of_height(0.0), [0.0, 1.0, 2.0, 3.0]).is_nan());
    assert!(tet_gradient_magnitude(of_height(0.0), [1.0; 4]).is_nan());
    for hole in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for at in 0..4 {
            let mut scalars = [1.0; 4];
            scalars[at] = hole;
            assert!(tet_gradient_magnitude(of_height(1.0), scalars).is_nan(), "{hole} at {at}");
            assert!(tet_gradient_magnitude(of_height(1e-12), scalars).is_nan(), "{hole} at {at}");
        }
        assert!(tet_gradient_magnitude(of_height(1.0), [hole; 4]).is_nan());
    }
    let mesh = build(kuhn_grid([2, 2, 2]));
    let mut scalars = vec![1.0; 27];
    scalars[13] = f32::NAN;
    let mut out = vec![-1.0; 48];
    let around = mesh.topology.tets.iter().filter(|tet| tet.contains(&13)).count();
    assert_eq!(mesh.gradient_magnitudes(&scalars, &mut out), around);
    assert!(around > 0 && out.iter().filter(|g| g.is_nan()).count() == around && out.contains(&0.0));
}

#[test]
fn flat_as_a_cell_may_be_its_gradient_is_right_or_missing() {
    // The scalar is x in the base plane and rises by 1 to the top: gradient (1, 0, 0.75 / height).
    for exponent in 0..149 {
        let height = 2.0_f32.powi(-exponent);
        let found = tet_gradient_magnitude(of_height(height), [0.0, 1.0, 0.0, 1.0]);
        let expected = 1.0_f64.hypot(0.75 / f64::from(height));
        // Products of powers of two are exact; only the bound exceeds its tolerance in f64, at 2^-24.
        assert!(
            (found / expected - 1.0).abs() <= LOCAL_BOUND || (exponent > 70 && found.is_nan()),
            "2^-{exponent}: {found:e}"
        );
    }
}

#[test]
fn a_constant_has_no_gradient_at_all_and_the_extremes_of_f32_are_differences_too() {
    let mesh = build(jittered(kuhn_grid([4, 3, 2]), &mut Random::new(3)));
    let vertices = mesh.vertex_source.len();
    for value in [0.0, -0.0, 0.1, -3e38, f32::MAX, 1e-45, 1e9] {
        let found = gradients(&mesh, &vec![value; vertices]);
        assert!(found.iter().all(|g| g.to_bits() == 0), "{value:e}");
    }
    // From -MAX to MAX over the unit edge.
    let steep = tet_gradient_magnitude(of_height(1.0), [f32::MIN, f32::MAX, f32::MIN, f32::MIN]);
    assert!(steep >= 2.0 * f64::from(f32::MAX) && steep.is_finite());
    let slight = tet_gradient_magnitude(of_height(1.0), [0.0, 1e-45, 0.0, 0.0]);
    assert!((1e-45..2e-45).contains(&slight));
}

/// A linear field on a jittered grid with coarsely quantised coordinates: all its scalars are exact.
fn linear() -> (RawMesh, impl Fn(DVec3) -> f32, f64) {
    let mut raw = jittered(kuhn_grid([5, 4, 3]), &mut Random::new(1));
    raw.points.iter_mut().for_each(|p| *p = (*p * 256.0).round() / 256.0);
    (raw, |p: DVec3| (3.0 * p.x - 7.0 * p.y + 2.0 * p.z + 11.0) as f32, 62.0_f64.sqrt())
}

#[test]
fn a_linear_field_has_its_gradient_in_every_cell() {
    let (raw, value, expected) = linear();
    let mesh = build(raw.clone());
    let found = gradients(&mesh, &scalars(&mesh, &raw.points, &value));
    let worst = |found: &[f32]| found.iter().map(|&g| (f64::from(g) / expected - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst(&found) <= BOUND, "{:e}", worst(&found));
    // One scalar off by 1e-5 of itself: the test can fail.
    let mut off = scalars(&mesh, &raw.points, value);
    off[17] *= 1.0 + 1e-5;
    assert!(worst(&gradients(&mesh, &off)) > BOUND);
}

/// Values of cells in the order of the file.
fn by_source(mesh: &Mesh, values: Vec<f32>) -> Vec<f32> {
    let mut out = vec![f32::NAN; values.len()];
    mesh.cell_source.iter().zip(values).for_each(|(&source, value)| out[source as usize] = value);
    out
}

/// The least height of any corner of any cell above the face opposite, in local units.
fn least_height(mesh: &Mesh) -> f64 {
    let height = |tet: [u32; 4], i: usize| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| mesh.positions.local[tet[(i + k) % 4] as usize].as_dvec3());
        let normal = (c - b).cross(d - b);
        (a - b).dot(normal).abs() / normal.length()
    };
    let tets = mesh.topology.tets.iter();
    tets.flat_map(|&tet| [0, 1, 2, 3].map(|i| height(tet, i))).fold(f64::INFINITY, f64::min)
}

#[test]
fn where_the_mesh_lies_and_how_large_it_is_changes_nothing_but_the_unit() {
    let (raw, value, _) = linear();
    let mesh = build(raw.clone());
    // A nonlinear field, so that cells differ.
    let bent = |p: DVec3| value(p) * value(p);
    let expected = gradients(&mesh, &scalars(&mesh, &raw.points, bent));
    // 2^-8 is more than an ulp of 1e6 in f64: nothing is lost.
    let moved = RawMesh { points: raw.points.iter().map(|p| *p + DVec3::splat(1e6)).collect(), ..raw.clone() };
    let moved = build(moved);
    assert_eq!(gradients(&moved, &scalars(&moved, &raw.points, bent)), expected);
    for exponent in [-100, -1, 3, 100] {
        let unit = 2.0_f64.powi(exponent);
        let scaled = build(RawMesh { points: raw.points.iter().map(|p| *p * unit).collect(), ..raw.clone() });
        let found = gradients(&scaled, &scalars(&scaled, &raw.points, bent));
        let expected: Vec<f32> = expected.iter().map(|&g| (f64::from(g) / unit) as f32).collect();
        assert_eq!(found, expected, "2^{exponent}");
    }
    for unit in [1e-30, 1e30] {
        let scaled = build(RawMesh { points: raw.points.iter().map(|p| *p * unit).collect(), ..raw.clone() });
        let found = by_source(&scaled, gradients(&scaled, &scalars(&scaled, &raw.points, bent)));
        // Local coordinates round by 2^-25, their differences D in E g = s by twice that: |dg| / |g| <= |E^-1| |dD|, where the
        // columns of the inverse are as long as the cell is not high, sqrt(3) / height, and nine differences 3 * 2^-24.
        let bound = 3.0_f64.sqrt() / least_height(&scaled) * 3.0 * 2.0_f64.powi(-24) + 2.0 * BOUND;
        assert!(bound < 1e-4, "{bound:e}");
        let close = |(&a, &b): (&f32, &f32)| (f64::from(a) * unit / f64::from(b) - 1.0).abs() < bound;
        // Another frame, and another curve order.
        let expected = by_source(&mesh, expected.clone());
        assert!(found.iter().zip(&expected).all(close), "{unit:e}");
    }
    // Beyond the range of f32 at both ends.
    let tiny = build(RawMesh { points: raw.points.iter().map(|p| *p * 1e-60).collect(), ..raw.clone() });
    assert!(gradients(&tiny, &scalars(&tiny, &raw.points, &value)).iter().all(|g| *g == f32::INFINITY));
    let vast = build(RawMesh { points: raw.points.iter().map(|p| *p * 1e60).collect(), ..raw.clone() });
    assert!(gradients(&vast, &scalars(&vast, &raw.points, &value)).iter().all(|g| *g == 0.0));
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mesh = build(jittered(kuhn_grid([13, 12, 11]), &mut Random::new(9)));
    let mut random = Random::new(2);
    let scalars: Vec<f32> = mesh.vertex_source.iter().map(|_| random.signed() as f32).collect();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| gradients(&mesh, &scalars)).into_iter().map(f32::to_bits).collect::<Vec<_>>()
    };
    assert!(mesh.topology.tets.len() > 8192, "more than one task");
    assert_eq!(run(1), run(4));
    assert_eq!(run(1), run(3));
}

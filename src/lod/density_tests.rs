//! Sampling density against its definition, and samples drawn by a density.

use super::*;
use crate::mesh::{Mesh, NONE, test_meshes};
use glam::DVec3;

fn mesh() -> Mesh {
    Mesh::build(test_meshes::kuhn_grid([5, 4, 3])).unwrap().0
}

fn at(mesh: &Mesh, vertex: usize) -> DVec3 {
    mesh.positions.local[vertex].as_dvec3()
}

/// The density for a single step.
fn density(mesh: &Mesh, scalar: impl Fn(DVec3) -> f64) -> Vec<f32> {
    let scalars: Vec<f32> = (0..mesh.positions.local.len()).map(|v| scalar(at(mesh, v)) as f32).collect();
    sampling_density(mesh, &scalars, 1)
}

fn interior(mesh: &Mesh) -> Vec<usize> {
    (0..mesh.topology.connectivity().faces.len())
        .filter(|&face| mesh.topology.connectivity().face_cells[face][1] != NONE)
        .collect()
}

fn area(mesh: &Mesh, face: usize) -> f64 {
    let [p, q, r] = mesh.topology.connectivity().faces[face].map(|v| at(mesh, v as usize));
    0.5 * (q - p).cross(r - p).length()
}

/// The error at a face by its definition: where the segment between the two opposite vertices meets the plane, found by solving in the
/// basis of the triangle's sides; at its midpoint if it does not.
fn naive_error(mesh: &Mesh, face: usize, scalar: &dyn Fn(usize) -> f64) -> f64 {
    let corners = mesh.topology.connectivity().faces[face].map(|v| v as usize);
    let opposite = mesh.topology.connectivity().face_cells[face].map(|cell| {
        let tet = mesh.topology.tets[cell as usize];
        tet.into_iter().map(|v| v as usize).find(|v| !corners.contains(v)).unwrap()
    });
    let [p, q, r] = corners.map(|v| at(mesh, v));
    let [a, b] = opposite.map(|v| at(mesh, v));
    // a + t (b - a) = p + u (q - p) + v (r - p)
    let solved = glam::DMat3::from_cols(b - a, p - q, p - r).inverse() * (p - a);
    let [t, u, v] = solved.to_array();
    let t_clamped = t.clamp(0.0, 1.0);
    assert_eq!(t, t_clamped, "the cells of this mesh are convex together in this direction");
    let [u, v] = [u, v].map(|w| w.clamp(-1.0, 2.0));
    let [on_p, on_q, on_r] = corners.map(scalar);
    let on_face = on_p + u * (on_q - on_p) + v * (on_r - on_p);
    let [on_a, on_b] = opposite.map(scalar);
    (on_face - (on_a + t * (on_b - on_a))).abs()
}

#[test]
fn the_density_is_the_fifth_root_of_area_times_squared_error() {
    let mesh = mesh();
    // Kinks of different strength everywhere.
    let scalar = |p: DVec3| (5.0 * p.x).sin() + p.y * p.z;
    let value = |v: usize| f64::from(scalar(at(&mesh, v)) as f32);
    let ours = density(&mesh, scalar);
    let faces = interior(&mesh);
    let errors: Vec<f64> = faces.iter().map(|&face| naive_error(&mesh, face, &value)).collect();
    let mean = |of: &dyn Fn(usize) -> f64| (0..faces.len()).map(of).sum::<f64>() / faces.len() as f64;
    let (mean_error, mean_area) = (mean(&|i| errors[i]), mean(&|i| area(&mesh, faces[i])));
    for (&face, error) in faces.iter().zip(&errors) {
        let square = (error / mean_error).powi(2) + 0.05f64.powi(2);
        let expected = (area(&mesh, face) / mean_area * square).powf(0.2);
        // Both are computed in f64 from the same scalars and rounded once to f32.
        assert!((f64::from(ours[face]) / expected - 1.0).abs() < 2.0 * f64::from(f32::EPSILON), "{face}");
    }
    assert!((0..ours.len()).all(|face| (ours[face] > 0.0) == faces.contains(&face)), "0 on the surface");
    let other = density(&mesh, |p| (5.0 * p.y).sin() + p.y * p.z);
    assert!(faces.iter().any(|&face| (other[face] / ours[face] - 1.0).abs() > 0.1), "the comparison notices");
}

#[test]
fn where_scalars_are_linear_only_the_area_counts() {
    let mesh = mesh();
    let faces = interior(&mesh);
    let relative = |density: &[f32], face: usize| f64::from(density[face]) / area(&mesh, face).powf(0.2);
    let spread = |density: &[f32]| {
        let all = || faces.iter().map(|&face| relative(density, face));
        all().fold(0.0, f64::max) / all().fold(f64::INFINITY, f64::min)
    };
    // Exact, since the values are powers of two.
    assert!(spread(&density(&mesh, |_| 3.0)) < 1.0 + 1e-6);
    assert!(spread(&density(&mesh, |p| p.x * p.y)) > 1.2, "the test can fail");
    // A kink in the middle of a linear field: nearby faces are sampled more densely than others.
    let kink = density(&mesh, |p| p.x.max(0.0));
    let is_near =
        |face: usize| mesh.topology.connectivity().faces[face].iter().any(|&v| at(&mesh, v as usize).x.abs() < 0.3);
    let best =
        |near: bool| faces.iter().filter(|&&f| is_near(f) == near).map(|&f| relative(&kink, f)).fold(0.0, f64::max);
    assert!(best(true) > 1.5 * best(false), "{} {}", best(true), best(false));
}

#[test]
fn steps_with_holes_are_left_out_and_extreme_scalars_stay_finite() {
    let mesh = mesh();
    let vertices = mesh.positions.local.len();
    let first: Vec<f32> = (0..vertices).map(|v| (v * v % 17) as f32).collect();
    let expected = sampling_density(&mesh, &first, 1);
    // The second of two steps has no finite values and does not count.
    let holes: Vec<f32> = first.iter().flat_map(|&value| [value, f32::NAN]).collect();
    assert_eq!(sampling_density(&mesh, &holes, 2), expected);
    // Both steps count: the mean square of equal errors is that of either.
    let twice: Vec<f32> = first.iter().flat_map(|&value| [value; 2]).collect();
    assert_eq!(sampling_density(&mesh, &twice, 2), expected);
    for scale in [1e-42, 1e-30, 1e30, f32::MAX / 17.0] {
        let scaled: Vec<f32> = first.iter().map(|value| value * scale).collect();
        let density = sampling_density(&mesh, &scaled, 1);
        assert!(interior(&mesh).iter().all(|&face| density[face].is_finite() && density[face] > 0.0), "{scale}");
    }
    for value in [f32::NAN, f32::INFINITY, 0.0] {
        let density = sampling_density(&mesh, &vec![value; vertices], 1);
        assert!(interior(&mesh).iter().all(|&face| density[face].is_finite() && density[face] > 0.0), "{value}");
    }
    assert_eq!(sampling_density(&mesh, &[], 0).len(), mesh.topology.connectivity().faces.len());
}

#[test]
fn flat_cells_have_a_density() {
    // Two cells over one face: one nearly without volume (none at all is refused by the mesh), then both; and a face that is
    // nearly a line.
    let (line, triangle) = ([1.0, 1e-5, 0.0], [0.0, 1.0, 0.0]);
    for (corner, heights) in [(triangle, [1.0, -1e-5]), (triangle, [1e-5, -1e-5]), (line, [1.0, -1.0])] {
        let tips = heights.map(|z| [0.2, 0.2, z]);
        let raw = crate::mesh::RawMesh {
            points: [[0.0; 3], [1.0, 0.0, 0.0], corner, tips[0], tips[1]].map(DVec3::from).to_vec(),
            cells: vec![[0, 1, 2, 3], [0, 2, 1, 4]].into(),
        };
        let mesh = Mesh::build(raw).unwrap().0;
        let scalars: Vec<f32> = (0..mesh.positions.local.len()).map(|v| v as f32).collect();
        let density = sampling_density(&mesh, &scalars, 1);
        assert!(interior(&mesh).iter().all(|&face| density[face].is_finite() && density[face] > 0.0), "{density:?}");
        assert_eq!(interior(&mesh).len(), 1);
    }
}

#[test]
fn a_ranking_by_density_has_so_many_faces_of_each_density() {
    let mesh = Mesh::build(test_meshes::kuhn_grid([16, 16, 16])).unwrap().0;
    let topology = &mesh.topology;
    // Classes by id modulo three, not in step with the order of the list.
    let densities = [1.0f32, 2.0, 4.0];
    let density: Vec<f32> = (0..topology.connectivity().faces.len()).map(|face| densities[face / 7 % 3]).collect();
    let ranking = Ranking::by_density(topology, &density);
    let mut all = ranking.ids().to_vec();
    all.sort_unstable();
    assert_eq!(all, interior(&mesh).iter().map(|&face| face as u32).collect::<Vec<_>>());
    let count = all.len() / 10;
    let mut found = [0.0; 3];
    ranking.ids()[..count].iter().for_each(|&face| found[face as usize / 7 % 3] += 1.0);
    let of_class = |class: usize| all.iter().filter(|&&face| face as usize / 7 % 3 == class).count() as f64;
    let total: f64 = (0..3).map(|class| of_class(class) * f64::from(densities[class])).sum();
    for class in 0..3 {
        let expected = count as f64 * of_class(class) * f64::from(densities[class]) / total;
        // Random sampling is off by the root of the number; stratified sampling by less.
        assert!((found[class] - expected).abs() < 3.0 * expected.sqrt(), "{} of {expected}", found[class]);
    }
    // Faces of density 0 come last.
    let none: Vec<f32> =
        (0..topology.connectivity().faces.len()).map(|face| if face % 2 == 0 { 0.0 } else { 1.0 }).collect();
    let ranking = Ranking::by_density(topology, &none);
    let odd = all.iter().filter(|&&face| face % 2 == 1).count();
    assert!(ranking.ids()[..odd].iter().all(|face| face % 2 == 1));
    // NaN densities: every face is still listed.
    let nan = vec![f32::NAN; topology.connectivity().faces.len()];
    assert_eq!(Ranking::by_density(topology, &nan).ids().len(), all.len());
}

#[test]
fn a_ranking_by_density_covers_the_mesh_more_evenly_than_chance() {
    let mesh = Mesh::build(test_meshes::kuhn_grid([16, 16, 16])).unwrap().0;
    let topology = &mesh.topology;
    let all = interior(&mesh);
    // Of each 64 neighbours in the list, about 8 are in an eighth of the faces.
    let variance = |ranking: &Ranking| {
        let mut drawn = vec![false; topology.connectivity().faces.len()];
        ranking.ids()[..all.len() / 8].iter().for_each(|&face| drawn[face as usize] = true);
        let counts: Vec<f64> =
            all.chunks_exact(64).map(|chunk| chunk.iter().filter(|&&face| drawn[face]).count() as f64).collect();
        counts.iter().map(|count| (count - 8.0).powi(2)).sum::<f64>() / counts.len() as f64
    };
    let even = variance(&Ranking::by_density(topology, &vec![1.0; topology.connectivity().faces.len()]));
    // Random: 64 * 1/8 * 7/8 = 7. Stratified: one of each 8, random only at the ends.
    let chance = variance(&Ranking::by_hash(topology));
    assert!(even < 0.5 && (5.0..9.0).contains(&chance), "{even} {chance}");
    // The sample has equally many of the kinds of faces that alternate in the list.
    let ranking = Ranking::by_density(topology, &vec![1.0; topology.connectivity().faces.len()]);
    let place = |face: u32| all.binary_search(&(face as usize)).unwrap();
    let odd = ranking.ids()[..all.len() / 8].iter().filter(|&&face| place(face) % 2 == 1).count();
    let half = (all.len() / 16) as f64;
    assert!((odd as f64 - half).abs() < 4.0 * half.sqrt(), "{odd} of {half}");
}

#[test]
fn half_of_a_sample_of_cells_is_even_and_half_goes_by_their_importance() {
    let mesh = mesh();
    let (topology, count) = (&mesh.topology, mesh.topology.tets.len());
    let mut variation: Vec<f32> = (0..mesh.positions.local.len()).map(|v| (v % 7) as f32 * 0.1).collect();
    (variation[0], variation[1]) = (f32::NAN, f32::INFINITY);
    let density = cell_density(topology, &variation);
    let finite = |v: u32| if v < 2 { 0.0 } else { f64::from(variation[v as usize]) };
    let importance: Vec<f64> = topology.tets.iter().map(|tet| tet.iter().map(|&v| finite(v)).sum()).collect();
    let mean = importance.iter().sum::<f64>() / count as f64;
    for (found, importance) in density.iter().zip(&importance) {
        assert_eq!(*found, (1.0 + importance / mean) as f32);
    }
    // The least density is half of the mean one, so no cell has less than half its even chance.
    let whole: f64 = density.iter().map(|&of| f64::from(of)).sum();
    assert!((whole / count as f64 - 2.0).abs() < 1e-6 && density.iter().all(|&of| of >= 1.0));
    // Over seeds, cells are drawn in proportion: the mean count of each half by density, in 200 samples of 36 of 360.
    let threshold = 2.0f32;
    let is_dense = |cell: u32| density[cell as usize] > threshold;
    let share: f64 =
        (0..count as u32).filter(|&cell| is_dense(cell)).map(|cell| f64::from(density[cell as usize])).sum();
    let (samples, drawn) = (200, count / 10);
    let dense: usize = (0..samples)
        .map(|seed| {
            Ranking::of_cells_by_density(&density, seed).ids()[..drawn].iter().filter(|&&cell| is_dense(cell)).count()
        })
        .sum();
    let [found, expected] = [dense as f64 / (samples as usize * drawn) as f64, share / whole];
    // Four standard deviations of draws at random; these are stratified, and vary less.
    let deviation = (expected * (1.0 - expected) / (samples as usize * drawn) as f64).sqrt();
    let even = (0..count as u32).filter(|&cell| is_dense(cell)).count() as f64 / count as f64;
    assert!((found - expected).abs() < 4.0 * deviation, "{found} {expected} {deviation}");
    assert!((found - even).abs() > 4.0 * deviation, "the test can fail: {even}");
    // Where nothing changes, they are all alike; and any number of threads gives one list.
    let none = cell_density(topology, &vec![0.0; variation.len()]);
    assert_eq!(Ranking::of_cells_by_density(&none, 3), Ranking::of_cells(count, 3));
    assert_ne!(Ranking::of_cells(count, 3), Ranking::of_cells(count, 4));
    let lists = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Ranking::of_cells_by_density(&cell_density(topology, &variation), 5))
    });
    assert_eq!(lists[0], lists[1]);
}

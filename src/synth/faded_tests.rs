//! Splitting against a slow oracle and against properties of any conforming refinement.

use super::faded::{FadedSeries, split};
use super::{SeriesName, SynthSpec, generate};
use crate::field::{Component, SeriesSource};
use crate::mesh::RawMesh;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Six times the signed volume of each cell.
fn volumes(mesh: &RawMesh) -> Vec<f64> {
    mesh.cells.tets.iter().map(|tet| volume(tet.map(|v| mesh.points[v as usize]))).collect()
}

fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a)
}

#[test]
fn a_split_makes_eight_cells_of_an_eighth_and_of_the_same_orientation_along_any_diagonal() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mut diagonals = BTreeSet::new();
    // Stretched along each axis, so that another diagonal is the shortest.
    for stretch in [DVec3::new(4.0, 1.0, 1.0), DVec3::new(1.0, 4.0, 1.0), DVec3::new(1.0, 1.0, 4.0)] {
        for tet in [[0, 1, 2, 3], [0, 2, 1, 3]] {
            let mesh = RawMesh { points: corners.map(|p| p * stretch).to_vec(), cells: vec![tet].into() };
            let (fine, values) = split(&mesh, &[0.0, 1.0, 2.0, 4.0]);
            assert_eq!((fine.points.len(), fine.cells.tets.len(), values.len()), (10, 8, 10));
            let whole = volumes(&mesh)[0];
            assert!(volumes(&fine).iter().all(|&v| v == whole / 8.0), "{:?} of {whole}", volumes(&fine));
            // A linear field stays linear: all numbers here are exact.
            let linear = |p: DVec3| (p / stretch).dot(DVec3::new(1.0, 2.0, 4.0)) as f32;
            assert!(fine.points.iter().zip(&values).all(|(&p, &v)| linear(p) == v));
            diagonals.insert(fine.cells.tets[4][..2].to_vec());
        }
    }
    assert!(diagonals.len() > 1, "always the same diagonal");
}

#[test]
fn neighbours_share_the_middles_of_their_edges() {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
    let mesh = RawMesh { points, cells: vec![[0, 1, 2, 3], [1, 2, 3, 4]].into() };
    let (once, values) = split(&mesh, &[1.0; 5]);
    assert_eq!((once.points.len(), once.cells.tets.len()), (5 + 9, 16));
    let (twice, _) = split(&once, &values);
    assert_eq!(twice.cells.tets.len(), 128);
    let (built, report) = crate::mesh::Mesh::build(twice).expect("a mesh");
    // Two parts would mean that the common face was split differently on its sides.
    assert_eq!((report.parts, report.non_manifold_faces, built.topology.tets.len()), (1, 0, 128));
    assert_eq!(report.boundary_faces, 6 * 16);
}

#[test]
fn scalars_fade_to_zero_in_equal_steps() {
    let mesh = RawMesh { points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], cells: vec![[0, 1, 2, 3]].into() };
    let series = FadedSeries::new("a.vtu", "s", mesh.clone(), vec![4.0, -8.0, 0.0, 1.0], 0, 5).expect("a series");
    let mut out = Vec::new();
    for (step, left) in [(0, 1.0), (1, 0.75), (4, 0.0)] {
        series.read(&series.fields()[0], Component::Index(0), step, &mut out).expect("reads");
        assert_eq!(out, [4.0 * left, -8.0 * left, 0.0, left]);
    }
    assert!(series.read(&series.fields()[0], Component::Index(0), 5, &mut out).is_err());
    for i in [1, 2, usize::MAX] {
        assert!(
            series.read(&series.fields()[0], Component::Index(i), 0, &mut out).is_err(),
            "there is no component {i}"
        );
    }
    assert!(FadedSeries::new("a", "s", mesh.clone(), vec![0.0; 4], 9, 5).is_err(), "8^9 cells");
    assert!(FadedSeries::new("a", "s", mesh, vec![0.0; 4], 0, 0).is_err());
}

/// A mesh of jittered cells, as in a file, with a scalar per point.
fn jittered() -> (RawMesh, Vec<f32>) {
    let spec = SynthSpec { cells: 600, steps: 2, ..SynthSpec::new(SeriesName::Decay) };
    let series = generate(&spec).expect("a series");
    let mut values = Vec::new();
    series.read(&series.fields()[0], Component::Index(0), 0, &mut values).expect("reads");
    (series.mesh().expect("a mesh"), values)
}

/// Number of cells of each face.
fn faces(mesh: &RawMesh) -> BTreeMap<[u32; 3], usize> {
    let mut faces = BTreeMap::new();
    for tet in &mesh.cells.tets {
        for left_out in 0..4 {
            let mut face: Vec<u32> = (0..4).filter(|&i| i != left_out).map(|i| tet[i]).collect();
            face.sort_unstable();
            *faces.entry([face[0], face[1], face[2]]).or_default() += 1;
        }
    }
    faces
}

fn boundary_area(mesh: &RawMesh) -> f64 {
    let area = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| mesh.points[v as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    faces(mesh).iter().filter(|(_, cells)| **cells == 1).map(|(face, _)| area(face)).sum()
}

#[test]
fn split_meshes_conform_and_keep_volume_orientation_and_surface() {
    let (mesh, values) = jittered();
    let edges: BTreeSet<[u32; 2]> =
        mesh.cells.tets.iter().flat_map(|t| pairs(t).map(|(a, b)| [a.min(b), a.max(b)])).collect();
    let (fine, fine_values) = split(&mesh, &values);
    assert_eq!(
        (fine.points.len(), fine.cells.tets.len()),
        (mesh.points.len() + edges.len(), 8 * mesh.cells.tets.len())
    );
    assert_eq!((&fine.points[..mesh.points.len()], &fine_values[..values.len()]), (&mesh.points[..], &values[..]));

    // Coordinates up to `size`: edges up to 2 sqrt(3) size. Each of the 12 coordinates of a cell is rounded by at most
    // eps size / 2, and moves the determinant by at most 12 size^2: 72 eps size^3. The determinant itself is six products
    // of three differences up to 2 size, four roundings each: 192 eps size^3.
    let size = mesh.points.iter().fold(0.0_f64, |m, p| m.max(p.abs().max_element()));
    let bound = 264.0 * f64::EPSILON * size.powi(3);
    for (eight, whole) in volumes(&fine).chunks(8).zip(volumes(&mesh)) {
        let is_eighth = |&v: &f64| (v - whole / 8.0).abs() <= bound && v * whole > 0.0;
        assert!(eight.iter().all(is_eighth), "{eight:?} of {whole}");
    }
    let (before, after): (f64, f64) = (volumes(&mesh).iter().sum(), volumes(&fine).iter().sum());
    assert!((before - after).abs() <= bound * fine.cells.tets.len() as f64, "{before} to {after}");

    let (coarse_faces, fine_faces) = (faces(&mesh), faces(&fine));
    assert!(fine_faces.values().all(|&cells| cells <= 2), "a face of three cells");
    let count = |faces: &BTreeMap<[u32; 3], usize>| faces.values().filter(|&&cells| cells == 1).count();
    // Each face becomes four, and each cell gets eight inner faces; a face that neighbours cut differently would count twice.
    assert_eq!(fine_faces.len(), 4 * coarse_faces.len() + 8 * mesh.cells.tets.len());
    assert_eq!(count(&fine_faces), 4 * count(&coarse_faces));
    let (before, after) = (boundary_area(&mesh), boundary_area(&fine));
    // As above for two dimensions: 9 coordinates by eps size / 2 that move an area by up to 2 sqrt(3) size, and its own
    // six products of two differences up to 2 size, four roundings each.
    let bound = (9.0 * 1.75 + 96.0) * f64::EPSILON * size.powi(2) * fine_faces.len() as f64;
    assert!((before - after).abs() <= bound, "{before} to {after}");
}

fn pairs(tet: &[u32; 4]) -> [(u32, u32); 6] {
    let [a, b, c, d] = *tet;
    [(a, b), (a, c), (a, d), (b, c), (b, d), (c, d)]
}

/// Oracle: the eight cells of each cell, as sorted corner positions instead of numbers; the octahedron is cut by trying all diagonals and
/// all pairs of other midpoints on a common face.
fn naive_split(mesh: &RawMesh) -> Vec<BTreeSet<[[u64; 3]; 4]>> {
    let bits = |mut cell: [DVec3; 4]| {
        cell.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).expect("finite"));
        cell.map(|p| p.to_array().map(f64::to_bits))
    };
    let eight = |tet: &[u32; 4]| {
        let corner = tet.map(|v| mesh.points[v as usize]);
        let middle = |i: usize, j: usize| 0.5 * corner[i] + 0.5 * corner[j];
        let mut cells: BTreeSet<_> =
            (0..4).map(|i| bits([0, 1, 2, 3].map(|j| if i == j { corner[i] } else { middle(i, j) }))).collect();
        // A diagonal joins the midpoints of two edges without a common corner.
        let diagonals = [[(0, 1), (2, 3)], [(0, 2), (1, 3)], [(0, 3), (1, 2)]];
        let length = |[(a, b), (c, d)]: [(usize, usize); 2]| middle(a, b).distance_squared(middle(c, d));
        let shortest = diagonals.into_iter().min_by(|a, b| length(*a).total_cmp(&length(*b))).expect("three");
        let others: Vec<(usize, usize)> =
            diagonals.into_iter().filter(|d| *d != shortest).flat_map(|d| d.into_iter()).collect();
        for (n, &(a, b)) in others.iter().enumerate() {
            for &(c, d) in &others[n + 1..] {
                if [c, d].contains(&a) || [c, d].contains(&b) {
                    let [(e, f), (g, h)] = shortest;
                    cells.insert(bits([middle(e, f), middle(g, h), middle(a, b), middle(c, d)]));
                }
            }
        }
        cells
    };
    mesh.cells.tets.iter().map(eight).collect()
}

#[test]
fn every_cell_is_split_as_the_slow_oracle_splits_it() {
    let (mesh, values) = jittered();
    let (fine, fine_values) = split(&mesh, &values);
    let places = |tets: &[[u32; 4]], points: &[DVec3]| -> BTreeSet<[[u64; 3]; 4]> {
        let place = |tet: &[u32; 4]| {
            let mut cell = tet.map(|v| points[v as usize].to_array());
            cell.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
            cell.map(|p| p.map(f64::to_bits))
        };
        tets.iter().map(place).collect()
    };
    let oracle = naive_split(&mesh);
    let agree =
        |points: &[DVec3]| fine.cells.tets.chunks(8).zip(&oracle).all(|(eight, naive)| places(eight, points) == *naive);
    assert!(oracle.iter().all(|cells| cells.len() == 8));
    assert!(agree(&fine.points));
    let mut moved = fine.points.clone();
    moved[mesh.points.len()].x += 1e-9;
    assert!(!agree(&moved), "the comparison sees nothing");

    // The scalar of a midpoint, found by position, is the mean of its ends.
    let by_place: BTreeMap<[u64; 3], f32> =
        fine.points.iter().map(|p| p.to_array().map(f64::to_bits)).zip(fine_values).collect();
    for (a, b) in mesh.cells.tets.iter().flat_map(pairs) {
        let [p, q] = [a, b].map(|v| mesh.points[v as usize]);
        let mean = (f64::from(values[a as usize]) + f64::from(values[b as usize])) / 2.0;
        assert_eq!(by_place[&(0.5 * p + 0.5 * q).to_array().map(f64::to_bits)], mean as f32);
    }
}

#[test]
fn a_cell_that_names_a_vertex_twice_counts_eight_times_and_makes_no_points() {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mesh = RawMesh { points, cells: vec![[0, 0, 1, 2], [0, 1, 2, 3]].into() };
    let (once, values) = split(&mesh, &[1.0; 4]);
    let (twice, _) = split(&once, &values);
    assert_eq!((once.points.len(), once.cells.tets.len(), twice.cells.tets.len()), (10, 16, 128));
    let (_, report) = crate::mesh::Mesh::build(twice).expect("a mesh");
    assert_eq!((report.zero_volume, report.cells_out, report.parts, report.boundary_faces), (64, 64, 1, 64));
    assert_eq!(report.duplicate_cells + report.coincident_points + report.unreferenced_vertices, 0);
}

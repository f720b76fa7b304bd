use super::super::test_meshes::{Random, kuhn_grid};
use super::super::{Cells, Mesh, RawMesh, RepairReport};
use super::*;
use ConnectivityChoice::{Auto, Full, None as Without};
use glam::DVec3;

/// Cells with vertices of their own, in random order.
fn torn(raw: &RawMesh, seed: u64) -> RawMesh {
    let mut tets = raw.cells.tets.clone();
    Random::new(seed).shuffle(&mut tets);
    let points = tets.iter().flatten().map(|&v| raw.points[v as usize]).collect();
    let tets: Vec<[u32; 4]> = (0..tets.len() as u32).map(|cell| [0, 1, 2, 3].map(|i| 4 * cell + i)).collect();
    RawMesh { points, cells: tets.into() }
}

fn build(raw: &RawMesh, choice: ConnectivityChoice) -> (Mesh, RepairReport) {
    Mesh::build_as(raw.clone(), choice).unwrap()
}

/// The first `share` of the cells torn out.
fn partly_torn(raw: &RawMesh, share: f64) -> RawMesh {
    let count = (share * raw.cells.tets.len() as f64) as usize;
    let mut mesh = raw.clone();
    for tet in &mut mesh.cells.tets[..count] {
        for v in tet {
            mesh.points.push(raw.points[*v as usize]);
            *v = mesh.points.len() as u32 - 1;
        }
    }
    mesh
}

#[test]
fn a_soup_is_stored_without_connectivity_and_a_mesh_with_it() {
    let whole = kuhn_grid([5, 4, 3]);
    let soup = torn(&whole, 3);
    let cells = whole.cells.tets.len() as u64;
    let (mesh, report) = build(&soup, Auto);
    assert!(!mesh.is_connected && mesh.topology.known_connectivity().is_none());
    let outside = 4 * (5 * 4 + 4 * 3 + 3 * 5);
    let expected = Unconnected { faces: 4 * cells, alone: 4 * cells, open: outside, overlapping: 0, duplicates: 0 };
    assert_eq!((report.unconnected, report.cells_out, report.vertices_out), (Some(expected), cells, 4 * cells));
    assert_eq!((report.parts, report.boundary_faces, report.non_manifold_faces), (0, 0, 0));
    let text = report.to_string();
    assert!(text.contains("without connectivity") && text.contains("--connectivity full"), "{text}");
    // The same cells.
    let (connected, with) = build(&soup, Full);
    assert!(connected.is_connected && with.unconnected.is_none());
    assert_eq!((with.parts, with.boundary_faces), (cells, 4 * cells));
    assert_eq!(connected.topology.tets, mesh.topology.tets);
    assert_eq!((&connected.positions, &connected.cell_source), (&mesh.positions, &mesh.cell_source));

    for choice in [Auto, Full] {
        let (mesh, report) = build(&whole, choice);
        assert!(mesh.is_connected && report.unconnected.is_none(), "{choice}");
        assert_eq!((mesh.topology, report), (build(&whole, Full).0.topology, build(&whole, Full).1));
    }
    let (mesh, report) = build(&whole, Without);
    assert!(!mesh.is_connected);
    let expected = Unconnected { faces: 4 * cells, alone: outside, open: outside, overlapping: 0, duplicates: 0 };
    assert_eq!(report.unconnected, Some(expected));
}

#[test]
fn more_than_half_of_the_faces_alone_are_a_soup() {
    let whole = kuhn_grid([4, 4, 4]);
    for share in [0.0, 0.2, 0.35, 0.5, 0.8, 1.0] {
        let raw = partly_torn(&whole, share);
        let (_, full) = build(&raw, Full);
        let is_soup = 2 * full.boundary_faces > 4 * full.cells_out;
        assert_eq!(build(&raw, Auto).1.unconnected.is_some(), is_soup, "{share}");
        assert_eq!(build(&raw, Without).1.unconnected.map(|found| found.alone), Some(full.boundary_faces), "{share}");
    }
}

#[test]
fn duplicates_overlaps_gaps_and_hanging_nodes_are_counted() {
    let cube = kuhn_grid([1, 1, 1]);
    let of = |raw: &RawMesh| build(&torn(raw, 1), Without).1.unconnected.unwrap();
    let plain = of(&cube);
    assert_eq!((plain.open, plain.overlapping, plain.duplicates), (12, 0, 0));
    // The first cell twice: its two outer faces are crowded, and its two inner ones.
    let mut twice = cube.clone();
    twice.cells.tets.push(cube.cells.tets[0]);
    let found = of(&twice);
    assert_eq!((found.duplicates, found.overlapping), (1, 2 * 2 + 2 * 3), "each face once for each of its cells");
    // Without the first cell its neighbours' faces are open: a gap.
    let mut gap = cube.clone();
    gap.cells.tets.remove(0);
    assert_eq!(of(&gap).open, 12 - 2 + 2);
    // Beside it a cube of half the size: faces do not fit.
    let mut hanging = cube.clone();
    let first = hanging.points.len() as u32;
    hanging.points.extend(cube.points.iter().map(|p| 0.5 * *p + DVec3::X));
    hanging.cells.tets.extend(cube.cells.tets.iter().map(|tet| tet.map(|v| v + first)));
    assert_eq!(of(&hanging).open, 24);
}

#[test]
fn a_sample_decides_where_it_is_clear_and_all_faces_where_it_is_not() {
    // More stretches than a sample has.
    let whole = kuhn_grid([20, 20, 20]);
    let cells = whole.cells.tets.len() as u64;
    let found = |raw: &RawMesh| build(raw, Without).1.unconnected.unwrap();
    let sampled = found(&whole);
    assert_eq!(sampled.faces, 4 * (LEAST * STRETCH) as u64);
    assert!(sampled.faces < 4 * cells && 4 * sampled.alone < sampled.faces);
    assert!(sampled.alone > 0 && sampled.alone < 6 * 2 * 400);
    let soup = found(&torn(&whole, 9));
    assert_eq!((soup.faces, soup.alone), (sampled.faces, sampled.faces));
    assert!(build(&torn(&whole, 9), Auto).1.unconnected.is_some());
    // Half of the mesh torn: the sample says about half, and is not taken at its word.
    for share in [0.4, 0.6] {
        let raw = partly_torn(&whole, share);
        let (found, (mesh, report)) = (found(&raw), build(&raw, Auto));
        assert!(4 * found.alone > found.faces && 4 * found.alone < 3 * found.faces, "{found:?}");
        let full = build(&raw, Full).1;
        assert_eq!(report.unconnected.is_some(), 2 * full.boundary_faces > 4 * cells, "{share}");
        assert_eq!(mesh.is_connected, mesh.topology.known_connectivity().is_some());
    }
}

#[test]
fn the_report_does_not_depend_on_the_number_of_threads() {
    let raw = torn(&kuhn_grid([20, 20, 20]), 4);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build(&raw, Auto).1)
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn a_few_cells_are_no_soup() {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let one = RawMesh { points, cells: Cells::from(vec![[0, 1, 2, 3]]) };
    let found = build(&one, Without).1.unconnected.unwrap();
    assert_eq!((found.faces, found.alone, found.open), (4, 4, 4));
    assert!(build(&one, Auto).0.is_connected);
    let cubes = |n: usize| build(&torn(&kuhn_grid([n, 1, 1]), 2), Auto).0.is_connected;
    assert_eq!((cubes(10), cubes(11)), (true, false), "60 and 66 cells");
}

//! Building meshes: closed forms, random defects against the clean build, and a naive oracle for faces.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Vec3};
use proptest::prelude::*;

use super::curve::{ascending, cell_curve_index, curve_index};
use super::faces::{ascending_face, connect_in_parts};
use super::test_meshes::{Random, jittered, kuhn_grid, kuhn_grid_of, shuffled};
use super::{
    CellNeighbour, Connectivity, ConnectivityChoice, Mesh, MeshError, NONE, Positions, RawMesh, RepairReport, Topology,
    tet_volume,
};

fn build(raw: &RawMesh) -> (Mesh, RepairReport) {
    let (mesh, report) = Mesh::build(raw.clone()).unwrap();
    mesh.check().unwrap();
    (mesh, report)
}

fn unit_tet() -> RawMesh {
    RawMesh { points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], cells: vec![[0, 1, 2, 3]].into() }
}

#[test]
fn a_regular_grid_has_the_counts_of_its_closed_form() {
    for n in 1..=4 {
        let (mesh, report) = build(&kuhn_grid([n, n, n]));
        let n = n as u64;
        let boundary = 12 * n * n;
        assert!(report.is_clean(), "{report}");
        assert_eq!(report.cells_out, 6 * n.pow(3));
        assert_eq!(report.vertices_out, (n + 1).pow(3));
        assert_eq!(report.boundary_faces, boundary);
        assert_eq!(mesh.topology.connectivity().faces.len() as u64, (24 * n.pow(3) + boundary) / 2);
        assert_eq!(report.parts, 1);
        // Vertices - edges + faces - cells of a ball is 1.
        let edges: BTreeSet<_> =
            mesh.topology.connectivity().faces.iter().flat_map(|&[a, b, c]| [[a, b], [a, c], [b, c]]).collect();
        let euler = report.vertices_out as i64 - edges.len() as i64 + mesh.topology.connectivity().faces.len() as i64
            - report.cells_out as i64;
        assert_eq!(euler, 1);
    }
}

#[test]
fn the_volumes_of_the_cells_add_up_to_that_of_the_grid() {
    let (mesh, _) = build(&kuhn_grid([4, 2, 3]));
    let world = mesh.total_volume() * mesh.positions.scale.powi(3);
    // All coordinates are small integers; the sixths round, each by less than an ulp of the sum.
    assert!((world - 24.0).abs() <= 144.0 * 24.0 * f64::EPSILON, "{world}");
    let cells: f64 = (0..144).map(|cell| mesh.cell_volume(cell)).sum();
    assert_eq!(cells, mesh.total_volume(), "one run of cells, summed in order");
}

#[test]
fn a_single_tet_is_a_mesh() {
    let (mesh, report) = build(&unit_tet());
    assert!(report.is_clean());
    assert_eq!(report.to_string(), "1 cell, 4 vertices, 4 boundary faces, 1 part");
    assert_eq!(mesh.topology.connectivity().faces, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]);
    assert_eq!(mesh.topology.connectivity().face_cells, [[0, NONE]; 4]);
    assert_eq!(mesh.topology.connectivity().neighbours, [[CellNeighbour::NONE; 4]]);
}

#[test]
fn vertices_and_cells_lie_along_the_curve_and_know_where_they_came_from() {
    let mut random = Random::new(5);
    let raw = shuffled(&jittered(kuhn_grid([3, 4, 5]), &mut random), &mut random).0;
    let (mesh, _) = build(&raw);
    let local = &mesh.positions.local;
    assert!(local.windows(2).all(|pair| curve_index(pair[0].as_dvec3()) <= curve_index(pair[1].as_dvec3())));
    let cell_index = |tet: &[u32; 4]| cell_curve_index(*tet, local);
    assert!(mesh.topology.tets.is_sorted_by_key(cell_index));
    for (vertex, &source) in mesh.vertex_source.iter().enumerate() {
        // A local unit is 4 world units here; rounding to f32 is off by half a unit in the 24th bit on each axis.
        let error = (mesh.positions.world(vertex) - raw.points[source as usize]).abs().max_element();
        assert!(error <= mesh.positions.scale * 2f64.powi(-25), "{error:e}");
    }
    for (tet, &source) in mesh.topology.tets.iter().zip(&mesh.cell_source) {
        assert_eq!(ascending(tet.map(|v| mesh.vertex_source[v as usize])), ascending(raw.cells.tets[source as usize]));
    }
}

#[test]
fn a_hole_inside_has_boundary_faces_too() {
    let (_, report) = build(&kuhn_grid_of([3, 3, 3], |cube| cube != [1, 1, 1]));
    assert_eq!((report.parts, report.boundary_faces, report.cells_out), (1, 12 * 9 + 12, 6 * 26));
    assert_eq!(report.unreferenced_vertices, 0);
}

#[test]
fn parts_that_touch_in_an_edge_or_a_vertex_are_not_connected() {
    for (n, far, shared) in [([2, 2, 1], [1, 1, 0], 2), ([2, 2, 2], [1, 1, 1], 1)] {
        let (_, report) = build(&kuhn_grid_of(n, |cube| cube == [0, 0, 0] || cube == far));
        assert_eq!((report.parts, report.non_manifold_faces, report.boundary_faces), (2, 0, 24));
        assert_eq!(report.vertices_out, 16 - shared);
    }
}

#[test]
fn two_cells_on_the_same_side_of_a_face_are_not_neighbours() {
    let mut raw = unit_tet();
    raw.points.push(DVec3::new(0.2, 0.2, 2.0));
    raw.cells.tets.push([0, 1, 2, 4]);
    let (mesh, report) = build(&raw);
    assert_eq!((report.non_manifold_faces, report.boundary_faces, report.parts), (1, 8, 2));
    assert_eq!(mesh.topology.connectivity().faces.len(), 8, "the shared face is listed for each of its cells");
    assert!(report.to_string().contains("\nfaces of more than two cells, or of overlapping ones"));
}

#[test]
fn a_face_of_three_cells_is_boundary_for_all_of_them() {
    let mut raw = unit_tet();
    raw.points.extend([DVec3::new(0.2, 0.2, -1.0), DVec3::new(0.2, 0.2, -2.0)]);
    raw.cells.tets.extend([[0, 1, 2, 4], [0, 1, 2, 5]]);
    let (mesh, report) = build(&raw);
    assert_eq!((report.non_manifold_faces, report.boundary_faces, report.parts), (1, 12, 3));
    assert!(mesh.topology.connectivity().neighbours.iter().flatten().all(|side| *side == CellNeighbour::NONE));
}

#[test]
fn bad_indices_and_bad_points_are_named() {
    let mut raw = unit_tet();
    raw.cells.tets.push([0, 1, 2, 4]);
    let error = Mesh::build(raw).unwrap_err();
    assert_eq!(error, MeshError::VertexOutOfRange { cell: 1, index: 4, vertex_count: 4 });

    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut raw = unit_tet();
        raw.points[2].y = bad;
        let error = Mesh::build(raw).unwrap_err();
        assert!(matches!(error, MeshError::NotFinite { point: 2, .. }), "{error}");
    }
}

#[test]
fn a_bad_point_that_no_cell_needs_is_dropped() {
    let mut raw = unit_tet();
    raw.points.extend([DVec3::NAN, DVec3::splat(1e30)]);
    raw.cells.tets.push([0, 4, 4, 5]);
    let (mesh, report) = build(&raw);
    assert_eq!((report.unreferenced_vertices, report.zero_volume), (2, 1));
    assert_eq!(mesh.positions, build(&unit_tet()).0.positions);
}

#[test]
fn without_cells_there_is_no_mesh() {
    assert_eq!(Mesh::build(RawMesh::default()).unwrap_err(), MeshError::NoCells);
    let mut plane = kuhn_grid([2, 2, 2]);
    plane.points.iter_mut().for_each(|p| p.z = p.x - 3.0 * p.y);
    assert_eq!(Mesh::build(plane).unwrap_err(), MeshError::AllFlat(48));
    // So far from the origin that f64 resolves only one of the points.
    let mut far = unit_tet();
    far.points.iter_mut().for_each(|p| *p += 1e20);
    assert_eq!(Mesh::build(far).unwrap_err(), MeshError::AllFlat(1));
}

#[test]
fn coincident_points_are_counted_and_kept() {
    // Two cubes with separate points on their common side: a crack.
    let (a, mut b) = (kuhn_grid([1, 1, 1]), kuhn_grid([1, 1, 1]));
    b.points.iter_mut().for_each(|p| p.x += 1.0);
    let tets: Vec<_> = a.cells.tets.iter().copied().chain(b.cells.tets.iter().map(|tet| tet.map(|v| v + 8))).collect();
    let (_, report) = build(&RawMesh { points: [a.points, b.points].concat(), cells: tets.into() });
    assert_eq!((report.coincident_points, report.vertices_out, report.parts), (4, 16, 2));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let mut random = Random::new(11);
    let (mut raw, _) = shuffled(&jittered(kuhn_grid([12, 11, 10]), &mut random), &mut random);
    let repeated: Vec<_> = raw.cells.tets.iter().step_by(7).map(|&[a, b, c, d]| [b, a, c, d]).collect();
    raw.cells.tets.extend(repeated);
    let with_threads = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        let (mesh, report) = pool.install(|| build(&raw));
        let volume = pool.install(|| mesh.total_volume());
        (mesh.topology, mesh.positions, mesh.vertex_source, mesh.cell_source, report, volume)
    };
    assert_eq!(with_threads(1), with_threads(4));
}

/// Neighbours of all cells by comparing each with all others; sides by coordinates.
fn naive_neighbours(tets: &[[u32; 4]], positions: &Positions) -> (Vec<[CellNeighbour; 4]>, u64) {
    let side_of = |tet: [u32; 4], local: u32| {
        let [a, b, c] = ascending_face(tet, local);
        tet_volume(positions.corners([a, b, c, tet[local as usize]])) > 0.0
    };
    let halves: Vec<_> = (0..tets.len() as u32).flat_map(|cell| (0..4).map(move |local| (cell, local))).collect();
    let face = |(cell, local): (u32, u32)| ascending_face(tets[cell as usize], local);
    let mut neighbours = vec![[CellNeighbour::NONE; 4]; tets.len()];
    let mut non_manifold = BTreeSet::new();
    for &here in &halves {
        let others: Vec<_> =
            halves.iter().copied().filter(|&there| there != here && face(there) == face(here)).collect();
        let side = |(cell, local): (u32, u32)| side_of(tets[cell as usize], local);
        match others[..] {
            [] => {}
            [there] if side(here) != side(there) => {
                neighbours[here.0 as usize][here.1 as usize] = CellNeighbour::new(there.0, there.1);
            }
            _ => {
                non_manifold.insert(face(here));
            }
        }
    }
    (neighbours, non_manifold.len() as u64)
}

/// Random tets between few points on a lattice: overlapping, flat, doubled, wound either way.
fn random_soup(seed: u64, points: usize, cells: usize) -> RawMesh {
    let mut random = Random::new(seed);
    let mut coordinate = || random.below(5) as f64;
    let points: Vec<_> = (0..points).map(|_| DVec3::from_array(std::array::from_fn(|_| coordinate()))).collect();
    let tets: Vec<_> = (0..cells).map(|_| std::array::from_fn(|_| random.below(points.len()) as u32)).collect();
    RawMesh { points, cells: tets.into() }
}

/// Cells as sets of labelled vertices, with the positions of these.
fn labelled_cells(mesh: &Mesh, label: impl Fn(u32) -> u32) -> BTreeMap<[u32; 4], Vec<[u32; 3]>> {
    let cell = |tet: &[u32; 4]| {
        let mut vertices = tet.map(|v| (label(mesh.vertex_source[v as usize]), mesh.positions.local[v as usize]));
        vertices.sort_by_key(|vertex| vertex.0);
        (vertices.map(|vertex| vertex.0), vertices.map(|vertex| vertex.1.to_array().map(f32::to_bits)).to_vec())
    };
    mesh.topology.tets.iter().map(cell).collect()
}

/// Faces as sets of labelled vertices, with the cells on their sides.
fn labelled_faces(mesh: &Mesh, label: impl Fn(u32) -> u32) -> BTreeSet<([u32; 3], Vec<[u32; 4]>)> {
    let labels = |v: u32| label(mesh.vertex_source[v as usize]);
    let face = |(face, cells): (&[u32; 3], &[u32; 2])| {
        let mut vertices = face.map(labels);
        vertices.sort_unstable();
        let cells = cells.iter().filter(|&&cell| cell != NONE);
        let mut cells: Vec<_> = cells.map(|&cell| ascending(mesh.topology.tets[cell as usize].map(labels))).collect();
        cells.sort_unstable();
        (vertices, cells)
    };
    mesh.topology.connectivity().faces.iter().zip(&mesh.topology.connectivity().face_cells).map(face).collect()
}

/// Number of each kind of defect to add.
#[derive(Clone, Copy, Debug)]
struct Defects {
    flips: usize,
    duplicates: usize,
    flats: usize,
    unreferenced: usize,
}

/// Adds defects that are repaired. New points lie within the box of the old ones or far outside of it.
fn spoil(raw: &mut RawMesh, defects: Defects, random: &mut Random) {
    let (clean_cells, clean_points) = (raw.cells.tets.len(), raw.points.len());
    for _ in 0..defects.duplicates {
        let mut tet = raw.cells.tets[random.below(clean_cells)];
        random.shuffle(&mut tet);
        raw.cells.tets.push(tet);
    }
    for i in 0..defects.flats {
        let mut tet = raw.cells.tets[random.below(clean_cells)];
        let corner = random.below(4);
        tet[corner] = if i % 2 == 0 {
            tet[(corner + 1) % 4]
        } else {
            // A new point at the position of another vertex.
            raw.points.push(raw.points[tet[(corner + 1) % 4] as usize]);
            raw.points.len() as u32 - 1
        };
        raw.cells.tets.push(tet);
    }
    for i in 0..defects.unreferenced {
        let bad = [DVec3::NAN, DVec3::splat(1e200), raw.points[random.below(clean_points)]];
        raw.points.push(bad[i % 3]);
    }
    // Flips come before duplicates, so that the copy kept may be flipped or not.
    for cell in 0..defects.flips.min(clean_cells) {
        raw.cells.tets[cell].swap(0, 3);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn defects_are_repaired_to_the_clean_mesh(
        seed: u64,
        n in prop::array::uniform3(1usize..4),
        (flips, duplicates, flats, unreferenced) in (0usize..20, 0usize..8, 0usize..8, 0usize..6),
    ) {
        let mut random = Random::new(seed);
        let clean = jittered(kuhn_grid(n), &mut random);
        let (expected, clean_report) = build(&clean);
        prop_assert!(clean_report.is_clean());

        let mut spoilt = clean.clone();
        spoil(&mut spoilt, Defects { flips, duplicates, flats, unreferenced }, &mut random);
        let (spoilt, labels) = shuffled(&spoilt, &mut random);
        let (mesh, report) = build(&spoilt);

        prop_assert_eq!((mesh.positions.origin, mesh.positions.scale), (expected.positions.origin, expected.positions.scale));
        let label = |v: u32| labels[v as usize];
        prop_assert_eq!(labelled_cells(&mesh, label), labelled_cells(&expected, |v| v));
        prop_assert_eq!(labelled_faces(&mesh, label), labelled_faces(&expected, |v| v));
        prop_assert_eq!(report.duplicate_cells, duplicates as u64);
        prop_assert_eq!(report.zero_volume, flats as u64);
        prop_assert_eq!(report.unreferenced_vertices, (flats / 2 + unreferenced) as u64);
        prop_assert_eq!((report.cells_out, report.vertices_out), (clean_report.cells_out, clean_report.vertices_out));
        prop_assert_eq!((report.boundary_faces, report.parts), (clean_report.boundary_faces, 1));
        // Sources and turns map back to the cells of the file.
        for (tet, (&source, &turned)) in mesh.topology.tets.iter().zip(mesh.cell_source.iter().zip(&mesh.cell_turned)) {
            let [a, b, c, d] = tet.map(|v| mesh.vertex_source[v as usize]);
            prop_assert_eq!(if turned { [a, b, d, c] } else { [a, b, c, d] }, spoilt.cells.tets[source as usize]);
        }
        // Duplicates were shuffled, hence count as flipped or not by chance.
        let flips = flips.min(clean.cells.tets.len()) as u64;
        prop_assert!((flips..=flips + duplicates as u64).contains(&report.flipped));
    }

    #[test]
    fn the_order_and_orientation_of_cells_and_vertices_change_nothing_but_numbers(
        seed: u64, n in prop::array::uniform3(1usize..4),
    ) {
        let mut random = Random::new(seed);
        let raw = jittered(kuhn_grid(n), &mut random);
        let (expected, _) = build(&raw);
        let (mut other, labels) = shuffled(&raw, &mut random);
        other.cells.tets.iter_mut().for_each(|tet| random.shuffle(tet));
        let (mesh, report) = build(&other);
        mesh.check().unwrap();
        prop_assert_eq!(labelled_faces(&mesh, |v| labels[v as usize]), labelled_faces(&expected, |v| v));
        // Every inner face belongs to two cells, each of which has it as one of four.
        let inner = mesh.topology.connectivity().face_cells.iter().filter(|cells| cells[1] != NONE).count();
        prop_assert_eq!(mesh.topology.connectivity().faces.len() + inner, 4 * mesh.topology.tets.len());
        prop_assert_eq!(report.boundary_faces, (mesh.topology.connectivity().faces.len() - inner) as u64);
        // Volumes are positive, and their sum does not depend on the order but for rounding: each of N is below the sum V, so that
        // adding them rounds by N V ulp at most; what corners in another order round to is far below.
        let cells = mesh.topology.tets.len() as u32;
        prop_assert!((0..cells).all(|cell| mesh.cell_volume(cell) > 0.0));
        let (a, b) = (mesh.total_volume(), expected.total_volume());
        prop_assert!((a - b).abs() <= 2.0 * f64::from(cells) * f64::EPSILON * b, "{a} {b}");
    }

    #[test]
    fn faces_and_neighbours_are_those_of_a_naive_search(seed: u64, points in 4usize..12, cells in 1usize..40) {
        let raw = random_soup(seed, points, cells);
        let Ok((mesh, report)) = Mesh::build(raw) else { return Ok(()) };
        mesh.check().unwrap();
        let (neighbours, non_manifold) = naive_neighbours(&mesh.topology.tets, &mesh.positions);
        prop_assert_eq!(&mesh.topology.connectivity().neighbours, &neighbours);
        for most in [1, 7, 30] {
            let in_parts = connect_in_parts(mesh.topology.vertex_count, &mesh.topology.tets, most);
            prop_assert_eq!(&in_parts, mesh.topology.connectivity(), "parts of {}", most);
        }
        prop_assert_eq!(report.non_manifold_faces, non_manifold);
        let sides = neighbours.iter().flatten().filter(|side| **side == CellNeighbour::NONE).count();
        prop_assert_eq!(report.boundary_faces, sides as u64);
        prop_assert_eq!(2 * mesh.topology.connectivity().faces.len() - sides, 4 * mesh.topology.tets.len());
    }

    #[test]
    fn neither_size_nor_offset_changes_the_mesh(seed: u64, exponent in -1040i32..990, steps in -(1i64 << 30)..1 << 30) {
        // Small integers on a box of odd centre: every number here is exact unless it is subnormal, so that the mesh is
        // the same to the bit. Below 2^-1022 the multiples of the smallest number still hold these coordinates.
        let raw = shuffled(&kuhn_grid([2, 3, 2]), &mut Random::new(seed)).0;
        let (unit, unit_report) = build(&raw);
        let size = 2f64.powi(exponent / 2) * 2f64.powi(exponent - exponent / 2);
        let moved = raw.points.iter().map(|&p| 2.0 * size * (p + DVec3::new(steps as f64, 0.0, -1.0))).collect();
        let (mesh, report) = build(&RawMesh { points: moved, cells: raw.cells });
        prop_assert_eq!(&mesh.positions.local, &unit.positions.local);
        prop_assert_eq!(&mesh.topology, &unit.topology);
        prop_assert_eq!((mesh.vertex_source, mesh.cell_source, report), (unit.vertex_source, unit.cell_source, unit_report));
    }
}

#[test]
fn meshes_at_extremes_of_size_and_offset_are_whole() {
    for (size, offset) in [(1.0, 1e9), (1e-300, 0.0), (1e300, 0.0), (8e307, -4e307), (1e-3, -1e9), (5e-324, 0.0)] {
        let mut raw = kuhn_grid([2, 2, 2]);
        raw.points.iter_mut().for_each(|p| *p = *p * size + offset);
        let (mesh, report) = build(&raw);
        assert!(report.is_clean(), "{size:e} at {offset:e}: {report}");
        assert_eq!((report.cells_out, report.boundary_faces), (48, 48));
        let reach = mesh.positions.local.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
        assert!((0.5..=1.0).contains(&reach), "{size:e} at {offset:e}: {reach}");
        assert!(mesh.total_volume() > 0.0);
    }
}

#[test]
fn a_bar_of_extreme_aspect_is_whole() {
    let mut raw = kuhn_grid([4, 1, 1]);
    raw.points.iter_mut().for_each(|p| *p *= DVec3::new(1e12, 1e-12, 1.0));
    let (_, report) = build(&raw);
    assert!(report.is_clean(), "{report}");
}

#[test]
fn a_fan_around_one_vertex_is_whole() {
    // All cells share two vertices: the longest possible bucket of half-faces.
    let n = 3000u32;
    let rim = (0..n)
        .map(|i| DVec3::from((glam::DVec2::from_angle(f64::from(i) * std::f64::consts::TAU / f64::from(n)), 0.0)));
    let points = [DVec3::Z, -DVec3::Z].into_iter().chain(rim).collect();
    let tets: Vec<_> = (0..n).map(|i| [1, 0, 2 + i, 2 + (i + 1) % n]).collect();
    let (_, report) = build(&RawMesh { points, cells: tets.into() });
    assert_eq!((report.cells_out, report.boundary_faces, report.parts), (3000, 6000, 1));
    assert_eq!((report.non_manifold_faces, report.zero_volume), (0, 0));
}

#[test]
fn stored_cells_give_the_topology_that_was_built() {
    let (mesh, _) = build(&jittered(kuhn_grid([3, 2, 3]), &mut Random::new(3)));
    let topology = mesh.topology;
    let again = Topology::from_tets(topology.vertex_count, topology.tets.clone(), &mesh.positions).unwrap();
    assert_eq!(again.known_connectivity(), None, "it is made when first asked for");
    assert_eq!((&again.tets, again.connectivity()), (&topology.tets, topology.connectivity()));
    assert_eq!(again.known_connectivity(), Some(topology.connectivity()));

    let mut turned = topology.tets.clone();
    turned[5].swap(0, 1);
    let error = Topology::from_tets(topology.vertex_count, turned, &mesh.positions).unwrap_err();
    assert!(matches!(error, MeshError::BadEntry { array: "tets", entry: 5, .. }), "{error}");
    let error = Topology::from_tets(topology.vertex_count + 1, topology.tets, &mesh.positions).unwrap_err();
    assert!(matches!(error, MeshError::WrongLength { array: "points", .. }), "{error}");
}

/// A topology from another one's arrays after `spoil`.
fn stored(topology: &Topology, spoil: impl Fn(&mut Topology)) -> Result<Topology, MeshError> {
    let mut spoilt = topology.clone();
    spoil(&mut spoilt);
    let connectivity = spoilt.connectivity().clone();
    Topology::from_parts(spoilt.vertex_count, spoilt.tets, connectivity)
}

#[test]
fn stored_arrays_that_lead_out_of_bounds_are_refused() {
    let topology = build(&kuhn_grid([1, 1, 1])).0.topology;
    assert_eq!(stored(&topology, |_| ()).as_ref(), Ok(&topology));
    type Spoil = fn(&mut Topology);
    fn known(topology: &mut Topology) -> &mut Connectivity {
        topology.connectivity.get_mut().unwrap()
    }
    let spoilers: [(&str, Spoil); 11] = [
        ("cell 2 names point 8", |t| t.tets[2][1] = 8),
        ("names point 7, but there are 7", |t| t.vertex_count = 7),
        ("neighbours has 5 entries instead of 6", |t| known(t).neighbours.truncate(5)),
        ("neighbours, entry 1", |t| known(t).neighbours[1][3] = CellNeighbour::new(6, 0)),
        ("faces, entry 4", |t| known(t).faces[4][2] = 8),
        ("faces, entry 4", |t| known(t).faces[4].swap(0, 1)),
        ("face_cells has 17 entries instead of 18", |t| known(t).face_cells.truncate(17)),
        ("face_cells, entry 0", |t| known(t).face_cells[0][0] = 6),
        ("face_cells, entry 0", |t| known(t).face_cells[0] = [1, 1]),
        ("face_cells, entry 3", |t| known(t).face_cells[3] = [NONE, NONE]),
        ("faces of all cells has", |t| {
            known(t).faces.truncate(17);
            known(t).face_cells.truncate(17);
        }),
    ];
    for (expected, spoil) in spoilers {
        let message = stored(&topology, spoil).unwrap_err().to_string();
        assert!(message.contains(expected), "{message} instead of {expected}");
    }
}

#[test]
fn arrays_that_contradict_each_other_are_found() {
    let mesh = build(&kuhn_grid([2, 1, 1])).0;
    let interior = mesh.topology.connectivity().face_cells.iter().position(|cells| cells[1] != NONE).unwrap();
    let side = mesh.topology.connectivity().neighbours[0].iter().position(|side| *side != CellNeighbour::NONE).unwrap();
    fn known(mesh: &mut Mesh) -> &mut Connectivity {
        mesh.topology.connectivity.get_mut().unwrap()
    }
    let found = |spoil: &dyn Fn(&mut Mesh)| {
        let mut spoilt = mesh.clone();
        spoil(&mut spoilt);
        spoilt.check().unwrap_err().to_string()
    };
    assert!(found(&|m| known(m).neighbours[0][side] = CellNeighbour::NONE).contains("not mutual"));
    assert!(found(&|m| m.topology.tets[0].swap(0, 1)).starts_with("neighbours"));
    assert!(found(&|m| known(m).faces.swap(2, 3)).contains("ascending order"));
    assert!(found(&|m| known(m).face_cells[interior][1] ^= 1).contains("face_cells"));
    assert!(found(&|m| m.positions.local.iter_mut().for_each(|p| p.x = -p.x)).contains("inside out"));
    assert!(found(&|m| m.cell_source.truncate(3)).contains("cell_source"));
    let unused = |m: &mut Mesh| {
        m.topology.vertex_count += 1;
        m.positions.local.push(Vec3::ZERO);
        m.vertex_source.push(99);
    };
    assert!(found(&unused).contains("no cell uses"));
}

#[test]
fn cells_of_a_mesh_are_numbered_as_the_cells_that_they_are_a_part_of() {
    let cube = kuhn_grid([2, 1, 1]);
    // Two cubes of six tetrahedra each, and the tetrahedra as cells of their own.
    let cell_of_tet: Vec<u32> = (0..12).map(|tet| tet / 6).collect();
    let split = super::Split {
        tets: cube.cells.tets.clone(),
        cell_of_tet: Some(cell_of_tet),
        ..super::split(Vec::new().into(), &[])
    };
    let (mesh, report) = Mesh::build_split(cube.points.clone(), split, ConnectivityChoice::Full).unwrap();
    let (alone, of_alone) = Mesh::build(cube).unwrap();
    // Named by the cells of the source.
    let worst_cells = report.worst_cells.clone();
    assert!(worst_cells.len() == 2 && worst_cells.iter().all(|worst| worst.source < 2));
    let expected = super::RepairReport { cells_in: 2, split_cells: 2, worst_cells, ..of_alone };
    assert_eq!((mesh.topology.tets.clone(), report), (alone.topology.tets, expected));
    let expected: Vec<u32> = alone.cell_source.iter().map(|tet| tet / 6).collect();
    assert_eq!(mesh.cell_source, expected);
}

//! Cells that are cut from a point in their middle, and those beside them that are not.

use super::split::pull;
use super::steiner::sorted;
use super::test_meshes::Random;
use super::*;
use std::collections::{BTreeSet, HashMap};

/// The unit cube as VTK numbers its corners.
const CUBE: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [0.0, 1.0, 1.0],
];

fn points(of: &[[f64; 3]]) -> Vec<DVec3> {
    of.iter().map(|&p| DVec3::from(p)).collect()
}

/// A cube whose second corner is pushed so far in that the first does not see the face behind it; its corners are dyadic fractions.
fn warped() -> RawMesh {
    let mut raw = RawMesh { points: points(&CUBE), ..RawMesh::default() };
    raw.points[1] = DVec3::new(0.4375, 0.5, 0.5);
    raw.cells.solids.push(SolidShape::Hexahedron, 0..8);
    raw
}

/// A polyhedron of these faces.
fn polyhedron(points: Vec<DVec3>, mut faces: Vec<Vec<u32>>) -> RawMesh {
    polyhedron::close(&mut faces).unwrap();
    let mut raw = RawMesh { points, ..RawMesh::default() };
    raw.cells.solids.push_polyhedron(faces.iter().map(Vec::as_slice));
    raw
}

/// Two pyramids on a polygon in the plane z = 0, one upwards and one downwards.
fn bipyramid(ring: &[[f64; 2]], pole: [f64; 2]) -> RawMesh {
    let n = ring.len() as u32;
    let mut points: Vec<DVec3> = ring.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect();
    points.extend([-1.0, 1.0].map(|z| DVec3::new(pole[0], pole[1], z)));
    let faces = (0..n).flat_map(|i| [vec![i, (i + 1) % n, n + 1], vec![(i + 1) % n, i, n]]);
    polyhedron(points, faces.collect())
}

/// What older versions made of a mesh.
fn built_from_corners(raw: &RawMesh) -> (Mesh, RepairReport) {
    let split = split_from_corners(raw.cells.clone(), &raw.points);
    Mesh::build_split(raw.points.clone(), split, ConnectivityChoice::Full).unwrap()
}

fn built(raw: &RawMesh) -> (Mesh, RepairReport) {
    let (mesh, report) = Mesh::build(raw.clone()).unwrap();
    mesh.check().unwrap();
    let added = mesh.vertex_source.iter().filter(|&&source| source as usize >= raw.points.len()).count();
    assert_eq!(mesh.split_cells.steiner.len(), added);
    assert_eq!(report.vertices_in as usize, raw.points.len());
    assert_eq!(report.vertices_in + added as u64, report.vertices_out + report.unreferenced_vertices);
    (mesh, report)
}

/// The triangles of the faces of each split cell, which do not depend on how it is cut.
fn triangles(cells: &Cells) -> Vec<Vec<[u32; 3]>> {
    let of = |solid| {
        let mut tets = Vec::new();
        pull(solid, NONE, |vertex| (0, vertex), &mut tets);
        tets.into_iter().map(|[a, b, c, _]| [a, b, c]).collect()
    };
    cells.solids.iter().map(of).collect()
}

/// Volume within triangles by the divergence theorem, in world units.
fn enclosed(triangles: &[[u32; 3]], at: impl Fn(u32) -> DVec3) -> f64 {
    let origin = at(triangles[0][0]);
    let of = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| at(vertex) - origin);
        a.dot(b.cross(c)) / 6.0
    };
    triangles.iter().map(of).sum::<f64>().abs()
}

fn volume(mesh: &Mesh) -> f64 {
    mesh.total_volume() * mesh.positions.scale.powi(3)
}

/// A cell that its corners do not fill, and a point in it does.
fn assert_mended(raw: &RawMesh) -> Mesh {
    let expected = enclosed(&triangles(&raw.cells)[0], |vertex| raw.points[vertex as usize]);
    let (before, report) = built_from_corners(raw);
    assert_eq!((report.steiner_cells, report.warped_cells), (0, 1));
    assert!(volume(&before) > expected * 1.01, "{} of {expected}", volume(&before));
    let (mesh, report) = built(raw);
    assert_eq!(
        (report.steiner_cells, report.warped_cells, report.gapped_cells, report.non_manifold_faces),
        (1, 0, 0, 0)
    );
    assert_eq!(report.boundary_faces as usize, triangles(&raw.cells)[0].len());
    assert!((volume(&mesh) / expected - 1.0).abs() < 1e-12, "{} instead of {expected}", volume(&mesh));
    assert!(report.to_string().contains("cut from a point added in their middle: 1"), "{report}");
    mesh
}

#[test]
fn a_warped_hexahedron_is_filled_once_from_the_mean_of_its_corners() {
    let raw = warped();
    let mesh = assert_mended(&raw);
    let [[0, vertex]] = mesh.split_cells.steiner[..] else { panic!("one point") };
    assert_eq!(mesh.positions.world(vertex as usize), raw.points.iter().sum::<DVec3>() / 8.0);
    assert_eq!(mesh.vertex_source[vertex as usize], 8, "numbered on from the points");
    let (steiner, corners) = mesh.split_cells.steiner_corners().next().unwrap();
    let of_source: BTreeSet<u32> = corners.iter().map(|&corner| mesh.vertex_source[corner as usize]).collect();
    assert_eq!((steiner, of_source), (vertex, (0..8).collect()));
}

#[test]
fn a_cell_numbered_the_other_way_round_is_mended_too_and_no_repair() {
    let mut raw = RawMesh { points: warped().points, ..RawMesh::default() };
    raw.cells.solids.push(SolidShape::Hexahedron, [4, 5, 6, 7, 0, 1, 2, 3].into_iter());
    assert_mended(&raw);
    assert_eq!(built(&raw).1.flipped, 0);
}

#[test]
fn star_shaped_polyhedra_are_filled_from_the_mean_or_else_from_their_centroid() {
    // A dart, which its first corner does not see whole: a tip of it, and the mean of the corners lies within, or does not.
    for tip in [2.0, 1.0] {
        let raw = bipyramid(&[[-1.0, 1.0], [0.0, 0.0], [-1.0, -1.0], [tip, 0.0]], [0.25, 0.0]);
        let mesh = assert_mended(&raw);
        let at = mesh.positions.world(mesh.split_cells.steiner[0][1] as usize);
        let mean = raw.points.iter().sum::<DVec3>() / 6.0;
        assert_eq!((at - mean).length() < 1e-7, tip == 2.0, "{at}");
        assert!(at.x > 0.0 && (tip == 2.0 || mean.x < 0.0));
    }
    // Schönhardt's twisted prism, which no tetrahedra of its corners fill.
    let corner = |i: u32| {
        let (angle, z) = (f64::from(i % 3) * 120.0 + f64::from(i / 3) * 30.0, f64::from(i / 3));
        DVec3::new(angle.to_radians().cos(), angle.to_radians().sin(), z)
    };
    let sides = (0..3).flat_map(|i| [vec![i, (i + 1) % 3, (i + 1) % 3 + 3], vec![i, (i + 1) % 3 + 3, i + 3]]);
    for mirrored in [1.0, -1.0] {
        let points = (0..6).map(|i| corner(i) * DVec3::new(1.0, mirrored, 1.0)).collect();
        let raw = polyhedron(points, sides.clone().chain([vec![2, 1, 0], vec![3, 4, 5]]).collect());
        let expected = enclosed(&triangles(&raw.cells)[0], |vertex| raw.points[vertex as usize]);
        let (mesh, report) = built(&raw);
        assert_eq!((report.warped_cells, report.gapped_cells), (0, 0));
        // Coordinates are rounded to f32.
        assert!((volume(&mesh) / expected - 1.0).abs() < 1e-6);
    }
}

#[test]
fn a_cell_that_no_point_sees_whole_stays_as_it_was_and_is_counted() {
    let ring = [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [2.0, 3.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
    let raw = bipyramid(&ring, [1.5, 0.5]);
    let (before, of_before) = built_from_corners(&raw);
    let (mesh, report) = built(&raw);
    assert_eq!((report.steiner_cells, report.warped_cells), (0, 1));
    assert_eq!((mesh.topology, mesh.positions, report), (before.topology, before.positions, of_before));
}

/// A ring of `turns` rounds between two poles.
fn wound(turns: u32) -> RawMesh {
    let n = 5 * turns;
    let angle = |i: u32| std::f64::consts::TAU * f64::from(i) / 5.0;
    let ring: Vec<[f64; 2]> = (0..n).map(|i| [angle(i).cos(), angle(i).sin()]).collect();
    bipyramid(&ring, [0.0, 0.0])
}

#[test]
fn a_cell_that_goes_round_its_middle_twice_is_not_cut_from_there() {
    // All tetrahedra with the middle have a positive volume, and lie on each other in pairs.
    let mut raw = wound(2);
    // Its first corner does not see all.
    raw.points[0] *= 0.25;
    assert_eq!(built(&raw).1.steiner_cells, 0);
    let mut once = wound(1);
    once.points[0] *= 0.25;
    assert_eq!(built(&once).1.warped_cells, 0);
}

#[test]
fn neighbours_of_a_warped_cell_are_cut_as_before_and_share_its_faces() {
    let mut raw = warped();
    // Beside it, through the face that is pushed in.
    raw.points.extend(points(&[[2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [2.0, 0.0, 1.0], [2.0, 1.0, 1.0]]));
    raw.cells.solids.push(SolidShape::Hexahedron, [1, 8, 9, 2, 5, 10, 11, 6].into_iter());
    let (mesh, report) = built(&raw);
    assert_eq!((report.steiner_cells, report.warped_cells, report.non_manifold_faces, report.parts), (1, 0, 0, 1));
    assert_eq!(report.boundary_faces, 2 * 10, "the sides of both but the one between them");
    let beside = |mesh: &Mesh| {
        let of_cell = mesh.topology.tets.iter().zip(&mesh.cell_source).filter(|(_, source)| **source == 1);
        of_cell.map(|(tet, _)| tet.map(|v| mesh.vertex_source[v as usize])).collect::<BTreeSet<_>>()
    };
    let before = built_from_corners(&raw);
    assert_eq!(beside(&mesh), beside(&before.0));
    assert!(before.1.boundary_faces > 20 || before.1.non_manifold_faces > 0 || before.1.warped_cells > 0);
    let at = |vertex: u32| raw.points[vertex as usize];
    let expected: f64 = triangles(&raw.cells).iter().map(|triangles| enclosed(triangles, at)).sum();
    assert!((volume(&mesh) / expected - 1.0).abs() < 1e-12);
}

#[test]
fn a_side_of_several_faces_that_have_no_vertex_in_common_is_left_open_by_none() {
    // The side x = 1 of a cube is six triangles with two points within, the first of which has the least number.
    let mut at = points(&[[1.0, 0.25, 0.5], [1.0, 0.75, 0.5]]);
    at.extend(points(&CUBE));
    let side = [[3, 4, 1], [4, 8, 1], [8, 7, 0], [7, 3, 0], [0, 3, 1], [0, 1, 8]].map(Vec::from);
    let [a, b, c, d] = [3, 4, 8, 7];
    let sides = [vec![2, a, b, 5], vec![6, d, c, 9], vec![2, a, d, 6], vec![5, b, c, 9], vec![2, 5, 9, 6]];
    let raw = polyhedron(at, side.into_iter().chain(sides).collect());
    let ((of_before, before), after) = (built_from_corners(&raw), built(&raw));
    assert_eq!((before.gapped_cells, before.warped_cells, before.steiner_cells), (1, 0, 0));
    let outside = |mesh: &Mesh| {
        let faces =
            mesh.topology.connectivity().boundary_faces().map(|face| mesh.topology.connectivity().faces[face as usize]);
        faces.map(|face| sorted(face.map(|v| mesh.vertex_source[v as usize]))).collect::<BTreeSet<_>>()
    };
    let expected: BTreeSet<_> = triangles(&raw.cells)[0].iter().map(|&triangle| sorted(triangle)).collect();
    assert!(outside(&of_before) != expected, "its faces are not those that a neighbour has");
    assert_eq!(outside(&after.0), expected);
    assert_eq!((after.1.gapped_cells, after.1.steiner_cells, after.1.boundary_faces), (0, 1, 16));
    assert_eq!(volume(&after.0), 1.0);
}

#[test]
fn flat_tetrahedra_that_leave_nothing_open_need_no_point() {
    // A wedge as a hexahedron two of whose corners lie in the middle of edges: they are in a plane with two faces.
    let mut raw = RawMesh { points: points(&CUBE), ..RawMesh::default() };
    raw.cells.solids.push(SolidShape::Hexahedron, 0..8);
    for corner in [2, 6] {
        raw.points[corner] = 0.5 * (raw.points[corner - 1] + raw.points[corner + 1]);
    }
    let (before, of_before) = built_from_corners(&raw);
    let (mesh, report) = built(&raw);
    assert_eq!((report.steiner_cells, mesh.topology, report), (0, before.topology, of_before));
}

#[test]
fn a_cell_that_is_there_twice_has_one_point_and_is_dropped_once() {
    let mut raw = warped();
    raw.cells.solids.push(SolidShape::Hexahedron, [1, 2, 3, 0, 5, 6, 7, 4].into_iter());
    let (mesh, report) = Mesh::build(raw.clone()).unwrap();
    mesh.check().unwrap();
    assert_eq!((report.steiner_cells, report.cells_out, report.duplicate_cells), (2, 12, 12));
    assert_eq!(
        (report.vertices_in, report.vertices_out, report.coincident_points, report.non_manifold_faces),
        (8, 9, 0, 0)
    );
    assert_eq!((&mesh.split_cells.source[..], mesh.split_cells.steiner.len()), (&[0][..], 1));
}

#[test]
fn cells_that_name_missing_points_or_none_that_are_finite_are_still_refused_by_name() {
    let mut raw = warped();
    raw.points.truncate(7);
    assert!(Mesh::build(raw).unwrap_err().to_string().contains("names point 7, but there are 7 points"));
    let mut raw = warped();
    raw.points[3].x = f64::NAN;
    assert!(matches!(Mesh::build(raw), Err(MeshError::NotFinite { point: 3, .. })));
}

/// Unit cubes with corners moved at random by up to `jitter`, points in random order.
fn grid(n: u32, jitter: f64, random: &mut Random) -> RawMesh {
    let count = (n + 1).pow(3);
    let mut numbers: Vec<u32> = (0..count).collect();
    random.shuffle(&mut numbers);
    let number = |[x, y, z]: [u32; 3]| numbers[(x + (n + 1) * (y + (n + 1) * z)) as usize];
    let all = |n: u32| (0..n.pow(3)).map(move |i| [i % n, i / n % n, i / n / n]);
    let mut raw = RawMesh { points: vec![DVec3::ZERO; count as usize], ..RawMesh::default() };
    for place in all(n + 1) {
        let moved = place.map(|i| f64::from(i) + jitter * random.signed());
        raw.points[number(place) as usize] = DVec3::from(moved);
    }
    for [x, y, z] in all(n) {
        let corners = CUBE.map(|corner| corner.map(|i| i as u32)).map(|[i, j, k]| number([x + i, y + j, z + k]));
        raw.cells.solids.push(SolidShape::Hexahedron, corners.into_iter());
    }
    raw
}

/// Cells of a mesh whose parts fill them, and the others.
#[derive(Debug, Default)]
struct Tally {
    cells: usize,
    overlap_before: u64,
    overlap_after: u64,
    mended: u64,
}

/// Compares each cell that is cut positively with what its faces enclose; none of the faces between two such cells may be open.
fn assert_filled(raw: &RawMesh, tally: &mut Tally) {
    let (mesh, report) = built(raw);
    let of_cells = triangles(&raw.cells);
    let mut vertex = vec![0; raw.points.len()];
    for (at, &source) in (0u32..).zip(&mesh.vertex_source).filter(|(_, source)| (**source as usize) < raw.points.len())
    {
        vertex[source as usize] = at;
    }
    let at = |point: u32| mesh.positions.world(vertex[point as usize] as usize);
    let mut volumes = vec![0.0; of_cells.len()];
    for (cell, &source) in (0u32..).zip(&mesh.cell_source) {
        volumes[source as usize] += mesh.cell_volume(cell) * mesh.positions.scale.powi(3);
    }
    let is_filled = |cell: usize| (volumes[cell] / enclosed(&of_cells[cell], at) - 1.0).abs() < 1e-12;
    let filled: Vec<bool> = (0..of_cells.len()).map(is_filled).collect();
    let not_filled = filled.iter().filter(|&&is_filled| !is_filled).count() as u64;
    assert_eq!(not_filled, report.warped_cells, "all others are filled");
    let mut owners: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
    for (cell, triangles) in of_cells.iter().enumerate() {
        for triangle in triangles {
            let triangle = triangle.map(|point| vertex[point as usize]);
            owners.entry(sorted(triangle)).or_default().push(cell);
        }
    }
    for face in mesh.topology.connectivity().boundary_faces() {
        let face = mesh.topology.connectivity().faces[face as usize];
        // A face within a cell that is not filled is none of the cells' faces.
        let owners = owners.get(&face).map_or(&[][..], Vec::as_slice);
        let is_excused =
            owners.len() == 1 || owners.iter().any(|&cell| !filled[cell]) || owners.is_empty() && not_filled > 0;
        assert!(is_excused, "{face:?} between {owners:?} is open");
    }
    tally.cells += filled.len();
    tally.mended += report.steiner_cells;
    tally.overlap_before += built_from_corners(raw).1.warped_cells;
    tally.overlap_after += report.warped_cells;
}

#[test]
fn jittered_hexahedra_are_filled_and_no_face_between_them_is_open() {
    for (jitter, least) in [(0.2, 0), (0.3, 1), (0.4, 10)] {
        let mut tally = Tally::default();
        for seed in 0..20 {
            assert_filled(&grid(5, jitter, &mut Random::new(seed)), &mut tally);
        }
        eprintln!("jitter {jitter}: {tally:?}");
        assert_eq!(tally.mended + tally.overlap_after, tally.overlap_before);
        assert!(tally.mended >= least, "{tally:?}");
    }
}

#[test]
fn a_tetrahedron_turned_inside_a_mended_cell_is_noticed_by_the_volumes() {
    let raw = warped();
    let expected = enclosed(&triangles(&raw.cells)[0], |vertex| raw.points[vertex as usize]);
    let mut split = split(raw.cells, &raw.points);
    // The point is moved out of the cell, so that its tetrahedra overlap.
    split.steiner.points[0] = DVec3::new(0.9, 0.1, 0.5);
    let (mesh, report) = Mesh::build_split(raw.points, split, ConnectivityChoice::Full).unwrap();
    assert_eq!(report.warped_cells, 1);
    assert!(volume(&mesh) > 1.01 * expected);
}

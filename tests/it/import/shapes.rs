//! Cells of all shapes, split into tetrahedra.

use super::series::{Grid, write_series};
use crate::render::assert_within;
use glam::DVec3;
use std::collections::HashMap;
use std::fs;
use std::sync::Arc;
use tempfile::TempDir;
use tetreel::camera::{Camera, Projection};
use tetreel::export::StoredSeries;
use tetreel::export::vtu::{VtuOptions, write_collection};
use tetreel::field::{Component, SeriesSource};
use tetreel::import;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::mesh::{Mesh, RepairReport, tet_volume};
use tetreel::node_table::{Node, NodeTable};
use tetreel::pipeline::{Backend, FrameRequest, Pipeline, TetDraw};
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};

/// Area of a polygon in a plane of constant z.
fn area(polygon: &[[f64; 2]]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    0.5 * polygon.iter().zip(next).map(|([x, y], [u, v])| x * v - u * y).sum::<f64>()
}

/// A cube, a voxel beside it, a wedge on the cube, a pyramid on the voxel and a tetrahedron beside that, all of which share faces; prisms
/// of five and six sides apart from them; and their volume. Points are dyadic fractions, so that rounding them to f32 is exact.
pub fn block() -> (Grid, f64) {
    let mut points: Vec<[f64; 3]> =
        (0..12).map(|i| [f64::from(i % 3), f64::from(i / 3 % 2), f64::from(i / 6)]).collect();
    points.extend([[0.5, 0.0, 2.0], [0.5, 1.0, 2.0], [1.5, 0.5, 2.0], [1.0, 0.5, 2.5]]);
    let mut cells = vec![
        (12, vec![0, 1, 4, 3, 6, 7, 10, 9]),
        (11, vec![1, 2, 4, 5, 7, 8, 10, 11]),
        (13, vec![6, 7, 12, 9, 10, 13]),
        (14, vec![7, 8, 11, 10, 14]),
        (10, vec![7, 10, 15, 14]),
    ];
    let tet = 0.125;
    let mut volume = 1.0 + 1.0 + 0.5 + 1.0 / 3.0 + tet;
    let pentagon = [[4.0, 0.0], [6.0, 0.0], [7.0, 1.0], [5.5, 2.5], [4.0, 1.0]];
    let hexagon = [[10.0, 0.0], [11.0, 0.0], [12.5, 1.0], [12.0, 2.0], [10.5, 2.25], [9.5, 1.0]];
    for (kind, polygon) in [(15, &pentagon[..]), (16, &hexagon[..])] {
        let first = points.len();
        for z in [0.0, 0.75] {
            points.extend(polygon.iter().map(|[x, y]| [*x, *y, z]));
        }
        cells.push((kind, (first..points.len()).collect()));
        volume += 0.75 * area(polygon);
    }
    let values = |count: usize| (0..count).map(|i| i as f64).collect::<Vec<_>>();
    let (of_points, of_cells) = (values(points.len()), values(cells.len()));
    let grid = Grid {
        point_arrays: vec![("T", 1, of_points)],
        cell_arrays: vec![("c", 1, of_cells)],
        points,
        cells,
        ..Grid::default()
    };
    (grid, volume)
}

/// Triangles of the cells' faces that no other cell has, by the faces alone.
fn boundary_triangles(cells: &[(u8, Vec<usize>)]) -> usize {
    let mut faces: HashMap<Vec<usize>, usize> = HashMap::new();
    for (kind, v) in cells {
        let prism = |n: usize| {
            let sides = (0..n).map(move |i| vec![i, (i + 1) % n, n + (i + 1) % n, n + i]);
            sides.chain([(0..n).collect(), (n..2 * n).collect()]).collect::<Vec<Vec<usize>>>()
        };
        let of_cell = match kind {
            10 => (0..4).map(|left_out| (0..4).filter(|&i| i != left_out).collect()).collect(),
            11 => vec![
                vec![0, 1, 2, 3],
                vec![4, 5, 6, 7],
                vec![0, 1, 4, 5],
                vec![2, 3, 6, 7],
                vec![0, 2, 4, 6],
                vec![1, 3, 5, 7],
            ],
            12 => prism(4),
            13 => prism(3),
            14 => vec![vec![0, 1, 2, 3], vec![0, 1, 4], vec![1, 2, 4], vec![2, 3, 4], vec![3, 0, 4]],
            15 => prism(5),
            _ => prism(6),
        };
        for face in of_cell {
            let mut face: Vec<usize> = face.into_iter().map(|i| v[i]).collect();
            face.sort_unstable();
            *faces.entry(face).or_default() += 1;
        }
    }
    faces.into_iter().filter(|(_, count)| *count == 1).map(|(face, _)| face.len() - 2).sum()
}

/// The same grid with its points in another order.
fn shuffled(grid: &Grid, seed: usize) -> Grid {
    let n = grid.points.len();
    // Steps without a common divisor with the number of points visit each.
    let step = (1..)
        .map(|i| 2 * (seed + i) + 1)
        .find(|step| (2..=n).all(|d| !(n.is_multiple_of(d) && step.is_multiple_of(d))))
        .expect("one");
    let new: Vec<usize> = (0..n).map(|i| (i * step + seed) % n).collect();
    let mut out = grid.clone();
    for (i, &to) in new.iter().enumerate() {
        out.points[to] = grid.points[i];
        out.point_arrays[0].2[to] = grid.point_arrays[0].2[i];
    }
    out.cells.iter_mut().for_each(|(_, vertices)| vertices.iter_mut().for_each(|v| *v = new[*v]));
    out
}

/// The grid as a file, which lasts as long as the folder, opened.
fn open(grid: &Grid) -> (TempDir, Box<dyn SeriesSource>) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.vtu");
    fs::write(&path, grid.text()).expect("a file");
    let source = import::open(&path).expect("opens");
    (folder, source)
}

fn build(grid: &Grid) -> (Mesh, RepairReport) {
    Mesh::build(open(grid).1.mesh().expect("a mesh")).expect("cells with a volume")
}

fn volume_of(mesh: &Mesh) -> f64 {
    let scale = mesh.positions.scale;
    mesh.topology.tets.iter().map(|&tet| tet_volume(mesh.positions.corners(tet)) * scale.powi(3)).sum()
}

#[test]
fn cells_of_all_shapes_fill_their_space_and_share_their_faces_however_points_are_numbered() {
    let (grid, volume) = block();
    let boundary = boundary_triangles(&grid.cells);
    for seed in 0..60 {
        let grid = shuffled(&grid, seed);
        let (mesh, report) = build(&grid);
        assert_eq!((report.cells_in, report.split_cells), (7, 6));
        assert_eq!((report.flipped, report.warped_cells, report.zero_volume, report.non_manifold_faces), (0, 0, 0, 0));
        assert_eq!((report.boundary_faces as usize, report.parts), (boundary, 3), "seed {seed}");
        let found = volume_of(&mesh);
        assert!((found / volume - 1.0).abs() < 1e-12, "{found} instead of {volume}");
    }
}

#[test]
fn a_cell_that_is_numbered_the_other_way_round_is_no_repair() {
    let (mut grid, volume) = block();
    // As in VTK's own figure of a wedge.
    grid.cells[2].1 = vec![9, 10, 13, 6, 7, 12];
    grid.cells[0].1 = vec![6, 7, 10, 9, 0, 1, 4, 3];
    let (mesh, report) = build(&grid);
    assert_eq!((report.flipped, report.warped_cells, report.non_manifold_faces), (0, 0, 0));
    assert!((volume_of(&mesh) / volume - 1.0).abs() < 1e-12);
}

#[test]
fn cells_with_a_vertex_twice_are_what_is_left_of_them_and_warped_ones_are_counted() {
    let collapsed = Grid {
        points: block().0.points,
        // A wedge and a pyramid as hexahedra, as some solvers write them; and a hexahedron without a volume.
        cells: vec![
            (12, vec![6, 7, 12, 12, 9, 10, 13, 13]),
            (12, vec![7, 8, 11, 10, 14, 14, 14, 14]),
            (12, vec![0, 0, 0, 0, 1, 1, 1, 1]),
        ],
        point_arrays: Vec::new(),
        cell_arrays: vec![("c", 1, vec![1.0, 2.0, 3.0])],
        ..Grid::default()
    };
    let (mesh, report) = build(&collapsed);
    assert_eq!((report.cells_in, report.zero_volume, report.warped_cells, report.cells_out), (3, 1, 0, 5));
    assert!((volume_of(&mesh) - (0.5 + 1.0 / 3.0)).abs() < 1e-12);

    let mut warped = Grid { cells: vec![(12, (0..8).collect())], cell_arrays: Vec::new(), ..collapsed };
    warped.points =
        (0..8).map(|i: u32| [f64::from((i & 1) ^ (i >> 1 & 1)), f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
    assert_eq!(build(&warped).1.warped_cells, 0);
    // The corner opposite to the first one lies beyond it.
    warped.points[6] = [-1.0, -1.0, -1.0];
    let report = build(&warped).1;
    assert_eq!((report.warped_cells, report.is_clean()), (1, false));
}

#[test]
fn values_of_cells_follow_their_cells_and_curved_cells_are_read_by_their_corners() {
    let (grid, _) = block();
    let (_folder, source) = open(&grid);
    let mut values = Vec::new();
    source.read(&source.fields()[1], Component::Index(0), 0, &mut values).unwrap();
    assert_eq!(values, [4.0, 0.0, 1.0, 2.0, 3.0, 5.0, 6.0], "the tetrahedron comes first");
    assert!(source.notes().iter().any(|note| note.starts_with("split 6 cells into tetrahedra: 1 voxel, 1 hexahedron")));

    let mut curved = grid.clone();
    let middles = |n: usize| std::iter::repeat_n(0, n);
    for (at, kind, more) in [(0, 25, 12), (2, 26, 9), (3, 27, 8), (4, 24, 6)] {
        curved.cells[at].0 = kind;
        curved.cells[at].1.extend(middles(more));
    }
    let (_folder_of_curved, of_curved) = open(&curved);
    assert_eq!(of_curved.mesh().unwrap(), source.mesh().unwrap());
    assert!(of_curved.notes().iter().any(|note| note.starts_with("read the corners alone of 4 curved cells")));
}

#[test]
fn a_step_with_another_cell_is_refused() {
    let (grid, _) = block();
    let mut other = grid.clone();
    other.cells[0].1.swap(4, 6);
    let folder = tempfile::tempdir().expect("a folder");
    let source =
        import::open(&write_series(folder.path(), &[grid.clone(), other, grid])).expect("the first step is valid");
    let mut out = Vec::new();
    let field = &source.fields()[0];
    assert!(source.read(field, Component::Index(0), 2, &mut out).is_ok());
    let error = source.read(field, Component::Index(0), 1, &mut out).unwrap_err().to_string();
    assert!(error.contains("a_1.vtu") && error.contains("other cells"), "{error}");
}

#[test]
fn grids_of_all_shapes_are_written_as_they_were_read() {
    let (grid, volume) = block();
    let (_folder, source) = open(&grid);
    let raw = source.mesh().unwrap();
    let points: Vec<DVec3> = grid.points.iter().map(|&p| DVec3::from(p)).collect();
    assert_eq!((raw.points, raw.cells.len()), (points, 7));
    let folder = tempfile::tempdir().expect("a folder");
    let pvd = folder.path().join("out.pvd");
    write_collection(source.as_ref(), &pvd, &VtuOptions::default(), &Silent, &Cancel::new()).expect("is written");
    let again = import::open(&pvd).expect("opens");
    assert_eq!(again.mesh().unwrap(), source.mesh().unwrap());
    let (mesh, _) = Mesh::build(again.mesh().unwrap()).unwrap();
    assert!((volume_of(&mesh) / volume - 1.0).abs() < 1e-12);
}

/// A store of a grid in a folder.
fn stored(grid: &Grid, folder: &TempDir) -> Store {
    let path = folder.path().join("s.zarr");
    ingest(open(grid).1.as_ref(), &path, &IngestOptions::default(), &Silent, &Cancel::new()).expect("an import");
    Store::open(path).expect("a store")
}

#[test]
fn a_store_gives_the_cells_of_its_source_back_not_their_tetrahedra() {
    for seed in [0, 7, 31] {
        let grid = shuffled(&block().0, seed);
        let folder = tempfile::tempdir().expect("a folder");
        let store = stored(&grid, &folder);
        let mesh = store.mesh().expect("a mesh");
        mesh.check().expect("a sound mesh");
        assert_eq!((mesh.split_cells.solids.len(), mesh.topology.tets.len()), (6, 6 + 6 + 3 + 2 + 1 + 9 + 12));
        let back = StoredSeries::new(&store, &[]).expect("a source");
        assert_eq!(back.mesh().expect("a mesh"), open(&grid).1.mesh().expect("a mesh"));
    }
}

#[test]
fn cells_that_the_import_drops_do_not_come_back() {
    let (mut grid, _) = block();
    // A hexahedron without a volume.
    grid.cells.push((12, vec![0, 0, 0, 0, 1, 1, 1, 1]));
    grid.cell_arrays.clear();
    let folder = tempfile::tempdir().expect("a folder");
    let store = stored(&grid, &folder);
    let back = StoredSeries::new(&store, &[]).expect("a source").mesh().expect("a mesh");
    assert_eq!((back.cells.tets.len(), back.cells.solids.len()), (1, 6));
}

#[test]
fn damaged_lists_of_split_cells_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = stored(&block().0, &folder);
    for name in ["types", "vertices", "sources"] {
        let chunk = store.path().join("mesh/0/split_cells").join(name).join("c/0");
        let good = fs::read(&chunk).expect("a chunk");
        // A cell of no known type, a vertex beyond the mesh, cells out of order; each with its right checksum.
        let mut bad = good[..good.len() - 4].to_vec();
        bad[..1].fill(250);
        bad.extend(crc32c::crc32c(&bad).to_le_bytes());
        fs::write(&chunk, bad).expect("is written");
        let error = store.mesh().expect_err("is damaged").to_string();
        assert!(error.contains(name) && error.contains("import the series again"), "{name}: {error}");
        fs::write(&chunk, &good[..good.len() - 5]).expect("is written");
        assert!(store.mesh().expect_err("is cut").to_string().contains(name));
        fs::write(&chunk, good).expect("is written");
    }
    assert!(store.mesh().is_ok());
}

/// The grid with its hexahedron, wedge, prisms and tetrahedron as polyhedra, whose faces look this way or that.
pub fn as_polyhedra(grid: &Grid) -> Grid {
    let mut out = grid.clone();
    for (cell, (kind, v)) in grid.cells.iter().enumerate() {
        let prism = |n: usize| {
            let sides = (0..n).map(move |i| vec![i, (i + 1) % n, n + (i + 1) % n, n + i]);
            sides.chain([(0..n).collect(), (n..2 * n).collect()]).collect::<Vec<Vec<usize>>>()
        };
        let faces = match kind {
            10 => vec![vec![0, 1, 2], vec![0, 1, 3], vec![1, 2, 3], vec![2, 0, 3]],
            12 => prism(4),
            13 => prism(3),
            15 => prism(5),
            16 => prism(6),
            _ => continue,
        };
        out.cells[cell].0 = 42;
        out.faces.push((cell, faces.into_iter().map(|face| face.into_iter().map(|i| v[i]).collect()).collect()));
    }
    out
}

#[test]
fn polyhedra_are_split_as_the_shapes_that_they_are_and_share_faces_with_others() {
    let (grid, volume) = block();
    let boundary = boundary_triangles(&grid.cells);
    for seed in 0..30 {
        let shuffled = shuffled(&grid, seed);
        let (plain, _) = build(&shuffled);
        for has_shared_faces in [false, true] {
            let (mesh, report) = build(&Grid { has_shared_faces, ..as_polyhedra(&shuffled) });
            assert_eq!(
                (report.cells_in, report.warped_cells, report.zero_volume, report.non_manifold_faces),
                (7, 0, 0, 0)
            );
            assert_eq!((report.boundary_faces as usize, report.parts, report.flipped), (boundary, 3, 0), "seed {seed}");
            assert!((volume_of(&mesh) / volume - 1.0).abs() < 1e-12);
            assert_eq!(mesh.topology.tets.len(), plain.topology.tets.len());
        }
    }
}

#[test]
fn polyhedra_come_back_from_a_store_and_from_its_export() {
    let grid = as_polyhedra(&block().0);
    let folder = tempfile::tempdir().expect("a folder");
    let store = stored(&grid, &folder);
    let source = open(&grid).1;
    let back = StoredSeries::new(&store, &[]).expect("a source");
    assert_eq!(back.mesh().expect("a mesh"), source.mesh().expect("a mesh"));
    let pvd = folder.path().join("out.pvd");
    write_collection(&back, &pvd, &VtuOptions::default(), &Silent, &Cancel::new()).expect("is written");
    let again = import::open(&pvd).expect("opens");
    assert_eq!(again.mesh().expect("a mesh"), source.mesh().expect("a mesh"));
    for (field, of) in again.fields().iter().zip(source.fields()) {
        let values = |source: &dyn SeriesSource, field| {
            let mut values = Vec::new();
            source.read(field, Component::Index(0), 0, &mut values).expect("values");
            values
        };
        assert_eq!((&field.name, field.association), (&of.name, of.association));
        assert_eq!(values(again.as_ref(), field), values(source.as_ref(), of));
    }
}

#[test]
fn polyhedra_that_do_not_close_are_left_out_and_named_by_file_and_cell() {
    let grid = as_polyhedra(&block().0);
    let of = |change: &dyn Fn(&mut Grid)| {
        let mut grid = grid.clone();
        change(&mut grid);
        open(&grid)
    };
    for (change, expected) in [
        (&(|g: &mut Grid| _ = g.faces[0].1.pop()) as &dyn Fn(&mut Grid), "belongs to 1 of them"),
        (&|g| g.faces[0].1[1][2] = g.faces[0].1[1][0], "twice"),
    ] {
        let (_folder, source) = of(change);
        let notes = source.notes().join("; ");
        assert!(notes.contains("left out 1 polyhedra") && notes.contains("cell 0 of ") && notes.contains("a.vtu"));
        assert!(notes.contains(expected), "{notes}");
        let mut whole = grid.clone();
        whole.cells.remove(0);
        whole.cell_arrays[0].2.remove(0);
        whole.faces.remove(0);
        whole.faces.iter_mut().for_each(|(cell, _)| *cell -= 1);
        let (_other, rest) = open(&whole);
        assert_eq!(source.mesh().expect("a mesh").cells, rest.mesh().expect("a mesh").cells);
        let of_cells = |source: &dyn SeriesSource| {
            let mut values = Vec::new();
            source.read(&source.fields()[1], Component::Index(0), 0, &mut values).expect("values");
            values
        };
        assert_eq!(of_cells(source.as_ref()), of_cells(rest.as_ref()));
    }
    let error_of = |change: &dyn Fn(&mut Grid)| {
        let mut grid = grid.clone();
        change(&mut grid);
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.vtu");
        fs::write(&path, grid.text()).expect("a file");
        let error = import::open(&path).err().expect("is refused").to_string();
        assert!(error.contains("a.vtu") && error.contains("cell 0"), "{error}");
        error
    };
    assert!(error_of(&|g| g.faces[0].1[1][2] = 99).contains("has vertex 99"));
    assert!(error_of(&|g| _ = g.faces.remove(0)).contains("without faces"));
    for (from, to) in [("\"faces\"", "\"mist\""), ("\"faceoffsets\"", "\"mist\"")] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.vtu");
        fs::write(&path, grid.text().replace(from, to)).expect("a file");
        let error = import::open(&path).err().expect("is refused").to_string();
        assert!(error.contains("lacks the array") && error.contains(from.trim_matches('"')), "{error}");
    }
}

/// The block of all shapes, some of them curved or polyhedra, with what is wrong in real files: a cell without a volume, a tetrahedron
/// turned inside out, a crack, a point of no cell, a part far away, and values that are no numbers, huge or denormal.
fn dirty() -> Grid {
    let (mut grid, _) = block();
    let faces = as_polyhedra(&grid).faces.into_iter().filter(|(cell, _)| [0, 5].contains(cell)).collect();
    [0, 5].iter().for_each(|&cell: &usize| grid.cells[cell].0 = 42);
    grid.faces = faces;
    grid.cells[2].0 = 26;
    grid.cells[2].1.extend([0; 9]);
    // A hexahedron over the crack: its lower points lie where those of the block do, and are others.
    let first = grid.points.len();
    grid.points.extend([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    grid.points.extend([[0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 1.0, -1.0], [0.0, 1.0, -1.0]]);
    grid.cells.push((12, [4, 5, 6, 7, 0, 1, 2, 3].map(|i| first + i).to_vec()));
    // A quadratic tetrahedron turned inside out, far away, and a point of no cell.
    let far = grid.points.len();
    grid.points.extend([[1e4, 0.0, 0.0], [1e4 + 8.0, 0.0, 0.0], [1e4, 8.0, 0.0], [1e4, 0.0, 8.0], [-5.0, -5.0, -5.0]]);
    grid.cells.push((24, [vec![far + 1, far, far + 2, far + 3], vec![0; 6]].concat()));
    grid.cells.push((12, vec![0, 0, 0, 0, 1, 1, 1, 1]));
    let odd = [f64::NAN, f64::INFINITY, 1e38, 1e-40, -0.0];
    let value = |i: usize| match i % 9 {
        3 => odd[i / 9 % odd.len()],
        _ => (0.7 * i as f64).sin(),
    };
    grid.point_arrays = vec![("T", 1, (0..grid.points.len()).map(value).collect())];
    grid.cell_arrays = vec![("c", 1, (0..grid.cells.len()).map(|i| value(9 * (i / 2) + 3 * (i % 2))).collect())];
    grid
}

#[test]
fn a_dirty_mesh_of_all_shapes_has_the_right_report_and_is_drawn_as_the_judge_draws_it() {
    let grid = dirty();
    let (_, report) = build(&grid);
    assert_eq!((report.cells_in, report.split_cells, report.zero_volume), (10, 7, 1));
    assert_eq!((report.flipped, report.warped_cells, report.non_manifold_faces), (1, 0, 0));
    assert_eq!((report.coincident_points, report.unreferenced_vertices, report.parts), (4, 1, 5));
    let folder = tempfile::tempdir().expect("a folder");
    let store = stored(&grid, &folder);
    let node = |scalar, rgb, tau| Node { scalar, rgb, tau };
    let nodes =
        vec![node(-1.0, [0.2, 0.4, 1.0], 0.3), node(0.0, [0.9, 0.8, 0.2], 0.1), node(1.0, [1.0, 0.2, 0.1], 1.5)];
    let table = Arc::new(NodeTable::new(nodes).expect("nodes"));
    let at = |position: DVec3, focal_point: DVec3, projection| Camera {
        position,
        focal_point,
        view_up: DVec3::Z,
        projection,
        near: 0.0,
    };
    let perspective = Projection::Perspective { view_angle: 40.0 };
    let cameras = [
        at(DVec3::new(9.0, -12.0, 6.0), DVec3::new(5.0, 0.5, 0.5), perspective),
        at(DVec3::new(5.0, -9.0, 3.0), DVec3::new(5.0, 0.5, 0.5), Projection::Parallel { scale: 7.0 }),
        at(DVec3::new(0.4, 0.3, 0.6), DVec3::new(4.0, 0.7, 0.5), Projection::Perspective { view_angle: 80.0 }),
    ];
    for name in ["T", "c"] {
        let mut pipeline = Pipeline::open(&store, Some(&name.parse().expect("a name"))).expect("a series");
        let mut seen = 0;
        for camera in cameras {
            let request = FrameRequest::new(0, camera, table.clone(), (48, 36));
            let request = FrameRequest { backend: Backend::Cpu, ..request };
            let mut draw =
                |draw| pipeline.render(&request.clone().with_draw(draw)).expect("a frame").planes.color.clone();
            let judge = draw(TetDraw::Reference);
            for found in [draw(TetDraw::Raycast), draw(TetDraw::ALL_FACES)] {
                assert_within(name, &found, &judge);
            }
            seen += judge.pixels.iter().filter(|p| p[3] > 0.05).count();
        }
        assert!(seen > 300, "{name}: {seen} pixels");
    }
}

/// A cube that is a polyhedron, one side of which is refined: `n` by `n` quadrilaterals, the ends of whose outer edges lie on edges of the
/// faces around; and the cubes beside them.
fn refined(n: u32) -> Grid {
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut at = |p: [f64; 3]| {
        points.iter().position(|q| *q == p).unwrap_or_else(|| {
            points.push(p);
            points.len() - 1
        })
    };
    let end = f64::from(n);
    let mut faces = Vec::new();
    let mut cells = Vec::new();
    for i in 0..n * n {
        let (y, z) = (f64::from(i % n), f64::from(i / n));
        let square = |x: f64| [[x, y, z], [x, y + 1.0, z], [x, y + 1.0, z + 1.0], [x, y, z + 1.0]];
        faces.push(square(end).map(&mut at).to_vec());
        cells.push((12, [square(end), square(end + 1.0)].concat().into_iter().map(&mut at).collect()));
    }
    faces.push([[0.0, 0.0, 0.0], [0.0, end, 0.0], [0.0, end, end], [0.0, 0.0, end]].map(&mut at).to_vec());
    for other in [0.0, end] {
        for axis in [1, 2] {
            let mut face = |x: f64, along: f64| {
                let mut p = [x, other, other];
                p[axis] = along;
                at(p)
            };
            let edge: Vec<usize> = (0..=n).map(|i| face(end, f64::from(i))).collect();
            faces.push([edge, vec![face(0.0, end), face(0.0, 0.0)]].concat());
        }
    }
    cells.push((42, (0..points.len()).collect()));
    Grid {
        point_arrays: vec![("T", 1, (0..points.len()).map(|i| i as f64).collect())],
        cell_arrays: vec![("c", 1, (0..cells.len()).map(|i| i as f64).collect())],
        faces: vec![(cells.len() - 1, faces)],
        points,
        cells,
        ..Grid::default()
    }
}

/// The report of such a mesh with its points in another order, and the number of triangles on its outside.
fn report_of_refined(n: u32, seed: usize) -> (RepairReport, u64) {
    let original = refined(n);
    let mut grid = shuffled(&original, seed);
    // The numbers of the faces' corners follow the points.
    let new = |old: &usize| grid.points.iter().position(|p| *p == original.points[*old]).expect("a point");
    let renumbered = original.faces[0].1.iter().map(|face| face.iter().map(new).collect()).collect();
    grid.faces = vec![(original.faces[0].0, renumbered)];
    let (mesh, report) = build(&grid);
    let n = u64::from(n);
    assert!((volume_of(&mesh) / (n * n * n + n * n) as f64 - 1.0).abs() < 1e-12);
    // The coarse cube: a side of 2 triangles and four polygons; the others: four sides of n squares, and one of n by n.
    (report, 2 + 4 * (n + 1) + 2 * (4 * n + n * n))
}

#[test]
fn polyhedra_with_hanging_nodes_leave_no_face_open_however_points_are_numbered() {
    for seed in 0..60 {
        let (report, outside) = report_of_refined(2, seed);
        assert_eq!((report.boundary_faces, report.parts), (outside, 1), "seed {seed}");
        assert_eq!((report.zero_volume, report.gapped_cells, report.flipped, report.warped_cells), (0, 0, 0, 0));
    }
}

#[test]
fn polyhedra_that_leave_inner_faces_open_are_counted() {
    for seed in 0..10 {
        let (report, outside) = report_of_refined(3, seed);
        assert!(report.boundary_faces > outside, "seed {seed}: no vertex is one of all nine faces");
        assert_eq!((report.zero_volume, report.gapped_cells), (0, 1), "seed {seed}");
        assert!(report.to_string().contains("which may leave inner faces open: 1"), "{report}");
    }
}

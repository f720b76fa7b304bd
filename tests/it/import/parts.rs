//! Steps of several files: pieces of parallel codes, blocks, and lists of such files.

use super::series::Grid;
use super::shapes::{as_polyhedra, block};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;
use tetreel::field::{Component, SeriesSource};
use tetreel::import;
use tetreel::mesh::Mesh;

fn pvtu(pieces: &[&str]) -> String {
    let pieces: String = pieces.iter().map(|piece| format!("<Piece Source=\"{piece}\"/>")).collect();
    format!("<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>")
}

/// Two tetrahedra, and the block of all shapes with a triangle before it, as files beside each other with all kinds of lists of them. The
/// second step has other values.
fn folder() -> (TempDir, impl Fn(&str) -> PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().to_owned();
    let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("a file");
    let mut shapes = as_polyhedra(&block().0);
    shapes.cells.insert(0, (5, vec![0, 1, 2]));
    shapes.cell_arrays[0].2.insert(0, -1.0);
    // Points of both files at one place are kept apart: their values differ.
    shapes.point_arrays[0].2.iter_mut().for_each(|value| *value += 0.25);
    shapes.faces.iter_mut().for_each(|(cell, _)| *cell += 1);
    for step in 0..2 {
        for (name, grid) in [("a", &Grid::default()), ("b", &shapes)] {
            let mut grid = Grid { time: Some(f64::from(2 - step)), ..grid.clone() };
            for (_, _, values) in grid.point_arrays.iter_mut().chain(&mut grid.cell_arrays) {
                values.iter_mut().for_each(|value| *value += 1000.0 * f64::from(step));
            }
            // A field of one piece only.
            if name == "a" {
                grid.point_arrays.push(("alone", 1, vec![0.0; grid.points.len()]));
            }
            put(&format!("{name}{step}.vtu"), &grid.text());
        }
        put(&format!("p{step}.pvtu"), &pvtu(&[&format!("a{step}.vtu"), &format!("b{step}.vtu")]));
        let blocks = format!("<Block><DataSet file=\"a{step}.vtu\"/></Block><DataSet file=\"b{step}.vtu\"/><DataSet/>");
        let blocks = format!("<vtkMultiBlockDataSet>{blocks}</vtkMultiBlockDataSet>");
        put(&format!("m{step}.vtm"), &format!("<VTKFile type=\"vtkMultiBlockDataSet\">{blocks}</VTKFile>"));
    }
    for (name, extension) in [("p", "pvtu"), ("m", "vtm")] {
        let file = |step: u32, time: f64| format!("{{\"name\": \"{name}{step}.{extension}\", \"time\": {time}}}");
        let list = format!("{{\"file-series-version\": \"1.0\", \"files\": [{}, {}]}}", file(0, 7.5), file(1, -2.0));
        put(&format!("{name}.{extension}.series"), &list);
    }
    (folder, move |name: &str| path.join(name))
}

fn read(source: &dyn SeriesSource, field: usize, step: usize) -> Vec<f32> {
    let mut values = Vec::new();
    source.read(&source.fields()[field], Component::Index(0), step, &mut values).expect("values");
    values
}

#[test]
fn pieces_and_blocks_are_one_mesh_with_the_values_of_each_file() {
    let (_folder, at) = folder();
    let [a, b] = ["a0.vtu", "b0.vtu"].map(|name| import::open(&at(name)).expect("opens"));
    for name in ["p0.pvtu", "m0.vtm"] {
        let files = import::files(&at(name)).expect("files");
        assert_eq!(files, [name, "a0.vtu", "b0.vtu"].map(&at), "a change of any is a change of the whole");
        let whole = import::open(&at(name)).expect("opens");
        let names: Vec<&str> = whole.fields().iter().map(|field| field.name.as_str()).collect();
        // Pieces are no blocks.
        let expected = if name == "m0.vtm" { &["T", "c", "block"][..] } else { &["T", "c"] };
        assert_eq!(names, expected, "{name}");
        let notes = whole.notes().join("; ");
        assert!(notes.contains("'alone' (not the same in all pieces)") && notes.contains("triangle"), "{notes}");
        let [mesh, first, second] = [&whole, &a, &b].map(|source| source.mesh().expect("a mesh"));
        assert_eq!(mesh.points, [&first.points[..], &second.points].concat());
        let shifted = |v: &u32| v + first.points.len() as u32;
        let of_second = second.cells.iter().map(|cell| cell.iter().map(shifted).collect());
        let expected: Vec<Vec<u32>> = first.cells.iter().map(<[u32]>::to_vec).chain(of_second).collect();
        let found: Vec<Vec<u32>> = mesh.cells.iter().map(<[u32]>::to_vec).collect();
        assert_eq!(found, expected, "tetrahedra come first, and the second file has none");
        assert_eq!(read(whole.as_ref(), 0, 0), [read(a.as_ref(), 0, 0), read(b.as_ref(), 0, 0)].concat());
        assert_eq!(read(whole.as_ref(), 1, 0), [read(a.as_ref(), 2, 0), read(b.as_ref(), 1, 0)].concat());
        // Two tetrahedra, the triangle, then the others.
        assert_eq!([0, 1, 2, 8].map(|cell| whole.cell_number(cell)), [0, 1, 3, 9]);
    }
}

#[test]
fn steps_of_parts_are_in_order_of_time_from_the_files_or_from_a_list() {
    let (_folder, at) = folder();
    for (paths, times) in [
        (vec![at("p0.pvtu"), at("p1.pvtu")], [1.0, 2.0]),
        (vec![at("m0.vtm"), at("m1.vtm")], [1.0, 2.0]),
        (vec![at("p.pvtu.series")], [-2.0, 7.5]),
        (vec![at("m.vtm.series")], [-2.0, 7.5]),
    ] {
        let source = import::open_many(&paths).expect("opens");
        assert_eq!(source.times().values, times, "{paths:?}");
        // The earlier step is that of the second files.
        assert_eq!([0, 1].map(|step| read(source.as_ref(), 0, step)[1]), [1001.0, 1.0], "{paths:?}");
    }
}

#[test]
fn a_piece_that_is_missing_or_damaged_is_named() {
    let (_folder, at) = folder();
    fs::write(at("b1.vtu"), "no XML").expect("a file");
    fs::remove_file(at("b0.vtu")).expect("is there");
    for (name, expected) in
        [("p0.pvtu", "b0.vtu is missing"), ("p1.pvtu", "b1.vtu"), ("m.vtm.series", "b0.vtu is missing")]
    {
        let error = import::open(&at(name)).err().expect("is refused").to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn points_that_pieces_share_are_one_where_their_values_agree_in_the_first_step() {
    let whole = Grid::default();
    let folder = tempfile::tempdir().expect("a folder");
    let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("a file");
    // A piece of each cell, with the points of that cell alone. In the second step, the pieces disagree at one point.
    for step in 0..2 {
        for (cell, (of_type, vertices)) in whole.cells.iter().enumerate() {
            let points: Vec<_> = vertices.iter().map(|&v| whole.points[v]).collect();
            let mut values: Vec<f64> = vertices.iter().map(|&v| v as f64).collect();
            if (step, cell) == (1, 1) {
                values[1] += 0.5;
            }
            let numbers = (0..vertices.len()).collect();
            let piece = Grid {
                points,
                cells: vec![(*of_type, numbers)],
                point_arrays: vec![("T", 1, values)],
                cell_arrays: vec![("c", 1, vec![cell as f64])],
                time: Some(f64::from(step)),
                ..Grid::default()
            };
            put(&format!("{cell}_{step}.vtu"), &piece.text());
        }
        put(&format!("{step}.pvtu"), &pvtu(&[&format!("0_{step}.vtu"), &format!("1_{step}.vtu")]));
    }
    let paths = [0, 1].map(|step| folder.path().join(format!("{step}.pvtu")));
    let source = import::open_many(&paths).expect("opens");
    let mesh = source.mesh().expect("a mesh");
    assert_eq!((mesh.points.len(), mesh.cells.len()), (whole.points.len(), 2));
    let (built, report) = Mesh::build(mesh).expect("builds");
    assert_eq!((report.boundary_faces, built.topology.tets.len()), (6, 2), "the face between them is no border");
    let mut values = read(source.as_ref(), 0, 0);
    values.sort_by(f32::total_cmp);
    assert_eq!(values, [0.0, 1.0, 2.0, 3.0, 4.0]);
    assert!(source.notes().iter().any(|note| note == "joined 3 points on borders between pieces"));
    assert_eq!(read(source.as_ref(), 0, 1).len(), 5);
    let notes = source.notes().join("; ");
    assert!(notes.contains("field 'T': 1 points on borders"), "{notes}");
    // Pieces that disagree in the first step stay apart.
    let apart = import::open(&paths[1]).expect("opens");
    assert_eq!(apart.mesh().expect("a mesh").points.len(), 6);
}

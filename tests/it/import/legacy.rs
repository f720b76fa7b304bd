//! Legacy files that VTK wrote, and series of them.

use super::{assert_same, numbers};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tetreel::field::{Component, SeriesSource};
use tetreel::import;

/// The folder of files that `tests/interop/write_vtk.py` wrote.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/vtk")
}

/// What must be found in these files.
fn oracle() -> Value {
    let text = fs::read_to_string(folder().join("expected.json")).expect("the oracle's values");
    serde_json::from_str(&text).expect("valid JSON")
}

fn values(source: &dyn SeriesSource, step: usize) -> Vec<f32> {
    let field = source.fields().iter().find(|field| field.name == "T").expect("a field");
    let mut out = Vec::new();
    source.read(field, Component::Index(0), step, &mut out).expect("values");
    out
}

#[test]
fn every_legacy_file_that_vtk_wrote_is_read_exactly() {
    let oracle = oracle();
    let grids = oracle["grids"].as_object().expect("grids");
    // Three grids as text and binary, with cells in the old and the new layout.
    assert_eq!(grids.len(), 3 * 2 * 2);
    for (name, grid) in grids {
        let source = import::open(&folder().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_same(name, source.as_ref(), grid);
    }
}

#[test]
fn structured_grids_and_polyhedra_that_vtk_wrote_have_its_points_cells_and_values() {
    let oracle = oracle();
    let files = oracle["others"].as_object().expect("files");
    assert_eq!(files.len(), 4 * 2);
    for (name, expected) in files {
        let source = import::open(&folder().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let mesh = source.mesh().expect("a mesh");
        let points: Vec<u64> = mesh.points.iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect();
        assert_eq!(points, numbers(&expected["points"]), "{name}");
        assert_eq!(Some(mesh.cells.len() as u64), expected["cells"].as_u64(), "{name}");
        let found: Vec<u64> = values(source.as_ref(), 0).iter().map(|v| v.to_bits().into()).collect();
        assert_eq!(found, numbers(&expected["values"]), "{name}");
    }
}

#[test]
fn numbered_files_are_a_series_in_natural_order_or_in_that_of_their_times() {
    let target = tempfile::tempdir().expect("a folder");
    let text = fs::read_to_string(folder().join("structured_text.vtk")).expect("a file");
    let put = |name: &str, first: &str, time: Option<f64>| {
        let mut text = text.replace("LOOKUP_TABLE default\n0 ", &format!("LOOKUP_TABLE default\n{first} "));
        if let Some(time) = time {
            let field = format!("STRUCTURED_GRID\nFIELD FieldData 1\nTIME 1 1 double\n{time}\n");
            text = text.replace("STRUCTURED_GRID\n", &field);
        }
        let path = target.path().join(name);
        fs::write(&path, text).expect("a file");
        path
    };
    let plain = [put("s_10.vtk", "10", None), put("s_9.vtk", "9", None)];
    let source = import::open_many(&plain).expect("opens");
    assert_eq!(source.times().values, [0.0, 1.0]);
    assert_eq!([0, 1].map(|step| values(source.as_ref(), step)[0]), [9.0, 10.0]);

    let timed = [put("t_1.vtk", "1", Some(7.5)), put("t_2.vtk", "2", Some(0.25))];
    let source = import::open_many(&timed).expect("opens");
    assert_eq!(source.times().values, [0.25, 7.5]);
    assert_eq!([0, 1].map(|step| values(source.as_ref(), step)[0]), [2.0, 1.0]);

    let list = target.path().join("s.vtk.series");
    let files = r#"{"name": "s_10.vtk", "time": -1}, {"name": "s_9.vtk", "time": 2.5}"#;
    fs::write(&list, format!("{{\"file-series-version\": \"1.0\", \"files\": [{files}]}}")).expect("a file");
    let source = import::open(&list).expect("opens");
    assert_eq!(source.times().values, [-1.0, 2.5]);
    assert_eq!(values(source.as_ref(), 0)[0], 10.0);
}

#[test]
fn the_protein_of_the_papers_opens() {
    let Some(dir) = crate::common::samples() else { return };
    let source = import::open(&dir.join("paper_static/ironProt.vtk")).expect("opens");
    let mesh = source.mesh().expect("reads");
    assert_eq!((mesh.points.len(), mesh.cells.len()), (68 * 68 * 68, 67 * 67 * 67));
    let mut out = Vec::new();
    source.read(&source.fields()[0], Component::Index(0), 0, &mut out).expect("reads");
    assert_eq!(out.iter().fold((f32::MAX, f32::MIN), |(lo, hi), &v| (lo.min(v), hi.max(v))), (0.0, 255.0));
}

//! VTKHDF files (`tests/interop/write_vtkhdf.py`, which compares with VTK's own reader).

use std::path::{Path, PathBuf};
use tetreel::field::Component;
use tetreel::import;

fn at(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/vtkhdf").join(name)
}

#[test]
fn steps_of_all_kinds_of_grids_have_the_values_that_were_written() {
    for (name, times, points, cells) in [
        ("steps.vtkhdf", &[0.25, 0.5, 2.0][..], 16, 4),
        ("image.vtkhdf", &[0.25, 0.5, 2.0], 24, 6),
        ("polyhedron.vtkhdf", &[0.0], 8, 2),
        ("single.hdf", &[7.5], 8, 1),
    ] {
        let source = import::open(&at(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(source.times().values, times, "{name}");
        let mesh = source.mesh().expect("a mesh");
        assert_eq!((mesh.points.len(), mesh.cells.len()), (points, cells), "{name}");
        let field = source.fields().iter().find(|field| field.name == "T").expect("a field").clone();
        for step in 0..times.len() {
            let mut values = Vec::new();
            source.read(&field, Component::Index(0), step, &mut values).expect("values");
            let expected: Vec<f32> = (0..points).map(|i| (i + 100 * step) as f32).collect();
            assert_eq!(values, expected, "{name}, step {step}");
        }
    }
}

#[test]
fn a_folder_of_files_is_one_series() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["a_2.vtkhdf", "a_10.vtkhdf"] {
        std::fs::copy(at("single.hdf"), folder.path().join(name)).expect("a copy");
    }
    let source = import::open(folder.path()).expect("opens");
    assert_eq!(source.times().values, [0.0, 1.0]);
    let notes = source.notes().join("; ");
    assert!(notes.contains("a_2.vtkhdf") && notes.contains("have the same times"), "{notes}");
    assert_eq!(import::files(folder.path()).expect("files").len(), 3);
}

#[test]
fn what_is_no_grid_is_refused() {
    for (name, expected) in [("surface.vtkhdf", "PolyData"), ("amr.vtkhdf", "OverlappingAMR"), ("other.hdf", "VTKHDF")]
    {
        let error = import::open(&at(name)).err().expect("is refused").to_string();
        assert!(error.contains(name) && error.contains(expected), "{error}");
    }
}

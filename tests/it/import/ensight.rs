//! EnSight Gold cases as text and in C binary (`tests/interop/write_ensight.py`).

use std::fs;
use std::path::{Path, PathBuf};
use tetreel::field::{Component, SeriesSource};
use tetreel::import;

fn at(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/ensight").join(name)
}

fn read(source: &dyn SeriesSource, name: &str, step: usize) -> Vec<f32> {
    let field = source.fields().iter().find(|field| field.name == name).unwrap_or_else(|| panic!("no field {name}"));
    let mut values = Vec::new();
    source.read(field, Component::Index(0), step, &mut values).expect("values");
    values
}

#[test]
fn text_and_binary_have_the_same_series() {
    for kind in ["text", "binary"] {
        let path = at(&format!("{kind}.case"));
        let source = import::open(&path).unwrap_or_else(|e| panic!("{kind}: {e}"));
        let source = source.as_ref();
        assert_eq!(source.times().values, [0.25, 1.5], "{kind}");
        let mesh = source.mesh().expect("a mesh");
        assert_eq!((mesh.points.len(), mesh.cells.len()), (9, 2), "{kind}");
        assert_eq!(mesh.points[8].to_array(), [0.5, 0.5, 2.0]);
        assert_eq!([0, 1].map(|cell| source.cell_number(cell)), [1, 2], "the quadrilateral is left out");
        for step in [0_u8, 1] {
            let expected: Vec<f32> = (0..9).map(|i| f32::from(10 * step + i)).collect();
            assert_eq!(read(source, "T", step.into()), expected, "{kind}");
            assert_eq!(read(source, "p", step.into()), [2.0, 3.0], "{kind}");
        }
        assert_eq!(import::files(&path).expect("files").len(), 5, "{kind}");
    }
}

#[test]
fn a_case_is_known_by_what_it_begins_with_and_needs_all_its_files() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["binary.mesh.geo", "binary.T.0", "binary.T.1", "binary.p"] {
        fs::copy(at(name), folder.path().join(name)).expect("a copy");
    }
    let path = folder.path().join("run.txt");
    fs::copy(at("binary.case"), &path).expect("a copy");
    assert_eq!(import::open(&path).expect("opens").times().len(), 2);
    fs::remove_file(folder.path().join("binary.T.1")).expect("removed");
    let error = import::open(&path).err().expect("is refused").to_string();
    assert!(error.contains("run.txt: ") && error.contains("binary.T.1 is missing"), "{error}");
}

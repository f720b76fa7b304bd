//! Exodus files in each format of netCDF (`tests/interop/write_exodus.py`).

use std::fs;
use std::path::{Path, PathBuf};
use tetreel::field::{Component, SeriesSource};
use tetreel::import;

fn at(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/exodus").join(name)
}

fn read(source: &dyn SeriesSource, name: &str, component: usize, step: usize) -> Vec<f32> {
    let field = source.fields().iter().find(|field| field.name == name).unwrap_or_else(|| panic!("no field {name}"));
    let mut values = Vec::new();
    source.read(field, Component::Index(component), step, &mut values).expect("values");
    values
}

#[test]
fn every_format_of_netcdf_has_the_same_series() {
    for name in ["cdf1.e", "cdf2.e", "cdf5.e", "netcdf4.e"] {
        let source = import::open(&at(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let source = source.as_ref();
        assert_eq!(source.times().values, [0.25, 1.5], "{name}");
        let mesh = source.mesh().expect("a mesh");
        assert_eq!((mesh.points.len(), mesh.cells.len()), (9, 3), "{name}");
        assert_eq!(mesh.points[8].to_array(), [0.5, 0.5, 2.0]);
        assert_eq!(mesh.cells.tets, [[4, 5, 6, 8], [4, 6, 7, 8]], "tetrahedra come first");
        // The quadrilateral between the blocks is left out.
        assert_eq!([0, 1, 2].map(|cell| source.cell_number(cell)), [2, 3, 0]);
        let fields: Vec<_> = source.fields().iter().map(|field| (field.name.as_str(), field.components)).collect();
        assert_eq!(fields, [("T", 1), ("u", 3), ("p", 1), ("q", 1), ("block", 1)], "{name}");
        for step in [0, 1] {
            let of_node = |n: usize| (0..9).map(|i| (100 * step + 10 * n + i) as f32).collect::<Vec<_>>();
            assert_eq!(read(source, "T", 0, step), of_node(1), "{name}");
            for component in 0..3 {
                assert_eq!(read(source, "u", component, step), of_node(2 + component), "{name}");
            }
            let later = 100.0 * step as f32;
            assert_eq!(read(source, "p", 0, step), [1030.0, 1031.0, 1010.0].map(|v| v + later), "{name}");
            let q = read(source, "q", 0, step);
            assert!(q[..2] == [2030.0, 2031.0].map(|v| v + later) && q[2].is_nan(), "{name}: {q:?}");
            assert_eq!(read(source, "block", 0, step), [30.0, 30.0, 10.0], "{name}");
        }
        assert_eq!(import::files(&at(name)).expect("files"), [at(name)]);
    }
}

#[test]
fn parts_are_one_mesh_whichever_is_named() {
    let whole = import::open(&at("cdf1.e")).expect("opens");
    let [first, second] = ["parts.e.2.0", "parts.e.2.1"].map(at);
    let folder = tempfile::tempdir().expect("a folder");
    for path in [&first, &second] {
        fs::copy(path, folder.path().join(path.file_name().expect("a name"))).expect("a copy");
    }
    for paths in [vec![second.clone()], vec![second.clone(), first.clone()], vec![folder.path().to_owned()]] {
        let source = import::open_many(&paths).expect("opens");
        assert_eq!(source.times(), whole.times());
        let (mesh, expected) = (source.mesh().expect("a mesh"), whole.mesh().expect("a mesh"));
        assert_eq!((&mesh.points, &mesh.cells.tets), (&expected.points, &expected.cells.tets));
        assert_eq!(mesh.cells.len(), expected.cells.len());
        for field in whole.fields() {
            for (component, step) in (0..field.components).flat_map(|component| [(component, 0), (component, 1)]) {
                let of = |source: &dyn SeriesSource| read(source, &field.name, component, step);
                let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
                assert_eq!(bits(of(source.as_ref())), bits(of(whole.as_ref())), "{field:?}");
            }
        }
        let notes = source.notes().join("; ");
        assert!(notes.contains("joined 4 points") && notes.contains("10 left (1 HEX8)"), "{notes}");
    }
    assert_eq!(import::files(&second).expect("files"), [second, first]);
}

#[test]
fn files_that_are_no_single_series_are_refused_with_the_remedy() {
    let refusal = |paths: &[PathBuf]| import::open_many(paths).err().expect("is refused").to_string();
    assert!(refusal(&[at("cdf1.e"), at("cdf2.e")]).contains("open it alone"));
    let folder = tempfile::tempdir().expect("a folder");
    for (name, expected) in [("run.e.2.0", "run.e.2.1"), ("run.e-s002", "later mesh"), ("run.e-s002.2.0", "later mesh")]
    {
        let path = folder.path().join(name);
        fs::copy(at("cdf2.e"), &path).expect("a copy");
        assert!(refusal(&[path]).contains(expected), "{name}");
    }
    let path = folder.path().join("run.e");
    fs::copy(at("cdf2.e"), &path).expect("a copy");
    let notes = import::open(&path).expect("opens").notes().join("; ");
    assert!(notes.contains("run.e-s002"), "{notes}");
    let bytes = fs::read(at("netcdf4.e")).expect("a file");
    for end in [0, 3, 9, 100, bytes.len() / 2, bytes.len() - 1] {
        fs::write(&path, &bytes[..end]).expect("a file");
        let error = refusal(std::slice::from_ref(&path));
        assert!(error.contains("run.e: "), "{error}");
    }
}

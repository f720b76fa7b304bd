//! XDMF files in the dialects of several writers (`tests/interop/write_xdmf.py`), and damaged ones.

use super::numbers;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tetreel::error::FileResult;
use tetreel::field::{Component, SeriesSource};
use tetreel::import;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/xdmf")
}

fn expected() -> Value {
    serde_json::from_str(&fs::read_to_string(folder().join("expected.json")).unwrap()).unwrap()
}

/// All components of a field, tuple by tuple, as bits; NaNs compare by being one.
fn read(source: &dyn SeriesSource, name: &str, step: usize) -> Vec<u64> {
    let field = source.fields().iter().find(|f| f.name == name).unwrap_or_else(|| panic!("no field {name}"));
    let mut parts = vec![Vec::new(); field.components];
    for (i, part) in parts.iter_mut().enumerate() {
        source.read(field, Component::Index(i), step, part).unwrap();
    }
    (0..parts[0].len()).flat_map(|i| parts.iter().map(move |part| plain(part[i]))).collect()
}

fn plain(value: f32) -> u64 {
    if value.is_nan() { f32::NAN.to_bits().into() } else { value.to_bits().into() }
}

fn assert_is_the_series(name: &str, source: &dyn SeriesSource, expected: &Value, width: &str, fields: &[&str]) {
    let times: Vec<u64> = source.times().values.iter().map(|t| t.to_bits()).collect();
    assert_eq!(times, numbers(&expected["times"]), "{name}: times");
    let mesh = source.mesh().unwrap();
    let points: Vec<u64> = mesh.points.iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect();
    assert_eq!(points, numbers(&expected["points"][width]), "{name}: points");
    let tets: Vec<u64> = mesh.cells.tets.iter().flatten().map(|&v| v.into()).collect();
    assert_eq!(tets, expected["tets"].as_array().unwrap().iter().flat_map(numbers).collect::<Vec<_>>(), "{name}: tets");
    for field in fields {
        for step in 0..3 {
            let wanted = numbers(&expected["values"][width][field][step]);
            let wanted: Vec<u64> = wanted.into_iter().map(|bits| plain(f32::from_bits(bits as u32))).collect();
            assert_eq!(read(source, field, step), wanted, "{name}: {field} at step {step}");
        }
    }
}

#[test]
fn every_dialect_of_xdmf_is_read_exactly() {
    let expected = expected();
    let files = expected["files"].as_object().unwrap();
    assert_eq!(files.len(), 13);
    for (name, what) in files {
        let source = import::open(&folder().join(format!("{name}.xdmf"))).unwrap_or_else(|e| panic!("{name}: {e}"));
        let width = if what["f32"] == true { "f32" } else { "f64" };
        let fields: Vec<&str> = what["fields"].as_array().unwrap().iter().map(|f| f.as_str().unwrap()).collect();
        assert_is_the_series(name, &*source, &expected, width, &fields);
    }
}

#[test]
fn cells_without_volume_and_attributes_that_are_not_read_are_noted() {
    let spatial = import::open(&folder().join("spatial.xdmf")).unwrap();
    let notes = spatial.notes().join("\n");
    assert!(notes.contains("skipped 2 cells without volume: 1 polyline, 1 triangle"), "{notes}");
    assert!(!notes.contains("pieces"), "they share no points: {notes}");
    // Values of the skipped cells are skipped, too.
    let numbers: Vec<u64> = [1, 2, 3, 4, 5, 6, 0, 1, 2, 3, 4, 5].map(|v: u8| plain(f32::from(v))).to_vec();
    assert_eq!(read(&*spatial, "number", 1), numbers);
    let dolfin = import::open(&folder().join("dolfin.xdmf")).unwrap();
    let notes = dolfin.notes().join("\n");
    assert!(notes.contains("'c' (is a function of elements 'CG' of degree '' on cells ''"), "{notes}");
    let quadratic = import::open(&folder().join("checkpoint_xml.xdmf")).unwrap();
    let notes = quadratic.notes().join("\n");
    assert!(notes.contains("field 'U' is of degree 2: its values at corners"), "{notes}");
}

#[test]
fn units_are_attributes_of_data_sets_of_the_first_step() {
    let source = import::open(&folder().join("checkpoint.xdmf")).unwrap();
    let units: Vec<_> = source.fields().iter().map(|field| (field.name.as_str(), source.unit(field))).collect();
    let [kelvin, speed] = ["K", "m/s"].map(|unit| Some(unit.to_owned()));
    assert_eq!(units, [("T", kelvin), ("U", speed), ("region", None)], "65 letters are no unit");
}

#[test]
fn files_for_one_field_each_become_one_series() {
    let dir = copied(&["gzip_f32.xdmf", "gzip_f32.h5"]);
    let text = fs::read_to_string(dir.path().join("gzip_f32.xdmf")).unwrap();
    let only = |name: &str| {
        let hide = |text: String, other: &str| text.replace(&format!("Name=\"{other}\""), "Name=\"\"");
        ["T", "U", "region"].into_iter().filter(|other| *other != name).fold(text.clone(), hide)
    };
    let paths: Vec<PathBuf> = ["T", "U", "region"].map(|name| dir.path().join(format!("{name}.xmf"))).to_vec();
    for (path, name) in paths.iter().zip(["T", "U", "region"]) {
        fs::write(path, only(name)).unwrap();
    }
    let joined = import::open_many(&paths).unwrap();
    assert_is_the_series("joined", &*joined, &expected(), "f32", &["T", "U", "region"]);
    fs::write(&paths[1], only("U").replace("\"0.25\"", "\"0.26\"")).unwrap();
    assert!(refusal(import::open_many(&paths)).contains("other times"));
    fs::write(&paths[1], only("U").replacen("gzip_f32.h5:/mesh/points", "gzip_f32.h5:/U/0", 1)).unwrap();
    assert!(refusal(import::open_many(&paths)).contains("another mesh"));
    let mixed = [paths[0].clone(), dir.path().join("a.vtu")];
    assert!(refusal(import::open_many(&mixed)).contains("one kind"));
}

#[test]
fn checkpoints_that_contradict_themselves_are_errors_with_file_and_place() {
    for (from, to, parts) in [
        ("h5:/T/T_1/vector", "h5:/T/T_1/cells", &["T_1", "has the shape [12, 1]"][..]),
        ("h5:/T/T_1/cell_dofs", "h5:/U/U_1/cells", &["checkpoint.h5", "/U/U_1/cells"]),
        ("\"48 1\"", "\"47 1\"", &["checkpoint.xdmf: <DataItem> at byte", "47 dofs"]),
        ("\"13 1\"", "\"12 1\"", &["checkpoint.xdmf: <DataItem> at byte", "has [12, 1] numbers"]),
        ("/T/T_1/x_cell_dofs", "/T/T_1/x_cell_dof", &["checkpoint.h5", "x_cell_dof", "does not exist"]),
    ] {
        let dir = copied(&["checkpoint.xdmf", "checkpoint.h5"]);
        let path = dir.path().join("checkpoint.xdmf");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let error = refusal(read_all(&path));
        assert!(parts.iter().all(|part| error.contains(part)), "{from} -> {to}: {error}");
    }
}

fn copied(names: &[&str]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in names {
        fs::copy(folder().join(name), dir.path().join(name)).unwrap();
    }
    dir
}

fn refusal<T>(result: FileResult<T>) -> String {
    result.err().expect("refused").to_string()
}

/// Opens the series and reads all of it.
fn read_all(path: &Path) -> FileResult<()> {
    let source = import::open(path)?;
    source.mesh()?;
    let mut out = Vec::new();
    for step in 0..source.times().len() {
        for field in source.fields() {
            source.read(field, Component::Magnitude, step, &mut out)?;
        }
    }
    Ok(())
}

#[test]
fn damaged_xdmf_is_one_error_with_file_and_place() {
    let damages: [(&str, &str, &[&str]); 18] = [
        ("contiguous_f64.h5:/T/1", "gone.h5:/T/1", &["contiguous_f64.xdmf", "DataItem", "gone.h5 is missing"]),
        ("h5:/T/1", "h5:/T/9", &["contiguous_f64.h5", "/T/9", "does not exist"]),
        ("h5:/T/1", "h5:/V/1", &["contiguous_f64.h5", "/V/1", "does not exist"]),
        ("h5:/T/1", "h5:/text", &["contiguous_f64.h5", "/text", "holds no numbers"]),
        ("h5:/T/1", "h5:/U/1", &["contiguous_f64.h5", "/U/1", "[16, 3]", "[16]"]),
        ("h5:/T/1", "h5:/T", &["contiguous_f64.h5", "/T"]),
        ("h5:/mesh/cells", "h5:/mesh/points", &["contiguous_f64.h5", "/mesh/points", "[16, 3]", "[12, 4]"]),
        ("Dimensions=\"12 4\" NumberType=\"Int\"", "Dimensions=\"12 5\" NumberType=\"Int\"", &["contiguous_f64"]),
        (
            "NumberOfElements=\"12\"",
            "NumberOfElements=\"13\"",
            &["contiguous_f64.xdmf", "13 cells of type tetrahedron need 52"],
        ),
        ("NumberType=\"Int\"", "NumberType=\"Quaternion\"", &["contiguous_f64.xdmf", "Quaternion"]),
        ("Dimensions=\"16 3\"", "Dimensions=\"16 4\"", &["contiguous_f64.xdmf", "Geometry", "3 coordinates"]),
        ("Tetrahedron", "Hexahedron", &["contiguous_f64.xdmf", "12 cells of type hexahedron need 96"]),
        ("Tetrahedron", "Polyhedron", &["contiguous_f64.xdmf", "polyhedron", "not read", "Tetrahedralize"]),
        ("\"Tetrahedron\"", "\"3DCoRectMesh\"", &["contiguous_f64.xdmf", "3DCoRectMesh"]),
        ("<Time Value=\"0.25\"/>", "<Time Value=\"0.1\"/>", &["contiguous_f64.xdmf", "step 1", "same time"]),
        ("<Time Value=\"0.25\"/>", "<Time Value=\"soon\"/>", &["contiguous_f64.xdmf", "soon"]),
        ("<Time Value=\"0.25\"/>", "", &["contiguous_f64.xdmf", "step 1", "no <Time>"]),
        ("</Attribute>", "</Attributo>", &["contiguous_f64.xdmf", "malformed XML", "byte"]),
    ];
    for (from, to, parts) in damages {
        let dir = copied(&["contiguous_f64.xdmf", "contiguous_f64.h5"]);
        let path = dir.path().join("contiguous_f64.xdmf");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let error = refusal(read_all(&path));
        assert!(parts.iter().all(|part| error.contains(part)), "{from} -> {to}: {error}");
    }
}

#[test]
fn a_mesh_that_moves_changes_or_is_flat_is_refused() {
    let dir = copied(&["contiguous_f64.xdmf", "contiguous_f64.h5"]);
    let path = dir.path().join("contiguous_f64.xdmf");
    let text = fs::read_to_string(&path).unwrap();
    let second = text.find("step 1").unwrap();
    let edit = |from: &str, to: &str| {
        fs::write(&path, [&text[..second], &text[second..].replacen(from, to, 1)].concat()).unwrap();
        refusal(read_all(&path))
    };
    assert!(edit("h5:/mesh/points", "h5:/U/0").contains("points move"));
    let flat = text.replace("GeometryType=\"XYZ\"", "GeometryType=\"XY\"").replace("\"16 3\"", "\"24 2\"");
    fs::write(&path, flat.replace("h5:/mesh/points", "h5:/all/T")).unwrap();
    assert!(refusal(read_all(&path)).contains("contiguous_f64"));
    fs::write(&path, text.replace("\"Tetrahedron\"", "\"Triangle\"")).unwrap();
    assert!(refusal(read_all(&path)).contains("no cells with a volume"));
}

/// The HDF5 file of a series with other bytes.
fn with_h5(name: &str, change: impl FnOnce(&mut Vec<u8>)) -> FileResult<()> {
    let (xdmf, h5) = (format!("{name}.xdmf"), format!("{name}.h5"));
    let dir = copied(&[&xdmf, &h5]);
    let mut bytes = fs::read(dir.path().join(&h5)).unwrap();
    change(&mut bytes);
    fs::write(dir.path().join(&h5), bytes).unwrap();
    let result = read_all(&dir.path().join(xdmf));
    if let Err(error) = &result {
        assert!(error.to_string().contains(&h5) || error.to_string().contains(name), "{error}");
    }
    result
}

#[test]
fn a_cut_hdf5_file_is_an_error_that_names_it() {
    for name in ["contiguous_f64", "gzip_f32", "plain_be", "latest_f32", "checkpoint"] {
        let length = fs::metadata(folder().join(format!("{name}.h5"))).unwrap().len() as usize;
        for cut in [0, 7, 100, length / 4, length / 2] {
            assert!(with_h5(name, |bytes| bytes.truncate(cut)).is_err(), "{name} cut at {cut} of {length}");
        }
        for cut in (0..length).step_by(997) {
            let _ = with_h5(name, |bytes| bytes.truncate(cut));
        }
    }
}

#[test]
fn flipped_bytes_of_an_hdf5_file_never_panic() {
    // A fixed linear congruential generator (Knuth): the cases are the same in every run.
    let mut state = 7_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let mut failed = 0;
    for name in ["contiguous_f64", "gzip_f32", "plain_be", "latest_f32"] {
        for _ in 0..100 {
            let flips: Vec<(usize, u8)> = (0..1 + next() % 5).map(|_| (next(), next() as u8)).collect();
            let result = with_h5(name, |bytes| {
                for (at, value) in flips {
                    let length = bytes.len();
                    bytes[at % length] = value;
                }
            });
            failed += usize::from(result.is_err());
        }
    }
    assert!(failed > 20, "only {failed} of 400 were noticed: these flips test nothing");
}

//! Tests of `import` across modules: files written by VTK, series on disk, and damaged files.

pub mod blocks;
mod damage;
mod ensight;
mod exodus;
mod legacy;
mod npz;
mod parts;
mod raw;
pub mod series;
mod shapes;
mod steiner;
mod vtkhdf;
mod xdmf;

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tetreel::field::{Association, Component, SeriesSource};
use tetreel::import;

/// The folder of files that `tests/interop/write_vtu.py` wrote.
fn oracle_dir() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/vtu")
}

/// What must be found in these files.
fn oracle() -> Value {
    let text = std::fs::read_to_string(oracle_dir().join("expected.json")).expect("the oracle's values");
    serde_json::from_str(&text).expect("valid JSON")
}

fn numbers(list: &Value) -> Vec<u64> {
    list.as_array().expect("a list").iter().map(|v| v.as_u64().expect("a bit pattern")).collect()
}

/// Asserts that `source` is one step that holds exactly what `grid` lists.
fn assert_same(name: &str, source: &dyn SeriesSource, grid: &Value) {
    let time = grid["time"].as_u64().map_or(0.0, f64::from_bits);
    assert_eq!(source.times().values, [time], "{name}: times");
    let mesh = source.mesh().unwrap_or_else(|e| panic!("{name}: {e}"));
    let points: Vec<u64> = mesh.points.iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect();
    assert_eq!(points, numbers(&grid["points"]), "{name}: points");
    let tets: Vec<u64> = mesh.cells.tets.iter().flatten().map(|&v| v.into()).collect();
    let wanted: Vec<u64> = grid["tets"].as_array().expect("tets").iter().flat_map(numbers).collect();
    assert_eq!(tets, wanted, "{name}: tets");
    let skipped = grid["skipped"].as_u64().expect("a count");
    let note = format!("skipped {skipped} cells without volume");
    assert_eq!(source.notes().iter().any(|n| n.starts_with(&note)), skipped > 0, "{name}: {:?}", source.notes());

    let fields = grid["fields"].as_array().expect("fields");
    assert_eq!(source.fields().len(), fields.len(), "{name}: fields");
    let mut out = vec![1.0; 3];
    for (field, wanted) in source.fields().iter().zip(fields) {
        let association = if wanted["association"] == "point" { Association::Point } else { Association::Cell };
        let description = (field.name.as_str(), field.components as u64, field.association);
        let components = wanted["components"].as_u64().expect("a count");
        assert_eq!(description, (wanted["name"].as_str().expect("a name"), components, association), "{name}");
        let values: Vec<u32> = numbers(&wanted["values"]).iter().map(|&v| v as u32).collect();
        for component in 0..field.components {
            source.read(field, Component::Index(component), 0, &mut out).unwrap_or_else(|e| panic!("{name}: {e}"));
            let got: Vec<_> = out.iter().map(|v| v.to_bits()).collect();
            let one: Vec<_> = values.iter().skip(component).step_by(field.components).copied().collect();
            // NaNs compare by being one: conversion may change their payload.
            let plain = |bits: &u32| if f32::from_bits(*bits).is_nan() { f32::NAN.to_bits() } else { *bits };
            let (got, one): (Vec<_>, Vec<_>) = (got.iter().map(plain).collect(), one.iter().map(plain).collect());
            assert_eq!(got, one, "{name}: component {component} of '{}'", field.name);
        }
    }
}

#[test]
fn every_file_that_vtk_wrote_is_read_exactly() {
    let oracle = oracle();
    let files = oracle["files"].as_object().expect("files");
    // ascii; 3 encodings x 4 compressors x 2 header types x 2 byte orders; types, mixed, blocks, pieces
    assert_eq!(files.len(), 1 + 48 + 3 + 2 + 9 + 1);
    for (name, grid) in files {
        let source = import::open(&oracle_dir().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let grid = &oracle["grids"][grid.as_str().expect("a name")];
        assert!(!grid["tets"].as_array().expect("tets").is_empty(), "{name}");
        assert_same(name, source.as_ref(), grid);
    }
}

#[test]
fn the_files_cover_what_they_are_named_for() {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    let mut count = 0;
    for entry in std::fs::read_dir(oracle_dir()).expect("the folder") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "vtu") {
            continue;
        }
        count += 1;
        let bytes = std::fs::read(&path).expect("a file");
        let text = String::from_utf8_lossy(&bytes);
        for feature in
            ["UInt32\"", "UInt64\"", "BigEndian", "vtkZLib", "vtkLZ4", "vtkLZMA", "\"raw\"", "\"base64\"", "\"binary\""]
        {
            *seen.entry(feature).or_default() += usize::from(text.contains(feature));
        }
    }
    assert_eq!(count, 66, "64 files with a mesh and 2 empty ones");
    assert!(seen.values().all(|&n| n >= 12), "{seen:?}");
}

#[test]
fn a_mesh_without_tetrahedra_is_refused_and_says_so() {
    for name in oracle()["empty"].as_array().expect("a list") {
        let path = oracle_dir().join(name.as_str().expect("a name"));
        let error = import::open(&path).err().expect("nothing to draw").to_string();
        assert!(error.contains("no cells with a volume"), "{error}");
    }
}

#[test]
fn the_magnitude_of_a_vector_is_its_norm_and_what_leaves_f32_is_noted() {
    let source = import::open(&oracle_dir().join("raw_zlib_64_le.vtu")).expect("opens");
    let field = source.fields().iter().find(|f| f.name == "velocity").expect("a vector").clone();
    let (mut norm, mut parts) = (Vec::new(), vec![Vec::new(); 3]);
    source.read(&field, Component::Magnitude, 0, &mut norm).expect("reads");
    for (i, part) in parts.iter_mut().enumerate() {
        source.read(&field, Component::Index(i), 0, part).expect("reads");
    }
    let mut noticed = 0;
    for (i, &norm) in norm.iter().enumerate() {
        let squares = |parts: &[Vec<f32>]| parts.iter().map(|part| f64::from(part[i]).powi(2)).sum::<f64>();
        let naive = squares(&parts).sqrt();
        // The components are rounded to f32 here and not there: half an ulp each, and half for the norm.
        let is_same = |norm: f64| (norm - naive).abs() <= naive * f64::from(f32::EPSILON);
        assert!(is_same(f64::from(norm)), "{norm} {naive}");
        noticed += usize::from(!is_same(squares(&parts[..2]).sqrt()));
    }
    assert!(noticed > 0, "a norm of two components is not noticed");
    let error = source.read(&field, Component::Index(3), 0, &mut norm).expect_err("no such component").to_string();
    assert!(error.contains("3 components") && error.contains("velocity"), "{error}");
    assert!(
        source
            .read(&field, Component::Index(0), 1, &mut norm)
            .expect_err("no such step")
            .to_string()
            .contains("step 1")
    );
}

#[test]
fn the_series_of_the_papers_opens_with_its_192_steps() {
    let Some(dir) = crate::common::samples() else { return };
    let source = import::open(&dir.join("spxf/spxf.pvd")).expect("opens");
    let times = &source.times().values;
    assert_eq!(times.len(), 192);
    assert_eq!(times[..3], [0.004, 0.008, 0.012]);
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
    let mesh = source.mesh().expect("reads");
    assert_eq!((mesh.points.len(), mesh.cells.tets.len()), (2896, 12936));
    let fields: Vec<_> = source.fields().iter().map(|f| (f.name.as_str(), f.components, f.association)).collect();
    assert_eq!(fields, [("reaction_force", 1, Association::Point), ("displacement", 3, Association::Point)]);
    let mut out = Vec::new();
    let mut range = (f32::INFINITY, f32::NEG_INFINITY);
    for step in 0..192 {
        source.read(&source.fields()[0], Component::Index(0), step, &mut out).expect("reads");
        assert_eq!(out.len(), 2896);
        range = out.iter().fold(range, |(lo, hi), &v| (lo.min(v), hi.max(v)));
        if step == 0 {
            // RangeMax of the file's header.
            assert_eq!(range, (0.0, 3_398.609_4));
        }
    }
    assert!(range.0 == 0.0 && range.1 > 3398.0 && range.1.is_finite(), "{range:?}");
    source.read(&source.fields()[1], Component::Magnitude, 0, &mut out).expect("reads");
    // RangeMax of a vector in the header is its largest norm, printed with 11 digits; f32 is spaced by 2.9e-11 there, and
    // components and norm are rounded by half of that each. Measured: 1.4e-11.
    let largest = out.iter().fold(0.0_f32, |a, &b| a.max(b));
    assert!((f64::from(largest) - 0.000_317_446_843_45).abs() < 4e-11, "{largest}");
}

#[test]
fn the_single_meshes_of_the_papers_open() {
    let Some(dir) = crate::common::samples() else { return };
    for (name, points, tets, fields) in [("spx", 2896, 12936, 1), ("bluntfin", 40960, 187_395, 3)] {
        let source = import::open(&dir.join(format!("paper_static/{name}.vtu"))).expect("opens");
        let mesh = source.mesh().expect("reads");
        assert_eq!((mesh.points.len(), mesh.cells.tets.len(), source.fields().len()), (points, tets, fields), "{name}");
        assert_eq!(source.times().values, [0.0]);
    }
}

//! `tetreel fit`: functions in a store or in a copy of it, what is said of them, and pictures with them.

use super::connectivity::write_soup;
use super::{Place, files};
use glam::DVec3;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tetreel::codec::{seal, to_bytes};
use tetreel::fit::{FitError, FitOptions, fit};
use tetreel::functions::value_at;
use tetreel::image::{Planes, read_exr};
use tetreel::mesh::Mesh;
use tetreel::store::Store;
use tetreel::task::{Cancel, Progress};

/// All files of a store but its functions, by their path below it.
fn without_functions(store: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let below = |(path, bytes): (PathBuf, Vec<u8>)| (path.strip_prefix(store).unwrap().to_owned(), bytes);
    files(store).into_iter().map(below).filter(|(path, _)| !path.starts_with("functions")).collect()
}

fn sheets(place: &Place, store: &str) -> Planes {
    let look = ["--field", "linear", "--tf", "viridis@0:0.01,1:0.2", "--exr", "raw"];
    let words = ["render", store, "-o", "f.exr", "--steps", "2", "--size", "32x32", "--mode", "sheets"];
    place.ok(&[&words[..], &look].concat());
    read_exr(&place.path("f.exr")).unwrap().planes
}

const FIT: [&str; 4] = ["fit", "slab.zarr", "--method", "vertices"];

#[test]
fn functions_are_added_to_a_store_or_to_a_copy_of_it_and_nothing_else_changes() {
    let place = Place::with_slab();
    let before = files(&place.path("slab.zarr"));
    let derived = sheets(&place, "slab.zarr");
    let said = place.ok(&[&FIT[..], &["-o", "out.zarr"]].concat());
    assert!(said.contains("vertices: 500 functions") && said.contains("interior cells: mean"), "{said}");
    assert!(files(&place.path("slab.zarr")) == before);
    assert!(without_functions(&place.path("out.zarr")) == without_functions(&place.path("slab.zarr")));

    place.ok(&[&FIT[..], &["--add"]].concat());
    let mut after = files(&place.path("slab.zarr"));
    after.retain(|path, _| !path.starts_with(place.path("slab.zarr/functions")));
    assert!(after == before);
    let functions = |store: &str| -> Vec<_> { files(&place.path(store).join("functions")).into_values().collect() };
    assert!(functions("slab.zarr") == functions("out.zarr"));
    let names = std::fs::read_dir(place.0.path()).unwrap().map(|entry| entry.unwrap().file_name());
    assert!(names.into_iter().all(|name| !name.to_string_lossy().starts_with('.')), "nothing is left over");

    // The same to the bit.
    assert!(sheets(&place, "slab.zarr") == derived && sheets(&place, "out.zarr") == derived);
    place.ok(&[&FIT[..], &["--add", "--overwrite", "--width", "0.5", "--cut", "2.5"]].concat());
    assert!(sheets(&place, "slab.zarr") != derived, "other functions are another picture");
    let info = place.json(&["info", "slab.zarr", "--json"]);
    assert_eq!((&info["functions"]["width"], &info["functions"]["cut"]), (&0.5.into(), &2.5.into()));
    place.ok(&[&FIT[..], &["--add", "--overwrite", "--preset", "neophytou"]].concat());
    assert!(functions("slab.zarr") == functions("out.zarr"));
    // A copy of a store that has functions has the new ones alone.
    place.ok(&["fit", "slab.zarr", "--method", "vertices", "-o", "other.zarr", "--width", "0.5"]);
    assert!(functions("other.zarr") != functions("out.zarr"));
}

/// A point in a cell, by its number in the source.
fn interpolated(mesh: &Mesh, values: &[f32], cell: u64, at: DVec3) -> f64 {
    let cell = mesh.cell_source.iter().position(|&source| u64::from(source) == cell).unwrap();
    let tet = mesh.topology.tets[cell];
    let [a, b, c, d] = tet.map(|vertex| mesh.positions.local[vertex as usize].as_dvec3());
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).dot((c - a).cross(d - a));
    let parts = [volume(at, b, c, d), volume(a, at, c, d), volume(a, b, at, d), volume(a, b, c, at)];
    assert!(parts.iter().all(|&part| part >= 0.0), "the point is in its cell: {parts:?}");
    let sum: f64 = parts.iter().zip(tet).map(|(part, vertex)| part * f64::from(values[vertex as usize])).sum();
    sum / volume(a, b, c, d)
}

#[test]
fn what_is_reported_is_what_the_stored_functions_give() {
    let place = Place::with_slab();
    let words = ["--add", "--field", "linear", "--steps", "1..3:2", "--json"];
    let report = place.json(&[&FIT[..], &words].concat());
    let info = place.json(&["info", "slab.zarr", "--json"]);
    assert_eq!(info["functions"]["report"], report["report"]);
    assert_eq!(report["count"], 500);
    let report = &report["report"];
    assert_eq!((&report["field"], &report["steps_of_series"]), (&"linear".into(), &5.into()));

    let store = Store::open(place.path("slab.zarr")).unwrap();
    let mesh = store.mesh().unwrap();
    let kernels = store.functions().unwrap().unwrap().kernels(&mesh).unwrap();
    let reader = store.field(&"linear".parse().unwrap()).unwrap();
    let [lo, hi] = reader.info().range.unwrap().map(f64::from);
    let mut all = Vec::new();
    let steps = report["steps"].as_array().unwrap();
    assert_eq!(steps.iter().map(|of| of["step"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 3]);
    for of_step in steps {
        let mut values = vec![0.0; reader.value_count()];
        reader.decode_step(of_step["step"].as_u64().unwrap() as usize, &mut values).unwrap();
        let errors: Vec<f64> = (mesh.positions.local.iter().zip(&values))
            .map(|(p, &v)| (value_at(&kernels, &values, p.as_dvec3()).unwrap() - f64::from(v)).abs() / (hi - lo))
            .collect();
        let same = |found: &Value, errors: &[f64]| {
            let count = errors.len() as f64;
            assert_eq!(found["samples"].as_u64().unwrap(), errors.len() as u64);
            assert_eq!(found["mean"].as_f64().unwrap(), errors.iter().sum::<f64>() / count);
            assert_eq!(found["rms"].as_f64().unwrap(), (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt());
            assert_eq!(found["max"].as_f64().unwrap(), errors.iter().copied().fold(0.0, f64::max));
        };
        same(&of_step["vertices"], &errors);
        all.extend(errors);
        for group in ["interior", "boundary"] {
            let (found, worst) = (&of_step[group], &of_step[group]["at"]);
            assert!(found["samples"].as_u64().unwrap() > 500 && found["holes"] == 0 && found["unreached"] == 0);
            let at: [f64; 3] = serde_json::from_value(worst["point"].clone()).unwrap();
            let at = mesh.positions.local_from_world(DVec3::from_array(at));
            let truth = interpolated(&mesh, &values, worst["cell"].as_u64().unwrap(), at);
            let error = (value_at(&kernels, &values, at).unwrap() - truth).abs() / (hi - lo);
            // The point was rounded on its way to the world and back.
            assert!((error - found["max"].as_f64().unwrap()).abs() < 1e-13, "{error} {found}");
        }
        if of_step["step"] == 3 {
            same(&report["series"]["vertices"], &all);
        }
    }
    // Another seed: other places, about the same errors.
    let other = place.json(&[&FIT[..], &words, &["--overwrite", "--seed", "2"]].concat());
    let rms = |report: &Value| report["series"]["boundary"]["rms"].as_f64().unwrap();
    assert!(rms(&other["report"]) != rms(report) && (rms(&other["report"]) / rms(report) - 1.0).abs() < 0.2);
}

#[test]
fn functions_stay_when_steps_are_added() {
    let place = Place::with_slab();
    place.ok(&["export", "slab.zarr", "-o", "run.pvd"]);
    place.ok(&["import", "run.pvd", "-o", "grows.zarr", "--steps", "0..2"]);
    place.ok(&["fit", "grows.zarr", "--method", "vertices", "--add"]);
    let before = files(&place.path("grows.zarr/functions"));
    place.ok(&["import", "run.pvd", "-o", "grows.zarr", "--append"]);
    assert!(files(&place.path("grows.zarr/functions")) == before);
    let info = place.json(&["info", "grows.zarr", "--json"]);
    assert_eq!((&info["time"]["steps"], &info["functions"]["report"]["steps_of_series"]), (&5.into(), &3.into()));
}

#[test]
fn what_has_no_functions_is_refused_with_the_remedy() {
    let place = Place::with_slab();
    let data = |name: &str| format!("{}/tests/data/{name}", env!("CARGO_MANIFEST_DIR"));
    place.ok(&["import", &data("npz/cloud.npz"), "-o", "cloud.zarr"]);
    write_soup(&place);
    place.ok(&["import", "soup.vtk", "-o", "soup.zarr"]);
    place.ok(&["import", &data("vtu/ascii.vtu"), "-o", "cells.zarr"]);
    let cells = place.json(&["info", "cells.zarr", "--json"]);
    let of_cells = cells["fields"].as_array().unwrap().iter().find(|field| field["values_of"] == "cell").unwrap();
    let of_cells = of_cells["name"].as_str().unwrap();
    place.ok(&[&FIT[..], &["-o", "out.zarr"]].concat());
    std::fs::create_dir(place.path("folder")).unwrap();
    for (words, parts) in [
        (&["cells.zarr", "--add", "--field", of_cells][..], &["cells.zarr", of_cells, "--cells-to-points"][..]),
        (&["cells.zarr", "-o", "new.zarr", "--field", of_cells], &["cells.zarr", of_cells, "--cells-to-points"]),
        (&["cloud.zarr", "--add"], &["cloud.zarr", "points without cells"]),
        (&["soup.zarr", "--add"], &["soup.zarr", "not joined", "--connectivity full"]),
        (&["soup.zarr", "-o", "new.zarr"], &["soup.zarr", "not joined", "--connectivity full"]),
        (&["out.zarr", "--add"], &["out.zarr", "exists", "--overwrite"]),
        (&["slab.zarr", "-o", "out.zarr"], &["out.zarr", "exists", "--overwrite"]),
        (&["slab.zarr", "-o", "folder", "--overwrite"], &["folder", "not a tetreel store"]),
        (&["slab.zarr", "-o", "none/new.zarr"], &["none", "create it first"]),
        (&["soup.vtk", "--add"], &["soup.vtk", "--add", "-o"]),
        (&["none.zarr", "--add"], &["none.zarr"]),
        (&["slab.zarr", "--add", "--field", "q"], &["slab.zarr", "'q'", "linear"]),
        (&["slab.zarr", "--add", "--steps", "7..9"], &["7..9"]),
        (&["slab.zarr", "--add", "--width", "0"], &["0 times as wide", "at most 4"]),
        (&["slab.zarr", "--add", "--width", "NaN"], &["NaN times as wide"]),
        (&["slab.zarr", "--add", "--cut", "7"], &["7 widths", "0.5 to 6"]),
        (&["slab.zarr", "--add", "-o", "new.zarr"], &["cannot be used with"]),
        (&["slab.zarr"], &["required"]),
        (&["slab.zarr", "--add", "--preset", "neophytou", "--width", "0.5"], &["cannot be used with"]),
    ] {
        place.refuses(&[&["fit", "--method", "vertices"], words].concat(), parts);
    }
    place.refuses(&["fit", "slab.zarr", "--add", "--method", "clusters"], &["'clusters'", "--method"]);
}

#[test]
fn functions_that_are_not_known_or_damaged_are_named_and_the_rest_plays() {
    let place = Place::with_slab();
    place.ok(&[&FIT[..], &["--add"]].concat());
    let render = ["render", "slab.zarr", "-o", "f.png", "--steps", "1", "--size", "16x16", "--mode"];
    let refused = |parts: &[&str]| {
        place.refuses(&[&render[..], &["sheets"]].concat(), parts);
        place.ok(&[&render[..], &["raycast"]].concat());
        std::fs::remove_file(place.path("f.png")).unwrap();
    };
    let metadata = place.path("slab.zarr/functions/vertices/zarr.json");
    let text = std::fs::read_to_string(&metadata).unwrap();
    for (from, to, part) in [
        ("\"normalised\"", "\"additive\"", "form \"additive\""),
        ("\"ellipsoid\"", "\"sphere\"", "shape \"sphere\""),
        ("\"gaussian\"", "\"multiquadric\"", "phi \"multiquadric\""),
        ("\"method\": \"vertices\"", "\"method\": \"clusters\"", "method \"clusters\""),
        ("\"version\": 1", "\"version\": 2", "version 2"),
        ("\"cut\": 3.0", "\"cut\": 99.0", "99 widths"),
        ("\"count\": 500", "\"count\": 499", "500 vertices"),
    ] {
        let other = text.replacen(from, to, 1);
        assert_ne!(other, text, "{from}");
        std::fs::write(&metadata, other).unwrap();
        refused(&["functions/vertices", part]);
        let info = place.ok(&["info", "slab.zarr"]);
        assert!(info.contains(part) || part.contains("500"), "{info}");
    }
    std::fs::write(&metadata, &text).unwrap();
    let chunk = place.path("slab.zarr/functions/vertices/factors/c/0/0/0");
    let whole = std::fs::read(&chunk).unwrap();
    let mut flipped = whole.clone();
    flipped[100] ^= 8;
    for damaged in [&flipped, &whole[..whole.len() - 1]] {
        std::fs::write(&chunk, damaged).unwrap();
        refused(&["functions/vertices/factors/c/0/0/0", "block 0"]);
    }
    std::fs::remove_file(&chunk).unwrap();
    refused(&["functions/vertices/factors/c/0/0/0", "block 0", "missing"]);
    let mut numbers: Vec<f32> =
        whole[..500 * 24].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    numbers[6 * 77 + 2] = f32::INFINITY;
    let payload = to_bytes(&numbers);
    std::fs::write(&chunk, [&payload[..], &seal(&payload)].concat()).unwrap();
    refused(&["functions/vertices/factors", "block 0", "function 77", "not finite", "fit --add --overwrite"]);
    place.ok(&[&FIT[..], &["--add", "--overwrite"]].concat());
    assert!(std::fs::read(&chunk).unwrap() == whole);
}

/// Raises a flag at the first step that is judged, or the first file that is copied.
struct CancelledAt(&'static str, Cancel, Mutex<String>);

impl Progress for CancelledAt {
    fn begin(&self, stage: &str, _: u64, _: &str) {
        stage.clone_into(&mut self.2.lock().unwrap());
    }

    fn advance(&self, _: u64) {
        if *self.2.lock().unwrap() == self.0 {
            self.1.cancel();
        }
    }

    fn end(&self) {}

    fn say(&self, _: &str) {}
}

#[test]
fn a_fit_that_is_cancelled_leaves_nothing() {
    let place = Place::with_slab();
    let store = Store::open(place.path("slab.zarr")).unwrap();
    let before = files(place.0.path());
    let out = place.path("out.zarr");
    let mut cancelled = 0;
    for (stage, out) in [("judging", None), ("judging", Some(&*out)), ("copying", Some(&*out))] {
        let progress = CancelledAt(stage, Cancel::new(), Mutex::default());
        // More steps than are judged at a time.
        let options = FitOptions { steps: Some((0..5).cycle().take(15).collect()), ..FitOptions::default() };
        let result = fit(&store, out, &options, &progress, &progress.1);
        cancelled += usize::from(matches!(result, Err(FitError::Cancelled)));
        assert!(files(place.0.path()) == before, "{stage}");
    }
    assert_eq!(cancelled, 3);
}

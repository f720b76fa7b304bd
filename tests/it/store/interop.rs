//! Stock readers open every array: zarrs here, Python's `zarr` where it is installed.

use super::histograms::count_all;
use super::{import, sample};
use glam::DVec3;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use tetreel::codec::vq::VqOptions;
use tetreel::fit::{FitOptions, fit};
use tetreel::functions::value_at;
use tetreel::ingest::{CodecChoice, IngestOptions};
use tetreel::mesh::{Cells, RawMesh};
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};

fn imported(dir: &Path) -> Store {
    import(&sample(2), &dir.join("s.zarr"), &IngestOptions::default()).unwrap();
    let store = Store::open(dir.join("s.zarr")).unwrap();
    count_all(&store);
    store
}

/// Paths of the arrays below a group, as the metadata says.
fn arrays(folder: &Path, path: &str) -> Vec<String> {
    let mut found = Vec::new();
    for name in super::list(folder) {
        let below = folder.join(&name);
        let Ok(text) = std::fs::read_to_string(below.join("zarr.json")) else { continue };
        let path = format!("{path}/{name}");
        if text.contains("\"node_type\": \"array\"") {
            found.push(path);
        } else {
            found.extend(arrays(&below, &path));
        }
    }
    found
}

#[test]
fn zarrs_reads_every_array() {
    let dir = tempfile::tempdir().unwrap();
    let store = imported(dir.path());
    let storage = Arc::new(zarrs_filesystem::FilesystemStore::new(store.path()).unwrap());
    let paths = arrays(store.path(), "");
    // Mesh 8 (the grid has cells to turn), time 2, ten fields with ranges, checksums, moments, two arrays for the level of detail and
    // four histograms, eight of them with values.
    assert_eq!(paths.len(), 8 + 2 + 9 * 10 + 8, "{paths:?}");
    for path in paths {
        let array = zarrs::array::Array::open(storage.clone(), &path).unwrap();
        array.retrieve_array_subset::<zarrs::array::ArrayBytes<'_>>(&array.subset_all()).unwrap();
    }
    let raw = zarrs::array::Array::open(storage, "/fields/T/raw").unwrap();
    let values: Vec<f32> = raw.retrieve_chunk(&[1, 0]).unwrap();
    let mut ours = vec![0.0; values.len()];
    store.field(&"T".parse().unwrap()).unwrap().decode_step(1, &mut ours).unwrap();
    assert_eq!(values, ours);
}

/// The Python with zarr, or a skip.
fn python() -> Option<String> {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    match Command::new(&python)
        .args(["-c", "import zarr; assert int(zarr.__version__.split('.')[0]) >= 3, 'zarr is older than 3'"])
        .output()
    {
        Ok(output) if output.status.success() => return Some(python),
        Ok(output) => {
            let error = String::from_utf8_lossy(&output.stderr);
            crate::common::skip("python", error.lines().last().unwrap_or("zarr 3 cannot be imported"));
        }
        Err(error) => crate::common::skip("python", &error.to_string()),
    }
    None
}

/// What the script prints for a step of field T, after checking that the step's bits are those decoded here.
fn python_reads(python: &str, store: &Store, step: usize) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interop/read_store.py");
    let output = Command::new(python).arg(script).arg(store.path()).args(["T", &step.to_string()]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut values = vec![0.0f32; 64];
    store.field(&"T".parse().unwrap()).unwrap().decode_step(step, &mut values).unwrap();
    let crc = |values: &[f32]| {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let mut crc = flate2::Crc::new();
        crc.update(&bytes);
        format!("T step {step} crc32 {:08x}", crc.sum())
    };
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains(&crc(&values)), "{text}");
    values[3] += 1.0;
    assert!(!text.contains(&crc(&values)), "another value is noticed");
    text
}

#[test]
fn python_reads_every_array() {
    let Some(python) = python() else { return };
    let dir = tempfile::tempdir().unwrap();
    let text = python_reads(&python, &imported(dir.path()), 1);
    assert!(text.contains("mesh 162 cells 64 vertices") && text.contains("ok 108 arrays"), "{text}");
}

/// Swaps two corners of a tet if its volume is negative.
fn orient(points: &[DVec3], tet: &mut [u32; 4]) {
    let [a, b, c, d] = tet.map(|v| points[v as usize]);
    if (b - a).dot((c - a).cross(d - a)) < 0.0 {
        tet.swap(2, 3);
    }
}

#[test]
fn python_decodes_the_steps_of_vq() {
    let Some(python) = python() else { return };
    // With the arrays of the mesh that are not always there, and without.
    for (entries, own_scales, tidy) in [(16, false, false), (300, true, true)] {
        let dir = tempfile::tempdir().unwrap();
        let mut source = sample(70);
        let RawMesh { points, cells: Cells { tets, .. } } = &mut source.mesh;
        if tidy {
            tets.iter_mut().for_each(|tet| orient(points, tet));
        } else {
            points.iter_mut().for_each(|p| *p /= 3.0);
        }
        let smooth = source.value;
        source.value = Box::new(move |name, component, step, i| match (step, i) {
            (65..68, 20) => f32::NAN,
            (3, 9) => f32::INFINITY,
            _ => smooth(name, component, step, i) + (i as f32 * 0.1 * step as f32).cos(),
        });
        let codec = CodecChoice::new(VqOptions { entries, own_scales, ..VqOptions::default() });
        let report =
            import(&source, &dir.path().join("s.zarr"), &IngestOptions { codec, ..IngestOptions::default() }).unwrap();
        assert!(report.fields.iter().any(|f| f.nonfinite > 0));
        let store = Store::open(dir.path().join("s.zarr")).unwrap();
        for optional in ["cell_turned", "source_points"] {
            assert_eq!(store.path().join("mesh/0").join(optional).exists(), !tidy, "{optional}");
        }
        for step in [0, 3, 66] {
            python_reads(&python, &store, step);
        }
    }
}

/// The script that a page shows.
fn script_of(page: &str) -> String {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(page)).unwrap();
    page.split("```python\n").nth(1).unwrap().split("```").next().unwrap().to_owned()
}

#[test]
fn python_evaluates_functions_as_their_page_says() {
    let script = script_of("docs/functions.md");
    assert_eq!(script.lines().count(), 10);
    let Some(python) = python() else { return };
    let dir = tempfile::tempdir().unwrap();
    let store = imported(dir.path());
    fit(&store, None, &FitOptions::default(), &Silent, &Cancel::new()).unwrap();
    let mesh = store.mesh().unwrap();
    let kernels = store.functions().unwrap().unwrap().kernels(&mesh).unwrap();
    let reader = store.field(&"T".parse().unwrap()).unwrap();
    let mut values = vec![0.0; reader.value_count()];
    reader.decode_step(1, &mut values).unwrap();
    for at in [DVec3::new(1e6 + 1.25, 1.5, 0.375), DVec3::new(1e6 + 2.0, 0.5, 1.25)] {
        let at_words = at.to_array().map(|x| x.to_string());
        let mut command = Command::new(&python);
        let output = command.args(["-c", &script]).arg(store.path()).args(["T", "1"]).args(at_words).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let found: f64 = String::from_utf8(output.stdout).unwrap().trim().parse().unwrap();
        let expected = value_at(&kernels, &values, mesh.positions.local_from_world(at)).unwrap();
        // Both sum some dozen numbers of size 100 in float64.
        assert!((found - expected).abs() < 1e-11, "{found} {expected}");
        let beside = value_at(&kernels, &values, mesh.positions.local_from_world(at + 0.01 * DVec3::X)).unwrap();
        assert!((found - beside).abs() > 1e-11, "another place is noticed");
    }
}

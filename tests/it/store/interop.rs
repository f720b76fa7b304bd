//! Stock readers open every array: zarrs here, Python's `zarr` where it is installed.

use super::{import, sample};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use tetreel::ingest::IngestOptions;
use tetreel::store::Store;

fn imported(dir: &Path) -> Store {
    import(&sample(2), &dir.join("s.zarr"), &IngestOptions::default()).unwrap();
    Store::open(dir.join("s.zarr")).unwrap()
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
    let storage = Arc::new(zarrs::filesystem::FilesystemStore::new(store.path()).unwrap());
    let paths = arrays(store.path(), "");
    // Mesh 8 (the grid has cells to turn), time 2, ten fields with ranges and moments, eight of them with values.
    assert_eq!(paths.len(), 8 + 2 + 2 * 10 + 8, "{paths:?}");
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

#[test]
fn python_reads_every_array() {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    match Command::new(&python)
        .args(["-c", "import zarr; assert int(zarr.__version__.split('.')[0]) >= 3, 'zarr is older than 3'"])
        .output()
    {
        Ok(output) if output.status.success() => {}
        Ok(output) => {
            let error = String::from_utf8_lossy(&output.stderr);
            return crate::common::skip("python", error.lines().last().unwrap_or("zarr 3 cannot be imported"));
        }
        Err(error) => return crate::common::skip("python", &error.to_string()),
    }
    let dir = tempfile::tempdir().unwrap();
    let store = imported(dir.path());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interop/read_store.py");
    let output = Command::new(&python).arg(script).arg(store.path()).args(["T", "1"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut values = vec![0.0f32; 64];
    store.field(&"T".parse().unwrap()).unwrap().decode_step(1, &mut values).unwrap();
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut crc = flate2::Crc::new();
    crc.update(&bytes);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains(&format!("T step 1 crc32 {:08x}", crc.sum())), "{text}");
    assert!(text.contains("mesh 162 cells 64 vertices") && text.contains("ok 37 arrays"), "{text}");
}

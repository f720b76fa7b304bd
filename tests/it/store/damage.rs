//! Cut, flipped, missing and foreign pieces: an error that names them, or the same answer without them.

use super::histograms::count_all;
use super::{contents, import, sample};
use std::fs;
use std::path::{Path, PathBuf};
use tetreel::error::FileResult;
use tetreel::fit::{FitOptions, fit};
use tetreel::ingest::IngestOptions;
use tetreel::mesh::Mesh;
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};

/// A store in a folder of its own, with a scalar and a vector.
fn intact(steps: usize) -> (tempfile::TempDir, PathBuf) {
    store_of(steps, &["T", "velocity"])
}

fn store_of(steps: usize, fields: &[&str]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    let fields = fields.iter().map(|f| f.parse().unwrap()).collect();
    import(&sample(steps), &out, &IngestOptions { fields, ..Default::default() }).unwrap();
    let store = Store::open(&out).unwrap();
    count_all(&store);
    fit(&store, None, &FitOptions::default(), &Silent, &Cancel::new()).unwrap();
    (dir, out)
}

/// Everything that can be read: mesh, values of all steps, statistics.
fn read_all(path: &Path) -> FileResult<(Mesh, Vec<Vec<u32>>)> {
    let store = Store::open(path)?;
    store.info()?;
    let mesh = store.mesh()?;
    store.functions()?.map(|functions| functions.kernels(&mesh)).transpose()?;
    let mut values = Vec::new();
    for field in store.fields() {
        let reader = store.field(&field.name.parse().unwrap())?;
        let mut out = vec![0.0; reader.value_count()];
        for step in 0..reader.step_count() {
            reader.decode_step(step, &mut out)?;
            values.push(out.iter().map(|v| v.to_bits()).collect());
        }
        reader.statistics()?;
        // There, or not there: never an error.
        let _ = (reader.variation(), reader.intervals(6));
    }
    Ok((mesh, values))
}

/// Whether a file only holds what can be derived again.
fn is_derived(file: &str) -> bool {
    let is_of = |name: &&str| file.starts_with(&format!("mesh/0/{name}/"));
    file.starts_with("lod/") || file.contains("/histograms/") || ["faces", "face_cells", "neighbours"].iter().any(is_of)
}

#[test]
fn a_damaged_chunk_is_an_error_or_derived_again() {
    let (_dir, store) = intact(2);
    let (mesh, values) = read_all(&store).unwrap();
    let changes: [fn(&mut Vec<u8>); 5] = [
        |b| b.truncate(b.len() - 1),
        |b| b.truncate(0),
        |b| b.push(7),
        |b| b[0] ^= 1,
        |b| {
            let middle = b.len() / 2;
            b[middle] ^= 0x80;
        },
    ];
    let mut damaged = 0;
    for (file, bytes) in contents(&store).iter().filter(|(file, _)| !file.ends_with("zarr.json")) {
        for change in changes {
            let mut changed = bytes.clone();
            change(&mut changed);
            fs::write(store.join(file), changed).unwrap();
            let result = read_all(&store);
            if is_derived(file) {
                let read = result.unwrap();
                assert!(read.0.topology == mesh.topology && read.1 == values, "{file}");
            } else if file.starts_with("time/mesh_index") {
                assert!(result.is_ok()); // nothing reads it yet: there is one mesh
            } else {
                let error = result.err().unwrap_or_else(|| panic!("{file} was damaged and nobody noticed"));
                assert!(error.path.ends_with(file), "{file}: {error}");
            }
            damaged += 1;
        }
        fs::write(store.join(file), bytes).unwrap();
    }
    assert!(damaged > 5 * 20);
}

#[test]
fn metadata_with_any_byte_changed_is_never_a_panic() {
    // One field: the metadata of another one is alike.
    let (_dir, store) = store_of(1, &["T"]);
    for (file, bytes) in contents(&store).iter().filter(|(file, _)| file.ends_with("zarr.json")) {
        // Every seventh byte, and another change at each, keeps this within seconds; 7 is prime to JSON's regular layout.
        for at in (0..bytes.len()).step_by(7) {
            let mut changed = bytes.clone();
            changed[at] = [b'9', b'"', b'}', b'-', 0xff][at % 5];
            fs::write(store.join(file), changed).unwrap();
            let _ = read_all(&store);
        }
        fs::write(store.join(file), &bytes[..bytes.len() / 2]).unwrap();
        // Nothing reads these yet: there is one mesh, and one kind of functions.
        let unread = file.starts_with("time/mesh_index")
            || ["mesh/zarr.json", "time/zarr.json", "functions/zarr.json"].contains(&file.as_str());
        assert!(read_all(&store).is_err() || is_derived(file) || unread, "{file}");
        fs::write(store.join(file), bytes).unwrap();
    }
    read_all(&store).unwrap();
}

#[test]
fn a_missing_piece_is_named() {
    let (_dir, store) = intact(2);
    let pieces = [
        "mesh/0/points/c/0/0",
        "mesh/0/tets",
        "mesh/0/vertex_permutation/zarr.json",
        "time/values",
        "fields/zarr.json",
        "fields/T/raw/zarr.json",
        "fields/T/raw/c/1/0",
        "fields/T/range_per_step",
        "fields/velocity%3A0",
    ];
    for piece in pieces {
        let (path, aside) = (store.join(piece), store.join("aside"));
        fs::rename(&path, &aside).unwrap();
        let error = read_all(&store).expect_err(piece);
        assert!(error.path.starts_with(&path), "{piece}: {error}");
        fs::rename(&aside, &path).unwrap();
    }
    let error = {
        fs::remove_file(store.join("fields/T/raw/c/1/0")).unwrap();
        read_all(&store).unwrap_err()
    };
    assert_eq!(error.place, "step 1");
}

#[test]
fn derived_arrays_that_are_missing_or_of_another_version_are_derived_again() {
    let (_dir, store) = intact(1);
    let (mesh, _) = read_all(&store).unwrap();
    for name in ["faces", "face_cells", "neighbours"] {
        let metadata = store.join(format!("mesh/0/{name}/zarr.json"));
        let text = fs::read_to_string(&metadata).unwrap();
        for version in ["0", "2", "\"1\""] {
            let other = text.replace("\"derived_version\": 1", &format!("\"derived_version\": {version}"));
            assert_ne!(text, other);
            fs::write(&metadata, other).unwrap();
            assert_eq!(read_all(&store).unwrap().0.topology, mesh.topology);
        }
        fs::remove_dir_all(metadata.parent().unwrap()).unwrap();
        assert_eq!(read_all(&store).unwrap().0.topology, mesh.topology);
    }
}

#[test]
fn moments_that_are_missing_or_of_another_version_are_absent() {
    let (_dir, store) = intact(1);
    let statistics = || Store::open(&store).unwrap().field(&"T".parse().unwrap()).unwrap().statistics().unwrap();
    assert!(statistics().is_some());
    let metadata = store.join("fields/T/moments/zarr.json");
    let text = fs::read_to_string(&metadata).unwrap();
    fs::write(&metadata, text.replace("\"derived_version\": 1", "\"derived_version\": 0")).unwrap();
    assert!(statistics().is_none());
    fs::remove_dir_all(metadata.parent().unwrap()).unwrap();
    assert!(statistics().is_none());
}

#[test]
fn arrays_that_contradict_each_other_are_refused() {
    let (_dir, store) = intact(2);
    // A field of a longer series is moved in.
    let (_other_dir, other) = intact(3);
    for piece in ["fields/T/raw", "fields/T/range_per_step"] {
        fs::rename(store.join(piece), store.join("aside")).unwrap();
        fs::rename(other.join(piece), store.join(piece)).unwrap();
        let error = Store::open(&store).unwrap_err().to_string();
        assert!(error.contains(piece) && error.contains("instead of [2, "), "{error}");
        fs::rename(store.join(piece), other.join(piece)).unwrap();
        fs::rename(store.join("aside"), store.join(piece)).unwrap();
    }
}

#[test]
fn a_field_folder_that_leads_elsewhere_is_refused() {
    let (_dir, store) = intact(1);
    let metadata = store.join("fields/zarr.json");
    let text = fs::read_to_string(&metadata).unwrap();
    fs::write(&metadata, text.replace("\"T\"", "\"../../s.zarr/fields/T\"")).unwrap();
    assert!(Store::open(&store).unwrap_err().to_string().contains("no folder name"));
}

#[test]
fn what_is_not_a_store_of_this_version_is_refused_with_the_reason() {
    let (dir, store) = intact(1);
    let message = |path: &Path| Store::open(path).unwrap_err().to_string();
    assert!(message(&dir.path().join("none.zarr")).contains("does not exist"));
    assert!(message(&store.join("zarr.json")).contains("not a folder"));
    assert!(message(dir.path()).contains("tetreel store"));
    let metadata = store.join("zarr.json");
    let text = fs::read_to_string(&metadata).unwrap();
    fs::write(&metadata, text.replace("\"1.1\"", "\"2.3\"")).unwrap();
    assert!(message(&store).contains("store version 2.3"), "{}", message(&store));
    fs::write(&metadata, text.replace("\"1.1\"", "\"1.7\"")).unwrap();
    assert!(Store::open(&store).is_ok(), "a newer minor version is read");
}

#[test]
fn an_unknown_codec_is_named() {
    let (_dir, store) = intact(1);
    let metadata = store.join("fields/T/zarr.json");
    let text = fs::read_to_string(&metadata).unwrap();
    fs::write(&metadata, text.replace("\"raw\"", "\"fractal\"")).unwrap();
    assert!(Store::open(&store).unwrap_err().to_string().contains("'fractal' is not known"));
}

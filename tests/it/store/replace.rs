//! A store appears whole or not at all, and what existed is only ever replaced by a whole one.

use super::{contents, import, list, sample};
use std::fs;
use std::path::Path;
use tetreel::ingest::{IngestError, IngestOptions};
use tetreel::store::Store;
use tetreel::task::Cancel;

const OVERWRITE: bool = true;

fn options(overwrite: bool) -> IngestOptions {
    IngestOptions { overwrite, ..Default::default() }
}

/// Runs `fail` on an empty folder and on one with a store, and checks that neither changes.
fn leaves_no_trace(fail: impl Fn(&Path) -> IngestError) -> IngestError {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    fail(&out);
    assert!(list(dir.path()).is_empty(), "{:?}", list(dir.path()));

    import(&sample(2), &out, &options(false)).unwrap();
    let before = contents(dir.path());
    let error = fail(&out);
    assert_eq!(contents(dir.path()), before);
    error
}

#[test]
fn a_source_that_fails_midway_leaves_no_trace() {
    for step in [0, 1, 4] {
        let error = leaves_no_trace(|out| {
            let mut source = sample(5);
            source.fail_at = Some(step);
            import(&source, out, &options(OVERWRITE)).unwrap_err()
        });
        assert!(error.to_string().contains(&format!("step {step}")), "{error}");
    }
}

#[test]
fn a_step_of_the_wrong_length_leaves_no_trace() {
    let error = leaves_no_trace(|out| {
        let mut source = sample(5);
        source.long_at = Some(3);
        import(&source, out, &options(OVERWRITE)).unwrap_err()
    });
    assert!(error.to_string().contains("field 'T', component 0, step 3: has 66 values, but the mesh has 65 points"));
}

#[test]
fn a_cancelled_import_leaves_no_trace() {
    for step in [0, 2, 4] {
        let error = leaves_no_trace(|out| {
            let mut source = sample(5);
            source.cancel_at = Some((step, Cancel::new()));
            import(&source, out, &options(OVERWRITE)).unwrap_err()
        });
        assert!(matches!(error, IngestError::Cancelled), "{error}");
    }
}

#[test]
fn an_existing_store_is_replaced_only_if_that_is_allowed() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    import(&sample(2), &out, &options(false)).unwrap();
    let before = contents(dir.path());
    let error = import(&sample(3), &out, &options(false)).unwrap_err();
    assert!(error.to_string().contains("exists") && contents(dir.path()) == before, "{error}");
    import(&sample(3), &out, &options(OVERWRITE)).unwrap();
    assert_eq!(Store::open(&out).unwrap().times().len(), 3);
    assert_eq!(list(dir.path()), ["s.zarr"]);
}

#[test]
fn what_is_not_a_store_is_never_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("precious.zarr");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("thesis.tex"), "years of work").unwrap();
    let other_zarr = dir.path().join("other.zarr");
    fs::create_dir(&other_zarr).unwrap();
    fs::write(other_zarr.join("zarr.json"), r#"{"zarr_format":3,"node_type":"group","attributes":{}}"#).unwrap();
    let file = dir.path().join("file.zarr");
    fs::write(&file, "text").unwrap();
    let before = contents(dir.path());
    for out in [&folder, &other_zarr, &file] {
        let error = import(&sample(1), out, &options(OVERWRITE)).unwrap_err().to_string();
        assert!(error.contains("not a tetreel store") && error.contains(out.to_str().unwrap()), "{error}");
    }
    assert_eq!(contents(dir.path()), before);
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let error = import(&sample(1), &dir.path().join("nowhere/s.zarr"), &options(false)).unwrap_err();
    assert!(error.to_string().contains("nowhere: is not a folder; create it first"), "{error}");
    let error = import(&sample(1), Path::new("/"), &options(OVERWRITE)).unwrap_err();
    assert!(error.to_string().contains("names no file"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_new_store_is_as_readable_as_any_new_folder() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    import(&sample(1), &dir.path().join("s.zarr"), &options(false)).unwrap();
    fs::create_dir(dir.path().join("plain")).unwrap();
    let mode = |name: &str| fs::metadata(dir.path().join(name)).unwrap().permissions().mode();
    assert_eq!(mode("s.zarr"), mode("plain"));
}

#[test]
fn a_slash_behind_the_name_means_the_same_store() {
    let dir = tempfile::tempdir().unwrap();
    for overwrite in [false, OVERWRITE] {
        import(&sample(1), &dir.path().join("s.zarr/"), &options(overwrite)).unwrap();
        assert_eq!(list(dir.path()), ["s.zarr"]);
    }
}

#[cfg(unix)]
#[test]
fn a_name_that_is_no_unicode_is_refused_and_leaves_no_trace() {
    use std::os::unix::ffi::OsStrExt;
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join(std::ffi::OsStr::from_bytes(b"s\xff.zarr"));
    assert!(matches!(import(&sample(1), &out, &options(false)), Err(IngestError::File(_))));
    assert!(list(dir.path()).is_empty());
}

#[cfg(unix)]
#[test]
fn a_link_to_nowhere_counts_as_existing() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    std::os::unix::fs::symlink(dir.path().join("gone"), &out).unwrap();
    assert!(import(&sample(1), &out, &options(OVERWRITE)).is_err());
    assert!(fs::symlink_metadata(&out).unwrap().is_symlink());
}

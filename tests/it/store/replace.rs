//! A store appears whole or not at all, and what existed is only ever replaced by a whole one.

use super::append::{decode, import_all, part, reader, vq};
use super::{Formulas, contents, import, list, sample};
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
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

#[cfg(target_os = "linux")]
#[test]
fn a_store_may_have_a_name_that_is_no_unicode() {
    use std::os::unix::ffi::OsStrExt;
    let dir = tempfile::tempdir().unwrap();
    let [out, plain] = [&b"s\xff.zarr"[..], b"s.zarr"].map(|name| dir.path().join(std::ffi::OsStr::from_bytes(name)));
    for overwrite in [false, OVERWRITE] {
        import(&sample(1 + usize::from(overwrite)), &out, &options(overwrite)).unwrap();
    }
    import(&sample(2), &plain, &options(false)).unwrap();
    assert_eq!(list(dir.path()).len(), 2);
    assert!(contents(&out) == contents(&plain));
    let [a, b] = [out, plain].map(|path| decode(&reader(&Store::open(path).unwrap(), "T"), 1));
    assert!(a == b);
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

/// A series of the same mesh, fields, times and ranges as [`part`] in which the steps come in another order.
fn reversed(steps: usize) -> Formulas {
    let forwards = part(0..steps);
    Formulas {
        value: Box::new(move |name, c, step, i| (forwards.value)(name, c, steps - 1 - step, i)),
        ..part(0..steps)
    }
}

#[test]
fn a_reader_of_a_store_that_is_replaced_gives_what_it_opened_or_an_error() {
    const STEPS: usize = 70;
    for (codec, other_codec) in [(None, None), (vq(16, false), vq(16, false)), (vq(16, false), vq(16, true))] {
        let dir = tempfile::tempdir().unwrap();
        let [out, kept] = ["s.zarr", "kept.zarr"].map(|name| dir.path().join(name));
        let [store, kept] = [&out, &kept].map(|path| import_all(&part(0..STEPS), path, codec.clone()));
        let names: Vec<String> = store.fields().iter().map(|f| f.name.clone()).collect();
        let readers: Vec<_> = names.iter().map(|name| reader(&store, name)).collect();
        for (open, name) in readers.iter().zip(&names) {
            assert!(decode(open, STEPS - 1) == decode(&reader(&kept, name), STEPS - 1));
        }
        let options = IngestOptions { codec: other_codec.unwrap_or_default(), ..options(OVERWRITE) };
        import(&reversed(STEPS), &out, &options).unwrap();
        for (open, name) in readers.iter().zip(&names) {
            let mut refused = 0;
            for step in 0..STEPS {
                let mut values = vec![0.0; open.value_count()];
                match open.decode_step(step, &mut values) {
                    Ok(_) => {
                        let bits: Vec<u32> = values.iter().map(|x| x.to_bits()).collect();
                        assert!(bits == decode(&reader(&kept, name), step), "{name}, step {step}: of the other series");
                    }
                    Err(error) => {
                        let error = error.to_string();
                        assert!(error.contains("no longer the series") && error.contains("open it again"), "{error}");
                        refused += 1;
                    }
                }
            }
            assert!(refused > 0, "{name}: nothing of it was in memory");
        }
        // The mesh is the same: whose it is shows in the values.
        for error in [store.mesh().err(), store.source_points().err(), store.refreshed().err()] {
            assert!(error.unwrap().to_string().contains("no longer the series"));
        }
    }
}

#[test]
fn a_reader_never_mixes_series_while_stores_are_exchanged() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    let first = reader(&import_all(&part(0..3), &out, None), "T");
    let forwards = [0, 2].map(|step| decode(&first, step));
    let backwards = [forwards[1].clone(), forwards[0].clone()];
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            // The last one is another series than the first.
            for round in 0..13 {
                let source = if round % 2 == 0 { reversed(3) } else { part(0..3) };
                import(&source, &out, &options(OVERWRITE)).unwrap();
            }
            done.store(true, Ordering::SeqCst);
        });
        let (mut open, mut refused) = (first, 0);
        while !done.load(Ordering::SeqCst) || refused == 0 {
            let mut steps = [0, 2].map(|step| (step, vec![0.0; open.value_count()]));
            match steps.iter_mut().try_for_each(|(step, values)| open.decode_step(*step, values).map(drop)) {
                Ok(()) => {
                    let bits = steps.map(|(_, values)| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>());
                    assert!(bits == forwards || bits == backwards);
                }
                Err(error) => {
                    assert!(error.to_string().contains("no longer the series"), "{error}");
                    refused += 1;
                    open = reader(&Store::open(&out).unwrap(), "T");
                }
            }
        }
    });
}

#[cfg(unix)]
#[test]
fn overwriting_through_a_link_replaces_the_store_behind_it_and_not_the_link() {
    let dir = tempfile::tempdir().unwrap();
    let [disk, here] = ["disk", "here"].map(|name| dir.path().join(name));
    [&disk, &here].into_iter().for_each(|folder| fs::create_dir(folder).unwrap());
    let real = disk.join("s.zarr");
    import(&sample(2), &real, &options(false)).unwrap();
    for (link, target) in [("to.zarr", real.clone()), ("relative.zarr", "../disk/s.zarr".into()), ("slash.zarr", real)]
    {
        std::os::unix::fs::symlink(&target, here.join(link)).unwrap();
        let steps = 3 + link.len();
        let named = if link.starts_with("slash") { here.join(format!("{link}/")) } else { here.join(link) };
        let error = import(&sample(steps), &named, &options(false)).unwrap_err().to_string();
        assert!(error.contains("exists"), "{error}");
        import(&sample(steps), &named, &options(OVERWRITE)).unwrap();
        assert_eq!(fs::read_link(here.join(link)).unwrap(), target);
        for path in [disk.join("s.zarr"), here.join(link)] {
            assert_eq!(Store::open(path).unwrap().times().len(), steps);
        }
    }
    assert_eq!(list(&disk), ["s.zarr"]);
    assert_eq!(list(&here), ["relative.zarr", "slash.zarr", "to.zarr"]);
}

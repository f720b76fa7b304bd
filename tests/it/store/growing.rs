//! Who has a store open while it grows.

use super::append::{add, decode, import_all, part, reader, value, vq};
use super::{Formulas, field, import, list};
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use tetreel::field::Association;
use tetreel::ingest::{AppendOptions, AppendReport, IngestError, IngestOptions, append, ingest};
use tetreel::store::{FieldReader, Store};
use tetreel::task::{Cancel, Silent};

#[test]
fn readers_that_were_open_go_on_with_the_steps_that_they_had() {
    for codec in [None, vq(16, false)] {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("s.zarr");
        let old = import_all(&part(0..70), &out, codec.clone());
        let names: Vec<String> = old.fields().iter().map(|f| f.name.clone()).collect();
        let expected: Vec<Vec<u32>> = names.iter().flat_map(|n| [3, 68].map(|s| decode(&reader(&old, n), s))).collect();
        // Opened, but nothing read yet.
        let readers: Vec<FieldReader> = names.iter().map(|name| reader(&old, name)).collect();
        add(&part(0..100), &out, &AppendOptions::default()).unwrap();
        let found: Vec<Vec<u32>> = readers.iter().flat_map(|r| [3, 68].map(|s| decode(r, s))).collect();
        assert!(found == expected);
        assert!(readers[0].decode_step(70, &mut vec![0.0; 64]).is_err());
        let again = old.field(&"T".parse().unwrap());
        match codec {
            None => assert!(decode(&again.unwrap(), 68) == expected[1]),
            // Block 1 is another one now, and which steps it has this store cannot know.
            Some(_) => assert!(again.unwrap_err().to_string().contains("has changed since it was opened")),
        }
        if codec.is_some() {
            let new = old.refreshed().unwrap().unwrap();
            assert!(decode(&reader(&new, "T"), 68) != expected[1], "the block was coded again");
        }
    }
}

#[test]
fn a_reader_decodes_while_the_store_grows() {
    const END: usize = 20;
    let part = |steps: Range<usize>| Formulas { fields: vec![field("T", 1, Association::Point)], ..part(steps) };
    for codec in [None, vq(16, false)] {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("s.zarr");
        let mut store = import_all(&part(0..5), &out, codec);
        let done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for end in 6..=END {
                    add(&part(0..end), &out, &AppendOptions::default()).unwrap();
                }
                done.store(true, Ordering::SeqCst);
            });
            let mut seen = vec![store.times().len()];
            loop {
                let last = done.load(Ordering::SeqCst);
                if let Some(new) = store.refreshed().unwrap() {
                    store = new;
                    seen.push(store.times().len());
                }
                // Of the state that was opened; if it has gone on, the next look has it.
                match store.field(&"T".parse().unwrap()) {
                    Ok(reader) => assert_eq!(decode(&reader, store.times().len() - 1).len(), 64),
                    Err(error) => assert!(error.to_string().contains("has changed"), "{error}"),
                }
                if last {
                    break;
                }
            }
            assert!(seen.is_sorted() && seen.ends_with(&[END]) && seen.len() > 2, "{seen:?}");
        });
    }
}

#[test]
fn a_store_says_whether_it_has_grown_and_refuses_to_be_another_series() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    let old = import_all(&part(0..5), &out, None);
    assert!(old.refreshed().unwrap().is_none());
    add(&part(0..7), &out, &AppendOptions::default()).unwrap();
    let new = old.refreshed().unwrap().unwrap();
    assert_eq!((old.times().len(), new.times().len()), (5, 7));
    assert!(new.refreshed().unwrap().is_none());
    let replaced = |change: &dyn Fn(&mut Formulas)| {
        let mut source = part(0..7);
        change(&mut source);
        import(&source, &out, &IngestOptions { overwrite: true, ..Default::default() }).unwrap();
        new.refreshed().map(|store| store.is_some()).map_err(|e| e.to_string())
    };
    assert_eq!(replaced(&|_| ()), Ok(true), "another import of the same series");
    type Change = &'static dyn Fn(&mut Formulas);
    let others: [(Change, &str); 4] = [
        (&|s| s.mesh.points[40].z += 0.01, "another mesh"),
        (&|s| s.times.values.truncate(6), "fewer steps"),
        (&|s| s.times.values[3] += 0.01, "other times"),
        (&|s| s.fields.truncate(2), "other fields"),
    ];
    for (change, text) in others {
        let error = replaced(change).unwrap_err();
        assert!(error.contains(text) && error.contains("open it again"), "{error}");
    }
    std::fs::remove_dir_all(&out).unwrap();
    assert!(new.refreshed().unwrap_err().to_string().contains("does not exist"));
}

#[test]
fn a_store_that_is_replaced_while_steps_are_added_stays_what_it_has_become() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    import_all(&part(0..3), &out, None);
    let mut source = part(0..6);
    let (inner, once) = (out.clone(), AtomicBool::new(false));
    source.value = Box::new(move |name, component, step, i| {
        if step == 5 && !once.swap(true, Ordering::SeqCst) {
            let options = IngestOptions { overwrite: true, ..Default::default() };
            ingest(&part(0..4), &inner, &options, &Silent, &Cancel::new()).unwrap();
        }
        value(name, component, step, i)
    });
    let error = ingest_append(&source, &out).unwrap_err().to_string();
    assert!(error.contains("changed by somebody else"), "{error}");
    assert_eq!(Store::open(&out).unwrap().times().len(), 4);
    assert_eq!(list(dir.path()), ["s.zarr"]);
}

fn ingest_append(source: &Formulas, out: &Path) -> Result<AppendReport, IngestError> {
    append(source, out, &AppendOptions::default(), &Silent, &Cancel::new())
}

#[test]
fn a_store_that_is_gone_for_a_moment_is_waited_for() {
    let dir = tempfile::tempdir().unwrap();
    let [out, aside] = ["s.zarr", "aside"].map(|name| dir.path().join(name));
    let store = import_all(&part(0..3), &out, None);
    let open = reader(&store, "T");
    let expected = decode(&open, 1);
    for _ in 0..3 {
        std::fs::rename(&out, &aside).unwrap();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(std::time::Duration::from_millis(30));
                std::fs::rename(&aside, &out).unwrap();
            });
            assert!(store.refreshed().unwrap().is_none());
        });
        std::fs::rename(&out, &aside).unwrap();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(std::time::Duration::from_millis(30));
                std::fs::rename(&aside, &out).unwrap();
            });
            assert!(decode(&open, 1) == expected);
        });
    }
}

#[test]
fn of_two_that_add_at_the_same_time_neither_is_lost() {
    let part = |steps: Range<usize>| Formulas { fields: vec![field("T", 1, Association::Point)], ..part(steps) };
    for codec in [None, vq(16, false)] {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("s.zarr");
        import_all(&part(0..4), &out, codec);
        for round in 0..5 {
            let end = 4 + 4 * round;
            // The one that comes second finds the steps of the first, or has nothing to add.
            std::thread::scope(|scope| {
                for last in [end + 2, end + 4] {
                    let (out, part) = (&out, &part);
                    scope.spawn(move || add(&part(0..last), out, &AppendOptions::default()).unwrap());
                }
            });
            assert_eq!(Store::open(&out).unwrap().times().len(), end + 4);
        }
    }
}

#[cfg(unix)]
#[test]
fn who_adds_has_the_store_locked_while_the_source_is_read() {
    use std::fs::File;
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s.zarr");
    import_all(&part(0..3), &out, None);
    let is_free = |folder: &Path| File::open(folder).unwrap().try_lock().is_ok();
    if File::open(&out).unwrap().try_lock().is_err() {
        eprintln!("left out: this file system has no locks");
        return;
    }
    let mut source = part(0..6);
    let looks: Arc<Mutex<Vec<bool>>> = Arc::default();
    let (folder, seen) = (out.clone(), looks.clone());
    source.value = Box::new(move |name, component, step, i| {
        if i == 0 {
            seen.lock().unwrap().push(is_free(&folder));
        }
        value(name, component, step, i)
    });
    add(&source, &out, &AppendOptions::default()).unwrap();
    assert!(!looks.lock().unwrap().is_empty());
    assert!(looks.lock().unwrap().iter().all(|free| !free), "somebody else could have added at the same time");
    assert!(is_free(&out), "the lock ends with the work");
}

#[cfg(unix)]
#[test]
fn a_store_with_links_inside_is_not_added_to_and_stays_as_it_is() {
    let part = |steps: Range<usize>| Formulas { fields: vec![field("T", 1, Association::Point)], ..part(steps) };
    let dir = tempfile::tempdir().unwrap();
    let (out, elsewhere) = (dir.path().join("s.zarr"), dir.path().join("raw"));
    let store = import_all(&part(0..4), &out, None);
    let expected = decode(&reader(&store, "T"), 3);
    std::fs::rename(out.join("fields/T/raw"), &elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, out.join("fields/T/raw")).unwrap();
    let error = add(&part(0..8), &out, &AppendOptions::default()).unwrap_err().to_string();
    assert!(error.contains("fields/T/raw") && error.contains("symbolic link"), "{error}");
    assert!(decode(&reader(&Store::open(&out).unwrap(), "T"), 3) == expected);
}

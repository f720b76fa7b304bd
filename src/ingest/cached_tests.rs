//! Which imports are reused, which are repeated, and which files they leave.

use super::*;
use crate::task::Silent;
use std::sync::atomic::{AtomicUsize, Ordering};

const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/data/tornado");

/// A copy of the shipped series, and a cache beside it.
pub(super) struct Place {
    dir: tempfile::TempDir,
    cache: ImportCache,
}

impl Place {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        for entry in fs::read_dir(SHIPPED).unwrap() {
            let path = entry.unwrap().path();
            fs::copy(&path, dir.path().join(path.file_name().unwrap())).unwrap();
        }
        let cache = ImportCache::at(dir.path().join("cache"));
        Self { dir, cache }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn open(&self, names: &[&str]) -> Result<(Store, Origin), CacheError> {
        self.open_with(names, &Silent, &Cancel::new())
    }

    fn open_with(
        &self,
        names: &[&str],
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(Store, Origin), CacheError> {
        let paths: Vec<PathBuf> = names.iter().map(|name| self.path(name)).collect();
        self.cache.open_or_import(&paths, &mut |_| (), progress, cancel)
    }

    /// Names in the cache, sorted.
    fn entries(&self) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.path("cache")) else { return Vec::new() };
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Names of the shipped `.vtu` files, sorted.
    fn steps(&self) -> Vec<String> {
        let names = fs::read_dir(self.dir.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.filter(|name| name.ends_with(".vtu")).collect();
        names.sort();
        names
    }
}

/// Cancels when the first step has been imported.
struct CancelAtFirst(Cancel);

impl Progress for CancelAtFirst {
    fn begin(&self, _stage: &str, _total: u64, _unit: &str) {}
    fn advance(&self, _n: u64) {
        self.0.cancel();
    }
    fn end(&self) {}
    fn say(&self, _line: &str) {}
}

#[test]
fn a_source_is_imported_once_until_it_changes() {
    let place = Place::new();
    let (store, origin) = place.open(&["tornado.pvd"]).unwrap();
    assert!(matches!(origin, Origin::Imported(report) if report.steps == store.times().len()));
    let (again, origin) = place.open(&["tornado.pvd"]).unwrap();
    assert!(matches!(origin, Origin::Cached) && again.path() == store.path());
    let (_, origin) = place.open(&[&format!("cache/{}", place.entries()[0])]).unwrap();
    assert!(matches!(origin, Origin::Store));
    let pvd = fs::read_to_string(place.path("tornado.pvd")).unwrap();
    fs::write(place.path("tornado.pvd"), pvd + "\n").unwrap();
    assert!(matches!(place.open(&["tornado.pvd"]).unwrap().1, Origin::Imported(_)));
    assert_eq!(place.entries().len(), 2);
}

#[test]
fn several_files_are_one_entry_in_whatever_order_and_a_mix_is_refused() {
    let place = Place::new();
    let steps = place.steps();
    let mut names: Vec<&str> = steps.iter().map(String::as_str).collect();
    let (store, _) = place.open(&names).unwrap();
    assert_eq!(store.times().len(), names.len());
    names.reverse();
    names.push(names[0]);
    let (again, origin) = place.open(&names).unwrap();
    assert!(matches!(origin, Origin::Cached) && again.path() == store.path());
    assert!(matches!(place.open(&names[1..]).unwrap().1, Origin::Cached), "one was named twice");
    assert!(matches!(place.open(&names[2..]).unwrap().1, Origin::Imported(_)), "other files");
    let entry = format!("cache/{}", place.entries()[0]);
    for (mix, text) in [([entry.as_str(), names[0]], "is a store"), (["tornado.pvd", names[0]], "open it alone")] {
        let error = place.open(&mix).unwrap_err().to_string();
        assert!(error.contains(text) && error.contains("open it alone"), "{error}");
    }
    assert_eq!(place.entries().len(), 2);
}

#[test]
fn an_import_that_fails_or_is_cancelled_leaves_nothing() {
    let place = Place::new();
    let cancel = Cancel::new();
    let error = place.open_with(&["tornado.pvd"], &CancelAtFirst(cancel.clone()), &cancel).unwrap_err();
    assert!(error.is_cancelled());
    assert_eq!(place.entries(), [""; 0]);
    let last = place.steps().pop().unwrap();
    let bytes = fs::read(place.path(&last)).unwrap();
    fs::write(place.path(&last), &bytes[..bytes.len() / 2]).unwrap();
    let error = place.open(&["tornado.pvd"]).unwrap_err().to_string();
    assert!(error.contains(&last), "{error}");
    assert_eq!(place.entries(), [""; 0]);
}

#[test]
fn a_damaged_entry_is_imported_anew() {
    let place = Place::new();
    let (store, _) = place.open(&["tornado.pvd"]).unwrap();
    let root = store.path().to_owned();
    let damages: [&dyn Fn(); 4] = [
        &|| fs::write(root.join("time/values/zarr.json"), "{").unwrap(),
        &|| fs::write(root.join("zarr.json"), "no JSON").unwrap(),
        &|| fs::remove_file(root.join("zarr.json")).unwrap(),
        &|| {
            fs::remove_dir_all(&root).unwrap();
            fs::write(&root, "a file").unwrap();
        },
    ];
    for damage in damages {
        damage();
        let (again, origin) = place.open(&["tornado.pvd"]).unwrap();
        assert!(matches!(origin, Origin::Imported(_)) && again.path() == root);
        assert!(matches!(place.open(&["tornado.pvd"]).unwrap().1, Origin::Cached));
        assert_eq!(place.entries().len(), 1);
    }
}

#[test]
fn what_a_killed_import_has_left_goes_with_the_next_and_a_living_one_is_left_alone() {
    let place = Place::new();
    let (store, _) = place.open(&["tornado.pvd"]).unwrap();
    let name = store.path().file_name().unwrap().to_str().unwrap().to_owned();
    fs::remove_dir_all(store.path()).unwrap();
    let cache = place.path("cache");
    for left in [&name, "dead-00.zarr", "living-00.zarr"] {
        fs::create_dir_all(cache.join(format!(".{left}.tmp-Ab3/time"))).unwrap();
        fs::write(cache.join(format!(".{left}.lock")), "").unwrap();
    }
    let living = EntryLock::wait(&cache.join("living-00.zarr"), &mut || (), &Cancel::new()).unwrap();
    fs::create_dir(cache.join(".somebody-elses.tmp-Ab3")).unwrap();
    place.open(&["tornado.pvd"]).unwrap();
    let expected = [".living-00.zarr.lock", ".living-00.zarr.tmp-Ab3", ".somebody-elses.tmp-Ab3", &name];
    assert_eq!(place.entries(), expected);
    drop(living);
    assert_eq!(place.entries(), expected[1..]);
}

#[test]
fn of_two_that_open_the_same_source_one_imports_and_the_other_waits() {
    let place = Place::new();
    let imports = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let (store, origin) = place.open(&["tornado.pvd"]).unwrap();
                assert!(store.times().len() > 1);
                imports.fetch_add(usize::from(matches!(origin, Origin::Imported(_))), Ordering::Relaxed);
            });
        }
    });
    assert_eq!(imports.into_inner(), 1);
    assert_eq!(place.entries().len(), 1);
}

#[test]
fn who_waits_for_another_import_says_so_once_and_can_be_cancelled() {
    let place = Place::new();
    let target = place.path("a.zarr");
    let held = EntryLock::wait(&target, &mut || (), &Cancel::new()).unwrap();
    let cancel = Cancel::new();
    let mut said = 0;
    let waited = EntryLock::wait(
        &target,
        &mut || {
            said += 1;
            cancel.cancel();
        },
        &cancel,
    );
    assert!(waited.is_err_and(|e| e.is_cancelled()) && said == 1);
    drop(held);
    EntryLock::wait(&target, &mut || panic!("nobody has it"), &Cancel::new()).unwrap();
}

#[test]
fn without_a_place_for_the_cache_only_stores_are_opened() {
    let place = Place::new();
    let (store, _) = place.open(&["tornado.pvd"]).unwrap();
    let nowhere = ImportCache { folder: None };
    let open = |path: &Path| nowhere.open_or_import(&[path.to_owned()], &mut |_| (), &Silent, &Cancel::new());
    assert!(open(store.path()).is_ok());
    let error = open(&place.path("tornado.pvd")).unwrap_err().to_string();
    assert!(error.contains("TETREEL_CACHE"), "{error}");
}

#[test]
fn the_users_folder_is_the_first_that_is_named() {
    let folder = |set: &[(&str, &str)]| {
        folder_from(|name| set.iter().find(|(n, _)| *n == name).map(|(_, value)| OsString::from(value)))
    };
    let all = [("TETREEL_CACHE", "/a"), ("XDG_CACHE_HOME", "/b"), ("HOME", "/c")];
    let found = [0, 1, 2, 3].map(|skip| folder(&all[skip..]));
    let expected = [Some("/a"), Some("/b/tetreel"), Some("/c/.cache/tetreel"), None];
    assert_eq!(found, expected.map(|path| path.map(PathBuf::from)));
    assert_eq!(folder(&[("TETREEL_CACHE", ""), ("HOME", "/c")]), Some(PathBuf::from("/c/.cache/tetreel")));
}

#[test]
fn the_name_of_an_entry_fits_any_file_system_and_does_not_depend_on_where_one_stands() {
    let long = PathBuf::from(format!("{}.vtu", "ä".repeat(120)));
    let name = entry_name(&[long]).unwrap();
    assert!(name.starts_with(&"ä".repeat(90)) && name.len() < 210, "{name}");
    // Tests run in the folder of the package.
    let here = PathBuf::from("data/tornado/tornado.pvd");
    assert_eq!(entry_name(&[absolute(&here).unwrap()]).unwrap(), entry_name(&[here]).unwrap());
}

//! Removal of temporary files of killed runs.
//!
//! A run holds a lock on each temporary file that it writes, which ends with the process however that ends: a file that can be locked has
//! no owner any more. On systems other than Unix, and on file systems without locks, no file counts as a leftover.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tempfile::NamedTempFile;

/// Prefix of the names of temporary files. [`RANDOM`] letters and digits follow, and the final file's extension.
pub(super) const PREFIX: &str = ".tetreel-";
/// Default number of random characters of `tempfile`.
const RANDOM: usize = 6;

/// Folders whose leftovers this run has removed.
static SEEN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Removes leftovers from a folder once per run: it may have as many files as a series has frames.
pub(super) fn remove_once(folder: &Path) {
    if SEEN.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.to_owned()) {
        remove(folder);
    }
}

/// Removes the leftovers of ended runs from a folder. One that cannot be removed does no harm.
fn remove(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if is_temporary(&entry.file_name()) && entry.file_type().is_ok_and(|kind| kind.is_file()) {
            remove_unless_live(&entry.path());
        }
    }
}

/// Whether a file has the form of a temporary name, which users do not choose.
fn is_temporary(name: &OsStr) -> bool {
    let rest = name.as_encoded_bytes().strip_prefix(PREFIX.as_bytes());
    rest.and_then(|rest| rest.split_at_checked(RANDOM)).is_some_and(|(random, extension)| {
        random.iter().all(u8::is_ascii_alphanumeric) && matches!(extension.first(), None | Some(b'.'))
    })
}

#[cfg(unix)]
fn remove_unless_live(path: &Path) {
    // The file may have become a result between the two looks, and has another name then.
    if let Ok(file) = File::open(path)
        && file.try_lock().is_ok()
        && is_at(&file, path)
    {
        let _ = fs::remove_file(path);
    }
}

#[cfg(not(unix))]
fn remove_unless_live(_path: &Path) {}

/// Locks a file as owned while it is open; `false` if it was removed before that.
#[cfg(unix)]
pub(super) fn mark_as_live(file: &NamedTempFile) -> bool {
    // A run that checks for an owner holds the lock briefly. On file systems without locks, none checks.
    file.as_file().lock().is_err() || is_at(file.as_file(), file.path())
}

#[cfg(not(unix))]
pub(super) fn mark_as_live(_file: &NamedTempFile) -> bool {
    true
}

/// Whether the open file is still the one at this path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |metadata: fs::Metadata| (metadata.dev(), metadata.ino());
    let (file, named) = (file.metadata().map(id), fs::symlink_metadata(path).map(id));
    matches!((file, named), (Ok(file), Ok(named)) if file == named)
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::super::{replace_with, sibling_file};
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn what_a_killed_run_has_left_is_removed_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let left = [".tetreel-aB3xYz", ".tetreel-000000.png", ".tetreel-qwerty.tar.gz"];
        let others =
            [".tetreel-notes.txt", ".tetreel-aB3xYz1.png", ".tetreel-aB3-Yz.png", ".tetreel-", "tetreel-aB3xYz"];
        for name in left.iter().chain(&others) {
            fs::write(dir.path().join(name), "half").unwrap();
        }
        fs::create_dir(dir.path().join(".tetreel-folder")).unwrap();
        let live = sibling_file(&dir.path().join("live.png")).unwrap();
        let mut expected: Vec<String> = others.map(str::to_owned).to_vec();
        expected
            .extend([".tetreel-folder".to_owned(), live.path().file_name().unwrap().to_string_lossy().into_owned()]);
        expected.sort();
        // Removed by the run that made the live one.
        assert_eq!(names(dir.path()), expected);
        fs::write(dir.path().join(left[0]), "half").unwrap();
        remove(dir.path());
        assert_eq!(names(dir.path()), expected, "by another run");
        live.persist(dir.path().join("live.png")).unwrap();
        remove(dir.path());
        assert!(dir.path().join("live.png").exists());
    }

    #[test]
    fn no_file_is_taken_from_who_writes_it_however_often_others_look() {
        let dir = tempfile::tempdir().unwrap();
        let done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !done.load(std::sync::atomic::Ordering::SeqCst) {
                    remove(dir.path());
                }
            });
            for i in 0..300 {
                let path = dir.path().join(format!("{i}.txt"));
                replace_with(&path, b"whole").unwrap();
                assert_eq!(fs::read(&path).unwrap(), b"whole");
            }
            done.store(true, std::sync::atomic::Ordering::SeqCst);
        });
        assert_eq!(names(dir.path()).len(), 300);
    }
}

//! The folder of an import that can be interrupted: `NAME.partial` beside the store NAME.
//!
//! | in it | |
//! |---|---|
//! | `store` | the unfinished store |
//! | `checkpoint` | the state to go on from ([`super::checkpoint`]); everything that it counts on is on the medium |
//! | `lock` | locked by who writes here; the lock ends with the process, however that ends |
//!
//! Once the store is in its place the folder is removed. Without a checkpoint or without a store there is nothing to go on from: a run that
//! fails removes the folder, and the next one begins again in it.

use super::checkpoint::{CheckpointReader, CheckpointWriter};
use super::lock::is_at;
use super::staging::{sync_folder, sync_store};
use crate::error::{FileError, FileResult};
use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Attempts to lock a folder that its owner removes at this moment.
const LOOKS: u32 = 50;

/// The folder, while this process may write in it.
#[derive(Debug)]
pub(super) struct Partial {
    root: PathBuf,
    store: PathBuf,
    /// `None` on file systems without locks, and once the folder is gone.
    lock: Option<File>,
    /// Whether the folder is still this process's own.
    is_live: bool,
}

/// Where the unfinished store of `target` is.
fn folder_of(target: &Path) -> PathBuf {
    let mut name = OsString::from(target.file_name().unwrap_or_default());
    name.push(".partial");
    target.with_file_name(name)
}

impl Partial {
    /// Takes the folder for a store at `target`, and makes it if there is none.
    pub(super) fn begin(target: &Path) -> FileResult<Self> {
        let root = folder_of(target);
        for _ in 0..LOOKS {
            if let Some(lock) = take(&root)? {
                let partial = Self { store: root.join("store"), root, lock, is_live: true };
                if !partial.has_checkpoint() || !partial.store.is_dir() {
                    remove(fs::remove_dir_all(&partial.store), &partial.store)?;
                    remove(fs::remove_file(partial.checkpoint()), &partial.root)?;
                }
                fs::create_dir_all(&partial.store).map_err(|e| FileError::io(&partial.store, "create", &e))?;
                return Ok(partial);
            }
        }
        Err(in_use(&root))
    }

    /// The unfinished store.
    pub(super) fn store(&self) -> &Path {
        &self.store
    }

    /// The folder.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    fn checkpoint(&self) -> PathBuf {
        self.root.join("checkpoint")
    }

    pub(super) fn has_checkpoint(&self) -> bool {
        fs::symlink_metadata(self.checkpoint()).is_ok()
    }

    /// Opens the checkpoint, if there is one.
    pub(super) fn read(&self) -> FileResult<Option<CheckpointReader>> {
        self.has_checkpoint().then(|| CheckpointReader::open(&self.checkpoint())).transpose()
    }

    /// Replaces the checkpoint, once the store is on the medium.
    pub(super) fn write(&self, fill: impl FnOnce(&mut CheckpointWriter) -> FileResult<()>) -> FileResult<()> {
        let (new, path) = (self.root.join("checkpoint.new"), self.checkpoint());
        let mut to = CheckpointWriter::create(&new)?;
        fill(&mut to)?;
        to.finish()?;
        sync_store(&self.store)?;
        fs::rename(&new, &path).map_err(|e| FileError::io(&path, "write", &e))?;
        sync_folder(&self.root)
    }

    /// Removes the checkpoint of a store that is complete.
    pub(super) fn complete(&self) -> FileResult<()> {
        remove(fs::remove_file(self.checkpoint()), &self.root)?;
        sync_folder(&self.root)
    }

    /// Removes the folder and whatever is in it.
    pub(super) fn close(mut self) -> FileResult<()> {
        self.remove_all()
    }

    fn remove_all(&mut self) -> FileResult<()> {
        self.is_live = false;
        remove(fs::remove_dir_all(&self.store), &self.store)?;
        for name in ["checkpoint", "checkpoint.new"] {
            remove(fs::remove_file(self.root.join(name)), &self.root)?;
        }
        if cfg!(not(unix)) {
            // There, no open file can be removed.
            self.lock = None;
        }
        remove(fs::remove_file(self.root.join(LOCK)), &self.root)?;
        // Not empty if somebody has begun in it again.
        let _ = fs::remove_dir(&self.root);
        self.lock = None;
        Ok(())
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if self.is_live && !self.has_checkpoint() {
            // What cannot be removed is removed by the next run.
            let _ = self.remove_all();
        }
    }
}

/// Name of the file that is locked.
const LOCK: &str = "lock";

/// Makes the folder and locks it, where the file system has locks; `None` if its owner has just removed it.
fn take(root: &Path) -> FileResult<Option<Option<File>>> {
    let failed = |e: io::Error| FileError::io(root, "write in", &e);
    match fs::create_dir(root) {
        Err(e) if e.kind() == ErrorKind::AlreadyExists => check_own(root)?,
        made => made.map_err(failed)?,
    }
    let path = root.join(LOCK);
    let file = match File::options().write(true).create(true).truncate(false).open(&path) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        opened => opened.map_err(failed)?,
    };
    match file.try_lock() {
        Ok(()) => Ok(is_at(&file, fs::symlink_metadata(&path)).then_some(Some(file))),
        Err(TryLockError::WouldBlock) => Err(in_use(root)),
        Err(TryLockError::Error(_)) => Ok(Some(None)),
    }
}

fn in_use(root: &Path) -> FileError {
    let problem = "is being written by another import with --resume";
    FileError::invalid(root, "", problem).remedy("wait for that, or choose another name")
}

/// Refuses what is there unless it is such a folder: it has a lock, or nothing.
fn check_own(root: &Path) -> FileResult<()> {
    let is_own = fs::symlink_metadata(root).is_ok_and(|metadata| metadata.is_dir())
        && (fs::symlink_metadata(root.join(LOCK)).is_ok_and(|metadata| metadata.is_file())
            || fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_none()));
    // One that has vanished meanwhile was.
    if is_own || fs::symlink_metadata(root).is_err() {
        return Ok(());
    }
    let problem = "exists and is not from an import with --resume: it is not touched";
    Err(FileError::invalid(root, "", problem).remedy("move it away, or leave --resume out"))
}

/// The result of a removal; what is missing is removed.
fn remove(removed: io::Result<()>, path: &Path) -> FileResult<()> {
    match removed {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(FileError::io(path, "remove", &e)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn what_was_kept_is_found_again_and_what_was_not_is_gone() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s.zarr");
        let partial = Partial::begin(&target).unwrap();
        assert!(partial.read().unwrap().is_none());
        fs::write(partial.store().join("chunk"), "half").unwrap();
        drop(partial);
        assert!(names(dir.path()).is_empty(), "nothing to go on from");

        let partial = Partial::begin(&target).unwrap();
        fs::write(partial.store().join("chunk"), "whole").unwrap();
        partial.write(|to| to.put(&[1u8])).unwrap();
        assert!(Partial::begin(&target).unwrap_err().to_string().contains("another import"));
        drop(partial);
        let partial = Partial::begin(&target).unwrap();
        assert_eq!(fs::read(partial.store().join("chunk")).unwrap(), b"whole");
        assert_eq!(partial.read().unwrap().unwrap().take::<u8>().unwrap(), [1]);
        partial.close().unwrap();
        assert!(names(dir.path()).is_empty());
    }

    #[test]
    fn what_a_killed_run_has_left_without_a_checkpoint_or_without_a_store_is_begun_again() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s.zarr");
        let root = dir.path().join("s.zarr.partial");
        for left in ["store/fields/T", "store"] {
            fs::create_dir_all(root.join(left)).unwrap();
            fs::write(root.join("lock"), "").unwrap();
            fs::write(root.join("checkpoint.new"), "half").unwrap();
            if left == "store" {
                fs::remove_dir(root.join("store")).unwrap();
                fs::write(root.join("checkpoint"), "of what was moved").unwrap();
            }
            let partial = Partial::begin(&target).unwrap();
            assert!(partial.read().unwrap().is_none() && names(partial.store()).is_empty());
            drop(partial);
            assert!(names(dir.path()).is_empty());
        }
    }

    #[test]
    fn what_is_somebody_elses_is_not_touched() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s.zarr");
        let root = dir.path().join("s.zarr.partial");
        fs::create_dir(&root).unwrap();
        fs::write(root.join("thesis.tex"), "years of work").unwrap();
        assert!(Partial::begin(&target).unwrap_err().to_string().contains("not touched"));
        assert_eq!(names(&root), ["thesis.tex"]);
        fs::remove_dir_all(&root).unwrap();
        fs::write(&root, "a file").unwrap();
        assert!(Partial::begin(&target).unwrap_err().to_string().contains("not touched"));
        assert_eq!(fs::read(&root).unwrap(), b"a file");
    }
}

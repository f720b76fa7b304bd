//! A store is written to a temporary folder beside its target and moved there when it is complete.
//!
//! Until then the target is not touched; a failure, a panic or a cancelled run removes the temporary folder. With `overwrite`, the old and
//! the new store are exchanged in one operation of the file system, where it has one (Linux, macOS); elsewhere the old store is moved aside
//! first. It is removed only once the new one is in place. If the target is a link, the store that it points to is replaced, and the link
//! stays.
//!
//! An import that can be interrupted writes to a folder with a fixed name, which stays if the run ends ([`Partial`]).
//!
//! A store to which steps are added begins as hard links of the old one's files ([`Staging::keep`]).

use super::folder::walk;
use super::layout;
use super::partial::Partial;
use crate::error::{FileError, FileResult};
use crate::files;
use crate::task::Cancel;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Where a store is written.
#[derive(Debug)]
enum Place {
    /// A folder that a failure removes.
    Temporary(TempDir),
    /// A folder from which another run goes on.
    Partial(Partial),
}

impl Place {
    fn path(&self) -> &Path {
        match self {
            Self::Temporary(dir) => dir.path(),
            Self::Partial(partial) => partial.store(),
        }
    }

    /// The folder has become the store, and must not be removed.
    fn moved(self) -> FileResult<()> {
        match self {
            Self::Temporary(dir) => _ = dir.keep(),
            Self::Partial(partial) => partial.close()?,
        }
        Ok(())
    }

    /// Removes the folder, which holds the replaced store.
    fn remove(self) -> FileResult<()> {
        match self {
            Self::Temporary(dir) => {
                let path = dir.path().to_owned();
                dir.close().map_err(|e| FileError::io(path, "remove the replaced store", &e))
            }
            Self::Partial(partial) => partial.close(),
        }
    }
}

/// A folder beside the target of a store, in which it is written.
#[derive(Debug)]
pub(super) struct Staging {
    dir: Place,
    target: PathBuf,
    overwrite: bool,
    /// Files linked from the old store: they are on the medium already.
    linked: BTreeSet<PathBuf>,
}

impl Staging {
    /// Makes the folder, if the target may be written.
    pub(super) fn begin(target: &Path, overwrite: bool) -> FileResult<Self> {
        check_target(target, overwrite)?;
        let target = behind_link(target)?;
        let dir = Place::Temporary(files::sibling_folder(&target, "tmp")?);
        Ok(Self { dir, target, overwrite, linked: BTreeSet::new() })
    }

    /// Takes the folder of an import that can be interrupted, with what an earlier run has left there, if the target may be written.
    pub(super) fn go_on(target: &Path, overwrite: bool) -> FileResult<Self> {
        check_target(target, overwrite)?;
        let target = behind_link(target)?;
        let dir = Place::Partial(Partial::begin(&target)?);
        Ok(Self { dir, target, overwrite, linked: BTreeSet::new() })
    }

    /// The folder of an import that can be interrupted.
    pub(super) fn partial(&self) -> Option<&Partial> {
        match &self.dir {
            Place::Temporary(_) => None,
            Place::Partial(partial) => Some(partial),
        }
    }

    /// Gives the new store all files of the old one whose key (path below it, with `/`) `is_kept` confirms: hard links, or copies where the
    /// file system has no hard links.
    pub(super) fn keep(&mut self, is_kept: impl Fn(&str) -> bool) -> FileResult<()> {
        let old = self.target.clone();
        walk(&old, &mut |path, metadata| {
            let below = path.strip_prefix(&old).unwrap_or(path);
            let parts: Vec<_> = below.iter().map(|part| part.to_string_lossy()).collect();
            if metadata.is_symlink() {
                let problem = "is a symbolic link: steps cannot be added to a store that lies in several places";
                return Err(FileError::invalid(path, "", problem).remedy("put what it points to in its place"));
            }
            if !metadata.is_file() || !is_kept(&parts.join("/")) {
                return Ok(());
            }
            let new = self.dir.path().join(below);
            if let Some(parent) = new.parent() {
                fs::create_dir_all(parent).map_err(|e| FileError::io(parent, "create", &e))?;
            }
            match fs::hard_link(path, &new) {
                Ok(()) => _ = self.linked.insert(new),
                Err(_) => _ = fs::copy(path, &new).map_err(|e| FileError::io(path, "copy", &e))?,
            }
            Ok(())
        })
    }

    /// Copies all files of another store whose key `is_kept` confirms; `told` hears how many bytes each has. Whether `cancel` was not raised.
    pub(super) fn copy(
        &self,
        from: &Path,
        is_kept: impl Fn(&str) -> bool,
        told: &mut dyn FnMut(u64),
        cancel: &Cancel,
    ) -> FileResult<bool> {
        walk(from, &mut |path, metadata| {
            let below = path.strip_prefix(from).unwrap_or(path);
            let parts: Vec<_> = below.iter().map(|part| part.to_string_lossy()).collect();
            if metadata.is_symlink() {
                let problem = "is a symbolic link: a store that lies in several places is not copied";
                return Err(FileError::invalid(path, "", problem).remedy("put what it points to in its place"));
            }
            if !metadata.is_file() || !is_kept(&parts.join("/")) || cancel.is_cancelled() {
                return Ok(());
            }
            let new = self.dir.path().join(below);
            let parent = files::parent_of(&new);
            fs::create_dir_all(parent).map_err(|e| FileError::io(parent, "create", &e))?;
            // A copy of its own, which can be written where the other may only be read.
            let copied = File::open(path).and_then(|mut from| io::copy(&mut from, &mut File::create(&new)?));
            told(copied.map_err(|e| FileError::io(path, "copy", &e))?);
            Ok(())
        })?;
        Ok(!cancel.is_cancelled())
    }

    pub(super) fn path(&self) -> &Path {
        self.dir.path()
    }

    /// Makes everything durable and moves it into place.
    pub(super) fn commit(self) -> FileResult<()> {
        // Linked files lie in just as many folders, each of which would have to be flushed.
        if self.linked.is_empty() || !sync_file_system(self.dir.path()) {
            sync_tree(self.dir.path(), &self.linked)?;
        }
        // Another process may have written there meanwhile.
        check_target(&self.target, self.overwrite)?;
        if exists(&self.target) {
            // The old store that comes here must not be taken for an unfinished one.
            self.partial().map_or(Ok(()), Partial::complete)?;
            self.replace()
        } else {
            rename(self.dir.path(), &self.target)?;
            self.installed()
        }
    }

    fn replace(self) -> FileResult<()> {
        if exchange(self.dir.path(), &self.target) {
            // The temporary folder now holds the old store.
            sync_folder(files::parent_of(&self.target))?;
            return self.dir.remove();
        }
        self.replace_in_two_moves()
    }

    /// For systems that cannot exchange two folders: the store is briefly absent.
    fn replace_in_two_moves(self) -> FileResult<()> {
        let aside = files::sibling_folder(&self.target, "old")?;
        let old = aside.path().join("store");
        rename(&self.target, &old)?;
        if let Err(error) = rename(self.dir.path(), &self.target) {
            return match fs::rename(&old, &self.target) {
                Ok(()) => Err(error),
                Err(_) => {
                    let remedy = format!("the store that was there is now {}", aside.keep().join("store").display());
                    Err(error.remedy(remedy))
                }
            };
        }
        self.installed()?;
        let path = aside.path().to_owned();
        aside.close().map_err(|e| FileError::io(path, "remove the replaced store", &e))
    }

    /// The temporary folder has become the store, and must not be removed.
    fn installed(self) -> FileResult<()> {
        self.dir.moved()?;
        sync_folder(files::parent_of(&self.target))
    }
}

/// The target of a link; any other path as it is.
fn behind_link(target: &Path) -> FileResult<PathBuf> {
    let name = target.file_name().unwrap_or_default();
    // A path that ends with a slash is the folder behind a link.
    if !files::parent_of(target).join(name).is_symlink() {
        return Ok(target.to_owned());
    }
    fs::canonicalize(target).map_err(|e| FileError::io(target, "follow the link", &e))
}

/// Whether the path exists, as a dangling link too.
fn exists(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}

/// Refuses a target that may not be written.
fn check_target(target: &Path, overwrite: bool) -> FileResult<()> {
    if target.file_name().is_none() {
        return Err(FileError::invalid(target, "", "names no file").remedy("give a name such as series.zarr"));
    }
    let parent = files::parent_of(target);
    if !parent.is_dir() {
        return Err(FileError::invalid(parent, "", "is not a folder").remedy("create it first"));
    }
    if !exists(target) {
        return Ok(());
    }
    if !layout::is_store(target) {
        let problem = "exists and is not a tetreel store: it is not overwritten";
        return Err(FileError::invalid(target, "", problem).remedy("choose another name"));
    }
    if !overwrite {
        let error = FileError::invalid(target, "", "exists");
        return Err(error.remedy("choose another name, or allow it to be replaced (--overwrite)"));
    }
    Ok(())
}

/// Exchanges two folders in one operation; `false`, with nothing changed, if that is not possible.
#[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
pub(super) fn exchange(a: &Path, b: &Path) -> bool {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE).is_ok()
}

/// Other systems have no exchange.
#[cfg(not(any(target_os = "linux", target_os = "android", target_vendor = "apple")))]
pub(super) fn exchange(_a: &Path, _b: &Path) -> bool {
    false
}

pub(super) fn rename(from: &Path, to: &Path) -> FileResult<()> {
    fs::rename(from, to).map_err(|e| FileError::io(to, &format!("rename {} to it", from.display()), &e))
}

/// Flushes the files and folders below and including `root` to the medium, except for the `linked` files.
fn sync_tree(root: &Path, linked: &BTreeSet<PathBuf>) -> FileResult<()> {
    walk(root, &mut |path, metadata| {
        if metadata.is_dir() {
            return sync_folder(path);
        }
        if linked.contains(path) {
            return Ok(());
        }
        // Windows flushes only files that are open for writing.
        let file = File::options().write(true).open(path);
        file.and_then(|f| f.sync_all()).map_err(|e| FileError::io(path, "flush", &e))
    })?;
    sync_folder(root)
}

/// Flushes everything below and including `root`.
pub(super) fn sync_store(root: &Path) -> FileResult<()> {
    // In one operation where there is one: chunks written long ago need not be opened again.
    if sync_file_system(root) { Ok(()) } else { sync_tree(root, &BTreeSet::new()) }
}

/// Flushes all of the file system that `root` is on, in one operation; whether that was possible.
#[cfg(target_os = "linux")]
fn sync_file_system(root: &Path) -> bool {
    File::open(root).is_ok_and(|folder| rustix::fs::syncfs(folder).is_ok())
}

/// Other systems do not report when a flush is complete.
#[cfg(not(target_os = "linux"))]
fn sync_file_system(_root: &Path) -> bool {
    false
}

#[cfg(unix)]
pub(super) fn sync_folder(path: &Path) -> FileResult<()> {
    File::open(path).and_then(|f| f.sync_all()).map_err(|e| FileError::io(path, "flush", &e))
}

/// Folders cannot be flushed on other systems.
#[cfg(not(unix))]
pub(super) fn sync_folder(_path: &Path) -> FileResult<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with a store `s.zarr` whose one file says `old`, and a staged store that links it and has another file that says `new`.
    fn staged(dir: &Path) -> Staging {
        let target = dir.join("s.zarr");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("zarr.json"), r#"{"attributes": {"tetreel_store": "1.0"}}"#).unwrap();
        fs::write(target.join("kept"), "old").unwrap();
        fs::write(target.join("changed"), "old").unwrap();
        let mut staging = Staging::begin(&target, true).unwrap();
        staging.keep(|key| key != "changed").unwrap();
        fs::write(staging.path().join("changed"), "new").unwrap();
        staging
    }

    #[test]
    fn a_store_is_replaced_with_or_without_an_exchange_and_nothing_else_is_left() {
        for way in [Staging::commit, Staging::replace_in_two_moves] {
            let dir = tempfile::tempdir().unwrap();
            let staging = staged(dir.path());
            assert_eq!(fs::read(dir.path().join("s.zarr/changed")).unwrap(), b"old");
            way(staging).unwrap();
            for (file, text) in [("kept", "old"), ("changed", "new")] {
                assert_eq!(fs::read_to_string(dir.path().join("s.zarr").join(file)).unwrap(), text);
            }
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        }
    }

    #[test]
    fn what_is_not_committed_leaves_the_old_store() {
        let dir = tempfile::tempdir().unwrap();
        drop(staged(dir.path()));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        assert_eq!(fs::read(dir.path().join("s.zarr/kept")).unwrap(), b"old");
        assert_eq!(fs::read(dir.path().join("s.zarr/changed")).unwrap(), b"old");
    }
}

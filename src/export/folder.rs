//! A folder that is filled under a temporary name and moved to its place when it is complete.

use crate::error::{FileError, FileResult};
use crate::files;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder being written; removed with its contents if it is dropped before [`NewFolder::finish`].
pub(super) struct NewFolder {
    staging: TempDir,
    place: PathBuf,
}

impl NewFolder {
    /// Begins the folder `place`, which must be missing or empty; its parent must exist.
    pub(super) fn begin(place: &Path) -> FileResult<Self> {
        let parent = files::parent_of(place);
        if !parent.is_dir() {
            return Err(FileError::invalid(parent, "", "is not a folder").remedy("create it first"));
        }
        check_free(place)?;
        Ok(Self { staging: files::sibling_folder(place, "tmp")?, place: place.to_owned() })
    }

    /// The temporary path to write to.
    pub(super) fn path(&self) -> &Path {
        self.staging.path()
    }

    /// Moves the folder into its place.
    pub(super) fn finish(self) -> FileResult<()> {
        // Another process may have written there meanwhile.
        if check_free(&self.place)? {
            fs::remove_dir(&self.place).map_err(|e| FileError::io(&self.place, "replace the empty folder", &e))?;
        }
        fs::rename(self.staging.path(), &self.place).map_err(|e| FileError::io(&self.place, "move into place", &e))?;
        let _moved = self.staging.keep();
        Ok(())
    }
}

/// Whether `place` is an empty folder; `false` if it does not exist.
///
/// # Errors
/// If it is anything else.
fn check_free(place: &Path) -> FileResult<bool> {
    // A dangling link exists too.
    let Ok(metadata) = fs::symlink_metadata(place) else { return Ok(false) };
    let taken = |problem: &str| FileError::invalid(place, "", problem).remedy("choose another name or remove it");
    if !metadata.is_dir() {
        return Err(taken("exists and is not a folder"));
    }
    let mut entries = fs::read_dir(place).map_err(|e| FileError::io(place, "list", &e))?;
    if entries.next().is_some() { Err(taken("exists and is not empty")) } else { Ok(true) }
}

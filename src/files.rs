//! Writing files and folders whole or not at all, and reading only what is a file.
//!
//! What is written has a temporary name first, `.tetreel-` and letters. A run that is killed leaves it; the next one that writes into
//! the folder removes it (`files/leftovers.rs`).

mod leftovers;

use crate::error::{FileError, FileResult};
use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Writes `path` through a temporary sibling, which then takes its name: readers see the old file or the new one, and a
/// failure leaves the old one.
///
/// # Errors
/// If the folder does not take the file, or `write` fails.
pub fn replace(path: &Path, write: impl FnOnce(&mut File) -> FileResult<()>) -> FileResult<()> {
    let io = |e: std::io::Error| FileError::io(path, "write", &e);
    let mut sibling = sibling_file(path)?;
    write(sibling.as_file_mut())?;
    sibling.as_file_mut().flush().map_err(io)?;
    sibling.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}

/// Makes an empty file beside `path` with the same extension; it is removed when dropped unless it is renamed. As long as it is open,
/// no other run takes it for a leftover.
///
/// # Errors
/// If the folder does not take the file.
pub fn sibling_file(path: &Path) -> FileResult<tempfile::NamedTempFile> {
    check_place(path)?;
    let mut suffix = OsString::new();
    if let Some(extension) = path.extension() {
    leftovers::remove_once(parent_of(path));
        suffix.push(".");
        suffix.push(extension);
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(leftovers::PREFIX).suffix(&suffix);
    readable(&mut builder, 0o666);
    loop {
        let file = builder.tempfile_in(parent_of(path)).map_err(|e| FileError::io(path, "write", &e))?;
        if leftovers::mark_as_live(&file) {
            return Ok(file);
        }
    }
}

/// Makes an empty folder beside `target`, named after it and `purpose`; it is removed when dropped unless it is kept or
/// renamed.
///
/// # Errors
/// If `target` has no name, or the folder that it lies in takes no new one.
pub fn sibling_folder(target: &Path, purpose: &str) -> FileResult<tempfile::TempDir> {
    let no_name = || FileError::invalid(target, "", "names no file or folder").remedy("give it a name");
    let mut prefix = OsString::from(".");
    prefix.push(target.file_name().ok_or_else(no_name)?);
    prefix.push(format!(".{purpose}-"));
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix);
    readable(&mut builder, 0o777);
    let parent = parent_of(target);
    builder.tempdir_in(parent).map_err(|e| FileError::io(parent, "write in", &e))
}

/// Checks that a file can be written at `path`: before long work, not after it.
///
/// # Errors
/// If its folder does not exist or takes no file, or `path` is a folder.
pub fn check_place(path: &Path) -> FileResult<()> {
    let parent = parent_of(path);
    if path.is_dir() {
        return Err(FileError::invalid(path, "", "is a folder").remedy("choose another name"));
    }
    if parent.is_dir() {
        return tempfile::tempfile_in(parent).map(|_| ()).map_err(|e| FileError::io(path, "write", &e));
    }
    Err(FileError::invalid(parent, "", "is not a folder").remedy("create it first"))
}

/// The folder that a path lies in.
pub fn parent_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Temporary files are private by default; what becomes a result is as readable as the umask says.
fn readable(builder: &mut tempfile::Builder<'_, '_>, mode: u32) {
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
    #[cfg(not(unix))]
    let _ = (builder, mode);
}

/// Writes these bytes as [`replace`] does.
///
/// # Errors
/// If the folder does not take the file.
pub fn replace_with(path: &Path, bytes: &[u8]) -> FileResult<()> {
    replace(path, |file| file.write_all(bytes).map_err(|e| FileError::io(path, "write", &e)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        replace_with(&path, b"old").unwrap();
        let failed = replace(&path, |file| {
            file.write_all(b"half").map_err(|e| FileError::io(&path, "write", &e))?;
            Err(FileError::invalid(&path, "", "the writer failed"))
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
        replace_with(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }
}

//! Writing files and folders atomically, and reading regular files only.
//!
//! A file is written under a temporary name, `.tetreel-` and letters. A killed run leaves it; the next one that writes to the folder
//! removes it (`files/leftovers.rs`).

mod leftovers;

use crate::error::{FileError, FileResult};
#[cfg(doc)]
use std::ffi::OsStr;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

/// The remedy where the system writes no file: the folder is read-only, or the disk is full.
pub const PLACE_REMEDY: &str = "choose a folder that you may write to, with room on its disk";

/// The error of the operating system when a file is written, with the failed action and the remedy.
pub fn cannot_write(path: &Path, action: &str, source: &std::io::Error) -> FileError {
    FileError::io(path, action, source).remedy(PLACE_REMEDY)
}

/// Writes `path` through a temporary sibling, which is then renamed: readers see the old file or the new one, and a failure leaves the old
/// one.
///
/// # Errors
/// If the folder is not writable, or `write` fails.
pub fn replace(path: &Path, write: impl FnOnce(&mut File) -> FileResult<()>) -> FileResult<()> {
    let io = |e: std::io::Error| cannot_write(path, "write", &e);
    let mut sibling = sibling_file(path)?;
    write(sibling.as_file_mut())?;
    sibling.as_file_mut().flush().map_err(io)?;
    sibling.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}

/// Creates an empty file beside `path` with the same extension; it is removed when dropped unless it is renamed. While it is open, no other
/// run treats it as a leftover.
///
/// # Errors
/// If the folder is not writable.
pub fn sibling_file(path: &Path) -> FileResult<tempfile::NamedTempFile> {
    check_place(path)?;
    leftovers::remove_once(parent_of(path));
    let mut suffix = OsString::new();
    if let Some(extension) = path.extension() {
        suffix.push(".");
        suffix.push(extension);
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(leftovers::PREFIX).suffix(&suffix);
    readable(&mut builder, 0o666);
    loop {
        let file = builder.tempfile_in(parent_of(path)).map_err(|e| cannot_write(path, "write", &e))?;
        if leftovers::mark_as_live(&file) {
            return Ok(file);
        }
    }
}

/// Creates an empty folder beside `target`, named after it and `purpose`; it is removed when dropped unless it is kept or renamed.
///
/// # Errors
/// If `target` has no name, or its parent folder is not writable.
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

/// Checks that a file can be written at `path`, before long work.
///
/// # Errors
/// If its folder does not exist or is not writable, or `path` is a folder.
pub fn check_place(path: &Path) -> FileResult<()> {
    let parent = parent_of(path);
    if path.is_dir() {
        return Err(FileError::invalid(path, "", "is a folder").remedy("choose another name"));
    }
    if parent.is_dir() {
        return tempfile::tempfile_in(parent).map(|_| ()).map_err(|e| cannot_write(path, "write", &e));
    }
    Err(FileError::invalid(parent, "", "is not a folder").remedy("create it first"))
}

/// Name of a series, of a store or of a project, for titles and records.
pub fn name_of(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// The error of a file that would be replaced, and may not be.
pub fn taken(path: &Path) -> FileError {
    FileError::invalid(path, "", "there is a file of that name").remedy("choose another name, or replace it")
}

/// Reads a whole file.
///
/// # Errors
/// If it does not exist, is not a regular file, or cannot be read.
pub fn read(path: &Path) -> FileResult<Vec<u8>> {
    check_kind(path)?;
    fs::read(path).map_err(|e| FileError::io(path, "read", &e))
}

/// Opens a file to read it.
///
/// # Errors
/// If it does not exist, is not a regular file, or cannot be opened.
pub fn open(path: &Path) -> FileResult<File> {
    check_kind(path)?;
    File::open(path).map_err(|e| FileError::io(path, "open", &e))
}

/// Refuses a path that is neither a file nor a folder, before it is opened: reading a FIFO without a writer blocks, and some devices never
/// end. A missing path is left to the caller's open.
///
/// # Errors
/// If it is a FIFO, a socket or a device; the error names which.
pub fn check_kind(path: &Path) -> FileResult<()> {
    let kind = fs::metadata(path).ok().and_then(|metadata| special_kind(metadata.file_type()));
    match kind {
        None => Ok(()),
        Some(kind) => Err(FileError::unsupported(path, "", format!("is {kind}, not a file"))
            .remedy("write what comes from it to a file, and name that")),
    }
}

#[cfg(unix)]
fn special_kind(file: fs::FileType) -> Option<&'static str> {
    use std::os::unix::fs::FileTypeExt;
    let kinds = [
        (file.is_fifo(), "a FIFO"),
        (file.is_socket(), "a socket"),
        (file.is_char_device(), "a device"),
        (file.is_block_device(), "a device"),
    ];
    kinds.into_iter().find(|(is_it, _)| *is_it).map(|(_, name)| name)
}

/// On other systems folders have no such files.
#[cfg(not(unix))]
fn special_kind(_file: fs::FileType) -> Option<&'static str> {
    None
}

/// The parent folder of a path.
pub fn parent_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Sets the permissions to `mode` less the umask: temporary files are private by default, results are not.
fn readable(builder: &mut tempfile::Builder<'_, '_>, mode: u32) {
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
    #[cfg(not(unix))]
    let _ = (builder, mode);
}

/// Writes these bytes as [`replace`] does.
///
/// # Errors
/// If the folder is not writable.
pub fn replace_with(path: &Path, bytes: &[u8]) -> FileResult<()> {
    replace(path, |file| file.write_all(bytes).map_err(|e| cannot_write(path, "write", &e)))
}

/// The string of these bytes, parts of names ([`OsStr::as_encoded_bytes`]); `None` where the system cannot tell.
pub fn os_string(bytes: Vec<u8>) -> Option<OsString> {
    #[cfg(unix)]
    return Some(std::os::unix::ffi::OsStringExt::from_vec(bytes));
    #[cfg(not(unix))]
    String::from_utf8(bytes).ok().map(OsString::from)
}

/// Serializes a path for a JSON report; bytes that are not Unicode become U+FFFD.
///
/// # Errors
/// If the serializer fails.
pub fn serialize_path<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
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

//! Writing a file whole or not at all.

use crate::error::{FileError, FileResult};
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
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tetreel-");
    // Temporary files are private by default; a result is as readable as the umask says.
    #[cfg(unix)]
    let readable = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    #[cfg(unix)]
    builder.permissions(readable);
    let mut sibling = builder.tempfile_in(folder).map_err(io)?;
    write(sibling.as_file_mut())?;
    sibling.as_file_mut().flush().map_err(io)?;
    sibling.persist(path).map_err(|e| io(e.error))?;
    Ok(())
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

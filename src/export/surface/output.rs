//! Output of surfaces: a collection, or numbered files.

use super::step::StepSurface;
use super::{ply, vtp};
use crate::error::{FileError, FileResult};
use crate::export::collection::{NewCollection, OpenCollection, check_free};
use crate::export::numbered::NumberedPath;
use crate::files;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Writes a surface in a file format; returns the size of the file.
type Write = fn(&Path, &StepSurface) -> FileResult<u64>;

/// Paths of the files to write.
pub(super) enum Place<'a> {
    /// A `.pvd` file with a folder of `.vtp` files.
    Collection(NewCollection<'a>),
    /// These files, all in one folder.
    Files { write: Write, paths: Vec<PathBuf> },
}

/// Files being written; unfinished ones are removed on drop.
pub(super) enum Output<'a> {
    Collection(OpenCollection<'a>),
    Files { write: Write, paths: Vec<PathBuf>, staging: TempDir, written: usize },
}

impl<'a> Place<'a> {
    /// The paths of `count` files.
    ///
    /// # Errors
    /// If the extension is none of `.pvd`, `.vtp` and `.ply`, the name has no number for several files or one in a folder's name, or a path
    /// is taken.
    pub fn of(output: &'a Path, count: usize) -> FileResult<Self> {
        let is = |extension: &str| output.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
        let (write, example): (Write, _) = match (is("vtp"), is("ply")) {
            (true, _) => (vtp::write, "surface_%04d.vtp"),
            (_, true) => (ply::write, "surface_%04d.ply"),
            _ if is("pvd") => return Ok(Self::Collection(NewCollection::at(output)?)),
            _ => {
                let error = FileError::unsupported(output, "", "surfaces are written as .pvd, .vtp or .ply files");
                return Err(error.remedy("name it so"));
            }
        };
        let pattern = NumberedPath::new(output, example)?;
        let unsupported = |problem: String| {
            FileError::unsupported(output, "", problem).remedy(format!("write, for example, {example}"))
        };
        if count != 1 && !pattern.is_numbered() {
            return Err(unsupported(format!(
                "{count} steps are {count} files, and the name has no place for a number"
            )));
        }
        if files::parent_of(&pattern.path(0)) != files::parent_of(&pattern.path(1)) {
            return Err(unsupported("the place for a number is in the name of a folder".to_owned()));
        }
        let paths: Vec<PathBuf> = (0..count).map(|n| pattern.path(n)).collect();
        paths.iter().try_for_each(|path| check_free(path))?;
        Ok(Self::Files { write, paths })
    }

    /// Creates a temporary folder for the files beside their paths.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub fn begin(self) -> FileResult<Output<'a>> {
        match self {
            Self::Collection(place) => Ok(Output::Collection(place.begin("vtp")?)),
            Self::Files { write, paths } => {
                let first = paths.first().cloned().unwrap_or_default();
                let parent = files::parent_of(&first);
                if !parent.is_dir() {
                    return Err(FileError::invalid(parent, "", "is not a folder").remedy("create it first"));
                }
                Ok(Output::Files { write, staging: files::sibling_folder(&first, "tmp")?, paths, written: 0 })
            }
        }
    }
}

impl Output<'_> {
    /// Writes the next file; returns its size in bytes.
    ///
    /// # Errors
    /// If the disk is full, or the format cannot express the name of a field.
    pub fn write(&mut self, surface: &StepSurface) -> FileResult<u64> {
        match self {
            Self::Collection(collection) => {
                let name = collection.list.add(surface.time);
                vtp::write(&collection.folder.path().join(name), surface)
            }
            Self::Files { write, staging, written, .. } => {
                *written += 1;
                write(&staged(staging, *written - 1), surface)
            }
        }
    }

    /// Moves all files into place; returns the bytes of additional files.
    ///
    /// # Errors
    /// If another process has written there meanwhile; no files are left then.
    pub fn finish(self) -> FileResult<u64> {
        let (paths, staging) = match self {
            Self::Collection(collection) => return collection.finish(),
            Self::Files { paths, staging, .. } => (paths, staging),
        };
        paths.iter().try_for_each(|path| check_free(path))?;
        for (n, path) in paths.iter().enumerate() {
            if let Err(error) = fs::rename(staged(&staging, n), path) {
                for moved in &paths[..n] {
                    let _ = fs::remove_file(moved);
                }
                return Err(FileError::io(path, "move into place", &error));
            }
        }
        Ok(0)
    }
}

/// Temporary path of a file before it is moved.
fn staged(staging: &TempDir, n: usize) -> PathBuf {
    staging.path().join(n.to_string())
}

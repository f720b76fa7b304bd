//! Where surfaces go: a collection, or numbered files.

use super::step::StepSurface;
use super::{ply, vtp};
use crate::error::{FileError, FileResult};
use crate::export::collection::{NewCollection, OpenCollection, check_free};
use crate::export::numbered::NumberedPath;
use crate::files;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// What the files are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// VTK's XML.
    Vtp,
    /// Stanford's.
    Ply,
}

impl Format {
    fn write(self, path: &Path, surface: &StepSurface) -> FileResult<u64> {
        match self {
            Self::Vtp => vtp::write(path, surface),
            Self::Ply => ply::write(path, surface),
        }
    }
}

/// Where the files are to be.
pub(super) enum Place<'a> {
    /// A `.pvd` file with a folder of `.vtp` files.
    Collection(NewCollection<'a>),
    /// These files, all in one folder.
    Files { format: Format, paths: Vec<PathBuf> },
}

/// Files in the making. What is not finished vanishes.
pub(super) enum Output<'a> {
    Collection(OpenCollection<'a>),
    Files { format: Format, paths: Vec<PathBuf>, staging: TempDir, written: usize },
}

impl<'a> Place<'a> {
    /// The places of so many files.
    ///
    /// # Errors
    /// If the name has another extension than `.pvd`, `.vtp` and `.ply`, has no place for a number and there are several files, has it
    /// in the name of a folder, or one of the places is taken.
    pub fn of(output: &'a Path, count: usize) -> FileResult<Self> {
        let is = |extension: &str| output.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
        let format = match (is("vtp"), is("ply")) {
            (true, _) => Format::Vtp,
            (_, true) => Format::Ply,
            _ if is("pvd") => return Ok(Self::Collection(NewCollection::at(output)?)),
            _ => {
                let error = FileError::unsupported(output, "", "surfaces are written as .pvd, .vtp or .ply files");
                return Err(error.remedy("name it so"));
            }
        };
        let example = if format == Format::Vtp { "surface_%04d.vtp" } else { "surface_%04d.ply" };
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
        Ok(Self::Files { format, paths })
    }

    /// Makes a folder for the files beside their places.
    ///
    /// # Errors
    /// If that is not possible.
    pub fn begin(self) -> FileResult<Output<'a>> {
        match self {
            Self::Collection(place) => Ok(Output::Collection(place.begin("vtp")?)),
            Self::Files { format, paths } => {
                let first = paths.first().cloned().unwrap_or_default();
                let parent = files::parent_of(&first);
                if !parent.is_dir() {
                    return Err(FileError::invalid(parent, "", "is not a folder").remedy("create it first"));
                }
                Ok(Output::Files { format, staging: files::sibling_folder(&first, "tmp")?, paths, written: 0 })
            }
        }
    }
}

impl Output<'_> {
    /// Writes the next file; returns its size in bytes.
    ///
    /// # Errors
    /// If the disk is full, or a field has a name that the format does not express.
    pub fn write(&mut self, surface: &StepSurface) -> FileResult<u64> {
        match self {
            Self::Collection(collection) => {
                let name = collection.list.add(surface.time);
                Format::Vtp.write(&collection.folder.path().join(name), surface)
            }
            Self::Files { format, staging, written, .. } => {
                *written += 1;
                format.write(&staged(staging, *written - 1), surface)
            }
        }
    }

    /// Moves all files into their places; returns the bytes of what is written beside them.
    ///
    /// # Errors
    /// If somebody has written there meanwhile; nothing is left then.
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

/// Where a file is before it is moved.
fn staged(staging: &TempDir, n: usize) -> PathBuf {
    staging.path().join(n.to_string())
}

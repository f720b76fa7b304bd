//! The error of all file access: its kind, the file, the place in it, and the remedy.

use std::fmt;
use std::path::{Path, PathBuf};

/// The three kinds of file errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileErrorKind {
    /// The file is well formed, but uses something that tetreel does not handle.
    Unsupported,
    /// The file contradicts its format or itself.
    Invalid,
    /// The operating system reported an error.
    Io,
}

/// A failure to read or write a file. Names the file, the place in it, what is wrong and, where there is one, the remedy.
///
/// ```
/// use tetreel::error::FileError;
/// let e = FileError::invalid("run_07.vtu", "array 'T'", "ends after 12 of 96 bytes").remedy("write the file again");
/// assert_eq!(e.to_string(), "run_07.vtu: array 'T': ends after 12 of 96 bytes; write the file again");
/// ```
#[derive(Clone, Debug)]
pub struct FileError {
    /// Unsupported, invalid or I/O.
    pub kind: FileErrorKind,
    /// The file or folder concerned.
    pub path: PathBuf,
    /// The place in the file (an element, an array, a byte offset); empty for the file as a whole.
    pub place: String,
    /// What is wrong.
    pub problem: String,
    /// What the user can do; empty if there is no advice.
    pub remedy: String,
}

/// Result of a file operation.
pub type FileResult<T> = Result<T, FileError>;

impl FileError {
    fn new(kind: FileErrorKind, path: impl AsRef<Path>, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self {
            kind,
            path: path.as_ref().to_owned(),
            place: place.into(),
            problem: problem.into(),
            remedy: String::new(),
        }
    }

    /// A well-formed file with a feature that tetreel does not handle.
    pub fn unsupported(path: impl AsRef<Path>, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::new(FileErrorKind::Unsupported, path, place, problem)
    }

    /// A file that contradicts its format or itself.
    pub fn invalid(path: impl AsRef<Path>, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::new(FileErrorKind::Invalid, path, place, problem)
    }

    /// An error of the operating system, with the failed action ("open", "write", "rename").
    pub fn io(path: impl AsRef<Path>, action: &str, source: &std::io::Error) -> Self {
        Self::new(FileErrorKind::Io, path, "", format!("cannot {action}: {source}"))
    }

    /// Adds a remedy.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = remedy.into();
        self
    }
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.path.display())?;
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.problem)?;
        if !self.remedy.is_empty() {
            write!(f, "; {}", self.remedy)?;
        }
        Ok(())
    }
}

impl std::error::Error for FileError {}

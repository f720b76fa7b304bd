//! Work that ends early, by failure or cancellation.

use crate::error::{FileError, FileResult};
use crate::task::Cancel;

/// Why work on a step ended without a result.
#[derive(Clone, Debug)]
pub enum Stop {
    /// Its [`Cancel`] was raised.
    Cancelled,
    /// A file failed.
    File(FileError),
}

impl From<FileError> for Stop {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

impl Stop {
    /// Adds a location to a file error.
    #[must_use]
    pub(super) fn at(mut self, place: impl FnOnce() -> String) -> Self {
        if let Self::File(error) = &mut self {
            error.place = place();
        }
        self
    }
}

/// Fails with `Cancelled` once `cancel` is raised.
pub(super) fn go_on(cancel: &Cancel) -> Result<(), Stop> {
    if cancel.is_cancelled() { Err(Stop::Cancelled) } else { Ok(()) }
}

/// The result of work that may have been cancelled: `None` if it was.
pub(super) fn unless_cancelled<T>(result: Result<T, Stop>) -> FileResult<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Stop::Cancelled) => Ok(None),
        Err(Stop::File(error)) => Err(error),
    }
}

/// Runs work that cannot be cancelled.
pub(super) fn uncancelled<T>(work: impl FnOnce(&Cancel) -> Result<T, Stop>) -> FileResult<T> {
    match work(&Cancel::new()) {
        Ok(value) => Ok(value),
        Err(Stop::File(error)) => Err(error),
        Err(Stop::Cancelled) => unreachable!("nobody else has the flag"),
    }
}

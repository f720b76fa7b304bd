//! `--trace`: when each thread did what, as a file for trace viewers.

use crate::error::{FileError, FileResult};
use crate::files;
use anyhow::Context;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use tracing_chrome::{ChromeLayerBuilder, FlushGuard};
use tracing_subscriber::layer::SubscriberExt;

/// A trace that is being written, beside its place until it is complete.
pub(super) struct Trace {
    place: PathBuf,
    file: NamedTempFile,
    guard: FlushGuard,
}

impl Trace {
    /// Records the spans of all threads from now on. Only one trace can be begun in a process.
    pub(super) fn begin(place: &Path) -> anyhow::Result<Self> {
        let file = files::sibling_file(place)?;
        let writer = file.reopen().map_err(|e| FileError::io(place, "write", &e))?;
        let (layer, guard) =
            ChromeLayerBuilder::new().writer(writer).include_args(true).include_locations(false).build();
        tracing::subscriber::set_global_default(tracing_subscriber::registry().with(layer))
            .context("a trace is being written already")?;
        Ok(Self { place: place.to_owned(), file, guard })
    }

    /// Waits until all is written, and moves the file to its place.
    pub(super) fn end(self) -> FileResult<()> {
        let Self { place, file, guard } = self;
        drop(guard);
        file.persist(&place).map(drop).map_err(|e| FileError::io(&place, "write", &e.error))
    }
}

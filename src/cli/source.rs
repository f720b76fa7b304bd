//! Commands that take a store also take a SOURCE, which is imported to a cache first.

use super::Interrupted;
use super::progress::Terminal;
use crate::field::SeriesSource;
use crate::ingest::{CacheError, CacheEvent, ImportCache, IngestError, IngestOptions, IngestReport, Origin, ingest};
use crate::store::Store;
use crate::task::Progress;
use std::path::Path;

/// Opens a store, or imports a foreign file to the cache ([`ImportCache`]) and opens that.
pub(super) fn open(path: &Path, terminal: &Terminal) -> anyhow::Result<Store> {
    let mut announce = |event: CacheEvent<'_>| match event {
        CacheEvent::Waiting(cached) => {
            terminal.say(&format!("waiting for another import of {} to {}", path.display(), cached.display()));
        }
        CacheEvent::Importing(cached) => {
            terminal.say(&format!("importing {} to {}", path.display(), cached.display()));
        }
    };
    let opened = ImportCache::of_user().open_or_import(&[path.to_owned()], &mut announce, terminal, &terminal.cancel);
    if opened.is_err() {
        terminal.end();
    }
    let (store, origin) = opened.map_err(|error| match error {
        CacheError::Import(error) => ended(error),
        other => other.into(),
    })?;
    match origin {
        Origin::Store => {}
        Origin::Cached => {
            terminal.detail(&format!("{}: imported before to {}", path.display(), store.path().display()));
        }
        Origin::Imported(report) => terminal.detail(&report.to_string()),
    }
    Ok(store)
}

/// Imports with a progress bar; Ctrl-C cancels and leaves no files.
pub(super) fn run_ingest(
    source: &dyn SeriesSource,
    out: &Path,
    options: &IngestOptions,
    terminal: &Terminal,
) -> anyhow::Result<IngestReport> {
    let result = ingest(source, out, options, terminal, &terminal.cancel);
    if result.is_err() {
        terminal.end();
    }
    result.map_err(ended)
}

/// Converts the error of an import.
pub(super) fn ended(error: IngestError) -> anyhow::Error {
    match error {
        IngestError::Cancelled => Interrupted.into(),
        other => other.into(),
    }
}

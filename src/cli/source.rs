//! Commands that take a store also take a SOURCE, which is imported to a cache first.

use super::Interrupted;
use super::progress::Terminal;
use crate::field::SeriesSource;
use crate::import;
use crate::ingest::{IngestError, IngestOptions, IngestReport, ingest};
use crate::store::{Store, is_store};
use crate::task::Progress;
use anyhow::Context;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Opens a store, or imports a foreign file to the cache and opens that.
///
/// The cache is `$TETREEL_CACHE`, else `$XDG_CACHE_HOME/tetreel`, else `~/.cache/tetreel`. An entry holds as long as path,
/// size and time of change of the source's files are the same.
pub(super) fn open(path: &Path, terminal: &Terminal) -> anyhow::Result<Store> {
    if is_store(path) || path.extension().is_some_and(|e| e == "zarr") {
        return Ok(Store::open(path)?);
    }
    let cache = cache_dir()?;
    let cached = cache.join(entry_name(path, &import::files(path)?));
    if is_store(&cached)
        && let Ok(store) = Store::open(&cached)
    {
        terminal.detail(&format!("{}: imported before to {}", path.display(), cached.display()));
        return Ok(store);
    }
    // Only now: what was imported before need not be read, and a bad source leaves no folder.
    let source = import::open(path)?;
    std::fs::create_dir_all(&cache).with_context(|| format!("{}: cannot make the cache folder", cache.display()))?;
    terminal.say(&format!("importing {} to {}", path.display(), cached.display()));
    let report = run_ingest(&*source, &cached, &IngestOptions { overwrite: true, ..Default::default() }, terminal)?;
    terminal.detail(&report.to_string());
    Ok(Store::open(&cached)?)
}

/// Imports with a progress bar; Ctrl-C ends it without leaving anything.
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

/// How a run ends with this error.
pub(super) fn ended(error: IngestError) -> anyhow::Error {
    match error {
        IngestError::Cancelled => Interrupted.into(),
        other => other.into(),
    }
}

fn cache_dir() -> anyhow::Result<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    variable("TETREEL_CACHE")
        .or_else(|| variable("XDG_CACHE_HOME").map(|d| d.join("tetreel")))
        .or_else(|| variable("HOME").map(|d| d.join(".cache").join("tetreel")))
        .context("no place for the cache of imported files; set TETREEL_CACHE to a folder, or import to a store first")
}

/// A name that changes with the version of tetreel, the source's path and every change of its files.
fn entry_name(path: &Path, files: &[PathBuf]) -> String {
    let mut state =
        format!("{} {}", env!("CARGO_PKG_VERSION"), path.canonicalize().unwrap_or_else(|_| path.to_owned()).display());
    for file in files {
        let (size, changed) = std::fs::metadata(file).map_or((0, None), |m| (m.len(), m.modified().ok()));
        let nanos = changed.and_then(|t| t.duration_since(UNIX_EPOCH).ok()).map_or(0, |d| d.as_nanos());
        state.push_str(&format!("\n{} {size} {nanos}", file.display()));
    }
    let stem = path.file_stem().map_or_else(|| "source".into(), |s| s.to_string_lossy());
    // Two independent checksums: one of the text, one of the text backwards.
    let reversed: Vec<u8> = state.bytes().rev().collect();
    format!("{stem}-{:08x}{:08x}.zarr", crc32c::crc32c(state.as_bytes()), crc32c::crc32c(&reversed))
}

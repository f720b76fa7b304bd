//! `--trace`: the activity of each thread over time, as a file for trace viewers.

use crate::error::{FileError, FileResult};
use crate::files;
use anyhow::Context;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use tempfile::NamedTempFile;
use tracing_chrome::{ChromeLayerBuilder, FlushGuard};
use tracing_subscriber::layer::SubscriberExt;

/// A trace being written, to a temporary file until it is complete.
pub(super) struct Trace {
    place: PathBuf,
    file: NamedTempFile,
    guard: FlushGuard,
    failed: Failure,
}

/// The first write error.
type Failure = Arc<Mutex<Option<io::Error>>>;

/// A writer that keeps the first error instead of returning it: the thread that writes the trace would panic.
struct Patient {
    file: File,
    failed: Failure,
}

impl Patient {
    fn note(&self, result: io::Result<()>) {
        if let Err(error) = result {
            self.failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }
    }
}

impl Write for Patient {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let result = self.file.write_all(bytes);
        self.note(result);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let result = self.file.flush();
        self.note(result);
        Ok(())
    }
}

impl Trace {
    /// Records the spans of all threads from now on. Only one trace can be begun in a process.
    pub(super) fn begin(place: &Path) -> anyhow::Result<Self> {
        let file = files::sibling_file(place)?;
        let failed = Arc::default();
        let writer = file.reopen().map_err(|e| FileError::io(place, "write", &e))?;
        let writer = Patient { file: writer, failed: Arc::clone(&failed) };
        let (layer, guard) =
            ChromeLayerBuilder::new().writer(writer).include_args(true).include_locations(false).build();
        tracing::subscriber::set_global_default(tracing_subscriber::registry().with(layer))
            .context("a trace is being written already")?;
        Ok(Self { place: place.to_owned(), file, guard, failed })
    }

    /// Waits until everything is written, and renames the file.
    pub(super) fn end(self) -> FileResult<()> {
        let Self { place, file, guard, failed } = self;
        drop(guard);
        if let Some(error) = failed.lock().unwrap_or_else(PoisonError::into_inner).take() {
            return Err(FileError::io(&place, "write", &error));
        }
        file.persist(&place).map(drop).map_err(|e| FileError::io(&place, "write", &e.error))
    }
}

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_remembered_and_does_not_stop_the_writer() {
        use super::*;
        let failed = Failure::default();
        let mut writer =
            Patient { file: File::options().write(true).open("/dev/full").unwrap(), failed: failed.clone() };
        for _ in 0..2 {
            assert_eq!(writer.write(b"spans").unwrap(), 5);
        }
        writer.flush().unwrap();
        let error = failed.lock().unwrap().take().unwrap();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
    }
}

//! A count of the bytes of files, shared between those who write and those who report progress.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of the files of a run.
#[derive(Clone, Debug, Default)]
pub struct Written(Arc<AtomicU64>);

impl Written {
    /// Bytes so far.
    pub fn bytes(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Adds a file that is complete.
    pub(super) fn add(&self, file: &Path) {
        self.0.fetch_add(size_of(file), Ordering::Relaxed);
    }

    /// Sets the size of a file that grows.
    pub(super) fn set(&self, file: &Path) {
        self.0.store(size_of(file), Ordering::Relaxed);
    }
}

/// Size of a file; 0 if the system does not say.
fn size_of(file: &Path) -> u64 {
    std::fs::metadata(file).map_or(0, |metadata| metadata.len())
}

//! The lock on the folder of a store, held by whoever adds to it.

use crate::task::Cancel;
use std::fs::{File, Metadata, TryLockError};
use std::io;
use std::path::Path;
use std::time::Duration;

/// Pause between two attempts to take a lock.
const PAUSE: Duration = Duration::from_millis(20);

/// Exclusive right to change a store. It ends with the value, and with the process however that ends.
///
/// On systems other than Unix, and on file systems without locks, it excludes nobody: a change overtaken by another one is then still
/// noticed before it is put in place, but for a race of one instant.
#[derive(Debug)]
pub struct StoreLock {
    _folder: Option<File>,
}

impl StoreLock {
    /// Waits for the lock; `None` if `cancel` was raised. A store that is missing or cannot be opened is not locked: opening it gives the
    /// error.
    pub fn wait(root: &Path, cancel: &Cancel) -> Option<Self> {
        while !cancel.is_cancelled() {
            let Some(folder) = open_folder(root) else { return Some(Self { _folder: None }) };
            match folder.try_lock() {
                // After steps were added the store is another folder: the lock of the old one is void.
                Ok(()) if is_at(&folder, root.metadata()) => return Some(Self { _folder: Some(folder) }),
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => std::thread::sleep(PAUSE),
                Err(TryLockError::Error(_)) => return Some(Self { _folder: None }),
            }
        }
        None
    }

    /// The lock, if nobody else has it.
    pub(super) fn at_once(root: &Path) -> Option<Self> {
        let Some(folder) = open_folder(root) else { return Some(Self { _folder: None }) };
        match folder.try_lock() {
            Ok(()) => is_at(&folder, root.metadata()).then_some(Self { _folder: Some(folder) }),
            Err(TryLockError::WouldBlock) => None,
            Err(TryLockError::Error(_)) => Some(Self { _folder: None }),
        }
    }
}

#[cfg(unix)]
fn open_folder(root: &Path) -> Option<File> {
    // Opening a FIFO would block.
    File::open(Some(root).filter(|root| root.is_dir())?).ok()
}

/// Folders cannot be opened on other systems.
#[cfg(not(unix))]
fn open_folder(_root: &Path) -> Option<File> {
    None
}

/// Whether an open file or folder is still the one that was found by its name. Other systems than Unix cannot tell.
#[cfg(unix)]
pub(crate) fn is_at(file: &File, named: io::Result<Metadata>) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |metadata: Metadata| (metadata.dev(), metadata.ino());
    let (file, named) = (file.metadata().map(id), named.map(id));
    matches!((file, named), (Ok(file), Ok(named)) if file == named)
}

#[cfg(not(unix))]
pub(crate) fn is_at(_file: &File, _named: io::Result<Metadata>) -> bool {
    true
}

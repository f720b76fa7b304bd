//! One at a time: who adds to a store holds a lock on its folder.

use crate::task::Cancel;
use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::Duration;

/// How long to wait before another look at a lock that somebody else holds.
const PAUSE: Duration = Duration::from_millis(20);

/// The right to change a store. It ends with the value, and with the process however that ends.
///
/// On systems other than Unix, and on file systems without locks, everybody has it at once: there, a change that was overtaken
/// by another one is still noticed before it is put in place, unless it happens in that very moment.
#[derive(Debug)]
pub struct StoreLock {
    _folder: Option<File>,
}

impl StoreLock {
    /// Waits until nobody else has it; `None` if `cancel` was raised. A store that is not there or cannot be opened needs
    /// none: whoever opens it says why.
    pub fn wait(root: &Path, cancel: &Cancel) -> Option<Self> {
        while !cancel.is_cancelled() {
            let Some(folder) = open_folder(root) else { return Some(Self { _folder: None }) };
            match folder.try_lock() {
                // A store to which steps were added is another folder: the lock of the old one says nothing.
                Ok(()) if is_at(&folder, root) => return Some(Self { _folder: Some(folder) }),
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => std::thread::sleep(PAUSE),
                Err(TryLockError::Error(_)) => return Some(Self { _folder: None }),
            }
        }
        None
    }
}

#[cfg(unix)]
fn open_folder(root: &Path) -> Option<File> {
    // A FIFO would be waited for.
    File::open(Some(root).filter(|root| root.is_dir())?).ok()
}

/// Folders cannot be opened here.
#[cfg(not(unix))]
fn open_folder(_root: &Path) -> Option<File> {
    None
}

/// Whether a folder is still the one of this name.
#[cfg(unix)]
fn is_at(folder: &File, root: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    let (folder, named) = (folder.metadata().map(id), root.metadata().map(id));
    matches!((folder, named), (Ok(folder), Ok(named)) if folder == named)
}

#[cfg(not(unix))]
fn is_at(_folder: &File, _root: &Path) -> bool {
    true
}

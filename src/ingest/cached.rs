//! Opening what is no store: it is imported to a cache first.
//!
//! The cache is a folder of stores. The name of an entry has a checksum of the version of tetreel, of the source's path, and of
//! path, size and time of change of all its files: an entry holds until one of these changes. Who imports an entry holds a lock
//! on the file `.NAME.lock` beside it; somebody else who wants the same waits and finds it there. An import that fails or is
//! cancelled leaves nothing, and what a killed one has left is removed by the next import that finds its lock free.

use super::options::IngestOptions;
use super::report::{IngestError, IngestReport};
use super::{check_cancel, ingest};
use crate::error::{FileError, FileResult};
use crate::import;
use crate::store::{Store, is_store};
use crate::task::{Cancel, Progress};
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf, absolute};
use std::time::{Duration, UNIX_EPOCH};

/// Where imported sources are kept.
#[derive(Clone, Debug)]
pub struct ImportCache {
    folder: Option<PathBuf>,
}

/// Where a store came from.
#[derive(Debug)]
pub enum Origin {
    /// It is what was named.
    Store,
    /// It was imported before.
    Cached,
    /// It was imported now.
    Imported(Box<IngestReport>),
}

/// What takes a while and begins now, for a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CacheEvent<'a> {
    /// Somebody else imports the same to this store, which is waited for.
    Waiting(&'a Path),
    /// The import to this store.
    Importing(&'a Path),
}

/// Why nothing was opened.
#[derive(Debug, thiserror::Error)]
pub enum CacheError {
    /// No variable says where the cache is.
    #[error("no place for the cache of imported files; set TETREEL_CACHE to a folder, or import to a store first")]
    NoFolder,
    /// The store or the source cannot be opened, or the cache not be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The import failed, or was cancelled.
    #[error(transparent)]
    Import(#[from] IngestError),
}

impl CacheError {
    /// Whether somebody asked to stop.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Import(IngestError::Cancelled))
    }
}

impl ImportCache {
    /// The user's: `$TETREEL_CACHE`, else `$XDG_CACHE_HOME/tetreel`, else `~/.cache/tetreel` (on Windows
    /// `%LOCALAPPDATA%\tetreel`). That there is none is an error only when it is needed.
    pub fn of_user() -> Self {
        Self { folder: folder_from(|name| std::env::var_os(name)) }
    }

    /// In this folder, which is made when it is needed.
    pub fn at(folder: impl Into<PathBuf>) -> Self {
        Self { folder: Some(folder.into()) }
    }

    /// Opens a store, or imports a source to the cache (unless it is there already) and opens that. Several sources become
    /// one series as by [`import::open_many`]. `announce` hears of what takes a while.
    ///
    /// # Errors
    /// If there is no such store or source, it cannot be read or imported, there is no place for the cache, or `cancel` was
    /// raised. What is no store and no source is named, with what can be read.
    pub fn open_or_import(
        &self,
        sources: &[PathBuf],
        announce: &mut dyn FnMut(CacheEvent<'_>),
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(Store, Origin), CacheError> {
        let is_zarr = |path: &Path| is_store(path) || path.extension().is_some_and(|e| e == "zarr");
        let sources = match sources {
            [path] if is_zarr(path) => return Ok((Store::open(path)?, Origin::Store)),
            [path] => vec![path.clone()],
            several => {
                if let Some(store) = several.iter().find(|path| is_zarr(path)) {
                    let problem = "is a store: it cannot be joined with other files to a series";
                    return Err(FileError::unsupported(store, "", problem).remedy("open it alone").into());
                }
                distinct(several)
            }
        };
        let folder = self.folder.as_ref().ok_or(CacheError::NoFolder)?;
        let target = folder.join(entry_name(&sources)?);
        if let Some(store) = open_entry(&target) {
            return Ok((store, Origin::Cached));
        }
        // Only now: what was imported before need not be read, and a bad source leaves no folder.
        let source = import::open_many(&sources)?;
        check_cancel(cancel)?;
        fs::create_dir_all(folder).map_err(|e| FileError::io(folder, "make the cache folder", &e))?;
        let lock = EntryLock::wait(&target, &mut || announce(CacheEvent::Waiting(&target)), cancel)?;
        if let Some(store) = open_entry(&target) {
            return Ok((store, Origin::Cached));
        }
        if lock.is_exclusive() {
            clear(&target)?;
        }
        announce(CacheEvent::Importing(&target));
        let options = IngestOptions { overwrite: true, ..Default::default() };
        let report = ingest(&*source, &target, &options, progress, cancel)?;
        Ok((Store::open(&target)?, Origin::Imported(Box::new(report))))
    }
}

/// The user's cache folder, as these variables say.
fn folder_from(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let variable = |name: &str| variable(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let system = || if cfg!(windows) { variable("LOCALAPPDATA").map(|d| d.join("tetreel")) } else { None };
    variable("TETREEL_CACHE")
        .or_else(|| variable("XDG_CACHE_HOME").map(|d| d.join("tetreel")))
        .or_else(|| variable("HOME").map(|d| d.join(".cache").join("tetreel")))
        .or_else(system)
}

/// An entry that is whole as far as opening it tells. A damaged one counts as none.
fn open_entry(target: &Path) -> Option<Store> {
    is_store(target).then(|| Store::open(target).ok()).flatten()
}

/// Each path once, sorted.
fn distinct(paths: &[PathBuf]) -> Vec<PathBuf> {
    let mut paths: Vec<(PathBuf, PathBuf)> = paths.iter().map(|path| (canonical(path), path.clone())).collect();
    paths.sort();
    paths.dedup_by(|a, b| a.0 == b.0);
    paths.into_iter().map(|(_, path)| path).collect()
}

fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Bytes of the source's name in that of an entry; file systems allow 255, of which checksum, extension and what temporary
/// folders add take some.
const STEM_BYTES: usize = 180;

/// A name that changes with the version of tetreel, the sources' paths and every change of their files.
fn entry_name(sources: &[PathBuf]) -> FileResult<String> {
    // Bytes: two paths that are no Unicode may look the same as text.
    let mut state = env!("CARGO_PKG_VERSION").as_bytes().to_vec();
    for path in sources {
        state.push(b' ');
        state.extend_from_slice(canonical(path).as_os_str().as_encoded_bytes());
    }
    for file in sources.iter().map(|path| import::files(path)).collect::<FileResult<Vec<_>>>()?.concat() {
        let (size, changed) = fs::metadata(&file).map_or((0, None), |m| (m.len(), m.modified().ok()));
        let nanos = changed.and_then(|t| t.duration_since(UNIX_EPOCH).ok()).map_or(0, |d| d.as_nanos());
        // The same file is the same, wherever it is named from.
        let file = absolute(&file).unwrap_or(file);
        state.push(b'\n');
        state.extend_from_slice(file.as_os_str().as_encoded_bytes());
        state.extend_from_slice(format!(" {size} {nanos}").as_bytes());
    }
    let stem = sources.first().and_then(|path| path.file_stem());
    let stem = stem.map_or_else(|| "source".into(), OsStr::to_string_lossy);
    let stem = &stem[..stem.floor_char_boundary(STEM_BYTES)];
    let more = if sources.len() > 1 { format!("-and-{}-more", sources.len() - 1) } else { String::new() };
    // Two independent checksums: one of the text, one of the text backwards.
    let reversed: Vec<u8> = state.iter().rev().copied().collect();
    Ok(format!("{stem}{more}-{:08x}{:08x}.zarr", crc32c::crc32c(&state), crc32c::crc32c(&reversed)))
}

/// Makes place for an entry: removes what is there and no store, and what killed imports have left.
fn clear(target: &Path) -> FileResult<()> {
    if let Ok(metadata) = fs::symlink_metadata(target)
        && !is_store(target)
    {
        let removed = if metadata.is_dir() { fs::remove_dir_all(target) } else { fs::remove_file(target) };
        removed.map_err(|e| FileError::io(target, "remove the damaged import", &e))?;
    }
    remove_leftovers(target);
    let Some(folder) = target.parent() else { return Ok(()) };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let other = name.to_str().and_then(|name| name.strip_prefix('.')?.strip_suffix(LOCK));
        if let Some(other) = other.map(|name| folder.join(name))
            && other != target
            && let Some(lock) = EntryLock::try_existing(&other)
        {
            remove_leftovers(&other);
            drop(lock);
        }
    }
    Ok(())
}

/// Removes the temporary folders of an entry that nobody writes.
fn remove_leftovers(target: &Path) {
    let (Some(folder), Some(name)) = (target.parent(), target.file_name().and_then(OsStr::to_str)) else { return };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_left = |left: &str| {
            let rest = left.strip_prefix('.').and_then(|left| left.strip_prefix(name));
            rest.is_some_and(|rest| rest.starts_with(".tmp-") || rest.starts_with(".old-"))
        };
        if entry.file_name().to_str().is_some_and(is_left) {
            // What cannot be removed is in nobody's way.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// End of the name of a lock's file.
const LOCK: &str = ".lock";

/// How long to wait before another look at a lock that somebody else holds.
const PAUSE: Duration = Duration::from_millis(20);

/// The right to write an entry. It ends with the value, and with the process however that ends.
struct EntryLock {
    path: PathBuf,
    /// None on file systems without locks: there, two may import the same; the one that ends last replaces the other's.
    file: Option<File>,
}

impl EntryLock {
    fn path_for(target: &Path) -> PathBuf {
        let mut name = OsString::from(".");
        name.push(target.file_name().unwrap_or_default());
        name.push(LOCK);
        target.with_file_name(name)
    }

    /// Waits until nobody else has it; says so once.
    fn wait(target: &Path, waiting: &mut dyn FnMut(), cancel: &Cancel) -> Result<Self, CacheError> {
        let path = Self::path_for(target);
        let mut is_said = false;
        loop {
            check_cancel(cancel)?;
            let open = File::options().write(true).create(true).truncate(false).open(&path);
            let file = open.map_err(|e| FileError::io(&path, "write in the cache folder", &e))?;
            match file.try_lock() {
                // Who had it before has removed the file: the lock of a file without a name says nothing.
                Ok(()) if is_at(&file, &path) => return Ok(Self { path, file: Some(file) }),
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    if !is_said {
                        waiting();
                        is_said = true;
                    }
                    std::thread::sleep(PAUSE);
                }
                Err(TryLockError::Error(_)) => return Ok(Self { path, file: None }),
            }
        }
    }

    /// That of an entry which somebody has written at some time, if nobody does so now.
    fn try_existing(target: &Path) -> Option<Self> {
        let path = Self::path_for(target);
        let file = File::options().write(true).open(&path).ok()?;
        // Not made unless it is held: its end removes the file.
        (file.try_lock().is_ok() && is_at(&file, &path)).then(|| Self { path, file: Some(file) })
    }

    fn is_exclusive(&self) -> bool {
        self.file.is_some()
    }
}

impl Drop for EntryLock {
    fn drop(&mut self) {
        // While it is held. Where it cannot be told whether a file still has its name, the empty file stays.
        if cfg!(unix) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Whether a file is still the one of this name.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |metadata: fs::Metadata| (metadata.dev(), metadata.ino());
    let (file, named) = (file.metadata().map(id), fs::symlink_metadata(path).map(id));
    matches!((file, named), (Ok(file), Ok(named)) if file == named)
}

#[cfg(not(unix))]
fn is_at(_file: &File, _path: &Path) -> bool {
    true
}

#[cfg(test)]
#[path = "cached_tests.rs"]
mod tests;

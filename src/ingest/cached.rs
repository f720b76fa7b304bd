//! Opening a source as if it were a store: it is imported to a cache first.
//!
//! The cache is a folder of stores. The name of an entry has a checksum of tetreel's version, the source's path, and path, size and
//! modification time of all its files: it is valid until one of these changes. An import of an entry holds a lock on the file `.NAME.lock`
//! beside it; another process that wants the same entry waits for it. A failed or cancelled import leaves no files, and those of a killed
//! one are removed by the next import that finds its lock free.

use super::options::IngestOptions;
use super::report::{IngestError, IngestReport};
use super::{ReadMesh, check_cancel, ingest_and_tell};
use crate::error::{FileError, FileResult};
use crate::import;
use crate::store::{Store, is_at, is_store, store_version};
use crate::task::{Cancel, Progress};
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf, absolute};
use std::time::{Duration, UNIX_EPOCH};

/// The folder of imported sources.
#[derive(Clone, Debug)]
pub struct ImportCache {
    folder: Option<PathBuf>,
}

/// Where an opened store came from.
#[derive(Debug)]
pub enum Origin {
    /// The named path is a store.
    Store,
    /// An earlier import was found in the cache.
    Cached,
    /// The source was imported now.
    Imported(Box<IngestReport>),
}

/// A lengthy operation that begins now, for a message, or what is known so far.
#[derive(Clone, Copy)]
pub enum CacheEvent<'a> {
    /// Waiting for another process that imports the same source to this store.
    Waiting(&'a Path),
    /// Importing to this store.
    Importing(&'a Path),
    /// The points and cells of the source that is imported were read.
    Read(ReadMesh<'a>),
}

/// Why no store was opened.
#[derive(Debug, thiserror::Error)]
pub enum CacheError {
    /// No environment variable gives a folder for the cache.
    #[error("no place for the cache of imported files; set TETREEL_CACHE to a folder, or import to a store first")]
    NoFolder,
    /// The store or the source cannot be opened, or the cache cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The import failed, or was cancelled.
    #[error(transparent)]
    Import(#[from] IngestError),
}

impl CacheError {
    /// Whether the operation was cancelled.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Import(IngestError::Cancelled))
    }
}

impl ImportCache {
    /// The user's cache: `$TETREEL_CACHE`, else `$XDG_CACHE_HOME/tetreel`, else `~/.cache/tetreel` (on Windows `%LOCALAPPDATA%\tetreel`). A
    /// missing one is an error only when it is needed.
    pub fn of_user() -> Self {
        Self { folder: folder_from(|name| std::env::var_os(name)) }
    }

    /// A cache in this folder, which is created when it is needed.
    pub fn at(folder: impl Into<PathBuf>) -> Self {
        Self { folder: Some(folder.into()) }
    }

    /// Opens a store, or imports a source to the cache (unless it is there) and opens that. Several sources become one series as by
    /// [`import::open_many`]. `announce` is called before lengthy operations.
    ///
    /// # Errors
    /// If there is no such store or source, it cannot be read or imported, there is no folder for the cache, or `cancel` was raised. The
    /// error for an unknown format lists the readable ones.
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
        // Opened only now: a cached source need not be read, and a bad one leaves no folder.
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
        let mut read = |mesh: ReadMesh<'_>| announce(CacheEvent::Read(mesh));
        let report = ingest_and_tell(&*source, &target, &options, progress, cancel, &mut read)?;
        Ok((Store::open(&target)?, Origin::Imported(Box::new(report))))
    }
}

/// The user's cache folder from the environment.
fn folder_from(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let variable = |name: &str| variable(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let system = || if cfg!(windows) { variable("LOCALAPPDATA").map(|d| d.join("tetreel")) } else { None };
    variable("TETREEL_CACHE")
        .or_else(|| variable("XDG_CACHE_HOME").map(|d| d.join("tetreel")))
        .or_else(|| variable("HOME").map(|d| d.join(".cache").join("tetreel")))
        .or_else(system)
}

/// The entry if it opens; a damaged one counts as missing.
fn open_entry(target: &Path) -> Option<Store> {
    is_store(target).then(|| Store::open(target).ok()).flatten()
}

/// The distinct paths, sorted.
fn distinct(paths: &[PathBuf]) -> Vec<PathBuf> {
    let mut paths: Vec<(PathBuf, PathBuf)> = paths.iter().map(|path| (canonical(path), path.clone())).collect();
    paths.sort();
    paths.dedup_by(|a, b| a.0 == b.0);
    paths.into_iter().map(|(_, path)| path).collect()
}

fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Bytes of an entry's name for the source's name; file systems allow 255, which checksum, extension and names of temporary folders share.
const STEM_BYTES: usize = 180;

/// Entry name, which changes with the versions of tetreel and of stores, the sources' paths and every change of their files.
fn entry_name(sources: &[PathBuf]) -> FileResult<String> {
    // Raw bytes: two paths that are not Unicode may be equal as text.
    let mut state = [env!("CARGO_PKG_VERSION"), " ", &store_version()].concat().into_bytes();
    for path in sources {
        state.push(b' ');
        state.extend_from_slice(canonical(path).as_os_str().as_encoded_bytes());
    }
    for file in sources.iter().map(|path| import::files(path)).collect::<FileResult<Vec<_>>>()?.concat() {
        let (size, changed) = fs::metadata(&file).map_or((0, None), |m| (m.len(), m.modified().ok()));
        let nanos = changed.and_then(|t| t.duration_since(UNIX_EPOCH).ok()).map_or(0, |d| d.as_nanos());
        // Absolute, so that a file has one name from every working folder.
        let file = absolute(&file).unwrap_or(file);
        state.push(b'\n');
        state.extend_from_slice(file.as_os_str().as_encoded_bytes());
        state.extend_from_slice(format!(" {size} {nanos}").as_bytes());
    }
    let stem = sources.first().and_then(|path| path.file_stem());
    let stem = stem.map_or_else(|| "source".into(), OsStr::to_string_lossy);
    let stem = &stem[..stem.floor_char_boundary(STEM_BYTES)];
    let more = if sources.len() > 1 { format!("-and-{}-more", sources.len() - 1) } else { String::new() };
    // Two independent checksums: of the bytes forwards and backwards.
    let reversed: Vec<u8> = state.iter().rev().copied().collect();
    Ok(format!("{stem}{more}-{:08x}{:08x}.zarr", crc32c::crc32c(&state), crc32c::crc32c(&reversed)))
}

/// Clears an entry's path: removes whatever is not a store, and the remains of killed imports.
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

/// Removes the temporary folders of an entry that is not being written.
fn remove_leftovers(target: &Path) {
    let (Some(folder), Some(name)) = (target.parent(), target.file_name().and_then(OsStr::to_str)) else { return };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_left = |left: &str| {
            let rest = left.strip_prefix('.').and_then(|left| left.strip_prefix(name));
            rest.is_some_and(|rest| rest.starts_with(".tmp-") || rest.starts_with(".old-"))
        };
        if entry.file_name().to_str().is_some_and(is_left) {
            // A folder that cannot be removed does no harm.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// Suffix of a lock file's name.
const LOCK: &str = ".lock";

/// Pause between two attempts to take a lock.
const PAUSE: Duration = Duration::from_millis(20);

/// Exclusive right to write an entry. It ends with the value, and with the process however that ends.
struct EntryLock {
    path: PathBuf,
    /// `None` on file systems without locks: two processes may then import the same; the last to finish replaces the other's.
    file: Option<File>,
}

impl EntryLock {
    fn path_for(target: &Path) -> PathBuf {
        let mut name = OsString::from(".");
        name.push(target.file_name().unwrap_or_default());
        name.push(LOCK);
        target.with_file_name(name)
    }

    /// Waits for the lock; calls `waiting` once if it has to.
    fn wait(target: &Path, waiting: &mut dyn FnMut(), cancel: &Cancel) -> Result<Self, CacheError> {
        let path = Self::path_for(target);
        let mut is_said = false;
        loop {
            check_cancel(cancel)?;
            let open = File::options().write(true).create(true).truncate(false).open(&path);
            let file = open.map_err(|e| FileError::io(&path, "write in the cache folder", &e))?;
            match file.try_lock() {
                // The last holder has removed the file: the lock of an unlinked file is void.
                Ok(()) if is_at(&file, fs::symlink_metadata(&path)) => return Ok(Self { path, file: Some(file) }),
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

    /// Lock of an entry whose lock file exists, if it is free.
    fn try_existing(target: &Path) -> Option<Self> {
        let path = Self::path_for(target);
        let file = File::options().write(true).open(&path).ok()?;
        // `Self` only if the lock is held: dropping it removes the file.
        (file.try_lock().is_ok() && is_at(&file, fs::symlink_metadata(&path))).then(|| Self { path, file: Some(file) })
    }

    fn is_exclusive(&self) -> bool {
        self.file.is_some()
    }
}

impl Drop for EntryLock {
    fn drop(&mut self) {
        // Removed while still locked. On systems that cannot tell whether a file still has its name, the empty file stays.
        if cfg!(unix) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
#[path = "cached_tests.rs"]
mod tests;

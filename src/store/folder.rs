//! A folder as source and sink of chunks.

use crate::codec::{ChunkSink, ReadRange, seal};
use crate::error::{FileError, FileResult};
use crate::files;
use crate::slowdown::{Slow, waste};
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Tells whether what lies in a store's place is still the series that was opened.
pub(super) trait SameSeries: Debug + Send + Sync {
    /// Whether the store is still in the state in which the series was last found, so that a file just opened belongs to it. `false` if
    /// it has changed but continues this series: the file may be from any state between, so open it again.
    ///
    /// # Errors
    /// If it has become another series.
    fn is_unchanged(&self, root: &Path) -> FileResult<bool>;
}

/// Source of chunks whose keys are paths of files below a folder.
#[derive(Clone, Debug)]
pub(super) struct Folder {
    root: PathBuf,
    pinned: Pinned,
    /// The series that the files must belong to; `None`: any.
    series: Option<Arc<dyn SameSeries>>,
}

impl Folder {
    pub(super) fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into(), pinned: Pinned::default(), series: None }
    }

    /// The folder of a store; reads fail once another series has taken its place.
    pub(super) fn of_series(root: impl Into<PathBuf>, series: Arc<dyn SameSeries>) -> Self {
        Self { series: Some(series), ..Self::new(root) }
    }

    /// Whether a file just found belongs to the series; if not, looking again may find the one that does.
    fn is_of_series(&self) -> FileResult<bool> {
        self.series.as_ref().map_or(Ok(true), |series| series.is_unchanged(&self.root))
    }

    /// Fails if another series has taken the place of the one that was opened.
    pub(super) fn check(&self) -> FileResult<()> {
        self.is_of_series().map(drop)
    }

    /// Freezes these objects: reads give the files, or their absence, of now, whatever takes their place.
    ///
    /// Does nothing on systems other than Unix: there, a folder with open files cannot be moved.
    pub(super) fn pin(&mut self, keys: Vec<String>) -> FileResult<()> {
        if cfg!(unix) {
            for key in keys {
                files::check_kind(&self.path(&key))?;
                let file = match File::open(self.path(&key)) {
                    Ok(file) => Some(Arc::new(file)),
                    Err(e) if e.kind() == ErrorKind::NotFound => None,
                    Err(e) => return Err(FileError::io(self.path(&key), "open", &e)),
                };
                self.pinned.insert(key, file);
            }
        }
        Ok(())
    }

    /// Applies `act` to a file of the series, again if the store was exchanged meanwhile.
    fn find<T>(&self, act: impl Fn() -> io::Result<T>) -> FileResult<io::Result<T>> {
        for _ in 0..EXCHANGE_LOOKS {
            let result = self.look(&act);
            if self.is_of_series()? {
                return Ok(result);
            }
        }
        let error = FileError::invalid(&self.root, "", "changes all the time, so that nothing can be read");
        Err(error.remedy("try again when fewer steps are added"))
    }

    /// Applies `act` to a file. A store that is exchanged in two moves is briefly absent: if file and store are both missing, tries again.
    fn look<T>(&self, act: &impl Fn() -> io::Result<T>) -> io::Result<T> {
        for _ in 0..EXCHANGE_LOOKS {
            match act() {
                Err(e) if e.kind() == ErrorKind::NotFound => {}
                result => return result,
            }
            if self.root.join("zarr.json").exists() {
                break;
            }
            std::thread::sleep(EXCHANGE_PAUSE);
        }
        // The store may have come back between the two looks.
        act()
    }
}

/// Files that are held open; `None` for one that did not exist.
type Pinned = BTreeMap<String, Option<Arc<File>>>;

/// Attempts, and the pause between them, to find a store that has just vanished.
pub(super) const EXCHANGE_LOOKS: u32 = 50;
pub(super) const EXCHANGE_PAUSE: Duration = Duration::from_millis(5);

/// Reads from an offset of a file that several threads may share.
#[cfg(unix)]
fn read_at(file: &File, offset: u64, part: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, part, offset)
}

/// No file is pinned on systems other than Unix.
#[cfg(not(unix))]
fn read_at(mut file: &File, offset: u64, part: &mut [u8]) -> io::Result<()> {
    use std::io::{Read, Seek, SeekFrom};
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(part)
}

/// Removes a file that is about to be written: it may be a hard link shared with an older store, which must not change.
pub(super) fn unlink(path: &Path) -> FileResult<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(FileError::io(path, "replace", &e)),
        _ => Ok(()),
    }
}

impl ReadRange for Folder {
    fn size(&self, key: &str) -> FileResult<u64> {
        let path = self.path(key);
        let metadata = match self.pinned.get(key) {
            Some(Some(file)) => file.metadata(),
            Some(None) => Err(ErrorKind::NotFound.into()),
            None => self.find(|| fs::metadata(&path))?,
        };
        match metadata {
            Ok(metadata) if metadata.is_file() => Ok(metadata.len()),
            Ok(_) => Err(FileError::invalid(path, "", "is not a file")),
            Err(e) if e.kind() == ErrorKind::NotFound => {
                let remedy = "restore the file from a copy, or import the series again";
                Err(FileError::invalid(path, "", "is missing").remedy(remedy))
            }
            Err(e) => Err(FileError::io(path, "open", &e)),
        }
    }

    fn exists(&self, key: &str) -> FileResult<bool> {
        let path = self.path(key);
        if let Some(pinned) = self.pinned.get(key) {
            return Ok(pinned.is_some());
        }
        match self.find(|| fs::metadata(&path))? {
            Ok(_) => Ok(true),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(false),
            Err(e) => Err(FileError::io(path, "open", &e)),
        }
    }

    fn read(&self, key: &str, offset: u64, parts: &mut [&mut [u8]]) -> FileResult<()> {
        self.read_while(key, offset, parts, &mut |_| true).map(|_| ())
    }

    fn read_while(
        &self,
        key: &str,
        mut offset: u64,
        parts: &mut [&mut [u8]],
        filled: &mut dyn FnMut(&[u8]) -> bool,
    ) -> FileResult<bool> {
        waste(Slow::StoreChunk, 1);
        let path = self.path(key);
        let file = match self.pinned.get(key) {
            Some(Some(file)) => Ok(file.clone()),
            Some(None) => Err(ErrorKind::NotFound.into()),
            None => self.find(|| File::open(&path))?.map(Arc::new),
        };
        let file = file.map_err(|e| FileError::io(&path, "open", &e))?;
        for part in parts {
            read_at(&file, offset, part).map_err(|e| FileError::io(&path, "read", &e))?;
            offset += part.len() as u64;
            if !filled(part) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn path(&self, key: &str) -> PathBuf {
        self.root.join(key)
    }
}

/// Writes the chunks of one group and counts their bytes.
#[derive(Debug)]
pub(super) struct FolderSink {
    root: PathBuf,
    pub(super) bytes: u64,
}

impl FolderSink {
    pub(super) fn new(root: PathBuf) -> Self {
        Self { root, bytes: 0 }
    }
}

impl ChunkSink for FolderSink {
    fn put(&mut self, key: &str, payload: &[u8]) -> FileResult<()> {
        waste(Slow::StoreChunk, 1);
        let path = self.root.join(key);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(|e| FileError::io(parent, "create", &e))?;
        }
        unlink(&path)?;
        let checksum = seal(payload);
        let write = |mut file: File| file.write_all(payload).and_then(|()| file.write_all(&checksum));
        File::create(&path).and_then(write).map_err(|e| FileError::io(&path, "write", &e))?;
        self.bytes += (payload.len() + checksum.len()) as u64;
        Ok(())
    }
}

/// Calls `visit` for every file and folder below `root`, in the order of their names, folders after what they hold.
pub(super) fn walk(root: &Path, visit: &mut dyn FnMut(&Path, &fs::Metadata) -> FileResult<()>) -> FileResult<()> {
    let list = |e| FileError::io(root, "list", &e);
    let mut entries: Vec<PathBuf> =
        fs::read_dir(root).map_err(list)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>().map_err(list)?;
    entries.sort();
    for path in entries {
        // Links are not followed: a store has none, and a cycle would never end.
        let metadata = fs::symlink_metadata(&path).map_err(|e| FileError::io(&path, "open", &e))?;
        if metadata.is_dir() {
            walk(&path, visit)?;
        }
        visit(&path, &metadata)?;
    }
    Ok(())
}

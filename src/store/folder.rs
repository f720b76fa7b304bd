//! A folder as source and sink of chunks.

use crate::codec::{ChunkSink, ReadRange, seal};
use crate::error::{FileError, FileResult};
use std::fs::{self, File};
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Objects are the files below a folder.
#[derive(Clone, Debug)]
pub(super) struct Folder {
    root: PathBuf,
}

impl Folder {
    pub(super) fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }
}

impl ReadRange for Folder {
    fn size(&self, key: &str) -> FileResult<u64> {
        let path = self.path(key);
        match fs::metadata(&path) {
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
        path.try_exists().map_err(|e| FileError::io(path, "open", &e))
    }

    fn read(&self, key: &str, offset: u64, parts: &mut [&mut [u8]]) -> FileResult<()> {
        self.read_while(key, offset, parts, &mut |_| true).map(|_| ())
    }

    fn read_while(
        &self,
        key: &str,
        offset: u64,
        parts: &mut [&mut [u8]],
        filled: &mut dyn FnMut(&[u8]) -> bool,
    ) -> FileResult<bool> {
        let path = self.path(key);
        let mut file = File::open(&path).map_err(|e| FileError::io(&path, "open", &e))?;
        if offset > 0 {
            file.seek(SeekFrom::Start(offset)).map_err(|e| FileError::io(&path, "read", &e))?;
        }
        for part in parts {
            file.read_exact(part).map_err(|e| FileError::io(&path, "read", &e))?;
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
        let path = self.root.join(key);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(|e| FileError::io(parent, "create", &e))?;
        }
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
        // Links are not followed: a store has none, and a loop of them has no end.
        let metadata = fs::symlink_metadata(&path).map_err(|e| FileError::io(&path, "open", &e))?;
        if metadata.is_dir() {
            walk(&path, visit)?;
        }
        visit(&path, &metadata)?;
    }
    Ok(())
}

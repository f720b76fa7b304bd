//! The metadata of groups and arrays as files.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use zarrs::storage::byte_range::{ByteRangeIterator, extract_byte_ranges};
use zarrs::storage::{
    Bytes, MaybeBytes, MaybeBytesIterator, OffsetBytesIterator, ReadableStorageTraits, StorageError, StoreKey,
    StorePrefix, WritableStorageTraits,
};

/// The folder of a store, for zarrs, of which only metadata are asked. That of zarrs itself refuses folders whose path is no
/// Unicode, and waits for the medium after each file.
#[derive(Debug)]
pub(super) struct MetadataFolder {
    root: PathBuf,
}

impl MetadataFolder {
    pub(super) fn new(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    fn path(&self, key: &StoreKey) -> PathBuf {
        self.root.join(key.as_str())
    }
}

fn not_metadata<T>() -> Result<T, StorageError> {
    Err(StorageError::Unsupported("only whole metadata are read and written".to_owned()))
}

impl ReadableStorageTraits for MetadataFolder {
    fn get(&self, key: &StoreKey) -> Result<MaybeBytes, StorageError> {
        match fs::read(self.path(key)) {
            Ok(bytes) => Ok(Some(bytes.into())),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            Err(e) => Err(e.into()),
        }
    }

    fn get_partial_many<'a>(
        &'a self,
        key: &StoreKey,
        byte_ranges: ByteRangeIterator<'a>,
    ) -> Result<MaybeBytesIterator<'a>, StorageError> {
        let Some(bytes) = self.get(key)? else { return Ok(None) };
        let parts = extract_byte_ranges(&bytes, byte_ranges)?;
        Ok(Some(Box::new(parts.into_iter().map(|part| Ok(part.into())))))
    }

    fn size_key(&self, key: &StoreKey) -> Result<Option<u64>, StorageError> {
        Ok(self.get(key)?.map(|bytes| bytes.len() as u64))
    }

    fn supports_get_partial(&self) -> bool {
        false
    }
}

impl WritableStorageTraits for MetadataFolder {
    fn set(&self, key: &StoreKey, value: Bytes) -> Result<(), StorageError> {
        let path = self.path(key);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)?;
        }
        Ok(fs::write(path, value)?)
    }

    fn set_partial_many(&self, _key: &StoreKey, _values: OffsetBytesIterator<'_>) -> Result<(), StorageError> {
        not_metadata()
    }

    fn erase(&self, _key: &StoreKey) -> Result<(), StorageError> {
        not_metadata()
    }

    fn erase_prefix(&self, _prefix: &StorePrefix) -> Result<(), StorageError> {
        not_metadata()
    }

    fn supports_set_partial(&self) -> bool {
        false
    }
}

//! In-memory objects for the tests of codecs: a sink and a source.

use super::{ChunkSink, ReadRange, seal};
use crate::error::{FileError, FileResult};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Chunks by name, all in a group `f`.
#[derive(Clone, Default, PartialEq)]
pub(super) struct Objects(pub(super) BTreeMap<String, Vec<u8>>);

impl ChunkSink for Objects {
    fn put(&mut self, key: &str, payload: &[u8]) -> FileResult<()> {
        let bytes = [payload, &seal(payload)].concat();
        assert!(self.0.insert(format!("f/{key}"), bytes).is_none(), "{key} is written once");
        Ok(())
    }
}

impl ReadRange for Objects {
    fn size(&self, key: &str) -> FileResult<u64> {
        let missing = || FileError::invalid(self.path(key), "", "is missing");
        self.0.get(key).map(|b| b.len() as u64).ok_or_else(missing)
    }

    fn exists(&self, key: &str) -> FileResult<bool> {
        Ok(self.0.contains_key(key))
    }

    fn read(&self, key: &str, offset: u64, parts: &mut [&mut [u8]]) -> FileResult<()> {
        let mut rest = &self.0[key][usize::try_from(offset).unwrap()..];
        for part in parts {
            let (head, tail) = rest.split_at(part.len());
            part.copy_from_slice(head);
            rest = tail;
        }
        Ok(())
    }

    fn path(&self, key: &str) -> PathBuf {
        PathBuf::from(key)
    }
}

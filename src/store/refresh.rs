//! A store that has grown since it was opened.

use super::Store;
use super::field::StoredField;
use super::folder::{EXCHANGE_LOOKS, EXCHANGE_PAUSE};
use super::layout::MESH;
use crate::codec::{ReadRange, chunk_key};
use crate::error::{FileError, FileResult};
use std::fs;
use std::path::Path;
use std::time::SystemTime;

/// What tells one state of a store from the next: the metadata of its root, which every append and every import write anew,
/// when that was, and which file it is (0 where that has no number). `None` while there is no store.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stamp(Option<(Vec<u8>, Option<SystemTime>, u64)>);

impl Stamp {
    pub(super) fn of(root: &Path) -> Self {
        let path = root.join("zarr.json");
        let metadata = fs::metadata(&path).ok();
        let modified = metadata.as_ref().and_then(|m| m.modified().ok());
        #[cfg(unix)]
        let number = metadata.as_ref().map_or(0, std::os::unix::fs::MetadataExt::ino);
        #[cfg(not(unix))]
        let number = 0;
        Self(fs::read(&path).ok().map(|text| (text, modified, number)))
    }
}

/// Opens a store of which nothing changes meanwhile: if it is exchanged for a newer one, tries again.
pub(super) fn at_rest<T>(root: &Path, open: impl Fn(&Path, Stamp) -> FileResult<T>) -> FileResult<T> {
    let mut stamp = Stamp::of(root);
    for _ in 0..EXCHANGE_LOOKS {
        let opened = open(root, stamp.clone());
        let now = Stamp::of(root);
        if now == stamp {
            return opened;
        }
        if now.0.is_none() {
            std::thread::sleep(EXCHANGE_PAUSE);
        }
        stamp = now;
    }
    open(root, stamp)
}

/// The checksums of the chunks that make up the mesh; whatever has the same is the same mesh.
pub(super) fn mesh_checksums(source: &dyn ReadRange) -> Vec<Option<[u8; 4]>> {
    let checksum = |(name, rank): (&str, usize)| {
        let key = chunk_key(&format!("{MESH}/{name}"), 0, rank);
        let mut bytes = [0; 4];
        let offset = source.size(&key).ok()?.checked_sub(bytes.len() as u64)?;
        source.read(&key, offset, &mut [&mut bytes]).ok()?;
        Some(bytes)
    };
    [("points", 2), ("tets", 2), ("vertex_permutation", 1), ("cell_permutation", 1)].map(checksum).to_vec()
}

impl Store {
    /// The store as it is now if steps were added since it was opened; `None`, after a look at one small file, if nothing has
    /// changed. This store and its readers stay as they are: they go on with the steps that they know.
    ///
    /// # Errors
    /// If it is no longer the same series (another mesh, other fields, other times or fewer of them), or cannot be opened.
    pub fn refreshed(&self) -> FileResult<Option<Self>> {
        for _ in 0..EXCHANGE_LOOKS {
            let stamp = Stamp::of(&self.root);
            if stamp == self.stamp {
                return Ok(None);
            }
            if stamp.0.is_some() {
                break;
            }
            // Where two stores cannot change places at once, there is none for a moment.
            std::thread::sleep(EXCHANGE_PAUSE);
        }
        let new = Self::open(&self.root)?;
        self.check_continued_by(&new)?;
        Ok(Some(new))
    }

    fn check_continued_by(&self, new: &Self) -> FileResult<()> {
        let other = |what: &str| {
            let problem = format!("is no longer the series that was opened: it has {what}");
            Err(FileError::invalid(&self.root, "", problem).remedy("open it again"))
        };
        let counts = |store: &Self| (store.mesh.vertices, store.mesh.cells, store.mesh.attributes.bounds);
        if counts(self) != counts(new) || self.mesh_checksums != new.mesh_checksums {
            return other("another mesh");
        }
        let identity = |f: &StoredField| (f.name.clone(), f.folder.clone(), f.codec.clone(), f.association);
        if !self.fields.iter().map(identity).eq(new.fields.iter().map(identity)) {
            return other("other fields");
        }
        let (before, now) = (&self.times.values, &new.times.values);
        if now.len() < before.len() {
            return other("fewer steps");
        }
        if before.iter().zip(now).any(|(a, b)| a.to_bits() != b.to_bits()) {
            return other("other times");
        }
        Ok(())
    }
}

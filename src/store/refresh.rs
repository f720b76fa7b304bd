//! Detects that an opened store has grown, or has become another one.
//!
//! A reader checks after opening a file whether the store was exchanged. If so, mesh, times, codec and a checksum of each step's values
//! tell whether it is still the opened series: the reader goes on, or stops with an error.

use super::field::StoredField;
use super::folder::{EXCHANGE_LOOKS, EXCHANGE_PAUSE, Folder, SameSeries};
use super::layout::MESH;
use super::mesh::StoredMesh;
use super::{Store, open_fields, read_times};
use crate::codec::{ReadRange, chunk_key};
use crate::error::{FileError, FileResult};
use crate::field::TimeAxis;
use std::fs;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

/// State of a store: the metadata of its root, which every append and every import write anew, and the identity of that file. `None` while
/// there is no store.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stamp(Option<(Vec<u8>, FileId)>);

/// Identity of a file: modification time, length and inode number (0 where it has none).
#[derive(Clone, Copy, Debug, PartialEq)]
struct FileId {
    modified: Option<SystemTime>,
    bytes: u64,
    number: u64,
}

impl FileId {
    /// The identity of a store's root metadata; `None` while there is no store.
    fn of(root: &Path) -> Option<Self> {
        let metadata = fs::metadata(root.join("zarr.json")).ok().filter(fs::Metadata::is_file)?;
        #[cfg(unix)]
        let number = std::os::unix::fs::MetadataExt::ino(&metadata);
        #[cfg(not(unix))]
        let number = 0;
        Some(Self { modified: metadata.modified().ok(), bytes: metadata.len(), number })
    }
}

impl Stamp {
    pub(super) fn of(root: &Path) -> Self {
        let id = FileId::of(root);
        let text = id.and_then(|_| fs::read(root.join("zarr.json")).ok());
        Self(text.zip(id))
    }

    fn id(&self) -> Option<FileId> {
        self.0.as_ref().map(|(_, id)| *id)
    }
}

/// Opens a store in one consistent state: retries if it is exchanged for a newer one meanwhile.
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

/// Checksums of the mesh's chunks; equal ones mean the same mesh.
fn mesh_checksums(source: &dyn ReadRange) -> Vec<Option<[u8; 4]>> {
    let checksum = |(name, rank): (&str, usize)| {
        let key = chunk_key(&format!("{MESH}/{name}"), 0, rank);
        let mut bytes = [0; 4];
        let offset = source.size(&key).ok()?.checked_sub(bytes.len() as u64)?;
        source.read(&key, offset, &mut [&mut bytes]).ok()?;
        Some(bytes)
    };
    [("points", 2), ("tets", 2), ("vertex_permutation", 1), ("cell_permutation", 1)].map(checksum).to_vec()
}

/// The series of a store when it was opened, to check the store that is in its place now.
#[derive(Debug)]
pub(super) struct OpenedSeries {
    pub(super) mesh: StoredMesh,
    mesh_checksums: Vec<Option<[u8; 4]>>,
    pub(super) times: TimeAxis,
    pub(super) fields: Vec<StoredField>,
    /// The state of the store in which this series was last found.
    found_in: Mutex<Option<FileId>>,
}

impl SameSeries for OpenedSeries {
    fn is_unchanged(&self, root: &Path) -> FileResult<bool> {
        let mut found_in = self.found_in.lock().unwrap_or_else(PoisonError::into_inner);
        let now = FileId::of(root);
        // While there is no store, nothing of another one can have been found.
        if now.is_none() || now == *found_in {
            return Ok(true);
        }
        let new = Store::open(root)?;
        self.check_continued_by(&new)?;
        if self.fields.iter().any(|field| field.checksums.is_none()) {
            return Err(Self::is_not(root, "values that an older version has written, which may be others"));
        }
        *found_in = new.stamp.id();
        Ok(false)
    }
}

impl OpenedSeries {
    /// The series of the store at `root`, which is in the state `stamp`.
    pub(super) fn open(root: &Path, stamp: &Stamp) -> FileResult<Self> {
        let source = Folder::new(root);
        let mesh = StoredMesh::open(root, &source)?;
        let times = read_times(root, &source)?;
        let fields = open_fields(root, &source, times.len() as u64, &mesh)?;
        let mesh_checksums = mesh_checksums(&source);
        Ok(Self { mesh, mesh_checksums, times, fields, found_in: Mutex::new(stamp.id()) })
    }

    fn is_not(root: &Path, what: &str) -> FileError {
        let problem = format!("is no longer the series that was opened: it has {what}");
        FileError::invalid(root, "", problem).remedy("open it again")
    }

    fn check_continued_by(&self, store: &Store) -> FileResult<()> {
        let other = |what: &str| Err(Self::is_not(&store.root, what));
        let new = &store.series;
        let counts = |series: &Self| (series.mesh.vertices, series.mesh.cells, series.mesh.attributes.bounds);
        if counts(self) != counts(new) || self.mesh_checksums != new.mesh_checksums {
            return other("another mesh");
        }
        let identity = |f: &StoredField| {
            let codec = (f.codec.clone(), f.coding().and_then(|coding| coding.choice()));
            (f.name.clone(), f.folder.clone(), codec, f.association, f.values_of)
        };
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
        let goes_on = |(old, new): (&StoredField, &StoredField)| match (&old.checksums, &new.checksums) {
            (Some(old), Some(new)) => new.starts_with(old),
            // One of the two is from an older version.
            _ => true,
        };
        if self.fields.iter().zip(&new.fields).all(goes_on) { Ok(()) } else { other("other values") }
    }
}

impl Store {
    /// The store as it is now if steps were added since it was opened; `None` if it is unchanged, which reading one small file tells. This
    /// store and its readers keep their steps.
    ///
    /// # Errors
    /// If it is no longer the same series (another mesh, other fields, other values, other times or fewer of them), or cannot be opened.
    pub fn refreshed(&self) -> FileResult<Option<Self>> {
        for _ in 0..EXCHANGE_LOOKS {
            let stamp = Stamp::of(&self.root);
            if stamp == self.stamp {
                return Ok(None);
            }
            if stamp.0.is_some() {
                break;
            }
            // Without an atomic exchange, the store is briefly absent.
            std::thread::sleep(EXCHANGE_PAUSE);
        }
        let new = Self::open(&self.root)?;
        self.series.check_continued_by(&new)?;
        Ok(Some(new))
    }
}

//! The dataset on disk: a Zarr v3 group that any Zarr reader opens.
//!
//! | group | arrays |
//! |---|---|
//! | `mesh/0` | `points` (local f32, with origin and scale), `tets`, `vertex_permutation`, `cell_permutation`; `cell_turned` where there are such; `source_points` where `points` does not give them back; `split_cells/types`, `vertices`, `faces`, `sources` where the source has cells that are no tetrahedra, `split_cells/steiner` where some are cut from a vertex in their middle (in `vertex_permutation` such vertices are numbered on from the points of the source); derived: `faces`, `face_cells`, `neighbours` |
//! | `time` | `values` (f64), `mesh_index` |
//! | `fields/FOLDER` | what the codec writes (`raw`: steps x vertices; group `vq`: see [`crate::codec::vq`]), `range_per_step` (NaN where a step has no finite value), `checksum_per_step` (CRC-32C of a step's values as f32, before the codec; not from older versions), `moments` (mean, variance, number of finite samples); with `vq` from 64 steps on `errors_per_step`, `errors_per_vertex` (of complete blocks, to go on from); derived, in the group `histograms`: `scalar`, `scalar_gradient`, `cov`, `scalar_cov` ([`crate::histograms`]; attribute `steps`) |
//! | `cell_fields/FOLDER` | the same for fields of cells, absent if there are none; a value for each cell of the source, in the order in which the mesh has their first parts (`cell_permutation`) |
//! | `functions/vertices` | derived, where it was asked for (`tetreel fit`): `factors`, the widths of functions in place of the cells (see below) |
//! | `lod/FOLDER` | derived: `global` (coefficient of variation of each vertex), `local_N` (N intervals: first step, end, sampled step); attribute `steps` |
//! | `flow/FOLDER` | derived, for fields of vectors whose flow was shown: `travel`, the way that it has travelled, every eight steps ([`StoredTravel`]) |
//!
//! `functions/vertices/factors` is f32 [block, function, 6], one chunk a block, of which there is one: a function at each vertex of the mesh,
//! in their order, about `points`, in the same local units; rows of the lower triangle L of S = L L^T ([`crate::functions`]). Their values are
//! those of any field of vertices. Attributes of the group: `version`, `method` (`vertices`), `form` (`normalised`), `shape` (`ellipsoid`),
//! `phi` (`gaussian`), `cut`, `width`, `count`, `widened`, `report` ([`crate::functions::report`]); others than these are refused. The version of the
//! store stays: programs that do not know the group read all else as it is, and keep the group when they add steps.
//!
//! Codecs are the stock ones: little-endian bytes, then a CRC-32C. The metadata are of zarrs_metadata; the chunks are
//! written, and at playback read, by [`crate::codec`], which verifies sizes and checksums. The folder of a field is its
//! name made safe for any file system; the name itself is an attribute.
//!
//! [`StoreWriter`] writes to a temporary folder and moves the whole store to its target at the end; an interrupted import can go on from a
//! checkpoint beside it ([`StoreWriter::go_on`]); to add steps it begins with links to
//! the files of the existing store ([`StoreWriter::append`]), and [`Store::refreshed`] opens the grown one. [`Store`] reads metadata, times
//! and ranges when it is opened, everything else when it is asked for. Derived arrays carry a version; a missing, damaged or other one is
//! derived again (faces, neighbours) or treated as missing (moments, level of detail, histograms, travel: computed by their users).

mod append;
mod array;
mod blocks;
mod checkpoint;
mod field;
mod folder;
mod functions;
mod histograms;
mod importance;
mod info;
mod layout;
mod lock;
mod mesh;
mod metadata;
mod names;
mod partial;
mod refresh;
mod resume;
mod source_points;
mod split_cells;
mod staging;
mod travel;
mod writer;

pub use append::ResumedField;
pub use blocks::BlockInfo;
pub use checkpoint::{CheckpointReader, CheckpointWriter};
pub use field::{FieldReader, StoredField};
pub use functions::{FunctionsInfo, FunctionsWriter, StoredFunctions};
pub(crate) use info::range_text;
pub use info::{MeshInfo, StoreInfo, TimeInfo, VersionInfo};
pub(crate) use layout::store_version;
pub use layout::{MeanWeights, StoredConnectivity, StoredKind, is_store};
pub use lock::StoreLock;
pub(crate) use lock::is_at;
pub use source_points::SourcePoints;
pub use travel::StoredTravel;
pub use writer::{FieldDescription, FieldWriter, StoreWriter, WrittenField};

use crate::codec::{BlockCache, Chunking, ElementType, ReadRange};
use crate::error::{FileError, FileResult};
use crate::field::{Association, Blocks, Component, FieldSelector, TimeAxis};
use crate::mesh::Mesh;
use array::StoredArray;
use field::Series;
use folder::Folder;
use glam::DVec3;
use layout::{CELL_FIELDS, FieldsAttributes, RootAttributes, TIME, fields_of};
use mesh::StoredMesh;
use refresh::{OpenedSeries, Stamp};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Codec name of a field without values of its own: the norm of other fields.
const MAGNITUDE_CODEC: &str = "magnitude";

/// An opened store. It and its readers keep to the steps of when it was opened, even if it has grown since; when another series has taken
/// its place, they fail.
#[derive(Debug)]
pub struct Store {
    root: PathBuf,
    source: Arc<Folder>,
    attributes: RootAttributes,
    stamp: Stamp,
    series: Arc<OpenedSeries>,
}

impl Store {
    /// Opens a store: reads metadata, times and ranges, and checks that all pieces fit together.
    ///
    /// # Errors
    /// If this is not a store, one of another major version, or a piece is missing, damaged or of the wrong shape.
    pub fn open(path: impl AsRef<Path>) -> FileResult<Self> {
        refresh::at_rest(path.as_ref(), Self::open_at)
    }

    fn open_at(root: &Path, stamp: Stamp) -> FileResult<Self> {
        let attributes = layout::read_root(root)?;
        let series = Arc::new(OpenedSeries::open(root, &stamp)?);
        let source = Arc::new(Folder::of_series(root, series.clone()));
        Ok(Self { root: root.to_owned(), source, attributes, stamp, series })
    }

    /// Folder of the store.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// Times of the steps, bit for bit as in the source.
    pub fn times(&self) -> &TimeAxis {
        &self.series.times
    }

    /// The fields, in the order of the source.
    pub fn fields(&self) -> &[StoredField] {
        &self.series.fields
    }

    /// Reads the mesh. Faces and neighbours that are missing, damaged or of another version are derived again.
    ///
    /// # Errors
    /// If points, cells or permutations are missing or damaged, or do not make a mesh; if another series has taken the store's place.
    pub fn mesh(&self) -> FileResult<Mesh> {
        let mesh = self.series.mesh.read(&self.root, &*self.source)?;
        self.source.check()?;
        Ok(mesh)
    }

    /// The block of the source that each cell of the mesh is from; `None` if the source has no blocks.
    ///
    /// # Errors
    /// If the array is damaged, or another series has taken the store's place.
    pub fn blocks(&self) -> FileResult<Option<Blocks>> {
        let blocks = blocks::read(&self.root, &*self.source, self.series.mesh.cells)?;
        self.source.check()?;
        Ok(blocks)
    }

    /// The source's coordinates of each vertex, where those of the mesh do not give them back bit for bit; `None` where they do, or if an
    /// older version wrote the store. A vertex that was added has those of the mesh.
    ///
    /// # Errors
    /// If the array is damaged, or another series has taken the store's place.
    pub fn source_points(&self) -> FileResult<Option<Vec<DVec3>>> {
        let points = source_points::read(&self.root, &*self.source, self.series.mesh.vertices)?;
        self.source.check()?;
        Ok(points)
    }

    /// The functions that take the place of the cells; `None` if there are none.
    ///
    /// # Errors
    /// If they are of a kind that is not known, or damaged, or another series has taken the store's place.
    pub fn functions(&self) -> FileResult<Option<StoredFunctions>> {
        functions::read(&self.root, &*self.source, self.series.mesh.vertices)
    }

    /// A reader of one field. `NAME` of a vector means `NAME:mag`.
    ///
    /// # Errors
    /// If there is no such field; the error lists the available ones. If steps were added since the store was opened, so that a block of
    /// codec `vq` is coded anew ([`Store::refreshed`] has it).
    pub fn field(&self, selector: &FieldSelector) -> FileResult<FieldReader> {
        self.reader(selector, None)
    }

    /// As [`Store::field`], with the blocks of the reader in `cache`, which other readers may share.
    ///
    /// # Errors
    /// As [`Store::field`].
    pub fn field_with(&self, selector: &FieldSelector, cache: Arc<BlockCache>) -> FileResult<FieldReader> {
        self.reader(selector, Some(cache))
    }

    fn reader(&self, selector: &FieldSelector, cache: Option<Arc<BlockCache>>) -> FileResult<FieldReader> {
        let info = self.find(selector).ok_or_else(|| {
            let names: Vec<&str> = self.fields().iter().map(|f| f.name.as_str()).collect();
            let problem = format!("there is no field '{selector}'; the fields are: {}", names.join(", "));
            FileError::invalid(&self.root, "fields", problem)
        })?;
        // Both lengths were checked against the sizes of files.
        let mesh = &self.series.mesh;
        let count = usize::try_from(mesh.count(info.values_of))
            .map_err(|_| FileError::unsupported(&self.root, "mesh", "has too many values for this machine"))?;
        let parts = match info.values_of {
            Association::Point => None,
            Association::Cell => mesh.parts(&self.root, &*self.source)?.map(Arc::new),
        };
        let components = components_of(self.fields(), info);
        let source = self.source_of(info, &components)?;
        let series = Series { root: self.root.clone(), source, steps: self.times().len(), count, parts, cache };
        Ok(FieldReader::new(info.clone(), components, series))
    }

    /// Source of a field's chunks. A last short block is replaced when steps are added: its files are kept open.
    fn source_of(&self, info: &StoredField, components: &[StoredField]) -> FileResult<Arc<Folder>> {
        let fields = components.iter().chain([info]);
        let (steps, count) = (self.times().len(), self.series.mesh.count(info.values_of) as usize);
        let unsettled = |field: &StoredField| field.unsettled_chunks(&self.source, steps, count);
        let keys: Vec<String> = fields.flat_map(unsettled).collect();
        if keys.is_empty() {
            return Ok(self.source.clone());
        }
        let mut source = (*self.source).clone();
        source.pin(keys)?;
        if Stamp::of(&self.root) == self.stamp {
            return Ok(Arc::new(source));
        }
        Err(FileError::invalid(&self.root, "", "has changed since it was opened").remedy("open it again"))
    }

    fn find(&self, selector: &FieldSelector) -> Option<&StoredField> {
        let named = |name: &str| self.fields().iter().find(|f| f.name == name);
        named(&selector.to_string()).or_else(|| match selector.component {
            None => named(&format!("{}:mag", selector.name)),
            // Component 0 of a scalar is the scalar itself.
            Some(Component::Index(0)) => named(&selector.name),
            Some(_) => None,
        })
    }

    /// Bytes on disk of a field's own values, with checksums and metadata of their arrays: 0 for a magnitude.
    ///
    /// # Errors
    /// If its files cannot be listed.
    pub fn value_bytes(&self, field: &StoredField) -> FileResult<u64> {
        field.array_paths().map(|path| writer::bytes_on_disk(&self.root.join(path))).sum()
    }

    /// Summary of the store.
    ///
    /// # Errors
    /// If its files cannot be listed.
    pub fn info(&self) -> FileResult<StoreInfo> {
        StoreInfo::of(self)
    }
}

/// The fields whose norm a field is.
fn components_of(fields: &[StoredField], info: &StoredField) -> Vec<StoredField> {
    let component = |folder: &String| fields.iter().find(|f| &f.folder == folder).cloned();
    info.component_folders.iter().filter_map(component).collect()
}

fn read_times(root: &Path, source: &dyn ReadRange) -> FileResult<TimeAxis> {
    let key = format!("{TIME}/values");
    let array = StoredArray::open(root, &key, ElementType::F64, Chunking::Whole, 1)?;
    let values = array.read::<f64, 1>(source)?.into_flattened();
    let invalid = |problem: String| Err(FileError::invalid(root.join(&key), "", problem));
    if values.is_empty() {
        return invalid("there is no step".to_owned());
    }
    if let Some(step) = values.iter().position(|t| !t.is_finite()) {
        return invalid(format!("the time of step {step} is not finite"));
    }
    if let Some(step) = values.windows(2).position(|pair| pair[0] >= pair[1]) {
        return invalid(format!("times do not increase after step {step}"));
    }
    Ok(TimeAxis { values })
}

/// Opens all fields and links magnitudes to their components.
fn open_fields(root: &Path, source: &Folder, steps: u64, mesh: &StoredMesh) -> FileResult<Vec<StoredField>> {
    let mut fields = open_fields_of(Association::Point, root, source, steps, mesh)?;
    if root.join(CELL_FIELDS).join("zarr.json").is_file() {
        fields.extend(open_fields_of(Association::Cell, root, source, steps, mesh)?);
    }
    Ok(fields)
}

/// Opens the fields of vertices or of cells.
fn open_fields_of(
    values_of: Association,
    root: &Path,
    source: &Folder,
    steps: u64,
    mesh: &StoredMesh,
) -> FileResult<Vec<StoredField>> {
    let group = fields_of(values_of);
    let FieldsAttributes { folders } = layout::read_group(root, group)?;
    let invalid = |problem: String| FileError::invalid(root.join(group), "attributes", problem);
    let mut fields: Vec<StoredField> = Vec::new();
    for folder in &folders {
        if !names::is_plain(folder) {
            return Err(invalid(format!("'{folder}' is no folder name")));
        }
        fields.push(StoredField::open(root, source, (values_of, folder), [steps, mesh.count(values_of)])?);
    }
    for i in 0..fields.len() {
        let mut components = Vec::new();
        for folder in &fields[i].component_folders {
            // Magnitudes of magnitudes could recur without end.
            let component = fields.iter().find(|f| &f.folder == folder && f.component_folders.is_empty());
            let missing = || invalid(format!("'{}' needs '{folder}', which has no values", fields[i].name));
            components.push(component.ok_or_else(missing)?.name.clone());
        }
        fields[i].magnitude_of = components;
    }
    Ok(fields)
}

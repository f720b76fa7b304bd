//! Adding steps to a store: a new store beside it that links the unchanged files, then replaces it in one move.

use super::array::StoredArray;
use super::field::StoredField;
use super::folder::{Folder, FolderSink};
use super::histograms::HISTOGRAMS;
use super::importance::LOD;
use super::layout::{self, CELL_FIELDS, CHECKSUM_PER_STEP, ERRORS_PER_STEP, ERRORS_PER_VERTEX, FIELDS, TIME};
use super::staging::Staging;
use super::writer::{Content, FieldWriter, StoreWriter};
use super::{FieldDescription, Store};
use crate::codec::{Chunking, ElementType, ErrorTally, StoredValues};
use crate::error::{FileError, FileResult};
use crate::field::FieldSelector;
use crate::moments::Moments;
use std::path::Path;
use std::sync::Arc;

/// A field of a store that is being continued.
pub struct ResumedField {
    /// Writes the steps from `first_step` on.
    pub writer: FieldWriter,
    /// Statistics of all steps in the store.
    pub moments: Moments,
    /// The first step that the writer must be given. Less than the store's number of steps if a short block at their end is to be coded
    /// again.
    pub first_step: usize,
}

impl StoredField {
    /// The number of the first `steps` whose coding does not change when others are added.
    pub fn settled_steps(&self, steps: usize) -> usize {
        let block = self.coding().map_or(1, |coding| coding.codec().block_steps);
        steps / block * block
    }

    /// Keys of the chunks that adding steps replaces.
    pub(super) fn unsettled_chunks(&self, source: &Arc<Folder>, steps: usize, count: usize) -> Vec<String> {
        let group_key = &self.group();
        let values = StoredValues { source: source.clone(), group_key, steps, vertices: count };
        self.coding().map(|coding| coding.unsettled_chunks(&values)).unwrap_or_default()
    }
}

impl Store {
    /// Number of points and cells in the source of the mesh, dropped ones included; `None` if the store does not say.
    pub fn source_counts(&self) -> Option<[u64; 2]> {
        let count = |name: &str| self.series.mesh.attributes.repair.get(name)?.as_u64();
        Some([count("vertices_in")?, count("cells_in")?])
    }

    /// The source of the import, and its notes on what was skipped.
    pub fn origin(&self) -> (&str, &[String]) {
        (&self.attributes.source, &self.attributes.notes)
    }
}

impl StoreWriter {
    /// Begins a store that replaces `store` and has all of its data, with the continued fields in the same order. Times and fields must be
    /// written and finished; the rest is there. Unchanged files become hard links, where the file system has them.
    ///
    /// # Errors
    /// If the store was written by a newer version, or by an older one without the data that codec `vq` needs to continue; if statistics
    /// are damaged; if the folder of the store cannot be written.
    pub fn append(store: &Store) -> FileResult<(Self, Vec<ResumedField>)> {
        layout::check_appendable(&store.root, &store.attributes)?;
        let target = std::fs::canonicalize(&store.root).map_err(|e| FileError::io(&store.root, "open", &e))?;
        let resumed = store.fields().iter().map(|field| resume(store, field)).collect::<FileResult<Vec<_>>>()?;
        let mut staging = Staging::begin(&target, true)?;
        staging.keep(|key| is_kept(key, store, &resumed))?;
        let mut writer = Self::at(staging);
        writer.folders = store.fields().iter().map(|f| (f.values_of, f.folder.clone())).collect();
        writer.revision = store.attributes.revision.saturating_add(1);
        writer.replaces = Some((target, store.stamp.clone()));
        let fields = store.fields().iter().zip(resumed).map(|(field, resumed)| ResumedField {
            writer: FieldWriter {
                root: writer.staging.path().to_owned(),
                folder: field.folder.clone(),
                description: FieldDescription {
                    name: field.name.clone(),
                    association: field.association,
                    values_of: field.values_of,
                    weights: field.weights,
                    units: field.units.clone(),
                },
                checksums: field.checksums.as_ref().map(|known| known[..resumed.first_step].to_vec()),
                content: resumed.content,
                sink: FolderSink::new(writer.staging.path().join(field.group())),
            },
            moments: resumed.moments,
            first_step: resumed.first_step,
        });
        let fields = fields.collect();
        Ok((writer, fields))
    }
}

/// The state from which a field continues.
struct Resumed {
    content: Content,
    moments: Moments,
    first_step: usize,
}

fn resume(store: &Store, field: &StoredField) -> FileResult<Resumed> {
    let group = field.group();
    let path = store.root.join(&group);
    let steps = store.times().len();
    let reader = store.field(&FieldSelector { name: field.name.clone(), component: None })?;
    let statistics = reader.stored_statistics()?.ok_or_else(|| {
        let problem = "is missing or of another version: statistics cannot go on";
        FileError::unsupported(path.join("moments"), "", problem).remedy("import the series again")
    })?;
    let moments = Moments::resume(&statistics, &field.range_per_step, field.nonfinite)
        .ok_or_else(|| FileError::invalid(path.join("moments"), "", "holds no statistics of so many steps"))?;
    let content = match field.coding() {
        None => Content::MagnitudeOf(field.component_folders.clone()),
        Some(coding) => {
            if coding.choice().is_none() {
                return Err(too_old(path.join("zarr.json"), "does not say how it was coded"));
            }
            let vertices = reader.stored_count();
            let errors = match coding.codec().is_exact {
                true => ErrorTally::new(vertices),
                false => errors_so_far(store, &group, field.settled_steps(steps), vertices)?,
            };
            let values = StoredValues { source: store.source.clone(), group_key: &group, steps, vertices };
            Content::Encoded(coding.resume(&values, errors)?)
        }
    };
    Ok(Resumed { content, moments, first_step: field.settled_steps(steps) })
}

fn too_old(path: impl AsRef<Path>, what: &str) -> FileError {
    let problem = format!("{what}: the store is of an older version, and with codec vq nothing can be added to it");
    FileError::unsupported(path, "", problem).remedy("import the series again")
}

/// Coding errors of the complete blocks, which have `steps` steps.
fn errors_so_far(store: &Store, group: &str, steps: usize, vertices: usize) -> FileResult<ErrorTally> {
    if steps == 0 {
        return Ok(ErrorTally::new(vertices));
    }
    let keys = [ERRORS_PER_STEP, ERRORS_PER_VERTEX].map(|name| format!("{group}/{name}"));
    if let Some(key) = keys.iter().find(|key| !store.root.join(key).join("zarr.json").is_file()) {
        return Err(too_old(store.root.join(key), "is missing"));
    }
    let open = |key: &str, rank: usize| StoredArray::open(&store.root, key, ElementType::F64, Chunking::Whole, rank);
    let per_step = open(&keys[0], 2)?.expect_shape(&[steps as u64, 3])?;
    let per_vertex = open(&keys[1], 1)?.expect_shape(&[vertices as u64])?;
    let steps = per_step.read::<f64, 3>(&*store.source)?;
    let vertices = per_vertex.read::<f64, 1>(&*store.source)?.into_flattened();
    ErrorTally::from_parts(&steps, vertices)
        .ok_or_else(|| FileError::invalid(store.root.join(&keys[0]), "", "holds no sums of errors"))
}

/// Whether a file is unchanged; unknown files are.
fn is_kept(key: &str, store: &Store, resumed: &[Resumed]) -> bool {
    let within = |key: &str, group: &str| key.strip_prefix(group).is_some_and(|rest| rest.starts_with('/'));
    if key == "zarr.json" || within(key, TIME) || within(key, LOD) {
        return false;
    }
    if [FIELDS, CELL_FIELDS].iter().any(|group| key == format!("{group}/zarr.json")) {
        return false;
    }
    let below = |field: &StoredField| key.strip_prefix(&field.group())?.strip_prefix('/');
    let found = store.fields().iter().enumerate().find_map(|(i, field)| Some((i, below(field)?)));
    let Some((i, key)) = found else { return true };
    let renewed = ["range_per_step", CHECKSUM_PER_STEP, "moments", HISTOGRAMS, ERRORS_PER_STEP, ERRORS_PER_VERTEX];
    if key == "zarr.json" || renewed.iter().any(|name| within(key, name)) {
        return false;
    }
    match &resumed[i].content {
        Content::Encoded(encoder) if within(key, encoder.name()) => encoder.is_settled(key),
        _ => true,
    }
}

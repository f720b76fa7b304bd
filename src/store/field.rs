//! Fields of an opened store and the decoding of their steps.

use super::MAGNITUDE_CODEC;
use super::array::StoredArray;
use super::folder::Folder;
use super::layout::{self, CHECKSUM_PER_STEP, FieldAttributes, MeanWeights, fields_of, moments_array};
use super::mesh::is_current;
use crate::codec::blocks::{BlockCache, BlockKey, BlockLoader};
use crate::codec::vq::VqBlock;
use crate::codec::{
    self, Chunking, Coding, DecodeStats, Decoder, ElementType, Quality, ReadRange, StepRequest, StoredValues, Wanted,
    chunk_key, magnitude_unless, read_rows,
};
use crate::error::{FileError, FileResult};
use crate::field::Association;
use crate::mesh::SourceCells;
use crate::moments::{StepSummary, VertexStatistics};
use crate::task::Cancel;
use rayon::iter::ParallelIterator;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// A field of a store.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StoredField {
    /// Name as the user selects it: `T`, `velocity:0`, `velocity:mag`.
    pub name: String,
    /// Unit of the values, if known.
    pub units: Option<String>,
    /// Association of the values in the source.
    pub association: Association,
    /// What has the values in the store: cells, or vertices, to which those of cells may have been brought.
    pub values_of: Association,
    /// How they were brought there, if known.
    #[serde(skip)]
    pub weights: Option<MeanWeights>,
    /// Codec of the values; `magnitude` if they are computed from `magnitude_of`.
    pub codec: String,
    /// Parameters of the codec.
    pub codec_parameters: serde_json::Value,
    /// Error measured after coding; `None` if the values are exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<Quality>,
    /// Names of the fields whose Euclidean norm this one is; empty for a field with values of its own.
    pub magnitude_of: Vec<String>,
    /// Least and greatest finite value of the series; `None` if there is none.
    pub range: Option<[f32; 2]>,
    /// Least and greatest finite value of each step; `None` if a step has none.
    #[serde(skip)]
    pub range_per_step: Vec<Option<[f32; 2]>>,
    /// Number of NaN and infinite values in all steps.
    pub nonfinite: u64,
    /// CRC-32C of each step's values before coding; `None` if an older version wrote the store.
    #[serde(skip)]
    pub(super) checksums: Option<Vec<u32>>,
    /// Folder below `fields`.
    #[serde(skip)]
    pub(super) folder: String,
    /// Folders of `magnitude_of`.
    #[serde(skip)]
    pub(super) component_folders: Vec<String>,
    /// Coding of its own values; `None` for a magnitude.
    #[serde(skip)]
    coding: Option<OwnCoding>,
}

/// The coding of a field, which has the codec and the parameters that it is made of beside it.
#[derive(Clone, Debug)]
struct OwnCoding(Arc<dyn Coding>);

impl PartialEq for OwnCoding {
    /// Fields are compared by their codecs and parameters.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Coding of the own values of a field with these attributes; `None` if it is the norm of others.
fn coding_of(attributes: &FieldAttributes, path: &Path) -> FileResult<Option<Arc<dyn Coding>>> {
    if attributes.codec == MAGNITUDE_CODEC && !attributes.magnitude_of.is_empty() {
        return Ok(None);
    }
    let Some(codec) = codec::codec_of(&attributes.codec) else {
        let error = FileError::unsupported(path, "codec", format!("'{}' is not known", attributes.codec));
        return Err(error.remedy("a newer version of tetreel may read it"));
    };
    let coding = (codec.coding)(&attributes.codec_parameters);
    coding.map(Some).map_err(|problem| FileError::invalid(path, "attributes", problem))
}

impl StoredField {
    /// Name and unit: `T [K]`.
    pub fn titled(&self) -> String {
        match self.units.as_deref().filter(|units| !units.is_empty()) {
            Some(units) => format!("{} [{units}]", self.name),
            None => self.name.clone(),
        }
    }

    /// Reads attributes and ranges and checks the shape of the values: `count` in each step, of vertices or of the source's cells.
    pub(super) fn open(
        root: &Path,
        source: &Folder,
        (values_of, folder): (Association, &str),
        [steps, count]: [u64; 2],
    ) -> FileResult<Self> {
        let group = format!("{}/{folder}", fields_of(values_of));
        let attributes: FieldAttributes = layout::read_group(root, &group)?;
        let coding = coding_of(&attributes, &root.join(&group))?;
        for array in coding.iter().flat_map(|coding| coding.arrays(steps, count)) {
            let key = format!("{group}/{}", array.name);
            StoredArray::open(root, &key, array.element, array.chunking, array.shape.len())?
                .expect_shape(&array.shape)?;
        }
        let key = format!("{group}/range_per_step");
        let ranges = StoredArray::open(root, &key, ElementType::F32, Chunking::Whole, 2)?
            .expect_shape(&[steps, 2])?
            .read::<f32, 2>(source)?;
        let range_per_step = ranges
            .into_iter()
            .enumerate()
            .map(|(step, range)| check_range(range).ok_or((step, range)))
            .collect::<Result<Vec<_>, _>>()
            .map_err(|(step, r)| {
                FileError::invalid(root.join(&key), format!("step {step}"), format!("{r:?} is no range"))
            })?;
        let of_step = |&range: &Option<[f32; 2]>| StepSummary { range, nonfinite: 0 };
        let series = range_per_step.iter().map(of_step).fold(StepSummary::EMPTY, StepSummary::merge);
        Ok(Self {
            name: attributes.name,
            units: attributes.units,
            association: attributes.association,
            values_of,
            weights: attributes.weights,
            codec: attributes.codec,
            codec_parameters: attributes.codec_parameters,
            quality: attributes.quality,
            magnitude_of: Vec::new(),
            range: series.range,
            range_per_step,
            nonfinite: attributes.nonfinite,
            checksums: read_checksums(root, source, &group, steps)?,
            folder: folder.to_owned(),
            component_folders: attributes.magnitude_of,
            coding: coding.map(OwnCoding),
        })
    }

    /// Paths of its own value arrays below the root, whatever the number of values.
    pub(super) fn array_paths(&self) -> impl Iterator<Item = String> {
        let arrays = self.coding().into_iter().flat_map(|coding| coding.arrays(1, 1));
        arrays.map(|array| format!("{}/{}", self.group(), array.name))
    }

    /// Its group below the root.
    pub(super) fn group(&self) -> String {
        format!("{}/{}", fields_of(self.values_of), self.folder)
    }

    /// Coding of its own values; `None` for a magnitude.
    pub fn coding(&self) -> Option<&dyn Coding> {
        self.coding.as_ref().map(|OwnCoding(coding)| &**coding)
    }

    /// A decoder of the field's own values, with its blocks in `cache` if there is one; `None` for a magnitude.
    fn decoder(&self, series: &Series) -> Option<Box<dyn Decoder>> {
        let group_key = &self.group();
        let (source, steps, vertices) = (series.source.clone(), series.steps, series.count);
        let values = StoredValues { source, group_key, steps, vertices };
        self.coding().map(|coding| coding.decoder(&values, series.cache.clone()))
    }
}

fn read_checksums(root: &Path, source: &Folder, group: &str, steps: u64) -> FileResult<Option<Vec<u32>>> {
    let key = format!("{group}/{CHECKSUM_PER_STEP}");
    if !root.join(&key).join("zarr.json").is_file() {
        return Ok(None);
    }
    let array = StoredArray::open(root, &key, ElementType::U32, Chunking::Whole, 1)?;
    Ok(Some(array.expect_shape(&[steps])?.read::<u32, 1>(source)?.into_flattened()))
}

/// The checked range: `Some(None)` for NaN bounds (no finite value), `None` for an invalid range.
fn check_range([lo, hi]: [f32; 2]) -> Option<Option<[f32; 2]>> {
    match (lo.is_nan(), hi.is_nan()) {
        (true, true) => Some(None),
        (false, false) if lo <= hi && lo.is_finite() && hi.is_finite() => Some(Some([lo, hi])),
        _ => None,
    }
}

/// Properties shared by all fields of a store, and the block cache of a reader, if it was given one.
#[derive(Clone)]
pub(super) struct Series {
    pub(super) root: PathBuf,
    pub(super) source: Arc<Folder>,
    pub(super) steps: usize,
    /// Values of a step in the store: of vertices or of the source's cells.
    pub(super) count: usize,
    /// The source's cells that the values are of, if some of them are several cells of the mesh.
    pub(super) parts: Option<Arc<SourceCells>>,
    pub(super) cache: Option<Arc<BlockCache>>,
}

/// Decodes any step of a field. Several threads may use one reader at once.
pub struct FieldReader {
    info: StoredField,
    /// The fields whose norm this one is; empty for a field with its own values.
    components: Vec<StoredField>,
    /// The decoders of the stored values: one, or one per component of a magnitude.
    decoders: Vec<Box<dyn Decoder>>,
    /// Buffers for all components of a step of a magnitude.
    pool: Mutex<Vec<Vec<f32>>>,
    /// Buffers for the values of a step as the store has them.
    compact: Mutex<Vec<Vec<f32>>>,
    pub(super) series: Series,
}

impl FieldReader {
    /// The fields whose norm this one is.
    pub(super) fn components(&self) -> &[StoredField] {
        &self.components
    }

    /// A reader of `info`, with `components` the fields whose norm it is.
    pub(super) fn new(info: StoredField, components: Vec<StoredField>, series: Series) -> Self {
        let decoders = match info.decoder(&series) {
            Some(decoder) => vec![decoder],
            None => components.iter().filter_map(|field| field.decoder(&series)).collect(),
        };
        Self { info, components, decoders, pool: Mutex::default(), compact: Mutex::default(), series }
    }

    /// Another reader of the same files, with its blocks in `cache`: its reads evict none of this reader's blocks.
    #[must_use]
    pub fn with_blocks(&self, cache: Arc<BlockCache>) -> Self {
        let series = Series { cache: Some(cache), ..self.series.clone() };
        Self::new(self.info.clone(), self.components.clone(), series)
    }

    /// The field.
    pub fn info(&self) -> &StoredField {
        &self.info
    }

    /// Number of steps.
    pub fn step_count(&self) -> usize {
        self.series.steps
    }

    /// Number of values of a step: one per vertex of the store's mesh, or one per cell.
    pub fn value_count(&self) -> usize {
        self.series.parts.as_ref().map_or(self.series.count, |parts| parts.cells())
    }

    /// Number of values of a step in the store: one per vertex, or one per cell of the source.
    pub(super) fn stored_count(&self) -> usize {
        self.series.count
    }

    /// Decodes `step` into `out`, one value per vertex or cell of the store's mesh. NaN and infinities are as in the source.
    ///
    /// # Errors
    /// If there is no such step, or its chunk is missing, cut or damaged; the error names the file and the step. `out`
    /// is unspecified then.
    ///
    /// # Panics
    /// If the length of `out` is not [`FieldReader::value_count`].
    pub fn decode_step(&self, step: usize, out: &mut [f32]) -> FileResult<DecodeStats> {
        match self.decode_step_unless(StepRequest::whole(step, &Cancel::new()), out)? {
            Some(stats) => Ok(stats),
            None => unreachable!("nobody else has the flag"),
        }
    }

    /// As [`FieldReader::decode_step`], unless it is cancelled: then `None` within a few milliseconds. Only wanted chunks are sure to be
    /// decoded. All other values of `out` are unspecified.
    ///
    /// # Errors
    /// As [`FieldReader::decode_step`].
    ///
    /// # Panics
    /// As [`FieldReader::decode_step`], or if there is not one flag for each chunk.
    pub fn decode_step_unless(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>> {
        let Some(parts) = &self.series.parts else { return self.decode_stored(request, out) };
        self.with_buffer(&self.compact, self.series.count, |compact| {
            let needed = request.wanted.map(|wanted| parts.needed_chunks(wanted.length, wanted.chunks));
            let needed = request.wanted.zip(needed.as_deref()).map(|(wanted, chunks)| Wanted { chunks, ..wanted });
            let decoded = self.decode_stored(StepRequest { wanted: needed, ..request }, compact)?;
            match request.wanted {
                _ if decoded.is_none() => {}
                None => parts.expand(compact, out),
                Some(wanted) => {
                    let compact = &*compact;
                    wanted.of(out).for_each(|(first, out)| parts.expand_from(first, compact, out));
                }
            }
            Ok(decoded)
        })
    }

    /// Decodes the values of a step that the store has.
    fn decode_stored(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>> {
        if let Some(decoder) = self.own_decoder() {
            return decoder.decode_step_unless(request, out);
        }
        assert_eq!(out.len(), self.series.count, "one value per vertex or cell");
        self.with_buffer(&self.pool, self.decoders.len() * self.series.count, |buffer| {
            decode_magnitude(&self.decoders, request, buffer, out)
        })
    }

    /// Calls a function with a buffer of this length from a pool.
    fn with_buffer<T>(&self, pool: &Mutex<Vec<Vec<f32>>>, length: usize, call: impl FnOnce(&mut [f32]) -> T) -> T {
        let pooled = pool.lock().unwrap_or_else(PoisonError::into_inner).pop();
        // A new buffer is zero without being written, which would take a while and could not be cancelled.
        let mut buffer = pooled.unwrap_or_else(|| vec![0.0; length]);
        let result = call(&mut buffer);
        pool.lock().unwrap_or_else(PoisonError::into_inner).push(buffer);
        result
    }

    /// The decoder of the field's own values; `None` for a magnitude.
    fn own_decoder(&self) -> Option<&dyn Decoder> {
        self.info.coding.as_ref().and(self.decoders.first()).map(|decoder| &**decoder)
    }

    fn loaders(&self) -> impl Iterator<Item = &dyn BlockLoader> {
        self.decoders.iter().filter_map(|decoder| decoder.blocks())
    }

    /// Tells the cache which steps will be shown, the next one first; of repeated steps, as in a loop, the first counts. Their blocks are
    /// kept, and loaded by [`FieldReader::prefetch`], in this order. Steps that do not exist are ignored. The last call counts, by this
    /// reader or another one.
    ///
    /// Does nothing without a cache ([`Store::field_with`](super::Store::field_with)).
    pub fn expect(&self, upcoming: &[usize]) {
        let Some(cache) = &self.series.cache else { return };
        let blocks_of = |step: usize| self.loaders().map(move |loader| loader.block_of_step(step));
        let is_new = |i: usize| i == 0 || !blocks_of(upcoming[i]).eq(blocks_of(upcoming[i - 1]));
        cache.expect((0..upcoming.len()).filter(|&i| is_new(i)).flat_map(|i| self.keys(upcoming[i])));
    }

    /// Cache keys of a step's blocks.
    fn keys(&self, step: usize) -> impl Iterator<Item = BlockKey> {
        self.loaders()
            .filter_map(move |loader| loader.block_of_step(step).map(|index| BlockKey { decoder: loader.id(), index }))
    }

    /// Loads the first block that the steps of [`FieldReader::expect`] need, that is not in memory, and that fits in the budget beside
    /// those needed sooner. Returns whether there was one; not if `cancel` was raised before it was complete. A block that failed is
    /// skipped until steps are expected again.
    ///
    /// # Errors
    /// If the block is missing or damaged; the error names the file and the first step of the block.
    pub fn prefetch(&self, cancel: &Cancel) -> FileResult<bool> {
        let Some(cache) = &self.series.cache else { return Ok(false) };
        cache.prefetch(|decoder| self.loaders().find(|loader| loader.id() == decoder), cancel)
    }

    /// Whether `step` can be decoded without reading a file, from the reader's block cache.
    pub fn is_resident(&self, step: usize) -> bool {
        let Some(cache) = &self.series.cache else { return false };
        step < self.series.steps && self.keys(step).all(|key| cache.is_resident(key))
    }

    /// The source's cells, whose values the store has, if several cells of the mesh are parts of one; `None` for values of vertices.
    pub fn source_cells(&self) -> Option<&Arc<SourceCells>> {
        self.series.parts.as_ref()
    }

    /// The compressed block of codec `vq` that `step` is in, for a GPU decoder; `None` for other codecs. Its values are of vertices, of
    /// cells, or of the [cells of the source](Self::source_cells).
    ///
    /// # Errors
    /// As [`FieldReader::decode_step`].
    pub fn vq_block(&self, step: usize) -> FileResult<Option<Arc<VqBlock>>> {
        self.own_decoder().map_or(Ok(None), |decoder| decoder.vq_block(step))
    }

    /// Mean and variance over time of every value of a step; `None` if the store has none of this version.
    ///
    /// # Errors
    /// If the arrays are damaged.
    pub fn statistics(&self) -> FileResult<Option<VertexStatistics>> {
        let Some(stored) = self.stored_statistics()? else { return Ok(None) };
        let VertexStatistics { mean, variance, finite_count } = stored;
        let [mean, variance, finite_count] = [mean, variance, finite_count].map(|values| self.expanded(values));
        Ok(Some(VertexStatistics { mean, variance, finite_count }))
    }

    /// Values as the store has them, as one for each value of a step.
    pub(super) fn expanded<T: Copy + Default>(&self, stored: Vec<T>) -> Vec<T> {
        let Some(parts) = &self.series.parts else { return stored };
        let mut out = vec![T::default(); parts.cells()];
        parts.expand(&stored, &mut out);
        out
    }

    /// Mean and variance over time of every value of a step in the store, as [`Self::statistics`].
    pub(super) fn stored_statistics(&self) -> FileResult<Option<VertexStatistics>> {
        let spec = moments_array(self.series.count as u64);
        let key = format!("{}/{}", self.info.group(), spec.name);
        let Series { root, source, .. } = &self.series;
        if !root.join(&key).join("zarr.json").is_file() {
            return Ok(None);
        }
        let array = StoredArray::open(root, &key, spec.element, spec.chunking, spec.shape.len())?;
        if !is_current(&array) {
            return Ok(None);
        }
        let array = array.expect_shape(&spec.shape)?;
        let row = |i: u64| -> FileResult<Vec<f64>> {
            Ok(read_rows::<f64, 1>(&**source, &chunk_key(&key, i, 2), array.shape[1])?.into_flattened())
        };
        Ok(Some(VertexStatistics { mean: row(0)?, variance: row(1)?, finite_count: row(2)? }))
    }
}

fn decode_magnitude(
    components: &[Box<dyn Decoder>],
    request: StepRequest<'_>,
    buffer: &mut [f32],
    out: &mut [f32],
) -> FileResult<Option<DecodeStats>> {
    let mut bytes_read = 0;
    if out.is_empty() {
        return Ok(Some(DecodeStats::default()));
    }
    for (decoder, values) in components.iter().zip(buffer.chunks_exact_mut(out.len())) {
        match decoder.decode_step_unless(StepRequest { wanted: None, ..request }, values)? {
            Some(stats) => bytes_read += stats.bytes_read,
            None => return Ok(None),
        }
    }
    let values: Vec<&[f32]> = buffer.chunks_exact(out.len()).collect();
    let whole = magnitude_unless(&values, out, request.cancel);
    Ok(whole.then_some(DecodeStats { bytes_read, vertices_decoded: out.len() as u64 }))
}

impl std::fmt::Debug for FieldReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let path = self.series.source.path(&self.info.group());
        f.debug_struct("FieldReader").field("name", &self.info.name).field("path", &path).finish_non_exhaustive()
    }
}

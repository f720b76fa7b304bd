//! One field of a store, opened for playing.

use super::functions::KeptFunctions;
use super::kept::{ChunkRanges, Quantities, Rankings};
use super::time::FrameTime;
use crate::codec::vq::{self, VqBlock};
use crate::codec::{BlockCache, DecodeStats, StepRequest};
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldSelector, Scalars, TimeAxis};
use crate::histograms::Counted;
use crate::mesh::Mesh;
use crate::render::probe::interpolate;
use crate::render::{CompressedScalars, CompressedStep};
use crate::store::{FieldReader, Store, StoredField};
use crate::task::Cancel;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Source of decoded steps: [`FieldReader`], or in tests one that fails. No method has a default, so that a wrapping source forgets none.
pub(super) trait StepSource: Send + Sync {
    /// Fills `out` with a step, one scalar per vertex or cell; `None` if it was cancelled. Scalars that are not wanted may be left undecoded.
    fn decode_step(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>>;

    /// The compressed block of a step; `None` if its codec has none that a GPU can decode.
    fn vq_block(&self, step: usize) -> FileResult<Option<Arc<VqBlock>>>;

    /// Announces the steps that will be shown, in order.
    fn expect(&self, upcoming: &[usize]);

    /// Loads the first block that the expected steps need and that is not in memory; whether there was one.
    fn prefetch(&self, cancel: &Cancel) -> FileResult<bool>;

    /// Whether a step can be decoded without reading anything.
    fn is_resident(&self, step: usize) -> bool;

    /// The reader of the field in its store, which has what was found at import; `None` for a source from elsewhere.
    fn reader(&self) -> Option<&FieldReader>;

    /// Counts histograms, as [`FieldReader::go_on_counting`]; leaves `None` if there are none.
    fn go_on_counting(
        &self,
        counted: &mut Option<Counted>,
        mesh: &Mesh,
        cancel: &Cancel,
        told: &mut dyn FnMut(&Counted) -> bool,
    ) -> FileResult<bool>;

    /// Another source of the same steps, with its blocks in `blocks`.
    fn with_blocks(&self, blocks: Arc<BlockCache>) -> Box<dyn StepSource>;
}

impl StepSource for FieldReader {
    fn decode_step(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>> {
        self.decode_step_unless(request, out)
    }

    fn vq_block(&self, step: usize) -> FileResult<Option<Arc<VqBlock>>> {
        FieldReader::vq_block(self, step)
    }

    fn expect(&self, upcoming: &[usize]) {
        FieldReader::expect(self, upcoming);
    }

    fn prefetch(&self, cancel: &Cancel) -> FileResult<bool> {
        FieldReader::prefetch(self, cancel)
    }

    fn is_resident(&self, step: usize) -> bool {
        FieldReader::is_resident(self, step)
    }

    fn reader(&self) -> Option<&FieldReader> {
        Some(self)
    }

    fn go_on_counting(
        &self,
        counted: &mut Option<Counted>,
        mesh: &Mesh,
        cancel: &Cancel,
        told: &mut dyn FnMut(&Counted) -> bool,
    ) -> FileResult<bool> {
        FieldReader::go_on_counting(self, counted, mesh, cancel, told)
    }

    fn with_blocks(&self, blocks: Arc<BlockCache>) -> Box<dyn StepSource> {
        Box::new(FieldReader::with_blocks(self, blocks))
    }
}

/// One field of a store, opened for playing. Shared by all stages; immutable.
pub struct Series {
    pub(super) mesh: Arc<Mesh>,
    pub(super) times: TimeAxis,
    pub(super) field: StoredField,
    pub(super) source: Box<dyn StepSource>,
    pub(super) blocks: Arc<BlockCache>,
    pub(super) rankings: Mutex<Rankings>,
    pub(super) ranges: ChunkRanges,
    pub(super) quantities: Arc<Quantities>,
    pub(super) beside: Beside,
    pub(super) functions: KeptFunctions,
}

/// Other fields of the store of a series, opened when they are first asked for.
#[derive(Debug, Default)]
pub(super) struct Beside {
    /// Path of the store; `None` for a series from elsewhere.
    store: Option<PathBuf>,
    opened: Mutex<Vec<(FieldSelector, Arc<Series>)>>,
    /// Numbers of blocks, once they were asked for.
    blocks: Mutex<Option<Arc<Vec<f32>>>>,
}

impl Beside {
    /// An empty set for the same store.
    pub(super) fn of_the_same_store(&self) -> Self {
        Self { store: self.store.clone(), ..Self::default() }
    }
}

impl Series {
    /// Another field of the same store, on the same mesh and within the same budget.
    ///
    /// # Errors
    /// If the store cannot be opened, has no such field, or it is damaged.
    pub fn beside(&self, field: &FieldSelector) -> FileResult<Arc<Self>> {
        let mut opened = self.beside.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, series)) = opened.iter().find(|(of, _)| of == field) {
            return Ok(series.clone());
        }
        let no_store = || FileError::invalid("", field.to_string(), "is of a series that is in no store");
        let store = Store::open(self.beside.store.as_ref().ok_or_else(no_store)?)?;
        let series = Arc::new(self.reopened(&store, Some(field))?);
        opened.push((field.clone(), series.clone()));
        Ok(series)
    }

    /// The number of the block of the source that each cell is from, as values by which regions are chosen.
    ///
    /// # Errors
    /// If the store cannot be opened or is damaged, or its mesh has no blocks.
    pub fn block_numbers(&self) -> FileResult<Arc<Vec<f32>>> {
        let mut known = self.beside.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(numbers) = known.as_ref() {
            return Ok(numbers.clone());
        }
        let none = || FileError::invalid("", "", "the mesh has no blocks");
        let store = Store::open(self.beside.store.as_ref().ok_or_else(none)?)?;
        let blocks = store.blocks()?.ok_or_else(none)?;
        // Fields have numbers of blocks as f32, too.
        let numbers = Arc::new(blocks.of_cell.into_iter().map(|number| number as f32).collect());
        Ok(known.insert(numbers).clone())
    }

    /// Default budget in bytes for blocks of steps.
    pub const BLOCK_BYTES: u64 = 256 << 20;

    /// Opens a field; the first one if none is named. [`Self::BLOCK_BYTES`] of its blocks are kept in memory.
    ///
    /// # Errors
    /// If the store has no such field, or mesh or field are damaged.
    pub fn open(store: &Store, field: Option<&FieldSelector>) -> FileResult<Self> {
        Self::open_with(store, field, Arc::new(BlockCache::new(Self::BLOCK_BYTES)))
    }

    /// Opens a series as [`Self::open`] does, with another budget for blocks.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_with(store: &Store, field: Option<&FieldSelector>, blocks: Arc<BlockCache>) -> FileResult<Self> {
        Self::with_mesh(store, field, blocks, Arc::new(store.mesh()?))
    }

    /// Another field of the same store, or the same one after the store has grown; mesh and block budget are kept.
    ///
    /// # Errors
    /// If the store has no such field, or it is damaged.
    pub fn reopened(&self, store: &Store, field: Option<&FieldSelector>) -> FileResult<Self> {
        Self::with_mesh(store, field, self.blocks.clone(), self.mesh.clone())
    }

    fn with_mesh(
        store: &Store,
        field: Option<&FieldSelector>,
        blocks: Arc<BlockCache>,
        mesh: Arc<Mesh>,
    ) -> FileResult<Self> {
        let first = || {
            let name = store.fields().first().map(|f| f.name.clone());
            name.ok_or_else(|| FileError::invalid(store.path(), "fields", "the store has no field"))
        };
        let selector = match field {
            Some(selector) => selector.clone(),
            None => FieldSelector { name: first()?, component: None },
        };
        let (reader, times) = open_at_rest(store, &selector, &blocks)?;
        Ok(Self {
            mesh,
            times,
            field: reader.info().clone(),
            source: Box::new(reader),
            blocks,
            rankings: Mutex::default(),
            ranges: ChunkRanges::default(),
            quantities: Arc::default(),
            beside: Beside { store: Some(store.path().to_owned()), ..Beside::default() },
            functions: KeptFunctions::default(),
        })
    }

    /// The cache of decoded blocks.
    pub fn blocks(&self) -> &Arc<BlockCache> {
        &self.blocks
    }

    /// Whether a step can be decoded without reading anything: what a player shows as buffered.
    pub fn is_resident(&self, step: usize) -> bool {
        self.source.is_resident(step)
    }

    /// The mesh.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// Times of the steps.
    pub fn times(&self) -> &TimeAxis {
        &self.times
    }

    /// The field of the series.
    pub fn field(&self) -> &StoredField {
        &self.field
    }

    /// What has the scalars: vertices or cells.
    pub fn values_of(&self) -> Association {
        self.field.values_of
    }

    /// The scalars of a time as they are compressed, for a GPU that decodes them; `None` if their codec has no blocks. Those of a mixture
    /// only while the blocks of both steps are in memory: decoded steps are kept longer, and reading blocks again takes longer than to mix.
    pub(super) fn compressed(&self, time: FrameTime) -> FileResult<Option<CompressedScalars>> {
        let of = |step: usize| -> FileResult<Option<CompressedStep>> {
            Ok(self.source.vq_block(step)?.map(|block| CompressedStep { block, step: step % vq::STEPS }))
        };
        let toward = match time.toward() {
            None => None,
            Some((next, _)) if !(self.is_resident(time.step()) && self.is_resident(next)) => return Ok(None),
            Some((next, weight)) => {
                let Some(next) = of(next)? else { return Ok(None) };
                Some((next, weight))
            }
        };
        let source_cells = self.source.reader().and_then(FieldReader::source_cells).cloned();
        Ok(of(time.step())?.map(|step| CompressedScalars { step, toward, source_cells }))
    }

    /// Number of scalars of a step.
    pub(crate) fn scalar_count(&self) -> usize {
        match self.values_of() {
            Association::Point => self.mesh.positions.local.len(),
            Association::Cell => self.mesh.topology.tets.len(),
        }
    }

    /// The scalars of a step by its values.
    pub(crate) fn scalars(&self, values: Arc<Vec<f32>>) -> Scalars {
        Scalars::new(self.values_of(), values)
    }

    /// The value of a step at a point of a cell: linear between its vertices, NaN where one of them is, or the cell's; `None` if there is no such
    /// cell.
    pub(crate) fn value_at(&self, values: &[f32], cell: u32, weights: [f64; 4]) -> Option<f64> {
        let tet = self.mesh.topology.tets.get(cell as usize)?;
        Some(match self.values_of() {
            Association::Point => interpolate(weights, tet.map(|vertex| values[vertex as usize])),
            Association::Cell => f64::from(values[cell as usize]),
        })
    }

    /// Values of a step as values of the vertices: those of cells are averaged ([`Mesh::means_at_vertices`]).
    pub(super) fn at_vertices(&self, values: Vec<f32>) -> Vec<f32> {
        match self.values_of() {
            Association::Point => values,
            Association::Cell => self.mesh.means_at_vertices(&values),
        }
    }

    /// Fills `out` with a step, one scalar per vertex or cell; whether it came to its end before `cancel` was raised.
    pub(crate) fn decode_step(&self, step: usize, out: &mut [f32], cancel: &Cancel) -> FileResult<bool> {
        Ok(self.source.decode_step(StepRequest::whole(step, cancel), out)?.is_some())
    }
}

/// Most attempts to open a store that keeps growing.
const LOOKS: usize = 10;

/// A reader of a field and the times of its steps; from the store as it is now, if steps were added since it was opened.
fn open_at_rest(
    store: &Store,
    selector: &FieldSelector,
    blocks: &Arc<BlockCache>,
) -> FileResult<(FieldReader, TimeAxis)> {
    let mut newer = None;
    for _ in 0..LOOKS {
        let store: &Store = newer.as_ref().unwrap_or(store);
        match (store.field_with(selector, blocks.clone()), store.refreshed()) {
            (Ok(reader), _) => return Ok((reader, store.times().clone())),
            (Err(_), Ok(Some(grown))) => newer = Some(grown),
            (Err(error), _) => return Err(error),
        }
    }
    let store = newer.as_ref().unwrap_or(store);
    Ok((store.field_with(selector, blocks.clone())?, store.times().clone()))
}

impl std::fmt::Debug for Series {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Series")
            .field("field", &self.field.name)
            .field("steps", &self.times.len())
            .finish_non_exhaustive()
    }
}

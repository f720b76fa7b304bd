//! Series with a scripted source, for tests.

use super::series::{Series, StepSource};
use crate::codec::vq::VqBlock;
use crate::codec::{BlockCache, DecodeStats, StepRequest};
use crate::error::{FileError, FileResult};
use crate::field::{FieldSelector, TimeAxis};
use crate::histograms::{Counted, Kind, SeriesView, spread};
use crate::ingest::{IngestOptions, ingest};
use crate::mesh::Mesh;
use crate::store::{FieldReader, Store, StoredField};
use crate::synth::{SeriesName, SynthSpec, generate};
use crate::task::{Cancel, Silent};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

/// The calls and the script of a fake source.
#[derive(Debug, Default)]
struct State {
    decoded: Vec<usize>,
    counts: bool,
    fails: Option<usize>,
    panics: Option<usize>,
    /// Steps whose decoding blocks until it is cancelled.
    hangs: bool,
    /// Duration of decoding a step.
    takes: Duration,
}

/// Controls a fake source.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log(Arc<Mutex<State>>);

impl Log {
    fn with<T>(&self, f: impl FnOnce(&mut State) -> T) -> T {
        f(&mut self.0.lock().unwrap())
    }

    /// Steps decoded so far, in order.
    pub(crate) fn decoded(&self) -> Vec<usize> {
        self.with(|state| state.decoded.clone())
    }

    /// Lets the source have histograms from now on.
    pub(crate) fn count(&self) {
        self.with(|state| state.counts = true);
    }

    /// Lets this step fail to decode from now on.
    pub(crate) fn fail_at(&self, step: usize) {
        self.with(|state| state.fails = Some(step));
    }

    /// Lets this step panic from now on.
    pub(crate) fn panic_at(&self, step: usize) {
        self.with(|state| state.panics = Some(step));
    }

    /// Lets decoding a step take this long, or until it is cancelled, from now on.
    pub(crate) fn take(&self, duration: Duration) {
        self.with(|state| state.takes = duration);
    }

    /// Blocks decoding from now on until it is cancelled or this is called again; also counting histograms, of which there are none unless [`Self::count`] was
    /// called.
    pub(crate) fn hang(&self, hangs: bool) {
        self.with(|state| state.hangs = hangs);
    }

    fn hang_unless(&self, cancel: &Cancel) {
        while self.with(|state| state.hangs) && !cancel.is_cancelled() {
            std::thread::yield_now();
        }
    }
}

/// Step s has the value s everywhere.
struct Fake {
    field: StoredField,
    steps: usize,
    log: Log,
}

impl StepSource for Fake {
    fn decode_step(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>> {
        let StepRequest { step, cancel, .. } = request;
        self.log.hang_unless(cancel);
        let (begun, takes) = (Instant::now(), self.log.with(|state| state.takes));
        while begun.elapsed() < takes && !cancel.is_cancelled() {
            std::thread::yield_now();
        }
        if cancel.is_cancelled() {
            return Ok(None);
        }
        let (fails, panics) = self.log.with(|state| (state.fails == Some(step), state.panics == Some(step)));
        assert!(!panics, "step {step} is not meant to be decoded");
        if fails {
            return Err(FileError::invalid("fake", format!("step {step}"), "is damaged"));
        }
        self.log.with(|state| state.decoded.push(step));
        out.fill(step as f32);
        Ok(Some(DecodeStats { bytes_read: 1, vertices_decoded: out.len() as u64 }))
    }

    fn vq_block(&self, _step: usize) -> FileResult<Option<Arc<VqBlock>>> {
        Ok(None)
    }

    fn expect(&self, _upcoming: &[usize]) {}

    fn prefetch(&self, _cancel: &Cancel) -> FileResult<bool> {
        Ok(false)
    }

    fn is_resident(&self, _step: usize) -> bool {
        false
    }

    fn reader(&self) -> Option<&FieldReader> {
        None
    }

    fn go_on_counting(
        &self,
        counted: &mut Option<Counted>,
        mesh: &Mesh,
        cancel: &Cancel,
        told: &mut dyn FnMut(&Counted) -> bool,
    ) -> FileResult<bool> {
        self.log.hang_unless(cancel);
        if !self.log.with(|state| state.counts) {
            return Ok(false);
        }
        let (values_of, scalar_range) = (self.field.values_of, self.field.range);
        let cov = vec![0.25; mesh.vertex_source.len()];
        let series = SeriesView { mesh, values_of, scalar_range, cov: &cov };
        let ranges = Kind::ALL.map(|kind| series.known_ranges(&kind));
        let counted = counted.get_or_insert_with(|| Counted::none(&Kind::ALL, &ranges, self.steps));
        let read = |step, out: &mut [f32]| Ok(self.decode_step(StepRequest::whole(step, cancel), out)?.is_some());
        counted.go_on(&Kind::ALL, &series, &spread(self.steps, 1, self.steps), read, told)
    }

    fn with_blocks(&self, _blocks: Arc<BlockCache>) -> Box<dyn StepSource> {
        Box::new(Self { field: self.field.clone(), steps: self.steps, log: self.log.clone() })
    }
}

/// A small generated series in a store, shared by all tests.
fn stored() -> &'static Store {
    static STORE: OnceLock<(tempfile::TempDir, Store)> = OnceLock::new();
    let (_, store) = STORE.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let series = generate(&SynthSpec { cells: 600, steps: 4, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
        let path = dir.path().join("jet.zarr");
        ingest(&series, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        (dir, Store::open(path).unwrap())
    });
    store
}

/// The mesh of the small series.
pub(crate) fn mesh() -> Arc<Mesh> {
    Arc::new(stored().mesh().unwrap())
}

/// The small series, with its own values.
pub(crate) fn jet() -> Arc<Series> {
    Arc::new(Series::open(stored(), None).unwrap())
}

/// A series of this many steps on the mesh of the small one; step s has the value s everywhere.
pub(crate) fn logged(steps: usize) -> (Arc<Series>, Log) {
    of_field(steps, field())
}

/// As above, with a field that has no known finite value.
pub(crate) fn without_values(steps: usize) -> Arc<Series> {
    let mut field = field();
    (field.range, field.range_per_step) = (None, vec![None; steps]);
    of_field(steps, field).0
}

fn field() -> StoredField {
    let name = stored().fields()[0].name.clone();
    stored().field(&FieldSelector { name, component: None }).unwrap().info().clone()
}

fn of_field(steps: usize, field: StoredField) -> (Arc<Series>, Log) {
    let log = Log::default();
    let times = TimeAxis { values: (0..steps).map(|step| step as f64).collect() };
    let (source, blocks) =
        (Box::new(Fake { field: field.clone(), steps, log: log.clone() }), Arc::new(BlockCache::new(0)));
    (
        Arc::new(Series {
            mesh: mesh(),
            times,
            field,
            source,
            blocks,
            rankings: Default::default(),
            beside: Default::default(),
            functions: Default::default(),
            ranges: Default::default(),
            quantities: Default::default(),
        }),
        log,
    )
}

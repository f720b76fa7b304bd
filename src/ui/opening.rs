//! Opening a store, or importing a source to the cache first, on a thread of its own.

pub use super::first_picture::FirstPicture;
use super::picture::Picture;
use super::worker::lock;
use crate::codec::BlockCache;
use crate::error::FileError;
use crate::field::FieldSelector;
use crate::ingest::{CacheError, CacheEvent, ImportCache, IngestError, Origin};
use crate::pipeline::Series;
use crate::store::Store;
use crate::task::{Cancel, Progress, panic_message};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Callback for new results or progress.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// Options of opening.
#[derive(Clone, Debug)]
pub struct OpeningOptions {
    /// Cache that sources are imported to.
    pub cache: ImportCache,
    /// Bytes for blocks of steps.
    pub block_bytes: u64,
    /// Blocks of a series that is played, within whose budget this one stays; `None`: its own.
    pub blocks: Option<Arc<BlockCache>>,
    /// The field; `None`: the first.
    pub field: Option<FieldSelector>,
    /// The picture of a source that is drawn while its mesh is built and its steps are imported; `None`: there is none.
    pub first_picture: Option<FirstPicture>,
}

impl Default for OpeningOptions {
    fn default() -> Self {
        Self {
            cache: ImportCache::of_user(),
            block_bytes: Series::BLOCK_BYTES,
            blocks: None,
            field: None,
            first_picture: None,
        }
    }
}

/// An opened series.
#[derive(Debug)]
pub struct Opened {
    /// Store of the series and other fields.
    pub store: Arc<Store>,
    /// The series to be played.
    pub series: Arc<Series>,
    /// Absolute path that opens the same again: the store or the source that was named; of several sources, the store in the cache.
    pub path: PathBuf,
    /// Name for the title: that of the file, and the number of further ones.
    pub name: String,
    /// Whether the series was imported, and the report of that.
    pub origin: Origin,
}

/// Result of opening.
#[derive(Debug)]
pub enum OpeningEnd {
    /// Success.
    Opened(Box<Opened>),
    /// Cancelled; nothing half done is left.
    Cancelled,
    /// The problem and its remedy.
    Failed(String),
}

/// Progress of opening. `fraction`, and within a stage `done`, never decrease.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OpeningProgress {
    /// Current stage, for the user.
    pub stage: String,
    /// Completed units of the stage.
    pub done: u64,
    /// Units of the stage; 0 if they cannot be counted.
    pub total: u64,
    /// Name of the units, in the plural.
    pub unit: String,
    /// Share of the whole that is done, 0..=1; 1 at the end, even after a failure.
    pub fraction: f64,
    /// Estimated time left, once known.
    pub left: Option<Duration>,
}

/// Shares of the whole at which the import of steps begins and ends. The work before (the mesh) and after (statistics, opening the store)
/// cannot be counted, and is short beside the steps of a long series.
const STEPS_SHARE: [f64; 2] = [0.05, 0.95];

/// Shortest time between two wake-ups for progress.
const WAKE_PAUSE: Duration = Duration::from_millis(50);

/// State shared by the thread and its owner.
struct Shared {
    /// Name of what is opened, for the user.
    name: String,
    state: Mutex<State>,
    wake: Wake,
}

#[derive(Default)]
struct State {
    now: OpeningProgress,
    /// Start of the import of steps.
    steps_begun: Option<Instant>,
    woken: Option<Instant>,
    picture: Option<Arc<Picture>>,
    end: Option<OpeningEnd>,
}

/// An opening in progress. Dropping it cancels it.
pub struct Opening {
    shared: Arc<Shared>,
    cancel: Cancel,
    paths: Vec<PathBuf>,
}

impl Opening {
    /// Starts to open a store or a source, or several sources as one series. `wake` is called, from another thread, on progress and at the
    /// end.
    pub fn start(paths: Vec<PathBuf>, options: OpeningOptions, wake: Wake) -> Self {
        let opened = paths.clone();
        Self::start_job(paths, wake, move |shared, cancel| open(&opened, &options, shared, cancel))
    }

    /// Starts to open another field of the store of an opened series, on the same mesh and within the same budget.
    pub fn start_field(opened: Opened, field: FieldSelector, wake: Wake) -> Self {
        let paths = vec![opened.path.clone()];
        Self::start_job(paths, wake, move |_, cancel| {
            let series = Arc::new(opened.series.reopened(&opened.store, Some(&field))?);
            // Steps that cannot be read are reported when shown.
            let _ = series.distribution(cancel);
            Ok(Opened { series, ..opened })
        })
    }

    fn start_job(
        paths: Vec<PathBuf>,
        wake: Wake,
        job: impl FnOnce(&Shared, &Cancel) -> Result<Opened, CacheError> + Send + 'static,
    ) -> Self {
        let name = name_of(&paths);
        let now = OpeningProgress { stage: format!("opening {name}"), ..Default::default() };
        let state = Mutex::new(State { now, ..Default::default() });
        let shared = Arc::new(Shared { name, state, wake });
        let cancel = Cancel::new();
        let (inner, flag) = (shared.clone(), cancel.clone());
        let work = move || {
            let result = catch_unwind(AssertUnwindSafe(|| job(&inner, &flag)));
            inner.finish(match result {
                Ok(Ok(_)) if flag.is_cancelled() => OpeningEnd::Cancelled,
                Ok(Ok(opened)) => OpeningEnd::Opened(Box::new(opened)),
                Ok(Err(error)) if error.is_cancelled() => OpeningEnd::Cancelled,
                Ok(Err(error)) => OpeningEnd::Failed(error.to_string()),
                Err(panic) => OpeningEnd::Failed(format!(
                    "a defect of tetreel: opening panicked: {}; please report it",
                    panic_message(&*panic)
                )),
            });
        };
        if let Err(e) = std::thread::Builder::new().name("opening".to_owned()).spawn(work) {
            shared.finish(OpeningEnd::Failed(format!("cannot start a thread: {e}")));
        }
        Self { shared, cancel, paths }
    }

    /// Paths that are being opened.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// Progress so far.
    pub fn progress(&self) -> OpeningProgress {
        lock(&self.shared.state).now.clone()
    }

    /// A picture of some cells of the first step, once there is one.
    pub fn picture(&self) -> Option<Arc<Picture>> {
        lock(&self.shared.state).picture.clone()
    }

    /// The result, once; `None` before and after.
    pub fn take(&self) -> Option<OpeningEnd> {
        lock(&self.shared.state).end.take()
    }

    /// Requests a cancel: opening soon ends with [`OpeningEnd::Cancelled`], or with success if it was about to end.
    pub fn cancel(&self) {
        self.cancel.cancel();
    }
}

impl Drop for Opening {
    fn drop(&mut self) {
        self.cancel();
    }
}

impl Shared {
    /// Changes the progress, and wakes the window if the last wake-up was long ago or this is `urgent`.
    fn change(&self, urgent: bool, change: impl FnOnce(&mut State)) {
        let mut state = lock(&self.state);
        change(&mut state);
        let is_due = urgent || state.woken.is_none_or(|woken| woken.elapsed() >= WAKE_PAUSE);
        if is_due {
            state.woken = Some(Instant::now());
        }
        drop(state);
        if is_due {
            (self.wake)();
        }
    }

    /// Begins a stage without countable units.
    fn stage(&self, stage: String, fraction: f64) {
        self.change(true, |state| {
            let fraction = state.now.fraction.max(fraction);
            state.now = OpeningProgress { stage, fraction, ..Default::default() };
        });
    }

    fn finish(&self, end: OpeningEnd) {
        self.change(true, |state| {
            state.now = OpeningProgress { fraction: 1.0, left: None, done: state.now.total, ..state.now.clone() };
            state.end = Some(end);
        });
    }
}

impl Progress for Shared {
    fn begin(&self, _stage: &str, total: u64, unit: &str) {
        self.change(true, |state| {
            let fraction = state.now.fraction.max(STEPS_SHARE[0]);
            let (stage, unit) = (format!("importing {}", self.name), unit.to_owned());
            state.now = OpeningProgress { stage, total, unit, fraction, ..Default::default() };
            state.steps_begun = Some(Instant::now());
        });
    }

    fn advance(&self, n: u64) {
        self.change(false, |state| {
            let now = &mut state.now;
            now.done = now.done.saturating_add(n).min(now.total);
            let share = now.done as f64 / now.total.max(1) as f64;
            now.fraction = now.fraction.max(STEPS_SHARE[0] + share * (STEPS_SHARE[1] - STEPS_SHARE[0]));
            let elapsed = state.steps_begun.map_or(Duration::ZERO, |begun| begun.elapsed());
            now.left = (share > 0.0).then(|| elapsed.mul_f64((1.0 - share) / share));
        });
    }

    fn end(&self) {
        self.stage("writing statistics".to_owned(), STEPS_SHARE[1]);
    }

    fn say(&self, _line: &str) {}
}

/// The work of the thread.
fn open(paths: &[PathBuf], options: &OpeningOptions, shared: &Shared, cancel: &Cancel) -> Result<Opened, CacheError> {
    // Readers would report the kind of a file before its absence.
    for path in paths {
        std::fs::metadata(path).map_err(|e| {
            let error = FileError::io(path, "open", &e);
            if e.kind() == std::io::ErrorKind::NotFound { error.remedy("was it moved or renamed?") } else { error }
        })?;
    }
    let name = &shared.name;
    let (store, origin) = open_or_import(paths, options, shared, cancel)?;
    if cancel.is_cancelled() {
        return Err(IngestError::Cancelled.into());
    }
    shared.stage(format!("reading the mesh of {name}"), STEPS_SHARE[1]);
    let own = || Arc::new(BlockCache::new(options.block_bytes));
    let blocks = options.blocks.clone().unwrap_or_else(own);
    let series = Series::open_with(&store, options.field.as_ref(), blocks)?;
    // Computed here, so that the window need not wait. Steps that cannot be read are reported when shown.
    let _ = series.distribution(cancel);
    let path = match paths {
        [path] => path,
        _ => store.path(),
    };
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let (store, series, name) = (Arc::new(store), Arc::new(series), name.clone());
    Ok(Opened { store, series, path, name, origin })
}

/// Opens a store, or imports a source, while another thread draws the first picture of it.
fn open_or_import(
    paths: &[PathBuf],
    options: &OpeningOptions,
    shared: &Shared,
    cancel: &Cancel,
) -> Result<(Store, Origin), CacheError> {
    let (name, is_over) = (&shared.name, &Cancel::new());
    std::thread::scope(|scope| {
        let mut announce = |event: CacheEvent<'_>| match event {
            CacheEvent::Waiting(_) => shared.stage(format!("waiting for another import of {name}"), 0.0),
            CacheEvent::Importing(_) => shared.stage(format!("reading the mesh of {name}"), 0.0),
            CacheEvent::Read(mesh) => {
                let Some(first) = &options.first_picture else { return };
                let Some(step) = mesh.first_step(options.field.as_ref()) else { return };
                scope.spawn(move || {
                    let picture = first.of(&step, is_over).map(Arc::new);
                    shared.change(true, |state| state.picture = picture);
                });
            }
        };
        let result = options.cache.open_or_import(paths, &mut announce, shared, cancel);
        is_over.cancel();
        result
    })
}

/// Name of these files for the user.
fn name_of(paths: &[PathBuf]) -> String {
    let name = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    match paths {
        [] => "nothing".to_owned(),
        [path] => name(path),
        [first, rest @ ..] => format!("{} and {} more", name(first), rest.len()),
    }
}

#[cfg(test)]
#[path = "opening_tests.rs"]
mod tests;

//! Watches a store for added steps.
//!
//! A thread checks the metadata of the store's root every second, and only if the file has changed calls [`Store::refreshed`] (which opens
//! the new store); every tenth time it does so in any case, for file systems with coarse times. A grown series is opened again and kept
//! until taken.

use super::opening::Wake;
use super::worker::lock;
use crate::error::FileResult;
use crate::field::FieldSelector;
use crate::pipeline::Series;
use crate::store::Store;
use crate::task::{Cancel, panic_message};
use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, unbounded};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

/// Interval between checks of a store.
const PAUSE: Duration = Duration::from_secs(1);

/// Number of checks after which unchanged metadata are not trusted.
const LOOKS_TRUSTED: u32 = 10;

/// A store that has grown, or that its owner has.
#[derive(Clone, Debug)]
pub struct Grown {
    /// The store, reopened if it has grown.
    pub store: Arc<Store>,
    /// The followed field of the store, with the mesh and the blocks in memory of the series that it continues.
    pub series: Arc<Series>,
}

/// The followed series and the results not taken yet.
struct State {
    /// What the owner has.
    held: Grown,
    /// Counts changes of the held series by the owner: results for an earlier one are discarded.
    generation: u64,
    found: Option<Grown>,
    /// Problems that were not handed over yet.
    problems: Vec<String>,
}

struct Shared {
    state: Mutex<State>,
    wake: Wake,
}

/// Follows a store until it is dropped.
pub struct Follower {
    shared: Arc<Shared>,
    /// A message requests a check at once. When it closes, the thread ends.
    to_thread: Sender<()>,
}

impl Follower {
    /// Follows a store with an open field. `wake` is called, from another thread, when there is a result to take.
    pub fn start(store: Arc<Store>, series: Arc<Series>, wake: Wake) -> Self {
        Self::start_every(PAUSE, store, series, wake)
    }

    fn start_every(pause: Duration, store: Arc<Store>, series: Arc<Series>, wake: Wake) -> Self {
        let watch = Watch::new(store.clone());
        let held = Grown { store, series };
        let state = State { held, generation: 0, found: None, problems: Vec::new() };
        let shared = Arc::new(Shared { state: Mutex::new(state), wake });
        let (to_thread, commands) = unbounded();
        let inner = shared.clone();
        let work = move || {
            let run = AssertUnwindSafe(|| follow(watch, &inner, &commands, pause));
            if let Err(panic) = catch_unwind(run) {
                let text = panic_message(&*panic);
                complain(
                    &inner,
                    format!("a defect of tetreel: following the store panicked: {text}; please report it"),
                );
            }
        };
        if let Err(error) = std::thread::Builder::new().name("following".to_owned()).spawn(work) {
            complain(&shared, format!("the store is not followed: cannot start a thread: {error}"));
        }
        Self { shared, to_thread }
    }

    /// Switches to another field of the store: results are handed over for it from now on.
    pub fn set_field(&self, series: Arc<Series>) {
        let mut state = lock(&self.shared.state);
        state.held.series = series;
        state.generation += 1;
        state.found = None;
        drop(state);
        // It may have ended with a panic, which was reported.
        let _ = self.to_thread.send(());
    }

    /// New steps, or why there can be none: each once. The store and its series replace those that were given before.
    pub fn take(&self) -> Option<Result<Grown, String>> {
        let mut state = lock(&self.shared.state);
        if !state.problems.is_empty() {
            return Some(Err(state.problems.remove(0)));
        }
        let found = state.found.take()?;
        state.held = found.clone();
        Some(Ok(found))
    }
}

fn complain(shared: &Shared, problem: String) {
    lock(&shared.state).problems.push(problem);
    (shared.wake)();
}

/// The work of the thread.
fn follow(mut watch: Watch, shared: &Shared, commands: &Receiver<()>, pause: Duration) {
    // The last reported problem.
    let mut told: Option<String> = None;
    loop {
        match commands.recv_timeout(pause) {
            Err(RecvTimeoutError::Disconnected) => return,
            Ok(()) | Err(RecvTimeoutError::Timeout) => {}
        }
        match watch.look().and_then(|looked| hand_over(&watch.store, shared).map(|()| looked)) {
            // A check that opened nothing does not clear an earlier problem.
            Ok(false) => {}
            Ok(true) => told = None,
            Err(error) => {
                let text = error.to_string();
                if told.as_ref() != Some(&text) {
                    complain(shared, text.clone());
                    told = Some(text);
                }
            }
        }
    }
}

/// Reopens the field, unless the owner has all steps or a result with them waits to be taken.
fn hand_over(store: &Arc<Store>, shared: &Shared) -> FileResult<()> {
    let (series, generation) = {
        let state = lock(&shared.state);
        let has_all =
            |known: &Grown| Arc::ptr_eq(&known.store, store) && known.series.times().len() >= store.times().len();
        if has_all(&state.held) || state.found.as_ref().is_some_and(has_all) {
            return Ok(());
        }
        (state.held.series.clone(), state.generation)
    };
    // Stores list fields by their full name.
    let field = FieldSelector { name: series.field().name.clone(), component: None };
    let series = Arc::new(series.reopened(store, Some(&field))?);
    // The window asks for percentiles, for which steps are decoded: here, not on its thread. It reports steps that cannot be read.
    let _ = series.distribution(&Cancel::new());
    let mut state = lock(&shared.state);
    // Otherwise a pending message requests the other field.
    if state.generation == generation {
        state.found = Some(Grown { store: store.clone(), series });
        drop(state);
        (shared.wake)();
    }
    Ok(())
}

/// Cheap signs of an exchanged store: length, modification time and file number of its root's metadata.
type Signs = Option<(u64, Option<SystemTime>, u64)>;

fn signs(root: &Path) -> Signs {
    let metadata = std::fs::metadata(root.join("zarr.json")).ok()?;
    #[cfg(unix)]
    let number = std::os::unix::fs::MetadataExt::ino(&metadata);
    #[cfg(not(unix))]
    let number = 0;
    Some((metadata.len(), metadata.modified().ok(), number))
}

/// The newest store seen, and its signs.
struct Watch {
    store: Arc<Store>,
    seen: Signs,
    looks: u32,
}

impl Watch {
    fn new(store: Arc<Store>) -> Self {
        // No signs yet: the store may have grown since it was opened.
        Self { store, seen: None, looks: 0 }
    }

    /// Refreshes the store if needed; returns whether it was opened for that.
    fn look(&mut self) -> FileResult<bool> {
        let now = signs(self.store.path());
        self.looks = (self.looks + 1) % LOOKS_TRUSTED;
        if now == self.seen && self.looks != 0 {
            return Ok(false);
        }
        // Set before refreshing: later changes have other signs.
        self.seen = now;
        if let Some(newer) = self.store.refreshed()? {
            self.store = Arc::new(newer);
        }
        Ok(true)
    }
}

#[cfg(test)]
#[path = "following_tests.rs"]
mod tests;

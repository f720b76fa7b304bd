//! Histograms over which transfer functions are edited: found on threads of their own.
//!
//! - Those of the *whole series* are in the store, or are counted step by step from coarse to fine. They are shown from the first three
//!   steps on (both ends and the middle), then as often as their number doubles and ten times a second, until all are counted and kept
//!   in the store. What is counted is not lost when nobody wants it any more: the next request goes on from there.
//! - Those of *one step* are counted from its scalars, over the axes of the series as far as these are known. A newer step ends the
//!   decoding of an older one, not its counting: while a series plays there are histograms all the time, each with its step.
//!
//! What is shown stays when something fails, with a message.

use super::worker::{BLOCK_BYTES, Gate, Slot, Worker};
use crate::histograms::{Counted, Histogram, Kind, divides_evenly};
use crate::pipeline::Series;
use crate::task::Cancel;
use crate::transfer::Space;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Interval between snapshots while steps are counted.
const SHOWN_EVERY: Duration = Duration::from_millis(100);

/// The steps whose values are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// All.
    Series,
    /// One.
    Step(usize),
}

/// A request for a histogram.
#[derive(Clone, Debug)]
pub struct Asked {
    /// The series.
    pub series: Arc<Series>,
    /// The axes of the histogram.
    pub kind: Space,
    /// The steps counted.
    pub of: Wanted,
}

impl Asked {
    fn is_same(&self, other: &Self) -> bool {
        self.is_like(other) && self.of == other.of
    }

    /// Whether only the step may differ.
    fn is_like(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.series, &other.series) && self.kind == other.kind
    }
}

/// The steps that a histogram counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steps {
    /// Some or all steps of the series.
    Series {
        /// Number of steps counted, spread evenly.
        counted: usize,
        /// Number of steps of the series.
        steps: usize,
    },
    /// This one.
    Step(usize),
}

/// A histogram to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Its axes.
    pub kind: Space,
    /// The steps counted.
    pub of: Steps,
    /// The counts.
    pub histogram: Histogram,
}

/// What is known of a whole series.
#[derive(Clone, Debug, Default)]
struct Found {
    counted: Option<Arc<Counted>>,
    problem: Option<String>,
}

#[derive(Clone)]
struct StepJob {
    series: Arc<Series>,
    kind: Space,
    step: usize,
    /// Raised when the step is not wanted any more.
    decoding: Cancel,
}

type OfStep = Result<Arc<Shown>, String>;

/// Finds histograms. No call blocks.
pub struct Histograms {
    counter: Worker<Arc<Series>>,
    gate: Arc<Gate>,
    of_series: Arc<Slot<Found>>,
    stepper: Worker<StepJob>,
    of_step: Arc<Slot<OfStep>>,
    asked: Option<Asked>,
    /// Whether the series asked for is being counted, or has been.
    is_counting: bool,
    found: Found,
    decoding: Cancel,
    step_problem: Option<String>,
    shown: Option<Arc<Shown>>,
}

impl Histograms {
    /// Starts two threads, which end with their owner. `wake` is called when there is something to [`take`](Self::take).
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn start(wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let (gate, of_series, of_step) =
            (Arc::<Gate>::default(), Arc::<Slot<Found>>::default(), Arc::<Slot<OfStep>>::default());
        let of_thread = gate.clone();
        let work = move |(): &mut (), series: Arc<Series>, cancel: &Cancel, show: &dyn Fn(Found)| {
            count(&series, &of_thread, cancel, show);
        };
        let failed = |series: Arc<Series>, text| Found { counted: series.counted_histograms(), problem: Some(text) };
        let counter = Worker::start("histograms", of_series.filler(wake.clone()), work, failed)?;
        let stepper = Worker::start("histogram", of_step.filler(wake), count_step, |_, text| Err(text))?;
        Ok(Self {
            counter,
            gate,
            of_series,
            stepper,
            of_step,
            asked: None,
            is_counting: false,
            found: Found::default(),
            decoding: Cancel::new(),
            step_problem: None,
            shown: None,
        })
    }

    /// Requests a histogram in place of the last one; nothing changes if it is the same. `None`: nobody looks at histograms, and nothing is
    /// counted. The counting of a series that has begun goes on while a step of it is asked for.
    pub fn ask(&mut self, asked: Option<Asked>) {
        let before = self.asked.as_ref();
        if asked.as_ref().zip(before).is_some_and(|(asked, before)| asked.is_same(before)) {
            return;
        }
        // Requests of the same axes differ in steps: what is being counted is still wanted.
        let is_next_step = matches!(
            (before, &asked),
            (Some(before), Some(now)) if now.is_like(before) && now.of != Wanted::Series
        );
        let is_same_series = before.zip(asked.as_ref()).is_some_and(|(a, b)| Arc::ptr_eq(&a.series, &b.series));
        self.forget_step(is_next_step);
        if !is_same_series {
            self.forget_series();
        }
        self.asked = asked;
        match &self.asked {
            Some(Asked { series, kind, of: Wanted::Step(step) }) => {
                let job = StepJob { series: series.clone(), kind: *kind, step: *step, decoding: self.decoding.clone() };
                self.stepper.give(job);
            }
            Some(Asked { series, of: Wanted::Series, .. }) => {
                if !self.is_counting {
                    self.is_counting = true;
                    self.counter.give(series.clone());
                }
                self.show_series();
            }
            None => {}
        }
    }

    /// Ends what is done for the last step, at least its decoding.
    fn forget_step(&mut self, finishes: bool) {
        self.decoding.cancel();
        self.decoding = Cancel::new();
        self.step_problem = None;
        if !finishes {
            self.stepper.stop();
            self.of_step.clear();
        }
    }

    fn forget_series(&mut self) {
        self.counter.stop();
        self.of_series.clear();
        (self.is_counting, self.found, self.shown) = (false, Found::default(), None);
    }

    /// Takes what was found; whether there is something else to be drawn or said.
    pub fn take(&mut self) -> bool {
        let mut is_new = false;
        if let Some(found) = self.of_series.take() {
            self.found = found;
            is_new = self.show_series();
        }
        match self.of_step.take() {
            Some(Ok(shown)) => (self.shown, self.step_problem, is_new) = (Some(shown), None, true),
            Some(Err(problem)) => (self.step_problem, is_new) = (Some(problem), true),
            None => {}
        }
        is_new
    }

    /// Shows the histogram of the series, if that is asked for and known.
    fn show_series(&mut self) -> bool {
        let Some(Asked { kind, of: Wanted::Series, .. }) = self.asked else { return false };
        if let Some(counted) = &self.found.counted
            && let Some(histogram) = counted.of_kind(&kind_of(kind))
        {
            let of = Steps::Series { counted: counted.steps, steps: counted.of };
            self.shown = Some(Arc::new(Shown { kind, of, histogram: histogram.clone() }));
        }
        true
    }

    /// The last histogram of the series asked for: until a newer one is known, that of another step or other axes.
    pub fn shown(&self) -> Option<&Arc<Shown>> {
        self.shown.as_ref()
    }

    /// Why the histogram asked for cannot be had, is not that of all steps, or is not kept in the store.
    pub fn problem(&self) -> Option<&str> {
        match self.asked.as_ref()?.of {
            Wanted::Series => self.found.problem.as_deref(),
            Wanted::Step(_) => self.step_problem.as_deref(),
        }
    }

    /// Pauses the counting of series after the current step, or resumes it: for while the user waits for frames. Steps are counted all the
    /// same.
    pub fn pause(&self, pauses: bool) {
        self.gate.set(pauses);
    }
}

impl Drop for Histograms {
    fn drop(&mut self) {
        self.decoding.cancel();
        // Raised first, so that a thread leaving the gate sees it.
        self.counter.stop();
        self.gate.set(false);
    }
}

/// The kind of histogram over these axes.
fn kind_of(space: Space) -> Kind<'static> {
    match space {
        Space::Scalar => Kind::SCALAR,
        Space::Cov => Kind::COV,
        Space::ScalarGradient => Kind::SCALAR_GRADIENT,
        Space::ScalarCov => Kind::SCALAR_COV,
    }
}

/// Counts a series, and calls `show` with snapshots.
fn count(series: &Arc<Series>, gate: &Gate, cancel: &Cancel, show: &dyn Fn(Found)) {
    let apart = series.apart(BLOCK_BYTES);
    let mut shown: Option<Instant> = None;
    loop {
        gate.pass();
        let mut pauses = false;
        let ended = apart.count_histograms(cancel, &mut |counted| {
            let is_due = shown.is_some_and(|at| at.elapsed() >= SHOWN_EVERY) || divides_evenly(counted.steps);
            if is_due && !counted.is_whole() {
                show(Found { counted: Some(Arc::new(counted.clone())), problem: None });
                shown = Some(Instant::now());
            }
            // Others who need the histograms may go on with them in the meantime.
            pauses = gate.is_closed();
            !pauses
        });
        let problem = match ended {
            Ok(Some(whole)) => {
                let not_kept = whole.not_kept.as_ref();
                let problem = not_kept.map(|why| format!("the histograms are counted again next time: {why}"));
                return show(Found { counted: Some(whole), problem });
            }
            Ok(None) if cancel.is_cancelled() => return,
            Ok(None) if pauses => continue,
            Ok(None) => "the series has no histograms".to_owned(),
            Err(error) => error.to_string(),
        };
        return show(Found { counted: apart.counted_histograms(), problem: Some(problem) });
    }
}

/// A series, and the same for a reader beside its player.
type Beside = Option<(Arc<Series>, Arc<Series>)>;

fn count_step(kept: &mut Beside, job: StepJob, _: &Cancel, put: &dyn Fn(OfStep)) {
    let StepJob { series, kind, step, decoding } = job;
    let last = kept.take().filter(|(of, _)| Arc::ptr_eq(of, &series));
    let (_, apart) = kept.insert(last.unwrap_or_else(|| (series.clone(), series.apart(BLOCK_BYTES))));
    match apart.histogram_of_step(&kind_of(kind), step, &decoding) {
        Ok(Some(histogram)) => put(Ok(Arc::new(Shown { kind, of: Steps::Step(step), histogram }))),
        Ok(None) => {}
        Err(error) => put(Err(error.to_string())),
    }
}

#[cfg(test)]
#[path = "histograms_tests.rs"]
mod tests;

//! Background threads: each works on the newest job it is given.

use crate::pipeline::{Pipeline, Series};
use crate::task::{Cancel, panic_message};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Bytes of blocks for a worker that reads steps: a few blocks of 64 steps of a million cells, or one larger block.
pub(super) const BLOCK_BYTES: u64 = 32 << 20;

/// Locks a mutex, also after a panic of a thread that had it: what it protects is valid at all times.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A pipeline that renders for a worker, and keeps data of the last frames.
#[derive(Default)]
pub(super) struct SeriesPipeline(Option<(Arc<Series>, Pipeline)>);

impl SeriesPipeline {
    /// The pipeline of a series: that of the last call if it was of the same one.
    pub(super) fn of(&mut self, series: &Arc<Series>) -> &mut Pipeline {
        let last = self.0.take().filter(|(last, _)| Arc::ptr_eq(last, series));
        let new = || (series.clone(), Pipeline::new(series.apart(BLOCK_BYTES)));
        &mut self.0.insert(last.unwrap_or_else(new)).1
    }

    /// As [`Self::of`], to be put back.
    pub(super) fn take(&mut self, series: &Arc<Series>) -> Pipeline {
        self.of(series);
        self.0.take().map_or_else(|| Pipeline::new(series.apart(BLOCK_BYTES)), |(_, pipeline)| pipeline)
    }

    /// Puts back the pipeline of a series.
    pub(super) fn put(&mut self, series: &Arc<Series>, pipeline: Pipeline) {
        self.0 = Some((series.clone(), pipeline));
    }
}

/// One thread, which ends with its owner. It is the only one of a rayon pool: parallel code runs on it alone, and never waits behind a
/// renderer's tasks.
pub(super) struct Worker<J> {
    shared: Arc<Shared<J>>,
    _pool: ThreadPool,
}

struct Shared<J> {
    state: Mutex<State<J>>,
    changed: Condvar,
}

struct State<J> {
    next: Option<J>,
    /// Cancel flag of the current or last job.
    current: Cancel,
    is_over: bool,
}

impl<J: Clone + Send + 'static> Worker<J> {
    /// Starts the thread. `work` does a job and passes its results on to `put`. What it keeps from job to job is in `S`, and begins afresh
    /// after a panic, which is a fault of this program: `failed` then makes the result from the panic's message.
    pub(super) fn start<S: Default + 'static, R: 'static>(
        name: &str,
        put: impl Fn(R, &Cancel) + Send + 'static,
        work: impl Fn(&mut S, J, &Cancel, &dyn Fn(R)) + Send + 'static,
        failed: impl Fn(J, String) -> R + Send + 'static,
    ) -> io::Result<Self> {
        let name = name.to_owned();
        let pool = ThreadPoolBuilder::new().num_threads(1).thread_name(move |_| name.clone()).build();
        let pool = pool.map_err(io::Error::other)?;
        let state = Mutex::new(State::<J> { next: None, current: Cancel::new(), is_over: false });
        let shared = Arc::new(Shared { state, changed: Condvar::new() });
        let of_thread = shared.clone();
        pool.spawn(move || {
            let mut kept = S::default();
            while let Some((job, cancel)) = of_thread.next() {
                let copy = job.clone();
                let put = |result| put(result, &cancel);
                if let Err(panic) = catch_unwind(AssertUnwindSafe(|| work(&mut kept, job, &cancel, &put))) {
                    kept = S::default();
                    let said = panic_message(&*panic);
                    put(failed(copy, format!("tetreel failed at this: {said}; please report this")));
                }
            }
        });
        Ok(Self { shared, _pool: pool })
    }

    /// Gives a job, replacing a waiting one. The current one is finished.
    pub(super) fn give(&self, job: J) {
        lock(&self.shared.state).next = Some(job);
        self.shared.changed.notify_all();
    }
}

impl<J> Worker<J> {
    /// Drops the waiting job and cancels the current one.
    pub(super) fn stop(&self) {
        let mut state = lock(&self.shared.state);
        state.next = None;
        state.current.cancel();
    }
}

impl<J> Drop for Worker<J> {
    fn drop(&mut self) {
        self.stop();
        lock(&self.shared.state).is_over = true;
        self.shared.changed.notify_all();
    }
}

impl<J> Shared<J> {
    /// The next job and its cancel flag; `None` at the end.
    fn next(&self) -> Option<(J, Cancel)> {
        let mut state = lock(&self.state);
        loop {
            if state.is_over {
                return None;
            }
            if let Some(job) = state.next.take() {
                state.current = Cancel::new();
                return Some((job, state.current.clone()));
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// A gate that blocks a thread while closed.
#[derive(Default)]
pub(super) struct Gate {
    is_closed: Mutex<bool>,
    opened: Condvar,
}

impl Gate {
    pub(super) fn set(&self, is_closed: bool) {
        *lock(&self.is_closed) = is_closed;
        self.opened.notify_all();
    }

    pub(super) fn is_closed(&self) -> bool {
        *lock(&self.is_closed)
    }

    /// Waits until the gate is open.
    pub(super) fn pass(&self) {
        let closed = lock(&self.is_closed);
        drop(self.opened.wait_while(closed, |is_closed| *is_closed).unwrap_or_else(PoisonError::into_inner));
    }
}

/// A slot for the newest result.
#[derive(Debug)]
pub(super) struct Slot<T>(Mutex<Option<T>>);

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T> Slot<T> {
    /// Stores a result, unless `cancel` is raised: if its owner raises it and then clears the slot, the slot stays empty.
    pub(super) fn put(&self, value: T, cancel: &Cancel) {
        let mut slot = lock(&self.0);
        if !cancel.is_cancelled() {
            *slot = Some(value);
        }
    }

    pub(super) fn take(&self) -> Option<T> {
        lock(&self.0).take()
    }

    pub(super) fn clear(&self) {
        lock(&self.0).take();
    }
}

impl<T: 'static> Slot<T> {
    /// Stores results as [`Self::put`] does, and calls `wake` after each.
    pub(super) fn filler(self: &Arc<Self>, wake: Arc<dyn Fn() + Send + Sync>) -> impl Fn(T, &Cancel) + use<T> {
        let slot = self.clone();
        move |value, cancel| {
            slot.put(value, cancel);
            wake();
        }
    }
}

impl<T: Clone> Slot<T> {
    pub(super) fn get(&self) -> Option<T> {
        lock(&self.0).clone()
    }
}

/// Helpers for the tests of workers.
#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::{Duration, Instant};

    /// Waits until `look` returns a value; fails after a time limit.
    pub(in crate::ui) fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
        let begun = Instant::now();
        loop {
            if let Some(found) = look() {
                return found;
            }
            assert!(begun.elapsed() < Duration::from_secs(60), "no {what}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// A counter of wake-ups, and its callback.
    pub(in crate::ui) fn counted() -> (Arc<AtomicUsize>, Arc<dyn Fn() + Send + Sync>) {
        let count = Arc::new(AtomicUsize::new(0));
        let counter = count.clone();
        let wake = move || {
            counter.fetch_add(1, Ordering::SeqCst);
        };
        (count, Arc::new(wake))
    }

    type Sum = Arc<Slot<Result<u32, String>>>;

    /// Adds up jobs and panics at 13. The weak reference dies with its thread.
    fn adder() -> (Worker<u32>, Sum, std::sync::Weak<()>) {
        let slot = Arc::new(Slot::default());
        let alive = Arc::new(());
        let gone = Arc::downgrade(&alive);
        let work = move |sum: &mut u32, job: u32, _: &Cancel, put: &dyn Fn(Result<u32, String>)| {
            let _held = &alive;
            assert_ne!(job, 13, "an unlucky number");
            *sum += job;
            put(Ok(*sum));
        };
        let failed = |job: u32, text| Err(format!("{job}: {text}"));
        (Worker::start("adder", slot.filler(Arc::new(|| ())), work, failed).unwrap(), slot, gone)
    }

    #[test]
    fn after_a_panic_it_says_so_and_begins_afresh() {
        let (worker, slot, _) = adder();
        let ask = |job| {
            worker.give(job);
            wait_for("result", || slot.take())
        };
        assert_eq!((ask(1), ask(2)), (Ok(1), Ok(3)));
        let error = ask(13).unwrap_err();
        assert!(error.starts_with("13: ") && error.contains("an unlucky number"), "{error}");
        assert_eq!(ask(4), Ok(4), "what the panic may have left behind is gone");
    }

    #[test]
    fn the_thread_ends_with_its_owner() {
        let (worker, _, gone) = adder();
        worker.give(1);
        assert!(gone.upgrade().is_some());
        drop(worker);
        wait_for("end of the thread", || gone.upgrade().is_none().then_some(()));
    }

    #[test]
    fn a_job_that_waits_is_replaced_and_one_at_hand_is_cancelled_by_stop_alone() {
        let seen = Arc::new(Mutex::new(Vec::new()));
        let log = seen.clone();
        let work = move |(): &mut (), job: u32, cancel: &Cancel, _: &dyn Fn(())| {
            log.lock().unwrap().push((job, false));
            while job == 0 && !cancel.is_cancelled() {
                std::thread::yield_now();
            }
            log.lock().unwrap().push((job, true));
        };
        let worker = Worker::start("waiter", |(), _| (), work, |_, text| panic!("{text}")).unwrap();
        worker.give(0);
        wait_for("begin", || (!seen.lock().unwrap().is_empty()).then_some(()));
        (1..=5).for_each(|job| worker.give(job));
        assert_eq!(*seen.lock().unwrap(), [(0, false)], "the one at hand goes on");
        worker.stop();
        worker.give(6);
        let all = wait_for("the last", || Some(seen.lock().unwrap().clone()).filter(|all| all.contains(&(6, true))));
        assert_eq!(all, [(0, false), (0, true), (6, false), (6, true)]);
    }

    #[test]
    fn a_result_that_nobody_wants_any_more_stays_out_of_the_slot() {
        let (slot, cancel) = (Slot::default(), Cancel::new());
        slot.put(1, &cancel);
        assert_eq!((slot.get(), slot.take(), slot.take()), (Some(1), Some(1), None));
        cancel.cancel();
        slot.put(2, &cancel);
        assert_eq!(slot.take(), None);
    }
}

//! Progress reports and cancellation of long work.

use std::any::Any;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// A flag shared between the one who may cancel (Ctrl-C, a seek) and the work, which checks it between two units.
#[derive(Clone, Debug, Default)]
pub struct Cancel {
    raised: Arc<AtomicBool>,
    /// Checks left until it is raised.
    #[cfg(test)]
    looks_left: Option<Arc<std::sync::atomic::AtomicU64>>,
}

impl Cancel {
    /// A flag that is not raised.
    pub fn new() -> Self {
        Self::default()
    }

    /// A flag that is raised after this many checks.
    #[cfg(test)]
    pub(crate) fn after_looks(looks: u64) -> Self {
        Self { looks_left: Some(Arc::new(looks.into())), ..Self::default() }
    }

    /// Asks the work to stop at its next check.
    pub fn cancel(&self) {
        self.raised.store(true, Ordering::Relaxed);
    }

    /// Whether the work should stop.
    pub fn is_cancelled(&self) -> bool {
        #[cfg(test)]
        if let Some(left) = &self.looks_left
            && left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| left.checked_sub(1)).is_err()
        {
            self.cancel();
        }
        self.raised.load(Ordering::Relaxed)
    }
}

/// The message of a caught panic.
pub fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "it does not say why".to_owned())
}

/// Limit on the threads that work at a time: a window in use needs a core for itself.
///
/// Threads take a [`Turn`] before each short unit of work, so that a new limit holds as soon as the current units are done.
#[derive(Clone, Debug, Default)]
pub struct ThreadLimit(Arc<(Mutex<Turns>, Condvar)>);

#[derive(Debug, Default)]
struct Turns {
    /// Most threads at work; `None`: no limit.
    most: Option<usize>,
    taken: usize,
}

/// The right to work on one unit, until it is dropped.
#[derive(Debug)]
pub struct Turn<'a>(&'a ThreadLimit);

impl ThreadLimit {
    /// No limit until one is set.
    pub fn none() -> Self {
        Self::default()
    }

    /// Sets the limit, at least one thread; `None`: no limit.
    pub fn set(&self, most: Option<usize>) {
        self.turns().most = most.map(|most| most.max(1));
        self.0.1.notify_all();
    }

    /// Waits until another thread may work. A thread must not hold two turns.
    pub fn turn(&self) -> Turn<'_> {
        let is_full = |turns: &mut Turns| turns.most.is_some_and(|most| turns.taken >= most);
        let waited = self.0.1.wait_while(self.turns(), is_full);
        waited.unwrap_or_else(PoisonError::into_inner).taken += 1;
        Turn(self)
    }

    fn turns(&self) -> MutexGuard<'_, Turns> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        let mut turns = self.0.turns();
        turns.taken -= 1;
        if turns.most.is_some() {
            self.0.0.1.notify_one();
        }
    }
}

/// Receives the progress of long work. Implementations draw a bar, or do nothing ([`Silent`]).
pub trait Progress: Sync {
    /// A stage of `total` units begins (`unit` is a plural noun: "steps", "frames").
    fn begin(&self, stage: &str, total: u64, unit: &str);
    /// `n` more units of the current stage are done.
    fn advance(&self, n: u64);
    /// The current stage is over.
    fn end(&self);
    /// Shows a line to the user.
    fn say(&self, line: &str);
}

/// Progress that is discarded.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64, _unit: &str) {}
    fn advance(&self, _n: u64) {}
    fn end(&self) {}
    fn say(&self, _line: &str) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::sync::atomic::AtomicUsize;
    use std::time::Duration;

    /// The most threads, of four, that worked at a time.
    fn most_at_work(limit: &ThreadLimit, then: impl Fn(usize) + Sync) -> usize {
        let (at_work, most, units) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        let _turn = limit.turn();
                        let now = at_work.fetch_add(1, Ordering::SeqCst) + 1;
                        most.fetch_max(now, Ordering::SeqCst);
                        std::thread::sleep(Duration::from_micros(200));
                        at_work.fetch_sub(1, Ordering::SeqCst);
                        then(units.fetch_add(1, Ordering::SeqCst));
                    }
                });
            }
        });
        assert_eq!(units.into_inner(), 200);
        most.into_inner()
    }

    #[test]
    fn no_more_threads_than_allowed_work_at_a_time() {
        let limit = ThreadLimit::none();
        assert!(most_at_work(&limit, |_| ()) > 2, "the measure sees more than the limits below");
        for most in [1, 2] {
            limit.set(Some(most));
            assert_eq!(most_at_work(&limit, |_| ()), most);
        }
        limit.set(Some(0));
        assert_eq!(most_at_work(&limit, |_| ()), 1, "somebody must do it");
    }

    #[test]
    fn a_limit_that_changes_under_way_leaves_nobody_waiting() {
        let limit = ThreadLimit::none();
        limit.set(Some(1));
        most_at_work(&limit, |unit| limit.set((unit % 3 > 0).then_some(unit % 3)));
        limit.set(None);
        assert!(most_at_work(&limit, |_| ()) > 1);
    }
}

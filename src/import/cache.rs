//! A small cache of the last steps in memory, shared by the threads that read them.

use crate::error::FileResult;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Most cached steps.
const MAX_STEPS: usize = 4;
/// Bytes beyond which only the newest step is cached.
const MAX_BYTES: usize = 1 << 30;

/// A step that is loaded, or being loaded by the thread that requested it first.
type Slot<T> = Arc<OnceLock<FileResult<Arc<T>>>>;

/// Steps by index, the most recently used last.
pub(super) struct StepCache<T> {
    slots: Mutex<VecDeque<(usize, Slot<T>)>>,
}

impl<T> Default for StepCache<T> {
    fn default() -> Self {
        Self { slots: Mutex::default() }
    }
}

impl<T> StepCache<T> {
    /// The step of that index, cached or loaded with `load`. Threads that request a step being loaded wait for it. Errors are not cached.
    /// `bytes` is the memory size of a step.
    pub(super) fn get(
        &self,
        step: usize,
        load: impl FnOnce() -> FileResult<T>,
        bytes: impl Fn(&T) -> usize,
    ) -> FileResult<Arc<T>> {
        let slot = self.slot(step);
        let result = slot.get_or_init(|| load().map(Arc::new)).clone();
        let mut slots = self.lock();
        if result.is_err() {
            slots.retain(|(_, other)| !Arc::ptr_eq(other, &slot));
        }
        let size = |slot: &Slot<T>| slot.get().and_then(|loaded| loaded.as_ref().ok()).map_or(0, |step| bytes(step));
        while slots.len() > 1 && slots.iter().map(|(_, slot)| size(slot)).sum::<usize>() > MAX_BYTES {
            slots.pop_front();
        }
        result
    }

    fn slot(&self, step: usize) -> Slot<T> {
        let mut slots = self.lock();
        if let Some(at) = slots.iter().position(|(index, _)| *index == step)
            && let Some(found) = slots.remove(at)
        {
            slots.push_back(found.clone());
            return found.1;
        }
        if slots.len() == MAX_STEPS {
            slots.pop_front();
        }
        let slot = Slot::default();
        slots.push_back((step, slot.clone()));
        slot
    }

    /// Locks the queue, which a panic elsewhere leaves in a valid state.
    fn lock(&self) -> MutexGuard<'_, VecDeque<(usize, Slot<T>)>> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::FileError;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn a_step_is_loaded_once_while_it_is_among_the_last() {
        let cache = StepCache::default();
        let loads = AtomicUsize::new(0);
        let get = |step: usize| {
            let load = || {
                loads.fetch_add(1, Ordering::SeqCst);
                Ok(step * 10)
            };
            *cache.get(step, load, |_| 1).expect("loads")
        };
        std::thread::scope(|scope| (0..8).for_each(|_| drop(scope.spawn(|| assert_eq!(get(3), 30)))));
        assert_eq!(loads.load(Ordering::SeqCst), 1);
        for step in [0, 1, 2, 3, 0] {
            assert_eq!(get(step), step * 10);
        }
        assert_eq!(loads.load(Ordering::SeqCst), 4);
        get(9); // drops step 1, the one not asked for the longest
        get(1);
        assert_eq!(loads.load(Ordering::SeqCst), 6);
    }

    #[test]
    fn large_steps_are_not_kept_beside_each_other_and_errors_not_at_all() {
        let cache = StepCache::default();
        for step in 0..3 {
            cache.get(step, || Ok(step), |_| MAX_BYTES).expect("loads");
            assert_eq!(cache.lock().len(), 1);
        }
        let failed = cache.get(7, || Err(FileError::invalid("a", "", "b")), |_| 0);
        assert!(failed.is_err());
        assert_eq!(cache.get(7, || Ok(7), |_| 0).ok().as_deref(), Some(&7));
    }
}

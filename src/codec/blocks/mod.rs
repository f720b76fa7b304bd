//! Blocks in memory, within a byte budget shared by several decoders and threads.
//!
//! A block is what a decoder reads at once: 64 compressed steps with codec `vq`, one step with `raw`. A [`BlockCache`] keeps blocks as long
//! as they fit. A player announces with [`BlockCache::expect`] which blocks it will need, in the order of their next use, and has them
//! loaded before they are requested. When there are too many, these are evicted first:
//!
//! 1. blocks that nobody expects, the one used longest ago first;
//! 2. of those expected, the one whose next use is furthest away.
//!
//! The second rule is the optimal one for blocks of one size (Belady, IBM Systems Journal 5, 1966): in a loop over more than fits it keeps
//! what it can, where the first alone would evict every block just before it is needed again. A block larger than the budget stays, alone,
//! until another one is loaded: a small budget costs time and nothing else. The cache holds at most the budget and a block that has just
//! been loaded. A thread that uses a block holds its [`Arc`]; the memory is freed when that thread is done.
//!
//! A block that several threads request is loaded by the first of them, without a thread of the pool: one that waits in the pool could be
//! given this same work. The others wait for it. Failures are not kept, since the file may be restored; if the load is cancelled, one of
//! the waiting threads begins it again. For one thread, what is resident depends on the calls alone.

#[cfg(test)]
mod decoder_tests;
mod residents;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod thread_tests;

use super::Stop;
use super::stop::{go_on, unless_cancelled};
use super::vq::VqBlock;
use crate::error::FileResult;
use crate::task::Cancel;
use residents::{Resident, Residents};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How often a thread that waits for another thread's load checks its own cancel flag.
const PATIENCE: Duration = Duration::from_millis(2);

/// Identifies the decoder of a block, within the process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DecoderId(u64);

impl DecoderId {
    /// An identifier that no other decoder has.
    pub fn unique() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// Identifies a block in a cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BlockKey {
    /// The block's decoder.
    pub decoder: DecoderId,
    /// Number of the block, from 0.
    pub index: usize,
}

/// A loaded block.
#[derive(Clone, Debug)]
pub enum Block {
    /// 64 steps of codec `vq`.
    Vq(Arc<VqBlock>),
    /// One step, one value per vertex.
    Raw(Arc<Vec<f32>>),
}

/// A block as returned by a [`BlockLoader`].
#[derive(Clone, Debug)]
pub struct LoadedBlock {
    /// The block.
    pub block: Block,
    /// Size of the block in memory, in bytes.
    pub bytes: u64,
    /// Bytes that were read for it.
    pub bytes_read: u64,
}

/// Loads the blocks of one decoder.
pub trait BlockLoader: Send + Sync {
    /// The decoder.
    fn id(&self) -> DecoderId;

    /// The block that contains `step`; `None` if there is no such step.
    fn block_of_step(&self, step: usize) -> Option<usize>;

    /// Size of block `index` in memory, as far as that is known before it is read. Must be quick.
    fn expected_bytes(&self, index: usize) -> u64;

    /// Reads a block, unless `cancel` is raised. Must not wait for the thread pool.
    ///
    /// # Errors
    /// If it is missing or damaged; the error names the first step of the block. Or `Cancelled`.
    fn load(&self, index: usize, cancel: &Cancel) -> Result<LoadedBlock, Stop>;
}

/// Contents of a cache, and event counts so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheStatistics {
    /// Bytes of the blocks in memory.
    pub resident_bytes: u64,
    /// Peak of `resident_bytes`, including a block that has just been loaded, before others were evicted for it.
    pub peak_bytes: u64,
    /// Blocks in memory.
    pub resident_blocks: usize,
    /// Requests for a block that was in memory or being loaded.
    pub hits: u64,
    /// Requests for a block that was neither.
    pub misses: u64,
    /// Blocks loaded, on request or ahead of it.
    pub loads: u64,
    /// Blocks evicted.
    pub evictions: u64,
    /// Bytes read for the blocks that were loaded.
    pub bytes_read: u64,
}

/// Blocks of any decoders, within a byte budget.
#[derive(Debug)]
pub struct BlockCache {
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    residents: Residents,
    /// Blocks being loaded and their expected sizes; few.
    loads: Vec<(BlockKey, u64, Arc<Load>)>,
}

/// A load in progress: the loading thread tells the waiting threads here how it ended.
#[derive(Debug, Default)]
struct Load {
    outcome: Mutex<Option<Result<Block, Stop>>>,
    ended: Condvar,
}

impl Load {
    /// Waits until the load has ended; `Cancelled` also if `cancel` is raised meanwhile.
    fn wait(&self, cancel: &Cancel) -> Result<Block, Stop> {
        let mut outcome = self.outcome.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if let Some(ended) = &*outcome {
                return ended.clone();
            }
            go_on(cancel)?;
            outcome = self.ended.wait_timeout(outcome, PATIENCE).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn end(&self, outcome: Result<Block, Stop>) {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(outcome);
        self.ended.notify_all();
    }
}

/// The loading thread's obligation to report. Dropped without a result, as by a panic, it wakes the waiting threads.
struct Duty<'a> {
    cache: &'a BlockCache,
    key: BlockKey,
    load: Arc<Load>,
}

impl Drop for Duty<'_> {
    fn drop(&mut self) {
        self.cache.lock().loads.retain(|(_, _, load)| !Arc::ptr_eq(load, &self.load));
        self.load.end(Err(Stop::Cancelled));
    }
}

impl State {
    fn load_of(&self, key: BlockKey) -> Option<&Arc<Load>> {
        self.loads.iter().find(|(other, ..)| *other == key).map(|(_, _, load)| load)
    }
}

impl BlockCache {
    /// An empty cache that keeps as many blocks as fit in `budget_bytes`, or one larger block.
    pub fn new(budget_bytes: u64) -> Self {
        Self::with(Residents::new(budget_bytes, usize::MAX))
    }

    /// An empty cache that keeps at most `count` blocks, whatever their size.
    pub(super) fn of_blocks(count: usize) -> Self {
        Self::with(Residents::new(u64::MAX, count))
    }

    fn with(residents: Residents) -> Self {
        Self { state: Mutex::new(State { residents, loads: Vec::new() }) }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The budget, in bytes.
    pub fn budget(&self) -> u64 {
        self.lock().residents.budget()
    }

    /// Changes the budget; blocks beyond it are evicted at once.
    pub fn set_budget(&self, budget_bytes: u64) {
        let gone = self.lock().residents.set_budget(budget_bytes);
        // Freeing much memory takes a while: done without the lock.
        drop::<Vec<Resident>>(gone);
    }

    /// Contents of the cache, and event counts so far.
    pub fn statistics(&self) -> CacheStatistics {
        self.lock().residents.statistics()
    }

    /// Announces the blocks that will be needed, in the order of their next use; of repetitions the first counts. Replaces the list of
    /// every earlier call, by any caller.
    pub fn expect(&self, upcoming: impl IntoIterator<Item = BlockKey>) {
        self.lock().residents.expect(upcoming);
    }

    /// Whether a block is in memory.
    pub fn is_resident(&self, key: BlockKey) -> bool {
        self.lock().residents.contains(key)
    }

    /// Removes the blocks of a decoder that is no longer used.
    pub fn forget(&self, decoder: DecoderId) {
        let gone = self.lock().residents.forget(decoder);
        drop::<Vec<Resident>>(gone);
    }

    /// Block `index` of a decoder, loaded if it is not in memory, and the bytes that this call has read for it.
    ///
    /// # Errors
    /// The errors of [`BlockLoader::load`].
    pub fn get(&self, loader: &dyn BlockLoader, index: usize, cancel: &Cancel) -> Result<(Block, u64), Stop> {
        let key = BlockKey { decoder: loader.id(), index };
        loop {
            go_on(cancel)?;
            let mut state = self.lock();
            if let Some(block) = state.residents.use_block(key) {
                return Ok((block, 0));
            }
            if let Some(load) = state.load_of(key).cloned() {
                drop(state);
                match self.wait(&load, cancel) {
                    Err(Stop::Cancelled) => continue, // by the other thread's flag or this one's: the next check tells
                    ended => return ended.map(|block| (block, 0)),
                }
            }
            state.residents.count_miss();
            let duty = self.begin(state, key, loader.expected_bytes(index));
            return Self::load(duty, loader, cancel);
        }
    }

    /// A block if it is in memory or being loaded; `None` also if that load fails.
    pub fn find(&self, key: BlockKey, cancel: &Cancel) -> Option<Block> {
        let mut state = self.lock();
        if let Some(block) = state.residents.use_block(key) {
            return Some(block);
        }
        let load = state.load_of(key).cloned();
        drop(state);
        let found = load.and_then(|load| self.wait(&load, cancel).ok());
        if found.is_none() {
            self.lock().residents.count_miss();
        }
        found
    }

    /// Loads the first expected block that is neither in memory nor being loaded and fits without evicting one whose next use is sooner.
    /// Blocks that failed since the last [`BlockCache::expect`] are skipped. `loader_of` gives the loader of a decoder whose blocks this
    /// call may load. Returns whether a block was loaded.
    ///
    /// # Errors
    /// The error of the block's file.
    pub fn prefetch<'a>(
        &self,
        loader_of: impl Fn(DecoderId) -> Option<&'a dyn BlockLoader>,
        cancel: &Cancel,
    ) -> FileResult<bool> {
        if cancel.is_cancelled() {
            return Ok(false);
        }
        let state = self.lock();
        let on_its_way = |key| state.loads.iter().find(|(other, ..)| *other == key).map(|&(_, bytes, _)| bytes);
        let expected = |key: BlockKey| loader_of(key.decoder).map(|loader| loader.expected_bytes(key.index));
        let Some((key, bytes)) = state.residents.next_to_load(on_its_way, expected) else { return Ok(false) };
        let Some(loader) = loader_of(key.decoder) else { return Ok(false) };
        let duty = self.begin(state, key, bytes);
        let loaded = unless_cancelled(Self::load(duty, loader, cancel));
        if loaded.is_err() {
            self.lock().residents.pass_over(key);
        }
        Ok(loaded?.is_some())
    }

    fn wait(&self, load: &Load, cancel: &Cancel) -> Result<Block, Stop> {
        let block = load.wait(cancel)?;
        self.lock().residents.count_hit();
        Ok(block)
    }

    fn begin(&self, mut state: MutexGuard<'_, State>, key: BlockKey, expected_bytes: u64) -> Duty<'_> {
        let gone = state.residents.make_way();
        let load = Arc::new(Load::default());
        state.loads.push((key, expected_bytes, load.clone()));
        drop(state);
        drop::<Option<Resident>>(gone);
        Duty { cache: self, key, load }
    }

    fn load(duty: Duty<'_>, loader: &dyn BlockLoader, cancel: &Cancel) -> Result<(Block, u64), Stop> {
        let key = duty.key;
        let loaded = match loader.load(key.index, cancel) {
            Ok(loaded) => loaded,
            Err(stop) => {
                // Removed from the list before the waiting threads are told: later requests try again.
                duty.cache.lock().loads.retain(|(_, _, load)| !Arc::ptr_eq(load, &duty.load));
                duty.load.end(Err(stop.clone()));
                return Err(stop);
            }
        };
        let (block, bytes_read) = (loaded.block.clone(), loaded.bytes_read);
        let gone = {
            let mut state = duty.cache.lock();
            // Under one lock, or a thread would find the block neither in memory nor being loaded.
            state.loads.retain(|(_, _, load)| !Arc::ptr_eq(load, &duty.load));
            state.residents.insert(key, loaded, loader.expected_bytes(key.index))
        };
        duty.load.end(Ok(block.clone()));
        drop::<Vec<Resident>>(gone);
        Ok((block, bytes_read))
    }
}

//! Policy of the cache: which blocks stay in memory, without threads and files.

use super::{Block, BlockKey, CacheStatistics, DecoderId, LoadedBlock};
use std::cmp::Reverse;
use std::collections::{HashMap, HashSet};

/// Next use of a block that nobody expects.
const NEVER: usize = usize::MAX;

/// A block in memory.
#[derive(Debug)]
pub(super) struct Resident {
    block: Block,
    bytes: u64,
    /// Time of the last use; no two blocks have the same.
    last_use: u64,
    /// Index among the upcoming blocks, or [`NEVER`].
    next_use: usize,
}

impl Resident {
    /// Eviction order: the greatest first.
    fn rank(&self) -> (usize, Reverse<u64>) {
        (self.next_use, Reverse(self.last_use))
    }
}

/// The blocks in memory, and the upcoming ones.
#[derive(Debug, Default)]
pub(super) struct Residents {
    budget: u64,
    max_blocks: usize,
    blocks: HashMap<BlockKey, Resident>,
    /// Each block once, the next one first.
    upcoming: Vec<BlockKey>,
    /// Index of each block in `upcoming`.
    next_use: HashMap<BlockKey, usize>,
    /// Upcoming blocks that could not be loaded ahead.
    failed: HashSet<BlockKey>,
    /// Actual sizes of blocks that were not as expected: otherwise one that does not fit would be loaded ahead again and again.
    surprises: HashMap<BlockKey, u64>,
    /// Uses so far, as a clock.
    clock: u64,
    statistics: CacheStatistics,
}

impl Residents {
    pub(super) fn new(budget: u64, max_blocks: usize) -> Self {
        Self { budget, max_blocks, ..Self::default() }
    }

    pub(super) fn budget(&self) -> u64 {
        self.budget
    }

    /// Returns the evicted blocks.
    pub(super) fn set_budget(&mut self, budget: u64) -> Vec<Resident> {
        self.budget = budget;
        self.shrink()
    }

    pub(super) fn statistics(&self) -> CacheStatistics {
        CacheStatistics { resident_blocks: self.blocks.len(), ..self.statistics }
    }

    pub(super) fn contains(&self, key: BlockKey) -> bool {
        self.blocks.contains_key(&key)
    }

    /// A resident block, marked as used now.
    pub(super) fn use_block(&mut self, key: BlockKey) -> Option<Block> {
        let resident = self.blocks.get_mut(&key)?;
        self.clock += 1;
        resident.last_use = self.clock;
        self.statistics.hits += 1;
        Some(resident.block.clone())
    }

    pub(super) fn count_hit(&mut self) {
        self.statistics.hits += 1;
    }

    pub(super) fn count_miss(&mut self) {
        self.statistics.misses += 1;
    }

    pub(super) fn expect(&mut self, upcoming: impl IntoIterator<Item = BlockKey>) {
        self.upcoming.clear();
        self.next_use.clear();
        self.failed.clear();
        for key in upcoming {
            let place = self.upcoming.len();
            if *self.next_use.entry(key).or_insert(place) == place {
                self.upcoming.push(key);
            }
        }
        for (key, resident) in &mut self.blocks {
            resident.next_use = self.next_use.get(key).copied().unwrap_or(NEVER);
        }
    }

    /// Adds a loaded block; returns the evicted ones, which may include it.
    pub(super) fn insert(&mut self, key: BlockKey, loaded: LoadedBlock, expected_bytes: u64) -> Vec<Resident> {
        let LoadedBlock { block, bytes, bytes_read } = loaded;
        if bytes != expected_bytes {
            self.surprises.insert(key, bytes);
        }
        self.clock += 1;
        let next_use = self.next_use.get(&key).copied().unwrap_or(NEVER);
        let resident = Resident { block, bytes, last_use: self.clock, next_use };
        self.statistics.loads += 1;
        self.statistics.bytes_read += bytes_read;
        // Another thread has meanwhile loaded a block larger than the budget: only one of the two stays.
        let mut gone = Vec::new();
        if self.is_over_budget() {
            if self.blocks.values().any(|other| other.rank() < resident.rank()) {
                self.statistics.evictions += 1;
                return vec![resident];
            }
            gone.extend(self.make_way());
        }
        self.blocks.insert(key, resident);
        self.statistics.resident_bytes += bytes;
        self.statistics.peak_bytes = self.statistics.peak_bytes.max(self.statistics.resident_bytes);
        gone.extend(self.shrink());
        gone
    }

    fn is_over_budget(&self) -> bool {
        self.statistics.resident_bytes > self.budget
    }

    /// Evicts blocks until they fit, or one is left.
    fn shrink(&mut self) -> Vec<Resident> {
        let mut gone = Vec::new();
        while self.blocks.len() > 1 && (self.is_over_budget() || self.blocks.len() > self.max_blocks) {
            let last = self.blocks.iter().max_by_key(|(_, resident)| resident.rank()).map(|(key, _)| *key);
            gone.extend(last.and_then(|key| self.evict(key)));
        }
        gone
    }

    /// Evicts a block larger than the budget before another one is loaded, so that both are not in memory together.
    pub(super) fn make_way(&mut self) -> Option<Resident> {
        if !self.is_over_budget() {
            return None;
        }
        // Over the budget there is only one block.
        let key = self.blocks.keys().next().copied()?;
        self.evict(key)
    }

    fn evict(&mut self, key: BlockKey) -> Option<Resident> {
        let resident = self.blocks.remove(&key)?;
        self.statistics.resident_bytes -= resident.bytes;
        self.statistics.evictions += 1;
        Some(resident)
    }

    pub(super) fn forget(&mut self, decoder: DecoderId) -> Vec<Resident> {
        self.surprises.retain(|key, _| key.decoder != decoder);
        let gone: Vec<Resident> =
            self.blocks.extract_if(|key, _| key.decoder == decoder).map(|(_, resident)| resident).collect();
        self.statistics.resident_bytes -= gone.iter().map(|resident| resident.bytes).sum::<u64>();
        gone
    }

    /// The first upcoming block that is not in memory and fits beside those whose next use is sooner, and its size in bytes. `on_its_way`
    /// is the size of a block that is being loaded; `expected` that of one that may be loaded.
    pub(super) fn next_to_load(
        &self,
        on_its_way: impl Fn(BlockKey) -> Option<u64>,
        expected: impl Fn(BlockKey) -> Option<u64>,
    ) -> Option<(BlockKey, u64)> {
        let (mut sooner_bytes, mut sooner) = (0u64, 0);
        for &key in &self.upcoming {
            if let Some(bytes) = self.blocks.get(&key).map(|resident| resident.bytes).or_else(|| on_its_way(key)) {
                sooner_bytes = sooner_bytes.saturating_add(bytes);
                sooner += 1;
                if sooner_bytes > self.budget {
                    return None;
                }
            } else if !self.failed.contains(&key)
                && let Some(bytes) = expected(key)
            {
                let bytes = self.surprises.get(&key).copied().unwrap_or(bytes);
                let fits = sooner_bytes.saturating_add(bytes) <= self.budget && sooner < self.max_blocks;
                if fits || sooner == 0 {
                    return Some((key, bytes));
                }
            }
        }
        None
    }

    /// Skips this block in loading ahead until the next list of upcoming ones.
    pub(super) fn pass_over(&mut self, key: BlockKey) {
        self.failed.insert(key);
    }
}

//! The cache against a naive one, and the benefit of its policy.

use super::*;
use proptest::prelude::*;

/// Blocks that hold their index.
#[derive(Debug)]
pub(super) struct Numbers {
    pub(super) id: DecoderId,
    /// Size of each block in memory.
    bytes: Vec<u64>,
    /// Size that each block announces.
    expected_bytes: Vec<u64>,
}

impl Numbers {
    /// Blocks of these sizes, announced as such.
    pub(super) fn new(bytes: &[u64]) -> Self {
        Self { id: DecoderId::unique(), bytes: bytes.to_vec(), expected_bytes: bytes.to_vec() }
    }

    pub(super) fn key(&self, index: usize) -> BlockKey {
        BlockKey { decoder: self.id, index }
    }

    fn expect(&self, cache: &BlockCache, upcoming: impl IntoIterator<Item = usize>) {
        cache.expect(upcoming.into_iter().map(|index| self.key(index)));
    }

    fn prefetch(&self, cache: &BlockCache) -> bool {
        cache.prefetch(|id| (id == self.id).then_some(self as &dyn BlockLoader), &Cancel::new()).unwrap()
    }

    fn get(&self, cache: &BlockCache, index: usize) {
        let (block, _) = cache.get(self, index, &Cancel::new()).unwrap();
        assert_eq!(number(&block), index);
    }

    fn resident(&self, cache: &BlockCache) -> Vec<usize> {
        (0..self.bytes.len()).filter(|&index| cache.is_resident(self.key(index))).collect()
    }
}

pub(super) fn number(block: &Block) -> usize {
    let Block::Raw(values) = block else { panic!("these are raw") };
    values[0] as usize
}

impl BlockLoader for Numbers {
    fn id(&self) -> DecoderId {
        self.id
    }

    fn block_of_step(&self, step: usize) -> Option<usize> {
        (step < self.bytes.len()).then_some(step)
    }

    fn expected_bytes(&self, index: usize) -> u64 {
        self.expected_bytes[index]
    }

    fn load(&self, index: usize, cancel: &Cancel) -> Result<LoadedBlock, Stop> {
        go_on(cancel)?;
        let block = Block::Raw(Arc::new(vec![index as f32]));
        Ok(LoadedBlock { block, bytes: self.bytes[index], bytes_read: 10 * self.bytes[index] })
    }
}

/// A straightforward cache.
struct Naive<'a> {
    blocks: &'a Numbers,
    budget: u64,
    /// Resident blocks, the last used one at the end.
    here: Vec<usize>,
    upcoming: Vec<usize>,
    loaded_before: Vec<usize>,
    statistics: CacheStatistics,
}

impl<'a> Naive<'a> {
    fn new(blocks: &'a Numbers, budget: u64) -> Self {
        let (here, upcoming, loaded_before) = Default::default();
        Self { blocks, budget, here, upcoming, loaded_before, statistics: CacheStatistics::default() }
    }

    fn bytes(&self, indices: &[usize]) -> u64 {
        indices.iter().map(|&index| self.blocks.bytes[index]).sum()
    }

    fn next_use(&self, index: usize) -> Option<usize> {
        self.upcoming.iter().position(|&other| other == index)
    }

    fn shrink(&mut self) {
        while self.here.len() > 1 && self.bytes(&self.here) > self.budget {
            let unexpected = self.here.iter().position(|&index| self.next_use(index).is_none());
            let furthest = || (0..self.here.len()).max_by_key(|&at| self.next_use(self.here[at]));
            let gone = unexpected.or_else(furthest).unwrap();
            self.here.remove(gone);
            self.statistics.evictions += 1;
        }
    }

    fn load(&mut self, index: usize) {
        if self.bytes(&self.here) > self.budget {
            assert_eq!(self.here.len(), 1);
            self.here.clear();
            self.statistics.evictions += 1;
        }
        self.here.push(index);
        self.loaded_before.push(index);
        self.statistics.loads += 1;
        self.statistics.bytes_read += 10 * self.blocks.bytes[index];
        self.statistics.peak_bytes = self.statistics.peak_bytes.max(self.bytes(&self.here));
        self.shrink();
    }

    /// Uses a block; returns whether it was resident.
    fn find(&mut self, index: usize) -> bool {
        let at = self.here.iter().position(|&other| other == index);
        match at {
            Some(at) => {
                self.here.remove(at);
                self.here.push(index);
                self.statistics.hits += 1;
            }
            None => self.statistics.misses += 1,
        }
        at.is_some()
    }

    fn get(&mut self, index: usize) {
        if !self.find(index) {
            self.load(index);
        }
    }

    fn prefetch(&mut self) -> bool {
        for place in 0..self.upcoming.len() {
            let index = self.upcoming[place];
            if self.here.contains(&index) {
                continue;
            }
            let sooner: Vec<usize> = self.here.iter().copied().filter(|i| self.upcoming[..place].contains(i)).collect();
            let sizes =
                if self.loaded_before.contains(&index) { &self.blocks.bytes } else { &self.blocks.expected_bytes };
            if sooner.is_empty() || self.bytes(&sooner) + sizes[index] <= self.budget {
                self.load(index);
                return true;
            }
        }
        false
    }

    fn statistics(&self) -> CacheStatistics {
        CacheStatistics { resident_bytes: self.bytes(&self.here), resident_blocks: self.here.len(), ..self.statistics }
    }

    fn resident(&self) -> Vec<usize> {
        let mut here = self.here.clone();
        here.sort_unstable();
        here
    }
}

/// A call on a cache.
#[derive(Clone, Debug)]
enum Call {
    Get(usize),
    Find(usize),
    Prefetch,
    Expect(Vec<usize>),
    Budget(u64),
}

const COUNT: usize = 12;

fn any_call() -> impl Strategy<Value = Call> {
    prop_oneof![
        3 => (0..COUNT).prop_map(Call::Get),
        1 => (0..COUNT).prop_map(Call::Find),
        3 => Just(Call::Prefetch),
        2 => prop::collection::vec(0..COUNT, 0..20).prop_map(Call::Expect),
        1 => (0u64..60).prop_map(Call::Budget),
    ]
}

fn any_blocks() -> impl Strategy<Value = Numbers> {
    let sizes = prop_oneof![Just((7, 7)), (0u64..20).prop_map(|bytes| (bytes, bytes)), (0u64..20, 0u64..20)];
    prop::collection::vec(sizes, COUNT).prop_map(|sizes| {
        let (bytes, expected_bytes) = sizes.into_iter().unzip();
        Numbers { id: DecoderId::unique(), bytes, expected_bytes }
    })
}

proptest! {
    #[test]
    fn what_is_resident_is_what_a_naive_cache_keeps(
        blocks in any_blocks(),
        budget in 0u64..60,
        calls in prop::collection::vec(any_call(), 1..80),
    ) {
        let (cache, mut naive) = (BlockCache::new(budget), Naive::new(&blocks, budget));
        let mut largest_budget = budget;
        for call in calls {
            let next = naive.upcoming.first().copied().filter(|index| naive.here.contains(index));
            let next = next.filter(|&index| blocks.bytes[index] <= naive.budget);
            match call.clone() {
                Call::Get(index) => {
                    blocks.get(&cache, index);
                    naive.get(index);
                }
                Call::Find(index) => {
                    let found = cache.find(blocks.key(index), &Cancel::new());
                    prop_assert_eq!(found.as_ref().map(number), naive.find(index).then_some(index));
                }
                Call::Prefetch => prop_assert_eq!(blocks.prefetch(&cache), naive.prefetch()),
                Call::Expect(upcoming) => {
                    blocks.expect(&cache, upcoming.iter().copied());
                    naive.upcoming = upcoming;
                }
                Call::Budget(budget) => {
                    cache.set_budget(budget);
                    naive.budget = budget;
                    naive.shrink();
                    largest_budget = largest_budget.max(budget);
                    prop_assert_eq!(cache.budget(), budget);
                }
            }
            let now = cache.statistics();
            prop_assert_eq!(now, naive.statistics(), "{:?}", call);
            prop_assert_eq!(blocks.resident(&cache), naive.resident(), "{:?}", call);
            prop_assert!(now.resident_bytes <= cache.budget() || now.resident_blocks == 1);
            let largest_block = blocks.bytes.iter().max().unwrap();
            prop_assert!(now.peak_bytes <= largest_budget + largest_block);
            prop_assert!(next.is_none_or(|next| cache.is_resident(blocks.key(next))), "what is next has gone");
        }
        // Every block can be loaded ahead once at most, surprises included: this ends.
        let ahead = (0..10 * COUNT).take_while(|_| blocks.prefetch(&cache)).count();
        prop_assert!(ahead <= 2 * COUNT, "{}", ahead);
    }
}

#[test]
fn a_naive_cache_that_is_not_told_what_comes_is_noticed() {
    let blocks = Numbers::new(&[4; 5]);
    let (cache, mut naive, mut untold) = (BlockCache::new(12), Naive::new(&blocks, 12), Naive::new(&blocks, 12));
    blocks.expect(&cache, [3, 0, 1]);
    naive.upcoming = vec![3, 0, 1];
    for index in [0, 1, 2, 3] {
        blocks.get(&cache, index);
        naive.get(index);
        untold.get(index);
    }
    assert_eq!(blocks.resident(&cache), [0, 1, 3]);
    assert_eq!(naive.resident(), [0, 1, 3]);
    assert_eq!(untold.resident(), [1, 2, 3]);
}

/// The steps of a loop from `first` on, each once.
fn round(count: usize, first: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |i| (first + i) % count)
}

/// Hits of the optimal cache of `room` blocks in an endless loop, of which `calls` are counted: each time the block is evicted that is
/// needed last.
fn optimal_hits(count: usize, room: usize, calls: usize) -> u64 {
    let (mut here, mut hits): (Vec<usize>, u64) = Default::default();
    for call in 0..calls {
        let index = call % count;
        if here.contains(&index) {
            hits += 1;
            continue;
        }
        if here.len() == room {
            let wait = |other: usize| (other + count - index) % count;
            let last = (0..here.len()).max_by_key(|&at| wait(here[at])).unwrap();
            here.remove(last);
        }
        here.push(index);
    }
    hits
}

#[test]
fn a_loop_over_more_than_fits_has_the_hits_of_the_optimum_and_not_the_none_of_lru() {
    for (count, room) in [(10, 6), (10, 9), (7, 2), (5, 1), (4, 4)] {
        let blocks = Numbers::new(&vec![3; count]);
        let [cache, lru] = [0; 2].map(|_| BlockCache::new(3 * room as u64));
        let calls = 6 * count + 3;
        for call in 0..calls {
            blocks.expect(&cache, round(count, call % count));
            blocks.get(&cache, call % count);
            blocks.get(&lru, call % count); // which is told nothing
        }
        let [hits, lru_hits] = [&cache, &lru].map(|cache| cache.statistics().hits);
        assert_eq!(hits, optimal_hits(count, room, calls), "{count} {room}");
        assert_eq!(lru_hits, if room == count { (calls - count) as u64 } else { 0 });
        assert!(hits > lru_hits || room == 1 || room == count);
    }
}

#[test]
fn in_the_direction_of_play_every_block_is_there_before_it_is_asked_for() {
    let count = 9;
    let forwards: Vec<usize> = (0..count).collect();
    let backwards: Vec<usize> = (0..count).rev().collect();
    let twice = [&forwards[..], &forwards[..]].concat();
    let there_and_back = [&forwards[..], &backwards[1..]].concat();
    for (order, loads) in [(forwards, count), (backwards, count), (twice, 0), (there_and_back, 0)] {
        let blocks = Numbers::new(&[5; 9]);
        // What is shown and the next one.
        let cache = BlockCache::new(10);
        for (i, &index) in order.iter().enumerate() {
            blocks.expect(&cache, order[i..].iter().copied());
            while blocks.prefetch(&cache) {}
            assert!(order[i..].iter().take(2).all(|&index| cache.is_resident(blocks.key(index))));
            blocks.get(&cache, index);
        }
        let statistics = cache.statistics();
        assert_eq!((statistics.misses, statistics.hits), (0, order.len() as u64), "{order:?}");
        assert!(loads == 0 || statistics.loads == loads as u64, "once each: {statistics:?}");
        assert!(statistics.peak_bytes <= 15);
    }
}

#[test]
fn a_block_larger_than_the_budget_stays_until_another_one_is_needed() {
    let blocks = Numbers::new(&[100, 100, 1]);
    let cache = BlockCache::new(0);
    (0..3).for_each(|_| blocks.get(&cache, 0));
    assert_eq!((cache.statistics().loads, cache.statistics().hits), (1, 2));
    blocks.expect(&cache, [0, 1]);
    assert!(!blocks.prefetch(&cache), "the one that is shown would have to go");
    blocks.expect(&cache, [1]);
    blocks.get(&cache, 1);
    assert_eq!(blocks.resident(&cache), [1]);
    blocks.expect(&cache, [0]);
    assert!(blocks.prefetch(&cache));
    assert_eq!(blocks.resident(&cache), [0]);
    assert_eq!(cache.statistics().peak_bytes, 100, "never two of them");
}

#[test]
fn decoders_share_the_budget_but_no_blocks_and_take_theirs_with_them() {
    let (a, b) = (Numbers::new(&[4; 3]), Numbers::new(&[4; 3]));
    let cache = BlockCache::new(12);
    (0..3).for_each(|index| a.get(&cache, index));
    b.get(&cache, 1);
    assert_eq!((a.resident(&cache), b.resident(&cache)), (vec![1, 2], vec![1]));
    cache.expect([a.key(2), b.key(0), b.key(1)]);
    assert!(!a.prefetch(&cache), "those of another decoder are not its own");
    assert!(b.prefetch(&cache));
    assert_eq!((a.resident(&cache), b.resident(&cache)), (vec![2], vec![0, 1]));
    cache.forget(b.id);
    let statistics = cache.statistics();
    assert_eq!((statistics.resident_bytes, statistics.resident_blocks, statistics.evictions), (4, 1, 2));
    assert_eq!(a.resident(&cache), [2]);
}

//! Several threads at one cache: a block is loaded once, and no thread hangs, however the load ends.

use super::tests::{Numbers, number};
use super::*;
use crate::error::FileError;
use std::sync::atomic::AtomicUsize;

/// How the first load ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ending {
    Whole,
    Cancelled,
    Failed,
    Panic,
}

/// A block whose first load ends when a number of threads wait for it.
struct Awaited<'a> {
    cache: &'a BlockCache,
    numbers: Numbers,
    waiting: usize,
    ending: Ending,
    attempts: AtomicUsize,
}

impl<'a> Awaited<'a> {
    fn new(cache: &'a BlockCache, waiting: usize, ending: Ending) -> Self {
        Self { cache, numbers: Numbers::new(&[8]), waiting, ending, attempts: AtomicUsize::new(0) }
    }

    /// Waits until the waiting threads hold the load, beside the cache and the loading thread.
    fn wait_for_others(&self) {
        let others = || self.cache.lock().loads.first().map_or(0, |(_, _, load)| Arc::strong_count(load) - 2);
        while others() < self.waiting {
            std::thread::yield_now();
        }
    }
}

impl BlockLoader for Awaited<'_> {
    fn id(&self) -> DecoderId {
        self.numbers.id
    }

    fn block_of_step(&self, step: usize) -> Option<usize> {
        self.numbers.block_of_step(step)
    }

    fn expected_bytes(&self, index: usize) -> u64 {
        self.numbers.expected_bytes(index)
    }

    fn load(&self, index: usize, cancel: &Cancel) -> Result<LoadedBlock, Stop> {
        if self.attempts.fetch_add(1, Ordering::SeqCst) == 0 {
            self.wait_for_others();
            match self.ending {
                Ending::Whole => {}
                Ending::Cancelled => return Err(Stop::Cancelled),
                Ending::Failed => return Err(FileError::invalid("block", "chunk", "fails on purpose").into()),
                Ending::Panic => panic!("on purpose"),
            }
        }
        self.numbers.load(index, cancel)
    }
}

/// Outcomes of four threads that request one block: (loaded, failed, cancelled, panicked), and the loads begun.
fn four_ask(ending: Ending) -> ([usize; 4], usize) {
    let cache = BlockCache::new(100);
    let awaited = Awaited::new(&cache, 3, ending);
    let mut fared = [0; 4];
    std::thread::scope(|scope| {
        let ask = || awaited.cache.get(&awaited, 0, &Cancel::new());
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(ask)).collect();
        for thread in threads {
            fared[match thread.join() {
                Ok(Ok((block, _))) => {
                    assert_eq!(number(&block), 0);
                    0
                }
                Ok(Err(Stop::File(_))) => 1,
                Ok(Err(Stop::Cancelled)) => 2,
                Err(_) => 3,
            }] += 1;
        }
    });
    assert!(cache.lock().loads.is_empty());
    let attempts = awaited.attempts.load(Ordering::SeqCst);
    // However the load ended, the next request succeeds.
    assert!(cache.get(&awaited, 0, &Cancel::new()).is_ok());
    assert_eq!(cache.statistics().loads, 1);
    (fared, attempts)
}

#[test]
fn a_block_that_four_threads_ask_for_is_loaded_once() {
    assert_eq!(four_ask(Ending::Whole), ([4, 0, 0, 0], 1));
}

#[test]
fn when_a_load_is_cancelled_one_of_those_who_wait_begins_it_again() {
    assert_eq!(four_ask(Ending::Cancelled), ([3, 0, 1, 0], 2));
}

#[test]
fn when_a_load_fails_all_who_wait_are_told_and_the_next_one_tries_again() {
    assert_eq!(four_ask(Ending::Failed), ([0, 4, 0, 0], 1));
}

#[test]
fn when_a_load_panics_those_who_wait_do_not_hang() {
    assert_eq!(four_ask(Ending::Panic), ([3, 0, 0, 1], 2));
}

#[test]
fn who_waits_for_another_ones_load_can_be_cancelled_alone() {
    let cache = BlockCache::new(100);
    let awaited = Awaited::new(&cache, 2, Ending::Whole);
    let impatient = Cancel::new();
    let block = std::thread::scope(|scope| {
        // Waits for two: one of them gives up, and this is the other.
        let loads = scope.spawn(|| cache.get(&awaited, 0, &Cancel::new()));
        let gives_up = scope.spawn(|| {
            while awaited.attempts.load(Ordering::SeqCst) == 0 {
                std::thread::yield_now();
            }
            cache.get(&awaited, 0, &impatient)
        });
        while cache.lock().loads.first().is_none_or(|(_, _, load)| Arc::strong_count(load) < 3) {
            std::thread::yield_now();
        }
        impatient.cancel();
        assert!(matches!(gives_up.join().unwrap(), Err(Stop::Cancelled)));
        let _two_waiting: Vec<Arc<Load>> =
            cache.lock().loads.iter().flat_map(|(_, _, load)| [load.clone(), load.clone()]).collect();
        loads.join().unwrap()
    });
    assert_eq!(number(&block.unwrap().0), 0);
    assert_eq!(awaited.attempts.into_inner(), 1);
}

#[test]
fn a_block_on_its_way_ahead_of_need_is_waited_for_and_not_read_twice() {
    let cache = BlockCache::new(100);
    let awaited = Awaited::new(&cache, 1, Ending::Whole);
    let key = awaited.numbers.key(0);
    cache.expect([key]);
    std::thread::scope(|scope| {
        let ahead = scope.spawn(|| cache.prefetch(|_| Some(&awaited as &dyn BlockLoader), &Cancel::new()));
        while awaited.attempts.load(Ordering::SeqCst) == 0 {
            std::thread::yield_now();
        }
        assert!(!cache.prefetch(|_| Some(&awaited as &dyn BlockLoader), &Cancel::new()).unwrap(), "it is on its way");
        assert_eq!(cache.find(key, &Cancel::new()).as_ref().map(number), Some(0));
        assert!(ahead.join().unwrap().unwrap());
    });
    let statistics = cache.statistics();
    assert_eq!((statistics.loads, statistics.hits, statistics.misses), (1, 1, 0));
}

#[test]
fn threads_that_ask_load_ahead_and_give_up_at_random_get_the_blocks_that_they_asked_for() {
    let numbers = Numbers::new(&[3, 9, 4, 4, 7, 1, 12, 5]);
    let cache = BlockCache::new(20);
    std::thread::scope(|scope| {
        for seed in 1..5usize {
            let (numbers, cache) = (&numbers, &cache);
            scope.spawn(move || {
                let mut random = seed;
                for call in 0..2000 {
                    random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    let (index, cancel) = ((random >> 40) % 8, Cancel::new());
                    if (random >> 50) % 8 == 0 {
                        cancel.cancel();
                    }
                    match call % 4 {
                        0 => cache.expect([index, (index + 1) % 8, (index + 2) % 8].map(|i| numbers.key(i))),
                        1 => _ = cache.prefetch(|_| Some(numbers as &dyn BlockLoader), &cancel).unwrap(),
                        _ => match cache.get(numbers, index, &cancel) {
                            Ok((block, _)) => assert_eq!(number(&block), index),
                            Err(stop) => assert!(matches!(stop, Stop::Cancelled) && cancel.is_cancelled()),
                        },
                    }
                }
            });
        }
    });
    let statistics = cache.statistics();
    assert!(statistics.resident_bytes <= 20 && statistics.peak_bytes <= 20 + 12, "{statistics:?}");
    assert!(statistics.hits > 0 && statistics.evictions > 0 && cache.lock().loads.is_empty());
}

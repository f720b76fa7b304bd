//! Sorting ids by depth, stably and in parallel.
//!
//! ```text
//! keys     depth of every id, chunk by chunk; how many ids of the chunk are in each bucket of equal depth
//! scan     where the ids of (bucket, chunk) go: ascending by bucket, then by chunk
//! scatter  each chunk moves its ids and keys, in their order
//! buckets  each is sorted by the bits in which its keys differ, 9 at a time, the lowest first
//! ```
//! A radix sort whose first digit is the most significant one and not a group of bits (Knuth, *The Art of Computer Programming* 3, 5.2.5).
//! It is stable because chunks and buckets keep the order of their ids; it does not depend on the number of threads because chunks have a
//! fixed size, and each chunk and bucket is sorted by one thread.
//!
//! Why the first digit is depth itself: only that pass moves ids through all of the memory. Ids near in memory are near in space, so they
//! go to few buckets, which are so small that all other passes stay in the first-level cache. A sort that begins with the lowest digit
//! scatters over all of the memory in every pass; it takes longer (`depth_order` has the figures). Filling two halves of a chunk in turn,
//! so that no count waits for the one before it, gained nothing. Buckets that are large all the same, since most faces lie in a small range
//! of depths, are sorted by comparison, on all threads.
//!
//! Threads write to disjoint slots assigned by the scan, but scattered over the array. Relaxed atomics express that without `unsafe`; on
//! current processors they are plain loads and stores.

use super::parts::{CHUNK, fill_parts};
use crate::task::Cancel;
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Mean ids per bucket: with their keys they fill a quarter of a first-level cache.
const PER_BUCKET: usize = 1024;
/// Maximum number of buckets: more cannot be written to side by side.
const MOST_BUCKETS: usize = 2048;
/// A bucket of more ids than this is sorted by comparison, which bounds the scratch memory of a thread.
const LARGE: usize = 1 << 15;
/// Bits of a digit within a bucket.
const BITS: u32 = 9;
const DIGITS: usize = 1 << BITS;

/// Sorts ids by depth; keeps its memory (16 bytes per id) from one call to the next.
#[derive(Debug, Default)]
pub(super) struct RadixSort {
    keys: Vec<f32>,
    /// Key and id in one word, by bucket.
    pairs: Vec<AtomicU64>,
    sorted: Vec<u32>,
    /// Per chunk, the number of ids in each bucket; then their destinations.
    places: Vec<u32>,
    /// End of each bucket.
    ends: Vec<u32>,
}

impl RadixSort {
    /// Result of the last sort.
    pub(super) fn sorted(&self) -> &[u32] {
        &self.sorted
    }

    /// Sorts `count` ids (fewer than 2^32), where `id` gives the one at each index, ascending by `key` and stably. Keys should be spread
    /// over `range`, but need not lie within. `None` if `cancel` was raised before the end; the result is then undefined.
    pub(super) fn sort(
        &mut self,
        count: usize,
        id: impl Fn(usize) -> u32 + Sync,
        key: impl Fn(u32) -> f32 + Sync,
        range: [f32; 2],
        cancel: &Cancel,
    ) -> Option<()> {
        let buckets = (count / PER_BUCKET).clamp(1, MOST_BUCKETS);
        let bucket_of = bucket_of(range, buckets);
        self.keys.resize(count, 0.0);
        self.pairs.resize_with(count, AtomicU64::default);
        self.sorted.resize(count, 0);
        self.places.resize(count.div_ceil(CHUNK) * buckets, 0);
        let Self { keys, pairs, sorted, places, ends } = self;

        let chunks = keys.par_chunks_mut(CHUNK).zip(places.par_chunks_mut(buckets)).enumerate();
        chunks.for_each(|(chunk, (keys, counts))| {
            counts.fill(0);
            for (at, slot) in (CHUNK * chunk..).zip(keys) {
                // Zeros of both signs are one depth.
                *slot = key(id(at)) + 0.0;
                counts[bucket_of(*slot)] += 1;
            }
        });
        scan(places, buckets, ends);
        if cancel.is_cancelled() {
            return None;
        }
        let chunks = keys.par_chunks(CHUNK).zip(places.par_chunks_mut(buckets)).enumerate();
        chunks.for_each(|(chunk, (keys, places))| {
            for (at, &key) in (CHUNK * chunk..).zip(keys) {
                let place = &mut places[bucket_of(key)];
                pairs[*place as usize].store(u64::from(ascending_bits(key)) << 32 | u64::from(id(at)), Relaxed);
                *place += 1;
            }
        });
        if cancel.is_cancelled() {
            return None;
        }
        let begin = |bucket: usize| bucket.checked_sub(1).map_or(0, |before| ends[before] as usize);
        fill_parts(sorted, ends, &|bucket, sorted: &mut [u32]| sort_bucket(&pairs[begin(bucket)..], sorted));
        Some(())
    }
}

/// Turns counts of each bucket in each chunk into destinations, and writes the ends of the buckets.
fn scan(places: &mut [u32], buckets: usize, ends: &mut Vec<u32>) {
    ends.clear();
    let mut next = 0;
    for bucket in 0..buckets {
        for count in places[bucket..].iter_mut().step_by(buckets) {
            next += std::mem::replace(count, next);
        }
        ends.push(next);
    }
}

/// The bucket of a depth, monotonic in the depth: each operation is rounded, but none changes the order.
fn bucket_of([lo, hi]: [f32; 2], buckets: usize) -> impl Fn(f32) -> usize + Copy {
    let scale = buckets as f32 / (hi - lo);
    let scale = if scale.is_finite() { scale } else { 0.0 };
    // The cast saturates.
    move |depth| (((depth - lo) * scale) as usize).min(buckets - 1)
}

/// Bits of a number, ordered as the numbers are: -NaN < -inf < .. < -0 < +0 < .. < inf < NaN.
pub fn ascending_bits(x: f32) -> u32 {
    let bits = x.to_bits();
    // Negative numbers flip all bits, others the sign bit.
    bits ^ ((bits as i32 >> 31) as u32 | 1 << 31)
}

thread_local! {
    /// Scratch of a thread that sorts a bucket: twice up to [`LARGE`] words.
    static SCRATCH: RefCell<[Vec<u64>; 2]> = const { RefCell::new([Vec::new(), Vec::new()]) };
}

/// Sorts the first `out.len()` of `pairs`.
fn sort_bucket(pairs: &[AtomicU64], out: &mut [u32]) {
    let pairs = &pairs[..out.len()];
    if pairs.len() > LARGE {
        // Ids ascend in a bucket, so that sorting by key and id is stable.
        let mut pairs: Vec<u64> = pairs.iter().map(|pair| pair.load(Relaxed)).collect();
        pairs.par_sort_unstable();
        return out.iter_mut().zip(pairs).for_each(|(out, pair)| *out = pair as u32);
    }
    SCRATCH.with_borrow_mut(|[from, to]| {
        let (mut least, mut most) = (u32::MAX, 0);
        from.clear();
        from.extend(pairs.iter().map(|pair| {
            let pair = pair.load(Relaxed);
            (least, most) = (least.min(key_of(pair)), most.max(key_of(pair)));
            pair
        }));
        // Differences from the least key vary only in the low bits.
        let differing = u32::BITS - most.saturating_sub(least).leading_zeros();
        let passes = differing.div_ceil(BITS);
        for pass in 1..passes {
            to.resize(from.len(), 0);
            move_by_digit(from, least, BITS * (pass - 1), |at, pair| to[at] = pair);
            std::mem::swap(from, to);
        }
        match passes {
            0 => out.iter_mut().zip(from).for_each(|(out, pair)| *out = *pair as u32),
            _ => move_by_digit(from, least, BITS * (passes - 1), |at, pair| out[at] = pair as u32),
        }
    });
}

fn key_of(pair: u64) -> u32 {
    (pair >> 32) as u32
}

/// Moves pairs to their slots, with `to`, by the digit at `shift` of key minus `least`.
fn move_by_digit(from: &[u64], least: u32, shift: u32, mut to: impl FnMut(usize, u64)) {
    let digit = |pair: u64| (key_of(pair) - least) as usize >> shift & (DIGITS - 1);
    let mut places = [0u32; DIGITS];
    from.iter().for_each(|&pair| places[digit(pair)] += 1);
    let mut next = 0;
    places.iter_mut().for_each(|count| next += std::mem::replace(count, next));
    for &pair in from {
        let place = &mut places[digit(pair)];
        to(*place as usize, pair);
        *place += 1;
    }
}

//! The nearest entry of a codebook for many vectors: the loop in which encoding spends its time.
//!
//! ```text
//! for each tile of 16 vectors x, in parallel
//!     for each entry c:  score = |c|^2 / 2 - x . c        (half the squared distance, less |x|^2 / 2)
//!         keep the entry with the lowest score, the first of equal ones
//! ```
//!
//! Differences from the plain distance, for speed: the product form needs two operations a number instead of three. It rounds like |x|^2,
//! not like the distance, so that of two entries almost equally far either may be found; that costs a part in 2^20 of |x|^2. Lanes are
//! vectors, not entries: the minimum then needs no search across lanes. Two entries are scored together, so that each number of x is loaded
//! once for both. 16 lanes are one register of AVX-512: a search of 1024 entries for a vector of 12 numbers takes 313 ns with it, 473 with
//! AVX2, 977 with SSE2.

use super::simd::widest;
use super::tiles::{LANES, Tiles};
use rayon::prelude::*;

/// Tiles of one task.
const TASK: usize = 32;

/// Codebook entries in the space of the search, row by row; entry 0 is the zero vector.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entries {
    pub(super) dims: usize,
    pub(super) rows: Vec<f32>,
}

impl Entries {
    /// Number of entries.
    pub(super) fn len(&self) -> usize {
        self.rows.len() / self.dims
    }

    /// The numbers of one entry.
    pub(super) fn row(&self, entry: usize) -> &[f32] {
        &self.rows[entry * self.dims..][..self.dims]
    }
}

/// The nearest entry of each vector.
#[derive(Clone, Debug, Default)]
pub(super) struct Assignment {
    /// Index of the entry.
    pub(super) entry: Vec<u16>,
    /// Squared distance to the entry.
    pub(super) distance: Vec<f32>,
}

/// Finds the nearest entry of every vector. The result is the same for any number of threads.
pub(super) fn nearest(vectors: &Tiles, entries: &Entries) -> Assignment {
    let half: Vec<f32> = (0..entries.len()).map(|k| 0.5 * dot(entries.row(k), entries.row(k))).collect();
    let mut out = Assignment { entry: vec![0; vectors.count], distance: vec![0.0; vectors.count] };
    let task = TASK * LANES;
    let work = out.entry.par_chunks_mut(task).zip(out.distance.par_chunks_mut(task));
    work.zip(vectors.data.par_chunks(TASK * vectors.tile_len())).for_each(|((entry, distance), tiles)| {
        widest(Task { tiles, dims: vectors.dims, rows: &entries.rows, half: &half, entry, distance });
    });
    out
}

/// A range of tiles, and the slices for their results.
struct Task<'a> {
    tiles: &'a [f32],
    dims: usize,
    rows: &'a [f32],
    half: &'a [f32],
    entry: &'a mut [u16],
    distance: &'a mut [f32],
}

impl pulp::NullaryFnOnce for Task<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { tiles, dims, rows, half, entry, distance } = self;
        let lanes = entry.chunks_mut(LANES).zip(distance.chunks_mut(LANES));
        for (tile, (entry, distance)) in tiles.chunks_exact(dims * LANES).zip(lanes) {
            let (index, score) = match dims {
                4 => scan::<4>(tile, rows, half),
                8 => scan::<8>(tile, rows, half),
                12 => scan::<12>(tile, rows, half),
                16 => scan::<16>(tile, rows, half),
                dims => scan_any(tile, dims, rows, half),
            };
            let mut squares = [0.0f32; LANES];
            for numbers in tile.chunks_exact(LANES) {
                squares.iter_mut().zip(numbers).for_each(|(s, x)| *s += x * x);
            }
            for lane in 0..entry.len() {
                entry[lane] = index[lane];
                distance[lane] = (2.0 * score[lane] + squares[lane]).max(0.0);
            }
        }
    }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Best entry and score so far, per lane.
struct Best {
    score: [f32; LANES],
    entry: [u32; LANES],
}

impl Best {
    const NONE: Self = Self { score: [f32::INFINITY; LANES], entry: [0; LANES] };

    #[inline(always)]
    fn offer(&mut self, entry: u32, score: &[f32; LANES]) {
        for ((best, found), &score) in self.score.iter_mut().zip(&mut self.entry).zip(score) {
            let better = score < *best;
            *best = if better { score } else { *best };
            *found = if better { entry } else { *found };
        }
    }

    #[inline(always)]
    fn result(&self) -> ([u16; LANES], [f32; LANES]) {
        // There are no more than 2^16 entries.
        (self.entry.map(|entry| entry as u16), self.score)
    }
}

#[inline(always)]
fn scan<const D: usize>(tile: &[f32], rows: &[f32], half: &[f32]) -> ([u16; LANES], [f32; LANES]) {
    let mut x = [[0.0f32; LANES]; D];
    x.iter_mut().zip(tile.chunks_exact(LANES)).for_each(|(to, from)| to.copy_from_slice(from));
    let mut best = Best::NONE;
    let (pairs, odd) = rows.as_chunks::<D>().0.as_chunks::<2>();
    for (pair, [a, b]) in pairs.iter().enumerate() {
        let mut score_a = [half[2 * pair]; LANES];
        let mut score_b = [half[2 * pair + 1]; LANES];
        for d in 0..D {
            for lane in 0..LANES {
                score_a[lane] -= a[d] * x[d][lane];
                score_b[lane] -= b[d] * x[d][lane];
            }
        }
        best.offer(2 * pair as u32, &score_a);
        best.offer(2 * pair as u32 + 1, &score_b);
    }
    if let [last] = odd {
        let entry = half.len() - 1;
        let mut score = [half[entry]; LANES];
        for d in 0..D {
            (0..LANES).for_each(|lane| score[lane] -= last[d] * x[d][lane]);
        }
        best.offer(entry as u32, &score);
    }
    best.result()
}

#[inline(always)]
fn scan_any(tile: &[f32], dims: usize, rows: &[f32], half: &[f32]) -> ([u16; LANES], [f32; LANES]) {
    let mut best = Best::NONE;
    for (entry, row) in rows.chunks_exact(dims).enumerate() {
        let mut score = [half[entry]; LANES];
        for (&weight, numbers) in row.iter().zip(tile.chunks_exact(LANES)) {
            score.iter_mut().zip(numbers).for_each(|(s, x)| *s -= weight * x);
        }
        best.offer(entry as u32, &score);
    }
    best.result()
}

#[cfg(test)]
mod tests {
    use super::super::simd::portable;
    use super::super::test_data::Random;
    use super::*;

    fn random_tiles(dims: usize, count: usize, seed: u64) -> Tiles {
        let mut random = Random::new(seed);
        let mut tiles = Tiles::new(dims, count);
        tiles.data.iter_mut().for_each(|x| *x = random.signed());
        tiles
    }

    fn distance(tiles: &Tiles, vector: usize, row: &[f32]) -> f64 {
        row.iter().enumerate().map(|(d, &c)| (f64::from(tiles.get(vector, d)) - f64::from(c)).powi(2)).sum()
    }

    /// Largest excess of the found distance over the least one, as a part of |x|^2 + |c|^2.
    fn worst_excess(tiles: &Tiles, entries: &Entries, found: &Assignment) -> f64 {
        let excess = |vector: usize| {
            let least = (0..entries.len()).map(|k| distance(tiles, vector, entries.row(k))).fold(f64::MAX, f64::min);
            let row = entries.row(usize::from(found.entry[vector]));
            let size = distance(tiles, vector, &vec![0.0; tiles.dims]) + f64::from(dot(row, row));
            (distance(tiles, vector, row) - least) / size
        };
        (0..tiles.count).map(excess).fold(0.0, f64::max)
    }

    #[test]
    fn the_entry_found_is_the_nearest_up_to_rounding() {
        for dims in [4, 8, 12, 16, 5, 64] {
            for count in [1, 2, 37, 256] {
                let tiles = random_tiles(dims, 1003, 7);
                let mut random = Random::new(11);
                let mut rows: Vec<f32> = (0..count * dims).map(|_| random.signed()).collect();
                rows[..dims].fill(0.0);
                let entries = Entries { dims, rows };
                let mut found = nearest(&tiles, &entries);
                // Each score is a sum of dims + 1 terms below |x| |c|, rounded as often.
                let bound = 2.0 * (dims + 2) as f64 * f64::from(f32::EPSILON);
                assert!(worst_excess(&tiles, &entries, &found) < bound, "{dims} {count}");
                for v in 0..tiles.count {
                    let exact = distance(&tiles, v, entries.row(usize::from(found.entry[v])));
                    assert!((f64::from(found.distance[v]) - exact).abs() < bound * dims as f64);
                }
                if count > 1 {
                    found.entry[5] = if found.entry[5] == 0 { 1 } else { 0 };
                    assert!(worst_excess(&tiles, &entries, &found) > bound, "another entry is noticed");
                }
            }
        }
    }

    #[test]
    fn of_equal_entries_the_first_is_taken_and_zeros_take_the_entry_of_zeros() {
        let tiles = Tiles::new(4, 3);
        let entries = Entries { dims: 4, rows: [[0.0; 4], [0.0; 4], [1.0; 4]].concat() };
        let found = nearest(&tiles, &entries);
        assert_eq!((found.entry, found.distance), (vec![0; 3], vec![0.0; 3]));
    }

    #[test]
    fn wide_registers_find_the_same_bits() {
        for dims in [4, 8, 12, 16, 64] {
            let tiles = random_tiles(dims, TASK * LANES, 8);
            let mut random = Random::new(6);
            let entries = Entries { dims, rows: (0..dims * 301).map(|_| random.signed()).collect() };
            let half: Vec<f32> = (0..301).map(|k| 0.5 * dot(entries.row(k), entries.row(k))).collect();
            let mut plain = Assignment { entry: vec![0; tiles.count], distance: vec![0.0; tiles.count] };
            let Assignment { entry, distance } = &mut plain;
            portable(Task { tiles: &tiles.data, dims, rows: &entries.rows, half: &half, entry, distance });
            let wide = nearest(&tiles, &entries);
            assert_eq!(wide.entry, plain.entry);
            assert!(plain.entry.iter().any(|&e| e != plain.entry[0]) && plain.distance.iter().all(|&d| d > 0.0));
            assert!(wide.distance.iter().zip(&plain.distance).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn chunks_of_work_do_not_show() {
        let tiles = random_tiles(8, 3 * TASK * LANES + 5, 3);
        let mut random = Random::new(4);
        let entries = Entries { dims: 8, rows: (0..8 * 33).map(|_| random.signed()).collect() };
        let all = nearest(&tiles, &entries);
        let part: Vec<u32> = (0..tiles.count as u32).rev().collect();
        let mut reversed = nearest(&tiles.select(&part), &entries);
        reversed.entry.reverse();
        reversed.distance.reverse();
        assert!(all.entry != all.entry.iter().rev().copied().collect::<Vec<_>>(), "the order matters");
        assert_eq!((all.entry, all.distance), (reversed.entry, reversed.distance));
    }
}

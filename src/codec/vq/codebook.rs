//! Training a codebook: splits along principal axes, then LBG.
//!
//! ```text
//! one cell with all vectors
//! until there are enough cells: split the cell of largest distortion through its mean, across its principal axis
//! repeat: centroids <- means of cells; each vector to the nearest centroid        (Linde, Buzo, Gray 1980)
//! ```
//!
//! The splits are those of Schneider and Westermann, "Compression domain volume rendering" (2003), whose code the dissertation used. Entry
//! 0 is always the zero vector: constant vertices are then exact. A centroid that loses all its vectors moves to the vector with the
//! largest error.

use super::search::{Assignment, Entries, nearest};
use super::tiles::Tiles;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// LBG ends when an iteration reduces the distortion by less than this part.
const LEAST_GAIN: f64 = 2e-3;
/// Iterations of the power method. The axis need not be exact: any cut through the mean is valid, and LBG follows.
const POWER_ITERATIONS: usize = 12;

/// Trains up to `count` entries (entry 0 included) on `vectors`, with at most `iterations` of LBG.
pub(super) fn train(vectors: &Tiles, count: usize, iterations: usize) -> Entries {
    let mut entries = split(vectors, count);
    let mut before = f64::INFINITY;
    for _ in 0..iterations {
        let found = nearest(vectors, &entries);
        let distortion: f64 = found.distance.iter().map(|&d| f64::from(d)).sum();
        if before - distortion <= LEAST_GAIN * before && before.is_finite() || distortion == 0.0 {
            break;
        }
        before = distortion;
        update(vectors, &found, &mut entries);
    }
    entries
}

/// A cell: its vectors, centroid, and sum of squared distances to it.
struct Cell {
    distortion: f64,
    vectors: Vec<u32>,
    centroid: Vec<f64>,
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        // No two cells share a vector, so the order is total and unique.
        self.distortion.total_cmp(&other.distortion).then_with(|| other.vectors.cmp(&self.vectors))
    }
}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Cell {}

impl Cell {
    fn new(all: &Tiles, vectors: Vec<u32>) -> Self {
        let mut centroid = vec![0.0f64; all.dims];
        let mut squares = 0.0f64;
        for &v in &vectors {
            for (d, sum) in centroid.iter_mut().enumerate() {
                let x = f64::from(all.get(v as usize, d));
                *sum += x;
                squares += x * x;
            }
        }
        let count = vectors.len().max(1) as f64;
        centroid.iter_mut().for_each(|sum| *sum /= count);
        let distortion = squares - count * centroid.iter().map(|c| c * c).sum::<f64>();
        // A distortion below the rounding of the two sums is not split.
        let distortion = if distortion > squares * 1e-13 { distortion } else { 0.0 };
        Self { distortion, vectors, centroid }
    }

    /// The two halves on either side of the mean along the principal axis.
    fn split(self, all: &Tiles) -> [Self; 2] {
        let axis = principal_axis(all, &self);
        let offset: f64 = axis.iter().zip(&self.centroid).map(|(a, c)| a * c).sum();
        let above = |&v: &u32| {
            let along = axis.iter().enumerate().map(|(d, a)| a * f64::from(all.get(v as usize, d))).sum::<f64>();
            along > offset
        };
        let (upper, lower): (Vec<u32>, Vec<u32>) = self.vectors.iter().partition(|v| above(v));
        [Self::new(all, lower), Self::new(all, upper)]
    }
}

/// Direction of largest variance of a cell, by the power method from its column of largest diagonal.
fn principal_axis(all: &Tiles, cell: &Cell) -> Vec<f64> {
    let dims = all.dims;
    let mut matrix = vec![0.0f64; dims * dims];
    let mut x = vec![0.0f64; dims];
    for &v in &cell.vectors {
        for (d, x) in x.iter_mut().enumerate() {
            *x = f64::from(all.get(v as usize, d)) - cell.centroid[d];
        }
        for (row, &factor) in matrix.chunks_exact_mut(dims).zip(&x) {
            row.iter_mut().zip(&x).for_each(|(sum, x)| *sum += factor * x);
        }
    }
    let largest = (0..dims).max_by(|&i, &j| matrix[i * dims + i].total_cmp(&matrix[j * dims + j])).unwrap_or(0);
    let mut axis = matrix[largest * dims..][..dims].to_vec();
    for _ in 0..POWER_ITERATIONS {
        let largest = axis.iter().fold(0.0f64, |m, a| m.max(a.abs()));
        if largest == 0.0 {
            break;
        }
        axis.iter_mut().for_each(|a| *a /= largest);
        let row = |row: &[f64]| row.iter().zip(&axis).map(|(m, a)| m * a).sum();
        axis = matrix.chunks_exact(dims).map(row).collect();
    }
    axis
}

/// The zero vector, and the centroids of the cells that splitting gives.
fn split(vectors: &Tiles, count: usize) -> Entries {
    let mut heap = BinaryHeap::from([Cell::new(vectors, (0..vectors.count as u32).collect())]);
    let mut whole: Vec<Cell> = Vec::new();
    while heap.len() + whole.len() + 1 < count {
        let Some(cell) = heap.pop() else { break };
        if cell.distortion == 0.0 {
            heap.push(cell);
            break;
        }
        let parts = cell.split(vectors);
        if parts.iter().any(|part| part.vectors.is_empty()) {
            // Rounding put all vectors on one side: they are indistinguishable.
            whole.extend(parts.into_iter().filter(|part| !part.vectors.is_empty()));
        } else {
            heap.extend(parts);
        }
    }
    let mut rows = vec![0.0; vectors.dims];
    let cells = heap.into_sorted_vec();
    let filled = cells.iter().chain(&whole).filter(|cell| !cell.vectors.is_empty());
    rows.extend(filled.take(count.saturating_sub(1)).flat_map(|cell| cell.centroid.iter().map(|&c| c as f32)));
    Entries { dims: vectors.dims, rows }
}

/// Moves each centroid except the zero vector to the mean of its vectors, or to the vector with the largest error if it has none.
fn update(vectors: &Tiles, found: &Assignment, entries: &mut Entries) {
    let members = to_means(vectors, &found.entry, entries);
    let empty: Vec<usize> = (1..members.len()).filter(|&k| members[k] == 0).collect();
    for (k, v) in empty.iter().zip(worst(found, empty.len())) {
        (0..vectors.dims).for_each(|d| entries.rows[k * vectors.dims + d] = vectors.get(v, d));
    }
}

/// Moves the entries except the zero vector to the means of their vectors; returns the number of vectors of each entry.
pub(super) fn to_means(vectors: &Tiles, indices: &[u16], entries: &mut Entries) -> Vec<u32> {
    let (dims, count) = (vectors.dims, entries.len());
    let mut members = vec![0u32; count];
    indices.iter().for_each(|&k| members[usize::from(k)] += 1);
    // One component of all vectors after the other: each sum has a fixed order on any number of threads.
    let sums: Vec<Vec<f64>> = (0..dims)
        .into_par_iter()
        .map(|d| {
            let mut sums = vec![0.0f64; count];
            for (v, &k) in indices.iter().enumerate() {
                sums[usize::from(k)] += f64::from(vectors.get(v, d));
            }
            sums
        })
        .collect();
    for k in (1..count).filter(|&k| members[k] > 0) {
        for (d, sums) in sums.iter().enumerate() {
            entries.rows[k * dims + d] = (sums[k] / f64::from(members[k])) as f32;
        }
    }
    members
}

/// The `count` vectors farthest from their entries, the farthest first.
fn worst(found: &Assignment, count: usize) -> Vec<usize> {
    if count == 0 {
        return Vec::new();
    }
    let mut order: Vec<usize> = (0..found.distance.len()).filter(|&v| found.distance[v] > 0.0).collect();
    order.sort_by(|&a, &b| found.distance[b].total_cmp(&found.distance[a]).then(a.cmp(&b)));
    order.truncate(count);
    order
}

#[cfg(test)]
mod tests {
    use super::super::test_data::Random;
    use super::*;

    /// Points around `clusters` far corners.
    fn clusters(clusters: usize, each: usize) -> Tiles {
        let mut random = Random::new(5);
        let count = clusters * each;
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|i| (i * 7919) % count);
        let vectors: Vec<[f32; 4]> = order
            .iter()
            .map(|i| std::array::from_fn(|d| ((i % clusters + 1) * (d + 3) * 37 % 101) as f32 + 0.1 * random.signed()))
            .collect();
        let mut tiles = Tiles::new(4, count);
        for (v, vector) in vectors.iter().enumerate() {
            for (d, &x) in vector.iter().enumerate() {
                tiles.data[(v / 16 * 4 + d) * 16 + v % 16] = x;
            }
        }
        tiles
    }

    fn distortion(vectors: &Tiles, entries: &Entries) -> f64 {
        nearest(vectors, entries).distance.iter().map(|&d| f64::from(d)).sum()
    }

    #[test]
    fn separate_clusters_get_an_entry_each_and_zero_is_kept() {
        let vectors = clusters(12, 50);
        let entries = train(&vectors, 13, 10);
        assert_eq!(entries.len(), 13);
        assert!(entries.row(0).iter().all(|&x| x == 0.0));
        // Noise of +-0.1 in each of 4 numbers has a mean square of 4 * 0.01 / 3.
        assert!(distortion(&vectors, &entries) < 600.0 * 0.0134 * 1.2);
        assert!(distortion(&vectors, &train(&vectors, 12, 10)) > 600.0, "one entry less is noticed");
    }

    #[test]
    fn lbg_improves_on_the_splits_and_never_makes_them_worse() {
        let mut random = Random::new(9);
        let mut vectors = Tiles::new(8, 3000);
        vectors.data.iter_mut().for_each(|x| *x = random.signed() * random.signed());
        let mut last = f64::INFINITY;
        for iterations in [0, 1, 3, 10] {
            let found = distortion(&vectors, &train(&vectors, 64, iterations));
            assert!(found <= last, "{iterations}: {found} after {last}");
            last = found;
        }
        // Measured: 0.91.
        assert!(last < 0.97 * distortion(&vectors, &train(&vectors, 64, 0)));
    }

    #[test]
    fn few_or_equal_vectors_make_few_entries() {
        let mut same = Tiles::new(4, 40);
        same.data.fill(1.5);
        let entries = train(&same, 256, 10);
        assert_eq!(entries.rows, [[0.0; 4], [1.5; 4]].concat());
        assert_eq!(train(&Tiles::new(4, 0), 256, 10).len(), 1);
        let few = clusters(3, 1);
        let entries = train(&few, 256, 10);
        for (v, &entry) in nearest(&few, &entries).entry.iter().enumerate() {
            assert_eq!(entries.row(usize::from(entry)), [0, 1, 2, 3].map(|d| few.get(v, d)));
        }
    }

    #[test]
    fn an_entry_that_serves_nobody_moves_to_the_vector_served_worst() {
        let vectors = clusters(4, 10);
        let mut entries = train(&vectors, 5, 10);
        entries.rows[4..8].fill(1e6);
        let before = distortion(&vectors, &entries);
        update(&vectors, &nearest(&vectors, &entries), &mut entries);
        assert!(entries.row(1).iter().all(|&x| x < 200.0));
        // The entry that served them meanwhile moves back in the next iteration.
        update(&vectors, &nearest(&vectors, &entries), &mut entries);
        // Measured: 2e-5.
        assert!(distortion(&vectors, &entries) < 1e-4 * before);
    }
}

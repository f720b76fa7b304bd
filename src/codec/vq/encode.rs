//! Encoding of one block.
//!
//! ```text
//! special values out; mean m, unit s and differences d = (x - m) / s of each vertex
//! coarse vectors u: means of d over the 8 groups of 8 steps
//! codebook 8 <- train on a sample of u;   i8 <- nearest;   codebook 8 <- means of u over i8
//! fine vectors r = d - codebook 8 [i8], 64 numbers
//! axes <- principal axes of a sample of r; codebook <- train on the sample along these axes;   i64 <- nearest there
//! codebook 64 <- means of r over i64, all 64 numbers
//! ```
//!
//! Deviations from the dissertation (6.1.1), none of which a decoder sees:
//! 1. the fine vectors are the residuals of the first codebook, not those of the exact group means; the second codebook then repairs errors
//!    of the first;
//! 2. training on some 40 vectors an entry instead of all, and searching in at most 16 of 64 dimensions, unless
//!    [`Search::Exact`] is asked for.
//!
//! All sums have a fixed order: the result is the same for any number of threads.

use super::block::{Encoded, Indices, power};
use super::codebook::{to_means, train};
use super::pca::{Basis, Vector};
use super::prepare::{Prepared, Unit, take_specials};
use super::search::{Entries, nearest};
use super::tiles::{LANES, Tiles};
use super::{GROUPS, STEPS, Search, VqOptions, group_of_step};
use crate::slowdown::{Slow, waste};
use rayon::prelude::*;

/// Vectors that an entry is trained on by the fast search.
const TRAINED_ON: usize = 40;
/// Fewest vectors of a sample.
const SAMPLE_MIN: usize = 16_384;
/// Part of the variance that the fast search may omit, if the largest number of dimensions allows it.
const TAIL: f64 = 1e-4;
/// Numbers of dimensions for which the search has a loop.
const DIMENSIONS: [usize; 4] = [4, 8, 12, 16];
/// Tiles of one task.
const TASK: usize = 64;

/// Effort of training a codebook.
struct Effort {
    sample: usize,
    iterations: usize,
}

impl Effort {
    fn of(options: &VqOptions, vertices: usize) -> Self {
        match options.search {
            Search::Fast => {
                Self { sample: (TRAINED_ON * options.entries).max(SAMPLE_MIN).min(vertices), iterations: 5 }
            }
            Search::Exact => Self { sample: vertices, iterations: 10 },
        }
    }
}

/// Encodes the block `values` (step by step, one value a vertex) that begins with step `first_step` of the series. Special values in it are
/// replaced by their filling.
pub(super) fn encode_block(values: &mut [f32], vertices: usize, first_step: u32, options: &VqOptions) -> Encoded {
    waste(Slow::EncodeVq, values.len());
    let runs = take_specials(values, vertices, first_step);
    let prepared = Prepared::new(values, vertices, options.own_scales);
    let moving: Vec<u32> = (0..vertices as u32).filter(|&v| prepared.moves[v as usize]).collect();
    let effort = Effort::of(options, moving.len());
    let sample = sample(&moving, effort.sample);

    let coarse = prepared.coarse();
    let mut first = train(&coarse.select(&sample), options.entries, effort.iterations);
    let i8 = nearest(&coarse, &first).entry;
    to_means(&coarse, &i8, &mut first);
    let base = group_means(&prepared, &first);
    let fine = Fine { prepared: &prepared, base: &base, i8: &i8 };

    let vectors = fine.sample(&sample);
    let basis = match options.search {
        Search::Fast => Basis::of(&vectors, TAIL, &DIMENSIONS),
        Search::Exact => Basis::identity(),
    };
    let second = train(&project(&vectors, &basis), options.entries, effort.iterations);
    drop(vectors);
    let i64 = nearest(&fine.project_all(&basis), &second).entry;
    let cb64 = fine.means(&i64, options.entries);

    let cb8 = rows_of(&base, options.entries);
    let unit = match &prepared.unit {
        Unit::Common(exponent) => power(*exponent),
        Unit::Own(_) => 1.0,
    };
    let in_units = |codebook: Vec<f32>| codebook.into_iter().map(|x| x * unit).collect();
    Encoded {
        exponent: if let Unit::Own(exponents) = prepared.unit { exponents } else { Vec::new() },
        mean: prepared.mean,
        indices: Indices::new([i8, i64], options.entries),
        cb8: in_units(cb8),
        cb64: in_units(cb64),
        runs,
    }
}

/// At most `count` of `from`, evenly spaced: the vertices lie along a space-filling curve, so this samples space, too.
fn sample(from: &[u32], count: usize) -> Vec<u32> {
    let count = count.min(from.len());
    (0..count).map(|i| from[i * from.len() / count]).collect()
}

/// Means of numbers by entry; -0 for entry 0 and for entries without numbers. Adding -0 changes nothing: 0 would turn a constant -0 into 0.
fn means(entries: usize, numbers: impl Iterator<Item = (u16, f32)>) -> Vec<f32> {
    let mut sums = vec![(0.0f64, 0u32); entries];
    for (k, x) in numbers {
        let (sum, count) = &mut sums[usize::from(k)];
        *sum += f64::from(x);
        *count += 1;
    }
    let mean = |&(sum, count): &(f64, u32)| if count == 0 { -0.0 } else { (sum / f64::from(count)) as f32 };
    let mut means: Vec<f32> = sums.iter().map(mean).collect();
    means[0] = -0.0;
    means
}

/// The entries of the first codebook as differences of group means.
fn group_means(prepared: &Prepared<'_>, first: &Entries) -> Vec<[f32; GROUPS]> {
    let root = prepared.group_sizes().map(f32::sqrt);
    let of = |row: &[f32]| std::array::from_fn(|g| if root[g] > 0.0 { row[g] / root[g] } else { -0.0 });
    let mut base: Vec<[f32; GROUPS]> = first.rows.chunks_exact(GROUPS).map(of).collect();
    base[0] = [-0.0; GROUPS];
    base
}

/// Codebook rows: for each group one number an entry.
fn rows_of(base: &[[f32; GROUPS]], entries: usize) -> Vec<f32> {
    let mut rows = vec![-0.0; GROUPS * entries];
    for (k, entry) in base.iter().enumerate() {
        entry.iter().enumerate().for_each(|(g, &x)| rows[g * entries + k] = x);
    }
    rows
}

/// The residuals of the differences after the first codebook.
struct Fine<'a> {
    prepared: &'a Prepared<'a>,
    base: &'a [[f32; GROUPS]],
    i8: &'a [u16],
}

impl Fine<'_> {
    /// The fine vectors of 16 vertices, step by step.
    fn tile(&self, vertices: &[usize; LANES]) -> [[f32; LANES]; STEPS] {
        let mut out = self.prepared.differences(vertices);
        let base = vertices.map(|v| &self.base[usize::from(self.i8[v])]);
        let base: [[f32; LANES]; GROUPS] = std::array::from_fn(|g| base.map(|b| b[g]));
        for (j, numbers) in out[..self.prepared.steps].iter_mut().enumerate() {
            numbers.iter_mut().zip(&base[group_of_step(j)]).for_each(|(x, b)| *x -= b);
        }
        out
    }

    /// The fine vectors of the `chosen` vertices, in order.
    fn sample(&self, chosen: &[u32]) -> Vec<Vector> {
        let mut out = vec![[0.0; STEPS]; chosen.len()];
        out.par_chunks_mut(LANES).zip(chosen.par_chunks(LANES)).for_each(|(out, chosen)| {
            let tile = self.tile(&std::array::from_fn(|l| chosen[l.min(chosen.len() - 1)] as usize));
            for (l, out) in out.iter_mut().enumerate() {
                *out = std::array::from_fn(|j| tile[j][l]);
            }
        });
        out
    }

    /// All fine vectors, projected onto the axes.
    fn project_all(&self, basis: &Basis) -> Tiles {
        let mut tiles = Tiles::new(basis.axes.len(), self.prepared.vertices);
        let len = tiles.tile_len();
        tiles.data.par_chunks_mut(TASK * len).enumerate().for_each(|(task, tiles)| {
            for (i, tile) in tiles.chunks_exact_mut(len).enumerate() {
                basis.project(&self.tile(&self.prepared.lanes((task * TASK + i) * LANES)), tile);
            }
        });
        tiles
    }

    /// The second codebook: means of the fine vectors by entry, one row a step.
    fn means(&self, i64: &[u16], entries: usize) -> Vec<f32> {
        let vertices = self.prepared.vertices;
        let mut rows = vec![-0.0f32; STEPS * entries];
        let base: Vec<Vec<f32>> =
            (0..GROUPS).map(|g| self.i8.iter().map(|&k| self.base[usize::from(k)][g]).collect()).collect();
        rows.par_chunks_mut(entries).zip(self.prepared.values.par_chunks(vertices)).enumerate().for_each(
            |(j, (row, values))| {
                let base = &base[group_of_step(j)];
                let number = |v: usize| (i64[v], self.prepared.difference(v, values[v]) - base[v]);
                row.copy_from_slice(&means(entries, (0..vertices).map(number)));
            },
        );
        rows
    }
}

/// Vectors projected onto the axes.
fn project(vectors: &[Vector], basis: &Basis) -> Tiles {
    let mut tiles = Tiles::new(basis.axes.len(), vectors.len());
    let len = tiles.tile_len();
    tiles.data.par_chunks_mut(len).zip(vectors.par_chunks(LANES)).for_each(|(tile, vectors)| {
        let mut numbers = [[0.0; LANES]; STEPS];
        for (l, vector) in vectors.iter().enumerate() {
            (0..STEPS).for_each(|j| numbers[j][l] = vector[j]);
        }
        basis.project(&numbers, tile);
    });
    tiles
}

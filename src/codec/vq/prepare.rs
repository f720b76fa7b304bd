//! Preparation of a block for encoding: special values taken out, means, scales, and its two kinds of difference vectors.
//!
//! Values keep their order, step by step; everything here runs along the steps or takes 16 vertices at a time. All vectors are in units of
//! the vertex's power of two (the same for all vertices unless each has its own), so that no square of a difference can overflow or vanish
//! in f32.

use super::block::{SpecialRun, power};
use super::tiles::{LANES, Tiles};
use super::{GROUPS, STEPS, group_of_step};
use rayon::prelude::*;

/// Vertices of one task; fixed, so that no sum depends on the number of threads.
const TASK: usize = 1024;

/// Values of up to 64 steps, and statistics of each vertex.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    /// Step by step, one value a vertex; finite.
    pub(super) values: &'a [f32],
    pub(super) vertices: usize,
    /// Number of steps.
    pub(super) steps: usize,
    /// Mean of each vertex; its exact value if it is constant.
    pub(super) mean: Vec<f32>,
    /// Whether each vertex changes at all.
    pub(super) moves: Vec<bool>,
    /// Exponents of the power of two in which differences are measured.
    pub(super) unit: Unit,
}

/// Exponents of units.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Unit {
    /// One exponent for all vertices.
    Common(i8),
    /// One exponent per vertex.
    Own(Vec<i8>),
}

/// Replaces NaN and infinities by interpolation in time, and returns them as runs.
///
/// A gap is filled linearly from the value before to the value after, at the ends by the nearest value, and with 0 where no value of the
/// vertex is finite. `first_step` is that of the block.
pub(super) fn take_specials(values: &mut [f32], vertices: usize, first_step: u32) -> Vec<SpecialRun> {
    let task = TASK * STEPS;
    if values.par_chunks(task).all(|part| part.iter().all(|x| x.is_finite())) {
        return Vec::new();
    }
    let steps = values.len() / vertices;
    let mut special = vec![false; vertices];
    for row in values.chunks_exact(vertices) {
        special.iter_mut().zip(row).for_each(|(special, x)| *special |= !x.is_finite());
    }
    let mut runs = Vec::new();
    for v in (0..vertices).filter(|&v| special[v]) {
        let series: Vec<f32> = (0..steps).map(|j| values[j * vertices + v]).collect();
        runs_of(&series, v as u32, first_step, &mut runs);
        let filled = fill(&series);
        filled.iter().enumerate().for_each(|(j, &x)| values[j * vertices + v] = x);
    }
    runs
}

/// Collects the runs of special values of one vertex.
fn runs_of(series: &[f32], vertex: u32, first_step: u32, runs: &mut Vec<SpecialRun>) {
    let before = runs.len();
    for (j, x) in (0u32..).zip(series).filter(|(_, x)| !x.is_finite()) {
        let (first, bits) = (first_step + j, x.to_bits());
        match runs[before..].last_mut() {
            Some(run) if run.first + run.count == first && run.bits == bits => run.count += 1,
            _ => runs.push(SpecialRun { vertex, first, count: 1, bits }),
        }
    }
}

/// `series` with its gaps filled.
fn fill(series: &[f32]) -> Vec<f32> {
    let next = |from: usize| (from..series.len()).find(|&j| series[j].is_finite());
    let mut out = series.to_vec();
    let mut last: Option<usize> = None;
    for j in 0..series.len() {
        if series[j].is_finite() {
            last = Some(j);
            continue;
        }
        out[j] = match (last, next(j)) {
            (Some(a), Some(b)) => {
                let part = (j - a) as f64 / (b - a) as f64;
                (f64::from(series[a]) * (1.0 - part) + f64::from(series[b]) * part) as f32
            }
            (Some(a), None) => series[a],
            (None, Some(b)) => series[b],
            (None, None) => 0.0,
        };
    }
    out
}

/// Mean and spread of one vertex.
#[derive(Clone, Copy)]
struct Summary {
    mean: f32,
    moves: bool,
    /// Greatest value less least value, the bound of differences from the mean.
    spread: f64,
}

impl<'a> Prepared<'a> {
    /// Prepares finite values. Each vertex gets its own unit if `own_scales`, or if no common one is possible.
    pub(super) fn new(values: &'a [f32], vertices: usize, own_scales: bool) -> Self {
        let steps = values.len() / vertices;
        let mut summaries = vec![Summary { mean: 0.0, moves: false, spread: 0.0 }; vertices];
        summaries.par_chunks_mut(TASK).enumerate().for_each(|(task, out)| {
            summarise(values, vertices, steps, task * TASK, out);
        });
        let largest = summaries.iter().map(|s| s.spread).fold(0.0, f64::max);
        // With a common unit, differences and codebooks are unscaled: they must be far from overflow.
        let unit = if own_scales || largest > COMMON_MAX {
            Unit::Own(summaries.iter().map(|s| exponent_of(s.spread)).collect())
        } else {
            Unit::Common(exponent_of(largest))
        };
        Self {
            values,
            vertices,
            steps,
            mean: summaries.iter().map(|s| s.mean).collect(),
            moves: summaries.iter().map(|s| s.moves).collect(),
            unit,
        }
    }

    fn exponent(&self, vertex: usize) -> i8 {
        match &self.unit {
            Unit::Common(e) => *e,
            Unit::Own(e) => e[vertex],
        }
    }

    /// Differences from the mean in units, of 16 vertices, step by step; zero behind the last step.
    pub(super) fn differences(&self, vertices: &[usize; LANES]) -> [[f32; LANES]; STEPS] {
        let factors = vertices.map(|v| factors(self.exponent(v)));
        let (before, after) = (factors.map(|f| f[0]), factors.map(|f| f[1]));
        let mean: [f32; LANES] = std::array::from_fn(|l| self.mean[vertices[l]] * before[l]);
        let mut out = [[0.0; LANES]; STEPS];
        for (row, out) in self.values.chunks_exact(self.vertices).zip(&mut out) {
            for l in 0..LANES {
                out[l] = (row[vertices[l]] * before[l] - mean[l]) * after[l];
            }
        }
        out
    }

    /// The difference of one value from the mean, in units.
    pub(super) fn difference(&self, vertex: usize, value: f32) -> f32 {
        let [before, after] = factors(self.exponent(vertex));
        (value * before - self.mean[vertex] * before) * after
    }

    /// Number of steps of each group.
    pub(super) fn group_sizes(&self) -> [f32; GROUPS] {
        let mut sizes = [0.0; GROUPS];
        (0..self.steps).for_each(|j| sizes[group_of_step(j)] += 1.0);
        sizes
    }

    /// Differences of the groups' means from the mean, times the root of the group's size: distances between these
    /// vectors are those between the series that are constant in each group.
    pub(super) fn coarse(&self) -> Tiles {
        let root = self.group_sizes().map(f32::sqrt);
        let mut tiles = Tiles::new(GROUPS, self.vertices);
        let len = tiles.tile_len();
        tiles.data.par_chunks_mut(TASK / LANES * len).enumerate().for_each(|(task, tiles)| {
            for (i, tile) in tiles.chunks_exact_mut(len).enumerate() {
                let differences = self.differences(&self.lanes(task * TASK + i * LANES));
                for (j, numbers) in differences[..self.steps].iter().enumerate() {
                    let group = group_of_step(j);
                    let sums = &mut tile[group * LANES..][..LANES];
                    sums.iter_mut().zip(numbers).for_each(|(sum, x)| *sum += x / root[group]);
                }
            }
        });
        tiles
    }

    /// 16 vertices from `first` on; behind the last, the last one is repeated.
    pub(super) fn lanes(&self, first: usize) -> [usize; LANES] {
        std::array::from_fn(|l| (first + l).min(self.vertices - 1))
    }
}

/// Largest spread of a vertex for which a common unit is used.
const COMMON_MAX: f64 = (1u128 << 120) as f64;

/// Factors before and after a subtraction that give the difference in units of 2^`exponent`. Differences of the largest numbers overflow;
/// of quarters of them they don't.
fn factors(exponent: i8) -> [f32; 2] {
    let before = if exponent > 120 { 0.25 } else { 1.0 };
    [before, power(-exponent) / before]
}

/// Exponent of the power of two just above `spread`, limited so that both it and its reciprocal are f32 numbers.
fn exponent_of(spread: f64) -> i8 {
    if spread == 0.0 {
        return 0;
    }
    // The spread of f32 numbers is a normal f64.
    let exponent = ((spread.to_bits() >> 52) & 0x7FF) as i32 - 1022;
    exponent.clamp(-126, 126) as i8
}

/// Summaries of the vertices from `first` on.
fn summarise(values: &[f32], vertices: usize, steps: usize, first: usize, out: &mut [Summary]) {
    let begin = &values[first..first + out.len()];
    let mut sums = vec![0.0f64; out.len()];
    let mut least = begin.to_vec();
    let mut greatest = begin.to_vec();
    let mut differs = vec![0u32; out.len()];
    for row in values.chunks_exact(vertices) {
        let row = &row[first..first + out.len()];
        for (i, &x) in row.iter().enumerate() {
            sums[i] += f64::from(x);
            least[i] = if x < least[i] { x } else { least[i] };
            greatest[i] = if x > greatest[i] { x } else { greatest[i] };
            differs[i] |= x.to_bits() ^ begin[i].to_bits();
        }
    }
    for (i, out) in out.iter_mut().enumerate() {
        let moves = differs[i] != 0;
        let mean = if moves { (sums[i] / steps as f64) as f32 } else { begin[i] };
        *out = Summary { mean, moves, spread: f64::from(greatest[i]) - f64::from(least[i]) };
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_data::Random;
    use super::*;

    const NAN: f32 = f32::NAN;
    const INF: f32 = f32::INFINITY;

    #[test]
    fn gaps_are_filled_along_time_and_kept_as_runs() {
        // Three vertices, five steps.
        let series = [[NAN, 1.0, INF, NAN, 4.0], [2.0, NAN, NAN, NAN, NAN], [NAN, NAN, -INF, NAN, NAN]];
        let mut values: Vec<f32> = (0..15).map(|i| series[i % 3][i / 3]).collect();
        let runs = take_specials(&mut values, 3, 64);
        let filled: Vec<Vec<f32>> = (0..3).map(|v| (0..5).map(|j| values[3 * j + v]).collect()).collect();
        assert_eq!(filled, [[1.0, 1.0, 2.0, 3.0, 4.0], [2.0; 5], [0.0; 5]]);
        let run = |vertex, first, count, x: f32| SpecialRun { vertex, first, count, bits: x.to_bits() };
        let expected = [
            [run(0, 64, 1, NAN), run(0, 66, 1, INF), run(0, 67, 1, NAN), run(1, 65, 4, NAN)],
            [run(2, 64, 2, NAN), run(2, 66, 1, -INF), run(2, 67, 2, NAN), run(2, 0, 0, 0.0)],
        ];
        assert_eq!(runs, expected.concat()[..7]);
        assert_eq!(take_specials(&mut values, 3, 64), []);
    }

    #[test]
    fn means_differences_and_group_means_are_those_of_the_definition() {
        let mut noticed = 0;
        for (vertices, steps) in [(37, 64), (5, 64), (20, 23), (3, 1)] {
            let mut random = Random::new(vertices as u64);
            let mut values: Vec<f32> = (0..vertices * steps).map(|_| 7.0 + random.signed()).collect();
            (0..steps).for_each(|j| values[j * vertices + 2] = 0.1);
            let prepared = Prepared::new(&values, vertices, false);
            let Unit::Common(exponent) = prepared.unit else { panic!("one unit is enough") };
            // The spread is below 2, in steps above 1.
            assert_eq!(exponent, if steps == 1 { 0 } else { 1 });
            let unit = power(exponent);
            let coarse = prepared.coarse();
            for v in 0..vertices {
                let x = |j: usize| f64::from(values[j * vertices + v]);
                let mean = (0..steps).map(x).sum::<f64>() / steps as f64;
                // Rounded to f32 once, by two of these below 8. Measured: 1.94.
                assert!((f64::from(prepared.mean[v]) - mean).abs() <= 4.0 * f64::from(f32::EPSILON));
                assert_eq!(prepared.moves[v], v != 2 && steps > 1);
                let differences = prepared.differences(&[v; LANES]);
                for (j, row) in differences.iter().enumerate() {
                    let expected = if j < steps { values[j * vertices + v] - prepared.mean[v] } else { 0.0 };
                    assert_eq!(row[3] * unit, expected);
                }
                for (g, size) in prepared.group_sizes().into_iter().enumerate() {
                    let members = (0..steps).filter(|&j| group_of_step(j) == g);
                    let sum: f64 = members.map(|j| x(j) - f64::from(prepared.mean[v])).sum();
                    let expected = if size == 0.0 { 0.0 } else { sum / f64::from(size.sqrt()) };
                    // Sums of eight numbers below 2, each rounded, then divided.
                    let is_same = |found: f32| (f64::from(found) - expected).abs() < 32.0 * f64::from(f32::EPSILON);
                    assert!(is_same(coarse.get(v, g) * unit));
                    noticed += usize::from(!is_same(coarse.get((v + 1) % vertices, g) * unit));
                }
            }
        }
        assert!(noticed > 100, "the neighbour's means are not noticed: {noticed}");
    }

    #[test]
    fn constants_do_not_move_whatever_their_size_and_their_differences_are_zero() {
        let constants = [0.0, -0.0, 0.1, 3e38, 1e-45];
        let values: Vec<f32> =
            (0..64 * 6).map(|i| if i % 6 < 5 { constants[i % 6] } else { 1e-20 * i as f32 }).collect();
        for own in [false, true] {
            let prepared = Prepared::new(&values, 6, own);
            assert_eq!(prepared.moves, [false, false, false, false, false, true]);
            for (mean, constant) in prepared.mean.iter().zip(constants) {
                assert_eq!(mean.to_bits(), constant.to_bits());
            }
            let differences = prepared.differences(&prepared.lanes(0));
            assert!(differences.iter().all(|row| row[..5] == [0.0; 5] && row[5].abs() <= 1.0));
        }
    }

    #[test]
    fn the_largest_and_the_smallest_numbers_have_finite_differences() {
        let sign = |i: usize| if (i / 2).is_multiple_of(2) { 1.0 } else { -1.0 };
        let values: Vec<f32> = (0..128).map(|i| sign(i) * if i % 2 == 0 { f32::MAX } else { 1e-45 }).collect();
        let prepared = Prepared::new(&values, 2, false);
        assert_eq!(prepared.unit, Unit::Own(vec![126, -126]));
        for row in prepared.differences(&prepared.lanes(0)) {
            assert!((3.9..=4.0).contains(&row[0].abs()) && row[1].abs() == 2f32.powi(-23), "{row:?}");
        }
        assert_eq!([exponent_of(1.0), exponent_of(0.99), exponent_of(2f64.powi(-149))], [1, 0, -126]);
    }
}

//! Principal axes of vectors of 64 numbers.
//!
//! The covariance is summed in f32 over batches of [`BATCH`] vectors and in f64 over batches, in a fixed order. Its
//! eigenvectors come from cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, 8.5.5): slow for large
//! matrices, accurate to the last bits and short for one of 64 rows.

use super::STEPS;
use super::simd::widest;
use super::tiles::LANES;
use rayon::prelude::*;

/// Vectors whose products are summed in f32 before they go into the f64 sum.
const BATCH: usize = 64;
/// Vectors of one task.
const TASK: usize = 1024;
/// Most sweeps of rotations; a matrix of 64 rows converges in about eight.
const MAX_SWEEPS: usize = 30;

/// A vector of 64 numbers.
pub(super) type Vector = [f32; STEPS];
type Matrix = Vec<[f64; STEPS]>;

/// The first principal axes of a set of vectors.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    /// Orthonormal axes, by descending variance.
    pub(super) axes: Vec<Vector>,
}

impl Basis {
    /// The fewest axes of `vectors` that hold all but `tail` of the variance, rounded up to one of `choices` (ascending).
    pub(super) fn of(vectors: &[Vector], tail: f64, choices: &[usize]) -> Self {
        let (values, axes) = eigen(covariance(vectors));
        let total: f64 = values.iter().sum();
        let left = |dims: usize| values[dims..].iter().sum::<f64>();
        let enough = choices.iter().find(|&&dims| left(dims) <= tail * total).or(choices.last());
        let dims = enough.copied().unwrap_or(STEPS);
        Self { axes: axes[..dims].iter().map(|axis| axis.map(|x| x as f32)).collect() }
    }

    /// The 64 coordinate axes.
    pub(super) fn identity() -> Self {
        let axis = |i: usize| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 });
        Self { axes: (0..STEPS).map(axis).collect() }
    }

    /// Projects 16 vectors, stored component by component, onto the axes, into one tile.
    pub(super) fn project(&self, vectors: &[[f32; LANES]; STEPS], tile: &mut [f32]) {
        widest(Projection { axes: &self.axes, vectors, tile });
    }
}

struct Projection<'a> {
    axes: &'a [Vector],
    vectors: &'a [[f32; LANES]; STEPS],
    tile: &'a mut [f32],
}

impl pulp::NullaryFnOnce for Projection<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (axis, out) in self.axes.iter().zip(self.tile.chunks_exact_mut(LANES)) {
            let mut sums = [0.0f32; LANES];
            for (&weight, numbers) in axis.iter().zip(self.vectors) {
                for (sum, &number) in sums.iter_mut().zip(numbers) {
                    *sum += weight * number;
                }
            }
            out.copy_from_slice(&sums);
        }
    }
}

/// Covariance matrix of `vectors`.
fn covariance(vectors: &[Vector]) -> Matrix {
    let count = vectors.len().max(1) as f64;
    let parts: Vec<(Matrix, [f64; STEPS])> = vectors.par_chunks(TASK).map(products).collect();
    let mut matrix = vec![[0.0; STEPS]; STEPS];
    let mut mean = [0.0; STEPS];
    for (products, sums) in &parts {
        for (row, part) in matrix.iter_mut().zip(products) {
            row.iter_mut().zip(part).for_each(|(a, b)| *a += b);
        }
        mean.iter_mut().zip(sums).for_each(|(a, b)| *a += b);
    }
    mean.iter_mut().for_each(|m| *m /= count);
    for i in 0..STEPS {
        for j in i..STEPS {
            matrix[i][j] = matrix[i][j] / count - mean[i] * mean[j];
            matrix[j][i] = matrix[i][j];
        }
    }
    matrix
}

/// Sums of the products of all pairs of components (upper triangle), and of the components.
fn products(vectors: &[Vector]) -> (Matrix, [f64; STEPS]) {
    let mut matrix = vec![[0.0f64; STEPS]; STEPS];
    let mut sums = [0.0f64; STEPS];
    let mut rows = vec![[0.0f32; STEPS]; STEPS];
    for batch in vectors.chunks(BATCH) {
        rows.fill([0.0; STEPS]);
        for v in batch {
            for (i, row) in rows.iter_mut().enumerate() {
                let factor = v[i];
                // From a multiple of 8 on: whole registers, and few products below the diagonal.
                let from = i & !7;
                row[from..].iter_mut().zip(&v[from..]).for_each(|(sum, x)| *sum += factor * x);
            }
            sums.iter_mut().zip(v).for_each(|(sum, &x)| *sum += f64::from(x));
        }
        for (to, from) in matrix.iter_mut().zip(&rows) {
            to.iter_mut().zip(from).for_each(|(a, &b)| *a += f64::from(b));
        }
    }
    (matrix, sums)
}

/// Eigenvalues of a symmetric matrix, the largest first, and their eigenvectors as rows.
fn eigen(mut a: Matrix) -> (Vec<f64>, Matrix) {
    let mut axes: Matrix = (0..STEPS).map(|i| std::array::from_fn(|j| f64::from(u8::from(i == j)))).collect();
    let norm: f64 = a.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
    // Off-diagonal elements are then below the rounding of the diagonal.
    let negligible = norm * f64::EPSILON / STEPS as f64;
    for _ in 0..MAX_SWEEPS {
        let mut rotated = false;
        for p in 0..STEPS {
            for q in p + 1..STEPS {
                if a[p][q].abs() > negligible {
                    rotate(&mut a, &mut axes, p, q);
                    rotated = true;
                }
            }
        }
        if !rotated {
            break;
        }
    }
    let mut order: Vec<usize> = (0..STEPS).collect();
    order.sort_by(|&i, &j| a[j][j].total_cmp(&a[i][i]).then(i.cmp(&j)));
    // A variance of zero may round to a negative one.
    (order.iter().map(|&i| a[i][i].max(0.0)).collect(), order.iter().map(|&i| axes[i]).collect())
}

/// One Jacobi rotation: makes a[p][q] zero.
fn rotate(a: &mut Matrix, axes: &mut Matrix, p: usize, q: usize) {
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for row in a.iter_mut() {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
    for j in 0..STEPS {
        (a[p][j], a[q][j]) = (c * a[p][j] - s * a[q][j], s * a[p][j] + c * a[q][j]);
        (axes[p][j], axes[q][j]) = (c * axes[p][j] - s * axes[q][j], s * axes[p][j] + c * axes[q][j]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_data::Random;
    use super::*;

    /// Vectors in the span of three fixed ones, with a little noise.
    fn vectors(count: usize) -> Vec<Vector> {
        let mut random = Random::new(1);
        let shape = |k: usize, j: usize| ((j * (2 * k + 1)) as f32 * 0.05 + k as f32).sin();
        (0..count)
            .map(|_| {
                let w: [f32; 3] = std::array::from_fn(|k| random.signed() * [4.0, 2.0, 1.0][k]);
                std::array::from_fn(|j| 5.0 + (0..3).map(|k| w[k] * shape(k, j)).sum::<f32>() + 1e-3 * random.signed())
            })
            .collect()
    }

    #[test]
    fn the_covariance_is_that_of_the_textbook() {
        let vectors = vectors(2500);
        let matrix = covariance(&vectors);
        let n = vectors.len() as f64;
        let mean = |i: usize| vectors.iter().map(|v| f64::from(v[i])).sum::<f64>() / n;
        for (i, j) in [(0, 0), (3, 17), (63, 1), (40, 40)] {
            let of = |v: &Vector| (f64::from(v[i]) - mean(i)) * (f64::from(v[j]) - mean(j));
            let expected = vectors.iter().map(of).sum::<f64>() / n;
            // Products up to 12^2, batches of 64 summed in f32: 64 * 2^-24 of that at most.
            let bound = 64.0 * 144.0 * 2f64.powi(-24);
            assert!((matrix[i][j] - expected).abs() < bound, "{i} {j}");
            assert!((matrix[i][(j + 1) % STEPS] - expected).abs() > bound, "{i} {j}: the neighbour is not noticed");
        }
    }

    #[test]
    fn eigenvectors_are_orthonormal_and_rebuild_the_matrix() {
        let vectors = vectors(40);
        let product = |i: usize, j: usize| vectors.iter().map(|v| f64::from(v[i]) * f64::from(v[j])).sum::<f64>();
        let matrix: Matrix = (0..STEPS).map(|i| std::array::from_fn(|j| product(i, j))).collect();
        let (values, axes) = eigen(matrix.clone());
        assert!(values.windows(2).all(|w| w[0] >= w[1]));
        let dot = |a: &[f64; STEPS], b: &[f64; STEPS]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        for i in 0..STEPS {
            for j in 0..STEPS {
                // Some 10 sweeps of 2016 rotations, each of a few roundings.
                assert!((dot(&axes[i], &axes[j]) - f64::from(u8::from(i == j))).abs() < 1e-12);
                let rebuilt: f64 = (0..STEPS).map(|k| values[k] * axes[k][i] * axes[k][j]).sum();
                assert!((rebuilt - matrix[i][j]).abs() < 1e-11 * values[0]);
            }
        }
    }

    #[test]
    fn as_many_axes_are_taken_as_the_data_have() {
        assert_eq!(Basis::of(&vectors(500), 1e-4, &[4, 8, 16]).axes.len(), 4);
        let constant = vec![[1.0; STEPS]; 10];
        assert_eq!(Basis::of(&constant, 1e-4, &[4, 8, 16]).axes.len(), 4);
        let mut random = Random::new(2);
        let noise: Vec<Vector> = (0..2000).map(|_| std::array::from_fn(|_| random.signed())).collect();
        assert_eq!(Basis::of(&noise, 1e-4, &[4, 8, 16]).axes.len(), 16);
        assert_eq!(Basis::of(&[], 1e-4, &[4, 8]).axes.len(), 4);
    }
}

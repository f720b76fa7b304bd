//! Separable filters on a plane of numbers.

use super::Plane;
use rayon::prelude::*;

/// Weights of a filter along one axis at offsets `-radius..=radius`.
pub(super) struct Kernel(Vec<f64>);

impl Kernel {
    /// Samples `f` at each offset.
    pub(super) fn sample(radius: usize, f: impl Fn(f64) -> f64) -> Self {
        Self((0..=2 * radius).map(|i| f(i as f64 - radius as f64)).collect())
    }

    pub(super) fn sum(&self) -> f64 {
        self.0.iter().sum()
    }

    /// The kernel scaled to a sum of 1.
    pub(super) fn normalised(self) -> Self {
        let sum = self.sum();
        Self(self.0.into_iter().map(|w| w / sum).collect())
    }

    /// The kernel with positive weights scaled to a sum of 1, negative ones to -1.
    pub(super) fn signs_normalised(self) -> Self {
        let positive: f64 = self.0.iter().filter(|w| **w > 0.0).sum();
        let negative: f64 = -self.0.iter().filter(|w| **w < 0.0).sum::<f64>();
        Self(self.0.into_iter().map(|w| w / if w > 0.0 { positive } else { negative }).collect())
    }

    fn radius(&self) -> usize {
        self.0.len() / 2
    }
}

impl Plane<f64> {
    /// The plane filtered by one kernel along rows and another along columns; edges are replicated.
    pub(super) fn convolved(&self, along_rows: &Kernel, along_columns: &Kernel) -> Self {
        let (width, height) = (self.width, self.height);
        let clamped = |i: usize, k: usize, radius: usize, size: usize| (i + k).saturating_sub(radius).min(size - 1);
        let mut rows = vec![0.0; self.pixels.len()];
        rows.par_chunks_mut(width).zip(self.pixels.par_chunks(width)).for_each(|(out, row)| {
            let radius = along_rows.radius();
            for (i, value) in out.iter_mut().enumerate() {
                let weighted = |(k, w): (usize, &f64)| w * row[clamped(i, k, radius, width)];
                *value = along_rows.0.iter().enumerate().map(weighted).sum();
            }
        });
        let mut pixels = vec![0.0; self.pixels.len()];
        pixels.par_chunks_mut(width).enumerate().for_each(|(j, out)| {
            let radius = along_columns.radius();
            for (k, w) in along_columns.0.iter().enumerate() {
                let start = clamped(j, k, radius, height) * width;
                out.iter_mut().zip(&rows[start..start + width]).for_each(|(value, v)| *value += w * v);
            }
        });
        Self { width, height, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn convolution_equals_the_double_sum() {
        let (width, height) = (5, 4);
        let pixels: Vec<f64> = (0..20).map(|i| f64::from(i * i % 7)).collect();
        let plane = Plane { width, height, pixels };
        let (rows, columns) = (Kernel::sample(2, |x| 1.0 + x), Kernel::sample(1, |y| 2.0 - y * y));
        let fast = plane.convolved(&rows, &columns);
        for j in 0..4_i32 {
            for i in 0..5_i32 {
                let mut sum = 0.0;
                for dj in -1..=1 {
                    for di in -2..=2 {
                        let (x, y) = ((i + di).clamp(0, 4), (j + dj).clamp(0, 3));
                        let weight = (1.0 + f64::from(di)) * (2.0 - f64::from(dj * dj));
                        sum += weight * plane.pixels[(y * 5 + x) as usize];
                    }
                }
                assert_eq!(fast.pixels[(j * 5 + i) as usize], sum, "small whole numbers are exact");
            }
        }
    }
}

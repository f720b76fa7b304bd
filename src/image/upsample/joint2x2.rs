//! Bilinear interpolation between those of the four surrounding samples whose reference value is nearly that of the pixel.
//!
//! ```text
//! S_p = 1 / k_p  sum over the four samples s of  I_s b_s(p) g(|R_p - R_s|)      b: the weights of bilinear interpolation
//! ```
//! with g as in the joint filter (`joint.rs`) and R_s the reference at the sample. If all four lie across an edge, so that the sum of the
//! weights is below [`LEAST_SUM`], the pixel is interpolated bilinearly.

use super::joint::exp2_of_negative;
use super::{Enlarging, Reference, log2_per_square};
use crate::image::RgbaImage;
use rayon::prelude::*;

/// Minimum sum of weights; below it all samples are ignored.
pub const LEAST_SUM: f32 = 1e-6;

/// The image at full size, and the number of pixels that fell back to bilinear interpolation. `references`: at the pixels of the full
/// image, and at the samples. `sigma_reference`: sigma of g, above 0.
pub fn joint2x2(
    image: &RgbaImage,
    enlarging: &Enlarging,
    references: [&Reference; 2],
    sigma_reference: f64,
) -> (RgbaImage, u64) {
    joint2x2_above(LEAST_SUM, image, enlarging, references, sigma_reference)
}

/// [`joint2x2`] with another minimum sum of weights.
pub(crate) fn joint2x2_above(
    least_sum: f32,
    image: &RgbaImage,
    enlarging: &Enlarging,
    [at_pixels, at_samples]: [&Reference; 2],
    sigma_reference: f64,
) -> (RgbaImage, u64) {
    let (width, height) = enlarging.full;
    let mut out = RgbaImage::new(width, height);
    if enlarging.is_empty() {
        return (out, 0);
    }
    let per_square = log2_per_square(sigma_reference);
    let columns = enlarging.between_samples(image.width, width);
    let rows = enlarging.between_samples(image.height, height);
    let lines = out.pixels.par_chunks_mut(width).zip(at_pixels.pixels.par_chunks(width)).zip(&rows);
    let fell_back = lines.map(|((pixels, references), &(above, below, down))| {
        let mut fell_back = 0;
        for ((pixel, here), &(left, right, along)) in pixels.iter_mut().zip(references).zip(&columns) {
            let samples = [(above, left), (above, right), (below, left), (below, right)]
                .map(|(row, column)| row * image.width + column);
            let shares = [(1.0 - along) * (1.0 - down), along * (1.0 - down), (1.0 - along) * down, along * down];
            let weight = |i: usize| shares[i] * alike(here, &at_samples.pixels[samples[i]], per_square);
            let mut weights: [f32; 4] = std::array::from_fn(weight);
            let mut sum: f32 = weights.iter().sum();
            if sum < least_sum {
                (weights, sum) = (shares, shares.iter().sum());
                fell_back += 1;
            }
            let mixed = |c: usize| (0..4).map(|i| weights[i] * image.pixels[samples[i]][c]).sum::<f32>() / sum;
            *pixel = std::array::from_fn(mixed);
        }
        fell_back
    });
    let fell_back = fell_back.sum();
    (out, fell_back)
}

/// g of two reference values.
#[inline(always)]
fn alike(a: &[f32; 3], b: &[f32; 3], per_square: f32) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    exp2_of_negative(-(x * x + y * y + z * z) * per_square)
}

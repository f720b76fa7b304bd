//! Bilinear interpolation between samples.

use super::Enlarging;
use crate::image::RgbaImage;
use rayon::prelude::*;

/// The image resized by [`bilinear`], for the same camera and an equal height of the view.
pub fn enlarged(image: &RgbaImage, width: usize, height: usize) -> RgbaImage {
    bilinear(image, &Enlarging::between((image.width, image.height), (width, height)))
}

/// The image at full size, bilinear between samples at their positions in the scene. Edges are replicated.
pub fn bilinear(image: &RgbaImage, enlarging: &Enlarging) -> RgbaImage {
    let (width, height) = enlarging.full;
    let mut out = RgbaImage::new(width, height);
    if enlarging.is_empty() {
        return out;
    }
    let columns = enlarging.between_samples(image.width, width);
    let rows = enlarging.between_samples(image.height, height);
    let mix = |a: [f32; 4], b: [f32; 4], part: f32| std::array::from_fn(|c| a[c] + (b[c] - a[c]) * part);
    out.pixels.par_chunks_mut(width).zip(&rows).for_each(|(row, &(above, below, down))| {
        let at = |row: usize, column: usize| image.pixels[row * image.width + column];
        for (pixel, &(left, right, along)) in row.iter_mut().zip(&columns) {
            *pixel =
                mix(mix(at(above, left), at(above, right), along), mix(at(below, left), at(below, right), along), down);
        }
    });
    out
}

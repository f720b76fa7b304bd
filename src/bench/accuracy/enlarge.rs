//! A smaller image at full size.

use crate::image::RgbaImage;
use rayon::prelude::*;

/// The image at another size, bilinear between pixel centres, which lie where they did in the scene: both are seen through the
/// same camera, whose image height is the same. Beyond the outermost centres the image holds on.
pub fn enlarged(image: &RgbaImage, width: usize, height: usize) -> RgbaImage {
    let mut out = RgbaImage::new(width, height);
    if image.pixels.is_empty() || out.pixels.is_empty() {
        return out;
    }
    let per_pixel = image.height as f64 / height as f64;
    let places = |size: usize, from: usize| -> Vec<(usize, usize, f32)> {
        let last = (from - 1) as f64;
        let place = |i: usize| {
            let from_middle = i as f64 + 0.5 - 0.5 * size as f64;
            let at = (from_middle * per_pixel + 0.5 * from as f64 - 0.5).clamp(0.0, last);
            let near = at as usize;
            (near, (near + 1).min(from - 1), (at - near as f64) as f32)
        };
        (0..size).map(place).collect()
    };
    let (columns, rows) = (places(width, image.width), places(height, image.height));
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

#[cfg(test)]
mod tests {
    use super::*;

    /// An image whose channels are linear in the place, as a share of the height from the middle.
    fn ramp(width: usize, height: usize) -> RgbaImage {
        let mut image = RgbaImage::new(width, height);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            let (x, y) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let (u, v) = ((x - 0.5 * width as f64) / height as f64, (y - 0.5 * height as f64) / height as f64);
            *pixel = [u as f32, v as f32, (u + 2.0 * v) as f32, 1.0];
        }
        image
    }

    #[test]
    fn what_is_linear_in_the_scene_stays_where_it_is_at_any_size() {
        for (small, full) in [((20, 15), (40, 30)), ((10, 8), (41, 30)), ((40, 30), (40, 30))] {
            let (from, to) = (ramp(small.0, small.1), ramp(full.0, full.1));
            let large = enlarged(&from, full.0, full.1);
            let factor = full.1.div_ceil(small.1);
            let mut worst = 0.0_f32;
            for (i, (a, b)) in large.pixels.iter().zip(&to.pixels).enumerate() {
                // Beyond the outermost centres the image holds on.
                let (x, y) = (i % full.0, i / full.0);
                if x >= factor && x + factor < full.0 && y >= factor && y + factor < full.1 {
                    worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(worst, f32::max);
                }
            }
            // A few roundings of numbers below 2.
            assert!(worst <= 1e-6, "{small:?} to {full:?}: {worst}");
        }
        let moved = enlarged(&ramp(20, 15), 40, 30);
        assert!((moved.pixels[15 * 40 + 20][0] - ramp(40, 30).pixels[15 * 40 + 21][0]).abs() > 1e-6, "cannot fail");
    }

    #[test]
    fn the_smallest_image_and_none_are_enlarged_too() {
        let one = RgbaImage { width: 1, height: 1, pixels: vec![[0.25, 0.5, 0.75, 1.0]] };
        assert!(enlarged(&one, 7, 3).pixels.iter().all(|p| *p == one.pixels[0]));
        assert_eq!(enlarged(&RgbaImage::default(), 2, 2), RgbaImage::new(2, 2));
        assert_eq!(enlarged(&one, 0, 2), RgbaImage::new(0, 2));
    }
}

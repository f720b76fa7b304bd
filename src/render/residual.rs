//! Detail missing from frames of few rays, taken from an earlier frame of the same view.
//!
//! ```text
//! shown = F_0 + B(L_t - L_0) = D + B(L_t),   D = F_0 - B(L_0)      0 <= colour <= opacity <= 1
//! ```
//! L are the rays at every [`STRIDE_PX`]th pixel and in the last column and row, B bilinear interpolation between them, F_0 an image of
//! all rays; L_0 its pixels at the rays of L. The *details* D are zero at rays of L, whose pixels are shown unchanged. They come in bands
//! of rows, so that they can be renewed a band at a time during playback. Depth is that of the nearest ray of L.

use crate::camera::Lattice;
use crate::image::{Planes, RgbaImage};
use rayon::prelude::*;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::Arc;

/// Pixels between neighbouring rays.
pub const STRIDE_PX: usize = 4;

/// Rows of a band, equal to the rows of a renderer's tile.
const BAND_ROWS: usize = 16;

/// Frames in which all details are renewed once, some bands in each.
pub const RENEWAL_FRAMES: usize = 32;

/// The pixels that rays are cast for.
pub fn lattice() -> Lattice {
    Lattice::new(NonZeroUsize::new(STRIDE_PX).unwrap_or(NonZeroUsize::MIN))
}

/// Difference between an image of all rays and bilinear interpolation between the rays of [`lattice`]. Cheap to clone: bands are shared.
#[derive(Clone, Debug, PartialEq)]
pub struct Details {
    /// Width and height in pixels.
    size_px: (usize, usize),
    /// Rows of pixels, [`BAND_ROWS`] of them except perhaps in the last band.
    bands: Vec<Arc<Vec<[f32; 4]>>>,
}

impl Details {
    /// The details of an image of all rays.
    pub fn of(image: &RgbaImage) -> Self {
        let size_px = (image.width, image.height);
        let between = interpolated(&at_lattice(image), size_px);
        let [exact, between] = [image, &between].map(|of| of.pixels.par_chunks((BAND_ROWS * image.width).max(1)));
        let bands = exact.zip(between).map(|(exact, between)| Arc::new(lacking(exact, between)));
        Self { size_px, bands: bands.collect() }
    }

    /// Number of bands of an image of this width and height.
    pub fn count(size_px: (usize, usize)) -> usize {
        size_px.1.div_ceil(BAND_ROWS)
    }

    /// Number of bands to renew per frame, so that [`RENEWAL_FRAMES`] suffice for all.
    pub fn per_frame(size_px: (usize, usize)) -> usize {
        Self::count(size_px).div_ceil(RENEWAL_FRAMES)
    }

    /// The rows of a band.
    pub fn rows_of(band: usize, (_, height): (usize, usize)) -> Range<usize> {
        (band * BAND_ROWS).min(height)..((band + 1) * BAND_ROWS).min(height)
    }

    /// Width and height of the image in pixels.
    pub fn size_px(&self) -> (usize, usize) {
        self.size_px
    }

    /// Copies some bands from other details of the same size.
    pub fn take_over(&mut self, bands: Range<usize>, from: &Self) {
        if self.size_px == from.size_px {
            let ours = self.bands.iter_mut().zip(&from.bands).enumerate();
            ours.filter(|(band, _)| bands.contains(band)).for_each(|(_, (ours, theirs))| *ours = theirs.clone());
        }
    }

    /// The interpolated image plus these details.
    fn added_to(&self, between: &RgbaImage) -> RgbaImage {
        let mut image = between.clone();
        let bands = image.pixels.par_chunks_mut((BAND_ROWS * self.size_px.0).max(1)).zip(&self.bands);
        bands.for_each(|(pixels, details)| {
            for (pixel, detail) in pixels.iter_mut().zip(details.iter()) {
                let sum: [f32; 4] = std::array::from_fn(|c| pixel[c] + detail[c]);
                let opacity = sum[3].clamp(0.0, 1.0);
                *pixel = [sum[0].clamp(0.0, opacity), sum[1].clamp(0.0, opacity), sum[2].clamp(0.0, opacity), opacity];
            }
        });
        image
    }
}

/// Error of the pixels that were renewed, before they were.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ResidualError {
    /// Number of renewed pixels.
    pub pixels: u64,
    /// Root mean square error of raw accumulators, with details and without.
    pub rmse: [f64; 2],
}

/// A frame of few rays, enlarged to full size with details.
#[derive(Debug)]
pub struct Residual {
    between: RgbaImage,
    color: RgbaImage,
    details: Details,
}

impl Residual {
    /// Enlarges the planes of [`lattice`] to full size: colour here, depth in place. The details must be of this size.
    pub fn new(planes: &mut Planes, details: Details) -> Self {
        let between = interpolated(&planes.color, details.size_px);
        let color = details.added_to(&between);
        let (width, height) = details.size_px;
        let (columns, rows) = (nearest(width), nearest(height));
        let of_row = |&row: &usize| columns.iter().map(move |column| (row, column));
        let small = planes.depth.width;
        let depths = rows
            .par_iter()
            .flat_map_iter(|row| of_row(row).map(|(row, column)| planes.depth.pixels[row * small + column]));
        let depths: Vec<f32> = depths.collect();
        (planes.depth.width, planes.depth.height, planes.depth.pixels) = (width, height, depths);
        Self { between, color, details }
    }

    /// Shows exact rows, which start with the first row of a band, and replaces the details of their bands.
    pub fn renew(&mut self, bands: Range<usize>, exact: &[[f32; 4]]) -> ResidualError {
        let (size_px @ (width, _), mut exact) = (self.details.size_px, exact);
        let mut squares = [0.0; 2];
        let mut pixels = 0;
        for band in bands {
            let rows = Details::rows_of(band, size_px);
            let Some((of_band, others)) = exact.split_at_checked(width * rows.len()) else { break };
            exact = others;
            let (from, to) = (width * rows.start, width * rows.end);
            let shown = [&self.color.pixels[from..to], &self.between.pixels[from..to]];
            for (square, shown) in squares.iter_mut().zip(shown) {
                let differences = shown.as_flattened().iter().zip(of_band.as_flattened());
                *square += differences.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
            }
            pixels += of_band.len() as u64;
            self.details.bands[band] = Arc::new(lacking(of_band, shown[1]));
            self.color.pixels[from..to].copy_from_slice(of_band);
        }
        let rmse = squares.map(|sum| if pixels == 0 { 0.0 } else { (sum / (4 * pixels) as f64).sqrt() });
        ResidualError { pixels, rmse }
    }

    /// The image, and the details for the frames that follow.
    pub fn finish(self) -> (RgbaImage, Details) {
        (self.color, self.details)
    }
}

/// The pixels of an image on [`lattice`].
fn at_lattice(image: &RgbaImage) -> RgbaImage {
    let (lattice, width, height) = (lattice(), image.width, image.height);
    let (columns, rows) = (lattice.count(width), lattice.count(height));
    let pixel = |row, column| image.pixels[lattice.pixel(row, height) * width + lattice.pixel(column, width)];
    let pixels = (0..rows).flat_map(|row| (0..columns).map(move |column| pixel(row, column))).collect();
    RgbaImage { width: columns, height: rows, pixels }
}

/// Bilinear interpolation between the pixels of [`lattice`], which stay unchanged.
fn interpolated(small: &RgbaImage, (width, height): (usize, usize)) -> RgbaImage {
    let (columns, rows) = (around(width), around(height));
    let mut out = RgbaImage::new(width, height);
    out.pixels.par_chunks_mut(width.max(1)).zip(&rows).for_each(|(pixels, &(above, below, down))| {
        let of_row = |row: usize| &small.pixels[row * small.width..][..small.width];
        let (above, below) = (of_row(above), of_row(below));
        for (pixel, &(left, right, along)) in pixels.iter_mut().zip(&columns) {
            for c in 0..4 {
                let [top, bottom] = [above, below].map(|row| mixed(row[left][c], row[right][c], along));
                pixel[c] = mixed(top, bottom, down);
            }
        }
    });
    out
}

/// Linear interpolation, exact at both ends.
fn mixed(a: f32, b: f32, share: f32) -> f32 {
    a * (1.0 - share) + b * share
}

/// Pixels of one image minus those of another.
fn lacking(exact: &[[f32; 4]], between: &[[f32; 4]]) -> Vec<[f32; 4]> {
    exact.iter().zip(between).map(|(exact, between)| std::array::from_fn(|c| exact[c] - between[c])).collect()
}

/// For each pixel of a line the two lattice indices around it, and its fraction of the way from the first to the second.
fn around(pixels: usize) -> Vec<(usize, usize, f32)> {
    let lattice = lattice();
    let last = lattice.count(pixels) - 1;
    let of_pixel = |pixel: usize| {
        let before = (pixel / STRIDE_PX).min(last.saturating_sub(1));
        let after = (before + 1).min(last);
        let [from, to] = [before, after].map(|at| lattice.pixel(at, pixels));
        let share = if to > from { (pixel - from) as f32 / (to - from) as f32 } else { 0.0 };
        (before, after, share)
    };
    (0..pixels).map(of_pixel).collect()
}

/// For each pixel of a line the nearest lattice index.
fn nearest(pixels: usize) -> Vec<usize> {
    around(pixels).into_iter().map(|(before, after, share)| if share < 0.5 { before } else { after }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::compare_raw;
    use crate::mesh::test_meshes::Random;

    /// Random colours within their opacities.
    fn noise(random: &mut Random, (width, height): (usize, usize)) -> RgbaImage {
        let mut image = RgbaImage::new(width, height);
        for pixel in &mut image.pixels {
            let opacity = 0.5 + 0.5 * random.signed() as f32;
            *pixel = [opacity, 0.5 * opacity, opacity * (0.5 + 0.5 * random.signed() as f32), opacity];
        }
        image
    }

    fn planes(image: &RgbaImage) -> Planes {
        let color = at_lattice(image);
        let mut planes = Planes::default();
        planes.clear(color.width, color.height);
        planes.depth.pixels = (0..color.pixels.len()).map(|at| at as f32).collect();
        Planes { color, ..planes }
    }

    const SIZES: [(usize, usize); 6] = [(1, 1), (4, 5), (5, 4), (70, 35), (2, 130), (33, 16)];

    /// The formula pixel by pixel, in f64.
    fn naive(now: &RgbaImage, before: &RgbaImage) -> RgbaImage {
        let (width, height) = (now.width, now.height);
        let places = |at: usize, pixels: usize| {
            let last = pixels - 1;
            let from = (at / 4 * 4).min(if last.is_multiple_of(4) { last.saturating_sub(4) } else { last / 4 * 4 });
            let to = (from + 4).min(last);
            (from, to, if to > from { (at - from) as f64 / (to - from) as f64 } else { 0.0 })
        };
        let mut out = RgbaImage::new(width, height);
        for at in 0..width * height {
            let ((x0, x1, x), (y0, y1, y)) = (places(at % width, width), places(at / width, height));
            let change = |row: usize, column: usize, c: usize| {
                f64::from(now.pixels[row * width + column][c]) - f64::from(before.pixels[row * width + column][c])
            };
            let sum = |c: usize| {
                let top = (1.0 - x) * change(y0, x0, c) + x * change(y0, x1, c);
                let bottom = (1.0 - x) * change(y1, x0, c) + x * change(y1, x1, c);
                f64::from(before.pixels[at][c]) + (1.0 - y) * top + y * bottom
            };
            let opacity = sum(3).clamp(0.0, 1.0);
            out.pixels[at] = [0, 1, 2, 3].map(|c| sum(c).clamp(0.0, opacity) as f32);
        }
        out
    }

    #[test]
    fn the_change_between_two_moments_is_bilinear_and_colours_stay_within_opacity() {
        let mut random = Random::new(7);
        for size_px in SIZES {
            let [before, now] = [(); 2].map(|()| noise(&mut random, size_px));
            let expected = naive(&now, &before);
            let (shown, _) = Residual::new(&mut planes(&now), Details::of(&before)).finish();
            // Ten sums and products of numbers below 1, each rounded by at most 2^-25.
            let most = 10.0 * 2f64.powi(-25);
            let difference = compare_raw(&shown, &expected).unwrap();
            assert!(difference.max <= most, "{size_px:?}: {difference:?}");
            assert!(shown.pixels.iter().all(|p| p[3] <= 1.0 && p.iter().all(|&c| (0.0..=p[3]).contains(&c))));
            let (plain, _) =
                Residual::new(&mut planes(&now), Details::of(&RgbaImage::new(size_px.0, size_px.1))).finish();
            let is_between_rays = size_px != (1, 1);
            assert_eq!(compare_raw(&plain, &expected).unwrap().max > 0.1, is_between_rays, "{size_px:?}: it can fail");
        }
    }

    #[test]
    fn rays_that_are_cast_are_shown_as_they_are_and_so_is_a_moment_that_did_not_change() {
        let mut random = Random::new(8);
        for size_px in SIZES {
            let [before, now] = [(); 2].map(|()| noise(&mut random, size_px));
            let mut of_now = planes(&now);
            let (shown, _) = Residual::new(&mut of_now, Details::of(&before)).finish();
            assert_eq!(at_lattice(&shown), at_lattice(&now), "{size_px:?}");
            assert_eq!(
                (of_now.depth.width, of_now.depth.height, of_now.depth.pixels.len()),
                (size_px.0, size_px.1, now.pixels.len())
            );
            let (same, _) = Residual::new(&mut planes(&before), Details::of(&before)).finish();
            // One difference and one sum, rounded.
            assert!(compare_raw(&same, &before).unwrap().max <= 2f64.powi(-23), "{size_px:?}");
        }
    }

    #[test]
    fn bands_made_anew_are_exact_and_their_details_serve_the_next_moment() {
        let mut random = Random::new(9);
        for size_px in SIZES {
            let [before, now] = [(); 2].map(|()| noise(&mut random, size_px));
            let bands = 0..Details::count(size_px);
            let mut details = Details::of(&before);
            for band in bands.clone() {
                let mut residual = Residual::new(&mut planes(&now), details.clone());
                let rows = Details::rows_of(band, size_px);
                let exact = &now.pixels[rows.start * size_px.0..rows.end * size_px.0];
                let error = residual.renew(band..band + 1, exact);
                assert_eq!(error.pixels as usize, exact.len());
                if exact.len() > 100 {
                    assert!(error.rmse.iter().all(|&rmse| rmse > 0.01), "{error:?}");
                }
                let (shown, renewed) = residual.finish();
                assert_eq!(&shown.pixels[rows.start * size_px.0..rows.end * size_px.0], exact);
                details.take_over(band..band + 1, &renewed);
            }
            assert_eq!(details, Details::of(&now), "{size_px:?}");
            let mut residual = Residual::new(&mut planes(&now), details);
            let error = residual.renew(bands, &now.pixels);
            assert!(error.rmse[0] <= 2f64.powi(-23) && residual.finish().0 == now, "{size_px:?}: {error:?}");
        }
    }
}

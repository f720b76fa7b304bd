//! Histograms as columns and images of pixels.
//!
//! A bin covers the pixels where its values are drawn. Bins narrower than a pixel are summed; the count of a wider one is shared among its
//! pixels, in proportion to the values of each. So pixels show a density over the axis as it is drawn, not the count of the bin they are
//! in: where a map stretches the axis its columns become lower, areas stay what they were, and all counts in the pixels add up to those of
//! the histogram. With counts a stretched part would look as though it had more values; and the map that equalises a histogram
//! ([`RangeMap::equalised`], dissertation 7.2) would not draw it level.

use crate::moments::{Bins, CountScale, Histogram1d, Histogram2d, shares};
use crate::transfer::{MappedRange, RangeMap};

/// An axis along which a histogram is drawn, from its low end (left, bottom) on.
#[derive(Clone, Copy, Debug)]
pub enum DrawnAxis<'a> {
    /// The axis of the histogram itself, on which bins are equally wide, those of octaves too; with positions moved by a map.
    Bins(&'a RangeMap),
    /// A linear or log-spaced range of values, with positions moved by a map. The identity of maps gives the plain range.
    Values(&'a MappedRange, &'a RangeMap),
}

impl DrawnAxis<'_> {
    /// How the bins are shared among pixels: bin, pixel, and the bin's share in it.
    fn shares(&self, bins: &Bins, pixels: usize) -> Vec<(usize, usize, f64)> {
        let edge = |pixel: usize| pixel as f64 / pixels as f64;
        let cut = |pixel: usize| match self {
            Self::Bins(map) => map.inverse(edge(pixel)) * bins.count() as f64,
            Self::Values(range, map) => range.scalar_at(map.inverse(edge(pixel))),
        };
        let ends = |bin: usize| match self {
            Self::Bins(_) => Some([bin as f64, (bin + 1) as f64]),
            Self::Values(..) => bins.bounds(bin),
        };
        let cuts: Vec<f64> = if pixels == 0 { Vec::new() } else { (0..=pixels).map(cut).collect() };
        let cuts = &cuts[..];
        let of_bin = |bin: usize| {
            let found = ends(bin).into_iter().flat_map(move |ends| shares(ends, cuts));
            found.map(move |(pixel, share)| (bin, pixel, share))
        };
        (0..bins.count()).flat_map(of_bin).collect()
    }
}

/// A histogram in pixels: one row of columns, or an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Width and height in pixels; the height of columns is 1.
    pub size_px: [usize; 2],
    /// Number of values in each pixel, row by row, row 0 on top. They add up to the finite values of the histogram less `outside`.
    pub counts: Vec<f64>,
    /// Number of finite values that are not on the axes.
    pub outside: f64,
    /// Heights or shades 0..=1, growing with the logarithm of the counts ([`CountScale::Log`]); 1 for the fullest pixel, 0 for empty ones.
    /// Where bins are wider than pixels on average, counts are taken per bin: heights then do not depend on the number of pixels.
    pub heights: Vec<f32>,
}

impl Bars {
    fn new(size_px: [usize; 2], counts: Vec<f64>, finite: u64, pixels_per_bin: f64) -> Self {
        let outside = (finite as f64 - counts.iter().sum::<f64>()).max(0.0);
        let scaled: Vec<f64> = counts.iter().map(|count| count * pixels_per_bin).collect();
        Self { size_px, heights: CountScale::Log.heights_of_shares(&scaled), counts, outside }
    }
}

/// Number of pixels of an average bin, at least 1.
fn pixels_per_bin(pixels: usize, bins: usize) -> f64 {
    (pixels as f64 / bins as f64).max(1.0)
}

/// A histogram as columns, one a pixel.
pub fn columns(histogram: &Histogram1d, axis: DrawnAxis<'_>, width_px: usize) -> Bars {
    let bins = histogram.bins();
    let mut counts = vec![0.0; width_px];
    for (bin, pixel, share) in axis.shares(bins, width_px) {
        counts[pixel] += histogram.counts()[bin] as f64 * share;
    }
    Bars::new([width_px, 1], counts, histogram.finite(), pixels_per_bin(width_px, bins.count()))
}

/// A histogram of pairs as an image: first values to the right, second ones upward.
pub fn image(histogram: &Histogram2d, [x, y]: [DrawnAxis<'_>; 2], [width_px, height_px]: [usize; 2]) -> Bars {
    let (columns, rows) = (histogram.x().count(), histogram.y().count());
    let along_x = x.shares(histogram.x(), width_px);
    let mut wide = vec![0.0; width_px * rows];
    for (row, counts) in histogram.counts().chunks_exact(columns).enumerate() {
        for &(bin, pixel, share) in &along_x {
            wide[row * width_px + pixel] += counts[bin] as f64 * share;
        }
    }
    let mut counts = vec![0.0; width_px * height_px];
    for (bin, pixel, share) in y.shares(histogram.y(), height_px) {
        let to = (height_px - 1 - pixel) * width_px;
        let from = &wide[bin * width_px..][..width_px];
        counts[to..][..width_px].iter_mut().zip(from).for_each(|(to, from)| *to += from * share);
    }
    let pixels = pixels_per_bin(width_px, columns) * pixels_per_bin(height_px, rows);
    Bars::new([width_px, height_px], counts, histogram.finite(), pixels)
}

#[cfg(test)]
#[path = "bars_tests.rs"]
mod tests;

//! Difference metrics of two images.

use super::filter::Kernel;
use super::flip::mean_flip;
use super::{DepthImage, Plane, RgbaImage};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Differences between two images of equal size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageMetrics {
    /// Largest absolute difference of raw accumulators, over all pixels and four channels.
    pub max: f64,
    /// Root mean square difference, over the same samples.
    pub rmse: f64,
    /// Peak signal-to-noise ratio in dB, `-20 log10(rmse)` (the peak is 1); infinite for equal images (JSON: null).
    #[serde(deserialize_with = "null_is_infinite")]
    pub psnr: f64,
    /// Structural similarity of luminance over the background, 1 for equal images.
    pub ssim: f64,
    /// Mean LDR-FLIP over the background at the paper's 67.02 pixels per degree, 0 for equal images.
    pub flip: f64,
}

fn null_is_infinite<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

/// Why two images cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetricsError {
    /// The images have different sizes.
    #[error("the images have different sizes: {} x {} and {} x {} pixels", .0.0, .0.1, .1.0, .1.1)]
    DifferentSizes((usize, usize), (usize, usize)),
    /// There is nothing to compare.
    #[error("the images have no pixels")]
    NoPixels,
    /// A pixel is NaN or infinite.
    #[error("pixel ({column}, {row}) of the {which} image is not finite")]
    NotFinite {
        /// The image: "first" or "second".
        which: &'static str,
        /// Column from the left.
        column: usize,
        /// Row from the top.
        row: usize,
    },
}

/// Compares image `a` (the reference) with `b`: `max`, `rmse` and `psnr` on raw accumulators, `ssim` and `flip` over an
/// opaque `background`.
///
/// # Errors
/// If sizes differ, there are no pixels, or a pixel is not finite.
pub fn compare(a: &RgbaImage, b: &RgbaImage, background: [f32; 3]) -> Result<ImageMetrics, MetricsError> {
    let RawDifference { max, rmse } = compare_raw(a, b)?;
    let (a_over, b_over) = (a.over(background), b.over(background));
    Ok(ImageMetrics {
        max,
        rmse,
        psnr: -20.0 * rmse.log10(),
        ssim: mean_ssim(&luminance(&a_over, a), &luminance(&b_over, b)),
        flip: mean_flip(&a_over, &b_over, a.width, a.height),
    })
}

/// Differences of the raw accumulators of two images of equal size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawDifference {
    /// Largest absolute difference, over all pixels and four channels.
    pub max: f64,
    /// Root mean square difference, over the same samples.
    pub rmse: f64,
}

/// `max` and `rmse` of [`compare`], without the slower metrics.
///
/// # Errors
/// As [`compare`].
pub fn compare_raw(a: &RgbaImage, b: &RgbaImage) -> Result<RawDifference, MetricsError> {
    check_sizes(a, b)?;
    for (which, image) in [("first", a), ("second", b)] {
        if let Some((column, row)) = image.first_not_finite() {
            return Err(MetricsError::NotFinite { which, column, row });
        }
    }
    let channels = a.pixels.iter().flatten().zip(b.pixels.iter().flatten());
    let (mut max, mut squares) = (0.0_f64, 0.0);
    for difference in channels.map(|(&x, &y)| f64::from(x) - f64::from(y)) {
        max = max.max(difference.abs());
        squares += difference * difference;
    }
    Ok(RawDifference { max, rmse: (squares / (4 * a.pixels.len()) as f64).sqrt() })
}

/// Differences between two planes of distances or of normals of equal size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaneMetrics {
    /// Largest absolute difference where both planes have a value, world units, or largest angle, degrees; 0 if there is no such pixel.
    pub max: f64,
    /// Root mean square difference or angle, over the same pixels.
    pub rmse: f64,
    /// Number of these pixels.
    pub compared: u64,
    /// Number of pixels with a value in only one plane.
    pub unmatched: u64,
}

/// Compares distances; a non-finite value means none.
///
/// # Errors
/// If sizes differ, or there are no pixels.
pub fn compare_depth(a: &DepthImage, b: &DepthImage) -> Result<PlaneMetrics, MetricsError> {
    compare_where_both(a, b, |x| x.is_finite(), |x, y| (f64::from(x) - f64::from(y)).abs())
}

/// Compares normals of any length; a zero vector means no normal.
///
/// # Errors
/// If sizes differ, or there are no pixels.
pub fn compare_normals(a: &Plane<[f32; 3]>, b: &Plane<[f32; 3]>) -> Result<PlaneMetrics, MetricsError> {
    let angle = |x: [f32; 3], y: [f32; 3]| {
        let [x, y] = [x, y].map(|n| DVec3::from(n.map(f64::from)));
        // Precise at small angles, unlike the arc cosine.
        x.cross(y).length().atan2(x.dot(y)).to_degrees()
    };
    compare_where_both(a, b, |normal| normal != [0.0; 3], angle)
}

/// Compares the pixels that have a value in both planes by a difference of at least 0.
fn compare_where_both<P: Copy>(
    a: &Plane<P>,
    b: &Plane<P>,
    has_value: impl Fn(P) -> bool,
    difference: impl Fn(P, P) -> f64,
) -> Result<PlaneMetrics, MetricsError> {
    let mut metrics = PlaneMetrics { max: 0.0, rmse: 0.0, compared: 0, unmatched: 0 };
    let mut squares = 0.0;
    for (x, y) in pairs(a, b)? {
        match (has_value(x), has_value(y)) {
            (true, true) => {
                let difference = difference(x, y);
                metrics.max = metrics.max.max(difference);
                squares += difference * difference;
                metrics.compared += 1;
            }
            (false, false) => {}
            _ => metrics.unmatched += 1,
        }
    }
    metrics.rmse = (squares / metrics.compared.max(1) as f64).sqrt();
    Ok(metrics)
}

/// Differences between two planes of ids of equal size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IdMetrics {
    /// Pixels whose ids differ.
    pub different: u64,
    /// Pixels with an id in at least one plane.
    pub compared: u64,
}

/// Compares ids; 0 means none.
///
/// # Errors
/// If sizes differ, or there are no pixels.
pub fn compare_ids(a: &Plane<u32>, b: &Plane<u32>) -> Result<IdMetrics, MetricsError> {
    let mut metrics = IdMetrics { different: 0, compared: 0 };
    for (x, y) in pairs(a, b)? {
        metrics.different += u64::from(x != y);
        metrics.compared += u64::from(x != 0 || y != 0);
    }
    Ok(metrics)
}

/// Pairs of the pixels of two planes.
fn pairs<P: Copy>(a: &Plane<P>, b: &Plane<P>) -> Result<impl Iterator<Item = (P, P)>, MetricsError> {
    check_sizes(a, b)?;
    Ok(a.pixels.iter().copied().zip(b.pixels.iter().copied()))
}

/// Checks that two planes have equal sizes, and pixels.
pub(super) fn check_sizes<P>(a: &Plane<P>, b: &Plane<P>) -> Result<(), MetricsError> {
    if (a.width, a.height) != (b.width, b.height) {
        return Err(MetricsError::DifferentSizes((a.width, a.height), (b.width, b.height)));
    }
    if a.pixels.is_empty() { Err(MetricsError::NoPixels) } else { Ok(()) }
}

/// Luma of display-referred RGB (Rec. 601), as in the SSIM paper's programs.
fn luminance(pixels: &[[f32; 3]], image: &RgbaImage) -> Plane<f64> {
    let luma = |&[r, g, b]: &[f32; 3]| 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
    Plane { width: image.width, height: image.height, pixels: pixels.iter().map(luma).collect() }
}

/// Radius of SSIM's window.
const WINDOW_RADIUS: usize = 5;
/// Standard deviation of SSIM's window, pixels.
const WINDOW_DEVIATION: f64 = 1.5;

/// Mean structural similarity: Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image Quality Assessment: From Error
/// Visibility to Structural Similarity", IEEE TIP 13(4), 2004; 11 x 11 Gaussian window, K1 = 0.01, K2 = 0.03, peak 1, over
/// the pixels whose window lies inside the image. A side shorter than the window has a window that fits it.
fn mean_ssim(a: &Plane<f64>, b: &Plane<f64>) -> f64 {
    const C1: f64 = 0.01 * 0.01;
    const C2: f64 = 0.03 * 0.03;
    let radius = |size: usize| WINDOW_RADIUS.min((size - 1) / 2);
    let (radius_x, radius_y) = (radius(a.width), radius(a.height));
    let window =
        |radius| Kernel::sample(radius, |x| (-x * x / (2.0 * WINDOW_DEVIATION * WINDOW_DEVIATION)).exp()).normalised();
    let (window_x, window_y) = (window(radius_x), window(radius_y));
    let mean_of = |value: &dyn Fn(f64, f64) -> f64| {
        let pixels = a.pixels.iter().zip(&b.pixels).map(|(&x, &y)| value(x, y)).collect();
        Plane { width: a.width, height: a.height, pixels }.convolved(&window_x, &window_y).pixels
    };
    let (mean_a, mean_b) = (mean_of(&|x, _| x), mean_of(&|_, y| y));
    let (aa, bb, ab) = (mean_of(&|x, _| x * x), mean_of(&|_, y| y * y), mean_of(&|x, y| x * y));
    let (mut sum, mut count) = (0.0, 0_u64);
    for j in radius_y..a.height - radius_y {
        for i in (radius_x..a.width - radius_x).map(|i| j * a.width + i) {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let (variance_a, variance_b, covariance) = (aa[i] - ma * ma, bb[i] - mb * mb, ab[i] - ma * mb);
            let similarity = (2.0 * ma * mb + C1) * (2.0 * covariance + C2)
                / ((ma * ma + mb * mb + C1) * (variance_a + variance_b + C2));
            sum += similarity;
            count += 1;
        }
    }
    sum / count as f64
}

#[cfg(test)]
#[path = "metrics_tests.rs"]
mod tests;

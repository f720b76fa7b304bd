//! Upsampling of a small image to full size, by four filters.
//!
//! ```text
//! nearest    the nearest sample
//! bilinear   between the four samples around it
//! joint      bilinear, then a mean over nearby pixels with nearly the same reference value (joint.rs)
//! joint2x2   bilinear, without samples of another reference value (joint2x2.rs)
//! ```
//! A reference ([`Reference`]) has up to three numbers per pixel, such as depths of the domain's boundary. Only colours are interpolated:
//! depths, normals and ids take the nearest sample, since a mean with an infinite depth is meaningless.

mod bilinear;
mod joint;
mod joint2x2;
mod nearest;
#[cfg(test)]
mod tests;

use super::Plane;
pub use bilinear::{bilinear, enlarged};
pub use joint::{JointKernel, MAX_KERNEL_PX, joint};
#[cfg(all(test, feature = "gpu"))]
pub(crate) use joint2x2::joint2x2_above;
pub use joint2x2::{LEAST_SUM, joint2x2};
pub use nearest::nearest;

/// Reference values of pixels, compared by Euclidean distance; unused components are constant.
pub type Reference = Plane<[f32; 3]>;

/// Factor k of a Gaussian of width `sigma` > 0, as 2^(-k d^2) of a distance d. Capped at 1e30, where any difference has weight 0.
pub(crate) fn log2_per_square(sigma: f64) -> f32 {
    (std::f64::consts::LOG2_E / (2.0 * sigma.powi(2))).min(1e30) as f32
}

/// Positions of the samples of a small image in the full one: both have the same centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Enlarging {
    /// Width and height of the small image.
    pub small: (usize, usize),
    /// Width and height of the full image in pixels.
    pub full: (usize, usize),
    /// Distance of neighbouring samples in full pixels.
    pub per_sample: f64,
}

impl Enlarging {
    /// One sample for `factor` x `factor` pixels: the small image covers at least as many pixels as the full one in both directions.
    pub fn by(factor: usize, full: (usize, usize)) -> Self {
        let small = (full.0.div_ceil(factor), full.1.div_ceil(factor));
        Self { small, full, per_sample: factor as f64 }
    }

    /// Two images through one camera, with an equal height of the view.
    pub fn between(small: (usize, usize), full: (usize, usize)) -> Self {
        Self { small, full, per_sample: full.1 as f64 / small.1 as f64 }
    }

    /// Position of each pixel's centre, along a line of `full`, in a line of `small` samples, whose centres are the integers; clamped to
    /// the outermost samples.
    fn places(&self, small: usize, full: usize) -> impl Iterator<Item = f64> {
        let (per_sample, last) = (self.per_sample, small.saturating_sub(1) as f64);
        let middle = 0.5 * small as f64 - 0.5;
        (0..full).map(move |i| ((i as f64 + 0.5 - 0.5 * full as f64) / per_sample + middle).clamp(0.0, last))
    }

    /// For each column (or row) the two samples around it, and the weight of the second.
    fn between_samples(&self, small: usize, full: usize) -> Vec<(usize, usize, f32)> {
        let around = |at: f64| (at as usize, (at as usize + 1).min(small - 1), (at - at.floor()) as f32);
        self.places(small, full).map(around).collect()
    }

    /// Whether one of the images is empty.
    fn is_empty(&self) -> bool {
        [self.small.0, self.small.1, self.full.0, self.full.1].contains(&0)
    }
}

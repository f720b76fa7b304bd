//! A small image at full size, four ways.
//!
//! ```text
//! nearest    the sample that a pixel lies in
//! bilinear   between the four samples around it
//! joint      bilinear, then a mean over pixels nearby at which a reference has nearly the same value (joint.rs)
//! joint2x2   bilinear, but for samples at which a reference has another value (joint2x2.rs)
//! ```
//! A reference ([`Reference`]) has up to three numbers a pixel, such as depths of the domain's boundary. Only colours are mixed: of depths,
//! normals and numbers the one of the nearest sample is taken, since a mean with an infinite depth is none.

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

/// What is compared between pixels, by the distance of vectors; numbers that are not used are the same everywhere.
pub type Reference = Plane<[f32; 3]>;

/// The logarithm (base 2) of a Gaussian of width `sigma`, above 0, is minus this times the square of a distance. Beyond 1e30 all that
/// differs is out.
pub(crate) fn log2_per_square(sigma: f64) -> f32 {
    (std::f64::consts::LOG2_E / (2.0 * sigma.powi(2))).min(1e30) as f32
}

/// Where the samples of a small image lie in the full one: both have the same middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Enlarging {
    /// Width and height of the small image.
    pub small: (usize, usize),
    /// Width and height in pixels of the full one.
    pub full: (usize, usize),
    /// Full pixels from one sample to the next.
    pub per_sample: f64,
}

impl Enlarging {
    /// A sample for `factor` x `factor` pixels: the small image covers as many or more pixels than the full one in both directions.
    pub fn by(factor: usize, full: (usize, usize)) -> Self {
        let small = (full.0.div_ceil(factor), full.1.div_ceil(factor));
        Self { small, full, per_sample: factor as f64 }
    }

    /// Of two images through one camera, whose image height is the same.
    pub fn between(small: (usize, usize), full: (usize, usize)) -> Self {
        Self { small, full, per_sample: full.1 as f64 / small.1 as f64 }
    }

    /// Where the middle of each pixel of a line of `full` lies in one of `small` samples, whose middles are the integers; those beyond the
    /// outermost are at these.
    fn places(&self, small: usize, full: usize) -> impl Iterator<Item = f64> {
        let (per_sample, last) = (self.per_sample, small.saturating_sub(1) as f64);
        let middle = 0.5 * small as f64 - 0.5;
        (0..full).map(move |i| ((i as f64 + 0.5 - 0.5 * full as f64) / per_sample + middle).clamp(0.0, last))
    }

    /// For each column (or row) the two samples around it, and how far it is from the first towards the second.
    fn between_samples(&self, small: usize, full: usize) -> Vec<(usize, usize, f32)> {
        let around = |at: f64| (at as usize, (at as usize + 1).min(small - 1), (at - at.floor()) as f32);
        self.places(small, full).map(around).collect()
    }

    /// Whether there is nothing to enlarge, or no place for it.
    fn is_empty(&self) -> bool {
        [self.small.0, self.small.1, self.full.0, self.full.1].contains(&0)
    }
}

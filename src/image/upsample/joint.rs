//! The joint bilateral filter (dissertation, section 4.1.1, eq. 4.3 and 4.4).
//!
//! ```text
//! S_p = 1 / k_p  sum over q in Omega of  I_q f(|p - q|) g(|R_p - R_q|)      k_p: the sum of the weights f g
//! f(D) = exp(-D^2 / (2 (Omega / 2)^2))      g(D) = exp(-D^2 / (2 sigma^2))
//! ```
//! p, q are pixels of the full image, I the small image at full size (bilinear), R a reference at full size, and Omega the pixels within
//! Omega / 2 of p in each direction, cropped at the image's border. p itself has the weight 1, so k_p >= 1.
//!
//! What the print leaves open: eq. 4.2 and 4.3 swap I and R; here, as in the text on 4.3, I is small and R is of full size. Eq. 4.3 sums over
//! q_1, perhaps q of the small image; here q is of full size, as Omega is. f takes distances in the small image while Omega is in pixels of the
//! full one, literally a filter that is almost flat; here both are of the full one. The "RMS" of figure 4.4 has no definition.
//!
//! Sixteen pixels p are processed side by side, with q at the same offset from each. The planes are separate, with a margin in which the
//! colour and a coverage plane (1 within the image) are 0, so that no border tests are needed. f is a table by offset; g is a polynomial,
//! accurate to 2e-7, and not below 2^-126. Sums run over the rows of Omega, in the same order for any thread count.

use super::{Reference, log2_per_square};
use crate::image::RgbaImage;
use crate::task::Cancel;
use rayon::prelude::*;

/// Size of Omega and width of g.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointKernel {
    /// Omega, pixels; an even number is rounded up to the next odd one. At least 1.
    pub kernel_px: usize,
    /// sigma of g, in units of the reference. Above 0; infinite: the reference is ignored.
    pub sigma_reference: f64,
}

/// Maximum of Omega, pixels.
pub const MAX_KERNEL_PX: usize = 64;

impl JointKernel {
    /// Omega of 1 to [`MAX_KERNEL_PX`] pixels, and a finite sigma above 0; `None` of other numbers.
    pub fn new(kernel_px: usize, sigma_reference: f64) -> Option<Self> {
        let is_good = (1..=MAX_KERNEL_PX).contains(&kernel_px) && sigma_reference > 0.0 && sigma_reference.is_finite();
        is_good.then_some(Self { kernel_px, sigma_reference })
    }

    /// The kernel of section 4.1.3 for a sample per `factor` x `factor` pixels: 2 `factor` pixels, 8 for `factor` 1; sigma 0.01.
    pub fn of_factor(factor: usize) -> Self {
        let kernel_px = if factor <= 1 { 8 } else { factor.saturating_mul(2).min(MAX_KERNEL_PX) };
        Self { kernel_px, sigma_reference: 0.01 }
    }
}

/// Number of pixels processed side by side.
const SIDE_BY_SIDE: usize = 16;
type Lanes = [f32; SIDE_BY_SIDE];

/// Number of planes: four of colour, one of coverage, three of the reference.
const PLANES: usize = 8;

/// Filters the image to the size of its reference; `None` if `cancel` is raised.
pub fn joint(image: &RgbaImage, reference: &Reference, kernel: JointKernel, cancel: &Cancel) -> Option<RgbaImage> {
    let mut out = RgbaImage::new(image.width, image.height);
    if image.pixels.is_empty() {
        return Some(out);
    }
    let padded = Padded::of(image, reference, kernel.kernel_px / 2);
    let domain = domain_weights(kernel.kernel_px);
    let per_square = log2_per_square(kernel.sigma_reference);
    out.pixels.par_chunks_mut(image.width).enumerate().for_each(|(row, pixels)| {
        if !cancel.is_cancelled() {
            pulp::Arch::new().dispatch(FilterRow { padded: &padded, domain: &domain, per_square, row, pixels });
        }
    });
    (!cancel.is_cancelled()).then_some(out)
}

/// Weights f by distance in columns and rows, for a quarter of Omega: `half + 1` per row.
fn domain_weights(kernel_px: usize) -> Vec<f32> {
    let (half, sigma) = (kernel_px / 2, 0.5 * kernel_px as f64);
    let weight = |i: usize| {
        let (x, y) = ((i % (half + 1)) as f64, (i / (half + 1)) as f64);
        (-(x * x + y * y) / (2.0 * sigma * sigma)).exp() as f32
    };
    (0..(half + 1) * (half + 1)).map(weight).collect()
}

/// The planes of the filter with their margins.
struct Padded {
    half: usize,
    width: usize,
    planes: [Vec<f32>; PLANES],
}

impl Padded {
    fn of(image: &RgbaImage, reference: &Reference, half: usize) -> Self {
        let width = image.width.next_multiple_of(SIDE_BY_SIDE) + 2 * half;
        let size = width * (image.height + 2 * half);
        let plane = |plane: usize| {
            let mut samples = vec![0.0; size];
            let value = |at: usize| match plane {
                0..4 => image.pixels[at][plane],
                4 => 1.0,
                _ => reference.pixels[at][plane - 5],
            };
            let rows = samples.chunks_mut(width).skip(half).take(image.height).enumerate();
            for (row, samples) in rows {
                let inner = &mut samples[half..half + image.width];
                inner.iter_mut().enumerate().for_each(|(x, sample)| *sample = value(row * image.width + x));
            }
            samples
        };
        let mut planes = [const { Vec::new() }; PLANES];
        planes.par_iter_mut().enumerate().for_each(|(at, samples)| *samples = plane(at));
        Self { half, width, planes }
    }

    /// Loads adjacent pixels of a plane.
    #[inline(always)]
    fn lanes(&self, plane: usize, at: usize) -> &Lanes {
        self.planes[plane][at..].first_chunk().unwrap_or(&[0.0; SIDE_BY_SIDE])
    }
}

/// A row of the result.
struct FilterRow<'a> {
    padded: &'a Padded,
    domain: &'a [f32],
    per_square: f32,
    row: usize,
    pixels: &'a mut [[f32; 4]],
}

impl pulp::NullaryFnOnce for FilterRow<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { padded, domain, per_square, row, pixels } = self;
        for (part, pixels) in pixels.chunks_mut(SIDE_BY_SIDE).enumerate() {
            let sums = filtered(padded, domain, per_square, row, part * SIDE_BY_SIDE);
            for (l, pixel) in pixels.iter_mut().enumerate() {
                *pixel = std::array::from_fn(|c| sums[c][l] / sums[4][l]);
            }
        }
    }
}

/// Weighted sums of the colours, and of the weights, for adjacent pixels from `column` on.
#[inline(always)]
fn filtered(padded: &Padded, domain: &[f32], per_square: f32, row: usize, column: usize) -> [Lanes; 5] {
    let Padded { half, width, .. } = *padded;
    let here = (row + half) * width + column + half;
    let [r0, r1, r2] = [padded.lanes(5, here), padded.lanes(6, here), padded.lanes(7, here)];
    let mut sums = [[0.0; SIDE_BY_SIDE]; 5];
    for down in 0..=2 * half {
        let mut of_row = [[0.0; SIDE_BY_SIDE]; 5];
        let weights = &domain[down.abs_diff(half) * (half + 1)..][..half + 1];
        for along in 0..=2 * half {
            let (f, there) = (weights[along.abs_diff(half)], (row + down) * width + column + along);
            let [q0, q1, q2] = [padded.lanes(5, there), padded.lanes(6, there), padded.lanes(7, there)];
            let mut weight = [0.0; SIDE_BY_SIDE];
            for l in 0..SIDE_BY_SIDE {
                let (a, b, c) = (r0[l] - q0[l], r1[l] - q1[l], r2[l] - q2[l]);
                weight[l] = f * exp2_of_negative(-(a * a + b * b + c * c) * per_square);
            }
            for (plane, sum) in of_row.iter_mut().enumerate() {
                let values = padded.lanes(plane, there);
                for l in 0..SIDE_BY_SIDE {
                    sum[l] += weight[l] * values[l];
                }
            }
        }
        for (sum, of_row) in sums.iter_mut().zip(&of_row) {
            for l in 0..SIDE_BY_SIDE {
                sum[l] += of_row[l];
            }
        }
    }
    sums
}

/// 2^t of t <= 0, but not below 2^-126: 2^n (n the nearest integer) times the series of exp(ln 2 (t - n)) up to the sixth power, with a
/// remainder below 1.3e-7.
#[inline(always)]
pub(super) fn exp2_of_negative(t: f32) -> f32 {
    /// Numbers near this have a spacing of 1, with the integer in their last bits.
    const ROUNDING: f32 = 12_582_912.0;
    let t = if t > -126.0 { t } else { -126.0 };
    let rounded = t + ROUNDING;
    let x = (t - (rounded - ROUNDING)) * std::f32::consts::LN_2;
    let series =
        1.0 + x * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0))))));
    series * f32::from_bits((rounded.to_bits() << 23).wrapping_add(127 << 23))
}

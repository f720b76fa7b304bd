//! [`Lattice`]: a regular subset of an image's pixels for which rays are cast.

use std::num::NonZeroUsize;

/// The pixels whose column and row are multiples of a stride, or the last of the image. They form a plane of their own, in image order, of
/// ceil((columns - 1) / stride) + 1 columns, and as many rows by the same formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lattice {
    stride_px: NonZeroUsize,
}

impl Lattice {
    /// All pixels.
    pub const ALL: Self = Self { stride_px: NonZeroUsize::MIN };

    /// Every `stride_px`-th pixel in both directions, and the last ones. A stride beyond the image's size leaves its corners.
    pub const fn new(stride_px: NonZeroUsize) -> Self {
        Self { stride_px }
    }

    /// Distance between neighbouring pixels of the lattice.
    pub const fn stride_px(self) -> usize {
        self.stride_px.get()
    }

    /// Number of lattice pixels in a row (or column) of `pixels`.
    pub const fn count(self, pixels: usize) -> usize {
        pixels.saturating_sub(1).div_ceil(self.stride_px()) + 1
    }

    /// Column (or row), out of `pixels`, of the lattice pixel at index `at` in the plane.
    #[inline]
    pub const fn pixel(self, at: usize, pixels: usize) -> usize {
        let (pixel, last) = (at.saturating_mul(self.stride_px()), pixels - 1);
        if pixel < last { pixel } else { last }
    }

    /// Whether column (or row) `pixel`, out of `pixels`, is in the lattice.
    #[inline]
    pub const fn has(self, pixel: usize, pixels: usize) -> bool {
        pixel.is_multiple_of(self.stride_px()) || pixel + 1 == pixels
    }

    /// Index in the plane of the first lattice pixel, out of `pixels`, at or after `pixel`; [`Self::count`] if there is none.
    #[inline]
    pub const fn first_from(self, pixel: usize, pixels: usize) -> usize {
        let (count, next) = (self.count(pixels), pixel.div_ceil(self.stride_px()));
        if pixel >= pixels {
            count
        } else if next < count {
            next
        } else {
            count - 1
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lattice(stride: usize) -> Lattice {
        Lattice::new(NonZeroUsize::new(stride).unwrap())
    }

    proptest! {
        #[test]
        fn it_has_the_multiples_of_its_stride_and_the_last_pixel(stride in 1..40usize, pixels in 1..100usize) {
            let expected: Vec<usize> = (0..pixels).filter(|&p| p.is_multiple_of(stride) || p == pixels - 1).collect();
            let lattice = lattice(stride);
            let found: Vec<usize> = (0..lattice.count(pixels)).map(|at| lattice.pixel(at, pixels)).collect();
            prop_assert_eq!(&found, &expected);
            for pixel in 0..pixels + 3 {
                let first = expected.iter().position(|&p| p >= pixel).unwrap_or(expected.len());
                prop_assert_eq!(pixel < pixels && lattice.has(pixel, pixels), expected.contains(&pixel));
                prop_assert_eq!(lattice.first_from(pixel, pixels), first);
            }
        }
    }

    #[test]
    fn a_stride_beyond_the_image_leaves_its_corners_and_one_of_one_all_pixels() {
        assert_eq!([lattice(1000).count(17), lattice(16).count(17), lattice(15).count(17)], [2, 2, 3]);
        assert_eq!((Lattice::ALL.count(17), Lattice::ALL.pixel(16, 17), lattice(3).count(1)), (17, 16, 1));
    }
}

//! [`Samples`]: the pixels of an image for which rays are cast, and their indices in the rendered plane.

use super::Lattice;
use std::ops::Range;
use std::sync::Arc;

/// The pixels of an image for which rays are cast. The rendered plane has one pixel for each of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Samples {
    /// Pixels at a stride in both directions; the plane has their order in the image.
    Lattice(Lattice),
    /// A list of pixels; the plane is one row, in the order of the list.
    Pixels(Arc<PixelSet>),
}

impl Samples {
    /// All pixels.
    pub const ALL: Self = Self::Lattice(Lattice::ALL);
}

/// Distinct pixels of an image, in a given order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PixelSet {
    size_px: (usize, usize),
    /// Row times the width of the image plus column, in the given order.
    pixels: Vec<u32>,
    /// The same pixels in ascending order, each with its index in the list.
    sorted: Vec<(u32, u32)>,
}

/// Why a list of pixels is invalid for an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PixelSetError {
    /// The list is empty.
    #[error("a list of no pixels; name one at least")]
    Empty,
    /// A pixel lies outside of the image.
    #[error("pixel {pixel} at place {place} of the list lies beyond an image of {width} x {height} pixels")]
    Beyond {
        /// Row times the width of the image plus column.
        pixel: u32,
        /// Zero-based index in the list.
        place: usize,
        /// Pixels per row of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
    },
    /// A pixel is listed twice.
    #[error("pixel {pixel} is at places {first} and {second} of the list; name it once")]
    Twice {
        /// Row times the width of the image plus column.
        pixel: u32,
        /// Zero-based index in the list.
        first: usize,
        /// Index of the second occurrence.
        second: usize,
    },
}

impl PixelSet {
    /// A list for an image of `size_px` columns and rows. Pixels are `row * columns + column`, from the top left.
    ///
    /// # Errors
    /// If the list is empty, or a pixel lies outside of the image or is listed twice.
    pub fn new(size_px: (usize, usize), pixels: &[u32]) -> Result<Self, PixelSetError> {
        let (width, height) = size_px;
        if pixels.is_empty() {
            return Err(PixelSetError::Empty);
        }
        let beyond = pixels.iter().position(|&pixel| pixel as usize >= width.saturating_mul(height));
        if let Some(place) = beyond {
            return Err(PixelSetError::Beyond { pixel: pixels[place], place, width, height });
        }
        let mut sorted: Vec<(u32, u32)> = pixels.iter().copied().zip(0..).collect();
        sorted.sort_unstable();
        if let Some(&[(pixel, first), (_, second)]) = sorted.array_windows().find(|[a, b]| a.0 == b.0) {
            return Err(PixelSetError::Twice { pixel, first: first as usize, second: second as usize });
        }
        Ok(Self { size_px, pixels: pixels.to_vec(), sorted })
    }

    /// The size of the image: columns and rows.
    pub fn size_px(&self) -> (usize, usize) {
        self.size_px
    }

    /// Number of pixels, at least one.
    #[expect(clippy::len_without_is_empty, reason = "a list has a pixel at least")]
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// The list in ascending order with the index of each of its pixels here; `None` if this ascends.
    pub(crate) fn ascending(&self) -> Option<(Self, Vec<u32>)> {
        if self.pixels.is_sorted() {
            return None;
        }
        let (pixels, places): (Vec<u32>, Vec<u32>) = self.sorted.iter().copied().unzip();
        let sorted = pixels.iter().copied().zip(0..).collect();
        Some((Self { size_px: self.size_px, pixels, sorted }, places))
    }

    /// Column and row of the pixel at an index of the list.
    pub fn pixel(&self, place: usize) -> (usize, usize) {
        let pixel = self.pixels[place] as usize;
        (pixel % self.size_px.0, pixel / self.size_px.0)
    }

    /// The listed pixels in a range of columns of a row, from left to right: their columns and their indices in the list.
    pub fn in_row(&self, row: usize, columns: Range<usize>) -> impl Iterator<Item = (usize, usize)> {
        let first = row * self.size_px.0;
        let at = |column: usize| self.sorted.partition_point(|&(pixel, _)| (pixel as usize) < first + column);
        let found = &self.sorted[at(columns.start)..at(columns.end.max(columns.start))];
        found.iter().map(move |&(pixel, place)| (pixel as usize - first, place as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_row_has_its_pixels_from_left_to_right_at_their_places(
            seeds in prop::collection::hash_set(0..77u32, 1..40), row in 0..7usize, a in 0..12usize, b in 0..12usize,
        ) {
            let pixels: Vec<u32> = seeds.into_iter().collect();
            let list = PixelSet::new((11, 7), &pixels).unwrap();
            let mut expected: Vec<(usize, usize)> = (0..list.len())
                .filter(|&place| list.pixel(place).1 == row && (a..b).contains(&list.pixel(place).0))
                .map(|place| (list.pixel(place).0, place))
                .collect();
            expected.sort_unstable();
            prop_assert_eq!(list.in_row(row, a..b.min(11)).collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn what_is_no_list_is_refused_by_pixel_and_place() {
        let refused = |pixels: &[u32]| PixelSet::new((4, 3), pixels).unwrap_err().to_string();
        assert_eq!(refused(&[]), "a list of no pixels; name one at least");
        assert_eq!(refused(&[11, 12]), "pixel 12 at place 1 of the list lies beyond an image of 4 x 3 pixels");
        assert_eq!(refused(&[7, 2, 7, 7]), "pixel 7 is at places 0 and 2 of the list; name it once");
        assert_eq!(PixelSet::new((4, 3), &[11, 0]).unwrap().pixel(0), (3, 2));
    }
}

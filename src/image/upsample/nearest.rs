//! The nearest sample.

use super::{Enlarging, Plane};
use rayon::prelude::*;

/// Each pixel with the value of the nearest sample; the right or the lower one of two.
pub fn nearest<P: Copy + Send + Sync>(plane: &Plane<P>, enlarging: &Enlarging) -> Plane<P> {
    let (width, height) = enlarging.full;
    if enlarging.is_empty() || plane.pixels.is_empty() {
        return Plane { width: 0, height: 0, pixels: Vec::new() };
    }
    let places = |small, full| enlarging.places(small, full).map(|at| (at + 0.5) as usize).collect::<Vec<_>>();
    let (columns, rows) = (places(plane.width, width), places(plane.height, height));
    let row = |&row: &usize| columns.iter().map(move |column| plane.pixels[row * plane.width + column]);
    Plane { width, height, pixels: rows.par_iter().flat_map_iter(row).collect() }
}

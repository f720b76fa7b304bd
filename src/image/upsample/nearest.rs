//! Nearest-neighbour upsampling.

use super::{Enlarging, Plane};
use rayon::prelude::*;

/// Each pixel with the value of the nearest sample; the right or lower one of two equally near.
pub fn nearest<P: Copy + Send + Sync>(plane: &Plane<P>, enlarging: &Enlarging) -> Plane<P> {
    let (width, height) = enlarging.full;
    let Some(&any) = plane.pixels.first().filter(|_| !enlarging.is_empty()) else {
        return Plane { width: 0, height: 0, pixels: Vec::new() };
    };
    let places = |small, full| enlarging.places(small, full).map(|at| (at + 0.5) as usize).collect::<Vec<_>>();
    let (columns, rows) = (places(plane.width, width), places(plane.height, height));
    let mut pixels = vec![any; width * height];
    pixels.par_chunks_mut(width).zip(&rows).for_each(|(pixels, row)| {
        let samples = &plane.pixels[row * plane.width..][..plane.width];
        pixels.iter_mut().zip(&columns).for_each(|(pixel, &column)| *pixel = samples[column]);
    });
    Plane { width, height, pixels }
}

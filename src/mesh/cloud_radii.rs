//! Radii of points that have none.

use super::cloud::box_of;
use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// The neighbour to which half the distance is the radius of a point without one.
const NEIGHBOUR: usize = 4;

/// Half the distance from each point that is a cell to its fourth nearest other one, or to the farthest of fewer; 0 for one alone.
///
/// Of points at one place the tree has only as many as an answer can have: else each would be compared with all of them.
pub(super) fn estimated_radii(points: &[DVec3], cells: &[u32]) -> Vec<f64> {
    /// With the point itself.
    const NEAREST: NonZero<usize> = NonZero::new(NEIGHBOUR + 1).unwrap();
    let (lo, hi) = box_of(cells.iter().map(|&vertex| (points[vertex as usize], 0.0)));
    // Squares of coordinates in any unit must be finite, and those of small ones not zero.
    let (middle, size) = (0.5 * lo + 0.5 * hi, (0.5 * hi - 0.5 * lo).max_element());
    let scale = if size > 0.0 { size } else { 1.0 };
    let place = |cell: u32| ((points[cells[cell as usize] as usize] - middle) / scale).to_array();
    // Adding zero turns -0 into +0.
    let bits = |cell: u32| place(cell).map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..cells.len() as u32).collect();
    order.par_sort_unstable_by_key(|&cell| (bits(cell), cell));
    let (mut places, mut asked) = (Vec::new(), Vec::new());
    for at_place in order.chunk_by(|&a, &b| bits(a) == bits(b)) {
        let few = &at_place[..at_place.len().min(NEAREST.get())];
        places.extend(few.iter().map(|&cell| place(cell)));
        if at_place.len() < NEAREST.get() {
            asked.extend_from_slice(at_place);
        }
    }
    let mut radii = vec![0.0; cells.len()];
    let Ok(tree) = ImmutableKdTree::<f64, 3>::new_from_slice(&places) else { return radii };
    let radius = |&cell: &u32| {
        let nearest = tree.query(&place(cell)).nearest_n::<SquaredEuclidean<f64>>(NEAREST).execute();
        nearest.iter().map(|found| found.distance).fold(0.0, f64::max).sqrt() * 0.5 * scale
    };
    let found: Vec<f64> = asked.par_iter().map(radius).collect();
    asked.iter().zip(found).for_each(|(&cell, radius)| radii[cell as usize] = radius);
    radii
}

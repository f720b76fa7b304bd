//! The fragments of splats, row by row of the image.

use super::super::layers::LayerFragment;
use super::super::{LayerFragments, RenderError};
use super::IconSums;
use super::splat::{END, Splat};
use crate::camera::View;
use rayon::prelude::*;
use std::ops::Range;

/// Most fragments of a frame: 2 GiB in all.
pub(in crate::render) const MOST: u64 = 1 << 26;

/// The fragments of splats in their order. `per_unit` is the world length of a local unit.
///
/// # Errors
/// If there would be more than [`MOST`].
pub(super) fn fragments(
    splats: &[Splat],
    (sums, opacity): (&IconSums, f64),
    view: &View,
    per_unit: f64,
) -> Result<LayerFragments, RenderError> {
    // Before anything is listed: a row of a splat without pixels counts as one, since it is listed, too.
    let most: u64 = splats.par_iter().map(|splat| splat.most_pixels(view)).sum();
    if most > MOST {
        return Err(RenderError::TooMuchFlow { fragments: most, most: MOST });
    }
    let by_row = splats_by_row(splats, view.height_px);
    let of_row = |row: usize| {
        let mut found = Vec::new();
        for splat in by_row.of(row).iter().map(|&splat| &splats[splat as usize]) {
            splat.row(row, (sums, opacity), view, per_unit, &mut found);
        }
        found
    };
    let rows: Vec<Vec<(u32, LayerFragment)>> = (0..view.height_px).into_par_iter().map(of_row).collect();
    let (width, height) = view.plane_px();
    Ok(LayerFragments::of_ordered(width * height, &rows))
}

/// For each row of an image its splats, in order.
struct SplatsByRow {
    /// Where those of each row begin, and the end.
    begins: Vec<usize>,
    splats: Vec<u32>,
}

impl SplatsByRow {
    fn of(&self, row: usize) -> &[u32] {
        &self.splats[self.begins[row]..self.begins[row + 1]]
    }
}

fn splats_by_row(splats: &[Splat], height: usize) -> SplatsByRow {
    let mut begins = vec![0usize; height + 1];
    for splat in splats {
        splat.rows(height).for_each(|row| begins[row + 1] += 1);
    }
    for row in 0..height {
        begins[row + 1] += begins[row];
    }
    let (mut next, mut ids) = (begins.clone(), vec![0; begins[height]]);
    for (id, splat) in splats.iter().enumerate() {
        for row in splat.rows(height) {
            ids[next[row]] = id as u32;
            next[row] += 1;
        }
    }
    SplatsByRow { begins, splats: ids }
}

impl Splat {
    /// At least as many as its pixels, and its rows.
    pub(super) fn most_pixels(&self, view: &View) -> u64 {
        self.rows(view.height_px).map(|row| self.columns(row, view.width_px).len().max(1) as u64).sum()
    }

    /// The rows with pixels of it.
    pub(super) fn rows(&self, height: usize) -> Range<usize> {
        pixels(self.center.y, self.half_height, height)
    }

    /// The columns with pixels of it in a row.
    fn columns(&self, row: usize, width: usize) -> Range<usize> {
        let [xx, xy, _] = self.form;
        let dy = row as f64 + 0.5 - self.center.y;
        // The least squared distance in a row, without a difference that a needle would lose.
        let (middle, least) = (-xy / xx * dy, (END * dy / self.half_height).powi(2));
        let half = ((END * END - least).max(0.0) / xx).sqrt();
        pixels(self.center.x + middle, half, width)
    }

    /// Appends the fragments of a row: indices in the rendered plane, from left to right.
    fn row(
        &self,
        row: usize,
        (sums, opacity): (&IconSums, f64),
        view: &View,
        per_unit: f64,
        found: &mut Vec<(u32, LayerFragment)>,
    ) {
        let ([xx, xy, yy], depth) = (self.form, self.depth * per_unit);
        let dy = row as f64 + 0.5 - self.center.y;
        for (column, place) in view.rendered_in(row, self.columns(row, view.width_px)) {
            let dx = column as f64 + 0.5 - self.center.x;
            let squared = xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy;
            let alpha = opacity * self.opacity([dx, dy], squared, sums);
            let [r, g, b] = self.color.map(|c| (c * alpha) as f32);
            if alpha as f32 > 0.0 {
                found.push((place as u32, LayerFragment { depth, rgba: [r, g, b, alpha as f32] }));
            }
        }
    }
}

/// Pixels whose middle is within half an extent of a place, one more on either side for rounding: the window is zero there.
fn pixels(middle: f64, half: f64, count: usize) -> Range<usize> {
    // Casts saturate.
    let (first, end) = ((middle - half - 1.0).max(0.0) as usize, (middle + half + 1.0).max(0.0) as usize);
    first.min(count)..end.min(count)
}

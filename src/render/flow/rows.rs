//! The fragments of splats, row by row of the image.

use super::super::cpu::layers::Inside;
use super::super::layers::{LayerFragment, RowFragments};
use super::super::{LayerFragments, RenderError};
use super::IconSums;
use super::splat::{END, Splat, window};
use crate::camera::View;
use pulp::Arch;
use rayon::prelude::*;
use std::ops::Range;

/// Most fragments of a frame: 2 GiB in all.
pub(in crate::render) const MOST: u64 = 1 << 26;

/// The fragments of splats in their order, with all icons of the scene, as far as they are inside, and how many are not. `per_unit` is the world
/// length of a local unit.
///
/// # Errors
/// If there would be more than [`MOST`].
pub(super) fn fragments(
    splats: &[Splat],
    (icons, opacity): (&[&IconSums], f64),
    (view, inside): (&View, Option<&Inside>),
    per_unit: f64,
) -> Result<(LayerFragments, u64), RenderError> {
    // Before anything is listed: a row of a splat without pixels counts as one, since it is listed, too.
    let most: u64 = splats.par_iter().map(|splat| splat.most_pixels(view)).sum();
    if most > MOST {
        return Err(RenderError::TooMuchFlow { fragments: most, most: MOST });
    }
    let by_row = splats_by_row(splats, view.height_px);
    let arch = Arch::new();
    let of_row = |row: usize| {
        let mut found = Row::default();
        // Compiled for each processor: without its instructions that round down, each look-up calls a function several times.
        arch.dispatch(
            #[inline(always)]
            || {
                for &splat in by_row.of(row) {
                    splats[splat as usize].row(splat, row, (icons, opacity), view, &mut found);
                }
            },
        );
        let mut fragments = in_pixels(&found, splats, (row, view), per_unit);
        let outside = inside.map_or(0, |inside| {
            // The pixels of a row follow each other in the plane; a local unit is a power of two.
            let first = view.rendered_in(row, 0..view.width_px).next().map_or(0, |(_, place)| place);
            fragments.retain(|pixel, depth| inside.has(first + pixel, depth / per_unit))
        });
        (fragments, outside)
    };
    let (rows, outside): (Vec<RowFragments>, Vec<u64>) = (0..view.height_px).into_par_iter().map(of_row).unzip();
    Ok((LayerFragments::of_rows(rows), outside.into_iter().sum()))
}

/// What a splat has on a pixel.
struct Found {
    /// Index in the rendered plane.
    place: u32,
    splat: u32,
    /// Opacity of its icon.
    alpha: f64,
}

/// What splats have in a row.
#[derive(Default)]
struct Row {
    found: Vec<Found>,
    /// The windows there, if splats have kernels.
    windows: Vec<f64>,
}

/// What was found in a row, by pixels, each in the order of the splats.
fn in_pixels(
    Row { found, windows }: &Row,
    splats: &[Splat],
    (row, view): (usize, &View),
    per_unit: f64,
) -> RowFragments {
    let mut places = view.rendered_in(row, 0..view.width_px).map(|(_, place)| place as u32);
    // The pixels of a row follow each other in the plane.
    let Some(first) = places.next() else { return RowFragments::default() };
    let mut ends = vec![0u32; 1 + places.count()];
    for of in found {
        ends[(of.place - first) as usize] += 1;
    }
    let mut count = 0;
    ends.iter_mut().for_each(|end| {
        count += *end;
        *end = count - *end;
    });
    let mut fragments = vec![LayerFragment { depth: 0.0, rgba: [0.0; 4] }; found.len()];
    for (i, &Found { place, splat, alpha }) in found.iter().enumerate() {
        let Splat { depth, color, kernel, .. } = &splats[splat as usize];
        let rgba = match kernel {
            None => [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha],
            Some(kernel) => kernel.light(windows[i], alpha, *color),
        };
        let next = &mut ends[(place - first) as usize];
        fragments[*next as usize] = LayerFragment { depth: depth * per_unit, rgba: rgba.map(|c| c as f32) };
        *next += 1;
    }
    RowFragments { ends, fragments }
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

    /// Appends what the splat, number `id`, has in a row, from left to right.
    #[inline(always)]
    fn row(&self, id: u32, row: usize, (icons, opacity): (&[&IconSums], f64), view: &View, to: &mut Row) {
        let [xx, xy, yy] = self.form;
        let dy = row as f64 + 0.5 - self.center.y;
        let icons = self.icons_of(icons);
        let opacity = if self.flows { opacity } else { 0.0 };
        for (column, place) in view.rendered_in(row, self.columns(row, view.width_px)) {
            let dx = column as f64 + 0.5 - self.center.x;
            let squared = xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy;
            let alpha = opacity * self.mixed([dx, dy], squared, icons);
            if self.kernel.is_some() {
                let window = window(squared);
                if window > 0.0 {
                    to.windows.push(window);
                    to.found.push(Found { place: place as u32, splat: id, alpha });
                }
            } else if alpha as f32 > 0.0 {
                to.found.push(Found { place: place as u32, splat: id, alpha });
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

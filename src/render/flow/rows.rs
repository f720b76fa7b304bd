//! The fragments of splats, row by row of the image.

use super::super::cpu::layers::Inside;
use super::super::layers::{LayerFragment, ListedFragments};
use super::super::{LayerFragments, RenderError};
use super::IconSums;
use super::lanes::LANES;
use super::splat::Splat;
use crate::camera::View;
use pulp::{Arch, NullaryFnOnce};
use rayon::prelude::*;
use std::ops::Range;

/// Most fragments of a frame: 2 GiB in all.
pub(in crate::render) const MOST: u64 = 1 << 26;

/// The fragments of splats in their order, with all icons of the scene, as far as they are inside, and how many are not. `per_unit` is the world
/// length of a local unit. The memory of `spare` lists is used again: new memory takes the system as long as drawing.
///
/// # Errors
/// If there would be more than [`MOST`].
pub(super) fn fragments(
    splats: &[Splat],
    (icons, opacity): (&[&IconSums], f64),
    (view, inside): (&View, Option<&Inside>),
    per_unit: f64,
    mut spare: Vec<Vec<LayerFragment>>,
) -> Result<(LayerFragments, u64), RenderError> {
    // Before anything is listed: a row of a splat without pixels counts as one, since it is listed, too.
    let most: u64 = splats.par_iter().map(|splat| splat.most_pixels(view)).sum();
    if most > MOST {
        return Err(RenderError::TooMuchFlow { fragments: most, most: MOST });
    }
    let by_row = splats_by_row(splats, view.height_px);
    let arch = Arch::new();
    spare.resize_with(view.height_px, Vec::new);
    let of_row = |(row, fragments): (usize, Vec<LayerFragment>)| {
        let splats = Row::of(splats, by_row.of(row), (row, view));
        // Compiled for each processor, with its vectors.
        let mut drawn = arch.dispatch(Draw { row: splats, icons, opacity, per_unit, fragments });
        let outside = inside.map_or(0, |inside| {
            // The pixels of a row follow each other in the plane; a local unit is a power of two.
            let first = view.rendered_in(row, 0..view.width_px).next().map_or(0, |(_, place)| place);
            drawn.keep_within(|pixel| inside.of_ray(first + pixel), per_unit)
        });
        (drawn, outside)
    };
    let (rows, outside): (Vec<ListedFragments>, Vec<u64>) = spare.into_par_iter().enumerate().map(of_row).unzip();
    Ok((LayerFragments::of_lists(rows, true), outside.into_iter().sum()))
}

/// A row of pixels, and the splats on it.
struct Row<'a> {
    /// Its number in the image.
    row: usize,
    /// The columns that are rendered, then some more, so that [`LANES`] of them begin at each.
    columns: Vec<u32>,
    /// The splats in their order, each with the indices of its columns.
    splats: Vec<(&'a Splat, Range<u32>)>,
}

impl<'a> Row<'a> {
    fn of(splats: &'a [Splat], of_row: &[u32], (row, view): (usize, &View)) -> Self {
        let mut columns: Vec<u32> = view.rendered_in(row, 0..view.width_px).map(|(column, _)| column as u32).collect();
        let is_whole = columns.len() == view.width_px;
        let index = |column: usize| {
            if is_whole { column } else { columns.partition_point(|of| (*of as usize) < column) }
        };
        let on_row = |splat: &'a Splat| {
            let Range { start, end } = splat.columns(row, view.width_px);
            (splat, index(start) as u32..index(end) as u32)
        };
        let splats = of_row.iter().map(|&splat| on_row(&splats[splat as usize])).filter(|(_, of)| !of.is_empty());
        let splats = splats.collect();
        columns.extend([0; LANES]);
        Self { row, columns, splats }
    }

    /// For each pixel, as many places as splats may be on it.
    fn places(&self) -> Vec<[u32; 2]> {
        let mut more = vec![0i32; self.columns.len() + 1];
        for (_, columns) in &self.splats {
            more[columns.start as usize] += 1;
            more[columns.end as usize] -= 1;
        }
        let (mut begin, mut splats) = (0, 0);
        let pixels = more[..self.columns.len() - LANES].iter();
        pixels
            .map(|more| {
                splats += more;
                begin += splats as u32;
                [begin - splats as u32; 2]
            })
            .collect()
    }
}

/// What is drawn into a row.
struct Draw<'a> {
    row: Row<'a>,
    icons: &'a [&'a IconSums],
    opacity: f64,
    per_unit: f64,
    /// Memory for what is drawn.
    fragments: Vec<LayerFragment>,
}

impl NullaryFnOnce for Draw<'_> {
    type Output = ListedFragments;

    #[inline(always)]
    fn call(self) -> ListedFragments {
        let Self { row, icons, opacity, per_unit, mut fragments } = self;
        let mut spans = row.places();
        let all = row.splats.iter().map(|(_, columns)| columns.len()).sum();
        // What was there before lies in no pixel's part.
        fragments.resize(all, LayerFragment { depth: 0.0, rgba: [0.0; 4] });
        for (splat, columns) in &row.splats {
            let line = splat.line(row.row as f64 + 0.5 - splat.center.y);
            let (icons, opacity) = (splat.icons_of(icons), if splat.flows { opacity as f32 } else { 0.0 });
            let depth = splat.depth * per_unit;
            for at in columns.clone().step_by(LANES) {
                let Some(eight) = row.columns[at as usize..].first_chunk::<LANES>() else { break };
                let mut dx = [0.0; LANES];
                for l in 0..LANES {
                    dx[l] = f64::from(eight[l]) + 0.5 - splat.center.x;
                }
                let seen = splat.seen(&dx, &line, icons);
                let spans = &mut spans[at as usize..columns.end as usize];
                for (l, [_, end]) in spans.iter_mut().enumerate().take(LANES) {
                    if let Some(rgba) = splat.light(seen.window[l], opacity * seen.pattern[l]) {
                        fragments[*end as usize] = LayerFragment { depth, rgba };
                        *end += 1;
                    }
                }
            }
        }
        ListedFragments { spans, fragments }
    }
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
        pixels(self.center.y - self.half_height, self.center.y + self.half_height, height)
    }

    /// The columns with pixels of it in a row.
    pub(super) fn columns(&self, row: usize, width: usize) -> Range<usize> {
        let [from, to] = self.ends(&self.line(row as f64 + 0.5 - self.center.y));
        pixels(self.center.x + from, self.center.x + to, width)
    }

    /// Premultiplied colour, and opacity, where the window and the icon have these values; `None` where nothing is seen.
    #[inline(always)]
    fn light(&self, window: f32, alpha: f32) -> Option<[f32; 4]> {
        match &self.kernel {
            None if alpha > 0.0 => {
                let [r, g, b] = self.color;
                Some([r as f32 * alpha, g as f32 * alpha, b as f32 * alpha, alpha])
            }
            None => None,
            Some(kernel) => {
                (window > 0.0).then(|| kernel.light(f64::from(window), f64::from(alpha), self.color).map(|c| c as f32))
            }
        }
    }
}

/// Pixels whose middle is within an extent, or so little beside it that rounding may decide.
fn pixels(from: f64, to: f64, count: usize) -> Range<usize> {
    const BESIDE: f64 = 1.0 / 64.0;
    // Casts saturate.
    let (first, end) = ((from - 0.5 - BESIDE).ceil().max(0.0) as usize, (to + 0.5 + BESIDE).floor().max(0.0) as usize);
    first.min(count)..end.min(count).max(first.min(count))
}

//! The splats of a view by tiles of the rendered plane, as texels that shaders read (`shaders/lib/flow_splats.wgsl`).
//!
//! A splat is in the list of each tile that it reaches, in the order of depths. What is linear over the image is listed with it, as the tile has
//! it in its middle: it is counted in f64 from the splat's centre, wherever that is, and in f32 over the few pixels from there.

use super::splat::{END, Splat};
use super::{FlowFidelity, FlowSplats};
use crate::camera::{Lattice, Samples};
use crate::render::gpu::layout::{FAR, TILE_PX, integer_digits, two_parts};
use glam::DVec2;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Four numbers.
pub(in crate::render) type Texel = [f32; 4];

/// Texels of the head, of a splat, and of its place in the list of a tile.
const HEAD: usize = 1;
const SPLAT_TEXELS: usize = 5;
const PLACE_TEXELS: usize = 2;

/// Levels of an icon that its number is counted by.
const LEVELS: u32 = 8;

/// Most splats: f32 has their numbers.
const MOST_SPLATS: usize = 1 << 24;

/// Most places in tiles, or in rows of them: 1 GiB.
const MOST_PLACES: usize = 1 << 25;

/// The splats of a row of tiles.
#[derive(Debug, Default)]
pub(super) struct Strip {
    /// The splats in their order, each with the tiles that it reaches.
    reached: Vec<(u32, Range<u32>)>,
    /// For each tile, the number of its splats.
    counts: Vec<u32>,
}

/// The plane that is rendered, and its tiles.
struct Grid {
    lattice: Lattice,
    image: [usize; 2],
    plane: [usize; 2],
}

impl Grid {
    /// Tiles in a row, and rows of them.
    fn tiles(&self) -> [usize; 2] {
        self.plane.map(|px| px.div_ceil(TILE_PX))
    }

    /// Of the plane's columns, or rows, those whose pixels are in a range.
    fn places(&self, pixels: Range<usize>, axis: usize) -> Range<usize> {
        let of = self.image[axis];
        self.lattice.first_from(pixels.start, of)..self.lattice.first_from(pixels.end, of)
    }

    /// The middle of a pixel in the middle of a tile, which may lie beyond the image.
    fn middle(&self, tile: [usize; 2]) -> DVec2 {
        // As `Params` has it.
        let stride = self.lattice.stride_px().min(self.image[0].max(self.image[1]));
        let [x, y] = tile.map(|at| ((at * TILE_PX + TILE_PX / 2) * stride) as f64 + 0.5);
        DVec2::new(x, y)
    }

    /// The tiles of a row of them that each of these splats reaches.
    fn strip(&self, row: usize, splats: &[Splat], on_row: &[u32]) -> Strip {
        let [image, rows] = [self.image[0], self.plane[1]];
        let rows = row * TILE_PX..rows.min((row + 1) * TILE_PX);
        let mut strip = Strip { counts: vec![0; self.tiles()[0]], ..Strip::default() };
        for &number in on_row {
            let splat = &splats[number as usize];
            let of_splat = self.places(splat.rows(self.image[1]), 1);
            let [mut first, mut end] = [usize::MAX, 0];
            for place in of_splat.start.max(rows.start)..of_splat.end.min(rows.end) {
                let pixel = self.lattice.pixel(place, self.image[1]);
                let columns = self.places(splat.columns(pixel, image), 0);
                if !columns.is_empty() {
                    (first, end) = (first.min(columns.start), end.max(columns.end));
                }
            }
            if first < end {
                let tiles = first / TILE_PX..end.div_ceil(TILE_PX);
                strip.counts[tiles.clone()].iter_mut().for_each(|count| *count += 1);
                strip.reached.push((number, tiles.start as u32..tiles.end as u32));
            }
        }
        strip
    }

    /// The rows of tiles with pixels of a splat.
    fn rows_of(&self, splat: &Splat) -> Range<usize> {
        let rows = self.places(splat.rows(self.image[1]), 1);
        if rows.is_empty() { 0..0 } else { rows.start / TILE_PX..rows.end.div_ceil(TILE_PX) }
    }

    /// The splats on each row of tiles, in their order.
    fn on_rows(&self, splats: &[Splat]) -> Vec<Vec<u32>> {
        let mut on_rows = vec![Vec::new(); self.tiles()[1]];
        for (splat, number) in splats.iter().zip(0..) {
            on_rows[self.rows_of(splat)].iter_mut().for_each(|row| row.push(number));
        }
        on_rows
    }
}

impl FlowSplats {
    /// The plane that is rendered; `None` of listed pixels.
    fn grid(&self) -> Option<Grid> {
        let Samples::Lattice(lattice) = self.view.samples else { return None };
        let (columns, rows) = self.view.plane_px();
        Some(Grid { lattice, image: [self.view.width_px, self.view.height_px], plane: [columns, rows] })
    }

    /// The tiles that the splats reach, row by row; `None` if they are too many.
    fn strips(&self, grid: &Grid) -> Option<&[Strip]> {
        let found = self.reached.get_or_init(|| {
            // Before anything is listed.
            let rows: usize = self.splats.par_iter().map(|splat| grid.rows_of(splat).len()).sum();
            if rows > MOST_PLACES {
                return None;
            }
            let on_rows = grid.on_rows(&self.splats);
            let of_row = |(row, splats): (usize, &Vec<u32>)| grid.strip(row, &self.splats, splats);
            Some(on_rows.par_iter().enumerate().map(of_row).collect())
        });
        found.as_deref()
    }

    /// Finds the tiles that the splats reach, which takes longer than to list them.
    pub(crate) fn reach(&self) {
        if let Some(grid) = self.grid() {
            self.strips(&grid);
        }
    }

    /// Lists the splats by tiles; depths are counted from `origin` (local units).
    ///
    /// # Errors
    /// What is too much if there would be more than `most` texels.
    pub(in crate::render) fn list(&self, origin: f64, most: usize, texels: &mut Vec<Texel>) -> Result<(), String> {
        let Some(grid) = self.grid() else { return Err("a list of pixels".to_owned()) };
        if self.splats.len() > MOST_SPLATS {
            return Err(format!("{} splats of flow, of which it can tell {MOST_SPLATS}", self.splats.len()));
        }
        let too_many = || "splats of flow have more places in tiles than a texture".to_owned();
        let strips = self.strips(&grid).ok_or_else(too_many)?;
        let counts: Vec<u32> = strips.iter().flat_map(|strip| strip.counts.iter().copied()).collect();
        let places: usize = counts.iter().map(|&count| count as usize).sum();
        let begin = (HEAD + counts.len() + SPLAT_TEXELS * self.splats.len()).next_multiple_of(PLACE_TEXELS);
        if begin + PLACE_TEXELS * places > most {
            return Err(too_many());
        }
        texels.clear();
        texels.push(self.head());
        let mut next = begin;
        for &count in &counts {
            texels.push(integer_digits([next as u32, count]));
            next += PLACE_TEXELS * count as usize;
        }
        let wholes: Vec<f64> = self.patterns.iter().map(|pattern| pattern.sums().whole()).collect();
        texels.par_extend(self.splats.par_iter().flat_map_iter(|splat| self.texels_of(splat, &wholes, origin)));
        texels.resize(next, [0.0; 4]);
        let mut rest = &mut texels[begin..];
        let mut parts = Vec::with_capacity(strips.len());
        for strip in strips {
            let places: usize = strip.counts.iter().map(|&count| count as usize).sum();
            let (part, behind) = rest.split_at_mut(PLACE_TEXELS * places);
            parts.push((strip, part));
            rest = behind;
        }
        parts.into_par_iter().enumerate().for_each(|(row, (strip, part))| self.fill(&grid, row, strip, part));
        Ok(())
    }

    /// What all splats have in common.
    fn head(&self) -> Texel {
        let [is_cut, has_others] = [self.inside.is_some(), self.others().is_some()].map(|is| f32::from(u8::from(is)));
        [kernels_number(self.kernels), is_cut, has_others, 0.0]
    }

    /// The texels of a splat, whose icons have these means.
    fn texels_of(&self, splat: &Splat, wholes: &[f64], origin: f64) -> [Texel; SPLAT_TEXELS] {
        let (mix, [depth, rest]) = (splat.mix, two_parts(splat.depth - origin));
        let [along, across] = splat.periods_per_pixel();
        // Where a pattern has no place it is not seen.
        let has_place = along.is_finite() && across.is_finite() && splat.width.is_finite();
        let opacity = if splat.flows && has_place { self.opacity } else { 0.0 };
        let next = if mix.share > 0.0 { wholes[mix.icon + 1] } else { 0.0 };
        let whole = (1.0 - splat.contrast) * ((1.0 - mix.share) * wholes[mix.icon] + mix.share * next);
        let icon = LEVELS * mix.icon as u32 + splat.level;
        let [r, g, b] = splat.color;
        let of_kernel = splat.kernel.as_ref().map(|kernel| kernel.numbers()).unwrap_or_default();
        let ([kernel_r, kernel_g, kernel_b], kernel_depth, kernel_opacity) = of_kernel;
        [
            [along.x as f32, along.y as f32, across.x as f32, across.y as f32],
            [depth, rest, (splat.width * super::TEXELS as f64) as f32, kernel_opacity as f32],
            [r as f32, g as f32, b as f32, opacity as f32],
            [splat.contrast as f32, mix.share as f32, icon as f32, whole as f32],
            [kernel_r as f32, kernel_g as f32, kernel_b as f32, kernel_depth as f32],
        ]
    }

    /// Fills the lists of a row of tiles.
    fn fill(&self, grid: &Grid, row: usize, strip: &Strip, texels: &mut [Texel]) {
        let mut next = Vec::with_capacity(strip.counts.len());
        let mut begin = 0;
        for &count in &strip.counts {
            next.push(begin);
            begin += PLACE_TEXELS * count as usize;
        }
        for (number, tiles) in &strip.reached {
            let splat = &self.splats[*number as usize];
            for tile in tiles.clone() {
                let at = &mut next[tile as usize];
                let place = place_of(splat, *number, grid.middle([tile as usize, row]));
                texels[*at..*at + PLACE_TEXELS].copy_from_slice(&place);
                *at += PLACE_TEXELS;
            }
        }
    }

    /// Where rays are inside of the cells that are shown, as texels; depths are counted from `origin`.
    pub(in crate::render) fn inside_texels(&self, origin: f64, texels: &mut Vec<Texel>) {
        let Some(inside) = &self.inside else { return };
        let number = |depth: f64| match depth {
            f64::INFINITY => [FAR, 0.0],
            f64::NEG_INFINITY => [-FAR, 0.0],
            _ => two_parts(depth - origin),
        };
        let interval = |[near, far]: [f64; 2]| {
            let [[near, near_rest], [far, far_rest]] = [near, far].map(number);
            [near, near_rest, far, far_rest]
        };
        let first = |ray: usize| match inside.of_ray(ray) {
            [only] => interval(*only),
            _ => [FAR, 0.0, 0.0, 0.0],
        };
        texels.clear();
        texels.par_extend((0..self.pixels()).into_par_iter().map(first));
        for ray in 0..self.pixels() {
            let intervals = inside.of_ray(ray);
            if intervals.len() > 1 {
                let [high, low, ..] = integer_digits([texels.len() as u32, 0]);
                texels[ray] = [FAR, intervals.len() as f32, high, low];
                texels.extend(intervals.iter().copied().map(interval));
            }
        }
    }

    /// Where they are drawn, if it is not everywhere.
    pub(in crate::render) fn inside(&self) -> Option<&Arc<super::Inside>> {
        self.inside.as_ref()
    }

    /// The sums of the icons, as texels.
    pub(in crate::render) fn icon_texels(&self, texels: &mut Vec<Texel>) {
        texels.clear();
        self.patterns.iter().for_each(|pattern| pattern.sums().push_texels(texels));
    }
}

/// The number of what kernels are.
fn kernels_number(kernels: Option<FlowFidelity>) -> f32 {
    match kernels {
        None => 0.0,
        Some(FlowFidelity::Smooth) => 1.0,
        Some(FlowFidelity::Paper) => 2.0,
    }
}

/// A splat's place in the list of a tile with this middle.
fn place_of(splat: &Splat, number: u32, middle: DVec2) -> [Texel; PLACE_TEXELS] {
    let [xx, xy, _] = splat.form;
    let (root, down) = (xx.sqrt(), END / splat.half_height);
    let (beside, slope) = (middle - splat.center, -xy / xx);
    let [along, across] = splat.periods_per_pixel();
    let periods = |per_pixel: DVec2, phase: f64| {
        let at = per_pixel.dot(beside) + phase;
        if at.is_finite() { (at - at.floor()) as f32 } else { 0.0 }
    };
    [
        [(root * (beside.x - slope * beside.y)) as f32, (down * beside.y) as f32, root as f32, (-root * slope) as f32],
        [down as f32, periods(along, splat.phase[0]), periods(across, splat.phase[1]), number as f32],
    ]
}

impl Splat {
    /// Periods of the pattern along and across, per pixel to the right and down.
    fn periods_per_pixel(&self) -> [DVec2; 2] {
        let (DVec2 { x, y }, [along, across]) = (self.along, self.frequency);
        [along * DVec2::new(x, y), across * DVec2::new(y, -x)]
    }
}

/// Constants that shaders have, too.
#[cfg(test)]
pub(in crate::render) fn layout_of_lists() -> Vec<(&'static str, f64)> {
    let (texels, least) = (super::TEXELS as f64, (-0.5 * END * END).exp());
    vec![
        ("FLOW_HEAD", HEAD as f64),
        ("SPLAT_TEXELS", SPLAT_TEXELS as f64),
        ("PLACE_TEXELS", PLACE_TEXELS as f64),
        ("NO_KERNELS", kernels_number(None).into()),
        ("SMOOTH_KERNELS", kernels_number(Some(FlowFidelity::Smooth)).into()),
        ("SPLAT_END", END * END),
        ("SPLAT_LEAST", least),
        ("ICON_ROWS", texels),
        ("ICON_LEVELS", texels.log2() + 1.0),
        ("ICON_COLUMNS", 2.0 * texels + 1.0),
        ("ICON_BEFORE", 0.5 * texels),
    ]
}

//! Sums over functions on the sheets of a tile.

use super::super::raster::boxes::Bounds;
use super::super::tiles::TILE_PX;
use super::kernel::TileKernel;
use super::slopes::Slopes;
use crate::optics::exp_neg;
use crate::render::functions::Normalise;
use std::ops::Range;

/// Distances between sheets that are summed at a time.
pub(super) const AT_ONCE: usize = 16;

/// The pixels of a row of a tile.
pub(super) type Row = [f32; TILE_PX];
/// The pixels of a tile on each sheet.
type OnSheets = [[Row; TILE_PX]; AT_ONCE + 1];

/// Sheets at equal distances.
#[derive(Clone, Copy, Debug)]
pub(super) struct SheetDepths {
    /// Depth of the first one.
    pub(super) first: f64,
    /// Distance from one to the next.
    pub(super) apart: f64,
    /// Number of distances, at most [`AT_ONCE`]: one sheet more.
    pub(super) count: usize,
}

impl SheetDepths {
    /// Sheets between the ends of a slab, as many as are asked for where that is possible; none beyond `last` but the first there.
    pub(super) fn between([near, far]: [f64; 2], asked: f64, last: f64) -> Self {
        let count = asked.ceil().clamp(1.0, AT_ONCE as f64);
        let apart = (far - near) / count;
        let needed = ((last - near) / apart).ceil().clamp(1.0, count);
        Self { first: near, apart, count: needed as usize }
    }

    pub(super) fn depth(&self, sheet: usize) -> f64 {
        self.first + sheet as f64 * self.apart
    }

    /// The sheets at depths between two; none if those lie outside.
    fn within(&self, [near, far]: [f64; 2]) -> Range<usize> {
        let at = |depth: f64| (depth - self.first) / self.apart;
        let first = at(near).ceil().clamp(0.0, self.count as f64 + 1.0) as usize;
        let end = (at(far).floor() + 1.0).clamp(0.0, self.count as f64 + 1.0) as usize;
        first..end
    }
}

/// Sums of (v - b) phi and of phi on sheets, from which the field follows. The base b is amid the values, so that those far from zero lose no
/// digits of their differences.
pub(super) struct Sums {
    values: Box<OnSheets>,
    weights: Box<OnSheets>,
    base: f32,
    /// Least and greatest value of the field.
    within: [f64; 2],
    /// Sums of values are divided by this at least.
    least_weight: f32,
}

impl Default for Sums {
    fn default() -> Self {
        let none = || Box::new([[[0.0; TILE_PX]; TILE_PX]; AT_ONCE + 1]);
        Self { values: none(), weights: none(), base: 0.0, within: [0.0; 2], least_weight: 0.0 }
    }
}

/// A function to add.
#[derive(Clone, Copy)]
pub(super) struct Term<'a> {
    pub(super) kernel: &'a TileKernel,
    pub(super) value: f32,
    /// exp(-c^2 / 2).
    pub(super) height_at_cut: f32,
    /// Distance in widths at which the function ends.
    pub(super) cut: f64,
    pub(super) bounds: Bounds,
    pub(super) is_thin: bool,
}

impl Sums {
    /// Begins some sheets of a field between a least and a greatest value.
    #[inline(always)]
    pub(super) fn begin(&mut self, sheets: SheetDepths, within: [f32; 2], normalise: Normalise) {
        self.within = within.map(f64::from);
        (self.base, self.least_weight) = base_of(within, normalise);
        for of in [&mut self.values, &mut self.weights] {
            of[..=sheets.count].as_flattened_mut().as_flattened_mut().fill(0.0);
        }
    }

    /// Adds a function, in the rows whose bit is set, and its slopes where these are asked for.
    #[inline(always)]
    pub(super) fn add(&mut self, term: Term<'_>, sheets: SheetDepths, rows: u16, mut slopes: Option<&mut Slopes>) {
        let term = Term { value: term.value - self.base, ..term };
        let apart = sheets.apart as f32;
        let Bounds { x0, x1, y0, y1 } = term.bounds;
        let inside: Row = std::array::from_fn(|l| if (x0..x1).contains(&l) { 1.0 } else { 0.0 });
        for row in (y0..y1).filter(|row| rows >> row & 1 == 1) {
            let Some(ends) = term.kernel.on_row(row, term.cut) else { continue };
            let range = sheets.within(ends.map(|s| s + term.kernel.depth));
            if range.is_empty() {
                continue;
            }
            let s = (sheets.depth(range.start) - term.kernel.depth) as f32;
            let along = Along::of(term.kernel, row, s, apart);
            if let Some(slopes) = &mut slopes {
                slopes.add(&term, &along, &inside, row, range.clone());
            }
            if term.is_thin {
                self.add_one_by_one(&term, along, &inside, row, range);
            } else {
                self.add_by_products(&term, along, &inside, row, range);
            }
        }
    }

    /// Products from sheet to sheet.
    #[inline(always)]
    fn add_by_products(
        &mut self,
        term: &Term<'_>,
        Along { y, b, apart }: Along,
        inside: &Row,
        row: usize,
        range: Range<usize>,
    ) {
        let [mut height, mut by, mut by_by] = [[0.0f32; TILE_PX]; 3];
        for l in 0..TILE_PX {
            let yy = y[0][l] * y[0][l] + y[1][l] * y[1][l] + y[2][l] * y[2][l];
            let yb = y[0][l] * b[0][l] + y[1][l] * b[1][l] + y[2][l] * b[2][l];
            let bb = b[0][l] * b[0][l] + b[1][l] * b[1][l] + b[2][l] * b[2][l];
            height[l] = exp_neg(0.5 * yy) * inside[l];
            // Pixels outside of the box may be at any distance: their factors stay finite, their heights zero.
            let exponent = apart * (yb + 0.5 * (apart * bb));
            by[l] = exp_neg(if exponent > -LARGEST { exponent } else { -LARGEST });
            by_by[l] = exp_neg(apart * (apart * bb));
        }
        let cut = term.height_at_cut;
        for sheet in range {
            let (values, weights) = (&mut self.values[sheet][row], &mut self.weights[sheet][row]);
            for l in 0..TILE_PX {
                let above = height[l] - cut;
                let weight = if above > 0.0 { above } else { 0.0 };
                values[l] += term.value * weight;
                weights[l] += weight;
                height[l] *= by[l];
                by[l] *= by_by[l];
            }
        }
    }

    /// An exponential on each sheet.
    #[inline(always)]
    fn add_one_by_one(
        &mut self,
        term: &Term<'_>,
        Along { mut y, b, apart }: Along,
        inside: &Row,
        row: usize,
        range: Range<usize>,
    ) {
        let cut = term.height_at_cut;
        for sheet in range {
            let (values, weights) = (&mut self.values[sheet][row], &mut self.weights[sheet][row]);
            for l in 0..TILE_PX {
                let yy = y[0][l] * y[0][l] + y[1][l] * y[1][l] + y[2][l] * y[2][l];
                let above = exp_neg(0.5 * yy) * inside[l] - cut;
                let weight = if above > 0.0 { above } else { 0.0 };
                values[l] += term.value * weight;
                weights[l] += weight;
            }
            for (y, b) in y.iter_mut().zip(&b) {
                y.iter_mut().zip(b).for_each(|(y, b)| *y += apart * b);
            }
        }
    }

    /// Makes the field of the sums, in the rows whose bit is set; NaN where no function reaches.
    #[inline(always)]
    pub(super) fn divide(&mut self, sheets: SheetDepths, rows: u16) {
        let least_weight = self.least_weight;
        for (values, weights) in self.values[..=sheets.count].iter_mut().zip(&*self.weights) {
            for row in (0..TILE_PX).filter(|row| rows >> row & 1 == 1) {
                for l in 0..TILE_PX {
                    let weight = weights[row][l];
                    // Zero over zero is NaN, which stays.
                    values[row][l] /= if weight > 0.0 && weight < least_weight { least_weight } else { weight };
                }
            }
        }
    }

    /// The sum of weights on a sheet at a pixel.
    #[inline(always)]
    pub(super) fn weight(&self, sheet: usize, pixel: usize) -> f32 {
        at_pixel(&self.weights[sheet], pixel)
    }

    /// The field less its base on a sheet at a pixel, once sums are divided.
    #[inline(always)]
    pub(super) fn above_base(&self, sheet: usize, pixel: usize) -> f32 {
        at_pixel(&self.values[sheet], pixel)
    }

    /// The field on a sheet at a pixel, once sums are divided: between its least and its greatest value, NaN where no function reaches.
    #[inline(always)]
    pub(super) fn field(&self, sheet: usize, pixel: usize) -> f64 {
        // Rounding may leave the interval.
        (f64::from(self.base) + f64::from(self.above_base(sheet, pixel))).clamp(self.within[0], self.within[1])
    }
}

/// What is subtracted from the values of a field between a least and a greatest one, and what sums are divided by at least.
pub(super) fn base_of([least, most]: [f32; 2], normalise: Normalise) -> (f32, f32) {
    match normalise {
        Normalise::Sum => (0.5 * least + 0.5 * most, 0.0),
        Normalise::Eq20 => (0.0, 1.0),
    }
}

/// Exponents of factors are kept below this: f32 has room for their exponentials.
const LARGEST: f32 = 60.0;

#[inline(always)]
pub(super) fn at_pixel(rows: &[Row; TILE_PX], pixel: usize) -> f32 {
    rows[pixel / TILE_PX][pixel % TILE_PX]
}

/// A function along the rays of a row.
#[derive(Clone, Copy)]
pub(super) struct Along {
    /// L^-1 (x - mu) on the first sheet.
    pub(super) y: [Row; 3],
    /// Its derivative by depth.
    pub(super) b: [Row; 3],
    /// Distance between sheets.
    pub(super) apart: f32,
}

impl Along {
    /// A function on a row from a sheet `s` behind its centre on.
    #[inline(always)]
    fn of(kernel: &TileKernel, row: usize, s: f32, apart: f32) -> Self {
        let j = row as f32;
        let [mut y, mut b] = [[[0.0; TILE_PX]; 3]; 2];
        for c in 0..3 {
            let (a0, ax) = (kernel.a[0][c] + j * kernel.a[2][c], kernel.a[1][c]);
            let (b0, bx) = (kernel.b[0][c] + j * kernel.b[2][c], kernel.b[1][c]);
            for l in 0..TILE_PX {
                let i = l as f32;
                b[c][l] = b0 + i * bx;
                y[c][l] = (a0 + i * ax) + s * b[c][l];
            }
        }
        Self { y, b, apart }
    }
}

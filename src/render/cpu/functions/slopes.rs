//! Slopes of the sums on the sheets of a tile, for light.
//!
//! grad phi = -exp(-d^2 / 2) grad (d^2 / 2) where a function reaches, and grad f = (sum v grad phi - f sum grad phi) / sum phi.

use super::super::tiles::TILE_PX;
use super::sheets::{Along, Row, Sums, Term, at_pixel};
use crate::optics::exp_neg;
use crate::render::functions::Normalise;
use glam::Vec3;
use std::ops::Range;

/// The pixels of a tile, sheet by sheet.
type OnSheets = Vec<[Row; TILE_PX]>;

/// Sums of (v - b) grad phi and of grad phi on sheets, along the axes of the view.
#[derive(Default)]
pub(super) struct Slopes {
    of_values: [OnSheets; 3],
    of_weights: [OnSheets; 3],
}

impl Slopes {
    /// Begins this number of sheets.
    pub(super) fn begin(&mut self, sheets: usize) {
        for of in self.of_values.iter_mut().chain(&mut self.of_weights) {
            of.clear();
            of.resize(sheets, [[0.0; TILE_PX]; TILE_PX]);
        }
    }

    /// Adds a function on some sheets of a row, `along` being at the first of them.
    #[inline(always)]
    pub(super) fn add(&mut self, term: &Term<'_>, along: &Along, inside: &Row, row: usize, range: Range<usize>) {
        let Along { mut y, b, apart } = *along;
        let axes = &term.kernel.axes;
        let on_axes = |of: &[Row; 3]| -> [Row; 3] {
            std::array::from_fn(|k| {
                let [x, y, z] = axes[k];
                std::array::from_fn(|l| x * of[0][l] + y * of[1][l] + z * of[2][l])
            })
        };
        let (mut slope, by) = (on_axes(&y), on_axes(&b));
        for sheet in range {
            let mut heights = [0.0f32; TILE_PX];
            for l in 0..TILE_PX {
                let height = exp_neg(0.5 * (y[0][l] * y[0][l] + y[1][l] * y[1][l] + y[2][l] * y[2][l])) * inside[l];
                heights[l] = if height > term.height_at_cut { -height } else { 0.0 };
            }
            for k in 0..3 {
                let (values, weights) = (&mut self.of_values[k][sheet][row], &mut self.of_weights[k][sheet][row]);
                for l in 0..TILE_PX {
                    let of_weight = heights[l] * slope[k][l];
                    values[l] += term.value * of_weight;
                    weights[l] += of_weight;
                    slope[k][l] += apart * by[k][l];
                    y[k][l] += apart * b[k][l];
                }
            }
        }
    }

    /// The gradient on a sheet at a pixel, along the axes of the view, of the field of some sums; NaN where no function reaches.
    pub(super) fn gradient(&self, sums: &Sums, sheet: usize, pixel: usize, normalise: Normalise) -> Vec3 {
        let of = |sums: &[OnSheets; 3]| Vec3::from_array([0, 1, 2].map(|k| at_pixel(&sums[k][sheet], pixel)));
        gradient(
            of(&self.of_values),
            of(&self.of_weights),
            sums.above_base(sheet, pixel),
            sums.weight(sheet, pixel),
            normalise,
        )
    }
}

/// The gradient of a quotient of sums, of which the first is `value` times the second, `weight`.
pub(super) fn gradient(of_value: Vec3, of_weight: Vec3, value: f32, weight: f32, normalise: Normalise) -> Vec3 {
    match normalise {
        Normalise::Eq20 if weight < 1.0 => of_value,
        _ => (of_value - value * of_weight) / weight,
    }
}

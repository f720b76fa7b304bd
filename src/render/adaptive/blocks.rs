//! The blocks between neighbouring rays of one stride.

use super::{PixelBits, Seen};
use crate::image::Planes;
use crate::stats::FrameStats;
use rayon::prelude::*;
use std::ops::Range;

/// Bit: the block exists, because the block around it is split or it is one of the coarsest.
const OPEN: u8 = 1;
/// Bits: why a block is split.
const CONTRAST: u8 = 2;
const BORDER: u8 = 4;
const REACHED: u8 = 8;
const BESIDE: u8 = 16;
const LAYER: u8 = 32;
/// Reasons that also split neighbours.
const OF_ITS_OWN: u8 = CONTRAST | BORDER | REACHED;

/// The blocks of a stride: column i has the pixels from i * stride to (i + 1) * stride, or to the last.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    size: (usize, usize),
    stride: usize,
    pub(super) columns: usize,
    rows: usize,
    states: Vec<u8>,
}

/// First and last column and row of a block.
pub(super) struct Corners {
    columns: [usize; 2],
    rows: [usize; 2],
}

impl Blocks {
    /// Starts an image of this width and height with no block open.
    pub(super) fn begin(&mut self, size: (usize, usize), stride: usize) {
        let count = |pixels: usize| pixels.saturating_sub(1).div_ceil(stride).max(1);
        *self = Self {
            size,
            stride,
            columns: count(size.0),
            rows: count(size.1),
            states: std::mem::take(&mut self.states),
        };
        self.states.clear();
        self.states.resize(self.columns * self.rows, 0);
    }

    /// Opens all blocks.
    pub(super) fn open_all(&mut self) {
        self.states.fill(OPEN);
    }

    /// Opens the blocks inside split blocks of twice the stride.
    pub(super) fn open_in(&mut self, coarser: &Self) {
        let states = self.states.par_chunks_mut(self.columns).enumerate();
        states.for_each(|(row, states)| {
            for (column, state) in states.iter_mut().enumerate() {
                *state = u8::from(coarser.is_split((column / 2, row / 2)));
            }
        });
    }

    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn states(&self) -> &[u8] {
        &self.states
    }

    /// Whether no block is split.
    pub(super) fn are_all_whole(&self) -> bool {
        self.states.iter().all(|&state| state <= OPEN)
    }

    /// Whether a block exists and is split.
    pub(super) fn is_split(&self, (column, row): (usize, usize)) -> bool {
        self.states[row * self.columns + column] > OPEN
    }

    pub(super) fn corners(&self, (column, row): (usize, usize)) -> Corners {
        let ends = |at: usize, pixels: usize| [at * self.stride, ((at + 1) * self.stride).min(pixels - 1)];
        Corners { columns: ends(column, self.size.0), rows: ends(row, self.size.1) }
    }

    /// The row of blocks that owns the pixels of a row.
    pub(super) fn owner_of_row(&self, row: usize) -> usize {
        (row / self.stride).min(self.rows - 1)
    }

    /// The columns of these blocks inside a column of coarser ones.
    pub(super) fn columns_in(&self, coarser: &Self, column: usize) -> Range<usize> {
        2 * column..if column + 1 == coarser.columns { self.columns } else { 2 * column + 2 }
    }

    /// The columns of pixels that a column of blocks owns.
    pub(super) fn owned_columns(&self, column: usize) -> Range<usize> {
        let end = if column + 1 == self.columns { self.size.0 } else { (column + 1) * self.stride };
        column * self.stride..end
    }

    /// Splits open blocks by what the rays at their corners have met.
    pub(super) fn split(
        &mut self,
        seen: &Seen,
        contrast: f32,
        reaches: impl Fn(Range<usize>, Range<usize>) -> bool + Sync,
        layer_ends: impl Fn(Range<usize>, Range<usize>) -> bool + Sync,
    ) {
        let mut states = std::mem::take(&mut self.states);
        states.par_chunks_mut(self.columns).enumerate().for_each(|(row, states)| {
            for (column, state) in states.iter_mut().enumerate().filter(|(_, state)| **state == OPEN) {
                let corners = self.corners((column, row));
                *state |= corners.reason(seen, contrast, &reaches);
                if *state == OPEN && corners.are_around(&layer_ends) {
                    *state |= LAYER;
                }
            }
        });
        let beside = |row: usize, column: usize| {
            let rows = row.saturating_sub(1)..(row + 2).min(self.rows);
            let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
            rows.into_iter()
                .any(|row| states[row * self.columns..][columns.clone()].iter().any(|state| state & OF_ITS_OWN != 0))
        };
        let dilated = (0..states.len()).into_par_iter().with_min_len(1024).map(|at| match states[at] {
            OPEN if beside(at / self.columns, at % self.columns) => OPEN | BESIDE,
            state => state,
        });
        dilated.collect_into_vec(&mut self.states);
    }

    /// Counts the split blocks by reason, and the others.
    pub(super) fn count(&self, stats: &mut FrameStats) {
        let of = |mask: u8| self.states.iter().filter(|state| **state & mask != 0).count() as u64;
        let reasons = [CONTRAST, BORDER, REACHED, BESIDE, LAYER].map(of);
        stats.blocks_split.iter_mut().zip(reasons).for_each(|(sum, count)| *sum += count);
        stats.blocks_filled += self.states.iter().filter(|state| **state == OPEN).count() as u64;
    }

    /// Sets the bits in `words` of a row's pixels that lie in split blocks, at half the stride, and have not been cast.
    pub(super) fn want_in_row(&self, row: usize, half: usize, cast: &PixelBits, words: &mut [u64]) {
        if !row.is_multiple_of(half) && row + 1 != self.size.1 {
            return;
        }
        let owner = self.owner_of_row(row);
        // The first row of a block is the last row of the block above.
        let above = (row == owner * self.stride && owner > 0).then(|| owner - 1);
        for at in [Some(owner), above].into_iter().flatten() {
            for column in (0..self.columns).filter(|&column| self.is_split((column, at))) {
                let [first, last] = self.corners((column, at)).columns;
                for pixel in (first..last).step_by(half).chain([last]).filter(|&pixel| !cast.contains(pixel, row)) {
                    words[pixel / 64] |= 1 << (pixel % 64);
                }
            }
        }
    }
}

impl Corners {
    /// The block's own reason to be split; 0 if it has none.
    fn reason(
        &self,
        Seen { planes, met }: &Seen,
        contrast: f32,
        reaches: impl Fn(Range<usize>, Range<usize>) -> bool,
    ) -> u8 {
        let Self { columns: [x0, x1], rows: [y0, y1] } = *self;
        let corners = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)];
        let colors = corners.map(|(x, y)| planes.color.pixels[y * planes.color.width + x]);
        let differs = (0..4).any(|channel| {
            let of = colors.map(|color| color[channel]);
            let (least, most) = of.iter().fold((of[0], of[0]), |(least, most), &c| (least.min(c), most.max(c)));
            most - least > contrast
        });
        if differs {
            return CONTRAST;
        }
        let has_met = corners.map(|(x, y)| met.contains(x, y));
        match has_met.iter().filter(|met| **met).count() {
            0 if self.are_around(reaches) => REACHED,
            1..4 => BORDER,
            _ => 0,
        }
    }

    /// Whether a predicate holds for the block's columns and rows.
    fn are_around(&self, is_in: impl Fn(Range<usize>, Range<usize>) -> bool) -> bool {
        let Self { columns: [x0, x1], rows: [y0, y1] } = *self;
        is_in(x0..x1 + 1, y0..y1 + 1)
    }

    /// Colour (bilinear) and depth (of the nearest corner) of a pixel in the block.
    pub(super) fn mix(&self, planes: &Planes, x: usize, y: usize) -> ([f32; 4], f32) {
        let Self { columns: [x0, x1], rows: [y0, y1] } = *self;
        let share = |from: usize, to: usize, at: usize| (at - from) as f32 / (to - from).max(1) as f32;
        let (right, down) = (share(x0, x1, x), share(y0, y1, y));
        let color = |x: usize, y: usize| planes.color.pixels[y * planes.color.width + x];
        let corners = [[color(x0, y0), color(x1, y0)], [color(x0, y1), color(x1, y1)]];
        let mixed = std::array::from_fn(|c| {
            let [[a, b], [d, e]] = corners.map(|row| row.map(|color: [f32; 4]| color[c]));
            let (above, below) = (a + (b - a) * right, d + (e - d) * right);
            above + (below - above) * down
        });
        let (nearest_x, nearest_y) = (if right > 0.5 { x1 } else { x0 }, if down > 0.5 { y1 } else { y0 });
        (mixed, planes.depth.pixels[nearest_y * planes.depth.width + nearest_x])
    }
}

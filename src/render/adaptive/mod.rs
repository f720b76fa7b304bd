//! Contrast-adaptive sampling: which rays of an image are cast, and how the other pixels are filled.
//!
//! ```text
//! rays at every 8th pixel in both directions, and in the last column and row
//! for strides 8, 4, 2: blocks between four neighbouring rays
//!     split where (a) a channel differs by more than the threshold between two corners
//!                 (b) some of the corners' rays meet the domain, and some do not
//!                 (c) none does, but the box of an entry face reaches into the block
//!                 (d) one of the eight neighbours at this stride is split by a to c
//!                 (e) a layer beside the cells, such as a drawn edge, begins or ends in the block
//!     rays at half the stride in split blocks
//! the pixels of the other blocks: colour bilinear between their corners, depth that of the nearest corner
//! ```
//!
//! The *domain* is the active cells, whatever is skipped. A block owns its pixels from its first column and row up to those of the next
//! block; the last block of a row or column owns the last pixel, too. A ray is cast once, through its pixel: sampled pixels have the bits
//! of the exact image. Which rays are cast follows from the results of earlier rays alone. Contrast is observed, not bounded: features
//! between samples can be missed (`docs/limitations.md`).
//!
//! Refining where neighbouring samples differ is E. Painter, K. Sloan, "Antialiased Ray Tracing by Adaptive Progressive Refinement", SIGGRAPH
//! 1989; the blocks are those of M. Levoy, "Volume Rendering by Adaptive Refinement", The Visual Computer 6 (1990).

mod bits;
mod blocks;
mod contrast;
#[cfg(test)]
mod tests;

use crate::camera::Lattice;
use crate::image::Planes;
use crate::stats::FrameStats;
pub(in crate::render) use bits::PixelBits;
use blocks::Blocks;
pub use contrast::{BadContrast, Contrast};
use rayon::prelude::*;
use std::num::NonZeroUsize;
use std::ops::Range;

/// Pixels between rays at each level.
const STRIDES: [usize; 4] = [8, 4, 2, 1];

/// The last level: rays at every pixel of split blocks.
pub(in crate::render) const LAST: usize = STRIDES.len() - 1;

/// Progress of a frame's sampling. Keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(in crate::render) struct Adaptive {
    size: (usize, usize),
    /// Thresholds still to be reached, the next one last.
    contrasts: Vec<f32>,
    level: usize,
    /// The pixels whose rays are cast at this level.
    pub(in crate::render) wanted: PixelBits,
    /// Pixels whose rays were cast at earlier levels.
    cast: PixelBits,
    /// Results of the rays.
    pub(in crate::render) seen: Seen,
    blocks: [Blocks; LAST],
}

/// Results of the rays that were cast; undefined at other pixels.
#[derive(Debug, Default)]
pub(in crate::render) struct Seen {
    pub(in crate::render) planes: Planes,
    /// Pixels whose rays met the domain.
    pub(in crate::render) met: PixelBits,
}

impl Adaptive {
    /// Begins an image of this width and height, with falling thresholds for raw accumulators; 0 casts all rays.
    pub(in crate::render) fn begin(&mut self, size: (usize, usize), mut contrasts: Vec<f32>) {
        contrasts.reverse();
        (self.size, self.contrasts) = (size, contrasts);
        for bits in [&mut self.wanted, &mut self.cast, &mut self.seen.met] {
            bits.clear(size);
        }
        self.seen.planes.clear(size.0, size.1);
        self.begin_blocks();
        let lattice = self.lattice();
        for row in (0..lattice.count(size.1)).map(|at| lattice.pixel(at, size.1)) {
            (0..lattice.count(size.0)).for_each(|at| self.wanted.insert(lattice.pixel(at, size.0), row));
        }
    }

    /// Opens the coarsest blocks, none of them split.
    fn begin_blocks(&mut self) {
        self.level = 0;
        for (blocks, stride) in self.blocks.iter_mut().zip(STRIDES) {
            blocks.begin(self.size, stride);
        }
        self.blocks[0].open_all();
    }

    /// Continues from a filled image to the next threshold, reusing its rays; false if there is none.
    pub(in crate::render) fn sharpen(&mut self) -> bool {
        self.contrasts.pop();
        let Some(&contrast) = self.contrasts.last() else { return false };
        self.begin_blocks();
        if contrast > 0.0 {
            self.wanted.clear(self.size);
        } else {
            // No decision is made at 0: equal corners prove nothing.
            self.level = LAST;
            self.wanted.become_rest_of(&self.cast);
        }
        true
    }

    /// The threshold being reached.
    pub(in crate::render) fn contrast(&self) -> f32 {
        self.contrasts.last().copied().unwrap_or(0.0)
    }

    /// The level being cast.
    pub(in crate::render) fn level(&self) -> usize {
        self.level
    }

    /// The lattice of the level being cast.
    pub(in crate::render) fn lattice(&self) -> Lattice {
        Lattice::new(NonZeroUsize::new(STRIDES[self.level]).unwrap_or(NonZeroUsize::MIN))
    }

    /// Continues to the rays of the next level once all of this level are cast; false if there are none, and the image can be filled.
    /// `reaches`: whether the box of an entry face overlaps some columns and rows; `layer_ends`: whether a layer begins or ends there.
    pub(in crate::render) fn refine(
        &mut self,
        reaches: impl Fn(Range<usize>, Range<usize>) -> bool + Sync,
        layer_ends: impl Fn(Range<usize>, Range<usize>) -> bool + Sync,
        stats: &mut FrameStats,
    ) -> bool {
        let contrast = self.contrast();
        if self.level == 0 || contrast == 0.0 {
            (stats.blocks_split, stats.blocks_filled) = Default::default();
        }
        loop {
            stats.rays_by_level[self.level] += self.wanted.count();
            self.cast.insert_all(&self.wanted);
            let Some(blocks) = self.blocks.get_mut(self.level) else { return false };
            blocks.split(&self.seen, contrast, &reaches, &layer_ends);
            blocks.count(stats);
            if blocks.are_all_whole() {
                return false;
            }
            let (blocks, stride, cast) = (&self.blocks[self.level], STRIDES[self.level + 1], &self.cast);
            self.wanted.clear(self.size);
            self.wanted
                .par_rows_mut()
                .enumerate()
                .for_each(|(row, words)| blocks.want_in_row(row, stride, cast, words));
            self.open_finer();
            self.level += 1;
            // The next blocks' corners may all have been cast.
            if !self.wanted.is_empty() {
                return true;
            }
        }
    }

    /// Whether the ray of a pixel was cast before the current level; for a filled image, at all.
    #[cfg(test)]
    pub(in crate::render) fn has_cast(&self, column: usize, row: usize) -> bool {
        self.cast.contains(column, row)
    }

    /// The states of a level's blocks, row by row, in the bits of `blocks.rs`.
    #[cfg(all(test, feature = "gpu"))]
    pub(in crate::render) fn states(&self, level: usize) -> &[u8] {
        self.blocks[level].states()
    }

    /// Opens the finer blocks inside split blocks of this level.
    fn open_finer(&mut self) {
        let (coarser, finer) = self.blocks.split_at_mut(self.level + 1);
        if let (Some(coarser), Some(finer)) = (coarser.last(), finer.first_mut()) {
            finer.open_in(coarser);
        }
    }

    /// Fills an image: results of rays, and their blocks' interpolation between them.
    pub(in crate::render) fn fill(&self, planes: &mut Planes) {
        let width = self.size.0;
        let rows = planes.color.pixels.par_chunks_mut(width).zip(planes.depth.pixels.par_chunks_mut(width));
        rows.enumerate().with_min_len(8).for_each(|(row, (color, depth))| {
            let of_row = row * width..(row + 1) * width;
            color.copy_from_slice(&self.seen.planes.color.pixels[of_row.clone()]);
            depth.copy_from_slice(&self.seen.planes.depth.pixels[of_row]);
            let at = self.blocks[0].owner_of_row(row);
            (0..self.blocks[0].columns).for_each(|column| self.fill_block(0, (column, at), row, (color, depth)));
        });
    }

    /// Fills a row of the pixels that a block owns.
    fn fill_block(&self, level: usize, at: (usize, usize), row: usize, (color, depth): (&mut [[f32; 4]], &mut [f32])) {
        let Some(blocks) = self.blocks.get(level) else { return };
        if blocks.is_split(at) {
            let Some(finer) = self.blocks.get(level + 1) else { return };
            let below = finer.owner_of_row(row);
            finer
                .columns_in(blocks, at.0)
                .for_each(|column| self.fill_block(level + 1, (column, below), row, (color, depth)));
            return;
        }
        let corners = blocks.corners(at);
        for column in blocks.owned_columns(at.0) {
            // Rays on an edge shared with a split block have been cast.
            if !self.cast.contains(column, row) {
                (color[column], depth[column]) = corners.mix(&self.seen.planes, column, row);
            }
        }
    }
}

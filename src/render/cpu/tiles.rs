//! The image in tiles, and which of its pixels a triangle may cover.

use super::super::{Frame, RenderJob};
use super::ray::ViewVertex;
use crate::camera::View;
use crate::stats::FrameStats;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Tiles are squares of this many pixels: small enough to balance load, large enough that neighbouring rays share cells
/// in cache.
pub(super) const TILE_PX: usize = 16;

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PixelRect {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

/// The tiles of an image, row by row from the top.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileGrid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    width: usize,
    height: usize,
}

impl TileGrid {
    /// The tiles of a view's image.
    pub(super) fn of(view: &View) -> Self {
        let (width, height) = (view.width_px, view.height_px);
        Self { columns: width.div_ceil(TILE_PX), rows: height.div_ceil(TILE_PX), width, height }
    }

    pub(super) fn tile_count(&self) -> usize {
        self.columns * self.rows
    }

    pub(super) fn rect(&self, tile: usize) -> PixelRect {
        let (x, y) = (tile % self.columns * TILE_PX, tile / self.columns * TILE_PX);
        PixelRect { x, y, width: TILE_PX.min(self.width - x), height: TILE_PX.min(self.height - y) }
    }
}

/// What a ray has seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct TilePixel {
    pub(super) rgba: [f32; 4],
    /// Local depth of the first visible place; infinite if there is none.
    pub(super) depth: f64,
}

impl TilePixel {
    pub(super) const CLEAR: Self = Self { rgba: [0.0; 4], depth: f64::INFINITY };
}

/// Renders the tiles from `first` on for about `budget` (one at least), into `tile_pixels` (all tiles, one after the other),
/// with one of `scratch` for each thread. Returns what they cost, and the first tile that is still to be done.
///
/// Tiles are handed out one by one, in order, until there is a reason to stop: those handed out are finished, so that what
/// is done is always a prefix, and no thread waits for others before the end of the slice.
pub(super) fn render_tiles<S: Send>(
    job: &RenderJob,
    tile_pixels: &mut [TilePixel],
    scratch: &[Mutex<S>],
    first: usize,
    budget: Duration,
    render_tile: impl Fn(usize, &mut S, &mut [TilePixel]) -> FrameStats + Sync,
) -> (FrameStats, usize) {
    let started = Instant::now();
    let mut handed_out = first;
    let goes_on = || started.elapsed() < budget && !job.cancel.is_cancelled();
    let counts = tile_pixels[first * TILE_PX * TILE_PX..]
        .chunks_exact_mut(TILE_PX * TILE_PX)
        .zip(first..)
        .take_while(|&(_, tile)| tile == first || goes_on())
        .inspect(|_| handed_out += 1)
        .par_bridge()
        .map(|(pixels, tile)| {
            let _turn = job.thread_limit.turn();
            // A thread of the pool has a scratch of its own: the lock is never waited for.
            let slot = rayon::current_thread_index().unwrap_or(0) % scratch.len();
            let mut scratch = scratch[slot].lock().unwrap_or_else(PoisonError::into_inner);
            render_tile(tile, &mut scratch, pixels)
        })
        .reduce(FrameStats::default, |mut sum, part| {
            sum.add_counts(&part);
            sum
        });
    (counts, handed_out)
}

/// Copies tiles from their own order into the planes of the frame; `depth_scale` is the world length of a local one.
pub(super) fn copy_tiles(
    frame: &mut Frame,
    grid: &TileGrid,
    tile_pixels: &[TilePixel],
    tiles: Range<usize>,
    depth_scale: f64,
) {
    let width = frame.color.width;
    for tile in tiles {
        let rect = grid.rect(tile);
        let pixels = &tile_pixels[tile * TILE_PX * TILE_PX..];
        for (row, line) in pixels.chunks_exact(rect.width).take(rect.height).enumerate() {
            let at = (rect.y + row) * width + rect.x;
            for (i, pixel) in line.iter().enumerate() {
                frame.color.pixels[at + i] = pixel.rgba;
                frame.depth.pixels[at + i] = (pixel.depth * depth_scale) as f32;
            }
        }
    }
}

/// Pixels whose rays may meet a triangle in front of the eye; `None` if there are none. Conservative.
pub(super) fn pixel_box(view: &View, corners: [ViewVertex; 3]) -> Option<PixelRect> {
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let mut include = |axis: usize, value: f64| {
        range[axis] = [range[axis][0].min(value), range[axis][1].max(value)];
    };
    if view.perspective {
        if corners.iter().all(|v| v.w <= 0.0) {
            return None;
        }
        let extent = corners.iter().fold(0.0f64, |m, v| m.max(v.x.abs()).max(v.y.abs()).max(v.w.abs()));
        for i in 0..3 {
            let (a, b) = (&corners[i], &corners[(i + 1) % 3]);
            if a.w > 0.0 {
                include(0, a.x / a.w);
                include(1, a.y / a.w);
            }
            if (a.w > 0.0) != (b.w > 0.0) {
                // The edge leaves the half-space in front of the eye here: towards infinity on the image plane, on the
                // side of x and y (on both sides if rounding leaves that open).
                let f = a.w / (a.w - b.w);
                for (axis, value) in [(0, a.x + f * (b.x - a.x)), (1, a.y + f * (b.y - a.y))] {
                    if value >= -1e-9 * extent {
                        include(axis, f64::INFINITY);
                    }
                    if value <= 1e-9 * extent {
                        include(axis, f64::NEG_INFINITY);
                    }
                }
            }
        }
    } else {
        for v in &corners {
            include(0, v.x);
            include(1, v.y);
        }
    }
    // Boxes are exact up to f64's rounding.
    const PAD_PX: f64 = 1e-3;
    let axis_range = |lo: f64, hi: f64, half: f64, pixels: usize| {
        let to_px = |v: f64| (v / half + 1.0) * 0.5 * pixels as f64 - 0.5;
        let (lo, hi) = (to_px(lo) - PAD_PX, to_px(hi) + PAD_PX);
        let first = lo.ceil().clamp(0.0, pixels as f64);
        let end = (hi.floor() + 1.0).clamp(0.0, pixels as f64);
        (first as usize, (end - first).max(0.0) as usize)
    };
    let (x, width) = axis_range(range[0][0], range[0][1], view.half_width, view.width_px);
    let (y, height) = axis_range(-range[1][1], -range[1][0], view.half_height, view.height_px);
    (width > 0 && height > 0).then_some(PixelRect { x, y, width, height })
}

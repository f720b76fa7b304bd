//! Tiles of the image.

use super::super::adaptive::{PixelBits, Seen};
use super::super::{Frame, Planes, RenderJob};
use crate::camera::{Lattice, PixelSet, Samples, View};
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct TileGrid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    width: usize,
    height: usize,
}

impl TileGrid {
    /// The tiles of a view's image.
    pub(super) fn of(view: &View) -> Self {
        Self::of_size((view.width_px, view.height_px))
    }

    /// The tiles of an image of this width and height.
    pub(super) fn of_size((width, height): (usize, usize)) -> Self {
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

/// Result of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct TilePixel {
    pub(super) rgba: [f32; 4],
    /// Local depth of the first visible point; infinite if there is none.
    pub(super) depth: f64,
}

impl TilePixel {
    pub(super) const TRANSPARENT: Self = Self { rgba: [0.0; 4], depth: f64::INFINITY };
}

/// A tile in processing order.
#[derive(Clone, Copy, Debug)]
struct TileTurn {
    tile: u32,
    /// Nanoseconds of its last rendering.
    nanos: u64,
    /// Rays that met the domain in its last rendering.
    met: TileBits,
}

/// Some pixels of a tile: bits of the columns per row.
pub(super) type TileBits = [u16; TILE_PX];

/// The tiles of a grid in processing order: the costliest of the last frame first, so that only cheap ones remain when threads run out of
/// work. The image does not depend on it.
#[derive(Debug, Default)]
struct TileOrder {
    grid: TileGrid,
    turns: Vec<TileTurn>,
    /// Position of each tile in this order.
    places: Vec<u32>,
}

impl TileOrder {
    /// Sorts the tiles of a grid: by their last cost, or, without a previous frame of the same grid, from the centre of the image
    /// outwards; row by row if not `costly_first`.
    fn begin(&mut self, grid: TileGrid, costly_first: bool) {
        if self.grid != grid {
            self.grid = grid;
            self.turns.clear();
            // Tiles nearer to the centre count as costlier.
            let away = |at: usize, count: usize| (2 * at + 1).abs_diff(count) as u64;
            let nearness = |tile: usize| {
                let [x, y] = [away(tile % grid.columns, grid.columns), away(tile / grid.columns, grid.rows)];
                u64::from(u32::MAX).saturating_sub(x * x + y * y)
            };
            self.turns.extend((0..grid.tile_count()).map(|tile| TileTurn {
                tile: tile as u32,
                nanos: nearness(tile),
                met: [0; TILE_PX],
            }));
        }
        let cost = |turn: &TileTurn| if costly_first { turn.nanos } else { 0 };
        self.turns.par_sort_unstable_by_key(|turn| (std::cmp::Reverse(cost(turn)), turn.tile));
        self.places.resize(grid.tile_count(), 0);
        for (place, turn) in (0..).zip(&self.turns) {
            self.places[turn.tile as usize] = place;
        }
    }
}

/// The tiles of successive frames, and the scratch memory of threads.
#[derive(Default)]
pub(super) struct Tiles<S> {
    order: TileOrder,
    /// Pixels tile by tile in processing order, each tile's rows together.
    pixels: Vec<TilePixel>,
    /// Scratch memory per thread.
    scratch: Vec<Mutex<S>>,
    /// The first position in the order not yet done.
    next: usize,
}

impl<S: Default + Send> Tiles<S> {
    /// Starts the tiles of a grid; an empty grid keeps the costs of the last frame.
    pub(super) fn begin(&mut self, grid: TileGrid, costly_first: bool) {
        if grid.tile_count() > 0 {
            self.order.begin(grid, costly_first);
        }
        self.pixels.resize(grid.tile_count() * TILE_PX * TILE_PX, TilePixel::TRANSPARENT);
        self.scratch.resize_with(rayon::current_num_threads(), Mutex::default);
        self.next = 0;
    }

    /// Renders the next tiles of a view's image for about `budget` (at least one) into the planes of the frame; true if they were the
    /// last.
    pub(super) fn render(
        &mut self,
        job: &RenderJob,
        budget: Duration,
        frame: &mut Frame,
        render_tile: impl Fn(usize, &mut S, &mut [TilePixel]) -> FrameStats + Sync,
    ) -> bool {
        let is_rendered = |PixelRect { x, y, width, height }| job.view.renders_some_in(x..x + width, y..y + height);
        let done = self.render_some(job, budget, &mut frame.stats, is_rendered, |tile, scratch, pixels| {
            (render_tile(tile, scratch, pixels), [0; TILE_PX])
        });
        match &job.view.samples {
            Samples::Lattice(lattice) => done.copy_lattice(*lattice, &mut frame.planes),
            Samples::Pixels(pixels) => done.copy_pixels(pixels, &mut frame.planes),
        }
        self.are_done()
    }

    /// Whether all tiles are done.
    pub(super) fn are_done(&self) -> bool {
        self.next * TILE_PX * TILE_PX >= self.pixels.len()
    }

    /// Renders the next tiles for about `budget` (at least one), skipping those for which `is_rendered` is false; returns all tiles
    /// passed.
    ///
    /// Tiles are handed out one by one, in order, until there is a reason to stop: those handed out are finished, so that the done tiles
    /// always form a prefix, and no thread waits for others before the end of the slice.
    pub(super) fn render_some(
        &mut self,
        job: &RenderJob,
        budget: Duration,
        stats: &mut FrameStats,
        is_rendered: impl Fn(PixelRect) -> bool + Sync,
        render_tile: impl Fn(usize, &mut S, &mut [TilePixel]) -> (FrameStats, TileBits) + Sync,
    ) -> TilesDone<'_> {
        let started = Instant::now();
        let (first, scratch, grid) = (self.next, &self.scratch, self.order.grid);
        let goes_on = || started.elapsed() < budget && !job.cancel.is_cancelled();
        let counts = self.pixels[first * TILE_PX * TILE_PX..]
            .chunks_exact_mut(TILE_PX * TILE_PX)
            .zip(&mut self.order.turns[first..])
            .zip(first..)
            .take_while(|&(_, place)| place == first || goes_on())
            .inspect(|_| self.next += 1)
            .par_bridge()
            .map(|((pixels, TileTurn { tile, nanos, met }), _)| {
                let _turn = job.thread_limit.turn();
                // Each thread of the pool has its own scratch: the lock is never contended.
                let slot = rayon::current_thread_index().unwrap_or(0) % scratch.len();
                let mut scratch = scratch[slot].lock().unwrap_or_else(PoisonError::into_inner);
                let begun = Instant::now();
                let counts = if is_rendered(grid.rect(*tile as usize)) {
                    let (counts, met_by) = render_tile(*tile as usize, &mut scratch, pixels);
                    *met = met_by;
                    counts
                } else {
                    FrameStats::default()
                };
                *nanos = begun.elapsed().as_nanos() as u64;
                counts
            })
            .reduce(FrameStats::default, |mut sum, part| {
                sum.add_counts(&part);
                sum
            });
        let busy_nanos: u64 = self.order.turns[first..self.next].iter().map(|turn| turn.nanos).sum();
        let all_ms = started.elapsed().as_secs_f64() * 1e3 * rayon::current_num_threads() as f64;
        stats.add_counts(&counts);
        stats.ms_idle += (all_ms - busy_nanos as f64 * 1e-6).max(0.0);
        TilesDone {
            order: &self.order,
            pixels: &self.pixels,
            done: first..self.next,
            depth_scale: job.mesh.positions.scale,
        }
    }
}

/// A range of done tiles in processing order.
pub(super) struct TilesDone<'a> {
    order: &'a TileOrder,
    /// The pixels of all tiles.
    pixels: &'a [TilePixel],
    /// Their positions in the order.
    done: Range<usize>,
    /// World length of a local unit of depth.
    depth_scale: f64,
}

impl TilesDone<'_> {
    /// Copies the pixels of a lattice into the planes.
    pub(super) fn copy_lattice(&self, lattice: Lattice, planes: &mut Planes) {
        let grid = self.order.grid;
        if self.done.is_empty() {
            return;
        }
        let rows = planes
            .color
            .pixels
            .par_chunks_mut(planes.color.width)
            .zip(planes.depth.pixels.par_chunks_mut(planes.depth.width))
            .enumerate();
        rows.with_min_len(TILE_PX).for_each(|(row, (color, depth))| {
            let row = lattice.pixel(row, grid.height);
            let tiles = row / TILE_PX * grid.columns..(row / TILE_PX + 1) * grid.columns;
            for (tile, &place) in tiles.clone().zip(&self.order.places[tiles]) {
                let place = place as usize;
                if !self.done.contains(&place) {
                    continue;
                }
                let rect = grid.rect(tile);
                let line = &self.pixels[place * TILE_PX * TILE_PX + row % TILE_PX * rect.width..][..rect.width];
                let [from, to] = [rect.x, rect.x + rect.width].map(|pixel| lattice.first_from(pixel, grid.width));
                let out = color[from..to].iter_mut().zip(&mut depth[from..to]);
                for (at, (color, depth)) in (from..).zip(out) {
                    let pixel = &line[lattice.pixel(at, grid.width) - rect.x];
                    *color = pixel.rgba;
                    *depth = (pixel.depth * self.depth_scale) as f32;
                }
            }
        });
    }

    /// Copies the `wanted` pixels from tiles of lattice points to their positions in the image.
    pub(super) fn copy_wanted(&self, lattice: Lattice, wanted: &PixelBits, seen: &mut Seen) {
        let Seen { planes: Planes { color, depth, .. }, met } = seen;
        let (grid, width, height) = (self.order.grid, color.width, color.height);
        let rows = color.pixels.par_chunks_mut(width).zip(depth.pixels.par_chunks_mut(width)).zip(met.par_rows_mut());
        rows.enumerate().with_min_len(TILE_PX).for_each(|(row, ((color, depth), met))| {
            if !lattice.has(row, height) {
                return;
            }
            let at = lattice.first_from(row, height);
            for tile in at / TILE_PX * grid.columns..(at / TILE_PX + 1) * grid.columns {
                let place = self.order.places[tile] as usize;
                if !self.done.contains(&place) {
                    continue;
                }
                let rect = grid.rect(tile);
                let line = &self.pixels[place * TILE_PX * TILE_PX + at % TILE_PX * rect.width..][..rect.width];
                let has_met = self.order.turns[place].met[at % TILE_PX];
                for (i, pixel) in line.iter().enumerate() {
                    let column = lattice.pixel(rect.x + i, width);
                    if wanted.contains(column, row) {
                        (color[column], depth[column]) = (pixel.rgba, (pixel.depth * self.depth_scale) as f32);
                        met[column / 64] |= u64::from(has_met >> i & 1) << (column % 64);
                    }
                }
            }
        });
    }

    /// Copies listed pixels into the planes, which have a single row.
    pub(super) fn copy_pixels(&self, pixels: &PixelSet, planes: &mut Planes) {
        let grid = self.order.grid;
        if self.done.is_empty() {
            return;
        }
        let planes = planes.color.pixels.par_iter_mut().zip(&mut planes.depth.pixels).enumerate();
        planes.with_min_len(TILE_PX * TILE_PX).for_each(|(at, (color, depth))| {
            let (column, row) = pixels.pixel(at);
            let tile = row / TILE_PX * grid.columns + column / TILE_PX;
            let place = self.order.places[tile] as usize;
            if self.done.contains(&place) {
                let in_tile = row % TILE_PX * grid.rect(tile).width + column % TILE_PX;
                let pixel = &self.pixels[place * TILE_PX * TILE_PX + in_tile];
                *color = pixel.rgba;
                *depth = (pixel.depth * self.depth_scale) as f32;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 x 2 tiles, the rightmost and bottom ones partial.
    const GRID: TileGrid = TileGrid { columns: 3, rows: 2, width: 40, height: 30 };

    fn tiles(order: &TileOrder) -> Vec<u32> {
        order.turns.iter().map(|turn| turn.tile).collect()
    }

    #[test]
    fn the_first_frame_begins_in_the_middle_and_the_next_with_the_costliest_tiles() {
        let mut order = TileOrder::default();
        order.begin(GRID, true);
        assert_eq!(tiles(&order), [1, 4, 0, 2, 3, 5]);
        for turn in &mut order.turns {
            turn.nanos = [30, 10, 60, 30, 50, 20][turn.tile as usize];
        }
        order.begin(GRID, true);
        assert_eq!(tiles(&order), [2, 4, 0, 3, 5, 1]);
        assert!(order.turns.iter().enumerate().all(|(at, turn)| order.places[turn.tile as usize] as usize == at));
        order.begin(GRID, false);
        assert_eq!(tiles(&order), [0, 1, 2, 3, 4, 5]);
        // Costs are kept nevertheless.
        order.begin(GRID, true);
        assert_eq!(tiles(&order), [2, 4, 0, 3, 5, 1]);
        order.begin(TileGrid { width: 41, ..GRID }, true);
        assert_eq!(tiles(&order), [1, 4, 0, 2, 3, 5]);
    }

    #[test]
    fn tiles_are_copied_from_their_places_and_only_those_that_are_done() {
        let mut order = TileOrder::default();
        order.begin(GRID, true);
        // The value of a pixel encodes its tile's position, and its index in the tile.
        let value = |place: usize, pixel: usize| (1000 * (place + 1) + pixel) as f32;
        let pixels: Vec<TilePixel> = (0..6)
            .flat_map(|place| (0..TILE_PX * TILE_PX).map(move |pixel| value(place, pixel)))
            .map(|value| TilePixel { rgba: [value; 4], depth: f64::from(value) })
            .collect();
        let mut planes = Planes::default();
        planes.clear(40, 30);
        let done = TilesDone { order: &order, pixels: &pixels, done: 2..4, depth_scale: 0.5 };
        done.copy_lattice(Lattice::ALL, &mut planes);
        for (at, (color, depth)) in planes.color.pixels.iter().zip(&planes.depth.pixels).enumerate() {
            let (x, y) = (at % 40, at / 40);
            let (tile, rect) = (x / 16 + y / 16 * 3, GRID.rect(x / 16 + y / 16 * 3));
            let place = order.places[tile] as usize;
            let expected = value(place, (y - rect.y) * rect.width + x - rect.x);
            let is_done = (2..4).contains(&place);
            assert_eq!(*color, if is_done { [expected; 4] } else { [0.0; 4] }, "{x}, {y}");
            assert_eq!(*depth, if is_done { 0.5 * expected } else { f32::INFINITY }, "{x}, {y}");
        }
        // All pixels listed in reverse.
        let backwards = PixelSet::new((40, 30), &(0..40 * 30).rev().collect::<Vec<u32>>()).unwrap();
        let mut listed = Planes::default();
        listed.clear(40 * 30, 1);
        done.copy_pixels(&backwards, &mut listed);
        assert!(listed.color.pixels.iter().rev().eq(&planes.color.pixels));
        assert!(listed.depth.pixels.iter().rev().eq(&planes.depth.pixels));
    }
}

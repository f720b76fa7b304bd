//! The rays of a tile.

use super::super::ray::Ray;
use super::super::tiles::{TILE_PX, TileBits};
use super::boxes::Bounds;
use super::lanes::{BLOCK, COLUMNS, Lanes, PixelList};
use crate::camera::{Lattice, Samples, View};

/// The rays of a tile.
pub(in crate::render::cpu) struct TileRays {
    pub(in crate::render::cpu) bounds: Bounds,
    /// The middle of the tile on the image plane.
    pub(in crate::render::cpu) centre: [f64; 2],
    /// Positions of the columns and rows in the image plane.
    px: [f64; TILE_PX],
    py: [f64; TILE_PX],
    /// Distances of the columns and rows from the middle.
    pub(in crate::render::cpu) dx: [f64; TILE_PX],
    pub(in crate::render::cpu) dy: [f64; TILE_PX],
    /// The same distances for the pixels of a block that begins at each column, and at each row.
    block_dx: [[f32; BLOCK]; TILE_PX],
    block_dy: [[f32; BLOCK]; TILE_PX],
    /// Largest |dx| and |dy|.
    pub(in crate::render::cpu) reach: [f64; 2],
    /// Bits of the columns, per row, whose rays are cast.
    pub(in crate::render::cpu) rendered: TileBits,
}

impl TileRays {
    /// The rays to be cast in a tile of the image.
    pub(in crate::render::cpu) fn new(view: &View, bounds: Bounds) -> Self {
        let Bounds { x0, x1, y0, y1 } = bounds;
        let in_row = |row: usize| view.rendered_in(row, x0..x1).fold(0, |bits, (x, _)| bits | 1 << (x - x0));
        let is_all = view.samples == Samples::ALL;
        let some = || std::array::from_fn(|j| if y0 + j < y1 { in_row(y0 + j) } else { 0 });
        Self::of_lattice(view, Lattice::ALL, bounds, (!is_all).then(some))
    }

    /// The rays of a tile of lattice points; `bounds` are lattice indices. `some`: bits of the columns, per row, whose rays are cast; all
    /// without.
    pub(in crate::render::cpu) fn of_lattice(
        view: &View,
        lattice: Lattice,
        bounds: Bounds,
        some: Option<[u16; TILE_PX]>,
    ) -> Self {
        let Bounds { x0, x1, y0, y1 } = bounds;
        // Values beyond the image are unused.
        let [column, row] = [view.width_px, view.height_px].map(|pixels| move |at| lattice.pixel(at, pixels));
        let middle = |first: usize, last: usize| 0.5 * (first + last + 1) as f64;
        let (cx, cy) = view.ray_at(middle(column(x0), column(x1 - 1)), middle(row(y0), row(y1 - 1)));
        let px: [f64; TILE_PX] = std::array::from_fn(|i| view.ray(column(x0 + i), 0).0);
        let py: [f64; TILE_PX] = std::array::from_fn(|j| view.ray(0, row(y0 + j)).1);
        let (dx, dy) = (px.map(|px| px - cx), py.map(|py| py - cy));
        let most = |of: &[f64]| of.iter().fold(0.0f64, |most, d| most.max(d.abs()));
        let reach = [most(&dx[..x1 - x0]), most(&dy[..y1 - y0])];
        let at = |of: &[f64; TILE_PX], i: usize| of[i.min(TILE_PX - 1)] as f32;
        let block_dx = std::array::from_fn(|i| std::array::from_fn(|l| at(&dx, i + l % COLUMNS)));
        let block_dy = std::array::from_fn(|j| std::array::from_fn(|l| at(&dy, j + l / COLUMNS)));
        let all = |j: usize| if y0 + j < y1 { u16::MAX >> (TILE_PX - (x1 - x0)) } else { 0 };
        let rendered = some.unwrap_or_else(|| std::array::from_fn(all));
        Self { bounds, centre: [cx, cy], px, py, dx, dy, block_dx, block_dy, reach, rendered }
    }

    /// The ray of a pixel, row times [`TILE_PX`] plus column.
    #[inline(always)]
    pub(in crate::render::cpu) fn ray(&self, view: &View, pixel: usize) -> Ray {
        let pixel = pixel % (TILE_PX * TILE_PX);
        Ray::through(view, self.px[pixel % TILE_PX], self.py[pixel / TILE_PX])
    }

    /// The image-plane point of a pixel.
    #[inline(always)]
    pub(in crate::render::cpu) fn at(&self, pixel: usize) -> (f64, f64) {
        (self.px[pixel % TILE_PX], self.py[pixel / TILE_PX % TILE_PX])
    }

    /// Lists the `wanted` pixels in a box that an item does not certainly miss; returns their number. Its certainty of a miss, of the
    /// pixels of a block at these distances from the middle, is that what `missed` gives is above `above`.
    #[inline(always)]
    pub(in crate::render::cpu) fn candidates<L: Lanes>(
        &self,
        lanes: L,
        Bounds { x0: first, x1: end, y0: top, y1: bottom }: Bounds,
        wanted: &TileBits,
        (list, above): (&mut PixelList, f32),
        missed: impl Fn(&[f32; BLOCK], &[f32; BLOCK]) -> [f32; BLOCK],
    ) -> usize {
        let above = [above; BLOCK];
        let mut count = 0;
        let mut column = first;
        while column < end {
            let columns = 0xffu32 >> COLUMNS.saturating_sub(end - column);
            let wanted = |row: usize| u32::from(wanted[row % TILE_PX] >> (column % TILE_PX)) & columns;
            let mut row = top;
            while row < bottom {
                let asked = wanted(row) | if row + 1 < bottom { wanted(row + 1) << COLUMNS } else { 0 };
                let some = missed(&self.block_dx[column % TILE_PX], &self.block_dy[row % TILE_PX]);
                let missed = u32::from(lanes.less_f32(above, some));
                count = lanes.push((asked & !missed) as u16, row * TILE_PX + column, list, count);
                row += BLOCK / COLUMNS;
            }
            column += COLUMNS;
        }
        count
    }
}

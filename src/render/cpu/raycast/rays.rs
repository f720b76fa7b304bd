//! The rays cast together: points of a lattice of pixels, in tiles of 16 x 16.
//!
//! A tile of a coarse lattice covers many of the tiles that faces are sorted into, so that its rays fill vectors as those of a whole
//! image do; faces between lattice points are skipped. A ray is that of its pixel, whichever rays are cast beside it.
//! Leaving out of each tile the faces that hold no wanted pixel gained nothing (0.98 to 1.04 of the time).

use super::super::super::adaptive::PixelBits;
use super::super::raster::TileRays;
use super::super::raster::boxes::Bounds;
use super::super::raster::lists::PlacesInTile;
use super::super::ray::Ray;
use super::super::tiles::{PixelRect, TILE_PX, TileGrid};
use crate::camera::{Lattice, Samples, View};
use arrayvec::ArrayVec;
use std::ops::Range;

/// Lattice points in the image of a view, all or some of them.
#[derive(Clone, Copy)]
pub(super) struct RayPlane<'a> {
    pub(super) view: &'a View,
    lattice: Lattice,
    /// Tiles of lattice points.
    pub(super) grid: TileGrid,
    /// The pixels whose rays are cast; `None` for those of the view's samples.
    wanted: Option<&'a PixelBits>,
}

/// The image tiles, in a row or column of tiles, in which a tile of rays has lattice points.
pub(super) type TilesInLine = ArrayVec<(usize, PlacesInTile), TILE_PX>;

impl<'a> RayPlane<'a> {
    /// The rays of a view's samples.
    pub(super) fn of_view(view: &'a View) -> Self {
        let lattice = match view.samples {
            Samples::Lattice(lattice) => lattice,
            Samples::Pixels(_) => Lattice::ALL,
        };
        Self::of(view, lattice, None)
    }

    /// The rays of pixels of a lattice that are `wanted`.
    pub(super) fn of_wanted(view: &'a View, lattice: Lattice, wanted: &'a PixelBits) -> Self {
        Self::of(view, lattice, Some(wanted))
    }

    fn of(view: &'a View, lattice: Lattice, wanted: Option<&'a PixelBits>) -> Self {
        let size = (lattice.count(view.width_px), lattice.count(view.height_px));
        Self { view, lattice, grid: TileGrid::of_size(size), wanted }
    }

    /// Whether the lattice points are all pixels of the image.
    pub(super) fn has_all_places(&self) -> bool {
        self.lattice == Lattice::ALL
    }

    /// Column and row of the pixel at a lattice point of a tile, given as row times the tile's width plus column.
    #[inline(always)]
    pub(super) fn pixel(&self, rect: PixelRect, place: usize) -> (usize, usize) {
        let (column, row) = (rect.x + place % rect.width, rect.y + place / rect.width);
        (self.lattice.pixel(column, self.view.width_px), self.lattice.pixel(row, self.view.height_px))
    }

    /// Whether a ray is cast for a pixel.
    pub(super) fn renders(&self, column: usize, row: usize) -> bool {
        self.wanted.map_or_else(|| self.view.renders(column, row), |wanted| wanted.contains(column, row))
    }

    /// The ray at a lattice point of a tile.
    #[inline(always)]
    pub(super) fn ray(&self, rect: PixelRect, place: usize) -> Ray {
        let (column, row) = self.pixel(rect, place);
        Ray::of_pixel(self.view, column, row)
    }

    /// Columns and rows of the image between the first and the last pixel of a tile.
    pub(super) fn pixels_in(&self, rect: PixelRect) -> (Range<usize>, Range<usize>) {
        let ends = |first: usize, count: usize, pixels: usize| {
            self.lattice.pixel(first, pixels)..self.lattice.pixel(first + count - 1, pixels) + 1
        };
        (ends(rect.x, rect.width, self.view.width_px), ends(rect.y, rect.height, self.view.height_px))
    }

    /// The rays of a tile.
    pub(super) fn tile_rays(&self, rect: PixelRect) -> TileRays {
        let bounds = Bounds { x0: rect.x, x1: rect.x + rect.width, y0: rect.y, y1: rect.y + rect.height };
        let is_some = self.wanted.is_some() || matches!(self.view.samples, Samples::Pixels(_));
        let some = || std::array::from_fn(|j| if j < rect.height { self.in_row(rect.y + j, rect) } else { 0 });
        TileRays::of_lattice(self.view, self.lattice, bounds, is_some.then(some))
    }

    /// Whether any ray of a tile is cast.
    pub(super) fn has_some_in(&self, rect: PixelRect) -> bool {
        (rect.y..rect.y + rect.height).any(|row| self.in_row(row, rect) != 0)
    }

    /// Bits of the columns whose rays are cast in a row of a tile.
    fn in_row(&self, row: usize, rect: PixelRect) -> u16 {
        let row = self.lattice.pixel(row, self.view.height_px);
        let columns = (0..rect.width).map(|i| self.lattice.pixel(rect.x + i, self.view.width_px));
        match (self.wanted, &self.view.samples) {
            (Some(wanted), _) => {
                (0..).zip(columns).fold(0, |bits, (i, column)| bits | u16::from(wanted.contains(column, row)) << i)
            }
            (None, Samples::Lattice(_)) => u16::MAX >> (TILE_PX - rect.width),
            (None, Samples::Pixels(listed)) => {
                let found = listed.in_row(row, rect.x..rect.x + rect.width);
                found.fold(0, |bits, (column, _)| bits | 1 << (column - rect.x))
            }
        }
    }

    /// Columns and rows of the image tiles in which a tile of rays has lattice points.
    pub(super) fn image_tiles(&self, rect: PixelRect) -> [TilesInLine; 2] {
        let in_line = |first: usize, count: usize, pixels: usize| {
            let mut tiles = TilesInLine::new();
            for place in first..first + count {
                let tile = self.lattice.pixel(place, pixels) / TILE_PX;
                if tiles.last().is_none_or(|&(last, _)| last != tile) {
                    let from =
                        |i: usize| self.lattice.first_from(tile * TILE_PX + i, pixels).clamp(first, first + count);
                    tiles.push((tile, std::array::from_fn(|i| (from(i) - first) as u8)));
                }
            }
            tiles
        };
        [in_line(rect.x, rect.width, self.view.width_px), in_line(rect.y, rect.height, self.view.height_px)]
    }
}

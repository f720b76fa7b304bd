//! For each tile of an image the items whose box overlaps it, in list order.
//!
//! [`TileLists`] are filled by one thread (count, scan, store). [`Bins`] cut a long list into chunks that depend on its length alone; each
//! chunk has its own lists for all tiles. A tile reads the chunks one after the other, in list order, however many threads there are.

use super::super::ray::less;
use super::super::tiles::{TILE_PX, TileGrid};
use super::boxes::{Bounds, BoxSource};
use crate::mesh::NONE;
use crate::visibility::ascending_bits;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// For each pixel of a tile in one direction, and the one behind the last, an index in another tile.
pub(in crate::render::cpu) type PlacesInTile = [u8; TILE_PX + 1];

/// Smallest number of items per chunk: enough to hide the cost of its lists.
const CHUNK_MIN: usize = 4 * 1024;
/// Largest number of chunks: each has a counter for every tile.
const CHUNKS_MAX: usize = 128;

/// An item that may cover a tile, with the data that tiles need: they read it sequentially.
#[derive(Clone, Copy, Debug)]
pub(in crate::render::cpu) struct TileItem<T> {
    /// The item.
    pub(in crate::render::cpu) item: T,
    /// The columns x0..x1 and rows y0..y1 of the tile in its box: x0, x1, y0, y1.
    in_tile: [u8; 4],
    /// Least depth, rounded to f32.
    nearest: f32,
}

/// A face that may cover a tile.
pub(in crate::render::cpu) type TileFace = TileItem<ListedFace>;

impl TileFace {
    pub(in crate::render::cpu) const UNUSED: Self = Self { item: ListedFace::NONE, in_tile: [0; 4], nearest: 0.0 };
}

impl<T: Copy> TileItem<T> {
    /// An item whose box meets the tile in column and row `tile`.
    #[inline(always)]
    pub(in crate::render::cpu) fn new(seen: &SeenItem<T>, tile: [usize; 2]) -> Self {
        let within = |px: usize, tile: usize| px.saturating_sub(tile * TILE_PX).min(TILE_PX) as u8;
        let Bounds { x0, x1, y0, y1 } = seen.bounds;
        let in_tile = [within(x0, tile[0]), within(x1, tile[0]), within(y0, tile[1]), within(y1, tile[1])];
        Self { item: seen.item, in_tile, nearest: seen.nearest }
    }

    /// The item with its box in lattice points instead of pixels: `columns` and `rows` map each pixel of the tile, and the one behind the
    /// last, to the first lattice point from there on. `None` if no lattice point is in the box.
    #[inline(always)]
    pub(in crate::render::cpu) fn in_places(&self, columns: &PlacesInTile, rows: &PlacesInTile) -> Option<Self> {
        let [x0, x1, y0, y1] = self.in_tile.map(|pixel| usize::from(pixel) % (TILE_PX + 1));
        let in_tile = [columns[x0], columns[x1], rows[y0], rows[y1]];
        (in_tile[0] < in_tile[1] && in_tile[2] < in_tile[3]).then_some(Self { in_tile, ..*self })
    }

    /// Lower bound on the depth of the item.
    #[inline(always)]
    pub(in crate::render::cpu) fn nearest(&self) -> f64 {
        below(self.nearest)
    }

    /// Ascends with the least depth.
    #[inline(always)]
    pub(in crate::render::cpu) fn depth_order(&self) -> u32 {
        ascending_bits(self.nearest)
    }

    /// The box within the tile, relative to the tile's corner.
    #[inline(always)]
    pub(in crate::render::cpu) fn bounds(&self) -> Bounds {
        let [x0, x1, y0, y1] = self.in_tile.map(usize::from);
        Bounds { x0, x1, y0, y1 }
    }
}

/// Corners and cells of a face.
#[derive(Clone, Copy, Debug)]
pub(in crate::render::cpu) struct ListedFace {
    /// Corner vertices.
    pub(in crate::render::cpu) ids: [u32; 3],
    /// Cells in front of the face and behind it, for rays that see its corners counter-clockwise.
    pub(in crate::render::cpu) cells: [u32; 2],
}

impl ListedFace {
    /// A face of no cell.
    pub(in crate::render::cpu) const NONE: Self = Self { ids: [0; 3], cells: [NONE; 2] };
}

/// An item whose box is not empty.
#[derive(Clone, Copy, Debug)]
pub(in crate::render::cpu) struct SeenItem<T> {
    pub(in crate::render::cpu) item: T,
    pub(in crate::render::cpu) bounds: Bounds,
    /// Least depth, rounded to f32.
    pub(in crate::render::cpu) nearest: f32,
}

/// Items whose boxes are not empty.
pub(in crate::render::cpu) type Seen<T> = Vec<SeenItem<T>>;

/// For each tile the items whose box overlaps it, in order: first the boxes are counted, then the items stored.
#[derive(Debug)]
pub(in crate::render::cpu) struct TileLists<T> {
    grid: TileGrid,
    /// `starts[t]..starts[t + 1]` of `in_tiles` belong to tile t.
    starts: Vec<u32>,
    in_tiles: Vec<TileItem<T>>,
}

impl<T> Default for TileLists<T> {
    fn default() -> Self {
        Self { grid: TileGrid::default(), starts: Vec::new(), in_tiles: Vec::new() }
    }
}

impl TileLists<ListedFace> {
    /// Sorts faces into the tiles of an image, with `seen` as scratch memory; returns their least depth, rounded to f32.
    pub(in crate::render::cpu) fn fill(
        &mut self,
        source: BoxSource<'_>,
        grid: TileGrid,
        faces: &[ListedFace],
        seen: &mut Seen<ListedFace>,
    ) -> f32 {
        self.sort(grid, seen, faces.iter().filter_map(|face| source.seen(face)))
    }
}

impl<T: Copy> TileLists<T> {
    /// Sorts items into the tiles of an image, with `seen` as scratch memory; returns their least depth, rounded to f32.
    #[inline(always)]
    pub(in crate::render::cpu) fn sort(
        &mut self,
        grid: TileGrid,
        seen: &mut Seen<T>,
        items: impl Iterator<Item = SeenItem<T>>,
    ) -> f32 {
        let mut nearest_of_all = f32::INFINITY;
        self.begin(grid);
        seen.clear();
        for item in items {
            nearest_of_all = less(nearest_of_all, item.nearest);
            self.count(item.bounds);
            seen.push(item);
        }
        self.store(seen);
        nearest_of_all
    }

    /// Empties the lists.
    pub(in crate::render::cpu) fn begin(&mut self, grid: TileGrid) {
        self.grid = grid;
        self.starts.clear();
        self.starts.resize(grid.tile_count() + 1, 0);
    }

    /// Counts an item; returns in how many tiles it is.
    #[inline(always)]
    pub(in crate::render::cpu) fn count(&mut self, bounds: Bounds) -> u64 {
        let ([x0, x1], [y0, y1]) = tiles(bounds);
        for y in y0..=y1 {
            for count in &mut self.starts[y * self.grid.columns + 1..][x0..=x1] {
                *count += 1;
            }
        }
        ((x1 - x0 + 1) * (y1 - y0 + 1)) as u64
    }

    /// Stores the items that have been counted.
    pub(in crate::render::cpu) fn store(&mut self, seen: &Seen<T>) {
        let grid = self.grid;
        for tile in 0..grid.tile_count() {
            self.starts[tile + 1] += self.starts[tile];
        }
        let Some(any) = seen.first() else { return };
        // Old entries need no reset: all of them are overwritten.
        self.in_tiles.resize(self.starts[grid.tile_count()] as usize, TileItem::new(any, [0, 0]));
        for item in seen {
            let ([x0, x1], [y0, y1]) = tiles(item.bounds);
            for y in y0..=y1 {
                // `starts[tile]` serves as the cursor and ends where the next tile starts; shifted back below.
                for (x, cursor) in (x0..).zip(&mut self.starts[y * grid.columns..][x0..=x1]) {
                    self.in_tiles[*cursor as usize] = TileItem::new(item, [x, y]);
                    *cursor += 1;
                }
            }
        }
        for tile in (0..grid.tile_count()).rev() {
            self.starts[tile + 1] = self.starts[tile];
        }
        self.starts[0] = 0;
    }

    /// The items of a tile.
    #[inline(always)]
    pub(in crate::render::cpu) fn items(&self, tile: usize) -> &[TileItem<T>] {
        &self.in_tiles[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}

/// The lists of all tiles for a long list of items, chunk by chunk.
#[derive(Debug)]
pub(in crate::render::cpu) struct Bins<T> {
    pub(in crate::render::cpu) grid: TileGrid,
    chunks: Vec<TileLists<T>>,
    used: usize,
    /// Scratch memory per thread.
    seen: Vec<Mutex<Seen<T>>>,
    /// Least depth of all items from each chunk on, rounded to f32.
    nearest_from: Vec<f32>,
}

impl<T> Default for Bins<T> {
    fn default() -> Self {
        let (chunks, seen, nearest_from) = (Vec::new(), Vec::new(), Vec::new());
        Self { grid: TileGrid::default(), chunks, used: 0, seen, nearest_from }
    }
}

impl<T: Copy + Send + Sync> Bins<T> {
    pub(in crate::render::cpu) fn chunk_count(&self) -> usize {
        self.used
    }

    /// The items of a chunk that may cover a tile.
    pub(in crate::render::cpu) fn items(&self, chunk: usize, tile: usize) -> &[TileItem<T>] {
        self.chunks[chunk].items(tile)
    }

    /// Whether an item may cover a tile.
    pub(in crate::render::cpu) fn has_some(&self, tile: usize) -> bool {
        self.chunks[..self.used].iter().any(|lists| !lists.items(tile).is_empty())
    }

    /// Lower bound on the depth of the items from this chunk on; infinite behind the last chunk.
    pub(in crate::render::cpu) fn nearest_from(&self, chunk: usize) -> f64 {
        below(self.nearest_from[chunk])
    }

    /// Sorts the elements of a list into the tiles of a grid: `fill` does so with each chunk, whose elements it may complete, and returns
    /// their least depth, rounded to f32.
    pub(in crate::render::cpu) fn fill<E: Send>(
        &mut self,
        grid: TileGrid,
        elements: &mut [E],
        fill: impl Fn(&mut TileLists<T>, &mut Seen<T>, usize, &mut [E]) -> f32 + Sync,
    ) {
        self.grid = grid;
        let length = elements.len().div_ceil(CHUNKS_MAX).max(CHUNK_MIN);
        self.used = elements.len().div_ceil(length);
        if self.chunks.len() < self.used {
            self.chunks.resize_with(self.used, TileLists::default);
        }
        self.seen.resize_with(rayon::current_num_threads(), Mutex::default);
        let seen = &self.seen;
        self.nearest_from.clear();
        self.nearest_from.resize(self.used + 1, f32::INFINITY);
        let chunks = self.chunks[..self.used].par_iter_mut().zip(&mut self.nearest_from);
        let elements = elements.par_chunks_mut(length).enumerate();
        chunks.zip(elements).for_each(|((lists, nearest), (chunk, elements))| {
            // Each thread of the pool has its own: the lock is never contended.
            let seen = &seen[rayon::current_thread_index().unwrap_or(0) % seen.len()];
            let mut seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
            *nearest = fill(lists, &mut seen, chunk * length, elements);
        });
        for chunk in (0..self.used).rev() {
            self.nearest_from[chunk] = self.nearest_from[chunk + 1].min(self.nearest_from[chunk]);
        }
    }
}

/// Lower bound of a depth that was rounded to f32.
#[inline(always)]
pub(in crate::render::cpu) fn below(rounded: f32) -> f64 {
    f64::from(rounded) - f64::from(rounded.abs() * f32::EPSILON)
}

/// First and last column and row of tiles that a box overlaps.
#[inline(always)]
fn tiles(Bounds { x0, x1, y0, y1 }: Bounds) -> ([usize; 2], [usize; 2]) {
    ([x0 / TILE_PX, (x1 - 1) / TILE_PX], [y0 / TILE_PX, (y1 - 1) / TILE_PX])
}

//! For each tile the faces whose box overlaps it.

use super::super::ray::less;
use super::super::tiles::{TILE_PX, TileGrid};
use super::boxes::{Bounds, BoxSource};
use crate::mesh::NONE;

/// For each pixel of a tile in one direction, and the one behind the last, an index in another tile.
pub(in crate::render::cpu) type PlacesInTile = [u8; TILE_PX + 1];

/// A face that may cover a tile, with the data that tiles need: they read it sequentially.
#[derive(Clone, Copy, Debug)]
pub(in crate::render::cpu) struct TileFace {
    /// Corner vertices.
    pub(in crate::render::cpu) ids: [u32; 3],
    /// Cells in front of the face and behind it, for rays that see its corners counter-clockwise.
    pub(in crate::render::cpu) cells: [u32; 2],
    /// The columns x0..x1 and rows y0..y1 of the tile in its box: x0, x1, y0, y1.
    in_tile: [u8; 4],
    /// Least depth of a corner, rounded to f32.
    nearest: f32,
}

impl TileFace {
    pub(in crate::render::cpu) const UNUSED: Self =
        Self { ids: [0; 3], cells: [NONE; 2], in_tile: [0; 4], nearest: 0.0 };

    /// A face whose box meets the tile in column and row `tile`.
    #[inline(always)]
    pub(in crate::render::cpu) fn new(face: &SeenFace, tile: [usize; 2]) -> Self {
        let within = |px: usize, tile: usize| px.saturating_sub(tile * TILE_PX).min(TILE_PX) as u8;
        let Bounds { x0, x1, y0, y1 } = face.bounds;
        let in_tile = [within(x0, tile[0]), within(x1, tile[0]), within(y0, tile[1]), within(y1, tile[1])];
        Self { ids: face.face.ids, cells: face.face.cells, in_tile, nearest: face.nearest }
    }

    /// The face with its box in lattice points instead of pixels: `columns` and `rows` map each pixel of the tile, and the one behind the
    /// last, to the first lattice point from there on. `None` if no lattice point is in the box.
    #[inline(always)]
    pub(in crate::render::cpu) fn in_places(&self, columns: &PlacesInTile, rows: &PlacesInTile) -> Option<Self> {
        let [x0, x1, y0, y1] = self.in_tile.map(|pixel| usize::from(pixel) % (TILE_PX + 1));
        let in_tile = [columns[x0], columns[x1], rows[y0], rows[y1]];
        (in_tile[0] < in_tile[1] && in_tile[2] < in_tile[3]).then_some(Self { in_tile, ..*self })
    }

    /// Lower bound on the depth of the face.
    #[inline(always)]
    pub(in crate::render::cpu) fn nearest(&self) -> f64 {
        below(self.nearest)
    }

    /// The box within the tile, relative to the tile's corner.
    #[inline(always)]
    pub(in crate::render::cpu) fn bounds(&self) -> Bounds {
        let [x0, x1, y0, y1] = self.in_tile.map(usize::from);
        Bounds { x0, x1, y0, y1 }
    }
}

/// Corners and cells of a face, as in [`TileFace`].
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::render::cpu) struct ListedFace {
    pub(in crate::render::cpu) ids: [u32; 3],
    pub(in crate::render::cpu) cells: [u32; 2],
}

/// A face whose box is not empty.
#[derive(Clone, Copy, Debug)]
pub(in crate::render::cpu) struct SeenFace {
    pub(in crate::render::cpu) face: ListedFace,
    pub(in crate::render::cpu) bounds: Bounds,
    /// Least depth of a corner, rounded to f32.
    pub(in crate::render::cpu) nearest: f32,
}

/// Faces whose boxes are not empty.
pub(in crate::render::cpu) type Seen = Vec<SeenFace>;

/// For each tile the faces whose box overlaps it, in order: first the boxes are counted, then the faces stored.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct TileLists {
    grid: TileGrid,
    /// `starts[t]..starts[t + 1]` of `in_tiles` belong to tile t.
    starts: Vec<u32>,
    in_tiles: Vec<TileFace>,
}

impl TileLists {
    /// Sorts faces into the tiles of an image, with `seen` as scratch memory; returns their least depth, rounded to f32.
    pub(in crate::render::cpu) fn fill(
        &mut self,
        source: BoxSource<'_>,
        grid: TileGrid,
        faces: &[ListedFace],
        seen: &mut Seen,
    ) -> f32 {
        let mut nearest_of_all = f32::INFINITY;
        self.begin(grid);
        seen.clear();
        for face in faces {
            let Some(bounds) = source.bounds(face.ids) else { continue };
            let nearest = source.nearest(face.ids);
            nearest_of_all = less(nearest_of_all, nearest);
            seen.push(SeenFace { face: *face, bounds, nearest });
            self.count(bounds);
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

    /// Counts a face.
    #[inline(always)]
    pub(in crate::render::cpu) fn count(&mut self, bounds: Bounds) {
        let ([x0, x1], [y0, y1]) = tiles(bounds);
        for y in y0..=y1 {
            for count in &mut self.starts[y * self.grid.columns + 1..][x0..=x1] {
                *count += 1;
            }
        }
    }

    /// Stores the faces that have been counted.
    pub(in crate::render::cpu) fn store(&mut self, seen: &Seen) {
        let grid = self.grid;
        for tile in 0..grid.tile_count() {
            self.starts[tile + 1] += self.starts[tile];
        }
        // Old entries need no reset: all of them are overwritten.
        self.in_tiles.resize(self.starts[grid.tile_count()] as usize, TileFace::UNUSED);
        for face in seen {
            let ([x0, x1], [y0, y1]) = tiles(face.bounds);
            for y in y0..=y1 {
                // `starts[tile]` serves as the cursor and ends where the next tile starts; shifted back below.
                for (x, cursor) in (x0..).zip(&mut self.starts[y * grid.columns..][x0..=x1]) {
                    self.in_tiles[*cursor as usize] = TileFace::new(face, [x, y]);
                    *cursor += 1;
                }
            }
        }
        for tile in (0..grid.tile_count()).rev() {
            self.starts[tile + 1] = self.starts[tile];
        }
        self.starts[0] = 0;
    }

    /// The faces of a tile.
    #[inline(always)]
    pub(in crate::render::cpu) fn faces(&self, tile: usize) -> &[TileFace] {
        &self.in_tiles[self.starts[tile] as usize..self.starts[tile + 1] as usize]
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

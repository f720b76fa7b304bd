//! Which faces a tile has to look at, in the order of the list.
//!
//! The list is cut into chunks that depend on its length alone; each chunk has lists of its own for all tiles, filled by one
//! thread (count, scan, fill). A tile reads the chunks one after the other: the order is that of the list, however many
//! threads there are.

use super::super::ray::ViewVertex;
use super::super::tiles::{TILE_PX, TileGrid, pixel_box};
use crate::camera::View;
use crate::task::Cancel;
use rayon::prelude::*;

/// Fewest faces of a chunk: enough to hide the cost of its lists.
const CHUNK_MIN: usize = 4 * 1024;
/// Most chunks: each has a counter for every tile.
const CHUNKS_MAX: usize = 128;

/// Faces whose corners are asked for before the first is looked at.
const LOADED_AT_ONCE: usize = 64;

/// Where a vertex is in the image, in pixels from the middle of the first one (NaN if it is not in front of the eye), and
/// its depth; four numbers for the sake of one load.
pub(super) type ScreenPoint = [f32; 4];

/// Places of all vertices in the image.
pub(super) fn project(view: &View, vertices: &[ViewVertex], cancel: &Cancel, out: &mut Vec<ScreenPoint>) {
    let to_px = |v: f64, half: f64, pixels: usize| ((v / half + 1.0) * 0.5 * pixels as f64 - 0.5) as f32;
    let project = |v: &ViewVertex| {
        let h = if view.perspective { v.w } else { 1.0 };
        if h <= 0.0 || cancel.is_cancelled() {
            return [f32::NAN, f32::NAN, v.w as f32, 0.0];
        }
        let (x, y) =
            (to_px(v.x / h, view.half_width, view.width_px), to_px(-v.y / h, view.half_height, view.height_px));
        [x, y, v.w as f32, 0.0]
    };
    vertices.par_iter().with_min_len(4096).map(project).collect_into_vec(out);
}

/// Pixels from `x0` to `x1` and `y0` to `y1`, ends excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Bounds {
    pub(super) x0: usize,
    pub(super) x1: usize,
    pub(super) y0: usize,
    pub(super) y1: usize,
}

/// What boxes of faces are found from.
#[derive(Clone, Copy)]
pub(super) struct BoxSource<'a> {
    pub(super) view: &'a View,
    pub(super) vertices: &'a [ViewVertex],
    pub(super) screen: &'a [ScreenPoint],
}

impl BoxSource<'_> {
    /// Pixels within `clip` whose rays may meet a face in front of the eye; `None` if there are none. Conservative: places
    /// in the image are right to 2^-22 of its size.
    #[inline(always)]
    pub(super) fn bounds(&self, ids: [u32; 3], clip: Bounds) -> Option<Bounds> {
        let [a, b, c] = ids.map(|v| self.screen[v as usize]);
        // NaN comes through.
        if (a[0] + b[0] + c[0]).is_nan() {
            return self.bounds_at_eye(ids, clip);
        }
        let range = |axis: usize, first: usize, end: usize| {
            let pad = 1e-3 + end as f32 * (1.0 / (1u32 << 22) as f32);
            let (lo, hi) = (least(a[axis], least(b[axis], c[axis])) - pad, most(a[axis], most(b[axis], c[axis])) + pad);
            // Casts of numbers beyond the integers end at the last one. A pixel exactly at an end lies a pad outside.
            let from = if lo > 0.0 { lo as i32 as usize + 1 } else { 0 };
            let to = if hi > 0.0 { hi as i32 as usize + 1 } else { 0 };
            (from.max(first), to.min(end))
        };
        let ((x0, x1), (y0, y1)) = (range(0, clip.x0, clip.x1), range(1, clip.y0, clip.y1));
        (x0 < x1 && y0 < y1).then_some(Bounds { x0, x1, y0, y1 })
    }

    #[cold]
    #[inline(never)]
    fn bounds_at_eye(&self, ids: [u32; 3], clip: Bounds) -> Option<Bounds> {
        let found = pixel_box(self.view, ids.map(|v| self.vertices[v as usize]))?;
        let (x0, x1) = (found.x.max(clip.x0), (found.x + found.width).min(clip.x1));
        let (y0, y1) = (found.y.max(clip.y0), (found.y + found.height).min(clip.y1));
        (x0 < x1 && y0 < y1).then_some(Bounds { x0, x1, y0, y1 })
    }
}

// Both of one instruction, as neither is NaN.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// For each tile the faces whose box meets it.
#[derive(Debug, Default)]
pub(super) struct FaceBins {
    pub(super) grid: TileGrid,
    chunks: Vec<Chunk>,
    used: usize,
    /// Least depth of a corner of a face in each chunk or behind it, rounded to f32.
    nearest_from: Vec<f32>,
}

#[derive(Debug, Default)]
struct Chunk {
    /// `starts[t]..starts[t + 1]` of `faces` belong to tile t.
    starts: Vec<u32>,
    /// Ids.
    faces: Vec<u32>,
    /// Faces of the chunk that can be seen, while it is filled.
    tiles: Vec<FaceTiles>,
    nearest: f32,
}

/// The first and last column and row of tiles that a face's box meets.
#[derive(Debug)]
struct FaceTiles {
    face: u32,
    columns: [u32; 2],
    rows: [u32; 2],
}

impl FaceBins {
    /// No tiles: nothing can be seen.
    pub(super) fn clear(&mut self) {
        (self.grid, self.used) = (TileGrid::default(), 0);
    }

    pub(super) fn chunk_count(&self) -> usize {
        self.used
    }

    /// Ids of the faces of a chunk that a tile has to look at.
    pub(super) fn faces(&self, chunk: usize, tile: usize) -> &[u32] {
        let chunk = &self.chunks[chunk];
        &chunk.faces[chunk.starts[tile] as usize..chunk.starts[tile + 1] as usize]
    }

    /// No face of this chunk or a later one has a place nearer than that; infinite behind the last chunk.
    pub(super) fn nearest_from(&self, chunk: usize) -> f64 {
        let rounded = f64::from(self.nearest_from[chunk]);
        rounded - rounded.abs() * f64::from(f32::EPSILON)
    }

    /// Sorts the faces `drawn` (ids) into the tiles; some of them if `cancel` is raised.
    pub(super) fn fill(&mut self, source: BoxSource<'_>, faces: &[[u32; 3]], drawn: &[u32], cancel: &Cancel) {
        self.grid = TileGrid::of(source.view);
        let grid = self.grid;
        let length = drawn.len().div_ceil(CHUNKS_MAX).max(CHUNK_MIN);
        self.used = drawn.len().div_ceil(length);
        if self.chunks.len() < self.used {
            self.chunks.resize_with(self.used, Chunk::default);
        }
        self.chunks[..self.used].par_iter_mut().zip(drawn.par_chunks(length)).for_each(|(chunk, drawn)| {
            chunk.fill(source, grid, faces, if cancel.is_cancelled() { &[] } else { drawn });
        });
        self.nearest_from.clear();
        self.nearest_from.resize(self.used + 1, f32::INFINITY);
        for chunk in (0..self.used).rev() {
            self.nearest_from[chunk] = self.nearest_from[chunk + 1].min(self.chunks[chunk].nearest);
        }
    }
}

impl Chunk {
    fn fill(&mut self, source: BoxSource<'_>, grid: TileGrid, faces: &[[u32; 3]], drawn: &[u32]) {
        let image = Bounds { x0: 0, x1: source.view.width_px, y0: 0, y1: source.view.height_px };
        let columns = grid.columns;
        self.nearest = f32::INFINITY;
        self.tiles.clear();
        self.starts.clear();
        self.starts.resize(grid.tile_count() + 1, 0);
        for drawn in drawn.chunks(LOADED_AT_ONCE) {
            // The faces lie anywhere in memory: all are asked for before the first is looked at.
            let mut loaded = [[0; 3]; LOADED_AT_ONCE];
            for (loaded, &face) in loaded.iter_mut().zip(drawn) {
                *loaded = faces[face as usize];
            }
            for (&face, &ids) in drawn.iter().zip(&loaded) {
                self.count(source, image, columns, face, ids);
            }
        }
        for tile in 0..grid.tile_count() {
            self.starts[tile + 1] += self.starts[tile];
        }
        self.faces.clear();
        self.faces.resize(self.starts[grid.tile_count()] as usize, 0);
        for &FaceTiles { face, columns: [x0, x1], rows: [y0, y1] } in &self.tiles {
            for y in y0 as usize..=y1 as usize {
                // `starts[tile]` serves as the cursor and ends where the next tile starts; shifted back below.
                for cursor in &mut self.starts[y * columns..][x0 as usize..=x1 as usize] {
                    self.faces[*cursor as usize] = face;
                    *cursor += 1;
                }
            }
        }
        for tile in (0..grid.tile_count()).rev() {
            self.starts[tile + 1] = self.starts[tile];
        }
        self.starts[0] = 0;
    }

    /// Counts a face for each tile that its box meets.
    #[inline(always)]
    fn count(&mut self, source: BoxSource<'_>, image: Bounds, columns: usize, face: u32, ids: [u32; 3]) {
        let Some(b) = source.bounds(ids, image) else { return };
        for v in ids {
            self.nearest = least(self.nearest, source.screen[v as usize][2]);
        }
        let tile = |px: usize| (px / TILE_PX) as u32;
        let [x0, x1, y0, y1] = [tile(b.x0), tile(b.x1 - 1), tile(b.y0), tile(b.y1 - 1)];
        self.tiles.push(FaceTiles { face, columns: [x0, x1], rows: [y0, y1] });
        for y in y0 as usize..=y1 as usize {
            for count in &mut self.starts[y * columns + 1..][x0 as usize..=x1 as usize] {
                *count += 1;
            }
        }
    }
}

//! Which faces a tile has to look at, in the order of the list.
//!
//! The list is cut into chunks that depend on its length alone; each chunk has lists of its own for all tiles, filled by one
//! thread (count, scan, fill). A tile reads the chunks one after the other: the order is that of the list, however many
//! threads there are.

use super::super::ray::ViewVertex;
use super::super::tiles::{TILE_PX, TileGrid, pixel_box};
use super::sides::Sides;
use crate::camera::View;
use crate::mesh::{Mesh, NONE};
use crate::render::RenderJob;
use crate::task::Cancel;
use crate::visibility::{CellSet, DrawnFaces};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Fewest faces of a chunk: enough to hide the cost of its lists.
const CHUNK_MIN: usize = 4 * 1024;
/// Most chunks: each has a counter for every tile.
const CHUNKS_MAX: usize = 128;

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
    list: List,
    chunks: Vec<Chunk>,
    used: usize,
    /// One for each thread.
    seen: Vec<Mutex<Seen>>,
    /// Least depth of a corner of a face in each chunk or behind it, rounded to f32.
    nearest_from: Vec<f32>,
}

/// A face that a tile has to look at, with what all tiles would else look for: they read them one after the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileFace {
    /// Corners.
    pub(super) ids: [u32; 3],
    /// In front of it and behind it, for rays that see its corners counter-clockwise.
    pub(super) cells: [u32; 2],
    /// The columns x0..x1 and rows y0..y1 of the tile in its box: x0, x1, y0, y1.
    in_tile: [u8; 4],
}

impl TileFace {
    pub(super) const UNUSED: Self = Self { ids: [0; 3], cells: [NONE; 2], in_tile: [0; 4] };

    /// A face whose box meets the tile in column and row `tile`.
    #[inline(always)]
    pub(super) fn new(face: &ListedFace, bounds: Bounds, tile: [usize; 2]) -> Self {
        let within = |px: usize, tile: usize| px.saturating_sub(tile * TILE_PX).min(TILE_PX) as u8;
        let Bounds { x0, x1, y0, y1 } = bounds;
        let in_tile = [within(x0, tile[0]), within(x1, tile[0]), within(y0, tile[1]), within(y1, tile[1])];
        Self { ids: face.ids, cells: face.cells, in_tile }
    }

    /// Its box in the tile, from the tile's corner.
    #[inline(always)]
    pub(super) fn bounds(&self) -> Bounds {
        let [x0, x1, y0, y1] = self.in_tile.map(usize::from);
        Bounds { x0, x1, y0, y1 }
    }
}

/// Corners and cells of a face, as [`TileFace`] has them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ListedFace {
    pub(super) ids: [u32; 3],
    pub(super) cells: [u32; 2],
}

/// The faces of a list in its order, kept as long as the list is drawn: in the mesh they lie anywhere in memory.
#[derive(Debug, Default)]
struct List {
    of: Option<(Arc<Mesh>, Arc<DrawnFaces>, Arc<CellSet>)>,
    faces: Vec<ListedFace>,
}

#[derive(Debug, Default)]
struct Chunk {
    /// `starts[t]..starts[t + 1]` of `in_tiles` belong to tile t.
    starts: Vec<u32>,
    in_tiles: Vec<TileFace>,
    nearest: f32,
}

/// Faces of a chunk that can be seen, and their boxes, while it is filled.
type Seen = Vec<(ListedFace, Bounds)>;

impl FaceBins {
    /// No tiles: nothing can be seen.
    pub(super) fn clear(&mut self) {
        (self.grid, self.used) = (TileGrid::default(), 0);
    }

    pub(super) fn chunk_count(&self) -> usize {
        self.used
    }

    /// The faces of a chunk that a tile has to look at.
    pub(super) fn faces(&self, chunk: usize, tile: usize) -> &[TileFace] {
        let chunk = &self.chunks[chunk];
        &chunk.in_tiles[chunk.starts[tile] as usize..chunk.starts[tile + 1] as usize]
    }

    /// No face of this chunk or a later one has a place nearer than that; infinite behind the last chunk.
    pub(super) fn nearest_from(&self, chunk: usize) -> f64 {
        let rounded = f64::from(self.nearest_from[chunk]);
        rounded - rounded.abs() * f64::from(f32::EPSILON)
    }

    /// Sorts the faces of a job, `drawn`, into the tiles; some of them if it is cancelled.
    pub(super) fn fill(&mut self, source: BoxSource<'_>, sides: &Sides, job: &RenderJob, drawn: &Arc<DrawnFaces>) {
        self.grid = TileGrid::of(source.view);
        let (grid, count) = (self.grid, drawn.faces.len());
        let length = count.div_ceil(CHUNKS_MAX).max(CHUNK_MIN);
        self.used = count.div_ceil(length);
        if self.chunks.len() < self.used {
            self.chunks.resize_with(self.used, Chunk::default);
        }
        self.seen.resize_with(rayon::current_num_threads(), Mutex::default);
        let seen = &self.seen;
        let find = self.list.begin(job, drawn).then_some((&job.mesh.topology, &*job.active, sides));
        let chunks = self.chunks[..self.used].par_iter_mut();
        let faces = self.list.faces.par_chunks_mut(length).zip(drawn.faces.par_chunks(length));
        chunks.zip(faces).for_each(|(chunk, (faces, drawn))| {
            if job.cancel.is_cancelled() {
                return chunk.fill(source, grid, &[], &mut Vec::new());
            }
            if let Some((topology, active, sides)) = find {
                for (listed, &face) in faces.iter_mut().zip(drawn) {
                    let cells = sides.cells(topology, active, face);
                    *listed = ListedFace { ids: topology.faces[face as usize], cells };
                }
            }
            // A thread of the pool has one of its own: the lock is never waited for.
            let seen = &seen[rayon::current_thread_index().unwrap_or(0) % seen.len()];
            chunk.fill(source, grid, faces, &mut seen.lock().unwrap_or_else(PoisonError::into_inner));
        });
        if job.cancel.is_cancelled() {
            // Perhaps before all were found.
            self.list.of = None;
        }
        self.nearest_from.clear();
        self.nearest_from.resize(self.used + 1, f32::INFINITY);
        for chunk in (0..self.used).rev() {
            self.nearest_from[chunk] = self.nearest_from[chunk + 1].min(self.chunks[chunk].nearest);
        }
    }
}

impl List {
    /// Makes room for the faces `drawn` of a job; whether they are still to be found.
    fn begin(&mut self, job: &RenderJob, drawn: &Arc<DrawnFaces>) -> bool {
        let is_kept = self.of.as_ref().is_some_and(|(mesh, faces, active)| {
            Arc::ptr_eq(mesh, &job.mesh) && Arc::ptr_eq(faces, drawn) && Arc::ptr_eq(active, &job.active)
        });
        self.faces.resize(drawn.faces.len(), ListedFace::default());
        self.of = Some((job.mesh.clone(), drawn.clone(), job.active.clone()));
        !is_kept
    }
}

impl Chunk {
    fn fill(&mut self, source: BoxSource<'_>, grid: TileGrid, faces: &[ListedFace], seen: &mut Seen) {
        let image = Bounds { x0: 0, x1: source.view.width_px, y0: 0, y1: source.view.height_px };
        self.nearest = f32::INFINITY;
        self.starts.clear();
        self.starts.resize(grid.tile_count() + 1, 0);
        seen.clear();
        for face in faces {
            let Some(bounds) = source.bounds(face.ids, image) else { continue };
            for v in face.ids {
                self.nearest = least(self.nearest, source.screen[v as usize][2]);
            }
            seen.push((*face, bounds));
            let ([x0, x1], [y0, y1]) = tiles(bounds);
            for y in y0..=y1 {
                for count in &mut self.starts[y * grid.columns + 1..][x0..=x1] {
                    *count += 1;
                }
            }
        }
        for tile in 0..grid.tile_count() {
            self.starts[tile + 1] += self.starts[tile];
        }
        // No need to clear what is there: all of it is written.
        self.in_tiles.resize(self.starts[grid.tile_count()] as usize, TileFace::UNUSED);
        for (face, bounds) in &*seen {
            let ([x0, x1], [y0, y1]) = tiles(*bounds);
            for y in y0..=y1 {
                // `starts[tile]` serves as the cursor and ends where the next tile starts; shifted back below.
                for (x, cursor) in (x0..).zip(&mut self.starts[y * grid.columns..][x0..=x1]) {
                    self.in_tiles[*cursor as usize] = TileFace::new(face, *bounds, [x, y]);
                    *cursor += 1;
                }
            }
        }
        for tile in (0..grid.tile_count()).rev() {
            self.starts[tile + 1] = self.starts[tile];
        }
        self.starts[0] = 0;
    }
}

/// The first and last column and row of tiles that a box meets.
#[inline(always)]
fn tiles(Bounds { x0, x1, y0, y1 }: Bounds) -> ([usize; 2], [usize; 2]) {
    ([x0 / TILE_PX, (x1 - 1) / TILE_PX], [y0 / TILE_PX, (y1 - 1) / TILE_PX])
}

//! Draws one tile: faces in list order, a buffer of fragments per pixel.

use super::super::super::layers::{Ahead, Layers};
use super::super::super::medium::{Medium, RayPoint};
use super::super::raster::boxes::Bounds;
use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::lists::{Bins, ListedFace, TileFace};
use super::super::raster::{FACES_AT_ONCE, Faces, TileRays};
use super::super::ray::{Ray, ViewVertex};
use super::super::raycast::entries::EyeCell;
use super::super::tiles::{PixelRect, TilePixel};
use super::super::values::ValuesOnRay;
use super::TILE_PX;
use super::fragment::{Fragment, sort_in_window};
use super::light::{FragmentRay, RayOptics};
use super::resolve::resolve_again;
use crate::camera::View;
use crate::mesh::{NONE, Topology};
use crate::optics::Accumulator;
use crate::render::KBuffer;
use crate::stats::FrameStats;
use crate::task::Cancel;
use pulp::NullaryFnOnce;

/// Scene data shared by all tiles of a frame.
pub(super) struct Scene<'a, M, Y> {
    pub(super) topology: &'a Topology,
    pub(super) vertices: &'a [ViewVertex],
    pub(super) bins: &'a Bins<ListedFace>,
    pub(super) view: &'a View,
    pub(super) medium: &'a M,
    pub(super) layers: &'a Y,
    /// Active cells that may contain the eye.
    pub(super) eye_cells: &'a [u32],
    pub(super) k_buffer: KBuffer,
    /// Whether the list has all faces of the active cells.
    pub(super) is_complete: bool,
    pub(super) early_termination: bool,
    /// Depths closer than this may be in the wrong order.
    pub(super) tie: f64,
    pub(super) cancel: &'a Cancel,
}

impl<M: Medium<Light = Accumulator>, Y: Layers> Scene<'_, M, Y> {
    /// Capacity of a pixel's buffer in fragments.
    fn room(&self) -> usize {
        usize::from(self.k_buffer.k) + BATCH
    }

    /// Whether no ray of a tile meets anything.
    #[inline(never)]
    fn is_transparent_in(&self, tile: usize, PixelRect { x, y, width, height }: PixelRect) -> bool {
        self.eye_cells.is_empty() && !self.bins.has_some(tile) && !self.layers.has_some_in(x..x + width, y..y + height)
    }

    /// The ray of a pixel before its first fragment.
    pub(super) fn ray(&self, column: usize, row: usize) -> FragmentRay<M::Ray, Y::Ahead<'_>> {
        FragmentRay::new(self.view.near_depth(), self.layers.ahead(column, row))
    }

    pub(super) fn optics(&self, ray: &Ray) -> RayOptics<'_, M> {
        let values = ValuesOnRay { medium: self.medium, topology: self.topology, vertices: self.vertices, ray: *ray };
        RayOptics { values, tie: self.tie, early_termination: self.early_termination }
    }

    /// The start of a ray inside the active cells: at the eye, with the scalar there, since the next fragment need not be the cell's
    /// exit. If it is certain to be, the ray starts where it enters the cell, behind the eye, as in the ray caster.
    pub(super) fn start_at_eye(&self, ray: &Ray, cell: u32) -> Option<Fragment> {
        let at_eye = EyeCell::new(self.topology, self.vertices, ray, cell)?;
        let (entry, exit) = (at_eye.entry.point, at_eye.exit.point);
        let exit_is_next = self.is_complete && self.k_buffer.exact_order;
        let RayPoint { depth, scalar } = if exit_is_next || entry.depth >= 0.0 || exit.depth <= entry.depth {
            entry
        } else {
            let share = -entry.depth / (exit.depth - entry.depth);
            RayPoint { depth: 0.0, scalar: entry.scalar + (exit.scalar - entry.scalar) * share }
        };
        Some(Fragment { depth, scalar, near: NONE, far: cell })
    }
}

/// Fragments collected beyond the `k` held back, before they are sorted and composited.
const BATCH: usize = 16;
const PIXELS: usize = TILE_PX * TILE_PX;

/// Buffers of a tile, reused from tile to tile.
pub(super) struct TileScratch {
    /// Slots for k + [`BATCH`] fragments per pixel, in order of arrival behind those held back.
    slots: Vec<Fragment>,
    counts: [u32; PIXELS],
    /// Number of fragments held back per pixel, sorted.
    held: [u32; PIXELS],
    /// Pixels whose slots are full.
    full: Vec<u16>,
    pub(super) faces: Faces,
    /// Faces set up together.
    batch: [TileFace; FACES_AT_ONCE],
    /// Pixels that a face may cover.
    pub(super) candidates: PixelList,
    /// Fragments of the pixels being resolved again.
    pub(super) again: Vec<(u32, Fragment)>,
}

impl Default for TileScratch {
    fn default() -> Self {
        let (counts, held) = ([0; PIXELS], [0; PIXELS]);
        Self {
            slots: Vec::new(),
            counts,
            held,
            full: Vec::new(),
            faces: Faces::NONE,
            batch: [TileFace::UNUSED; FACES_AT_ONCE],
            candidates: [0; PIXELS + BLOCK],
            again: Vec::new(),
        }
    }
}

/// Renders one tile into the first pixels of `pixels`, row by row; returns its statistics.
pub(super) struct RenderTile<'a, M, Y, L: Lanes> {
    pub(super) lanes: L,
    pub(super) scene: &'a Scene<'a, M, Y>,
    pub(super) tile: usize,
    pub(super) scratch: &'a mut TileScratch,
    pub(super) pixels: &'a mut [TilePixel],
}

impl<M: Medium<Light = Accumulator>, Y: Layers, L: Lanes> NullaryFnOnce for RenderTile<'_, M, Y, L> {
    type Output = FrameStats;

    #[inline(always)]
    fn call(self) -> FrameStats {
        let Self { lanes, scene, tile, scratch, pixels } = self;
        let rect = scene.bins.grid.rect(tile);
        if scene.is_transparent_in(tile, rect) {
            pixels.fill(TilePixel::TRANSPARENT);
            return FrameStats::default();
        }
        let bounds = Bounds { x0: rect.x, x1: rect.x + rect.width, y0: rect.y, y1: rect.y + rect.height };
        let rays = TileRays::new(scene.view, bounds);
        let mut lights = [FragmentRay::new(scene.view.near_depth(), Y::Ahead::NONE); PIXELS];
        if Y::ANY {
            for (pixel, light) in lights.iter_mut().enumerate() {
                let (column, row) = (pixel % TILE_PX, pixel / TILE_PX);
                if rays.rendered[row] >> column & 1 == 1 {
                    *light = scene.ray(rect.x + column, rect.y + row);
                }
            }
        }
        let mut stats = draw_in_list_order(lanes, scene, tile, &rays, scratch, &mut lights);
        let mut again = [0u32; TILE_PX];
        for row in 0..rect.height {
            for column in 0..rect.width {
                let light = &lights[row * TILE_PX + column];
                let is_in_order = light.out_of_order == 0 && (light.is_whole() || !scene.is_complete);
                again[row] |= u32::from(scene.k_buffer.exact_order && !is_in_order) << column;
                stats.out_of_order += u64::from(light.out_of_order);
            }
        }
        if again != [0; TILE_PX] {
            stats.pixels_resolved_again += again.iter().map(|row| u64::from(row.count_ones())).sum::<u64>();
            resolve_again(scene, tile, &rays, &again, scratch, &mut lights);
        }
        for row in 0..rect.height {
            for column in 0..rect.width {
                let light = &lights[row * TILE_PX + column];
                stats.segments += u64::from(light.segments());
                stats.rays_stopped_early += u64::from(light.is_opaque);
                stats.rays_hit += u64::from(light.last.depth > f64::NEG_INFINITY);
                pixels[row * rect.width + column] = light.pixel();
            }
        }
        stats
    }
}

/// Draws faces in list order, with a buffer of k fragments per pixel.
#[inline(always)]
fn draw_in_list_order<'s, M: Medium<Light = Accumulator>, Y: Layers, L: Lanes>(
    lanes: L,
    scene: &'s Scene<'_, M, Y>,
    tile: usize,
    rays: &TileRays,
    scratch: &mut TileScratch,
    lights: &mut [FragmentRay<M::Ray, Y::Ahead<'s>>; PIXELS],
) -> FrameStats {
    let room = scene.room();
    scratch.slots.resize(PIXELS * room, Fragment::UNUSED);
    scratch.counts.fill(0);
    scratch.held.fill(0);
    scratch.full.clear();
    begin_at_eye(scene, rays, scratch);
    let mut stats = FrameStats::default();
    let mut open = OpenPixels::new(rays);
    let mut queue = FaceQueue { next_chunk: 0, faces: &[], hidden: 0 };
    loop {
        let ready = queue.take(scene, tile, &open, &mut scratch.batch);
        scratch.faces.set(scene.view, scene.vertices, rays, &scratch.batch[..ready]);
        let is_last = ready == 0;
        let mut next = 0;
        loop {
            let TileScratch { slots, counts, full, faces, candidates, .. } = &mut *scratch;
            if next < ready {
                let slots = slots.as_mut_slice();
                // A face adds at most one fragment per pixel, so capacity is checked after each face.
                faces.hits(lanes, next, (scene.view, scene.vertices), rays, candidates, |pixel, hit| {
                    let count = counts[pixel] as usize;
                    slots[pixel * room + count] = Fragment::at(hit);
                    counts[pixel] = count as u32 + 1;
                    if count + 1 == room {
                        full.push(pixel as u16);
                    }
                });
                next += 1;
            } else if is_last {
                full.extend((0..PIXELS as u16).filter(|&pixel| counts[usize::from(pixel)] > 0));
            }
            while let Some(pixel) = scratch.full.pop() {
                let light = &mut lights[usize::from(pixel)];
                let was_opaque = light.is_opaque;
                stats.fragments += let_go(scene, rays, scratch, usize::from(pixel), light, is_last);
                if light.is_opaque && !was_opaque {
                    open.close(usize::from(pixel), light.last.depth);
                }
            }
            if next >= ready {
                break;
            }
        }
        if is_last {
            stats.faces_hidden = queue.hidden;
            return stats;
        }
    }
}

/// The pixels of a tile that are not opaque yet.
struct OpenPixels {
    /// A bit per column for each row.
    rows: [u16; TILE_PX],
    count: usize,
    /// Depth of the furthest last fragment of the opaque pixels.
    furthest: f64,
}

impl OpenPixels {
    fn new(rays: &TileRays) -> Self {
        let count = rays.rendered.iter().map(|row| row.count_ones() as usize).sum();
        Self { rows: rays.rendered, count, furthest: f64::NEG_INFINITY }
    }

    /// Marks a pixel as opaque from this depth on.
    fn close(&mut self, pixel: usize, depth: f64) {
        self.rows[pixel / TILE_PX] &= !(1 << (pixel % TILE_PX));
        self.count -= 1;
        self.furthest = self.furthest.max(depth);
    }

    /// Whether a box has an open pixel.
    #[inline(always)]
    fn has_some_in(&self, Bounds { x0, x1, y0, y1 }: Bounds) -> bool {
        let columns = ((1u32 << x1) - (1u32 << x0)) as u16;
        self.rows[y0..y1].iter().fold(0, |some, row| some | row & columns) != 0
    }
}

/// The faces of a tile still to be drawn.
struct FaceQueue<'a> {
    next_chunk: usize,
    faces: &'a [TileFace],
    /// Number of faces left out.
    hidden: u64,
}

impl<'a> FaceQueue<'a> {
    /// Puts the next faces that rays may meet into `batch` and returns their number, 0 at the end of the list. Faces over opaque pixels
    /// only are left out; in exact order only if they also lie behind all that has been composited, or the pixel would have to be drawn
    /// again.
    #[inline(always)]
    fn take<M: Medium<Light = Accumulator>, Y: Layers>(
        &mut self,
        scene: &Scene<'a, M, Y>,
        tile: usize,
        open: &OpenPixels,
        batch: &mut [TileFace; FACES_AT_ONCE],
    ) -> usize {
        let lies_behind = |nearest: f64| !scene.k_buffer.exact_order || nearest > open.furthest;
        let chunks = scene.bins.chunk_count();
        let mut ready = 0;
        while ready < FACES_AT_ONCE {
            let Some((face, rest)) = self.faces.split_first() else {
                let nobody_sees = |chunk: usize| open.count == 0 && lies_behind(scene.bins.nearest_from(chunk));
                if self.next_chunk == chunks || scene.cancel.is_cancelled() || nobody_sees(self.next_chunk) {
                    self.hidden +=
                        (self.next_chunk..chunks).map(|c| scene.bins.items(c, tile).len() as u64).sum::<u64>();
                    self.next_chunk = chunks;
                    break;
                }
                self.faces = scene.bins.items(self.next_chunk, tile);
                self.next_chunk += 1;
                continue;
            };
            self.faces = rest;
            let is_hidden =
                open.furthest > f64::NEG_INFINITY && !open.has_some_in(face.bounds()) && lies_behind(face.nearest());
            batch[ready] = *face;
            ready += usize::from(!is_hidden);
            self.hidden += u64::from(is_hidden);
        }
        ready
    }
}

/// Finds the first fragments of rays that begin within the active cells.
#[inline(never)]
fn begin_at_eye<M: Medium<Light = Accumulator>, Y: Layers>(
    scene: &Scene<'_, M, Y>,
    rays: &TileRays,
    scratch: &mut TileScratch,
) {
    let room = scene.room();
    let is_rendered = |pixel: &usize| rays.rendered[pixel / TILE_PX] >> (pixel % TILE_PX) & 1 == 1;
    for &cell in scene.eye_cells {
        for pixel in (0..PIXELS).filter(is_rendered) {
            let count = &mut scratch.counts[pixel];
            // A ray begins in one of the cells around the eye; more are possible only by rounding.
            if let Some(start) = scene.start_at_eye(&rays.ray(scene.view, pixel), cell)
                && (*count as usize) < BATCH
            {
                scratch.slots[pixel * room + *count as usize] = start;
                *count += 1;
            }
        }
    }
}

/// Sorts the fragments of a pixel and composites those that leave its buffer, all of them at the end; returns the number of fragments
/// that had arrived.
#[inline(always)]
fn let_go<M: Medium<Light = Accumulator>, Y: Layers, A: Ahead>(
    scene: &Scene<'_, M, Y>,
    rays: &TileRays,
    scratch: &mut TileScratch,
    pixel: usize,
    light: &mut FragmentRay<M::Ray, A>,
    is_last: bool,
) -> u64 {
    let k = usize::from(scene.k_buffer.k);
    let (count, held) = (scratch.counts[pixel] as usize, scratch.held[pixel] as usize);
    let fragments = &mut scratch.slots[pixel * scene.room()..][..count];
    // Nothing behind an opaque depth is visible, whatever the order.
    let leaving = if is_last || light.is_opaque { count } else { count.saturating_sub(k) };
    if !light.is_opaque {
        sort_in_window(fragments, held, k, scene.tie);
    }
    let optics = scene.optics(&rays.ray(scene.view, pixel));
    light.advance_all(&optics, &fragments[..leaving]);
    fragments.copy_within(leaving.., 0);
    let left = (count - leaving) as u32;
    (scratch.counts[pixel], scratch.held[pixel]) = (left, left);
    (count - held) as u64
}

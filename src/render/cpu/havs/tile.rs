//! Draws one tile, round by round.

use super::super::super::layers::{Ahead, Layers};
use super::super::super::medium::{Medium, RayPoint};
use super::super::light::RayLight;
use super::super::raster::boxes::Bounds;
use super::super::raster::fragments::{self, PIXELS, sort_words};
use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::lists::{Bins, ListedFace, TileFace};
use super::super::raster::{FACES_AT_ONCE, Faces, Hits, TileRays};
use super::super::ray::{Ray, ViewVertex};
use super::super::raycast::entries::EyeCell;
use super::super::tiles::{PixelRect, TileBits, TilePixel};
use super::super::values::ValuesOnRay;
use super::TILE_PX;
use super::fragment::{Fragment, sort_all, sort_in_window};
use super::light::RayOptics;
use super::lights::{Lights, SideBySide};
use super::path::Path;
use super::queue::FaceQueue;
use super::resolve::resolve_again;
use crate::camera::View;
use crate::mesh::{NONE, Topology};
use crate::optics::Accumulator;
use crate::optics::exact::ExactTable;
use crate::render::KBuffer;
use crate::stats::FrameStats;
use crate::task::Cancel;
use pulp::{Arch, NullaryFnOnce};

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
    /// The vectors that are used.
    pub(super) arch: Arch,
    /// Fragments that are held back at most, unless there is one pixel.
    pub(super) held_most: usize,
}

impl<M: Medium<Light = Accumulator>, Y: Layers> Scene<'_, M, Y> {
    /// Whether no ray of a tile meets anything.
    #[inline(never)]
    fn is_transparent_in(&self, tile: usize, PixelRect { x, y, width, height }: PixelRect) -> bool {
        self.eye_cells.is_empty() && !self.bins.has_some(tile) && !self.layers.has_some_in(x..x + width, y..y + height)
    }

    /// The lights of the rays of a tile before their first fragments.
    fn lights(&self, rays: &TileRays) -> [RayLight<M::Ray, Y::Ahead<'_>>; PIXELS] {
        let unused = RayLight::new(self.view.near_depth(), Y::Ahead::NONE);
        std::array::from_fn(|pixel| if has(&rays.rendered, pixel) { self.light(rays, pixel) } else { unused })
    }

    /// The light of a ray before its first fragment, of a pixel of a tile in the image.
    pub(super) fn light(&self, rays: &TileRays, pixel: usize) -> RayLight<M::Ray, Y::Ahead<'_>> {
        let (column, row) = (rays.bounds.x0 + pixel % TILE_PX, rays.bounds.y0 + pixel / TILE_PX);
        RayLight::new(self.view.near_depth(), self.layers.ahead(column, row))
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

    /// The table of rays that are composited side by side in a tile; `None` if each is composited alone.
    fn table_of_lanes(&self, rays: &TileRays) -> Option<&ExactTable> {
        let Bounds { x0, x1, y0, y1 } = rays.bounds;
        let has_vectors = !matches!(self.arch, Arch::Scalar) && cfg!(target_arch = "x86_64");
        self.medium.exact_table().filter(|_| has_vectors && !self.layers.has_some_in(x0..x1, y0..y1))
    }
}

/// Fragments of the first round: enough for the first layers of a tile, and few in vain if rays become opaque there.
const FIRST_ROUND: usize = 8 * PIXELS;
/// Fragments of later rounds: four times as many as of the one before, unless rays became opaque in it, and at most these.
const LATER_ROUNDS: usize = 128 * PIXELS;

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct TileScratch {
    fragments: FragmentScratch,
    side_by_side: SideBySide,
    /// Parts of the tile still to be drawn.
    parts: Vec<TileBits>,
}

/// Buffers of fragments.
pub(super) struct FragmentScratch {
    fragments: fragments::Fragments<RayPoint, [u32; 2]>,
    /// Fragments held back for the next round, with their pixels, and their number per pixel.
    held: Vec<(u8, Fragment)>,
    held_of: [u32; PIXELS],
    /// The fragments of a pixel.
    line: Vec<Fragment>,
    pub(super) faces: Faces,
    /// Faces set up together.
    batch: [TileFace; FACES_AT_ONCE],
    /// Pixels that a face may cover.
    pub(super) candidates: PixelList,
    /// Fragments of the pixels being resolved again.
    pub(super) again: Vec<(u32, Fragment)>,
}

impl Default for FragmentScratch {
    fn default() -> Self {
        Self {
            fragments: fragments::Fragments::default(),
            held: Vec::new(),
            held_of: [0; PIXELS],
            line: Vec::new(),
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
        pixels.fill(TilePixel::TRANSPARENT);
        let mut stats = FrameStats::default();
        if scene.is_transparent_in(tile, rect) {
            return stats;
        }
        let bounds = Bounds { x0: rect.x, x1: rect.x + rect.width, y0: rect.y, y1: rect.y + rect.height };
        let mut rays = TileRays::new(scene.view, bounds);
        scratch.parts.clear();
        scratch.parts.push(rays.rendered);
        while let Some(part) = scratch.parts.pop() {
            rays.rendered = part;
            match draw(lanes, scene, tile, &mut rays, (scratch, &mut *pixels)) {
                Some(counts) => stats.add_counts(&counts),
                None => scratch.parts.extend(halves(&part)),
            }
        }
        stats
    }
}

/// Both halves of some pixels, of which there are at least two.
fn halves(part: &TileBits) -> [TileBits; 2] {
    let mut left = count_of(part) / 2;
    let first = of_pixels(|pixel| {
        let is_first = has(part, pixel) && left > 0;
        left -= usize::from(is_first);
        is_first
    });
    [first, of_pixels(|pixel| has(part, pixel) && !has(&first, pixel))]
}

fn has(pixels: &TileBits, pixel: usize) -> bool {
    pixels[pixel / TILE_PX] >> (pixel % TILE_PX) & 1 == 1
}

/// Those of all pixels, which are asked in their order.
fn of_pixels(mut is_one: impl FnMut(usize) -> bool) -> TileBits {
    let mut bits = TileBits::default();
    (0..PIXELS).for_each(|pixel| bits[pixel / TILE_PX] |= u16::from(is_one(pixel)) << (pixel % TILE_PX));
    bits
}

fn count_of(pixels: &TileBits) -> usize {
    pixels.iter().map(|row| row.count_ones() as usize).sum()
}

/// Calls `each` with each of these pixels.
pub(super) fn each(pixels: &TileBits, mut each: impl FnMut(usize)) {
    for (row, &bits) in pixels.iter().enumerate() {
        let mut bits = bits;
        while bits != 0 {
            each(row * TILE_PX + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}

/// The place of a pixel of a tile among those of its image.
pub(super) fn place(rays: &TileRays, pixel: usize) -> usize {
    pixel / TILE_PX * (rays.bounds.x1 - rays.bounds.x0) + pixel % TILE_PX
}

/// Draws the pixels `rays.rendered` of a tile; `None` if more fragments would be held back than memory is for.
#[inline(always)]
fn draw<M: Medium<Light = Accumulator>, Y: Layers, L: Lanes>(
    lanes: L,
    scene: &Scene<'_, M, Y>,
    tile: usize,
    rays: &mut TileRays,
    (TileScratch { fragments: scratch, side_by_side, .. }, pixels): (&mut TileScratch, &mut [TilePixel]),
) -> Option<FrameStats> {
    let part = rays.rendered;
    let is_alone = count_of(&part) < 2;
    let mut paths = [Path::START; PIXELS];
    let mut alone;
    let mut lights = match scene.table_of_lanes(rays) {
        Some(table) => Lights::side_by_side(table, side_by_side),
        None => {
            alone = scene.lights(rays);
            Lights::Each(&mut alone)
        }
    };
    scratch.fragments.clear();
    scratch.held_of.fill(0);
    begin_at_eye(scene, rays, scratch);
    let mut stats = FrameStats { fragments: scratch.fragments.len() as u64, ..FrameStats::default() };
    let mut queue = FaceQueue::new(scene.bins, tile, scene.cancel);
    let (mut round, mut some_are_closed) = (FIRST_ROUND, false);
    loop {
        // As many as are held back, at least: all of these are put in order in each round.
        let held = scratch.fragments.len();
        let is_last = collect(lanes, scene, rays, scratch, (&mut queue, some_are_closed, held + round.max(held)));
        stats.fragments += (scratch.fragments.len() - held) as u64;
        let bound = if is_last { f64::INFINITY } else { queue.nearest_left() };
        stats.segments += release(scene, rays, (&mut paths, &mut lights), (scratch, pixels), bound);
        let is_open = |pixel: usize| !paths[pixel].is_opaque;
        let open = of_pixels(|pixel| is_open(pixel) && has(&rays.rendered, pixel));
        let closes_some = open != std::mem::replace(&mut rays.rendered, open);
        some_are_closed |= closes_some;
        if is_last {
            break;
        }
        hold(scratch, &paths);
        if scratch.fragments.len() > scene.held_most && !is_alone {
            each(&part, |pixel| pixels[place(rays, pixel)] = TilePixel::TRANSPARENT);
            return None;
        }
        if !closes_some {
            round = LATER_ROUNDS.min(4 * round);
        }
    }
    stats.faces_hidden = queue.hidden;
    finish(scene, tile, (rays, &part), (&mut paths, lights), (scratch, pixels), &mut stats);
    Some(stats)
}

/// Finds the first fragments of rays that begin within the active cells.
#[inline(never)]
fn begin_at_eye<M: Medium<Light = Accumulator>, Y: Layers>(
    scene: &Scene<'_, M, Y>,
    rays: &TileRays,
    scratch: &mut FragmentScratch,
) {
    for &cell in scene.eye_cells {
        each(&rays.rendered, |pixel| {
            if let Some(start) = scene.start_at_eye(&rays.ray(scene.view, pixel), cell) {
                start.push_to(&mut scratch.fragments, pixel);
            }
        });
    }
}

/// Finds the fragments of the next faces until there are so many in all; true at the end of the list.
#[inline(always)]
fn collect<M: Medium<Light = Accumulator>, Y: Layers, L: Lanes>(
    lanes: L,
    scene: &Scene<'_, M, Y>,
    rays: &TileRays,
    scratch: &mut FragmentScratch,
    (queue, some_are_closed, most): (&mut FaceQueue<'_>, bool, usize),
) -> bool {
    let FragmentScratch { fragments, faces, batch, candidates, .. } = scratch;
    while fragments.len() < most {
        let ready = queue.take(&rays.rendered, some_are_closed, batch);
        if ready == 0 {
            return true;
        }
        faces.set(scene.view, scene.vertices, rays, &batch[..ready]);
        for face in 0..ready {
            faces.some_hits(lanes, face, (scene.view, scene.vertices), rays, candidates, |hits| {
                let &Hits { which, pixels, depth, scalar, turned, cells: [front, behind] } = hits;
                let at = |l: usize| RayPoint { depth: depth[l], scalar: scalar[l] };
                // Most faces are seen from one side.
                if which & !turned != 0 {
                    fragments.push_some([front, behind], which & !turned, pixels, depth, at);
                }
                if which & turned != 0 {
                    fragments.push_some([behind, front], which & turned, pixels, depth, at);
                }
            });
        }
    }
    false
}

/// The fragments that have been found by pixel.
pub(super) type FragmentsByPixel<'a> = fragments::FragmentsByPixel<'a, RayPoint, [u32; 2]>;

/// Puts the fragments of a pixel in order, of which `held` were so before; returns how many of them are certain to be in front of all that are
/// still to come, which have at least the depth `bound`: in exact order, or as by the buffer of `k`.
#[inline(always)]
fn in_order<M, Y>(
    scene: &Scene<'_, M, Y>,
    by_pixel: FragmentsByPixel<'_>,
    pixel: usize,
    (held, bound): (u32, f64),
    line: &mut Vec<Fragment>,
) -> usize {
    line.clear();
    line.extend(by_pixel.some(by_pixel.range(pixel)).map(Fragment::from));
    let (tie, KBuffer { k, exact_order }) = (scene.tie, scene.k_buffer);
    if !exact_order {
        sort_in_window(line, held as usize, usize::from(k), tie);
        return if bound == f64::INFINITY { line.len() } else { line.len().saturating_sub(usize::from(k)) };
    }
    if !line.is_sorted_by(|a, b| b.depth - a.depth > tie) {
        sort_all(line, tie);
    }
    let mut leaving = line.partition_point(|fragment| fragment.depth < bound - tie);
    while leaving > 0 && leaving < line.len() && line[leaving].depth - line[leaving - 1].depth <= tie {
        leaving -= 1;
    }
    leaving
}

/// Composites the fragments that are certain to be next, and holds back the others; returns the number of pieces.
#[inline(always)]
fn release<M: Medium<Light = Accumulator>, Y: Layers>(
    scene: &Scene<'_, M, Y>,
    rays: &TileRays,
    (paths, lights): (&mut [Path; PIXELS], &mut Lights<'_, M::Ray, Y::Ahead<'_>>),
    (scratch, pixels): (&mut FragmentScratch, &mut [TilePixel]),
    bound: f64,
) -> u64 {
    let FragmentScratch { fragments, held, held_of, line, .. } = scratch;
    let by_pixel = match scene.k_buffer.exact_order {
        true => fragments.by_pixel(|words, _| {
            sort_words(words);
        }),
        false => fragments.by_pixel(|_, _| ()),
    };
    let held_before = *held_of;
    lights.begin_round(paths);
    held.clear();
    for pixel in 0..PIXELS {
        if !by_pixel.range(pixel).is_empty() {
            let path = &mut paths[pixel];
            let staying = if let Some(leaving) = lights.advance_in_order(scene, by_pixel, pixel, (path, bound)) {
                line.clear();
                line.extend(by_pixel.some(leaving..by_pixel.range(pixel).end).map(Fragment::from));
                &line[..]
            } else {
                let leaving = in_order(scene, by_pixel, pixel, (held_before[pixel], bound), line);
                let (leaving, staying) = line.split_at(leaving);
                lights.advance(scene, rays, pixel, (path, leaving));
                staying
            };
            held_of[pixel] = staying.len() as u32;
            held.extend(staying.iter().map(|&fragment| (pixel as u8, fragment)));
        }
        lights.end(pixel);
    }
    let pieces = lights.end_round(scene, rays, pixels);
    for pixel in (0..PIXELS).filter(|_| scene.early_termination) {
        let to_opaque = lights.path_to_opaque(rays, pixel, scene.tie, || {
            let leaving = in_order(scene, by_pixel, pixel, (held_before[pixel], bound), line);
            &line[..leaving]
        });
        paths[pixel] = to_opaque.unwrap_or(paths[pixel]);
    }
    pieces
}

/// Keeps the fragments that are held back, of rays that go on, for the next round.
fn hold(scratch: &mut FragmentScratch, paths: &[Path; PIXELS]) {
    let FragmentScratch { fragments, held, .. } = scratch;
    fragments.clear();
    for (pixel, fragment) in held.iter().filter(|(pixel, _)| !paths[usize::from(*pixel)].is_opaque) {
        fragment.push_to(fragments, usize::from(*pixel));
    }
}

/// Draws pixels again whose order was wrong, and gives all that were drawn to the image.
#[inline(always)]
fn finish<M: Medium<Light = Accumulator>, Y: Layers>(
    scene: &Scene<'_, M, Y>,
    tile: usize,
    (rays, part): (&mut TileRays, &TileBits),
    (paths, lights): (&mut [Path; PIXELS], Lights<'_, M::Ray, Y::Ahead<'_>>),
    (scratch, pixels): (&mut FragmentScratch, &mut [TilePixel]),
    stats: &mut FrameStats,
) {
    let again = of_pixels(|pixel| {
        let path = &paths[pixel];
        let is_in_order = path.out_of_order == 0 && (path.is_whole() || !scene.is_complete);
        scene.k_buffer.exact_order && has(part, pixel) && !is_in_order
    });
    each(part, |pixel| {
        stats.out_of_order += u64::from(paths[pixel].out_of_order);
        stats.segments += lights.give(rays, pixel, pixels);
    });
    if again != TileBits::default() {
        stats.pixels_resolved_again += count_of(&again) as u64;
        stats.segments += resolve_again(scene, tile, (rays, &again), scratch, (paths, pixels));
    }
    each(part, |pixel| {
        stats.rays_stopped_early += u64::from(paths[pixel].is_opaque);
        stats.rays_hit += u64::from(paths[pixel].last.depth > f64::NEG_INFINITY);
    });
}

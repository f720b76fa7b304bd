//! The walk of eight rays side by side, one in each lane of a vector.
//!
//! ```text
//! while there are rays
//!     while there is room for a row, of few where rays have become opaque
//!         each lane walks through one cell of its own: new vertex, edge functions, exit, (depth, scalar) there
//!         the segments of the lanes are a row
//!         a lane at the end of a path goes to the next one; at the end of its ray the next ray of the tile takes it
//!     the rows are composited
//! ```
//!
//! Functions on vectors are inlined by attribute, closures are not: the remaining ones stand outside of the loops. A function
//! that is not inlined is compiled without the processor's instructions.
//!
//! Every operation is one of the scalar walk's, on the same numbers in the same order, so that the image is bit-identical. Differences:
//! 1. Decisions are masks that select; only uncertain signs are decided lane by lane, by the scalar walk's function.
//! 2. Light is separate from geometry, so that neither waits for the other: [`exact`] composites the segments of eight rays side by
//!    side, [`each`] one after the other for other media.
//! 3. A ray that becomes opaque has advanced some rows too far. They are neither composited nor counted as steps.

mod each;
mod exact;
mod rows;
mod vector;

use super::super::super::medium::{Medium, RayLine};
use super::super::ray::{Crossing, Ray, Sheared, ViewVertex};
use super::super::tiles::{PixelRect, TilePixel};
use super::path;
use super::starts::PixelStart;
use super::walk::{Scene, careful_signs};
use crate::optics::Accumulator;
use crate::slowdown::{Slow, waste};
use crate::stats::FrameStats;
use each::EachLight;
use exact::{ExactLights, Optics};
use pulp::{NullaryFnOnce, cast};
use rows::{Lights, Out, RayEnd, Rows, RowsAhead};
use std::arch::x86_64::__m256i;

use vector::{Eight, LANES, Lanes};

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct LaneScratch {
    rows: Box<Rows>,
    /// Carried over between tiles, since neighbours are similar.
    ahead: RowsAhead,
}

/// Walks the rays of a tile.
pub(super) struct WalkRays<'a, M, L: Lanes> {
    pub(super) lanes: L,
    pub(super) scene: &'a Scene<'a, M>,
    pub(super) rect: PixelRect,
    /// Starts sorted by pixel and depth.
    pub(super) starts: &'a [PixelStart],
    pub(super) scratch: &'a mut LaneScratch,
    pub(super) pixels: &'a mut [TilePixel],
    pub(super) stats: &'a mut FrameStats,
}

impl<M: Medium<Light = Accumulator>, L: Lanes> NullaryFnOnce for WalkRays<'_, M, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, scene, rect, starts, scratch, pixels, stats } = self;
        let LaneScratch { rows, ahead } = scratch;
        let mut out = Out { pixels, stats, early_termination: scene.early_termination };
        let rays = Rays { scene, rect, rest: starts };
        match scene.medium.exact_table() {
            Some(table) => {
                let mut lights = ExactLights::new(Optics { lanes, table }, scene.view.near_depth());
                walk(lanes, scene, rays, (rows, ahead), &mut out, &mut lights);
            }
            None => {
                let mut lights = EachLight::new(scene.medium, scene.view.near_depth());
                walk(lanes, scene, rays, (rows, ahead), &mut out, &mut lights);
            }
        }
        waste(Slow::Walk, out.stats.steps as usize);
        waste(Slow::Lanes, out.stats.steps as usize);
        waste(Slow::OpaqueRays, out.stats.rays_stopped_early as usize);
    }
}

/// The rays of a tile still to be walked.
struct Rays<'a, M> {
    scene: &'a Scene<'a, M>,
    rect: PixelRect,
    rest: &'a [PixelStart],
}

/// State of a lane's ray outside [`Slots`].
#[derive(Clone, Copy)]
struct Lane<'a> {
    ray: Ray,
    pixel: usize,
    /// Starts of the paths still to be walked.
    starts: &'a [PixelStart],
}

impl<'a, M> Rays<'a, M> {
    /// The next ray, before its first path.
    fn next(&mut self) -> Option<Lane<'a>> {
        let pixel = self.rest.first()?.0;
        let count = self.rest.iter().take_while(|start| start.0 == pixel).count();
        let (starts, rest) = self.rest.split_at(count);
        self.rest = rest;
        let pixel = pixel as usize;
        let ray = self.scene.plane.ray(self.rect, pixel);
        Some(Lane { ray, pixel, starts })
    }
}

/// The positions of eight rays: for each the face through which it enters its cell, as in the scalar walk.
#[repr(C, align(64))]
#[derive(Default)]
struct Slots {
    px: Eight,
    py: Eight,
    x: [Eight; 3],
    y: [Eight; 3],
    w: [Eight; 3],
    s: [Eight; 3],
    reach: [Eight; 3],
    edges: [Eight; 3],
    ids: [[u32; LANES]; 3],
    /// The cell and its vertex that is not on the face, as in [`CellNeighbour`](crate::mesh::CellNeighbour).
    at: [u32; LANES],
    /// Depth and scalar at the face.
    depth: Eight,
    scalar: Eight,
}

impl Slots {
    /// Moves a lane to the start of its ray's next path; false if there is none.
    fn next_path<M>(&mut self, scene: &Scene<'_, M>, l: usize, lane: &mut Lane<'_>) -> bool {
        let Some(((_, start), rest)) = lane.starts.split_first() else { return false };
        lane.starts = rest;
        let entry = path::enter(scene, &lane.ray, start.cell, start.opposite);
        debug_assert!(entry.is_some(), "a start is a crossing");
        let Some((ids, Crossing { corners, edges, point })) = entry else { return false };
        (self.px[l], self.py[l]) = (lane.ray.line.px, lane.ray.line.py);
        for (i, corner) in corners.iter().enumerate() {
            (self.x[i][l], self.y[i][l], self.w[i][l], self.s[i][l]) = (corner.x, corner.y, corner.w, corner.s);
            (self.reach[i][l], self.edges[i][l], self.ids[i][l]) = (corner.reach(), edges[i], ids[i]);
        }
        self.at[l] = start.cell << 2 | start.opposite;
        (self.depth[l], self.scalar[l]) = (point.depth, point.scalar);
        true
    }
}

/// [`Slots`] in registers.
#[derive(Clone, Copy)]
struct Place<L: Lanes> {
    px: L::F,
    py: L::F,
    x: [L::F; 3],
    y: [L::F; 3],
    w: [L::F; 3],
    s: [L::F; 3],
    reach: [L::F; 3],
    edges: [L::F; 3],
    ids: [__m256i; 3],
    at: __m256i,
    depth: L::F,
    scalar: L::F,
}

impl<L: Lanes> Place<L> {
    #[inline(always)]
    fn load(lanes: L, from: &Slots) -> Self {
        Self {
            px: lanes.load(&from.px),
            py: lanes.load(&from.py),
            x: load_three(lanes, &from.x),
            y: load_three(lanes, &from.y),
            w: load_three(lanes, &from.w),
            s: load_three(lanes, &from.s),
            reach: load_three(lanes, &from.reach),
            edges: load_three(lanes, &from.edges),
            ids: cast(from.ids),
            at: cast(from.at),
            depth: lanes.load(&from.depth),
            scalar: lanes.load(&from.scalar),
        }
    }

    #[inline(always)]
    fn store(&self, lanes: L, into: &mut Slots) {
        (into.x, into.y, into.w, into.s) = (
            store_three(lanes, &self.x),
            store_three(lanes, &self.y),
            store_three(lanes, &self.w),
            store_three(lanes, &self.s),
        );
        (into.reach, into.edges) = (store_three(lanes, &self.reach), store_three(lanes, &self.edges));
        (into.ids, into.at) = (cast(self.ids), cast(self.at));
        (into.depth, into.scalar) = (lanes.store(self.depth), lanes.store(self.scalar));
    }
}

#[inline(always)]
fn load_three<L: Lanes>(lanes: L, of: &[Eight; 3]) -> [L::F; 3] {
    [lanes.load(&of[0]), lanes.load(&of[1]), lanes.load(&of[2])]
}

#[inline(always)]
fn store_three<L: Lanes>(lanes: L, of: &[L::F; 3]) -> [Eight; 3] {
    [lanes.store(of[0]), lanes.store(of[1]), lanes.store(of[2])]
}

/// Gathers rows of a table.
#[inline(always)]
fn rows_at<T>(table: &[T], at: [u32; LANES]) -> [&T; LANES] {
    let [a, b, c, d, e, f, g, h] = at;
    [
        &table[a as usize],
        &table[b as usize],
        &table[c as usize],
        &table[d as usize],
        &table[e as usize],
        &table[f as usize],
        &table[g as usize],
        &table[h as usize],
    ]
}

/// Mesh data of the walk, as plain numbers.
struct Cells<'a> {
    tets: &'a [[u32; 4]],
    /// Vertices of the cells, cell by cell.
    vertex_of: &'a [u32],
    neighbours: &'a [[u32; 4]],
    /// x, y, w and s of each vertex.
    vertices: &'a [[f64; 4]],
    /// Bits of the active cells; `None` if all are active.
    active: Option<&'a [u64]>,
    perspective: bool,
    /// One scalar per cell, if the medium has these instead of those of vertices.
    scalars: Option<&'a [f32]>,
}

/// Outcome of a step.
struct Stepped {
    /// Bits of the lanes whose paths go on.
    goes_on: u8,
    /// Bits of the lanes in which signs contradicted each other.
    broken: u8,
}

#[inline(always)]
fn walk<'a, M: Medium, L: Lanes, K: Lights>(
    lanes: L,
    scene: &'a Scene<'a, M>,
    mut rays: Rays<'a, M>,
    (rows, ahead): (&mut Rows, &mut RowsAhead),
    out: &mut Out<'_>,
    lights: &mut K,
) {
    let topology = &scene.mesh.topology;
    let cells = Cells {
        tets: &topology.tets,
        vertex_of: topology.tets.as_flattened(),
        neighbours: bytemuck::cast_slice(&topology.neighbours),
        vertices: bytemuck::cast_slice(scene.vertices),
        active: (!scene.all_active).then(|| scene.active.words()),
        perspective: scene.view.perspective,
        scalars: scene.medium.cell_scalars(),
    };
    let most = rays.rest.len() * topology.tets.len();
    let mut slots = Slots::default();
    let mut own: [Option<Lane<'_>>; LANES] = [None; LANES];
    let mut alive = 0u8;
    // Lanes without a ray stay at the first face of the first cell.
    for (i, v) in crate::mesh::FACE_VERTICES[0].into_iter().enumerate() {
        slots.ids[i] = [topology.tets[0][v]; LANES];
    }
    for l in 0..LANES {
        if next_ray(scene, &mut rays, &mut slots, &mut own, l) {
            alive |= 1 << l;
            lights.begin(l, line_of(&own[l]));
        }
    }
    while alive != 0 {
        rows.count = 0;
        rows.ends.clear();
        let before = (out.stats.steps, out.stats.rays_stopped_early);
        while rows.count < ahead.count() && alive != 0 {
            let first = rows.count;
            let stepped = walk_on::<L, K>(lanes, &cells, &mut slots, (rows, ahead.count()), alive);
            out.stats.steps += (rows.count - first) as u64 * u64::from(alive.count_ones());
            debug_assert!(out.stats.steps <= most as u64, "a path goes through a cell once");
            let mut ended = alive & !stepped.goes_on;
            while ended != 0 {
                let l = ended.trailing_zeros() as usize;
                ended &= ended - 1;
                let Some(lane) = &mut own[l] else { continue };
                let is_broken = stepped.broken >> l & 1 == 1;
                if !is_broken && slots.next_path(scene, l, lane) {
                    continue;
                }
                let pixel = lane.pixel;
                if !next_ray(scene, &mut rays, &mut slots, &mut own, l) {
                    alive &= !(1 << l);
                }
                rows.ends.push(RayEnd { row: rows.count - 1, lane: l, pixel, line: line_of(&own[l]) });
            }
        }
        let walked = out.stats.steps;
        lights.composite(rows, out);
        if !scene.early_termination {
            *ahead = RowsAhead::all();
            continue;
        }
        ahead.learn(walked - before.0, walked - out.stats.steps, out.stats.rays_stopped_early - before.1);
        let mut opaque = alive & lights.opaque();
        while opaque != 0 {
            let l = opaque.trailing_zeros() as usize;
            opaque &= opaque - 1;
            if let Some(lane) = own[l] {
                lights.finish(l, out, lane.pixel);
            }
            if !next_ray(scene, &mut rays, &mut slots, &mut own, l) {
                alive &= !(1 << l);
            }
            lights.begin(l, line_of(&own[l]));
        }
    }
}

/// The line of the ray in a lane, if there is one.
#[inline(always)]
fn line_of(lane: &Option<Lane<'_>>) -> RayLine {
    lane.map_or_else(RayLine::default, |lane| lane.ray.line)
}

/// Assigns the next ray of the tile to a lane; false if there is none.
#[inline(never)]
fn next_ray<'a, M>(
    scene: &Scene<'_, M>,
    rays: &mut Rays<'a, M>,
    slots: &mut Slots,
    own: &mut [Option<Lane<'a>>; LANES],
    l: usize,
) -> bool {
    own[l] = rays.next();
    own[l].as_mut().is_some_and(|lane| slots.next_path(scene, l, lane))
}

/// Walks until a path ends or there are `most` rows, at least one row.
#[inline(always)]
fn walk_on<L: Lanes, K: Lights>(
    lanes: L,
    cells: &Cells<'_>,
    slots: &mut Slots,
    (rows, most): (&mut Rows, usize),
    alive: u8,
) -> Stepped {
    let mut place = Place::load(lanes, slots);
    let stepped = loop {
        let row = rows.count % rows::ROWS;
        rows.from_depth[row] = lanes.store(place.depth);
        if K::CELLS {
            rows.cell[row] = cast(place.at);
        }
        rows.from_scalar[row] = match cells.scalars {
            None => lanes.store(place.scalar),
            Some(scalars) => scalars_of(scalars, cast(place.at)),
        };
        let stepped = step(lanes, cells, &mut place, alive);
        rows.to_depth[row] = lanes.store(place.depth);
        rows.to_scalar[row] = match cells.scalars {
            None => lanes.store(place.scalar),
            Some(_) => rows.from_scalar[row],
        };
        rows.alive[row] = alive;
        rows.count = row + 1;
        if alive & !stepped.goes_on != 0 || rows.count >= most {
            break stepped;
        }
    };
    place.store(lanes, slots);
    stepped
}

/// The scalars of cells, given as in [`CellNeighbour`](crate::mesh::CellNeighbour).
#[inline(always)]
fn scalars_of(scalars: &[f32], at: [u32; LANES]) -> Eight {
    let [a, b, c, d, e, f, g, h] = at;
    let of = |at: u32| f64::from(scalars[at as usize >> 2]);
    [of(a), of(b), of(c), of(d), of(e), of(f), of(g), of(h)]
}

/// Walks each lane through one cell.
#[inline(always)]
fn step<L: Lanes>(lanes: L, cells: &Cells<'_>, place: &mut Place<L>, alive: u8) -> Stepped {
    let at: [u32; LANES] = cast(place.at);
    let [a, b, c, d, e, f, g, h] = rows_at(cells.vertex_of, at);
    let new_ids = [*a, *b, *c, *d, *e, *f, *g, *h];
    let [nx, ny, nw, ns] = lanes.transpose(rows_at(cells.vertices, new_ids));
    let h = if cells.perspective { nw } else { lanes.splat(1.0) };
    let (nx, ny) = (lanes.sub(nx, lanes.mul(place.px, h)), lanes.sub(ny, lanes.mul(place.py, h)));
    let reach = lanes.add(lanes.abs(nx), lanes.abs(ny));
    let mut to = [nx; 3];
    for (i, to) in to.iter_mut().enumerate() {
        *to = lanes.sub(lanes.mul(nx, place.y[i]), lanes.mul(place.x[i], ny));
    }
    let zero = lanes.splat(0.0);
    let mut positive = [lanes.lt(zero, to[0]), lanes.lt(zero, to[1]), lanes.lt(zero, to[2])];
    let least = lanes.less(lanes.less(lanes.abs(to[0]), lanes.abs(to[1])), lanes.abs(to[2]));
    let reaches = lanes.add(lanes.add(place.reach[0], place.reach[1]), place.reach[2]);
    let is_sure = lanes.bits(lanes.lt(uncertainty(lanes, reach, reaches), least));
    if alive & !is_sure != 0 {
        let new = NewVertices { x: lanes.store(nx), y: lanes.store(ny), ids: new_ids };
        let [b0, b1, b2] = positive;
        let positive_bits = [lanes.bits(b0), lanes.bits(b1), lanes.bits(b2)];
        let mut careful = Careful { to: store_three(lanes, &to), positive: positive_bits };
        let (x, y) = (store_three(lanes, &place.x), store_three(lanes, &place.y));
        careful.refine(alive & !is_sure, &new, &x, &y, &cast(place.ids));
        to = load_three(lanes, &careful.to);
        let [b0, b1, b2] = careful.positive;
        positive = [lanes.mask(b0), lanes.mask(b1), lanes.mask(b2)];
    }
    let [b0, b1, b2] = positive;
    // As in REPLACED: the corner that the new vertex replaces.
    let k = [lanes.and_not(b1, b2), lanes.and_not(b2, b0)];
    let k2 = lanes.and_not(b0, b1);
    let broken = alive & !(lanes.bits(k[0]) | lanes.bits(k[1]) | lanes.bits(k2));
    debug_assert!(broken == 0, "signs of edge functions are exact");

    let gone = lanes.select3_u32(k, place.ids);
    let edges = [
        lanes.neg(lanes.select3(k, [to[2], to[0], to[1]])),
        lanes.select3(k, [to[1], to[2], to[0]]),
        lanes.select3(k, place.edges),
    ];
    place.x = turned(lanes, k, &place.x, nx);
    place.y = turned(lanes, k, &place.y, ny);
    place.w = turned(lanes, k, &place.w, nw);
    place.s = turned(lanes, k, &place.s, ns);
    place.reach = turned(lanes, k, &place.reach, reach);
    place.edges = edges;
    let [a, b, c] = place.ids;
    let ids = [lanes.select3_u32(k, [b, c, a]), lanes.select3_u32(k, [c, a, b]), cast(new_ids)];
    // Lanes without a ray stay in place.
    let is_alive = lanes.mask(alive);
    for (id, to) in place.ids.iter_mut().zip(ids) {
        *id = lanes.select_u32(is_alive, to, *id);
    }
    let mut cell = at;
    cell.iter_mut().for_each(|cell| *cell >>= 2);
    let across = lanes.across(rows_at(cells.tets, cell), rows_at(cells.neighbours, cell), gone);
    let goes_on = alive & !broken & is_active(cells, cast(across));
    place.at = lanes.select_u32(lanes.mask(goes_on), across, place.at);
    (place.depth, place.scalar) = hit(lanes, edges, &place.w, &place.s);
    Stepped { goes_on, broken }
}

/// The corners of triangles after a new vertex replaces one; the new vertex is the last.
#[inline(always)]
fn turned<L: Lanes>(lanes: L, k: [L::M; 2], of: &[L::F; 3], new: L::F) -> [L::F; 3] {
    [lanes.select3(k, [of[1], of[2], of[0]]), lanes.select3(k, [of[2], of[0], of[1]]), new]
}

/// Bits of the lanes whose neighbours are active cells.
#[inline(always)]
fn is_active(cells: &Cells<'_>, neighbours: [u32; LANES]) -> u8 {
    let mut bits = 0;
    for (l, neighbour) in neighbours.into_iter().enumerate() {
        let is_active = match cells.active {
            None => neighbour != u32::MAX,
            Some(words) => {
                let word = words.get(neighbour as usize >> 8).copied().unwrap_or(0);
                neighbour != u32::MAX && word >> (neighbour >> 2 & 63) & 1 == 1
            }
        };
        bits |= u8::from(is_active) << l;
    }
    bits
}

/// As the scalar [`uncertainty`](super::super::ray::uncertainty).
#[inline(always)]
fn uncertainty<L: Lanes>(lanes: L, reach_a: L::F, reach_b: L::F) -> L::F {
    const CAREFUL: f64 = 1.0 / (1u64 << 30) as f64;
    lanes.add(lanes.mul(lanes.mul(lanes.splat(CAREFUL), reach_a), reach_b), lanes.splat(f64::MIN_POSITIVE))
}

/// Depth and scalar, as by the scalar [`hit`](super::super::ray::hit).
#[inline(always)]
fn hit<L: Lanes>(lanes: L, e: [L::F; 3], w: &[L::F; 3], s: &[L::F; 3]) -> (L::F, L::F) {
    let (zero, one) = (lanes.splat(0.0), lanes.splat(1.0));
    let [a, b, c] = [lanes.greater(e[0], zero), lanes.greater(e[1], zero), lanes.greater(e[2], zero)];
    let sum = lanes.add(lanes.add(a, b), c);
    let is_more = lanes.lt(zero, sum);
    let per_sum = lanes.select(is_more, lanes.div(one, sum), lanes.splat(1.0 / 3.0));
    let [a, b, c] = [lanes.select(is_more, a, one), lanes.select(is_more, b, one), lanes.select(is_more, c, one)];
    let [a, b, c] = [lanes.mul(a, per_sum), lanes.mul(b, per_sum), lanes.mul(c, per_sum)];
    let depth = lanes.add(lanes.add(lanes.mul(a, w[0]), lanes.mul(b, w[1])), lanes.mul(c, w[2]));
    let rise = [lanes.mul(b, lanes.sub(s[1], s[0])), lanes.mul(c, lanes.sub(s[2], s[0]))];
    let scalar = lanes.add(lanes.add(s[0], rise[0]), rise[1]);
    let lo = lanes.less(lanes.less(s[0], s[1]), s[2]);
    let hi = lanes.greater(lanes.greater(s[0], s[1]), s[2]);
    (depth, lanes.less(lanes.greater(scalar, lo), hi))
}

struct NewVertices {
    x: Eight,
    y: Eight,
    ids: [u32; LANES],
}

/// Edge functions from the new vertices to the corners, and bits of the lanes in which they are positive.
struct Careful {
    to: [Eight; 3],
    positive: [u8; 3],
}

impl Careful {
    /// Recomputes doubtful lanes exactly.
    #[cold]
    #[inline(never)]
    fn refine(&mut self, mut doubtful: u8, new: &NewVertices, x: &[Eight; 3], y: &[Eight; 3], ids: &[[u32; LANES]; 3]) {
        while doubtful != 0 {
            let l = doubtful.trailing_zeros() as usize;
            doubtful &= doubtful - 1;
            // Depth and scalar do not matter here.
            let planar = |x: f64, y: f64| Sheared { x, y, w: 0.0, s: 0.0 };
            let corners = [0, 1, 2].map(|i| planar(x[i][l], y[i][l]));
            let mut to = [0.0; 3];
            let new_vertex = planar(new.x[l], new.y[l]);
            let signs = careful_signs(&mut to, &new_vertex, new.ids[l], &corners, &ids.map(|ids| ids[l]));
            for (i, to) in to.into_iter().enumerate() {
                self.to[i][l] = to;
                let bit = u8::from(signs >> i & 1 == 1) << l;
                self.positive[i] = self.positive[i] & !(1 << l) | bit;
            }
        }
    }
}

const _: () = assert!(size_of::<ViewVertex>() == size_of::<[f64; 4]>());

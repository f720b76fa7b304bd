//! The walk of eight rays side by side, one in each lane of a vector ([`lanes`](super::super::lanes)).
//!
//! ```text
//! while there is room for a row
//!     each lane walks through one cell of its own: new vertex, edge functions, exit, (depth, scalar) there
//!     the segments of the lanes are a row
//!     a lane at the end of a path goes to the next one; at the end of its ray the next ray of the tile takes it
//! ```
//!
//! Functions on vectors are inlined by attribute, closures are not: the remaining ones stand outside of the loops. A function
//! that is not inlined is compiled without the processor's instructions.
//!
//! Every operation is one of the scalar walk's, on the same numbers in the same order, so that the image is bit-identical. Differences:
//! 1. Decisions are masks that select; only uncertain signs are decided lane by lane, by the scalar walk's function.
//! 2. Light is separate from geometry, so that neither waits for the other: [`exact`](super::super::lanes::exact) composites the segments of eight rays
//!    side by side, [`each`] one after the other for other media.
//! 3. A ray that becomes opaque has advanced some rows too far. They are neither composited nor counted as steps.

mod each;
mod entering;
mod step;

use super::super::super::layers::Layers;
use super::super::super::medium::{Medium, RayLine};
use super::super::lanes::cut::CutLights;
use super::super::lanes::exact::{ExactLights, Optics};
use super::super::lanes::rows::{self, Lights, Out, RayEnd, Rows, RowsAhead};
use super::super::lanes::vector::{Eight, LANES, Lanes};
use super::super::lanes::{Rays, composite};
use super::super::tiles::{PixelRect, TilePixel};
use super::starts::PixelStart;
use super::walk::Scene;
use crate::optics::Accumulator;
use crate::slowdown::{Slow, waste};
use crate::stats::FrameStats;
use each::EachLight;
use entering::Entered;
use pulp::{NullaryFnOnce, cast};
use std::arch::x86_64::__m256i;
use std::ops::Range;
use step::{Cells, Stepped, load_three, step, store_three};

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct LaneScratch {
    rows: Box<Rows>,
    /// Rows that have been cut at fragments of other layers.
    cut: Box<Rows>,
    entered: Entered,
    /// Carried over between tiles, since neighbours are similar.
    ahead: RowsAhead,
}

/// Walks the rays of a tile.
pub(super) struct WalkRays<'a, M, L: Lanes, Y> {
    pub(super) lanes: L,
    pub(super) scene: &'a Scene<'a, M>,
    pub(super) layers: &'a Y,
    pub(super) rect: PixelRect,
    /// Starts sorted by pixel and depth.
    pub(super) starts: &'a [PixelStart],
    pub(super) scratch: &'a mut LaneScratch,
    pub(super) pixels: &'a mut [TilePixel],
    pub(super) stats: &'a mut FrameStats,
}

impl<M: Medium<Light = Accumulator>, L: Lanes, Y: Layers> NullaryFnOnce for WalkRays<'_, M, L, Y> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, scene, layers, rect, starts, scratch, pixels, stats } = self;
        let LaneScratch { rows, cut, entered, ahead } = scratch;
        entered.clear();
        let mut out = Out { pixels, unfinished: None, stats, early_termination: scene.early_termination };
        let mut walk = Walk::new(lanes, scene, Starts { scene, rect, starts, next: 0, entered });
        let near_distance = scene.view.near_depth();
        let fragments_of = |pixel: usize| {
            let (column, row) = scene.plane.pixel(rect, pixel);
            layers.ahead(column, row)
        };
        match scene.medium.exact_table() {
            Some(table) => {
                let mut lights = ExactLights::new(Optics { lanes, table }, near_distance);
                if Y::ANY {
                    let mut lights = CutLights::new(lanes, lights, cut, fragments_of);
                    composite(&mut walk, (rows, ahead), &mut out, &mut lights);
                } else {
                    composite(&mut walk, (rows, ahead), &mut out, &mut lights);
                }
            }
            None => {
                let mut lights = EachLight::new(scene.medium, near_distance, fragments_of);
                composite(&mut walk, (rows, ahead), &mut out, &mut lights);
            }
        }
        waste(Slow::Walk, out.stats.steps as usize);
        waste(Slow::Lanes, out.stats.steps as usize);
        waste(Slow::OpaqueRays, out.stats.rays_stopped_early as usize);
    }
}

/// The rays of a tile still to be walked.
struct Starts<'a, M> {
    scene: &'a Scene<'a, M>,
    rect: PixelRect,
    starts: &'a [PixelStart],
    /// The first start of the next ray.
    next: usize,
    entered: &'a mut Entered,
}

/// State of a lane's ray outside [`Slots`].
#[derive(Clone)]
struct Lane {
    line: RayLine,
    pixel: usize,
    /// Starts of the paths still to be walked.
    starts: Range<usize>,
}

impl<M> Starts<'_, M> {
    /// The next ray, before its first path.
    fn next(&mut self) -> Option<Lane> {
        let (rest, first) = (self.starts.get(self.next..)?, self.next);
        let pixel = rest.first()?.0;
        self.next += rest.iter().take_while(|start| start.0 == pixel).count();
        let pixel = pixel as usize;
        let line = self.scene.plane.ray(self.rect, pixel).line;
        Some(Lane { line, pixel, starts: first..self.next })
    }

    /// Moves a lane to the start of its ray's next path; false if there is none.
    fn next_path<L: Lanes>(&mut self, lanes: L, slots: &mut Slots, l: usize, lane: &mut Lane) -> bool {
        let Some(start) = lane.starts.next() else { return false };
        let entry = self.entered.of(lanes, self.scene, self.rect, self.starts, start);
        debug_assert!(entry.is_some(), "a start is a crossing");
        let Some((entry, from)) = entry else { return false };
        slots.go_to(l, entry, from);
        true
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
    /// Moves a lane to an entry.
    #[inline(always)]
    fn go_to(&mut self, l: usize, entry: &Slots, from: usize) {
        (self.px[l], self.py[l]) = (entry.px[from], entry.py[from]);
        for i in 0..3 {
            (self.x[i][l], self.y[i][l]) = (entry.x[i][from], entry.y[i][from]);
            (self.w[i][l], self.s[i][l]) = (entry.w[i][from], entry.s[i][from]);
            (self.reach[i][l], self.edges[i][l]) = (entry.reach[i][from], entry.edges[i][from]);
            self.ids[i][l] = entry.ids[i][from];
        }
        self.at[l] = entry.at[from];
        (self.depth[l], self.scalar[l]) = (entry.depth[from], entry.scalar[from]);
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

/// The walk of eight rays.
struct Walk<'a, M, L> {
    lanes: L,
    cells: Cells<'a>,
    starts: Starts<'a, M>,
    slots: Slots,
    own: [Option<Lane>; LANES],
    /// Most steps of the tile's rays.
    most: usize,
}

impl<'a, M: Medium, L: Lanes> Walk<'a, M, L> {
    #[inline(always)]
    fn new(lanes: L, scene: &Scene<'a, M>, starts: Starts<'a, M>) -> Self {
        let topology = &scene.mesh.topology;
        let cells = Cells {
            tets: &topology.tets,
            vertex_of: topology.tets.as_flattened(),
            neighbours: bytemuck::cast_slice(scene.neighbours),
            vertices: bytemuck::cast_slice(scene.vertices),
            active: (!scene.all_active).then(|| scene.active.words()),
            perspective: scene.view.perspective,
            scalars: scene.medium.cell_scalars(),
        };
        let most = starts.starts.len() * topology.tets.len();
        let mut slots = Slots::default();
        // Lanes without a ray stay at the first face of the first cell.
        for (i, v) in crate::mesh::FACE_VERTICES[0].into_iter().enumerate() {
            slots.ids[i] = [topology.tets[0][v]; LANES];
        }
        Self { lanes, cells, starts, slots, own: [const { None }; LANES], most }
    }
}

impl<M: Medium, L: Lanes> Rays for Walk<'_, M, L> {
    #[inline(never)]
    fn next(&mut self, lane: usize) -> Option<RayLine> {
        let Self { lanes, starts, slots, own, .. } = self;
        let ray = &mut own[lane];
        *ray = starts.next();
        ray.as_mut().and_then(|ray| starts.next_path(*lanes, slots, lane, ray).then_some(ray.line))
    }

    #[inline(always)]
    fn pixel(&self, lane: usize) -> Option<usize> {
        self.own[lane].as_ref().map(|ray| ray.pixel)
    }

    #[inline(always)]
    fn go_on<K: Lights>(&mut self, rows: &mut Rows, most: usize, alive: &mut u8, out: &mut Out<'_>) {
        while rows.count < most && *alive != 0 {
            let first = rows.count;
            let stepped = walk_on::<L, K>(self.lanes, &self.cells, &mut self.slots, (rows, most), *alive);
            out.stats.steps += (rows.count - first) as u64 * u64::from(alive.count_ones());
            debug_assert!(out.stats.steps <= self.most as u64, "a path goes through a cell once");
            let mut ended = *alive & !stepped.goes_on;
            while ended != 0 {
                let l = ended.trailing_zeros() as usize;
                ended &= ended - 1;
                let Some(lane) = &mut self.own[l] else { continue };
                let is_broken = stepped.broken >> l & 1 == 1;
                if !is_broken && self.starts.next_path(self.lanes, &mut self.slots, l, lane) {
                    continue;
                }
                let pixel = lane.pixel;
                let next = self.next(l);
                if next.is_none() {
                    *alive &= !(1 << l);
                }
                let (line, next) = (next.unwrap_or_default(), self.pixel(l));
                rows.ends.push(RayEnd { row: rows.count - 1, lane: l, pixel, line, next });
            }
        }
    }
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

/// An entry: ids of the corners, cell and vertex, and the bits of corners, edge functions, depth and scalar.
#[cfg(test)]
pub(super) type EntryBits = ([u32; 3], u32, Vec<u64>);

/// The entries of the starts of a tile by the vectors of this processor; `None` where the ray misses the face. Empty if it has no vectors.
#[cfg(test)]
pub(super) fn entries_of<M>(scene: &Scene<'_, M>, rect: PixelRect, starts: &[PixelStart]) -> Vec<Option<EntryBits>> {
    fn all<M, L: Lanes>(
        lanes: L,
        scene: &Scene<'_, M>,
        rect: PixelRect,
        starts: &[PixelStart],
    ) -> Vec<Option<EntryBits>> {
        let mut entered = Entered::default();
        let mut bits_of = |at: usize| {
            let (entry, l) = entered.of(lanes, scene, rect, starts, at)?;
            let Slots { x, y, w, s, reach, edges, .. } = entry;
            let of_corners = [x, y, w, s, reach, edges].into_iter().flatten();
            let numbers = of_corners.chain([&entry.px, &entry.py, &entry.depth, &entry.scalar]);
            Some((entry.ids.map(|ids| ids[l]), entry.at[l], numbers.map(|of| of[l].to_bits()).collect()))
        };
        // The last ones first, and all once more, so that blocks are computed again.
        let _ = (0..starts.len()).rev().map(&mut bits_of).count();
        (0..starts.len()).map(bits_of).collect()
    }
    match pulp::Arch::new() {
        pulp::Arch::V4(lanes) => all(lanes, scene, rect, starts),
        pulp::Arch::V3(lanes) => all(lanes, scene, rect, starts),
        _ => Vec::new(),
    }
}

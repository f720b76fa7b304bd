//! From an entry through the active cells to the exit.

use super::super::super::JointScene;
use super::super::ray::{Crossing, Ray, Sheared, ViewVertex, edge, hit, signed_edge, uncertainty};
use super::super::tiles::{PixelRect, TilePixel};
#[cfg(target_arch = "x86_64")]
use super::lanes::{LaneScratch, WalkRays};
use super::light::RayLight;
use super::path::{self, REPLACED, TURNED};
use super::starts::{Entries, PixelStart, StartScratch};
use crate::camera::View;
use crate::mesh::Mesh;
use crate::optics::Integrator;
use crate::slowdown::{Slow, waste};
use crate::stats::FrameStats;
use crate::visibility::CellSet;
use pulp::Arch;

/// What all tiles of a frame read.
pub(super) struct Scene<'a, I> {
    pub(super) mesh: &'a Mesh,
    pub(super) active: &'a CellSet,
    pub(super) all_active: bool,
    pub(super) view: &'a View,
    pub(super) table: &'a I,
    /// The transfer function in place of `table`, if it is of more than the scalar.
    pub(super) grid: Option<&'a JointScene>,
    pub(super) vertices: &'a [ViewVertex],
    pub(super) scalars: &'a [f32],
    pub(super) entries: Entries<'a>,
    pub(super) early_termination: bool,
}

impl<I> Scene<'_, I> {
    /// Depth before which rays see nothing.
    pub(super) fn near_distance(&self) -> f64 {
        if self.view.perspective { self.view.near.max(0.0) } else { f64::NEG_INFINITY }
    }
}

/// Buffers of a tile, used again from tile to tile.
#[derive(Default)]
pub(super) struct TileScratch {
    starts: StartScratch,
    #[cfg(target_arch = "x86_64")]
    lanes: LaneScratch,
}

/// Renders one tile into the first pixels of `pixels`, row by row; returns what it cost. Not `portable`: with the widest
/// vectors that this processor has.
pub(super) fn render_tile<I: Integrator>(
    portable: bool,
    scene: &Scene<'_, I>,
    tile: usize,
    scratch: &mut TileScratch,
    pixels: &mut [TilePixel],
) -> FrameStats {
    let rect = scene.entries.bins.grid.rect(tile);
    pixels.fill(TilePixel::CLEAR);
    let starts = scene.entries.starts(tile, &mut scratch.starts);
    let mut stats = FrameStats { entries: starts.len() as u64, ..FrameStats::default() };
    if starts.is_empty() {
        return stats;
    }
    if scene.grid.is_some() {
        walk_one_by_one::<I, true>(scene, rect, starts, pixels, &mut stats);
        return stats;
    }
    match if portable { Arch::Scalar } else { Arch::new() } {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(lanes) => {
            lanes.vectorize(WalkRays {
                lanes,
                scene,
                rect,
                starts,
                scratch: &mut scratch.lanes,
                pixels,
                stats: &mut stats,
            });
        }
        #[cfg(target_arch = "x86_64")]
        Arch::V3(lanes) => {
            lanes.vectorize(WalkRays {
                lanes,
                scene,
                rect,
                starts,
                scratch: &mut scratch.lanes,
                pixels,
                stats: &mut stats,
            });
        }
        _ => walk_one_by_one::<I, false>(scene, rect, starts, pixels, &mut stats),
    }
    stats
}

/// Walks the rays of a tile, one after the other; `IN_GRID` if the scene has one.
fn walk_one_by_one<I: Integrator, const IN_GRID: bool>(
    scene: &Scene<'_, I>,
    rect: PixelRect,
    starts: &[PixelStart],
    pixels: &mut [TilePixel],
    stats: &mut FrameStats,
) {
    for starts in starts.chunk_by(|a, b| a.0 == b.0) {
        let pixel = starts[0].0 as usize;
        let ray = Ray::of_pixel(scene.view, rect.x + pixel % rect.width, rect.y + pixel / rect.width);
        let mut walk = Walk::new(scene, ray, starts);
        let most = starts.len() * scene.mesh.topology.tets.len();
        while walk.step::<IN_GRID>(scene) {
            debug_assert!(walk.steps as usize <= most, "a path goes through a cell once");
        }
        pixels[pixel] = walk.light.pixel();
        walk.count(stats);
    }
    waste(Slow::WalkPortable, stats.steps as usize);
}

/// A ray on its way: which path, which cell, and what it has gathered.
struct Walk<'a, I: Integrator> {
    ray: Ray,
    /// Starts of the paths still to be walked.
    starts: &'a [PixelStart],
    cell: u32,
    /// The vertex of the cell (0..4) that is not on the face through which the ray enters it.
    opposite: u32,
    /// The face through which the ray enters the cell, counter-clockwise, and its edge functions.
    corners: [Sheared; 3],
    reaches: [f64; 3],
    ids: [u32; 3],
    edges: [f64; 3],
    /// Depth and scalar where it does.
    last: (f64, f64),
    /// The quantity of vertices there, in a grid.
    last_value: f64,
    light: RayLight<I::Place>,
    steps: u32,
    stopped_early: bool,
}

impl<'a, I: Integrator> Walk<'a, I> {
    /// A ray at its first start (there is one).
    fn new(scene: &Scene<'_, I>, ray: Ray, starts: &'a [PixelStart]) -> Self {
        let mut walk = Self {
            ray,
            starts,
            cell: 0,
            opposite: 0,
            corners: [Sheared::default(); 3],
            reaches: [0.0; 3],
            ids: [0; 3],
            edges: [0.0; 3],
            last: (0.0, 0.0),
            last_value: 0.0,
            light: RayLight::new(scene.near_distance()),
            steps: 0,
            stopped_early: false,
        };
        walk.next_path(scene);
        walk
    }

    /// Adds what the ray has cost.
    fn count(&self, stats: &mut FrameStats) {
        stats.steps += u64::from(self.steps);
        stats.rays_hit += 1;
        stats.rays_stopped_early += u64::from(self.stopped_early);
        self.light.count(stats);
    }

    /// Goes to the start of the next path, if there is one.
    fn next_path(&mut self, scene: &Scene<'_, I>) -> bool {
        let Some(((_, start), rest)) = self.starts.split_first() else { return false };
        self.starts = rest;
        (self.cell, self.opposite) = (start.cell, start.opposite);
        let entry = path::enter(scene, &self.ray, start.cell, start.opposite);
        debug_assert!(entry.is_some(), "a start is a crossing");
        let Some((ids, Crossing { corners, edges, depth, scalar })) = entry else { return false };
        (self.ids, self.corners, self.edges, self.last) = (ids, corners, edges, (depth, scalar));
        self.reaches = corners.map(|c| c.reach());
        self.last_value = scene.grid.map_or(0.0, |grid| grid.on_face(ids, edges));
        self.light.leave();
        true
    }

    /// Walks through one cell; false at the end of the ray.
    #[inline(always)]
    fn step<const IN_GRID: bool>(&mut self, scene: &Scene<'_, I>) -> bool {
        self.steps += 1;
        let topology = &scene.mesh.topology;
        let tet = &topology.tets[self.cell as usize];
        let new_id = tet[self.opposite as usize & 3];
        let new = self.ray.shear(&scene.vertices[new_id as usize]);
        let reach = new.reach();
        // Spelled out rather than mapped: this is the innermost loop.
        let [p, q, r] = &self.corners;
        let mut to = [edge(&new, p), edge(&new, q), edge(&new, r)];
        let least = to[0].abs().min(to[1].abs()).min(to[2].abs());
        let signs = if least > uncertainty(reach, self.reaches[0] + self.reaches[1] + self.reaches[2]) {
            usize::from(to[0] > 0.0) | usize::from(to[1] > 0.0) << 1 | usize::from(to[2] > 0.0) << 2
        } else {
            careful_signs(&mut to, &new, new_id, &self.corners, &self.ids)
        };
        let k = REPLACED[signs] as usize;
        if k == 3 {
            debug_assert!(false, "signs of edge functions are exact");
            return false;
        }
        let gone = self.ids[k];
        let exit = usize::from(tet[1] == gone) + 2 * usize::from(tet[2] == gone) + 3 * usize::from(tet[3] == gone);
        // The triangle turns so that the new vertex comes last: corners move, none is written in place.
        let (next, after) = TURNED[k];
        let (p, q) = (self.corners[next], self.corners[after]);
        let edges = [-to[after], to[next], self.edges[k]];
        self.corners = [p, q, new];
        self.reaches = [self.reaches[next], self.reaches[after], reach];
        self.ids = [self.ids[next], self.ids[after], new_id];
        self.edges = edges;
        let neighbour = topology.neighbours[self.cell as usize][exit & 3];
        let here = hit(edges, &p, &q, &new);
        match scene.grid {
            Some(grid) if IN_GRID => self.go_on_in_grid(grid, scene.mesh.positions.scale, here),
            _ => self.light.go_on(scene.table, self.ray.length_per_depth, self.last, here),
        }
        self.last = here;
        if scene.early_termination && self.light.is_opaque() {
            self.stopped_early = true;
            return false;
        }
        match neighbour.cell() {
            Some(n) if scene.all_active || scene.active.contains(n) => {
                (self.cell, self.opposite) = (n, neighbour.opposite());
                true
            }
            _ => self.next_path(scene),
        }
    }
}

impl<I: Integrator> Walk<'_, I> {
    /// Composites the segment of the cell up to the place `here` on the face that the ray has come to; `scale` is the world length
    /// of a local one.
    #[inline(never)]
    fn go_on_in_grid(&mut self, grid: &JointScene, scale: f64, here: (f64, f64)) {
        let value = grid.on_face(self.ids, self.edges);
        let segment = grid.segment(self.cell, [self.last.1, here.1], [self.last_value, value]);
        self.light.go_on_in_grid(&segment, self.ray.length_per_depth * scale, self.last.0, here.0);
        self.last_value = value;
    }
}

/// The signs of the edge functions from a new vertex to the corners of a triangle as bits, where one is small; values are
/// refined.
#[cold]
#[inline(never)]
pub(super) fn careful_signs(
    to: &mut [f64; 3],
    new: &Sheared,
    new_id: u32,
    corners: &[Sheared; 3],
    ids: &[u32; 3],
) -> usize {
    let mut signs = 0;
    for (i, value) in to.iter_mut().enumerate() {
        let (refined, positive) = signed_edge(new, &corners[i], new_id, ids[i]);
        *value = refined;
        signs |= usize::from(positive) << i;
    }
    signs
}

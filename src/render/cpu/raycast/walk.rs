//! The cell walk: from an entry through the active cells to the exit.

use super::super::super::layers::{Ahead, Layers, NoLayers};
use super::super::super::medium::{Medium, RayPoint, Segment};
use super::super::light::RayLight;
use super::super::ray::{Crossing, Ray, Sheared, ViewVertex, edge, hit, signed_edge, uncertainty};
use super::super::tiles::{PixelRect, TILE_PX, TileBits, TilePixel};
use super::super::values::value_on_face;
#[cfg(target_arch = "x86_64")]
use super::lanes::{LaneScratch, WalkRays};
#[cfg(not(target_arch = "x86_64"))]
type LaneScratch = ();
use super::path::{self, REPLACED, TURNED};
use super::rays::RayPlane;
use super::starts::{Entries, PixelStart, StartScratch};
use crate::camera::View;
use crate::field::Scalars;
use crate::mesh::{CellNeighbour, Mesh};
use crate::optics::Accumulator;
use crate::slowdown::{Slow, waste};
use crate::stats::FrameStats;
use crate::visibility::CellSet;
use pulp::Arch;

/// Scene data shared by all tiles of a frame.
pub(super) struct Scene<'a, M> {
    pub(super) mesh: &'a Mesh,
    pub(super) neighbours: &'a [[CellNeighbour; 4]],
    pub(super) active: &'a CellSet,
    pub(super) all_active: bool,
    pub(super) view: &'a View,
    /// The rays that are cast.
    pub(super) plane: RayPlane<'a>,
    pub(super) medium: &'a M,
    pub(super) vertices: &'a [ViewVertex],
    pub(super) scalars: &'a Scalars,
    pub(super) entries: Entries<'a>,
    /// Entries into the domain of adaptive sampling, if it differs from the cells walked.
    pub(super) domain: Option<Entries<'a>>,
    pub(super) early_termination: bool,
}

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct TileScratch {
    starts: StartScratch,
    lanes: LaneScratch,
}

/// Renders one tile of rays into the first pixels of `pixels`, row by row; returns its statistics, and bits of the rays that met the
/// domain. Unless `portable`, uses the widest vectors of this processor.
pub(super) fn render_tile<M: Medium<Light = Accumulator>, L: Layers>(
    portable: bool,
    scene: &Scene<'_, M>,
    layers: &L,
    rect: PixelRect,
    scratch: &mut TileScratch,
    pixels: &mut [TilePixel],
) -> (FrameStats, TileBits) {
    pixels.fill(TilePixel::TRANSPARENT);
    let mut met = [0; TILE_PX];
    let mut meet = |starts: &[PixelStart]| {
        for &(place, _) in starts {
            met[place as usize / rect.width] |= 1 << (place as usize % rect.width);
        }
    };
    if let Some(domain) = &scene.domain {
        meet(domain.starts(&scene.plane, rect, &mut scratch.starts));
    }
    let starts = scene.entries.starts(&scene.plane, rect, &mut scratch.starts);
    if scene.domain.is_none() {
        meet(starts);
    }
    let stats = FrameStats { entries: starts.len() as u64, ..FrameStats::default() };
    (walk_from(portable, scene, layers, rect, starts, (&mut scratch.lanes, pixels, stats)), met)
}

/// Walks the rays of a tile from their starts.
fn walk_from<M: Medium<Light = Accumulator>, L: Layers>(
    portable: bool,
    scene: &Scene<'_, M>,
    layers: &L,
    rect: PixelRect,
    starts: &[PixelStart],
    (lane_scratch, pixels, mut stats): (&mut LaneScratch, &mut [TilePixel], FrameStats),
) -> FrameStats {
    let (columns, rows) = scene.plane.pixels_in(rect);
    let has_layers = layers.has_some_in(columns, rows);
    if has_layers {
        without_cells(scene, layers, rect, starts, pixels);
    }
    if starts.is_empty() {
        return stats;
    }
    if has_layers {
        walk_with(portable, scene, layers, rect, starts, (lane_scratch, pixels, &mut stats));
    } else {
        walk_with(portable, scene, &NoLayers, rect, starts, (lane_scratch, pixels, &mut stats));
    }
    stats
}

/// Walks the rays of a tile, side by side where that is possible.
fn walk_with<M: Medium<Light = Accumulator>, L: Layers>(
    portable: bool,
    scene: &Scene<'_, M>,
    layers: &L,
    rect: PixelRect,
    starts: &[PixelStart],
    (scratch, pixels, stats): (&mut LaneScratch, &mut [TilePixel], &mut FrameStats),
) {
    // A branch of its own, so that vectors are not compiled for such a medium.
    if M::HAS_VALUES {
        walk_one_by_one(scene, layers, rect, starts, pixels, stats);
        return;
    }
    match if portable { Arch::Scalar } else { Arch::new() } {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(lanes) => {
            lanes.vectorize(WalkRays { lanes, scene, layers, rect, starts, scratch, pixels, stats });
        }
        #[cfg(target_arch = "x86_64")]
        Arch::V3(lanes) => {
            lanes.vectorize(WalkRays { lanes, scene, layers, rect, starts, scratch, pixels, stats });
        }
        _ => walk_one_by_one(scene, layers, rect, starts, pixels, stats),
    }
}

/// Renders the rays of a tile that have no start: they meet no cell.
fn without_cells<M: Medium<Light = Accumulator>, L: Layers>(
    scene: &Scene<'_, M>,
    layers: &L,
    rect: PixelRect,
    starts: &[PixelStart],
    pixels: &mut [TilePixel],
) {
    let mut meets_cells = [false; TILE_PX * TILE_PX];
    starts.iter().for_each(|start| meets_cells[start.0 as usize] = true);
    let pixels = pixels.iter_mut().zip(meets_cells).enumerate().take(rect.width * rect.height);
    for (pixel, (out, _)) in pixels.filter(|(_, (_, meets_cells))| !meets_cells) {
        let (column, row) = scene.plane.pixel(rect, pixel);
        if scene.plane.renders(column, row) {
            *out = RayLight::<M::Ray, _>::new(scene.view.near_depth(), layers.ahead(column, row)).pixel();
        }
    }
}

/// Walks the rays of a tile one after the other.
fn walk_one_by_one<M: Medium<Light = Accumulator>, L: Layers>(
    scene: &Scene<'_, M>,
    layers: &L,
    rect: PixelRect,
    starts: &[PixelStart],
    pixels: &mut [TilePixel],
    stats: &mut FrameStats,
) {
    for starts in starts.chunk_by(|a, b| a.0 == b.0) {
        let pixel = starts[0].0 as usize;
        let (column, row) = scene.plane.pixel(rect, pixel);
        let ray = Ray::of_pixel(scene.view, column, row);
        let light = RayLight::new(scene.view.near_depth(), layers.ahead(column, row));
        let mut walk = Walk::new(scene, ray, light, starts);
        let most = starts.len() * scene.mesh.topology.tets.len();
        while walk.step(scene) {
            debug_assert!(walk.steps as usize <= most, "a path goes through a cell once");
        }
        pixels[pixel] = walk.light.pixel();
        walk.count(stats);
    }
    waste(Slow::WalkPortable, stats.steps as usize);
}

/// State of a ray: its path, cell and light.
struct Walk<'a, R, A> {
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
    /// Point of entry.
    last: RayPoint,
    /// Value at that point, if the medium has values.
    last_value: f64,
    light: RayLight<R, A>,
    steps: u32,
    stopped_early: bool,
}

impl<'a, R: Copy + Default, A: Ahead> Walk<'a, R, A> {
    /// A ray at its first start (there must be one).
    fn new<M: Medium<Ray = R, Light = Accumulator>>(
        scene: &Scene<'_, M>,
        ray: Ray,
        light: RayLight<R, A>,
        starts: &'a [PixelStart],
    ) -> Self {
        let mut walk = Self {
            ray,
            starts,
            cell: 0,
            opposite: 0,
            corners: [Sheared::default(); 3],
            reaches: [0.0; 3],
            ids: [0; 3],
            edges: [0.0; 3],
            last: RayPoint::default(),
            last_value: 0.0,
            light,
            steps: 0,
            stopped_early: false,
        };
        walk.next_path(scene);
        walk
    }

    /// Adds the counts of the ray.
    fn count(&self, stats: &mut FrameStats) {
        stats.steps += u64::from(self.steps);
        stats.rays_hit += 1;
        stats.rays_stopped_early += u64::from(self.stopped_early);
        stats.segments += u64::from(self.light.segments);
        stats.out_of_order += u64::from(self.light.out_of_order);
    }

    /// Moves to the start of the next path; false if there is none.
    fn next_path<M: Medium<Ray = R, Light = Accumulator>>(&mut self, scene: &Scene<'_, M>) -> bool {
        let Some(((_, start), rest)) = self.starts.split_first() else { return false };
        self.starts = rest;
        (self.cell, self.opposite) = (start.cell, start.opposite);
        let entry = path::enter(scene, &self.ray, start.cell, start.opposite);
        debug_assert!(entry.is_some(), "a start is a crossing");
        let Some((ids, Crossing { corners, edges, point })) = entry else { return false };
        (self.ids, self.corners, self.edges, self.last) = (ids, corners, edges, point);
        self.reaches = corners.map(|c| c.reach());
        self.last_value = self.value_here(scene.medium);
        self.light.leave();
        true
    }

    /// Value on the face that the ray is at.
    #[inline(always)]
    fn value_here<M: Medium>(&self, medium: &M) -> f64 {
        if M::HAS_VALUES { value_on_face(medium, self.ids, self.edges) } else { 0.0 }
    }

    /// Walks through one cell; false at the end of the ray.
    #[inline(always)]
    fn step<M: Medium<Ray = R, Light = Accumulator>>(&mut self, scene: &Scene<'_, M>) -> bool {
        self.steps += 1;
        let tet = &scene.mesh.topology.tets[self.cell as usize];
        let new_id = tet[self.opposite as usize & 3];
        let new = self.ray.shear(&scene.vertices[new_id as usize]);
        let reach = new.reach();
        // Written out for speed: this is the innermost loop.
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
        // The triangle is rotated so that the new vertex comes last: corners move, none is written in place.
        let (next, after) = TURNED[k];
        let (p, q) = (self.corners[next], self.corners[after]);
        let edges = [-to[after], to[next], self.edges[k]];
        self.corners = [p, q, new];
        self.reaches = [self.reaches[next], self.reaches[after], reach];
        self.ids = [self.ids[next], self.ids[after], new_id];
        self.edges = edges;
        let neighbour = scene.neighbours[self.cell as usize][exit & 3];
        let here = hit(edges, &p, &q, &new);
        let value = self.value_here(scene.medium);
        let (depth, scalar) = ([self.last.depth, here.depth], [self.last.scalar, here.scalar]);
        let values = [self.last_value, value];
        let segment = Segment::new(self.cell, depth, scalar, values, self.ray.line);
        self.light.go_on(scene.medium, segment);
        (self.last, self.last_value) = (here, value);
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

/// Signs, as bits, of the edge functions from a new vertex to the corners of a triangle, where one is small; values are refined.
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

//! From an entry through the active cells to the exit.

use super::entries::{Crossing, EntryFace, PixelRect, TileBins, crossing, face_of};
use super::view::{Edge, Ray, ViewVertex, edge, hit};
use crate::camera::View;
use crate::mesh::Mesh;
use crate::optics::Accumulator;
use crate::optics::exact::{ExactRay, ExactTable};
use crate::stats::FrameStats;
use crate::visibility::CellSet;

/// What all tiles of a frame read.
pub(super) struct Scene<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) active: &'a CellSet,
    pub(super) all_active: bool,
    pub(super) view: &'a View,
    pub(super) table: &'a ExactTable,
    pub(super) vertices: &'a [ViewVertex],
    pub(super) entry_faces: &'a [EntryFace],
    pub(super) eye_cells: &'a [u32],
    pub(super) early_termination: bool,
}

/// Buffers of a tile, used again from tile to tile.
#[derive(Default)]
pub(super) struct TileScratch {
    starts: Vec<(u32, Start)>,
}

/// Where a path begins: in `cell`, through the face opposite its vertex `opposite`.
#[derive(Clone, Copy, Debug)]
struct Start {
    depth: f64,
    cell: u32,
    opposite: u32,
}

/// Renders one tile: its pixels row by row, where they lie, and what it cost.
pub(super) fn render_tile(
    scene: &Scene<'_>,
    bins: &TileBins,
    tile: usize,
    scratch: &mut TileScratch,
) -> (Vec<[f32; 4]>, PixelRect, FrameStats) {
    let rect = bins.rect(tile);
    let mut pixels = vec![[0.0; 4]; rect.width * rect.height];
    let mut stats = FrameStats::default();
    find_starts(scene, bins, tile, rect, &mut scratch.starts);
    stats.entries = scratch.starts.len() as u64;
    for starts in scratch.starts.chunk_by(|a, b| a.0 == b.0) {
        let pixel = starts[0].0 as usize;
        let ray = Ray::of_pixel(scene.view, rect.x + pixel % rect.width, rect.y + pixel / rect.width);
        pixels[pixel] = cast(scene, &ray, starts, &mut stats);
    }
    (pixels, rect, stats)
}

/// All starts of paths in a tile, by pixel and depth.
fn find_starts(scene: &Scene<'_>, bins: &TileBins, tile: usize, rect: PixelRect, out: &mut Vec<(u32, Start)>) {
    out.clear();
    for (face, bounds) in bins.faces(tile) {
        let EntryFace { vertices, cell, opposite } = scene.entry_faces[face as usize];
        let columns = bounds.x.max(rect.x)..(bounds.x + bounds.width).min(rect.x + rect.width);
        for j in bounds.y.max(rect.y)..(bounds.y + bounds.height).min(rect.y + rect.height) {
            for i in columns.clone() {
                let ray = Ray::of_pixel(scene.view, i, j);
                if let Some(c) = crossing(&ray, scene.vertices, vertices)
                    && (c.depth > 0.0 || !ray.perspective)
                {
                    let pixel = ((j - rect.y) * rect.width + i - rect.x) as u32;
                    out.push((pixel, Start { depth: c.depth, cell, opposite }));
                }
            }
        }
    }
    for &cell in scene.eye_cells {
        for pixel in 0..rect.width * rect.height {
            let ray = Ray::of_pixel(scene.view, rect.x + pixel % rect.width, rect.y + pixel / rect.width);
            if let Some(start) = start_at_eye(scene, &ray, cell) {
                out.push((pixel as u32, start));
            }
        }
    }
    // Ties by cell: the order does not depend on how the starts were found.
    out.sort_unstable_by(|a, b| {
        a.0.cmp(&b.0)
            .then(a.1.depth.total_cmp(&b.1.depth))
            .then(a.1.cell.cmp(&b.1.cell))
            .then(a.1.opposite.cmp(&b.1.opposite))
    });
}

/// The ray's start in a cell that it enters behind (or at) the eye and leaves in front of it.
fn start_at_eye(scene: &Scene<'_>, ray: &Ray, cell: u32) -> Option<Start> {
    let mut start = None;
    let mut exit = None;
    for opposite in 0..4 {
        let face = face_of(&scene.mesh.topology, cell, opposite);
        let [p, q, r] = face.vertices;
        if let Some(c) = crossing(ray, scene.vertices, [p, q, r]) {
            start = Some(Start { depth: c.depth, cell, opposite: face.opposite });
        } else if let Some(c) = crossing(ray, scene.vertices, [p, r, q]) {
            exit = Some(c.depth);
        }
    }
    start.filter(|s| s.depth <= 0.0 && exit.is_some_and(|depth| depth > 0.0))
}

/// Casts one ray along all its paths.
fn cast(scene: &Scene<'_>, ray: &Ray, starts: &[(u32, Start)], stats: &mut FrameStats) -> [f32; 4] {
    let mut path = Path {
        scene,
        ray,
        light: Accumulator::CLEAR,
        front: if ray.perspective { scene.view.near.max(0.0) } else { f64::NEG_INFINITY },
        composited: false,
        stats,
    };
    path.stats.rays_hit += 1;
    for (_, start) in starts {
        path.walk(start);
        if scene.early_termination && path.light.is_opaque() {
            path.stats.rays_stopped_early += 1;
            break;
        }
    }
    path.light.pixel()
}

/// A ray on its way.
struct Path<'a, 's> {
    scene: &'a Scene<'a>,
    ray: &'a Ray,
    light: Accumulator,
    /// Depth up to which the ray has been composited, or the near distance.
    front: f64,
    /// Whether `front` is the end of a segment rather than the near distance.
    composited: bool,
    stats: &'s mut FrameStats,
}

/// Which corner of the triangle the new vertex replaces, from the signs of edge(new, corner i) as bits i; see the module's
/// essay for why the first and the last entry do not occur.
const REPLACED: [usize; 8] = [3, 2, 0, 0, 1, 2, 1, 3];

impl Path<'_, '_> {
    /// Walks from `start` to the end of the path, or until nothing behind can be seen.
    fn walk(&mut self, start: &Start) {
        let (scene, ray) = (self.scene, self.ray);
        let topology = &scene.mesh.topology;
        let (mut cell, mut opposite) = (start.cell, start.opposite as usize);
        let mut ids = face_of(topology, cell, opposite).vertices;
        let Some(Crossing { mut corners, mut edges, depth, scalar }) = crossing(ray, scene.vertices, ids) else {
            debug_assert!(false, "a start is a crossing");
            return;
        };
        let mut last = (depth, scalar);
        let mut exact = None;
        loop {
            self.stats.steps += 1;
            let tet = &topology.tets[cell as usize];
            let new_id = tet[opposite];
            let new = ray.shear(&scene.vertices[new_id as usize]);
            let to: [Edge; 3] = std::array::from_fn(|i| edge(&new, &corners[i], new_id, ids[i]));
            let sign = |i: usize| usize::from(to[i].positive);
            let k = REPLACED[sign(0) | sign(1) << 1 | sign(2) << 2];
            if k == 3 {
                debug_assert!(false, "signs of edge functions are exact");
                return;
            }
            let exit = tet.iter().position(|&v| v == ids[k]).unwrap_or(0);
            (corners[k], ids[k]) = (new, new_id);
            let (next, after) = ([1, 2, 0][k], [2, 0, 1][k]);
            edges[next] = -to[after].value;
            edges[after] = to[next].value;
            let here = hit(edges, &corners[0], &corners[1], &corners[2]);
            if here.0 > last.0 {
                self.composite(&mut exact, last, here);
                last = here;
            }
            if scene.early_termination && self.light.is_opaque() {
                return;
            }
            let neighbour = topology.neighbours[cell as usize][exit];
            match neighbour.cell() {
                Some(n) if scene.all_active || scene.active.contains(n) => {
                    (cell, opposite) = (n, neighbour.opposite() as usize);
                }
                _ => return,
            }
        }
    }

    /// Composites the segment between two (depth, scalar) places, or the part of it behind `front`.
    #[inline]
    fn composite(&mut self, exact: &mut Option<ExactRay>, from: (f64, f64), to: (f64, f64)) {
        if to.0 <= self.front {
            self.stats.out_of_order += u64::from(self.composited);
            *exact = None;
            return;
        }
        let mut from = from;
        if from.0 < self.front {
            let f = (self.front - from.0) / (to.0 - from.0);
            from = (self.front, from.1 + f * (to.1 - from.1));
            *exact = None;
        }
        let table = self.scene.table;
        let walker = exact.get_or_insert_with(|| ExactRay::enter(table, from.1));
        let length = (to.0 - from.0) * self.ray.length_per_depth;
        self.stats.segments += walker.segment(table, from.1, to.1, length, &mut self.light);
        (self.front, self.composited) = (to.0, true);
    }
}

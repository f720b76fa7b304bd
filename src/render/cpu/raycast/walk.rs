//! From an entry through the active cells to the exit.

use super::super::prepared::first_visible;
use super::super::ray::{Crossing, Ray, Sheared, ViewVertex, crossing, edge, hit, signed_edge, uncertainty};
use super::super::tiles::{PixelRect, TilePixel};
use super::entries::{EntryFace, EyeCell, TileBins, face_of};
use crate::camera::View;
use crate::mesh::Mesh;
use crate::optics::{Accumulator, Integrator};
use crate::stats::FrameStats;
use crate::visibility::CellSet;

/// What all tiles of a frame read.
pub(super) struct Scene<'a, I> {
    pub(super) mesh: &'a Mesh,
    pub(super) active: &'a CellSet,
    pub(super) all_active: bool,
    pub(super) view: &'a View,
    pub(super) table: &'a I,
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

/// Renders one tile into the first pixels of `pixels`, row by row; returns what it cost.
#[inline(always)]
pub(super) fn render_tile_inlined<I: Integrator>(
    scene: &Scene<'_, I>,
    bins: &TileBins,
    tile: usize,
    scratch: &mut TileScratch,
    pixels: &mut [TilePixel],
) -> FrameStats {
    let rect = bins.grid.rect(tile);
    pixels.fill(TilePixel::CLEAR);
    let mut stats = FrameStats::default();
    find_starts(scene, bins, tile, rect, &mut scratch.starts);
    stats.entries = scratch.starts.len() as u64;
    for starts in scratch.starts.chunk_by(|a, b| a.0 == b.0) {
        let pixel = starts[0].0 as usize;
        let ray = Ray::of_pixel(scene.view, rect.x + pixel % rect.width, rect.y + pixel / rect.width);
        let mut walk = Walk::new(scene, ray, starts);
        while walk.step(scene) {}
        pixels[pixel] = TilePixel { rgba: walk.light.pixel(), depth: walk.visible_from };
        stats.add_counts(&walk.counts());
    }
    stats
}

/// All starts of paths in a tile, by pixel and depth.
fn find_starts<I>(scene: &Scene<'_, I>, bins: &TileBins, tile: usize, rect: PixelRect, out: &mut Vec<(u32, Start)>) {
    out.clear();
    for (face, bounds) in bins.faces(tile) {
        let EntryFace { vertices, cell, opposite } = scene.entry_faces[face as usize];
        let columns = bounds.x.max(rect.x)..(bounds.x + bounds.width).min(rect.x + rect.width);
        for j in bounds.y.max(rect.y)..(bounds.y + bounds.height).min(rect.y + rect.height) {
            for i in columns.clone() {
                let ray = Ray::of_pixel(scene.view, i, j);
                if let Some(c) = crossing(&ray, scene.vertices, vertices)
                    && (!ray.perspective || c.is_in_front(vertices))
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
fn start_at_eye<I>(scene: &Scene<'_, I>, ray: &Ray, cell: u32) -> Option<Start> {
    let at_eye = EyeCell::new(&scene.mesh.topology, scene.vertices, ray, cell)?;
    Some(Start { depth: at_eye.entry.depth, cell, opposite: at_eye.opposite })
}

/// A ray on its way: which path, which cell, and what it has gathered.
struct Walk<'a, I: Integrator> {
    ray: Ray,
    /// Starts of the paths still to be walked.
    starts: &'a [(u32, Start)],
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
    /// Place in the table, if the last segment was composited up to `last`.
    place: Option<I::Place>,
    light: Accumulator,
    /// Depth of the first visible place.
    visible_from: f64,
    /// Depth up to which the ray has been composited, or the near distance.
    front: f64,
    /// Whether `front` is the end of a segment rather than the near distance.
    composited: bool,
    steps: u32,
    segments: u32,
    out_of_order: u32,
    stopped_early: bool,
}

/// Which corner of the triangle the new vertex replaces, from the signs of edge(new, corner i) as bits i; see the module's
/// essay for why the first and the last entry do not occur.
const REPLACED: [u8; 8] = [3, 2, 0, 0, 1, 2, 1, 3];

impl<'a, I: Integrator> Walk<'a, I> {
    /// A ray at its first start (there is one).
    fn new(scene: &Scene<'_, I>, ray: Ray, starts: &'a [(u32, Start)]) -> Self {
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
            place: None,
            light: Accumulator::CLEAR,
            visible_from: f64::INFINITY,
            front: if ray.perspective { scene.view.near.max(0.0) } else { f64::NEG_INFINITY },
            composited: false,
            steps: 0,
            segments: 0,
            out_of_order: 0,
            stopped_early: false,
        };
        walk.next_path(scene);
        walk
    }

    /// What the ray has cost.
    fn counts(&self) -> FrameStats {
        FrameStats {
            steps: u64::from(self.steps),
            segments: u64::from(self.segments),
            rays_hit: 1,
            rays_stopped_early: u64::from(self.stopped_early),
            out_of_order: u64::from(self.out_of_order),
            ..FrameStats::default()
        }
    }

    /// Goes to the start of the next path, if there is one.
    fn next_path(&mut self, scene: &Scene<'_, I>) -> bool {
        let Some(((_, start), rest)) = self.starts.split_first() else { return false };
        self.starts = rest;
        (self.cell, self.opposite) = (start.cell, start.opposite);
        self.ids = face_of(&scene.mesh.topology, start.cell, start.opposite as usize).vertices;
        let crossing = crossing(&self.ray, scene.vertices, self.ids);
        debug_assert!(crossing.is_some(), "a start is a crossing");
        let Some(Crossing { corners, edges, depth, scalar }) = crossing else { return false };
        (self.corners, self.edges, self.last) = (corners, edges, (depth, scalar));
        self.reaches = corners.map(|c| c.reach());
        self.place = None;
        true
    }

    /// Walks through one cell; false at the end of the ray.
    #[inline(always)]
    fn step(&mut self, scene: &Scene<'_, I>) -> bool {
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
            self.careful_signs(&mut to, &new, new_id)
        };
        let k = REPLACED[signs] as usize;
        if k == 3 {
            debug_assert!(false, "signs of edge functions are exact");
            return false;
        }
        let gone = self.ids[k];
        let exit = usize::from(tet[1] == gone) + 2 * usize::from(tet[2] == gone) + 3 * usize::from(tet[3] == gone);
        // The triangle turns so that the new vertex comes last: corners move, none is written in place.
        let (next, after) = ([1, 2, 0][k], [2, 0, 1][k]);
        let (p, q) = (self.corners[next], self.corners[after]);
        let edges = [-to[after], to[next], self.edges[k]];
        self.corners = [p, q, new];
        self.reaches = [self.reaches[next], self.reaches[after], reach];
        self.ids = [self.ids[next], self.ids[after], new_id];
        self.edges = edges;
        let neighbour = topology.neighbours[self.cell as usize][exit & 3];
        let here = hit(edges, &p, &q, &new);
        if here.0 > self.last.0 {
            self.composite(scene.table, here);
            self.last = here;
        }
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

    /// The signs of the edge functions from a new vertex to the corners as bits, where one is small; values are refined.
    #[cold]
    #[inline(never)]
    fn careful_signs(&self, to: &mut [f64; 3], new: &Sheared, new_id: u32) -> usize {
        let mut signs = 0;
        for (i, value) in to.iter_mut().enumerate() {
            let (refined, positive) = signed_edge(new, &self.corners[i], new_id, self.ids[i]);
            *value = refined;
            signs |= usize::from(positive) << i;
        }
        signs
    }

    /// Composites the segment from the last (depth, scalar) place to the next one, or the part of it behind `front`.
    #[inline(always)]
    fn composite(&mut self, table: &I, to: (f64, f64)) {
        let mut from = self.last;
        if from.0 < self.front {
            self.place = None;
            if to.0 <= self.front {
                self.out_of_order += u32::from(self.composited);
                return;
            }
            let share = (self.front - from.0) / (to.0 - from.0);
            from = (self.front, from.1 + share * (to.1 - from.1));
        }
        let place = self.place.get_or_insert_with(|| table.enter(from.1));
        let length = (to.0 - from.0) * self.ray.length_per_depth;
        let pieces = table.segment(place, from.1, to.1, length, &mut self.light) as u32;
        // A table may show light before the transfer function has any: the ray is then asked again.
        if self.visible_from == f64::INFINITY && pieces > 0 {
            self.visible_from = first_visible(table, from, to);
        }
        self.segments += pieces;
        (self.front, self.composited) = (to.0, true);
    }
}

//! Where rays enter the active cells.

use super::super::super::RenderJob;
use super::super::ray::{Crossing, Ray, ViewVertex, crossing};
use super::super::tiles::{PixelRect, TILE_PX, TileGrid, pixel_box};
use crate::camera::View;
use crate::mesh::{FACE_VERTICES, Topology};
use crate::task::Cancel;
use crate::visibility::CellSet;
use rayon::prelude::*;

/// A face of an active cell without an active cell behind it.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct EntryFace {
    /// Counter-clockwise seen from outside the cell.
    pub(super) vertices: [u32; 3],
    pub(in crate::render) cell: u32,
    /// The vertex of the cell (0..4) that is not on the face.
    pub(in crate::render) opposite: u32,
}

/// All entry faces, in the order of their cells; some of them if `cancel` is raised.
pub(in crate::render) fn collect(topology: &Topology, active: &CellSet, cancel: &Cancel, out: &mut Vec<EntryFace>) {
    out.clear();
    out.par_extend((0..topology.tets.len() as u32).into_par_iter().with_min_len(16_384).flat_map_iter(|cell| {
        let member = active.contains(cell) && !cancel.is_cancelled();
        let neighbours = topology.neighbours[cell as usize];
        (0..4).filter_map(move |i| {
            let open = member && neighbours[i].cell().is_none_or(|n| !active.contains(n));
            open.then(|| face_of(topology, cell, i))
        })
    }));
}

/// Face `opposite` of a cell.
pub(super) fn face_of(topology: &Topology, cell: u32, opposite: usize) -> EntryFace {
    let tet = topology.tets[cell as usize];
    EntryFace { vertices: FACE_VERTICES[opposite].map(|v| tet[v]), cell, opposite: opposite as u32 }
}

/// Active cells that may contain the eye, for rays that start inside the volume. A ray starts in one of them if it is
/// behind the eye where it enters the cell and not where it leaves it; both are computed as for any other face, so that
/// entries in front of the eye and starts around it complement each other. `tolerance`, local units, is more than view
/// coordinates are rounded by: a cell too many only costs time.
pub(in crate::render) fn cells_at_eye(job: &RenderJob, local_view: &View, tolerance: f64) -> Vec<u32> {
    // The local box lies within [-1, 1]: an eye outside needs no search.
    if !local_view.perspective || local_view.eye.abs().max_element() > 1.0 + tolerance {
        return Vec::new();
    }
    job.mesh.cells_near(local_view.eye, tolerance).into_iter().filter(|&c| job.active.contains(c)).collect()
}

/// Where a ray passes through a cell with the eye in it.
pub(in crate::render::cpu) struct EyeCell {
    /// Behind the eye, or at it.
    pub(in crate::render::cpu) entry: Crossing,
    /// The vertex of the cell (0..4) that is not on the face of the entry.
    pub(in crate::render::cpu) opposite: u32,
    /// In front of the eye.
    pub(in crate::render::cpu) exit: Crossing,
}

impl EyeCell {
    /// `None` if the ray does not enter the cell behind (or at) the eye and leave it in front.
    pub(in crate::render::cpu) fn new(
        topology: &Topology,
        vertices: &[ViewVertex],
        ray: &Ray,
        cell: u32,
    ) -> Option<Self> {
        let (mut start, mut end) = (None, None);
        for opposite in 0..4 {
            let face = face_of(topology, cell, opposite);
            let [p, q, r] = face.vertices;
            if let Some(c) = crossing(ray, vertices, [p, q, r]) {
                start = (!c.is_in_front([p, q, r])).then_some((c, face.opposite));
            } else if let Some(c) = crossing(ray, vertices, [p, r, q]) {
                end = c.is_in_front([p, r, q]).then_some(c);
            }
        }
        let ((entry, opposite), exit) = (start?, end?);
        Some(Self { entry, opposite, exit })
    }
}

/// For each tile the entry faces whose pixel box meets it.
#[derive(Debug, Default)]
pub(super) struct TileBins {
    pub(super) grid: TileGrid,
    boxes: Vec<PixelRect>,
    /// `starts[t]..starts[t + 1]` of `faces` belong to tile t.
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl TileBins {
    /// No tiles: nothing can be seen.
    pub(super) fn clear(&mut self) {
        self.grid = TileGrid::default();
    }

    pub(super) fn tile_count(&self) -> usize {
        self.grid.tile_count()
    }

    /// Entry faces of a tile, with their pixel boxes.
    pub(super) fn faces(&self, tile: usize) -> impl Iterator<Item = (u32, PixelRect)> + '_ {
        let range = self.starts[tile] as usize..self.starts[tile + 1] as usize;
        self.faces[range].iter().map(|&f| (f, self.boxes[f as usize]))
    }

    pub(super) fn fill(&mut self, view: &View, vertices: &[ViewVertex], faces: &[EntryFace]) {
        self.grid = TileGrid::of(view);
        faces
            .par_iter()
            .with_min_len(1024)
            .map(|f| {
                let corners = f.vertices.map(|v| vertices[v as usize]);
                let may_enter = !is_back_facing(view, &corners);
                may_enter.then(|| pixel_box(view, corners)).flatten().unwrap_or_default()
            })
            .collect_into_vec(&mut self.boxes);
        self.starts.clear();
        self.starts.resize(self.tile_count() + 1, 0);
        let columns = self.grid.columns;
        let tiles_of = move |b: &PixelRect| {
            let (x0, x1) = (b.x / TILE_PX, (b.x + b.width).div_ceil(TILE_PX));
            let (y0, y1) = (b.y / TILE_PX, (b.y + b.height).div_ceil(TILE_PX));
            let (x1, y1) = if b.width == 0 || b.height == 0 { (x0, y0) } else { (x1, y1) };
            (y0..y1).flat_map(move |y| (x0..x1).map(move |x| y * columns + x))
        };
        for b in &self.boxes {
            for tile in tiles_of(b) {
                self.starts[tile + 1] += 1;
            }
        }
        for tile in 0..self.tile_count() {
            self.starts[tile + 1] += self.starts[tile];
        }
        self.faces.clear();
        self.faces.resize(self.starts[self.tile_count()] as usize, 0);
        for (face, b) in (0u32..).zip(&self.boxes) {
            for tile in tiles_of(b) {
                // `starts[tile]` serves as the cursor and ends where the next tile starts; shifted back below.
                self.faces[self.starts[tile] as usize] = face;
                self.starts[tile] += 1;
            }
        }
        for tile in (0..self.tile_count()).rev() {
            self.starts[tile + 1] = self.starts[tile];
        }
        self.starts[0] = 0;
    }
}

/// Whether every ray sees the triangle from behind, beyond doubt.
fn is_back_facing(view: &View, [a, b, c]: &[ViewVertex; 3]) -> bool {
    let (ab, ac) = ([b.x - a.x, b.y - a.y, b.w - a.w], [c.x - a.x, c.y - a.y, c.w - a.w]);
    let normal = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]];
    // Along the ray to corner a; parallel rays all go along w.
    let ray = if view.perspective { [a.x, a.y, a.w] } else { [0.0, 0.0, 1.0] };
    let dot: f64 = (0..3).map(|i| normal[i] * ray[i]).sum();
    let length = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    // Far above f64's rounding: what is in doubt is decided pixel by pixel.
    dot < -1e-9 * length(&ab) * length(&ac) * length(&ray)
}

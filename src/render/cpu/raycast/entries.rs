//! Where rays enter the active cells.

use super::super::super::RenderJob;
use super::TILE_PX;
use super::view::{Ray, Sheared, ViewVertex, hit, signed_edge};
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

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PixelRect {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) width: usize,
    pub(super) height: usize,
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

/// A face that a ray passes through from its front.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub(super) corners: [Sheared; 3],
    /// Edge functions opposite the corners.
    pub(super) edges: [f64; 3],
    pub(super) depth: f64,
    pub(super) scalar: f64,
}

impl Crossing {
    /// Whether the face is hit in front of the eye; `ids` are those of the corners. The same for both cells at it, whatever
    /// the order of its corners there: the terms of the weighted depth are summed in the order of the ids. Else a ray whose
    /// eye is within rounding of a face would start on both sides of it, or on none.
    pub(super) fn is_in_front(&self, ids: [u32; 3]) -> bool {
        let mut terms: [(u32, f64); 3] = std::array::from_fn(|i| (ids[i], self.edges[i].max(0.0) * self.corners[i].w));
        terms.sort_unstable_by_key(|term| term.0);
        terms[0].1 + terms[1].1 + terms[2].1 > 0.0
    }
}

/// Where the ray passes through a triangle whose corners it sees counter-clockwise.
#[inline]
pub(super) fn crossing(ray: &Ray, vertices: &[ViewVertex], ids: [u32; 3]) -> Option<Crossing> {
    let corners = ids.map(|v| ray.shear(&vertices[v as usize]));
    let [p, q, r] = &corners;
    let signed =
        [signed_edge(q, r, ids[1], ids[2]), signed_edge(r, p, ids[2], ids[0]), signed_edge(p, q, ids[0], ids[1])];
    signed.iter().all(|edge| edge.1).then(|| {
        let edges = signed.map(|edge| edge.0);
        let (depth, scalar) = hit(edges, p, q, r);
        Crossing { corners, edges, depth, scalar }
    })
}

/// For each tile the entry faces whose pixel box meets it.
#[derive(Debug, Default)]
pub(super) struct TileBins {
    columns: usize,
    rows: usize,
    width: usize,
    height: usize,
    boxes: Vec<PixelRect>,
    /// `starts[t]..starts[t + 1]` of `faces` belong to tile t.
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl TileBins {
    /// No tiles: nothing can be seen.
    pub(super) fn clear(&mut self) {
        (self.columns, self.rows) = (0, 0);
    }

    pub(super) fn tile_count(&self) -> usize {
        self.columns * self.rows
    }

    pub(super) fn rect(&self, tile: usize) -> PixelRect {
        let (x, y) = (tile % self.columns * TILE_PX, tile / self.columns * TILE_PX);
        PixelRect { x, y, width: TILE_PX.min(self.width - x), height: TILE_PX.min(self.height - y) }
    }

    /// Entry faces of a tile, with their pixel boxes.
    pub(super) fn faces(&self, tile: usize) -> impl Iterator<Item = (u32, PixelRect)> + '_ {
        let range = self.starts[tile] as usize..self.starts[tile + 1] as usize;
        self.faces[range].iter().map(|&f| (f, self.boxes[f as usize]))
    }

    pub(super) fn fill(&mut self, view: &View, vertices: &[ViewVertex], faces: &[EntryFace]) {
        (self.width, self.height) = (view.width_px, view.height_px);
        (self.columns, self.rows) = (view.width_px.div_ceil(TILE_PX), view.height_px.div_ceil(TILE_PX));
        faces
            .par_iter()
            .with_min_len(1024)
            .map(|f| pixel_box(view, f.vertices.map(|v| vertices[v as usize])).unwrap_or_default())
            .collect_into_vec(&mut self.boxes);
        self.starts.clear();
        self.starts.resize(self.tile_count() + 1, 0);
        let columns = self.columns;
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

/// Pixels whose rays may enter through a triangle in front of the eye; `None` if there are none. Conservative.
fn pixel_box(view: &View, corners: [ViewVertex; 3]) -> Option<PixelRect> {
    if is_back_facing(view, &corners) {
        return None;
    }
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let mut include = |axis: usize, value: f64| {
        range[axis] = [range[axis][0].min(value), range[axis][1].max(value)];
    };
    if view.perspective {
        if corners.iter().all(|v| v.w <= 0.0) {
            return None;
        }
        let extent = corners.iter().fold(0.0f64, |m, v| m.max(v.x.abs()).max(v.y.abs()).max(v.w.abs()));
        for i in 0..3 {
            let (a, b) = (&corners[i], &corners[(i + 1) % 3]);
            if a.w > 0.0 {
                include(0, a.x / a.w);
                include(1, a.y / a.w);
            }
            if (a.w > 0.0) != (b.w > 0.0) {
                // The edge leaves the half-space in front of the eye here: towards infinity on the image plane, on the
                // side of x and y (on both sides if rounding leaves that open).
                let f = a.w / (a.w - b.w);
                for (axis, value) in [(0, a.x + f * (b.x - a.x)), (1, a.y + f * (b.y - a.y))] {
                    if value >= -1e-9 * extent {
                        include(axis, f64::INFINITY);
                    }
                    if value <= 1e-9 * extent {
                        include(axis, f64::NEG_INFINITY);
                    }
                }
            }
        }
    } else {
        for v in &corners {
            include(0, v.x);
            include(1, v.y);
        }
    }
    // Boxes are exact up to f64's rounding.
    const PAD_PX: f64 = 1e-3;
    let axis_range = |lo: f64, hi: f64, half: f64, pixels: usize| {
        let to_px = |v: f64| (v / half + 1.0) * 0.5 * pixels as f64 - 0.5;
        let (lo, hi) = (to_px(lo) - PAD_PX, to_px(hi) + PAD_PX);
        let first = lo.ceil().clamp(0.0, pixels as f64);
        let end = (hi.floor() + 1.0).clamp(0.0, pixels as f64);
        (first as usize, (end - first).max(0.0) as usize)
    };
    let (x, width) = axis_range(range[0][0], range[0][1], view.half_width, view.width_px);
    let (y, height) = axis_range(-range[1][1], -range[1][0], view.half_height, view.height_px);
    (width > 0 && height > 0).then_some(PixelRect { x, y, width, height })
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

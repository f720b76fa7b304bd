//! The nearest depths at which rays pass through the boundary of the active cells; and where rays are inside of cells ([`inside`]).
//!
//! The boundary is the faces between an active cell and an inactive one or the outside. Entry and exit faces count alike, as in depth
//! peeling (C. Everitt, *Interactive Order-Independent Transparency*, 2001; the dissertation, section 4.1.2). Each pixel keeps its
//! nearest depths while the faces of its tile are drawn in any order, so that one pass finds all depth layers.

mod inside;
mod nearest;
#[cfg(test)]
mod tests;
mod tiled;

use super::super::RenderJob;
use super::raster::lists::ListedFace;
use super::ray::transform;
use super::tiles::TILE_PX;
use crate::camera::{Samples, View};
use crate::image::Plane;
use crate::image::upsample::Reference;
use crate::mesh::{Connectivity, NONE};
use crate::visibility::CellSet;
pub(crate) use inside::{Inside, InsideFinder};
pub use nearest::MAX_LAYERS;
use nearest::Nearest;
use rayon::prelude::*;
use tiled::TiledFaces;

/// Faces of the mesh between two checks of the cancel flag: a fraction of a millisecond.
const FACES_PER_LOOK: usize = 64 * 1024;

/// Reference value of a missing depth layer; depths are 0 (the nearest point of the boundary in view) to 1 (the farthest).
pub(in crate::render) const MISSING: f32 = 2.0;

/// The nearest depths of the boundary in each pixel of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundaryDepths {
    /// World units along the viewing direction (from the eye; parallel projection: from the camera's position), nearest first; infinite
    /// where there is no such depth layer, and beyond the number of depth layers asked for.
    pub depths: Plane<[f64; MAX_LAYERS]>,
    /// Least and greatest depth of the boundary in view, of all depth layers; `None` if none is in view.
    pub range: Option<[f64; 2]>,
}

impl BoundaryDepths {
    /// Finds the nearest `layers` (at most [`MAX_LAYERS`]) depths of the boundary of a job's active cells in all pixels of its image,
    /// also those without rays; `None` if the job is cancelled. Depths before the near distance do not count.
    pub fn of(job: &RenderJob, layers: usize) -> Option<Self> {
        let view = View { samples: Samples::ALL, ..job.local_view() };
        let mut vertices = Vec::new();
        transform(&view, &job.mesh.positions.local, &job.scalars, None, &job.cancel, &mut vertices);
        let faces = boundary_faces(job, &job.active)?;
        let faces: Vec<_> = faces.into_par_iter().map(|ids| ListedFace { ids, cells: [NONE; 2] }).collect();
        let faces = TiledFaces::of(&view, &vertices, &faces, &job.cancel);
        let mut depths = vec![[f64::INFINITY; MAX_LAYERS]; view.width_px * view.height_px];
        let rows = depths.par_chunks_mut(view.width_px * TILE_PX).enumerate();
        let ranges = rows.map_init(Nearest::default, |nearest, (row, depths)| {
            let (mut range, columns) = ([f64::INFINITY, f64::NEG_INFINITY], faces.grid.columns);
            for tile in row * columns..(row + 1) * columns {
                if job.cancel.is_cancelled() {
                    break;
                }
                let rect = faces.grid.rect(tile);
                nearest.find(&faces, tile, layers, view.near_depth());
                range = joined(range, nearest.range);
                for (y, depths) in depths.chunks_mut(view.width_px).enumerate() {
                    let found = &nearest.depths[y * TILE_PX..][..rect.width];
                    depths[rect.x..rect.x + rect.width].copy_from_slice(found);
                }
            }
            range
        });
        let [least, most] = ranges.reduce(|| [f64::INFINITY, f64::NEG_INFINITY], joined);
        if job.cancel.is_cancelled() {
            return None;
        }
        let scale = job.mesh.positions.scale;
        depths.par_iter_mut().for_each(|depths| *depths = depths.map(|depth| depth * scale));
        Some(Self {
            depths: Plane { width: view.width_px, height: view.height_px, pixels: depths },
            range: (least <= most).then_some([least * scale, most * scale]),
        })
    }

    /// The depths as a reference of filters: 0 is the nearest point of the boundary within `range`, 1 the farthest, 2 a missing depth
    /// layer. An empty range counts as 1 long. Images of one view must share a range.
    pub fn reference(&self, range: [f64; 2]) -> Reference {
        let extent = if range[1] > range[0] { range[1] - range[0] } else { 1.0 };
        let share = |depth: f64| if depth.is_finite() { ((depth - range[0]) / extent) as f32 } else { MISSING };
        let Plane { width, height, pixels } = &self.depths;
        let pixels = pixels.par_iter().map(|depths| depths.map(share)).collect();
        Reference { width: *width, height: *height, pixels }
    }
}

/// Union of two [least, greatest] ranges.
fn joined(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The ascending corners of the faces between a cell in a set and none, in mesh order; `None` if the job is cancelled.
pub(in crate::render) fn boundary_faces(job: &RenderJob, cells: &CellSet) -> Option<Vec<[u32; 3]>> {
    let is_in = |cell: u32| cell != NONE && cells.contains(cell);
    let Connectivity { faces, face_cells, .. } = job.mesh.topology.connectivity();
    let parts = faces.par_chunks(FACES_PER_LOOK).zip(face_cells.par_chunks(FACES_PER_LOOK));
    let of_part = |(faces, cells): (&[[u32; 3]], &[[u32; 2]])| -> Vec<[u32; 3]> {
        if job.cancel.is_cancelled() {
            return Vec::new();
        }
        let _turn = job.thread_limit.turn();
        let part = faces.iter().zip(cells).filter(|(_, [a, b])| is_in(*a) != is_in(*b));
        part.map(|(ids, _)| *ids).collect()
    };
    let found: Vec<Vec<[u32; 3]>> = parts.map(of_part).collect();
    (!job.cancel.is_cancelled()).then(|| found.concat())
}

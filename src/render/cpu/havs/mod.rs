//! Drawing faces instead of cells: hardware-assisted visibility sorting (HAVS) on the CPU (dissertation 6.1.3).
//!
//! The job lists the faces to draw, each once, sorted by the depth of their centroids, either all or some (level of detail). They give
//! each pixel fragments nearly in depth order:
//!
//! ```text
//! vertices to view coordinates and to the image
//! for each chunk of the list, in parallel:  tiles that the box of each face meets            bins
//! for each tile, in parallel, in rounds of more and more faces in the order of the list:     queue, tile
//!   for each pixel whose ray hits a face:  fragment = depth, scalar, cell left, cell entered  raster
//!   for each pixel:  its fragments in order, those that nothing to come can be in front of leave
//!     if the ray is within an active cell behind the last one that left, integrate from that one to this one
//!                                                                                path, light, side_by_side
//!   at the end, for each pixel whose ray did not go from cell to cell: again, from all fragments  resolve
//! ```
//!
//! **Gaps.** The gap between two successive fragments is filled if an active cell is behind the nearer one. With a complete list the
//! farther one is the exit of that cell. With an incomplete one the gap spans several cells; faces between an active cell and none are
//! always drawn, which preserves holes and the outline.
//!
//! **Order.** In exact order fragments leave up to the least depth of the faces that are still to come, whatever their order. Otherwise a buffer
//! holds back the k nearest of a pixel (the k-buffer), which corrects most errors of the order: a fragment nearer than the last one that left
//! is counted and dropped. With a complete list the cells check the order: each fragment must leave the cell that the one before entered. If one
//! does not, and exact order is asked for, the pixel is drawn again by following its fragments from cell to cell, as the ray caster does. Depths within
//! rounding are ordered by their cells, an exit before an entry. So a complete list in exact order gives the ray caster's image, however flat
//! the cells are.
//!
//! Depths are f64: cells of boundary layers are thinner than the resolution of f32 depths.
//!
//! Deviations for speed:
//! 1. A buffer takes up a round of fragments before they are sorted into the k before each and leave: the same ones leave
//!    in the same order.
//! 2. Edge functions are linear over a tile. In f32, for two rows of eight pixels at a time, they say which pixels a face
//!    certainly misses; for the rest they are computed in f64, eight at a time; in doubt by their definition ([`raster`](super::raster)).
//!    Eight faces are made ready side by side.
//! 3. Opaque pixels take no more fragments; a face that only these could see is left out.
//! 4. The list is kept in its order, with corners and cells, as long as it is drawn; tiles have copies of their faces.
//!    Both for the sake of memory read in order ([`bins`]).
//! 5. The rays of a tile are integrated eight side by side ([`lanes`](super::lanes)), once it is known in a round between which fragments; with another
//!    medium than a table of the scalar, or other layers, one after the other, runs of fragments together ([`Medium::pass_run`]).
//! 6. It is compiled for the widest registers that the processor has; the image is the same.
//!
//! Shares of a frame's time (1M cells, dense, samples of `perf`, EPYC with AVX-512): hits 27 %, order and paths 20, light 24, bins 14.

mod bins;
mod fragment;
#[cfg(test)]
mod lanes_tests;
mod light;
mod lights;
mod path;
mod place;
mod queue;
mod resolve;
#[cfg(target_arch = "x86_64")]
mod side_by_side;
mod sides;
mod tile;

use super::super::layers::Layers;
use super::super::medium::Medium;
use super::super::{Frame, FrameRun, LayerRenderer, OpticsTables, RenderError, RenderJob};
use super::tiles::{TILE_PX, Tiles};
use super::{RenderTiles, TileJob};
use crate::optics::Accumulator;
use crate::slowdown::{Slow, waste};
use crate::visibility::Drawn;
pub(in crate::render::cpu) use place::{FacePlacer, FacesInView};
use pulp::{Arch, Scalar, Simd};
use rayon::prelude::*;
#[cfg(feature = "gpu")]
pub(in crate::render) use sides::is_outward;
use std::sync::Arc;
use std::time::Duration;
use tile::{RenderTile, Scene, TileScratch};

/// The face renderer on the CPU.
pub type Havs = FrameRun<FaceTiles>;

/// Draws faces tile by tile on the CPU.
pub struct FaceTiles {
    placer: FacePlacer,
    tiles: Tiles<TileScratch>,
    /// Tables for jobs without prepared optics.
    tables: OpticsTables,
    /// Whether to avoid instructions that not every processor of the architecture has.
    portable: bool,
    /// Fragments of a tile that are held back at most, unless it is down to one pixel.
    held_most: usize,
}

/// Of 16 MB a thread.
const HELD_MOST: usize = 1 << 18;

impl Default for FaceTiles {
    fn default() -> Self {
        let (placer, tiles, tables) = (FacePlacer::default(), Tiles::default(), OpticsTables::default());
        Self { placer, tiles, tables, portable: false, held_most: HELD_MOST }
    }
}

/// A job of [`FaceTiles`].
pub struct FaceJob {
    tiles: TileJob,
    in_view: Arc<FacesInView>,
}

impl Havs {
    /// A renderer without a job.
    pub fn new() -> Self {
        Self::default()
    }

    /// A renderer that avoids instructions of newer processors; its images are the same.
    pub fn portable() -> Self {
        Self::of(FaceTiles { portable: true, ..FaceTiles::default() })
    }
}

/// The faces of a job, checked.
///
/// # Errors
/// If there are none, if one is not in the mesh, or if k is out of range.
pub(in crate::render) fn checked_faces(job: &RenderJob) -> Result<Arc<Drawn>, RenderError> {
    let drawn = job.faces.clone().ok_or(RenderError::NoFaces)?;
    let faces = job.mesh.topology.connectivity().faces.len();
    match drawn.ids.par_iter().with_min_len(1 << 16).max() {
        Some(&face) if face as usize >= faces => return Err(RenderError::NoSuchFace { face, faces }),
        _ => {}
    }
    let k = job.k_buffer.k;
    if (2..=32).contains(&k) { Ok(drawn) } else { Err(RenderError::BadK(k)) }
}

impl LayerRenderer for FaceTiles {
    type Job = FaceJob;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<FaceJob>, RenderError> {
        let drawn = job.faces.clone().ok_or(RenderError::NoFaces)?;
        let tiles = TileJob::new(job, &mut self.tables, frame);
        let TileJob { job, view, .. } = &tiles;
        frame.stats.faces_total = job.mesh.topology.connectivity().faces.len() as u64;
        let mut in_view = Arc::default();
        if tiles.is_transparent() {
            checked_faces(job)?;
        } else {
            in_view = match job.placed.as_ref().and_then(|placed| placed.faces(job)) {
                Some(faces) => faces,
                None => self.placer.place(job, view, &mut frame.stats)?,
            };
            frame.stats.faces_drawn = drawn.ids.len() as u64;
        }
        self.tiles.begin(in_view.bins.grid, job.skip.costly_first);
        Ok(Some(FaceJob { tiles, in_view }))
    }

    fn advance(&mut self, budget: Duration, job: &mut FaceJob, frame: &mut Frame) -> Result<bool, RenderError> {
        Ok(self.render(job, budget, frame))
    }
}

impl RenderTiles for FaceTiles {
    fn tile_job(job: &FaceJob) -> &TileJob {
        &job.tiles
    }

    fn render_tiles<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        FaceJob { tiles: TileJob { job, view, .. }, in_view }: &FaceJob,
        (medium, layers): (&M, &L),
        budget: Duration,
        frame: &mut Frame,
    ) -> bool {
        let arch = if self.portable { Arch::Scalar } else { Arch::new() };
        let scene = Scene {
            topology: &job.mesh.topology,
            vertices: &in_view.vertices,
            bins: &in_view.bins,
            view,
            medium,
            layers,
            eye_cells: &in_view.eye_cells,
            k_buffer: job.k_buffer,
            is_complete: job.faces.as_ref().is_some_and(|drawn| drawn.is_complete),
            early_termination: job.skip.opaque,
            // The mesh lies within a local box of diameter 2 sqrt(3).
            tie: fragment::tie(view.eye.length() + 2.0),
            cancel: &job.cancel,
            arch,
            held_most: self.held_most,
        };
        let portable = self.portable;
        self.tiles.render(job, budget, frame, |tile, scratch, pixels| {
            let counts = match arch {
                #[cfg(target_arch = "x86_64")]
                Arch::V4(lanes) => lanes.vectorize(RenderTile { lanes, scene: &scene, tile, scratch, pixels }),
                #[cfg(target_arch = "x86_64")]
                Arch::V3(lanes) => lanes.vectorize(RenderTile { lanes, scene: &scene, tile, scratch, pixels }),
                _ => Scalar.vectorize(RenderTile { lanes: Scalar, scene: &scene, tile, scratch, pixels }),
            };
            let fragments = counts.fragments as usize;
            waste(Slow::Faces, fragments);
            waste(Slow::FaceLanes, if portable { 0 } else { fragments });
            waste(Slow::FewFaces, if scene.is_complete { 0 } else { fragments });
            counts
        })
    }
}

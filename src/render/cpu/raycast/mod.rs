//! Ray casting by cell walk: per pixel, from face to face through the active cells.
//!
//! 1. **view transform** ([`ray`]): vertices to view coordinates, once per frame.
//! 2. **entries** ([`entries`]): faces between an active cell and an inactive one or the outside, binned into tiles; per
//!    pixel those that the ray enters through, nearest first. Empty space, holes and separate parts are this one
//!    mechanism.
//! 3. **walk** ([`walk`]): from an entry through the active cells to the exit, compositing a segment per cell.
//!
//! **Why no ray is lost or doubled.** A pixel's ray is made the origin of a plane by shearing the vertices along it; a
//! face is hit if the origin lies in its sheared triangle. Sheared coordinates are a function of vertex and pixel alone, so
//! all cells see the same planar points, and the sign of an edge function of two of them is exact, with zeros decided by
//! shifting the ray by (d, d^2), d -> 0 ([`ray::accurate_edge`]). Of the four sheared faces of a tet, generic points lie
//! in none or in two with opposite orientation (the boundary of a tet is a closed surface: its degree over any point of
//! the plane is zero). So the faces hit by a ray pair up inside each tet: they form paths from a front-facing to a back-facing face of
//! the active sub-complex's surface, each walk ends there, whatever rounding does to the shape of slivers, and entries
//! found by the same edge functions are exactly the starts of the paths.
//!
//! Deviations for speed from the plain algorithm:
//! 1. Entry candidates are culled by conservative pixel boxes.
//! 2. Of the three edges of the exit face only those at the new vertex are evaluated.
//! 3. It is compiled a second time for AVX2 ([`simd`]).
//! 4. The triangle turns so that the new vertex is its last corner: nothing is written to a place that depends on the step.
//!
//! Tried and not kept, since they changed nothing (rays of a tile share their cells, which stay in the cache): walking four
//! or eight rays of a thread in turn, to hide the latency of the loads; vertices and neighbours of a cell side by side.

pub(in crate::render) mod entries;
pub(in crate::render) mod pre_integrated;
mod simd;
mod walk;

use super::super::{Advance, Frame, RenderError, RenderJob, Renderer};
use super::prepared::Table;
use super::ray::{self, ViewVertex};
use super::tiles::{self, TILE_PX, TilePixel};
use crate::camera::View;
use crate::mesh::Mesh;
use crate::optics::Integrator;
use crate::optics::table3d::Table3dResolution;
use crate::stats::FrameStats;
use crate::visibility::CellSet;
use entries::{EntryFace, TileBins};
use pre_integrated::PreIntegrated;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use walk::{Scene, TileScratch};

/// Cells so near to the eye, local units, may be the first on a ray: view coordinates are rounded by some 2^-53 of the local
/// box's diameter, which is below 4.
pub(in crate::render::cpu) const EYE_TOLERANCE: f64 = 1e-12;

/// The CPU ray caster.
#[derive(Default)]
pub struct Raycast {
    frame: Frame,
    vertices: Vec<ViewVertex>,
    entry_faces: Vec<EntryFace>,
    /// What they were collected from.
    entry_faces_of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    bins: TileBins,
    /// Pixels tile by tile, each tile's rows together.
    tile_pixels: Vec<TilePixel>,
    /// One for each thread.
    scratch: Vec<Mutex<TileScratch>>,
    active_job: Option<ActiveJob>,
    /// The pre-integrated table of the last job that asked for one.
    pre_integrated: PreIntegrated,
    /// Use no instructions that not every processor of its kind has.
    portable: bool,
}

/// What a job under way needs beyond the buffers.
struct ActiveJob {
    job: RenderJob,
    view: View,
    table: Table,
    eye_cells: Vec<u32>,
    next_tile: usize,
    started: Instant,
    /// Milliseconds that the frame took before it came here.
    ms_before: f64,
}

impl Raycast {
    /// A renderer without a job.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same renderer without instructions that only newer processors have; its images are the same.
    pub fn portable() -> Self {
        Self { portable: true, ..Self::default() }
    }

    /// A renderer whose pre-integrated tables have this resolution.
    pub fn with_table3d_resolution(resolution: Table3dResolution) -> Self {
        Self { pre_integrated: PreIntegrated::of_resolution(resolution), ..Self::default() }
    }

    /// Entry faces depend on the mesh and its active cells alone: those of the last job are kept while these are the same.
    fn collect_entry_faces(&mut self, job: &RenderJob) {
        let same = |(mesh, active): &(Arc<Mesh>, Arc<CellSet>)| {
            Arc::ptr_eq(mesh, &job.mesh) && Arc::ptr_eq(active, &job.active)
        };
        if !self.entry_faces_of.as_ref().is_some_and(same) {
            entries::collect(&job.mesh.topology, &job.active, &job.cancel, &mut self.entry_faces);
            let is_complete = !job.cancel.is_cancelled();
            self.entry_faces_of = is_complete.then(|| (job.mesh.clone(), job.active.clone()));
        }
    }
}

impl Renderer for Raycast {
    fn begin(&mut self, job: RenderJob) -> Result<(), RenderError> {
        job.check()?;
        let started = Instant::now();
        let view = job.local_view();
        self.frame.clear(view.width_px, view.height_px);
        let table = Table::of(&job, &mut self.pre_integrated);
        ray::transform(&view, &job.mesh.positions.local, &job.scalars, &job.cancel, &mut self.vertices);
        let cells_active = job.active.count();
        let everything_clear = table.is_clear() || cells_active == 0 || job.cancel.is_cancelled();
        let eye_cells = if everything_clear {
            self.bins.clear();
            Vec::new()
        } else {
            self.collect_entry_faces(&job);
            self.bins.fill(&view, &self.vertices, &self.entry_faces);
            entries::cells_at_eye(&job, &view, EYE_TOLERANCE)
        };
        self.frame.stats = FrameStats {
            cells_active: cells_active as u64,
            cells_total: job.active.universe() as u64,
            entry_faces: if everything_clear { 0 } else { self.entry_faces.len() as u64 },
            ms_order: job.stats.ms_order + started.elapsed().as_secs_f64() * 1e3,
            ..job.stats.clone()
        };
        self.tile_pixels.resize(self.bins.tile_count() * TILE_PX * TILE_PX, TilePixel::CLEAR);
        self.scratch.resize_with(rayon::current_num_threads(), Mutex::default);
        let ms_before = job.stats.ms_decode + job.stats.ms_order;
        self.active_job = Some(ActiveJob { job, view, table, eye_cells, next_tile: 0, started, ms_before });
        Ok(())
    }

    fn advance(&mut self, budget: Duration) -> Result<Advance<'_>, RenderError> {
        let Some(active) = self.active_job.take() else { return Ok(Advance::Done(&self.frame)) };
        if active.job.cancel.is_cancelled() {
            // Perhaps since before its tiles were known.
            self.active_job = Some(active);
            return Ok(Advance::Partial(&self.frame));
        }
        let slice_started = Instant::now();
        let next_tile = match &active.table {
            Table::Exact(table) => self.render_tiles(&active, table, budget),
            Table::Table3d(table) => self.render_tiles(&active, &**table, budget),
        };
        self.frame.stats.ms_render += slice_started.elapsed().as_secs_f64() * 1e3;
        self.frame.stats.ms_frame = active.ms_before + active.started.elapsed().as_secs_f64() * 1e3;
        if next_tile >= self.bins.tile_count() {
            return Ok(Advance::Done(&self.frame));
        }
        self.active_job = Some(ActiveJob { next_tile, ..active });
        Ok(Advance::Partial(&self.frame))
    }

    fn take_frame(&mut self, replacement: Frame) -> Frame {
        std::mem::replace(&mut self.frame, replacement)
    }
}

impl Raycast {
    /// Renders tiles of a job for about `budget`; returns the first that is still to be done.
    fn render_tiles<I: Integrator>(&mut self, active: &ActiveJob, table: &I, budget: Duration) -> usize {
        let scene = Scene {
            mesh: &active.job.mesh,
            active: &active.job.active,
            all_active: active.job.active.count() == active.job.active.universe(),
            view: &active.view,
            table,
            vertices: &self.vertices,
            entry_faces: &self.entry_faces,
            eye_cells: &active.eye_cells,
            early_termination: active.job.early_termination,
        };
        let (bins, avx2) = (&self.bins, !self.portable);
        let (first, pixels) = (active.next_tile, &mut self.tile_pixels);
        let (counts, end) =
            tiles::render_tiles(&active.job, pixels, &self.scratch, first, budget, |tile, scratch, out| {
                simd::render_tile(avx2, &scene, bins, tile, scratch, out)
            });
        self.frame.stats.add_counts(&counts);
        let scale = active.job.mesh.positions.scale;
        tiles::copy_tiles(&mut self.frame, &self.bins.grid, &self.tile_pixels, first..end, scale);
        end
    }
}

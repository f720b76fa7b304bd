//! Ray casting by cell walk: per pixel, from face to face through the active cells.
//!
//! 1. **view transform** ([`ray`]): vertices to view coordinates, once per frame.
//! 2. **entries** ([`entries`], [`starts`]): faces between an active cell and an inactive one or the outside, binned into
//!    tiles; per pixel those that the ray enters through, nearest first. Empty space, holes and separate parts are this one
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
//! 1. Entry candidates are culled by conservative pixel boxes, and by the side that is seen of them; those of a tile are met
//!    by its rays many at a time ([`raster`](super::raster)).
//! 2. Of the three edges of the exit face only those at the new vertex are evaluated.
//! 3. Where the processor has AVX2 or AVX-512, eight rays are walked side by side, to the same bits ([`lanes`]).
//! 4. The triangle turns so that the new vertex is its last corner: nothing is written to a place that depends on the step.
//!
//! Tried and not kept, since they changed nothing (rays of a tile share their cells, which stay in the cache): walking four
//! or eight rays of a thread in turn, without vectors, to hide the latency of the loads; vertices and neighbours of a cell
//! side by side.
//!
//! A job with a [`JointScene`](super::super::JointScene) is walked ray by ray: its segments need the quantity of their vertices at both ends, which the walk
//! finds from the face, and the cell.
//!
//! **What a ray sees does not depend on which clear cells are left out**, to the last bit: scalars of a hit stay within those of
//! its cell, paths begin as if the ray came through the cell before ([`path`]), and segments that show nothing change nothing
//! ([`light`]).

pub(in crate::render) mod entries;
#[cfg(target_arch = "x86_64")]
mod lanes;
mod light;
mod outside;
mod path;
pub(in crate::render) mod skips;
mod starts;
mod walk;

use super::super::{Advance, Frame, OpticsTable, OpticsTables, RenderError, RenderJob, Renderer};
use super::raster::boxes::{self, BoxSource, ScreenPoint};
use super::ray::{self, ViewVertex};
use super::tiles::{self, TILE_PX, TileOrder, TilePixel};
use crate::camera::View;
use crate::mesh::Mesh;
use crate::optics::Integrator;
use crate::optics::table3d::Table3dResolution;
use crate::slowdown::{Slow, waste};
use crate::stats::FrameStats;
use crate::visibility::{Clusters, NeededClusters};
use entries::{EntryBins, EntryFaces};
use skips::CellChoice;
use starts::Entries;
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
    screen: Vec<ScreenPoint>,
    entry_faces: EntryFaces,
    choice: CellChoice,
    bins: EntryBins,
    /// Those of the last mesh.
    clusters: Option<(Arc<Mesh>, Clusters)>,
    needed: NeededClusters,
    order: TileOrder,
    /// Pixels tile by tile in that order, each tile's rows together.
    tile_pixels: Vec<TilePixel>,
    /// One for each thread.
    scratch: Vec<Mutex<TileScratch>>,
    active_job: Option<ActiveJob>,
    /// For jobs that come without.
    tables: OpticsTables,
    /// Walk one ray after the other, with no instructions that not every processor of its kind has.
    portable: bool,
}

/// What a job under way needs beyond the buffers.
struct ActiveJob {
    job: RenderJob,
    view: View,
    table: OpticsTable,
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

    /// The same renderer without instructions that only newer processors have, one ray after the other; its images are the
    /// same.
    pub fn portable() -> Self {
        Self { portable: true, ..Self::default() }
    }

    /// A renderer whose pre-integrated tables have this resolution.
    pub fn with_table3d_resolution(resolution: Table3dResolution) -> Self {
        Self { tables: OpticsTables::of_resolution(resolution), ..Self::default() }
    }

    /// View coordinates, and where rays may enter; counts what that saved.
    fn place_entries(&mut self, job: &RenderJob, view: &View, eye_cells: &[u32]) -> FrameStats {
        let knows_outside = job.skip.outside && outside::may_be_left_out(&job.mesh, view, eye_cells);
        let mut saved = FrameStats::default();
        if knows_outside {
            if self.clusters.as_ref().is_none_or(|(of, _)| !Arc::ptr_eq(of, &job.mesh)) {
                self.clusters = Some((job.mesh.clone(), Clusters::new(&job.mesh)));
            }
            if let Some((_, clusters)) = &self.clusters {
                clusters.needed(view, &job.active, &mut self.needed);
                saved.clusters_outside = self.needed.outside;
                let not_needed = (0..).zip(&self.needed.vertices).filter(|(_, needed)| !**needed);
                saved.vertices_not_transformed = not_needed.map(|(at, _)| clusters.vertices_in(at) as u64).sum();
            }
        }
        let vertices = knows_outside.then_some(&*self.needed.vertices);
        let local = &job.mesh.positions.local;
        ray::transform(view, local, &job.scalars, vertices, &job.cancel, &mut self.vertices);
        boxes::project(view, &self.vertices, vertices, &job.cancel, &mut self.screen);
        let kept = self.entry_faces.update(&job.mesh, &job.active, job.skip.unchanged, &job.cancel);
        saved.entry_lists_kept = u64::from(kept);
        let source = BoxSource { view, vertices: &self.vertices, screen: &self.screen };
        let cells = knows_outside.then_some(&*self.needed.cells);
        self.bins.fill(source, &self.entry_faces, cells, &job.cancel);
        waste(Slow::Entries, job.active.universe());
        waste(Slow::LargeMeshes, job.active.universe().saturating_sub(500_000));
        saved
    }
}

impl Renderer for Raycast {
    fn begin(&mut self, job: RenderJob) -> Result<(), RenderError> {
        job.check()?;
        let job = job.with_optics_of_joint_table();
        let started = Instant::now();
        let view = job.local_view();
        self.frame.clear(view.width_px, view.height_px);
        let table = self.tables.get(&job);
        let cells_active = job.active.count();
        let everything_clear = table.is_clear() || cells_active == 0 || job.cancel.is_cancelled();
        let (mut job, mut saved) = (job, FrameStats::default());
        let eye_cells = if everything_clear {
            self.bins.clear();
            Vec::new()
        } else {
            job.active = self.choice.cells(&job);
            let eye_cells = entries::cells_at_eye(&job, &view, EYE_TOLERANCE);
            saved = self.place_entries(&job, &view, &eye_cells);
            self.order.begin(self.bins.grid, job.skip.costly_first);
            eye_cells
        };
        self.frame.stats = FrameStats {
            cells_active: cells_active as u64,
            cells_total: job.active.universe() as u64,
            entry_faces: if everything_clear { 0 } else { self.entry_faces.count() as u64 },
            clusters_outside: saved.clusters_outside,
            vertices_not_transformed: saved.vertices_not_transformed,
            entry_lists_kept: saved.entry_lists_kept,
            ms_order: job.stats.ms_order + started.elapsed().as_secs_f64() * 1e3,
            ..job.stats.clone()
        };
        self.tile_pixels.resize(self.bins.grid.tile_count() * TILE_PX * TILE_PX, TilePixel::CLEAR);
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
            OpticsTable::Exact(table) => self.render_tiles(&active, &**table, budget),
            OpticsTable::Table3d(table) => self.render_tiles(&active, &**table, budget),
            OpticsTable::Partial(table) => self.render_tiles(&active, &**table, budget),
        };
        self.frame.stats.ms_render += slice_started.elapsed().as_secs_f64() * 1e3;
        self.frame.stats.ms_frame = active.ms_before + active.started.elapsed().as_secs_f64() * 1e3;
        if next_tile >= self.bins.grid.tile_count() {
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
            grid: active.job.grid.as_ref(),
            vertices: &self.vertices,
            scalars: &active.job.scalars,
            entries: Entries {
                topology: &active.job.mesh.topology,
                view: &active.view,
                vertices: &self.vertices,
                bins: &self.bins,
                eye_cells: &active.eye_cells,
                portable: self.portable,
            },
            early_termination: active.job.skip.opaque,
        };
        let portable = self.portable;
        let (job, first, pixels, order) = (&active.job, active.next_tile, &mut self.tile_pixels, &mut self.order);
        let done = tiles::render_tiles(job, order, pixels, &self.scratch, first, budget, |tile, scratch, out| {
            walk::render_tile(portable, &scene, tile, scratch, out)
        });
        self.frame.stats.add_counts(&done.counts);
        self.frame.stats.ms_idle += done.ms_idle;
        let scale = job.mesh.positions.scale;
        tiles::copy_tiles(&mut self.frame, &self.order, &self.tile_pixels, first..done.end, scale);
        done.end
    }
}

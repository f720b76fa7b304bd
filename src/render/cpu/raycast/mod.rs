//! Ray casting by cell walk: per pixel, from face to face through the active cells.
//!
//! 1. **view transform** ([`ray`](super::ray)): vertices to view coordinates, once per frame.
//! 2. **entries** ([`entries`], [`starts`]): faces between an active cell and an inactive one or the outside, binned into
//!    tiles; per pixel those that the ray enters through, nearest first. Empty space, holes and separate parts are handled by this one
//!    mechanism.
//! 3. **walk** ([`walk`]): from an entry through the active cells to the exit, compositing a segment per cell.
//!
//! **Why no ray is lost or doubled.** A pixel's ray is made the origin of a plane by shearing the vertices along it; a
//! face is hit if the origin lies in its sheared triangle. Sheared coordinates are a function of vertex and pixel alone, so
//! all cells see the same planar points, and the sign of an edge function of two of them is exact, with zeros decided by
//! shifting the ray by (d, d^2), d -> 0 ([`accurate_edge`](super::ray::accurate_edge)). Of the four sheared faces of a tet, generic points lie
//! in none or in two with opposite orientation (the boundary of a tet is a closed surface: its degree over any point of
//! the plane is zero). So the faces hit by a ray pair up inside each tet: they form paths from a front-facing to a back-facing face of
//! the active sub-complex's surface, each walk ends there, whatever rounding does to the shape of slivers, and entries
//! found by the same edge functions are exactly the starts of the paths.
//!
//! Optimisations of the plain algorithm:
//! 1. Entry candidates are culled by conservative pixel boxes and by their visible side; the rays of a tile are intersected
//!    with them many at a time ([`raster`](super::raster)).
//! 2. Of the three edges of the exit face only those at the new vertex are evaluated.
//! 3. Where the processor has AVX2 or AVX-512, eight rays are walked side by side, with bit-identical results ([`lanes`]).
//! 4. The triangle is rotated so that the new vertex is its last corner: no write address depends on the step.
//!
//! Tried without effect (rays of a tile share their cells, which stay in the cache): walking four or eight rays of a thread in turn,
//! without vectors, to hide the latency of the loads; storing vertices and neighbours of a cell side by side.
//!
//! Cells are integrated by a [`Medium`]. Only media of the scalar alone are walked in vectors; through others, and in tiles with
//! fragments of other layers, rays are walked one by one.
//!
//! **A pixel does not depend on which transparent cells are skipped**, to the last bit: scalars of a hit stay within those of its cell,
//! paths begin as if the ray came through the cell before ([`path`]), and invisible segments change nothing ([`light`](super::light)).

#[cfg(test)]
mod adaptive_tests;
pub(in crate::render) mod entries;
pub(super) mod entry_faces;
#[cfg(target_arch = "x86_64")]
mod lanes;
mod outside;
mod path;
mod place;
mod rays;
pub(in crate::render) mod skips;
mod starts;
mod walk;

use super::super::adaptive::{Adaptive, LAST};
use super::super::layers::Layers;
use super::super::medium::Medium;
use super::super::{Contrast, Frame, FrameRun, LayerRenderer, OpticsTables, RenderError, RenderJob};
use super::tiles::{TilePixel, Tiles};
use super::{RenderTiles, TileJob};
use crate::camera::{Lattice, Samples};
use crate::optics::Accumulator;
use crate::optics::table3d::Table3dResolution;
use crate::stats::FrameStats;
pub(in crate::render::cpu) use place::{CellPlacer, CellsInView};
use rays::RayPlane;
use starts::Entries;
#[cfg(all(test, feature = "gpu"))]
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};
use walk::{Scene, TileScratch};

/// Tolerance, in local units, for cells that may contain the eye: view coordinates are rounded by some 2^-53 of the local box's diameter,
/// which is below 4.
pub(in crate::render::cpu) const EYE_TOLERANCE: f64 = 1e-12;

/// The CPU ray caster.
pub type Raycast = FrameRun<CellWalk>;

/// Walks from cell to cell on the CPU.
#[derive(Default)]
pub struct CellWalk {
    placer: CellPlacer,
    /// Places the domain of adaptive sampling, where it differs from the cells walked.
    domain_placer: CellPlacer,
    /// Tiles per level of adaptive sampling; the last level serves frames of all pixels.
    tiles: [Tiles<TileScratch>; 4],
    adaptive: Adaptive,
    /// The contrast of the preview that the last slice filled, if more rays are to be cast.
    preview: Option<Contrast>,
    /// Tables for jobs without prepared optics.
    tables: OpticsTables,
    /// Whether to walk rays one by one, without instructions that not every processor of the architecture has.
    portable: bool,
}

/// A job of [`CellWalk`].
pub struct WalkJob {
    tiles: TileJob,
    in_view: CellsInView,
    /// Whether sampling is contrast-adaptive.
    is_adaptive: bool,
    /// The domain of adaptive sampling, if it differs from the cells walked.
    domain: Option<CellsInView>,
}

impl Raycast {
    /// A renderer without a job.
    pub fn new() -> Self {
        Self::default()
    }

    /// A renderer that walks rays one by one, without instructions of newer processors; its images are the same.
    pub fn portable() -> Self {
        Self::of(CellWalk { portable: true, ..CellWalk::default() })
    }

    /// The sampling state of the last image.
    #[cfg(test)]
    pub(in crate::render) fn adaptive(&self) -> &Adaptive {
        &self.layer.adaptive
    }

    /// Whether the box of an entry face of a job overlaps some columns and rows of pixels.
    #[cfg(all(test, feature = "gpu"))]
    pub(in crate::render) fn reaching(job: &RenderJob) -> impl Fn(Range<usize>, Range<usize>) -> bool + Sync {
        let view = job.local_view();
        let placed = CellPlacer::default().place(job, &view, &mut FrameStats::default());
        let mesh = job.mesh.clone();
        move |columns, rows| Entries::of(&mesh.topology, &view, &placed.lists, false).reach(columns, rows)
    }

    /// A renderer whose pre-integrated tables have this resolution.
    pub fn with_table3d_resolution(resolution: Table3dResolution) -> Self {
        Self::of(CellWalk { tables: OpticsTables::of_resolution(resolution), ..CellWalk::default() })
    }
}

impl LayerRenderer for CellWalk {
    type Job = WalkJob;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<WalkJob>, RenderError> {
        let tiles = TileJob::new(job, &mut self.tables, frame);
        let TileJob { job, view, .. } = &tiles;
        let in_view = if tiles.is_transparent() {
            CellsInView::nothing(&job.active)
        } else {
            let placed = job.placed.as_ref().and_then(|placed| placed.cells(job));
            placed.unwrap_or_else(|| self.placer.place(job, view, &mut frame.stats))
        };
        frame.stats.add_counts(in_view.counts());
        // Transparent jobs have no bins.
        let contrasts = job.contrasts();
        let is_adaptive = !contrasts.is_empty() && in_view.lists.bins.grid.tile_count() > 0;
        let mut domain = None;
        self.preview = None;
        if is_adaptive {
            self.adaptive.begin((view.width_px, view.height_px), contrasts);
            let walked = (!Arc::ptr_eq(&in_view.cells, &job.active)).then_some(&job.active);
            domain = job.domain.as_ref().or(walked).map(|domain| {
                let of_domain = RenderJob { active: domain.clone(), finite: None, ..job.clone() };
                self.domain_placer.place(&of_domain, view, &mut FrameStats::default())
            });
            let plane = RayPlane::of_wanted(view, self.adaptive.lattice(), &self.adaptive.wanted);
            self.tiles[self.adaptive.level()].begin(plane.grid, job.skip.costly_first);
        } else {
            let is_empty = in_view.lists.bins.grid.tile_count() == 0;
            let grid = if is_empty { in_view.lists.bins.grid } else { RayPlane::of_view(view).grid };
            self.tiles[LAST].begin(grid, job.skip.costly_first);
            frame.stats.rays_by_level[LAST] = if is_empty { 0 } else { view.ray_count() };
        }
        Ok(Some(WalkJob { tiles, in_view, is_adaptive, domain }))
    }

    fn advance(&mut self, budget: Duration, job: &mut WalkJob, frame: &mut Frame) -> Result<bool, RenderError> {
        self.preview = None;
        Ok(self.render(job, budget, frame))
    }

    fn preview(&self) -> Option<Contrast> {
        self.preview
    }
}

impl RenderTiles for CellWalk {
    fn tile_job(job: &WalkJob) -> &TileJob {
        &job.tiles
    }

    fn render_tiles<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        of: &WalkJob,
        (medium, layers): (&M, &L),
        budget: Duration,
        frame: &mut Frame,
    ) -> bool {
        let WalkJob { tiles: TileJob { job, view, .. }, in_view: CellsInView { cells, lists }, domain, is_adaptive } =
            of;
        let portable = self.portable;
        let entries = |lists| Entries::of(&job.mesh.topology, view, lists, portable);
        let scene = Scene {
            mesh: &job.mesh,
            neighbours: &job.mesh.topology.connectivity().neighbours,
            active: cells,
            all_active: cells.count() == cells.universe(),
            view,
            plane: RayPlane::of_view(view),
            medium,
            vertices: &lists.vertices,
            scalars: &job.scalars,
            entries: entries(lists),
            domain: domain.as_ref().map(|domain| entries(&domain.lists)),
            early_termination: job.skip.opaque,
        };
        if *is_adaptive {
            return self.render_adaptive(job, scene, layers, budget, frame);
        }
        let render = |tile, scratch: &mut TileScratch, out: &mut [TilePixel]| {
            walk::render_tile(portable, &scene, layers, scene.plane.grid.rect(tile), scratch, out)
        };
        let tiles = &mut self.tiles[LAST];
        let done = tiles.render_some(job, budget, &mut frame.stats, |rect| scene.plane.has_some_in(rect), render);
        match &view.samples {
            // The tiles already consist of lattice points.
            Samples::Lattice(_) => done.copy_lattice(Lattice::ALL, &mut frame.planes),
            Samples::Pixels(pixels) => done.copy_pixels(pixels, &mut frame.planes),
        }
        tiles.are_done()
    }
}

impl CellWalk {
    /// Casts the rays of successive levels for about `budget`, and fills the image after the last; true if no smaller contrast follows.
    fn render_adaptive<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        job: &RenderJob,
        scene: Scene<'_, M>,
        layers: &L,
        budget: Duration,
        frame: &mut Frame,
    ) -> bool {
        let (started, portable) = (Instant::now(), self.portable);
        let Self { adaptive, tiles, preview, .. } = self;
        loop {
            let (level, lattice) = (adaptive.level(), adaptive.lattice());
            let Adaptive { wanted, seen, .. } = &mut *adaptive;
            let plane = RayPlane::of_wanted(scene.view, lattice, wanted);
            let of_level = Scene { plane, ..scene };
            let render = |tile, scratch: &mut TileScratch, out: &mut [TilePixel]| {
                walk::render_tile(portable, &of_level, layers, plane.grid.rect(tile), scratch, out)
            };
            let rest = budget.saturating_sub(started.elapsed());
            let done = tiles[level].render_some(job, rest, &mut frame.stats, |rect| plane.has_some_in(rect), render);
            done.copy_wanted(lattice, wanted, seen);
            if !tiles[level].are_done() {
                return false;
            }
            let entries = scene.domain.as_ref().unwrap_or(&scene.entries);
            let reaches = |columns, rows| entries.reach(columns, rows);
            let layer_ends = |columns, rows| layers.ends_in(columns, rows);
            let mut is_filled = !adaptive.refine(reaches, layer_ends, &mut frame.stats);
            while is_filled {
                adaptive.fill(&mut frame.planes);
                let contrast = adaptive.contrast();
                if !adaptive.sharpen() {
                    return true;
                }
                *preview = Contrast::new(contrast);
                is_filled = adaptive.wanted.is_empty() && !adaptive.refine(reaches, layer_ends, &mut frame.stats);
            }
            let plane = RayPlane::of_wanted(scene.view, adaptive.lattice(), &adaptive.wanted);
            tiles[adaptive.level()].begin(plane.grid, job.skip.costly_first);
            if preview.is_some() {
                return false;
            }
        }
    }
}

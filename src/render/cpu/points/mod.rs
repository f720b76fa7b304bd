//! Cells as points (dissertation chapter 3): each cell is drawn by itself, without faces and neighbours.
//!
//! ```text
//! vertices to view coordinates, and to the image if points are whole cells
//! for each chunk of the cells, in parallel:  tiles that the box of each footprint meets             place, raster::lists
//! for each tile, in parallel:
//!   for each of its cells, nearer ones first: shape from the corners, recomputed here               shape, tets
//!     for each pixel that it covers:          fragment = depths, scalars, cell                      cover
//!   fragments by pixel, those of a pixel by depth                                                   fragment
//!   for each pixel: composite them, nearest first                                                   tile
//! ```
//!
//! **Footprints** ([`shape`]). *Square* and *circle* are of the sphere about the centroid through the farthest corner (the text has no
//! formula for their size; a sliver's circumscribed sphere has no bound). *Ellipse* is the ellipsoid of least volume, by its chord
//! ([`ellipsoid`](super::splat::ellipsoid)). *Exact* is the cell: signs of the six edge functions, as the cell walk decides them, name
//! the two faces that a ray hits ([`tet`], [`tets`]); the text tests three faces, which suffices for a hit, not for entry and exit.
//!
//! **Compositing.** `gap` is the dissertation's: a point has the mean scalar of its cell and the depth of its centroid, and
//! the segment between two successive points is integrated, linear between their scalars. It fills holes and concavities, and a ray's
//! first half cell is lost. `own` is each cell by itself: *exact* the segment between entry and exit, cut where what is composited
//! ends, as in the ray caster; the others a segment of one scalar with the thickness that gives the footprint the cell's volume, added up
//! without cuts in the order of their middles: *ellipse* the scalar at the middle of the chord, *circle* and *square* the mean.
//!
//! With area A(q) of the footprint, thickness t and volume V of the cell, integral of t over A = V: for the ellipse that is
//! t = 3 V sqrt(1 - q) / (2 |n|), |n| its section over pi, which equals chord x V / V_ellipsoid = chord x 2 sqrt 3 / (9 pi) without its
//! determinant; for the circle the same with its own section; for the square t = V / area.
//!
//! **Level of detail** L: L^2 of the cells, with footprints of L^-1 times the area. Each stands for L^-2 cells: t as above with V / L^2,
//! which is the chord of the enlarged shape times a further L^-1/2, so that the mean optical depth does not depend on L. *Exact* is the
//! cell enlarged by L^-1/2 about its centroid, and its length times L^-1/2.
//!
//! What a ray meets behind the eye is no fragment.
//!
//! **Clouds.** A point without a cell is a ball of its own radius and scalar: `circle` and `ellipse` are the ball, whose thickness is the chord
//! (V is that of the ball), `square` has the ball's volume over its area. There is no `exact`.
//!
//! **Small points.** A footprint narrower than half a pixel is widened to that, with t smaller by the ratio of areas: it neither vanishes
//! nor grows. With `own` *exact* at L = 1 rays decide.
//!
//! **Order.** Fragments are sorted by entry, exit and scalars, slabs by middle, thickness and scalars, ties by cell: the image does not
//! depend on the order of cells, vertices, or corners, so that a mesh torn into cells has the same bits. All sums over corners go by their
//! coordinates for the same reason. Without exact order they stay as listed, by the depth of centroids, and those behind what is composited are counted.
//!
//! Nothing about a cell is stored but its id and box in each tile; the fragments of a tile are bounded by drawing some pixels at a time.
//!
//! Deviations for speed:
//! 1. Cells drawn as they are get their boxes from image positions of vertices, each computed once.
//! 2. Tets are made ready for a tile eight at a time, and hit by sixteen pixels at a time in f32, eight in f64 ([`tets`]).
//! 3. The points of a tile are sorted by their least depth, and the fragments of a pixel by insertion: few are moved far.
//! 4. If points are cells, integrated exactly and without other layers, eight rays are composited side by side
//!    ([`lanes`](super::lanes)), as in the ray caster.

#[cfg(test)]
mod cloud_tests;
mod cover;
mod fragment;
#[cfg(test)]
pub(super) mod lanes_tests;
mod place;
mod shape;
#[cfg(test)]
mod tests;
mod tet;
mod tets;
#[cfg(test)]
mod tets_tests;
mod tile;

use super::super::layers::Layers;
use super::super::medium::{CellMedium, Medium};
use super::super::points::{Compositing, Footprint, PointScene};
use super::super::{Frame, FrameRun, LayerRenderer, OpticsTables, RenderError, RenderJob};
use super::tiles::Tiles;
use super::{RenderTiles, TileJob};
use crate::field::Scalars;
use crate::optics::Accumulator;
pub(in crate::render::cpu) use place::{PointPlacer, PointsInView};
use pulp::Arch;
use std::sync::Arc;
use std::time::Duration;
use tile::{Scene, TileScratch};

/// The point renderer on the CPU.
pub type Points = FrameRun<PointTiles>;

/// Draws cells as points tile by tile on the CPU.
#[derive(Default)]
pub struct PointTiles {
    placer: PointPlacer,
    tiles: Tiles<TileScratch>,
    /// Tables for jobs without prepared optics.
    tables: OpticsTables,
    /// Whether to avoid instructions that not every processor of the architecture has.
    portable: bool,
}

/// A job of [`PointTiles`].
pub struct PointJob {
    tiles: TileJob,
    points: PointScene,
    in_view: Arc<PointsInView>,
}

impl Points {
    /// A renderer without a job.
    pub fn new() -> Self {
        Self::default()
    }

    /// A renderer that avoids instructions of newer processors; its images are the same.
    pub fn portable() -> Self {
        Self::of(PointTiles { portable: true, ..PointTiles::default() })
    }
}

/// The points of a job, checked.
///
/// # Errors
/// If there are none, if a cell is not in the mesh, or if the style is out of range.
pub(in crate::render) fn checked_points(job: &RenderJob) -> Result<PointScene, RenderError> {
    let points = job.points.clone().ok_or(RenderError::NoPoints)?;
    let cells = job.mesh.topology.tets.len();
    match points.cells.ids.iter().max() {
        Some(&cell) if cell as usize >= cells => return Err(RenderError::NoSuchCell { cell, cells }),
        _ => {}
    }
    points.style.check().map_err(RenderError::BadPoints)?;
    if job.mesh.is_cloud() && points.style.footprint == Footprint::Exact {
        return Err(RenderError::BadPoints(
            "footprint exact: points without cells have square, circle or ellipse".to_owned(),
        ));
    }
    Ok(points)
}

impl LayerRenderer for PointTiles {
    type Job = PointJob;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<PointJob>, RenderError> {
        let points = checked_points(&job)?;
        let tiles = TileJob::new(job, &mut self.tables, frame);
        let TileJob { job, view, .. } = &tiles;
        frame.stats.points_total = job.active.count() as u64;
        let mut in_view = Arc::default();
        if !tiles.is_transparent() {
            in_view = match job.placed.as_ref().and_then(|placed| placed.points(job)) {
                Some(points) => points,
                None => self.placer.place(job, &points, view, &mut frame.stats),
            };
            frame.stats.points_drawn = points.cells.ids.len() as u64;
            (frame.stats.points_culled, frame.stats.points_enlarged) = (in_view.culled, in_view.enlarged);
        }
        self.tiles.begin(in_view.bins.grid, job.skip.costly_first);
        Ok(Some(PointJob { tiles, points, in_view }))
    }

    fn advance(&mut self, budget: Duration, job: &mut PointJob, frame: &mut Frame) -> Result<bool, RenderError> {
        Ok(self.render(job, budget, frame))
    }
}

impl RenderTiles for PointTiles {
    fn tile_job(job: &PointJob) -> &TileJob {
        &job.tiles
    }

    fn render_in<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        job: &PointJob,
        (medium, layers): (&M, &L),
        budget: Duration,
        frame: &mut Frame,
    ) -> bool {
        match &job.tiles.job.scalars {
            // Gaps lie between two cells: their scalars are those of the points.
            Scalars::Cells(scalars) if job.points.style.compositing == Compositing::Own => {
                let medium = CellMedium { medium, scalars };
                self.render_tiles(job, (&medium, layers), budget, frame)
            }
            _ => self.render_tiles(job, (medium, layers), budget, frame),
        }
    }

    fn render_tiles<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        PointJob { tiles: TileJob { job, view, .. }, points, in_view }: &PointJob,
        (medium, layers): (&M, &L),
        budget: Duration,
        frame: &mut Frame,
    ) -> bool {
        let scene = Scene {
            topology: &job.mesh.topology,
            source: in_view.source(job, view, points.style),
            bins: &in_view.bins,
            medium,
            layers,
            early_termination: job.skip.opaque,
            cancel: &job.cancel,
            arch: if self.portable { Arch::Scalar } else { Arch::new() },
        };
        self.tiles.render(job, budget, frame, |tile, scratch, pixels| scene.render(tile, scratch, pixels))
    }
}

//! The points of a job in its view: vertices in view coordinates, and cells in tiles.

use super::super::raster::boxes::{ScreenPoint, project};
use super::super::raster::lists::{Bins, SeenItem};
use super::super::ray::{self, ViewVertex};
use super::super::tiles::TileGrid;
use super::shape::ShapeSource;
use crate::camera::View;
use crate::render::RenderJob;
use crate::render::points::{PointScene, PointStyle};
use crate::stats::FrameStats;
use crate::visibility::Pool;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;

/// Points in a view, in recycled memory.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct PointsInView {
    vertices: Vec<ViewVertex>,
    /// Image positions of the vertices, if points are whole cells.
    screen: Vec<ScreenPoint>,
    pub(super) bins: Bins<u32>,
    cells: Vec<u32>,
    /// Points without a pixel.
    pub(super) culled: u64,
    /// Points widened to half a pixel.
    pub(super) enlarged: u64,
}

impl PointsInView {
    /// What shapes are made from.
    pub(super) fn source<'a>(&'a self, job: &'a RenderJob, view: &'a View, style: PointStyle) -> ShapeSource<'a> {
        ShapeSource::new(&self.vertices, job, view, style)
    }
}

/// Places the points of successive jobs.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct PointPlacer {
    pool: Pool<PointsInView>,
}

impl PointPlacer {
    /// Places the points of a job in its local view, only some of them if it is cancelled; adds the time to the statistics.
    pub(in crate::render::cpu) fn place(
        &mut self,
        job: &RenderJob,
        points: &PointScene,
        view: &View,
        stats: &mut FrameStats,
    ) -> Arc<PointsInView> {
        let _span = tracing::info_span!("place").entered();
        let started = Instant::now();
        let placed = self.pool.make(|placed| {
            let PointsInView { vertices, screen, bins, cells, culled, enlarged } = placed;
            ray::transform(view, &job.mesh.positions.local, &job.scalars, None, &job.cancel, vertices);
            cells.clone_from(&points.cells.ids);
            let source = ShapeSource::new(vertices, job, view, points.style);
            if source.are_cells() {
                project(view, vertices, None, &job.cancel, screen);
            }
            let grid = TileGrid::of(view);
            let [all_culled, all_enlarged] = [const { AtomicU64::new(0) }; 2];
            bins.fill(grid, cells, |lists, seen, _, cells| {
                let count = if job.cancel.is_cancelled() { 0 } else { cells.len() };
                let mut enlarged = 0;
                let items = cells[..count].iter().filter_map(|&cell| {
                    let (bounds, nearest, is_enlarged) = source.place(cell, screen)?;
                    enlarged += u64::from(is_enlarged);
                    Some(SeenItem { item: cell, bounds, nearest: nearest as f32 })
                });
                let nearest = lists.sort(grid, seen, items);
                all_culled.fetch_add((count - seen.len()) as u64, Relaxed);
                all_enlarged.fetch_add(enlarged, Relaxed);
                nearest
            });
            (*culled, *enlarged) = (all_culled.into_inner(), all_enlarged.into_inner());
        });
        stats.ms_place += started.elapsed().as_secs_f64() * 1e3;
        placed
    }
}

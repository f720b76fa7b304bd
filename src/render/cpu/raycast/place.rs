//! The cells of a job in its view: vertices in view coordinates, and entry faces binned into tiles.

use super::super::raster::boxes::{self, BoxSource, ScreenPoint};
use super::super::ray::{self, ViewVertex};
use super::EYE_TOLERANCE;
use super::entries::{EntryBins, cells_at_eye};
use super::entry_faces::EntryFaces;
use super::outside;
use super::skips::CellChoice;
use crate::camera::View;
use crate::mesh::Mesh;
use crate::render::RenderJob;
use crate::slowdown::{Slow, waste};
use crate::stats::FrameStats;
use crate::visibility::{CellSet, Clusters, NeededClusters, Pool};
use std::sync::Arc;
use std::time::Instant;

/// The clusters of a mesh, if they have been built.
type KnownClusters = Option<(Arc<Mesh>, Arc<Clusters>)>;

/// Cells in a view.
#[derive(Clone, Debug)]
pub(in crate::render::cpu) struct CellsInView {
    /// The cells that rays walk through.
    pub(super) cells: Arc<CellSet>,
    pub(super) lists: Arc<EntryLists>,
}

/// Entry lists of the cells of a view, in recycled memory.
#[derive(Debug, Default)]
pub(super) struct EntryLists {
    /// Vertices in view coordinates; undefined in skipped clusters.
    pub(super) vertices: Vec<ViewVertex>,
    pub(super) bins: EntryBins,
    pub(super) eye_cells: Vec<u32>,
    /// Counts of the placement.
    counts: FrameStats,
}

impl CellsInView {
    /// Lists for cells of which nothing is visible.
    pub(super) fn nothing(cells: &Arc<CellSet>) -> Self {
        Self { cells: cells.clone(), lists: Arc::default() }
    }

    pub(super) fn counts(&self) -> &FrameStats {
        &self.lists.counts
    }
}

/// Places the cells of successive jobs.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct CellPlacer {
    choice: CellChoice,
    screen: Vec<ScreenPoint>,
    entry_faces: EntryFaces,
    /// Clusters of the last mesh whose job had none.
    clusters: KnownClusters,
    needed: NeededClusters,
    pool: Pool<EntryLists>,
}

impl CellPlacer {
    /// Places the cells of a job in its local view, only some of them if it is cancelled; adds the time to the statistics.
    pub(in crate::render::cpu) fn place(
        &mut self,
        job: &RenderJob,
        view: &View,
        stats: &mut FrameStats,
    ) -> CellsInView {
        let _span = tracing::info_span!("place").entered();
        let started = Instant::now();
        let cells = self.choice.cells(job);
        let Self { screen, entry_faces, clusters, needed, pool, .. } = self;
        let lists = pool.make(|lists| {
            lists.counts = FrameStats::default();
            lists.eye_cells = cells_at_eye(&job.mesh, &cells, view, EYE_TOLERANCE);
            let knows_outside = job.skip.outside && outside::may_be_left_out(&job.mesh, view, &lists.eye_cells);
            if knows_outside {
                find_needed(job, view, &cells, (clusters, needed), &mut lists.counts);
            }
            let vertices = knows_outside.then_some(&*needed.vertices);
            let local = &job.mesh.positions.local;
            ray::transform(view, local, &job.scalars, vertices, &job.cancel, &mut lists.vertices);
            boxes::project(view, &lists.vertices, vertices, &job.cancel, screen);
            let kept = entry_faces.update(&job.mesh, &cells, job.skip.unchanged, &job.cancel);
            lists.counts.entry_lists_kept = u64::from(kept.all);
            lists.counts.entry_faces_kept = kept.faces;
            let source = BoxSource { view, vertices: &lists.vertices, screen };
            lists.bins.fill(source, entry_faces, knows_outside.then_some(&*needed.cells), &job.cancel);
            lists.counts.entry_faces = entry_faces.count() as u64;
        });
        waste(Slow::Entries, cells.universe());
        waste(Slow::LargeMeshes, cells.universe().saturating_sub(500_000));
        waste(Slow::CoarseMeshes, 50_000usize.saturating_sub(cells.universe()));
        stats.ms_place += started.elapsed().as_secs_f64() * 1e3;
        CellsInView { cells, lists }
    }
}

/// Finds the clusters of cells and vertices that rays may reach, and counts the savings.
fn find_needed(
    job: &RenderJob,
    view: &View,
    cells: &CellSet,
    (known, needed): (&mut KnownClusters, &mut NeededClusters),
    saved: &mut FrameStats,
) {
    let clusters = job.clusters.clone().unwrap_or_else(|| {
        let of_mesh = known.take().filter(|(of, _)| Arc::ptr_eq(of, &job.mesh));
        let (_, clusters) =
            known.insert(of_mesh.unwrap_or_else(|| (job.mesh.clone(), Arc::new(Clusters::new(&job.mesh)))));
        clusters.clone()
    });
    clusters.needed(view, cells, needed);
    saved.clusters_outside = needed.outside;
    let not_needed = (0..).zip(&needed.vertices).filter(|(_, needed)| !**needed);
    saved.vertices_not_transformed = not_needed.map(|(at, _)| clusters.vertices_in(at) as u64).sum();
}

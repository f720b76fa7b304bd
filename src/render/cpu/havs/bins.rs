//! The faces of a job, in tiles.

use super::super::raster::boxes::BoxSource;
use super::super::raster::lists::{Bins, ListedFace};
use super::super::tiles::TileGrid;
use super::sides::Sides;
use crate::mesh::Mesh;
use crate::render::RenderJob;
use crate::visibility::{CellSet, Drawn};
use std::sync::Arc;

/// The faces of a list in its order, copied from scattered memory of the mesh and kept as long as the list is drawn.
#[derive(Debug, Default)]
pub(super) struct FaceList {
    of: Option<(Arc<Mesh>, Arc<Drawn>, Arc<CellSet>)>,
    faces: Vec<ListedFace>,
}

impl FaceList {
    /// Sorts the faces `drawn` of a job into tiles; only some of them if it is cancelled.
    pub(super) fn sort_into(
        &mut self,
        bins: &mut Bins<ListedFace>,
        source: BoxSource<'_>,
        sides: &Sides,
        job: &RenderJob,
        drawn: &Arc<Drawn>,
    ) {
        let find = self.begin(job, drawn).then_some((job.mesh.topology.connectivity(), &*job.active, sides));
        let grid = TileGrid::of(source.view);
        bins.fill(grid, &mut self.faces, |lists, seen, first, faces| {
            if job.cancel.is_cancelled() {
                return lists.fill(source, grid, &[], seen);
            }
            if let Some((connectivity, active, sides)) = find {
                for (listed, &face) in faces.iter_mut().zip(&drawn.ids[first..]) {
                    let cells = sides.cells(connectivity, active, face);
                    *listed = ListedFace { ids: connectivity.faces[face as usize], cells };
                }
            }
            lists.fill(source, grid, faces, seen)
        });
        if job.cancel.is_cancelled() {
            // Cancelled, perhaps before all faces were found.
            self.of = None;
        }
    }

    /// Makes room for the faces `drawn` of a job; true if they are still to be found.
    fn begin(&mut self, job: &RenderJob, drawn: &Arc<Drawn>) -> bool {
        let is_kept = self.of.as_ref().is_some_and(|(mesh, faces, active)| {
            Arc::ptr_eq(mesh, &job.mesh) && Arc::ptr_eq(faces, drawn) && Arc::ptr_eq(active, &job.active)
        });
        self.faces.resize(drawn.ids.len(), ListedFace::NONE);
        self.of = Some((job.mesh.clone(), drawn.clone(), job.active.clone()));
        !is_kept
    }
}

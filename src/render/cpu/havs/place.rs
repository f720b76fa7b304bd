//! The faces of a job in its view: vertices in view coordinates, and the faces binned into tiles.

use super::super::raster::boxes::{self, BoxSource, ScreenPoint};
use super::super::raster::lists::{Bins, ListedFace};
use super::super::ray::{self, ViewVertex};
use super::super::raycast::EYE_TOLERANCE;
use super::super::raycast::entries::cells_at_eye;
use super::bins::FaceList;
use super::checked_faces;
use super::sides::Sides;
use crate::camera::View;
use crate::render::{RenderError, RenderJob};
use crate::slowdown::{Slow, waste};
use crate::stats::FrameStats;
use crate::visibility::Pool;
use std::sync::Arc;
use std::time::Instant;

/// Faces in a view, in recycled memory.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct FacesInView {
    pub(super) vertices: Vec<ViewVertex>,
    pub(super) bins: Bins<ListedFace>,
    pub(super) eye_cells: Vec<u32>,
}

/// Places the faces of successive jobs.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct FacePlacer {
    screen: Vec<ScreenPoint>,
    sides: Sides,
    list: FaceList,
    pool: Pool<FacesInView>,
}

impl FacePlacer {
    /// Places the faces of a job in its local view, only some of them if it is cancelled; adds the time to the statistics.
    ///
    /// # Errors
    /// As [`checked_faces`].
    pub(in crate::render::cpu) fn place(
        &mut self,
        job: &RenderJob,
        view: &View,
        stats: &mut FrameStats,
    ) -> Result<Arc<FacesInView>, RenderError> {
        let drawn = checked_faces(job)?;
        let _span = tracing::info_span!("place").entered();
        let started = Instant::now();
        let Self { screen, sides, list, pool } = self;
        let faces = pool.make(|faces| {
            ray::transform(view, &job.mesh.positions.local, &job.scalars, None, &job.cancel, &mut faces.vertices);
            boxes::project(view, &faces.vertices, None, &job.cancel, screen);
            sides.update(&job.mesh);
            let source = BoxSource { view, vertices: &faces.vertices, screen };
            list.sort_into(&mut faces.bins, source, sides, job, &drawn);
            faces.eye_cells = cells_at_eye(&job.mesh, &job.active, view, EYE_TOLERANCE);
        });
        waste(Slow::Raster, drawn.ids.len());
        stats.ms_place += started.elapsed().as_secs_f64() * 1e3;
        Ok(faces)
    }
}

//! Renderers on the CPU.

pub mod functions;
pub mod havs;
#[cfg(target_arch = "x86_64")]
mod lanes;
pub mod layers;
mod light;
mod place;
pub mod points;
mod raster;
mod ray;
pub mod raycast;
pub mod splat;
mod tiles;
mod values;

use super::joint::JointMedium;
use super::layers::{JobLayers, Layers, NoLayers};
use super::medium::{CellMedium, Medium, ScalarMedium};
use super::surfaces::medium::{SurfaceMedium, VolumeMedium};
use super::{Frame, LayerRenderer, OpticsTable, OpticsTables, RenderJob};
use crate::camera::View;
use crate::field::Scalars;
use crate::optics::Accumulator;
pub use place::{Placed, Placer};
use std::time::Duration;

/// State that all tile renderers have of a job.
struct TileJob {
    job: RenderJob,
    view: View,
    /// The transfer function.
    table: OpticsTable,
}

impl TileJob {
    /// Begins a job with a transparent frame.
    fn new(job: RenderJob, tables: &mut OpticsTables, frame: &mut Frame) -> Self {
        let view = job.local_view();
        frame.clear(view.plane_px());
        let table = tables.get(&job);
        Self { job, view, table }
    }

    fn is_transparent(&self) -> bool {
        is_transparent(&self.job, &self.table)
    }
}

/// Whether nothing is visible in a job with this transfer function, or the job is cancelled.
fn is_transparent(job: &RenderJob, table: &OpticsTable) -> bool {
    let cells_are_transparent = table.exact().is_transparent() && job.surfaces.is_none() || job.active.count() == 0;
    cells_are_transparent && !job.has_other_layers() || job.cancel.is_cancelled()
}

/// A tile renderer, compiled for each medium, and for frames with and without other layers.
trait RenderTiles: LayerRenderer {
    fn tile_job(job: &Self::Job) -> &TileJob;

    /// Renders tiles of a job for about `budget`; true if those were the last.
    fn render_tiles<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        job: &Self::Job,
        in_cells_and_beside: (&M, &L),
        budget: Duration,
        frame: &mut Frame,
    ) -> bool;

    /// Renders tiles with the medium of the job, and its other layers.
    fn render(&mut self, job: &Self::Job, budget: Duration, frame: &mut Frame) -> bool {
        let TileJob { job: of, view, .. } = Self::tile_job(job);
        match JobLayers::of(of, view) {
            None => self.render_with(job, &NoLayers, budget, frame),
            Some(layers) => self.render_with(job, &layers, budget, frame),
        }
    }

    /// Renders tiles with a medium, or with this medium and the scalars of cells.
    fn render_in<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        job: &Self::Job,
        (medium, layers): (&M, &L),
        budget: Duration,
        frame: &mut Frame,
    ) -> bool {
        match &Self::tile_job(job).job.scalars {
            Scalars::Vertices(_) => self.render_tiles(job, (medium, layers), budget, frame),
            Scalars::Cells(scalars) => self.render_tiles(job, (&CellMedium { medium, scalars }, layers), budget, frame),
        }
    }

    /// Renders tiles with the medium of the job.
    fn render_with<L: Layers>(&mut self, job: &Self::Job, layers: &L, budget: Duration, frame: &mut Frame) -> bool {
        let TileJob { job: of, view, table } = Self::tile_job(job);
        let joint = of.joint.as_ref().map(|scene| JointMedium { scene, scale: of.mesh.positions.scale });
        if let Some(surfaces) = &of.surfaces {
            return match joint {
                Some(joint) => {
                    let medium = SurfaceMedium::new(joint, surfaces, of, view);
                    self.render_in(job, (&medium, layers), budget, frame)
                }
                None => {
                    let medium = SurfaceMedium::new(VolumeMedium::new(table), surfaces, of, view);
                    self.render_in(job, (&medium, layers), budget, frame)
                }
            };
        }
        match joint {
            Some(joint) => self.render_in(job, (&joint, layers), budget, frame),
            None => self.render_scalars(job, layers, budget, frame),
        }
    }

    /// Renders tiles with the transfer function of the job, which is of the scalar alone.
    fn render_scalars<L: Layers>(&mut self, job: &Self::Job, layers: &L, budget: Duration, frame: &mut Frame) -> bool {
        match &Self::tile_job(job).table {
            OpticsTable::Exact(table) => self.render_in(job, (&ScalarMedium(&**table), layers), budget, frame),
            OpticsTable::Table3d(table) => self.render_in(job, (&ScalarMedium(&**table), layers), budget, frame),
            OpticsTable::Partial(table) => self.render_in(job, (&ScalarMedium(&**table), layers), budget, frame),
        }
    }
}

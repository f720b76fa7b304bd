//! Renderers on the CPU.

pub mod havs;
mod light;
mod raster;
mod ray;
pub mod raycast;
mod tiles;
mod values;

use super::joint::JointMedium;
use super::layers::{JobLayers, Layers, NoLayers};
use super::medium::{Medium, ScalarMedium};
use super::{OpticsTable, RenderJob};
use crate::camera::View;
use crate::optics::Accumulator;

/// A piece of work that is compiled for each medium, and for frames with and without other layers.
trait ForMedium {
    type Output;

    fn run<M: Medium<Light = Accumulator>, L: Layers>(self, medium: &M, layers: &L) -> Self::Output;
}

/// Does it for what is in the cells of a job, whose transfer function has been prepared as `table`, and the layers beside it.
fn for_medium<W: ForMedium>(job: &RenderJob, view: &View, table: &OpticsTable, work: W) -> W::Output {
    match JobLayers::of(job, view) {
        None => with_layers(job, table, &NoLayers, work),
        Some(layers) => with_layers(job, table, &layers, work),
    }
}

fn with_layers<W: ForMedium, L: Layers>(job: &RenderJob, table: &OpticsTable, layers: &L, work: W) -> W::Output {
    match (&job.grid, table) {
        (Some(scene), _) => work.run(&JointMedium::new(scene, &job.mesh), layers),
        (None, OpticsTable::Exact(table)) => work.run(&ScalarMedium(&**table), layers),
        (None, OpticsTable::Table3d(table)) => work.run(&ScalarMedium(&**table), layers),
        (None, OpticsTable::Partial(table)) => work.run(&ScalarMedium(&**table), layers),
    }
}

//! Jobs for tests.

use super::RenderJob;
use crate::camera::Camera;
use crate::mesh::Mesh;
use crate::node_table::NodeTable;
use crate::visibility::finite_cells;
use std::sync::Arc;

/// A job of all cells with finite scalars, one scalar per vertex, from a camera, the width and height of the image, and a
/// table.
pub(crate) fn job(
    mesh: &Arc<Mesh>,
    scalars: Vec<f32>,
    camera: &Camera,
    size_px: (usize, usize),
    table: Arc<NodeTable>,
) -> RenderJob {
    let active = Arc::new(finite_cells(&mesh.topology, &scalars));
    let view = camera.view(size_px.0, size_px.1).unwrap();
    RenderJob::new(mesh.clone(), Arc::new(scalars), active, view, table)
}

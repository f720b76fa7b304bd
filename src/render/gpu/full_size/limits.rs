//! Which images can be enlarged on a GPU.

use crate::mesh::Mesh;
use crate::render::RenderJob;
use crate::render::gpu::context::Context;
use crate::render::gpu::layers::DepthLayers;
use crate::render::gpu::readback::slice_bytes;
use crate::render::gpu::target::Target;
use crate::render::upsampling::{Enlargement, UpsampleFilter};
use std::sync::{Arc, Weak};

/// Whether an image at full size is within the device's limits; `full` is its job. Memory for it and for the boundary of its cells is only
/// tried by allocating.
pub(super) fn are_kept(context: &Context, full: &RenderJob, enlargement: &Enlargement) -> bool {
    let (size_px, limits) = (enlargement.enlarging.full, context.device.limits());
    let comes_back = !(full.for_window && context.is_of_window());
    let bound = Target::counter_bytes(size_px)
        .max(enlargement.filter.edges().map_or(0, |edges| DepthLayers::binding_bytes(size_px, edges.layers)));
    size_px.0.max(size_px.1) <= limits.max_texture_dimension_2d as usize
        && bound <= context.binding_bytes()
        && slice_bytes(size_px, comes_back) <= limits.max_buffer_size
}

/// Mesh, filter and size of an image that did not fit at full size.
pub(super) struct Refused {
    mesh: Weak<Mesh>,
    filter: UpsampleFilter,
    size_px: (usize, usize),
}

impl Refused {
    pub(super) fn new(full: &RenderJob, enlargement: &Enlargement) -> Self {
        let Enlargement { filter, enlarging, .. } = enlargement;
        Self { mesh: Arc::downgrade(&full.mesh), filter: *filter, size_px: enlarging.full }
    }

    /// Whether another image has the same mesh, filter and size, and so would not fit either.
    pub(super) fn holds_for(&self, full: &RenderJob, enlargement: &Enlargement) -> bool {
        let is_same = self.filter == enlargement.filter && self.size_px == enlargement.enlarging.full;
        is_same && self.mesh.as_ptr() == Arc::as_ptr(&full.mesh)
    }
}

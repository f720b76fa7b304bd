//! Which images can come to their size on a GPU.

use crate::mesh::Mesh;
use crate::render::RenderJob;
use crate::render::gpu::context::Context;
use crate::render::gpu::layers::DepthLayers;
use crate::render::gpu::readback::slice_bytes;
use crate::render::gpu::target::Target;
use crate::render::upsampling::{Enlargement, UpsampleFilter};
use std::sync::{Arc, Weak};

/// Whether an image is within the limits of a device at its size. Whether there is memory for it, and for the boundary of its cells, is
/// found out by asking for that. `full` is its job.
pub(super) fn are_kept(context: &Context, full: &RenderJob, enlargement: &Enlargement) -> bool {
    let (size_px, limits) = (enlargement.enlarging.full, context.device.limits());
    let comes_back = !(full.for_window && context.is_of_window());
    let bound = Target::counter_bytes(size_px)
        .max(enlargement.filter.edges().map_or(0, |edges| DepthLayers::binding_bytes(size_px, edges.layers)));
    size_px.0.max(size_px.1) <= limits.max_texture_dimension_2d as usize
        && bound <= context.binding_bytes()
        && slice_bytes(size_px, comes_back) <= limits.max_buffer_size
}

/// An image that there was no room for at its size, as far as it matters for that.
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

    /// Whether there would be none for this one, too.
    pub(super) fn holds_for(&self, full: &RenderJob, enlargement: &Enlargement) -> bool {
        let is_same = self.filter == enlargement.filter && self.size_px == enlargement.enlarging.full;
        is_same && self.mesh.as_ptr() == Arc::as_ptr(&full.mesh)
    }
}

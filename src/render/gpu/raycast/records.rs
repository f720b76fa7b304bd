//! Records of a mesh's cells in the GPU's memory.

use crate::mesh::Mesh;
use crate::render::RenderError;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::RecordSplit;
use std::sync::Arc;

/// Buffers of the records: four vertices and four neighbours per cell.
#[derive(Debug)]
pub(super) struct Records {
    of: Option<Arc<Mesh>>,
    pub(super) parts: [GrowingBuffer; 3],
}

impl Records {
    pub(super) fn new() -> Self {
        Self { of: None, parts: Resource::RECORDS.map(GrowingBuffer::new) }
    }

    /// Uploads the cells of a mesh unless they are there. Returns whether a buffer was made, and the bytes sent.
    pub(super) fn upload(
        &mut self,
        context: &Context,
        mesh: &Arc<Mesh>,
        split: RecordSplit,
    ) -> Result<(bool, u64), RenderError> {
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, mesh)) {
            return Ok((false, 0));
        }
        self.of = None;
        let cells = mesh.topology.tets.len();
        let (mut made, mut sent) = (false, 0);
        let record =
            |cell: usize| [mesh.topology.tets[cell], mesh.topology.connectivity().neighbours[cell].map(|n| n.0)];
        for (part, buffer) in (0u32..).zip(&mut self.parts) {
            let (new, bytes) = buffer.upload_packed(context, split.cells_of(part, cells), record)?;
            (made, sent) = (made | new, sent + bytes);
        }
        self.of = Some(mesh.clone());
        Ok((made, sent))
    }
}

//! Records of a mesh's cells in the GPU's memory.

use crate::mesh::Mesh;
use crate::render::RenderError;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::{RECORD_BYTES, RecordSplit};
use std::sync::Arc;

/// Cells per piece in which records are made and sent, so that no second copy of a large mesh is held.
const CELLS_PER_PIECE: usize = 1 << 18;

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
        let mut piece = Vec::with_capacity(2 * CELLS_PER_PIECE.min(cells));
        for (part, buffer) in (0u32..).zip(&mut self.parts) {
            let range = split.cells_of(part, cells);
            made |= buffer.reserve(context, RECORD_BYTES * range.len() as u64)?;
            for from in range.clone().step_by(CELLS_PER_PIECE) {
                let to = (from + CELLS_PER_PIECE).min(range.end);
                piece.clear();
                for cell in from..to {
                    piece.push(mesh.topology.tets[cell]);
                    piece.push(mesh.topology.neighbours[cell].map(|n| n.0));
                }
                let offset = RECORD_BYTES * (from - range.start) as u64;
                sent += buffer.write(context, offset, bytemuck::cast_slice(&piece))?;
                // Frees the staging memory of the piece before the next.
                context.queue.submit([]);
            }
        }
        self.of = Some(mesh.clone());
        Ok((made, sent))
    }
}

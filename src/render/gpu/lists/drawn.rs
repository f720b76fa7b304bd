//! The list of what is drawn, on the GPU.

use crate::render::RenderError;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::resources::Resource;
use crate::visibility::Drawn;
use std::sync::Arc;

/// The elements that a job draws, and what comes behind them.
pub(in crate::render::gpu) struct DrawnBuffer {
    of: Option<Arc<Drawn>>,
    pub(in crate::render::gpu) buffer: GrowingBuffer,
}

impl DrawnBuffer {
    pub(in crate::render::gpu) fn new() -> Self {
        Self { of: None, buffer: GrowingBuffer::new(Resource::Drawn) }
    }

    /// Uploads a list unless it is there, and the bytes `behind` it. Returns whether a buffer was made, and the bytes sent.
    pub(in crate::render::gpu) fn upload(
        &mut self,
        context: &Context,
        drawn: &Arc<Drawn>,
        behind: &[u8],
    ) -> Result<(bool, u64), RenderError> {
        let list_bytes = size_of_val(drawn.ids.as_slice()) as u64;
        let mut sent = 0;
        let made = self.buffer.reserve(context, list_bytes + behind.len() as u64)?;
        if made || !self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, drawn)) {
            self.of = None;
            sent += self.buffer.write(context, 0, bytemuck::cast_slice(&drawn.ids))?;
            self.of = Some(drawn.clone());
        }
        sent += self.buffer.write(context, list_bytes, behind)?;
        Ok((made, sent))
    }
}

//! Steps of codec `vq` decoded on the GPU: a block is sent once for its 64 steps, each step is 32 bytes of parameters.

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::VqStep;
use super::pipelines::{NO_RECORDS, Pipelines};
use super::resources::Resource;
use super::shaders::Stage;
use crate::codec::vq::{GROUPS, Indices, group_of_step};
use crate::render::{CompressedStep, RenderError};
use bytemuck::bytes_of;
use std::sync::Arc;

/// Decodes the steps of one block at a time, which stays in the GPU's memory.
pub(super) struct BlockDecoder {
    /// The step that the next frame decodes, or the last one has decoded.
    step: Option<CompressedStep>,
    /// Whether the step has not been decoded yet.
    is_pending: bool,
    block: GrowingBuffer,
    params: GrowingBuffer,
    pipelines: Pipelines,
    /// The scalar buffer that is bound.
    scalars: Option<wgpu::Buffer>,
    places: VqStep,
}

/// Words (32 bits) that hold `bytes`.
fn words(bytes: usize) -> u32 {
    bytes.div_ceil(4) as u32
}

impl BlockDecoder {
    pub(super) fn new() -> Self {
        Self {
            step: None,
            is_pending: false,
            block: GrowingBuffer::new(Resource::Block),
            params: GrowingBuffer::new(Resource::VqStep),
            pipelines: Pipelines::new(),
            scalars: None,
            places: VqStep::default(),
        }
    }

    /// Vertices whose scalars the frame must decode first: all or none.
    pub(super) fn pending_vertices(&self) -> u32 {
        if self.is_pending { self.places.vertex_count } else { 0 }
    }

    /// Drops the pending step, if any.
    pub(super) fn forget(&mut self) {
        self.is_pending = false;
    }

    /// Sends the step's block and parameters unless they are there, to be decoded into `scalars`. Returns the bytes sent, or `None` if the
    /// block is larger than a binding.
    pub(super) fn prepare(
        &mut self,
        context: &Context,
        step: &CompressedStep,
        scalars: &GrowingBuffer,
    ) -> Result<Option<u64>, RenderError> {
        self.is_pending = false;
        let (places, bytes) = places_of(step);
        if bytes > context.binding_bytes() {
            return Ok(None);
        }
        self.pipelines.prepare(context, NO_RECORDS, [Stage::DecodeVq])?;
        let is_there = self.step.as_ref().is_some_and(|there| Arc::ptr_eq(&there.block, &step.block));
        // A reallocated buffer is unbound at once: a later failure must not leave the old one bound.
        let is_bound = self.scalars.as_ref() == Some(scalars.get(context)?);
        if self.params.reserve(context, size_of::<VqStep>() as u64)? || !is_bound {
            self.pipelines.unbind();
        }
        let mut sent = 0;
        if !is_there {
            self.step = None;
            if self.block.reserve(context, bytes)? {
                self.pipelines.unbind();
            }
            sent += self.send_block(context, step, &places)?;
        }
        sent += self.params.write(context, 0, bytes_of(&places))?;
        self.pipelines.bind(context, &[&self.params, &self.block, scalars], &[])?;
        self.scalars = Some(scalars.get(context)?.clone());
        (self.step, self.places, self.is_pending) = (Some(step.clone()), places, true);
        Ok(Some(sent))
    }

    fn send_block(&self, context: &Context, step: &CompressedStep, places: &VqStep) -> Result<u64, RenderError> {
        let block = &step.block;
        let [first, second] = match block.indices() {
            Indices::Narrow([first, second]) => [&first[..], &second[..]],
            Indices::Wide([first, second]) => [bytemuck::cast_slice(first), bytemuck::cast_slice(second)],
        };
        let parts: [(u32, &[u8]); 6] = [
            (0, bytemuck::cast_slice(block.cb8())),
            (words(size_of_val(block.cb8())), bytemuck::cast_slice(block.cb64())),
            (places.means, bytemuck::cast_slice(block.means())),
            (places.first, first),
            (places.second, second),
            (places.exponents, bytemuck::cast_slice(block.exponents())),
        ];
        let mut sent = 0;
        for (word, bytes) in parts {
            // Whole words only; the last one is padded with zeros.
            let (whole, rest) = bytes.split_at(bytes.len() / 4 * 4);
            let at = 4 * u64::from(word);
            sent += self.block.write(context, at, whole)?;
            if !rest.is_empty() {
                let mut last = [0; 4];
                last[..rest.len()].copy_from_slice(rest);
                sent += self.block.write(context, at + whole.len() as u64, &last)?;
            }
        }
        Ok(sent)
    }

    /// Records the decoding in a pass.
    pub(super) fn record(&self, context: &Context, pass: &mut wgpu::ComputePass<'_>) -> Result<(), RenderError> {
        self.pipelines.dispatch(context, Stage::DecodeVq, self.places.vertex_count.div_ceil(256), pass)
    }
}

/// Offsets of the parts of a step's block in words (codebooks, means, indices, exponents), and the bytes of all.
fn places_of(step: &CompressedStep) -> (VqStep, u64) {
    let block = &step.block;
    let row = block.row_len() as u32;
    let (groups, j) = (GROUPS as u32, step.step as u32);
    let vertices = block.means().len();
    let means = words(size_of_val(block.cb8())) + words(size_of_val(block.cb64()));
    let (index_bytes, per_word_log2) = match block.indices() {
        Indices::Narrow(_) => (1, 2),
        Indices::Wide(_) => (2, 1),
    };
    let first = means + words(4 * vertices);
    let second = first + words(index_bytes * vertices);
    let end = second + words(index_bytes * vertices);
    let exponents = block.exponents().len();
    let places = VqStep {
        vertex_count: vertices as u32,
        row_8: group_of_step(step.step) as u32 * row,
        row_64: (groups + j) * row,
        means,
        exponents: if exponents == 0 { u32::MAX } else { end },
        first,
        second,
        per_word_log2,
    };
    (places, 4 * u64::from(end + words(exponents)))
}

//! Scalars of codec `vq` decoded on the GPU: a block is sent once for its 64 steps, each step is 64 bytes of parameters.
//!
//! A mixture is decoded in two passes: the first leaves the values of one step, the second mixes those of the other into them. It needs
//! f64, in which the CPU mixes, and has the CPU's bits as steps do, unless a GPU takes denormal numbers for 0.
//!
//! Fields of cells may have a value for each cell of the source, of which cells of the mesh are parts: a thread is a cell of the mesh then,
//! and looks up the cell that it is a part of.

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::VqStep;
use super::pipelines::{NO_RECORDS, Pipelines};
use super::resources::Resource;
use super::shaders::{Moment, Stage, Valued};
use crate::codec::vq::{GROUPS, Indices, VqBlock, group_of_step};
use crate::mesh::SourceCells;
use crate::render::{CompressedScalars, CompressedStep, RenderError};
use bytemuck::bytes_of;
use std::sync::{Arc, Weak};

/// Decodes the steps of two blocks, which stay in the GPU's memory; the second one only if a mixture has needed both.
pub(super) struct BlockDecoder {
    blocks: [BlockBuffer; 2],
    cells: CellsBuffer,
    /// Decode a step, and mix a second one into it.
    passes: [StepPass; 2],
    /// Number of passes that the next frame needs.
    pending: usize,
}

/// A block in the GPU's memory.
struct BlockBuffer {
    of: Weak<VqBlock>,
    buffer: GrowingBuffer,
}

impl BlockBuffer {
    fn new() -> Self {
        Self { of: Weak::new(), buffer: GrowingBuffer::new(Resource::Block) }
    }

    fn has(&self, block: &Arc<VqBlock>) -> bool {
        Weak::as_ptr(&self.of) == Arc::as_ptr(block)
    }

    /// Sends a block's parts to their places. Returns the bytes sent.
    fn send(&mut self, context: &Context, block: &Arc<VqBlock>, places: &VqStep) -> Result<u64, RenderError> {
        self.of = Weak::new();
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
            sent += self.buffer.write(context, at, whole)?;
            if !rest.is_empty() {
                let mut last = [0; 4];
                last[..rest.len()].copy_from_slice(rest);
                sent += self.buffer.write(context, at + whole.len() as u64, &last)?;
            }
        }
        self.of = Arc::downgrade(block);
        Ok(sent)
    }
}

/// For each cell of a mesh the source's cell that it is a part of.
struct CellsBuffer {
    of: Weak<SourceCells>,
    buffer: GrowingBuffer,
}

impl CellsBuffer {
    fn new() -> Self {
        Self { of: Weak::new(), buffer: GrowingBuffer::new(Resource::SourceCells) }
    }

    /// Sends the cells unless they are there. Returns the bytes sent.
    fn update(&mut self, context: &Context, cells: &Arc<SourceCells>, of_parts: &[u32]) -> Result<u64, RenderError> {
        if Weak::as_ptr(&self.of) == Arc::as_ptr(cells) {
            return Ok(0);
        }
        self.of = Weak::new();
        self.buffer.reserve(context, size_of_val(of_parts) as u64)?;
        let sent = self.buffer.write(context, 0, bytemuck::cast_slice(of_parts))?;
        self.of = Arc::downgrade(cells);
        Ok(sent)
    }
}

/// A pass over the vertices or cells.
struct StepPass {
    moment: Moment,
    stage: Stage,
    places: VqStep,
    params: GrowingBuffer,
    pipelines: Pipelines,
    /// The buffers that are bound, of a block, of scalars and, if they are needed, of the source's cells.
    bound: Vec<wgpu::Buffer>,
}

impl StepPass {
    fn new(moment: Moment) -> Self {
        Self {
            moment,
            stage: Stage::DecodeVq(moment, Valued::Each),
            places: VqStep::default(),
            params: GrowingBuffer::new(Resource::VqStep),
            pipelines: Pipelines::new(),
            bound: Vec::new(),
        }
    }

    fn unbind(&mut self) {
        self.pipelines.unbind();
        self.bound.clear();
    }

    /// Sends the parameters, and binds the buffers unless they are. Returns the bytes sent.
    fn prepare(
        &mut self,
        context: &Context,
        places: VqStep,
        valued: Valued,
        buffers: &[&GrowingBuffer],
    ) -> Result<u64, RenderError> {
        self.stage = Stage::DecodeVq(self.moment, valued);
        self.pipelines.prepare(context, NO_RECORDS, [self.stage])?;
        let bound = buffers.iter().map(|buffer| buffer.get(context).cloned()).collect::<Result<Vec<_>, _>>()?;
        // A reallocated buffer is unbound at once: a later failure must not leave the old one bound.
        if self.params.reserve(context, size_of::<VqStep>() as u64)? || self.bound != bound {
            self.unbind();
        }
        let sent = self.params.write(context, 0, bytes_of(&places))?;
        let all = [&[&self.params], buffers].concat();
        self.pipelines.bind_those(context, |stage| stage == self.stage, &all, &[])?;
        (self.places, self.bound) = (places, bound);
        Ok(sent)
    }
}

/// Words (32 bits) that hold `bytes`.
fn words(bytes: usize) -> u32 {
    bytes.div_ceil(4) as u32
}

impl BlockDecoder {
    pub(super) fn new() -> Self {
        Self {
            blocks: [BlockBuffer::new(), BlockBuffer::new()],
            cells: CellsBuffer::new(),
            passes: [Moment::Step, Moment::Mixture].map(StepPass::new),
            pending: 0,
        }
    }

    /// Scalars that the frame must decode first, of both steps of a mixture; 0 if none.
    pub(super) fn pending_scalars(&self) -> u64 {
        self.passes[..self.pending].iter().map(|pass| u64::from(pass.places.count)).sum()
    }

    /// Drops the pending passes, if any.
    pub(super) fn forget(&mut self) {
        self.pending = 0;
    }

    /// Sends blocks and parameters unless they are there, to be decoded into `scalars`, `count` of them ([`CompressedScalars::fit`]). Returns
    /// the bytes sent, or `None` if this GPU cannot decode them: a block is larger than a binding, or a mixture needs f64, or a weight so
    /// small that its parts are denormal.
    pub(super) fn prepare(
        &mut self,
        context: &Context,
        compressed: &CompressedScalars,
        count: usize,
        scalars: &GrowingBuffer,
    ) -> Result<Option<u64>, RenderError> {
        self.pending = 0;
        let weights = match &compressed.toward {
            None => Some(Default::default()),
            Some((_, weight)) if context.has_f64() => parts_of(1.0 - weight).zip(parts_of(*weight)),
            Some(_) => None,
        };
        let Some((weight_before, weight)) = weights else { return Ok(None) };
        let steps = compressed.steps().map(|step| (step, places_of(step)));
        let count = count as u32;
        let steps =
            steps.map(|(step, (places, bytes))| (step, VqStep { count, weight_before, weight, ..places }, bytes));
        if steps.clone().any(|(_, _, bytes)| bytes > context.binding_bytes()) {
            return Ok(None);
        }
        let (mut sent, mut needed) = (0, compressed.steps().filter_map(|step| self.place_of(&step.block)).last());
        let mut of_steps = [0; 2];
        for (of_step, (step, places, bytes)) in of_steps.iter_mut().zip(steps.clone()) {
            *of_step = match self.place_of(&step.block) {
                Some(place) => place,
                None => {
                    // The other step's block stays.
                    let place = needed.map_or(0, |other| 1 - other);
                    sent += self.send_block(context, place, &step.block, &places, bytes)?;
                    place
                }
            };
            needed = Some(*of_step);
        }
        let of_parts = compressed.source_cells.as_ref().and_then(|cells| Some((cells, cells.of_parts()?)));
        if let Some((cells, of_parts)) = of_parts {
            sent += self.cells.update(context, cells, of_parts)?;
        }
        // Sending a block may unbind the passes of both.
        for ((pass, place), (_, places, _)) in self.passes.iter_mut().zip(of_steps).zip(steps) {
            let block = &self.blocks[place].buffer;
            sent += match of_parts {
                None => pass.prepare(context, places, Valued::Each, &[block, scalars])?,
                Some(_) => pass.prepare(context, places, Valued::Wholes, &[block, scalars, &self.cells.buffer])?,
            };
        }
        self.pending = compressed.steps().count();
        Ok(Some(sent))
    }

    /// Where a block lies, if it is in the GPU's memory.
    fn place_of(&self, block: &Arc<VqBlock>) -> Option<usize> {
        self.blocks.iter().position(|there| there.has(block))
    }

    fn send_block(
        &mut self,
        context: &Context,
        place: usize,
        block: &Arc<VqBlock>,
        places: &VqStep,
        bytes: u64,
    ) -> Result<u64, RenderError> {
        let there = &mut self.blocks[place];
        if there.buffer.bytes() < bytes {
            there.of = Weak::new();
            self.passes.iter_mut().for_each(StepPass::unbind);
            there.buffer.reserve(context, bytes)?;
        }
        there.send(context, block, places)
    }

    /// Records the decoding in a pass.
    pub(super) fn record(&self, context: &Context, pass: &mut wgpu::ComputePass<'_>) -> Result<(), RenderError> {
        self.passes[..self.pending].iter().try_for_each(|of| {
            let workgroups = of.places.count.div_ceil(256);
            of.pipelines.dispatch(context, of.stage, workgroups, pass)
        })
    }
}

/// Three numbers whose sum is exactly `weight`, in any order; `None` if one would be denormal.
fn parts_of(weight: f64) -> Option<[f32; 3]> {
    let mut rest = weight;
    let parts = [(); 3].map(|()| {
        let part = rest as f32;
        rest -= f64::from(part);
        part
    });
    let are_kept = parts.iter().all(|part| *part == 0.0 || part.is_normal());
    (are_kept && rest == 0.0).then_some(parts)
}

/// Offsets of the parts of a step's block in words (codebooks, means, indices, exponents), and the bytes of all.
fn places_of(step: &CompressedStep) -> (VqStep, u64) {
    let block = &step.block;
    let row = block.row_len() as u32;
    let (groups, j) = (GROUPS as u32, step.step as u32);
    let values = block.means().len();
    let means = words(size_of_val(block.cb8())) + words(size_of_val(block.cb64()));
    let (index_bytes, per_word_log2) = match block.indices() {
        Indices::Narrow(_) => (1, 2),
        Indices::Wide(_) => (2, 1),
    };
    let first = means + words(4 * values);
    let second = first + words(index_bytes * values);
    let end = second + words(index_bytes * values);
    let exponents = block.exponents().len();
    let places = VqStep {
        row_8: group_of_step(step.step) as u32 * row,
        row_64: (groups + j) * row,
        means,
        exponents: if exponents == 0 { u32::MAX } else { end },
        first,
        second,
        per_word_log2,
        ..VqStep::default()
    };
    (places, 4 * u64::from(end + words(exponents)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_have_three_parts_without_a_rest() {
        for weight in [0.5, 0.1, 1.0 / 3.0, 1.0 - f64::EPSILON, 1e-9, 1.0 - 1e-9] {
            let parts = parts_of(weight).unwrap().map(f64::from);
            let [a, b, c] = parts;
            assert_eq!([(a + b) + c, a + (b + c), (a + c) + b], [weight; 3]);
        }
        assert!(parts_of(0.1).unwrap()[2] != 0.0, "two would not do");
        for weight in [1e-30 / 3.0, 1e-300] {
            assert_eq!(parts_of(weight), None, "{weight:e}");
        }
    }
}

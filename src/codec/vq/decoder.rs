//! Reading blocks from the store, and decoding steps of blocks.

use super::block::{Encoded, Indices, SpecialRun, VqBlock};
use super::layout::{NAME, VqParameters};
use super::{GROUPS, STEPS};
use crate::codec::blocks::{Block, BlockCache, BlockLoader, DecoderId, LoadedBlock};
use crate::codec::stop::{go_on, uncancelled, unless_cancelled};
use crate::codec::{
    DecodeStats, Decoder, Element, ReadRange, StepRequest, Stop, chunk_key, read_chunk_unless, read_rows_unless,
};
use crate::error::{FileError, FileResult};
use crate::task::Cancel;
use rayon::prelude::*;
use std::sync::Arc;

/// Fewest blocks of a decoder's own cache: the playing one, and one on either side.
const KEPT: usize = 3;
/// Numbers that are validated between two checks of the cancel flag.
const CHECKED: usize = 1 << 20;

/// Decodes any step. Its blocks lie in a cache, which does not affect the result.
pub struct VqDecoder {
    source: Arc<dyn ReadRange>,
    group_key: String,
    parameters: VqParameters,
    steps: usize,
    vertices: usize,
    id: DecoderId,
    cache: Arc<BlockCache>,
}

impl VqDecoder {
    /// A decoder of the group `vq` in the group `group_key` of `source`. It keeps the last blocks that were used: a few, or one more than
    /// there are threads, which may each be at another step.
    pub fn new(
        source: Arc<dyn ReadRange>,
        group_key: &str,
        parameters: VqParameters,
        steps: usize,
        vertices: usize,
    ) -> Self {
        let group_key = format!("{group_key}/{NAME}");
        let cache = Arc::new(BlockCache::of_blocks(KEPT.max(rayon::current_num_threads() + 1)));
        Self { source, group_key, parameters, steps, vertices, id: DecoderId::unique(), cache }
    }

    /// Keeps blocks in `cache` instead of its own one.
    #[must_use]
    pub fn with_cache(mut self, cache: Arc<BlockCache>) -> Self {
        self.cache = cache;
        self
    }

    /// The cache of its blocks.
    pub fn cache(&self) -> &Arc<BlockCache> {
        &self.cache
    }

    /// The block that contains `step`, as its step `step % 64`; read if it is not in memory. For decoders on other processors: its parts
    /// are plain slices.
    ///
    /// # Errors
    /// As [`Decoder::decode_step`].
    pub fn resident_block(&self, step: usize) -> FileResult<Arc<VqBlock>> {
        uncancelled(|cancel| Ok(self.block(step, cancel)?.0))
    }

    /// The block that contains `step`, and the bytes that this call read for it.
    fn block(&self, step: usize, cancel: &Cancel) -> Result<(Arc<VqBlock>, u64), Stop> {
        let Some(index) = self.block_of_step(step) else {
            let problem = format!("there are {} steps, counted from 0", self.steps);
            let path = self.source.path(&self.group_key);
            return Err(FileError::invalid(path, format!("step {step}"), problem).into());
        };
        match self.cache.get(self, index, cancel).map_err(|stop| stop.at(|| format!("step {step}")))? {
            (Block::Vq(block), bytes_read) => Ok((block, bytes_read)),
            (Block::Raw(_), _) => unreachable!("under the key of this decoder are its blocks"),
        }
    }

    fn parts(&self, index: usize, bytes: &mut u64, cancel: &Cancel) -> Result<Encoded, Stop> {
        let indices = if self.parameters.entries <= 256 {
            Indices::Narrow([self.indices("i8", index, bytes, cancel)?, self.indices("i64", index, bytes, cancel)?])
        } else {
            Indices::Wide([self.indices("i8", index, bytes, cancel)?, self.indices("i64", index, bytes, cancel)?])
        };
        let entries = self.parameters.entries as usize;
        Ok(Encoded {
            mean: self.row("mean", index, 2, self.vertices, bytes, cancel)?,
            exponent: self.exponents(index, bytes, cancel)?,
            indices,
            cb8: self.row("cb8", index, 3, GROUPS * entries, bytes, cancel)?,
            cb64: self.row("cb64", index, 3, STEPS * entries, bytes, cancel)?,
            runs: self.runs(index, bytes, cancel)?,
        })
    }

    fn key(&self, array: &str, index: usize, rank: usize) -> String {
        chunk_key(&format!("{}/{array}", self.group_key), index as u64, rank)
    }

    fn row<T: Element>(
        &self,
        array: &str,
        index: usize,
        rank: usize,
        count: usize,
        bytes: &mut u64,
        cancel: &Cancel,
    ) -> Result<Vec<T>, Stop> {
        let rows = read_rows_unless::<T, 1>(&*self.source, &self.key(array, index, rank), count as u64, cancel)?;
        *bytes += (count * size_of::<T>()) as u64;
        Ok(rows.into_flattened())
    }

    /// Indices into a codebook, checked to be in range.
    fn indices<T: Element + Into<u64>>(
        &self,
        array: &str,
        index: usize,
        bytes: &mut u64,
        cancel: &Cancel,
    ) -> Result<Vec<T>, Stop> {
        let indices = self.row::<T>(array, index, 2, self.vertices, bytes, cancel)?;
        for (i, part) in indices.chunks(CHECKED).enumerate() {
            go_on(cancel)?;
            if let Some(v) = part.iter().position(|&entry| entry.into() >= self.parameters.entries) {
                let problem = format!("vertex {} has an entry that the codebook lacks", i * CHECKED + v);
                return Err(self.damaged(array, index, 2, problem).into());
            }
        }
        Ok(indices)
    }

    fn damaged(&self, array: &str, index: usize, rank: usize, problem: String) -> FileError {
        FileError::invalid(self.source.path(&self.key(array, index, rank)), "chunk", problem)
            .remedy("import the series again")
    }

    /// Exponents of a block; all 0 if its chunk is missing.
    fn exponents(&self, index: usize, bytes: &mut u64, cancel: &Cancel) -> Result<Vec<i8>, Stop> {
        let key = self.key("exponent", index, 2);
        if !self.parameters.exponents || !self.source.exists(&key)? {
            return Ok(Vec::new());
        }
        self.row("exponent", index, 2, self.vertices, bytes, cancel)
    }

    fn runs(&self, index: usize, bytes: &mut u64, cancel: &Cancel) -> Result<Vec<SpecialRun>, Stop> {
        let specials = self.parameters.specials;
        if specials == 0 {
            return Ok(Vec::new());
        }
        let blocks = self.steps.div_ceil(STEPS);
        let starts: Vec<u64> = self.row("special_start", 0, 1, blocks + 1, bytes, cancel)?;
        let range = starts[index]..starts[index + 1];
        if range.start > range.end || range.end > specials {
            return Err(self.damaged("special_start", 0, 1, format!("block {index} has no range of rows")).into());
        }
        let mut runs: Vec<SpecialRun> = Vec::new();
        let chunk_rows = self.parameters.special_rows();
        for chunk in range.start / chunk_rows..range.end.div_ceil(chunk_rows) {
            let mut rows = vec![[0u32; 4]; chunk_rows as usize];
            let key = self.key("special", chunk as usize, 2);
            *bytes += read_chunk_unless(&*self.source, &key, rows.as_flattened_mut(), cancel)?;
            let first = chunk * chunk_rows;
            let row = |at: u64| (at.saturating_sub(first).min(chunk_rows)) as usize;
            let rows = &rows[row(range.start)..row(range.end)];
            // Sorted up to here: only one run is checked again.
            let known = runs.len().saturating_sub(1);
            runs.extend(rows.iter().map(|&[vertex, first, count, bits]| SpecialRun { vertex, first, count, bits }));
            if !runs[known..].is_sorted() || runs.last().is_some_and(|run| run.vertex as usize >= self.vertices) {
                return Err(self.damaged("special", 0, 2, format!("rows of block {index} are not in order")).into());
            }
        }
        Ok(runs)
    }
}

impl BlockLoader for VqDecoder {
    fn id(&self) -> DecoderId {
        self.id
    }

    fn block_of_step(&self, step: usize) -> Option<usize> {
        (step < self.steps).then_some(step / STEPS)
    }

    /// The size without special values, whose number only the block tells.
    fn expected_bytes(&self, index: usize) -> u64 {
        let _ = index; // all blocks have the same expected size
        VqBlock::expected_bytes(self.vertices, self.parameters.entries as usize, self.parameters.exponents)
    }

    fn load(&self, index: usize, cancel: &Cancel) -> Result<LoadedBlock, Stop> {
        let mut bytes_read = 0;
        let parts = self.parts(index, &mut bytes_read, cancel);
        let parts = parts.map_err(|stop| stop.at(|| format!("step {}", index * STEPS)))?;
        let block = VqBlock::new_unless(parts, self.parameters.entries as usize, cancel)?;
        Ok(LoadedBlock { bytes: block.bytes() as u64, block: Block::Vq(Arc::new(block)), bytes_read })
    }
}

impl Decoder for VqDecoder {
    fn decode_step_unless(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>> {
        let StepRequest { step, wanted, cancel } = request;
        assert_eq!(out.len(), self.vertices, "one value per vertex");
        let Some((block, bytes_read)) = unless_cancelled(self.block(step, cancel))? else { return Ok(None) };
        let Some(wanted) = wanted else {
            let whole = block.decode(step % STEPS, step, out, cancel);
            return Ok(whole.then_some(DecodeStats { bytes_read, vertices_decoded: out.len() as u64 }));
        };
        let vertices_decoded = wanted.count(out.len());
        wanted.of(out).for_each(|(first, out)| {
            if !cancel.is_cancelled() {
                block.decode_part(step % STEPS, step, first, out);
            }
        });
        Ok((!cancel.is_cancelled()).then_some(DecodeStats { bytes_read, vertices_decoded }))
    }

    fn vq_block(&self, step: usize) -> FileResult<Option<Arc<VqBlock>>> {
        self.resident_block(step).map(Some)
    }

    fn blocks(&self) -> Option<&dyn BlockLoader> {
        Some(self)
    }
}

impl Drop for VqDecoder {
    fn drop(&mut self) {
        self.cache.forget(self.id);
    }
}

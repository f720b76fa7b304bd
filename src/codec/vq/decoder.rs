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
    pub(super) cache: Arc<BlockCache>,
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
}

/// A block that is being read.
struct BlockReader<'a> {
    decoder: &'a VqDecoder,
    index: usize,
    cancel: &'a Cancel,
    /// Bytes read so far.
    bytes: u64,
}

impl BlockReader<'_> {
    fn parts(&mut self) -> Result<Encoded, Stop> {
        let (vertices, entries) = (self.decoder.vertices, self.decoder.parameters.entries as usize);
        let indices = if entries <= 256 {
            Indices::Narrow([self.indices("i8")?, self.indices("i64")?])
        } else {
            Indices::Wide([self.indices("i8")?, self.indices("i64")?])
        };
        Ok(Encoded {
            mean: self.row(&self.key("mean", self.index, 2), vertices)?,
            exponent: self.exponents()?,
            indices,
            cb8: self.row(&self.key("cb8", self.index, 3), GROUPS * entries)?,
            cb64: self.row(&self.key("cb64", self.index, 3), STEPS * entries)?,
            runs: self.runs()?,
        })
    }

    fn key(&self, array: &str, index: usize, rank: usize) -> String {
        chunk_key(&format!("{}/{array}", self.decoder.group_key), index as u64, rank)
    }

    fn row<T: Element>(&mut self, key: &str, count: usize) -> Result<Vec<T>, Stop> {
        let rows = read_rows_unless::<T, 1>(&*self.decoder.source, key, count as u64, self.cancel)?;
        self.bytes += (count * size_of::<T>()) as u64;
        Ok(rows.into_flattened())
    }

    /// Indices into a codebook, checked to be in range.
    fn indices<T: Element + Into<u64>>(&mut self, array: &str) -> Result<Vec<T>, Stop> {
        let key = self.key(array, self.index, 2);
        let indices = self.row::<T>(&key, self.decoder.vertices)?;
        for (i, part) in indices.chunks(CHECKED).enumerate() {
            go_on(self.cancel)?;
            if let Some(v) = part.iter().position(|&entry| entry.into() >= self.decoder.parameters.entries) {
                let problem = format!("vertex {} has an entry that the codebook lacks", i * CHECKED + v);
                return Err(self.damaged(&key, problem));
            }
        }
        Ok(indices)
    }

    fn damaged(&self, key: &str, problem: String) -> Stop {
        let error = FileError::invalid(self.decoder.source.path(key), "chunk", problem);
        error.remedy("import the series again").into()
    }

    /// Exponents of the block; all 0 if its chunk is missing.
    fn exponents(&mut self) -> Result<Vec<i8>, Stop> {
        let key = self.key("exponent", self.index, 2);
        if !self.decoder.parameters.exponents || !self.decoder.source.exists(&key)? {
            return Ok(Vec::new());
        }
        self.row(&key, self.decoder.vertices)
    }

    fn runs(&mut self) -> Result<Vec<SpecialRun>, Stop> {
        let VqDecoder { source, parameters, steps, vertices, .. } = self.decoder;
        if parameters.specials == 0 {
            return Ok(Vec::new());
        }
        let (index, key) = (self.index, self.key("special_start", 0, 1));
        let starts: Vec<u64> = self.row(&key, steps.div_ceil(STEPS) + 1)?;
        let range = starts[index]..starts[index + 1];
        if range.start > range.end || range.end > parameters.specials {
            return Err(self.damaged(&key, format!("block {index} has no range of rows")));
        }
        let mut runs: Vec<SpecialRun> = Vec::new();
        let chunk_rows = parameters.special_rows();
        for chunk in range.start / chunk_rows..range.end.div_ceil(chunk_rows) {
            let mut rows = vec![[0u32; 4]; chunk_rows as usize];
            let key = self.key("special", chunk as usize, 2);
            self.bytes += read_chunk_unless(&**source, &key, rows.as_flattened_mut(), self.cancel)?;
            let first = chunk * chunk_rows;
            let row = |at: u64| (at.saturating_sub(first).min(chunk_rows)) as usize;
            let rows = &rows[row(range.start)..row(range.end)];
            // Sorted up to here: only one run is checked again.
            let known = runs.len().saturating_sub(1);
            runs.extend(rows.iter().map(|&[vertex, first, count, bits]| SpecialRun { vertex, first, count, bits }));
            if !runs[known..].is_sorted() || runs.last().is_some_and(|run| run.vertex as usize >= *vertices) {
                let problem = format!("rows of block {index} are not in order");
                return Err(self.damaged(&self.key("special", 0, 2), problem));
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
        let mut reader = BlockReader { decoder: self, index, cancel, bytes: 0 };
        let parts = reader.parts().map_err(|stop| stop.at(|| format!("step {}", index * STEPS)))?;
        let block = VqBlock::new(parts, self.parameters.entries as usize, cancel);
        // Once it is cancelled, the block may lack rows.
        go_on(cancel)?;
        Ok(LoadedBlock { bytes: block.bytes() as u64, block: Block::Vq(Arc::new(block)), bytes_read: reader.bytes })
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

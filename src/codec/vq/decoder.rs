//! Blocks from the store, and steps from blocks.

use super::block::{Encoded, Indices, SpecialRun, VqBlock};
use super::layout::{NAME, VqParameters};
use super::{GROUPS, STEPS};
use crate::codec::{DecodeStats, Decoder, Element, ReadRange, chunk_key, read_chunk, read_rows};
use crate::error::{FileError, FileResult};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Blocks that are kept at least: that which plays, and one on either side.
const KEPT: usize = 3;

/// A block that is loaded, or being loaded by the thread that asked first, and the bytes that were read for it.
type Slot = Arc<OnceLock<FileResult<(Arc<VqBlock>, u64)>>>;

/// Decodes any step. The last blocks that were used are kept; which ones does not change what is decoded.
pub struct VqDecoder {
    source: Arc<dyn ReadRange>,
    group_key: String,
    parameters: VqParameters,
    steps: usize,
    vertices: usize,
    /// Most blocks that are kept: one more than threads that may each be at another place.
    kept: usize,
    /// The block used last is at the end.
    blocks: Mutex<VecDeque<(usize, Slot)>>,
}

impl VqDecoder {
    /// A decoder of the group `vq` in the group `group_key` of `source`.
    pub fn new(
        source: Arc<dyn ReadRange>,
        group_key: &str,
        parameters: VqParameters,
        steps: usize,
        vertices: usize,
    ) -> Self {
        let group_key = format!("{group_key}/{NAME}");
        let kept = KEPT.max(rayon::current_num_threads() + 1);
        Self { source, group_key, parameters, steps, vertices, kept, blocks: Mutex::default() }
    }

    /// Bytes in memory of the blocks that are kept.
    pub fn resident_bytes(&self) -> usize {
        let blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        let loaded = |slot: &Slot| slot.get().and_then(|r| r.as_ref().ok()).map_or(0, |(block, _)| block.bytes());
        blocks.iter().map(|(_, slot)| loaded(slot)).sum()
    }

    /// The block that `step` is in, step `step % 64` of it; read if it is not in memory. For decoders elsewhere: its parts
    /// are plain slices.
    ///
    /// # Errors
    /// As [`Decoder::decode_step`].
    pub fn resident_block(&self, step: usize) -> FileResult<Arc<VqBlock>> {
        Ok(self.block_of_step(step)?.0)
    }

    /// The same, and the bytes read for it now.
    fn block_of_step(&self, step: usize) -> FileResult<(Arc<VqBlock>, u64)> {
        if step >= self.steps {
            let problem = format!("there are {} steps, counted from 0", self.steps);
            return Err(FileError::invalid(self.source.path(&self.group_key), format!("step {step}"), problem));
        }
        self.block(step / STEPS).map_err(|mut error| {
            error.place = format!("step {step}");
            error
        })
    }

    /// The block, and the bytes read for it now.
    fn block(&self, index: usize) -> FileResult<(Arc<VqBlock>, u64)> {
        let slot = self.slot(index);
        let mut read = 0;
        // Loading uses no thread of the pool: one that waits in it could be given this same work.
        let loaded = slot.get_or_init(|| {
            let loaded = self.load(index);
            read = loaded.as_ref().map_or(0, |(_, bytes)| *bytes);
            loaded
        });
        match loaded {
            Ok((block, _)) => Ok((block.clone(), read)),
            Err(error) => {
                // Not kept: the file may be restored.
                let mut blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
                blocks.retain(|(_, other)| !Arc::ptr_eq(other, &slot));
                Err(error.clone())
            }
        }
    }

    fn slot(&self, index: usize) -> Slot {
        let mut blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        let found = blocks.iter().position(|(other, _)| *other == index).and_then(|at| blocks.remove(at));
        let (_, slot) = found.unwrap_or_default();
        if blocks.len() >= self.kept {
            blocks.pop_front();
        }
        blocks.push_back((index, slot.clone()));
        slot
    }

    fn load(&self, index: usize) -> FileResult<(Arc<VqBlock>, u64)> {
        let mut bytes = 0;
        let mut load = || -> FileResult<Encoded> {
            let entries = self.parameters.entries as usize;
            let indices = if entries <= 256 {
                Indices::Narrow([self.indices("i8", index, &mut bytes)?, self.indices("i64", index, &mut bytes)?])
            } else {
                Indices::Wide([self.indices("i8", index, &mut bytes)?, self.indices("i64", index, &mut bytes)?])
            };
            Ok(Encoded {
                mean: self.row("mean", index, 2, self.vertices, &mut bytes)?,
                exponent: self.exponents(index, &mut bytes)?,
                indices,
                cb8: self.row("cb8", index, 3, GROUPS * entries, &mut bytes)?,
                cb64: self.row("cb64", index, 3, STEPS * entries, &mut bytes)?,
                runs: self.runs(index, &mut bytes)?,
            })
        };
        let parts = load()?;
        Ok((Arc::new(VqBlock::new(parts, self.parameters.entries as usize)), bytes))
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
    ) -> FileResult<Vec<T>> {
        let rows = read_rows::<T, 1>(&*self.source, &self.key(array, index, rank), count as u64)?;
        *bytes += (count * size_of::<T>()) as u64;
        Ok(rows.into_flattened())
    }

    /// Entries of a codebook, all of which exist.
    fn indices<T: Element + Into<u64>>(&self, array: &str, index: usize, bytes: &mut u64) -> FileResult<Vec<T>> {
        let indices = self.row::<T>(array, index, 2, self.vertices, bytes)?;
        match indices.iter().position(|&i| i.into() >= self.parameters.entries) {
            None => Ok(indices),
            Some(v) => {
                let problem = format!("vertex {v} has an entry that the codebook lacks");
                Err(self.damaged(array, index, 2, problem))
            }
        }
    }

    fn damaged(&self, array: &str, index: usize, rank: usize, problem: String) -> FileError {
        FileError::invalid(self.source.path(&self.key(array, index, rank)), "chunk", problem)
            .remedy("import the series again")
    }

    /// Exponents of a block; those of one whose chunk is missing are all 0.
    fn exponents(&self, index: usize, bytes: &mut u64) -> FileResult<Vec<i8>> {
        let key = self.key("exponent", index, 2);
        if !self.parameters.exponents || !self.source.exists(&key)? {
            return Ok(Vec::new());
        }
        self.row("exponent", index, 2, self.vertices, bytes)
    }

    fn runs(&self, index: usize, bytes: &mut u64) -> FileResult<Vec<SpecialRun>> {
        let specials = self.parameters.specials;
        if specials == 0 {
            return Ok(Vec::new());
        }
        let blocks = self.steps.div_ceil(STEPS);
        let starts: Vec<u64> = self.row("special_start", 0, 1, blocks + 1, bytes)?;
        let range = starts[index]..starts[index + 1];
        if range.start > range.end || range.end > specials {
            return Err(self.damaged("special_start", 0, 1, format!("block {index} has no range of rows")));
        }
        let mut runs = Vec::new();
        let chunk_rows = self.parameters.special_rows();
        for chunk in range.start / chunk_rows..range.end.div_ceil(chunk_rows) {
            let mut rows = vec![[0u32; 4]; chunk_rows as usize];
            *bytes += read_chunk(&*self.source, &self.key("special", chunk as usize, 2), rows.as_flattened_mut())?;
            let first = chunk * chunk_rows;
            let row = |at: u64| (at.saturating_sub(first).min(chunk_rows)) as usize;
            let rows = &rows[row(range.start)..row(range.end)];
            runs.extend(rows.iter().map(|&[vertex, first, count, bits]| SpecialRun { vertex, first, count, bits }));
        }
        let sound = runs.is_sorted() && runs.last().is_none_or(|run| (run.vertex as usize) < self.vertices);
        if sound {
            Ok(runs)
        } else {
            Err(self.damaged("special", 0, 2, format!("rows of block {index} are not in order")))
        }
    }
}

impl Decoder for VqDecoder {
    fn decode_step(&self, step: usize, out: &mut [f32]) -> FileResult<DecodeStats> {
        assert_eq!(out.len(), self.vertices, "one value per vertex");
        let (block, bytes_read) = self.block_of_step(step)?;
        block.decode(step % STEPS, step, out);
        Ok(DecodeStats { bytes_read, vertices_decoded: out.len() as u64 })
    }

    fn vq_block(&self, step: usize) -> FileResult<Option<Arc<VqBlock>>> {
        self.resident_block(step).map(Some)
    }
}

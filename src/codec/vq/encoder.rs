//! Streaming encoder: takes steps, writes blocks.

use super::block::{Encoded, Indices, SpecialRun, VqBlock};
use super::encode::encode_block;
use super::layout::{NAME, SPECIAL_ROWS, VqParameters};
use super::{STEPS, VqOptions};
use crate::codec::{
    ChunkSink, Encoder, EncoderState, ErrorTally, ReadRange, StoredValues, chunk_key, parse_chunk_key, read_rows,
    to_bytes,
};
use crate::error::{FileError, FileResult};
use crate::task::Cancel;

/// Buffers the steps of one block and writes the block when it is complete. Memory: 256 bytes a vertex for the block, about as much again
/// during encoding (twice that with the exact search).
#[derive(Debug)]
pub struct VqEncoder {
    options: VqOptions,
    vertices: usize,
    /// Steps of the current block.
    values: Vec<f32>,
    blocks: u64,
    exponents: bool,
    special: SpecialWriter,
    tally: ErrorTally,
}

impl VqEncoder {
    /// An encoder of a field with `vertices` values a step.
    ///
    /// # Panics
    /// If there is no vertex, or the number of entries is not one of [`VqOptions::entries`].
    pub fn new(vertices: usize, options: VqOptions) -> Self {
        assert!(vertices > 0, "no vertex");
        assert!((2..=super::MAX_ENTRIES).contains(&options.entries), "{} entries", options.entries);
        Self {
            options,
            vertices,
            values: Vec::new(),
            blocks: 0,
            exponents: false,
            special: SpecialWriter::default(),
            tally: ErrorTally::new(vertices),
        }
    }

    /// An encoder that continues a field that was coded with `parameters`. It begins after the last complete block of its values; the steps
    /// of a short block after it must first be pushed again, from the source. `tally` has the errors of the complete blocks. The output is
    /// the same as from an encoder of all steps.
    ///
    /// # Errors
    /// If the parameters do not say how the field was coded, or the special values of the complete blocks cannot be read.
    ///
    /// # Panics
    /// As [`VqEncoder::new`].
    pub fn resume(values: &StoredValues<'_>, parameters: &VqParameters, tally: ErrorTally) -> FileResult<Self> {
        let StoredValues { source, group_key, steps, vertices } = values;
        let options = parameters.options().ok_or_else(|| {
            FileError::unsupported(source.path(group_key), "codec_parameters", "do not say how the field was coded")
        })?;
        let blocks = (steps / STEPS) as u64;
        let key = format!("{group_key}/{NAME}");
        let special = SpecialWriter::resume(&**source, &key, parameters, *steps as u64)?;
        let mut exponents = false;
        for block in (0..blocks).filter(|_| parameters.exponents) {
            exponents = exponents || source.exists(&chunk_key(&format!("{key}/exponent"), block, 2))?;
        }
        Ok(Self { blocks, exponents, special, tally, ..Self::new(*vertices, options) })
    }

    /// The encoder whose state after `steps` steps this was; `None` if it is no such state.
    ///
    /// # Panics
    /// As [`VqEncoder::new`].
    pub fn from_state(vertices: usize, options: VqOptions, steps: usize, state: EncoderState) -> Option<Self> {
        let EncoderState { counts, rows, sums } = state;
        let (&[exponents, chunks], starts) = counts.split_first_chunk()?;
        let (rows, []) = rows.as_chunks() else { return None };
        let (of_steps, of_vertices) = sums.split_at_checked(steps.checked_mul(ErrorTally::PER_STEP)?)?;
        let (of_steps, []) = of_steps.as_chunks() else { return None };
        let blocks = steps / STEPS;
        let before = chunks.checked_mul(SPECIAL_ROWS)?.checked_add(rows.len() as u64)?;
        let in_order = starts.len() == blocks && starts.is_sorted() && starts.iter().all(|start| *start <= before);
        if !steps.is_multiple_of(STEPS) || exponents > 1 || !in_order || rows.len() as u64 >= SPECIAL_ROWS {
            return None;
        }
        let tally = ErrorTally::from_parts(of_steps, of_vertices.to_vec()).filter(|_| of_vertices.len() == vertices)?;
        let special = SpecialWriter { rows: rows.to_vec(), chunks, starts: starts.to_vec() };
        Some(Self { blocks: blocks as u64, exponents: exponents == 1, special, tally, ..Self::new(vertices, options) })
    }

    fn write_block(&mut self, sink: &mut dyn ChunkSink) -> FileResult<()> {
        // Runs count steps in u32, as `special` does.
        let first_step = (self.blocks * STEPS as u64) as u32;
        let mut parts = encode_block(&mut self.values, self.vertices, first_step, &self.options);
        let block = self.verified(&mut parts, first_step);
        write_parts(&parts, self.blocks, sink)?;
        self.exponents |= !parts.exponent.is_empty();
        self.special.block(&parts.runs, sink)?;
        let decode = |j: usize, first: usize, out: &mut [f32]| {
            block.decode_part(j, first_step as usize + j, first, out);
        };
        self.tally.add(&self.values, decode);
        self.blocks += 1;
        self.values.clear();
        Ok(())
    }

    /// The block as the decoder sees it, after finite values that overflow there have been turned into runs.
    fn verified(&self, parts: &mut Encoded, first_step: u32) -> VqBlock {
        let block = VqBlock::new(parts.clone(), self.options.entries, &Cancel::new());
        // Only blocks with exponents can reach the largest numbers.
        if parts.exponent.is_empty() {
            return block;
        }
        let before = parts.runs.len();
        let mut decoded = vec![0.0; self.vertices];
        for (j, row) in (0u32..).zip(self.values.chunks_exact(self.vertices)) {
            block.decode_finite(j as usize, 0, &mut decoded);
            for (vertex, (x, _)) in (0u32..).zip(row.iter().zip(&decoded)).filter(|(_, (_, y))| !y.is_finite()) {
                parts.runs.push(SpecialRun { vertex, first: first_step + j, count: 1, bits: x.to_bits() });
            }
        }
        if parts.runs.len() == before {
            return block;
        }
        // A filled special value has its run already.
        let special = parts.runs[..before].to_vec();
        let covered = |run: &SpecialRun| {
            let near = special.partition_point(|s| s.vertex < run.vertex);
            let same = special[near..].iter().take_while(|s| s.vertex == run.vertex);
            same.into_iter().any(|s| (s.first..s.first + s.count).contains(&run.first))
        };
        let added: Vec<SpecialRun> = parts.runs.drain(before..).filter(|run| !covered(run)).collect();
        parts.runs.extend(added);
        parts.runs.sort_unstable();
        VqBlock::new(parts.clone(), self.options.entries, &Cancel::new())
    }
}

fn write_parts(parts: &Encoded, block: u64, sink: &mut dyn ChunkSink) -> FileResult<()> {
    let mut put =
        |name: &str, rank: usize, bytes: &[u8]| sink.put(&chunk_key(&format!("{NAME}/{name}"), block, rank), bytes);
    let [i8, i64] = match &parts.indices {
        Indices::Narrow(lists) => lists.each_ref().map(|list| to_bytes(list)),
        Indices::Wide(lists) => lists.each_ref().map(|list| to_bytes(list)),
    };
    put("mean", 2, &to_bytes(&parts.mean))?;
    put("i8", 2, &i8)?;
    put("i64", 2, &i64)?;
    put("cb8", 3, &to_bytes(&parts.cb8))?;
    put("cb64", 3, &to_bytes(&parts.cb64))?;
    // If all are 0 the chunk is omitted: Zarr's fill value is the exponent 0.
    if parts.exponent.is_empty() { Ok(()) } else { put("exponent", 2, &to_bytes(&parts.exponent)) }
}

/// Writes `special` in chunks of equal length, across blocks; a single chunk is as long as needed. Buffers one chunk and one number a
/// block.
#[derive(Debug, Default)]
struct SpecialWriter {
    rows: Vec<[u32; 4]>,
    chunks: u64,
    /// Number of rows before each block.
    starts: Vec<u64>,
}

impl SpecialWriter {
    /// A writer with the rows of the complete blocks of a store with `steps` steps.
    fn resume(source: &dyn ReadRange, vq_key: &str, parameters: &VqParameters, steps: u64) -> FileResult<Self> {
        let blocks = steps as usize / STEPS;
        let mut starts = parameters.special_starts(source, vq_key, steps)?;
        if starts.is_empty() {
            return Ok(Self { starts: vec![0; blocks], ..Self::default() });
        }
        let count = starts[blocks];
        starts.truncate(blocks);
        let chunks = count / SPECIAL_ROWS;
        let left = (count % SPECIAL_ROWS) as usize;
        let mut rows = Vec::new();
        if left > 0 {
            let key = chunk_key(&format!("{vq_key}/special"), chunks, 2);
            rows = read_rows::<u32, 4>(source, &key, parameters.special_rows())?;
            rows.truncate(left);
        }
        Ok(Self { rows, chunks, starts })
    }

    fn count(&self) -> u64 {
        self.chunks * SPECIAL_ROWS + self.rows.len() as u64
    }

    fn block(&mut self, runs: &[SpecialRun], sink: &mut dyn ChunkSink) -> FileResult<()> {
        self.starts.push(self.count());
        for run in runs {
            self.rows.push([run.vertex, run.first, run.count, run.bits]);
            if self.rows.len() as u64 == SPECIAL_ROWS {
                self.flush(sink)?;
            }
        }
        Ok(())
    }

    fn flush(&mut self, sink: &mut dyn ChunkSink) -> FileResult<()> {
        sink.put(&chunk_key(&format!("{NAME}/special"), self.chunks, 2), &to_bytes(self.rows.as_flattened()))?;
        self.chunks += 1;
        self.rows.clear();
        Ok(())
    }

    /// Writes the buffered rows; returns the total number of rows.
    fn finish(mut self, sink: &mut dyn ChunkSink) -> FileResult<u64> {
        let count = self.count();
        if count == 0 {
            return Ok(0);
        }
        self.starts.push(count);
        if !self.rows.is_empty() {
            // Chunks of an array have equal length; the last one is padded with zeros.
            if self.chunks > 0 {
                self.rows.resize(SPECIAL_ROWS as usize, [0; 4]);
            }
            self.flush(sink)?;
        }
        sink.put(&chunk_key(&format!("{NAME}/special_start"), 0, 1), &to_bytes(&self.starts))?;
        Ok(count)
    }
}

impl Encoder for VqEncoder {
    fn name(&self) -> &'static str {
        NAME
    }

    fn push(&mut self, values: &[f32], sink: &mut dyn ChunkSink) -> FileResult<()> {
        assert_eq!(values.len(), self.vertices, "one value per vertex");
        self.values.extend_from_slice(values);
        if self.values.len() == STEPS * self.vertices { self.write_block(sink) } else { Ok(()) }
    }

    fn finish(mut self: Box<Self>, sink: &mut dyn ChunkSink) -> FileResult<crate::codec::Encoded> {
        let last = self.values.len() / self.vertices;
        let steps = self.blocks * STEPS as u64 + last as u64;
        let settled = self.tally.clone();
        if last > 0 {
            self.write_block(sink)?;
        }
        let specials = self.special.finish(sink)?;
        let parameters = VqParameters::new(&self.options, self.exponents, specials);
        let arrays = parameters.arrays(steps, self.vertices as u64);
        let parameters = serde_json::to_value(parameters).unwrap_or_default();
        let settled_errors = (steps >= STEPS as u64).then_some(settled);
        Ok(crate::codec::Encoded { arrays, parameters, errors: Some(self.tally), settled_errors })
    }

    fn is_settled(&self, key: &str) -> bool {
        let Some((array, row)) = parse_chunk_key(key) else { return false };
        match array.strip_prefix(NAME).and_then(|name| name.strip_prefix('/')) {
            Some("special") => row < self.special.chunks,
            Some("mean" | "i8" | "i64" | "cb8" | "cb64" | "exponent") => row < self.blocks,
            _ => false,
        }
    }

    fn state(&self) -> Option<EncoderState> {
        if !self.values.is_empty() {
            return None;
        }
        let (of_steps, of_vertices) = self.tally.parts();
        Some(EncoderState {
            counts: [&[u64::from(self.exponents), self.special.chunks], &self.special.starts[..]].concat(),
            rows: self.special.rows.as_flattened().to_vec(),
            sums: [of_steps.as_flattened(), of_vertices].concat(),
        })
    }
}

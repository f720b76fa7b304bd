//! Encoding of one field over time, so that any step can be decoded.
//!
//! An [`Encoder`] takes the steps in order, buffers those of a block, and hands finished chunks of bytes to a [`ChunkSink`] under their
//! names in the store. A [`Decoder`] reads bytes behind [`ReadRange`] (a folder today, an object store later) and decodes any step without
//! state that another thread could see. Chunks are those of Zarr arrays, described by [`ArraySpec`]: little-endian elements and then their
//! CRC-32C, as the stock codecs `bytes` and `crc32c` write. Decoders keep blocks in a [`BlockCache`], which several of them may share.
//!
//! To add a codec, add a folder here and a line to [`CODECS`].
//!
//! | layer | where |
//! |---|---|
//! | arrays and their shapes | [`ArraySpec`], filled in by the encoder's [`Encoder::finish`] |
//! | bytes of a chunk | [`seal`], [`read_chunk`] |
//! | values of a step | [`raw`], [`vq`] |
//! | blocks that stay in memory | [`blocks`] |
//! | errors of decoded values | [`ErrorTally`], [`Quality`] |

pub mod blocks;
mod chunk;
mod magnitude;
mod quality;
pub mod raw;
mod registry;
mod stop;
#[cfg(test)]
mod test_objects;
pub mod vq;

pub use blocks::{BlockCache, CacheStatistics};
pub use chunk::{
    ArraySpec, Chunking, Element, ElementType, ReadRange, check_chunk_size, chunk_key, parse_chunk_key, read_chunk,
    read_chunk_unless, read_rows, read_rows_unless, seal, to_bytes,
};
pub use magnitude::{magnitude, magnitude_unless};
pub use quality::{ErrorTally, OverSigma, Quality};
pub use registry::{CODECS, Codec, CodecChoice, Coding, Encoding, OptionText, PaperSize, StoredValues, codec_of};
pub use stop::Stop;

use crate::error::FileResult;
use crate::task::Cancel;
use blocks::BlockLoader;
use rayon::prelude::*;
use std::sync::Arc;

/// Cost of decoding a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecodeStats {
    /// Bytes read from the store.
    pub bytes_read: u64,
    /// Scalars decoded.
    pub vertices_decoded: u64,
}

/// The vertices of a step to be decoded, by chunks.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Vertices per chunk (the last one may have fewer).
    pub length: usize,
    /// Whether each chunk is wanted.
    pub chunks: &'a [bool],
}

impl Wanted<'_> {
    /// The wanted chunks of `out`, each with its first vertex.
    pub(crate) fn of<T: Send>(self, out: &mut [T]) -> impl ParallelIterator<Item = (usize, &mut [T])> {
        let chunks = out.par_chunks_mut(self.length.max(1)).zip(self.chunks).enumerate();
        chunks.filter(|(_, (_, wanted))| **wanted).map(move |(at, (out, _))| (at * self.length, out))
    }

    /// Number of wanted vertices among `vertices`.
    ///
    /// # Panics
    /// If there is not one flag for each chunk.
    pub(crate) fn count(self, vertices: usize) -> u64 {
        assert_eq!(vertices.div_ceil(self.length), self.chunks.len(), "a wish for each chunk");
        let length = |at: usize| self.length.min(vertices.saturating_sub(at * self.length));
        self.chunks.iter().enumerate().filter(|(_, wanted)| **wanted).map(|(at, _)| length(at) as u64).sum()
    }
}

/// A step to be decoded, and what of it.
#[derive(Clone, Copy, Debug)]
pub struct StepRequest<'a> {
    /// The step.
    pub step: usize,
    /// The vertices that are needed; `None` for all.
    pub wanted: Option<Wanted<'a>>,
    /// Ends the decoding when it is raised.
    pub cancel: &'a Cancel,
}

impl<'a> StepRequest<'a> {
    /// A request for all vertices of a step.
    pub fn whole(step: usize, cancel: &'a Cancel) -> Self {
        Self { step, wanted: None, cancel }
    }
}

/// Receives the finished chunks of an encoder.
pub trait ChunkSink {
    /// Stores `payload` (without its checksum) under `key`, as made by [`chunk_key`].
    ///
    /// # Errors
    /// If the chunk cannot be written.
    fn put(&mut self, key: &str, payload: &[u8]) -> FileResult<()>;
}

/// Result of a finished encoder.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The arrays whose chunks went to the sink.
    pub arrays: Vec<ArraySpec>,
    /// Codec parameters, for the store's attributes.
    pub parameters: serde_json::Value,
    /// Errors of decoded values; `None` if the codec is exact by design.
    pub errors: Option<ErrorTally>,
    /// The part of `errors` that does not change if steps are added later; `None` if there is none.
    pub settled_errors: Option<ErrorTally>,
}

/// The state of an encoder at the end of a block, as numbers whose meaning is the codec's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EncoderState {
    /// Counts.
    pub counts: Vec<u64>,
    /// Rows that wait for others to make a chunk.
    pub rows: Vec<u32>,
    /// Sums.
    pub sums: Vec<f64>,
}

/// Encodes the steps of one field in order.
pub trait Encoder: Send {
    /// Name of the codec in the store's attributes.
    fn name(&self) -> &'static str;

    /// Takes the next step, one value per vertex, and writes chunks that it completes.
    ///
    /// # Errors
    /// If the sink fails.
    fn push(&mut self, values: &[f32], sink: &mut dyn ChunkSink) -> FileResult<()>;

    /// Writes what is still buffered (a last, short block).
    ///
    /// # Errors
    /// If the sink fails.
    fn finish(self: Box<Self>, sink: &mut dyn ChunkSink) -> FileResult<Encoded>;

    /// Whether the chunk `key` is final: written, and not written again however many steps follow. A resumed encoder also counts the chunks
    /// of its predecessor that it does not replace.
    fn is_settled(&self, key: &str) -> bool;

    /// The state at the end of a block, from which [`Encoding::resume`] goes on bit for bit; `None` within one.
    fn state(&self) -> Option<EncoderState>;
}

/// Decodes any step of one field, from several threads at once.
pub trait Decoder: Send + Sync {
    /// Decodes a step into `out`, one value per vertex, unless it is cancelled: `None` then, within a few milliseconds, and `out` is
    /// unspecified. Only wanted vertices need to be decoded; the others are unspecified.
    ///
    /// # Errors
    /// If a chunk is missing, cut or damaged; the error names the file and the step. `out` is unspecified then.
    ///
    /// # Panics
    /// If the length of `out` is not the number of vertices, or there is not one flag for each chunk.
    fn decode_step_unless(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>>;

    /// Decodes the whole step, without cancellation.
    ///
    /// # Errors
    /// As [`Decoder::decode_step_unless`].
    ///
    /// # Panics
    /// As [`Decoder::decode_step_unless`].
    fn decode_step(&self, step: usize, out: &mut [f32]) -> FileResult<DecodeStats> {
        stop::uncancelled(|cancel| {
            self.decode_step_unless(StepRequest::whole(step, cancel), out)?.ok_or(Stop::Cancelled)
        })
    }

    /// The block of codec `vq` that contains `step`, for a decoder on another processor; `None` from other codecs.
    ///
    /// # Errors
    /// As [`Decoder::decode_step`].
    fn vq_block(&self, _step: usize) -> FileResult<Option<Arc<vq::VqBlock>>> {
        Ok(None)
    }

    /// The loader of this decoder's blocks into a [`BlockCache`] before they are needed; `None` if it caches none.
    fn blocks(&self) -> Option<&dyn BlockLoader> {
        None
    }
}

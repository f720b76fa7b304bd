//! Encoding of one field over time, so that any step can be decoded.
//!
//! An [`Encoder`] takes the steps in order, keeps as many as a block of it needs, and hands finished chunks of bytes to a
//! [`ChunkSink`] under the names that they have in the store. A [`Decoder`] reads bytes behind [`ReadRange`] (a folder
//! today, an object store later) and decodes any step without state that another thread could see. Chunks are those of
//! Zarr arrays, described by [`ArraySpec`]: little-endian elements and then their CRC-32C, which is what the stock codecs
//! `bytes` and `crc32c` write. What decoders keep in memory lies in a [`BlockCache`], which several of them may share.
//!
//! A further codec is a folder here and a line of [`CODECS`].
//!
//! | layer | where |
//! |---|---|
//! | what arrays there are | [`ArraySpec`], filled in by the encoder's [`Encoder::finish`] |
//! | bytes of a chunk | [`seal`], [`read_chunk`] |
//! | values of a step | [`raw`], [`vq`] |
//! | blocks that stay in memory | [`blocks`] |
//! | how far they are from the truth | [`ErrorTally`], [`Quality`] |

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
pub use registry::{CODECS, Codec, CodecChoice, Coding, Encoding, StoredValues, codec_of};
pub use stop::Stop;

use crate::error::FileResult;
use crate::task::Cancel;
use blocks::BlockLoader;
use rayon::prelude::*;
use std::sync::Arc;

/// What decoding a step cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecodeStats {
    /// Bytes read from the store.
    pub bytes_read: u64,
    /// Scalars decoded.
    pub vertices_decoded: u64,
}

/// Which vertices of a step are to be decoded: some of its chunks.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Vertices of a chunk (the last one may have fewer).
    pub length: usize,
    /// Whether each is wanted.
    pub chunks: &'a [bool],
}

impl Wanted<'_> {
    /// The chunks of `out` that are wanted, each with its first vertex.
    pub(crate) fn of<T: Send>(self, out: &mut [T]) -> impl ParallelIterator<Item = (usize, &mut [T])> {
        let chunks = out.par_chunks_mut(self.length.max(1)).zip(self.chunks).enumerate();
        chunks.filter(|(_, (_, wanted))| **wanted).map(move |(at, (out, _))| (at * self.length, out))
    }

    /// How many of `vertices` these are.
    ///
    /// # Panics
    /// If there is not one wish for each chunk.
    pub(crate) fn count(self, vertices: usize) -> u64 {
        assert_eq!(vertices.div_ceil(self.length), self.chunks.len(), "a wish for each chunk");
        let length = |at: usize| self.length.min(vertices.saturating_sub(at * self.length));
        self.chunks.iter().enumerate().filter(|(_, wanted)| **wanted).map(|(at, _)| length(at) as u64).sum()
    }
}

/// Takes the finished chunks of an encoder.
pub trait ChunkSink {
    /// Keeps `payload` (without its checksum) under `key`, as [`chunk_key`] makes it.
    ///
    /// # Errors
    /// If the chunk cannot be written.
    fn put(&mut self, key: &str, payload: &[u8]) -> FileResult<()>;
}

/// What an encoder has written once it is through.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The arrays whose chunks went to the sink.
    pub arrays: Vec<ArraySpec>,
    /// Parameters of the codec, for the store's attributes.
    pub parameters: serde_json::Value,
    /// What decoding gives back wrongly; `None` if it is exact by design.
    pub errors: Option<ErrorTally>,
    /// Of these, what does not change if steps are added later; `None` if there is nothing.
    pub settled_errors: Option<ErrorTally>,
}

/// Encodes the steps of one field in order.
pub trait Encoder: Send {
    /// Name of the codec in the store's attributes.
    fn name(&self) -> &'static str;

    /// Takes the next step, one value per vertex, and writes what has become complete by it.
    ///
    /// # Errors
    /// If the sink fails.
    fn push(&mut self, values: &[f32], sink: &mut dyn ChunkSink) -> FileResult<()>;

    /// Writes what is still buffered (a last, short block).
    ///
    /// # Errors
    /// If the sink fails.
    fn finish(self: Box<Self>, sink: &mut dyn ChunkSink) -> FileResult<Encoded>;

    /// Whether the chunk `key` is final at this moment: it is there and not written again, however many steps follow. Of an
    /// encoder that goes on with what another one left, the chunks that it does not replace.
    fn is_settled(&self, key: &str) -> bool;
}

/// Decodes any step of one field, from several threads at once.
pub trait Decoder: Send + Sync {
    /// Decodes `step` into `out`, one value per vertex, unless `cancel` is raised: `None` then, within a few milliseconds,
    /// and `out` is unspecified. Only those vertices need to be there that are wanted, if that is said; what the others hold is
    /// unspecified.
    ///
    /// # Errors
    /// If a chunk is missing, cut or damaged; the error names the file and the step. `out` is unspecified then.
    ///
    /// # Panics
    /// If the length of `out` is not the number of vertices, or there is not one wish for each chunk.
    fn decode_step_unless(
        &self,
        step: usize,
        wanted: Option<Wanted<'_>>,
        out: &mut [f32],
        cancel: &Cancel,
    ) -> FileResult<Option<DecodeStats>>;

    /// The whole step, without a way to stop it.
    ///
    /// # Errors
    /// As [`Decoder::decode_step_unless`].
    ///
    /// # Panics
    /// As [`Decoder::decode_step_unless`].
    fn decode_step(&self, step: usize, out: &mut [f32]) -> FileResult<DecodeStats> {
        stop::uncancelled(|cancel| self.decode_step_unless(step, None, out, cancel)?.ok_or(Stop::Cancelled))
    }

    /// The block of codec `vq` that `step` is in, for a decoder on another processor; `None` from other codecs.
    ///
    /// # Errors
    /// As [`Decoder::decode_step`].
    fn vq_block(&self, _step: usize) -> FileResult<Option<Arc<vq::VqBlock>>> {
        Ok(None)
    }

    /// How the blocks of this decoder are loaded into a [`BlockCache`] before they are needed; `None` if it keeps none.
    fn blocks(&self) -> Option<&dyn BlockLoader> {
        None
    }
}

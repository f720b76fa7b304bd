//! Codec `raw`: uncompressed f32 steps, one chunk a step.

use super::blocks::{Block, BlockCache, BlockKey, BlockLoader, DecoderId, LoadedBlock};
use super::stop::{go_on, unless_cancelled};
use super::{
    ArraySpec, ChunkSink, Chunking, Codec, CodecChoice, Coding, DecodeStats, Decoder, ElementType, Encoded, Encoder,
    EncoderState, Encoding, ErrorTally, PaperSize, ReadRange, StepRequest, Stop, StoredValues, chunk_key,
    parse_chunk_key, read_chunk_unless, read_rows_unless, to_bytes,
};
use crate::error::{FileError, FileResult};
use crate::slowdown::{Slow, waste};
use crate::task::Cancel;
use rayon::prelude::*;
use std::fmt;
use std::sync::Arc;

/// Values that one task copies: below that, threads cost more than they save.
const TASK: usize = 32_768;

/// Name of the codec and of its array.
pub const NAME: &str = "raw";

/// The codec that stores values unchanged.
pub static CODEC: Codec = Codec {
    name: NAME,
    about: "the values as they are",
    options: &[],
    block_steps: 1,
    is_exact: true,
    choose: |options| match options.first() {
        None => Ok(CodecChoice::new(Raw)),
        Some((name, _)) => Err(format!("codec {NAME} has no option '{name}'")),
    },
    coding: |_parameters| Ok(Arc::new(Raw)),
};

/// The options of the codec, of which there are none, and its coding.
#[derive(Clone, Copy, Debug)]
pub struct Raw;

impl fmt::Display for Raw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(NAME)
    }
}

impl Encoding for Raw {
    fn codec(&self) -> &'static Codec {
        &CODEC
    }

    fn encoder(&self, vertices: usize) -> Box<dyn Encoder> {
        Box::new(RawEncoder::new(vertices))
    }

    fn resume(&self, vertices: usize, steps: usize, state: EncoderState) -> Option<Box<dyn Encoder>> {
        let encoder = RawEncoder::resume(vertices, steps as u64);
        (encoder.state()? == state).then(|| Box::new(encoder) as Box<dyn Encoder>)
    }

    fn by_the_paper(&self, _vertices: u64, _steps: u64) -> Option<PaperSize> {
        None
    }
}

impl Coding for Raw {
    fn codec(&self) -> &'static Codec {
        &CODEC
    }

    fn choice(&self) -> Option<CodecChoice> {
        Some(CodecChoice::new(Self))
    }

    fn arrays(&self, steps: u64, vertices: u64) -> Vec<ArraySpec> {
        vec![array(steps, vertices)]
    }

    fn decoder(&self, values: &StoredValues<'_>, cache: Option<Arc<BlockCache>>) -> Box<dyn Decoder> {
        let decoder = RawDecoder::new(values.source.clone(), values.group_key, values.steps, values.vertices);
        Box::new(match cache {
            Some(cache) => decoder.with_cache(cache),
            None => decoder,
        })
    }

    fn unsettled_chunks(&self, _values: &StoredValues<'_>) -> Vec<String> {
        Vec::new()
    }

    fn resume(&self, values: &StoredValues<'_>, _errors: ErrorTally) -> FileResult<Box<dyn Encoder>> {
        Ok(Box::new(RawEncoder::resume(values.vertices, values.steps as u64)))
    }
}

/// The array `raw` [steps, vertices] of f32.
pub fn array(steps: u64, vertices: u64) -> ArraySpec {
    ArraySpec {
        name: NAME.to_owned(),
        element: ElementType::F32,
        shape: vec![steps, vertices],
        chunking: Chunking::PerRow,
        axes: vec!["step", "vertex"],
    }
}

/// Writes each step as it comes.
#[derive(Debug)]
pub struct RawEncoder {
    steps: u64,
    vertices: u64,
}

impl RawEncoder {
    /// An encoder of a field with `vertices` values a step.
    pub fn new(vertices: usize) -> Self {
        Self::resume(vertices, 0)
    }

    /// An encoder that continues after `steps` steps.
    pub fn resume(vertices: usize, steps: u64) -> Self {
        Self { steps, vertices: vertices as u64 }
    }
}

impl Encoder for RawEncoder {
    fn name(&self) -> &'static str {
        NAME
    }

    fn push(&mut self, values: &[f32], sink: &mut dyn ChunkSink) -> FileResult<()> {
        assert_eq!(values.len() as u64, self.vertices, "one value per vertex");
        sink.put(&chunk_key(NAME, self.steps, 2), &to_bytes(values))?;
        self.steps += 1;
        Ok(())
    }

    fn finish(self: Box<Self>, _sink: &mut dyn ChunkSink) -> FileResult<Encoded> {
        let arrays = vec![array(self.steps, self.vertices)];
        Ok(Encoded { arrays, parameters: serde_json::json!({}), errors: None, settled_errors: None })
    }

    fn is_settled(&self, key: &str) -> bool {
        parse_chunk_key(key).is_some_and(|(array, step)| array == NAME && step < self.steps)
    }

    fn state(&self) -> Option<EncoderState> {
        Some(EncoderState { counts: vec![self.steps], ..EncoderState::default() })
    }
}

/// Reads a step directly into the caller's memory, or copies it from a cache into which it was loaded ahead.
pub struct RawDecoder {
    source: Arc<dyn ReadRange>,
    array_key: String,
    steps: usize,
    vertices: usize,
    id: DecoderId,
    cache: Option<Arc<BlockCache>>,
}

impl RawDecoder {
    /// An uncached decoder of the array `raw` in the group `group_key` of `source`.
    pub fn new(source: Arc<dyn ReadRange>, group_key: &str, steps: usize, vertices: usize) -> Self {
        let array_key = format!("{group_key}/{NAME}");
        Self { source, array_key, steps, vertices, id: DecoderId::unique(), cache: None }
    }

    /// Makes the decoder look into `cache` first. Decoding puts nothing there: a decoded step is in the caller's memory already.
    #[must_use]
    pub fn with_cache(mut self, cache: Arc<BlockCache>) -> Self {
        self.cache = Some(cache);
        self
    }

    fn decode(&self, request: StepRequest<'_>, out: &mut [f32]) -> Result<DecodeStats, Stop> {
        let StepRequest { step, wanted, cancel } = request;
        let vertices_decoded = out.len() as u64;
        if step >= self.steps {
            let problem = format!("there are {} steps, counted from 0", self.steps);
            let path = self.source.path(&self.array_key);
            return Err(FileError::invalid(path, format!("step {step}"), problem).into());
        }
        let key = BlockKey { decoder: self.id, index: step };
        if let Some(Block::Raw(values)) = self.cache.as_ref().and_then(|cache| cache.find(key, cancel)) {
            let vertices_decoded = wanted.map_or(vertices_decoded, |wanted| wanted.count(out.len()));
            match wanted {
                None => copy(&values, out, cancel)?,
                Some(wanted) => wanted.of(out).for_each(|(at, out)| out.copy_from_slice(&values[at..at + out.len()])),
            }
            return go_on(cancel).map(|()| DecodeStats { bytes_read: 0, vertices_decoded });
        }
        let read = read_chunk_unless(&*self.source, &chunk_key(&self.array_key, step as u64, 2), out, cancel);
        let bytes_read = read.map_err(|stop| stop.at(|| format!("step {step}")))?;
        waste(Slow::DecodeRaw, out.len());
        Ok(DecodeStats { bytes_read, vertices_decoded })
    }
}

/// Copies on all threads.
fn copy(values: &[f32], out: &mut [f32], cancel: &Cancel) -> Result<(), Stop> {
    if out.len() <= TASK {
        out.copy_from_slice(values);
    } else {
        out.par_chunks_mut(TASK).zip(values.par_chunks(TASK)).for_each(|(out, values)| {
            if !cancel.is_cancelled() {
                out.copy_from_slice(values);
            }
        });
    }
    go_on(cancel)
}

impl BlockLoader for RawDecoder {
    fn id(&self) -> DecoderId {
        self.id
    }

    fn block_of_step(&self, step: usize) -> Option<usize> {
        (step < self.steps).then_some(step)
    }

    fn expected_bytes(&self, _index: usize) -> u64 {
        (self.vertices as u64).saturating_mul(size_of::<f32>() as u64)
    }

    fn load(&self, index: usize, cancel: &Cancel) -> Result<LoadedBlock, Stop> {
        let key = chunk_key(&self.array_key, index as u64, 2);
        let rows = read_rows_unless::<f32, 1>(&*self.source, &key, self.vertices as u64, cancel);
        let values = rows.map_err(|stop| stop.at(|| format!("step {index}")))?.into_flattened();
        let bytes = size_of_val(&values[..]) as u64;
        // The checksum has been read, too.
        let bytes_read = bytes + u64::from(u32::BITS / 8);
        Ok(LoadedBlock { block: Block::Raw(Arc::new(values)), bytes, bytes_read })
    }
}

impl Decoder for RawDecoder {
    /// Reads a step as a whole if it comes from its file: the checksum is over all of it.
    fn decode_step_unless(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>> {
        assert_eq!(out.len(), self.vertices, "one value per vertex");
        unless_cancelled(self.decode(request, out))
    }

    fn blocks(&self) -> Option<&dyn BlockLoader> {
        self.cache.is_some().then_some(self)
    }
}

impl Drop for RawDecoder {
    fn drop(&mut self) {
        if let Some(cache) = &self.cache {
            cache.forget(self.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::test_objects::Objects;

    const STEPS: [[f32; 3]; 2] = [[1.0, -0.0, f32::INFINITY], [f32::MIN_POSITIVE, 1e-45, -3.5]];

    fn encoded() -> Objects {
        let mut objects = Objects::default();
        let mut encoder = Box::new(RawEncoder::new(3));
        for step in &STEPS {
            encoder.push(step, &mut objects).unwrap();
        }
        assert_eq!(encoder.finish(&mut objects).unwrap().arrays, [array(2, 3)]);
        objects
    }

    fn decode(objects: &Objects, step: usize) -> FileResult<Vec<u32>> {
        let mut out = [0.0; 3];
        let stats = RawDecoder::new(Arc::new(objects.clone()), "f", 2, 3).decode_step(step, &mut out)?;
        assert_eq!(stats, DecodeStats { bytes_read: 16, vertices_decoded: 3 });
        Ok(out.iter().map(|v| v.to_bits()).collect())
    }

    #[test]
    fn any_step_comes_back_bit_for_bit() {
        let objects = encoded();
        for step in [1, 0, 1] {
            assert_eq!(decode(&objects, step).unwrap(), STEPS[step].map(f32::to_bits));
        }
    }

    #[test]
    fn every_flipped_bit_is_noticed_and_the_step_named() {
        let objects = encoded();
        for byte in 0..16 {
            let mut damaged = objects.clone();
            damaged.0.get_mut("f/raw/c/1/0").unwrap()[byte] ^= 0x10;
            let error = decode(&damaged, 1).unwrap_err();
            assert_eq!((error.place.as_str(), error.path.to_str().unwrap()), ("step 1", "f/raw/c/1/0"));
            assert!(decode(&damaged, 0).is_ok());
        }
    }

    #[test]
    fn a_cut_a_longer_and_a_missing_chunk_and_a_step_too_far_are_errors() {
        for change in [|b: &mut Vec<u8>| b.truncate(15), |b: &mut Vec<u8>| b.push(0), |b: &mut Vec<u8>| b.clear()] {
            let mut objects = encoded();
            change(objects.0.get_mut("f/raw/c/0/0").unwrap());
            assert!(decode(&objects, 0).unwrap_err().problem.contains("instead of 16"));
        }
        let mut objects = encoded();
        objects.0.remove("f/raw/c/0/0");
        assert!(decode(&objects, 0).is_err());
        assert!(decode(&objects, 2).unwrap_err().problem.contains("2 steps"));
    }
}

//! Codec `raw`: the steps as they are, f32, one chunk a step.

use super::{
    ArraySpec, ChunkSink, Chunking, DecodeStats, Decoder, ElementType, Encoded, Encoder, ReadRange, chunk_key,
    parse_chunk_key, read_chunk, to_bytes,
};
use crate::error::{FileError, FileResult};
use std::sync::Arc;

/// Name of the codec and of its array.
pub const NAME: &str = "raw";

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

    /// An encoder that goes on behind so many steps.
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
}

/// Reads a step straight into the caller's memory.
pub struct RawDecoder {
    source: Arc<dyn ReadRange>,
    array_key: String,
    steps: usize,
    vertices: usize,
}

impl RawDecoder {
    /// A decoder of the array `raw` in the group `group_key` of `source`.
    pub fn new(source: Arc<dyn ReadRange>, group_key: &str, steps: usize, vertices: usize) -> Self {
        Self { source, array_key: format!("{group_key}/{NAME}"), steps, vertices }
    }
}

impl Decoder for RawDecoder {
    fn decode_step(&self, step: usize, out: &mut [f32]) -> FileResult<DecodeStats> {
        assert_eq!(out.len(), self.vertices, "one value per vertex");
        if step >= self.steps {
            let problem = format!("there are {} steps, counted from 0", self.steps);
            return Err(FileError::invalid(self.source.path(&self.array_key), format!("step {step}"), problem));
        }
        let key = chunk_key(&self.array_key, step as u64, 2);
        let bytes_read = read_chunk(&*self.source, &key, out).map_err(|mut error| {
            error.place = format!("step {step}");
            error
        })?;
        Ok(DecodeStats { bytes_read, vertices_decoded: out.len() as u64 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::seal;
    use std::collections::BTreeMap;
    use std::path::PathBuf;

    /// Objects in memory: a sink and a source.
    #[derive(Clone, Default)]
    struct Objects(BTreeMap<String, Vec<u8>>);

    impl ChunkSink for Objects {
        fn put(&mut self, key: &str, payload: &[u8]) -> FileResult<()> {
            let mut bytes = payload.to_vec();
            bytes.extend(seal(payload));
            self.0.insert(format!("f/{key}"), bytes);
            Ok(())
        }
    }

    impl ReadRange for Objects {
        fn size(&self, key: &str) -> FileResult<u64> {
            let missing = || FileError::invalid(self.path(key), "", "is missing");
            self.0.get(key).map(|b| b.len() as u64).ok_or_else(missing)
        }

        fn exists(&self, key: &str) -> FileResult<bool> {
            Ok(self.0.contains_key(key))
        }

        fn read(&self, key: &str, offset: u64, parts: &mut [&mut [u8]]) -> FileResult<()> {
            let mut rest = &self.0[key][usize::try_from(offset).unwrap()..];
            for part in parts {
                let (head, tail) = rest.split_at(part.len());
                part.copy_from_slice(head);
                rest = tail;
            }
            Ok(())
        }

        fn path(&self, key: &str) -> PathBuf {
            PathBuf::from(key)
        }
    }

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

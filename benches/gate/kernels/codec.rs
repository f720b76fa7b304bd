//! Kernels of codecs, and of chunks in files.

use super::Work;
use crate::scene::Jet;
use std::collections::BTreeMap;
use std::error::Error;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tetreel::codec::raw::{RawDecoder, RawEncoder};
use tetreel::codec::vq::{STEPS, VqDecoder, VqEncoder, VqOptions, VqParameters};
use tetreel::codec::{ChunkSink, Decoder, Encoder, ReadRange, seal};
use tetreel::error::{FileError, FileResult};
use tetreel::field::{Association, FieldSelector, TimeAxis};
use tetreel::moments::Moments;
use tetreel::random::SplitMix64;
use tetreel::store::{FieldDescription, FieldReader, FieldWriter, Store, StoreWriter};

/// Chunks in memory.
#[derive(Default)]
pub struct Objects(BTreeMap<String, Vec<u8>>);

impl ChunkSink for Objects {
    fn put(&mut self, key: &str, payload: &[u8]) -> FileResult<()> {
        self.0.insert(format!("f/{key}"), [payload, &seal(payload)].concat());
        Ok(())
    }
}

impl ReadRange for Objects {
    fn size(&self, key: &str) -> FileResult<u64> {
        self.0.get(key).map(|b| b.len() as u64).ok_or_else(|| FileError::invalid(key, "", "is missing"))
    }

    fn exists(&self, key: &str) -> FileResult<bool> {
        Ok(self.0.contains_key(key))
    }

    fn read(&self, key: &str, offset: u64, parts: &mut [&mut [u8]]) -> FileResult<()> {
        let mut at = offset as usize;
        for part in parts {
            part.copy_from_slice(&self.0[key][at..at + part.len()]);
            at += part.len();
        }
        Ok(())
    }

    fn path(&self, key: &str) -> PathBuf {
        key.into()
    }
}

/// Values of 64 steps, one after the other: some functions of time, mixed differently at each vertex, and a little noise.
pub fn series(vertices: usize) -> Vec<f32> {
    const FUNCTIONS: usize = 5;
    let mut random = SplitMix64::new(7);
    let mut number = || random.between(-1.0, 1.0) as f32;
    let over_time: Vec<[f32; FUNCTIONS]> = (0..STEPS).map(|_| std::array::from_fn(|_| number())).collect();
    let at_vertex: Vec<[f32; FUNCTIONS]> = (0..vertices).map(|_| std::array::from_fn(|_| number())).collect();
    let mut values = Vec::with_capacity(STEPS * vertices);
    for functions in &over_time {
        for weights in &at_vertex {
            let sum: f32 = functions.iter().zip(weights).map(|(f, w)| f * w).sum();
            values.push(sum + 0.01 * number());
        }
    }
    values
}

/// A block of codec `vq`, decoder ready.
pub fn vq_block(vertices: usize, entries: usize) -> Result<VqDecoder, Box<dyn Error>> {
    let mut objects = Objects::default();
    let parameters = encode(&series(vertices), vertices, entries, &mut objects)?;
    Ok(VqDecoder::new(Arc::new(objects), "f", VqParameters::read(&parameters)?, STEPS, vertices))
}

fn encode(
    values: &[f32],
    vertices: usize,
    entries: usize,
    sink: &mut Objects,
) -> Result<serde_json::Value, Box<dyn Error>> {
    let mut encoder = Box::new(VqEncoder::new(vertices, VqOptions { entries, ..VqOptions::default() }));
    for row in values.chunks_exact(vertices) {
        encoder.push(row, sink)?;
    }
    Ok(encoder.finish(sink)?.parameters)
}

/// Decodes any step of a block in memory.
pub fn decode_vq(_: &Path) -> Result<Work, Box<dyn Error>> {
    const VERTICES: usize = 4000;
    let decoder = vq_block(VERTICES, 64)?;
    let mut out = vec![0.0; VERTICES];
    // Loads the block.
    decoder.decode_step(0, &mut out)?;
    Ok(Box::new(move || {
        for at in 0..20 * STEPS {
            decoder.decode_step(at * 29 % STEPS, black_box(&mut out))?;
        }
        Ok(())
    }))
}

/// Decodes steps from memory with their checksums, which dominate.
pub fn decode_raw(_: &Path) -> Result<Work, Box<dyn Error>> {
    const VERTICES: usize = 60_000;
    const ROWS: usize = 4;
    let values = (0..VERTICES).map(|v| v as f32).collect::<Vec<_>>();
    let mut objects = Objects::default();
    let mut encoder = Box::new(RawEncoder::new(VERTICES));
    for _ in 0..ROWS {
        encoder.push(&values, &mut objects)?;
    }
    encoder.finish(&mut objects)?;
    let decoder = RawDecoder::new(Arc::new(objects), "f", ROWS, VERTICES);
    let mut out = vec![0.0; VERTICES];
    Ok(Box::new(move || {
        for at in 0..25 * ROWS {
            decoder.decode_step(at % ROWS, black_box(&mut out))?;
        }
        Ok(())
    }))
}

/// Encodes one block: training, search, means, and errors.
pub fn encode_vq(_: &Path) -> Result<Work, Box<dyn Error>> {
    const VERTICES: usize = 2000;
    let values = series(VERTICES);
    Ok(Box::new(move || {
        let mut objects = Objects::default();
        black_box(encode(&values, VERTICES, 64, &mut objects)?);
        Ok(())
    }))
}

/// A store with one field of codec `raw`.
struct OneField {
    store: StoreWriter,
    field: FieldWriter,
    moments: Moments,
}

impl OneField {
    fn begin(path: &Path, jet: &Jet, steps: usize) -> Result<Self, Box<dyn Error>> {
        let mut store = StoreWriter::create(path, false)?;
        store.write_mesh(&jet.mesh, &Default::default())?;
        store.write_times(&TimeAxis { values: (0..steps).map(|step| step as f64).collect() })?;
        let vertices = jet.mesh.vertex_source.len();
        let (association, values_of) = (Association::Point, Association::Point);
        let description = FieldDescription { name: "f".to_owned(), association, values_of, weights: None, units: None };
        let field = store.begin_field(description, Box::new(RawEncoder::new(vertices)));
        Ok(Self { store, field, moments: Moments::new(vertices) })
    }

    /// A reader of a store whose steps are all equal.
    fn written(path: &Path, jet: &Jet, steps: usize) -> Result<FieldReader, Box<dyn Error>> {
        let mut new = Self::begin(path, jet, steps)?;
        for _ in 0..steps {
            new.moments.add_step(&jet.scalars[0]);
            new.field.push(&jet.scalars[0])?;
        }
        new.field.finish(&new.moments)?;
        new.store.finish("gate", Vec::new())?;
        Ok(Store::open(path)?.field(&FieldSelector { name: "f".to_owned(), component: None })?)
    }
}

/// Writes chunks to files and reads others, one step each: names, checksums and copies; system calls are not counted.
pub fn store_chunk(folder: &Path) -> Result<Work, Box<dyn Error>> {
    const STORED: usize = 8;
    let jet = Jet::new(30_000, &[8])?;
    let reader = OneField::written(&folder.join("read.zarr"), &jet, STORED)?;
    let mut new = OneField::begin(&folder.join("write.zarr"), &jet, STORED)?;
    let mut out = vec![0.0; jet.mesh.vertex_source.len()];
    Ok(Box::new(move || {
        for at in 0..400 {
            new.field.push(&jet.scalars[0])?;
            reader.decode_step(at % STORED, black_box(&mut out))?;
        }
        Ok(())
    }))
}

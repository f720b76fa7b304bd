//! Codec `vq`: time and error of encoding, time of decoding a step: `cargo bench --bench vq [-- VERTICES]`; with `TETREEL_BENCH_EXACT` set, beside full LBG.
//!
//! Encoding: one block of 64 steps of the generated series, megabytes of f32 a second and core, and the signal-to-noise
//! ratio with that of the exact search (full LBG) beside it. Decoding: any step of a block in memory, nanoseconds a
//! vertex, one thread; every answer is compared with the formula of the format on the way.

use std::collections::BTreeMap;
use std::error::Error;
use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;
use tetreel::bench::{Machine, Spread};
use tetreel::codec::vq::{Search, VqDecoder, VqEncoder, VqOptions, VqParameters};
use tetreel::codec::{ChunkSink, Decoder, Encoder, Quality, ReadRange, seal};
use tetreel::error::{FileError, FileResult};
use tetreel::field::{Component, SeriesSource};
use tetreel::mesh::Mesh;
use tetreel::moments::Moments;
use tetreel::synth::{SeriesName, SynthSpec, generate};

const STEPS: usize = 64;
const DECODES: usize = 400;
const ENCODES: usize = 3;

/// Chunks in memory.
#[derive(Default)]
struct Objects(BTreeMap<String, Vec<u8>>);

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

/// The first 64 steps of a series with some `vertices`, in the order of the store; values and vertices.
fn series(name: SeriesName, vertices: u64) -> Result<(Vec<f32>, usize), Box<dyn Error>> {
    // Kuhn grids have between five and six cells a vertex.
    let source = generate(&SynthSpec { cells: vertices * 57 / 10, steps: STEPS, ..SynthSpec::new(name) })?;
    let (mesh, _) = Mesh::build(source.mesh()?)?;
    let (mut values, mut step_values) = (Vec::new(), Vec::new());
    for step in 0..STEPS {
        source.read(&source.fields()[0], Component::Index(0), step, &mut step_values)?;
        values.extend(mesh.vertex_source.iter().map(|&v| step_values[v as usize]));
    }
    Ok((values, mesh.vertex_source.len()))
}

struct Encoding {
    objects: Objects,
    parameters: VqParameters,
    quality: Quality,
    seconds: f64,
}

fn encode(values: &[f32], vertices: usize, options: VqOptions) -> Result<Encoding, Box<dyn Error>> {
    let mut moments = Moments::new(vertices);
    values.chunks_exact(vertices).for_each(|row| _ = moments.add_step(row));
    let mut objects = Objects::default();
    let start = Instant::now();
    let mut encoder = Box::new(VqEncoder::new(vertices, options));
    for row in values.chunks_exact(vertices) {
        encoder.push(row, &mut objects)?;
    }
    let encoded = encoder.finish(&mut objects)?;
    let seconds = start.elapsed().as_secs_f64();
    let errors = encoded.errors.ok_or("vq states its errors")?;
    let quality = errors.quality(&moments.vertex_statistics());
    Ok(Encoding { objects, parameters: VqParameters::read(&encoded.parameters)?, quality, seconds })
}

fn decode(encoding: Encoding, vertices: usize, values: &[f32]) -> Result<Spread, Box<dyn Error>> {
    let largest = encoding.quality.max_error;
    let decoder = VqDecoder::new(Arc::new(encoding.objects), "f", encoding.parameters, STEPS, vertices);
    let mut out = vec![0.0; vertices];
    let mut times = Vec::new();
    for i in 0..DECODES {
        let step = i * 29 % STEPS;
        let start = Instant::now();
        decoder.decode_step(step, black_box(&mut out))?;
        times.push(start.elapsed().as_secs_f64() * 1e9 / vertices as f64);
        let wrong = |(x, y): (&f32, &f32)| (f64::from(*x) - f64::from(*y)).abs() > largest;
        assert!(!values[step * vertices..].iter().zip(&out).any(wrong), "step {step} is off by more than {largest}");
    }
    Ok(Spread::of(&times))
}

fn run() -> Result<(), Box<dyn Error>> {
    let numbers: Vec<u64> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let wanted = numbers.first().copied().unwrap_or(160_000);
    println!("{:?}", Machine::detect());
    for name in [SeriesName::Decay, SeriesName::Jet, SeriesName::Dipole] {
        let (values, vertices) = series(name, wanted)?;
        println!("{} {vertices} vertices, {STEPS} steps, one thread", name.as_str());
        for entries in [256, 1024, 4096] {
            let options = VqOptions { entries, ..VqOptions::default() };
            let runs = (0..ENCODES).map(|_| encode(&values, vertices, options)).collect::<Result<Vec<_>, _>>()?;
            let rates: Vec<f64> = runs.iter().map(|r| values.len() as f64 * 4e-6 / r.seconds).collect();
            let rates = Spread::of(&rates);
            let q = runs[0].quality;
            println!(
                "  K {entries}: encode {:.1} MB/s best, {:.1} median, {:.1} least; SNR {:.2} dB ({:.1} to {:.1}), max {:.2e}",
                rates.max,
                rates.median,
                rates.min,
                q.snr_db.unwrap_or(f64::INFINITY),
                q.snr_min_db.unwrap_or(f64::INFINITY),
                q.snr_max_db.unwrap_or(f64::INFINITY),
                q.max_error
            );
            let Some(last) = runs.into_iter().last() else { continue };
            let ns = decode(last, vertices, &values)?;
            println!(
                "    decode {:.3} ns best, {:.3} median, {:.3} to {:.3} quartiles, {:.3} worst",
                ns.min, ns.median, ns.q1, ns.q3, ns.max
            );
            if std::env::var_os("TETREEL_BENCH_EXACT").is_some() {
                let exact = encode(&values, vertices, VqOptions { search: Search::Exact, ..options })?;
                let rate = values.len() as f64 * 4e-6 / exact.seconds;
                println!("    exact: {rate:.2} MB/s, SNR {:.2} dB", exact.quality.snr_db.unwrap_or(f64::INFINITY));
            }
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| run().map_err(|e| e.to_string())).map_err(Into::into)
}

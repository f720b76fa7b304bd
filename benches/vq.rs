//! Codec `vq`: time and error of encoding, time of decoding a step: `cargo bench --bench vq [-- VERTICES]`; with `TETREEL_BENCH_EXACT` set,
//! also against full LBG.
//!
//! Encoding: one block of 64 steps of the generated series, in megabytes of f32 per second and core, with the signal-to-noise ratio and
//! that of the exact search (full LBG). Decoding: any step of a block in memory, in nanoseconds per vertex, on one thread; every result is
//! checked against the format's formula.

use glam::Vec3;
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

/// Values of 64 steps, one after the other, and the number of vertices, in store order.
type Series = (Vec<f32>, usize);

/// The first 64 steps of a generated series with about `vertices` vertices.
fn series(name: SeriesName, vertices: u64) -> Result<Series, Box<dyn Error>> {
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

/// Spherical fronts of three speeds that run from three corners through a box: steep on arrival, then decaying.
fn fronts(vertices: u64) -> Result<Series, Box<dyn Error>> {
    let spec = SynthSpec { cells: vertices * 57 / 10, steps: 1, ..SynthSpec::new(SeriesName::Jet) };
    let (mesh, _) = Mesh::build(generate(&spec)?.mesh()?)?;
    let points = &mesh.positions.local;
    let corners = [([-1.0, -1.0, -1.0], 0.045f32), ([1.0, 1.0, -1.0], 0.06), ([0.0, 1.0, 1.0], 0.08)];
    let value = |t: f32, p: Vec3| -> f32 {
        let of = |(corner, speed): &([f32; 3], f32)| {
            let behind = speed * t - p.distance(Vec3::from_array(*corner));
            (1.0 + (30.0 * behind).tanh()) * (-3.0 * behind.max(0.0)).exp()
        };
        corners.iter().map(of).sum()
    };
    let values = (0..STEPS).flat_map(|t| points.iter().map(move |&p| (t as f32, p)));
    Ok((values.map(|(t, p)| value(t, p)).collect(), points.len()))
}

/// Processor time of this thread in nanoseconds, more reliable than a clock on a busy machine. 0 if the system does not report it.
fn processor_ns() -> u64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|ns| ns.parse().ok()).unwrap_or(0)
}

struct Encoding {
    objects: Objects,
    parameters: VqParameters,
    quality: Quality,
    /// Wall-clock and processor time.
    seconds: [f64; 2],
    /// Time for ranges and moments of the same steps.
    moments_seconds: f64,
}

fn encode(values: &[f32], vertices: usize, options: VqOptions) -> Result<Encoding, Box<dyn Error>> {
    let mut moments = Moments::new(vertices);
    let before = processor_ns();
    values.chunks_exact(vertices).for_each(|row| _ = moments.add_step(row));
    let moments_seconds = (processor_ns() - before) as f64 * 1e-9;
    let mut objects = Objects::default();
    let (start, before) = (Instant::now(), processor_ns());
    let mut encoder = Box::new(VqEncoder::new(vertices, options));
    for row in values.chunks_exact(vertices) {
        encoder.push(row, &mut objects)?;
    }
    let encoded = encoder.finish(&mut objects)?;
    let seconds = [start.elapsed().as_secs_f64(), (processor_ns() - before) as f64 * 1e-9];
    let errors = encoded.errors.ok_or("vq states its errors")?;
    let quality = errors.quality(&moments.vertex_statistics());
    Ok(Encoding { objects, parameters: VqParameters::read(&encoded.parameters)?, quality, seconds, moments_seconds })
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
    // Skips cargo's own arguments, which are no numbers.
    let numbers: Vec<u64> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let wanted = numbers.first().copied().unwrap_or(160_000);
    println!("{:?}", Machine::detect());
    for name in ["decay", "jet", "dipole", "fronts"] {
        let (values, vertices) = match SeriesName::ALL.into_iter().find(|series| series.as_str() == name) {
            Some(series_name) => series(series_name, wanted)?,
            None => fronts(wanted)?,
        };
        println!("{name}: {vertices} vertices, {STEPS} steps, one thread");
        for entries in [256, 1024, 4096] {
            measure(&values, vertices, VqOptions { entries, ..VqOptions::default() })?;
        }
    }
    Ok(())
}

fn measure(values: &[f32], vertices: usize, options: VqOptions) -> Result<(), Box<dyn Error>> {
    let megabytes = values.len() as f64 * 4e-6;
    let runs = (0..ENCODES).map(|_| encode(values, vertices, options)).collect::<Result<Vec<_>, _>>()?;
    let rate = |kind: usize| Spread::of(&runs.iter().map(|r| megabytes / r.seconds[kind]).collect::<Vec<_>>());
    let (clock, processor) = (rate(0), rate(1));
    let q = runs[0].quality;
    let db = |snr: Option<f64>| snr.unwrap_or(f64::INFINITY);
    println!(
        "  K {}: encode {:.1} MB/s of processor time ({:.1} to {:.1}), {:.1} by the clock; moments {:.1} % more",
        options.entries,
        processor.median,
        processor.min,
        processor.max,
        clock.max,
        100.0 * runs[0].moments_seconds / runs[0].seconds[1]
    );
    println!(
        "    SNR {:.2} dB ({:.1} to {:.1}), max {:.2e}",
        db(q.snr_db),
        db(q.snr_min_db),
        db(q.snr_max_db),
        q.max_error
    );
    let Some(last) = runs.into_iter().last() else { return Ok(()) };
    let ns = decode(last, vertices, values)?;
    println!("    decode {:.3} ns best, {:.3} median, {:.3} to {:.3} quartiles", ns.min, ns.median, ns.q1, ns.q3);
    if std::env::var_os("TETREEL_BENCH_EXACT").is_some() {
        let exact = encode(values, vertices, VqOptions { search: Search::Exact, ..options })?;
        println!("    exact: {:.2} MB/s, SNR {:.2} dB", megabytes / exact.seconds[1], db(exact.quality.snr_db));
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| run().map_err(|e| e.to_string())).map_err(Into::into)
}

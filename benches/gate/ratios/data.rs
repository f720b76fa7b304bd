//! Time ratios of decoding and importing.

use super::on_one_thread;
use crate::kernels::vq_block;
use std::error::Error;
use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tetreel::bench::paired;
use tetreel::codec::Decoder;
use tetreel::codec::vq::{Indices, STEPS, VqBlock, group_of_step};
use tetreel::export::vtu::{VtuOptions, write_series};
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

/// Decoding of codec `vq` over the format's formula in a plain loop.
pub fn decode_lanes() -> Result<f64, Box<dyn Error>> {
    const VERTICES: usize = 32_000;
    let decoder = vq_block(VERTICES, 256)?;
    let block = decoder.resident_block(0)?;
    on_one_thread(|| {
        let (mut plain, mut decoded) = (vec![0.0; VERTICES], vec![0.0; VERTICES]);
        decode_plainly(&block, 5, &mut plain);
        decoder.decode_step(5, &mut decoded).map_err(|e| e.to_string())?;
        if plain != decoded {
            return Err("the plain loop gives other values".to_owned());
        }
        let steps = || (0..4 * STEPS).map(|at| at * 29 % STEPS);
        let of_plain = || steps().for_each(|step| decode_plainly(&block, step, black_box(&mut plain)));
        let of_decoder = || steps().for_each(|step| drop(black_box(decoder.decode_step(step, &mut decoded))));
        Ok(paired(of_plain, of_decoder, 15, 1).ratio)
    })
}

/// Decodes a step of a block without exponents and special values, by the formula of [`VqBlock`].
#[inline(never)]
fn decode_plainly(block: &VqBlock, step: usize, out: &mut [f32]) {
    let Indices::Narrow([first, second]) = block.indices() else { return };
    let row = |codebook: usize, row: usize| {
        let rows = [block.cb8(), block.cb64()][codebook];
        &rows[row * block.row_len()..][..block.row_len()]
    };
    let (cb8, cb64) = (row(0, group_of_step(step)), row(1, step));
    for (v, value) in out.iter_mut().enumerate() {
        *value = block.means()[v] + (cb8[usize::from(first[v])] + cb64[usize::from(second[v])]);
    }
}

/// A folder in memory, since the disk's sync times are not measured.
const IN_MEMORY: &str = "/dev/shm";

/// Import of `.vtu` files over a pass through their bytes, one after the other, on one thread: both take longer on a slower processor. (Over
/// `cat` the ratio was that of the processor's speed to the memory's, 9.8 to 17.6 on the machines at hand.)
pub fn import() -> Result<f64, Box<dyn Error>> {
    const ROUNDS: usize = 6;
    let folder = tempfile::tempdir_in(IN_MEMORY).map_err(|e| format!("{e}; 64 MB are needed in {IN_MEMORY}"))?;
    let jet = generate(&SynthSpec { cells: 100_000, steps: 8, ..SynthSpec::new(SeriesName::Jet) })?;
    let written = write_series(&jet, &folder.path().join("jet"), &VtuOptions::default(), &Silent, &Cancel::new())?;
    let files = files(&folder.path().join("jet"))?;
    let (mut importing, mut passing) = (f64::INFINITY, f64::INFINITY);
    for round in 0..ROUNDS {
        passing = passing.min(seconds(|| pass_through(&files))?);
        let out = folder.path().join(format!("{round}.zarr"));
        importing = importing.min(seconds(|| {
            let series = tetreel::import::open(&written.pvd)?;
            ingest(&*series, &out, &IngestOptions::default(), &Silent, &Cancel::new())?;
            Ok(())
        })?);
        fs::remove_dir_all(&out)?;
    }
    Ok(importing / passing)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let paths = fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>()?;
    Ok(paths.into_iter().filter(|path| path.extension().is_some_and(|e| e == "vtu")).collect())
}

/// Reads files and hashes their bytes (FNV-1a): a product for each, which waits for the one before.
fn pass_through(files: &[PathBuf]) -> Result<(), Box<dyn Error>> {
    for file in files {
        let hash = fs::read(file)?
            .iter()
            .fold(0xcbf2_9ce4_8422_2325u64, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3));
        black_box(hash);
    }
    Ok(())
}

fn seconds(work: impl FnOnce() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let started = Instant::now();
    work()?;
    Ok(started.elapsed().as_secs_f64())
}

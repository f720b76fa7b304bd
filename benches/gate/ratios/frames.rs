//! Time ratios of pipeline frames.

use super::on_one_thread;
use crate::scene::{DENSE, TENTS};
use std::error::Error;
use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tetreel::bench::{median, paired};
use tetreel::camera::Camera;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::pipeline::{Backend, FrameRequest, Pipeline, Pipelined, PipelinedOptions, Series};
use tetreel::random::SplitMix64;
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::Skip;

/// Steps of the series, which repeats after this number of frames.
const STEPS: usize = 4;
/// Frames per camera turn.
const TURN: usize = 20;

/// A jet in a store, viewed from all sides.
struct Scene {
    series: Arc<Series>,
    requests: Vec<FrameRequest>,
    store: PathBuf,
    /// Folder of the store.
    _folder: tempfile::TempDir,
}

impl Scene {
    fn new(cells: u64, tf: &str, pixels: usize, skip: Skip) -> Result<Self, Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("jet.zarr");
        let jet = generate(&SynthSpec { cells, steps: STEPS, ..SynthSpec::new(SeriesName::Jet) })?;
        ingest(&jet, &path, &IngestOptions::default(), &Silent, &Cancel::new())?;
        let series = Arc::new(Series::open(&Store::open(&path)?, None)?);
        let [lo, hi] = series.field().range.ok_or("no finite value")?.map(f64::from);
        let bounds = series.mesh().positions.world_bounds();
        let unit_distance = 0.01 * (bounds.1 - bounds.0).length();
        let range = MappedRange::new(lo, hi, false)?;
        let table = build_node_table(
            &TransferFunction::parse(tf)?,
            &range,
            // Linear between points, so that tables are as short as possible: their length is not tested.
            OpacityKind::Extinction,
            &Lengths::of_unit_distance(unit_distance),
        )?;
        let (table, camera) = (Arc::new(table), Camera::default_for(bounds)?);
        let request = |frame: usize| -> Result<FrameRequest, Box<dyn Error>> {
            let camera = camera.orbit(360.0 / TURN as f64 * frame as f64, 0.0)?;
            let request = FrameRequest::new(frame % STEPS, camera, table.clone(), (pixels, pixels));
            Ok(FrameRequest { backend: Backend::Cpu, skip, ..request })
        };
        let requests = (0..TURN).map(request).collect::<Result<_, _>>()?;
        Ok(Self { series, requests, store: path, _folder: folder })
    }

    fn request(&self, frame: usize) -> FrameRequest {
        self.requests[frame % TURN].clone()
    }
}

/// All skipping over none: sums over a turn of each frame's least time.
pub fn skipping() -> Result<f64, Box<dyn Error>> {
    const ROUNDS: usize = 3;
    let scene = Scene::new(400_000, TENTS, 256, Skip::ALL)?;
    on_one_thread(|| {
        let mut ways = [Skip::NONE, Skip::ALL].map(|skip| (skip, Pipeline::new(scene.series.clone())));
        let mut least = [[f64::INFINITY; TURN]; 2];
        // The first turn, which fills caches, is discarded.
        for frame in 0..(1 + ROUNDS) * TURN {
            for ((skip, pipeline), least) in ways.iter_mut().zip(&mut least) {
                let request = FrameRequest { skip: *skip, ..scene.request(frame) };
                let took = milliseconds(pipeline, &request)?;
                if frame >= TURN {
                    least[frame % TURN] = least[frame % TURN].min(took);
                }
            }
        }
        let [without, with] = least.map(|frames| frames.iter().sum::<f64>());
        Ok(with / without)
    })
}

/// Milliseconds of a frame.
fn milliseconds(pipeline: &mut Pipeline, request: &FrameRequest) -> Result<f64, String> {
    let started = Instant::now();
    black_box(pipeline.render(request).map_err(|e| e.to_string())?);
    Ok(started.elapsed().as_secs_f64() * 1e3)
}

/// Pipelined frames over sequential ones.
pub fn pipelined() -> Result<f64, Box<dyn Error>> {
    const FRAMES: usize = 30;
    const LONG: Duration = Duration::from_secs(60);
    let scene = Scene::new(100_000, DENSE, 256, Skip::ALL)?;
    let options = PipelinedOptions { frame_cache_bytes: 0, ..Default::default() };
    let pipelined = Pipelined::start(Pipeline::new(scene.series.clone()), &options, || {})?;
    let mut in_turn = Pipeline::new(scene.series.clone());
    let mut delivered = 0;
    let one_after_the_other = || {
        for frame in 0..FRAMES {
            black_box(in_turn.render(&scene.request(frame)).map(|frame| frame.stats.steps).unwrap_or(0));
        }
    };
    let side_by_side = || {
        for frame in 0..FRAMES {
            _ = pipelined.push(scene.request(frame));
        }
        while let Some(delivery) = pipelined.wait(LONG) {
            delivered += usize::from(black_box(delivery.frame).is_ok());
        }
    };
    let ratio = paired(one_after_the_other, side_by_side, 5, 1).ratio;
    if delivered == 6 * FRAMES { Ok(ratio) } else { Err(format!("{delivered} frames came").into()) }
}

/// The first frame of a pipeline, after its series is opened, over a later one with new scalars.
pub fn first_frame() -> Result<f64, Box<dyn Error>> {
    const PIPELINES: usize = 5;
    const LATER: usize = 4;
    let scene = Scene::new(400_000, TENTS, 256, Skip::ALL)?;
    on_one_thread(|| {
        let mut ratios = Vec::with_capacity(PIPELINES);
        for _ in 0..PIPELINES {
            // A series caches results about its mesh.
            let series = Store::open(&scene.store).and_then(|store| Series::open(&store, None));
            let mut pipeline = Pipeline::new(Arc::new(series.map_err(|e| e.to_string())?));
            let frames = (0..=LATER).map(|frame| milliseconds(&mut pipeline, &scene.request(frame)));
            let frames = frames.collect::<Result<Vec<f64>, String>>()?;
            ratios.push(frames[0] / frames[LATER]);
        }
        Ok(median(&ratios))
    })
}

/// Late frames of a pipeline over the same ones early on. Since the machine's speed may change in the seconds between, each frame is
/// measured relative to a sort beside it.
pub fn late_frames() -> Result<f64, Box<dyn Error>> {
    const FIRST: usize = 5;
    const LAST: usize = 500;
    let scene = Scene::new(20_000, DENSE, 128, Skip::ALL)?;
    let sorts = on_one_thread(|| {
        let mut pipeline = Pipeline::new(scene.series.clone());
        let measured = (0..=LAST).map(|frame| {
            let before = sort_ms();
            let took = milliseconds(&mut pipeline, &scene.request(frame))?;
            Ok(took / (0.5 * (before + sort_ms())))
        });
        measured.collect::<Result<Vec<f64>, String>>()
    })?;
    // The same frames, a whole number of turns later.
    let later = (LAST - FIRST - TURN) / TURN * TURN;
    let ratios: Vec<f64> = (FIRST..FIRST + TURN).map(|frame| sorts[frame + later] / sorts[frame]).collect();
    Ok(median(&ratios))
}

/// Milliseconds of a fixed sort.
fn sort_ms() -> f64 {
    let mut random = SplitMix64::new(1);
    let mut numbers: Vec<u64> = (0..10_000).map(|_| random.next_u64()).collect();
    let started = Instant::now();
    black_box(&mut numbers).sort_unstable();
    started.elapsed().as_secs_f64() * 1e3
}

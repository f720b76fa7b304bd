//! Error of images at a level of detail: `cargo bench --bench lod -- STORE.zarr[@FIELD] ...`
//!
//! 1. Each ranking against random subsets of the same number of faces.
//! 2. Rankings of intervals: the error in the middle of an interval against that at its ends, and the change of the image
//!    from one interval to the next.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::lod::{Interval, Partition, Ranking, list_change, select};
use tetreel::moments::CovDenominator;
use tetreel::node_table::NodeTable;
use tetreel::pipeline::{FrameRequest, Pipeline, Sampling, Series};
use tetreel::random::SplitMix64;
use tetreel::render::cpu::havs::Havs;
use tetreel::render::{RenderJob, Renderer};
use tetreel::store::Store;
use tetreel::task::Cancel;
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::{DepthOrder, Skip};

type Outcome<T> = Result<T, Box<dyn Error>>;
type Pixels = Vec<[f32; 4]>;

const SIZE: (usize, usize) = (96, 96);
const LEVELS: [f64; 5] = [0.03, 0.05, 0.1, 0.25, 0.5];
const TRANSFER_FUNCTIONS: [&str; 4] = [
    "viridis@0:0.05,1:0.5",
    "inferno@0:0,1:0.5",
    "viridis@0:0,0.2:0,0.25:0.8,0.3:0,0.6:0,0.65:0.8,0.7:0,1:0",
    "viridis@0:0.5,0.45:0,0.55:0,1:0.5",
];
const LOTS: u64 = 3;
const GLOBAL: Sampling = Sampling::Global(CovDenominator::Floored { share: 0.01 });
const SAMPLINGS: [(&str, Sampling); 6] = [
    ("error", Sampling::Error),
    ("random", Sampling::Random),
    ("global", GLOBAL),
    ("plain", Sampling::Global(CovDenominator::Plain)),
    ("regular", Sampling::Local(Partition::Regular(6))),
    ("greedy", Sampling::Local(Partition::Greedy(6))),
];

fn main() -> Outcome<()> {
    let stores: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect();
    if stores.is_empty() {
        println!("which series? cargo bench --bench lod -- STORE.zarr[@FIELD] ...");
    }
    for name in stores {
        let (path, field) = name.split_once('@').map_or((&*name, None), |(path, field)| (path, Some(field)));
        let selector = field.map(str::parse).transpose()?;
        let pipeline = Pipeline::open(&Store::open(Path::new(path))?, selector.as_ref())?;
        let mut scene = Scene { series: pipeline.series().clone(), pipeline };
        println!("\n{name}: {} cells, {} steps", scene.series.mesh().topology.tets.len(), scene.series.times().len());
        beside_chance(&mut scene)?;
        intervals(&mut scene)?;
    }
    Ok(())
}

struct Scene {
    series: Arc<Series>,
    pipeline: Pipeline,
}

impl Scene {
    fn cameras(&self) -> Outcome<[Camera; 2]> {
        let camera = Camera::default_for(self.series.mesh().positions.world_bounds())?;
        Ok([camera, camera.orbit(75.0, 30.0)?])
    }

    fn table(&self, tf: &str) -> Outcome<Arc<NodeTable>> {
        let [lo, hi] = self.series.field().range.ok_or("no finite value")?.map(f64::from);
        let (a, b) = self.series.mesh().positions.world_bounds();
        let (tf, range) = (TransferFunction::parse(tf)?, MappedRange::new(lo, hi, false)?);
        Ok(Arc::new(build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_diagonal((b - a).length()))?))
    }

    fn job(&mut self, step: usize, camera: Camera, table: &Arc<NodeTable>) -> Outcome<RenderJob> {
        // Rankings are compared on the faces of all cells.
        let request = FrameRequest::new(step, camera, table.clone(), SIZE);
        Ok(self.pipeline.prepare(&FrameRequest { skip: Skip::NONE, ..request })?)
    }

    fn ranking(&self, step: usize, sampling: Sampling) -> Outcome<Arc<Ranking>> {
        Ok(self.series.ranking(step, sampling, &Cancel::new())?.ok_or("cancelled")?)
    }
}

fn image(job: &RenderJob, ranking: &Ranking, level: f64) -> Outcome<Pixels> {
    let selection = Arc::new(select(&job.mesh.topology, ranking, level, &job.active));
    let faces = DepthOrder::default().order(&job.mesh, job.view.forward, &selection, &job.cancel);
    Ok(Havs::new().render(RenderJob { faces, ..job.clone() })?.planes.color.pixels.clone())
}

fn mean_square(a: &Pixels, b: &Pixels) -> f64 {
    let differences = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
    differences.sum::<f64>() / (4 * a.len()) as f64
}

/// The interior faces in random order.
fn by_lot(series: &Series, seed: u64) -> Ranking {
    let topology = &series.mesh().topology;
    let mut random = SplitMix64::new(seed);
    let numbers: Vec<f32> = topology.connectivity().faces.iter().map(|_| random.unit() as f32).collect();
    Ranking::by_importance(topology, &numbers)
}

fn beside_chance(scene: &mut Scene) -> Outcome<()> {
    let steps = scene.series.times().len();
    let steps = if steps < 4 { vec![0] } else { vec![steps / 6, steps / 2, steps - 1 - steps / 12] };
    let cameras = scene.cameras()?;
    let lots: Vec<Ranking> = (1..=LOTS).map(|seed| by_lot(&scene.series, seed)).collect();
    let mut logs = [[0.0; SAMPLINGS.len()]; LEVELS.len()];
    let mut chance = [0.0; LEVELS.len()];
    for tf in TRANSFER_FUNCTIONS {
        let table = scene.table(tf)?;
        let mut random = [0.0; LEVELS.len()];
        let mut ours = [[0.0; SAMPLINGS.len()]; LEVELS.len()];
        for (&step, camera) in steps.iter().flat_map(|step| cameras.map(|camera| (step, camera))) {
            let job = scene.job(step, camera, &table)?;
            let whole = image(&job, &lots[0], 1.0)?;
            for (i, &level) in LEVELS.iter().enumerate() {
                for lot in &lots {
                    random[i] += mean_square(&image(&job, lot, level)?, &whole) / LOTS as f64;
                }
                for ((_, sampling), sum) in SAMPLINGS.iter().zip(&mut ours[i]) {
                    *sum += mean_square(&image(&job, &*scene.ranking(step, *sampling)?, level)?, &whole);
                }
            }
        }
        let frames = (2 * steps.len()) as f64;
        for (i, ours) in ours.iter().enumerate() {
            chance[i] += random[i] / frames / TRANSFER_FUNCTIONS.len() as f64;
            for (log, ours) in logs[i].iter_mut().zip(ours) {
                *log += 0.5 * (ours.max(1e-30) / random[i].max(1e-30)).ln() / TRANSFER_FUNCTIONS.len() as f64;
            }
        }
    }
    println!("| level | rmse of chance |{}|", SAMPLINGS.map(|(name, _)| format!(" {name} ")).join("|"));
    for (i, level) in LEVELS.iter().enumerate() {
        let ratios = logs[i].map(|log| format!(" {:.2} ", log.exp())).join("|");
        println!("| {:.0} % | {:.1e} |{ratios}|", 100.0 * level, chance[i].sqrt());
    }
    Ok(())
}

fn intervals(scene: &mut Scene) -> Outcome<()> {
    let partition = Partition::default();
    let found = scene.series.intervals(partition, &Cancel::new())?.ok_or("cancelled")?;
    if found.len() < 2 {
        return Ok(());
    }
    let (table, camera) = (scene.table(TRANSFER_FUNCTIONS[0])?, scene.cameras()?[0]);
    println!(
        "| {} intervals, level | rmse in the middle | at the ends | change at a border, whole | with intervals | with one ranking | other faces |",
        found.len()
    );
    for level in [0.05, 0.25] {
        let local = Sampling::Local(partition);
        let (mut middle, mut ends) = (0.0, 0.0);
        let mut changes = [0.0; 3];
        let mut others = 0.0;
        for (at, &Interval { first, end, sampled }) in found.iter().enumerate() {
            let mut error = |step: usize| -> Outcome<f64> {
                let job = scene.job(step, camera, &table)?;
                let ranking = scene.ranking(step, local)?;
                Ok(mean_square(&image(&job, &ranking, level)?, &image(&job, &ranking, 1.0)?))
            };
            middle += error(sampled)?;
            ends += 0.5 * (error(first)? + error(end - 1)?);
            if at + 1 < found.len() {
                let (before, after) = (scene.ranking(end - 1, local)?, scene.ranking(end, local)?);
                let jobs = [scene.job(end - 1, camera, &table)?, scene.job(end, camera, &table)?];
                let pairs = [(&before, &before, 1.0), (&before, &after, level), (&before, &before, level)];
                for (change, (a, b, level)) in changes.iter_mut().zip(pairs) {
                    *change += mean_square(&image(&jobs[0], a, level)?, &image(&jobs[1], b, level)?);
                }
                others += list_change(&before, &after, level);
            }
        }
        let (count, borders) = (found.len() as f64, (found.len() - 1) as f64);
        let [whole, local, one] = changes.map(|change| (change / borders).sqrt());
        println!(
            "| {:.0} % | {:.1e} | {:.1e} | {whole:.1e} | {local:.1e} | {one:.1e} | {:.0} % |",
            100.0 * level,
            (middle / count).sqrt(),
            (ends / count).sqrt(),
            100.0 * others / borders
        );
    }
    Ok(())
}

//! Savings by each switch of `Skip`: frames with all switches on against frames with one off, in pairs.
//! `cargo bench --bench skipping -- [STORE.zarr[@FIELD] ...]`; without a store a generated jet of a million cells.

use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use tetreel::bench::{Machine, paired};
use tetreel::camera::Camera;
use tetreel::codec::vq::VqOptions;
use tetreel::ingest::{CodecChoice, IngestOptions, ingest};
use tetreel::node_table::NodeTable;
use tetreel::pipeline::{Backend, FrameRequest, Pipeline, Series, TetDraw};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::Skip;

const PAIRS: usize = 15;
const SIZE: (usize, usize) = (512, 512);

/// A scene: name, transfer function, whether time and camera move, how near the camera is, and the renderer.
struct Scene {
    name: &'static str,
    tf: &'static str,
    time_moves: bool,
    camera_moves: bool,
    zoom: f64,
    draw: TetDraw,
}

const TENTS: &str = "viridis@0:0,0.2:0,0.25:0.3,0.3:0,0.48:0,0.53:0.5,0.58:0,0.72:0,0.8:0.8,0.88:0,1:0";
const DENSE: &str = "viridis@0:0.05,1:0.5";
const OPAQUE: &str = "turbo@0:0.9,1:1";

const SCENES: [Scene; 6] = [
    Scene { name: "tents", tf: TENTS, time_moves: true, camera_moves: true, zoom: 1.0, draw: TetDraw::Raycast },
    Scene { name: "dense", tf: DENSE, time_moves: true, camera_moves: true, zoom: 1.0, draw: TetDraw::Raycast },
    Scene { name: "opaque", tf: OPAQUE, time_moves: true, camera_moves: true, zoom: 1.0, draw: TetDraw::Raycast },
    Scene { name: "tents, near", tf: TENTS, time_moves: true, camera_moves: true, zoom: 0.3, draw: TetDraw::Raycast },
    Scene {
        name: "tents, still",
        tf: TENTS,
        time_moves: false,
        camera_moves: false,
        zoom: 1.0,
        draw: TetDraw::Raycast,
    },
    Scene {
        name: "tents, faces",
        tf: TENTS,
        time_moves: true,
        camera_moves: false,
        zoom: 1.0,
        draw: TetDraw::ALL_FACES,
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("{:?}, {PAIRS} pairs, {}x{}, {} threads", Machine::detect(), SIZE.0, SIZE.1, rayon::current_num_threads());
    let mut names: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect();
    let scratch = tempfile::tempdir()?;
    if names.is_empty() {
        let path = scratch.path().join("jet.zarr");
        let jet = generate(&SynthSpec { cells: 1_000_000, steps: 8, ..SynthSpec::new(SeriesName::Jet) })?;
        let codec = CodecChoice::new(VqOptions { entries: 64, ..VqOptions::default() });
        ingest(&jet, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new())?;
        names.push(path.display().to_string());
    }
    for name in names {
        let (path, field) = name.split_once('@').map_or((&*name, None), |(path, field)| (path, Some(field)));
        let selector = field.map(str::parse).transpose()?;
        let series = Arc::new(Series::open(&Store::open(Path::new(path))?, selector.as_ref())?);
        println!("\n{name}: {} cells, codec {}", series.mesh().topology.tets.len(), series.field().codec);
        println!("| scene | all, ms | off | ms | all / off | 95 % |");
        println!("|---|---|---|---|---|---|");
        for scene in &SCENES {
            measure(&series, scene)?;
        }
    }
    Ok(())
}

fn measure(series: &Arc<Series>, scene: &Scene) -> Result<(), Box<dyn Error>> {
    let table = table(series, scene.tf)?;
    let framing = Camera::default_for(series.mesh().positions.world_bounds())?;
    let position = framing.focal_point + scene.zoom * (framing.position - framing.focal_point);
    let camera = Camera { position, ..framing };
    let steps = series.times().len();
    let request = |index: usize, skip: Skip| -> Result<FrameRequest, Box<dyn Error>> {
        let step = if scene.time_moves { index % steps } else { 0 };
        let camera = if scene.camera_moves { camera.orbit(5.625 * index as f64, 0.0)? } else { camera };
        let request = FrameRequest::new(step, camera, table.clone(), SIZE);
        Ok(FrameRequest { backend: Backend::Cpu, skip, ..request.with_draw(scene.draw) })
    };
    let switches = Skip::SWITCHES.iter().map(|(name, switch)| {
        let mut skip = Skip::ALL;
        *switch(&mut skip) = false;
        (*name, skip)
    });
    for (name, off) in switches.chain([("everything", Skip::NONE)]) {
        let requests = |skip| (0..2 * steps.max(PAIRS + 2)).map(|i| request(i, skip)).collect::<Result<Vec<_>, _>>();
        let (with, without) = (requests(Skip::ALL)?, requests(off)?);
        let (mut a, mut b) = (Pipeline::new(series.clone()), Pipeline::new(series.clone()));
        let (mut at_a, mut at_b) = (0, 0);
        // The next frame of a sequence that both sides render.
        let draw = |pipeline: &mut Pipeline, requests: &[FrameRequest], at: &mut usize| {
            black_box(pipeline.render(&requests[*at % requests.len()]).map(|frame| frame.stats.steps).unwrap_or(0));
            *at += 1;
        };
        let result = paired(|| draw(&mut a, &without, &mut at_a), || draw(&mut b, &with, &mut at_b), PAIRS, 1);
        println!(
            "| {} | {:.1} | {name} | {:.1} | {:.3} | {:.3} to {:.3} |",
            scene.name, result.b.median, result.a.median, result.ratio, result.interval[0], result.interval[1]
        );
    }
    Ok(())
}

fn table(series: &Series, tf: &str) -> Result<Arc<NodeTable>, Box<dyn Error>> {
    let [lo, hi] = series.field().range.ok_or("no finite value")?.map(f64::from);
    let (a, b) = series.mesh().positions.world_bounds();
    let (tf, range) = (TransferFunction::parse(tf)?, MappedRange::new(lo, hi, false)?);
    Ok(Arc::new(build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_diagonal((b - a).length()))?))
}

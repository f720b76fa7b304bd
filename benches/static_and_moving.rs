//! Table 6.2 of Callahan's dissertation: faces of a series drawn with and without sorting, as a volume and as an isosurface in the middle
//! of the range, static scalars on one thread against time-varying ones on all:
//! `cargo bench --bench static_and_moving -- STORE.zarr[@FIELD] ...`

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use tetreel::bench::{BenchRun, FrameBench, Machine, Motion, run_frames};
use tetreel::camera::Camera;
use tetreel::pipeline::{Backend, FrameRequest, Pipeline, TetDraw};
use tetreel::render::surfaces::Isosurface;
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};

const FRAMES: usize = 15;
const SIZE: (usize, usize) = (512, 512);

fn main() -> Result<(), Box<dyn Error>> {
    println!("{:?}", Machine::detect());
    println!(
        "| series | cells | shown | sort | static, 1 thread, fps | moving, {} threads, fps | Mtets/s | decode | order | render |",
        rayon::current_num_threads()
    );
    for name in std::env::args().skip(1).filter(|arg| !arg.starts_with("--")) {
        let (path, field) = name.split_once('@').map_or((&*name, None), |(path, field)| (path, Some(field)));
        let selector = field.map(str::parse).transpose()?;
        let mut pipeline = Pipeline::open(&Store::open(Path::new(path))?, selector.as_ref())?;
        let (a, b) = pipeline.mesh().positions.world_bounds();
        let [lo, hi] = pipeline.field().range.ok_or("no finite value")?.map(f64::from);
        let (tf, range) = (TransferFunction::parse("viridis@0:0.05,1:0.5")?, MappedRange::new(lo, hi, false)?);
        let table = build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_diagonal((b - a).length()))?;
        let volume = FrameRequest {
            backend: Backend::Cpu,
            ..FrameRequest::new(0, Camera::default_for((a, b))?, Arc::new(table), SIZE).with_draw(TetDraw::ALL_FACES)
        };
        let surface = volume.clone().with_tets(|tets| {
            (tets.surfaces, tets.volume) = (vec![Isosurface::new(0.5 * lo + 0.5 * hi)], false);
        });
        let shown = [("volume", &volume), ("isosurface", &surface)];
        for ((shown, request), camera) in
            shown.into_iter().flat_map(|shown| [true, false].map(|camera| (shown, camera)))
        {
            let mut run = |time| -> Result<BenchRun, Box<dyn Error>> {
                let motion = Motion { time, camera };
                let bench = FrameBench {
                    dataset: name.clone(),
                    request: request.clone(),
                    motion,
                    frames: FRAMES,
                    judged: false,
                };
                Ok(run_frames(&mut pipeline, &bench, &Silent, &Cancel::new())?)
            };
            let moving = run(true)?;
            let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
            let still = alone.install(|| run(false).map_err(|error| error.to_string()))?;
            let (sort, ms) = (if camera { "yes" } else { "no" }, &moving.ms);
            println!(
                "| {name} | {} | {shown} | {sort} | {:.1} | {:.1} | {:.2} | {:.1} ms | {:.1} ms | {:.1} ms |",
                moving.cells,
                still.fps,
                moving.fps,
                moving.cells_per_s / 1e6,
                ms.decode,
                ms.order,
                ms.render
            );
        }
    }
    Ok(())
}

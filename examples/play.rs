//! Plays a series as fast as possible and prints every frame's time: `cargo run --release --example play [STORE.zarr]`.
//! Without a store it generates a small series first. The next frame is prepared while one is rendered.

use std::time::{Duration, Instant};
use std::{env::args, error::Error, sync::Arc};
use tetreel::camera::Camera;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::pipeline::{FrameRequest, Pipeline, Pipelined, PipelinedOptions};
use tetreel::playback::{Clock, Command, Mode, Player};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{Lengths, OpacityKind, RangePolicy, TransferFunction, build_node_table};

fn main() -> Result<(), Box<dyn Error>> {
    let temp = tempfile::tempdir()?;
    let generated = temp.path().join("decay.zarr");
    let store = match args().nth(1) {
        Some(path) => Store::open(path)?,
        None => {
            let decay = generate(&SynthSpec { cells: 20_000, steps: 16, ..SynthSpec::new(SeriesName::Decay) })?;
            ingest(&decay, &generated, &IngestOptions::default(), &Silent, &Cancel::new())?;
            Store::open(&generated)?
        }
    };
    let pipeline = Pipeline::open(&store, None)?;
    let (lo, hi) = pipeline.mesh().positions.world_bounds();
    let [min, max] = pipeline.field().range.ok_or("the field has no finite value")?.map(f64::from);
    let range = RangePolicy::Series.resolve((min, max), (min, max))?;
    let tf = TransferFunction::parse("viridis@0:0,1:0.3")?;
    let table = Arc::new(build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_diagonal((hi - lo).length()))?);
    let camera = Camera::default_for((lo, hi))?;

    let times = pipeline.times().clone();
    let pipelined = Pipelined::start(pipeline, &PipelinedOptions::default(), || ())?;
    let mut player = Player::new(Clock::new(times.clone()), pipelined);
    let started = Instant::now();
    player.apply(Command::Mode(Mode::AsFastAsPossible), started.elapsed())?;
    player.apply(Command::Play, started.elapsed())?;
    while !player.clock().state().ended {
        let request = &mut |time| Some(FrameRequest::new(time, camera, table.clone(), (320, 240)));
        if let Some(delivery) = player.tick(started.elapsed(), request).shown {
            let (time, frame) = (delivery.request.time.time(&times), delivery.frame?);
            println!(
                "time {time:8.4}  {:7.2} ms  at {:7.1} ms",
                frame.stats.ms_frame,
                started.elapsed().as_secs_f64() * 1e3
            );
        } else {
            player.wait(Duration::from_millis(100));
        }
    }
    Ok(())
}

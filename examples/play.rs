//! Plays a series as fast as it goes and prints every frame's time: `cargo run --release --example play [STORE.zarr]`.
//! Without a store it generates a small series first.

use std::{env::args, error::Error, sync::Arc};
use tetreel::camera::Camera;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{OpacityKind, RangePolicy, TransferFunction, build_node_table};

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
    let mut pipeline = Pipeline::open(&store, None)?;
    let (lo, hi) = pipeline.mesh().positions.world_bounds();
    let [min, max] = pipeline.field().range.ok_or("the field has no finite value")?.map(f64::from);
    let range = RangePolicy::Series.resolve((min, max), (min, max))?;
    let tf = TransferFunction::parse("viridis@0:0,1:0.3")?;
    let table = Arc::new(build_node_table(&tf, &range, OpacityKind::Alpha, 0.01 * (hi - lo).length())?);
    let camera = Camera::default_for((lo, hi))?;
    for (step, time) in pipeline.times().values.clone().into_iter().enumerate() {
        let frame = pipeline.render(&FrameRequest::new(step, camera, table.clone(), (320, 240)))?;
        println!("step {step:3}  time {time:8.4}  {:7.2} ms", frame.stats.ms_frame);
    }
    Ok(())
}

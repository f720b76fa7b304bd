//! Renders one step of a series to a PNG: `cargo run --release --example render_one [OUT.png [STORE.zarr [STEP]]]`.
//! Without a store it generates a small series first.

use std::{env::args, error::Error, path::Path, sync::Arc};
use tetreel::camera::Camera;
use tetreel::image::{PngDepth, write_png};
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{Lengths, OpacityKind, RangePolicy, TransferFunction, build_node_table};

fn main() -> Result<(), Box<dyn Error>> {
    let temp = tempfile::tempdir()?;
    let generated = temp.path().join("jet.zarr");
    let store = match args().nth(2) {
        Some(path) => Store::open(path)?,
        None => {
            let jet = generate(&SynthSpec { cells: 20_000, steps: 8, ..SynthSpec::new(SeriesName::Jet) })?;
            ingest(&jet, &generated, &IngestOptions::default(), &Silent, &Cancel::new())?;
            Store::open(&generated)?
        }
    };
    let mut pipeline = Pipeline::open(&store, None)?;
    let step = args().nth(3).map_or(Ok(pipeline.times().len() - 1), |text| text.parse())?;
    let (lo, hi) = pipeline.mesh().positions.world_bounds();
    let [min, max] = pipeline.field().range.ok_or("the field has no finite value")?.map(f64::from);
    let range = RangePolicy::Series.resolve((min, max), (min, max))?;
    let tf = TransferFunction::parse("inferno@0:0,0.3:0.02,1:0.5")?;
    let table = Arc::new(build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_diagonal((hi - lo).length()))?);
    let camera = Camera::default_for((lo, hi))?;
    let request = FrameRequest::new(step, camera, table, (640, 480));
    let out = args().nth(1).unwrap_or_else(|| "render_one.png".to_owned());
    let frame = pipeline.render(&request)?;
    write_png(Path::new(&out), &frame.planes.color, None, PngDepth::Eight)?;
    println!("{out}: step {step}, {:.1} ms", frame.stats.ms_frame);
    Ok(())
}

//! Steady playback reuses its memory: what frames allocate is counted by an allocator of this program's own, which runs this test alone.

use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use std::alloc::System;
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::node_table::{Node, NodeTable};
use tetreel::pipeline::{Backend, FrameRequest, Pipeline, TetDraw};
use tetreel::render::cpu::functions::Sheets;
use tetreel::render::functions::{SheetSpacing, SheetStyle};
use tetreel::render::{RenderJob, Renderer};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Bytes that a frame may allocate: queues of the thread pool and entries of its statistics. Lists of the functions in tiles alone are some
/// hundred times as long.
const SMALL: usize = 4096;

#[test]
fn functions_of_step_after_step_are_drawn_in_the_same_memory() {
    let temp = tempfile::tempdir().unwrap();
    let (steps, out) = (6, temp.path().join("jet.zarr"));
    let series = generate(&SynthSpec { cells: 3000, steps, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    ingest(&series, &out, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
    let mut pipeline = Pipeline::open(&Store::open(&out).unwrap(), None).unwrap();
    let [lo, hi] = pipeline.field().range.unwrap().map(f64::from);
    let nodes = [(lo, 0.1), (hi, 3.0)].map(|(scalar, tau)| Node { scalar, rgb: [1.0, 0.5, 0.2], tau });
    let table = Arc::new(NodeTable::new(nodes.to_vec()).unwrap());
    let camera = Camera::default_for(pipeline.mesh().frame()).unwrap();
    let style = SheetStyle { spacing: SheetSpacing::Count(48) };
    let request = |step| {
        let request = FrameRequest::new(step, camera, table.clone(), (160, 120)).with_draw(TetDraw::Sheets(style));
        FrameRequest { backend: Backend::Cpu, ..request }
    };
    let jobs: Vec<RenderJob> = (0..steps).map(|step| pipeline.prepare(&request(step)).unwrap()).collect();
    let mut sheets = Sheets::new();
    let mut play = |count: usize| {
        // Jobs are cloned before they are counted.
        let jobs: Vec<RenderJob> = jobs.iter().cycle().take(count).cloned().collect();
        let region = Region::new(ALLOCATOR);
        let mut drawn = 0;
        for job in jobs {
            drawn = sheets.render(job).unwrap().stats.functions_drawn;
        }
        (region.change().bytes_allocated / count, drawn)
    };
    // The first frames show that it is counted: lists are made.
    let (first, drawn) = play(1);
    assert!(first > 20 * SMALL && drawn > 500, "{first} bytes, {drawn} functions");
    play(2 * steps);
    let (steady, _) = play(3 * steps);
    println!("{first} bytes for the first frame, {steady} for each later one");
    assert!(steady <= SMALL, "{steady} bytes a frame");
}

//! Whole series, from file or generator to frames: the fast renderers against the judge.

#[cfg(feature = "gpu")]
use crate::render::havs;
use crate::render::{assert_within, is_within, raycast, reference, stretched};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;
use tetreel::camera::{Camera, Projection};
use tetreel::field::{FieldSelector, SeriesSource};
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::node_table::NodeTable;
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::render::RenderJob;
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{
    Lengths, OpacityKind, RangePolicy, TransferContent, TransferFunction, TransferSource, build_node_table,
};

/// A store of a source.
pub fn ingested(source: &dyn SeriesSource, out: &Path, steps: &str) -> Store {
    let options = IngestOptions { steps: steps.parse().unwrap(), ..Default::default() };
    ingest(source, out, &options, &Silent, &Cancel::new()).unwrap();
    Store::open(out).unwrap()
}

/// A transfer function over the field's range.
pub fn table_for(pipeline: &Pipeline, tf: &str) -> Arc<NodeTable> {
    colors_for(pipeline, tf).0
}

/// The same, and what it is made from.
pub fn colors_for(pipeline: &Pipeline, tf: &str) -> (Arc<NodeTable>, Arc<TransferSource>) {
    let [lo, hi] = pipeline.field().range.unwrap().map(f64::from);
    let range = RangePolicy::Series.resolve((lo, hi), (lo, hi)).unwrap();
    let (a, b) = pipeline.mesh().positions.world_bounds();
    let (function, lengths) = (TransferFunction::parse(tf).unwrap(), Lengths::of_diagonal((b - a).length()));
    let table = build_node_table(&function, &range, OpacityKind::Alpha, &lengths).unwrap();
    let content = TransferContent::Function { function, range };
    (Arc::new(table), Arc::new(TransferSource { content, kind: OpacityKind::Alpha, lengths }))
}

/// Dense, sparse with narrow tents, with an opaque plateau, and nearly transparent.
pub const TRANSFER_FUNCTIONS: [&str; 4] = [
    "viridis@0:0.02,1:0.5",
    "inferno@0:0,0.01:0,0.02:0.4,0.03:0,0.5:0,0.52:0.6,0.54:0,1:0",
    "turbo@0:0,0.1:0.1,0.3:1,1:1",
    "gray@0:0.001,1:0.002",
];

/// Outside, along an axis, in parallel projection, and from within.
pub fn cameras(bounds: (DVec3, DVec3)) -> [Camera; 4] {
    let outside = Camera::default_for(bounds).unwrap();
    let (centre, size) = (0.5 * (bounds.0 + bounds.1), (bounds.1 - bounds.0).length());
    let along_x = Camera { position: centre + DVec3::X * size, view_up: DVec3::Z, ..outside };
    let parallel =
        Camera { projection: Projection::Parallel { scale: 0.37 * size }, ..outside.orbit(70.0, -20.0).unwrap() };
    let inside = Camera {
        position: centre + 0.03 * size * DVec3::new(0.3, 0.2, 0.1),
        projection: Projection::Perspective { view_angle: 80.0 },
        ..outside
    };
    [outside, along_x, parallel, inside]
}

/// Share of the inner faces that are drawn when not all are.
#[cfg(feature = "gpu")]
const SOME_FACES: f64 = 0.1;

/// The CPU against the judge, the GPU, where there is one, against the CPU. Returns the largest opacity.
pub fn assert_frame_agrees(name: &str, job: &RenderJob) -> f32 {
    // The judge looks at transparent cells as well.
    let whole = RenderJob { active: job.finite.clone().unwrap_or_else(|| job.active.clone()), ..job.clone() };
    let (fast, judge) = (raycast(job), reference(&whole));
    assert_within(&format!("{name}: CPU against reference"), &fast, &judge);
    #[cfg(feature = "gpu")]
    if let Some(frame) = crate::render::gpu::render(job) {
        assert_within(&format!("{name}: GPU against CPU"), &frame.planes.color, &fast);
        assert_eq!(frame.stats.broken_paths, 0, "{name}");
    }
    judge.pixels.iter().fold(0.0, |most, p| most.max(p[3]))
}

/// Faces on the GPU, where there is one: all of them against the ray caster, some against the CPU.
#[cfg(feature = "gpu")]
pub fn assert_faces_agree(name: &str, job: &RenderJob) {
    let Some(frame) = havs::gpu::render(&havs::with_all_faces(job)) else { return };
    assert_within(&format!("{name}: faces on the GPU"), &frame.planes.color, &raycast(job));
    assert_eq!((frame.stats.broken_paths, frame.stats.out_of_order), (0, 0), "{name}");
    let some = havs::with_some_faces(job, SOME_FACES, 1);
    let (gpu, cpu) = (havs::gpu::render(&some).map(|frame| frame.planes.color), havs::havs(&some).planes.color);
    assert_within(&format!("{name}: some faces on the GPU"), &gpu.unwrap_or_default(), &cpu);
}

/// Without the feature there is nothing to compare.
#[cfg(not(feature = "gpu"))]
pub fn assert_faces_agree(_: &str, _: &RenderJob) {}

/// Pixels of each side: the judge looks at every cell for every pixel, and takes nearly all of the time.
const SIZE: (usize, usize) = (80, 80);

/// Four transfer functions from four cameras at the first of the steps; at the others each transfer function from a camera of its own.
pub fn assert_agrees_from_all_sides(store: &Store, field: &str, steps: &[usize]) {
    let selector: FieldSelector = field.parse().unwrap();
    let mut pipeline = Pipeline::open(store, Some(&selector)).unwrap();
    let mut seen = 0.0f32;
    for (t, tf) in TRANSFER_FUNCTIONS.into_iter().enumerate() {
        let table = table_for(&pipeline, tf);
        for (c, camera) in cameras(pipeline.mesh().positions.world_bounds()).into_iter().enumerate() {
            for &step in if t == c { steps } else { &steps[..1] } {
                let job = pipeline.prepare(&FrameRequest::new(step, camera, table.clone(), SIZE)).unwrap();
                let name = format!("{field}, {tf}, camera {c}, step {step}");
                seen = seen.max(assert_frame_agrees(&name, &job));
                if t == 0 && step == steps[0] {
                    assert_faces_agree(&name, &job);
                    let is_noticed = c > 0 || !is_within(&raycast(&stretched(&job)), &raycast(&job));
                    assert!(is_noticed, "{name}: a quarter of a pixel makes no difference");
                }
            }
        }
    }
    assert!(seen > 0.5, "empty images prove nothing");
}

// Long: the float64 reference draws every series from all sides.
#[test]
fn every_generated_series_is_drawn_as_the_reference_draws_it() {
    let temp = tempfile::tempdir().unwrap();
    for name in SeriesName::ALL {
        let series = generate(&SynthSpec { cells: 6000, steps: 4, ..SynthSpec::new(name) }).unwrap();
        let store = ingested(&series, &temp.path().join(format!("{name}.zarr")), "1..3:2");
        let field = store.fields()[0].name.clone();
        assert_agrees_from_all_sides(&store, &field, &[0, 1]);
    }
}

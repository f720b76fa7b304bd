//! Real series, from file to frames. Skipped, with a word, where the samples are absent.

use crate::common::samples;
use crate::render::difference;
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;
use tetreel::camera::{Camera, Projection};
use tetreel::field::FieldSelector;
use tetreel::image::RgbaImage;
use tetreel::import;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::node_table::NodeTable;
use tetreel::pipeline::{FrameRequest, Pipeline, RenderMode};
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{OpacityKind, RangePolicy, TransferFunction, build_node_table};

fn import_to(source: &Path, out: &Path, steps: &str) -> Store {
    let source = import::open(source).unwrap();
    let options = IngestOptions { steps: steps.parse().unwrap(), ..Default::default() };
    ingest(&*source, out, &options, &Silent, &Cancel::new()).unwrap();
    Store::open(out).unwrap()
}

fn table_for(pipeline: &Pipeline, tf: &str) -> Arc<NodeTable> {
    let [lo, hi] = pipeline.field().range.unwrap().map(f64::from);
    let range = RangePolicy::Series.resolve((lo, hi), (lo, hi)).unwrap();
    let (a, b) = pipeline.mesh().positions.world_bounds();
    let tf = TransferFunction::parse(tf).unwrap();
    Arc::new(build_node_table(&tf, &range, OpacityKind::Alpha, 0.01 * (b - a).length()).unwrap())
}

/// The same request through the fast path and through the judge.
fn both(pipeline: &mut Pipeline, step: usize, camera: Camera, table: &Arc<NodeTable>) -> (RgbaImage, RgbaImage) {
    let request =
        FrameRequest { mode: RenderMode::Raycast, ..FrameRequest::new(step, camera, table.clone(), (128, 128)) };
    let fast = pipeline.render(&request).unwrap().color.clone();
    let judge = pipeline.render(&FrameRequest { mode: RenderMode::Reference, ..request }).unwrap().color.clone();
    (fast, judge)
}

/// Dense, sparse with narrow tents, with an opaque plateau, and nearly transparent.
const TRANSFER_FUNCTIONS: [&str; 4] = [
    "viridis@0:0.02,1:0.5",
    "inferno@0:0,0.01:0,0.02:0.4,0.03:0,0.5:0,0.52:0.6,0.54:0,1:0",
    "turbo@0:0,0.1:0.1,0.3:1,1:1",
    "gray@0:0.001,1:0.002",
];

fn assert_agrees_from_all_sides(store: &Store, field: &str, steps: &[usize]) {
    let selector: FieldSelector = field.parse().unwrap();
    let mut pipeline = Pipeline::open(store, Some(&selector)).unwrap();
    let bounds = pipeline.mesh().positions.world_bounds();
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
    let mut seen = 0.0f32;
    for tf in TRANSFER_FUNCTIONS {
        let table = table_for(&pipeline, tf);
        for (c, camera) in [outside, along_x, parallel, inside].into_iter().enumerate() {
            for &step in steps {
                let (fast, judge) = both(&mut pipeline, step, camera, &table);
                let (rmse, max) = difference(&fast, &judge);
                assert!(rmse <= 1e-5 && max <= 1e-3, "{field}, {tf}, camera {c}, step {step}: {rmse:.1e}, {max:.1e}");
                seen = judge.pixels.iter().fold(seen, |m, p| m.max(p[3]));
            }
        }
    }
    assert!(seen > 0.5, "empty images prove nothing");
}

#[test]
fn the_spxf_series_is_drawn_as_the_reference_draws_it() {
    let Some(dir) = samples() else { return };
    let out = tempfile::tempdir().unwrap();
    let store = import_to(&dir.join("spxf/spxf.pvd"), &out.path().join("spxf.zarr"), "0..191:95");
    assert_eq!(store.times().values, [0.004, 0.384, 0.764]);
    assert_agrees_from_all_sides(&store, "reaction_force", &[0, 1, 2]);
    assert_agrees_from_all_sides(&store, "displacement:2", &[2]);
    assert_agrees_from_all_sides(&store, "displacement", &[1]);
}

#[test]
fn the_blunt_fin_is_drawn_as_the_reference_draws_it() {
    let Some(dir) = samples() else { return };
    let out = tempfile::tempdir().unwrap();
    let store = import_to(&dir.join("paper_static/bluntfin.vtu"), &out.path().join("bluntfin.zarr"), "0");
    let name = store.fields()[0].name.clone();
    let mut pipeline = Pipeline::open(&store, Some(&name.parse().unwrap())).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let table = table_for(&pipeline, TRANSFER_FUNCTIONS[0]);
    let (fast, judge) = both(&mut pipeline, 0, camera, &table);
    let (rmse, max) = difference(&fast, &judge);
    assert!(rmse <= 1e-5 && max <= 1e-3, "{rmse:.1e}, {max:.1e}");
}

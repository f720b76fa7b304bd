//! Real series, from file to frames. Skipped, with a word, where the samples are absent.

use crate::common::samples;
use crate::series::{assert_agrees_from_all_sides, assert_frame_agrees, ingested, table_for};
use std::path::Path;
use tetreel::camera::Camera;
use tetreel::import;
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::store::Store;

fn import_to(source: &Path, out: &Path, steps: &str) -> Store {
    ingested(&*import::open(source).unwrap(), out, steps)
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
    let table = table_for(&pipeline, "viridis@0:0.02,1:0.5");
    let job = pipeline.prepare(&FrameRequest::new(0, camera, table, (128, 128))).unwrap();
    assert!(assert_frame_agrees("blunt fin", &job) > 0.5);
}

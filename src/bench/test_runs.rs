//! Records for tests.

use crate::bench::{BenchRun, JUDGE_REFERENCE, RunError, RunTimes, SceneName};
use crate::stats::FrameStats;

/// A run of the ray caster on a series with this time and error.
pub(in crate::bench) fn run(series: &str, ms: f64, rmse: f64) -> BenchRun {
    BenchRun {
        dataset: series.to_owned(),
        cells: 1000,
        vertices: 300,
        viewpoints: 1,
        time_moves: false,
        camera_moves: false,
        size: [64, 48],
        backend: "cpu".to_owned(),
        mode: "raycast".to_owned(),
        lod: 1.0,
        optics: "exact".to_owned(),
        codec: "raw".to_owned(),
        skip: true,
        k: None,
        exact_order: None,
        sheets: None,
        table_size: None,
        image_scale: 1.0,
        upsample: None,
        contrast: None,
        ratio: Some(1.0),
        scene: Some(SceneName {
            series: series.to_owned(),
            transfer_function: "dense".to_owned(),
            step: 0,
            view: "front".to_owned(),
        }),
        threads: 2,
        ms: RunTimes { frame: ms, p50: ms, p95: ms, ..RunTimes::default() },
        fps: 1e3 / ms,
        cells_per_s: 1e6 / ms,
        error: Some(RunError {
            rmse,
            max: 10.0 * rmse,
            psnr: None,
            distance: None,
            flip: Some(1e-3),
            judge: JUDGE_REFERENCE.to_owned(),
        }),
        stats: FrameStats::default(),
    }
}

//! The accuracy suite on a small series: every path is there, and its errors are what they should be.

use crate::meshes::grid;
use crate::render::{BOUND_MAX, BOUND_RMSE, wave};
use crate::series::{colors_for, ingested};
use std::path::Path;
use tetreel::bench::accuracy::{
    AccuracyBench, AccuracyRuns, CODEC_PATHS, IntegrationRun, IntegrationTable, Judged, KS, LENGTH_DECADES, LODS,
    TRANSFER_FUNCTIONS, VIEWS, integration_errors, judge, path_label, paths, run_accuracy, scenes, summaries,
};
use tetreel::bench::plot::write_plots;
use tetreel::bench::{BenchRun, JUDGE_RAW, JUDGE_REFERENCE};
use tetreel::camera::{Camera, CameraError};
use tetreel::codec::vq::VqOptions;
use tetreel::ingest::{CodecChoice, IngestOptions, ingest};
use tetreel::pipeline::{Backend, Pipeline, RenderMode, Representation, UpsampleKind};
use tetreel::store::Store;
use tetreel::synth::{FadedSeries, SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

/// A small jet in both codecs, and its scenes as the judge sees them.
fn jet(dir: &Path) -> (Pipeline, Pipeline, Judged) {
    let series = generate(&SynthSpec { cells: 2000, steps: 8, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let mut raw = Pipeline::open(&ingested(&series, &dir.join("raw.zarr"), "0..7"), None).unwrap();
    // So few entries that the loss can be seen.
    let packed = dir.join("vq.zarr");
    let options =
        IngestOptions { codec: CodecChoice::new(VqOptions { entries: 4, ..Default::default() }), ..Default::default() };
    ingest(&series, &packed, &options, &Silent, &Cancel::new()).unwrap();
    let vq = Pipeline::open(&Store::open(&packed).unwrap(), None).unwrap();
    let judged = judged("jet", &mut raw);
    (raw, vq, judged)
}

/// The scenes of a series as the judge sees them.
fn judged(name: &str, pipeline: &mut Pipeline) -> Judged {
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let table = |tf: &str, _| Ok::<_, CameraError>(colors_for(pipeline, tf));
    let scenes = scenes(name, pipeline.times().len(), &camera, (48, 40), &TRANSFER_FUNCTIONS, table).unwrap();
    judge(pipeline, scenes, Representation::Cells, &Silent, &Cancel::new()).unwrap()
}

fn measured(pipeline: &mut Pipeline, judged: &Judged) -> AccuracyRuns {
    let mut backends = vec![Backend::Cpu];
    if cfg!(feature = "gpu") && pipeline.check_backend(Backend::Gpu).is_ok() {
        backends.push(Backend::Gpu);
    }
    let paths = paths(&backends);
    let bench =
        AccuracyBench { dataset: "jet", judged, judge: JUDGE_REFERENCE, paths: &paths, frames: 1, ratio: Some(1.0) };
    let measured = run_accuracy(pipeline, &bench, &Silent, &Cancel::new()).unwrap();
    assert_eq!(measured.runs.len() + measured.refused.len(), paths.len() * judged.scenes.len());
    measured
}

/// Whether a path leaves nothing out, and must therefore be right.
fn is_exact(run: &BenchRun) -> bool {
    let is_whole = run.lod == 1.0 && run.image_scale == 1.0 && run.optics == "exact";
    is_whole && run.contrast.is_none() && run.codec == "raw" && run.exact_order != Some(false)
}

/// The exact paths and scenes that are further from the truth than they may be.
fn too_wrong(runs: &[BenchRun]) -> Vec<String> {
    let is_wrong = |run: &&BenchRun| run.error.as_ref().is_none_or(|e| !(e.rmse <= BOUND_RMSE && e.max <= BOUND_MAX));
    let wrong = runs.iter().filter(|run| is_exact(run)).filter(is_wrong);
    wrong.map(|run| format!("{} in {}: {:?}", path_label(run), run.scene.as_ref().unwrap(), run.error)).collect()
}

/// The largest RMSE of the runs that `wanted` says.
fn worst(runs: &[BenchRun], wanted: impl Fn(&BenchRun) -> bool) -> f64 {
    let errors = runs.iter().filter(|run| wanted(run)).map(|run| run.error.as_ref().unwrap().rmse);
    errors.reduce(f64::max).expect("no run is of this kind")
}

// Long: it measures all paths that there are.
#[test]
fn every_path_is_measured_and_those_that_leave_nothing_out_are_exact() {
    let temp = tempfile::tempdir().unwrap();
    let (mut raw, _, mut judged) = jet(temp.path());
    assert_eq!(judged.scenes.len(), TRANSFER_FUNCTIONS.len() * VIEWS.len());
    assert!(judged.images.iter().all(|image| image.pixels.iter().any(|p| p[3] > 0.1)), "a scene is empty");
    let AccuracyRuns { runs, refused } = measured(&mut raw, &judged);
    assert_eq!(refused, [] as [String; 0]);

    let has = |wanted: &dyn Fn(&BenchRun) -> bool| runs.iter().filter(|run| wanted(run)).count() == judged.scenes.len();
    for backend in ["cpu", "gpu"] {
        let is_there = runs.iter().any(|run| run.backend == backend);
        for (mode, optics, table, scale) in [
            ("raycast", "exact", None, 1.0),
            ("raycast", "partial", None, 1.0),
            ("raycast", "table3d", Some(128), 1.0),
            ("havs", "partial", None, 1.0),
            ("havs", "table3d", Some(128), 1.0),
        ] {
            let is_it = |run: &BenchRun| {
                let factors = (run.mode.as_str(), run.optics.as_str(), run.table_size, run.image_scale, run.lod);
                run.backend == backend && run.contrast.is_none() && factors == (mode, optics, table, scale, 1.0)
            };
            assert!(has(&is_it) || !is_there, "{backend} {mode} {optics} {table:?} {scale}");
        }
    }
    for filter in UpsampleKind::ALL.map(|kind| kind.to_string()) {
        let is_of = |run: &BenchRun| run.upsample.as_ref() == Some(&filter) && run.image_scale == 0.25;
        assert!(has(&|run| is_of(run) && run.backend == "cpu"), "{filter}");
    }
    for lod in LODS {
        assert!(has(&|run| run.lod == lod
            && run.backend == "cpu"
            && path_label(run) == format!("havs, {} % of faces", 100.0 * lod)));
    }
    for (k, exact_order) in KS.into_iter().flat_map(|k| [(k, true), (k, false)]) {
        let is_plain = |run: &BenchRun| run.lod == 1.0 && run.optics == "exact" && run.backend == "cpu";
        assert!(
            has(&|run| is_plain(run) && (run.k, run.exact_order) == (Some(k), Some(exact_order))),
            "{k} {exact_order}"
        );
    }

    assert_eq!(too_wrong(&runs), [] as [String; 0]);
    // The same check with a judge that is wrong in one channel of one pixel finds every exact path.
    let pixel = &mut judged.images[0].pixels[48 * 20 + 24];
    pixel[1] += 2.0 * BOUND_MAX as f32;
    let found = too_wrong(&measured(&mut raw, &judged).runs);
    assert_eq!(found.len() * judged.scenes.len(), runs.iter().filter(|run| is_exact(run)).count(), "{found:?}");
}

#[test]
fn errors_grow_with_all_that_is_left_out() {
    let temp = tempfile::tempdir().unwrap();
    let (mut raw, _, judged) = jet(temp.path());
    let runs = measured(&mut raw, &judged).runs;
    let has_no_table = |run: &BenchRun| run.optics == "exact" && run.backend == "cpu";
    let is_in_order =
        |run: &BenchRun| run.exact_order == Some(true) && run.image_scale == 1.0 && run.upsample.is_none();
    let at_level = |lod: f64| worst(&runs, |run| has_no_table(run) && is_in_order(run) && run.lod == lod);
    assert!(at_level(0.05) > at_level(0.5) && at_level(0.5) > at_level(1.0), "{} {}", at_level(0.05), at_level(0.5));
    let is_cast = |run: &BenchRun| run.mode == "raycast" && run.backend == "cpu";
    let of_table = |size| worst(&runs, |run| is_cast(run) && run.table_size == Some(size) && run.image_scale == 1.0);
    assert!(of_table(32) > of_table(256), "{} {}", of_table(32), of_table(256));
    let casts_all = |run: &BenchRun| is_cast(run) && has_no_table(run) && run.contrast.is_none();
    let is_plain = |run: &BenchRun| run.upsample.as_ref().is_none_or(|filter| filter == "bilinear");
    let at_scale = |scale: f64| worst(&runs, |run| casts_all(run) && is_plain(run) && run.image_scale == scale);
    assert!(at_scale(0.25) > at_scale(0.5) && at_scale(0.5) > at_scale(1.0));
    let with = |contrast: f32| worst(&runs, |run| run.contrast == Some(f64::from(contrast)));
    assert!(with(0.2) > with(0.01) && with(0.01) < at_scale(0.5), "{} {}", with(0.2), with(0.01));
}

#[test]
fn errors_shrink_as_the_buffer_grows_and_vanish_in_exact_order() {
    // Layers that become thinner towards one side, to a millionth: the order of their centroids is not that along rays.
    let mut mesh = grid(6, 0.14, 5, |_| true);
    let values = mesh.points.iter().map(|&p| wave(p) as f32).collect();
    mesh.points.iter_mut().for_each(|p| p.z = 2.0 * 1e-6_f64.powf(0.5 - 0.5 * p.z) - 1.0);
    let temp = tempfile::tempdir().unwrap();
    let series = FadedSeries::new("layers", "wave", mesh, values, 0, 2).unwrap();
    let mut layers = Pipeline::open(&ingested(&series, &temp.path().join("layers.zarr"), "0..1"), None).unwrap();
    let judged = judged("layers", &mut layers);
    let paths: Vec<_> =
        paths(&[Backend::Cpu]).into_iter().filter(|p| p.mode == RenderMode::Havs && p.lod == 1.0).collect();
    let bench = AccuracyBench {
        dataset: "layers",
        judged: &judged,
        judge: JUDGE_REFERENCE,
        paths: &paths,
        frames: 1,
        ratio: None,
    };
    let runs = run_accuracy(&mut layers, &bench, &Silent, &Cancel::new()).unwrap().runs;
    let with_k = |k: u8| worst(&runs, |run| run.k == Some(k) && run.exact_order == Some(false));
    assert!(with_k(2) > BOUND_RMSE && with_k(2) > with_k(32), "{} {}", with_k(2), with_k(32));
    assert_eq!(too_wrong(&runs), [] as [String; 0]);
    assert!(runs.iter().filter(|run| is_exact(run)).count() == KS.len() * judged.scenes.len());
}

#[test]
fn compressed_values_are_judged_by_those_from_before() {
    let temp = tempfile::tempdir().unwrap();
    let (mut raw, mut vq, judged) = jet(temp.path());
    let of = |pipeline: &mut Pipeline, judge, ratio| {
        let bench = AccuracyBench {
            dataset: "jet",
            judged: &judged,
            judge,
            paths: &CODEC_PATHS,
            frames: 1,
            ratio: Some(ratio),
        };
        run_accuracy(pipeline, &bench, &Silent, &Cancel::new()).unwrap().runs
    };
    let (own, packed) = (of(&mut raw, JUDGE_REFERENCE, 1.0), of(&mut vq, JUDGE_RAW, 9.0));
    let rays = |runs: &[BenchRun]| worst(runs, |run| run.mode == "raycast" && run.image_scale == 1.0);
    // What a lossy codec changes is far more than what renderers do. Measured: 7.7e-2 and 1.1e-7.
    assert!(rays(&own) <= BOUND_RMSE && rays(&packed) > 10.0 * BOUND_RMSE, "{} {}", rays(&own), rays(&packed));
    assert!(packed.iter().all(|run| run.codec == "vq" && run.error.as_ref().unwrap().judge == JUDGE_RAW));

    let all = [own, packed].concat();
    assert!(summaries(&all).iter().any(|summary| summary.label == "raycast, vq 9:1"));
    let report = write_plots(temp.path(), &all).unwrap();
    let written: Vec<_> = report.written.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(
        written,
        ["accuracy_time.svg", "accuracy_families.svg", "accuracy_ratio.svg", "accuracy_lod.svg", "accuracy_scale.svg"]
    );
}

/// What f32 may lose in a segment of opacity and of a colour that is exact: weights are off by 4e-7 of 1 at most each
/// (`optics/weights.rs`), and what is behind a piece is dimmed by it. Measured: 2.9e-7.
const ONE_SEGMENT: f64 = 1e-6;
/// Of an opacity, however small. Sums and products of positive numbers, each rounded a few times by 6e-8: partial, measured 1.3e-7.
/// Down a ramp the exact integrator goes in f32, from its upper end: where a segment keeps to the lowest hundredth of one, 6e-8 of a
/// hundred times what there is. Measured 1.8e-5, at the foot of the spike.
const ONE_SEGMENT_RELATIVE: [(&str, f64); 2] = [("partial", 1e-6), ("exact", 1e-4)];

/// Runs in which an integrator is not as exact as it should be: in opacity, and in colour if that is asked for.
fn inexact<'a>(runs: &'a [IntegrationRun], optics: &str, in_color: bool) -> Vec<&'a IntegrationRun> {
    let (_, relative) = ONE_SEGMENT_RELATIVE.into_iter().find(|(of, _)| *of == optics).unwrap_or(("", 1e-4));
    let is_wrong = |run: &&IntegrationRun| {
        let off = run.opacity_max.max(if in_color { run.color_max } else { 0.0 });
        run.optics == optics && !(off < ONE_SEGMENT && run.opacity_relative < relative)
    };
    runs.iter().filter(is_wrong).collect()
}

#[test]
fn one_segment_is_integrated_within_the_bounds_of_each_method_in_every_hard_case() {
    let sizes = [32, 128];
    let runs = integration_errors(&sizes, 120).unwrap();
    let cases = ["smooth", "spike of 1/4096", "alpha 1 - 1e-7", "steps", "1e-38 to 1e38"];
    assert_eq!(runs.len(), cases.len() * (2 + sizes.len()) * LENGTH_DECADES.count());
    for case in cases {
        for (optics, size) in [("exact", None), ("partial", None), ("table3d", Some(32)), ("table3d", Some(128))] {
            let of: Vec<_> =
                runs.iter().filter(|r| r.case == case && r.optics == optics && r.table_size == size).collect();
            assert_eq!(of.len(), LENGTH_DECADES.count(), "{case} {optics} {size:?}");
            assert_eq!((of[0].length, of[12].length, of[0].segments), (1e-9, 1e3, 120));
        }
    }
    println!("{}", IntegrationTable(&runs));
    assert_eq!(inexact(&runs, "exact", true), [] as [&IntegrationRun; 0]);
    assert_eq!(inexact(&runs, "partial", false), [] as [&IntegrationRun; 0]);
    // The same check fails for what is not exact: a table, and the colours of partial pre-integration; and a table has errors that
    // shrink with its size where the function is smooth.
    assert!(inexact(&runs, "table3d", false).len() > LENGTH_DECADES.count());
    assert!(!inexact(&runs, "partial", true).is_empty());
    // Measured: 5.8e-5.
    assert!(runs.iter().all(|run| run.optics != "partial" || run.color_max < 1.5e-4));
    let worst = |size| {
        let of = runs.iter().filter(|r| r.case == "smooth" && r.table_size == Some(size));
        of.map(|r| r.color_rms).fold(0.0, f64::max)
    };
    // Four times as fine, where interpolation has a sixteenth of the error in scalars, and the same in lengths. Measured: 0.088.
    assert!(worst(128) < 0.3 * worst(32), "{:e} {:e}", worst(128), worst(32));
}

//! Few rays with details of an earlier moment: what is exact of a frame, how far the rest is off, and what refuses them.

use super::{is_same_at, one_ray_off};
use crate::series::{ingested, table_for};
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::image::{RgbaImage, compare_raw};
use tetreel::pipeline::{
    Backend, Delivery, FrameRequest, Pipeline, Pipelined, PipelinedOptions, ResidualBase, ResidualRequest, SampleSet,
    Series, SharedFrame, TetDraw,
};
use tetreel::render::domain::{DomainStyle, DomainSurface};
use tetreel::render::residual::Details;
use tetreel::synth::{SeriesName, SynthSpec, generate};

const SIZE_PX: (usize, usize) = (150, 101);
const STEPS: usize = 6;

/// A jet, a pipeline for it that keeps what it has room for, and a request.
fn jet(tf: &str) -> (tempfile::TempDir, Pipelined, FrameRequest) {
    let source = generate(&SynthSpec { cells: 4000, steps: STEPS, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let store = ingested(&source, &dir.path().join("s.zarr"), &format!("0..{}", STEPS - 1));
    let series = Arc::new(Series::open(&store, None).unwrap());
    let pipeline = Pipeline::new(series);
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let request =
        FrameRequest { backend: Backend::Cpu, ..FrameRequest::new(0, camera, table_for(&pipeline, tf), SIZE_PX) };
    (dir, Pipelined::start(pipeline, &PipelinedOptions::default(), || ()).unwrap(), request)
}

fn delivery(pipelined: &Pipelined, request: FrameRequest) -> Delivery {
    pipelined.push(request).unwrap();
    pipelined.wait(std::time::Duration::from_secs(60)).unwrap()
}

fn frame(pipelined: &Pipelined, request: FrameRequest) -> SharedFrame {
    delivery(pipelined, request).frame.unwrap()
}

fn with(request: &FrameRequest, step: usize, base: ResidualBase, anew: std::ops::Range<usize>) -> FrameRequest {
    FrameRequest { time: step.into(), residual: Some(ResidualRequest { base, anew }), ..request.clone() }
}

fn rmse(a: &RgbaImage, b: &RgbaImage) -> f64 {
    compare_raw(a, b).unwrap().rmse
}

#[test]
fn rays_that_are_cast_and_rows_made_anew_have_the_bits_of_the_whole_frame() {
    let (_dir, pipelined, request) = jet("viridis@0:0.02,1:0.5");
    let first = frame(&pipelined, request.clone());
    let exact = frame(&pipelined, FrameRequest { time: 3.into(), ..request.clone() }).planes.clone();
    // What was rendered in full is as good as anything: it is kept.
    let kept = delivery(&pipelined, with(&request, 3, ResidualBase::exact(first.clone()), 0..1));
    assert!(kept.is_kept && kept.frame.unwrap().planes == exact);
    let (width, height) = SIZE_PX;
    let fresh = FrameRequest { skip: "all,-unchanged".parse().unwrap(), ..request.clone() };
    for (anew, count) in [(0..0, 0), (2..4, 32 * width), (6..7, 5 * width), (0..7, width * height)] {
        let shown = frame(&pipelined, with(&fresh, 3, ResidualBase::exact(first.clone()), anew.clone()));
        let is_cast = |at: usize| {
            let (column, row) = (at % width, at / width);
            let is = |pixel: usize, pixels: usize| pixel.is_multiple_of(4) || pixel + 1 == pixels;
            is(column, width) && is(row, height) || anew.contains(&(row / 16))
        };
        let pixels = || (0..width * height).filter(|&at| is_cast(at));
        assert!(is_same_at(&shown.planes.color, &exact.color, pixels()), "{anew:?}");
        let off = one_ray_off(&shown.planes.color, pixels().next_back().unwrap());
        assert!(!is_same_at(&off, &exact.color, pixels()), "{anew:?}: one ray is noticed");
        let all = 0..width * height;
        assert_eq!((shown.stats.pixels_anew as usize, shown.stats.residual_rmse.is_some()), (count, count > 0));
        assert_eq!(is_same_at(&shown.planes.color, &exact.color, all.clone()), count == width * height);
        assert!(!is_same_at(&one_ray_off(&exact.color, width), &exact.color, all), "one ray is noticed");
        assert_eq!((shown.planes.depth.width, shown.planes.depth.height), SIZE_PX);
        assert!(shown.stats.ms_residual > 0.0 && shown.stats.ms_worked() >= shown.stats.ms_residual);
    }
}

#[test]
fn details_serve_the_next_moments_and_nothing_that_has_them_is_kept() {
    let (_dir, pipelined, request) = jet("viridis@0:0.02,1:0.5");
    let first = frame(&pipelined, request.clone());
    // The same moment: two roundings.
    let fresh = FrameRequest { skip: "all,-unchanged".parse().unwrap(), ..request.clone() };
    let same = frame(&pipelined, with(&fresh, 0, ResidualBase::exact(first.clone()), 0..0));
    assert!(compare_raw(&same.planes.color, &first.planes.color).unwrap().max <= 2f64.powi(-23));
    let nothing = Arc::new(Details::of(&RgbaImage::new(SIZE_PX.0, SIZE_PX.1)));
    let mut base = ResidualBase::exact(first);
    for step in 1..STEPS {
        let exact = pipelined_exact(&pipelined, &fresh, step);
        let shown = delivery(&pipelined, with(&fresh, step, base, 0..0));
        assert!(!shown.is_kept);
        let shown = shown.frame.unwrap();
        let plain = frame(&pipelined, with(&fresh, step, ResidualBase::Details(nothing.clone()), 0..0));
        let (with_details, without) = (rmse(&shown.planes.color, &exact), rmse(&plain.planes.color, &exact));
        println!("step {step}: RMSE {with_details:.2e} with details of step 0, {without:.2e} without");
        assert!(with_details < without, "{step}");
        base = ResidualBase::Details(shown.details.clone().unwrap());
    }
    // A whole frame after one with details.
    let again = frame(&pipelined, FrameRequest { time: 1.into(), ..fresh.clone() });
    assert!(again.details.is_none() && again.planes.color == pipelined_exact(&pipelined, &fresh, 1));
}

fn pipelined_exact(pipelined: &Pipelined, request: &FrameRequest, step: usize) -> RgbaImage {
    frame(pipelined, FrameRequest { time: step.into(), residual: None, ..request.clone() }).planes.color.clone()
}

#[test]
fn details_that_do_not_fit_are_refused() {
    let (_dir, pipelined, request) = jet("viridis@0:0.02,1:0.5");
    let base = ResidualBase::exact(frame(&pipelined, request.clone()));
    let good = with(&request, 1, base, 0..1);
    let bad = |change: fn(FrameRequest) -> FrameRequest| {
        let refused = delivery(&pipelined, change(good.clone())).frame.unwrap_err().to_string();
        assert!(refused.contains("details"), "{refused}");
        refused
    };
    assert!(bad(|r| FrameRequest { size_px: (150, 100), ..r }).contains("another size"));
    bad(|r| r.with_draw(TetDraw::ALL_FACES));
    bad(|r| r.with_draw(TetDraw::Reference));
    bad(|r| FrameRequest { samples: "adaptive".parse::<SampleSet>().unwrap(), ..r });
    bad(|r| {
        r.with_tets(|tets| {
            tets.domain =
                vec![DomainSurface { style: DomainStyle::Wireframe, regions: None, color: None, opacity: 1.0 }]
        })
    });
    assert!(delivery(&pipelined, good).frame.is_ok());
}

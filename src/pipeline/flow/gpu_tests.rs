//! Frames whose splats of flow a GPU draws.

use super::*;
use crate::camera::Camera;
use crate::ingest::{IngestOptions, ingest};
use crate::node_table::{Node, NodeTable};
use crate::pipeline::{
    Backend, Delivery, FrameRequest, Layer, Pipeline, Pipelined, PipelinedOptions, SampleSet, TetDraw,
};
use crate::render::gpu::context::{Context, ContextOptions};
use crate::render::gpu::test_common;
use crate::render::testing::difference;
use crate::render::{Contrast, Frame};
use crate::store::Store;
use crate::synth::{SeriesName, SynthSpec, generate};
use crate::task::Silent;

/// A tornado, and requests of it by cells and by faces.
fn tornado() -> (tempfile::TempDir, Arc<Series>, Vec<FrameRequest>) {
    let folder = tempfile::tempdir().unwrap();
    let tornado = generate(&SynthSpec { cells: 1500, steps: 3, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
    let path = folder.path().join("t.zarr");
    ingest(&tornado, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
    let series = Arc::new(Series::open(&Store::open(&path).unwrap(), Some(&selector("pressure"))).unwrap());
    let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap().orbit(30.0, 20.0).unwrap();
    let [lo, hi] = series.field().range.unwrap().map(f64::from);
    let node = |scalar, tau| Node { scalar, rgb: [0.2, 0.5, 0.9], tau };
    let table = Arc::new(NodeTable::new(vec![node(lo, 0.5), node(hi, 0.0)]).unwrap());
    let of = |draw: TetDraw, step: usize| {
        let mut request = FrameRequest::new(step, camera, table.clone(), (70, 50)).with_draw(draw);
        request.layers.push(Layer::Flow(FlowLayer::new("velocity".to_owned(), FlowStyle::default())));
        FrameRequest { backend: Backend::Gpu, ..request }
    };
    let draws = [TetDraw::Raycast, TetDraw::ALL_FACES];
    let requests = draws.into_iter().flat_map(|draw| [1, 2].map(|step| of(draw, step))).collect();
    (folder, series, requests)
}

fn pipeline(series: &Arc<Series>) -> Pipeline {
    let mut pipeline = Pipeline::new(series.clone());
    pipeline.choose_gpu(ContextOptions { draws_flow: Some(true), ..ContextOptions::default() });
    pipeline
}

#[test]
fn splats_have_fragments_only_where_no_gpu_draws_them_and_look_the_same() {
    if let Err(why) = Context::new(&ContextOptions::default()) {
        return test_common::skip("gpu", &why.to_string());
    }
    let (_folder, series, requests) = tornado();
    let (mut on_gpu, mut on_cpu) = (pipeline(&series), Pipeline::new(series.clone()));
    let mut played = Vec::new();
    for request in &requests {
        let ordered = |pipeline: &mut Pipeline, request: &FrameRequest, draws_flow| {
            pipeline.order(request, draws_flow, &Cancel::new()).unwrap()
        };
        let has = |ordered: &crate::pipeline::preparation::Ordered| {
            (ordered.job.flow.is_some(), ordered.job.fragments.is_some())
        };
        let drawn = ordered(&mut on_gpu, request, true);
        assert_eq!(has(&drawn), (true, false));
        assert_eq!(has(&ordered(&mut on_gpu, request, false)), (true, true));
        let judged = request.clone().with_draw(TetDraw::Reference);
        assert_eq!(has(&ordered(&mut on_gpu, &judged, true)), (false, true));
        let adaptive = SampleSet::Adaptive { contrast: Contrast::new(0.1).unwrap() };
        let adaptive = FrameRequest { samples: adaptive, ..request.clone().with_draw(TetDraw::Raycast) };
        assert_eq!(has(&ordered(&mut on_gpu, &adaptive, true)), (true, true));

        let expected = on_cpu.render(&FrameRequest { backend: Backend::Cpu, ..request.clone() }).unwrap().clone();
        // Fragments that are made late have the same bits.
        let late = on_gpu.renderers.render(drawn, Backend::Cpu).unwrap().unwrap();
        assert!(late.planes == expected.planes && late.stats.flow_fragments == expected.stats.flow_fragments);
        let found = on_gpu.render(request).unwrap().clone();
        let pixels = |frame: &Frame| frame.planes.color.pixels.clone();
        let [rmse, most] = difference(&pixels(&found), &pixels(&expected));
        eprintln!("{rmse:.1e}, {most:.1e}");
        assert!(found.stats.on_gpu && rmse <= 1e-6 && most <= 1e-4, "{rmse:.1e}, {most:.1e}");
        let [found_stats, stats] = [&found, &expected].map(|frame| &frame.stats);
        assert_eq!((found_stats.flow_splats, found_stats.flow_fast), (stats.flow_splats, stats.flow_fast));
        assert!(found_stats.flow_fragments > 1000 && found_stats.flow_outside > 0);
        // Rays end, and where a pattern is dark its sums are rounded to no light or to next to none.
        assert!(found_stats.flow_fragments <= stats.flow_fragments + stats.flow_fragments / 8);
        played.push(found.planes);
    }
    assert!(played[0] != played[1] && played[2] != played[3]);
    // Whatever was known when a frame was ordered.
    let pipelined = Pipelined::start(pipeline(&series), &PipelinedOptions::default(), || ()).unwrap();
    for (request, expected) in requests.into_iter().zip(&played) {
        let _ = pipelined.push(request);
        let Some(Delivery { frame, .. }) = pipelined.wait(std::time::Duration::from_secs(60)) else {
            panic!("no frame")
        };
        assert!(frame.unwrap().planes == *expected);
    }
}

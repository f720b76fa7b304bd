//! Frames of a series by request: which renderer draws them, and what happens when it fails.

use crate::series::{ingested, table_for};
use std::sync::Arc;
use std::time::Duration;
use tetreel::camera::Camera;
use tetreel::codec::BlockCache;
use tetreel::codec::vq::VqOptions;
use tetreel::ingest::{AppendOptions, CodecChoice, IngestOptions, append, ingest};
use tetreel::pipeline::{
    Backend, FaceDetail, FrameRequest, Pipeline, Pipelined, PipelinedOptions, SampleSet, Series, TetDraw,
};
use tetreel::playback::{Clock, Command, Mode, Player};
use tetreel::render::Contrast;
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

/// A small jet, and a request for its frames.
fn jet(dir: &std::path::Path) -> (Pipeline, FrameRequest) {
    let series = generate(&SynthSpec { cells: 3000, steps: 6, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let pipeline = Pipeline::open(&ingested(&series, &dir.join("jet.zarr"), "0..5"), None).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let table = table_for(&pipeline, "inferno@0:0,1:0.5");
    (pipeline, FrameRequest::new(0, camera, table, (96, 64)))
}

#[test]
fn a_request_says_by_itself_where_it_is_rendered() {
    for backend in [Backend::Auto, Backend::Cpu, Backend::Gpu] {
        let json = serde_json::to_string(&backend).unwrap();
        assert_eq!(json.trim_matches('"').parse::<Backend>().unwrap(), backend);
    }
    assert!("cuda".parse::<Backend>().unwrap_err().contains("choose auto, cpu or gpu"));
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = jet(temp.path());
    pipeline.check_backend(Backend::Auto).unwrap();
    let cpu = FrameRequest { backend: Backend::Cpu, ..request.clone() };
    assert!(!pipeline.render(&cpu).unwrap().stats.on_gpu);
    let judge = FrameRequest { backend: Backend::Gpu, ..request.with_draw(TetDraw::Reference) };
    assert!(!pipeline.render(&judge).unwrap().stats.on_gpu);
}

#[cfg(not(feature = "gpu"))]
#[test]
fn without_the_feature_a_gpu_is_refused_and_auto_is_the_cpu() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = jet(temp.path());
    let refused = pipeline.render(&FrameRequest { backend: Backend::Gpu, ..request.clone() }).unwrap_err();
    assert!(refused.to_string().contains("built without the feature gpu"), "{refused}");
    assert!(pipeline.check_backend(Backend::Gpu).is_err());
    assert!(!pipeline.render(&request).unwrap().stats.on_gpu);
}

#[test]
fn a_lattice_of_pixels_is_a_part_of_the_whole_frame_and_nothing_is_kept_for_the_other() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = jet(temp.path());
    let request = FrameRequest { backend: Backend::Cpu, time: 5.into(), ..request };
    let stride_px = std::num::NonZeroUsize::new(7).unwrap();
    let some = FrameRequest { samples: SampleSet::Lattice { stride_px }, ..request.clone() };
    let whole = pipeline.render(&request).unwrap().planes.clone();
    let color = pipeline.render(&some).unwrap().planes.color.clone();
    assert_eq!((color.width, color.height), (15, 10));
    for (at, pixel) in color.pixels.iter().enumerate() {
        let (column, row) = ((7 * (at % 15)).min(95), (7 * (at / 15)).min(63));
        assert_eq!(*pixel, whole.color.pixels[96 * row + column]);
    }
    assert!(color.pixels.iter().any(|pixel| pixel[3] > 0.0));
    assert_eq!(pipeline.render(&request).unwrap().planes, whole);
}

#[test]
fn rays_that_contrast_asks_for_go_from_cell_to_cell() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = jet(temp.path());
    let request = FrameRequest { time: 5.into(), ..request };
    let whole = pipeline.render(&FrameRequest { backend: Backend::Cpu, ..request.clone() }).unwrap().planes.clone();
    assert!(whole.color.pixels.iter().any(|pixel| pixel[3] > 0.0));
    let at = |samples: &str| FrameRequest { samples: samples.parse().unwrap(), ..request.clone() };
    let on = |backend: Backend, samples: &str| FrameRequest { backend, ..at(samples) };
    let frame = pipeline.render(&on(Backend::Cpu, "adaptive:0.3")).unwrap().clone();
    assert!(!frame.stats.on_gpu && frame.stats.rays_by_level[0] > 0);
    assert!(frame.planes != whole && frame.planes.color.pixels.len() == whole.color.pixels.len());
    assert!(pipeline.render(&on(Backend::Cpu, "adaptive:0")).unwrap().planes == whole);
    if pipeline.check_backend(Backend::Gpu).is_ok() {
        let exact = pipeline.render(&on(Backend::Gpu, "exact")).unwrap().clone();
        assert!(pipeline.render(&on(Backend::Gpu, "adaptive:0")).unwrap().planes == exact.planes);
        let fewer = pipeline.render(&on(Backend::Gpu, "adaptive:0.3")).unwrap().clone();
        assert!(fewer.stats.on_gpu && fewer.stats.rays_by_level[0] > 0 && fewer.planes != exact.planes);
        let on_the_way = FrameRequest { previews: vec![Contrast::default()], ..on(Backend::Gpu, "exact") };
        assert!(pipeline.render(&on_the_way).unwrap().planes == exact.planes);
    } else {
        assert!(pipeline.render(&on(Backend::Gpu, "adaptive")).is_err());
    }
    let all = FaceDetail { lod: 0.5, ..FaceDetail::ALL };
    for draw in [TetDraw::ALL_FACES, TetDraw::Faces(all), TetDraw::Reference] {
        let refused = pipeline.render(&at("adaptive").with_draw(draw)).unwrap_err().to_string();
        assert!(refused.contains("from cell to cell") && refused.contains(draw.drawn_by().name()), "{refused}");
    }
    for bad in ["adaptive:1.5", "adaptive:", "adaptive:nan", "some", "exact:0.1"] {
        assert!(bad.parse::<SampleSet>().is_err(), "{bad}");
    }
}

const LONG: Duration = Duration::from_secs(60);

/// Pixels as bits.
fn bits(frame: &tetreel::render::Frame) -> Vec<[u32; 4]> {
    frame.planes.color.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

#[test]
fn blocks_are_read_ahead_as_far_as_the_budget_goes_and_frames_do_not_depend_on_it() {
    let temp = tempfile::tempdir().unwrap();
    let (mut alone, request) = jet(temp.path());
    let store = Store::open(temp.path().join("jet.zarr")).unwrap();
    let step_bytes = 4 * alone.mesh().positions.local.len() as u64;
    for budget_steps in [0, 1, 3, 100] {
        let blocks = Arc::new(BlockCache::new(budget_steps * step_bytes));
        let series = Arc::new(Series::open_with(&store, None, blocks.clone()).unwrap());
        let options = PipelinedOptions { frame_cache_bytes: 0, ..Default::default() };
        let pipelined = Pipelined::start(Pipeline::new(series.clone()), &options, || ()).unwrap();
        let mut before = None;
        for first in 0..6 {
            let upcoming: Vec<usize> = (first..6).collect();
            pipelined.expect(&upcoming);
            // A block that is larger than the budget is kept as long as nothing else is loaded.
            let expected = (6 - first).min(budget_steps.max(1) as usize);
            while (first..first + expected).any(|step| !series.is_resident(step)) {
                std::thread::yield_now();
            }
            let at_step = FrameRequest { time: first.into(), ..request.clone() };
            pipelined.push(at_step.clone()).unwrap();
            let frame = pipelined.wait(LONG).unwrap().frame.unwrap();
            assert_eq!(frame.stats.bytes_read, 0, "step {first} was there before it was needed");
            let expected = bits(alone.render(&at_step).unwrap());
            assert!(bits(&frame) == expected);
            assert!(before.as_ref() != Some(&expected), "another step would be seen");
            before = Some(expected);
            assert!(blocks.statistics().resident_bytes <= (budget_steps * step_bytes).max(step_bytes));
        }
    }
}

#[test]
fn a_player_shows_the_steps_that_a_running_simulation_adds() {
    let series = |steps| generate(&SynthSpec { cells: 600, steps, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    for codec in [CodecChoice::default(), CodecChoice::new(VqOptions::default())] {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("jet.zarr");
        // The simulation has come to step 3, then to step 7.
        let begun = IngestOptions { steps: "0..3".parse().unwrap(), codec, ..Default::default() };
        ingest(&series(8), &path, &begun, &Silent, &Cancel::new()).unwrap();
        let store = Store::open(&path).unwrap();
        let pipeline = Pipeline::open(&store, None).unwrap();
        let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
        let table = table_for(&pipeline, "inferno@0:0,1:0.5");
        let request = FrameRequest::new(0, camera, table, (48, 32));
        let clock = Clock::new(pipeline.times().clone());
        let pipelined = Pipelined::start(pipeline, &PipelinedOptions::default(), || ()).unwrap();
        let mut player = Player::new(clock, pipelined);
        player.apply(Command::Mode(Mode::AsFastAsPossible), Duration::ZERO).unwrap();
        let play = |player: &mut Player| {
            let mut shown = Vec::new();
            player.apply(Command::Play, Duration::ZERO).unwrap();
            while !player.clock().state().ended || player.pipelined().wanted() > 0 {
                let tick = player.tick(Duration::ZERO, &mut |time| Some(FrameRequest { time, ..request.clone() }));
                match tick.shown {
                    Some(delivery) => shown.push((delivery.request.time.step(), bits(&delivery.frame.unwrap()))),
                    None => drop(player.wait(LONG)),
                }
            }
            shown
        };
        assert_eq!(play(&mut player).iter().map(|(step, _)| *step).collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert!(store.refreshed().unwrap().is_none());
        append(&series(8), &path, &AppendOptions::default(), &Silent, &Cancel::new()).unwrap();
        let grown = store.refreshed().unwrap().unwrap();
        let reopened = player.pipelined().series().reopened(&grown, None).unwrap();
        player.grow(Arc::new(reopened)).unwrap();
        let shown = play(&mut player);
        let mut alone = Pipeline::open(&grown, None).unwrap();
        assert!(shown.iter().map(|(step, _)| *step).any(|step| step == 7));
        for (step, pixels) in shown {
            let frame = alone.render(&FrameRequest { time: step.into(), ..request.clone() }).unwrap();
            assert!(bits(frame) == pixels, "step {step}");
        }
    }
}

#[cfg(feature = "gpu")]
mod gpu {
    use super::*;
    use crate::render::gpu::context;
    use tetreel::export::still::{OutputFrame, StillOptions, write_still};
    use tetreel::image::{ExrColor, read_exr};
    use tetreel::pipeline::PipelineError;
    use tetreel::render::RenderError;
    use tetreel::render::gpu::context::ContextOptions;
    use tetreel::render::surfaces::Isosurface;

    #[test]
    fn frames_of_a_gpu_that_is_lost_in_the_middle_of_an_animation_are_those_of_one_that_is_not() {
        if context().is_none() {
            return;
        }
        for draw in [TetDraw::Raycast, TetDraw::ALL_FACES] {
            lose_in_the_middle(draw);
        }
    }

    fn lose_in_the_middle(draw: TetDraw) {
        let temp = tempfile::tempdir().unwrap();
        let (mut pipeline, request) = jet(temp.path());
        let request = FrameRequest { backend: Backend::Gpu, ..request.with_draw(draw) };
        let options = StillOptions { exr: ExrColor::Raw.into(), ..Default::default() };
        let mut animate = |name: &str, lost_after: Option<usize>| {
            let mut restarts = Vec::new();
            for step in 0..6 {
                let frame = pipeline.render(&FrameRequest { time: step.into(), ..request.clone() }).unwrap();
                assert!(frame.stats.on_gpu);
                restarts.push(frame.stats.gpu_restarts);
                let output = OutputFrame { planes: frame.planes.clone(), attributes: Default::default() };
                write_still(&temp.path().join(format!("{name}_{step}.exr")), &output, &options).unwrap();
                if lost_after == Some(step) {
                    pipeline.gpu().unwrap().lose();
                }
            }
            restarts
        };
        assert_eq!(animate("whole", None), [0; 6]);
        assert_eq!(animate("lost", Some(2)), [0, 0, 0, 1, 0, 0]);
        let mut last = None;
        for step in 0..6 {
            let read = |name: &str| read_exr(&temp.path().join(format!("{name}_{step}.exr"))).unwrap().planes;
            let (whole, lost) = (read("whole"), read("lost"));
            assert_eq!((&whole.color, &whole.depth), (&lost.color, &lost.depth), "step {step}");
            assert!(last.replace(whole.color.clone()) != Some(whole.color), "the steps differ");
        }
    }

    #[test]
    fn auto_uses_a_gpu_in_software_only_if_it_is_named_and_the_cpu_for_what_is_beyond_it() {
        let Some(context) = context() else { return };
        let temp = tempfile::tempdir().unwrap();
        let (mut pipeline, request) = jet(temp.path());
        let on_gpu = pipeline.render(&request).unwrap().stats.on_gpu;
        assert_eq!(on_gpu, context.adapter().is_hardware);
        let named = ContextOptions { adapter: context.adapter().name.clone(), ..Default::default() };
        pipeline.choose_gpu(named.clone());
        assert!(pipeline.render(&request).unwrap().stats.on_gpu);
        let scalars = pipeline.prepare(&request).unwrap().scalars;
        let greatest = scalars.values().iter().copied().fold(f32::MIN, f32::max);
        let surfaces = vec![Isosurface::new(0.5 * f64::from(greatest))];
        for (volume, mode) in [(true, TetDraw::default()), (false, TetDraw::default()), (false, TetDraw::ALL_FACES)] {
            let lit = request.clone().with_tets(|tets| {
                (tets.surfaces, tets.volume, tets.draw) = (surfaces.clone(), volume, mode);
            });
            let frame = pipeline.render(&lit).unwrap();
            assert!(frame.stats.on_gpu, "{mode:?}");
            assert!(frame.planes.depth.pixels.iter().any(|depth| depth.is_finite()), "{mode:?}, up to {greatest}");
        }
        assert_eq!(pipeline.gpu_problem(), None);

        // No mesh fits into bindings of this size.
        pipeline.choose_gpu(ContextOptions { binding_bytes: Some(1024), ..named });
        for _ in 0..2 {
            let frame = pipeline.render(&request).unwrap();
            assert!(!frame.stats.on_gpu && frame.planes.color.pixels.iter().any(|p| p[3] > 0.0));
            assert!(matches!(pipeline.gpu_problem(), Some(RenderError::BeyondGpu { .. })));
        }
        let refused = pipeline.render(&FrameRequest { backend: Backend::Gpu, ..request.clone() });
        assert!(matches!(refused, Err(PipelineError::Render(RenderError::BeyondGpu { .. }))));
        // Not asked, not mentioned.
        pipeline.render(&FrameRequest { backend: Backend::Cpu, ..request }).unwrap();
    }

    #[test]
    fn one_pipeline_draws_cells_and_faces_on_one_gpu() {
        if context().is_none() {
            return;
        }
        let temp = tempfile::tempdir().unwrap();
        let (mut pipeline, request) = jet(temp.path());
        let mut frame = |draw: TetDraw, backend: Backend| {
            pipeline.render(&FrameRequest { backend, ..request.clone().with_draw(draw) }).unwrap().clone()
        };
        let cells = frame(TetDraw::Raycast, Backend::Gpu);
        for _ in 0..2 {
            let faces = frame(TetDraw::ALL_FACES, Backend::Gpu);
            assert!(faces.stats.on_gpu && faces.stats.fragments > 0 && faces.stats.steps == 0);
            crate::render::assert_within("faces and cells", &faces.planes.color, &cells.planes.color);
            assert_eq!(frame(TetDraw::Raycast, Backend::Gpu).planes.color, cells.planes.color);
            assert!(!frame(TetDraw::ALL_FACES, Backend::Cpu).stats.on_gpu);
        }
    }

    #[test]
    fn a_gpu_that_is_not_there_is_refused_by_the_names_of_those_that_are() {
        let Some(context) = context() else { return };
        let temp = tempfile::tempdir().unwrap();
        let (mut pipeline, request) = jet(temp.path());
        pipeline.choose_gpu(ContextOptions { adapter: "no such adapter".to_owned(), ..Default::default() });
        for backend in [Backend::Auto, Backend::Gpu] {
            let refused = pipeline.render(&FrameRequest { backend, ..request.clone() }).unwrap_err().to_string();
            assert!(refused.contains("no such adapter") && refused.contains(&context.adapter().name), "{refused}");
        }
        assert!(pipeline.render(&FrameRequest { backend: Backend::Cpu, ..request }).is_ok());
    }
}

#[test]
fn tables_come_to_the_renderer_ready_made_and_are_changed_where_the_transfer_function_is() {
    use tetreel::optics::OpticsKind;
    use tetreel::render::{RenderJob, Renderer, cpu::raycast::Raycast};
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = jet(temp.path());
    let with_node = |at: f64, tau: f64| {
        let mut nodes = request.tets().unwrap().table.over_scalars().nodes().to_vec();
        let scalar = nodes[0].scalar + at * (nodes[nodes.len() - 1].scalar - nodes[0].scalar);
        let place = nodes.partition_point(|n| n.scalar < scalar);
        nodes[place].tau = tau;
        Arc::new(tetreel::node_table::NodeTable::new(nodes).unwrap()).into()
    };
    let looked_up = request.clone().with_tets(|tets| tets.optics = OpticsKind::Table3d);
    let mut built = |request: &FrameRequest| {
        let job = pipeline.prepare(request).unwrap();
        assert!(job.prepared.is_some(), "it is made where cells are ordered");
        let found = job.stats.table_entries_built;
        let anew = RenderJob { prepared: None, ..job.clone() };
        let [given, anew] = [job, anew].map(|job| bits(Raycast::new().render(job).unwrap()));
        assert!(given == anew, "a table that was changed is one made anew");
        found
    };
    let all = 128 * 128 * 16;
    assert_eq!(built(&looked_up), all);
    // Another step, another camera: the same table.
    assert_eq!(built(&FrameRequest { time: 1.into(), ..looked_up.clone() }), 0);
    let late = built(&looked_up.clone().with_tets(|tets| tets.table = with_node(0.9, 3.0)));
    assert!(late > 0 && late < all / 2, "{late} of {all}");
    for optics in [OpticsKind::Exact, OpticsKind::Partial] {
        assert_eq!(built(&request.clone().with_tets(|tets| tets.optics = optics)), 0);
    }
    // The count comes out with the frame, from the pipeline with stages of their own too.
    let series = Arc::new(Series::open(&Store::open(temp.path().join("jet.zarr")).unwrap(), None).unwrap());
    let pipelined = Pipelined::start(Pipeline::new(series), &PipelinedOptions::default(), || ()).unwrap();
    let entries = [looked_up.clone(), FrameRequest { time: 2.into(), ..looked_up }].map(|request| {
        pipelined.push(request).unwrap();
        pipelined.wait(LONG).unwrap().frame.unwrap().stats.table_entries_built
    });
    assert_eq!(entries, [all, 0]);
}

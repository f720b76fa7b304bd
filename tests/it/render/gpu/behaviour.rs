//! How the renderer on the GPU behaves: split buffers, retries, slices, refusals, lost devices.

use super::*;
use std::time::Duration;
use tetreel::mesh::RawMesh;
use tetreel::render::gpu::context::Tier;
use tetreel::render::gpu::layout::EYE_DISTANCE_MAX;
use tetreel::render::gpu::shaders::RecordSplit;
use tetreel::render::{Advance, RenderError};
use tetreel::task::Cancel;

/// A mesh with a hole, seen from outside.
fn scene(size: (usize, usize)) -> RenderJob {
    let mesh = Arc::new(build(grid(6, 0.16, 1, |c| c.length() > 0.4)));
    job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), size, dense())
}

/// One tet, seen from nearby: its faces fill the image.
fn one_tet(size: (usize, usize)) -> RenderJob {
    let points = [[-1.0, -1.0, -1.0], [1.0, -0.9, -0.8], [-0.8, 1.0, -0.9], [-0.9, -0.8, 1.0]];
    let points = points.map(DVec3::from_array).to_vec();
    let mesh = Arc::new(build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }));
    let camera = Camera {
        position: DVec3::new(1.4, 1.5, 1.3),
        focal_point: DVec3::splat(-0.6),
        view_up: DVec3::Z,
        projection: PERSPECTIVE,
        near: 0.0,
    };
    job(&mesh, sample(&mesh, wave), &camera, size, dense())
}

/// Three tets behind each other whose faces fill the image: twelve faces, of which three are in every tile.
fn layers(size: (usize, usize)) -> RenderJob {
    let mut raw = RawMesh::default();
    for z in [-0.5, 0.1, 0.7] {
        let first = raw.points.len() as u32;
        raw.points.extend([[-3.0, -3.0, z], [3.0, -3.0, z], [0.0, 3.0, z], [0.0, 0.0, z - 0.4]].map(DVec3::from_array));
        raw.cells.tets.push([first, first + 1, first + 2, first + 3]);
    }
    let mesh = Arc::new(build(raw));
    job(&mesh, sample(&mesh, wave), &camera(DVec3::new(0.12, 0.07, 4.0), PERSPECTIVE), size, dense())
}

fn frame_of(context: &Arc<Context>, job: &RenderJob) -> Frame {
    GpuRaycast::new(context.clone()).render(job.clone()).unwrap().clone()
}

fn assert_same_bits(name: &str, a: &Frame, b: &Frame) {
    assert!(
        a.planes.color == b.planes.color,
        "{name}: colours differ by {:?}",
        difference(&a.planes.color, &b.planes.color)
    );
    assert!(a.planes.depth == b.planes.depth, "{name}: depths differ");
    assert!(a.planes.color.pixels.iter().any(|p| p[3] > 0.0), "{name}: an empty image proves nothing");
}

#[test]
fn records_in_parts_give_the_same_image() {
    let Some(context) = context() else { return };
    let job = scene((61, 47));
    let cells = job.mesh.topology.tets.len();
    let whole = frame_of(&context, &job);
    assert_within("whole", &whole.planes.color, &raycast(&job));
    for (binding_bytes, parts) in [(1 << 15, 2), (1 << 14, 3)] {
        let options = ContextOptions { binding_bytes: Some(binding_bytes), ..Default::default() };
        let context = own_context(&options).unwrap();
        assert_eq!(RecordSplit::new(cells, context.binding_bytes()).map(|s| s.parts), Some(parts), "{cells} cells");
        let split = frame_of(&context, &job);
        assert_same_bits(&format!("{parts} parts"), &split, &whole);
        // Another mesh, in fewer parts, and back: the shaders are made for the split.
        let mut renderer = GpuRaycast::new(context);
        let small = one_tet((61, 47));
        let expected = render(&small).unwrap();
        for _ in 0..2 {
            assert_same_bits("one tet", renderer.render(small.clone()).unwrap(), &expected);
            assert_same_bits("many parts", renderer.render(job.clone()).unwrap(), &whole);
        }
    }
    // The comparison notices a cell in the wrong place.
    let mut other = job.clone();
    let mut active = (*job.active).clone();
    active.set(cells as u32 - 1, false);
    other.active = Arc::new(active);
    assert!(frame_of(&context, &other).planes.color != whole.planes.color);
}

#[test]
fn the_limits_of_webgpu_are_enough() {
    let Some(context) = context() else { return };
    let web = own_context(&ContextOptions { tier: Tier::WebGpu, ..Default::default() }).unwrap();
    assert_eq!(web.device.limits(), wgpu::Limits::default());
    let job = scene((61, 47));
    assert_same_bits("WebGPU", &frame_of(&web, &job), &frame_of(&context, &job));
}

#[test]
fn lists_that_are_too_short_are_made_longer_and_the_frame_is_begun_again() {
    let Some(context) = context() else { return };
    let job = layers((512, 512));
    let mut renderer = GpuRaycast::new(context);
    let first = renderer.render(job.clone()).unwrap().clone();
    assert!(first.stats.entry_retries > 0, "the lists were long enough: nothing tested");
    assert_within("after a retry", &first.planes.color, &raycast(&job));
    let hit = first.planes.color.pixels.iter().filter(|p| p[3] > 0.0).count();
    assert!(hit > 512 * 512 / 2, "{hit} pixels");
    let second = renderer.render(job).unwrap();
    assert_eq!(second.stats.entry_retries, 0, "the room stays");
    assert_eq!(second.stats.steps, first.stats.steps, "what the short lists had shown is not counted");
    assert_same_bits("again", second, &first);
}

#[test]
fn a_retry_between_slices_shows_nothing_twice() {
    let Some(context) = context() else { return };
    let job = layers((256, 256));
    let whole = frame_of(&context, &job);
    assert!(whole.stats.entry_retries > 0);
    let mut renderer = GpuRaycast::new(context);
    renderer.begin(job).unwrap();
    let (sliced, slices) = finish(&mut renderer, &whole);
    assert!(slices > 2 && sliced.stats.entry_retries > 0, "{slices} slices");
    assert_eq!(sliced.stats.steps, whole.stats.steps);
    assert_same_bits("slices", &sliced, &whole);
}

/// Advances in the smallest steps; every pixel on the way is transparent or final.
fn finish(renderer: &mut GpuRaycast, whole: &Frame) -> (Frame, usize) {
    let mut slices = 0;
    loop {
        slices += 1;
        match renderer.advance(Duration::ZERO).unwrap() {
            Advance::Done(frame) => return (frame.clone(), slices),
            Advance::Partial(frame) | Advance::Preview(frame, _) => {
                let pixels = frame.planes.color.pixels.iter().zip(&whole.planes.color.pixels);
                let wrong = pixels.filter(|(now, then)| now != then && **now != [0.0; 4]).count();
                assert_eq!(wrong, 0, "pixels that are neither transparent nor final, after slice {slices}");
            }
        }
    }
}

#[test]
fn slices_give_the_image_of_the_whole_frame() {
    let Some(context) = context() else { return };
    let job = scene((150, 130));
    let whole = frame_of(&context, &job);
    let mut renderer = GpuRaycast::new(context);
    for _ in 0..2 {
        renderer.begin(job.clone()).unwrap();
        let (sliced, slices) = finish(&mut renderer, &whole);
        assert!(slices > 2, "the job fits {slices} slices: nothing tested");
        assert_same_bits("slices", &sliced, &whole);
        let counts = |f: &Frame| (f.stats.steps, f.stats.entries, f.stats.segments, f.stats.rays_hit);
        assert_eq!(counts(&sliced), counts(&whole));
    }
}

#[test]
fn steady_frames_make_no_resources() {
    let Some(context) = own_context(&ContextOptions::default()) else { return };
    let base = scene((64, 48));
    let mut renderer = GpuRaycast::new(context.clone());
    let frame = |i: usize| {
        let angle = 0.3 * i as f64;
        let camera = camera(DVec3::new(5.0 * angle.cos(), 5.0 * angle.sin(), 2.0), PERSPECTIVE);
        let scalars = sample(&base.mesh, |p| wave(p + DVec3::splat(0.05 * i as f64)));
        let table = NodeTable::new(
            base.table.nodes().iter().map(|n| Node { tau: n.tau * (1.0 + 0.1 * i as f64), ..*n }).collect(),
        );
        RenderJob {
            view: camera.view(64, 48).unwrap(),
            scalars: Arc::new(scalars).into(),
            table: Arc::new(table.unwrap()),
            ..base.clone()
        }
    };
    // One slice after another uses all buffers of the ring.
    renderer.begin(frame(0)).unwrap();
    while let Advance::Partial(_) = renderer.advance(Duration::ZERO).unwrap() {}
    renderer.render(frame(0)).unwrap();
    let before = context.resources_created();
    assert!(before > 10);
    for i in 1..=10 {
        let shown = renderer.render(frame(i)).unwrap().clone();
        assert_within(&format!("frame {i}"), &shown.planes.color, &raycast(&frame(i)));
        assert_eq!(shown.stats.entry_retries, 0);
        assert!(shown.stats.bytes_uploaded >= 4 * base.scalars.values().len() as u64, "the scalars are new");
        assert!(shown.stats.bytes_uploaded < 4096 + 4 * base.scalars.values().len() as u64, "and the mesh is not");
    }
    assert_eq!(context.resources_created(), before);
    // The counter notices a larger image.
    renderer.render(scene((80, 48))).unwrap();
    assert!(context.resources_created() > before);
}

#[test]
fn times_of_the_stages_are_there_if_the_adapter_has_timestamps() {
    let Some(context) = context() else { return };
    let without = own_context(&ContextOptions { no_timestamps: true, ..Default::default() }).unwrap();
    assert_eq!(without.timestamp_period_ns(), None);
    let job = scene((40, 30));
    for context in [context, without] {
        let frame = frame_of(&context, &job);
        let expected = context.timestamp_period_ns().is_some();
        for time in [frame.stats.ms_gpu_transform, frame.stats.ms_gpu_entries, frame.stats.ms_gpu_walk] {
            assert_eq!(time.is_some(), expected);
            assert!(time.is_none_or(|ms| ms.is_finite() && ms >= 0.0), "{time:?}");
        }
    }
}

/// The job is refused with the adapter's name and a reason that has `reason` in it, and the next job is rendered.
fn assert_refused(renderer: &mut GpuRaycast, job: RenderJob, reason: &str, next: &RenderJob) {
    let name = renderer.context().adapter().name.clone();
    match renderer.render(job) {
        Err(RenderError::BeyondGpu { adapter, problem }) => {
            assert_eq!(adapter, name);
            assert!(problem.contains(reason), "{problem}");
        }
        other => panic!("{reason}: {:?}", other.map(|f| f.stats.clone())),
    }
    assert_within("the next job", &renderer.render(next.clone()).unwrap().planes.color, &raycast(next));
}

#[test]
fn jobs_beyond_the_gpu_are_refused_and_the_next_is_rendered() {
    let Some(context) = own_context(&ContextOptions { tier: Tier::WebGpu, ..Default::default() }) else { return };
    let most = context.device.limits().max_texture_dimension_2d as usize;
    let mut renderer = GpuRaycast::new(context);
    let next = scene((40, 30));
    for size in [(most + 1, 1), (1, most + 1)] {
        assert_refused(&mut renderer, scene(size), &format!("at most {most} pixels"), &next);
    }
    let mut far = next.clone();
    far.view.eye = far.mesh.positions.scale * (EYE_DISTANCE_MAX + 2.0) * DVec3::X;
    assert_refused(&mut renderer, far, "too far", &next);
    // What the job itself lacks is said as on the CPU.
    let short = RenderJob { scalars: Arc::new(vec![0.0; 3]).into(), ..next.clone() };
    assert!(matches!(renderer.render(short), Err(RenderError::ScalarCount { .. })));
    assert_within("after all", &renderer.render(next.clone()).unwrap().planes.color, &raycast(&next));
}

#[test]
fn a_mesh_or_lists_beyond_a_binding_are_refused_and_the_next_is_rendered() {
    let options = ContextOptions { binding_bytes: Some(2048), ..Default::default() };
    let Some(context) = own_context(&options) else { return };
    assert_eq!(context.binding_bytes(), 2048);
    let mut renderer = GpuRaycast::new(context);
    let next = one_tet((16, 16));
    // 64 cells a binding, three bindings.
    assert_refused(&mut renderer, scene((16, 16)), "cells is too large", &next);
    // Lists for 16 tiles fit, for 256 they do not: some sizes fail at once, others after a retry.
    for size in [(64, 64), (128, 128), (208, 208), (512, 512)] {
        let job = one_tet(size);
        match renderer.render(job.clone()) {
            Ok(frame) => assert_within(&format!("{size:?}"), &frame.planes.color, &raycast(&job)),
            Err(RenderError::BeyondGpu { problem, .. }) => {
                assert!(problem.contains("lists of entries") || problem.contains("counters"), "{problem}");
            }
            Err(other) => panic!("{other}"),
        }
        assert_within("next", &renderer.render(next.clone()).unwrap().planes.color, &raycast(&next));
    }
}

#[test]
fn a_mesh_that_fits_in_part_leaves_nothing_behind() {
    // Positions and scalars of the large mesh fit a binding, at 12 and 4 bytes a vertex; view vertices at 32 do not. What has
    // been made anew until then must be what the next job binds, though it needs nothing larger than the first.
    let options = ContextOptions { binding_bytes: Some(2048), ..Default::default() };
    let Some(context) = own_context(&options) else { return };
    let mut renderer = GpuRaycast::new(context);
    let first = one_tet((16, 16));
    assert_within("first", &renderer.render(first.clone()).unwrap().planes.color, &raycast(&first));
    let mut raw = RawMesh::default();
    for i in 0..20 {
        let vertex = raw.points.len() as u32;
        raw.points.extend([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| 0.5 * p + f64::from(i)));
        raw.cells.tets.push([vertex, vertex + 1, vertex + 2, vertex + 3]);
    }
    let mesh = Arc::new(build(raw));
    let too_large = job(&mesh, sample(&mesh, wave), &camera(DVec3::X, PERSPECTIVE), (16, 16), dense());
    let points = (0..4).map(|v| DVec3::new(1.0, -1.0, 0.8) * first.mesh.positions.world(v)).collect();
    let mesh = Arc::new(build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }));
    let next = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(2.0, -3.0, 2.0), PERSPECTIVE), (16, 16), dense());
    assert!(difference(&raycast(&next), &raycast(&first)).1 > 1e-2);
    assert_refused(&mut renderer, too_large, "view vertices", &next);
}

/// The device is lost while a frame is under way, or before; every later call says so.
#[test]
fn a_lost_device_is_an_error_and_a_new_one_works() {
    for slices_before in [None, Some(0), Some(1), Some(2)] {
        let Some(context) = own_context(&ContextOptions::default()) else { return };
        let job = scene((200, 180));
        let mut renderer = GpuRaycast::new(context.clone());
        let name = context.adapter().name.clone();
        let is_lost = |result: Result<(), RenderError>| match result {
            Err(RenderError::DeviceLost { adapter, .. }) => assert_eq!(adapter, name, "{slices_before:?}"),
            other => panic!("lost after {slices_before:?} slices: {other:?}"),
        };
        match slices_before {
            None => {
                context.lose();
                is_lost(renderer.begin(job.clone()));
            }
            Some(slices) => {
                renderer.begin(job.clone()).unwrap();
                for _ in 0..slices {
                    assert!(matches!(renderer.advance(Duration::ZERO), Ok(Advance::Partial(_))));
                }
                context.lose();
                is_lost(renderer.advance(Duration::MAX).map(|_| ()));
            }
        }
        is_lost(renderer.begin(job.clone()));
        is_lost(context.check());
        let again = own_context(&ContextOptions::default()).unwrap();
        assert_within("a new device", &frame_of(&again, &job).planes.color, &raycast(&job));
    }
}

#[test]
fn a_dropped_job_leaves_nothing_for_the_next() {
    let Some(context) = context() else { return };
    let (first, second) = (scene((150, 130)), one_tet((70, 50)));
    let expected = frame_of(&context, &second);
    let mut renderer = GpuRaycast::new(context);
    for slices in 0..3 {
        renderer.begin(first.clone()).unwrap();
        for _ in 0..slices {
            assert!(matches!(renderer.advance(Duration::ZERO).unwrap(), Advance::Partial(_)));
        }
        assert_same_bits("after a dropped job", renderer.render(second.clone()).unwrap(), &expected);
    }
    let cancel = Cancel::new();
    cancel.cancel();
    assert!(renderer.render_unless_cancelled(RenderJob { cancel, ..first }).unwrap().is_none());
    assert_same_bits("after a cancelled job", renderer.render(second).unwrap(), &expected);
}

#[test]
fn a_renderer_used_again_keeps_nothing_of_the_jobs_before() {
    let Some(context) = context() else { return };
    let mut jobs = vec![one_tet((33, 40)), scene((40, 33))];
    let base = jobs[1].clone();
    let mut some = (*base.active).clone();
    (0..some.universe() as u32).step_by(3).for_each(|cell| some.set(cell, false));
    jobs.push(RenderJob { active: Arc::new(some), ..base.clone() });
    jobs.push(RenderJob { table: Arc::new(table(&[(0.0, [1.0; 3], 0.0)])), ..base.clone() });
    jobs.push(RenderJob { scalars: Arc::new(vec![0.3; base.scalars.values().len()]).into(), ..base.clone() });
    jobs.push(RenderJob { optics: tetreel::optics::OpticsKind::Table3d, ..base });
    let fresh: Vec<_> = jobs.iter().map(|job| frame_of(&context, job)).collect();
    let mut renderer = GpuRaycast::new(context);
    // Every job after every other one, itself included.
    for first in &jobs {
        for (second, expected) in jobs.iter().zip(&fresh) {
            renderer.render(first.clone()).unwrap();
            let again = renderer.render(second.clone()).unwrap();
            assert!(again.planes == expected.planes);
            assert_eq!(
                (again.stats.entry_faces, again.stats.steps),
                (expected.stats.entry_faces, expected.stats.steps)
            );
        }
    }
}

#[test]
fn an_adapter_of_no_such_name_is_refused_with_the_names_of_those_there_are() {
    let Some(context) = context() else { return };
    let options = ContextOptions { adapter: "no such adapter".to_owned(), ..Default::default() };
    match Context::new(&options) {
        Err(RenderError::NoGpu(why)) => {
            assert!(why.contains("no such adapter") && why.contains(&context.adapter().name), "{why}");
        }
        other => panic!("{:?}", other.map(|c| c.adapter().clone())),
    }
    let by_name = ContextOptions { adapter: context.adapter().name.to_uppercase(), ..Default::default() };
    assert_eq!(Context::new(&by_name).unwrap().adapter(), context.adapter());
}

//! How the face renderer on the GPU behaves: bands, slices, steady frames, refusals, lost devices.

use super::*;
use crate::meshes::{build, grid, sample};
use crate::render::gpu::{context, own_context};
use std::time::Duration;
use tetreel::mesh::RawMesh;
use tetreel::optics::OpticsKind;
use tetreel::render::gpu::context::{Context, ContextOptions, Tier};
use tetreel::render::gpu::havs::Havs as GpuHavs;
use tetreel::render::gpu::layout::{EYE_DISTANCE_MAX, FRAGMENT_BYTES};
use tetreel::render::{Advance, Frame, RenderError};
use tetreel::task::Cancel;
use tetreel::visibility::Skip;

const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };

/// A mesh with a hole, seen from outside.
fn base(size: (usize, usize)) -> RenderJob {
    let mesh = Arc::new(build(grid(6, 0.16, 1, |c| c.length() > 0.4)));
    job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), size, dense())
}

fn scene(size: (usize, usize)) -> RenderJob {
    with_all_faces(&base(size))
}

/// One tet, seen from nearby: its faces fill the image.
fn one_tet(size: (usize, usize)) -> RenderJob {
    let points = [[-1.0, -1.0, -1.0], [1.0, -0.9, -0.8], [-0.8, 1.0, -0.9], [-0.9, -0.8, 1.0]];
    let points = points.map(DVec3::from_array).to_vec();
    let mesh = Arc::new(build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }));
    let focal_point = DVec3::splat(-0.6);
    let camera = Camera { focal_point, ..camera(DVec3::new(1.4, 1.5, 1.3), PERSPECTIVE) };
    with_all_faces(&job(&mesh, sample(&mesh, wave), &camera, size, dense()))
}

fn frame_of(context: &Arc<Context>, job: &RenderJob) -> Frame {
    GpuHavs::new(context.clone()).render(job.clone()).unwrap().clone()
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

fn counts(frame: &Frame) -> [u64; 5] {
    let s = &frame.stats;
    [s.fragments, s.segments, s.rays_hit, s.rays_stopped_early, s.out_of_order]
}

#[test]
fn many_bands_give_the_bits_of_one() {
    let Some(context) = context() else { return };
    for (kind, job) in [
        ("complete", scene((70, 50))),
        ("level of detail", with_some_faces(&base((70, 50)), 0.3, 1)),
        ("small buffer", with_buffer(&scene((70, 50)), 2, false)),
        ("large faces", one_tet((150, 90))),
    ] {
        let mut whole = GpuHavs::new(context.clone());
        let expected = whole.render(job.clone()).unwrap().clone();
        assert_eq!(whole.band_count(), 1);
        for fragments in [40_000, 5_000, 700, 60] {
            let mut banded = GpuHavs::with_fragment_bytes(context.clone(), fragments * FRAGMENT_BYTES);
            for _ in 0..2 {
                let frame = banded.render(job.clone()).unwrap().clone();
                let name = format!("{kind}, {fragments} fragments at a time");
                assert_same_bits(&name, &frame, &expected);
                assert_eq!(counts(&frame), counts(&expected), "{name}");
            }
            // As many as there must be, and more than tiles where a tile does not fit.
            let least = expected.stats.fragments.div_ceil(fragments) as usize;
            assert!(banded.band_count() >= least, "{kind}: {} bands", banded.band_count());
        }
    }
}

#[test]
fn a_pixel_with_more_fragments_than_there_is_memory_for_is_refused() {
    let Some(context) = context() else { return };
    let mut renderer = GpuHavs::with_fragment_bytes(context, 8 * FRAGMENT_BYTES);
    match renderer.render(scene((40, 30))) {
        Err(RenderError::BeyondGpu { problem, .. }) => assert!(problem.contains("fragments"), "{problem}"),
        other => panic!("{:?}", other.map(|f| f.stats.clone())),
    }
    // One tet has two for each pixel.
    let next = one_tet((40, 30));
    assert_within("the next job", &renderer.render(next.clone()).unwrap().planes.color, &raycast(&next));
}

#[test]
fn the_same_image_comes_twice_bit_for_bit() {
    let Some(context) = context() else { return };
    for job in [scene((70, 50)), with_some_faces(&base((70, 50)), 0.4, 1), with_buffer(&scene((70, 50)), 2, false)] {
        let first = frame_of(&context, &job);
        for _ in 0..3 {
            let again = frame_of(&context, &job);
            assert_same_bits("again", &again, &first);
            assert_eq!(counts(&again), counts(&first));
        }
    }
}

#[test]
fn small_bindings_and_the_limits_of_webgpu_give_the_same_image() {
    let Some(context) = context() else { return };
    let job = scene((61, 47));
    let expected = frame_of(&context, &job);
    let web = own_context(&ContextOptions { tier: Tier::WebGpu, ..Default::default() }).unwrap();
    assert_eq!(web.device.limits(), wgpu::Limits::default());
    assert_same_bits("WebGPU", &frame_of(&web, &job), &expected);
    // Faces take three bindings, fragments two.
    let faces = job.mesh.topology.connectivity().faces.len() as u64;
    let options = ContextOptions { binding_bytes: Some(20 * faces / 2 - 1), ..Default::default() };
    let small = own_context(&options).unwrap();
    let mut renderer = GpuHavs::new(small);
    assert_same_bits("three parts", renderer.render(job.clone()).unwrap(), &expected);
    assert!(renderer.band_count() > 1, "fragments fit one band: nothing proved");
    let options = ContextOptions { binding_bytes: Some(20 * faces / 4), ..Default::default() };
    match GpuHavs::new(own_context(&options).unwrap()).render(job) {
        Err(RenderError::BeyondGpu { problem, .. }) => assert!(problem.contains("faces is too large"), "{problem}"),
        other => panic!("{:?}", other.map(|f| f.stats.clone())),
    }
}

#[test]
fn pieces_that_find_no_room_are_given_room_and_the_frame_is_begun_again() {
    let Some(context) = context() else { return };
    // Triangles behind each other that fill the image: more than a few in each tile.
    let mut raw = RawMesh::default();
    for i in 0..8 {
        let (first, z) = (raw.points.len() as u32, -0.9 + 0.2 * f64::from(i));
        raw.points.extend([[-3.0, -3.0, z], [3.0, -3.0, z], [0.0, 3.0, z], [0.0, 0.0, z - 0.1]].map(DVec3::from_array));
        raw.cells.tets.push([first, first + 1, first + 2, first + 3]);
    }
    let mesh = Arc::new(build(raw));
    let eye = camera(DVec3::new(0.12, 0.07, 4.0), PERSPECTIVE);
    let job = with_all_faces(&job(&mesh, sample(&mesh, wave), &eye, (200, 180), dense()));
    let mut renderer = GpuHavs::new(context);
    let first = renderer.render(job.clone()).unwrap().clone();
    assert!(first.stats.entry_retries > 0, "there was room: nothing tested");
    assert_within("after a retry", &first.planes.color, &raycast(&job));
    let second = renderer.render(job).unwrap();
    assert_eq!(second.stats.entry_retries, 0, "the room stays");
    assert_same_bits("again", second, &first);
    assert_eq!(counts(second), counts(&first));
}

/// Advances in the smallest steps; every pixel on the way is transparent or final.
fn finish(renderer: &mut GpuHavs, whole: &Frame) -> (Frame, usize) {
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
    let job = scene((110, 90));
    let whole = frame_of(&context, &job);
    // Bands of many tiles, of one, and of parts of one.
    for bytes in [1 << 28, 6_000 * FRAGMENT_BYTES, 1_500 * FRAGMENT_BYTES] {
        let mut renderer = GpuHavs::with_fragment_bytes(context.clone(), bytes);
        for _ in 0..2 {
            renderer.begin(job.clone()).unwrap();
            let (sliced, slices) = finish(&mut renderer, &whole);
            assert!(slices > 3, "the job fits {slices} slices: nothing tested");
            assert_same_bits("slices", &sliced, &whole);
            assert_eq!(counts(&sliced), counts(&whole));
        }
    }
}

#[test]
fn steady_frames_make_no_resources() {
    let Some(context) = own_context(&ContextOptions::default()) else { return };
    let base = base((64, 48));
    let mut renderer = GpuHavs::new(context.clone());
    let frame = |i: usize| {
        let angle = 0.3 * i as f64;
        let camera = camera(DVec3::new(5.0 * angle.cos(), 5.0 * angle.sin(), 2.0), PERSPECTIVE);
        let scalars = sample(&base.mesh, |p| wave(p + DVec3::splat(0.05 * i as f64)));
        let nodes = base.table.nodes().iter().map(|n| Node { tau: n.tau * (1.0 + 0.1 * i as f64), ..*n }).collect();
        with_all_faces(&RenderJob {
            view: camera.view(64, 48).unwrap(),
            scalars: Arc::new(scalars).into(),
            table: Arc::new(NodeTable::new(nodes).unwrap()),
            ..base.clone()
        })
    };
    // One slice after another uses all buffers of the ring.
    renderer.begin(frame(0)).unwrap();
    while let Advance::Partial(_) = renderer.advance(Duration::ZERO).unwrap() {}
    renderer.render(frame(0)).unwrap();
    let before = context.resources_created();
    assert!(before > 10);
    for i in 1..=10 {
        let job = frame(i);
        let shown = renderer.render(job.clone()).unwrap().clone();
        assert_within(&format!("frame {i}"), &shown.planes.color, &raycast(&job));
        let new = 4 * (base.scalars.values().len() + job.faces.as_ref().unwrap().ids.len()) as u64;
        assert!(shown.stats.bytes_uploaded >= new, "scalars and order are new");
        assert!(shown.stats.bytes_uploaded < 4096 + new, "and the mesh is not");
    }
    assert_eq!(context.resources_created(), before);
    // The counter notices a larger image.
    renderer.render(scene((80, 48))).unwrap();
    assert!(context.resources_created() > before);
}

#[test]
fn an_order_that_did_not_change_is_not_sent_again() {
    let Some(context) = context() else { return };
    let job = scene((40, 30));
    let mut renderer = GpuHavs::new(context);
    let first = renderer.render(job.clone()).unwrap().stats.bytes_uploaded;
    let second = renderer.render(job).unwrap().stats.bytes_uploaded;
    assert!(first > 50_000 && second < 100, "{first} and {second} bytes");
}

#[test]
fn jobs_without_faces_or_with_wrong_ones_are_refused_as_on_the_cpu() {
    let Some(context) = context() else { return };
    let good = scene((8, 8));
    let mut renderer = GpuHavs::new(context);
    let faces = |faces: Vec<u32>| Some(Arc::new(Drawn { ids: faces, is_complete: false }));
    for bad in [
        RenderJob { faces: None, ..good.clone() },
        RenderJob { faces: faces(vec![0, 10_000_000]), ..good.clone() },
        with_buffer(&good, 1, true),
        with_buffer(&good, 33, true),
        RenderJob { scalars: Arc::new(vec![0.0; 3]).into(), ..good.clone() },
    ] {
        let expected = Havs::new().render(bad.clone()).map(|_| ()).unwrap_err();
        assert_eq!(renderer.render(bad).map(|_| ()).unwrap_err(), expected);
    }
    let mut far = good.clone();
    far.view.eye = far.mesh.positions.scale * (EYE_DISTANCE_MAX + 2.0) * DVec3::X;
    match renderer.render(far) {
        Err(RenderError::BeyondGpu { problem, .. }) => assert!(problem.contains("too far"), "{problem}"),
        other => panic!("{:?}", other.map(|f| f.stats.clone())),
    }
    assert_within("after all", &renderer.render(good.clone()).unwrap().planes.color, &raycast(&good));
}

#[test]
fn an_empty_view_and_a_transparent_table_give_an_empty_image() {
    let Some(context) = context() else { return };
    let base = scene((33, 20));
    let look_away = Camera { focal_point: DVec3::splat(9.0), ..camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE) };
    let mut renderer = GpuHavs::new(context);
    for empty in [
        RenderJob { view: look_away.view(33, 20).unwrap(), ..base.clone() },
        RenderJob { table: Arc::new(table(&[(0.0, [1.0; 3], 0.0)])), ..base.clone() },
        RenderJob { faces: Some(Arc::new(Drawn::default())), ..base.clone() },
    ] {
        assert!(renderer.render(base.clone()).unwrap().stats.fragments > 0);
        let frame = renderer.render(empty).unwrap();
        assert_eq!(frame.stats.fragments, 0);
        assert!(frame.planes.color.pixels.iter().flatten().all(|&v| v == 0.0));
        assert!(frame.planes.depth.pixels.iter().all(|&d| d == f32::INFINITY));
    }
}

#[test]
fn opaque_rays_stop_early_and_change_nothing_visible() {
    let Some(context) = context() else { return };
    let mesh = Arc::new(build(grid(12, 0.16, 1, |_| true)));
    let opaque = table(&[(-1.5, [0.2, 0.2, 1.0], 60.0), (1.5, [1.0, 0.2, 0.1], 90.0)]);
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (64, 64), opaque);
    for job in [with_all_faces(&job), with_some_faces(&job, 0.5, 1)] {
        let early = frame_of(&context, &job);
        let full = frame_of(&context, &RenderJob { skip: Skip { opaque: false, ..Skip::ALL }, ..job });
        assert!(early.stats.rays_stopped_early > 1000 && full.stats.rays_stopped_early == 0);
        assert_eq!(difference(&early.planes.color, &full.planes.color).1, 0.0);
    }
}

#[test]
fn a_renderer_used_again_keeps_nothing_of_the_jobs_before() {
    let Some(context) = context() else { return };
    let base = base((40, 33));
    let mut some = (*base.active).clone();
    (0..some.universe() as u32).step_by(3).for_each(|cell| some.set(cell, false));
    let fewer = RenderJob { active: Arc::new(some), ..base.clone() };
    let inside = camera(DVec3::new(0.5, 0.3, 0.4), Projection::Perspective { view_angle: 100.0 });
    let jobs = [
        one_tet((33, 40)),
        with_all_faces(&base),
        with_some_faces(&base, 0.3, 1),
        with_buffer(&with_all_faces(&base), 2, false),
        with_all_faces(&fewer),
        with_all_faces(&RenderJob { view: inside.view(40, 33).unwrap(), ..base.clone() }),
        RenderJob { optics: OpticsKind::Table3d, ..with_all_faces(&base) },
    ];
    let fresh: Vec<_> = jobs.iter().map(|job| frame_of(&context, job)).collect();
    let mut renderer = GpuHavs::new(context);
    for first in &jobs {
        for (second, expected) in jobs.iter().zip(&fresh) {
            renderer.render(first.clone()).unwrap();
            let again = renderer.render(second.clone()).unwrap();
            assert!(again.planes == expected.planes);
            assert_eq!(counts(again), counts(expected));
        }
    }
}

#[test]
fn a_dropped_or_cancelled_job_leaves_nothing_for_the_next() {
    let Some(context) = context() else { return };
    let (first, second) = (scene((150, 130)), one_tet((70, 50)));
    let expected = frame_of(&context, &second);
    let mut renderer = GpuHavs::new(context);
    for slices in 0..8 {
        renderer.begin(first.clone()).unwrap();
        for _ in 0..slices {
            assert!(matches!(renderer.advance(Duration::ZERO).unwrap(), Advance::Partial(_)));
        }
        assert_same_bits("after a dropped job", renderer.render(second.clone()).unwrap(), &expected);
    }
    let cancel = Cancel::new();
    let cancelled = RenderJob { cancel: cancel.clone(), ..first };
    renderer.begin(cancelled.clone()).unwrap();
    renderer.advance(Duration::ZERO).unwrap();
    cancel.cancel();
    assert!(matches!(renderer.advance(Duration::MAX).unwrap(), Advance::Partial(_)));
    assert!(renderer.render_unless_cancelled(cancelled).unwrap().is_none());
    assert_same_bits("after a cancelled job", renderer.render(second).unwrap(), &expected);
}

#[test]
fn a_lost_device_is_an_error_and_a_new_one_works() {
    for slices_before in [None, Some(0), Some(2), Some(5)] {
        let Some(context) = own_context(&ContextOptions::default()) else { return };
        let job = scene((200, 180));
        let mut renderer = GpuHavs::new(context.clone());
        let is_lost = |result: Result<(), RenderError>| match result {
            Err(RenderError::DeviceLost { .. }) => {}
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
        let again = own_context(&ContextOptions::default()).unwrap();
        assert_within("a new device", &frame_of(&again, &job).planes.color, &raycast(&job));
    }
}

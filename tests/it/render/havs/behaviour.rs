//! What the face renderer does beside its image.

use super::*;
use crate::meshes::{build, grid, sample};
use std::time::Duration;
use tetreel::mesh::RawMesh;
use tetreel::optics::OpticsKind;
use tetreel::render::{Advance, Frame};
use tetreel::task::ThreadLimit;
use tetreel::visibility::Skip;

const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };

fn scene(size: (usize, usize)) -> RenderJob {
    let mesh = Arc::new(build(grid(8, 0.16, 1, |c| c.length() > 0.4)));
    with_all_faces(&job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), size, dense()))
}

#[test]
fn slices_and_threads_do_not_change_the_image_or_the_counts() {
    for job in [scene((70, 50)), with_some_faces(&scene((70, 50)), 0.4, 1)] {
        let whole = havs(&job);
        let mut sliced = Havs::new();
        sliced.begin(job.clone()).unwrap();
        let mut slices = 0;
        let frame = loop {
            slices += 1;
            match sliced.advance(Duration::ZERO).unwrap() {
                Advance::Partial(frame) | Advance::Preview(frame, _) => {
                    assert_eq!(frame.planes.color.pixels.len(), 70 * 50)
                }
                Advance::Done(frame) => break frame.clone(),
            }
        };
        assert!(slices > 1, "the job fits a slice: nothing tested");
        let same = |frame: &Frame| {
            assert_same("slices and threads", &frame.planes.color, &whole.planes.color);
            assert_eq!(frame.planes.depth, whole.planes.depth);
            let counts = |f: &Frame| (f.stats.fragments, f.stats.out_of_order, f.stats.segments, f.stats.rays_hit);
            assert_eq!(counts(frame), counts(&whole));
        };
        same(&frame);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            same(&pool.install(|| havs(&job)));
        }
    }
}

#[test]
fn the_order_of_the_tiles_does_not_change_the_image_or_the_counts() {
    let job = scene((90, 70));
    let row_by_row = RenderJob { skip: Skip { costly_first: false, ..Skip::ALL }, ..job.clone() };
    let expected = havs(&row_by_row);
    let mut renderer = Havs::new();
    // From the middle, by cost, row by row, and again by cost.
    for job in [&job, &job, &row_by_row, &job] {
        let frame = renderer.render(job.clone()).unwrap();
        assert_same("tiles in another order", &frame.planes.color, &expected.planes.color);
        assert_eq!(frame.planes.depth, expected.planes.depth);
        assert_eq!(frame.stats.fragments, expected.stats.fragments);
    }
}

#[test]
fn the_version_for_newer_processors_draws_the_same_bits() {
    let job = scene((70, 50));
    assert_same("portable", &havs(&job).planes.color, &Havs::portable().render(job).unwrap().planes.color);
}

#[test]
fn a_list_of_several_chunks_is_drawn_in_its_order() {
    // More faces than two chunks have, in every order that a list can come in wrong: the buffer's mistakes show the order.
    let mesh = Arc::new(build(grid(15, 0.16, 1, |_| true)));
    let base = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (40, 40), dense());
    let all = with_all_faces(&base);
    let mut faces = (**all.faces.as_ref().unwrap()).clone();
    assert!(faces.ids.len() > 2 * 16 * 1024);
    assert_within("front to back", &havs(&all).planes.color, &raycast(&base));
    faces.ids.reverse();
    let reversed = RenderJob { faces: Some(Arc::new(faces)), ..all.clone() };
    let frame = havs(&reversed);
    assert_within("back to front", &frame.planes.color, &raycast(&base));
    assert_eq!((frame.stats.out_of_order, frame.stats.pixels_resolved_again), (0, 0));
    // From the back, in a buffer: every fragment but the first k is nearer than those that left.
    let frame = havs(&with_buffer(&reversed, 8, false));
    assert!(frame.stats.out_of_order > frame.stats.fragments / 2);
    assert!(difference(&frame.planes.color, &raycast(&base)).1 > 0.1);
}

#[test]
fn opaque_rays_stop_early_and_change_nothing_visible() {
    let mesh = Arc::new(build(grid(24, 0.16, 1, |_| true)));
    let opaque = table(&[(-1.5, [0.2, 0.2, 1.0], 60.0), (1.5, [1.0, 0.2, 0.1], 90.0)]);
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (128, 128), opaque);
    for (job, share) in [(with_all_faces(&job), 0.9), (with_some_faces(&job, 0.5, 1), 1.0)] {
        let early = havs(&job);
        let full = havs(&RenderJob { skip: Skip { opaque: false, ..Skip::ALL }, ..job });
        assert!(early.stats.rays_stopped_early > 5000 && full.stats.rays_stopped_early == 0);
        // Whole tiles are left; with few faces not much sooner than their lists end.
        let (some, all) = (early.stats.fragments, full.stats.fragments);
        assert!((some as f64) < share * all as f64, "{some} of {all} fragments");
        assert!(early.stats.faces_hidden > 0 && full.stats.faces_hidden == 0);
        assert_same("stopped early", &early.planes.color, &full.planes.color);
    }
}

#[test]
fn beside_rays_that_meet_nothing_faces_behind_opaque_pixels_are_left_out() {
    let mesh = Arc::new(build(grid(24, 0.16, 1, |_| true)));
    let opaque = table(&[(-1.5, [0.2, 0.2, 1.0], 60.0), (1.5, [1.0, 0.2, 0.1], 90.0)]);
    // One tile, with the whole mesh and what is around it.
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (16, 16), opaque);
    let early = havs(&with_all_faces(&job));
    let full = havs(&RenderJob { skip: Skip { opaque: false, ..Skip::ALL }, ..with_all_faces(&job) });
    assert!(full.stats.rays_hit < 256);
    let (some, all) = (early.stats.fragments, full.stats.fragments);
    assert!(some < all / 2, "{some} of {all} fragments");
    assert_same("stopped early", &early.planes.color, &full.planes.color);
}

#[test]
fn a_near_part_behind_in_the_list_is_not_lost_when_rays_are_opaque() {
    // A large tet in front whose centroid lies far behind, after all of the small opaque ones.
    let mut raw = grid(20, 0.0, 1, |_| true);
    let first = raw.points.len() as u32;
    for p in [DVec3::new(-1.5, -1.5, 2.0), DVec3::new(1.5, -1.5, 2.0), DVec3::new(0.0, 1.5, 2.0)] {
        raw.points.push(p);
    }
    raw.points.push(DVec3::new(40.0, 0.0, -90.0));
    raw.cells.tets.push([first, first + 1, first + 2, first + 3]);
    let (mesh, _) = Mesh::build(raw).unwrap();
    let scalars = mesh.vertex_source.iter().map(|&v| if v < first { 0.0 } else { 1.0 }).collect();
    let opaque = table(&[(0.0, [0.2, 0.2, 1.0], 60.0), (1.0, [1.0, 0.2, 0.1], 3.0)]);
    let mesh = Arc::new(mesh);
    let base = job(&mesh, scalars, &camera(DVec3::new(0.1, 0.2, 6.0), PERSPECTIVE), (64, 64), opaque);
    let frame = havs(&with_all_faces(&base));
    assert_within("a large part in front", &frame.planes.color, &raycast(&base));
    let in_buffers = havs(&with_buffer(&with_all_faces(&base), 8, false));
    assert_noticed("the same in buffers", &in_buffers.planes.color, &raycast(&base));
}

#[test]
fn the_face_renderer_waits_for_its_turn_and_stops_when_cancelled() {
    let job = scene((48, 40));
    let alone = havs(&job).planes.color;
    let limit = ThreadLimit::none();
    limit.set(Some(1));
    let limited = RenderJob { thread_limit: limit.clone(), ..job.clone() };
    let turn = limit.turn();
    let (tell, told) = std::sync::mpsc::channel();
    let rendering = std::thread::spawn(move || {
        let color = havs(&limited).planes.color;
        tell.send(()).unwrap();
        color
    });
    assert!(told.recv_timeout(Duration::from_millis(100)).is_err());
    drop(turn);
    assert_same("a turn later", &rendering.join().unwrap(), &alone);
    let mut renderer = Havs::new();
    renderer.begin(job.clone()).unwrap();
    renderer.advance(Duration::ZERO).unwrap();
    job.cancel.cancel();
    assert!(matches!(renderer.advance(Duration::MAX).unwrap(), Advance::Partial(_)));
    assert!(renderer.render_unless_cancelled(job).unwrap().is_none());
}

#[test]
fn an_empty_view_and_a_transparent_table_cost_no_fragments() {
    let base = scene((16, 16));
    let look_away = Camera { focal_point: DVec3::splat(9.0), ..camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE) };
    let away = RenderJob { view: look_away.view(16, 16).unwrap(), ..base.clone() };
    let transparent = RenderJob { table: Arc::new(table(&[(0.0, [1.0; 3], 0.0)])), ..base.clone() };
    let mut renderer = Havs::new();
    for job in [away, transparent] {
        let frame = renderer.render(job).unwrap();
        assert_eq!(frame.stats.fragments, 0);
        assert!(frame.planes.color.pixels.iter().flatten().all(|&v| v == 0.0));
    }
    assert!(renderer.render(base).unwrap().stats.fragments > 0);
}

#[test]
fn jobs_without_faces_or_with_wrong_ones_are_refused() {
    let good = scene((8, 8));
    let refused = |job: RenderJob| Havs::new().render(job).unwrap_err().to_string();
    assert!(refused(RenderJob { faces: None, ..good.clone() }).contains("no faces"));
    let faces = Drawn { ids: vec![0, 10_000_000], is_complete: false };
    assert!(refused(RenderJob { faces: Some(Arc::new(faces)), ..good.clone() }).contains("face 10000000"));
    assert!(refused(with_buffer(&good, 1, true)).contains("2 to 32"));
    assert!(refused(with_buffer(&good, 33, true)).contains("2 to 32"));
    assert!(refused(RenderJob { scalars: Arc::new(vec![0.0; 3]).into(), ..good }).contains("3 scalars"));
}

#[test]
fn a_renderer_used_again_keeps_nothing_of_the_jobs_before() {
    let mut jobs = Vec::new();
    for (i, raw) in [grid(5, 0.16, 1, |_| true), grid(4, 0.16, 2, |c| c.length() > 0.4)].into_iter().enumerate() {
        let mesh = Arc::new(build(raw));
        let camera = camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE);
        let base = job(&mesh, sample(&mesh, wave), &camera, (40 - i, 33), dense());
        jobs.extend([with_all_faces(&base), with_buffer(&with_some_faces(&base, 0.3, 1), 32, true)]);
        for optics in [OpticsKind::Table3d, OpticsKind::Partial] {
            jobs.push(RenderJob { optics, ..with_all_faces(&base) });
        }
    }
    let mut renderer = Havs::new();
    for first in &jobs {
        for second in &jobs {
            renderer.render(first.clone()).unwrap();
            assert_same(
                "used before",
                &renderer.render(second.clone()).unwrap().planes.color,
                &havs(second).planes.color,
            );
        }
    }
}

#[test]
fn other_optics_have_the_same_errors_as_in_the_ray_caster() {
    for optics in [OpticsKind::Table3d, OpticsKind::Partial] {
        let job = RenderJob { optics, ..scene((64, 64)) };
        assert_within(&optics.to_string(), &havs(&job).planes.color, &raycast(&job));
        let exact = RenderJob { optics: OpticsKind::Exact, ..job.clone() };
        assert!(difference(&havs(&job).planes.color, &havs(&exact).planes.color).1 > 0.0, "another integrator");
    }
}

#[test]
fn one_cell_that_fills_many_tiles_agrees_with_the_ray_caster() {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mesh = Arc::new(build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }));
    for (eye, focal) in [
        (DVec3::new(0.4, 0.35, 0.45), DVec3::ZERO),
        (DVec3::new(0.2, 0.2, 0.2), DVec3::X),
        (DVec3::new(5e5, 4e5, 3e5), DVec3::splat(0.25)),
    ] {
        let projection = Projection::Perspective { view_angle: if eye.x > 1.0 { 1e-4 } else { 90.0 } };
        let camera = Camera { position: eye, focal_point: focal, view_up: DVec3::Z, projection, near: 0.0 };
        let job = job(&mesh, vec![-0.9, 0.3, 0.8, 0.0], &camera, (200, 150), dense());
        let frame = havs(&with_all_faces(&job));
        assert!(frame.stats.fragments > 10_000, "{} fragments", frame.stats.fragments);
        assert_within(&format!("eye {eye}"), &frame.planes.color, &raycast(&job));
    }
}

#[test]
fn overlapping_cells_agree_with_the_ray_caster() {
    let mut raw = grid(4, 0.16, 3, |_| true);
    let moved: Vec<DVec3> = raw.points.iter().map(|&p| p + DVec3::new(0.31, 0.17, 0.23)).collect();
    let first = raw.points.len() as u32;
    let again: Vec<_> = raw.cells.tets.iter().map(|tet| tet.map(|v| v + first)).collect();
    raw.points.extend(moved);
    raw.cells.tets.extend(again);
    let mesh = Arc::new(build(raw));
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), (48, 48), dense());
    let frame = havs(&with_all_faces(&job));
    assert_within("overlapping", &frame.planes.color, &raycast(&job));
    assert!(frame.stats.pixels_resolved_again > 500);
}

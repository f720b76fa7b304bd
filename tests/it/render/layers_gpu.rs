//! Fragments of other layers on the GPU, against the CPU.

use super::cells::{joint_jobs, scenes as of_cells};
use super::gpu::{context, points as points_on_gpu, render as walked};
use super::havs::gpu::render as drawn;
use super::havs::{havs, with_all_faces, with_some_faces};
use super::joint::{PARALLEL, PERSPECTIVE, jobs as joint_scenes, scene};
use super::layers::{Quad, random_quads, slabs, with_quads};
use super::surfaces::scenes as with_sheets;
use super::*;
use tetreel::optics::OpticsKind;
use tetreel::render::gpu::points::Points as GpuPoints;
use tetreel::render::{LayerFragments, RenderError};
use tetreel::visibility::{CellSet, Skip};

/// Images by the walk and by faces, and those of the CPU.
fn images(job: &RenderJob) -> [(&'static str, RgbaImage, RgbaImage); 2] {
    let faces = with_all_faces(job);
    let on_gpu = [walked(job), drawn(&faces)].map(|frame| {
        let frame = frame.unwrap();
        assert_eq!((frame.stats.broken_paths, frame.stats.out_of_order), (0, 0));
        frame.planes.color
    });
    let [walk, of_faces] = on_gpu;
    [("walk", walk, raycast(job)), ("faces", of_faces, havs(&faces).planes.color)]
}

/// Compares a job with quads by lot with the CPU's; a part of it, or a depth that is off by a hundredth of the scene's, is noticed.
fn compare(name: &str, job: &RenderJob, depths: [f64; 2], seed: u64) {
    let quads = random_quads(&job.view, depths, seed);
    let job = with_quads(job, &quads);
    let moved: Vec<Quad> = quads.iter().map(|q| Quad { depth: q.depth + 0.04, ..q.clone() }).collect();
    for ((path, found, expected), (_, other, _)) in images(&job).into_iter().zip(images(&with_quads(&job, &moved))) {
        let (rmse, max) = difference(&found, &expected);
        eprintln!("{name}, {path}: rmse {rmse:.1e}, max {max:.1e}");
        assert_within(&format!("{name}, {path}"), &found, &expected);
        if !name.contains("alone") {
            assert_noticed(&format!("{name}, {path}"), &other, &expected);
        }
    }
}

#[test]
fn rays_and_faces_meet_the_fragments_of_the_cpu() {
    if context().is_none() {
        return;
    }
    for (seed, projection) in [PARALLEL, PERSPECTIVE].into_iter().enumerate() {
        let plain = scene(5, projection);
        for optics in OpticsKind::ALL {
            let job = RenderJob { optics, ..plain.clone() };
            compare(&format!("{projection:?}, {optics}"), &job, [2.5, 6.5], 3 + seed as u64);
        }
        for (name, job) in joint_scenes(5, projection) {
            compare(&format!("{projection:?}, joint, {name}"), &job, [2.5, 6.5], 5 + seed as u64);
        }
    }
    let (_, cells) = of_cells().swap_remove(0);
    compare("scalars of cells", &cells, [2.5, 6.5], 7);
    for (name, job) in joint_jobs(&cells) {
        compare(&format!("scalars of cells, {name}"), &job, [2.5, 6.5], 8);
    }
}

#[test]
fn fragments_lie_among_isosurfaces_and_before_an_eye_inside() {
    if context().is_none() {
        return;
    }
    // One of each camera, with a volume and without.
    for (name, job) in with_sheets().into_iter().filter(|(name, _)| name.contains("cell")) {
        let depths = if name.starts_with("inside") { [0.01, 1.5] } else { [1.5, 6.5] };
        compare(&name, &job, depths, 11);
    }
}

#[test]
fn fragments_before_the_near_plane_and_behind_something_opaque_are_not_seen_nor_lost_where_there_are_no_cells() {
    if context().is_none() {
        return;
    }
    let (mesh, scalars) = slabs();
    let camera_at = |x: f64, near: f64| Camera {
        position: DVec3::new(x, 0.013, -0.021),
        focal_point: DVec3::new(x - 1.0, 0.013, -0.021),
        view_up: DVec3::Z,
        projection: PERSPECTIVE,
        near,
    };
    let quad = |depth: f64, alpha: f32| Quad {
        columns: 2..31,
        rows: 0..40,
        depth,
        rgba: [0.2 * alpha, 0.6 * alpha, 0.1 * alpha, alpha],
    };
    let job_of = |camera: &Camera, nodes| job(&mesh, scalars.clone(), camera, (40, 40), table(nodes));
    let usual = [(0.0, [0.9, 0.5, 0.1], 0.7), (1.0, [0.2, 0.4, 1.0], 1.3)];
    let clear = [(0.0, [0.9, 0.5, 0.1], 0.0), (1.0, [0.2, 0.4, 1.0], 0.0)];
    let all = [0.3, 2.0, 3.1, 3.4, 4.0, 4.4, 9.0].map(|depth| quad(depth, 0.4));
    let wall = [quad(2.0, 0.3), quad(3.4, 1.0), quad(3.5, 0.5), quad(7.0, 0.5)];
    for (name, job, quads) in [
        ("all", job_of(&camera_at(4.0, 0.0), &usual), &all[..]),
        ("near plane", job_of(&camera_at(4.0, 3.3), &usual), &all),
        ("far eye", job_of(&camera_at(900.0, 0.0), &usual), &[quad(899.0, 0.4), quad(900.0, 0.3), quad(2.0, 0.2)]),
        ("wall", job_of(&camera_at(4.0, 0.0), &usual), &wall),
        ("transparent cells", job_of(&camera_at(4.0, 0.0), &clear), &all),
        ("eye in a slab", job_of(&camera_at(0.6, 0.0), &usual), &[quad(0.02, 0.3), quad(0.2, 0.4), quad(1.1, 0.9)]),
    ] {
        for skip in [Skip::ALL, Skip::NONE] {
            let job = with_quads(&RenderJob { skip, ..job.clone() }, quads);
            let without = RenderJob { fragments: None, ..job.clone() };
            let others = [walked(&without), drawn(&with_all_faces(&without))].map(|frame| frame.unwrap().planes.color);
            for ((path, found, expected), without) in images(&job).into_iter().zip(others) {
                assert_within(&format!("{name}, {path}"), &found, &expected);
                assert_noticed(name, &without, &expected);
            }
        }
    }
    // No cell at all, and some faces only.
    let job = with_quads(&job_of(&camera_at(4.0, 0.0), &usual), &all);
    let none = RenderJob { active: Arc::new(CellSet::none(mesh.topology.tets.len())), ..job.clone() };
    assert_within("no cell", &walked(&none).unwrap().planes.color, &raycast(&none));
    let some = with_some_faces(&job, 0.5, 3);
    assert_within("some faces", &drawn(&some).unwrap().planes.color, &havs(&some).planes.color);
}

#[test]
fn a_list_without_a_fragment_changes_no_bit_and_points_are_left_to_the_cpu() {
    let Some(context) = context() else { return };
    let job = scene(5, PERSPECTIVE);
    let pixels = job.view.width_px * job.view.height_px;
    let empty = RenderJob { fragments: Some(Arc::new(LayerFragments::new(pixels, []).unwrap())), ..job.clone() };
    assert_eq!(walked(&empty).unwrap().planes, walked(&job).unwrap().planes);
    assert_eq!(drawn(&with_all_faces(&empty)).unwrap().planes, drawn(&with_all_faces(&job)).unwrap().planes);
    let refused = GpuPoints::new(context).begin(with_points(&empty, PointStyle::EXACT));
    assert!(matches!(refused, Err(RenderError::BeyondGpu { problem, .. }) if problem.contains("other layers")));
    assert!(points_on_gpu(&job).is_some());
}

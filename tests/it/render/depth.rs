//! The depth plane against closed forms and the reference.

use super::*;
use crate::meshes::{build, grid, sample};
use tetreel::image::DepthImage;

const PARALLEL: Projection = Projection::Parallel { scale: 0.9 };
const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 20.0 };

/// Rays whose whole opacity is below this may differ: the reference counts a cell that a ray runs along over 1e-5 local
/// units (its `GRAZING_LENGTH`), with extinctions up to 25 a unit, where the ray caster has it beside the ray.
const ALPHA_MIN: f32 = 25.0 * 1e-5;

/// Colour and depth of both renderers.
fn both(job: &RenderJob) -> [(&'static str, RgbaImage, DepthImage); 2] {
    let fast = Raycast::new().render(job.clone()).unwrap().clone();
    let judge = Reference::new().render(job.clone()).unwrap().clone();
    [("raycast", fast.planes.color, fast.planes.depth), ("reference", judge.planes.color, judge.planes.depth)]
}

/// Both renderers show this depth in every pixel, in `unit`s of the world. Positions and scalars of vertices are rounded
/// to f32, 6e-8 each of numbers up to 1, where the scalar has slope 1; the depth once more, 6e-8 of up to 8: together 6e-7.
fn assert_depth(name: &str, job: &RenderJob, depth: f64, unit: f64) {
    for (renderer, _, plane) in both(job) {
        assert_eq!(plane.pixels.len(), job.view.width_px * job.view.height_px);
        for &found in &plane.pixels {
            let error = (f64::from(found) - depth * unit).abs();
            assert!(error <= 1e-6 * unit, "{name}, {renderer}: {found} instead of {}", depth * unit);
        }
    }
}

/// Transparent but for a tent over 0.1..0.3.
fn tent() -> NodeTable {
    table(&[(0.1, [1.0; 3], 0.0), (0.2, [1.0, 0.5, 0.0], 5.0), (0.3, [1.0; 3], 0.0)])
}

fn looking(from: DVec3, to: DVec3, near: f64) -> Camera {
    let projection = PERSPECTIVE;
    Camera { position: from, focal_point: to, view_up: DVec3::Z, projection, near }
}

#[test]
fn a_slab_begins_at_its_face() {
    let mesh = Arc::new(build(grid(5, 0.16, 1, |_| true)));
    let scalars = vec![0.25; mesh.positions.local.len()];
    let table = table(&[(0.0, [1.0; 3], 0.01)]);
    for direction in [DVec3::X, -DVec3::Y, DVec3::Z] {
        let of = |distance: f64, projection| {
            job(&mesh, scalars.clone(), &camera(distance * direction, projection), (17, 17), table.clone())
        };
        assert_depth("perspective", &of(5.0, PERSPECTIVE), 4.0, 1.0);
        assert_depth("parallel", &of(5.0, PARALLEL), 4.0, 1.0);
        // A parallel view starts before the bounds, wherever its camera is.
        assert_depth("parallel from inside", &of(0.25, PARALLEL), -0.75, 1.0);
    }
}

#[test]
fn a_tent_begins_where_the_scalar_reaches_its_foot() {
    let mesh = Arc::new(build(grid(6, 0.16, 2, |_| true)));
    let of = |camera: &Camera| job(&mesh, sample(&mesh, |p| p.x), camera, (17, 17), tent());
    for projection in [PARALLEL, PERSPECTIVE] {
        assert_depth("falling", &of(&camera(5.0 * DVec3::X, projection)), 4.7, 1.0);
        assert_depth("rising", &of(&camera(-5.0 * DVec3::X, projection)), 5.1, 1.0);
    }
    let inside = |x: f64, near| looking(DVec3::new(x, 0.03, 0.02), DVec3::new(2.0, 0.03, 0.02), near);
    assert_depth("before the tent", &of(&inside(-0.4, 0.0)), 0.5, 1.0);
    assert_depth("in the tent", &of(&inside(0.2, 0.0)), 0.0, 1.0);
    assert_depth("cut in the tent", &of(&inside(-0.4, 0.65)), 0.65, 1.0);
    assert_depth("cut before the tent", &of(&inside(-0.4, 0.3)), 0.5, 1.0);
    // Behind it there is nothing.
    for (name, color, depth) in both(&of(&inside(0.31, 0.0))) {
        assert!(depth.pixels.iter().all(|d| *d == f32::INFINITY), "{name}");
        assert!(color.pixels.iter().all(|p| p[3] == 0.0), "{name}");
    }
}

#[test]
fn a_step_begins_at_the_step() {
    let mesh = Arc::new(build(grid(6, 0.16, 2, |_| true)));
    let step = table(&[(0.4, [1.0; 3], 0.0), (0.4, [1.0; 3], 1e3)]);
    let of =
        |direction: DVec3| job(&mesh, sample(&mesh, |p| p.x), &camera(5.0 * direction, PARALLEL), (9, 9), step.clone());
    assert_depth("rising", &of(-DVec3::X), 5.4, 1.0);
    assert_depth("falling", &of(DVec3::X), 4.0, 1.0);
}

#[test]
fn depth_is_in_world_units_wherever_the_world_is() {
    let raw = grid(5, 0.16, 3, |_| true);
    for (offset, unit) in [(DVec3::splat(1e7), 1.0), (DVec3::ZERO, 1e-30), (DVec3::new(-3e5, 10.0, 8e4), 1e3)] {
        let mut moved = raw.clone();
        for p in &mut moved.points {
            *p = offset + *p * unit;
        }
        let mesh = Arc::new(build(moved));
        let scalars = sample(&mesh, |p| (p.x - offset.x) / unit);
        let table = NodeTable::new(tent().nodes().iter().map(|n| Node { tau: n.tau / unit, ..*n }).collect()).unwrap();
        for projection in [PERSPECTIVE, Projection::Parallel { scale: 0.9 * unit }] {
            let mut camera = camera(DVec3::new(-5.0, 0.0, 0.0), projection);
            (camera.position, camera.focal_point) = (offset + unit * camera.position, offset);
            let job = job(&mesh, scalars.clone(), &camera, (17, 17), table.clone());
            assert_depth(&format!("offset {offset}, unit {unit}"), &job, 5.1, unit);
        }
    }
}

/// Pixels with light whose depths differ by more than rounding, and pixels compared. Both renderers work in f64 on the same
/// coordinates and round once, to 2^-24 of a depth; 1e-9 is left for how f64 rounds where a ray meets a plane at a flat angle
/// or the scalar hardly changes along it.
fn disagreeing(job: &RenderJob, other: &RenderJob) -> (usize, usize) {
    let [(_, color, depth), _] = both(job);
    let [_, (_, judge_color, judge_depth)] = both(other);
    let pixels = color.pixels.iter().zip(&judge_color.pixels).zip(depth.pixels.iter().zip(&judge_depth.pixels));
    let lit = pixels.filter(|((a, b), _)| a[3].max(b[3]) > ALPHA_MIN);
    let same =
        |a: f32, b: f32| a.is_finite() && (f64::from(a) - f64::from(b)).abs() <= 1.2e-7 * f64::from(b.abs()) + 1e-9;
    lit.fold((0, 0), |(wrong, all), (_, (a, b))| (wrong + usize::from(!same(*a, *b)), all + 1))
}

fn scenes() -> Vec<RenderJob> {
    let tents = table(&[
        (-0.55, [0.1, 0.2, 0.9], 0.0),
        (-0.5, [0.1, 0.2, 0.9], 2.0),
        (-0.45, [0.1, 0.2, 0.9], 0.0),
        (0.55, [1.0, 0.4, 0.1], 0.0),
        (0.6, [1.0, 0.4, 0.1], 25.0),
        (0.65, [1.0, 0.4, 0.1], 0.0),
    ]);
    let steps = table(&[(0.1, [0.9, 0.9, 0.1], 0.0), (0.1, [0.3, 0.0, 0.8], 1.2), (0.9, [1.0, 0.2, 0.1], 2.0)]);
    let mut jobs = Vec::new();
    for mesh in [grid(6, 0.16, 1, |_| true), grid(8, 0.16, 7, |c| c.length() > 0.5)].map(|raw| Arc::new(build(raw))) {
        for table in [tents.clone(), steps.clone()] {
            for camera in [
                camera(DVec3::new(3.0, -4.0, 2.0), PERSPECTIVE),
                camera(DVec3::new(1.0, 2.0, -4.0), Projection::Parallel { scale: 1.27 }),
                looking(DVec3::new(0.3, 0.2, 0.7), DVec3::new(-0.4, 0.1, -0.2), 0.0),
                looking(DVec3::new(0.3, 0.2, 0.7), DVec3::new(-0.4, 0.1, -0.2), 0.4),
            ] {
                jobs.push(job(&mesh, sample(&mesh, wave), &camera, (64, 64), table.clone()));
            }
        }
    }
    jobs
}

#[test]
fn depths_of_the_ray_caster_are_those_of_the_reference() {
    let mut lit = 0;
    for (i, job) in scenes().iter().enumerate() {
        let (wrong, all) = disagreeing(job, job);
        assert_eq!(wrong, 0, "scene {i}, of {all}");
        lit += all;
    }
    assert!(lit > 16 * 64 * 64 / 4, "{lit} pixels with light");
}

#[test]
fn the_comparison_notices_a_moved_foot_and_a_moved_eye() {
    let jobs = scenes();
    let (mut wrong, mut all) = (0, 0);
    for job in &jobs {
        let nodes = job.table.nodes().iter().map(|n| Node { scalar: n.scalar + 1e-4, ..*n }).collect();
        let other = RenderJob { table: Arc::new(NodeTable::new(nodes).unwrap()), ..job.clone() };
        let (wrong_here, all_here) = disagreeing(&other, job);
        (wrong, all) = (wrong + wrong_here, all + all_here);
    }
    // Faces of the mesh and the near distance stay where they are, feet inside the mesh move.
    assert!(wrong > all / 10, "{wrong} of {all}");
    let mut moved = jobs[0].clone();
    moved.view.eye += 1e-5 * moved.view.forward;
    let (wrong, all) = disagreeing(&moved, &jobs[0]);
    assert!(wrong > all * 9 / 10, "{wrong} of {all}");
}

//! All faces in exact order: the ray caster's image.

use super::*;
use crate::meshes::{build, grid, sample};
use tetreel::render::Frame;
use tetreel::visibility::CellSet;

pub type Shape = Box<dyn Fn(DVec3) -> bool>;

const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };

/// Cameras along axes and diagonals, through vertices and edges, both projections.
pub fn cameras() -> Vec<Camera> {
    let mut cameras = Vec::new();
    for direction in [DVec3::X, -DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::new(1.0, -2.0, 0.5), DVec3::new(1.0, 1.0, 0.0)]
    {
        let position = 5.0 * direction.normalize();
        cameras.push(camera(position, PERSPECTIVE));
        cameras.push(camera(position, Projection::Parallel { scale: 1.27 }));
    }
    cameras
}

/// Opacity below which a pixel has no depth to compare: less than what f32 tells from the sums of others (2^-30), of rays that
/// pass a corner of the mesh.
const ALPHA_MIN: f32 = 1e-9;

/// Pixels whose depth is another one.
fn other_depths(job: &RenderJob, frame: &Frame, judge: &Frame) -> usize {
    // Rounded to f32 once from depths of the same coordinates in f64: two units. At the eye what remains is the rounding of
    // coordinates up to 8, of which 2^-53 is 1e-15; ten of those. Rays that touch a cell in a point only may do so or not.
    let differ = |a: f32, b: f32| a != b && (a - b).abs() > 2.0 * f32::EPSILON * b.abs() + 1e-14;
    // Behind such a point, by more than depths are rounded, both see the same.
    let touches = |pixel: usize, a: f32, b: f32| {
        let mut view = job.view.clone();
        view.near = f64::from(a.min(b)) * (1.0 + 1e-6);
        let behind = Raycast::new().render(RenderJob { view, ..job.clone() }).unwrap().planes.depth.pixels[pixel];
        job.view.perspective && !differ(behind, a.max(b))
    };
    let depths =
        frame.planes.depth.pixels.iter().zip(&judge.planes.depth.pixels).zip(&judge.planes.color.pixels).enumerate();
    let is_other = |(i, ((a, b), rgba)): &(usize, ((&f32, &f32), &[f32; 4]))| {
        rgba[3] > ALPHA_MIN && differ(**a, **b) && !touches(*i, **a, **b)
    };
    depths.filter(is_other).count()
}

/// Largest errors of a scene, and what it took.
#[derive(Default)]
struct Worst {
    rmse: f64,
    max: f64,
    /// As they come.
    out_of_order: u64,
    again: u64,
    fragments: u64,
}

impl Worst {
    /// All faces of the job, in buffers of 2, 8 and 32 in exact order: the ray caster's image and depth.
    fn compare(&mut self, name: &str, job: &RenderJob) {
        let judge = Raycast::new().render(job.clone()).unwrap().clone();
        let job = with_all_faces(job);
        for k in [2, 8, 32] {
            let frame = havs(&with_buffer(&job, k, true));
            assert_within(&format!("{name}, k {k}"), &frame.planes.color, &judge.planes.color);
            let (rmse, max) = difference(&frame.planes.color, &judge.planes.color);
            assert_eq!(other_depths(&job, &frame, &judge), 0, "{name}, k {k}: depths");
            (self.rmse, self.max) = (self.rmse.max(rmse), self.max.max(max));
            self.again += frame.stats.pixels_resolved_again;
            self.fragments += frame.stats.fragments;
            self.out_of_order += havs(&with_buffer(&job, k, false)).stats.out_of_order;
        }
    }

    fn report(&self, name: &str) {
        let Self { rmse, max, out_of_order, again, fragments } = self;
        eprintln!(
            "{name}: rmse {rmse:.1e}, max {max:.1e}, {out_of_order} of {fragments} out of order, {again} pixels again"
        );
        assert!(*fragments > 1000, "{name}: an empty image proves nothing");
    }
}

#[test]
fn convex_meshes_agree_with_the_ray_caster() {
    for (name, jitter) in [("regular", 0.0), ("jittered", 0.16)] {
        let mesh = Arc::new(build(grid(6, jitter, 1, |_| true)));
        let mut worst = Worst::default();
        for (i, camera) in cameras().iter().enumerate() {
            let job = job(&mesh, sample(&mesh, wave), camera, (65, 65), dense());
            worst.compare(&format!("{name}, camera {i}"), &job);
        }
        worst.report(name);
    }
}

/// Which cubes of a grid are there, by their middles.
pub fn shapes() -> [(&'static str, Shape); 4] {
    [
        ("hole", Box::new(|c: DVec3| c.length() > 0.5)),
        ("two parts", Box::new(|c: DVec3| c.x.abs() > 0.3)),
        (
            "checkerboard touching in edges",
            Box::new(|c: DVec3| ((c + DVec3::ONE) * 4.0).floor().as_ivec3().element_sum() % 2 == 0),
        ),
        ("shell", Box::new(|c: DVec3| c.abs().max_element() > 0.6)),
    ]
}

#[test]
fn holes_and_separate_parts_agree_with_the_ray_caster() {
    for (name, keep) in shapes() {
        for jitter in [0.0, 0.16] {
            let mesh = Arc::new(build(grid(8, jitter, 7, &keep)));
            let mut worst = Worst::default();
            for (i, camera) in cameras().iter().enumerate() {
                // An odd size: rays through vertices and in the planes of faces, about which both have the same opinion.
                let job = job(&mesh, sample(&mesh, wave), camera, (65, 65), dense());
                worst.compare(&format!("{name}, camera {i}"), &job);
            }
            worst.report(&format!("{name}, jitter {jitter}"));
        }
    }
}

/// A box of slivers, or of layers that become thinner towards one side.
pub fn layered(squash: f64, thinnest: f64) -> (Arc<Mesh>, Vec<f32>, NodeTable) {
    let mut raw = grid(8, 0.16, 5, |c| c.length() > 0.35);
    // Heights from 0 to 1 become those of layers between `thinnest` and 1.
    let place = |z: f64| if thinnest == 1.0 { z } else { thinnest.powf(0.5 - 0.5 * z) * 2.0 - 1.0 };
    let values: Vec<f64> = raw.points.iter().map(|&p| wave(p)).collect();
    for p in &mut raw.points {
        p.z = place(p.z) * squash;
    }
    let mesh = build(raw);
    let scalars = mesh.vertex_source.iter().map(|&v| values[v as usize] as f32).collect();
    let table = NodeTable::new(dense().nodes().iter().map(|n| Node { tau: n.tau / squash, ..*n }).collect()).unwrap();
    (Arc::new(mesh), scalars, table)
}

/// Cameras on all sides of layers, both projections.
pub fn cameras_of_layers() -> Vec<Camera> {
    let mut positions = vec![DVec3::new(0.5, 0.3, 4.0), DVec3::new(2.0, 1.0, 3.0), DVec3::new(3.0, 2.0, 0.1)];
    positions.extend([DVec3::new(0.5, 0.3, -4.0), DVec3::new(-3.0, 2.0, -1.5), DVec3::new(0.0, 0.0, -5.0)]);
    let both = |position| [PERSPECTIVE, Projection::Parallel { scale: 1.27 }].map(|p| camera(position, p));
    positions.into_iter().flat_map(both).collect()
}

#[test]
fn slivers_and_boundary_layers_agree_with_the_ray_caster() {
    for (name, squash, thinnest) in [
        ("squash 1e-3", 1e-3, 1.0),
        ("squash 1e-5", 1e-5, 1.0),
        ("layers to 1e-3", 1.0, 1e-3),
        ("layers to 1e-6", 1.0, 1e-6),
    ] {
        let (mesh, scalars, table) = layered(squash, thinnest);
        let mut worst = Worst::default();
        for (i, camera) in cameras_of_layers().iter().enumerate() {
            let job = job(&mesh, scalars.clone(), camera, (65, 65), table.clone());
            worst.compare(&format!("{name}, camera {i}, {:?}", camera.projection), &job);
        }
        worst.report(name);
        assert!(worst.out_of_order > 0, "{name}: nothing was out of order: nothing proved");
    }
}

/// Eyes in cells, on a vertex, a face and an edge.
pub fn inside() -> Vec<(String, RenderJob)> {
    let shapes: [(&str, Shape); 2] =
        [("box", Box::new(|_: DVec3| true)), ("hole", Box::new(|c: DVec3| c.length() > 0.5))];
    let mut jobs = Vec::new();
    for (name, keep) in shapes {
        let mesh = Arc::new(build(grid(6, 0.16, 9, keep)));
        let on_vertex = mesh.positions.world(mesh.positions.local.len() / 2);
        let tet = mesh.topology.tets[100].map(|v| mesh.positions.world(v as usize));
        let (on_face, on_edge) = ((tet[0] + tet[1] + tet[2]) / 3.0, (tet[0] + tet[1]) / 2.0);
        let eyes = [DVec3::new(0.3, 0.2, 0.7), DVec3::new(0.01, 0.02, 0.03), on_vertex, on_face, on_edge];
        for (i, eye) in eyes.into_iter().enumerate() {
            for (angle, near) in [(30.0, 0.0), (30.0, 0.4), (120.0, 0.0), (120.0, 0.4)] {
                let camera = Camera {
                    position: eye,
                    focal_point: DVec3::new(-0.4, 0.1, -0.2),
                    view_up: DVec3::Z,
                    projection: Projection::Perspective { view_angle: angle },
                    near,
                };
                let job = job(&mesh, sample(&mesh, wave), &camera, (48, 48), dense());
                jobs.push((format!("{name}, eye {i}, angle {angle}, near {near}"), job));
            }
        }
    }
    jobs
}

#[test]
fn cameras_inside_agree_with_the_ray_caster() {
    let mut worst = Worst::default();
    for (name, job) in inside() {
        worst.compare(&name, &job);
    }
    worst.report("cameras inside");
}

/// Eyes in the planes of faces of a regular mesh.
pub fn in_planes() -> Vec<(String, RenderJob)> {
    let mesh = Arc::new(build(grid(3, 0.0, 1, |_| true)));
    let scalars = sample(&mesh, |p| p.x + 2.0 * p.y * p.z);
    let mut jobs = Vec::new();
    for (eye, focal) in [
        (DVec3::new(0.0, 0.0, -0.2), DVec3::new(0.0, 0.0, -1.0)),
        (DVec3::new(0.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 1.0)),
        (DVec3::new(1.0 / 3.0, 0.1, 0.2), DVec3::new(1.0 / 3.0, 1.0, 0.2)),
        (DVec3::new(0.25, 0.31, 1.0), DVec3::new(2.0, 0.7, 0.9)),
    ] {
        for angle in [60.0, 100.0, 170.0] {
            let view_up = if (focal - eye).cross(DVec3::Z).length() < 1e-9 { DVec3::Y } else { DVec3::Z };
            let projection = Projection::Perspective { view_angle: angle };
            let camera = Camera { position: eye, focal_point: focal, view_up, projection, near: 0.0 };
            jobs.push((format!("{eye}, {angle}"), job(&mesh, scalars.clone(), &camera, (101, 67), dense())));
        }
    }
    jobs
}

#[test]
fn an_eye_in_the_plane_of_faces_agrees_with_the_ray_caster() {
    let mut worst = Worst::default();
    for (name, job) in in_planes() {
        worst.compare(&name, &job);
    }
    worst.report("eyes in planes");
}

#[test]
fn holes_in_the_field_and_any_active_subset_agree_with_the_ray_caster() {
    let mesh = Arc::new(build(grid(6, 0.16, 13, |_| true)));
    let camera = camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE);
    let mut worst = Worst::default();
    for seed in 0..4 {
        let mut job = job(&mesh, sample(&mesh, wave), &camera, (48, 48), dense());
        let mut active = CellSet::none(mesh.topology.tets.len());
        for cell in 0..active.universe() as u32 {
            active.set(cell, noise(seed, u64::from(cell)) > 0.2 * seed as f64 - 0.3);
        }
        job.active = Arc::new(active);
        worst.compare(&format!("seed {seed}"), &job);
    }
    let mut scalars = sample(&mesh, wave);
    for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
        scalars[40 * i + 10] = bad;
    }
    let job = job(&mesh, scalars, &camera, (64, 64), dense());
    assert!(job.active.count() < job.active.universe());
    worst.compare("not finite", &job);
    worst.report("active subsets");
}

#[test]
fn the_comparison_notices_a_missing_face_and_a_wrong_order() {
    let (mesh, scalars, table) = layered(1e-3, 1.0);
    let base = job(&mesh, scalars, &camera(DVec3::new(2.0, 1.0, 3.0), PERSPECTIVE), (33, 33), table);
    let judge = raycast(&base);
    let all = with_all_faces(&base);
    // Depths, too: of an eye that is a millionth nearer.
    let mut nearer = all.clone();
    nearer.view.eye += 1e-6 * nearer.view.forward;
    let whole = Raycast::new().render(base.clone()).unwrap().clone();
    let seen = judge.pixels.iter().filter(|p| p[3] > ALPHA_MIN).count();
    let other = other_depths(&all, &havs(&nearer), &whole);
    assert!(other > seen / 2, "{other} of {seen} depths");
    // Without the second look, a buffer of two is not enough.
    let frame = havs(&with_buffer(&all, 2, false));
    assert!(frame.stats.out_of_order > 0);
    assert_noticed("a buffer of two", &frame.planes.color, &judge);
    // A quarter of the inner faces is missing.
    assert_noticed("three quarters of the faces", &havs(&with_some_faces(&base, 0.75, 1)).planes.color, &judge);
}

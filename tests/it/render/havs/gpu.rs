//! The face renderer on the GPU against the one on the CPU, and against the ray caster.

use super::*;
use crate::meshes::{build, grid, sample};
use crate::render::gpu::context;
use std::sync::{Mutex, OnceLock, PoisonError};
use tetreel::mesh::RawMesh;
use tetreel::optics::OpticsKind;
use tetreel::render::Frame;
use tetreel::render::gpu::havs::Havs as GpuHavs;
use tetreel::visibility::CellSet;

const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };

/// The frame of a job, by one renderer that all tests share: whatever it did before must not matter.
pub fn render(job: &RenderJob) -> Option<Frame> {
    static RENDERER: OnceLock<Mutex<GpuHavs>> = OnceLock::new();
    let context = context()?;
    let renderer = RENDERER.get_or_init(|| Mutex::new(GpuHavs::new(context)));
    let mut renderer = renderer.lock().unwrap_or_else(PoisonError::into_inner);
    Some(renderer.render(job.clone()).unwrap().clone())
}

/// What an image may be off by.
#[derive(Clone, Copy)]
struct Bound {
    rmse: f64,
    max: f64,
}

/// The project's bound.
const BOUND: Bound = Bound { rmse: 1e-5, max: 1e-3 };
/// Of cells 1e5 times as wide as they are high, in f64.
const SLIVERS: Bound = Bound { rmse: 1e-5, max: 2e-3 };
/// The same in f32: sheared coordinates move a vertex by 2^-24 of a cell's width, a hundredth of its height or more where faces
/// are seen at an angle. That of the ray caster on the GPU.
const SLIVERS_IN_F32: Bound = Bound { rmse: 5e-4, max: 5e-3 };

/// Largest errors of a scene.
#[derive(Default)]
struct Worst {
    rmse: f64,
    max: f64,
    fragments: u64,
}

impl Worst {
    fn compare(&mut self, name: &str, gpu: &Frame, judge: &RgbaImage, allowed: Bound) {
        let (rmse, max) = difference(&gpu.planes.color, judge);
        assert!(rmse <= allowed.rmse && max <= allowed.max, "{name}: rmse {rmse:.2e}, max {max:.2e}");
        (self.rmse, self.max) = (self.rmse.max(rmse), self.max.max(max));
        self.fragments += gpu.stats.fragments;
    }

    /// All faces of the job: the ray caster's image.
    fn complete(&mut self, name: &str, job: &RenderJob, allowed: Bound) {
        let Some(gpu) = render(&with_all_faces(job)) else { return };
        assert_eq!((gpu.stats.out_of_order, gpu.stats.broken_paths), (0, 0), "{name}");
        self.compare(name, &gpu, &raycast(job), allowed);
    }

    fn report(&self, name: &str) {
        let Self { rmse, max, fragments } = self;
        eprintln!("{name}: rmse {rmse:.1e}, max {max:.1e}, {fragments} fragments");
        assert!(*fragments > 1000, "{name}: an empty image proves nothing");
    }
}

#[test]
fn convex_meshes_agree_with_the_ray_caster() {
    if context().is_none() {
        return;
    }
    for (name, jitter) in [("regular", 0.0), ("jittered", 0.16)] {
        let mesh = Arc::new(build(grid(6, jitter, 1, |_| true)));
        let mut worst = Worst::default();
        for (i, camera) in complete::cameras().iter().enumerate() {
            let job = job(&mesh, sample(&mesh, wave), camera, (65, 65), dense());
            worst.complete(&format!("{name}, camera {i}"), &job, BOUND);
        }
        worst.report(name);
    }
}

#[test]
fn holes_and_separate_parts_agree_with_the_ray_caster() {
    if context().is_none() {
        return;
    }
    for (name, keep) in complete::shapes() {
        for jitter in [0.0, 0.16] {
            let mesh = Arc::new(build(grid(8, jitter, 7, &keep)));
            let mut worst = Worst::default();
            for (i, camera) in complete::cameras().iter().enumerate() {
                let job = job(&mesh, sample(&mesh, wave), camera, (65, 65), dense());
                worst.complete(&format!("{name}, jitter {jitter}, camera {i}"), &job, BOUND);
            }
            worst.report(&format!("{name}, jitter {jitter}"));
        }
    }
}

#[test]
fn slivers_and_boundary_layers_agree_with_the_ray_caster() {
    let Some(context) = context() else { return };
    let slivers = if context.has_f64() { SLIVERS } else { SLIVERS_IN_F32 };
    for (name, squash, thinnest, bound) in [
        ("squash 1e-3", 1e-3, 1.0, BOUND),
        ("squash 1e-5", 1e-5, 1.0, slivers),
        ("layers to 1e-3", 1.0, 1e-3, BOUND),
        ("layers to 1e-6", 1.0, 1e-6, BOUND),
    ] {
        let (mesh, scalars, table) = complete::layered(squash, thinnest);
        let mut worst = Worst::default();
        for (i, camera) in complete::cameras_of_layers().iter().enumerate() {
            let job = job(&mesh, scalars.clone(), camera, (65, 65), table.clone());
            worst.complete(&format!("{name}, camera {i}"), &job, bound);
        }
        worst.report(name);
    }
}

#[test]
fn cameras_inside_agree_with_the_ray_caster() {
    if context().is_none() {
        return;
    }
    let mut worst = Worst::default();
    for (name, job) in complete::inside() {
        worst.complete(&name, &job, BOUND);
    }
    worst.report("cameras inside");
}

#[test]
fn an_eye_in_the_plane_of_faces_agrees_with_the_ray_caster() {
    if context().is_none() {
        return;
    }
    let mut worst = Worst::default();
    for (name, job) in complete::in_planes() {
        worst.complete(&name, &job, BOUND);
    }
    worst.report("eyes in planes");
}

#[test]
fn holes_in_the_field_and_any_active_subset_agree_with_the_ray_caster() {
    if context().is_none() {
        return;
    }
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
        worst.complete(&format!("seed {seed}"), &job, BOUND);
    }
    let mut scalars = sample(&mesh, wave);
    for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
        scalars[40 * i + 10] = bad;
    }
    let job = job(&mesh, scalars, &camera, (64, 64), dense());
    assert!(job.active.count() < job.active.universe());
    worst.complete("not finite", &job, BOUND);
    worst.report("active subsets");
}

#[test]
fn levels_of_detail_agree_with_the_cpu() {
    if context().is_none() {
        return;
    }
    let mut worst = Worst::default();
    for (i, base) in some_faces::jobs().iter().enumerate() {
        for share in [1.0, 0.5, 0.1, 0.01, 0.0] {
            for optics in OpticsKind::ALL {
                let job = RenderJob { optics, ..with_some_faces(base, share, 5) };
                let (gpu, cpu) = (render(&job).unwrap(), havs(&job));
                let name = format!("job {i}, share {share}, {optics:?}");
                worst.compare(&name, &gpu, &cpu.planes.color, BOUND);
                assert_eq!(gpu.stats.out_of_order, 0, "{name}");
            }
        }
    }
    worst.report("levels of detail");
}

#[test]
fn a_small_buffer_makes_the_mistakes_of_the_cpu() {
    if context().is_none() {
        return;
    }
    let mut jobs = some_faces::jobs();
    for (squash, thinnest) in [(1e-3, 1.0), (1.0, 1e-3)] {
        let (mesh, scalars, table) = complete::layered(squash, thinnest);
        for camera in complete::cameras_of_layers().iter().step_by(3) {
            jobs.push(job(&mesh, scalars.clone(), camera, (65, 65), table.clone()));
        }
    }
    let (mut worst, mut mistakes, mut wrong) = (Worst::default(), 0, 0);
    for (i, base) in jobs.iter().enumerate() {
        for share in [1.0, 0.3] {
            let all = with_some_faces(base, share, 6);
            let exact = render(&all).unwrap();
            for k in [2, 4, 8, 32] {
                let job = with_buffer(&all, k, false);
                let (gpu, cpu) = (render(&job).unwrap(), havs(&job));
                worst.compare(&format!("job {i}, share {share}, k {k}"), &gpu, &cpu.planes.color, BOUND);
                mistakes += usize::from(difference(&exact.planes.color, &cpu.planes.color).1 > 1e-3);
                wrong += gpu.stats.out_of_order;
            }
        }
    }
    worst.report("small buffers");
    // The comparison has something to notice.
    assert!(mistakes > 10 && wrong > 1000, "{mistakes} images with mistakes, {wrong} fragments dropped");
}

#[test]
fn the_comparison_notices_a_missing_face_and_another_buffer() {
    if context().is_none() {
        return;
    }
    let (mesh, scalars, table) = complete::layered(1e-3, 1.0);
    let base = job(&mesh, scalars, &camera(DVec3::new(2.0, 1.0, 3.0), PERSPECTIVE), (65, 65), table);
    let (rmse, max) = difference(&render(&with_some_faces(&base, 0.75, 1)).unwrap().planes.color, &raycast(&base));
    assert!(rmse > 1e-5 && max > 1e-3, "rmse {rmse:.1e}, max {max:.1e}");
    let all = with_all_faces(&base);
    let three = havs(&with_buffer(&all, 3, false)).planes.color;
    let (rmse, max) = difference(&render(&with_buffer(&all, 2, false)).unwrap().planes.color, &three);
    assert!(rmse > 1e-5 && max > 1e-3, "rmse {rmse:.1e}, max {max:.1e}");
}

/// A job whose faces fill the image: one tet, its neighbours, from near.
#[test]
fn large_faces_agree_with_the_cpu() {
    if context().is_none() {
        return;
    }
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let one = Arc::new(build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }));
    let cube = Arc::new(build(grid(1, 0.0, 1, |_| true)));
    let mut worst = Worst::default();
    for (mesh, eye, focal, angle) in [
        (&one, DVec3::new(0.4, 0.35, 0.45), DVec3::ZERO, 90.0),
        (&one, DVec3::new(0.2, 0.2, 0.2), DVec3::X, 90.0),
        (&one, DVec3::new(5e5, 4e5, 3e5), DVec3::splat(0.25), 1e-4),
        (&cube, DVec3::new(2.0, 1.7, 2.1), DVec3::ZERO, 60.0),
        (&cube, DVec3::new(0.3, 0.1, 0.2), DVec3::X, 100.0),
    ] {
        let projection = Projection::Perspective { view_angle: angle };
        let camera = Camera { position: eye, focal_point: focal, view_up: DVec3::Z, projection, near: 0.0 };
        let job = job(mesh, sample(mesh, wave), &camera, (200, 150), dense());
        worst.complete(&format!("eye {eye}"), &job, BOUND);
        let all = with_all_faces(&job);
        assert_eq!(render(&all).unwrap().stats.fragments, havs(&all).stats.fragments, "eye {eye}");
    }
    worst.report("large faces");
}

#[test]
fn depths_are_those_of_the_cpu() {
    if context().is_none() {
        return;
    }
    let mesh = Arc::new(build(grid(5, 0.16, 2, |_| true)));
    for position in [DVec3::new(-2.0, -3.0, -3.0), DVec3::new(-0.3, -0.2, -0.4)] {
        let base = job(&mesh, sample(&mesh, wave), &camera(position, PERSPECTIVE), (48, 40), dense());
        for job in [with_all_faces(&base), with_some_faces(&base, 0.3, 2)] {
            let (gpu, cpu) = (render(&job).unwrap(), havs(&job));
            let mut both = 0;
            for (&x, &y) in gpu.planes.depth.pixels.iter().zip(&cpu.planes.depth.pixels) {
                assert_eq!(x.is_finite(), y.is_finite());
                if y.is_finite() {
                    // As in the tests of the ray caster on the GPU.
                    let bound = (50.0 + 2.0 * y.abs()) / (1 << 24) as f32;
                    assert!((x - y).abs() <= bound, "{x} and {y}");
                    both += 1;
                }
            }
            assert!(both > 200, "{both} pixels");
        }
    }
}

#[test]
fn eyes_next_to_edges_vertices_and_faces_lose_no_ray() {
    if context().is_none() {
        return;
    }
    let mesh = Arc::new(build(grid(4, 0.15, 3, |p| p.length() > 0.4)));
    // Cells that are nearly opaque: a ray that is lost shows.
    let opaque = table(&[(-1.5, [0.9, 0.1, 0.2], 6.0), (0.1, [0.1, 0.8, 0.3], 20.0), (1.5, [0.2, 0.3, 1.0], 60.0)]);
    let random = |seed: u64, i: u64| DVec3::new(noise(seed, 3 * i), noise(seed, 3 * i + 1), noise(seed, 3 * i + 2));
    let tets = &mesh.topology.tets;
    let (mut worst, mut views) = (Worst::default(), 0);
    for index in 0..150u64 {
        let tet = tets[(index as usize * 7919) % tets.len()].map(|v| mesh.positions.world(v as usize));
        // A vertex, a place on an edge, one in a face, moved a little.
        let on_edge = tet[0].lerp(tet[1], 0.5 + 0.3 * noise(5, index));
        let place = [tet[0], on_edge, on_edge.lerp(tet[2], 0.4)][index as usize % 3];
        let offset = [0.0, 1e-9, 1e-8, 3e-8, 1e-7, 1e-6][index as usize / 3 % 6];
        let position = place + offset * random(6, index);
        let camera = Camera {
            position,
            focal_point: position + random(7, index).normalize(),
            view_up: random(8, index),
            projection: Projection::Perspective { view_angle: 90.0 },
            near: 0.0,
        };
        if camera.view(24, 20).is_err() {
            continue;
        }
        let job = job(&mesh, sample(&mesh, wave), &camera, (24, 20), opaque.clone());
        // Eyes outside that look away see nothing.
        if raycast(&job).pixels.iter().any(|p| p[3] > 0.0) {
            worst.complete(&format!("place {index}, {offset:e} off"), &job, BOUND);
            views += 1;
        }
    }
    worst.report("eyes next to features");
    assert!(views > 100, "{views} views");
}

#[test]
fn a_list_from_back_to_front_gives_the_same_image() {
    if context().is_none() {
        return;
    }
    // Dozens of fragments a pixel, all in the wrong order: insertion is given up.
    let mesh = Arc::new(build(grid(16, 0.16, 1, |_| true)));
    let base = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), (40, 33), dense());
    let reversed = |job: RenderJob| {
        let drawn = job.faces.as_ref().unwrap();
        let faces = drawn.ids.iter().rev().copied().collect();
        RenderJob { faces: Some(Arc::new(Drawn { ids: faces, is_complete: drawn.is_complete })), ..job }
    };
    let mut worst = Worst::default();
    for job in [with_all_faces(&base), with_some_faces(&base, 0.6, 3)] {
        let (forth, back) = (render(&job).unwrap(), render(&reversed(job.clone())).unwrap());
        assert!(forth.stats.fragments > 12 * forth.stats.rays_hit, "{:?}", forth.stats);
        worst.compare("back to front", &back, &forth.planes.color, BOUND);
        let window = reversed(with_buffer(&job, 8, false));
        let (gpu, cpu) = (render(&window).unwrap(), havs(&window));
        worst.compare("back to front through a buffer", &gpu, &cpu.planes.color, BOUND);
        assert!(gpu.stats.out_of_order > gpu.stats.fragments / 4);
    }
    worst.report("back to front");
}

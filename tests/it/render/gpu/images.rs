//! Images of the GPU against those of the CPU, in scenes made for what the GPU does differently.

use super::*;
use std::time::Duration;
use tetreel::mesh::RawMesh;
use tetreel::optics::OpticsKind;
use tetreel::render::Advance;

/// Renders on both and compares within the project's bound; `None` without a GPU.
pub fn compare(name: &str, job: &RenderJob) -> Option<(Frame, Frame)> {
    let gpu = render(job)?;
    let cpu = Raycast::new().render(job.clone()).unwrap().clone();
    assert_within(name, &gpu.planes.color, &cpu.planes.color);
    assert!(cpu.planes.color.pixels.iter().any(|p| p[3] > 0.0), "{name}: an empty image proves nothing");
    assert_eq!(gpu.stats.broken_paths, 0, "{name}");
    Some((gpu, cpu))
}

/// `count` separate slabs of 48 tets along x, within [-1, 1].
fn slabs(count: usize, share: f64) -> RawMesh {
    let mut all = RawMesh::default();
    for slab in 0..count {
        let one = grid(2, 0.16, slab as u64, |_| true);
        let first = all.points.len() as u32;
        let pitch = 2.0 / count as f64;
        let middle = -1.0 + (slab as f64 + 0.5) * pitch;
        all.points.extend(one.points.iter().map(|p| DVec3::new(middle + 0.5 * share * pitch * p.x, p.y, p.z)));
        all.cells.tets.extend(one.cells.tets.iter().map(|tet| tet.map(|v| v + first)));
    }
    all
}

#[test]
fn rays_that_enter_more_often_than_four_times_see_all_slabs() {
    if context().is_none() {
        return;
    }
    // Shares of 1: slabs that touch, so that a ray leaves one where it enters the next.
    for (count, share) in [(4, 0.5), (5, 0.5), (12, 0.5), (12, 1.0), (23, 0.05)] {
        let mesh = Arc::new(build(slabs(count, share)));
        let parallel = Projection::Parallel { scale: 0.87 };
        for (view, camera) in [
            ("along", camera(DVec3::new(-5.0, 0.11, 0.07), Projection::Perspective { view_angle: 16.0 })),
            ("against", camera(DVec3::new(5.0, 0.31, 0.22), parallel)),
            ("slanted", camera(DVec3::new(-4.0, 1.4, 0.9), parallel)),
        ] {
            let name = format!("{count} slabs of {share}, {view}");
            let job = job(&mesh, sample(&mesh, wave), &camera, (48, 40), dense());
            let (gpu, cpu) = compare(&name, &job).unwrap();
            assert_eq!((gpu.stats.entries, gpu.stats.rays_hit), (cpu.stats.entries, cpu.stats.rays_hit), "{name}");
            if count > 5 {
                assert!(gpu.stats.entries > 4 * gpu.stats.rays_hit, "{name}: {} entries", gpu.stats.entries);
            }
            // The comparison notices the loss of the fifth and later entries of each ray.
            let mut fewer = job.clone();
            let mut active = (*job.active).clone();
            for (cell, tet) in (0..).zip(&job.mesh.topology.tets) {
                let far = if view == "against" { -0.6 } else { 0.6 };
                let x = tet.map(|v| job.mesh.positions.world(v as usize).x).iter().sum::<f64>() / 4.0;
                if (x - far) * far > 0.0 {
                    active.set(cell, false);
                }
            }
            fewer.active = Arc::new(active);
            let (rmse, max) = difference(&render(&fewer).unwrap().planes.color, &cpu.planes.color);
            assert!(rmse > 1e-5 && max > 1e-3, "{name}: rmse {rmse:.1e}, max {max:.1e}");
        }
    }
}

/// A transfer function of up to ten nodes over [-1.5, 1.5]: slopes, steps, spikes a millionth wide, transparent stretches.
fn random_table(seed: u64) -> NodeTable {
    let random = |i: u64| 0.5 + 0.5 * noise(seed, i);
    let count = 2 + (8.0 * random(0)) as u64;
    let mut nodes = Vec::new();
    let mut scalars: Vec<_> = (0..count).map(|n| -1.5 + 3.0 * random(10 + n)).collect();
    scalars.sort_by(f64::total_cmp);
    for (n, s) in (0u64..).zip(scalars) {
        let at = 100 * (n + 1);
        let rgb = |i: u64| [random(at + i), random(at + i + 1), random(at + i + 2)];
        let tau = |i: u64| if random(at + i) < 0.3 { 0.0 } else { 3.0 * random(at + i + 1).powi(3) };
        match (4.0 * random(at)) as u32 {
            // A step.
            0 => nodes.extend([(s, rgb(1), tau(10)), (s, rgb(4), tau(12))]),
            // A spike with an area of up to 0.5.
            1 => {
                let (h, area, foot) = (0.5e-6, 0.5 * random(at + 7), tau(10));
                nodes.extend([(s - h, rgb(1), foot), (s, rgb(4), foot + area / h), (s + h, rgb(1), foot)]);
            }
            _ => nodes.push((s, rgb(1), tau(10))),
        }
    }
    table(&nodes)
}

#[test]
fn random_transfer_functions_with_steps_and_spikes_agree() {
    if context().is_none() {
        return;
    }
    let mesh = Arc::new(build(grid(5, 0.16, 17, |c| c.length() > 0.4)));
    let (mut steps, mut spikes) = (0, 0);
    for seed in 0..24 {
        let table = random_table(seed);
        let gaps = table.nodes().windows(2).map(|n| n[1].scalar - n[0].scalar);
        steps += gaps.clone().filter(|&gap| gap == 0.0).count();
        spikes += gaps.filter(|&gap| gap > 0.0 && gap < 1e-6).count();
        let at = DVec3::new(noise(seed, 1), noise(seed, 2), noise(seed, 3)).normalize();
        let job = job(&mesh, sample(&mesh, wave), &camera(5.0 * at, PERSPECTIVE), (48, 40), table);
        if job.table.nodes().iter().all(|n| n.tau == 0.0) {
            continue;
        }
        compare(&format!("seed {seed}"), &job);
    }
    assert!(steps > 10 && spikes > 10, "{steps} steps, {spikes} spikes");
}

/// Meshes with holes: whole, without some cubes, and with vertices that have no scalar.
fn holed(seed: u64) -> (Arc<Mesh>, Vec<f32>) {
    let keep = |c: DVec3| noise(seed, (c * 1024.0).as_i64vec3().element_sum() as u64) > -0.7;
    let mesh = Arc::new(build(grid(5, 0.16, seed, keep)));
    let mut scalars = sample(&mesh, wave);
    for i in 0..4 {
        let at = ((0.5 + 0.5 * noise(seed, 500 + i)) * scalars.len() as f64) as usize;
        scalars[at] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::NAN][i as usize];
    }
    (mesh, scalars)
}

#[test]
fn random_views_of_meshes_with_holes_agree() {
    if context().is_none() {
        return;
    }
    let mut inside = 0;
    for seed in 0..60 {
        let (mesh, scalars) = holed(seed / 6);
        let random = |i: u64| noise(seed, 900 + i);
        let direction = DVec3::new(random(0), random(1), random(2));
        let position = direction * 10f64.powf(0.8 * random(3));
        let focal_point = 0.4 * DVec3::new(random(4), random(5), random(6));
        let projection = if seed % 4 == 3 {
            Projection::Parallel { scale: 0.4 + 0.4 * (1.0 + random(7)) }
        } else {
            Projection::Perspective { view_angle: 70.0 + 60.0 * random(7) }
        };
        let view_up = DVec3::new(random(8), random(9), random(10));
        let near = if seed % 5 == 4 { 0.3 } else { 0.0 };
        let camera = Camera { position, focal_point, view_up, projection, near };
        inside += usize::from(position.abs().max_element() < 1.0);
        let job = job(&mesh, scalars, &camera, (40, 36), if seed % 3 == 0 { random_table(seed) } else { dense() });
        let Some(gpu) = render(&job) else { return };
        let cpu = raycast(&job);
        assert_within(&format!("seed {seed}, {camera:?}"), &gpu.planes.color, &cpu);
        assert_eq!(gpu.stats.broken_paths, 0);
    }
    assert!(inside > 10 && inside < 50, "{inside} eyes inside");
}

#[test]
fn eyes_in_cells_on_vertices_and_in_planes_of_faces_agree() {
    if context().is_none() {
        return;
    }
    for (kind, jitter, hole) in [("jittered", 0.16, 0.0), ("regular", 0.0, 0.0), ("hole", 0.16, 0.5)] {
        let mesh = Arc::new(build(grid(4, jitter, 9, |c| c.length() >= hole)));
        let tet = mesh.topology.tets[100].map(|v| mesh.positions.world(v as usize));
        let eyes = [
            ("in a cell", DVec3::new(0.31, 0.22, 0.73)),
            ("on a vertex", mesh.positions.world(mesh.positions.local.len() / 2)),
            ("on an edge", 0.5 * (tet[0] + tet[1])),
            ("on a face", (tet[0] + tet[1] + tet[2]) / 3.0),
            ("in a face's plane", tet[0] + 3.0 * (tet[1] - tet[0]) + 2.0 * (tet[2] - tet[0])),
        ];
        for (place, position) in eyes {
            for view_angle in [40.0, 110.0] {
                let projection = Projection::Perspective { view_angle };
                let focal_point = DVec3::new(-0.43, 0.12, -0.21);
                let camera = Camera { position, focal_point, view_up: DVec3::Z, projection, near: 0.0 };
                let job = job(&mesh, sample(&mesh, wave), &camera, (40, 36), dense());
                compare(&format!("{kind}, {place}, {view_angle}"), &job);
            }
        }
    }
}

#[test]
fn parallel_rays_along_the_axes_agree() {
    if context().is_none() {
        return;
    }
    for jitter in [0.0, 0.16] {
        let mesh = Arc::new(build(grid(4, jitter, 5, |c| c.length() > 0.4)));
        for direction in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z] {
            // Of odd sizes, the middle rays run along edges and faces of a regular mesh; the scale keeps the others off the
            // planes of the boundary.
            let camera = camera(4.0 * direction, Projection::Parallel { scale: 1.27 });
            let job = job(&mesh, sample(&mesh, wave), &camera, (41, 41), dense());
            compare(&format!("jitter {jitter}, {direction}"), &job);
        }
    }
}

#[test]
fn the_pre_integrated_table_gives_the_image_of_the_cpu() {
    if context().is_none() {
        return;
    }
    let (mesh, scalars) = holed(3);
    let tents = table(&[
        (-0.8, [0.1, 0.2, 0.9], 0.0),
        (-0.5, [0.1, 0.2, 0.9], 3.0),
        (-0.2, [0.1, 0.2, 0.9], 0.0),
        (0.2, [1.0, 0.4, 0.1], 0.0),
        (0.5, [1.0, 0.4, 0.1], 9.0),
        (0.8, [1.0, 0.4, 0.1], 0.0),
    ]);
    // Steeper than the table is wide: scalars on both sides of its range.
    let narrow = table(&[(-0.3, [0.9, 0.2, 0.1], 0.4), (0.0, [0.1, 0.9, 0.2], 2.0), (0.3, [0.2, 0.1, 0.9], 0.1)]);
    for (kind, table) in [("dense", dense()), ("tents", tents), ("narrow", narrow)] {
        for position in [DVec3::new(3.0, 2.0, 2.5), DVec3::new(0.3, 0.2, 0.7), DVec3::new(-50.0, 20.0, 10.0)] {
            let angle = if position.length() > 10.0 { 3.0 } else { 40.0 };
            let camera = camera(position, Projection::Perspective { view_angle: angle });
            let exact = job(&mesh, scalars.clone(), &camera, (48, 40), table.clone());
            let job = RenderJob { optics: OpticsKind::Table3d, ..exact.clone() };
            let (gpu, _) = compare(&format!("{kind} from {position}"), &job).unwrap();
            // It is not the exact integrator that has been compared.
            assert!(gpu.planes.color != render(&exact).unwrap().planes.color, "{kind} from {position}");
        }
    }
}

/// Largest distance of two depths in units of `bound` over the pixels where both see something, and the pixels where only
/// one does, and those where both do.
fn depth_difference(a: &Frame, b: &Frame, bound: impl Fn(f64) -> f64) -> (f64, usize, usize) {
    let (mut largest, mut lone, mut both) = (0f64, 0, 0);
    for (&x, &y) in a.planes.depth.pixels.iter().zip(&b.planes.depth.pixels) {
        if x.is_finite() && y.is_finite() {
            both += 1;
            let (x, y) = (f64::from(x), f64::from(y));
            largest = largest.max((x - y).abs() / bound(y));
        }
        lone += usize::from(x.is_finite() != y.is_finite());
    }
    (largest, lone, both)
}

/// Bound on a depth where the first thing seen is the mesh's surface or a place where a scalar of slope 1 reaches a node.
///
/// With u = 2^-24: sheared coordinates are right to 2 u of themselves, edge functions to 6 u, weights to 8 u; the depth, a sum of two
/// differences of corners' depths times weights, is off by at most 20 u times the longest of these (a cell's diameter, below 1), the
/// scalar by as much of its differences and 3 u of its mapped range of 2, and with slope 1 the depth by the same again. Counted
/// from another place and as world depth it is rounded twice, u of itself each. Together 50 u + 2 u |depth|.
fn depth_bound(depth: f64) -> f64 {
    (50.0 + 2.0 * depth.abs()) / f64::from(1 << 24)
}

#[test]
fn depths_are_those_of_the_cpu() {
    let Some(_) = context() else { return };
    let mesh = Arc::new(build(grid(5, 0.16, 2, |_| true)));
    let linear = |scale: f64| sample(&mesh, move |p| scale * (0.48 * p.x + 0.6 * p.y + 0.64 * p.z));
    let tent = table(&[(0.1, [1.0; 3], 0.0), (0.2, [1.0, 0.5, 0.0], 5.0), (0.3, [1.0; 3], 0.0)]);
    for (name, table) in [("surface", dense()), ("tent", tent)] {
        for (view, camera) in [
            ("perspective", camera(DVec3::new(-2.0, -3.0, -3.0), PERSPECTIVE)),
            ("parallel", camera(DVec3::new(-2.0, -3.0, -3.0), Projection::Parallel { scale: 1.3 })),
            ("parallel from inside", camera(DVec3::new(-0.1, -0.2, -0.3), Projection::Parallel { scale: 1.3 })),
            ("inside", Camera { near: 0.05, ..camera(DVec3::new(-0.3, -0.2, -0.4), PERSPECTIVE) }),
            ("far", camera(2000.0 * DVec3::new(-2.0, -3.0, -3.0), Projection::Perspective { view_angle: 0.02 })),
        ] {
            let job = job(&mesh, linear(1.0), &camera, (48, 40), table.clone());
            let (gpu, cpu) = compare(&format!("{name}, {view}"), &job).unwrap();
            let (largest, lone, both) = depth_difference(&gpu, &cpu, depth_bound);
            assert!(largest <= 1.0 && both > 200, "{name}, {view}: {largest} of the bound, {both} pixels");
            assert_eq!(lone, 0, "{name}, {view}: of {both}");
            if (name, view) == ("surface", "inside") {
                // All is at the near distance.
                continue;
            }
            // The comparison notices an eye that moved by a few bounds.
            let mut moved = job;
            moved.view.eye -= 8.0 * depth_bound(moved.view.eye.length()) * moved.view.forward;
            let (largest, ..) = depth_difference(&render(&moved).unwrap(), &cpu, depth_bound);
            assert!(largest > 1.0, "{name}, {view}: {largest}");
        }
    }
}

#[test]
fn one_renderer_draws_many_sizes() {
    let Some(context) = context() else { return };
    let mesh = Arc::new(build(grid(3, 0.16, 2, |_| true)));
    let mut renderer = GpuRaycast::new(context);
    // Around the tile's size and the rows of 256 bytes in which images come back.
    for size in [(1, 1), (15, 17), (16, 16), (17, 15), (1, 40), (64, 3), (65, 33), (3, 64), (1, 1)] {
        let camera = camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE);
        let job = job(&mesh, sample(&mesh, wave), &camera, size, dense());
        renderer.begin(job.clone()).unwrap();
        while let Advance::Partial(_) = renderer.advance(Duration::ZERO).unwrap() {}
        let image = renderer.advance(Duration::ZERO).unwrap();
        let Advance::Done(frame) = image else { panic!("done is done") };
        assert_eq!((frame.planes.color.width, frame.planes.color.height), size);
        assert_within(&format!("{size:?}"), &frame.planes.color, &raycast(&job));
    }
}

#[test]
fn slivers_agree_in_f64_and_nearly_in_f32() {
    let squash = 1e-5;
    let mut raw = grid(6, 0.16, 5, |_| true);
    for p in &mut raw.points {
        p.z *= squash;
    }
    let mesh = Arc::new(build(raw));
    let scalars = sample(&mesh, |p| wave(DVec3::new(p.x, p.y, p.z / squash)));
    let table = NodeTable::new(dense().nodes().iter().map(|n| Node { tau: n.tau / squash, ..*n }).collect()).unwrap();
    for position in [DVec3::new(0.5, 0.3, 4.0), DVec3::new(2.0, 1.0, 3.0)] {
        let job = job(&mesh, scalars.clone(), &camera(position, PERSPECTIVE), (64, 64), table.clone());
        assert_slivers_agree(&job, &raycast(&job));
    }
}

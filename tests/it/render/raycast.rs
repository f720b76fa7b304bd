//! The ray caster against the reference, and what its image must not depend on. Scenes made to be difficult are in `stress`.

use super::*;
use crate::meshes::{build, grid, noise, sample};
use std::time::Duration;
use tetreel::mesh::RawMesh;
use tetreel::render::Advance;
use tetreel::visibility::{CellSet, Skip};

const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };

/// Three narrow tents, everything else transparent.
fn tents() -> NodeTable {
    let tent = |s: f64, rgb, tau| [(s - 0.05, rgb, 0.0), (s, rgb, tau), (s + 0.05, rgb, 0.0)];
    table(
        &[tent(-0.5, [0.1, 0.2, 0.9], 2.0), tent(0.0, [0.2, 0.9, 0.3], 8.0), tent(0.6, [1.0, 0.4, 0.1], 25.0)].concat(),
    )
}

/// Cameras along axes and diagonals, through vertices and edges, near and far, both projections.
fn cameras() -> Vec<Camera> {
    let mut cameras = Vec::new();
    for direction in [DVec3::X, -DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::new(1.0, -2.0, 0.5), DVec3::new(1.0, 1.0, 0.0)]
    {
        let position = 5.0 * direction.normalize();
        cameras.push(camera(position, PERSPECTIVE));
        // Not a divisor of the box's size: rays in the plane of a boundary face have no defined answer.
        cameras.push(camera(position, Projection::Parallel { scale: 1.27 }));
    }
    cameras
}

#[test]
fn any_active_subset_agrees_with_the_reference() {
    let mesh = Arc::new(build(grid(5, 0.16, 13, |_| true)));
    for seed in 0..4 {
        let mut job =
            job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), (48, 48), dense());
        let mut active = CellSet::none(mesh.topology.tets.len());
        for cell in 0..active.universe() as u32 {
            active.set(cell, noise(seed, u64::from(cell)) > 0.2 * seed as f64 - 0.3);
        }
        job.active = Arc::new(active);
        assert_agrees(&format!("seed {seed}"), &job);
    }
}

#[test]
fn rays_walk_through_active_cells_only_and_through_each_once() {
    let view = camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE);
    let all = Arc::new(build(grid(5, 0.16, 13, |_| true)));
    let tets = &all.topology.tets;
    // With those at the corners of the box the rest has the same box, and the same coordinates to the bit.
    let is_at_corner = |v: u32| all.positions.world(v as usize).abs().min_element() > 0.99;
    let is_kept =
        |(cell, tet): (usize, &[u32; 4])| noise(7, cell as u64) > -0.2 || tet.iter().any(|&v| is_at_corner(v));
    let kept: Vec<bool> = tets.iter().enumerate().map(is_kept).collect();
    let points = (0..all.positions.local.len()).map(|v| all.positions.world(v)).collect();
    let left: Vec<_> = tets.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(tet, _)| *tet).collect();
    let part = Arc::new(build(RawMesh { points, cells: left.into() }));
    let mut among_all = job(&all, sample(&all, wave), &view, (48, 48), dense());
    let mut active = CellSet::none(tets.len());
    (0..).zip(&kept).for_each(|(cell, &kept)| active.set(cell, kept));
    among_all.active = Arc::new(active);
    let alone = job(&part, sample(&part, wave), &view, (48, 48), dense());
    for renderer in [Raycast::new, Raycast::portable] {
        let steps = [&among_all, &alone].map(|job| renderer().render(job.clone()).unwrap().stats.steps);
        assert!(steps[0] == steps[1] && steps[0] > 48 * 48, "{steps:?}");
    }
}

#[test]
fn the_comparison_notices_a_changed_scalar_and_a_changed_pixel_convention() {
    let mesh = Arc::new(build(grid(6, 0.16, 1, |_| true)));
    let base = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (64, 64), dense());
    let judge = reference(&base);
    let mut other = base.clone();
    let mut scalars = base.scalars.values().to_vec();
    let middle = scalars.len() / 2;
    scalars[middle] += 0.1;
    other.scalars = Arc::new(scalars).into();
    assert_noticed("one scalar off by 5 % of the range", &raycast(&other), &judge);
    assert_noticed("a quarter of a pixel off at the edge", &raycast(&stretched(&base)), &judge);
}

#[test]
fn slices_do_not_change_the_image() {
    let mesh = Arc::new(build(grid(8, 0.16, 1, |c| c.length() > 0.4)));
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (70, 50), dense());
    let whole = raycast(&job);
    let mut sliced = Raycast::new();
    sliced.begin(job.clone()).unwrap();
    let mut slices = 0;
    let image = loop {
        slices += 1;
        match sliced.advance(Duration::ZERO).unwrap() {
            Advance::Partial(frame) | Advance::Preview(frame, _) => {
                assert_eq!(frame.planes.color.pixels.len(), 70 * 50)
            }
            Advance::Done(frame) => break frame.planes.color.clone(),
        }
    };
    assert!(slices > 1, "the job fits a slice: nothing tested");
    assert_same("slices", &image, &whole);
}

#[test]
fn neither_the_order_of_the_tiles_nor_slices_of_it_change_the_image() {
    let mesh = Arc::new(build(grid(8, 0.16, 1, |c| c.length() > 0.4)));
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (90, 70), dense());
    let row_by_row = RenderJob { skip: Skip { costly_first: false, ..Skip::ALL }, ..job.clone() };
    let expected = Raycast::new().render(row_by_row.clone()).unwrap().clone();
    let mut renderer = Raycast::new();
    // From the middle, by cost, row by row, and again by cost.
    for job in [&job, &job, &row_by_row, &job] {
        let frame = renderer.render(job.clone()).unwrap();
        assert_same("tiles in another order", &frame.planes.color, &expected.planes.color);
        assert_eq!(frame.planes.depth, expected.planes.depth);
    }
    renderer.begin(job).unwrap();
    let mut seen = 0;
    while let Advance::Partial(frame) = renderer.advance(Duration::ZERO).unwrap() {
        // What is there is final, and there is more of it every time.
        let pixels = || frame.planes.color.pixels.iter().zip(&expected.planes.color.pixels);
        assert!(pixels().all(|(now, whole)| now == whole || *now == [0.0; 4]));
        let now = pixels().filter(|(now, whole)| now == whole).count();
        assert!(now >= seen);
        seen = now;
    }
    assert!(seen > 0, "the job fits a slice: nothing tested");
}

#[test]
fn what_lies_outside_of_the_view_is_left_out_and_changes_nothing() {
    let mesh = Arc::new(build(grid(30, 0.16, 1, |c| c.length() > 0.3)));
    let scalars = sample(&mesh, wave);
    let (mut outside, mut untouched, mut seen) = (0, 0, 0);
    for seed in 0..40 {
        let mut at = 0;
        let mut random = |reach: f64| {
            at += 3;
            reach * DVec3::from_array([0, 1, 2].map(|i| noise(seed, at + i)))
        };
        // Inside, at the mesh, far away.
        let position = random([0.9, 2.5, 40.0][seed as usize % 3]);
        let projection = match seed % 4 {
            0 => Projection::Parallel { scale: 0.4 },
            1 => Projection::Perspective { view_angle: if position.length() > 5.0 { 1.0 } else { 20.0 } },
            _ => Projection::Perspective { view_angle: if position.length() > 5.0 { 2.0 } else { 100.0 } },
        };
        let near = if seed % 5 == 0 { 0.4 } else { 0.0 };
        let camera = Camera { position, focal_point: random(1.0), view_up: DVec3::Z, projection, near };
        let mut all = job(&mesh, scalars.clone(), &camera, (60, 50), dense());
        if seed % 2 == 1 {
            let mut some = CellSet::all(mesh.topology.tets.len());
            (0..some.universe() as u32).filter(|&c| noise(7, u64::from(c)) > 0.5).for_each(|c| some.set(c, false));
            all.active = Arc::new(some);
        }
        all.skip.outside = false;
        let inside = RenderJob { skip: Skip::ALL, ..all.clone() };
        let (all, inside) =
            (Raycast::new().render(all).unwrap().clone(), Raycast::new().render(inside).unwrap().clone());
        assert_eq!((&all.planes.color, &all.planes.depth), (&inside.planes.color, &inside.planes.depth), "seed {seed}");
        assert_eq!((all.stats.entries, all.stats.steps), (inside.stats.entries, inside.stats.steps), "seed {seed}");
        assert_eq!((all.stats.clusters_outside, all.stats.vertices_not_transformed), (0, 0));
        outside += inside.stats.clusters_outside;
        untouched += inside.stats.vertices_not_transformed;
        seen += u32::from(all.planes.color.pixels.iter().any(|p| p[3] > 0.0));
    }
    assert!(outside > 200 && untouched > 50_000, "{outside} clusters, {untouched} vertices");
    assert!(seen > 20, "{seen} images with something to compare");
}

#[test]
fn entry_faces_are_kept_while_mesh_and_cells_are_the_same() {
    let mesh = Arc::new(build(grid(4, 0.16, 1, |_| true)));
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (48, 40), dense());
    let mut always = job.clone();
    always.skip.unchanged = false;
    let mut other = job.clone();
    other.active = Arc::new((*job.active).clone());
    let mut renderer = Raycast::new();
    let expected = Raycast::new().render(job.clone()).unwrap().planes.color.clone();
    for (job, kept) in [(&job, 0), (&job, 1), (&always, 0), (&job, 1), (&other, 0), (&other, 1)] {
        let frame = renderer.render(job.clone()).unwrap();
        assert_eq!(frame.stats.entry_lists_kept, kept);
        assert_same("entry lists", &frame.planes.color, &expected);
    }
    // One cell more or less: its faces and those beside it are found, the others are those of before.
    for cell in [0, 17, 40] {
        let mut cells = (*job.active).clone();
        cells.set(cell, !cells.contains(cell));
        let changed = RenderJob { active: Arc::new(cells), ..job.clone() };
        let expected = Raycast::new().render(changed.clone()).unwrap().clone();
        let frame = renderer.render(changed).unwrap();
        let (kept, faces) = (frame.stats.entry_faces_kept, frame.stats.entry_faces);
        assert!(kept > faces / 2 && kept < faces && faces == expected.stats.entry_faces, "{kept} of {faces}");
        assert_same("changed cells", &frame.planes.color, &expected.planes.color);
    }
}

#[test]
fn the_version_for_newer_processors_draws_the_same_bits() {
    let mesh = Arc::new(build(grid(8, 0.16, 1, |c| c.length() > 0.4)));
    for camera in cameras() {
        for table in [dense(), tents()] {
            let job = job(&mesh, sample(&mesh, wave), &camera, (50, 50), table);
            assert_same("portable", &raycast(&job), &Raycast::portable().render(job).unwrap().planes.color);
        }
    }
}

#[test]
fn opaque_rays_stop_early_and_change_nothing_visible() {
    let mesh = Arc::new(build(grid(8, 0.16, 1, |_| true)));
    let opaque = table(&[(-1.5, [0.2, 0.2, 1.0], 30.0), (1.5, [1.0, 0.2, 0.1], 60.0)]);
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (64, 64), opaque);
    let mut renderer = Raycast::new();
    let early = renderer.render(job.clone()).unwrap().clone();
    let full = renderer.render(RenderJob { skip: Skip { opaque: false, ..Skip::ALL }, ..job }).unwrap().clone();
    assert!(early.stats.rays_stopped_early > 1000 && full.stats.rays_stopped_early == 0);
    assert!(early.stats.steps < full.stats.steps / 2, "{} of {}", early.stats.steps, full.stats.steps);
    assert_eq!((early.planes.color, early.planes.depth), (full.planes.color, full.planes.depth));
}

#[test]
fn renderers_on_the_cpu_wait_for_their_turn_and_draw_the_same() {
    let mesh = Arc::new(build(grid(4, 0.16, 1, |_| true)));
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (48, 40), dense());
    let renderers: [fn() -> Box<dyn Renderer>; 2] = [|| Box::new(Raycast::new()), || Box::new(Reference::default())];
    for new in renderers {
        let alone = new().render(job.clone()).unwrap().planes.color.clone();
        let limit = tetreel::task::ThreadLimit::none();
        limit.set(Some(1));
        let limited = RenderJob { thread_limit: limit.clone(), ..job.clone() };
        // Somebody else has the only turn: not one tile is begun.
        let turn = limit.turn();
        let (tell, told) = std::sync::mpsc::channel();
        let rendering = std::thread::spawn(move || {
            let color = new().render(limited).unwrap().planes.color.clone();
            tell.send(()).unwrap();
            color
        });
        assert!(told.recv_timeout(Duration::from_millis(100)).is_err());
        drop(turn);
        assert_same("a turn later", &rendering.join().unwrap(), &alone);
    }
}

#[test]
fn an_empty_view_and_a_transparent_table_cost_no_steps() {
    let mesh = Arc::new(build(grid(4, 0.16, 1, |_| true)));
    let look_away = Camera { focal_point: DVec3::new(9.0, 9.0, 9.0), ..camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE) };
    let transparent = table(&[(0.0, [1.0; 3], 0.0)]);
    let mut renderer = Raycast::new();
    for job in [
        job(&mesh, sample(&mesh, wave), &look_away, (16, 16), dense()),
        job(&mesh, sample(&mesh, wave), &camera(DVec3::X * 5.0, PERSPECTIVE), (16, 16), transparent),
    ] {
        assert!(reference(&job).pixels.iter().flatten().all(|&v| v == 0.0));
        let frame = renderer.render(job).unwrap();
        assert_eq!(frame.stats.steps, 0);
        assert!(frame.planes.color.pixels.iter().flatten().all(|&v| v == 0.0));
    }
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let mesh = Arc::new(build(grid(2, 0.0, 1, |_| true)));
    let good = job(&mesh, sample(&mesh, wave), &camera(DVec3::X * 5.0, PERSPECTIVE), (8, 8), dense());
    let bad_scalars = RenderJob { scalars: Arc::new(vec![0.0; 3]).into(), ..good.clone() };
    let bad_cells = RenderJob { active: Arc::new(CellSet::all(7)), ..good };
    for renderer in [&mut Raycast::new() as &mut dyn Renderer, &mut Reference::new()] {
        assert!(renderer.render(bad_scalars.clone()).unwrap_err().to_string().contains("3 scalars"));
        assert!(renderer.render(bad_cells.clone()).unwrap_err().to_string().contains("7 cells"));
    }
}

#[test]
fn random_tables_with_steps_and_spikes_agree_with_the_reference() {
    let mesh = Arc::new(build(grid(5, 0.16, 17, |c| c.length() > 0.45)));
    for seed in 0..24u64 {
        let random = |i: u64| noise(100 + seed, i);
        let count = 2 + (seed % 9);
        let mut scalars: Vec<f64> = (0..count).map(|i| 1.5 * random(i)).collect();
        scalars.sort_by(f64::total_cmp);
        // Every third node is a step, every fourth a spike of a millionth of the range.
        let mut nodes = Vec::new();
        for (i, &scalar) in (0u64..).zip(&scalars) {
            let rgb = [0, 1, 2].map(|c| 0.5 + 0.5 * random(50 + 3 * i + c));
            let tau = if random(200 + i) < 0.0 { 0.0 } else { 3.0 * random(200 + i) };
            match i % 4 {
                1 => nodes.extend([(scalar, rgb, 0.0), (scalar, rgb, tau)]),
                3 => nodes.extend([(scalar, rgb, 0.0), (scalar + 1.5e-6, rgb, 3e5 * tau), (scalar + 3e-6, rgb, 0.0)]),
                _ => nodes.push((scalar, rgb, tau)),
            }
        }
        nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let position = DVec3::new(random(300), random(301), random(302)).normalize_or(DVec3::X) * 4.5;
        let job = job(&mesh, sample(&mesh, wave), &camera(position, PERSPECTIVE), (48, 48), table(&nodes));
        assert_within(&format!("seed {seed}, {nodes:?}"), &raycast(&job), &reference(&job));
    }
}

#[test]
fn a_renderer_used_again_keeps_nothing_of_the_jobs_before() {
    let meshes = [grid(5, 0.16, 1, |_| true), grid(4, 0.16, 2, |c| c.length() > 0.4)].map(|raw| Arc::new(build(raw)));
    let mut jobs = Vec::new();
    for (i, mesh) in meshes.iter().enumerate() {
        let base =
            job(mesh, sample(mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), (40 - i, 33), dense());
        let mut some = CellSet::all(mesh.topology.tets.len());
        (0..some.universe() as u32).step_by(3).for_each(|cell| some.set(cell, false));
        let transparent = Arc::new(table(&[(0.0, [1.0; 3], 0.0)]));
        jobs.push(RenderJob { active: Arc::new(some), ..base.clone() });
        jobs.push(RenderJob { table: transparent, ..base.clone() });
        jobs.push(base);
    }
    let colors: Vec<RgbaImage> = jobs.iter().map(raycast).collect();
    assert!((1..colors.len()).all(|i| colors[i] != colors[i - 1]), "what is kept of the job before would show");
    let mut renderer = Raycast::new();
    // Every job after every other one, itself included.
    for first in &jobs {
        for second in &jobs {
            renderer.render(first.clone()).unwrap();
            let again = renderer.render(second.clone()).unwrap();
            let fresh = Raycast::new().render(second.clone()).unwrap().clone();
            assert_eq!((&again.planes.color, again.stats.entry_faces), (&fresh.planes.color, fresh.stats.entry_faces));
        }
    }
}

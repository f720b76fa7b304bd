//! The ray caster against the reference, on scenes made to be difficult.

use super::*;
use crate::meshes::{build, grid, noise, sample};
use std::time::Duration;
use tetreel::render::Advance;
use tetreel::visibility::{CellSet, Skip};

type Shape = Box<dyn Fn(DVec3) -> bool>;

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
fn convex_meshes_agree_with_the_reference() {
    for (name, jitter) in [("regular", 0.0), ("jittered", 0.16)] {
        let mesh = Arc::new(build(grid(6, jitter, 1, |_| true)));
        for (i, camera) in cameras().iter().enumerate() {
            for (t, table) in [dense(), tents()].into_iter().enumerate() {
                let job = job(&mesh, sample(&mesh, wave), camera, (65, 65), table);
                assert_agrees(&format!("{name}, camera {i}, table {t}"), &job);
            }
        }
    }
}

#[test]
fn holes_and_separate_parts_agree_with_the_reference() {
    let shapes: [(&str, Shape); 4] = [
        ("hole", Box::new(|c: DVec3| c.length() > 0.5)),
        ("two parts", Box::new(|c: DVec3| c.x.abs() > 0.3)),
        (
            "checkerboard touching in edges",
            Box::new(|c: DVec3| ((c + DVec3::ONE) * 4.0).floor().as_ivec3().element_sum() % 2 == 0),
        ),
        ("shell", Box::new(|c: DVec3| c.abs().max_element() > 0.6)),
    ];
    for (name, keep) in shapes {
        let mesh = Arc::new(build(grid(8, 0.16, 7, keep)));
        for (i, camera) in cameras().iter().enumerate() {
            // An even size: rays in a plane of boundary faces have no defined answer, and these meshes have flat ones.
            let job = job(&mesh, sample(&mesh, wave), camera, (64, 64), dense());
            assert_agrees(&format!("{name}, camera {i}"), &job);
        }
    }
}

#[test]
fn cameras_inside_agree_with_the_reference() {
    let shapes: [(&str, Shape); 2] =
        [("box", Box::new(|_: DVec3| true)), ("hole", Box::new(|c: DVec3| c.length() > 0.5))];
    for (name, keep) in shapes {
        let mesh = Arc::new(build(grid(6, 0.16, 9, keep)));
        let on_vertex = mesh.positions.world(mesh.positions.local.len() / 2);
        let tet = mesh.topology.tets[100].map(|v| mesh.positions.world(v as usize));
        let on_face = (tet[0] + tet[1] + tet[2]) / 3.0;
        let on_edge = (tet[0] + tet[1]) / 2.0;
        for (i, eye) in [DVec3::new(0.3, 0.2, 0.7), DVec3::new(0.01, 0.02, 0.03), on_vertex, on_face, on_edge]
            .into_iter()
            .enumerate()
        {
            for angle in [30.0, 120.0] {
                for near in [0.0, 0.4] {
                    let camera = Camera {
                        position: eye,
                        focal_point: DVec3::new(-0.4, 0.1, -0.2),
                        view_up: DVec3::Z,
                        projection: Projection::Perspective { view_angle: angle },
                        near,
                    };
                    let job = job(&mesh, sample(&mesh, wave), &camera, (48, 48), dense());
                    assert_agrees(&format!("{name}, eye {i}, angle {angle}, near {near}"), &job);
                }
            }
        }
    }
}

#[test]
fn offsets_and_scales_of_the_world_do_not_matter() {
    let raw = grid(5, 0.16, 3, |c| c.length() > 0.4);
    for (offset, scale) in [(DVec3::splat(1e7), 1.0), (DVec3::ZERO, 1e-30), (DVec3::new(-3e5, 10.0, 8e4), 1e3)] {
        let mut moved = raw.clone();
        for p in &mut moved.points {
            *p = offset + *p * scale;
        }
        let mesh = Arc::new(build(moved));
        let scalars = sample(&mesh, |p| wave((p - offset) / scale));
        let table =
            NodeTable::new(dense().nodes().iter().map(|n| Node { tau: n.tau / scale, ..*n }).collect()).unwrap();
        let mut camera = camera(DVec3::new(3.0, -4.0, 2.0), PERSPECTIVE);
        (camera.position, camera.focal_point) = (offset + scale * camera.position, offset);
        assert_agrees(&format!("offset {offset}, scale {scale}"), &job(&mesh, scalars, &camera, (64, 64), table));
    }
}

#[test]
fn slivers_agree_with_the_reference() {
    for squash in [1e-3, 1e-5] {
        let mut raw = grid(6, 0.16, 5, |_| true);
        for p in &mut raw.points {
            p.z *= squash;
        }
        let mesh = Arc::new(build(raw));
        let scalars = sample(&mesh, |p| wave(DVec3::new(p.x, p.y, p.z / squash)));
        let table =
            NodeTable::new(dense().nodes().iter().map(|n| Node { tau: n.tau / squash, ..*n }).collect()).unwrap();
        for position in [DVec3::new(0.5, 0.3, 4.0), DVec3::new(2.0, 1.0, 3.0)] {
            let job = job(&mesh, scalars.clone(), &camera(position, PERSPECTIVE), (64, 64), table.clone());
            if squash >= 1e-3 {
                assert_agrees(&format!("squash {squash}"), &job);
                continue;
            }
            let fast = raycast(&job);
            assert_within("squash 1e-5: CPU against reference", &fast, &reference(&job));
            #[cfg(feature = "gpu")]
            gpu::assert_slivers_agree(&job, &fast);
        }
    }
}

#[test]
fn cells_with_a_non_finite_scalar_are_holes() {
    let mesh = Arc::new(build(grid(6, 0.16, 11, |_| true)));
    let mut scalars = sample(&mesh, wave);
    for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
        scalars[40 * i + 10] = bad;
    }
    let camera = camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE);
    let job = job(&mesh, scalars, &camera, (64, 64), dense());
    assert!(job.active.count() < job.active.universe());
    assert_agrees("holes", &job);
    assert!(raycast(&job).pixels.iter().flatten().all(|v| v.is_finite()));
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
fn the_comparison_notices_a_changed_scalar_and_a_changed_pixel_convention() {
    let mesh = Arc::new(build(grid(6, 0.16, 1, |_| true)));
    let base = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (64, 64), dense());
    let judge = reference(&base);
    let mut other = base.clone();
    let mut scalars = (*base.scalars).clone();
    let middle = scalars.len() / 2;
    scalars[middle] += 0.1;
    other.scalars = Arc::new(scalars);
    let (rmse, max) = difference(&raycast(&other), &judge);
    assert!(rmse > 1e-5 && max > 1e-3, "one scalar off by 5 % of the range: rmse {rmse:.1e}, max {max:.1e}");
    let mut other = base;
    other.view.half_width *= 1.0 + 0.5 / 64.0;
    let (rmse, max) = difference(&raycast(&other), &judge);
    assert!(rmse > 1e-5 && max > 1e-3, "half a pixel off at the edge: rmse {rmse:.1e}, max {max:.1e}");
}

#[test]
fn slices_and_threads_do_not_change_the_image() {
    let mesh = Arc::new(build(grid(8, 0.16, 1, |c| c.length() > 0.4)));
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (70, 50), dense());
    let whole = raycast(&job);
    let mut sliced = Raycast::new();
    sliced.begin(job.clone()).unwrap();
    let mut slices = 0;
    let image = loop {
        slices += 1;
        match sliced.advance(Duration::ZERO).unwrap() {
            Advance::Partial(frame) => assert_eq!(frame.color.pixels.len(), 70 * 50),
            Advance::Done(frame) => break frame.color.clone(),
        }
    };
    assert!(slices > 1, "the job fits a slice: nothing tested");
    assert_eq!(image, whole);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| raycast(&job)), whole, "{threads} threads");
        assert_eq!(pool.install(|| reference(&job)), reference(&job), "{threads} threads");
    }
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
        assert_eq!((&frame.color, &frame.depth), (&expected.color, &expected.depth));
    }
    renderer.begin(job).unwrap();
    let mut seen = 0;
    while let Advance::Partial(frame) = renderer.advance(Duration::ZERO).unwrap() {
        // What is there is final, and there is more of it every time.
        let pixels = || frame.color.pixels.iter().zip(&expected.color.pixels);
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
    let (mut outside, mut untouched) = (0, 0);
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
        assert_eq!((&all.color, &all.depth), (&inside.color, &inside.depth), "seed {seed}");
        assert_eq!((all.stats.entries, all.stats.steps), (inside.stats.entries, inside.stats.steps), "seed {seed}");
        assert_eq!((all.stats.clusters_outside, all.stats.vertices_not_transformed), (0, 0));
        outside += inside.stats.clusters_outside;
        untouched += inside.stats.vertices_not_transformed;
    }
    assert!(outside > 200 && untouched > 50_000, "{outside} clusters, {untouched} vertices");
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
    let expected = Raycast::new().render(job.clone()).unwrap().color.clone();
    for (job, kept) in [(&job, 0), (&job, 1), (&always, 0), (&job, 1), (&other, 0), (&other, 1)] {
        let frame = renderer.render(job.clone()).unwrap();
        assert_eq!((frame.stats.entry_lists_kept, &frame.color), (kept, &expected));
    }
}

#[test]
fn the_version_for_newer_processors_draws_the_same_bits() {
    let mesh = Arc::new(build(grid(8, 0.16, 1, |c| c.length() > 0.4)));
    for camera in cameras() {
        for table in [dense(), tents()] {
            let job = job(&mesh, sample(&mesh, wave), &camera, (50, 50), table);
            assert_eq!(raycast(&job), Raycast::portable().render(job).unwrap().color);
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
    assert_eq!((early.color, early.depth), (full.color, full.depth));
}

#[test]
fn renderers_on_the_cpu_wait_for_their_turn_and_draw_the_same() {
    let mesh = Arc::new(build(grid(4, 0.16, 1, |_| true)));
    let job = job(&mesh, sample(&mesh, wave), &camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE), (48, 40), dense());
    let renderers: [fn() -> Box<dyn Renderer>; 2] = [|| Box::new(Raycast::new()), || Box::new(Reference::default())];
    for new in renderers {
        let alone = new().render(job.clone()).unwrap().color.clone();
        let limit = tetreel::task::ThreadLimit::none();
        limit.set(Some(1));
        let limited = RenderJob { thread_limit: limit.clone(), ..job.clone() };
        // Somebody else has the only turn: not one tile is begun.
        let turn = limit.turn();
        let (tell, told) = std::sync::mpsc::channel();
        let rendering = std::thread::spawn(move || {
            let color = new().render(limited).unwrap().color.clone();
            tell.send(()).unwrap();
            color
        });
        assert!(told.recv_timeout(Duration::from_millis(100)).is_err());
        drop(turn);
        assert_eq!(rendering.join().unwrap(), alone);
    }
}

#[test]
fn an_empty_view_and_a_transparent_table_cost_no_steps() {
    let mesh = Arc::new(build(grid(4, 0.16, 1, |_| true)));
    let look_away = Camera { focal_point: DVec3::new(9.0, 9.0, 9.0), ..camera(DVec3::new(3.0, 2.0, 2.0), PERSPECTIVE) };
    let clear = table(&[(0.0, [1.0; 3], 0.0)]);
    let mut renderer = Raycast::new();
    for job in [
        job(&mesh, sample(&mesh, wave), &look_away, (16, 16), dense()),
        job(&mesh, sample(&mesh, wave), &camera(DVec3::X * 5.0, PERSPECTIVE), (16, 16), clear),
    ] {
        assert!(reference(&job).pixels.iter().flatten().all(|&v| v == 0.0));
        let frame = renderer.render(job).unwrap();
        assert_eq!(frame.stats.steps, 0);
        assert!(frame.color.pixels.iter().flatten().all(|&v| v == 0.0));
    }
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let mesh = Arc::new(build(grid(2, 0.0, 1, |_| true)));
    let good = job(&mesh, sample(&mesh, wave), &camera(DVec3::X * 5.0, PERSPECTIVE), (8, 8), dense());
    let bad_scalars = RenderJob { scalars: Arc::new(vec![0.0; 3]), ..good.clone() };
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
        let (rmse, max) = difference(&raycast(&job), &reference(&job));
        assert!(rmse <= 1e-5 && max <= 1e-3, "seed {seed}: rmse {rmse:.2e}, max {max:.2e}, {nodes:?}");
    }
}

#[test]
fn labels_on_the_steps_of_a_table_agree_with_the_reference() {
    let mesh = Arc::new(build(grid(6, 0.16, 19, |_| true)));
    // Whole numbers at the vertices, most cells constant, and steps of the table exactly there.
    let labels = sample(&mesh, |p| (2.5 * p.x).floor());
    let steps: Vec<_> = (-3..3)
        .flat_map(|i| {
            let rgb = |i: i32| [0.1 * f64::from(i + 4), 0.5, 0.9 - 0.1 * f64::from(i + 4)];
            let tau = |i: i32| if i % 2 == 0 { 0.7 } else { 0.0 };
            [(f64::from(i), rgb(i), tau(i)), (f64::from(i), rgb(i + 1), tau(i + 1))]
        })
        .collect();
    for camera in cameras() {
        assert_agrees("labels", &job(&mesh, labels.clone(), &camera, (48, 48), table(&steps)));
    }
}

#[test]
fn extremes_of_the_field_agree_with_the_reference() {
    let mesh = Arc::new(build(grid(4, 0.16, 23, |_| true)));
    // Denormals, the largest numbers, a huge offset with a small range: the table spans what f32 can tell apart.
    for (name, lo, hi) in [("denormal", 1e-42, 3e-41), ("huge", -3e38, 3e38), ("offset", 1e7, 1e7 + 64.0)] {
        let scalars = sample(&mesh, |p| lo + (hi - lo) * (0.5 + 0.3 * wave(p)));
        let nodes =
            [(lo, [0.1, 0.2, 0.9], 0.0), (0.5 * lo + 0.5 * hi, [0.2, 0.9, 0.3], 1.0), (hi, [1.0, 0.4, 0.1], 0.3)];
        assert_agrees(
            name,
            &job(&mesh, scalars, &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), (48, 48), table(&nodes)),
        );
    }
    let constant = vec![0.25; mesh.positions.local.len()];
    assert_agrees("constant", &job(&mesh, constant, &camera(DVec3::X * 4.0, PERSPECTIVE), (49, 49), dense()));
}

#[test]
fn an_eye_in_the_plane_of_faces_agrees_with_the_reference() {
    // Every face of this mesh lies in a plane through lattice points: rays from lattice points run along faces.
    let mesh = Arc::new(build(grid(3, 0.0, 1, |_| true)));
    let scalars = sample(&mesh, |p| p.x + 2.0 * p.y * p.z);
    for (eye, focal) in [
        (DVec3::new(0.0, 0.0, -0.2), DVec3::new(0.0, 0.0, -1.0)),
        (DVec3::new(0.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 1.0)),
        (DVec3::new(1.0 / 3.0, 0.1, 0.2), DVec3::new(1.0 / 3.0, 1.0, 0.2)),
    ] {
        for angle in [60.0, 100.0, 170.0] {
            let view_up = if (focal - eye).cross(DVec3::Z).length() < 1e-9 { DVec3::Y } else { DVec3::Z };
            let projection = Projection::Perspective { view_angle: angle };
            let camera = Camera { position: eye, focal_point: focal, view_up, projection, near: 0.0 };
            assert_agrees(&format!("{eye}, {angle}"), &job(&mesh, scalars.clone(), &camera, (101, 67), dense()));
        }
    }
}

#[test]
fn an_eye_on_the_boundary_sees_nothing_behind_it() {
    let mesh = Arc::new(build(grid(3, 0.0, 1, |_| true)));
    let opaque = table(&[(0.0, [1.0; 3], 3e7)]);
    let camera = Camera {
        position: DVec3::new(0.25, 0.31, 1.0),
        focal_point: DVec3::new(2.0, 0.7, 0.9),
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle: 100.0 },
        near: 0.0,
    };
    // An odd height would send a row of rays along the boundary, where there is no defined answer.
    let job = job(&mesh, sample(&mesh, wave), &camera, (64, 48), opaque);
    assert_agrees("eye on the boundary", &job);
    let clear = reference(&job).pixels.iter().filter(|p| p[3] == 0.0).count();
    assert!(clear > 0 && clear < 64 * 48, "{clear} clear pixels");
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
        let clear = Arc::new(table(&[(0.0, [1.0; 3], 0.0)]));
        jobs.push(RenderJob { active: Arc::new(some), ..base.clone() });
        jobs.push(RenderJob { table: clear, ..base.clone() });
        jobs.push(base);
    }
    let mut renderer = Raycast::new();
    // Every job after every other one, itself included.
    for first in &jobs {
        for second in &jobs {
            renderer.render(first.clone()).unwrap();
            let again = renderer.render(second.clone()).unwrap();
            let fresh = Raycast::new().render(second.clone()).unwrap().clone();
            assert_eq!((&again.color, again.stats.entry_faces), (&fresh.color, fresh.stats.entry_faces));
        }
    }
}

#[test]
fn overlapping_cells_are_counted_and_composited_once() {
    let mut raw = grid(4, 0.16, 3, |_| true);
    let moved = raw.points.iter().map(|&p| p + DVec3::new(0.31, 0.17, 0.23)).collect::<Vec<_>>();
    let first = raw.points.len() as u32;
    let again = raw.tets.iter().map(|tet| tet.map(|v| v + first)).collect::<Vec<_>>();
    let alone = Arc::new(build(raw.clone()));
    raw.points.extend(moved);
    raw.tets.extend(again);
    let both = Arc::new(build(raw));
    let out_of_order = |mesh: &Arc<Mesh>| {
        // Constant: which of two overlapping cells has a point does not matter.
        let constant = vec![0.5; mesh.positions.local.len()];
        let job = job(mesh, constant, &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), (48, 48), dense());
        assert_agrees("constant", &job);
        Raycast::new().render(job).unwrap().stats.out_of_order
    };
    assert_eq!(out_of_order(&alone), 0);
    assert!(out_of_order(&both) > 1000);
}

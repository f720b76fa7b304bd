//! Transfer functions of more than the scalar on the GPU, against the reference and the CPU.

use super::cells;
use super::gpu::{context, own_context, points as points_on_gpu, render as walked};
use super::havs::gpu::render as drawn;
use super::havs::{havs, with_all_faces, with_buffer, with_some_faces};
use super::joint::*;
use super::*;
use crate::meshes::{build, grid, noise, sample};
use tetreel::node_table::JointTable;
use tetreel::optics::OpticsKind;
use tetreel::render::gpu::context::{ContextOptions, Tier};
use tetreel::render::gpu::havs::Havs as GpuHavs;
use tetreel::render::gpu::layout::{FRAGMENT_BYTES, JOINT_FRAGMENT_BYTES};
use tetreel::render::gpu::raycast::Raycast as GpuRaycast;
use tetreel::render::{Frame, JointScene, RenderError};
use tetreel::visibility::Skip;

/// Frames of the ray caster, and of the renderers of faces and of points.
fn by_all(job: &RenderJob) -> [(&'static str, Frame); 3] {
    let faces = drawn(&with_all_faces(job)).unwrap();
    [("walk", walked(job).unwrap()), ("faces", faces), ("points", points_on_gpu(job).unwrap())]
}

fn assert_all_agree(name: &str, job: &RenderJob) {
    let judge = reference(job);
    assert!(judge.pixels.iter().any(|p| p[3] > 0.0), "{name}: an empty image proves nothing");
    for (path, frame) in by_all(job) {
        let (rmse, max) = difference(&frame.planes.color, &judge);
        eprintln!("{name}, {path}: rmse {rmse:.1e}, max {max:.1e}");
        assert_within(&format!("{name}, {path}"), &frame.planes.color, &judge);
        assert_eq!((frame.stats.broken_paths, frame.stats.out_of_order), (0, 0), "{name}, {path}");
    }
}

#[test]
fn all_renderers_agree_with_the_reference_in_two_and_three_dimensions() {
    if context().is_none() {
        return;
    }
    for (projection, from) in [(PERSPECTIVE, "perspective"), (PARALLEL, "parallel")] {
        for (name, job) in jobs(5, projection) {
            assert_all_agree(&format!("{name}, {from}"), &job);
            let judge = reference(&job);
            for (path, frame) in by_all(&stretched(&job)) {
                assert_noticed(&format!("{name}, {from}, {path}"), &frame.planes.color, &judge);
            }
        }
    }
}

#[test]
fn one_vertex_and_one_cell_that_change_are_sent_and_seen() {
    if context().is_none() {
        return;
    }
    for (name, job) in jobs(5, PERSPECTIVE) {
        let judge = reference(&job);
        let before = by_all(&job);
        let scene = job.joint.clone().unwrap();
        let nearest = |count: usize, place: &dyn Fn(usize) -> DVec3| {
            let from_eye = |i: &usize| place(*i).distance(job.view.eye);
            (0..count).min_by(|a, b| from_eye(a).total_cmp(&from_eye(b))).unwrap()
        };
        let vertex = nearest(job.scalars.values().len(), &|v| job.mesh.positions.world(v));
        let tets = &job.mesh.topology.tets;
        let middle = |c: usize| tets[c].map(|v| job.mesh.positions.world(v as usize)).iter().sum::<DVec3>() / 4.0;
        let cell = nearest(tets.len(), &middle);
        let changed = |values: &Option<Arc<Vec<f32>>>, at: usize, by: f32| {
            values.as_ref().map(|values| {
                let mut values = (**values).clone();
                values[at] += by;
                Arc::new(values)
            })
        };
        let of_rows = scene.row_values.as_ref().map(|values| values.values().clone());
        let row_values = changed(&of_rows, vertex, 0.3).map(Into::into);
        let vertices = JointScene { row_values, ..scene.clone() };
        let cells = JointScene { cell_values: changed(&scene.cell_values, cell, 0.6), ..scene.clone() };
        for (what, other, differs) in
            [("a vertex", vertices, scene.row_values.is_some()), ("a cell", cells, scene.cell_values.is_some())]
        {
            let other = RenderJob { joint: Some(other), ..job.clone() };
            if differs {
                assert_noticed(&format!("{name}, {what}"), &reference(&other), &judge);
                assert_all_agree(&format!("{name}, {what}"), &other);
            }
        }
        // And back again, through a job without a joint table.
        let plain = RenderJob { joint: None, optics: OpticsKind::Table3d, ..job.clone() };
        assert!(
            by_all(&plain).iter().zip(&before).all(|((_, plain), (_, joint))| plain.planes.color != joint.planes.color),
            "{name}"
        );
        for ((path, now), (_, before)) in by_all(&job).iter().zip(&before) {
            assert!(now.planes == before.planes, "{name}, {path}");
        }
    }
}

#[test]
fn images_depths_and_counts_are_those_of_the_cpu() {
    if context().is_none() {
        return;
    }
    for (name, job) in jobs(6, PERSPECTIVE) {
        let cpu = Raycast::new().render(job.clone()).unwrap().clone();
        for (path, frame) in by_all(&job) {
            // Depths are f32 in the mesh's units, of an extent of 2 at a distance of 4.4: right to 2^-24 of that, but where extinction
            // begins within rounding of a face. Measured: 1e-6 of them.
            let close = |a: f32, b: f32| a == b || (a - b).abs() < 1e-5 * b.abs();
            let differ = frame
                .planes
                .depth
                .pixels
                .iter()
                .zip(&cpu.planes.depth.pixels)
                .filter(|(a, b)| !close(**a, **b))
                .count();
            assert!(differ <= 2, "{name}, {path}: {differ} depths");
            // Pieces whose length is rounded to nothing here are counted there.
            let (here, there) = (frame.stats.segments as f64, cpu.stats.segments as f64);
            assert!((here / there - 1.0).abs() < 0.01, "{name}, {path}: {here} pieces, not {there}");
        }
    }
}

#[test]
fn a_cell_more_is_seen_in_its_own_layer() {
    if context().is_none() {
        return;
    }
    let table =
        Arc::new(table_of(&[0.0], &[0.0], &[0.0, 1.0], |_, _, layer| [0.9, 0.4, 0.1, 0.2 + 2.0 * layer as f32]));
    let jobs = [5, 6].map(|cells| {
        let mut raw = grid(1, 0.0, 1, |_| true);
        raw.cells.tets.truncate(cells);
        let mesh = Arc::new(build(raw));
        let camera = camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE);
        let plain = job(&mesh, sample(&mesh, wave), &camera, (32, 32), (**table.projection()).clone());
        let values = Some(Arc::new(vec![1.0; cells]));
        let scene = JointScene { table: table.clone(), row_values: None, cell_values: values };
        RenderJob { joint: Some(scene), ..plain }
    });
    // The sixth is where the table of five cells left off.
    let [five, six] = &jobs;
    assert!(reference(five) != reference(six));
    for job in [five, six, five] {
        assert_all_agree(&format!("{} cells", job.mesh.topology.tets.len()), job);
    }
}

#[test]
fn one_row_and_one_layer_give_the_image_of_the_node_table() {
    if context().is_none() {
        return;
    }
    let base = scene(6, PERSPECTIVE);
    let nodes = base.table.nodes();
    let value = |n: &Node| [n.rgb[0] as f32, n.rgb[1] as f32, n.rgb[2] as f32, n.tau as f32];
    let scalars = nodes.iter().map(|n| n.scalar).collect();
    let table = JointTable::new(scalars, vec![3.0], vec![-1e9], nodes.iter().map(value).collect()).unwrap();
    let other = with_joint_table(&base, table, Some(vertex_values(&base)), Some(cell_values(&base)));
    for ((path, joint), (_, plain)) in by_all(&other).into_iter().zip(by_all(&base)) {
        let (rmse, max) = difference(&joint.planes.color, &plain.planes.color);
        eprintln!("{path}: rmse {rmse:.1e}, max {max:.1e}");
        // The same pieces, lengths rounded in another way: a share of the segment instead of one of its scalars.
        assert!(rmse < 1e-6 && max < 2e-5, "{path}: rmse {rmse:.1e}, max {max:.1e}");
    }
}

#[test]
fn narrow_flat_and_opaque_tables_agree() {
    if context().is_none() {
        return;
    }
    let base = scene(4, PARALLEL);
    let (vertex, cell) = (Some(vertex_values(&base)), Some(cell_values(&base)));
    let one = table_of(&[0.1], &[0.3], &[0.2], |_, _, _| [0.4, 0.5, 0.6, 0.7]);
    assert_all_agree("one node", &with_joint_table(&base, one, vertex.clone(), cell.clone()));
    assert_all_agree("rows only", &with_joint_table(&base, noisy(&[0.1], &ROWS, &[0.2], 8), vertex.clone(), None));
    assert_all_agree("layers only", &with_joint_table(&base, noisy(&[0.1], &[0.0], &LAYERS, 9), None, cell.clone()));
    assert_all_agree("nothing given", &with_joint_table(&base, noisy(&SCALARS, &ROWS, &LAYERS, 12), None, None));
    let fine: Vec<f64> = (0..60).map(|i| -1.5 + 0.05 * f64::from(i)).collect();
    assert_all_agree("fine", &with_joint_table(&base, noisy(&fine, &fine, &LAYERS, 10), vertex.clone(), cell.clone()));
    let spike = |s: f64, row: f64, _: f64| [0.9, 0.3, 0.1, if s == 0.1 && row == 0.2 { 300.0 } else { 0.0 }];
    let near = |at: f64| [at - 0.1, at, at + 0.1];
    assert_all_agree(
        "spike",
        &with_joint_table(&base, table_of(&near(0.1), &near(0.2), &[0.0], spike), vertex.clone(), None),
    );
    // Rows a millionth of the range apart: as good as a step.
    let rows = [-0.5, 0.2, 0.2 + 1e-6, 0.8];
    assert_all_agree("nearly a step", &with_joint_table(&base, noisy(&SCALARS, &rows, &LAYERS, 11), vertex, cell));
}

#[test]
fn quantities_that_are_no_numbers_or_huge_or_tiny_agree() {
    if context().is_none() {
        return;
    }
    let base = scene(4, PERSPECTIVE);
    let table = noisy(&SCALARS, &ROWS, &LAYERS, 6);
    let (mut vertex, mut cell) = (vertex_values(&base), cell_values(&base));
    for i in (0..vertex.len()).step_by(3) {
        // All that is huge counts as 1e30 times the range here, so that two such of one cell are as huge.
        vertex[i] = [f32::NAN, f32::INFINITY, f32::MAX, f32::MIN][i / 3 % 4];
    }
    for i in (0..cell.len()).step_by(3) {
        cell[i] = [f32::NAN, f32::INFINITY, f32::MIN, 1e-40][i / 3 % 4];
    }
    assert_all_agree("some", &with_joint_table(&base, table, Some(vertex), Some(cell)));
    // All quantities and axes times the same: denormal, small, far beyond f32 in the table.
    for unit in [1e-40, 1e-30, 1e30] {
        let axis = |axis: &[f64]| axis.iter().map(|&x| f64::from((x * unit) as f32)).collect::<Vec<_>>();
        let scaled = |values: Vec<f32>| values.iter().map(|&v| (f64::from(v) * unit) as f32).collect::<Vec<_>>();
        let table = noisy(&axis(&SCALARS), &axis(&ROWS), &axis(&LAYERS), 6);
        let scalars = Arc::new(scaled(base.scalars.values().to_vec())).into();
        let base = RenderJob { scalars, ..base.clone() };
        let job = with_joint_table(&base, table, Some(scaled(vertex_values(&base))), Some(scaled(cell_values(&base))));
        assert_all_agree(&format!("unit {unit:e}"), &job);
    }
    let table = noisy(&SCALARS, &[1e300, 2e300], &[-1e300, 1e300], 6);
    let (vertex, cell) = (Some(vertex_values(&base)), Some(cell_values(&base)));
    assert_all_agree("beyond f32", &with_joint_table(&base, table, vertex, cell));
}

#[test]
fn constant_fields_on_the_places_of_the_axes_have_their_right_sides() {
    if context().is_none() {
        return;
    }
    let base = scene(3, PERSPECTIVE);
    let (vertices, cells) = (base.scalars.values().len(), base.mesh.topology.tets.len());
    let narrow = |axis: &[f64]| axis.iter().map(|&x| f64::from(x as f32)).collect::<Vec<_>>();
    let table = noisy(&narrow(&SCALARS), &narrow(&ROWS), &narrow(&LAYERS), 5);
    for (scalar, vertex, cell) in [(0.1, 0.2, -0.1), (0.1, -9.0, 0.4), (-1.1, 0.8, 9.0), (0.3, 0.0, -0.7)] {
        let (scalar, vertex, cell) = (scalar as f32, vertex as f32, cell as f32);
        let expected = table.eval(f64::from(scalar), f64::from(vertex), f64::from(cell));
        let constant = RenderJob { scalars: Arc::new(vec![scalar; vertices]).into(), ..base.clone() };
        let job = with_joint_table(&constant, table.clone(), Some(vec![vertex; vertices]), Some(vec![cell; cells]));
        let flat = super::table(&[(0.0, expected.rgb, expected.tau)]);
        let flat = reference(&RenderJob { table: Arc::new(flat), joint: None, ..job.clone() });
        for (path, frame) in by_all(&job) {
            assert_within(path, &frame.planes.color, &flat);
        }
    }
}

#[test]
fn eyes_within_the_mesh_see_what_the_reference_sees() {
    if context().is_none() {
        return;
    }
    for seed in 0..8 {
        let random = |i: u64| noise(seed, i);
        let position = 0.8 * DVec3::new(random(0), random(1), random(2));
        let eye = Camera { position, ..camera(DVec3::new(3.0, random(3), random(4)), PERSPECTIVE) };
        for (name, job) in jobs(4, PERSPECTIVE) {
            let job = RenderJob { view: eye.view(40, 32).unwrap(), ..job };
            let judge = reference(&job);
            for (path, frame) in by_all(&job) {
                assert_within(&format!("{name}, {seed}, {path}"), &frame.planes.color, &judge);
            }
        }
    }
}

#[test]
fn some_faces_and_small_buffers_make_the_image_of_the_cpu() {
    if context().is_none() {
        return;
    }
    for (name, job) in jobs(5, PERSPECTIVE) {
        for (what, job) in [
            ("some faces", with_some_faces(&job, 0.4, 1)),
            ("k of 2", with_buffer(&with_all_faces(&job), 2, false)),
            ("some faces, k of 4", with_buffer(&with_some_faces(&job, 0.4, 2), 4, false)),
        ] {
            let (gpu, cpu) = (drawn(&job).unwrap(), havs(&job));
            assert_within(&format!("{name}, {what}"), &gpu.planes.color, &cpu.planes.color);
        }
        let all = havs(&with_all_faces(&job));
        assert_noticed(name, &drawn(&with_some_faces(&job, 0.4, 1)).unwrap().planes.color, &all.planes.color);
    }
}

#[test]
fn bands_and_pixels_of_many_fragments_change_no_bit() {
    let Some(context) = context() else { return };
    let (_, job) = jobs(6, PERSPECTIVE).pop().unwrap();
    let job = with_all_faces(&job);
    let whole = drawn(&job).unwrap();
    let mut banded = GpuHavs::with_fragment_bytes(context, 4_000 * JOINT_FRAGMENT_BYTES);
    let frame = banded.render(job).unwrap().clone();
    assert!(banded.band_count() > 3, "{} bands", banded.band_count());
    assert!(frame.planes == whole.planes);
}

#[test]
fn it_keeps_within_the_default_limits_of_webgpu_and_says_where_it_does_not_fit() {
    let web = ContextOptions { tier: Tier::WebGpu, ..ContextOptions::default() };
    let Some(context) = own_context(&web) else { return };
    for (name, job) in jobs(4, PERSPECTIVE) {
        let judge = reference(&job);
        let walk = GpuRaycast::new(context.clone()).render(job.clone()).unwrap().clone();
        let faces = GpuHavs::new(context.clone()).render(with_all_faces(&job)).unwrap().clone();
        for (path, frame) in [("walk", walk), ("faces", faces)] {
            assert_within(&format!("{name}, {path}"), &frame.planes.color, &judge);
        }
    }
    // Records and vertices of this mesh fit three bindings and one of this size, the table with all its values does not.
    let small = own_context(&ContextOptions { binding_bytes: Some(64 << 10), ..web }).unwrap();
    let job = scene(5, PERSPECTIVE);
    let axis: Vec<f64> = (0..80).map(|i| -1.0 + 0.025 * f64::from(i)).collect();
    let large = with_joint_table(&job, noisy(&axis, &axis, &[0.0], 4), Some(vertex_values(&job)), None);
    let mut renderer = GpuRaycast::new(small);
    let error = renderer.begin(large).unwrap_err();
    assert!(matches!(error, RenderError::BeyondGpu { .. }) && error.to_string().contains("table"), "{error}");
    let fits = with_joint_table(&job, noisy(&SCALARS, &ROWS, &[0.0], 4), Some(vertex_values(&job)), None);
    let judge = reference(&fits);
    assert_within("after that", &renderer.render(fits).unwrap().planes.color, &judge);
}

#[test]
fn a_steady_frame_makes_and_sends_nothing_anew() {
    let Some(context) = own_context(&ContextOptions::default()) else { return };
    let (_, job) = jobs(4, PERSPECTIVE).pop().unwrap();
    // The table decides about nothing else.
    let job = RenderJob { skip: Skip::NONE, ..job };
    let mut renderer = GpuRaycast::new(context.clone());
    let first = renderer.render(job.clone()).unwrap().stats.bytes_uploaded;
    let made = context.resources_created();
    let again = renderer.render(job.clone()).unwrap().stats.bytes_uploaded;
    assert_eq!((context.resources_created(), again), (made, 0), "{first} bytes before");
    // Another table of the same shape: its values alone.
    let mut scene = job.joint.clone().unwrap();
    scene.table = Arc::new(noisy(&SCALARS, &ROWS, &LAYERS, 77));
    let other = RenderJob { table: scene.table.projection().clone(), joint: Some(scene), ..job };
    let sent = renderer.render(other.clone()).unwrap().stats.bytes_uploaded;
    assert!(sent > 0 && sent < 16 * 400, "{sent} of {first} bytes");
    assert_within("another table", &renderer.render(other.clone()).unwrap().planes.color, &reference(&other));
}

#[test]
fn some_faces_small_buffers_and_bands_draw_scalars_of_cells_as_the_cpu_does() {
    let Some(context) = context() else { return };
    let (_, base) = cells::scenes().swap_remove(0);
    for (name, job) in cells::joint_jobs(&base) {
        for (what, job) in [
            ("some faces", with_some_faces(&job, 0.4, 1)),
            ("k of 2", with_buffer(&with_all_faces(&job), 2, false)),
            ("some faces, k of 4", with_buffer(&with_some_faces(&job, 0.4, 2), 4, false)),
        ] {
            let (gpu, cpu) = (drawn(&job).unwrap(), havs(&job));
            assert_within(&format!("{name}, {what}"), &gpu.planes.color, &cpu.planes.color);
        }
        let all = with_all_faces(&job);
        assert_noticed(name, &drawn(&with_some_faces(&job, 0.4, 1)).unwrap().planes.color, &havs(&all).planes.color);
        let mut banded = GpuHavs::with_fragment_bytes(context.clone(), 4_000 * FRAGMENT_BYTES);
        let frame = banded.render(all.clone()).unwrap().clone();
        assert!(banded.band_count() > 3 && frame.planes == drawn(&all).unwrap().planes, "{name}");
    }
}

#[test]
fn scalars_and_rows_of_cells_are_sent_when_they_change_and_stay_when_the_job_does_not() {
    let web = ContextOptions { tier: Tier::WebGpu, ..ContextOptions::default() };
    let Some(context) = own_context(&web) else { return };
    let (_, base) = cells::scenes().swap_remove(0);
    let [_, (_, of_rows), (_, of_both)] = cells::joint_jobs(&base).map(|(name, job)| {
        let skip = Skip::NONE;
        (name, RenderJob { skip, ..job })
    });
    let (_, of_vertices) = jobs(4, PERSPECTIVE).pop().unwrap();
    let plain = RenderJob { skip: Skip::NONE, ..base.clone() };
    let mut renderer = GpuRaycast::new(context.clone());
    // From scalars, rows and gradients of one kind to those of another and back, all in the same places.
    for (name, job) in [
        ("rows", &of_rows),
        ("plain", &plain),
        ("both", &of_both),
        ("vertices", &of_vertices),
        ("plain again", &plain),
        ("rows again", &of_rows),
    ] {
        let frame = renderer.render(job.clone()).unwrap().clone();
        assert_within(name, &frame.planes.color, &reference(job));
        let made = context.resources_created();
        let again = renderer.render(job.clone()).unwrap();
        assert_eq!((context.resources_created(), again.stats.bytes_uploaded), (made, 0), "{name}");
        assert!(again.planes == frame.planes, "{name}");
    }
    // Rows stay while a step without a joint table is shown; another map sends no scalars.
    renderer.render(plain.clone()).unwrap();
    let table = 16 * 400;
    let sent = renderer.render(of_rows.clone()).unwrap().stats.bytes_uploaded;
    assert!(sent > 0 && sent < table, "{sent} bytes");
    let wide = table_of(&[-9.0, 9.0], &[0.0], &[0.0], |_, _, _| [0.9, 0.4, 0.1, 0.2]);
    let wide = RenderJob { table: wide.projection().clone(), ..plain };
    let sent = renderer.render(wide.clone()).unwrap().stats.bytes_uploaded;
    assert!(sent > 0 && sent < table, "{sent} bytes");
    assert_within("another map", &renderer.render(wide.clone()).unwrap().planes.color, &reference(&wide));
}

//! Transfer functions of more than the scalar: the reference against closed forms, and the fast paths against the reference.

use super::havs::{havs, with_all_faces, with_some_faces};
use super::*;
use crate::meshes::{build, grid, noise, sample};
use proptest::prelude::*;
use tetreel::node_table::{JointAxis, JointTable, JointTableError};
use tetreel::optics::OpticsKind;
use tetreel::render::{JointScene, RenderError};
use tetreel::visibility::{CellSet, Skip};

pub const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };
pub const PARALLEL: Projection = Projection::Parallel { scale: 1.27 };

/// The job with a table in place of its own.
pub fn with_joint_table(
    job: &RenderJob,
    table: JointTable,
    vertex: Option<Vec<f32>>,
    cell: Option<Vec<f32>>,
) -> RenderJob {
    let projection = table.projection().clone();
    let row_values = vertex.map(|values| Arc::new(values).into());
    let scene = JointScene { table: Arc::new(table), row_values, cell_values: cell.map(Arc::new) };
    RenderJob { table: projection, joint: Some(scene), ..job.clone() }
}

/// A table of these axes with `value` at each (scalar, row, layer).
pub fn table_of(
    scalars: &[f64],
    rows: &[f64],
    layers: &[f64],
    value: impl Fn(f64, f64, f64) -> [f32; 4],
) -> JointTable {
    let along = |layer: f64| rows.iter().flat_map(move |&row| scalars.iter().map(move |&s| (s, row, layer)));
    let values = layers.iter().flat_map(|&layer| along(layer)).map(|(s, row, layer)| value(s, row, layer)).collect();
    JointTable::new(scalars.to_vec(), rows.to_vec(), layers.to_vec(), values).unwrap()
}

/// A table with other values at every place, a third of them transparent.
pub fn noisy(scalars: &[f64], rows: &[f64], layers: &[f64], seed: u64) -> JointTable {
    let value = |i: u64| {
        let of = |k: u64| (0.5 + 0.5 * noise(seed, 4 * i + k)) as f32;
        [of(0), of(1), of(2), 3.0 * (of(3) - 0.3).max(0.0)]
    };
    let count = (scalars.len() * rows.len() * layers.len()) as u64;
    JointTable::new(scalars.to_vec(), rows.to_vec(), layers.to_vec(), (0..count).map(value).collect()).unwrap()
}

/// Scalar nodes with a step, over the range of [`wave`] and not all of it.
pub const SCALARS: [f64; 7] = [-1.1, -0.6, -0.2, 0.1, 0.1, 0.45, 1.2];
pub const ROWS: [f64; 5] = [-0.5, 0.0, 0.2, 0.21, 0.8];
/// With two steps.
pub const LAYERS: [f64; 6] = [-0.7, -0.1, -0.1, 0.4, 0.4, 0.6];

/// An irregular mesh with a hole, seen from a corner.
pub fn scene(n: usize, projection: Projection) -> RenderJob {
    let mesh = Arc::new(build(grid(n, 0.16, 1, |c| c.length() > 0.4)));
    let camera = camera(DVec3::new(3.0, 2.0, 2.5), projection);
    job(&mesh, sample(&mesh, wave), &camera, (48, 48), dense())
}

pub fn vertex_values(job: &RenderJob) -> Vec<f32> {
    sample(&job.mesh, |p| (1.3 * p.y - 0.8 * p.z).sin())
}

pub fn cell_values(job: &RenderJob) -> Vec<f32> {
    (0..job.mesh.topology.tets.len() as u64).map(|cell| noise(7, cell) as f32).collect()
}

/// Two-dimensional and three-dimensional jobs.
pub fn jobs(n: usize, projection: Projection) -> Vec<(&'static str, RenderJob)> {
    let base = scene(n, projection);
    let (vertex, cell) = (vertex_values(&base), cell_values(&base));
    vec![
        ("per cell", with_joint_table(&base, noisy(&SCALARS, &[0.0], &LAYERS, 1), None, Some(cell.clone()))),
        ("per vertex", with_joint_table(&base, noisy(&SCALARS, &ROWS, &[0.0], 2), Some(vertex.clone()), None)),
        ("both", with_joint_table(&base, noisy(&SCALARS, &ROWS, &LAYERS, 3), Some(vertex), Some(cell))),
    ]
}

fn assert_all_agree(name: &str, job: &RenderJob) {
    let judge = reference(job);
    assert!(judge.pixels.iter().any(|p| p[3] > 0.0), "{name}: an empty image proves nothing");
    let faces = havs(&with_all_faces(job)).planes.color;
    for (path, image) in [("ray caster", raycast(job)), ("faces", faces), ("points", points(job).planes.color)] {
        let (rmse, max) = difference(&image, &judge);
        eprintln!("{name}, {path}: rmse {rmse:.1e}, max {max:.1e}");
        assert_within(&format!("{name}, {path}"), &image, &judge);
    }
}

#[test]
fn every_renderer_agrees_with_the_reference_in_two_and_three_dimensions() {
    for (projection, from) in [(PERSPECTIVE, "perspective"), (PARALLEL, "parallel")] {
        for (name, job) in jobs(5, projection) {
            assert_all_agree(&format!("{name}, {from}"), &job);
        }
    }
}

#[test]
fn the_comparison_notices_one_vertex_and_one_cell() {
    for (name, job) in jobs(5, PERSPECTIVE) {
        let judge = reference(&job);
        let scene = job.joint.clone().unwrap();
        let mut others = Vec::new();
        if let Some(values) = &scene.row_values {
            let mut values = values.values().to_vec();
            let nearest = (0..values.len()).min_by(|&a, &b| {
                let from_eye = |v: usize| job.mesh.positions.world(v).distance(job.view.eye);
                from_eye(a).total_cmp(&from_eye(b))
            });
            values[nearest.unwrap()] += 0.3;
            others.push(JointScene { row_values: Some(Arc::new(values).into()), ..scene.clone() });
        }
        if let Some(values) = &scene.cell_values {
            let mut values = (**values).clone();
            let nearest = (0..values.len()).min_by(|&a, &b| {
                let corner = |c: usize| job.mesh.topology.tets[c].map(|v| job.mesh.positions.world(v as usize));
                let from_eye = |c: usize| corner(c).iter().map(|p| p.distance(job.view.eye)).sum::<f64>();
                from_eye(a).total_cmp(&from_eye(b))
            });
            let nearest = nearest.unwrap();
            values[nearest] = if values[nearest] > 0.0 { -0.5 } else { 0.5 };
            others.push(JointScene { cell_values: Some(Arc::new(values)), ..scene });
        }
        for scene in others {
            let other = RenderJob { joint: Some(scene), ..job.clone() };
            for image in [raycast(&other), havs(&with_all_faces(&other)).planes.color, reference(&other)] {
                let (rmse, max) = difference(&image, &judge);
                assert!(rmse > 1e-5 && max > 1e-3, "{name}: rmse {rmse:.1e}, max {max:.1e}");
            }
        }
    }
}

#[test]
fn a_joint_table_of_one_row_and_one_layer_gives_the_image_of_its_node_table() {
    let base = scene(6, PERSPECTIVE);
    let nodes = base.table.nodes();
    let value = |n: &Node| [n.rgb[0] as f32, n.rgb[1] as f32, n.rgb[2] as f32, n.tau as f32];
    let scalars = nodes.iter().map(|n| n.scalar).collect();
    let table = JointTable::new(scalars, vec![3.0], vec![-1e9], nodes.iter().map(value).collect()).unwrap();
    // Whatever the quantities and the optics are.
    let other = with_joint_table(&base, table, Some(vertex_values(&base)), Some(cell_values(&base)));
    let other = RenderJob { optics: OpticsKind::Table3d, ..other };
    let faces = |job| havs(&with_all_faces(job));
    let pairs = [
        ("ray caster", raycast(&other), raycast(&base)),
        ("faces", faces(&other).planes.color, faces(&base).planes.color),
        (
            "some faces",
            havs(&with_some_faces(&other, 0.3, 1)).planes.color,
            havs(&with_some_faces(&base, 0.3, 1)).planes.color,
        ),
        ("reference", reference(&other), reference(&base)),
    ];
    for (name, image, expected) in pairs {
        let (rmse, max) = difference(&image, &expected);
        eprintln!("{name}: rmse {rmse:.1e}, max {max:.1e}");
        // Values are f32 there and f64 here, and summed in another order: some roundings of 1.
        assert!(rmse < 1e-6 && max < 1e-5, "{name}: rmse {rmse:.1e}, max {max:.1e}");
    }
    let depth = |job: &RenderJob| Raycast::new().render(job.clone()).unwrap().planes.depth.clone();
    let differ = depth(&other).pixels.iter().zip(&depth(&base).pixels).filter(|(a, b)| a != b).count();
    assert_eq!(differ, 0, "depths");
    assert!(
        difference(&raycast(&other), &raycast(&RenderJob { table: Arc::new(table_with_half(&base)), ..base })).1 > 1e-3
    );
}

fn table_with_half(job: &RenderJob) -> NodeTable {
    NodeTable::new(job.table.nodes().iter().map(|n| Node { tau: 0.5 * n.tau, ..*n }).collect()).unwrap()
}

/// The box seen along z by parallel rays, its scalar rising from 0 to 1 on the way, and a quantity of vertices that depends on x.
fn slab(table: JointTable, value: impl Fn(DVec3) -> f64) -> RenderJob {
    let mesh = Arc::new(build(grid(4, 0.16, 3, |_| true)));
    let along = sample(&mesh, |p| 0.5 - 0.5 * p.z);
    let base =
        job(&mesh, along, &camera(DVec3::new(0.0, 0.0, 5.0), Projection::Parallel { scale: 0.93 }), (17, 17), dense());
    let values = sample(&mesh, value);
    with_joint_table(&base, table, Some(values), None)
}

/// Largest difference in opacity of the reference and the fast paths from that of an optical depth that depends on x.
fn off_by(job: &RenderJob, depth: impl Fn(f64) -> f64) -> f64 {
    let mut worst: f64 = 0.0;
    for image in [reference(job), raycast(job), havs(&with_all_faces(job)).planes.color] {
        for (at, pixel) in image.pixels.iter().enumerate() {
            let (x, _) = job.view.ray(at % 17, at / 17);
            let side = job.view.right.x;
            worst = worst.max((f64::from(pixel[3]) + (-depth(side * x)).exp_m1()).abs());
        }
    }
    worst
}

#[test]
fn slabs_have_the_opacity_of_their_closed_forms() {
    // Linear in both: over a length of 2 the mean of both ends. Scalars are f32: half a bit of 1, times extinctions of up to 2.
    let plane = |s: f64, row: f64, _: f64| [0.5, 0.5, 0.5, (0.25 + 0.5 * s + 0.75 * row) as f32];
    let axis = [0.0, 0.3, 1.0];
    let share = |p: DVec3| 0.5 + 0.5 * p.x;
    let job = slab(table_of(&axis, &axis, &[0.0], plane), share);
    let depth = |x: f64| 2.0 * (0.25 + 0.25 + 0.75 * (0.5 + 0.5 * x));
    let off = off_by(&job, depth);
    assert!(off < 1e-6, "{off:.1e}");
    assert!(off_by(&job, |x| 1.0001 * depth(x)) > 1e-5);
    // One corner of a square: below the diagonal extinction is scalar less row, above it is nothing.
    let corner = |s: f64, row: f64, _: f64| [0.5, 0.5, 0.5, if s > row { 4.0 } else { 0.0 }];
    let job = slab(table_of(&[0.0, 1.0], &[0.0, 1.0], &[0.0], corner), share);
    let depth = |x: f64| 4.0 * (0.5 - 0.5 * x).powi(2);
    let off = off_by(&job, depth);
    assert!(off < 1e-6, "{off:.1e}");
    // Cut along the other diagonal it would be the product of scalar and rest at most.
    assert!(off_by(&job, |x| 4.0 * (0.5 - 0.5 * x)) > 0.01);
    // Both rise along the ray: along the diagonal nothing is seen, beside it all is.
    let job = slab(table_of(&[0.0, 1.0], &[0.0, 1.0], &[0.0], corner), |p| 0.5 - 0.5 * p.z);
    assert!(off_by(&job, |_| 0.0) < 1e-6);
}

#[test]
fn a_quantity_of_cells_is_the_same_in_all_of_a_cell() {
    let base = scene(5, PERSPECTIVE);
    let cells = cell_values(&base);
    // Cells above 0 as the ramp, others transparent: the image of these cells alone.
    let values = |s: f64, _: f64, layer: f64| [0.2, 0.6, 0.9, if layer < 0.5 { 0.0 } else { (1.5 + s) as f32 }];
    let is_seen = |value: f32| if value > 0.0 { 1.0 } else { 0.0 };
    let table = table_of(&[-1.5, 1.5], &[0.0], &[0.0, 1.0], values);
    let job = with_joint_table(&base, table, None, Some(cells.iter().map(|&v| is_seen(v)).collect()));
    let mut active = CellSet::none(cells.len());
    (0..).zip(&cells).for_each(|(cell, &value)| active.set(cell, base.active.contains(cell) && value > 0.0));
    let ramp = super::table(&[(-1.5, [0.2, 0.6, 0.9], 0.0), (1.5, [0.2, 0.6, 0.9], 3.0)]);
    let alone = RenderJob { table: Arc::new(ramp), active: Arc::new(active), ..base };
    assert_within("reference", &reference(&job), &reference(&alone));
    assert_within("ray caster", &raycast(&job), &raycast(&alone));
    assert_all_agree("cells", &job);
    // A layer half way between is half of both.
    let half =
        with_joint_table(&job, job.joint.clone().unwrap().table.as_ref().clone(), None, Some(vec![0.5; cells.len()]));
    let thin = super::table(&[(-1.5, [0.1, 0.3, 0.45], 0.0), (1.5, [0.1, 0.3, 0.45], 1.5)]);
    let alpha = |image: RgbaImage| RgbaImage { pixels: image.pixels.iter().map(|p| [p[3]; 4]).collect(), ..image };
    let thin = RenderJob { table: Arc::new(thin), joint: None, ..job };
    assert_within("half", &alpha(reference(&half)), &alpha(reference(&thin)));
}

#[test]
fn steps_hold_on_the_right_side_wherever_a_constant_field_lies_on_them() {
    let base = scene(4, PERSPECTIVE);
    let (vertices, cells) = (base.scalars.values().len(), base.mesh.topology.tets.len());
    let table = noisy(&SCALARS, &ROWS, &LAYERS, 5);
    for (scalar, vertex, cell) in [(0.1, 0.2, -0.1), (0.1, -9.0, 0.4), (-1.1, 0.8, 9.0), (0.3, 0.0, -0.7)] {
        let (scalar, vertex, cell) = (scalar as f32, vertex as f32, cell as f32);
        // f32 numbers, so that the field lies exactly on the places of the axes.
        let narrow = |axis: &[f64]| axis.iter().map(|&x| f64::from(x as f32)).collect::<Vec<_>>();
        let (s, r, l) = (narrow(table.scalars()), narrow(table.vertex_axis()), narrow(table.cell_axis()));
        let table = noisy(&s, &r, &l, 5);
        let expected = table.eval(f64::from(scalar), f64::from(vertex), f64::from(cell));
        let constant = RenderJob { scalars: Arc::new(vec![scalar; vertices]).into(), ..base.clone() };
        let job = with_joint_table(&constant, table, Some(vec![vertex; vertices]), Some(vec![cell; cells]));
        let flat = super::table(&[(0.0, expected.rgb, expected.tau)]);
        let flat = RenderJob { table: Arc::new(flat), joint: None, ..job.clone() };
        assert_within("reference", &reference(&job), &reference(&flat));
        assert_within("ray caster", &raycast(&job), &reference(&flat));
        assert_within("faces", &havs(&with_all_faces(&job)).planes.color, &reference(&flat));
    }
}

#[test]
fn values_that_are_no_numbers_have_the_lowest_row_and_layer_and_infinite_ones_the_last() {
    let base = scene(4, PERSPECTIVE);
    let (vertices, cells) = (base.scalars.values().len(), base.mesh.topology.tets.len());
    let table = noisy(&SCALARS, &ROWS, &LAYERS, 6);
    let with = |vertex: f32, cell: f32| {
        with_joint_table(&base, table.clone(), Some(vec![vertex; vertices]), Some(vec![cell; cells]))
    };
    let lowest = raycast(&with(-0.5, -0.7));
    for job in
        [with(f32::NAN, f32::NAN), with_joint_table(&base, table.clone(), None, None), with(f32::NEG_INFINITY, -1e38)]
    {
        assert_within("lowest", &raycast(&job), &lowest);
        assert_all_agree("lowest", &job);
    }
    let highest = with(f32::INFINITY, f32::INFINITY);
    assert_within("highest", &raycast(&highest), &raycast(&with(0.8, 0.6)));
    assert!(difference(&raycast(&highest), &lowest).1 > 1e-3);
    // One vertex and one cell among others.
    let (mut vertex, mut cell) = (vertex_values(&base), cell_values(&base));
    for i in (0..vertex.len()).step_by(3) {
        vertex[i] = [f32::NAN, f32::INFINITY, f32::MAX, -1e30][i / 3 % 4];
    }
    cell.iter_mut().step_by(3).for_each(|value| *value = f32::NAN);
    assert_all_agree("some", &with_joint_table(&base, table, Some(vertex), Some(cell)));
}

#[test]
fn tables_of_one_node_and_narrow_and_opaque_ones_are_drawn() {
    let base = scene(4, PARALLEL);
    let (vertex, cell) = (Some(vertex_values(&base)), Some(cell_values(&base)));
    let one = table_of(&[0.1], &[0.3], &[0.2], |_, _, _| [0.4, 0.5, 0.6, 0.7]);
    assert_all_agree("one node", &with_joint_table(&base, one, vertex.clone(), cell.clone()));
    let rows_only = noisy(&[0.1], &ROWS, &[0.2], 8);
    assert_all_agree("rows only", &with_joint_table(&base, rows_only, vertex.clone(), None));
    let layers_only = noisy(&[0.1], &[0.0], &LAYERS, 9);
    assert_all_agree("layers only", &with_joint_table(&base, layers_only, None, cell.clone()));
    let fine: Vec<f64> = (0..60).map(|i| -1.5 + 0.05 * f64::from(i)).collect();
    assert_all_agree("fine", &with_joint_table(&base, noisy(&fine, &fine, &LAYERS, 10), vertex.clone(), cell.clone()));
    // A spike in the middle of nothing, opaque within.
    let spike = |s: f64, row: f64, _: f64| [0.9, 0.3, 0.1, if s == 0.1 && row == 0.2 { 300.0 } else { 0.0 }];
    let near = |at: f64| [at - 0.1, at, at + 0.1];
    assert_all_agree("spike", &with_joint_table(&base, table_of(&near(0.1), &near(0.2), &[0.0], spike), vertex, None));
}

#[test]
fn what_is_left_out_changes_no_bit() {
    for (name, job) in jobs(6, PERSPECTIVE) {
        // Transparent below 0.
        let scene = job.joint.clone().unwrap();
        let table = &scene.table;
        let scalars = table.scalars().to_vec();
        let columns = scalars.len();
        let places = (0..table.cell_axis().len()).flat_map(|l| (0..table.vertex_axis().len()).map(move |r| (l, r)));
        let value =
            |i: usize, r: usize, l: usize| if table.scalars()[i] < 0.0 { [0.0; 4] } else { table.value(i, r, l) };
        let values = places.flat_map(|(l, r)| (0..columns).map(move |i| value(i, r, l))).collect();
        let cut = JointTable::new(scalars, table.vertex_axis().to_vec(), table.cell_axis().to_vec(), values).unwrap();
        let vertex = scene.row_values.as_ref().map(|values| values.values().to_vec());
        let cell = scene.cell_values.as_ref().map(|values| values.to_vec());
        let all = RenderJob { skip: Skip::NONE, ..with_joint_table(&job, cut, vertex, cell) };
        let mut visible = CellSet::none(all.active.universe());
        for cell in 0..all.active.universe() as u32 {
            let scalars = all.mesh.topology.tets[cell as usize].map(|v| f64::from(all.scalars.values()[v as usize]));
            let (lo, hi) = scalars.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &s| (l.min(s), h.max(s)));
            visible.set(cell, all.active.contains(cell) && all.table.is_visible_in(lo, hi));
        }
        assert!(visible.count() < all.active.count(), "{name}: nothing is left out");
        let less = RenderJob { active: Arc::new(visible), ..all.clone() };
        let frame = |job: &RenderJob| Raycast::new().render(job.clone()).unwrap().clone();
        let (a, b) = (frame(&all), frame(&less));
        assert!(a.planes == b.planes, "{name}");
        let chosen = RenderJob { finite: Some(all.active.clone()), skip: Skip::ALL, ..less.clone() };
        assert_within(name, &raycast(&chosen), &a.planes.color);
        assert_within(name, &havs(&with_all_faces(&less)).planes.color, &a.planes.color);
        // One visible cell less is noticed.
        let mut fewer = (*less.active).clone();
        (0..fewer.universe() as u32).filter(|&c| less.active.contains(c)).take(9).for_each(|c| fewer.set(c, false));
        assert!(frame(&RenderJob { active: Arc::new(fewer), ..less }).planes.color != a.planes.color, "{name}");
    }
}

#[test]
fn depths_are_those_of_the_reference() {
    for (name, job) in jobs(5, PERSPECTIVE) {
        let judge = Reference::new().render(job.clone()).unwrap().clone();
        for frame in [Raycast::new().render(job.clone()).unwrap().clone(), havs(&with_all_faces(&job))] {
            let close = |a: f32, b: f32| a == b || (a - b).abs() < 1e-5 * b.abs();
            let differ = frame
                .planes
                .depth
                .pixels
                .iter()
                .zip(&judge.planes.depth.pixels)
                .filter(|(a, b)| !close(**a, **b))
                .count();
            assert_eq!(differ, 0, "{name}");
        }
        assert!(judge.planes.depth.pixels.iter().filter(|d| d.is_finite()).count() > 100, "{name}");
    }
}

#[test]
fn gaps_between_drawn_have_both_quantities_of_their_ends() {
    // Where both are linear in space, the faces in between do not matter, but for the eye in the mesh.
    let base = scene(5, PERSPECTIVE);
    let flat = |scalars: Vec<f32>| RenderJob { scalars: Arc::new(scalars).into(), ..base.clone() };
    let base = flat(sample(&base.mesh, |p| 0.7 * p.x - 0.2 * p.y + 0.3 * p.z));
    let vertex = sample(&base.mesh, |p| 0.3 * p.x + 0.5 * p.y - 0.4 * p.z);
    let eye = camera(DVec3::new(0.6, 0.7, 0.5), PERSPECTIVE).view(48, 48).unwrap();
    for view in [base.view.clone(), eye] {
        let base = RenderJob { view, ..base.clone() };
        let job = with_joint_table(&base, noisy(&SCALARS, &ROWS, &[0.0], 2), Some(vertex.clone()), None);
        let judge = reference(&job);
        for share in [0.0, 0.3, 1.0] {
            let image = havs(&with_some_faces(&job, share, 1)).planes.color;
            assert_within(&format!("{share}"), &image, &judge);
        }
    }
}

#[test]
fn quantities_of_another_mesh_are_refused() {
    let base = scene(3, PERSPECTIVE);
    let table = noisy(&SCALARS, &ROWS, &LAYERS, 6);
    let vertices = with_joint_table(&base, table.clone(), Some(vec![0.0; 3]), None);
    let cells = with_joint_table(&base, table, None, Some(vec![0.0; 4]));
    for (job, given) in [(vertices, 3), (cells, 4)] {
        let error = Raycast::new().begin(job.clone()).unwrap_err();
        assert!(matches!(error, RenderError::JointValueCount { given: g, .. } if g == given), "{error}");
        assert!(Reference::new().begin(job).is_err());
    }
}

#[test]
fn axes_and_values_at_fault_are_named() {
    let new =
        |s: &[f64], r: &[f64], l: &[f64], v: Vec<[f32; 4]>| JointTable::new(s.to_vec(), r.to_vec(), l.to_vec(), v);
    let ok = vec![[0.5f32; 4]; 2];
    assert_eq!(new(&[], &[0.0], &[0.0], vec![]), Err(JointTableError::Empty(JointAxis::Scalar)));
    assert_eq!(new(&[0.0], &[0.0, 0.0], &[0.0], ok.clone()), Err(JointTableError::NotSorted(JointAxis::Vertex, 1)));
    assert_eq!(new(&[1.0, 0.0], &[0.0], &[0.0], ok.clone()), Err(JointTableError::NotSorted(JointAxis::Scalar, 1)));
    assert!(new(&[0.0, 0.0], &[0.0], &[0.0], ok.clone()).is_ok() && new(&[0.0], &[0.0], &[1.0; 2], ok.clone()).is_ok());
    assert_eq!(new(&[0.0], &[0.0], &[1.0; 3], vec![[0.5; 4]; 3]), Err(JointTableError::NotSorted(JointAxis::Cell, 2)));
    assert_eq!(new(&[f64::NAN], &[0.0], &[0.0], ok.clone()), Err(JointTableError::NotFinite(JointAxis::Scalar)));
    assert_eq!(new(&[-1e308, 1e308], &[0.0], &[0.0], ok), Err(JointTableError::NotFinite(JointAxis::Scalar)));
    let count = JointTableError::ValueCount { given: 1, expected: 2 };
    assert_eq!(new(&[0.0, 1.0], &[0.0], &[0.0], vec![[0.5; 4]]), Err(count));
    for bad in [[0.5, 0.5, 1.5, 0.0], [0.5, 0.5, 0.5, -1.0], [0.5, 0.5, 0.5, f32::INFINITY], [f32::NAN, 0.0, 0.0, 0.0]]
    {
        assert_eq!(new(&[0.0], &[0.0], &[0.0], vec![bad]), Err(JointTableError::BadValue(0)));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_projection_is_nowhere_below_the_table(seed in 0..1000u64, places in prop::collection::vec(prop::array::uniform3(-2.0..2.0_f64), 30)) {
        let table = noisy(&SCALARS, &ROWS, &LAYERS, seed);
        let projection = table.projection();
        for [s, row, layer] in places {
            let (here, above) = (table.eval(s, row, layer), projection.eval(s));
            // A few roundings of both sums.
            prop_assert!(here.tau <= above.tau * (1.0 + 1e-12), "{here:?} {above:?}");
            prop_assert!(here.tau >= 0.0 && here.rgb.iter().all(|c| (0.0..=1.0).contains(c)));
        }
        // Values at places of the axes are met exactly.
        for (i, j, k) in [(0, 0, 0), (2, 3, 3), (6, 4, 5), (4, 1, 2)] {
            let node = table.eval(SCALARS[i], ROWS[j], LAYERS[k]);
            // At a step the upper one holds.
            let k = if k == 3 { 4 } else { k };
            prop_assert_eq!(node.tau as f32, table.value(i, j, k)[3]);
        }
    }
}

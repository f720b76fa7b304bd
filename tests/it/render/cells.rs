//! Scalars of cells, constant in each: against closed forms, against the judge, and from renderer to renderer.

use super::joint::{LAYERS, PERSPECTIVE, ROWS, SCALARS, noisy, with_joint_table};
use super::surfaces::{OUTSIDE, alone, compare_depths, planes, shading, slivers, with_holes};
use super::*;
use crate::meshes::{build, grid, noise, sample};
use tetreel::field::Scalars;
use tetreel::node_table::JointTable;
use tetreel::optics::OpticsKind;
use tetreel::render::JointScene;
use tetreel::render::surfaces::{Cut, FieldBeside, Normals, SurfaceScene, SurfaceShading, cut_planes};
use tetreel::visibility::{CellSet, Skip};

/// The paths that there are on this machine beside the judge; the last three on its GPU.
fn paths() -> Vec<&'static str> {
    super::surfaces::paths()
}

/// Those on the CPU.
const PATHS: [&str; 4] = ["raycast", "portable", "faces", "points"];

fn centroid(mesh: &Mesh, cell: usize) -> DVec3 {
    mesh.topology.tets[cell].iter().map(|&v| mesh.positions.world(v as usize)).sum::<DVec3>() / 4.0
}

/// The job with a scalar for each of its cells; those that are not finite are holes.
fn of_cells(job: &RenderJob, value: impl Fn(usize, DVec3) -> f64) -> RenderJob {
    let values: Vec<f32> =
        (0..job.mesh.topology.tets.len()).map(|cell| value(cell, centroid(&job.mesh, cell)) as f32).collect();
    let active = CellSet::of(values.len(), |cell| values[cell].is_finite());
    RenderJob { scalars: Scalars::Cells(Arc::new(values)), active: Arc::new(active), ..job.clone() }
}

/// A field that no cell has of its neighbour, with holes.
fn patchwork(job: &RenderJob) -> RenderJob {
    of_cells(job, |cell, at| match cell % 23 {
        7 => f64::NAN,
        15 => f64::INFINITY,
        // On the step of the table.
        3 => f64::from(0.1_f32),
        _ => wave(at) + 0.3 * noise(5, cell as u64),
    })
}

/// Eyes outside and inside, in both projections, holes, slivers.
pub fn scenes() -> Vec<(&'static str, RenderJob)> {
    let eye = DVec3::new(-0.31, -0.22, -0.17);
    vec![
        ("outside", patchwork(&with_holes((61, 47), OUTSIDE, PERSPECTIVE))),
        ("parallel", patchwork(&with_holes((50, 50), OUTSIDE, Projection::Parallel { scale: 1.7 }))),
        ("inside", patchwork(&with_holes((40, 40), eye, Projection::Perspective { view_angle: 80.0 }))),
        ("slivers", thick(&patchwork(&slivers()), SLIVERS)),
    ]
}

/// Slivers are a thousand times as wide as high.
const SLIVERS: f64 = 300.0;

/// The job with so many times the extinction.
fn thick(job: &RenderJob, times: f64) -> RenderJob {
    let mut nodes = job.table.nodes().to_vec();
    nodes.iter_mut().for_each(|node| node.tau *= times);
    RenderJob { table: Arc::new(NodeTable::new(nodes).unwrap()), ..job.clone() }
}

/// The job with one cell in the picture changed.
fn changed(job: &RenderJob) -> RenderJob {
    let mut values = job.scalars.of_cells().unwrap().to_vec();
    values.iter_mut().step_by(2).for_each(|value| *value += 0.05);
    RenderJob { scalars: Scalars::Cells(Arc::new(values)), ..job.clone() }
}

/// Every path draws what the judge draws, the portable one to the bit as the other, and another field would be noticed.
fn assert_drawn(name: &str, job: &RenderJob) {
    let judge = planes("reference", job);
    assert!(judge.color.pixels.iter().any(|p| p[3] > 0.1), "{name}: an empty image proves nothing");
    for path in paths() {
        let found = planes(path, job);
        let (rmse, max) = difference(&found.color, &judge.color);
        eprintln!("{name}, {path}: rmse {rmse:.1e}, max {max:.1e}");
        assert_within(&format!("{name}, {path}"), &found.color, &judge.color);
        let (unmatched, depth) = compare_depths(&found, &judge);
        assert!(unmatched == 0 && depth <= 1e-5, "{name}, {path}: {unmatched}, {depth:.1e}");
    }
    assert!(planes("raycast", job) == planes("portable", job), "{name}");
    assert_noticed(name, &planes("raycast", &changed(job)).color, &judge.color);
}

#[test]
fn scalars_of_cells_are_drawn_as_the_judge_draws_them() {
    for (name, job) in scenes() {
        assert_drawn(name, &job);
        let sparse = table(&[(-0.2, [1.0, 0.2, 0.0], 0.0), (0.1, [0.0, 1.0, 0.0], 3.0), (0.35, [0.0, 0.0, 1.0], 0.0)]);
        let sparse = RenderJob { table: Arc::new(sparse), skip: Skip::ALL, ..job };
        let sparse = if name == "slivers" { thick(&sparse, SLIVERS) } else { sparse };
        assert_drawn(&format!("{name}, sparse"), &sparse);
    }
}

#[test]
fn tables_show_a_cell_as_well_as_they_show_its_one_scalar() {
    for (name, job) in scenes() {
        // Without steps, which tables blur.
        let smooth = table(&[(-1.5, [0.2, 0.2, 1.0], 0.1), (0.0, [0.1, 0.9, 0.3], 0.9), (1.5, [1.0, 0.2, 0.1], 2.0)]);
        for optics in [OpticsKind::Table3d, OpticsKind::Partial] {
            let job = RenderJob { optics, table: Arc::new(smooth.clone()), ..job.clone() };
            let judge = planes("reference", &job);
            for path in paths() {
                let (rmse, max) = difference(&planes(path, &job).color, &judge.color);
                eprintln!("{name}, {optics}, {path}: rmse {rmse:.1e}, max {max:.1e}");
                // Two samples of 128 over a range of 3 are 0.02 apart, over which colours are nearly linear.
                assert!(rmse <= 1e-3 && max <= 1e-2, "{name}, {optics}, {path}: rmse {rmse:.1e}, max {max:.1e}");
            }
        }
    }
}

#[test]
fn two_slabs_have_the_light_of_the_closed_form_without_a_ramp_between_them() {
    let (thin, thick) = ([0.2, 0.9, 0.1], [1.0, 0.3, 0.6]);
    // Opaque black between the two scalars: a ramp of any width would show.
    let nodes = [(0.0, thin, 0.4), (0.1, thin, 0.4), (0.1, [0.0; 3], 1e6), (0.9, [0.0; 3], 1e6), (0.9, thick, 1.3)];
    for jitter in [0.0, 0.12] {
        let mut raw = grid(6, jitter, 4, |_| true);
        // The plane between the slabs stays plane.
        raw.points.iter_mut().filter(|p| p.x.abs() < 0.1).for_each(|p| p.x = 0.0);
        let mesh = Arc::new(build(raw));
        let depth_of = |tau: f64, length: f64| tau * length;
        for projection in [Projection::Perspective { view_angle: 20.0 }, Projection::Parallel { scale: 0.9 }] {
            let point =
                job(&mesh, sample(&mesh, |_| 0.0), &camera(4.0 * DVec3::X, projection), (21, 21), table(&nodes));
            let job = of_cells(&point, |_, at| if at.x < 0.0 { 0.0 } else { 1.0 });
            let expected = |(px, py): (f64, f64)| {
                // Each slab is 1 thick along the view; the eye is on the side of the thick one.
                let length = job.view.length_per_depth(px, py);
                let [near, far] = [depth_of(1.3, length), depth_of(0.4, length)];
                let [seen, behind] = [-(-near).exp_m1(), (-near).exp() * -(-far).exp_m1()];
                let light = |c: usize| seen * thick[c] + behind * thin[c];
                [light(0), light(1), light(2), seen + behind]
            };
            for path in paths().into_iter().chain(["reference"]) {
                let image = planes(path, &job).color;
                for (n, rgba) in image.pixels.iter().enumerate() {
                    let right = expected(job.view.ray(n % image.width, n / image.width));
                    for (found, right) in rgba.iter().zip(right) {
                        // Sums of f32 over a dozen cells.
                        let error = (f64::from(*found) - right).abs();
                        assert!(error < 2e-6, "jitter {jitter}, {projection:?}, {path}, pixel {n}: {error:.1e}");
                    }
                }
            }
            // A field of vertices with these values would show it.
            let ramp = RenderJob { scalars: Arc::new(sample(&mesh, |p| (p.x > 0.0).into())).into(), ..point.clone() };
            assert_noticed("a ramp", &planes("raycast", &ramp).color, &planes("raycast", &job).color);
        }
    }
}

#[test]
fn what_is_skipped_changes_no_bit() {
    for (name, job) in scenes() {
        let sparse = table(&[(-0.2, [1.0, 0.2, 0.0], 0.0), (0.1, [0.0, 1.0, 0.0], 3.0), (0.35, [0.0, 0.0, 1.0], 0.0)]);
        let values = job.scalars.of_cells().unwrap();
        let visible = |cell: usize| sparse.is_visible_in(f64::from(values[cell]), f64::from(values[cell]));
        let active = CellSet::of(values.len(), |cell| values[cell].is_finite() && visible(cell));
        assert!(active.count() < job.active.count() / 2, "{name}: nothing is left out");
        let all = RenderJob { table: Arc::new(sparse.clone()), skip: Skip::NONE, ..job.clone() };
        let some =
            RenderJob { active: Arc::new(active), finite: Some(job.active.clone()), skip: Skip::ALL, ..all.clone() };
        for path in PATHS {
            // Rays end when they are opaque, if that is skipped.
            let skip = Skip { opaque: false, ..Skip::ALL };
            let some = RenderJob { skip, ..some.clone() };
            assert!(planes(path, &some) == planes(path, &all), "{name}, {path}");
        }
    }
}

#[test]
fn cuts_show_cells_flat_and_light_leaves_them_as_they_are() {
    for (name, base) in scenes().into_iter().filter(|(name, _)| *name != "slivers") {
        let cut = |clips: bool| Cut { point: [0.1, 0.05, 0.0], normal: [0.6, -0.3, 0.0], clips, by: None };
        for cuts in [vec![cut(false)], vec![cut(true)], vec![cut(true), cut(false)]] {
            let planes_of = cut_planes(&cuts, &base.mesh.positions).unwrap();
            let scene = SurfaceScene::new(&[], shading(Normals::None), &base.table).unwrap().with_planes(planes_of);
            let job = RenderJob { surfaces: Some(scene), ..base.clone() };
            let judge = planes("reference", &job);
            for path in PATHS {
                assert_within(&format!("{name}, {path}, {} cuts", cuts.len()), &planes(path, &job).color, &judge.color);
            }
            // A section has the colours of the cells behind it, and no others.
            if !cuts[0].clips {
                let values = job.scalars.of_cells().unwrap();
                let colors: Vec<[f64; 3]> = values.iter().map(|&s| base.table.eval(f64::from(s)).rgb).collect();
                let alone = RenderJob { table: Arc::new(NodeTable::transparent()), ..job.clone() };
                let image = planes("raycast", &alone).color;
                let seen: Vec<_> = image.pixels.iter().filter(|p| p[3] > 0.5).collect();
                assert!(seen.len() > 50, "{name}");
                for pixel in seen {
                    let is_of = |rgb: &[f64; 3]| (0..3).all(|c| (rgb[c] - f64::from(pixel[c])).abs() < 1e-6);
                    assert!(colors.iter().any(is_of), "{name}: {pixel:?}");
                }
            }
        }
        // The gradient in a cell is 0: there is nothing to light it by.
        let lit = SurfaceShading { volume: true, ..shading(Normals::Cell) };
        let job = RenderJob { surfaces: Some(SurfaceScene::new(&[], lit, &base.table).unwrap()), ..base.clone() };
        for path in ["raycast", "faces", "reference"] {
            let (_, max) = difference(&planes(path, &job).color, &planes(path, &base).color);
            assert!(max < 1e-6, "{name}, {path}: {max:.1e}");
        }
    }
}

#[test]
fn isosurfaces_of_vertices_have_the_colours_of_a_field_of_cells() {
    let base = with_holes((61, 47), OUTSIDE, PERSPECTIVE);
    let scalars = patchwork(&base).scalars;
    let sheets =
        [tetreel::render::surfaces::Isosurface { by: Some(0), ..super::surfaces::surface(0.2, [1.0; 3], 1.0) }];
    let mut job = alone(&base, &sheets, shading(Normals::None));
    let beside = FieldBeside { scalars, colors: base.table.clone() };
    job.surfaces = job.surfaces.map(|scene| scene.with_beside(vec![beside], Vec::new()));
    let judge = planes("reference", &job);
    assert!(judge.color.pixels.iter().filter(|p| p[3] > 0.5).count() > 100);
    for path in PATHS {
        assert_within(path, &planes(path, &job).color, &judge.color);
    }
}

/// Values of cells, none like its neighbour's.
fn noise_of_cells(job: &RenderJob, seed: u64) -> Vec<f32> {
    (0..job.mesh.topology.tets.len() as u64).map(|cell| 0.6 * noise(seed, cell) as f32).collect()
}

/// The job with a joint table whose rows, if it has any, and layers are of values of cells.
pub fn with_rows_of_cells(
    job: &RenderJob,
    table: JointTable,
    rows: Option<Vec<f32>>,
    cells: Option<Vec<f32>>,
) -> RenderJob {
    let mut job = with_joint_table(job, table, None, cells);
    job.joint.iter_mut().for_each(|scene| scene.row_values = rows.clone().map(|rows| Scalars::Cells(Arc::new(rows))));
    job
}

/// Two-dimensional and three-dimensional jobs of scalars of cells.
pub fn joint_jobs(base: &RenderJob) -> [(&'static str, RenderJob); 3] {
    let [rows, cells] = [9, 8].map(|seed| Some(noise_of_cells(base, seed)));
    // Some cells lie on the step, whose lower side may be transparent: beside it they would be visible by a billionth in f64 alone.
    let scalars = SCALARS.map(|scalar| f64::from(scalar as f32));
    let noisy = |rows: &[f64], layers: &[f64], seed| noisy(&scalars, rows, layers, seed);
    [
        ("layers", with_rows_of_cells(base, noisy(&[0.0], &LAYERS, 1), None, cells.clone())),
        ("rows", with_rows_of_cells(base, noisy(&ROWS, &[0.0], 2), rows.clone(), None)),
        ("both", with_rows_of_cells(base, noisy(&ROWS, &LAYERS, 3), rows, cells)),
    ]
}

#[test]
fn joint_tables_take_values_of_cells_beside_scalars_of_cells() {
    for (name, base) in scenes().into_iter().filter(|(name, _)| *name != "slivers") {
        for (what, job) in joint_jobs(&base) {
            assert_drawn(&format!("{name}, joint, {what}"), &job);
            // Another value of the rows, and of the layers, is noticed as well.
            let scene = job.joint.clone().unwrap();
            let others = [
                JointScene { row_values: scene.row_values.as_ref().map(|_| row_values(&base, 19)), ..scene.clone() },
                JointScene {
                    cell_values: scene.cell_values.as_ref().map(|_| Arc::new(noise_of_cells(&base, 18))),
                    ..scene.clone()
                },
            ];
            let judge = planes("reference", &job).color;
            for (other, differs) in others.into_iter().zip([scene.row_values.is_some(), scene.cell_values.is_some()]) {
                let other = RenderJob { joint: Some(other), ..job.clone() };
                for path in paths().into_iter().filter(|_| differs) {
                    assert_noticed(&format!("{name}, {what}, {path}"), &planes(path, &other).color, &judge);
                }
            }
        }
    }
}

fn row_values(job: &RenderJob, seed: u64) -> Scalars {
    Scalars::Cells(Arc::new(noise_of_cells(job, seed)))
}

#[test]
fn scalars_next_to_a_step_have_the_side_that_the_judge_gives_them() {
    let (_, base) = scenes().swap_remove(0);
    // The nearest f32 to 0.7 is below it, that to 0.1 above.
    for step in [0.7, 0.1, 300.7] {
        let at = step as f32;
        let [thick, thin] = [[1.0, 0.2, 0.1, 2.0], [0.1, 0.3, 1.0, 0.1]];
        let joint = JointTable::new(vec![step; 2], vec![0.0], vec![0.0], vec![thick, thin]).unwrap();
        let of = |near: [f32; 2]| of_cells(&base, |cell, _| f64::from(near[cell % 2]));
        let plain = |job: RenderJob| RenderJob { table: joint.projection().clone(), ..job };
        let kinds: [(&str, &dyn Fn(RenderJob) -> RenderJob); 2] =
            [("scalars", &plain), ("joint", &|job| with_rows_of_cells(&job, joint.clone(), None, None))];
        for (what, kind) in kinds {
            let [below, above] = [[at.next_down(), at], [at, at.next_up()]].map(|near| kind(of(near)));
            for job in [&below, &above] {
                let judge = planes("reference", job).color;
                for path in paths() {
                    assert_within(&format!("{what} at {step}, {path}"), &planes(path, job).color, &judge);
                }
            }
            assert_noticed(what, &planes("reference", &below).color, &planes("reference", &above).color);
        }
    }
}

#[test]
fn another_number_of_scalars_than_cells_is_refused() {
    let (_, job) = scenes().swap_remove(0);
    let wrong = RenderJob { scalars: Scalars::Cells(Arc::new(vec![0.0; 3])), ..job };
    let error = Raycast::new().render(wrong).unwrap_err().to_string();
    assert!(error.contains("3 scalars for a mesh of") && error.ends_with("cells"), "{error}");
}

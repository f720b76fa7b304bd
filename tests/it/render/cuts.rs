//! Planes through the cells: against closed forms, against the judge, and from renderer to renderer.

use super::surfaces::*;
use super::*;
use crate::meshes::{build, grid, sample};
use tetreel::node_table::Node;
use tetreel::optics::OpticsKind;
use tetreel::render::surfaces::{CropBox, Cut, Normals, SurfaceScene, cut_planes};

const SLANTED: [f64; 3] = [0.6, -0.3, 0.9];

fn section(point: [f64; 3], normal: [f64; 3]) -> Cut {
    Cut { point, normal, clips: false, by: None }
}

fn clip(point: [f64; 3], normal: [f64; 3]) -> Cut {
    Cut { point, normal, clips: true, by: None }
}

/// The job cut by planes, with its surfaces if it has some.
fn with_cuts(job: &RenderJob, cuts: &[Cut]) -> RenderJob {
    let planes = cut_planes(cuts, &job.mesh.positions).unwrap();
    let plain = || SurfaceScene::new(&[], shading(Normals::None), &job.table).unwrap();
    RenderJob { surfaces: Some(job.surfaces.clone().unwrap_or_else(plain).with_planes(planes)), ..job.clone() }
}

fn boxed(half: f64) -> Vec<Cut> {
    CropBox { min: [-half, -0.7 * half, -half], max: [half, half, 0.8 * half] }.cuts().to_vec()
}

/// Cuts of all kinds, some of them at one place.
fn cuts() -> Vec<(&'static str, Vec<Cut>)> {
    vec![
        ("clip", vec![clip([0.1, 0.05, -0.1], SLANTED)]),
        ("wedge", vec![clip([0.1, 0.05, -0.1], SLANTED), clip([-0.2, 0.0, 0.0], [-0.3, 0.1, 1.0])]),
        ("box", boxed(0.55)),
        ("section", vec![section([0.12, 0.0, 0.1], [0.2, -1.0, 0.4])]),
        ("sections", vec![section([0.1, 0.0, 0.0], [1.0, 0.0, 0.0]), section([0.0, -0.1, 0.0], [-0.4, 1.0, 0.2])]),
        ("capped", vec![clip([0.1, 0.05, -0.1], SLANTED), section([0.1, 0.05, -0.1], SLANTED)]),
        ("capped from behind", vec![section([0.1, 0.05, -0.1], SLANTED.map(|x| -x)), clip([0.1, 0.05, -0.1], SLANTED)]),
    ]
}

#[test]
fn cuts_are_drawn_as_the_judge_draws_them() {
    let (mut worst, mut seen) = ((0.0_f64, 0.0_f64, 0.0_f64), 0);
    for (name, base) in scenes().into_iter().step_by(3) {
        for (kind, cuts) in cuts() {
            // Slivers lie in a flat box.
            let flat = |mut cut: Cut| {
                cut.point[2] *= 1e-3;
                cut.normal[2] *= 1e3;
                cut
            };
            let cuts: Vec<Cut> = if name.starts_with("slivers") { cuts.into_iter().map(flat).collect() } else { cuts };
            let job = with_cuts(&base, &cuts);
            let judge = planes("reference", &job);
            seen += judge.color.pixels.iter().filter(|p| p[3] > 0.1).count();
            for path in ["raycast", "faces"] {
                let found = planes(path, &job);
                let (rmse, max) = difference(&found.color, &judge.color);
                let (unmatched, depth) = compare_depths(&found, &judge);
                worst = (worst.0.max(rmse), worst.1.max(max), worst.2.max(depth));
                assert!(
                    is_within(&found.color, &judge.color),
                    "{name}, {kind}, {path}: rmse {rmse:.1e}, max {max:.1e}"
                );
                assert!(unmatched == 0 && depth <= DEPTH_BOUND, "{name}, {kind}, {path}: {unmatched}, {depth:.1e}");
            }
            assert!(planes("raycast", &job) == planes("portable", &job), "{name}, {kind}");
            let moved: Vec<Cut> = cuts.iter().map(|cut| cut.moved(0.01)).collect();
            let moved = planes("raycast", &with_cuts(&base, &moved));
            // The eye in the middle of a box sees its sides nowhere.
            assert!(moved.color == judge.color || !is_within(&moved.color, &judge.color), "{name}, {kind}");
        }
    }
    assert!(seen > 20_000, "{seen} pixels");
    eprintln!("cuts against the judge: rmse {:.1e}, max {:.1e}, depth {:.1e}", worst.0, worst.1, worst.2);
}

#[test]
fn all_optics_are_cut() {
    let base = with_holes((40, 31), OUTSIDE, PERSPECTIVE);
    for optics in [OpticsKind::Partial, OpticsKind::Table3d] {
        let job = RenderJob { optics, ..base.clone() };
        for (kind, cuts) in cuts() {
            let cut = with_cuts(&job, &cuts);
            assert!(planes("raycast", &cut) == planes("portable", &cut), "{optics}, {kind}");
            let (rmse, _) = difference(&planes("raycast", &cut).color, &planes("reference", &cut).color);
            let (whole, _) = difference(&planes("raycast", &job).color, &planes("reference", &job).color);
            assert!(rmse <= 1.5 * whole + BOUND_RMSE, "{optics}, {kind}: {rmse:.1e}, uncut {whole:.1e}");
        }
    }
}

/// The cube of 2 a side with the field x in cells whose corners have round coordinates, seen along z.
fn blocks(table: NodeTable) -> RenderJob {
    let mesh = Arc::new(build(grid(4, 0.0, 5, |_| true)));
    let scalars = sample(&mesh, |p| p.x);
    let camera = camera(DVec3::new(0.0, 0.0, 5.0), Projection::Parallel { scale: 0.9 });
    job(&mesh, scalars, &camera, (20, 20), table)
}

/// Extinction 0.7 everywhere; colours from 0 to 1 along the field.
fn ramp() -> NodeTable {
    let node = |scalar: f64, c: f64| Node { scalar, rgb: [c, 1.0 - c, 0.5], tau: 0.7 };
    NodeTable::new(vec![node(-1.0, 0.0), node(1.0, 1.0)]).unwrap()
}

#[test]
fn planes_between_and_on_faces_of_cells_are_met_once_and_leave_what_lies_behind() {
    let base = blocks(ramp());
    // 0.5 and 0.0 are where cells end.
    for z in [0.5, 0.0, 0.13, -0.9] {
        let half = |kind: &str, cut: &[Cut]| planes(kind, &with_cuts(&base, cut));
        for path in ["raycast", "portable", "faces", "points", "reference"] {
            let clipped = half(path, &[clip([0.0, 0.0, z], [0.0, 0.0, 1e-30])]);
            let opacity = 1.0 - (-0.7 * (z + 1.0)).exp();
            let sectioned = half(path, &[section([0.3, 0.4, z], [0.0, 0.0, 3e30])]);
            let capped = half(path, &[clip([0.0, 0.0, z], [0.0, 0.0, 1.0]), section([0.3, 0.4, z], [0.0, 0.0, 2.0])]);
            for pixel in 0..400 {
                let (px, _) = base.view.ray(pixel % 20, pixel / 20);
                let color = [0.5 + 0.5 * px, 0.5 - 0.5 * px, 0.5];
                let check = |image: &tetreel::image::Planes, rgba: [f64; 4], depth: f64| {
                    let found = image.color.pixels[pixel];
                    let off = found.iter().zip(rgba).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
                    // Colours of the integrators are within 1e-6 of the closed form.
                    assert!(off < 3e-6, "{path}, {z}: {found:?}, not {rgba:?}");
                    let found = f64::from(image.depth.pixels[pixel]);
                    assert!((found - depth).abs() < 1e-6, "{path}, {z}: depth {found}, not {depth}");
                };
                let [r, g, b] = color;
                check(&clipped, [opacity * r, opacity * g, opacity * b, opacity], 5.0 - z);
                check(&sectioned, [r, g, b, 1.0], 4.0);
                check(&capped, [r, g, b, 1.0], 5.0 - z);
            }
        }
    }
}

#[test]
fn clips_that_leave_nothing_of_a_ray_leave_it_empty() {
    let base = blocks(ramp());
    for path in ["raycast", "portable", "faces", "points", "reference"] {
        let gone = planes(path, &with_cuts(&base, &[clip([0.0, 0.0, -1.5], [0.0, 0.0, 1.0])]));
        assert!(
            gone.color.pixels.iter().all(|p| *p == [0.0; 4]) && gone.depth.pixels.iter().all(|d| *d == f32::INFINITY)
        );
        // Parallel to all rays: one side of the picture is left.
        let left = planes(path, &with_cuts(&base, &[clip([0.001, 0.0, 0.0], [1.0, 0.0, 0.0])]));
        let is_left = |pixel: usize| left.color.pixels[pixel][3] > 0.0;
        assert!((0..400).all(|pixel| is_left(pixel) == (pixel % 20 < 10)), "{path}");
    }
}

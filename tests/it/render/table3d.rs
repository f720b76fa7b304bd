//! The ray caster with the pre-integrated table.

use super::*;
use crate::meshes::{build, grid, sample};
use tetreel::optics::OpticsKind;

fn scene(nodes: &[(f64, [f64; 3], f64)]) -> RenderJob {
    let mesh = Arc::new(build(grid(6, 0.16, 1, |c| c.length() > 0.4)));
    let camera = camera(DVec3::new(3.0, 2.0, 2.5), Projection::Perspective { view_angle: 30.0 });
    RenderJob { optics: OpticsKind::Table3d, ..job(&mesh, sample(&mesh, wave), &camera, (64, 64), table(nodes)) }
}

#[test]
fn constant_extinction_and_color_give_the_picture_of_the_reference() {
    let of = |tau: f64| scene(&[(-0.5, [0.9, 0.5, 0.2], tau), (0.5, [0.9, 0.5, 0.2], tau)]);
    assert_agrees("constant", &of(0.7));
    assert_noticed("a hundredth more extinction", &raycast(&of(0.707)), &reference(&of(0.7)));
}

#[test]
fn a_smooth_function_is_close_to_the_reference_and_a_tent_between_entries_is_not() {
    let smooth = scene(&[(-1.5, [0.2, 0.2, 1.0], 0.1), (0.0, [0.1, 0.9, 0.3], 0.6), (1.5, [1.0, 0.2, 0.1], 2.0)]);
    let (rmse, max) = difference(&raycast(&smooth), &reference(&smooth));
    // The kink at 0 may lie between two of the 128 entries, 3 / 127 = 0.024 apart: there the mean extinction is off by (change of
    // slope 0.6) x 0.024 / 8 = 2e-3 at most, over the few cells where the scalar passes 0, whose lengths are below 0.5.
    // Measured: 1.7e-5 and 1.4e-4.
    assert!(rmse < 1e-4 && max < 1e-3, "rmse {rmse:.1e}, max {max:.1e}");
    #[cfg(feature = "gpu")]
    if let Some(frame) = gpu::render(&smooth) {
        assert_within("GPU against CPU", &frame.planes.color, &raycast(&smooth));
    }
    // Narrower than an interval of the table: what a table cannot do, and what the comparison must see.
    let tent = scene(&[
        (-1.5, [1.0; 3], 0.0),
        (0.001, [1.0; 3], 0.0),
        (0.003, [1.0; 3], 500.0),
        (0.005, [1.0; 3], 0.0),
        (1.5, [1.0; 3], 0.0),
    ]);
    let (rmse, _) = difference(&raycast(&tent), &reference(&tent));
    assert!(rmse > 1e-3, "rmse {rmse:.1e}");
    // The exact integrator does both.
    for job in [smooth, tent] {
        assert_agrees("exact", &RenderJob { optics: OpticsKind::Exact, ..job });
    }
}

#[test]
fn both_compilations_of_the_walk_draw_the_same_picture() {
    let job = scene(&[(-1.0, [0.2, 0.2, 1.0], 0.1), (1.0, [1.0, 0.2, 0.1], 2.0)]);
    assert_same("portable", &raycast(&job), &Raycast::portable().render(job).unwrap().planes.color);
}

#[test]
fn a_renderer_changes_tables_with_jobs() {
    let first = scene(&[(-1.0, [0.2, 0.2, 1.0], 0.1), (1.0, [1.0, 0.2, 0.1], 2.0)]);
    let other_table = RenderJob { table: Arc::new(table(&[(0.0, [1.0; 3], 0.5)])), ..first.clone() };
    let mesh = Arc::new(build(grid(4, 0.1, 5, |_| true)));
    let other_mesh = RenderJob {
        scalars: Arc::new(sample(&mesh, wave)).into(),
        active: Arc::new(tetreel::visibility::CellSet::all(mesh.topology.tets.len())),
        mesh,
        ..first.clone()
    };
    let exact = RenderJob { optics: OpticsKind::Exact, ..first.clone() };
    let mut renderer = Raycast::new();
    for job in [&first, &other_table, &first, &other_mesh, &exact, &first] {
        assert_same("used before", &renderer.render(job.clone()).unwrap().planes.color, &raycast(job));
    }
}

#[test]
fn depth_is_that_of_the_transfer_function() {
    let job = scene(&[(-1.5, [1.0; 3], 0.0), (0.3, [1.0; 3], 0.0), (0.7, [1.0; 3], 4.0)]);
    let looked_up = Raycast::new().render(job.clone()).unwrap().clone();
    let exact = Raycast::new().render(RenderJob { optics: OpticsKind::Exact, ..job }).unwrap().clone();
    let mut compared = 0;
    for (a, b) in looked_up.planes.depth.pixels.iter().zip(&exact.planes.depth.pixels) {
        if b.is_finite() {
            assert_eq!(a, b);
            compared += 1;
        }
    }
    assert!(compared > 100);
}

//! Partial pre-integration in the ray caster and the face renderer, on the CPU and the GPU.

use super::*;
use crate::meshes::{build, grid, sample};
use tetreel::optics::OpticsKind;

/// Cells so wide that most segments cross nodes.
fn scene(nodes: &[(f64, [f64; 3], f64)]) -> RenderJob {
    let mesh = Arc::new(build(grid(6, 0.16, 1, |c| c.length() > 0.4)));
    let camera = camera(DVec3::new(3.0, 2.0, 2.5), Projection::Perspective { view_angle: 30.0 });
    RenderJob { optics: OpticsKind::Partial, ..job(&mesh, sample(&mesh, wave), &camera, (64, 64), table(nodes)) }
}

/// Forty nodes of four colours: segments cross several.
fn rainbow() -> Vec<(f64, [f64; 3], f64)> {
    let colors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]];
    (0..40).map(|i| (-1.5 + 0.08 * f64::from(i), colors[i as usize % 4], 0.5 * f64::from(i % 7))).collect()
}

#[test]
fn every_transfer_function_gives_the_picture_of_the_reference() {
    let tents =
        [(-1.5, 0.0), (0.001, 0.0), (0.003, 500.0), (0.005, 0.0), (0.4, 0.0), (0.6, 9.0), (0.6, 0.5), (1.5, 0.1)];
    let smooth = scene(&[(-1.5, [0.2, 0.2, 1.0], 0.1), (0.0, [0.1, 0.9, 0.3], 0.6), (1.5, [1.0, 0.2, 0.1], 2.0)]);
    let tents_of = |color: &dyn Fn(f64) -> [f64; 3]| scene(&tents.map(|(scalar, tau)| (scalar, color(scalar), tau)));
    let narrow = tents_of(&|_| [0.9, 0.5, 0.2]);
    let colored = tents_of(&|s| [0.5 + 0.3 * s, 0.5 - 0.3 * s, 0.2]);
    for (name, job) in [("smooth", &smooth), ("one colour", &narrow), ("tents", &colored)] {
        assert_agrees(name, job);
        let exact = RenderJob { optics: OpticsKind::Exact, ..job.clone() };
        assert!(raycast(job) != raycast(&exact), "{name}: it is another integrator");
    }
    // Segments across many nodes. Measured: 2.2e-5, 2.1e-4, all of it in colour, which the exact integrator has not.
    let hard = scene(&rainbow());
    let (image, judge) = (raycast(&hard), reference(&hard));
    let (rmse, max) = difference(&image, &judge);
    assert!(rmse < 5e-5 && max < 5e-4 && rmse > 1e-5, "rainbow: rmse {rmse:.1e}, max {max:.1e}");
    let opacity = image.pixels.iter().zip(&judge.pixels).map(|(a, b)| (a[3] - b[3]).abs()).fold(0.0, f32::max);
    // A ray ends when less than 2^-17 shines through.
    assert!(opacity < 1e-5, "rainbow: opacity {opacity:.1e}");
    assert_agrees("rainbow, exact", &RenderJob { optics: OpticsKind::Exact, ..hard });
    // Narrower than any table: and it must be seen.
    let table3d = RenderJob { optics: OpticsKind::Table3d, ..narrow.clone() };
    assert!(difference(&raycast(&table3d), &reference(&narrow)).0 > 1e-3);
}

#[test]
fn both_compilations_of_the_walk_draw_the_same_picture() {
    let job = scene(&[(-1.0, [0.2, 0.2, 1.0], 0.1), (0.1, [0.9, 0.2, 1.0], 3.0), (1.0, [1.0, 0.2, 0.1], 2.0)]);
    let image = raycast(&job);
    assert_eq!(image, Raycast::portable().render(job.clone()).unwrap().planes.color);
    let exact = RenderJob { optics: OpticsKind::Exact, ..job.clone() };
    assert!(image != raycast(&exact), "another integrator");
}

#[test]
fn depth_is_that_of_the_transfer_function() {
    let job = scene(&[(-1.5, [1.0; 3], 0.0), (0.3, [1.0; 3], 0.0), (0.7, [1.0; 3], 4.0), (0.8, [0.1; 3], 0.0)]);
    let partial = Raycast::new().render(job.clone()).unwrap().clone();
    let exact = Raycast::new().render(RenderJob { optics: OpticsKind::Exact, ..job }).unwrap().clone();
    assert_eq!(partial.planes.depth, exact.planes.depth);
    assert!(partial.planes.depth.pixels.iter().filter(|d| d.is_finite()).count() > 100);
}

/// Tables that are hard for f32, with the scalars that belong to them.
#[cfg(feature = "gpu")]
fn hard_for_single_precision() -> Vec<(&'static str, RenderJob)> {
    let spike = |at: f64, width: f64, tau: f64| {
        [(0.0, 0.01), (at, 0.01), (at + 0.5 * width, tau), (at + width, 0.01), (0.8, 0.3), (1.0, 0.0)]
    };
    let rgb = [[0.2, 0.2, 1.0], [0.1, 0.9, 0.3], [1.0, 0.1, 0.0], [0.1, 0.9, 0.3], [0.9, 0.9, 0.0], [0.5; 3]];
    let mut jobs = Vec::new();
    for (name, offset, range, nodes) in [
        ("spike of 1/4096", 0.0, 3.0, spike(0.4, 1.0 / 4096.0, 4096.0)),
        // Both ends of such a spike are rounded to f32 that are a few widths off, or to the same.
        ("spike of 1e-6", 0.0, 3.0, spike(0.4, 1e-6, 1e6)),
        ("spike of 1e-8", 0.0, 3.0, spike(0.4, 1e-8, 1e8)),
        ("spike far from zero", 1e7, 4096.0, spike(0.4, 1.0 / 4096.0, 4096.0)),
        // Beyond 1e9 the shaders cut optical depths off, which moves a surface within its ramp.
        ("opaque spike", 0.0, 3.0, spike(0.55, 1.0 / 4096.0, 1e8)),
        ("tiny scalars", 0.0, 1e-38, spike(0.4, 0.01, 100.0)),
        ("huge scalars", 0.0, 1e38, spike(0.4, 0.01, 100.0)),
    ] {
        let at = |share: f64| offset + range * (share - 0.5);
        let nodes: Vec<_> = nodes.iter().zip(rgb).map(|(&(s, tau), rgb)| (at(s), rgb, tau)).collect();
        let base = scene(&nodes);
        let scalars = base.scalars.values().iter().map(|&s| at(0.5 + 0.33 * f64::from(s)) as f32).collect::<Vec<_>>();
        jobs.push((name, RenderJob { scalars: Arc::new(scalars).into(), ..base }));
    }
    jobs
}

#[cfg(feature = "gpu")]
#[test]
fn the_gpu_draws_the_image_of_the_cpu() {
    use crate::render::havs::with_all_faces;
    let mut jobs = hard_for_single_precision();
    jobs.push(("rainbow", scene(&rainbow())));
    jobs.push(("one node", scene(&[(0.1, [0.4, 0.5, 0.6], 0.7)])));
    jobs.push(("a step", scene(&[(0.1, [0.4, 0.5, 0.6], 0.0), (0.1, [1.0, 0.5, 0.6], 2.0)])));
    for (name, job) in jobs {
        let Some(frame) = gpu::render(&job) else { return };
        let cpu = Raycast::new().render(job.clone()).unwrap().clone();
        assert_within(name, &frame.planes.color, &cpu.planes.color);
        assert!(frame.stats.on_gpu, "{name}");
        // Half the extinction and the green of one node are noticed.
        let mut nodes = job.table.nodes().to_vec();
        let thickest =
            (0..nodes.len()).max_by(|&a, &b| nodes[a].tau.min(9.0).total_cmp(&nodes[b].tau.min(9.0))).unwrap();
        nodes[thickest].tau *= 0.5;
        nodes[thickest].rgb[1] *= 0.5;
        let other = RenderJob { table: Arc::new(NodeTable::new(nodes).unwrap()), ..job.clone() };
        let off = gpu::render(&other).unwrap();
        assert!(difference(&off.planes.color, &cpu.planes.color).1 > 1e-3, "{name}");
        let faces = with_all_faces(&job);
        assert_within(
            &format!("{name}, faces"),
            &super::havs::gpu::render(&faces).unwrap().planes.color,
            &cpu.planes.color,
        );
    }
}

//! Clouds on the GPU against those on the CPU. Each comparison is shown to fail.

use super::tests::{ELLIPSE, EXACT, counts, dense, drawn, frame, on_cpu, styles};
use super::*;
use crate::camera::{Camera, Lattice, PixelSet, Projection, Samples};
use crate::mesh::Mesh;
use crate::mesh::test_meshes::{Random, cloud};
use crate::node_table::{Node, NodeTable};
use crate::optics::OpticsKind;
use crate::render::cpu::points::Points as CpuPoints;
use crate::render::gpu::layout::FRAGMENT_BYTES;
use crate::render::gpu::raycast::stage_tests::{cameras, context, job, mesh};
use crate::render::testing::{difference, is_within, with_points, with_sample};
use crate::render::{Renderer, testing};
use glam::DVec3;

const BALLS: PointStyle = PointStyle::BALLS;

/// Balls in the box of the meshes of other tests; the eye of the camera "inside" is in the first.
fn balls(count: usize) -> Vec<(DVec3, f64)> {
    let mut random = Random::new(17);
    let mut unit = || 0.5 + 0.5 * random.signed();
    let ball = |_| (4.0 * DVec3::new(unit(), unit(), unit()), 0.08 + 0.4 * unit() * unit());
    let first = (DVec3::splat(2.0) + DVec3::new(0.3, 0.25, 0.7), 0.5);
    std::iter::once(first).chain((1..count).map(ball)).collect()
}

/// Volumes of balls, from a sixth of those to six times.
fn volumes(balls: &[(DVec3, f64)]) -> Vec<f64> {
    let mut random = Random::new(18);
    balls.iter().map(|(_, r)| 4.0 * r.powi(3) * 6f64.powf(random.signed())).collect()
}

fn with_table(mesh: &Arc<Mesh>, camera: &Camera, tau: f64) -> RenderJob {
    RenderJob { table: dense(tau), ..job(mesh, camera, (43, 29)) }
}

fn footprints() -> impl Iterator<Item = PointStyle> {
    styles(1.0, 1.0).filter(|style| style.footprint != Footprint::Exact)
}

/// Compares with the CPU, by the bounds of all renderers. With e = 8 * 2^-24, the error of q (`render::cpu::splat::ellipsoid`), and D the
/// greatest optical depth of a point, the depth D sqrt(1 - q) is off by sqrt(e) D = 7e-4 D at the rim, where it is most; its mean square over
/// the disk is (e D / 2)^2 ln(1 / e): the light of a point with D = 1 is off by 1e-6. Measured, up to D = 1: 6e-8 and 4e-6 at most; up to
/// D = 300, opaque: 1.4e-6 and 7e-5, seven times less than the bounds.
fn assert_as_on_cpu(context: &Arc<Context>, name: &str, job: &RenderJob) {
    let name = format!("{name}, {:?}", job.points.as_ref().unwrap().style);
    let (found, expected) = (frame(context, job), on_cpu(job));
    let apart = difference(&found.planes.color.pixels, &expected.planes.color.pixels);
    assert!(is_within(apart), "{name}: {apart:?}");
    assert!(expected.planes.color.pixels.iter().any(|p| p[3] > 0.01), "{name}: an empty image proves nothing");
    let [found, expected] = [found, expected].map(|frame| frame.stats);
    assert_eq!((found.points_drawn, found.points_total), (expected.points_drawn, expected.points_total), "{name}");
    assert_eq!((found.broken_paths, found.on_gpu), (0, true), "{name}");
    // Rays within rounding of a rim may be on either side of it, and points within rounding of half a pixel.
    let counts = |s: &FrameStats| [s.fragments, s.points_enlarged, s.rays_hit];
    for (a, b) in counts(&found).into_iter().zip(counts(&expected)) {
        assert!(a.abs_diff(b) <= 1 + b / 500, "{name}: {:?} {:?}", counts(&found), counts(&expected));
    }
    // Boxes are wider on the GPU.
    assert!(found.points_culled <= expected.points_culled, "{name}");
}

#[test]
fn clouds_of_all_footprints_are_those_of_the_cpu() {
    let Some(context) = context() else { return };
    let balls = balls(250);
    let [plain, with_volumes] = [vec![], volumes(&balls)].map(|volumes| cloud(&balls, &volumes));
    for (name, camera) in cameras(DVec3::ZERO) {
        // Haze, dense, opaque.
        for (mesh, tau) in [(&plain, 0.05), (&with_volumes, 1.0), (&plain, 100.0)] {
            for style in footprints() {
                assert_as_on_cpu(
                    &context,
                    &format!("{name}, {tau}"),
                    &with_points(&with_table(mesh, &camera, tau), style),
                );
            }
        }
        for style in styles(0.5, 0.6).filter(|style| style.footprint != Footprint::Exact && style.exact_order) {
            let job = with_table(&with_volumes, &camera, 0.5);
            assert_as_on_cpu(&context, name, &with_sample(&job, style, 0));
        }
    }
}

#[test]
fn what_is_different_in_a_cloud_is_noticed() {
    let Some(context) = context() else { return };
    let (camera, balls) = (cameras(DVec3::ZERO)[0].1, balls(250));
    let right = cloud(&balls, &volumes(&balls));
    let changed = |change: &dyn Fn(&mut Mesh)| {
        let mut other = (*right).clone();
        change(&mut other);
        Arc::new(other)
    };
    let radii = changed(&|mesh| mesh.radii.iter_mut().flatten().for_each(|r| *r *= 1.001));
    let filling = changed(&|mesh| mesh.filling.iter_mut().flatten().for_each(|f| *f *= 1.001));
    let places = changed(&|mesh| mesh.positions.local.iter_mut().for_each(|p| p.x += 1e-4));
    let style = PointStyle { footprint: Footprint::Square, ..BALLS };
    for style in [BALLS, style] {
        let of = |mesh| with_points(&with_table(mesh, &camera, 0.05), style);
        let right = on_cpu(&of(&right)).planes.color.pixels;
        for (what, other) in [("radii", &radii), ("volumes", &filling), ("places", &places)] {
            let apart = difference(&frame(&context, &of(other)).planes.color.pixels, &right);
            assert!(!is_within(apart), "{what}, {style:?}: {apart:?}");
        }
    }
}

#[test]
fn clouds_by_all_optics_with_scalars_of_cells_and_values_beside_them_are_those_of_the_cpu() {
    let Some(context) = context() else { return };
    let mesh = cloud(&balls(150), &[]);
    let noise = |i: usize| 2.0 * crate::random::unit(crate::random::hash(5, i as u64)) as f32 - 1.0;
    let (name, camera) = cameras(DVec3::ZERO)[3];
    let base = with_table(&mesh, &camera, 0.3);
    let cells = testing::of_cells(&base);
    let by_optics = OpticsKind::ALL.map(|optics| RenderJob { optics, ..base.clone() });
    let jobs =
        by_optics.into_iter().chain([testing::with_rows(&base, noise), testing::with_rows(&cells, noise), cells]);
    for (i, job) in jobs.enumerate() {
        for compositing in Compositing::ALL {
            assert_as_on_cpu(
                &context,
                &format!("{name}, {i}"),
                &with_points(&job, PointStyle { compositing, ..BALLS }),
            );
        }
    }
}

#[test]
fn balls_around_one_place_come_in_the_order_of_the_cpu() {
    let Some(context) = context() else { return };
    let place = DVec3::new(2.1, 1.9, 2.2);
    // Two of the same radius, and others.
    let mesh = cloud(&[1.5, 1.5, 1.0, 0.5, 0.1].map(|radius| (place, radius)), &[]);
    for (name, camera) in cameras(DVec3::ZERO) {
        for scalars in [[-1.0, 0.9, 0.0, 1.3, -0.5], [0.9, -1.0, 0.5, -1.3, 1.0]] {
            let job = testing::job(&mesh, scalars.to_vec(), &camera, (43, 29), dense(0.3));
            assert_as_on_cpu(&context, name, &with_points(&job, BALLS));
        }
    }
}

#[test]
fn one_point_none_and_holes_are_those_of_the_cpu() {
    let Some(context) = context() else { return };
    let one = cloud(&[(DVec3::splat(2.0), 0.7)], &[]);
    let many = cloud(&balls(150), &[]);
    for (name, camera) in cameras(DVec3::ZERO) {
        assert_as_on_cpu(&context, name, &with_points(&with_table(&one, &camera, 1.0), BALLS));
        let whole = with_table(&many, &camera, 1.0);
        let holes = |every: usize| {
            let hole = |(i, s): (usize, &f32)| if i % every == 0 { f32::NAN } else { *s };
            let scalars = whole.scalars.values().iter().enumerate().map(hole).collect();
            with_points(&testing::job(&many, scalars, &camera, (43, 29), dense(1.0)), BALLS)
        };
        let some = holes(3);
        assert_as_on_cpu(&context, name, &some);
        // The light of those that are left: what has no number is as if it were not there.
        let left = with_points(&RenderJob { active: some.active.clone(), ..whole.clone() }, BALLS);
        let [with_holes, left] = [&some, &left].map(|job| frame(&context, job).planes);
        assert_eq!(with_holes, left, "{name}");
        assert_ne!(with_holes, frame(&context, &with_points(&whole, BALLS)).planes, "{name}");
        let none = frame(&context, &holes(1));
        assert_eq!((none.stats.points_drawn, none.stats.fragments), (0, 0));
        assert!(none.planes.color.pixels.iter().all(|p| *p == [0.0; 4]), "{name}");
    }
}

#[test]
fn bands_give_the_bits_of_the_whole_image_of_a_cloud() {
    let Some(context) = context() else { return };
    let mesh = cloud(&balls(250), &[]);
    let (_, camera) = cameras(DVec3::ZERO)[2];
    let mut whole = Points::new(context.clone());
    let mut banded = Points::with_fragment_bytes(context, 400 * FRAGMENT_BYTES);
    for style in footprints() {
        let job = with_points(&with_table(&mesh, &camera, 1.0), style);
        let expected = whole.render(job.clone()).unwrap().clone();
        assert_eq!(whole.band_count(), 1);
        let found = banded.render(job).unwrap().clone();
        assert_eq!((&found.planes, counts(&found)), (&expected.planes, counts(&expected)), "{style:?}");
        assert!(banded.band_count() >= expected.stats.fragments.div_ceil(400) as usize && banded.band_count() > 1);
    }
}

#[test]
fn rays_of_a_lattice_have_the_bits_of_the_whole_image_and_lists_of_pixels_are_refused() {
    let Some(context) = context() else { return };
    let [balls, cells] = [cloud(&balls(250), &[]), mesh(3, 5, DVec3::ZERO)];
    let lattice = Lattice::new(std::num::NonZeroUsize::new(3).unwrap());
    let (_, camera) = cameras(DVec3::ZERO)[3];
    let of_cells = [EXACT, ELLIPSE].map(|style| (&cells, style));
    for (mesh, style) in footprints().map(|style| (&balls, style)).chain(of_cells) {
        let job = with_points(&with_table(mesh, &camera, 1.0), style);
        let all = frame(&context, &job).planes.color.pixels;
        let mut sampled = job.clone();
        sampled.view.samples = Samples::Lattice(lattice);
        let places = |size: usize| (0..lattice.count(size)).map(move |place| lattice.pixel(place, size));
        let expected: Vec<_> =
            places(29).flat_map(|y| places(43).map(move |x| (x, y))).map(|(x, y)| all[43 * y + x]).collect();
        let found = frame(&context, &sampled).planes.color.pixels;
        assert!(found == expected && found.len() == 15 * 11, "{style:?}, cloud: {}", mesh.is_cloud());
        assert_ne!(found, all[..expected.len()], "other pixels are others");
    }
    let mut listed = with_points(&with_table(&balls, &camera, 1.0), BALLS);
    listed.view.samples = Samples::Pixels(Arc::new(PixelSet::new((43, 29), &[7]).unwrap()));
    let refused = Points::new(context).render(listed).unwrap_err();
    assert!(
        matches!(&refused, RenderError::BeyondGpu { problem, .. } if problem.contains("list of pixels")),
        "{refused}"
    );
}

#[test]
fn sizes_of_any_power_give_one_image_and_what_is_beyond_f32_is_left_to_the_cpu() {
    let Some(context) = context() else { return };
    let balls = balls(150);
    let (_, camera) = cameras(DVec3::ZERO)[0];
    // A power of two changes no bit of what is local.
    let of = |by: f64| {
        let scaled: Vec<_> = balls.iter().map(|&(p, r)| (by * p, by * r)).collect();
        let (position, focal_point) = (by * camera.position, by * camera.focal_point);
        let mesh = cloud(&scaled, &[]);
        drawn(&context, &with_table(&mesh, &Camera { position, focal_point, ..camera }, 1.0 / by), BALLS)
    };
    let right = of(1.0);
    assert_eq!(right, of(2f64.powi(100)));
    assert_eq!(right, of(2f64.powi(-100)));
    assert_ne!(right, of(1.5), "the test can fail");
    // Radii from 1 to 1e-36 of the box, nearly all of them widened to half a pixel; volumes far above and below those of the radii.
    let spread: Vec<_> = (0..37).map(|i| (balls[i].0, 0.5 * 10f64.powi(-(i as i32)))).collect();
    let volumes: Vec<_> =
        spread.iter().enumerate().map(|(i, (_, r))| r.powi(3) * 10f64.powi(((i + 12) % 25) as i32 - 12)).collect();
    for (name, camera) in cameras(DVec3::ZERO) {
        for volumes in [&[][..], &volumes] {
            let mesh = cloud(&spread, volumes);
            assert_eq!(mesh.topology.tets.len(), 37);
            for style in footprints().filter(|style| style.exact_order) {
                let job = with_points(&with_table(&mesh, &camera, 1.0), style);
                assert_as_on_cpu(&context, name, &job);
            }
        }
    }
    let job = |filling: f64| {
        let volumes: Vec<_> = balls.iter().map(|(_, r)| filling * r.powi(3)).collect();
        with_table(&cloud(&balls, &volumes), &camera, 1.0)
    };
    // Opaque, as on the CPU.
    let thick = with_points(&job(1e28), BALLS);
    assert!(frame(&context, &thick).planes.color.pixels.iter().any(|p| p[3] > 0.999));
    let (beyond, mut renderer) = (job(1e35), Points::new(context.clone()));
    let refused = renderer.render(with_points(&beyond, BALLS)).unwrap_err();
    assert!(matches!(&refused, RenderError::BeyondGpu { problem, .. } if problem.contains("volumes")), "{refused}");
    CpuPoints::new().render(with_points(&beyond, BALLS)).unwrap();
    // Gaps have no thickness, and a renderer that has refused a job goes on.
    let gaps = with_points(&beyond, PointStyle { compositing: Compositing::Gap, ..BALLS });
    assert!(renderer.render(gaps).is_ok());
}

#[test]
fn balls_around_the_eye_are_those_of_the_cpu() {
    let Some(context) = context() else { return };
    let eye = DVec3::new(0.3, 0.4, 0.5);
    // The eye is in all of them but two, in the middle of one, and in the plane of the middle of another.
    let ball = |[x, y, z]: [f64; 3], radius| (eye + DVec3::new(x, y, z), radius);
    let [middle, beside] = [ball([0.0; 3], 0.5), ball([0.0, 1.0, 0.0], 1.5)];
    let [front, behind] = [ball([1.0, 0.0, 0.0], 1.2), ball([-2.0, 0.0, 0.0], 2.5)];
    let mesh = cloud(&[middle, beside, front, behind, ball([2.0, 0.3, 0.2], 0.8), ball([-3.0, 0.3, 0.2], 0.8)], &[]);
    let projection = Projection::Perspective { view_angle: 100.0 };
    let camera = Camera { position: eye, focal_point: eye + DVec3::X, view_up: DVec3::Z, projection, near: 0.0 };
    for near in [0.0, 0.7] {
        let job =
            testing::job(&mesh, vec![-1.0, 0.0, 0.5, 1.0, -0.5, 0.3], &Camera { near, ..camera }, (43, 29), dense(0.3));
        for style in footprints() {
            assert_as_on_cpu(&context, &format!("near {near}"), &with_points(&job, style));
        }
    }
}

#[test]
fn steady_frames_of_a_cloud_make_nothing_and_meshes_come_and_go() {
    if context().is_none() {
        return;
    }
    let context = Arc::new(Context::new(&Default::default()).unwrap());
    let mut renderer = Points::new(context.clone());
    let (_, camera) = cameras(DVec3::ZERO)[0];
    let of_cloud = with_points(&with_table(&cloud(&balls(100), &[]), &camera, 1.0), BALLS);
    let of_cells = with_points(&with_table(&mesh(3, 5, DVec3::ZERO), &camera, 1.0), PointStyle { ..BALLS });
    let first = [&of_cloud, &of_cells].map(|job| renderer.render(job.clone()).unwrap().planes.clone());
    let again = [&of_cloud, &of_cells].map(|job| renderer.render(job.clone()).unwrap().planes.clone());
    assert_eq!(first, again);
    renderer.render(of_cloud.clone()).unwrap();
    let before = context.resources_created();
    renderer.render(of_cloud.clone()).unwrap();
    assert_eq!(context.resources_created(), before);
    let opaque = Node { scalar: 0.0, rgb: [1.0; 3], tau: 1e4 };
    let opaque = RenderJob { table: Arc::new(NodeTable::new(vec![opaque]).unwrap()), ..of_cloud };
    let mut stopping = opaque.clone();
    stopping.skip.opaque = true;
    let [stopped, whole] = [stopping, opaque].map(|job| renderer.render(job).unwrap().clone());
    assert_eq!(stopped.planes, whole.planes);
    assert!(stopped.stats.rays_stopped_early > 0 && whole.stats.rays_stopped_early == 0);
}

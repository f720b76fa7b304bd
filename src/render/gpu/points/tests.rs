//! Points on the GPU against those on the CPU, the cell walk and themselves in other orders. Each comparison is shown to fail.

use super::*;
use crate::camera::Camera;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid, torn};
use crate::mesh::{Mesh, RawMesh};
use crate::node_table::{Node, NodeTable};
use crate::optics::OpticsKind;
use crate::render::cpu::points::Points as CpuPoints;
use crate::render::cpu::raycast::Raycast;
use crate::render::gpu::context::ContextOptions;
use crate::render::gpu::layout::FRAGMENT_BYTES;
use crate::render::gpu::raycast::stage_tests::{cameras, context, job, mesh};
use crate::render::testing::{BOUNDS, difference, is_within, with_points, with_sample};
use crate::render::{Advance, Frame, Renderer, testing};
use crate::visibility::CellSet;
use glam::DVec3;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

pub(super) type Pixels = Vec<[f32; 4]>;

pub(super) const EXACT: PointStyle = PointStyle::EXACT;
pub(super) const ELLIPSE: PointStyle = PointStyle { footprint: Footprint::Ellipse, ..EXACT };

/// The frame of a job by one renderer that all tests share: whatever it did before must not matter.
pub(super) fn frame(context: &Arc<Context>, job: &RenderJob) -> Frame {
    static RENDERER: OnceLock<Mutex<Points>> = OnceLock::new();
    let renderer = RENDERER.get_or_init(|| Mutex::new(Points::new(context.clone())));
    renderer.lock().unwrap_or_else(PoisonError::into_inner).render(job.clone()).unwrap().clone()
}

pub(super) fn on_cpu(job: &RenderJob) -> Frame {
    CpuPoints::new().render(job.clone()).unwrap().clone()
}

pub(super) fn drawn(context: &Arc<Context>, job: &RenderJob, style: PointStyle) -> Pixels {
    frame(context, &with_points(job, style)).planes.color.pixels
}

/// A table with a step, times `tau`.
pub(super) fn dense(tau: f64) -> Arc<NodeTable> {
    let nodes = [(-1.4, 0.0, 0.5), (0.1, 0.2, 2.0), (0.1, 0.9, 0.3), (1.4, 1.0, 3.0)];
    let node = |(scalar, red, t): (f64, f64, f64)| Node { scalar, rgb: [red, 0.5, 1.0 - red], tau: tau * t };
    Arc::new(NodeTable::new(nodes.map(node).to_vec()).unwrap())
}

/// Jobs with cells that are missing, from everywhere, in images of more than one tile and not a multiple of them.
fn jobs() -> Vec<(&'static str, RenderJob)> {
    let mesh = mesh(3, 5, DVec3::ZERO);
    let of = |(name, camera): (&'static str, Camera)| {
        (name, RenderJob { table: dense(1.0), ..job(&mesh, &camera, (43, 29)) })
    };
    cameras(DVec3::ZERO).into_iter().map(of).collect()
}

#[test]
fn exact_points_are_those_of_the_cpu_and_the_walk() {
    let Some(context) = context() else { return };
    for (name, job) in jobs() {
        let (found, expected) = (frame(&context, &with_points(&job, EXACT)), on_cpu(&with_points(&job, EXACT)));
        let pixels = &found.planes.color.pixels;
        let apart = difference(pixels, &expected.planes.color.pixels);
        assert!(is_within(apart), "{name}: {apart:?}");
        let walked = Raycast::new().render(job.clone()).unwrap().planes.color.pixels.clone();
        assert!(is_within(difference(pixels, &walked)), "{name}");
        assert!(pixels.iter().any(|p| p[3] > 0.1), "{name}: an empty image proves nothing");
        assert_eq!(found.stats.broken_paths, 0);
    }
}

/// All styles of a level of detail and a radius.
pub(super) fn styles(lod: f64, radius: f64) -> impl Iterator<Item = PointStyle> {
    let of = move |footprint, compositing| {
        [true, false].map(|exact_order| PointStyle {
            footprint,
            compositing,
            radius,
            lod,
            exact_order,
            importance: None,
            constant_scalar: false,
        })
    };
    let all = move |footprint| Compositing::ALL.into_iter().flat_map(move |compositing| of(footprint, compositing));
    Footprint::ALL.into_iter().flat_map(all)
}

/// Compares with the CPU. The bounds are those of all renderers, and follow from f32: at the rim of an ellipse a thickness is right to
/// sqrt(8 * 2^-24) = 7e-4 of the greatest (`splat::ellipsoid`), and the optical depth of a point is below 1; elsewhere to a few 2^-24, of
/// which up to a hundred fragments of a pixel add up. Measured: 4e-7 and 5e-6.
pub(super) fn assert_as_on_cpu(context: &Arc<Context>, name: &str, job: &RenderJob) {
    let (found, expected) = (frame(context, job), on_cpu(job));
    let [pixels, right] = [&found, &expected].map(|frame| &frame.planes.color.pixels);
    let apart = difference(pixels, right);
    assert!(is_within(apart), "{name}: {apart:?}");
    assert!(right.iter().any(|p| p[3] > 0.1), "{name}: an empty image proves nothing");
    let other = RenderJob { table: dense(1.01), ..job.clone() };
    let noticed = difference(&frame(context, &other).planes.color.pixels, right);
    assert!(!is_within(noticed), "{name}: not noticed");
    let [found, expected] = [found, expected].map(|frame| frame.stats);
    assert_eq!((found.points_drawn, found.points_total), (expected.points_drawn, expected.points_total), "{name}");
    assert_eq!((found.broken_paths, found.on_gpu), (0, true), "{name}");
    // Rays within rounding of a rim may be on either side of it, and points within rounding of half a pixel.
    let are_close = |a: u64, b: u64| a.abs_diff(b) <= 1 + b / 500;
    let counts = |s: &FrameStats| [s.fragments, s.points_enlarged, s.rays_hit];
    for (a, b) in counts(&found).into_iter().zip(counts(&expected)) {
        assert!(are_close(a, b), "{name}: {:?} {:?}", counts(&found), counts(&expected));
    }
    // Boxes are wider on the GPU.
    assert!(found.points_culled <= expected.points_culled, "{name}");
}

#[test]
fn points_of_all_shapes_are_those_of_the_cpu() {
    let Some(context) = context() else { return };
    for (name, job) in jobs() {
        for style in styles(1.0, 1.0) {
            assert_as_on_cpu(&context, &format!("{name}, {style:?}"), &with_points(&job, style));
        }
        for style in styles(0.5, 0.6).filter(|style| style.exact_order) {
            assert_as_on_cpu(&context, &format!("{name}, {style:?}"), &with_sample(&job, style, 0));
        }
    }
}

#[test]
fn points_by_all_optics_are_those_of_the_cpu() {
    let Some(context) = context() else { return };
    for (name, job) in jobs() {
        for optics in OpticsKind::ALL {
            for style in [EXACT, ELLIPSE] {
                let job = RenderJob { optics, ..job.clone() };
                assert_as_on_cpu(&context, &format!("{name}, {optics}, {style:?}"), &with_points(&job, style));
            }
        }
    }
}

#[test]
fn points_below_half_a_pixel_are_widened_as_on_the_cpu() {
    let Some(context) = context() else { return };
    let (mesh, mut enlarged) = (mesh(4, 0, DVec3::ZERO), 0);
    // From outside, where a pixel is wider than a cell.
    let outside = cameras(DVec3::ZERO).into_iter().filter(|(name, _)| ["outside", "parallel", "far"].contains(name));
    for (name, camera) in outside {
        let job = RenderJob { table: dense(0.3), ..job(&mesh, &camera, (5, 4)) };
        for style in styles(1.0, 0.2).filter(|style| style.exact_order) {
            let job = with_points(&job, style);
            let (found, expected) = (frame(&context, &job), on_cpu(&job));
            let apart = difference(&found.planes.color.pixels, &expected.planes.color.pixels);
            assert!(is_within(apart), "{name}, {style:?}: {apart:?}");
            // Boxes are wider on the GPU: some of the points without a pixel are not known to be.
            let [found, expected] = [found, expected].map(|f| (f.stats.points_enlarged, f.stats.points_culled));
            assert!(found.1 <= expected.1 && found.0 + 1 >= expected.0, "{name}, {style:?}: {found:?} {expected:?}");
            assert!(found.0 + found.1 <= expected.0 + expected.1 + 1, "{name}, {style:?}: {found:?} {expected:?}");
            assert!(!style.is_exact() || found.0 == 0, "rays decide");
            enlarged += found.0;
        }
    }
    assert!(enlarged > 1000, "{enlarged}");
}

#[test]
fn a_mesh_torn_into_cells_has_the_same_bits() {
    let Some(context) = context() else { return };
    let mut random = Random::new(2);
    let raw = jittered(kuhn_grid([4; 3]), &mut random);
    let built = |raw| Arc::new(Mesh::build(raw).unwrap().0);
    let (whole, soup) = (built(raw.clone()), built(torn(&raw, &mut random)));
    assert_eq!(soup.positions.local.len(), 4 * whole.topology.tets.len(), "nothing was joined");
    let scalars_of = |mesh: &Mesh| -> Vec<f32> {
        let bits =
            |p: &glam::Vec3| u64::from(p.x.to_bits()) << 32 ^ u64::from(p.y.to_bits()) << 16 ^ u64::from(p.z.to_bits());
        mesh.positions.local.iter().map(|p| crate::random::unit(crate::random::hash(3, bits(p))) as f32).collect()
    };
    for (name, camera) in cameras(DVec3::ZERO) {
        for style in [EXACT, ELLIPSE, PointStyle { footprint: Footprint::Square, ..EXACT }] {
            let of = |mesh: &Arc<Mesh>, factor: f32| {
                let scalars = scalars_of(mesh).into_iter().map(|s| factor * s).collect();
                drawn(&context, &testing::job(mesh, scalars, &camera, (40, 40), dense(1.0)), style)
            };
            let image = of(&whole, 1.0);
            assert_eq!(image, of(&soup, 1.0), "{name}, {style:?}");
            assert_ne!(image, of(&whole, 0.999), "{name}, {style:?}: the test can fail");
        }
    }
}

/// Everything that a frame has but its times.
pub(super) fn counts(frame: &Frame) -> [u64; 6] {
    let s = &frame.stats;
    [s.fragments, s.segments, s.rays_hit, s.rays_stopped_early, s.out_of_order, s.points_culled]
}

#[test]
fn many_bands_and_slices_give_the_bits_of_one() {
    let Some(context) = context() else { return };
    let (_, job) = jobs().swap_remove(2);
    for style in [EXACT, ELLIPSE, PointStyle { compositing: Compositing::Gap, ..ELLIPSE }] {
        let job = with_points(&job, style);
        let mut whole = Points::new(context.clone());
        let expected = whole.render(job.clone()).unwrap().clone();
        assert_eq!(whole.band_count(), 1);
        for fragments in [3_000, 300] {
            let mut banded = Points::with_fragment_bytes(context.clone(), fragments * FRAGMENT_BYTES);
            let found = banded.render(job.clone()).unwrap().clone();
            assert_eq!((&found.planes, counts(&found)), (&expected.planes, counts(&expected)), "{style:?}");
            let least = expected.stats.fragments.div_ceil(fragments) as usize;
            assert!(least > 1 && banded.band_count() >= least, "{} bands", banded.band_count());
        }
        let mut sliced = Points::new(context.clone());
        sliced.begin(job).unwrap();
        let mut slices = 0;
        while !matches!(sliced.advance(Duration::ZERO).unwrap(), Advance::Done(_)) {
            slices += 1;
        }
        assert!(slices > 1, "{slices} slices");
        assert_eq!(sliced.advance(Duration::ZERO).unwrap().frame().planes, expected.planes);
    }
}

#[test]
fn steady_frames_make_nothing_and_what_is_skipped_changes_no_bit() {
    if context().is_none() {
        return;
    }
    let context = Arc::new(Context::new(&ContextOptions::default()).unwrap());
    let mut renderer = Points::new(context.clone());
    let (_, job) = jobs().swap_remove(0);
    let tents = [(0.2, 0.0), (0.3, 8.0), (0.4, 0.0)].map(|(scalar, tau)| Node { scalar, rgb: [1.0, 0.5, 0.2], tau });
    let job = RenderJob { table: Arc::new(NodeTable::new(tents.to_vec()).unwrap()), ..job };
    let all = renderer.render(with_points(&job, EXACT)).unwrap().clone();
    let before = context.resources_created();
    assert_eq!(renderer.render(with_points(&job, EXACT)).unwrap().planes, all.planes);
    assert_eq!(context.resources_created(), before);
    // Cells in which nothing is visible.
    let visible = |cell: usize| {
        let s = job.mesh.topology.tets[cell].map(|v| job.scalars.values()[v as usize]);
        let (lo, hi) = s.iter().fold((f32::MAX, f32::MIN), |(lo, hi), &s| (lo.min(s), hi.max(s)));
        lo < 0.4 && hi > 0.2
    };
    let cells = job.active.universe();
    let some = CellSet::of(cells, |cell| job.active.contains(cell as u32) && visible(cell));
    let some = RenderJob { active: Arc::new(some), ..job.clone() };
    let fewer = renderer.render(with_points(&some, EXACT)).unwrap().clone();
    assert_eq!(all.planes, fewer.planes);
    assert!(fewer.stats.points_drawn < all.stats.points_drawn && fewer.stats.fragments < all.stats.fragments);
    assert_eq!(fewer.stats.points_total, some.active.count() as u64);
    assert!(all.planes.color.pixels.iter().any(|p| p[3] > 0.1));
    let opaque = Node { scalar: 0.0, rgb: [1.0; 3], tau: 1e4 };
    let opaque = RenderJob { table: Arc::new(NodeTable::new(vec![opaque]).unwrap()), ..job };
    let mut stopping = opaque.clone();
    stopping.skip.opaque = true;
    let [stopped, whole] = [&stopping, &opaque].map(|job| renderer.render(with_points(job, EXACT)).unwrap().clone());
    assert_eq!(stopped.planes, whole.planes);
    assert!(stopped.stats.rays_stopped_early > 0 && whole.stats.rays_stopped_early == 0);
}

#[test]
fn an_eye_in_the_boundary_sees_nothing_of_the_cells_behind_it() {
    let Some(context) = context() else { return };
    let raw = kuhn_grid([3; 3]);
    let meshes = [torn(&raw, &mut Random::new(4)), raw].map(|raw| Arc::new(Mesh::build(raw).unwrap().0));
    let (min, max) = meshes[0].positions.world_bounds();
    // In the upper boundary, no lattice point, and looking slightly down: rays of an even image that go up or down, none along it.
    let at = |share: DVec3| min + share * (max - min);
    let position = at(DVec3::new(0.62, 0.66, 1.0));
    let focal_point = at(DVec3::new(1.5, 0.85, 0.95));
    let projection = crate::camera::Projection::Perspective { view_angle: 100.0 };
    let camera = Camera { position, focal_point, view_up: DVec3::Z, projection, near: 0.0 };
    // Opaque within a ten-millionth: whatever is seen of a cell behind the eye, within rounding of it, is opaque.
    for mesh in meshes {
        let job = RenderJob { table: dense(3e7), ..job(&mesh, &camera, (64, 48)) };
        let (found, expected) = (frame(&context, &with_points(&job, EXACT)), on_cpu(&with_points(&job, EXACT)));
        let opacities = |frame: &Frame| frame.planes.color.pixels.iter().map(|p| p[3]).collect::<Vec<_>>();
        let apart = opacities(&found).into_iter().zip(opacities(&expected)).map(|(a, b)| (a - b).abs());
        let wrong = apart.filter(|apart| *apart > BOUNDS[1] as f32).count();
        let transparent = opacities(&expected).iter().filter(|a| **a == 0.0).count();
        assert!(wrong == 0, "{wrong} pixels of which {transparent} are transparent");
        assert!(transparent > 500 && transparent < 64 * 48 - 500, "{transparent}");
    }
}

#[test]
fn overlapping_cells_are_cut_and_deep_pixels_sorted() {
    let Some(context) = context() else { return };
    let raw = kuhn_grid([1; 3]);
    let many: Vec<_> = (0..700).flat_map(|_| raw.cells.tets.clone()).collect();
    let many = torn(&RawMesh { points: raw.points.clone(), cells: many.into() }, &mut Random::new(6));
    let [many, once] = [many, raw].map(|raw| Arc::new(Mesh::build(raw).unwrap().0));
    let camera = Camera { position: DVec3::new(3.0, 2.5, 2.0), ..cameras(DVec3::ZERO)[0].1 };
    let camera = Camera { focal_point: DVec3::splat(0.5), ..camera };
    let [many, once] = [&many, &once].map(|mesh| RenderJob { table: dense(1.0), ..job(mesh, &camera, (20, 20)) });
    let found = frame(&context, &with_points(&many, EXACT));
    let expected = frame(&context, &with_points(&once, EXACT));
    assert_eq!(found.stats.fragments, 700 * expected.stats.fragments);
    assert!(found.stats.out_of_order > 0, "each cell is there many times");
    assert!(is_within(difference(&found.planes.color.pixels, &expected.planes.color.pixels)));
}

#[test]
fn degenerate_cells_give_no_light_that_is_not_a_number() {
    let Some(context) = context() else { return };
    let mesh = mesh(8, 0, DVec3::ZERO);
    let flatten: [&dyn Fn(glam::Vec3) -> glam::Vec3; 4] =
        [&|p| glam::Vec3::new(p.x, p.y, 0.0), &|p| glam::Vec3::new(p.x, 0.0, 0.0), &|_| glam::Vec3::ZERO, &|p| {
            p * 1e-38
        }];
    for (i, flatten) in flatten.into_iter().enumerate() {
        let mut flat = (*mesh).clone();
        flat.positions.local.iter_mut().for_each(|p| *p = flatten(*p));
        let flat = Arc::new(flat);
        for (name, camera) in cameras(DVec3::ZERO) {
            let job = RenderJob { table: dense(1.0), ..job(&flat, &camera, (17, 17)) };
            for footprint in Footprint::ALL {
                for (compositing, lod) in [(Compositing::Own, 1.0), (Compositing::Gap, 1.0), (Compositing::Own, 0.5)] {
                    let style = PointStyle { footprint, compositing, lod, ..EXACT };
                    let found = frame(&context, &with_points(&job, style));
                    let is_light = |p: &[f32; 4]| p.iter().all(|c| c.is_finite() && (-1e-6..=1.0 + 1e-5).contains(c));
                    assert!(found.planes.color.pixels.iter().all(is_light), "case {i}, {name}, {style:?}");
                }
            }
        }
    }
    // Behind the eye, and none at all.
    let away = Camera { position: DVec3::splat(50.0), focal_point: DVec3::splat(60.0), ..cameras(DVec3::ZERO)[0].1 };
    let job = RenderJob { table: dense(1.0), ..job(&mesh, &away, (17, 17)) };
    let found = frame(&context, &with_points(&job, EXACT));
    assert_eq!(found.stats.points_culled, found.stats.points_drawn);
    assert!(found.stats.points_drawn > 0 && found.planes.color.pixels.iter().all(|p| *p == [0.0; 4]));
}

#[test]
fn isosurfaces_are_refused_where_points_are_not_the_cells() {
    use crate::render::surfaces::{Isosurface, SurfaceScene, SurfaceShading};
    let Some(context) = context() else { return };
    let (_, job) = jobs().swap_remove(0);
    let scene = SurfaceScene::new(&[Isosurface::new(0.1)], SurfaceShading::default(), &job.table).unwrap();
    let job = RenderJob { surfaces: Some(scene), ..job };
    let mut renderer = Points::new(context);
    let refused = renderer.render(with_points(&job, ELLIPSE)).unwrap_err();
    assert!(matches!(&refused, RenderError::BeyondGpu { problem, .. } if problem.contains("isosurfaces")), "{refused}");
    assert!(renderer.render(with_points(&job, EXACT)).is_ok());
}

#[test]
fn points_have_scalars_of_cells_and_values_beside_the_scalar_as_on_the_cpu() {
    let Some(context) = context() else { return };
    let (_, base) = jobs().swap_remove(0);
    let noise = |i: usize| 2.0 * crate::random::unit(crate::random::hash(5, i as u64)) as f32 - 1.0;
    let cells = testing::of_cells(&base);
    let jobs = [cells.clone(), testing::with_rows(&base, noise), testing::with_rows(&cells, noise)];
    for (i, job) in jobs.iter().enumerate() {
        for footprint in Footprint::ALL {
            for compositing in Compositing::ALL {
                let style = PointStyle { footprint, compositing, ..EXACT };
                let expected = on_cpu(&with_points(job, style)).planes.color.pixels;
                let apart = difference(&drawn(&context, job, style), &expected);
                assert!(is_within(apart), "{i}, {style:?}: {apart:?}");
                let other = difference(&drawn(&context, &base, style), &expected);
                assert!(!is_within(other), "{i}, {style:?}: without them it is noticed");
            }
        }
    }
}

//! What fields of functions promise whatever their values are: light, values far from zero, intervals of slabs, many functions at one place.

use super::slabs::Slabs;
use super::tests::{camera, cameras, dense, drawn, job, judged, mesh, node, smooth, tents};
use super::*;
use crate::camera::Camera;
use crate::functions::{Kernels, value_at};
use crate::mesh::Mesh;
use crate::mesh::test_meshes::{Random, cloud};
use crate::node_table::NodeTable;
use crate::render::Renderer;
use crate::render::functions::{FieldDomain, FunctionDomain, Normalise, SheetSpacing, SheetStyle, SlopeLight};
use crate::render::testing::{self, difference};
use crate::stats::FrameStats;
use glam::{DVec3, Vec3};

const FINE: SheetSpacing = SheetSpacing::Error(1e-5);

fn with(job: &RenderJob, change: impl FnOnce(FunctionScene) -> FunctionScene) -> RenderJob {
    RenderJob { functions: job.functions.clone().map(change), ..job.clone() }
}

fn lit(job: &RenderJob, towards: Option<DVec3>) -> RenderJob {
    with(job, |of| FunctionScene {
        light: Some(SlopeLight::new(towards, of.kernels.box_of_centers().unwrap(), of.range)),
        ..of
    })
}

#[test]
fn light_is_that_of_the_judge() {
    let mesh = mesh(3);
    let [outside, parallel, inside] = cameras(&mesh);
    let coverage =
        |of: FunctionScene| FunctionScene { domain: FieldDomain::of(FunctionDomain::Coverage, &of.kernels), ..of };
    for (camera, table, towards, by_coverage, normalise) in [
        (outside, dense(), None, false, Normalise::Sum),
        (parallel, tents(), Some(DVec3::new(0.6, 0.0, 0.8)), false, Normalise::Sum),
        (inside, dense(), Some(DVec3::Y), false, Normalise::Eq20),
        (outside, tents(), None, true, Normalise::Sum),
    ] {
        let job = RenderJob { table, ..job(&mesh, smooth(&mesh), &camera, (12, 10), FINE) };
        let job = with(&job, |of| FunctionScene { normalise, ..if by_coverage { coverage(of) } else { of } });
        let lit = lit(&job, towards);
        let (found, expected) = (drawn(&lit).planes.color.pixels, judged(&lit).color.pixels);
        let [rmse, most] = difference(&found, &expected);
        println!("{towards:?}: {rmse:.1e} {most:.1e}");
        assert!(rmse <= 1e-4 && most <= 1e-3, "{towards:?}: {rmse} {most}");
        // The comparison can fail, light changes no opacity, and neither vectors nor what is skipped changes a bit.
        assert!(difference(&drawn(&job).planes.color.pixels, &expected)[1] > 1e-2);
        let unlit = drawn(&job).planes.color.pixels;
        // Sums of other roundings: of some thousand pieces at most.
        assert!(unlit.iter().zip(&found).all(|(a, b)| (a[3] - b[3]).abs() < 1e-5));
        assert_eq!(Sheets::portable().render(lit.clone()).unwrap().planes.color.pixels, found);
        assert_eq!(drawn(&RenderJob { skip: crate::visibility::Skip::NONE, ..lit }).planes.color.pixels, found);
    }
}

#[test]
fn light_comes_from_where_it_is_said_to() {
    // A ball that is opaque near its middle, on nothing: values of one function among zeros.
    let mesh = mesh(4);
    let middle = mesh.vertex_source.iter().position(|&source| source == 62).unwrap();
    let values = (0..mesh.positions.local.len()).map(|v| if v == middle { 1.0 } else { 0.0 }).collect();
    let table = vec![node(0.1, [1.0; 3], 0.0), node(0.2, [1.0; 3], 500.0)];
    let from = camera(&mesh);
    let job = job(&mesh, values, &from, (32, 32), SheetSpacing::Error(1e-4));
    let job = RenderJob { table: Arc::new(NodeTable::new(table).unwrap()), ..job };
    let right = job.local_view().right;
    let of = |towards| drawn(&lit(&job, towards)).planes.color.pixels;
    let [from_right, from_left, from_eye] = [Some(right), Some(-right), None].map(of);
    assert!(from_eye.iter().any(|p| p[0] > 0.9));
    // Brightness of both sides of what is opaque.
    let opaque: Vec<usize> = (0..32 * 32).filter(|&pixel| from_eye[pixel][3] > 0.9).collect();
    let middle = opaque.iter().map(|pixel| pixel % 32).sum::<usize>() as f64 / opaque.len() as f64;
    let side = |pixels: &[[f32; 4]], is_left: bool| -> f32 {
        opaque.iter().filter(|&&pixel| (((pixel % 32) as f64) < middle) == is_left).map(|&pixel| pixels[pixel][0]).sum()
    };
    let (dark, bright) = (side(&from_right, true), side(&from_right, false));
    let (bright_too, dark_too) = (side(&from_left, true), side(&from_left, false));
    assert!(opaque.len() > 20 && dark < 0.4 * bright && dark_too < 0.4 * bright_too);
    // A field without a slope has its colours.
    let flat =
        RenderJob { scalars: crate::field::Scalars::Vertices(vec![0.5; mesh.positions.local.len()].into()), ..job };
    assert_eq!(drawn(&lit(&flat, None)).planes, drawn(&flat).planes);
}

#[test]
fn values_far_from_zero_keep_their_differences() {
    let mesh = mesh(3);
    let far = 1e5;
    let values: Vec<f32> = smooth(&mesh).into_iter().map(|value| far as f32 + value).collect();
    let nodes = dense().nodes().iter().map(|of| node(far + of.scalar, of.rgb, of.tau)).collect();
    let job = job(&mesh, values, &camera(&mesh), (16, 12), FINE);
    let job = RenderJob { table: Arc::new(NodeTable::new(nodes).unwrap()), ..job };
    let [rmse, most] = difference(&drawn(&job).planes.color.pixels, &judged(&job).color.pixels);
    println!("{rmse:.1e} {most:.1e}");
    // A rounding of a sum of this size is 4e-3 of the range, and moves colours by as much.
    assert!(rmse <= 1e-5 && most <= 1e-4, "{rmse} {most}");
}

/// A table that shows a random interval.
fn random_table(random: &mut Random) -> NodeTable {
    let from = random.signed();
    let to = from + 0.05 + 0.3 * random.signed().abs();
    let ends = [(from - 0.01, 0.0), (from, 1.0), (to, 1.0), (to + 0.01, 0.0)];
    NodeTable::new(ends.map(|(scalar, tau)| node(scalar, [1.0; 3], tau)).to_vec()).unwrap()
}

/// A linear field in a random direction and noise, between -1 and 1.
fn random_values(mesh: &Mesh, random: &mut Random) -> Vec<f32> {
    let along = Vec3::from_array([(); 3].map(|()| 1.5 * random.signed() as f32));
    let noise = 0.2 * random.signed() as f32;
    let values = mesh.positions.local.iter().map(|p| along.dot(*p) + noise * random.signed() as f32);
    values.map(|value| value.clamp(-1.0, 1.0)).collect()
}

#[test]
fn no_slab_that_is_skipped_has_a_visible_value() {
    let mut random = Random::new(5);
    let meshes = [1, 3, 4].map(mesh);
    let (mut skipped, mut beside) = (0u64, 0u64);
    for round in 0..10_000 {
        let mesh = &meshes[round % 3];
        let from = cameras(mesh)[round / 3 % 3];
        let values = random_values(mesh, &mut random);
        let normalise = if round % 5 == 0 { Normalise::Eq20 } else { Normalise::Sum };
        let of = job(mesh, values.clone(), &from, (16, 16), SheetSpacing::Error(1e-2));
        let of = with(&of, |of| FunctionScene { normalise, ..of });
        let (table, view) = (random_table(&mut random), of.local_view());
        let scene = of.functions.as_ref().unwrap();
        let in_view = FunctionPlacer::default().place(&of, scene, &view, &mut FrameStats::default());
        let mut slabs = Slabs::default();
        slabs.list(&in_view, 0, &values);
        // A tile's slabs, halved four times where something is visible.
        let mut leaves = 0;
        while let Some((slab, ends)) = slabs.next(&in_view.depths) {
            let Some(within) = slabs.values(&slab, normalise) else { continue };
            let is_clear = !table.is_visible_in(f64::from(within[0]), f64::from(within[1]));
            if !is_clear && slab.halvings() < 4 {
                slabs.halve(&slab, &in_view.depths);
                continue;
            }
            leaves += 1;
            skipped += u64::from(is_clear);
            let share = 0.5 + 0.5 * random.signed();
            let depth = ends[0] + share * (ends[1] - ends[0]);
            let pixel = (random.signed().abs() * 256.0) as usize % 256;
            let (px, py) = view.ray(pixel % 16, pixel / 16);
            let away = if view.perspective { depth } else { 1.0 };
            let place = view.eye + depth * view.forward + away * (px * view.right + py * view.up);
            let (sum, weight) = sums_at(&scene.kernels, &values, place);
            if weight > 1e-12 {
                let value = normalise.value(sum, weight);
                // f64 rounds a mean by some 2^-50.
                let (least, most) = (f64::from(within[0]) - 1e-14, f64::from(within[1]) + 1e-14);
                assert!((least..=most).contains(&value), "{round}: {value} in {within:?}");
                let is_visible = table.eval(value.clamp(within[0].into(), within[1].into())).tau > 0.0;
                assert!(!(is_clear && is_visible), "{round}: {value}");
                beside += u64::from(!is_clear && !is_visible);
            }
        }
        assert!(leaves > 0);
    }
    // Slabs are skipped, and intervals say more than nothing.
    assert!(skipped > 1000 && beside > 1000, "{skipped} {beside}");
}

/// Sums of v phi and of phi over all functions, as the field is defined.
fn sums_at(kernels: &Kernels, values: &[f32], place: DVec3) -> (f64, f64) {
    let mean = value_at(kernels, values, place).unwrap_or(0.0);
    let weights = (0..kernels.len())
        .filter_map(|i| kernels.get(i))
        .map(|function| kernels.weight(function.unscaled(place - function.center).length_squared()));
    let weight: f64 = weights.sum();
    (mean * weight, weight)
}

/// Functions of one width, local units, at the points of a cloud, with a camera around them.
fn heap(places: Vec<DVec3>, width: f32, size_px: (usize, usize)) -> RenderJob {
    let balls: Vec<(DVec3, f64)> = places.iter().map(|&place| (place, 0.1)).collect();
    let mesh = cloud(&balls, &[]);
    let factors = vec![[width, 0.0, width, 0.0, 0.0, width]; balls.len()];
    let kernels = Kernels::new(mesh.positions.local.clone(), factors, 3.0).unwrap();
    let values = (0..balls.len()).map(|i| if i % 2 == 0 { 0.25 } else { 0.75 }).collect();
    let job = testing::job(&mesh, values, &Camera::default_for(mesh.frame()).unwrap(), size_px, dense());
    let style = SheetStyle { spacing: SheetSpacing::Count(16) };
    let scene = FunctionScene::new(Arc::new(kernels), style, 0.5);
    let domain = FieldDomain::Box([Vec3::splat(-0.2), Vec3::splat(0.2)].map(|corner| corner.as_dvec3()));
    RenderJob { functions: Some(FunctionScene { domain, ..scene }), ..job }
}

#[test]
fn a_million_functions_on_a_pixel_are_one_mean() {
    let mut random = Random::new(9);
    let places = (0..1_000_000).map(|_| 0.01 * DVec3::new(random.signed(), random.signed(), random.signed())).collect();
    let job = heap(places, 0.05, (1, 1));
    let found = drawn(&job);
    assert_eq!(found.stats.functions_drawn, 1_000_000);
    // The values alternate at random places: their mean is 1/2 within some thousandths, as of a constant field.
    let constant = vec![0.5f32; 1_000_000].into();
    let expected = drawn(&RenderJob { scalars: crate::field::Scalars::Vertices(constant), ..job });
    let [_, most] = difference(&found.planes.color.pixels, &expected.planes.color.pixels);
    assert!(most < 2e-3 && expected.planes.color.pixels[0][3] > 0.05, "{most} {:?}", found.planes.color.pixels);
}

#[test]
fn more_functions_in_tiles_than_lists_hold_are_refused_with_what_to_do() {
    // Each covers all 8,160 tiles.
    let places = (0..17_000).map(|i| DVec3::splat(1e-6 * f64::from(i))).collect();
    let job = heap(places, 1.0, (1920, 1080));
    let problem = Sheets::new().render(job).unwrap_err().to_string();
    assert!(problem.contains("make the picture smaller"), "{problem}");
}

//! Splats that rays on the GPU draw from lists of tiles, against their fragments on the CPU.

use super::kernels::with_kernels;
use super::mixture::{icons, with_icons};
use super::outside::{of_cells, with_gaps};
use super::*;
use crate::mesh::NONE;
use crate::render::cpu::havs::Havs;
use crate::render::gpu::context::{Context, ContextOptions, Tier};
use crate::render::gpu::{havs, raycast, test_common};
use crate::render::{Frame, LayerFragment, RenderError};
use crate::stats::FrameStats;
use crate::visibility::Drawn;

/// Root mean square and greatest difference of the images. f32 has a place in a pattern to 2^-20 of a texel, and 2^-19 of the sums of a row.
const BOUNDS: [f64; 2] = [1e-6, 1e-4];

/// Renderers on a GPU, by cells and by faces, and their twins on the CPU.
struct Renderers {
    on_gpu: [Box<dyn Renderer>; 2],
    on_cpu: [Box<dyn Renderer>; 2],
}

/// A GPU that draws splats, or gets their fragments; without one the test is reported as skipped.
pub(super) fn context(draws_flow: bool) -> Option<Arc<Context>> {
    let options = ContextOptions { draws_flow: Some(draws_flow), ..ContextOptions::default() };
    Context::new(&options).map(Arc::new).map_err(|why| test_common::skip("gpu", &why.to_string())).ok()
}

impl Renderers {
    fn of(context: &Arc<Context>) -> Self {
        Self {
            on_gpu: [
                Box::new(raycast::Raycast::new(context.clone())),
                // Many bands, of which some end within a tile.
                Box::new(havs::Havs::with_fragment_bytes(context.clone(), 40_000)),
            ],
            on_cpu: [Box::new(Raycast::new()), Box::new(Havs::new())],
        }
    }

    /// Compares the images of a job by cells and by faces; that of `other` on the CPU differs. Returns the counts of the GPU and the CPU.
    fn compare(&mut self, name: &str, job: &RenderJob, other: &RenderJob) -> Vec<[FrameStats; 2]> {
        let [job, other] = [job, other].map(|job| with_faces(job.clone()));
        let render = |renderer: &mut dyn Renderer, job: &RenderJob| renderer.render(job.clone()).unwrap().clone();
        let mut stats = Vec::new();
        for ((on_gpu, on_cpu), way) in self.on_gpu.iter_mut().zip(&mut self.on_cpu).zip(["cells", "faces"]) {
            let (found, expected) = (render(&mut **on_gpu, &job), render(&mut **on_cpu, &job));
            let pixels = |frame: &Frame| frame.planes.color.pixels.clone();
            let apart @ [rmse, most] = difference(&pixels(&found), &pixels(&expected));
            eprintln!("{name}, {way}: {rmse:.1e}, {most:.1e}");
            assert!(found.stats.on_gpu && rmse <= BOUNDS[0] && most <= BOUNDS[1], "{name}, {way}: {apart:?}");
            assert_depths(&format!("{name}, {way}"), &found, &expected);
            let others = render(&mut **on_cpu, &other);
            let [rmse, _] = difference(&pixels(&others), &pixels(&expected));
            assert!(rmse > 10.0 * BOUNDS[0], "{name}, {way}: {rmse:.1e} is not noticed");
            stats.push([found.stats, expected.stats]);
        }
        stats
    }
}

/// Asserts that nearly all pixels are seen from the same depth: where a pattern is dark, its sums are rounded to no light or to next to none.
fn assert_depths(name: &str, found: &Frame, expected: &Frame) {
    let depths = found.planes.depth.pixels.iter().zip(&expected.planes.depth.pixels);
    let is_apart = |(a, b): &(&f32, &f32)| !(a == b || (*a - *b).abs() <= 1e-5 * b.abs().max(1.0));
    let apart = depths.filter(is_apart).count();
    assert!(20 * apart <= found.planes.depth.pixels.len(), "{name}: {apart} pixels are seen from another depth");
}

/// The job with the faces of its cells.
fn with_faces(job: RenderJob) -> RenderJob {
    let cells = &job.mesh.topology.connectivity().face_cells;
    let is_active = |cells: &[u32; 2]| cells.iter().any(|&cell| cell != NONE && job.active.contains(cell));
    let ids = (0u32..).zip(cells).filter(|(_, cells)| is_active(cells)).map(|(face, _)| face).collect();
    RenderJob { faces: Some(Arc::new(Drawn { ids, is_complete: true })), ..job }
}

/// The job with the splats of a scene.
pub(super) fn with_flow(job: &RenderJob, scene: &FlowScene) -> RenderJob {
    RenderJob { flow: Some(Arc::new(scene.splats(&job.local_view()))), ..job.clone() }
}

/// The scene a little later.
pub(super) fn later(scene: &FlowScene) -> FlowScene {
    FlowScene { travel: Arc::new(scene.travel.iter().map(|way| 1.13 * way).collect()), ..scene.clone() }
}

/// Scenes of a mesh: icons, blur, fidelity, few and large splats, vectors of cells, mixtures, kernels.
pub(super) fn scenes(mesh: &Arc<Mesh>, job: &RenderJob) -> Vec<(&'static str, FlowScene)> {
    let usual = FlowStyle::default();
    let styled = |style| scene(mesh, style, vortex);
    let held = HeldFlow { time: 7.0, shutter: 0.8 };
    let few = Some(Arc::new(chosen(mesh, Association::Point, 9)));
    let paper = FlowStyle { fidelity: FlowFidelity::Paper, ..usual };
    let two = |first: f64| icons([first, 2.0 * first], 0.3 * first);
    vec![
        ("strokes", styled(usual)),
        ("blurred lines", FlowScene { held, ..styled(FlowStyle { icon: Icon::Lines, ..usual }) }),
        ("particles of paper", styled(FlowStyle { icon: Icon::Particles, ..paper })),
        ("few large arrows", FlowScene { chosen: few, ..styled(FlowStyle { icon: Icon::Arrows, size: 2.5, ..usual }) }),
        ("small", styled(FlowStyle { size: 0.05, length: Some(0.2), ..usual })),
        ("cells", scene_of_cells(mesh, usual, vortex)),
        ("icons by speed", with_icons(mesh, two(0.4), None)),
        ("kernels", with_kernels(styled(FlowStyle { opacity: 0.9, ..usual }), job)),
        ("kernels of paper", with_kernels(styled(FlowStyle { opacity: 0.9, ..paper }), job)),
    ]
}

#[test]
fn rays_draw_from_lists_what_fragments_show() {
    let Some(context) = context(true) else { return };
    let mut renderers = Renderers::of(&context);
    let mesh = mesh(4);
    let middle = mesh.positions.origin;
    let clips = vec![Plane::new(&mesh.positions, middle, DVec3::new(0.8, 0.3, -0.4)).unwrap()];
    for (camera, view) in cameras(&mesh).into_iter().zip(["outside", "parallel", "wide", "inside"]) {
        let job = job(&mesh, &camera, (75, 43));
        let clear = RenderJob { table: Arc::new(NodeTable::transparent()), ..job.clone() };
        for (number, (name, scene)) in scenes(&mesh, &job).into_iter().enumerate() {
            let name = format!("{view}, {name}");
            let [alone, others] = [&scene, &later(&scene)].map(|scene| with_flow(&clear, scene));
            for [found, expected] in renderers.compare(&format!("{name}, no volume"), &alone, &others) {
                // Where a pattern is dark, its sums are rounded to no light or to next to none; kernels are dark nowhere.
                let share = if scene.kernels.is_some() { 1000 } else { 8 };
                let counts = |stats: &FrameStats| [stats.flow_fragments, stats.flow_outside];
                for (found, expected) in counts(&found).into_iter().zip(counts(&expected)) {
                    assert!(found.abs_diff(expected) * share <= expected, "{name}: {found} of {expected}");
                }
            }
            if scene.kernels.is_none() {
                let [all, others] = [&scene, &later(&scene)].map(|scene| with_flow(&job, scene));
                renderers.compare(&name, &all, &others);
                // Clips cut all alike.
                if number % 3 == 0 {
                    let cut = with_flow(&job, &FlowScene { clips: clips.clone(), ..scene });
                    renderers.compare(&format!("{name}, clipped"), &cut, &all);
                }
            }
        }
    }
}

#[test]
fn lists_hold_for_any_lattice_among_holes_and_other_layers() {
    let Some(context) = context(true) else { return };
    let mut renderers = Renderers::of(&context);
    let mesh = with_gaps();
    let mut random = Random::new(9);
    for camera in cameras(&mesh) {
        let holes: Vec<bool> = mesh.topology.tets.iter().map(|_| random.below(8) == 0).collect();
        let all = scene(&mesh, FlowStyle { size: 0.8, ..FlowStyle::default() }, vortex);
        let some = of_cells(all.clone(), |cell| !holes[cell as usize]);
        for stride in [1, 2, 7, 1000] {
            let usual = job(&mesh, &camera, (131, 78));
            let samples = Samples::Lattice(Lattice::new(stride.try_into().unwrap()));
            let job = RenderJob { view: View { samples, ..usual.view.clone() }, ..usual };
            let [shown, others] = [&some, &all].map(|scene| with_flow(&job, scene));
            if stride < 1000 {
                renderers.compare(&format!("every {stride}"), &shown, &others);
            }
            // At the depths of some splats, between others, and before the near plane.
            let (splats, scale) = (some.splats(&job.local_view()), mesh.positions.scale);
            let depths = splats.projected().iter().step_by(5).map(|splat| splat.depth * scale).chain([-3.0]);
            let flat = |(depth, pixel): (f64, u32)| (pixel, LayerFragment { depth, rgba: [0.02, 0.0, 0.03, 0.04] });
            let pixels = splats.pixels() as u32;
            let fragments = depths.flat_map(|depth| (0..pixels).step_by(2).map(move |pixel| flat((depth, pixel))));
            let fragments = Arc::new(LayerFragments::new(splats.pixels(), fragments).unwrap());
            let among = RenderJob { flow: Some(Arc::new(splats.among(Some(fragments)))), ..job.clone() };
            renderers.compare(&format!("every {stride}, among others"), &among, &shown);
        }
    }
}

#[test]
fn a_gpu_that_draws_no_splats_has_the_bits_of_their_fragments_and_frees_lists_of_the_other() {
    let [Some(without), Some(with)] = [false, true].map(context) else { return };
    let mesh = mesh(4);
    let job = job(&mesh, &camera(&mesh), (60, 40));
    let scene = scene(&mesh, FlowStyle::default(), vortex);
    let flow = with_flow(&job, &scene);
    let fragments = Arc::new(scene.splats(&job.local_view()).fragments(None).unwrap().0);
    let of_fragments = RenderJob { fragments: Some(fragments.clone()), ..job.clone() };
    let mut plain = raycast::Raycast::new(without);
    let expected = plain.render(of_fragments.clone()).unwrap().clone();
    let found = plain.render(flow.clone()).unwrap();
    assert!(found.planes == expected.planes && found.stats.flow_fragments == fragments.count() as u64);
    // Fragments that were made beforehand take the place of none that are drawn twice.
    let made = RenderJob { fragments: Some(fragments), ..flow.clone() };
    assert!(plain.render(made.clone()).unwrap().planes == expected.planes);
    let mut renderer = raycast::Raycast::new(with.clone());
    let bits = |renderer: &mut raycast::Raycast, job: &RenderJob| renderer.render(job.clone()).unwrap().planes.clone();
    let first = bits(&mut renderer, &flow);
    assert!(bits(&mut renderer, &made) == first && first != expected.planes, "lists are drawn");
    // A steady frame makes nothing, nor does a frame of later splats.
    let before = with.resources_created();
    assert!(bits(&mut renderer, &flow) == first && bits(&mut renderer, &with_flow(&job, &later(&scene))) != first);
    assert_eq!(with.resources_created(), before);
    // Fragments, nothing, and splats again.
    let without_layers = plain.render(job.clone()).unwrap().planes.clone();
    for (job, expected) in [(&of_fragments, &expected.planes), (&job, &without_layers), (&flow, &first)] {
        assert!(bits(&mut renderer, job) == *expected);
    }
}

#[test]
fn lists_hold_in_f64_and_within_default_limits() {
    let mut raw = jittered(kuhn_grid([5; 3]), &mut Random::new(3));
    raw.points.iter_mut().for_each(|point| point.z *= 1e-3);
    let flat = Arc::new(Mesh::build(raw).unwrap().0);
    let (mut in_f64, mut has_f64, usual) = (0, false, FlowStyle { size: 1.0, ..FlowStyle::default() });
    for tier in [Tier::Adapter, Tier::WebGpu] {
        let options = ContextOptions { draws_flow: Some(true), tier, ..ContextOptions::default() };
        let Ok(context) = Context::new(&options) else { return test_common::skip("gpu", "there is none") };
        has_f64 |= context.has_f64();
        let mut renderers = Renderers::of(&Arc::new(context));
        let camera = camera(&flat);
        let node = |scalar, tau| Node { scalar, rgb: [0.3, 0.6, 0.2], tau };
        let dense = Arc::new(NodeTable::new(vec![node(-1.0, 5.0), node(1.0, 60.0)]).unwrap());
        let job = RenderJob { table: dense, ..job(&flat, &camera, (60, 33)) };
        let clear = RenderJob { table: Arc::new(NodeTable::transparent()), ..job.clone() };
        let scene = scene(&flat, usual, vortex);
        for job in [job, clear] {
            let [shown, others] = [&scene, &later(&scene)].map(|scene| with_flow(&job, scene));
            let stats = renderers.compare(&format!("{tier:?}"), &shown, &others);
            in_f64 += stats.iter().filter(|[found, _]| found.in_f64).count();
        }
    }
    assert_eq!(in_f64, if has_f64 { 2 } else { 0 });
}

/// A job, and splats at all vertices of a mesh, or in all its cells, each of which covers the image.
fn wide_splats(mesh: &Arc<Mesh>, of_cells: bool, size_px: (usize, usize)) -> RenderJob {
    let style = FlowStyle { size: 40.0, length: Some(1.0), ..FlowStyle::default() };
    let scene = if of_cells { scene_of_cells(mesh, style, vortex) } else { scene(mesh, style, vortex) };
    let outside = Camera { projection: Projection::Parallel { scale: 1.0 }, ..camera(mesh) };
    let scene = FlowScene { inside: None, ..scene };
    with_faces(with_flow(&job(mesh, &outside, size_px), &scene))
}

#[test]
fn lists_that_are_too_short_are_made_longer_and_have_the_same_image() {
    let Some(context) = context(true) else { return };
    let job = wide_splats(&mesh(3), false, (200, 150));
    let renderers: [Box<dyn Renderer>; 2] = [
        Box::new(raycast::Raycast::new(context.clone())),
        Box::new(havs::Havs::with_fragment_bytes(context.clone(), 40_000)),
    ];
    let twins: [Box<dyn Renderer>; 2] = [Box::new(Raycast::new()), Box::new(Havs::new())];
    for (mut renderer, mut twin) in renderers.into_iter().zip(twins) {
        let [first, again] = [0, 1].map(|_| renderer.render(job.clone()).unwrap().clone());
        assert_eq!([first.stats.entry_retries, again.stats.entry_retries], [1, 0]);
        assert!(first.planes == again.planes);
        let expected = twin.render(job.clone()).unwrap();
        let pixels = |frame: &Frame| frame.planes.color.pixels.clone();
        let apart @ [rmse, most] = difference(&pixels(&first), &pixels(expected));
        assert!(rmse <= BOUNDS[0] && most <= BOUNDS[1], "{apart:?}");
    }
}

#[test]
fn more_places_than_a_texture_has_and_more_splats_of_a_tile_than_are_sorted_are_refused() {
    let options = ContextOptions { draws_flow: Some(true), tier: Tier::WebGpu, ..ContextOptions::default() };
    let Ok(context) = Context::new(&options) else { return test_common::skip("gpu", "there is none") };
    let context = Arc::new(context);
    let large = mesh(24);
    // 2,744 in each of 4,096 tiles, and 82,944 in one, and in each of as many.
    for (job, reason) in [
        (wide_splats(&mesh(13), false, (1024, 1024)), "more places in tiles than a texture"),
        (wide_splats(&large, true, (16, 16)), "reach a tile"),
        (wide_splats(&large, true, (1024, 1024)), "are too many"),
    ] {
        for refused in [
            raycast::Raycast::new(context.clone()).render(job.clone()).map(|_| ()),
            havs::Havs::new(context.clone()).render(job.clone()).map(|_| ()),
        ] {
            let is_expected =
                matches!(&refused, Err(RenderError::BeyondGpu { problem, .. }) if problem.contains(reason));
            assert!(is_expected, "{refused:?}");
        }
    }
}

#[test]
fn without_a_splat_in_view_the_other_layers_are_drawn() {
    let Some(context) = context(true) else { return };
    let mut renderers = Renderers::of(&context);
    let mesh = mesh(4);
    let job = job(&mesh, &camera(&mesh), (60, 40));
    let still = scene(&mesh, FlowStyle::default(), |_| DVec3::ZERO).splats(&job.local_view());
    let flat = |pixel| (pixel, LayerFragment { depth: 1.0, rgba: [0.2, 0.0, 0.3, 0.4] });
    let fragments = Arc::new(LayerFragments::new(still.pixels(), (0..900).map(flat)).unwrap());
    let among = RenderJob { flow: Some(Arc::new(still.among(Some(fragments)))), ..job.clone() };
    renderers.compare("without splats", &among, &job);
}

#[test]
fn lists_of_pixels_are_refused() {
    let mesh = mesh(4);
    let job = job(&mesh, &camera(&mesh), (60, 40));
    let all = scene(&mesh, FlowStyle::default(), vortex);
    let pixels = Samples::Pixels(Arc::new(PixelSet::new((60, 40), &[7, 3, 1000]).unwrap()));
    let listed = RenderJob { view: View { samples: pixels, ..job.view.clone() }, ..job };
    let flow = with_flow(&listed, &all);
    // The CPU draws them as they are in the whole image.
    let some = Raycast::new().render(flow.clone()).unwrap().planes.color.pixels.clone();
    let whole = RenderJob { view: View { samples: Samples::ALL, ..listed.view.clone() }, ..listed };
    let whole = Raycast::new().render(with_flow(&whole, &all)).unwrap().planes.color.pixels.clone();
    assert_eq!(some, [7, 3, 1000].map(|pixel: usize| whole[pixel]));
    let Some(context) = context(true) else { return };
    let refused = raycast::Raycast::new(context).render(flow).map(|_| ());
    assert!(matches!(refused, Err(RenderError::BeyondGpu { problem, .. }) if problem.contains("list of pixels")));
}

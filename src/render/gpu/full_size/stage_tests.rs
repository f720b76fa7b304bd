//! Upsampling filters against the CPU's, from the same small image and the same depth layers.

use super::*;
use crate::image::upsample::{self, Enlarging, JointKernel, LEAST_SUM, Reference};
use crate::image::{Planes, RgbaImage};
use crate::mesh::Mesh;
use crate::mesh::test_meshes::kuhn_grid_of;
use crate::render::Renderer;
use crate::render::cpu::layers::boundary_faces;
use crate::render::gpu::context::ContextOptions;
use crate::render::gpu::layers::DepthLayers;
use crate::render::gpu::layers::stage_tests::large_faces;
use crate::render::gpu::raycast::Raycast;
use crate::render::gpu::raycast::stage_tests::{cameras, context, context_of_window, job, mesh};
use crate::render::gpu::target::OnePlane;
use crate::render::upsampling::{DepthEdges, Enlargement, ImageScale, UpsampleFilter, UpsampleKind, small_view};
use crate::task::Cancel;
use crate::visibility::CellSet;
use glam::DVec3;

impl<L> AtFullSize<L> {
    /// At the pixels of the full image, and at the samples of the small one.
    pub(in crate::render::gpu) fn layers(&self) -> &[DepthLayers; 2] {
        &self.enlarger.scene.layers
    }

    /// The range of the first of them.
    pub(in crate::render::gpu) fn range(&self) -> &GrowingBuffer {
        &self.enlarger.scene.range
    }
}

/// A job whose image is as large as this one's once it is enlarged.
pub(in crate::render::gpu) fn enlarged(job: &RenderJob, scale: ImageScale, filter: UpsampleFilter) -> RenderJob {
    let view = job.view.clone();
    let enlarging = Enlarging::by(scale.factor(), (view.width_px, view.height_px));
    let small = small_view(&enlarging, &view);
    let enlargement = Enlargement { filter, enlarging, view, domain: job.active.clone() };
    RenderJob { view: small, enlarge: Some(Arc::new(enlargement)), ..job.clone() }
}

pub(in crate::render::gpu) fn drawn<R: Renderer>(renderer: &mut R, job: &RenderJob) -> Frame {
    renderer.render(job.clone()).unwrap().clone()
}

/// The pixels of a plane of four numbers, without the last.
fn read_plane(context: &Context, plane: &OnePlane) -> Reference {
    let (width, height) = (plane.texture.width(), plane.texture.height());
    let row = (16 * width).next_multiple_of(256);
    let staging = context.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row * height),
        usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    let to = wgpu::TexelCopyBufferInfo { buffer: &staging, layout };
    encoder.copy_texture_to_buffer(plane.texture.as_image_copy(), to, plane.texture.size());
    context.queue.submit([encoder.finish()]);
    let words = crate::render::gpu::raycast::stage_tests::read_back(context, &staging);
    let number = |x: u32, y: u32, i: u32| f32::from_bits(words[(y * row / 4 + 4 * x + i) as usize]);
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [0, 1, 2].map(|i| number(x, y, i)))).collect();
    Reference { width: width as usize, height: height as usize, pixels }
}

/// What the CPU makes of the same image and the same layers, the fewest and the most pixels that fall back, and by how much colours may
/// differ.
fn twin(small: &Planes, [reference, at_samples]: [&Reference; 2], to: &Enlargement) -> (RgbaImage, [u64; 2], f64) {
    // Half the distance from 1 to the next f32.
    let unit = 1.0 / f64::from(1 << 24);
    // Of a weight 2^-t: what f32 makes of t, and WGSL's bound for exp2, (3 + 2 t) units in the last place, on both sides.
    let of_weight = |t: f64| 2.0 * (6.0 + 8.0 * t) * unit;
    match to.filter {
        UpsampleFilter::Nearest => (upsample::nearest(&small.color, &to.enlarging), [0; 2], 0.0),
        // Three steps, each rounded twice or three times, on both sides; colours are at most 1.
        UpsampleFilter::Bilinear => (upsample::bilinear(&small.color, &to.enlarging), [0; 2], 12.0 * unit),
        UpsampleFilter::Joint { kernel_px, edges } => {
            let kernel = JointKernel { kernel_px, sigma_reference: edges.sigma_depth };
            let image = upsample::bilinear(&small.color, &to.enlarging);
            // Weights 2^-t of N pixels, of which one is 1: the mean of t is at most log2 N (their entropy is the mean of t and the
            // logarithm of their sum). Sums are rounded row by row, and then over rows.
            let along = 2.0 * (kernel_px / 2) as f64 + 1.0;
            let bound = of_weight((along * along).log2()) + 8.0 * along * unit + 12.0 * unit;
            (upsample::joint(&image, reference, kernel, &Cancel::new()).unwrap(), [0; 2], bound)
        }
        UpsampleFilter::Joint2x2 { edges } => {
            let references = [reference, at_samples];
            let above =
                |least| upsample::joint2x2_above(least, &small.color, &to.enlarging, references, edges.sigma_depth);
            let (image, _) = above(LEAST_SUM);
            // As above, of four pixels whose weights sum up to LEAST_SUM or more.
            let of_weights = of_weight(2.0 - f64::from(LEAST_SUM).log2());
            // Whether a sum that is as near to it is below or above is a matter of rounding.
            assert!(of_weights < 1e-4);
            let fell_back = [1.0 - 1e-4, 1.0 + 1e-4].map(|near| above(LEAST_SUM * near).1);
            (image, fell_back, of_weights + 12.0 * unit)
        }
    }
}

fn farthest_apart(a: &RgbaImage, b: &RgbaImage) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let pairs = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
    pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}

#[test]
fn filters_make_of_an_image_what_the_cpu_makes_of_it() {
    let Some(context) = context() else { return };
    let mut renderer = Raycast::new(context.clone());
    let mut fallen_back = 0;
    for (size_px, scale) in [
        ((131, 77), ImageScale::Quarter),
        ((40, 61), ImageScale::Half),
        ((70, 50), ImageScale::Full),
        ((5, 3), ImageScale::Eighth),
        ((1, 1), ImageScale::Half),
    ] {
        for (name, camera) in &cameras(DVec3::ZERO)[..4] {
            let job = job(&mesh(3, 5, DVec3::ZERO), camera, size_px);
            // As by default, and Omega from one pixel to as many as there may be.
            let usual = UpsampleKind::ALL.iter().map(|kind| kind.usual(scale));
            let kernels = [1, 17, 64].map(|kernel_px| UpsampleFilter::Joint { kernel_px, edges: DepthEdges::USUAL });
            for filter in usual.chain(kernels) {
                let job = enlarged(&job, scale, filter);
                let small = drawn(&mut renderer, &RenderJob { enlarge: None, ..job.clone() }).planes;
                let frame = drawn(&mut renderer, &job);
                let to = job.enlarge.as_ref().unwrap();
                let [reference, at_samples] = renderer.layer.layers().each_ref().map(|layers| {
                    let none = Reference { width: 0, height: 0, pixels: Vec::new() };
                    layers.plane().map_or(none, |plane| read_plane(&context, plane))
                });
                let (expected, fell_back, bound) = twin(&small, [&reference, &at_samples], to);
                let apart = farthest_apart(&frame.planes.color, &expected);
                assert!(apart <= bound, "{name}, {size_px:?}, {filter:?}: {apart:.1e} of {bound:.1e}");
                assert!(frame.planes.depth == upsample::nearest(&small.depth, &to.enlarging), "{name}, {filter:?}");
                assert!((fell_back[0]..=fell_back[1]).contains(&frame.stats.upsample_fallbacks), "{name}, {filter:?}");
                fallen_back += frame.stats.upsample_fallbacks;
                // The comparison can fail: it notices one sample that is off by a tenth, of which the widest kernel leaves 2e-4.
                let mut other = small.clone();
                other.color.pixels[0][3] += 0.1;
                let other = farthest_apart(&frame.planes.color, &twin(&other, [&reference, &at_samples], to).0);
                assert!(other > bound, "{name}, {size_px:?}, {filter:?}: another sample is not noticed, {other:.1e}");
            }
        }
    }
    assert!(fallen_back > 0, "no pixel fell back");
}

#[test]
fn an_image_is_the_same_in_any_slices_and_by_a_renderer_of_other_images_before() {
    let Some(context) = context() else { return };
    let job = job(&mesh(3, 5, DVec3::ZERO), &cameras(DVec3::ZERO)[0].1, (131, 77));
    let mut used = Raycast::new(context.clone());
    for kind in UpsampleKind::ALL {
        let job = enlarged(&job, ImageScale::Quarter, kind.usual(ImageScale::Quarter));
        let whole = drawn(&mut Raycast::new(context.clone()), &job);
        used.begin(job.clone()).unwrap();
        let mut slices = 0;
        let sliced = loop {
            slices += 1;
            if let crate::render::Advance::Done(frame) = used.advance(Duration::ZERO).unwrap() {
                break frame.clone();
            }
        };
        let least = if whole.stats.depth_layers > 0 { 5 } else { 2 };
        assert!(slices >= least && sliced.planes == whole.planes, "{kind}: {slices} slices");
        assert_eq!(sliced.stats.upsample_fallbacks, whole.stats.upsample_fallbacks);
        assert!(sliced.stats.ms_render >= 0.0 && sliced.stats.ms_upsample > 0.0, "{kind}");
        assert_eq!(sliced.stats.ms_depth_layers > 0.0, sliced.stats.depth_layers > 0, "{kind}");
        // One that is given up half way.
        used.begin(job.clone()).unwrap();
        for _ in 0..slices / 2 {
            used.advance(Duration::ZERO).unwrap();
        }
        assert!(drawn(&mut used, &job).planes == whole.planes, "{kind}, after one that was given up");
        // And what is not enlarged stays as it is.
        assert_eq!(drawn(&mut used, &RenderJob { enlarge: None, ..job.clone() }).planes.color.width, 33);
    }
}

#[test]
fn enlarged_frames_for_a_window_stay_on_its_gpu() {
    let Some(context) = context_of_window() else { return };
    let job = job(&mesh(3, 5, DVec3::ZERO), &cameras(DVec3::ZERO)[0].1, (131, 77));
    let joint = UpsampleFilter::Joint { kernel_px: 4, edges: DepthEdges::USUAL };
    let job = RenderJob { for_window: true, ..enlarged(&job, ImageScale::Quarter, joint) };
    let mut renderer = Raycast::new(context.clone());
    let size = |frame: &Frame| frame.texture.as_ref().map(|t| (t.texture().width(), t.texture().height()));
    for _ in 0..2 {
        let frame = renderer.render(job.clone()).unwrap();
        assert_eq!((size(frame), frame.planes.color.pixels.len()), (Some((131, 77)), 0));
    }
    let before = context.resources_created();
    renderer.render(job.clone()).unwrap();
    assert_eq!(context.resources_created(), before);
    let texture = renderer.render(job.clone()).unwrap().texture.as_ref().unwrap().texture().clone();
    // Wherever one is given up, before its image is there or while that is enlarged, the next one has its texture.
    for slices in 0..12 {
        renderer.begin(job.clone()).unwrap();
        for _ in 0..slices {
            renderer.advance(Duration::ZERO).unwrap();
        }
        let frame = renderer.render(job.clone()).unwrap();
        assert_eq!(frame.texture.as_ref().map(|t| t.texture()), Some(&texture), "given up after {slices} slices");
    }
    // As has one that is as large without being enlarged.
    let view = job.enlarge.as_ref().unwrap().view.clone();
    let whole = RenderJob { view, enlarge: None, ..job.clone() };
    for slices in [None, Some(0), Some(1), None] {
        renderer.begin(job.clone()).unwrap();
        match slices {
            Some(slices) => (0..slices).for_each(|_| _ = renderer.advance(Duration::ZERO).unwrap()),
            None => _ = renderer.advance(Duration::MAX).unwrap(),
        }
        let frame = renderer.render(whole.clone()).unwrap();
        assert_eq!(frame.texture.as_ref().map(|t| t.texture()), Some(&texture), "behind {slices:?} slices");
    }
    let elsewhere = renderer.render(RenderJob { for_window: false, ..job }).unwrap();
    assert_eq!((size(elsewhere), elsewhere.planes.color.pixels.len()), (None, 131 * 77));
}

#[test]
fn an_image_without_room_at_full_size_comes_back_as_it_is_and_the_next_one_does_at_once() {
    if context().is_none() {
        return;
    }
    // The renderer has few faces, the filter a boundary that takes more than a binding has: 12 bytes a face.
    let options = ContextOptions { binding_bytes: Some(100_000), ..ContextOptions::default() };
    let context = Arc::new(Context::new(&options).unwrap());
    let keep = |[x, y, z]: [usize; 3]| (x + y + z) % 2 == 0;
    let mesh = Arc::new(Mesh::build(kuhn_grid_of([12; 3], keep)).unwrap().0);
    let job = job(&mesh, &cameras(DVec3::ZERO)[0].1, (40, 30));
    let few = CellSet::of(job.active.universe(), |cell| cell % 64 == 0);
    assert!(boundary_faces(&job, &job.active).unwrap().len() > 100_000 / 12);
    let edges = UpsampleFilter::Joint { kernel_px: 4, edges: DepthEdges::USUAL };
    let job = RenderJob { active: Arc::new(few), ..enlarged(&job, ImageScale::Half, edges) };
    let mut renderer = Raycast::new(context.clone());
    let as_it_is = drawn(&mut renderer, &RenderJob { enlarge: None, ..job.clone() });
    assert!(as_it_is.stats.rays_hit > 0 && as_it_is.planes.color.width == 20);
    for is_refused in [false, true] {
        let begun = renderer.layer.begin(job.clone(), &mut Frame::default()).unwrap().unwrap();
        assert_eq!(begun.sizing.is_none(), is_refused, "it is known from the first one on");
        let frame = drawn(&mut renderer, &job);
        let sizes = [&frame, &as_it_is].map(|frame| (frame.planes.color.width, frame.planes.depth.width));
        assert_eq!(sizes[0], sizes[1], "refused {is_refused}");
        assert!(frame.planes == as_it_is.planes, "refused {is_refused}");
        assert_eq!((frame.stats.on_gpu, frame.stats.upsampled_on_gpu), (true, false), "refused {is_refused}");
        let counts = |frame: &Frame| (frame.stats.steps, frame.stats.rays_hit, frame.stats.depth_layers);
        assert_eq!(counts(&frame), counts(&as_it_is), "nothing is counted twice");
    }
    // Another filter may have room.
    let whole = RenderJob { view: job.enlarge.as_ref().unwrap().view.clone(), enlarge: None, ..job };
    let job = enlarged(&whole, ImageScale::Half, UpsampleFilter::Bilinear);
    assert!(drawn(&mut renderer, &job).stats.upsampled_on_gpu);
}

#[test]
fn an_image_of_few_rays_is_enlarged_when_it_is_whole_and_one_of_another_size_is_refused() {
    let Some(context) = context() else { return };
    let job = job(&mesh(3, 5, DVec3::ZERO), &cameras(DVec3::ZERO)[0].1, (131, 77));
    let job = enlarged(&job, ImageScale::Half, UpsampleFilter::Nearest);
    let mut renderer = Raycast::new(context);
    let whole = drawn(&mut renderer, &job);
    let previews = [0.2, 0.05].map(|contrast| Contrast::new(contrast).unwrap()).to_vec();
    let mut seen = 0;
    let shown = RenderJob { previews, ..job.clone() };
    let frame = renderer.render_with_previews(shown, &mut |_, _| seen += 1).unwrap().unwrap();
    assert!(seen == 0 && frame.planes == whole.planes);
    // Large enough for blocks that lie within a cell.
    let large = self::job(&job.mesh, &cameras(DVec3::ZERO)[0].1, (523, 307));
    let large = enlarged(&large, ImageScale::Half, UpsampleFilter::Nearest);
    let few = RenderJob { contrast: Contrast::new(0.5), ..large.clone() };
    let small = drawn(&mut renderer, &RenderJob { enlarge: None, ..few.clone() });
    let frame = drawn(&mut renderer, &few);
    assert!(frame.planes.color == upsample::nearest(&small.planes.color, &few.enlarge.as_ref().unwrap().enlarging));
    assert!(frame.stats.blocks_filled > 0 && frame.stats.upsampled_on_gpu);
    assert!(frame.planes != drawn(&mut renderer, &large).planes);

    let mut other = job.clone();
    other.view.width_px += 1;
    let expected = RenderError::EnlargedSize { given: (67, 39), expected: (66, 39) };
    assert_eq!(renderer.begin(other).unwrap_err(), expected);
    let mut enlargement = Enlargement::clone(job.enlarge.as_ref().unwrap());
    enlargement.view.height_px = 78;
    let other = RenderJob { enlarge: Some(Arc::new(enlargement)), ..job };
    let expected = RenderError::EnlargedSize { given: (131, 78), expected: (131, 77) };
    assert_eq!(renderer.begin(other).unwrap_err(), expected);
}

#[test]
fn what_an_image_takes_at_full_size_is_given_back_with_the_next_one_that_is_not_enlarged() {
    let Some(context) = context() else { return };
    let (mesh, others) = (mesh(3, 5, DVec3::ZERO), mesh(2, 5, DVec3::ZERO));
    let camera = &cameras(DVec3::ZERO)[0].1;
    let other = job(&others, camera, (40, 30));
    let held = [None, Some(UpsampleKind::Joint), Some(UpsampleKind::Joint2x2)].map(|kind| {
        let mut renderer = Raycast::new(context.clone());
        let job = job(&mesh, camera, (131, 77));
        match kind {
            Some(kind) => drawn(&mut renderer, &enlarged(&job, ImageScale::Half, kind.usual(ImageScale::Half))),
            None => drawn(&mut renderer, &job),
        };
        drop(job);
        let before = Arc::strong_count(&mesh);
        assert_eq!(renderer.layer.layers()[0].plane().is_some(), kind.is_some());
        drawn(&mut renderer, &other);
        assert!(renderer.layer.layers().iter().all(|layers| layers.plane().is_none()));
        (before, Arc::strong_count(&mesh))
    });
    let [(before, left), joint, joint2x2] = held;
    assert!(joint.0 > before && joint2x2.0 > before, "the boundary has its mesh: {held:?}");
    assert_eq!([joint.1, joint2x2.1], [left; 2]);
}

#[test]
fn an_image_given_up_between_pieces_of_large_faces_leaves_nothing_to_the_next_one() {
    let Some(context) = context() else { return };
    let (mut renderer, job) = (Raycast::new(context.clone()), large_faces());
    let whole = drawn(&mut Raycast::new(context), &job);
    // Before there is room for all pieces, and with it.
    for _ in 0..2 {
        let mut frame = Frame::default();
        let mut begun = renderer.layer.begin(job.clone(), &mut frame).unwrap().unwrap();
        let is_within = |begun: &SizedJob<_>| {
            let sizing: &Sizing = begun.sizing.as_ref().unwrap();
            sizing.work.as_ref().is_some_and(Work::is_within_pieces)
        };
        while !is_within(&begun) {
            assert!(!renderer.layer.advance(Duration::ZERO, &mut begun, &mut frame).unwrap(), "there were no pieces");
        }
        drop(begun);
        assert!(drawn(&mut renderer, &job).planes == whole.planes);
    }
}

//! Images of another size that become frames: where their samples lie, what the filters are given, and what refuses them.

use crate::series::{ingested, table_for};
use std::num::NonZeroUsize;
use tetreel::camera::{Camera, Projection};
use tetreel::image::upsample::{self, Enlarging, JointKernel};
use tetreel::image::{Planes, RgbaImage};
use tetreel::pipeline::{
    Backend, DepthEdges, FaceDetail, FrameRequest, ImageScale, Pipeline, PipelineError, SampleSet, TetDraw,
    UpsampleFilter, UpsampleKind, Upsampling,
};
use tetreel::render::RenderJob;
use tetreel::render::cpu::layers::BoundaryDepths;
use tetreel::render::surfaces::Isosurface;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::Cancel;
use tetreel::visibility::Skip;

/// A jet of some cells, some of which are transparent, and a request for it on the CPU.
pub(super) fn jet(size_px: (usize, usize), tf: &str) -> (tempfile::TempDir, Pipeline, FrameRequest) {
    let source = generate(&SynthSpec { cells: 4000, steps: 2, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let store = ingested(&source, &dir.path().join("s.zarr"), "0..1");
    let pipeline = Pipeline::open(&store, None).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let table = table_for(&pipeline, tf);
    let request = FrameRequest { backend: Backend::Cpu, ..FrameRequest::new(1, camera, table, size_px) };
    (dir, pipeline, request)
}

pub(super) const TF: &str = "viridis@0:0,0.2:0,0.3:0.4,1:0.6";

pub(super) fn upsampled(request: &FrameRequest, scale: ImageScale, filter: UpsampleFilter) -> FrameRequest {
    FrameRequest { upsampling: Some(Upsampling { scale, filter }), ..request.clone() }
}

fn planes(pipeline: &mut Pipeline, request: &FrameRequest) -> Planes {
    pipeline.render(request).unwrap().planes.clone()
}

/// The image that is enlarged: rendered for itself, with a camera that looks at as much.
fn small(pipeline: &mut Pipeline, request: &FrameRequest, factor: usize) -> Planes {
    let (width, height) = request.size_px;
    let size_px = (width.div_ceil(factor), height.div_ceil(factor));
    let covers = (factor * size_px.1) as f64 / height as f64;
    let projection = match request.camera.projection {
        Projection::Perspective { view_angle } => {
            let half = (covers * (0.5 * view_angle.to_radians()).tan()).atan();
            Projection::Perspective { view_angle: 2.0 * half.to_degrees() }
        }
        Projection::Parallel { scale } => Projection::Parallel { scale: covers * scale },
    };
    planes(pipeline, &FrameRequest { size_px, camera: Camera { projection, ..request.camera }, ..request.clone() })
}

/// Pixels that differ by more than roundings of places in the image make of a smooth one.
fn apart(a: &RgbaImage, b: &RgbaImage) -> usize {
    assert_eq!((a.width, a.height), (b.width, b.height));
    a.pixels.iter().zip(&b.pixels).filter(|(a, b)| (0..4).any(|c| (a[c] - b[c]).abs() > 1e-5)).count()
}

#[test]
fn samples_lie_where_the_small_image_has_them_whatever_the_size() {
    for (size_px, factor, scale) in [
        ((64, 48), 4, ImageScale::Quarter),
        ((127, 95), 4, ImageScale::Quarter),
        ((1023, 767), 8, ImageScale::Eighth),
        ((63, 64), 2, ImageScale::Half),
        ((5, 3), 8, ImageScale::Eighth),
        ((1, 1), 8, ImageScale::Eighth),
    ] {
        let (_dir, mut pipeline, mut request) = jet(size_px, TF);
        for parallel in [false, true] {
            if parallel {
                request.camera = request.camera.with_other_projection().unwrap();
            }
            let small = small(&mut pipeline, &request, factor);
            let enlarging = Enlarging::by(factor, size_px);
            for filter in [UpsampleFilter::Nearest, UpsampleFilter::Bilinear] {
                let frame = planes(&mut pipeline, &upsampled(&request, scale, filter));
                let expected = match filter {
                    UpsampleFilter::Nearest => upsample::nearest(&small.color, &enlarging),
                    _ => upsample::bilinear(&small.color, &enlarging),
                };
                let apart = apart(&frame.color, &expected);
                // Rays that pass an edge of the mesh by less than a rounding.
                assert!(apart * 200 <= expected.pixels.len(), "{size_px:?} {factor} {filter:?}: {apart} pixels");
                assert_eq!((frame.depth.width, frame.depth.height), size_px);
                let is_seen = |plane: &Planes| plane.depth.pixels.iter().filter(|depth| depth.is_finite()).count();
                assert!(
                    is_seen(&frame).abs_diff(
                        upsample::nearest(&small.depth, &enlarging).pixels.iter().filter(|d| d.is_finite()).count()
                    ) * 200
                        <= expected.pixels.len()
                );
            }
            if size_px == (64, 48) {
                let exact = FrameRequest { size_px: (16, 12), ..request.clone() };
                let exact = planes(&mut pipeline, &exact);
                let frame = planes(&mut pipeline, &upsampled(&request, scale, UpsampleFilter::Nearest));
                assert!(frame.color == upsample::nearest(&exact.color, &enlarging), "the same bits where sizes divide");
                let shifted = Enlarging { per_sample: 3.0, ..enlarging };
                assert!(frame.color != upsample::nearest(&exact.color, &shifted), "the test can fail");
            }
        }
    }
}

#[test]
fn joint_filters_are_given_the_depths_of_the_boundary_at_full_size_and_at_the_samples() {
    let (_dir, mut pipeline, request) = jet((150, 101), TF);
    let (scale, factor) = (ImageScale::Quarter, 4);
    let bilinear = planes(&mut pipeline, &upsampled(&request, scale, UpsampleFilter::Bilinear)).color;
    let nearest = upsampled(&request, scale, UpsampleFilter::Nearest);
    let enlarging = Enlarging::by(factor, request.size_px);
    let full = pipeline.prepare(&request).unwrap();
    let at_samples = pipeline.prepare(&nearest).unwrap();
    let small = {
        use tetreel::render::Renderer;
        tetreel::render::cpu::raycast::Raycast::new().render(at_samples.clone()).unwrap().planes.color.clone()
    };
    for layers in 1..=3 {
        let edges = DepthEdges { sigma_depth: 0.02, layers };
        let depths = |job: &RenderJob| BoundaryDepths::of(job, layers).unwrap();
        let at_pixels = depths(&full);
        let range = at_pixels.range.unwrap();
        let reference = at_pixels.reference(range);
        let filter = UpsampleFilter::Joint { kernel_px: 6, edges };
        let kernel = JointKernel { kernel_px: 6, sigma_reference: 0.02 };
        let expected = upsample::joint(&bilinear, &reference, kernel, &Cancel::new()).unwrap();
        let frame = pipeline.render(&upsampled(&request, scale, filter)).unwrap().clone();
        assert!(frame.planes.color == expected && expected != bilinear, "{layers}");
        assert_eq!((frame.stats.depth_layers, frame.stats.upsample_fallbacks), (layers as u64, 0));
        assert!(frame.stats.ms_depth_layers > 0.0 && frame.stats.ms_upsample > 0.0);
        assert!(frame.stats.ms_frame >= frame.stats.ms_depth_layers + frame.stats.ms_upsample);

        let of_samples = depths(&at_samples).reference(range);
        let (expected, fell_back) = upsample::joint2x2(&small, &enlarging, [&reference, &of_samples], 0.02);
        let frame = pipeline.render(&upsampled(&request, scale, UpsampleFilter::Joint2x2 { edges })).unwrap().clone();
        assert!(frame.planes.color == expected, "{layers}");
        assert_eq!((frame.stats.depth_layers, frame.stats.upsample_fallbacks), (2 * layers as u64, fell_back));
        assert!(fell_back > 0, "a scene in which no sample is alike");
    }
}

#[test]
fn an_enlarged_frame_is_the_same_whatever_is_skipped_and_by_any_number_of_threads() {
    let (_dir, mut pipeline, request) = jet((75, 50), TF);
    for kind in UpsampleKind::ALL {
        let request = upsampled(&request, ImageScale::Half, kind.usual(ImageScale::Half));
        let frame = planes(&mut pipeline, &request);
        for (name, switch) in Skip::SWITCHES {
            let mut skip = Skip::ALL;
            *switch(&mut skip) = false;
            assert!(planes(&mut pipeline, &FrameRequest { skip, ..request.clone() }) == frame, "{kind} without {name}");
        }
        assert!(planes(&mut pipeline, &FrameRequest { skip: Skip::NONE, ..request.clone() }) == frame, "{kind}");
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| planes(&mut pipeline, &request)) == frame, "{kind} by {threads} threads");
        }
    }
}

#[test]
fn normals_and_numbers_of_surfaces_are_those_of_the_nearest_sample() {
    let (_dir, mut pipeline, request) = jet((90, 61), TF);
    let range = pipeline.field().range.unwrap().map(f64::from);
    let surface = Isosurface::new(0.5 * (range[0] + range[1]));
    let request = FrameRequest { guides: true, ..request.with_tets(|tets| tets.surfaces = vec![surface]) };
    let small = small(&mut pipeline, &request, 2);
    let frame = planes(&mut pipeline, &upsampled(&request, ImageScale::Half, UpsampleFilter::Bilinear));
    let enlarging = Enlarging::by(2, request.size_px);
    let (ids, normals) = (upsample::nearest(&small.id, &enlarging), upsample::nearest(&small.normal, &enlarging));
    assert!(ids.pixels.contains(&1) && ids.pixels.contains(&0));
    let other = ids.pixels.iter().zip(&frame.id.pixels).filter(|(a, b)| a != b).count();
    assert!(other * 200 <= ids.pixels.len(), "{other}");
    assert_eq!((frame.normal.width, frame.normal.height), request.size_px);
    let turned =
        normals.pixels.iter().zip(&frame.normal.pixels).filter(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3));
    let turned = turned.count();
    assert!(turned * 200 <= ids.pixels.len(), "{turned}");
}

#[test]
fn at_full_size_the_joint_filter_takes_noise_from_a_part_of_the_faces() {
    let (_dir, mut pipeline, request) = jet((160, 120), "viridis@0:0.02,1:0.5");
    let exact = planes(&mut pipeline, &request).color;
    let some = request.with_draw(TetDraw::Faces(FaceDetail { lod: 0.1, ..FaceDetail::ALL }));
    let noisy = planes(&mut pipeline, &some).color;
    let filter = UpsampleKind::Joint.usual(ImageScale::Full);
    let filtered = planes(&mut pipeline, &upsampled(&some, ImageScale::Full, filter)).color;
    let rmse = |image: &RgbaImage| tetreel::image::compare_raw(image, &exact).unwrap().rmse;
    let (before, after) = (rmse(&noisy), rmse(&filtered));
    println!("RMSE {before:.2e} of a tenth of the faces, {after:.2e} filtered");
    assert!(after < before);
}

#[test]
fn what_cannot_be_enlarged_is_refused_and_what_shows_nothing_is_empty() {
    let (_dir, mut pipeline, request) = jet((20, 15), TF);
    let bilinear = upsampled(&request, ImageScale::Half, UpsampleFilter::Bilinear);
    let lattice = SampleSet::Lattice { stride_px: NonZeroUsize::MIN };
    let edges = |sigma_depth, layers| UpsampleFilter::Joint2x2 { edges: DepthEdges { sigma_depth, layers } };
    for (request, word) in [
        (bilinear.clone().with_draw(TetDraw::Reference), "reference"),
        (FrameRequest { samples: "adaptive".parse().unwrap(), ..bilinear.clone() }, "cast all rays"),
        (FrameRequest { samples: lattice, ..bilinear.clone() }, "cast all rays"),
        (upsampled(&request, ImageScale::Half, edges(0.0, 1)), "above 0"),
        (upsampled(&request, ImageScale::Half, edges(f64::NAN, 1)), "above 0"),
        (upsampled(&request, ImageScale::Half, edges(0.1, 4)), "1 to 3"),
    ] {
        let refused = pipeline.render(&request).unwrap_err();
        assert!(matches!(refused, PipelineError::Request(_)) && refused.to_string().contains(word), "{refused}");
    }
    let mut beside = request.clone();
    beside.camera.focal_point = beside.camera.position + (beside.camera.position - beside.camera.focal_point);
    for kind in UpsampleKind::ALL {
        let frame = planes(&mut pipeline, &upsampled(&beside, ImageScale::Eighth, kind.usual(ImageScale::Eighth)));
        assert!(frame.color.pixels.iter().all(|pixel| *pixel == [0.0; 4]), "{kind}: nothing is in view");
        let nothing = FrameRequest { layers: Vec::new(), ..request.clone() };
        let frame = planes(&mut pipeline, &upsampled(&nothing, ImageScale::Half, kind.usual(ImageScale::Half)));
        assert!(frame.color == RgbaImage::new(20, 15), "{kind}: nothing is asked for");
    }
}

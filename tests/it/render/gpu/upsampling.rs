//! Images that come to full size on the GPU, from a request to a frame, against those of the CPU.

use super::super::upsampling::{TF, jet, upsampled};
use super::*;
use tetreel::pipeline::{
    Backend, DepthEdges, FaceDetail, FrameRequest, ImageScale, Pipeline, TetDraw, UpsampleFilter, UpsampleKind,
};

/// What colours may be off by beyond what small images may: depths in f32 are right to 1e-6 of the range in view, so that differences of
/// three layers are off by 3.5e-6. Of weights with a mean t (2^-t) of at most 22 (joint2x2, whose weights sum up to 1e-6) that is 5.5 /
/// sigma times as much at sigma 0.01, and less of the many pixels of the joint filter.
const BY_WEIGHTS: f64 = 2e-3;

fn on(backend: Backend, pipeline: &mut Pipeline, request: &FrameRequest) -> Frame {
    pipeline.render(&FrameRequest { backend, ..request.clone() }).unwrap().clone()
}

/// Pixels that differ by more than bounds allow.
fn beyond(a: &RgbaImage, b: &RgbaImage) -> usize {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let is_off = |(a, b): (&f32, &f32)| f64::from((a - b).abs()) > BOUND_MAX + BY_WEIGHTS;
    a.pixels.iter().zip(&b.pixels).filter(|(a, b)| a.iter().zip(*b).any(is_off)).count()
}

#[test]
fn frames_of_any_size_and_filter_come_to_full_size_on_the_gpu_as_on_the_cpu() {
    if context().is_none() {
        return;
    }
    let mut fallen_back = 0;
    for (size_px, scale) in [
        ((127, 95), ImageScale::Quarter),
        ((1023, 767), ImageScale::Eighth),
        ((160, 120), ImageScale::Half),
        ((90, 61), ImageScale::Full),
        ((5, 3), ImageScale::Eighth),
        ((1, 1), ImageScale::Eighth),
    ] {
        let (_dir, mut pipeline, mut request) = jet(size_px, TF);
        for parallel in [false, true] {
            if parallel {
                request.camera = request.camera.with_other_projection().unwrap();
            }
            for kind in UpsampleKind::ALL {
                let name = format!("{size_px:?}, {scale}, {kind}, parallel {parallel}");
                let request = upsampled(&request, scale, kind.usual(scale));
                let (gpu, cpu) = (on(Backend::Gpu, &mut pipeline, &request), on(Backend::Cpu, &mut pipeline, &request));
                assert!(gpu.stats.on_gpu && !cpu.stats.on_gpu);
                let pixels = size_px.0 * size_px.1;
                let off = beyond(&gpu.planes.color, &cpu.planes.color);
                // Whether a pixel falls back is decided by rounding where its weights sum up to the bound.
                let decided = gpu.stats.upsample_fallbacks.abs_diff(cpu.stats.upsample_fallbacks);
                assert!(off <= decided as usize && decided as usize * 1000 <= pixels, "{name}: {off}, {decided}");
                let infinite = |frame: &Frame| frame.planes.depth.pixels.iter().filter(|d| d.is_infinite()).count();
                assert_eq!((gpu.planes.depth.width, gpu.planes.depth.height), size_px, "{name}");
                assert!(infinite(&gpu).abs_diff(infinite(&cpu)) * 200 <= pixels, "{name}");
                let (found, expected) = (&gpu.stats, &cpu.stats);
                assert_eq!(found.depth_layers, expected.depth_layers, "{name}");
                assert_eq!(found.ms_depth_layers > 0.0, found.depth_layers > 0, "{name}");
                assert!(found.ms_upsample > 0.0 && found.ms_render > 0.0, "{name}");
                assert!(found.ms_frame >= found.ms_depth_layers + found.ms_upsample, "{name}");
                fallen_back += found.upsample_fallbacks;
                // The comparison can fail.
                if pixels > 10_000 {
                    let mut moved = request.clone();
                    moved.camera.position +=
                        0.01 * (moved.camera.focal_point - moved.camera.position).cross(moved.camera.view_up);
                    let moved = on(Backend::Gpu, &mut pipeline, &moved);
                    assert!(beyond(&moved.planes.color, &cpu.planes.color) > pixels / 100, "{name}: not noticed");
                }
            }
        }
    }
    assert!(fallen_back > 0, "no pixel fell back");
}

#[test]
fn layers_and_sigma_count_and_faces_are_enlarged_as_cells_are() {
    if context().is_none() {
        return;
    }
    let (_dir, mut pipeline, request) = jet((150, 101), TF);
    let faces = request.clone().with_draw(TetDraw::Faces(FaceDetail { lod: 0.3, ..FaceDetail::ALL }));
    let mut frames = Vec::new();
    for (request, scale) in [(&request, ImageScale::Quarter), (&faces, ImageScale::Full), (&faces, ImageScale::Quarter)]
    {
        for (sigma_depth, layers) in [(0.01, 1), (0.01, 3), (0.1, 3)] {
            let edges = DepthEdges { sigma_depth, layers };
            let request = upsampled(request, scale, UpsampleFilter::Joint { kernel_px: 6, edges });
            let (gpu, cpu) = (on(Backend::Gpu, &mut pipeline, &request), on(Backend::Cpu, &mut pipeline, &request));
            assert_eq!((gpu.stats.on_gpu, gpu.stats.depth_layers), (true, layers as u64));
            assert_eq!(beyond(&gpu.planes.color, &cpu.planes.color), 0, "{scale}, {sigma_depth}, {layers}");
            frames.push(gpu.planes.color);
        }
    }
    for (i, a) in frames.iter().enumerate() {
        assert!(frames[..i].iter().all(|b| beyond(a, b) > 0), "the comparison tells frame {i} from those before");
    }
}

/// The frame of a request on the GPU, and whether it came to its size there: it is that of the CPU wherever it did.
fn sized_on_gpu(pipeline: &mut Pipeline, request: &FrameRequest, name: &str) -> bool {
    let (gpu, cpu) = (on(Backend::Gpu, pipeline, request), on(Backend::Cpu, pipeline, request));
    assert!(gpu.stats.on_gpu && !cpu.stats.on_gpu && !cpu.stats.upsampled_on_gpu, "{name}");
    assert_eq!((gpu.planes.color.width, gpu.planes.color.height), request.size_px, "{name}");
    assert!(cpu.planes.color.pixels.iter().filter(|p| p[3] > 0.1).count() * 20 > cpu.planes.color.pixels.len());
    let decided = gpu.stats.upsample_fallbacks.abs_diff(cpu.stats.upsample_fallbacks) as usize;
    let off = beyond(&gpu.planes.color, &cpu.planes.color);
    assert!(off <= decided && decided * 1000 <= cpu.planes.color.pixels.len(), "{name}: {off}, {decided}");
    gpu.stats.upsampled_on_gpu
}

#[test]
fn what_is_beyond_the_gpu_at_full_size_is_drawn_on_it_and_enlarged_on_the_cpu() {
    if context().is_none() {
        return;
    }
    // WebGPU's textures are 8192 pixels wide at most: a thin slice through all of the mesh.
    for (width, fits) in [(8192, true), (8200, false)] {
        let (_dir, mut pipeline, mut request) = jet((width, 16), TF);
        pipeline.choose_gpu(ContextOptions { tier: Tier::WebGpu, ..ContextOptions::default() });
        let (lo, hi) = pipeline.mesh().positions.world_bounds();
        let scale = 0.5 * (hi - lo).length() * 16.0 / width as f64;
        request.camera.projection = Projection::Parallel { scale };
        for kind in UpsampleKind::ALL {
            let request = upsampled(&request, ImageScale::Eighth, kind.usual(ImageScale::Eighth));
            assert_eq!(sized_on_gpu(&mut pipeline, &request, &format!("{width}, {kind}")), fits, "{width}, {kind}");
        }
    }
    // Layers of 300 x 200 pixels are 247 tiles of 2 + 256 words a layer and more: a quarter of a megabyte each.
    let (_dir, mut pipeline, request) = jet((300, 200), TF);
    pipeline.choose_gpu(ContextOptions { binding_bytes: Some(400_000), ..ContextOptions::default() });
    for (layers, fits) in [(1, true), (3, false), (1, true)] {
        let edges = DepthEdges { layers, ..DepthEdges::USUAL };
        for filter in [UpsampleFilter::Joint { kernel_px: 4, edges }, UpsampleFilter::Joint2x2 { edges }] {
            let request = upsampled(&request, ImageScale::Quarter, filter);
            assert_eq!(sized_on_gpu(&mut pipeline, &request, &format!("{filter:?}")), fits, "{filter:?}");
        }
    }
}

#[test]
fn no_layers_are_drawn_for_an_image_of_no_cells() {
    if context().is_none() {
        return;
    }
    for (tf, layers) in [(TF, 6), ("viridis@0:0,1:0", 0)] {
        let (_dir, mut pipeline, request) = jet((60, 41), tf);
        let request = upsampled(&request, ImageScale::Half, UpsampleKind::Joint2x2.usual(ImageScale::Half));
        for backend in [Backend::Gpu, Backend::Cpu] {
            let frame = on(backend, &mut pipeline, &request);
            let is_transparent = frame.planes.color.pixels.iter().all(|pixel| *pixel == [0.0; 4]);
            assert_eq!(
                (frame.planes.color.width, frame.stats.depth_layers, is_transparent),
                (60, layers, layers == 0),
                "{backend}"
            );
        }
    }
}

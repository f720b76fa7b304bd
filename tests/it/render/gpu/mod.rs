//! The ray caster on the GPU against the one on the CPU. The scenes of the other tests of renderers are compared too
//! (`assert_agrees`).

mod adaptive;
mod behaviour;
mod decode;
mod eyes;
mod images;
mod upsampling;

use super::*;
use crate::meshes::{build, grid, noise, sample};
use std::sync::{Mutex, OnceLock, PoisonError};
use tetreel::render::Frame;
use tetreel::render::gpu::context::{Context, ContextOptions, Tier};
use tetreel::render::gpu::points::Points as GpuPoints;
use tetreel::render::gpu::raycast::Raycast as GpuRaycast;

/// The GPU of this machine, if there is one; says if not.
pub fn context() -> Option<Arc<Context>> {
    static CONTEXT: OnceLock<Result<Arc<Context>, String>> = OnceLock::new();
    let context = CONTEXT.get_or_init(|| match Context::new(&ContextOptions::default()) {
        Ok(context) => Ok(Arc::new(context)),
        Err(e) => Err(e.to_string()),
    });
    match context {
        Ok(context) => Some(context.clone()),
        Err(why) => {
            crate::common::skip("gpu", why);
            None
        }
    }
}

/// The frame of a job, by one renderer that all tests share: whatever it did before must not matter.
pub fn render(job: &RenderJob) -> Option<Frame> {
    static RENDERER: OnceLock<Mutex<GpuRaycast>> = OnceLock::new();
    let context = context()?;
    let renderer = RENDERER.get_or_init(|| Mutex::new(GpuRaycast::new(context)));
    let mut renderer = renderer.lock().unwrap_or_else(PoisonError::into_inner);
    Some(renderer.render(job.clone()).unwrap().clone())
}

/// The frame of a job by its cells as exact points, by one renderer that all tests share.
pub fn points(job: &RenderJob) -> Option<Frame> {
    static RENDERER: OnceLock<Mutex<GpuPoints>> = OnceLock::new();
    let context = context()?;
    let renderer = RENDERER.get_or_init(|| Mutex::new(GpuPoints::new(context)));
    let mut renderer = renderer.lock().unwrap_or_else(PoisonError::into_inner);
    Some(renderer.render(with_points(job, PointStyle::EXACT)).unwrap().clone())
}

/// A GPU of its own with these options, for tests that count what it makes or that break it.
pub fn own_context(options: &ContextOptions) -> Option<Arc<Context>> {
    context()?;
    Some(Arc::new(Context::new(options).unwrap()))
}

const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };

/// Cells 1e5 times as wide as high, on a device with f64 and within WebGPU's limits, against `judge`.
pub fn assert_slivers_agree(job: &RenderJob, judge: &RgbaImage) {
    let Some(context) = context() else { return };
    let web = own_context(&ContextOptions { tier: Tier::WebGpu, ..Default::default() }).unwrap();
    for context in [context, web] {
        let has_f64 = context.has_f64();
        let frame = GpuRaycast::new(context).render(job.clone()).unwrap().clone();
        assert_eq!((frame.stats.in_f64, frame.stats.broken_paths), (has_f64, 0));
        let (rmse, max) = difference(&frame.planes.color, judge);
        eprintln!("slivers 1e-5, f64 {has_f64}: rmse {rmse:.2e}, max {max:.2e}");
        if has_f64 {
            assert!(rmse <= 1e-5 && max <= 2e-3, "in f64: rmse {rmse:.2e}, max {max:.2e}");
        } else {
            // The weights of a hit are right to a few 2^-24, and so is its depth, relative to the depths of a cell's corners,
            // which differ by up to 0.2: 5e-8. The extinction is up to 2e5: an optical depth of 1e-2, and half of that is the
            // most that the opacity can be off; few hits have that error. It is what the comparison notices.
            assert!(rmse <= 5e-4 && max <= 5e-3, "in f32: rmse {rmse:.2e}, max {max:.2e}");
            assert!(rmse > 1e-5, "f32 is enough: {rmse:.2e}");
        }
    }
}

//! The ray caster on the GPU against the one on the CPU. The scenes of the other tests of renderers are compared too
//! (`assert_agrees`).

mod behaviour;
mod decode;
mod eyes;
mod images;

use super::*;
use crate::meshes::{build, grid, noise, sample};
use std::sync::{Mutex, OnceLock, PoisonError};
use tetreel::render::Frame;
use tetreel::render::gpu::context::{Context, ContextOptions};
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

/// A GPU of its own with these options, for tests that count what it makes or that break it.
pub fn own_context(options: &ContextOptions) -> Option<Arc<Context>> {
    context()?;
    Some(Arc::new(Context::new(options).unwrap()))
}

const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 30.0 };

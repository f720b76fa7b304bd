//! The GPU of a window that frames are shown in.

use crate::render::gpu::context::Context;
use std::sync::{Arc, Mutex, PoisonError};

/// The GPU of a window, for a pipeline to render on: frames that are asked for with
/// [`for_window`](super::FrameRequest::for_window) then stay there. Shared by the two; a window that is opened again brings
/// another one.
#[derive(Clone, Debug, Default)]
pub struct WindowGpu(Arc<Mutex<Option<Arc<Context>>>>);

impl WindowGpu {
    /// No window yet.
    pub fn none() -> Self {
        Self::default()
    }

    /// The window has this GPU from now on.
    pub fn set(&self, context: Arc<Context>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(context);
    }

    /// The window's GPU, if there is one that works.
    pub fn get(&self) -> Option<Arc<Context>> {
        let context = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        context.filter(|context| context.check().is_ok())
    }
}

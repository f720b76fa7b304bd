//! The GPU of a window that frames are shown in.

use crate::render::gpu::context::Context;
use std::sync::{Arc, Mutex, PoisonError};

/// The GPU of a window, for a pipeline to render on: frames requested with [`for_window`](super::FrameRequest::for_window) then stay there.
/// Shared by the two; a reopened window sets another GPU.
#[derive(Clone, Debug, Default)]
pub struct WindowGpu(Arc<Mutex<Option<Arc<Context>>>>);

impl WindowGpu {
    /// Without a window.
    pub fn none() -> Self {
        Self::default()
    }

    /// Sets the window's GPU.
    pub fn set(&self, context: Arc<Context>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(context);
    }

    /// The window's GPU; `None` without one that works.
    pub fn get(&self) -> Option<Arc<Context>> {
        let context = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        context.filter(|context| context.check().is_ok())
    }
}

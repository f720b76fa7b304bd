//! Wakes the current window.

use eframe::egui;
use std::sync::{Arc, Mutex, PoisonError};

/// Requests a repaint of the window. A reopened window replaces the one before.
#[derive(Clone, Default)]
pub(super) struct Waker(Arc<Mutex<Option<egui::Context>>>);

impl Waker {
    /// Wakes this window from now on.
    pub(super) fn attach(&self, ctx: &egui::Context) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(ctx.clone());
    }

    /// The callback for threads with new results.
    pub(super) fn wake(&self) -> impl Fn() + Send + Sync + Clone + use<> {
        let waker = self.clone();
        move || {
            // A copy, so that the lock is not held while the window is busy.
            let ctx = waker.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
            if let Some(ctx) = ctx {
                ctx.request_repaint();
            }
        }
    }
}

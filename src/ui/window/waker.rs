//! Wakes the current window.

use crate::ui::worker::lock;
use eframe::egui;
use std::sync::{Arc, Mutex};

/// Requests a repaint of the window. A reopened window replaces the one before.
#[derive(Clone, Default)]
pub(super) struct Waker(Arc<Mutex<Option<egui::Context>>>);

impl Waker {
    /// Wakes this window from now on.
    pub(super) fn attach(&self, ctx: &egui::Context) {
        *lock(&self.0) = Some(ctx.clone());
    }

    /// The callback for threads with new results.
    pub(super) fn wake(&self) -> impl Fn() + Send + Sync + Clone + use<> {
        let waker = self.clone();
        move || {
            // A copy, so that the lock is not held while the window is busy.
            let ctx = lock(&waker.0).clone();
            if let Some(ctx) = ctx {
                ctx.request_repaint();
            }
        }
    }
}

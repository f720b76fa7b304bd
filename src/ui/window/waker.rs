//! Wakes the window up, whichever it is at the moment.

use eframe::egui;
use std::sync::{Arc, Mutex, PoisonError};

/// Has the window painted again. A window that is opened again takes the place of the one before.
#[derive(Clone, Default)]
pub(super) struct Waker(Arc<Mutex<Option<egui::Context>>>);

impl Waker {
    /// Wakes this window from now on.
    pub(super) fn attach(&self, ctx: &egui::Context) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(ctx.clone());
    }

    /// For threads that have something to show.
    pub(super) fn wake(&self) -> impl Fn() + Send + Sync + Clone + use<> {
        let waker = self.clone();
        move || {
            // A copy: whoever holds the lock must not wait for the window.
            let ctx = waker.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
            if let Some(ctx) = ctx {
                ctx.request_repaint();
            }
        }
    }
}

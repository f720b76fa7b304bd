//! Runs a window of the system until it is closed.

use super::retained;
use super::{PlayerWindow, WindowOptions};
use crate::render::gpu::context::{self, ContextOptions};
use crate::task::Cancel;
use crossbeam::channel::RecvTimeoutError;
use eframe::egui_wgpu::{RenderState, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use eframe::{egui, egui_wgpu};
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

/// Why a window cannot be opened or kept.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    /// The system opens no window.
    #[error("cannot open a window: {0}; `tetreel render` makes pictures without one")]
    NoWindow(String),
    /// The window's GPU is lost again and again.
    #[error(
        "the window's GPU fails again and again: {0}; restart the machine or its driver, or use another with --adapter"
    )]
    Lost(String),
}

/// Interval between checks for a cancel.
const CANCEL_CHECK: Duration = Duration::from_millis(100);

/// Largest number of GPU losses before giving up.
const LOSSES_MAX: u32 = 5;

/// State shared by the window and its opener.
struct Shared {
    window: PlayerWindow,
    /// Why the window must be opened again.
    lost: Option<String>,
    watch: Box<dyn FnMut(&PlayerWindow)>,
    cancel: Cancel,
}

/// The window as egui's application.
struct App<'a> {
    shared: &'a RefCell<Shared>,
    painter: &'a retained::Owner,
}

impl eframe::App for App<'_> {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        let Shared { window, lost, watch, cancel } = &mut *self.shared.borrow_mut();
        if let Some(error) = window.lost() {
            // Nothing can be painted any more.
            *lost = Some(error.to_string());
            self.painter.close();
            ui.send_viewport_cmd(egui::ViewportCommand::Close);
            return;
        }
        if cancel.is_cancelled() {
            window.close_at_once();
        }
        window.show(ui);
        watch(window);
    }
}

/// Opens a window and returns when it is closed or `cancel` is raised. If its GPU is lost it is opened
/// again, and goes on where it was.
///
/// # Errors
/// If the system opens no window.
pub fn run(options: WindowOptions, cancel: &Cancel) -> Result<(), WindowError> {
    run_watched(options, cancel, Box::new(|_| ()))
}

/// As [`run`]; `watch` is called with the window after each pass, for programs that depend on what is shown.
///
/// # Errors
/// As [`run`].
pub fn run_watched(
    options: WindowOptions,
    cancel: &Cancel,
    watch: Box<dyn FnMut(&PlayerWindow)>,
) -> Result<(), WindowError> {
    let gpu = options.gpu.clone();
    let window = PlayerWindow::open(options).map_err(|error| WindowError::NoWindow(error.to_string()))?;
    let shared = RefCell::new(Shared { window, lost: None, watch, cancel: cancel.clone() });
    let mut last_loss = String::new();
    for _ in 0..=LOSSES_MAX {
        let shown = catch_unwind(AssertUnwindSafe(|| show_until_closed(&gpu, &shared, cancel)));
        let mut state = shared.borrow_mut();
        let lost = state.lost.take().or_else(|| state.window.lost().map(|error| error.to_string()));
        match (shown, lost) {
            // Painting on a lost device may fail in any way.
            (_, Some(reason)) if !cancel.is_cancelled() => {
                last_loss.clone_from(&reason);
                state.window.fail(format!("{reason}; the window was opened again"));
            }
            (Ok(result), _) => return result,
            (Err(panic), _) => std::panic::resume_unwind(panic),
        }
    }
    Err(WindowError::Lost(last_loss))
}

fn show_until_closed(gpu: &ContextOptions, shared: &RefCell<Shared>, cancel: &Cancel) -> Result<(), WindowError> {
    let size = shared.borrow().window.size();
    let viewport = egui::ViewportBuilder::default().with_title("tetreel").with_inner_size(size).with_app_id("tetreel");
    let native = eframe::NativeOptions {
        viewport: viewport.with_min_inner_size([640.0, 400.0]),
        renderer: eframe::Renderer::Wgpu,
        // Colours stay as computed.
        dithering: false,
        wgpu_options: WgpuConfiguration { wgpu_setup: setup(gpu), ..Default::default() },
        ..Default::default()
    };
    let painter = &retained::Owner::default();
    let (closes, closed) = crossbeam::channel::bounded::<()>(0);
    let shown = std::thread::scope(move |scope| {
        // Dropped when the window is closed, or has panicked.
        let _closes = closes;
        let open = |cc: &eframe::CreationContext<'_>| -> Result<Box<dyn eframe::App>, _> {
            let ctx = cc.egui_ctx.clone();
            std::thread::Builder::new().name("cancel".to_owned()).spawn_scoped(scope, move || {
                while closed.recv_timeout(CANCEL_CHECK) == Err(RecvTimeoutError::Timeout) && !cancel.is_cancelled() {}
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            })?;
            if let Some(RenderState { device, queue, target_format, .. }) = &cc.wgpu_render_state {
                painter.paint(&cc.egui_ctx, device, queue, *target_format);
            }
            shared.borrow_mut().window.attach(&cc.egui_ctx, cc.wgpu_render_state.as_ref());
            Ok(Box::new(App { shared, painter }) as Box<dyn eframe::App>)
        };
        eframe::run_native("tetreel", native, Box::new(open))
    });
    shown.map_err(|error| WindowError::NoWindow(cause(&error.to_string()).to_owned()))
}

/// The setup of a device for the window that renderers can use, too.
fn setup(gpu: &ContextOptions) -> WgpuSetup {
    let (of_adapter, of_device) = (gpu.clone(), gpu.clone());
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.backends = context::BACKENDS;
    setup.native_adapter_selector = Some(Arc::new(move |adapters, surface| {
        let shows = |adapter: &&egui_wgpu::wgpu::Adapter| surface.is_none_or(|s| adapter.is_surface_supported(s));
        let adapters: Vec<_> = adapters.iter().filter(shows).cloned().collect();
        context::best(&adapters, &of_adapter).cloned().map_err(|error| error.to_string())
    }));
    setup.device_descriptor = Arc::new(move |adapter| context::descriptor(adapter, &of_device));
    setup.into()
}

/// The system's message, without source positions of a library: `...: os error at src/x.rs:12: no display`.
fn cause(text: &str) -> &str {
    let after = text.rsplit_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    after.map_or(text, |(_, cause)| cause)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_in_the_source_are_left_out() {
        assert_eq!(cause("winit: os error at /a/b.rs:765: no display"), "no display");
        assert_eq!(cause("no adapter"), "no adapter");
    }
}

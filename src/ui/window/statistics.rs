//! Cost of the last frame, and the frame rate.

use super::widgets::still_plot;
use crate::playback::Mode;
use crate::ui::{HISTORY_FRAMES, MotionError, Session};
use eframe::egui;
use egui::{Role, WidgetInfo};
use egui_plot::Line;

/// A table of the last costs, and a plot of recent ones.
pub(super) fn show(ui: &mut egui::Ui, session: &Session) {
    plot(ui, session);
    ui.spacing_mut().item_spacing.y = 2.0;
    for (name, value) in lines(session) {
        ui.horizontal_top(|ui| {
            let left = egui::Layout::left_to_right(egui::Align::Min);
            ui.allocate_ui_with_layout(egui::vec2(NAMES, 0.0), left, |ui| {
                ui.set_min_width(NAMES);
                ui.label(name);
            });
            // Long numbers wrap: the panel keeps its width.
            ui.add(egui::Label::new(egui::RichText::new(value).monospace()).wrap());
        });
    }
}

/// Width of the names in points.
const NAMES: f32 = 108.0;

/// Height of the plot in points.
const PLOT: f32 = 90.0;

/// The stages of a frame, and the colours of their curves.
const STAGES: [(&str, egui::Color32); 3] = [
    ("decode", egui::Color32::from_rgb(235, 95, 85)),
    ("order", egui::Color32::from_rgb(80, 185, 95)),
    ("render", egui::Color32::from_rgb(90, 150, 255)),
];

/// Milliseconds of the stages of the last frames, oldest on the left.
fn plot(ui: &mut egui::Ui, session: &Session) {
    let plot = still_plot("costs of frames")
        .height(PLOT)
        .include_y(0.0)
        .include_x(HISTORY_FRAMES as f64)
        .include_x(0.0)
        .show_axes([false, true])
        .y_axis_formatter(|mark, _| format!("{} ms", super::overlay::number(mark.value)));
    // The legend is beside the curves, not over them.
    ui.horizontal(|ui| {
        for (stage, color) in STAGES {
            ui.colored_label(color, stage);
        }
    });
    let frames = session.history().frames();
    let first = HISTORY_FRAMES - frames.len();
    let costs: Vec<(f64, [f64; 3])> = frames.zip(first..).map(|(cost, i)| (i as f64, cost.ms)).collect();
    let shown = plot.show(ui, |plot| {
        for (stage, (name, color)) in STAGES.into_iter().enumerate() {
            let points: Vec<[f64; 2]> = costs.iter().map(|(i, ms)| [*i, ms[stage]]).collect();
            plot.line(Line::new(name, points).color(color));
        }
    });
    shown.response.widget_info(|| {
        WidgetInfo::labeled(Role::Image, true, "Milliseconds of decode, order and render of the last frames")
    });
}

fn lines(session: &Session) -> Vec<(&'static str, String)> {
    let state = session.state();
    let mut lines = Vec::new();
    if let Some(shown) = session.shown() {
        let stats = &shown.frame.stats;
        let (width, height) = shown.request.size_px;
        let ms = |ms: f64| format!("{ms:.1} ms");
        lines.push(("decode", ms(stats.ms_decode)));
        lines.push(("order", ms(stats.ms_order + stats.ms_place)));
        lines.push(("render", ms(stats.ms_begin + stats.ms_render)));
        lines.push(("image", format!("{width} x {height}")));
        if stats.faces_total > 0 {
            let share = 100.0 * stats.faces_drawn as f64 / stats.faces_total as f64;
            lines.push(("faces", format!("{} of {} ({share:.1} %)", stats.faces_drawn, stats.faces_total)));
            lines.push(("level of detail", format!("{:.1} %", 100.0 * shown.request.lod())));
        }
        let place = if stats.on_gpu { "GPU" } else { "CPU" };
        lines.push(("rendered on", if shown.is_kept { format!("{place}, kept") } else { place.to_owned() }));
        lines.push(("active cells", format!("{} of {}", stats.cells_active, stats.cells_total)));
        let cast: u64 = stats.rays_by_level.iter().sum();
        let pixels = (width * height) as u64;
        if (1..pixels).contains(&cast) {
            lines.push(("rays", format!("{:.1} %", 100.0 * cast as f64 / pixels as f64)));
        }
    }
    if let Some(MotionError { ms, rays, error, .. }) = session.motion_error() {
        let rays = rays.map_or(String::new(), |share| format!(", {:.0} % of the rays", 100.0 * share));
        let error = error.map_or(String::new(), |error| format!(", RMSE {:.0e}, max {:.2}", error.rmse, error.max));
        lines.push(("while moving", format!("{ms:.0} ms{error}{rays}")));
    }
    let rate = |rate: Option<f64>| rate.map_or("-".to_owned(), |rate| format!("{rate:.1}"));
    let asked = if state.settings.mode == Mode::EveryStep { rate(state.speed) } else { "-".to_owned() };
    lines.push(("frames/s asked", asked));
    lines.push(("frames/s shown", rate(state.frames_per_second)));
    lines.push(("dropped", state.dropped.to_string()));
    lines.push(("kept frames shown", session.kept_frames().to_string()));
    let blocks = session.series().blocks();
    let memory = blocks.statistics();
    let mb = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let budget = mb(blocks.budget());
    lines.push(("blocks", format!("{:.1} of {budget:.0} MiB", mb(memory.resident_bytes))));
    lines.push(("blocks read", memory.loads.to_string()));
    lines
}

//! The dialog of exports, and the progress of an export.

use super::popups;
use super::preview::Upload;
use super::welcome::in_words;
use super::widgets::{choice, color_button, icon, labelled, number};
use crate::export::run::SIZE_MAX_PX;
use crate::export::still::StillFormat;
use crate::image::{ExrColor, ExrCompression};
use crate::ui::exporting::{Choices, ExportAction, ExportProgress, Frames};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{
    Align2, Button, Direction, DragValue, Grid, Key, Layout, Modifiers, Popup, ProgressBar, Role, ScrollArea, TextEdit,
    Ui, WidgetInfo,
};

/// Width of the dialog, points, where the window has room.
const WIDTH: f32 = 540.0;
/// Margin around it.
const MARGIN: f32 = 8.0;
/// Height of its title, of the buttons and of the spaces between its parts.
const FRAME: f32 = 96.0;
/// Height of a line with progress, and of the messages.
const LINE: f32 = 24.0;
const MESSAGES: f32 = 72.0;
/// Largest width and height of the preview, points.
const PREVIEW: egui::Vec2 = egui::vec2(208.0, 132.0);
/// Width of lists beside the preview.
const CHOICE: f32 = 150.0;
/// Width of boxes for a path and for short texts.
const LONG: f32 = 340.0;
const SHORT: f32 = 76.0;

/// Description of the preview.
const ALT_TEXT: &str = "Preview of the export";

/// Sizes beside the window's.
const SIZES: [((usize, usize), &str); 3] =
    [((1280, 720), "1280 x 720"), ((1920, 1080), "1920 x 1080"), ((3840, 2160), "3840 x 2160")];

/// The dialog.
#[derive(Default)]
pub(super) struct ExportDialog {
    preview: Upload,
    was_open: bool,
}

impl ExportDialog {
    /// Shows the dialog, if it is open.
    pub(super) fn show(&mut self, ctx: &egui::Context, session: &mut Session, actions: &mut Vec<Action>) {
        let exports = session.exports();
        let is_new = !std::mem::replace(&mut self.was_open, exports.is_open());
        let Some(before) = exports.choices().filter(|_| exports.is_open()).cloned() else { return };
        let mut choices = before.clone();
        let escapes =
            !Popup::is_any_open(ctx) && ctx.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape));
        if escapes {
            // The key closes the dialog alone.
            actions.retain(|action| *action != Action::Close);
        }
        let room = ctx.content_rect().shrink(MARGIN);
        let lines = if exports.progress().is_some() { LINE } else { 0.0 };
        let messages = if session.notices().is_empty() { 0.0 } else { MESSAGES };
        let mut is_open = !escapes;
        let window =
            egui::Window::new("Export images or a movie").open(&mut is_open).collapsible(false).resizable(false);
        let window = window.default_pos(room.center()).pivot(Align2::CENTER_CENTER).constrain_to(room);
        window.show(ctx, |ui| {
            let margins = ctx.global_style().spacing.window_margin.sum().x;
            ui.set_width(WIDTH.min(room.width()) - margins);
            let body = ScrollArea::vertical().max_height(room.height() - FRAME - lines - messages);
            body.auto_shrink([false, true]).show(ui, |ui| {
                self.head(ui, session, &mut choices);
                if form(ui, &mut choices, is_new) {
                    actions.push(Action::Export(ExportAction::Start));
                }
                command(ui, session);
            });
            ui.separator();
            foot(ui, session, actions);
        });
        if choices != before {
            // An export that was asked for is that of the new choices.
            actions.insert(0, Action::Export(ExportAction::Choose(Box::new(choices))));
        }
        if !is_open {
            actions.push(Action::Export(ExportAction::Dialog));
        }
    }

    /// The preview, and beside it frames and size.
    fn head(&mut self, ui: &mut Ui, session: &Session, choices: &mut Choices) {
        ui.horizontal_top(|ui| {
            let middle = Layout::centered_and_justified(Direction::TopDown);
            ui.allocate_ui_with_layout(PREVIEW, middle, |ui| {
                ui.set_min_size(PREVIEW);
                ui.painter().rect_filled(ui.max_rect(), 0.0, ui.visuals().extreme_bg_color);
                self.preview(ui, session);
            });
            ui.vertical(|ui| {
                ui.spacing_mut().combo_width = CHOICE;
                let mut frames = choices.frames;
                let options = [(Frames::Moment, "this moment"), (Frames::Steps, "steps")];
                if choice(ui, "Frames of the export", &mut frames, &options) {
                    *choices = choices.with_frames(frames);
                }
                size(ui, session, choices);
                background(ui, choices);
                match session.exports().frames() {
                    Some(Ok(1)) => _ = ui.label("1 frame"),
                    Some(Ok(count)) => _ = ui.label(format!("{count} frames")),
                    Some(Err(problem)) => _ = ui.colored_label(ui.visuals().error_fg_color, problem),
                    None => {}
                }
            });
        });
    }

    /// The picture, once it is there.
    fn preview(&mut self, ui: &mut Ui, session: &Session) {
        match session.exports().preview() {
            Some(Ok(picture)) => {
                let texture = self.preview.of(ui.ctx(), "export preview", &picture);
                let size = texture.size_vec2();
                let size = size * (PREVIEW.x / size.x).min(PREVIEW.y / size.y);
                ui.add(egui::Image::new((texture.id(), size)).alt_text(ALT_TEXT));
            }
            Some(Err(problem)) => _ = ui.add(egui::Label::new(problem).wrap()),
            None => {}
        }
    }
}

/// Width and height.
fn size(ui: &mut Ui, session: &Session, choices: &mut Choices) {
    let mut options: Vec<((usize, usize), &str)> = Vec::new();
    options.extend(session.size_px().map(|size| (size, "as the window")));
    options.extend(SIZES);
    if !options.iter().any(|(size, _)| *size == choices.size_px) {
        options.push((choices.size_px, "own size"));
    }
    choice(ui, "Size of the export", &mut choices.size_px, &options);
    ui.horizontal(|ui| {
        let (width, height) = &mut choices.size_px;
        number(ui, DragValue::new(width).range(1..=SIZE_MAX_PX), "Width of the export");
        ui.label("x");
        number(ui, DragValue::new(height).range(1..=SIZE_MAX_PX).suffix(" px"), "Height of the export");
    });
}

/// The colour behind the volume.
fn background(ui: &mut Ui, choices: &mut Choices) {
    if choices.still_format() == Some(StillFormat::Exr) {
        ui.label("EXR: with opacity, depth, and normals and numbers of surfaces");
        return;
    }
    ui.horizontal(|ui| {
        let nothing = if choices.still_format().is_some() { "transparent" } else { "black (a movie has no opacity)" };
        let mut is_color = choices.background.is_some();
        if choice(ui, "Background of the export", &mut is_color, &[(true, "on a colour"), (false, nothing)]) {
            choices.background = is_color.then_some([0; 3]);
        }
        if let Some(rgb) = choices.background {
            let shown = rgb.map(|c| f32::from(c) / 255.0);
            choices.background = color_button(ui, shown, "Background colour of the export").or(Some(rgb));
        }
    });
}

/// File, times, annotations and formats; whether the file was entered. The box for it has the focus if the dialog `is_new`.
fn form(ui: &mut Ui, choices: &mut Choices, is_new: bool) -> bool {
    let mut is_entered = false;
    Grid::new("export").num_columns(2).spacing([12.0, 4.0]).show(ui, |ui| {
        ui.label("File");
        let hint = "frame_%04d.png, picture.exr, movie.mp4";
        let file = text(ui, &mut choices.file, LONG, hint, "File of the export");
        if is_new {
            file.request_focus();
        }
        is_entered = file.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        ui.end_row();
        if choices.frames == Frames::Steps {
            times(ui, choices);
        }
        if choices.has_rate() {
            ui.label("Frame rate");
            ui.horizontal(|ui| {
                text(ui, &mut choices.fps, SHORT, "25", "Frames per second of the export");
                ui.label("frames per second");
            });
            ui.end_row();
        }
        ui.label("Drawn over it");
        annotations(ui, choices);
        ui.end_row();
        format(ui, choices);
        ui.label("Files there");
        ui.horizontal(|ui| {
            ui.checkbox(&mut choices.replaces, "replace them");
            if choices.still_format().is_some() {
                ui.checkbox(&mut choices.resume, "keep images of the same frames");
            }
        });
        ui.end_row();
    });
    is_entered
}

/// Steps, times, and over how long they are spread.
fn times(ui: &mut Ui, choices: &mut Choices) {
    ui.label("Steps");
    ui.horizontal(|ui| {
        text(ui, &mut choices.steps, SHORT, "A..B:S", "Steps of the export")
            .on_hover_text("A..B:S: from A to B, each S-th");
        ui.label("times");
        text(ui, &mut choices.times, SHORT, "T0..T1", "Times of the export");
    });
    ui.end_row();
    ui.label("Spread over");
    ui.horizontal(|ui| {
        let over = "Empty: a frame for each step";
        text(ui, &mut choices.duration, SHORT, "seconds", "Duration of the export").on_hover_text(over);
        ui.add_enabled_ui(!choices.duration.trim().is_empty(), |ui| {
            ui.checkbox(&mut choices.interpolate, "mix steps")
                .on_hover_text("Interpolate the scalars between two steps");
        });
        ui.label("turn by");
        text(ui, &mut choices.turntable, SHORT, "degrees", "Turntable of the export");
    });
    ui.end_row();
}

fn annotations(ui: &mut Ui, choices: &mut Choices) {
    ui.horizontal(|ui| {
        labelled(ui.checkbox(&mut choices.time, "time"), "Time in the export");
        labelled(ui.checkbox(&mut choices.legend, "legend"), "Legend in the export");
        labelled(ui.checkbox(&mut choices.title, "title"), "Title in the export");
        if choices.title {
            text(ui, &mut choices.title_text, 2.0 * SHORT, "field and dataset", "Text of the title");
        }
    });
}

/// Options of the format of images.
fn format(ui: &mut Ui, choices: &mut Choices) {
    let Some(format) = choices.still_format() else { return };
    ui.label("Format");
    ui.horizontal(|ui| match format {
        StillFormat::Png => {
            choice(ui, "Bits per channel", &mut choices.deep_png, &[(false, "8 bits"), (true, "16 bits")]);
        }
        StillFormat::Exr => {
            // Three boxes need the width of a row.
            ui.spacing_mut().combo_width = SHORT;
            choice(ui, "Bits of colours", &mut choices.half_exr, &[(false, "32 bits"), (true, "16 bits")]);
            let colors = [(ExrColor::Linear, "linear"), (ExrColor::Raw, "raw")];
            choice(ui, "Colours of the file", &mut choices.exr, &colors);
            let ways = ExrCompression::ALL.map(|way| (way, way.as_str()));
            choice(ui, "Compression", &mut choices.exr_compression, &ways);
        }
    });
    ui.end_row();
}

/// A box for a text.
fn text(ui: &mut Ui, text: &mut String, width: f32, hint: &str, name: &str) -> egui::Response {
    labelled(ui.add(TextEdit::singleline(text).desired_width(width).hint_text(hint)), name)
}

/// The command line that exports the same.
fn command(ui: &mut Ui, session: &mut Session) {
    let Some(command) = session.export_command() else { return };
    ui.horizontal(|ui| {
        ui.label("The same on the command line:");
        if ui.button("Copy").clicked() {
            ui.ctx().copy_text(command.line.clone());
        }
    });
    let mut line = command.line.as_str();
    let edit = TextEdit::multiline(&mut line).code_editor().lock_focus(false).desired_rows(2);
    labelled(ui.add(edit.desired_width(f32::INFINITY)), "Command line of the export");
    for note in &command.notes {
        ui.label(format!("Before that: {note}"));
    }
}

/// Messages, progress and buttons.
fn foot(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    if !session.notices().is_empty() {
        let messages = ScrollArea::vertical().id_salt("messages of exports").max_height(MESSAGES - LINE / 2.0);
        messages.auto_shrink([false, true]).show(ui, |ui| popups::session_messages(ui, session, actions));
    }
    let exports = session.exports();
    let mut act = |action| actions.push(Action::Export(action));
    if let Some(progress) = exports.progress() {
        bar(ui, &progress, ui.available_width());
    }
    ui.horizontal(|ui| {
        let is_running = exports.progress().is_some();
        if ui.add_enabled(!is_running && exports.frames().is_some_and(|of| of.is_ok()), Button::new("Export")).clicked()
        {
            act(ExportAction::Start);
        }
        if is_running && ui.add_enabled(!exports.is_cancelled(), Button::new("Cancel")).clicked() {
            act(ExportAction::Cancel);
        }
        if exports.can_resume() && ui.button("Resume").on_hover_text("Goes on with the last export").clicked() {
            act(ExportAction::Resume);
        }
        if ui.button("Close").on_hover_text("Escape; an export goes on").clicked() {
            act(ExportAction::Dialog);
        }
    });
}

/// Progress of an export while the dialog is closed, with a button that cancels it.
pub(super) fn progress(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let exports = session.exports();
    let Some(progress) = exports.progress().filter(|_| !exports.is_open()) else { return };
    ui.separator();
    bar(ui, &progress, 240.0);
    if icon(ui, "×", "Cancel the export", !exports.is_cancelled()).clicked() {
        actions.push(Action::Export(ExportAction::Cancel));
    }
}

fn bar(ui: &mut Ui, progress: &ExportProgress, width: f32) {
    let text = counted(progress);
    let share = progress.done as f32 / progress.total.max(1) as f32;
    let response = ui.add(ProgressBar::new(share).desired_width(width).text(text.clone()));
    response.widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, format!("Exporting: {text}")));
}

/// `render 12 of 30 frames, 3.2 MB, 5 s left`.
fn counted(progress: &ExportProgress) -> String {
    let ExportProgress { stage, done, total, unit, bytes, left } = progress;
    if *total == 0 {
        return "begin".to_owned();
    }
    let size = if *bytes > 0 { format!(", {:.1} MB", *bytes as f64 / 1e6) } else { String::new() };
    let left = left.map_or_else(String::new, |left| format!(", {} left", in_words(left)));
    format!("{stage} {done} of {total} {unit}{size}{left}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn progress_is_a_line() {
        assert_eq!(counted(&ExportProgress::default()), "begin");
        let now = ExportProgress {
            stage: "render".to_owned(),
            done: 12,
            total: 30,
            unit: "frames".to_owned(),
            bytes: 3_200_000,
            left: Some(Duration::from_millis(4500)),
        };
        assert_eq!(counted(&now), "render 12 of 30 frames, 3.2 MB, 5 s left");
        let checking = ExportProgress { bytes: 0, left: None, stage: "check".to_owned(), ..now };
        assert_eq!(counted(&checking), "check 12 of 30 frames");
    }
}

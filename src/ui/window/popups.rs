//! Popups: messages, help for keys and mouse, hint for dropped files.

use super::widgets;
use crate::ui::notice::{Notice, NoticeKind};
use crate::ui::{Action, Session, keys};
use eframe::egui;

/// Hint while files are dragged over the window.
pub(super) fn drop_hint(ctx: &egui::Context) {
    if ctx.input(|input| input.raw.hovered_files.is_empty()) {
        return;
    }
    egui::Window::new("drop").title_bar(false).anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO).show(ctx, |ui| {
        ui.heading("Drop to open");
    });
}

/// Messages about a session, over the picture; the dialog of exports has them itself.
pub(super) fn notices(ui: &mut egui::Ui, session: &Session, actions: &mut Vec<Action>) {
    if session.exports().is_open() {
        return;
    }
    let mut notices = session.notices().to_vec();
    let read = messages(ui, "messages", &mut notices);
    actions.extend(read.map(Action::Dismiss));
}

/// Messages about a session, in a part of the window.
pub(super) fn session_messages(ui: &mut egui::Ui, session: &Session, actions: &mut Vec<Action>) {
    let mut read = None;
    messages_of(ui, session.notices(), &mut read);
    actions.extend(read.map(Action::Dismiss));
}

/// Messages, each with a button to dismiss it; returns the dismissed one.
pub(super) fn messages(ui: &mut egui::Ui, id: &'static str, notices: &mut Vec<Notice>) -> Option<usize> {
    if notices.is_empty() {
        return None;
    }
    let mut read = None;
    // Over the picture: beside it they would change its size, and every message would cost a frame.
    let area = egui::Area::new(egui::Id::unique(id))
        .anchor(egui::Align2::LEFT_TOP, MESSAGES_AT)
        .order(egui::Order::Foreground);
    area.show(ui.ctx(), |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| messages_of(ui, notices, &mut read));
    });
    if let Some(index) = read {
        notices.remove(index);
    }
    read
}

/// Position of messages, below field and error, in points.
const MESSAGES_AT: egui::Vec2 = egui::vec2(12.0, 56.0);

/// Largest width of messages, in points.
const MESSAGES_WIDTH: f32 = 700.0;

fn messages_of(ui: &mut egui::Ui, notices: &[Notice], read: &mut Option<usize>) {
    ui.set_max_width(ui.available_width().min(MESSAGES_WIDTH));
    for (index, notice) in notices.iter().enumerate() {
        ui.horizontal(|ui| {
            let name = format!("Dismiss message {}", index + 1);
            if widgets::icon(ui, "×", &name, true).clicked() {
                *read = Some(index);
            }
            let color = match notice.kind {
                NoticeKind::Error => ui.visuals().error_fg_color,
                NoticeKind::Done => ui.visuals().text_color(),
            };
            let count = if notice.count > 1 { format!(" ({} times)", notice.count) } else { String::new() };
            let text = egui::RichText::new(format!("{}{count}", notice.text)).color(color);
            ui.add(egui::Label::new(text).wrap());
        });
    }
}

/// Smallest margin above and below the help.
const HELP_MARGIN: f32 = 8.0;

/// Help for keys and mouse, from their tables.
pub(super) fn help(ctx: &egui::Context, session: &Session, actions: &mut Vec<Action>) {
    let mut is_open = session.help_is_open();
    let window = egui::Window::new("Keys and mouse").open(&mut is_open).collapsible(false).resizable(false);
    let window = window.vscroll(true).max_height(ctx.content_rect().height() - 2.0 * HELP_MARGIN);
    window.anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO).show(ctx, |ui| {
        egui::Grid::new("keys").num_columns(2).spacing([24.0, 4.0]).show(ui, |ui| {
            let mouse = keys::MOUSE.iter().map(|&(what, does)| (what.to_owned(), does));
            for (what, does) in keys::help().into_iter().chain(mouse) {
                ui.strong(what);
                ui.label(does);
                ui.end_row();
            }
        });
    });
    if is_open != session.help_is_open() {
        actions.push(Action::Help);
    }
}

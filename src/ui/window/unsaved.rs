//! Asks what becomes of unsaved changes of a project and of an export under way, before another file is opened or the window is closed.

use super::Dress;
use crate::ui::opening::Opened;
use crate::ui::views::Views;
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{Id, Modal};
use std::path::PathBuf;
use std::time::Duration;

/// What ends the session.
pub(super) enum Leaving {
    /// Other files are opened.
    Open(Vec<PathBuf>),
    /// What has been opened is played.
    Play(Box<Opened>, Dress),
    /// The window is closed.
    Close,
}

/// The question, while it is open.
#[derive(Default)]
pub(super) struct Unsaved {
    leaving: Option<Leaving>,
    /// Whether the user wants the changes saved.
    saves: bool,
    /// Whether the user lets the changes go, until other files are open.
    pub(super) are_discarded: bool,
}

impl Unsaved {
    /// Whether something would be lost: changes (those of a look without a file are in the settings), or an export.
    pub(super) fn would_lose(views: &Views) -> bool {
        views.sessions().any(|session| is_unsaved(session) || is_exporting(session))
    }

    /// Opens the question.
    pub(super) fn ask(&mut self, leaving: Leaving) {
        *self = Self { leaving: Some(leaving), ..Self::default() };
    }

    /// Shows the question, if it is open; returns what the user leaves for, once nothing is in the way.
    pub(super) fn show(&mut self, ctx: &egui::Context, views: &mut Views, now: Duration) -> Option<Leaving> {
        self.leaving.as_ref()?;
        if self.saves {
            if views.sessions().any(Session::is_saving) {
                return None;
            }
            // Where they could not be written, the session says why, and the user stays.
            return std::mem::take(self).leaving.filter(|_| !views.sessions().any(is_unsaved));
        }
        let count = views.sessions().filter(|session| is_unsaved(session)).count();
        let exports = views.sessions().any(is_exporting);
        let mut answer = None;
        let modal = Modal::new(Id::unique("unsaved changes")).show(ctx, |ui| {
            ui.heading(if count > 0 { "Unsaved changes" } else { "Leave?" });
            match count {
                0 => {}
                1 => drop(ui.label("The project has changes that are not in its file.")),
                _ => drop(ui.label("The projects of both views have changes that are not in their files.")),
            }
            match exports {
                true => drop(ui.label("An export is under way, and ends if you leave; images can be resumed.")),
                // It has ended meanwhile.
                false if count == 0 => drop(ui.label("The export has ended.")),
                false => {}
            }
            ui.horizontal(|ui| {
                if count > 0 && ui.button("Save them").clicked() {
                    for session in views.sessions_mut().filter(|session| is_unsaved(session)) {
                        session.act(Action::SaveProject { to: None, may_replace: false }, now);
                    }
                    self.saves = true;
                }
                if ui.button(if count > 0 { "Discard them" } else { "Leave" }).clicked() {
                    answer = self.leaving.take();
                    self.are_discarded = true;
                }
                if ui.button("Stay here").clicked() {
                    self.leaving = None;
                }
            });
        });
        if modal.should_close() {
            self.leaving = None;
        }
        answer
    }
}

fn is_unsaved(session: &Session) -> bool {
    session.project_file().is_some() && session.is_changed()
}

fn is_exporting(session: &Session) -> bool {
    session.exports().progress().is_some()
}

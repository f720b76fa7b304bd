//! Asks what becomes of changes of a project that are not saved, before another file is opened or the window is closed.

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
    /// Whether changes would be lost. Those of a look without a file are in the settings.
    pub(super) fn has_changes(views: &Views) -> bool {
        views.sessions().any(is_unsaved)
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
            return std::mem::take(self).leaving.filter(|_| !Self::has_changes(views));
        }
        let count = views.sessions().filter(|session| is_unsaved(session)).count();
        let mut answer = None;
        let modal = Modal::new(Id::unique("unsaved changes")).show(ctx, |ui| {
            ui.heading("Unsaved changes");
            ui.label(match count {
                2 => "The projects of both views have changes that are not in their files.",
                _ => "The project has changes that are not in its file.",
            });
            ui.horizontal(|ui| {
                if ui.button("Save them").clicked() {
                    for session in views.sessions_mut().filter(|session| is_unsaved(session)) {
                        session.act(Action::SaveProject { to: None, may_replace: false }, now);
                    }
                    self.saves = true;
                }
                if ui.button("Discard them").clicked() {
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

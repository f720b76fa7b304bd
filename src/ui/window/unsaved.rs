//! Asks what becomes of changes of a project that are not saved, before another file is opened or the window is closed.

use crate::ui::{Action, NoticeKind, Session};
use eframe::egui;
use egui::{Id, Modal};
use std::path::PathBuf;

/// What ends the session.
#[derive(Debug)]
pub(super) enum Leaving {
    /// Other files are opened.
    Open(Vec<PathBuf>),
    /// The window is closed.
    Close,
}

/// The question, while it is open.
#[derive(Debug, Default)]
pub(super) struct Unsaved {
    leaving: Option<Leaving>,
    /// Whether the project is being written.
    is_saving: bool,
}

impl Unsaved {
    /// Whether changes would be lost. Those of a look without a file are in the settings.
    pub(super) fn has_changes(session: &Session) -> bool {
        session.project_file().is_some() && session.is_changed()
    }

    /// Opens the question.
    pub(super) fn ask(&mut self, leaving: Leaving) {
        *self = Self { leaving: Some(leaving), is_saving: false };
    }

    /// Shows the question, if it is open; returns what the user leaves for, once nothing is in the way.
    pub(super) fn show(
        &mut self,
        ctx: &egui::Context,
        session: &Session,
        actions: &mut Vec<Action>,
    ) -> Option<Leaving> {
        self.leaving.as_ref()?;
        if self.is_saving {
            let has_failed = session.notices().iter().any(|notice| notice.kind == NoticeKind::Error);
            if has_failed {
                *self = Self::default();
            }
            return if session.is_changed() { None } else { self.leaving.take() };
        }
        let mut answer = None;
        let modal = Modal::new(Id::unique("unsaved changes")).show(ctx, |ui| {
            ui.heading("Unsaved changes");
            ui.label("The project has changes that are not in its file.");
            ui.horizontal(|ui| {
                if ui.button("Save them").clicked() {
                    actions.push(Action::SaveProject { to: None, may_replace: false });
                    self.is_saving = true;
                }
                if ui.button("Discard them").clicked() {
                    answer = self.leaving.take();
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

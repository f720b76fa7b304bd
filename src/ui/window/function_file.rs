//! The menu that loads and saves the transfer function of the edited member.

use super::widgets::{labelled, staying_menu};
use crate::ui::{Action, FunctionFile};
use eframe::egui;
use egui::{TextEdit, Ui};
use std::path::PathBuf;

/// What was typed.
#[derive(Debug, Default)]
pub(super) struct FunctionMenu {
    path: String,
    colors_only: bool,
    may_replace: bool,
}

impl FunctionMenu {
    /// Shows the menu.
    pub(super) fn show(&mut self, ui: &mut Ui, actions: &mut Vec<Action>) {
        staying_menu(ui, "File...", |ui| {
            ui.label("A transfer function (JSON), or colour maps of ParaView (FILE.json, FILE.json#NAME):");
            let edit = TextEdit::singleline(&mut self.path).hint_text("path").desired_width(320.0);
            labelled(ui.add(edit), "Path of the transfer function");
            let path = self.path.trim().trim_matches(['"', '\'']).to_owned();
            let has_path = !path.is_empty();
            ui.horizontal(|ui| {
                if ui.add_enabled(has_path, egui::Button::new("Load")).clicked() {
                    actions.push(Action::LoadFunction { from: PathBuf::from(&path), colors_only: self.colors_only });
                    ui.close();
                }
                ui.checkbox(&mut self.colors_only, "colours only");
            });
            ui.horizontal(|ui| {
                for (format, text) in [(FunctionFile::Tetreel, "Save"), (FunctionFile::ParaView, "Save for ParaView")] {
                    if ui.add_enabled(has_path, egui::Button::new(text)).clicked() {
                        let may_replace = std::mem::take(&mut self.may_replace);
                        actions.push(Action::SaveFunction { to: PathBuf::from(&path), format, may_replace });
                        ui.close();
                    }
                }
                ui.checkbox(&mut self.may_replace, "replace it");
            });
        });
    }
}

//! The menu that loads and saves the transfer function of the edited member.

use super::path_field::{Choice, OpenDialog, PathField};
use super::widgets::staying_menu;
use crate::ui::{Action, FunctionFile};
use eframe::egui;
use egui::Ui;

/// What was typed and chosen.
pub(super) struct FunctionMenu {
    path: PathField,
    colors_only: bool,
    may_replace: bool,
}

impl FunctionMenu {
    pub(super) fn new(open: &OpenDialog) -> Self {
        Self { path: PathField::new(open), colors_only: false, may_replace: false }
    }

    /// Shows the menu.
    pub(super) fn show(&mut self, ui: &mut Ui, actions: &mut Vec<Action>) {
        staying_menu(ui, "File...", |ui| {
            ui.label("A transfer function (JSON), or colour maps of ParaView (FILE.json, FILE.json#NAME):");
            let choices = [(Choice::File, "Choose file"), (Choice::Save, "Choose new file")];
            self.path.show(ui, ("Path of the transfer function", "path"), None, &choices);
            let path = self.path.path();
            let has_path = path.is_some();
            ui.horizontal(|ui| {
                if ui.add_enabled(has_path, egui::Button::new("Load")).clicked()
                    && let Some(from) = path.clone()
                {
                    actions.push(Action::LoadFunction { from, colors_only: self.colors_only });
                    ui.close();
                }
                ui.checkbox(&mut self.colors_only, "colours only");
            });
            ui.horizontal(|ui| {
                for (format, text) in [(FunctionFile::Tetreel, "Save"), (FunctionFile::ParaView, "Save for ParaView")] {
                    if ui.add_enabled(has_path, egui::Button::new(text)).clicked()
                        && let Some(to) = path.clone()
                    {
                        let may_replace = std::mem::take(&mut self.may_replace);
                        actions.push(Action::SaveFunction { to, format, may_replace });
                        ui.close();
                    }
                }
                ui.checkbox(&mut self.may_replace, "replace it");
            });
        });
    }
}

//! The menu of cameras with names.

use super::overlay::shortened;
use super::widgets::{icon, labelled, staying_menu};
use crate::project::{Edit, NamedCamera};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{Button, TextEdit, Ui};

/// Largest length of a name that is shown; longer ones are cut.
const NAME: usize = 32;

/// The menu, with the name that was typed.
#[derive(Debug, Default)]
pub(super) struct CameraMenu {
    name: String,
}

impl CameraMenu {
    /// Shows the menu.
    pub(super) fn show(&mut self, ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
        let menu = staying_menu(ui, "Cameras", |ui| self.content(ui, session, actions));
        menu.on_hover_text("Keep this view under a name, or go back to one");
    }

    fn content(&mut self, ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
        let cameras = &session.project().cameras;
        let mut edit = |edit: Edit| actions.push(Action::Edit(Box::new(edit)));
        ui.horizontal(|ui| {
            let text = TextEdit::singleline(&mut self.name).desired_width(160.0).hint_text(free_name(cameras));
            let response = labelled(ui.add(text), "Name of the camera");
            let is_entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            let hint = "Keep this view under the name; a camera of the same name is replaced";
            if ui.button("Store").on_hover_text(hint).clicked() || is_entered {
                let name = Some(std::mem::take(&mut self.name).trim().to_owned()).filter(|name| !name.is_empty());
                let (name, camera) = (name.unwrap_or_else(|| free_name(cameras)), session.camera());
                edit(match cameras.iter().position(|named| named.name == name) {
                    Some(index) => Edit::SetCamera { index, camera },
                    None => Edit::InsertCamera { index: cameras.len(), camera: NamedCamera { name, camera } },
                });
            }
        });
        let mut goes_to = None;
        for (index, NamedCamera { name, .. }) in cameras.iter().enumerate() {
            ui.horizontal(|ui| {
                if icon(ui, "x", &format!("Remove the camera {name}"), true).clicked() {
                    edit(Edit::RemoveCamera { index });
                }
                let typed = self.name.trim();
                let hint = format!("Rename the camera {name} to what is typed above");
                if icon(ui, "rename", &hint, !typed.is_empty()).clicked() {
                    edit(Edit::RenameCamera { index, name: typed.to_owned() });
                    self.name.clear();
                }
                if ui.add(Button::new(shortened(name, NAME)).wrap_mode(egui::TextWrapMode::Extend)).clicked() {
                    goes_to = Some(index);
                }
            });
        }
        actions.extend(goes_to.map(Action::GoToCamera));
    }
}

/// A name that no camera has.
fn free_name(cameras: &[NamedCamera]) -> String {
    let mut names = (1..).map(|number| format!("view {number}"));
    names.find(|name| cameras.iter().all(|camera| camera.name != *name)).unwrap_or_default()
}

//! Controls of the project: undo and redo, its ensembles with their members, its camera path.

use super::overlay::shortened;
use super::widgets::labelled;
use crate::look::EnsembleChoice;
use crate::project::{Edit, Project};
use crate::timeline::At;
use crate::transfer::Ensemble;
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{Button, TextEdit, Ui};
use std::path::{Path, PathBuf};

/// Number of ensembles with keys.
const DIGITS: usize = 9;

/// This part of the side panel.
#[derive(Debug, Default)]
pub(super) struct ProjectPanel {
    /// Path that was typed.
    path: String,
    /// Whether a file that is there is replaced.
    may_replace: bool,
}

impl ProjectPanel {
    /// Shows it.
    pub(super) fn show(&mut self, ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
        let project = session.project();
        file(ui, session, actions);
        ui.collapsing("Save as", |ui| self.save_as(ui, session, actions));
        if project.ensembles.len() > 1 {
            ensembles(ui, session, project, actions);
        }
        let edited = session.edited_ensemble();
        if let Some(ensemble) = project.ensembles.get(edited).filter(|ensemble| ensemble.members.len() > 1) {
            members(ui, session, (edited, ensemble), actions);
        }
        // While playing the line would flicker with every step.
        if session.is_working_out() && !session.state().playing {
            ui.label("working out the colours");
        }
        if !project.timeline.cameras.keys().is_empty() {
            let mut follows = session.follows_path();
            if ui.checkbox(&mut follows, "camera path").on_hover_text("C").changed() {
                actions.push(Action::CameraPath(follows));
            }
        }
    }

    /// A box for the path of a new file.
    fn save_as(&mut self, ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
        if self.path.is_empty() {
            let name = session.store().path().with_extension("toml");
            self.path = session.project_file().unwrap_or(&name).display().to_string();
        }
        let edit = TextEdit::singleline(&mut self.path).desired_width(ui.available_width());
        let response = labelled(ui.add(edit), "Path of the project file");
        let is_entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        ui.horizontal(|ui| {
            let is_entered = ui.button("Save to this file").clicked() || is_entered;
            ui.checkbox(&mut self.may_replace, "replace it");
            let path = self.path.trim();
            if is_entered && !path.is_empty() {
                let (to, may_replace) = (Some(PathBuf::from(path)), std::mem::take(&mut self.may_replace));
                actions.push(Action::SaveProject { to, may_replace });
            }
        });
    }
}

/// The project's file, and buttons to undo, redo and save.
fn file(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let path = session.project_file();
    let name = path.and_then(Path::file_name).map(|name| shortened(&name.to_string_lossy(), NAME));
    let name = name.unwrap_or_else(|| "not saved".to_owned());
    let response = ui.label(if session.is_changed() { format!("{name}, changed") } else { name });
    if let Some(path) = path {
        response.on_hover_text(path.display().to_string());
    }
    ui.horizontal(|ui| {
        let (undo, redo) = session.changes();
        let mut button = |text: &str, key: &str, is_enabled: bool, action: Action| {
            if ui.add_enabled(is_enabled, Button::new(text)).on_hover_text(key).clicked() {
                actions.push(action);
            }
        };
        button("Undo", "Ctrl Z", undo > 0, Action::Undo);
        button("Redo", "Ctrl Shift Z", redo > 0, Action::Redo);
        let save = Action::SaveProject { to: None, may_replace: false };
        button("Save", "Ctrl S", path.is_some() && session.is_changed(), save);
    });
}

/// The ensembles by name, with the shown one marked.
fn ensembles(ui: &mut Ui, session: &Session, project: &Project, actions: &mut Vec<Action>) {
    let shown = session.look().followed.ensembles;
    let mut row = |ui: &mut Ui, choice, text: &str, key: Option<usize>| {
        let response = ui.selectable_label(shown == choice, text);
        let response = match key {
            Some(key) => response.on_hover_text(key.to_string()),
            None => response,
        };
        if response.clicked() {
            actions.push(Action::Ensembles(choice));
        }
    };
    row(ui, EnsembleChoice::Project, "timeline", Some(0));
    for (index, ensemble) in project.ensembles.iter().enumerate() {
        let key = Some(index + 1).filter(|&key| key <= DIGITS);
        row(ui, EnsembleChoice::One(index), &shortened(&ensemble.name, NAME), key);
    }
    ui.label(match shown {
        EnsembleChoice::One(_) => "shown at all times".to_owned(),
        EnsembleChoice::Project => format!("shown: {}", on_timeline(session, project)),
    });
}

/// The members of an ensemble: the edited one is marked, each can be left out.
fn members(ui: &mut Ui, session: &Session, (index, ensemble): (usize, &Ensemble), actions: &mut Vec<Action>) {
    ui.label(format!("Members of {}", shortened(&ensemble.name, NAME)));
    let edited = session.edited_member().map(|(_, member)| member);
    for (at, member) in ensemble.members.iter().enumerate() {
        ui.horizontal(|ui| {
            let mut changed = member.clone();
            let enabled = ui.checkbox(&mut changed.enabled, "");
            if labelled(enabled, &format!("Use the member {}", member.name)).changed() {
                let member = Box::new(changed);
                actions.push(Action::Edit(Box::new(Edit::SetMember { ensemble: index, index: at, member })));
            }
            if ui.selectable_label(edited == Some(at), shortened(&member.name, NAME)).clicked() {
                actions.push(Action::Member(at));
            }
        });
    }
}

/// Largest length of a name; longer ones are cut.
const NAME: usize = 32;

/// The timeline's ensembles at the time on the screen.
fn on_timeline(session: &Session, project: &Project) -> String {
    let at = session.shown().map(|shown| shown.request.time.time(session.series().times()));
    match at.and_then(|at| project.timeline.ensembles.at(at)) {
        Some(At::One(name)) => name.clone(),
        Some(At::Between { a, b, weight }) => format!("{a}, {:.0} % {b}", 100.0 * weight),
        None => project.shown_without_keys().map_or_else(String::new, |ensemble| ensemble.name.clone()),
    }
}

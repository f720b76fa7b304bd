//! Controls of the project: its file, undo and redo, its ensembles with their members, its camera path.

use super::members::Members;
use super::overlay::shortened;
use super::path_field::{Choice, OpenDialog, PathField};
use super::widgets::staying_menu;
use crate::look::EnsembleChoice;
use crate::project::{Project, Timeline};
use crate::timeline::At;
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{Button, Ui};

/// Number of ensembles with keys.
const DIGITS: usize = 9;

/// The menu that saves a project.
pub(super) struct ProjectMenu {
    path: PathField,
    /// Whether a file that is there is replaced.
    may_replace: bool,
}

/// Whether a project says more than a look: its part of the side panel is open then.
pub(super) fn says_more(session: &Session) -> bool {
    let project = session.project();
    has_choice(project) || project.ensembles.iter().any(|of| of.members.len() > 1)
}

/// Whether there is something to choose from: ensembles, or the timeline.
fn has_choice(project: &Project) -> bool {
    project.ensembles.len() > 1 || project.timeline != Timeline::default()
}

/// Shows the project's part of the side panel.
pub(super) fn show(ui: &mut Ui, session: &Session, members: &mut Members, actions: &mut Vec<Action>) {
    let project = session.project();
    if has_choice(project) {
        ensembles(ui, session, project, actions);
    }
    members.show(ui, session, actions);
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

impl ProjectMenu {
    pub(super) fn new(open: &OpenDialog) -> Self {
        Self { path: PathField::new(open), may_replace: false }
    }

    /// Shows the menu, and buttons to undo and redo.
    pub(super) fn show(&mut self, ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
        staying_menu(ui, "Save...", |ui| {
            file(ui, session, actions);
            self.save_as(ui, session, actions);
            ui.separator();
            let hint = "All but the camera as it was saved, or as the window was opened; can be undone";
            let revert = ui.add_enabled(session.is_changed(), Button::new("Back to what was saved"));
            if revert.on_hover_text(hint).clicked() {
                actions.push(Action::Revert);
                ui.close();
            }
        });
        let (undo, redo) = session.changes();
        let mut button = |text: &str, key: &str, is_enabled: bool, action: Action| {
            if ui.add_enabled(is_enabled, Button::new(text)).on_hover_text(key).clicked() {
                actions.push(action);
            }
        };
        button("Undo", "Ctrl Z", undo > 0, Action::Undo);
        button("Redo", "Ctrl Shift Z", redo > 0, Action::Redo);
    }

    /// A box for the path of a new file.
    fn save_as(&mut self, ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
        if self.path.text.is_empty() {
            let name = session.source().with_extension("toml");
            self.path.text = session.project_file().unwrap_or(&name).display().to_string();
        }
        let (_, is_entered) =
            self.path.show(ui, ("Path of the project file", ""), None, &[(Choice::Save, "Choose new file")]);
        ui.horizontal(|ui| {
            let is_entered = ui.button("Save to this file").clicked() || is_entered;
            ui.checkbox(&mut self.may_replace, "replace it");
            if let Some(to) = self.path.path().filter(|_| is_entered) {
                let may_replace = std::mem::take(&mut self.may_replace);
                actions.push(Action::SaveProject { to: Some(to), may_replace });
            }
        });
    }
}

/// The project's file, and a button to save to it.
fn file(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let Some(path) = session.project_file() else {
        ui.label("What is shown, as a project file:");
        return;
    };
    let name = shortened(&path.file_name().unwrap_or(path.as_os_str()).to_string_lossy(), NAME);
    ui.horizontal(|ui| {
        let is_changed = session.is_changed();
        let name = if is_changed { format!("{name}, changed") } else { name };
        ui.label(name).on_hover_text(path.display().to_string());
        // The camera, which may have moved, is saved, too.
        if ui.button("Save").on_hover_text("Ctrl S").clicked() {
            actions.push(Action::SaveProject { to: None, may_replace: false });
        }
    });
    ui.label("or as:");
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

/// Largest length of a name; longer ones are cut.
pub(super) const NAME: usize = 32;

/// The timeline's ensembles at the time on the screen.
fn on_timeline(session: &Session, project: &Project) -> String {
    let at = session.shown().map(|shown| shown.request.time.time(session.series().times()));
    match at.and_then(|at| project.timeline.ensembles.at(at)) {
        Some(At::One(name)) => name.clone(),
        Some(At::Between { a, b, weight }) => format!("{a}, {:.0} % {b}", 100.0 * weight),
        None => project.shown_without_keys().map_or_else(String::new, |ensemble| ensemble.name.clone()),
    }
}

//! Controls of a project: its ensembles and its camera path.

use crate::look::EnsembleChoice;
use crate::project::Project;
use crate::timeline::At;
use crate::ui::{Action, Session};
use eframe::egui;
use egui::Ui;

/// Number of ensembles with keys.
const DIGITS: usize = 9;

/// Shows this part of the side panel.
pub(super) fn show(ui: &mut Ui, session: &Session, project: &Project, actions: &mut Vec<Action>) {
    if project.ensembles.is_empty() {
        ui.label("no ensembles");
    } else {
        ensembles(ui, session, project, actions);
    }
    if !project.timeline.cameras.keys().is_empty() {
        let mut follows = session.follows_path();
        if ui.checkbox(&mut follows, "camera path").on_hover_text("C").changed() {
            actions.push(Action::CameraPath(follows));
        }
    }
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
        row(ui, EnsembleChoice::One(index), &super::overlay::shortened(&ensemble.name, NAME), key);
    }
    ui.label(match shown {
        EnsembleChoice::Own => "shown: your own colours, not the project's".to_owned(),
        EnsembleChoice::One(_) => "shown at all times".to_owned(),
        EnsembleChoice::Project => format!("shown: {}", on_timeline(session, project)),
    });
    // While playing the line would flicker with every step.
    if session.is_working_out() && !session.state().playing {
        ui.label("working out the colours");
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

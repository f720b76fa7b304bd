//! The ensembles of the project, the members of the edited one, and how they are blended.

use super::overlay::shortened;
use super::project::NAME;
use super::widgets::{chosen, icon, labelled, number};
use crate::project::Edit;
use crate::transfer::{Blend, ColorWeighting, Ensemble, Member, Reduction, Space};
use crate::ui::members::{self, Place};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{DragValue, TextEdit, Ui};

/// Names that are typed.
#[derive(Debug, Default)]
pub(super) struct Members {
    ensemble: NameBox,
    member: NameBox,
}

/// A box for a name. What is typed counts when the box loses the focus.
#[derive(Debug, Default)]
struct NameBox {
    text: String,
    has_focus: bool,
}

impl NameBox {
    /// Shows the box; returns another name that was typed.
    fn show(&mut self, ui: &mut Ui, name: &str, label: &str) -> Option<String> {
        if !self.has_focus {
            name.clone_into(&mut self.text);
        }
        let response = labelled(ui.add(TextEdit::singleline(&mut self.text).desired_width(110.0)), label);
        self.has_focus = response.has_focus();
        let text = self.text.trim();
        (response.lost_focus() && !text.is_empty() && text != name).then(|| text.to_owned())
    }
}

impl Members {
    /// Shows the edited ensemble and its members.
    pub(super) fn show(&mut self, ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
        let (project, edited) = (session.project(), session.edited_ensemble());
        let Some(ensemble) = project.ensembles.get(edited) else { return };
        let mut edits = Vec::new();
        ui.horizontal(|ui| {
            if let Some(name) = self.ensemble.show(ui, &ensemble.name, "Name of the ensemble") {
                edits.push(Edit::RenameEnsemble { index: edited, name });
            }
            if icon(ui, "+", "Copy the ensemble", true).clicked() {
                edits.extend(members::copied_ensemble(project, edited));
            }
            if icon(ui, "×", "Remove the ensemble", project.ensembles.len() > 1).clicked() {
                edits.extend(members::removed_ensemble(project, edited));
            }
        });
        let weightings = [(ColorWeighting::Plain, "plain colours"), (ColorWeighting::Opacity, "colours by opacity")];
        let colors = chosen(ui, "Colours of the ensemble", ensemble.colors, &weightings);
        edits.extend(colors.map(|colors| Edit::SetColors { ensemble: edited, colors }));
        ui.label(format!("Members of {}", shortened(&ensemble.name, NAME)));
        list(ui, session, (edited, ensemble), actions);
        if let Some(place) = session.edited_member() {
            buttons(ui, session, place, ensemble, actions);
            if let Some(member) = ensemble.members.get(place.1) {
                edits.extend(self.member(ui, session, place, member));
            }
        }
        actions.extend(edits.into_iter().map(|edit| Action::Edit(Box::new(edit))));
    }

    /// The settings of a member; returns its change.
    fn member(&mut self, ui: &mut Ui, session: &Session, place: Place, member: &Member) -> Option<Edit> {
        let mut changed = member.clone();
        ui.horizontal(|ui| {
            if let Some(name) = self.member.show(ui, &member.name, "Name of the member") {
                changed.name = name;
            }
            let weight = DragValue::new(&mut changed.weight).speed(0.005).range(0.0..=1.0).max_decimals(3);
            number(ui, weight.prefix("x "), "Weight of the member");
        });
        if place.1 > 0 {
            let blends = [
                (Blend::Add, "added to those above"),
                (Blend::And, "and: where both are"),
                (Blend::Xor, "xor: where one is"),
                (Blend::Xor8, "xor of 8 bits"),
            ];
            if let Some(blend) = chosen(ui, "Blending", member.blend, &blends) {
                changed.blend = blend;
            }
        }
        let spaces = [
            (Space::Scalar, "over the scalar"),
            (Space::ScalarGradient, "over scalar and gradient"),
            (Space::Cov, "over the CoV"),
            (Space::ScalarCov, "over scalar and CoV"),
        ];
        if let Some(space) = chosen(ui, "Quantities", member.space, &spaces) {
            changed = members::in_space(&changed, space, session.shown_range().as_ref());
        }
        if member.space != Space::Scalar {
            let reductions = [
                (Reduction::Intensity, "reduced to the scalar"),
                (Reduction::Opacity, "reduced, with full colours"),
                (Reduction::Keep, "not reduced"),
            ];
            if let Some(reduction) = chosen(ui, "Reduction", member.reduction, &reductions) {
                changed.reduction = reduction;
            }
        }
        let (ensemble, index) = place;
        (changed != *member).then(|| Edit::SetMember { ensemble, index, member: Box::new(changed) })
    }
}

/// The members: the edited one is marked, each can be left out.
fn list(ui: &mut Ui, session: &Session, (index, ensemble): (usize, &Ensemble), actions: &mut Vec<Action>) {
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

/// Buttons that add, copy, remove and move members.
fn buttons(ui: &mut Ui, session: &Session, place: Place, of: &Ensemble, actions: &mut Vec<Action>) {
    let (project, (ensemble, index), count) = (session.project(), place, of.members.len());
    let moved = |to: usize| Some(Edit::MoveMember { ensemble, from: index, to });
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let mut button = |symbol: &str, name: &str, is_enabled: bool, edit: &dyn Fn() -> Option<Edit>, to: usize| {
            if icon(ui, symbol, name, is_enabled).clicked()
                && let Some(edit) = edit()
            {
                actions.extend([Action::Edit(Box::new(edit)), Action::Member(to)]);
            }
        };
        button("+", "Add a member", true, &|| members::added(project, place), index + 1);
        button("copy", "Copy the member", true, &|| members::copied(project, place), index + 1);
        button("×", "Remove the member", count > 1, &|| members::removed(project, place), index.saturating_sub(1));
        button("up", "Move the member up", index > 0, &|| moved(index.saturating_sub(1)), index.saturating_sub(1));
        button("down", "Move the member down", index + 1 < count, &|| moved(index + 1), index + 1);
    });
}

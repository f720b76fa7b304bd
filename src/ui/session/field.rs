//! Another field: as a change of what is shown, or because a state before a change has it.

use super::Session;
use crate::field::FieldSelector;
use crate::pipeline::Series;
use crate::project::Edit;
use crate::transfer::{FirstLook, Function, Member};
use crate::ui::document::Turn;
use std::sync::Arc;

impl Session {
    /// Turns to another state of the document, if there is one. Its field is opened first, if that is another one.
    pub(super) fn turn(&mut self, turn: Turn) {
        match self.other_field_after(turn) {
            None => self.document.turn(turn, &mut self.look),
            Some(field) => self.open_field(field, Some(turn)),
        }
    }

    /// The field of the state that a turn leads to; `None`: it is that of the series, or there is no such state. A project that names none has
    /// the one with which the window was opened.
    fn other_field_after(&self, turn: Turn) -> Option<FieldSelector> {
        let field = &self.document.project_after(turn)?.data.field;
        let name = field.as_ref().map_or_else(|| self.first_field.clone(), FieldSelector::to_string);
        let is_other = *field != self.project().data.field && name != self.series().field().name;
        name.parse().ok().filter(|_| is_other)
    }

    /// Opens a field on another thread, unless one is being opened.
    pub(super) fn open_field(&mut self, field: FieldSelector, turn: Option<Turn>) {
        if !std::mem::replace(&mut self.opens_field, true) {
            let series = self.series().clone();
            self.jobs.open(&self.store, &series, field, turn);
        }
    }

    /// Plays a field that was opened: as a change, or with the state that has it.
    pub(super) fn turn_to_field(&mut self, series: Arc<Series>, turn: Option<Turn>, looks: [FirstLook; 2]) {
        self.opens_field = false;
        let before = self.document.state(&self.look);
        match turn {
            None => self.change_field(&series.field().name, looks),
            // The user did something else meanwhile: no state waits for this field any more.
            Some(turn) if self.other_field_after(turn).is_none_or(|field| field.to_string() != series.field().name) => {
                return;
            }
            Some(turn) => self.document.turn(turn, &mut self.look),
        }
        if matches!(turn, None | Some(Turn::Revert)) {
            self.document.record(before, &self.look, None);
        }
        if let Some(follower) = &self.follower {
            follower.set_field(series.clone());
        }
        self.player.set_series(series);
        self.quality.forget_all();
        (self.moved, self.motion_error) = (None, None);
        // A picture of another field would be mistaken for this one.
        (self.shown, self.requests.still) = (None, None);
        self.study();
    }

    /// Names another field in the project: a window that was opened without a project has its automatic colours, unless the user chose
    /// others.
    fn change_field(&mut self, name: &str, [before, first]: [FirstLook; 2]) {
        let is_first = |member: &Member| member.range == before.range && self.function() == Some(&before.tf);
        if !self.document.is_of_file() && self.member().is_some_and(is_first) {
            let FirstLook { tf, range, .. } = first;
            self.edit_member(|member| (member.function, member.range) = (Function::TransferFunction(tf), range));
        }
        let mut data = self.project().data.clone();
        data.field = name.parse().ok();
        self.edit(Edit::SetData(data));
    }
}

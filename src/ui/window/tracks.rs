//! The tracks of the timeline: below the slider, with the keys at their times on the way of its handle.

use super::overlay::{self, shortened};
use crate::timeline::{Key, Transition};
use crate::ui::tracks::{KeyAction, Track, TrackKey, place_of, time_at};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::containers::menu::MenuButton;
use egui::{Align2, Button, FontId, Pos2, Rangef, Rect, Role, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2};

/// Height of a row, and the largest one of all; there are more below a bar.
const ROW: f32 = 18.0;
const ROWS: f32 = 5.0 * ROW;
/// Width of the names beside the tracks, and their longest text.
const NAMES: (f32, usize) = (104.0, 18);
/// Half the width of a key's mark, and of the place where the mouse grabs it.
const MARK: (f32, f32) = (5.0, 8.0);
/// Number of straight pieces that a transition is drawn with.
const PIECES: u32 = 24;

/// Room for the names beside the slider and the tracks: none without keys.
pub(super) fn names_width(session: &Session) -> f32 {
    if Track::with_keys(session.project()).is_empty() { 0.0 } else { NAMES.0 }
}

/// The menu of all tracks, to which what is shown is added as a key.
pub(super) fn add_menu(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let menu = MenuButton::new("Add key").ui(ui, |ui| {
        ui.label("What is shown now, as a key of");
        for track in Track::offered(session.project(), session.edited_member()) {
            let shown = session.value_shown(track);
            let button = ui.add_enabled(shown.is_ok(), Button::new(track.name(session.project())));
            let button = button.on_disabled_hover_text(shown.err().unwrap_or_default());
            if button.clicked() {
                actions.push(Action::Keys(KeyAction::Add(track)));
                ui.close();
            }
        }
    });
    menu.0.on_hover_text("Let what is shown now change over time");
}

/// Shows the tracks that have keys; `way` is that of the slider's handle.
pub(super) fn show(ui: &mut Ui, session: &Session, way: Rangef, actions: &mut Vec<Action>) {
    let tracks = Track::with_keys(session.project());
    if tracks.is_empty() {
        return;
    }
    let scroll = egui::ScrollArea::vertical().id_salt("tracks").max_height(ROWS).auto_shrink([false, true]);
    scroll.show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        for track in tracks {
            Row { session, track, keys: track.keys(session.project()), way }.show(ui, actions);
        }
    });
}

/// One track.
struct Row<'a> {
    session: &'a Session,
    track: Track,
    keys: Vec<TrackKey>,
    way: Rangef,
}

impl Row<'_> {
    fn times(&self) -> &[f64] {
        &self.session.series().times().values
    }

    fn x(&self, time: f64) -> f32 {
        let last = self.times().len().saturating_sub(1).max(1) as f64;
        egui::lerp(self.way, (place_of(self.times(), time) / last) as f32)
    }

    /// The time at a place on the screen.
    fn time(&self, x: f32) -> Option<f64> {
        let last = self.times().len().saturating_sub(1) as f64;
        time_at(self.times(), f64::from((x - self.way.min) / self.way.span().max(1.0)) * last)
    }

    fn show(&self, ui: &mut Ui, actions: &mut Vec<Action>) {
        let (place, response) = ui.allocate_exact_size(vec2(ui.available_width(), ROW), Sense::click());
        let name = self.track.name(self.session.project());
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, format!("Track of {name}")));
        if response.clicked() {
            actions.push(Action::Keys(KeyAction::Deselect));
        }
        let beside = place.with_max_x(self.way.min - MARK.1);
        let (font, ink) = (FontId::proportional(12.0), ui.visuals().text_color());
        let left = beside.left_center();
        ui.painter().with_clip_rect(beside).text(left, Align2::LEFT_CENTER, shortened(&name, NAMES.1), font, ink);
        ui.interact(beside, ui.scope_id().with(("name", self.track)), Sense::hover()).on_hover_text(&name);
        self.draw_transitions(ui, place);
        let selected = self.session.selected_key().map(|(track, index, _)| (track, index));
        for (index, key) in self.keys.iter().enumerate() {
            self.key(ui, place, (index, key), &name, selected == Some((self.track, index)), actions);
        }
    }

    /// Each transition as its curve, from the bottom at its key to the top at the next one.
    fn draw_transitions(&self, ui: &Ui, place: Rect) {
        let stroke = Stroke::new(1.0, ui.visuals().weak_text_color());
        let rest = Stroke::new(1.0, ui.visuals().widgets.noninteractive.bg_stroke.color);
        ui.painter().hline(self.way, place.center().y, rest);
        let y = |weight: f64| egui::lerp(place.bottom() - 3.0..=place.top() + 3.0, weight as f32);
        for [a, b] in self.keys.array_windows() {
            let points: Vec<Pos2> = match a.transition {
                Transition::Step { at } => {
                    let x = self.x(a.time * (1.0 - at) + b.time * at);
                    vec![pos2(self.x(a.time), y(0.0)), pos2(x, y(0.0)), pos2(x, y(1.0)), pos2(self.x(b.time), y(1.0))]
                }
                transition => {
                    let share = (0..=PIECES).map(|piece| f64::from(piece) / f64::from(PIECES));
                    share.map(|t| pos2(self.x(a.time * (1.0 - t) + b.time * t), y(transition.weight(t)))).collect()
                }
            };
            ui.painter().line(points, stroke);
        }
    }

    /// A key: clicked it is selected, dragged it moves.
    fn key(
        &self,
        ui: &Ui,
        place: Rect,
        (index, key): (usize, &TrackKey),
        track: &str,
        is_selected: bool,
        actions: &mut Vec<Action>,
    ) {
        let center = pos2(self.x(key.time), place.center().y);
        let rect = Rect::from_center_size(center, vec2(2.0 * MARK.1, ROW));
        let response = ui.interact(rect, ui.scope_id().with((self.track, index)), Sense::click_and_drag());
        let beyond = beyond(self.times(), key);
        let name = format!("Key {} of {track} at {}{beyond}", index + 1, overlay::number(key.time));
        response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_selected, &name));
        let visuals = ui.style().interact_selectable(&response, is_selected);
        let fill = if is_selected { ui.visuals().selection.bg_fill } else { visuals.bg_fill };
        // What lies beyond the steps is hollow.
        let fill = if beyond.is_empty() { fill } else { ui.visuals().extreme_bg_color };
        let corners = [vec2(-MARK.0, 0.0), vec2(0.0, -MARK.0), vec2(MARK.0, 0.0), vec2(0.0, MARK.0)];
        let stroke = Stroke::new(if is_selected { 2.0 } else { 1.0 }, visuals.text_color());
        ui.painter().add(Shape::convex_polygon(corners.map(|by| center + by).into(), fill, stroke));
        if response.clicked() || response.drag_started() {
            actions.push(Action::Keys(KeyAction::Select(self.track, index)));
        }
        if response.dragged()
            && let Some(time) = response.interact_pointer_pos().and_then(|at| self.time(at.x))
        {
            let snaps = !ui.input(|input| input.modifiers.shift);
            actions.push(Action::Keys(KeyAction::Move { time, snaps }));
        }
        response.on_hover_text(name);
    }
}

/// How a key lies beyond the steps, as text; empty if it does not.
fn beyond<T>(times: &[f64], key: &Key<T>) -> &'static str {
    match (times.first(), times.last()) {
        (Some(&first), _) if key.time < first => ", before the first step",
        (_, Some(&last)) if key.time > last => ", after the last step",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_beyond_the_steps_is_said_to_be() {
        let of = |time| beyond(&[0.0, 2.0], &Key { time, transition: Transition::Linear, value: () });
        assert_eq!([-1.0, 0.0, 2.0, 2.5].map(of), [", before the first step", "", "", ", after the last step"]);
    }
}

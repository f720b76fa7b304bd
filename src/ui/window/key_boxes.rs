//! The selected key of the timeline in numbers, and the curve of its transition.

use super::overlay;
use super::widgets::{chosen, icon, number, staying_menu};
use crate::optics::OpticsKind;
use crate::timeline::Transition;
use crate::ui::tracks::{KeyAction, KeyValue, Track};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{DragValue, Pos2, Rect, Role, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

/// Side of the curve, and radius of its handles.
const CURVE: f32 = 140.0;
const HANDLE: f32 = 5.0;
/// Number of straight pieces of the curve.
const PIECES: u32 = 48;

/// Shows the boxes, if a key is selected.
pub(super) fn show(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let Some((track, index, key)) = session.selected_key() else { return };
    let mut act = |action: KeyAction| actions.push(Action::Keys(action));
    ui.horizontal_wrapped(|ui| {
        ui.label(format!("key {} of {}", index + 1, track.name(session.project())));
        time(ui, session, key.time, &mut act);
        value(ui, session, track, &key.value, &mut act);
        transition(ui, key.transition, &mut act);
        if icon(ui, "copy", "Copy the key (Ctrl C)", true).clicked() {
            act(KeyAction::Copy);
        }
        let copied = session.copied_key();
        let here = copied.map_or("Copy here: no key was copied".to_owned(), |track| {
            format!("Insert the copied key of {} at the moment shown (Ctrl V)", track.name(session.project()))
        });
        if icon(ui, "copy here", &here, copied.is_some()).clicked() {
            act(KeyAction::Paste);
        }
        if icon(ui, "remove", "Remove the key (Delete)", true).clicked() {
            act(KeyAction::Remove);
        }
        if icon(ui, "×", "Select no key", true).clicked() {
            act(KeyAction::Deselect);
        }
    });
}

fn time(ui: &mut Ui, session: &Session, before: f64, act: &mut impl FnMut(KeyAction)) {
    let times = &session.series().times().values;
    let span = times.last().zip(times.first()).map_or(1.0, |(last, first)| 0.5 * last - 0.5 * first);
    let mut time = before;
    let value = DragValue::new(&mut time).speed((span / 250.0).max(f64::MIN_POSITIVE)).prefix("at ");
    number(ui, value.custom_formatter(|t, _| overlay::number(t)), "Time of the key");
    if time != before {
        act(KeyAction::Move { time, snaps: false });
    }
}

fn value(ui: &mut Ui, session: &Session, track: Track, before: &KeyValue, act: &mut impl FnMut(KeyAction)) {
    const NAME: &str = "Value of the key";
    match before {
        KeyValue::Ensemble(name) => {
            let ensembles = session.project().ensembles.iter();
            let names: Vec<(&str, &str)> = ensembles.map(|of| (of.name.as_str(), of.name.as_str())).collect();
            if let Some(name) = chosen(ui, NAME, name.as_str(), &names) {
                act(KeyAction::SetValue(KeyValue::Ensemble(name.to_owned())));
            }
        }
        KeyValue::Optics(kind) => {
            let kind = chosen(ui, NAME, *kind, &super::side::OPTICS);
            kind.into_iter().for_each(|kind: OpticsKind| act(KeyAction::SetValue(KeyValue::Optics(kind))));
        }
        KeyValue::Number(number) => {
            if let Some(number) = number_box(ui, session, track, *number, NAME) {
                act(KeyAction::SetValue(KeyValue::Number(number)));
            }
        }
        KeyValue::Camera(_) => {
            if ui.button("Take the view shown").clicked() {
                act(KeyAction::TakeShown);
            }
        }
        KeyValue::Map(_) => {
            if ui.button("Take what is shown").clicked() {
                act(KeyAction::TakeShown);
            }
        }
    }
}

/// A box for the number of a key; returns another number.
fn number_box(ui: &mut Ui, session: &Session, track: Track, before: f64, name: &str) -> Option<f64> {
    let is_share = matches!(track, Track::Lod | Track::IsoOpacity | Track::Flow);
    let mut shown = if is_share { 100.0 * before } else { before };
    let value = DragValue::new(&mut shown);
    let value = match track {
        _ if is_share => value.range(0.0..=100.0).speed(0.5).max_decimals(1).suffix(" %"),
        Track::Isovalue => {
            let (lo, hi) = session.range_of_field().unwrap_or((0.0, 1.0));
            value.speed((hi - lo) / 500.0).custom_formatter(|x, _| overlay::number(x))
        }
        _ => {
            let (lo, hi) = session.series().mesh().frame();
            value.speed((hi - lo).length() / 1000.0).custom_formatter(|x, _| overlay::number(x))
        }
    };
    let is_changed = number(ui, value, name).changed();
    let after = if is_share { (0.01 * shown).clamp(0.0, 1.0) } else { shown };
    (is_changed && after != before).then_some(after)
}

/// The kinds of transitions, with the numbers that a new one has.
fn kinds(now: Transition) -> [(Transition, &'static str); 4] {
    let kinds = [
        (Transition::Linear, "linear"),
        (Transition::Smooth, "smooth"),
        (Transition::Step { at: 0.5 }, "step"),
        // As CSS eases.
        (Transition::Cubic { handles: [[0.25, 0.1], [0.25, 1.0]] }, "cubic"),
    ];
    let is_same = |kind: &Transition| std::mem::discriminant(kind) == std::mem::discriminant(&now);
    kinds.map(|(kind, name)| (if is_same(&kind) { now } else { kind }, name))
}

fn transition(ui: &mut Ui, before: Transition, act: &mut impl FnMut(KeyAction)) {
    let mut after = chosen(ui, "Transition to the next key", before, &kinds(before)).unwrap_or(before);
    match &mut after {
        Transition::Linear | Transition::Smooth => {}
        Transition::Step { at } => {
            let mut percent = 100.0 * *at;
            let value = DragValue::new(&mut percent).range(0.0..=100.0).speed(0.5).max_decimals(1).suffix(" %");
            if number(ui, value, "Place of the step between both keys").changed() {
                *at = (0.01 * percent).clamp(0.0, 1.0);
            }
        }
        Transition::Cubic { handles } => {
            let curve = *handles;
            let menu = staying_menu(ui, "curve", |ui| edit_curve(ui, curve, handles));
            menu.on_hover_text("The curve of this transition");
        }
    }
    if after != before {
        act(KeyAction::SetTransition(after));
    }
}

/// A curve whose handles are dragged, with boxes for their numbers.
fn edit_curve(ui: &mut Ui, before: [[f64; 2]; 2], after: &mut [[f64; 2]; 2]) {
    let (place, response) = ui.allocate_exact_size(vec2(CURVE, CURVE), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Curve of the transition, edited below"));
    let inner = place.shrink(HANDLE + 1.0);
    let on_screen = |[t, weight]: [f64; 2]| {
        pos2(egui::lerp(inner.x_range(), t as f32), egui::lerp(inner.bottom()..=inner.top(), weight as f32))
    };
    let of_screen = |at: Pos2| {
        let by = at - inner.left_bottom();
        [by.x / inner.width(), -by.y / inner.height()].map(|share| f64::from(share).clamp(0.0, 1.0))
    };
    let visuals = ui.visuals();
    let (ink, weak) = (Stroke::new(1.5, visuals.text_color()), Stroke::new(1.0, visuals.weak_text_color()));
    let painter = ui.painter();
    painter.rect_filled(place, 2.0, visuals.extreme_bg_color);
    painter.rect_stroke(inner, 0.0, visuals.widgets.noninteractive.bg_stroke, StrokeKind::Outside);
    let curve = Transition::Cubic { handles: before };
    let share = (0..=PIECES).map(|piece| f64::from(piece) / f64::from(PIECES));
    painter.line(share.map(|t| on_screen([t, curve.weight(t)])).collect(), ink);
    for (at, (handle, end)) in before.into_iter().zip([[0.0; 2], [1.0; 2]]).enumerate() {
        let center = on_screen(handle);
        painter.line_segment([on_screen(end), center], weak);
        let grip = Rect::from_center_size(center, vec2(3.0 * HANDLE, 3.0 * HANDLE));
        let response = ui.interact(grip, ui.scope_id().with(("handle", at)), Sense::drag());
        response.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Handle {} of the curve", at + 1)));
        painter.circle(center, HANDLE, ui.style().interact(&response).bg_fill, ink);
        if let Some(to) = response.interact_pointer_pos().filter(|_| response.dragged()) {
            after[at] = of_screen(to);
        }
    }
    for (at, handle) in before.into_iter().enumerate() {
        ui.horizontal(|ui| {
            for (axis, (word, name)) in [("t ", "time"), ("to ", "weight")].into_iter().enumerate() {
                let mut share = handle[axis];
                let value = DragValue::new(&mut share).range(0.0..=1.0).speed(0.005).max_decimals(3).prefix(word);
                if number(ui, value, &format!("Handle {}, {name}", at + 1)).changed() {
                    after[at][axis] = share.clamp(0.0, 1.0);
                }
            }
        });
    }
}

//! The point under the mouse, and the picked point.

use super::overlay::number;
use super::widgets::{icon, still_plot};
use crate::playback::Command;
use crate::ui::{Action, Picked, Session};
use eframe::egui;
use egui::{Role, Ui, WidgetInfo};
use egui_plot::{Line, PlotBounds, VLine};
use glam::DVec3;

/// Height of the curve in points.
const PLOT: f32 = 130.0;

/// The point under the mouse, as text.
pub(super) fn hovered(session: &Session) -> Option<String> {
    let hover = session.hover()?;
    Some(match &hover.found {
        Ok(Some(probe)) => {
            let cell = format!("cell {}", probe.source_cell);
            let flow = session.look().flow.as_ref().zip(hover.vector);
            let cell = match flow {
                Some((flow, of)) => format!("{}\n{cell}", vector(session, &flow.layer.field, of)),
                None => cell,
            };
            match &hover.functions {
                None => format!("{}\n{cell}", value(session, probe.scalar)),
                Some(found) => {
                    let (value, slope) = (value(session, found.value), number(found.gradient.length()));
                    format!("{value}\nslope {slope}\n{} functions\n{cell}", found.reached)
                }
            }
        }
        Ok(None) => return None,
        Err(error) => error.clone(),
    })
}

/// A scalar with name and unit.
fn value(session: &Session, scalar: f64) -> String {
    let field = session.series().field();
    let units = field.units.as_deref().filter(|units| !units.is_empty());
    let units = units.map_or(String::new(), |units| format!(" {units}"));
    format!("{} = {}{units}", field.name, number(scalar))
}

/// A vector with its field's name and unit, and its length.
fn vector(session: &Session, field: &str, vector: DVec3) -> String {
    if !vector.is_finite() {
        return format!("{field} has no vector here");
    }
    let component = format!("{field}:0");
    let units = session.store().fields().iter().find(|of| of.name == component).and_then(|of| of.units.clone());
    let units = units.filter(|units| !units.is_empty()).map_or(String::new(), |units| format!(" {units}"));
    let [x, y, z] = vector.to_array().map(number);
    format!("{field} = ({x}, {y}, {z}){units}\nlength {}{units}", number(vector.length()))
}

/// The picked point and its value over the series; a click in the curve goes to that time.
pub(super) fn show(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let Some(picked) = session.picked() else {
        ui.label("Click a place in the picture to see its value over time.");
        return;
    };
    let p = picked.position;
    ui.horizontal(|ui| {
        if icon(ui, "×", "Forget the point", true).clicked() {
            actions.push(Action::ForgetPick);
        }
        let text = format!("({}, {}, {})\ncell {}", number(p.x), number(p.y), number(p.z), picked.source_cell);
        ui.add(egui::Label::new(text).wrap());
    });
    if let Some(text) = at_present(session, &picked) {
        ui.strong(text);
    }
    curve(ui, session, &picked, actions);
    if let Some(problem) = picked.curve.as_ref().and_then(|curve| curve.problem.clone()) {
        ui.colored_label(ui.visuals().error_fg_color, problem);
    }
}

fn at_present(session: &Session, picked: &Picked) -> Option<String> {
    let curve = picked.curve.as_ref()?;
    let step = session.state().frame?.step();
    let known = curve.values.get(step).filter(|_| step < curve.done)?;
    let value = if known.is_finite() { value(session, f64::from(*known)) } else { "no value at this step".to_owned() };
    let of_flow = curve.vectors.as_ref().filter(|_| session.look().flow.is_some());
    let of_flow = of_flow.and_then(|of| Some((&of.field, of.values.get(step)?)));
    Some(match of_flow {
        Some((field, of)) => format!("{value}\n{}", vector(session, field, DVec3::from(of.map(f64::from)))),
        None => value,
    })
}

fn curve(ui: &mut Ui, session: &Session, picked: &Picked, actions: &mut Vec<Action>) {
    let times = &session.series().times().values;
    let Some(range) = session.series().field().range else { return };
    let mut points: Vec<[f64; 2]> = Vec::new();
    if let Some(curve) = &picked.curve {
        let known = times.iter().zip(&curve.values).take(curve.done);
        points.extend(known.map(|(&time, &value)| [time, f64::from(value)]));
    }
    let (first, last) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(1.0));
    let values = points.iter().map(|p| p[1]).filter(|v| v.is_finite());
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    let [lo, hi] = if lo < hi { [lo, hi] } else { range.map(f64::from) };
    let ([first_shown, last_shown], [lo, hi]) = (span(first, last, 0.0), span(lo, hi, 0.05));
    let plot = still_plot("point over time")
        .height(PLOT)
        .x_axis_formatter(|mark, _| number(mark.value))
        .y_axis_formatter(|mark, _| number(mark.value));
    let now = session.state().time;
    let shown = plot.show(ui, |plot| {
        plot.set_plot_bounds(PlotBounds::from_min_max([first_shown, lo], [last_shown, hi]));
        // A curve has gaps where there is no value.
        for run in points.split(|p| !p[1].is_finite()).filter(|run| !run.is_empty()) {
            plot.line(Line::new("value", run.to_vec()).color(egui::Color32::from_rgb(90, 170, 255)));
        }
        if let Some(now) = now {
            plot.vline(VLine::new("now", now).color(egui::Color32::from_rgb(235, 165, 60)).width(1.5));
        }
        plot.pointer_coordinate()
    });
    let response = shown.response;
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Value of the point over time"));
    if let Some(at) = shown.inner.filter(|_| response.clicked() || response.dragged()) {
        actions.push(Action::Play(Command::SeekTime(at.x.clamp(first, last))));
    }
}

/// The interval from `lo` to `hi`, extended on both sides by this share of its length; if that is 0, by some room.
fn span(lo: f64, hi: f64, margin: f64) -> [f64; 2] {
    let distance = hi - lo;
    let room = if distance > 0.0 && distance.is_normal() { margin * distance } else { 0.5 * lo.abs().max(1.0) };
    [lo - room, hi + room]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_always_something_between_the_ends_of_a_plot() {
        assert_eq!(span(1.0, 3.0, 0.05), [0.9, 3.1]);
        assert_eq!(span(1.0, 3.0, 0.0), [1.0, 3.0]);
        assert_eq!(span(0.0, 0.0, 0.0), [-0.5, 0.5]);
        for at in [5.0, -1e30, 1e-320, 1e9] {
            let [lo, hi] = span(at, at, 0.05);
            assert!(lo < at && at < hi, "{at}");
        }
    }
}

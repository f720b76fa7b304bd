//! The range map below the histogram: handles that stretch parts of the axis.
//!
//! Drag a handle to stretch one side of it and crowd the other; drag it with Shift to pull it and the next one apart; double-click to add
//! one, right-click to remove it.

use super::Edited;
use super::canvas::Canvas;
use super::curve::POINT;
use crate::histograms::Histogram;
use crate::transfer::{RangeMap, Space};
use crate::ui::bars::{self, DrawnAxis};
use crate::ui::window::widgets::{icon, number};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{DragValue, PointerButton, Role, Stroke, Ui, WidgetInfo, pos2};

/// Height of the strip, points.
pub(super) const HEIGHT: f32 = 18.0;

/// Bins over the axis from which it is equalised.
const BINS: usize = 256;

/// The handle held by the mouse, and the map when the drag began.
#[derive(Debug, Default)]
pub(super) struct MapEditor {
    held: Option<(usize, RangeMap)>,
}

/// The inner handle nearest to a position of the axis, within reach.
fn nearest(map: &RangeMap, at: f64, reach: f64) -> Option<usize> {
    let inner = 1..map.points().len().saturating_sub(1);
    let distance = |index: usize| map.points().get(index).map_or(f64::INFINITY, |point| (point[1] - at).abs());
    inner.min_by(|&a, &b| distance(a).total_cmp(&distance(b))).filter(|&index| distance(index) <= reach)
}

/// The map with a handle dragged to a position of the axis: alone, or pulled apart from the next one, by the same way each.
fn dragged(map: &RangeMap, index: usize, to: f64, pulls_apart: bool) -> RangeMap {
    let Some(&[x, y]) = map.points().get(index) else { return map.clone() };
    if !pulls_apart {
        return map.with_moved(index, [x, to]);
    }
    // To the right the handle and the one before it go apart, to the left the one behind it.
    let other = if to > y { index - 1 } else { index + 1 };
    let Some(&[_, other_y]) = map.points().get(other) else { return map.clone() };
    let (i, j) = (index.min(other), index.max(other));
    let mirrored = other_y - (to - y);
    let ends = if index < other { [to, mirrored] } else { [mirrored, to] };
    map.pulled_apart(i, j, ends)
}

impl MapEditor {
    /// Shows the strip with its handles.
    pub(super) fn strip(
        &mut self,
        ui: &Ui,
        response: &egui::Response,
        canvas: &Canvas,
        edited: Edited<'_>,
        actions: &mut Vec<Action>,
    ) {
        let map = edited.map;
        let reach = canvas.reach(POINT.1)[0];
        let at = response.interact_pointer_pos().map(|at| canvas.position(at)[0]);
        let mut changed = None;
        if let Some(at) = at.filter(|_| response.secondary_clicked()) {
            changed = nearest(map, at, reach).map(|index| map.without_point(index));
        }
        if let Some(at) = at.filter(|_| response.double_clicked()) {
            let is_new = nearest(map, at, reach).is_none();
            changed = is_new.then(|| map.with_point(map.inverse(at))).flatten().map(|(map, _)| map);
        }
        if response.drag_started_by(PointerButton::Primary) {
            let pressed = response.ctx.input(|input| input.pointer.press_origin());
            let found = pressed.and_then(|at| nearest(map, canvas.position(at)[0], reach));
            self.held = found.map(|index| (index, map.clone()));
        }
        if !response.dragged() {
            self.held = None;
        }
        if let (Some((index, before)), Some(at)) = (&self.held, at) {
            let pulls_apart = response.ctx.input(|input| input.modifiers.shift);
            changed = Some(dragged(before, *index, at, pulls_apart));
        }
        set(edited.session, map, changed, actions);
        draw(ui, canvas, map);
        let handles = map.points().len().saturating_sub(2);
        response.widget_info(|| {
            WidgetInfo::labeled(Role::Image, true, format!("Range map of {handles} handles, edited below"))
        });
        response.clone().on_hover_text(
            "Double-click to add a handle that stretches the axis; drag it, with Shift to pull it and the next one apart; right-click to \
             remove it",
        );
    }

    /// The handles as numbers, and the buttons that equalise and reset.
    pub(super) fn boxes(&self, ui: &mut Ui, edited: Edited<'_>, actions: &mut Vec<Action>) {
        let map = edited.map;
        let inner = map.points().get(1..map.points().len() - 1).unwrap_or_default();
        ui.vertical(|ui| {
            let mut changed = None;
            ui.horizontal_wrapped(|ui| {
                let histogram = edited.session.histogram().filter(|shown| shown.kind == edited.member.space);
                let button = ui.add_enabled(histogram.is_some(), egui::Button::new("Equalise"));
                let hint = "As many values in each part of the axis";
                if let Some(histogram) = histogram.filter(|_| button.on_hover_text(hint).clicked()) {
                    let counts = counts(&histogram.histogram, edited);
                    changed = Some(RangeMap::equalised(&counts));
                }
                if ui.add_enabled(!inner.is_empty(), egui::Button::new("Reset")).clicked() {
                    changed = Some(RangeMap::default());
                }
                let middle = widest(map);
                if ui.button("Add handle").clicked() {
                    changed = map.with_point(map.inverse(middle)).map(|(map, _)| map).or(changed.take());
                }
            });
            egui::Grid::new("range map").num_columns(3).spacing([6.0, 2.0]).show(ui, |ui| {
                for (n, &[x, y]) in (1..).zip(inner) {
                    let mut to = [x, y];
                    let from = DragValue::new(&mut to[0]).speed(0.002).range(0.0..=1.0).max_decimals(4);
                    number(ui, from.prefix("share "), &format!("Share of the range at handle {n}"));
                    let position = DragValue::new(&mut to[1]).speed(0.002).range(0.0..=1.0).max_decimals(4);
                    number(ui, position.prefix("at "), &format!("Position of handle {n}"));
                    if to != [x, y] {
                        changed = Some(map.with_moved(n, to));
                    }
                    if icon(ui, "×", &format!("Remove handle {n}"), true).clicked() {
                        changed = Some(map.without_point(n));
                    }
                    ui.end_row();
                }
            });
            set(edited.session, map, changed, actions);
        });
    }
}

/// The middle of the widest part of the axis between two handles.
fn widest(map: &RangeMap) -> f64 {
    let parts = map.points().windows(2).map(|pair| [pair[0][1], pair[1][1]]);
    let widest = parts.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    widest.map_or(0.5, |[lo, hi]| 0.5 * lo + 0.5 * hi)
}

/// The values in bins of equal width over the axis that the map stretches.
fn counts(histogram: &Histogram, edited: Edited<'_>) -> Vec<u64> {
    let identity = RangeMap::default();
    let axis = match edited.member.space {
        Space::Cov => DrawnAxis::Bins(&identity),
        Space::Scalar | Space::ScalarGradient | Space::ScalarCov => DrawnAxis::Values(edited.range, &identity),
    };
    let counted = match histogram {
        Histogram::One(one) => bars::columns(one, axis, BINS).counts,
        Histogram::Two(two) => bars::image(two, [axis, DrawnAxis::Bins(&identity)], [BINS, 1]).counts,
    };
    counted.into_iter().map(|count| count.round() as u64).collect()
}

fn set(session: &Session, before: &RangeMap, changed: Option<RangeMap>, actions: &mut Vec<Action>) {
    let edit = changed.filter(|changed| changed != before).and_then(|map| session.range_map_edit(map));
    actions.extend(edit.map(|edit| Action::Edit(Box::new(edit))));
}

/// The axis with marks at equal steps of the range, and the handles.
fn draw(ui: &Ui, canvas: &Canvas, map: &RangeMap) {
    let visuals = ui.visuals();
    let painter = ui.painter().with_clip_rect(canvas.rect.expand(super::canvas::MARGIN));
    let (weak, ink) = (Stroke::new(1.0, visuals.weak_text_color()), Stroke::new(1.5, visuals.text_color()));
    let middle = canvas.rect.center().y;
    painter.hline(canvas.rect.x_range(), middle, weak);
    for tenth in 0..=10 {
        let x = canvas.point([map.eval(f64::from(tenth) / 10.0), 0.0]).x;
        painter.line_segment([pos2(x, middle - 2.5), pos2(x, middle + 2.5)], weak);
    }
    for &[_, y] in map.points().get(1..map.points().len() - 1).unwrap_or_default() {
        painter.circle(pos2(canvas.point([y, 0.0]).x, middle), POINT.0, visuals.selection.bg_fill, ink);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_are_dragged_alone_or_pulled_apart() {
        let map = RangeMap::new(&[[0.4, 0.4], [0.6, 0.6]]).unwrap();
        assert_eq!(
            (nearest(&map, 0.58, 0.05), nearest(&map, 0.5, 0.05), nearest(&map, 0.01, 0.05)),
            (Some(2), None, None)
        );
        assert_eq!(dragged(&map, 2, 0.7, false).points()[2], [0.6, 0.7]);
        let apart = dragged(&map, 2, 0.7, true);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(apart.points()[1][1], 0.3) && near(apart.points()[2][1], 0.7), "{apart:?}");
        // The end of the axis stays.
        let apart = dragged(&map, 2, 0.5, true);
        assert!(near(apart.points()[2][1], 0.5) && apart.points()[3] == [1.0; 2], "{apart:?}");
        assert_eq!(widest(&RangeMap::new(&[[0.4, 0.2]]).unwrap()), 0.6);
    }
}

//! The opacity curve under the mouse: drag a point, click to add one, right-click to remove it.

use super::canvas::{Canvas, MARGIN};
use crate::transfer::{OpacityPoint, TransferFunction};
use crate::ui::window::overlay::horizontal_strip;
use crate::ui::window::widgets::{icon, number};
use crate::ui::{Action, opacity};
use eframe::egui;
use egui::{DragValue, Painter, Pos2, Rect, Stroke, Ui, pos2};

/// Height of the colours below the curve.
pub(super) const COLORS_HEIGHT: f32 = 12.0;
/// Radius of a point, and the distance within which the mouse grabs it.
pub(super) const POINT: (f32, f32) = (4.0, 9.0);

/// The point held by the mouse.
#[derive(Debug, Default)]
pub(super) struct CurveEditor {
    held: Option<usize>,
}

/// Where the curve is drawn: the value `highest` is at the top.
#[derive(Clone, Copy)]
pub(super) struct Over<'a> {
    pub(super) canvas: &'a Canvas,
    pub(super) highest: f64,
}

impl Over<'_> {
    fn on_screen(&self, point: OpacityPoint) -> Pos2 {
        self.canvas.point([point.position, point.value / self.highest])
    }

    fn on_curve(&self, at: Pos2) -> OpacityPoint {
        let [position, share] = self.canvas.position(at);
        OpacityPoint { position, value: share * self.highest }
    }

    fn nearest(&self, points: &[OpacityPoint], at: Pos2) -> Option<usize> {
        let [x, y] = self.canvas.reach(POINT.1);
        opacity::nearest(points, self.on_curve(at), self.highest, (x, y))
    }
}

impl CurveEditor {
    /// The points as edited by the mouse.
    pub(super) fn edited(
        &mut self,
        response: &egui::Response,
        over: Over<'_>,
        points: &[OpacityPoint],
    ) -> Option<Vec<OpacityPoint>> {
        let at = response.interact_pointer_pos();
        if let Some(at) = at.filter(|_| response.secondary_clicked()) {
            return over.nearest(points, at).map(|index| opacity::removed(points, index));
        }
        if let Some(at) = at.filter(|_| response.clicked()) {
            let is_new = over.nearest(points, at).is_none();
            return is_new.then(|| opacity::inserted(points, over.on_curve(at), over.highest).0);
        }
        if response.drag_started_by(egui::PointerButton::Primary) {
            let pressed = response.ctx.input(|input| input.pointer.press_origin());
            self.held = pressed.and_then(|at| over.nearest(points, at));
        }
        if !response.dragged() {
            self.held = None;
        }
        let (index, at) = (self.held?, at?);
        let moved = opacity::moved(points, index, over.on_curve(at), over.highest);
        (moved != points).then_some(moved)
    }
}

/// Draws the curve, and the colours below it.
pub(super) fn draw(
    ui: &Ui,
    painter: &Painter,
    rect: Rect,
    over: Over<'_>,
    (points, tf): (&[OpacityPoint], &TransferFunction),
) {
    let visuals = ui.visuals();
    let colors = Rect::from_min_max(
        pos2(rect.left() + MARGIN, rect.bottom() - COLORS_HEIGHT),
        pos2(rect.right() - MARGIN, rect.bottom() - 2.0),
    );
    painter.add(horizontal_strip(colors, |position| tf.color_map().eval(position)));
    let ink = Stroke::new(1.5, visuals.text_color());
    let mut line: Vec<Pos2> = points.iter().map(|&point| over.on_screen(point)).collect();
    // The curve is constant outside of its points.
    if let (Some(&first), Some(&last)) = (line.first(), line.last()) {
        line.insert(0, pos2(over.canvas.rect.left(), first.y));
        line.push(pos2(over.canvas.rect.right(), last.y));
    }
    painter.line(line, ink);
    for &point in points {
        painter.circle(over.on_screen(point), POINT.0, visuals.selection.bg_fill, ink);
    }
}

/// Position and value of each point as numbers.
pub(super) fn boxes(ui: &mut Ui, points: &[OpacityPoint], highest: f64, actions: &mut Vec<Action>) {
    egui::Grid::new("opacity points").num_columns(3).spacing([6.0, 2.0]).show(ui, |ui| {
        for (index, &point) in points.iter().enumerate() {
            let mut edited = point;
            let n = index + 1;
            let position = DragValue::new(&mut edited.position).speed(0.002).max_decimals(4);
            number(ui, position.prefix("at "), &format!("Position of opacity point {n}, as a fraction of the range"));
            let value = DragValue::new(&mut edited.value).speed(0.002 * highest).max_decimals(4);
            number(ui, value.prefix("opacity "), &format!("Opacity of point {n}"));
            if edited != point {
                actions.push(Action::Opacities(opacity::moved(points, index, edited, highest)));
            }
            if icon(ui, "×", &format!("Remove opacity point {n}"), points.len() > 1).clicked() {
                actions.push(Action::Opacities(opacity::removed(points, index)));
            }
            ui.end_row();
        }
    });
}

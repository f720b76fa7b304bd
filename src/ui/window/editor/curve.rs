//! The opacity curve under the mouse: drag a point, click to add one, right-click to remove it.

use super::overlay::horizontal_strip;
use super::widgets::number;
use crate::transfer::{MappedRange, OpacityPoint, TransferFunction};
use crate::ui::{Action, Session, opacity};
use eframe::egui;
use egui::{DragValue, Mesh, Pos2, Rect, Role, Sense, Shape, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

/// Height of the curve, and of the colours below it.
const HEIGHT: (f32, f32) = (96.0, 12.0);
/// Radius of a point, and the distance within which the mouse grabs it.
const POINT: (f32, f32) = (4.0, 9.0);

/// The editor, with the point held by the mouse.
#[derive(Debug, Default)]
pub(super) struct TransferEditor {
    held: Option<usize>,
}

/// Transforms between curve and screen.
struct Axes {
    rect: Rect,
    highest: f64,
}

impl Axes {
    fn on_screen(&self, point: OpacityPoint) -> Pos2 {
        let x = self.rect.left() + point.position as f32 * self.rect.width();
        pos2(x, self.rect.bottom() - (point.value / self.highest) as f32 * self.rect.height())
    }

    fn on_curve(&self, at: Pos2) -> OpacityPoint {
        let position = f64::from((at.x - self.rect.left()) / self.rect.width());
        OpacityPoint { position, value: f64::from((self.rect.bottom() - at.y) / self.rect.height()) * self.highest }
    }

    fn nearest(&self, points: &[OpacityPoint], at: Pos2) -> Option<usize> {
        let reach = (f64::from(POINT.1 / self.rect.width()), f64::from(POINT.1 / self.rect.height()));
        opacity::nearest(points, self.on_curve(at), self.highest, reach)
    }
}

impl TransferEditor {
    /// Shows the curve over `range`.
    pub(super) fn show(&mut self, ui: &mut Ui, session: &Session, range: &MappedRange, actions: &mut Vec<Action>) {
        let Some(tf) = session.function() else {
            ui.label(super::side::SHAPES);
            return;
        };
        let points = opacity::relative_points(tf, range);
        let size = vec2(ui.available_width(), HEIGHT.0 + HEIGHT.1);
        let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        response.widget_info(|| {
            WidgetInfo::labeled(Role::Image, true, format!("Opacity curve of {} points, edited below", points.len()))
        });
        let curve = Rect::from_min_max(rect.min, pos2(rect.right(), rect.bottom() - HEIGHT.1));
        let axes =
            Axes { rect: curve.shrink(POINT.0), highest: opacity::highest_value(tf, session.look().opacity_kind) };
        if let Some(points) = self.edited(&response, &axes, &points) {
            actions.push(Action::Opacities(points));
        }
        draw(ui, rect, &axes, &points, session, tf, range);
        ui.collapsing("Points as numbers", |ui| boxes(ui, &points, axes.highest, actions));
    }

    /// The points as edited by the mouse.
    fn edited(&mut self, response: &egui::Response, axes: &Axes, points: &[OpacityPoint]) -> Option<Vec<OpacityPoint>> {
        let at = response.interact_pointer_pos();
        if let Some(at) = at.filter(|_| response.secondary_clicked()) {
            return axes.nearest(points, at).map(|index| opacity::removed(points, index));
        }
        if let Some(at) = at.filter(|_| response.clicked()) {
            let is_new = axes.nearest(points, at).is_none();
            return is_new.then(|| opacity::inserted(points, axes.on_curve(at), axes.highest).0);
        }
        if response.drag_started_by(egui::PointerButton::Primary) {
            let pressed = response.ctx.input(|input| input.pointer.press_origin());
            self.held = pressed.and_then(|at| axes.nearest(points, at));
        }
        if !response.dragged() {
            self.held = None;
        }
        let (index, at) = (self.held?, at?);
        let moved = opacity::moved(points, index, axes.on_curve(at), axes.highest);
        (moved != points).then_some(moved)
    }
}

/// Number of bars over the shown range.
const BARS: u32 = 256;

/// Histogram of the series over the range, as bars of logarithmic height, since most volumes are mostly surroundings.
fn bars(axes: &Axes, session: &Session, range: &MappedRange, color: egui::Color32) -> Mesh {
    let mut mesh = Mesh::default();
    let position = |bar: u32| f64::from(bar) / f64::from(BARS);
    let scalars: Vec<f64> = (0..=BARS).map(|bar| range.scalar_at(position(bar))).collect();
    let counts = session.survey().histogram.between(&scalars);
    let most = counts.iter().copied().fold(0.0, f64::max);
    for (bar, &count) in (0..BARS).zip(&counts).filter(|(_, count)| **count > 0.0) {
        let x = |bar: u32| egui::lerp(axes.rect.x_range(), position(bar) as f32);
        let top = axes.rect.bottom() - (count.ln_1p() / most.ln_1p()) as f32 * axes.rect.height();
        mesh.add_colored_rect(Rect::from_min_max(pos2(x(bar), top), pos2(x(bar + 1), axes.rect.bottom())), color);
    }
    mesh
}

fn draw(
    ui: &Ui,
    rect: Rect,
    axes: &Axes,
    points: &[OpacityPoint],
    session: &Session,
    tf: &TransferFunction,
    range: &MappedRange,
) {
    let visuals = ui.visuals();
    let painter = ui.painter().with_clip_rect(rect);
    painter.rect_filled(rect, 2.0, visuals.extreme_bg_color);
    painter.add(Shape::mesh(bars(axes, session, range, visuals.weak_text_color().gamma_multiply(0.5))));
    let colors =
        Rect::from_min_max(pos2(rect.left() + POINT.0, rect.bottom() - HEIGHT.1), rect.max - vec2(POINT.0, 2.0));
    painter.add(horizontal_strip(colors, |position| tf.color_map().eval(position)));
    let ink = Stroke::new(1.5, visuals.text_color());
    let mut line: Vec<Pos2> = points.iter().map(|&point| axes.on_screen(point)).collect();
    // The curve is constant outside of its points.
    if let (Some(&first), Some(&last)) = (line.first(), line.last()) {
        line.insert(0, pos2(axes.rect.left(), first.y));
        line.push(pos2(axes.rect.right(), last.y));
    }
    painter.line(line, ink);
    for &point in points {
        painter.circle(axes.on_screen(point), POINT.0, visuals.selection.bg_fill, ink);
    }
    painter.rect_stroke(rect, 2.0, visuals.widgets.noninteractive.bg_stroke, StrokeKind::Inside);
}

/// Position and value of each point as numbers.
fn boxes(ui: &mut Ui, points: &[OpacityPoint], highest: f64, actions: &mut Vec<Action>) {
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
            if super::widgets::icon(ui, "×", &format!("Remove opacity point {n}"), points.len() > 1).clicked() {
                actions.push(Action::Opacities(opacity::removed(points, index)));
            }
            ui.end_row();
        }
    });
}

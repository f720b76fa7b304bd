//! Shapes under the mouse: drag a handle, an edge or the whole; double-click a polyline to add a point, right-click a point to remove it.

use super::Edited;
use super::canvas::Canvas;
use super::curve::POINT;
use crate::transfer::{Function, Part, Widget};
use crate::ui::Action;
use crate::ui::shapes::{self, Kind};
use crate::ui::window::widgets::{color, color_button, icon, named, number};
use eframe::egui;
use egui::epaint::Vertex;
use egui::{Button, Color32, DragValue, Key, Mesh, Painter, PointerButton, Pos2, Role, Shape, Stroke, Ui};

/// A shape held by the mouse, as it was when the drag began.
#[derive(Debug)]
struct Held {
    index: usize,
    part: Part,
    before: Widget,
    from: [f64; 2],
}

/// The shape that is selected, and the one held.
#[derive(Debug, Default)]
pub(super) struct ShapeEditor {
    selected: usize,
    held: Option<Held>,
}

/// The part at a position, of the shape that lies on top there: the selected one first.
fn hit(canvas: &Canvas, widgets: &[Widget], selected: usize, at: [f64; 2]) -> Option<(usize, Part)> {
    let found = |index: usize| Some((index, widgets.get(index)?.hit(at, canvas.reach(POINT.1))?));
    let others = (0..widgets.len()).rev().filter(|&index| index != selected);
    let all: Vec<(usize, Part)> = std::iter::once(selected).chain(others).filter_map(found).collect();
    // A handle or an edge of another shape lies over the body of the selected one.
    all.iter().find(|(_, part)| *part != Part::Body).or(all.first()).copied()
}

impl ShapeEditor {
    /// Applies what the mouse and the keyboard do to the shapes.
    pub(super) fn edit(
        &mut self,
        response: &egui::Response,
        canvas: &Canvas,
        (edited, widgets): (Edited<'_>, &[Widget]),
        actions: &mut Vec<Action>,
    ) {
        self.selected = self.selected.min(widgets.len().saturating_sub(1));
        let mut set = |index: usize, changed: Option<Widget>| {
            let changed = changed.filter(|changed| widgets.get(index).is_some_and(|widget| widget != changed));
            actions.extend(changed.map(|changed| with(edited, widgets, index, changed)));
        };
        let at = response.interact_pointer_pos().map(|at| canvas.position(at));
        if let Some(at) = at.filter(|_| response.clicked() || response.secondary_clicked()) {
            let found = hit(canvas, widgets, self.selected, at);
            self.selected = found.map_or(self.selected, |(index, _)| index);
            match found {
                Some((index, Part::Handle(handle))) if response.secondary_clicked() => {
                    set(index, shapes::without_point(&widgets[index], handle));
                }
                Some((index, Part::Edge(_) | Part::Body)) if response.double_clicked() => {
                    set(index, shapes::with_point(&widgets[index], at));
                }
                _ => {}
            }
        }
        if response.drag_started_by(PointerButton::Primary) {
            let pressed = response.ctx.input(|input| input.pointer.press_origin());
            let from = pressed.map(|at| canvas.position(at));
            let found = from.and_then(|from| Some((from, hit(canvas, widgets, self.selected, from)?)));
            self.held = found.map(|(from, (index, part))| {
                self.selected = index;
                Held { index, part, before: widgets[index].clone(), from }
            });
        }
        if !response.dragged() {
            self.held = None;
        }
        if let (Some(Held { index, part, before, from }), Some(at)) = (&self.held, at) {
            set(*index, Some(shapes::dragged(before, *part, [at[0] - from[0], at[1] - from[1]])));
        }
        let deletes = |input: &egui::InputState| input.key_pressed(Key::Delete) || input.key_pressed(Key::Backspace);
        if response.has_focus() && response.ctx.input(deletes) && !widgets.is_empty() {
            actions.push(without(edited, widgets, self.selected));
        }
    }

    /// Draws the shapes, the selected one with its handles.
    pub(super) fn draw(&self, ui: &Ui, painter: &Painter, canvas: &Canvas, widgets: &[Widget]) {
        let visuals = ui.visuals();
        for (index, widget) in widgets.iter().enumerate() {
            let is_selected = index == self.selected;
            painter.add(Shape::mesh(filled(canvas, widget)));
            let ink = Stroke::new(if is_selected { 1.5 } else { 1.0 }, visuals.text_color());
            let outline: Vec<Pos2> = widget.handles().into_iter().map(|handle| canvas.point(handle)).collect();
            match widget {
                Widget::Polyline(_) => painter.line(outline.clone(), ink),
                _ => painter.add(Shape::closed_line(outline.clone(), ink)),
            };
            if is_selected {
                for at in outline {
                    painter.circle(at, POINT.0, visuals.selection.bg_fill, ink);
                }
            }
        }
    }

    /// The menu of new shapes, and the selected one as numbers.
    pub(super) fn boxes(&mut self, ui: &mut Ui, edited: Edited<'_>, widgets: &[Widget], actions: &mut Vec<Action>) {
        let axes = edited.member.space.axes();
        ui.horizontal_wrapped(|ui| {
            ui.menu_button("Add shape", |ui| {
                for kind in Kind::ALL.into_iter().filter(|kind| kind.shape(0).suits(axes)) {
                    if ui.button(kind.name()).clicked() {
                        let all = widgets.iter().cloned().chain([kind.shape(widgets.len())]).collect();
                        actions.push(edited.with_function(Function::Widgets(all)));
                        self.selected = widgets.len();
                        ui.close();
                    }
                }
            });
            for (index, widget) in widgets.iter().enumerate() {
                let shade = color(shapes::color(widget).map(|c| c as f32));
                let text = egui::RichText::new((index + 1).to_string()).strong().color(shade);
                let response = ui.add(Button::selectable(index == self.selected, text));
                let name = format!("Shape {}: {}", index + 1, Kind::of(widget).name());
                if named(response, Role::Button, &name).clicked() {
                    self.selected = index;
                }
            }
        });
        let Some(widget) = widgets.get(self.selected) else { return };
        let changed = one(ui, widget, axes);
        let changed = changed.filter(|changed| changed != widget);
        actions.extend(changed.map(|changed| with(edited, widgets, self.selected, changed)));
        let (from, last) = (self.selected, widgets.len() - 1);
        ui.horizontal(|ui| {
            if ui.button("Remove shape").on_hover_text("Delete, while the histogram has the focus").clicked() {
                actions.push(without(edited, widgets, from));
            }
            let places = [
                ("up", "Move the shape up", from.checked_sub(1)),
                ("down", "Move the shape down", (from < last).then_some(from + 1)),
            ];
            let hint = "Where shapes are equally opaque the last one shows";
            for (text, name, to) in places {
                if icon(ui, text, name, to.is_some()).on_hover_text(hint).clicked()
                    && let Some(to) = to
                {
                    let mut all = widgets.to_vec();
                    all.swap(from, to);
                    actions.push(edited.with_function(Function::Widgets(all)));
                    self.selected = to;
                }
            }
        });
    }
}

/// The boxes of a shape; returns another one that was made with them.
fn one(ui: &mut Ui, widget: &Widget, axes: usize) -> Option<Widget> {
    let mut changed = None;
    let as_points = matches!(widget, Widget::Polyline(_));
    ui.horizontal_wrapped(|ui| {
        let before = shapes::color(widget).map(|c| c as f32);
        let rgb = color_button(ui, before, "Colour of the shape");
        changed = rgb.map(|rgb| shapes::with_color(widget, None, unit(rgb))).or(changed.take());
        let opacities = if as_points { Vec::new() } else { shapes::opacities(widget) };
        for (index, (name, opacity)) in opacities.into_iter().enumerate() {
            let mut value = opacity;
            let drag = DragValue::new(&mut value).speed(0.002).range(0.0..=1.0).max_decimals(4);
            number(ui, drag, &format!("Shape: {name}"));
            if value != opacity {
                changed = Some(shapes::with_opacity(widget, index, value));
            }
        }
    });
    egui::Grid::new("handles").num_columns(4).spacing([6.0, 2.0]).show(ui, |ui| {
        for (index, handle) in widget.handles().into_iter().enumerate() {
            let n = index + 1;
            let mut to = handle;
            let names = [format!("Across, handle {n}"), format!("Up, handle {n}")];
            let count = if axes == 1 && !as_points { 1 } else { 2 };
            for (c, name) in names.iter().enumerate().take(count) {
                let drag = DragValue::new(&mut to[c]).speed(0.002).range(0.0..=1.0).max_decimals(4);
                number(ui, drag, name);
            }
            if to != handle {
                changed = Some(widget.moved(index, to));
            }
            if let Widget::Polyline(polyline) = widget
                && let Some(point) = polyline.points.get(index)
            {
                let rgb = color_button(ui, point.rgb.map(|c| c as f32), &format!("Colour of point {n}"));
                changed = rgb.map(|rgb| shapes::with_color(widget, Some(index), unit(rgb))).or(changed.take());
                if icon(ui, "×", &format!("Remove point {n}"), polyline.points.len() > 2).clicked() {
                    changed = shapes::without_point(widget, index).or(changed.take());
                }
            }
            ui.end_row();
        }
    });
    changed
}

/// A colour of 0..=255 as one of 0..=1.
fn unit(rgb: [u8; 3]) -> [f64; 3] {
    rgb.map(|c| f64::from(c) / 255.0)
}

fn with(edited: Edited<'_>, widgets: &[Widget], index: usize, changed: Widget) -> Action {
    let replaced = |(i, widget): (usize, &Widget)| if i == index { changed.clone() } else { widget.clone() };
    edited.with_function(Function::Widgets(widgets.iter().enumerate().map(replaced).collect()))
}

fn without(edited: Edited<'_>, widgets: &[Widget], index: usize) -> Action {
    let others = widgets.iter().enumerate().filter(|(i, _)| *i != index);
    edited.with_function(Function::Widgets(others.map(|(_, widget)| widget.clone()).collect()))
}

/// The inside of a shape, as opaque as it is, but seen in any case.
fn filled(canvas: &Canvas, widget: &Widget) -> Mesh {
    let shade = |rgb: [f64; 3], opacity: f64| color(rgb.map(|c| c as f32)).gamma_multiply(0.15 + 0.65 * opacity as f32);
    let mut mesh = Mesh::default();
    let mut fan = |corners: &[([f64; 2], Color32)]| {
        let first = mesh.vertices.len() as u32;
        let vertex =
            |&(at, color): &([f64; 2], Color32)| Vertex { pos: canvas.point(at), uv: egui::epaint::WHITE_UV, color };
        mesh.vertices.extend(corners.iter().map(vertex));
        (2..corners.len() as u32).for_each(|i| mesh.add_triangle(first, first + i - 1, first + i));
    };
    match widget {
        Widget::Rectangle(shape) => {
            let [left, right] = shape.opacity.map(|opacity| shade(shape.rgb, opacity));
            let ([x0, x1], [y0, y1]) = (shape.x, shape.y);
            fan(&[([x0, y0], left), ([x1, y0], right), ([x1, y1], right), ([x0, y1], left)]);
        }
        Widget::Triangle(shape) => {
            let color = shade(shape.rgb, shape.opacity);
            fan(&[(shape.base, color), ([shape.right, shape.top], color), ([shape.left, shape.top], color)]);
        }
        Widget::TriangleWithFallOff(shape) => {
            let [side, middle] = [0.0, shape.opacity].map(|opacity| shade(shape.rgb, opacity));
            let center = ([0.5 * (shape.left + shape.right), shape.top], middle);
            fan(&[(shape.base, middle), ([shape.right, shape.top], side), center]);
            fan(&[(shape.base, middle), center, ([shape.left, shape.top], side)]);
        }
        Widget::Polyline(shape) => {
            for pair in shape.points.windows(2) {
                let [a, b] =
                    [pair[0], pair[1]].map(|point| (point.position, point.opacity, shade(point.rgb, point.opacity)));
                fan(&[([a.0, 0.0], a.2), ([b.0, 0.0], b.2), ([b.0, b.1], b.2), ([a.0, a.1], a.2)]);
            }
        }
    }
    mesh
}

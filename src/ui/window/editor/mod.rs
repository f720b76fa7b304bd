//! The editor of the member that is edited: its curve or shapes over a histogram, and its range map.
//!
//! Positions on the axes are 0..=1, from left to right and upwards, as in [`Member`]. Widgets show the session's state and make actions; what
//! is kept here is what the mouse holds and what is selected.

mod canvas;
mod curve;
mod range_map;
mod shapes;

use super::overlay;
use super::widgets::{chosen, number};
use crate::project::Edit;
use crate::transfer::{Function, MappedRange, Member, OpacityKind, RangeMap, Space, Widget};
use crate::ui::{Action, Session, members, opacity};
use canvas::{Canvas, HistogramPicture, Scales};
use eframe::egui;
use egui::{DragValue, Role, Sense, Ui, WidgetInfo, vec2};

/// Heights of the picture over one axis and over two, points.
const HEIGHTS: [f32; 2] = [96.0, 160.0];

/// The editor.
#[derive(Default)]
pub(super) struct Editor {
    curve: curve::CurveEditor,
    shapes: shapes::ShapeEditor,
    map: range_map::MapEditor,
    picture: HistogramPicture,
    /// Whether the histogram is that of the step shown.
    is_of_step: bool,
    /// The histogram that is looked at.
    wanted: Option<(Space, bool)>,
}

/// The edited member as it is on the screen.
#[derive(Clone, Copy)]
struct Edited<'a> {
    session: &'a Session,
    place: members::Place,
    member: &'a Member,
    range: &'a MappedRange,
    map: &'a RangeMap,
}

impl Edited<'_> {
    /// The change that gives the member another function.
    fn with_function(&self, function: Function) -> Action {
        let (ensemble, index) = self.place;
        let member = Box::new(Member { function, ..self.member.clone() });
        Action::Edit(Box::new(Edit::SetMember { ensemble, index, member }))
    }
}

/// What opacities mean, and the length that they refer to.
fn units(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let look = session.look();
    let kinds = [(OpacityKind::Alpha, "opacities"), (OpacityKind::Extinction, "optical depths")];
    actions.extend(chosen(ui, "Kind of opacity", look.opacity_kind, &kinds).map(Action::OpacityKind));
    let before = look.lengths.unit_distance;
    let mut distance = before;
    ui.horizontal(|ui| {
        let drag = DragValue::new(&mut distance).speed(before / 100.0).custom_formatter(|x, _| overlay::number(x));
        number(ui, drag, "Unit distance: the length that opacities refer to");
        ui.label("unit distance");
    });
    if distance != before {
        actions.push(Action::UnitDistance(distance));
    }
}

impl Editor {
    /// The histogram that was looked at since the last call: its axes, and whether it is that of the step shown.
    pub(super) fn take_wanted(&mut self) -> Option<(Space, bool)> {
        self.wanted.take()
    }

    /// Shows the editor.
    pub(super) fn show(&mut self, ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
        let (Some(place), Some(member), Some(range)) =
            (session.edited_member(), session.member(), session.shown_range())
        else {
            ui.label("no values");
            return;
        };
        let map = session.range_map();
        let edited = Edited { session, place, member, range: &range, map: &map };
        self.wanted = Some((member.space, self.is_of_step));
        ui.horizontal_wrapped(|ui| {
            // Both choices in one row.
            ui.spacing_mut().combo_width = 0.0;
            self.kind(ui, edited, actions);
            let steps = [(false, "all steps"), (true, "step shown")];
            if let Some(is_of_step) = chosen(ui, "Histogram", self.is_of_step, &steps) {
                self.is_of_step = is_of_step;
            }
        });
        self.picture(ui, edited, actions);
        match &member.function {
            Function::TransferFunction(tf) => {
                let points = opacity::relative_points(tf, &range);
                let highest = opacity::highest_value(tf, session.look().opacity_kind);
                ui.collapsing("Points as numbers", |ui| curve::boxes(ui, &points, highest, actions));
            }
            Function::Widgets(widgets) => self.shapes.boxes(ui, edited, widgets, actions),
        }
        egui::CollapsingHeader::new("Axis and units").show(ui, |ui| {
            self.map.boxes(ui, edited, actions);
            units(ui, session, actions);
        });
    }

    /// The choice between a curve and shapes.
    fn kind(&self, ui: &mut Ui, edited: Edited<'_>, actions: &mut Vec<Action>) {
        if edited.member.space.axes() == 2 {
            ui.label("shapes over");
            return;
        }
        let has_shapes = matches!(edited.member.function, Function::Widgets(_));
        let kinds = [(false, "a curve over"), (true, "shapes over")];
        if chosen(ui, "Curve or shapes", has_shapes, &kinds).is_none() {
            return;
        }
        let function = match &edited.member.function {
            Function::TransferFunction(tf) => members::as_polyline(tf, edited.range),
            Function::Widgets(widgets) => {
                let polyline = match widgets.as_slice() {
                    [Widget::Polyline(polyline)] => members::as_curve(polyline),
                    _ => None,
                };
                Function::TransferFunction(polyline.unwrap_or_else(|| edited.session.look().tf.clone()))
            }
        };
        actions.push(edited.with_function(function));
    }

    /// The histogram with the curve or shapes over it, and the range map below it.
    fn picture(&mut self, ui: &mut Ui, edited: Edited<'_>, actions: &mut Vec<Action>) {
        let Edited { session, member, .. } = edited;
        let axes = member.space.axes();
        let colors_height = match &member.function {
            Function::TransferFunction(_) => curve::COLORS_HEIGHT,
            Function::Widgets(_) => 0.0,
        };
        let size = vec2(ui.available_width(), HEIGHTS[axes - 1] + colors_height);
        let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        let canvas = Canvas::in_rect(rect.with_max_y(rect.bottom() - colors_height));
        let painter = ui.painter().with_clip_rect(rect);
        painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
        let histogram = session.histogram().filter(|shown| shown.kind == member.space);
        let scales = Scales { range: edited.range, map: edited.map };
        if let Some(histogram) = histogram {
            self.picture.paint(ui, &painter, &canvas, (histogram, scales));
        }
        let name = match &member.function {
            Function::TransferFunction(tf) => {
                let points = opacity::relative_points(tf, edited.range);
                let highest = opacity::highest_value(tf, session.look().opacity_kind);
                let over = curve::Over { canvas: &canvas, highest };
                if let Some(points) = self.curve.edited(&response, over, &points) {
                    actions.push(Action::Opacities(points));
                }
                curve::draw(ui, &painter, rect, over, (&points, tf));
                format!("Opacity curve of {} points, edited below", points.len())
            }
            Function::Widgets(widgets) => {
                self.shapes.edit(&response, &canvas, (edited, widgets), actions);
                self.shapes.draw(ui, &painter, &canvas, widgets);
                format!("{} shapes over a histogram, edited below", widgets.len())
            }
        };
        painter.rect_stroke(rect, 2.0, ui.visuals().widgets.noninteractive.bg_stroke, egui::StrokeKind::Inside);
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &name));
        let under = response.hover_pos().filter(|at| canvas.rect.contains(*at)).map(|at| canvas.position(at));
        let (strip, map_response) =
            ui.allocate_exact_size(vec2(ui.available_width(), range_map::HEIGHT), Sense::click_and_drag());
        let map_strip = Canvas::in_rect(strip);
        self.map.strip(ui, &map_response, &map_strip, edited, actions);
        let text = match under {
            Some(at) => canvas::values_at(at, histogram.map(AsRef::as_ref), scales, member.space),
            None => canvas::status(session, histogram.map(AsRef::as_ref)),
        };
        // One line, always there: the panel does not move under the mouse.
        ui.add(egui::Label::new(egui::RichText::new(text).small()).truncate());
    }
}

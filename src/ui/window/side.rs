//! The side panel: controls of data and look.

use super::beside::{self, BesidePanel};
use super::cameras::CameraMenu;
use super::editor::Editor;
use super::function_file::FunctionMenu;
use super::members::Members;
use super::overlay::{self, Overlays, horizontal_strip};
use super::path_field::OpenDialog;
use super::project::{self, ProjectMenu};
use super::welcome::{self, PathBox, Wish};
use super::widgets::{chosen, color_button, icon, number, staying_menu, within_width};
use super::{flow, point, statistics, surfaces};
use crate::camera::{Axis, Projection};
use crate::optics::OpticsKind;
use crate::pipeline::{Backend, RenderMode, Representation};
use crate::render::points::{Compositing, Footprint, PointStyle};
use crate::transfer::{ColorMap, MappedRange, RangePolicy, Space};
use crate::ui::settings::{RecentFile, Settings};
use crate::ui::views::Views;
use crate::ui::{Action, CameraTurn, IMAGE_SCALES, Session};
use eframe::egui;
use egui::collapsing_header::CollapsingState;
use egui::{CollapsingHeader, DragValue, Role, Sense, Ui, WidgetInfo, vec2};
use std::collections::BTreeMap;

/// Default width of the panel, points.
pub(super) const WIDTH: f32 = 250.0;

/// State of the panel itself.
pub(super) struct Side {
    editor: Editor,
    function: FunctionMenu,
    members: Members,
    project: ProjectMenu,
    cameras: CameraMenu,
    beside: BesidePanel,
    /// Whether there was flow when the panel was shown last.
    has_flow: bool,
}

impl Side {
    pub(super) fn new(open: &OpenDialog) -> Self {
        Self {
            editor: Editor::default(),
            function: FunctionMenu::new(open),
            members: Members::default(),
            project: ProjectMenu::new(open),
            cameras: CameraMenu::default(),
            beside: BesidePanel::new(open),
            has_flow: false,
        }
    }

    /// Opens other files, saves the project and undoes changes: above the panel's other parts.
    pub(super) fn files(
        &mut self,
        ui: &mut Ui,
        (path_box, recent): (&mut PathBox, &[RecentFile]),
        session: &Session,
        actions: &mut Vec<Action>,
    ) -> Option<Wish> {
        ui.add_space(4.0);
        let row = ui.horizontal(|ui| {
            let wish = open(ui, path_box, recent);
            self.project.show(ui, session, actions);
            wish
        });
        row.inner
    }

    /// The histogram that was looked at since the last call: its axes, and whether it is that of the step shown.
    pub(super) fn take_histogram(&mut self) -> Option<(Space, bool)> {
        self.editor.take_wanted()
    }

    /// The difference of two views to be painted, if it is shown and known.
    pub(super) fn difference_of(&mut self, ctx: &egui::Context, views: &Views) -> Option<beside::Shown> {
        self.beside.difference_of(ctx, views)
    }

    /// Shows the panel; returns what the user wants to open.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        views: &Views,
        overlays: &mut Overlays,
        settings: &mut Settings,
        actions: &mut Vec<Action>,
    ) -> Option<Wish> {
        let (session, mut wish) = (views.active(), None);
        let has_flow = session.look().flow.is_some();
        let Settings { open_sections, recent, .. } = settings;
        // The bar has its own room: widgets under it could not be dragged.
        let scroll = &mut ui.spacing_mut().scroll;
        scroll.floating_allocated_width = scroll.bar_width + scroll.bar_inner_margin;
        egui::ScrollArea::vertical().auto_shrink([false, true]).show(ui, |ui| {
            within_width(ui, |ui| {
                let mut header = |ui: &mut Ui, title: &str, is_open: bool, show: &mut dyn FnMut(&mut Ui)| {
                    section(ui, title, (is_open, None), open_sections, show);
                };
                header(ui, "Field", true, &mut |ui| field(ui, session, actions));
                header(ui, "Project", project::says_more(session), &mut |ui| {
                    project::show(ui, session, &mut self.members, actions);
                });
                header(ui, "Colours", true, &mut |ui| {
                    colors(ui, session, &mut self.function, actions);
                });
                header(ui, "Opacity", true, &mut |ui| self.editor.show(ui, session, actions));
                header(ui, "View", true, &mut |ui| view(ui, session, (overlays, &mut self.cameras), actions));
                // A view, or flow, that has come has its controls.
                let opens = self.beside.is_new(views).then_some(true);
                section(ui, "Second view", (false, opens), open_sections, &mut |ui| {
                    wish = self.beside.show(ui, views, recent, actions).or(wish.take());
                });
                let opens = (!std::mem::replace(&mut self.has_flow, has_flow) && has_flow).then_some(true);
                section(ui, "Flow", (has_flow, opens), open_sections, &mut |ui| flow::show(ui, session, actions));
                let mut header = |ui: &mut Ui, title: &str, is_open: bool, show: &mut dyn FnMut(&mut Ui)| {
                    section(ui, title, (is_open, None), open_sections, show);
                };
                header(ui, "Surfaces", true, &mut |ui| surfaces::show(ui, session, actions));
                header(ui, "Point", true, &mut |ui| point::show(ui, session, actions));
                header(ui, "Picture", true, &mut |ui| picture(ui, session, actions));
                header(ui, "Statistics", true, &mut |ui| statistics::show(ui, session));
            })
        });
        wish
    }
}

/// A part of the panel that opens and closes by its title: open at first or not, and now in any case or as it is. What the user chose is
/// remembered.
fn section(
    ui: &mut Ui,
    title: &str,
    (is_open, now): (bool, Option<bool>),
    chosen: &mut BTreeMap<String, bool>,
    show: &mut dyn FnMut(&mut Ui),
) {
    let is_open = chosen.get(title).copied().unwrap_or(is_open);
    let shown = CollapsingHeader::new(title).default_open(is_open).open(now).show(ui, |ui| show(ui));
    if shown.header_response.clicked()
        && let Some(state) = CollapsingState::load(ui.ctx(), shown.header_response.id)
    {
        chosen.insert(title.to_owned(), state.is_open());
    }
}

/// The menu that opens other files.
fn open(ui: &mut Ui, path_box: &mut PathBox, recent: &[RecentFile]) -> Option<Wish> {
    let mut wanted = path_box.take_chosen();
    staying_menu(ui, "Open...", |ui| {
        ui.label("Drop a file on the window, or name one:");
        wanted = path_box.show(ui).or(wanted.take());
        if !recent.is_empty() {
            ui.separator();
            ui.label("Opened before:");
            wanted = welcome::recent(ui, recent).or(wanted.take());
        }
        if wanted.is_some() {
            ui.close();
        }
    });
    wanted.map(|path| Wish::Open(vec![path]))
}

fn field(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let shown = session.series().field();
    let names: Vec<&str> = session.store().fields().iter().map(|field| field.name.as_str()).collect();
    let options: Vec<(&str, &str)> = names.iter().map(|&name| (name, name)).collect();
    let name = chosen(ui, "Field to show", shown.name.as_str(), &options);
    actions.extend(name.and_then(|name| name.parse().ok()).map(Action::Field));
    if session.opens_field() {
        ui.label("opening the field");
    }
    let response = ui.label(overlay::quality(shown));
    let (_, notes) = session.store().origin();
    if !notes.is_empty() {
        response.on_hover_text(format!("Notes of the import:\n{}", notes.join("\n")));
    }
}

/// Kinds of optics, with their texts.
pub(super) const OPTICS: [(OpticsKind, &str); 3] = [
    (OpticsKind::Exact, "exact optics"),
    (OpticsKind::Partial, "partial pre-integration"),
    (OpticsKind::Table3d, "pre-integrated table"),
];

const FOOTPRINTS: [(Footprint, &str); 4] = [
    (Footprint::Exact, "the cell's own shape"),
    (Footprint::Ellipse, "ellipses"),
    (Footprint::Circle, "circles"),
    (Footprint::Square, "squares"),
];

const COMPOSITING: [(Compositing, &str); 2] =
    [(Compositing::Own, "each cell by itself"), (Compositing::Gap, "gaps between points")];

fn colors(ui: &mut Ui, session: &Session, menu: &mut FunctionMenu, actions: &mut Vec<Action>) {
    match session.function() {
        Some(tf) => color_map(ui, tf.color_map(), menu, actions),
        None => drop(ui.horizontal(|ui| {
            ui.label("each shape has its own");
            menu.show(ui, actions);
        })),
    }
    if let (Some(member), Some(range)) = (session.member(), session.shown_range()) {
        range_of_colors(ui, session, (member.range, &range), actions);
    }
}

fn color_map(ui: &mut Ui, map: &ColorMap, menu: &mut FunctionMenu, actions: &mut Vec<Action>) {
    let combo = egui::ComboBox::from_id_salt("colour map").selected_text(map.name()).width(WIDTH - 90.0);
    let name = map.name().to_owned();
    let response = combo.show_ui(ui, |ui| {
        for map in ColorMap::built_in_names().filter_map(ColorMap::built_in) {
            ui.horizontal(|ui| {
                preview(ui, map, vec2(80.0, 14.0));
                if ui.selectable_label(map.name() == name, map.name()).clicked() {
                    actions.push(Action::Colors(map.clone()));
                    ui.close();
                }
            });
        }
    });
    response.response.widget_info(|| {
        let mut info = WidgetInfo::labeled(Role::ComboBox, true, "Colour map");
        info.current_text_value = Some(name.clone());
        info
    });
    preview(ui, map, vec2(ui.available_width(), 14.0));
    let mut is_reversed = map.name().ends_with("_r");
    ui.horizontal(|ui| {
        if ui.checkbox(&mut is_reversed, "reversed").clicked() {
            actions.push(Action::Colors(map.reversed()));
        }
        menu.show(ui, actions);
    });
}

/// The colours of a map from left to right.
fn preview(ui: &mut Ui, map: &ColorMap, size: egui::Vec2) {
    let (rect, response) = ui.allocate_exact_size(size, Sense::hover());
    ui.painter().add(horizontal_strip(rect, |position| map.eval(position)));
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, format!("Colours of {}", map.name())));
}

/// How the range is found, and its ends as they are on the screen.
fn range_of_colors(
    ui: &mut Ui,
    session: &Session,
    (policy, range): (RangePolicy, &MappedRange),
    actions: &mut Vec<Action>,
) {
    let (lo, hi) = (range.lo(), range.hi());
    let (least, greatest) = match policy {
        RangePolicy::Percentile(from, to) | RangePolicy::SymmetricPercentile(from, to) => (from, to),
        _ => RangePolicy::PERCENTILES,
    };
    // Where the policy has numbers, its option has the same ones: the shown range is that of the policy.
    let mut policies = vec![
        (RangePolicy::Series, "range of all steps"),
        (RangePolicy::Step, "range of each step"),
        (RangePolicy::Manual(lo, hi), "fixed range"),
        (RangePolicy::Symmetric, "symmetric about 0"),
        (RangePolicy::Percentile(least, greatest), "1st to 99th percentile"),
        (RangePolicy::SymmetricPercentile(least, greatest), "percentiles, symmetric"),
    ];
    // A logarithm needs positive values.
    if session.series().field().range.is_some_and(|[_, hi]| hi > 0.0) {
        policies.push((RangePolicy::Log, "logarithmic"));
    }
    if lo > 0.0 {
        policies.push((RangePolicy::LogManual(lo, hi), "fixed, logarithmic"));
    }
    actions.extend(chosen(ui, "Range of the colours", policy, &policies).map(Action::Range));
    if policy.has_percentiles() {
        let is_from_least = matches!(policy, RangePolicy::Percentile(..));
        let all = if is_from_least { RangePolicy::Series } else { RangePolicy::Symmetric };
        let hint = "A few values lie beyond the colours and have those of the ends";
        if ui.button("All values").on_hover_text(hint).clicked() {
            actions.push(Action::Range(all));
        }
    }
    let (mut from, mut to) = (lo, hi);
    ui.horizontal(|ui| {
        let speed = (hi - lo) / 500.0;
        let end = |x| DragValue::new(x).speed(speed).custom_formatter(|x, _| overlay::number(x));
        number(ui, end(&mut from), "Lower end of the range");
        ui.label("to");
        number(ui, end(&mut to), "Upper end of the range");
    });
    // Invalid ends are not applied.
    let is_log = range.is_log();
    if (from, to) != (lo, hi) && MappedRange::new(from, to, is_log).is_ok() {
        actions.push(Action::Range(match is_log {
            true => RangePolicy::LogManual(from, to),
            false => RangePolicy::Manual(from, to),
        }));
    }
}

fn view(
    ui: &mut Ui,
    session: &Session,
    (overlays, cameras): (&mut Overlays, &mut CameraMenu),
    actions: &mut Vec<Action>,
) {
    ui.horizontal(|ui| {
        if ui.button("Whole mesh").on_hover_text("R").clicked() {
            actions.push(Action::ResetView);
        }
        cameras.show(ui, session, actions);
    });
    ui.horizontal(|ui| {
        let [back, on] = session.camera_turns();
        if icon(ui, "<", "The view before the last movement (Backspace)", back > 0).clicked() {
            actions.push(Action::TurnCamera(CameraTurn::Back));
        }
        if icon(ui, ">", "On to the view after it (Shift Backspace)", on > 0).clicked() {
            actions.push(Action::TurnCamera(CameraTurn::On));
        }
        ui.label("last movement");
    });
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        for (axis, name) in [(Axis::X, "x"), (Axis::Y, "y"), (Axis::Z, "z")] {
            for (from_positive, sign) in [(false, '+'), (true, '-')] {
                let hint = format!("Look towards {sign}{name}");
                if ui.button(format!("{sign}{name}")).on_hover_text(hint).clicked() {
                    actions.push(Action::ViewAlong { axis, from_positive });
                }
            }
        }
    });
    let mut is_parallel = matches!(session.camera().projection, Projection::Parallel { .. });
    if ui.checkbox(&mut is_parallel, "parallel projection").on_hover_text("V").clicked() {
        actions.push(Action::OtherProjection);
    }
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut overlays.axes, "axes").on_hover_text("Which way x, y and z go");
        ui.checkbox(&mut overlays.bounding_box, "box").on_hover_text("The box of the mesh");
        ui.checkbox(&mut overlays.legend, "legend").on_hover_text("What the colours mean");
    });
}

fn picture(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        let rgb = color_button(ui, session.background(), "Background");
        actions.extend(rgb.map(|rgb| Action::Background(rgb.map(|c| f32::from(c) / 255.0))));
        ui.label("background");
    });
    let before = session.image_scale();
    let mut scale = before;
    ui.horizontal(|ui| {
        let value = DragValue::new(&mut scale).range(IMAGE_SCALES).speed(0.01).max_decimals(2);
        number(ui, value.prefix("x "), "Image scale: pixels of the image per pixel of the screen");
        ui.label("image scale");
    });
    if scale != before {
        actions.push(Action::ImageScale(scale));
    }
    let backends = [(Backend::Auto, "GPU if there is one"), (Backend::Cpu, "CPU"), (Backend::Gpu, "GPU")];
    actions.extend(chosen(ui, "Backend", session.look().backend, &backends).map(Action::Backend));
    let modes = [
        (RenderMode::Auto, "best renderer"),
        (RenderMode::Raycast, "ray caster"),
        (RenderMode::Havs, "faces"),
        (RenderMode::Points, "cells as points"),
        (RenderMode::Sheets, "functions on sheets"),
        (RenderMode::Reference, "reference (float64, slow)"),
    ];
    actions.extend(chosen(ui, "Renderer", session.look().mode, &modes).map(Action::Renderer));
    if session.look().mode == RenderMode::Reference {
        let of = [(Representation::Cells, "of cells"), (Representation::Vertices, "of functions at the vertices")];
        actions.extend(chosen(ui, "Representation", session.look().representation, &of).map(Action::Representation));
    }
    if session.look().mode == RenderMode::Points {
        points(ui, session.look().points, actions);
    }
    actions.extend(chosen(ui, "Optics", session.look().optics, &OPTICS).map(Action::Optics));
}

/// How cells are drawn as points.
fn points(ui: &mut Ui, before: PointStyle, actions: &mut Vec<Action>) {
    let mut style = before;
    style.footprint = chosen(ui, "Footprint", style.footprint, &FOOTPRINTS).unwrap_or(style.footprint);
    style.compositing = chosen(ui, "Compositing", style.compositing, &COMPOSITING).unwrap_or(style.compositing);
    ui.horizontal(|ui| {
        let is_scaled = style.footprint != Footprint::Exact;
        let value = DragValue::new(&mut style.radius).range(0.01..=PointStyle::MOST_RADIUS).speed(0.01).max_decimals(2);
        ui.add_enabled_ui(is_scaled, |ui| {
            number(ui, value.prefix("x "), "Radius of points: scale of all footprints but the cell's own shape");
            ui.label("radius");
        });
    });
    ui.checkbox(&mut style.exact_order, "exact order")
        .on_hover_text("Sorts what a ray meets; else it is in the order of the cells' centres");
    if style != before {
        actions.push(Action::Points(style));
    }
}

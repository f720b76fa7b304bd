//! Small parts of the window.

use eframe::egui;
use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Color32, Response, Role, Ui, WidgetInfo, WidgetText};

/// A display-referred colour.
pub(super) fn color(rgb: [f32; 3]) -> Color32 {
    let [r, g, b] = rgb.map(|c| (c * 255.0).round() as u8);
    Color32::from_rgb(r, g, b)
}

/// A button with an icon, named `name`.
pub(super) fn icon(ui: &mut Ui, symbol: &str, name: &str, enabled: bool) -> Response {
    let response = ui.add_enabled(enabled, egui::Button::new(symbol).min_size(egui::vec2(26.0, 22.0)));
    named(response, Role::Button, name)
}

/// A toggle button.
pub(super) fn toggle(ui: &mut Ui, symbol: &str, name: &str, is_on: bool) -> Response {
    let response = ui.add(egui::Button::selectable(is_on, symbol).min_size(egui::vec2(26.0, 22.0)));
    response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_on, name));
    response.on_hover_text(name)
}

/// Names a widget, for screen readers and as a tooltip.
pub(super) fn named(response: Response, role: Role, name: &str) -> Response {
    response.widget_info(|| WidgetInfo::labeled(role, response.enabled(), name));
    response.on_hover_text(name).on_disabled_hover_text(name)
}

/// Names a widget for screen readers only.
pub(super) fn labelled(response: Response, name: &str) -> Response {
    response.ctx.accesskit_node_builder(response.id, |node| node.set_label(name));
    response
}

/// A button that opens a menu, which stays open when something in it is clicked or typed; returns the button.
pub(super) fn staying_menu(ui: &mut Ui, text: impl Into<WidgetText>, content: impl FnOnce(&mut Ui)) -> Response {
    let stays = MenuConfig::new().close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside);
    MenuButton::new(text.into()).config(stays).ui(ui, content).0
}

/// A number box, named `name`.
pub(super) fn number(ui: &mut Ui, value: egui::DragValue<'_>, name: &str) -> Response {
    labelled(ui.add(value), name).on_hover_text(name)
}

/// A button to choose a colour, named `name`; returns another one that was chosen.
pub(super) fn color_button(ui: &mut Ui, before: [f32; 3], name: &str) -> Option<[u8; 3]> {
    let [r, g, b, _] = color(before).to_array();
    let mut rgb = [r, g, b];
    labelled(ui.color_edit_button_srgb(&mut rgb), name);
    (rgb != [r, g, b]).then_some(rgb)
}

/// A number box of this width, whatever its digits.
pub(super) fn wide_number(ui: &mut Ui, width: f32, value: egui::DragValue<'_>, name: &str) -> Response {
    let height = ui.spacing().interact_size.y;
    labelled(ui.add_sized([width, height], value), name).on_hover_text(name)
}

/// A choice of one of several; returns whether it changed.
pub(super) fn choice<T: Copy + PartialEq>(ui: &mut Ui, name: &str, value: &mut T, options: &[(T, &str)]) -> bool {
    let before = *value;
    let text = options.iter().find(|(option, _)| option == value).map_or("", |(_, text)| *text);
    let combo = egui::ComboBox::from_id_salt(name).selected_text(text).truncate();
    let response = combo.show_ui(ui, |ui| {
        for (option, text) in options {
            ui.selectable_value(value, *option, *text);
        }
    });
    response.response.widget_info(|| {
        let mut info = WidgetInfo::labeled(Role::ComboBox, true, name);
        info.current_text_value = Some(text.to_owned());
        info
    });
    response.response.on_hover_text(name);
    *value != before
}

/// As [`choice`]; returns another value that was chosen.
pub(super) fn chosen<T: Copy + PartialEq>(ui: &mut Ui, name: &str, mut value: T, options: &[(T, &str)]) -> Option<T> {
    choice(ui, name, &mut value, options).then_some(value)
}

/// A symbol on a button of the player.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Symbol {
    First,
    StepBack,
    Backwards,
    Stop,
    Pause,
    Play,
    StepOn,
    Last,
}

impl Symbol {
    /// Convex polygons in a square from -1 to 1, y downwards.
    fn polygons(self) -> Vec<Vec<[f32; 2]>> {
        let bar = |x: f32| vec![[x - 0.17, -0.8], [x + 0.17, -0.8], [x + 0.17, 0.8], [x - 0.17, 0.8]];
        let forwards = |x: f32| vec![[x - 0.6, -0.8], [x + 0.7, 0.0], [x - 0.6, 0.8]];
        let backwards = |x: f32| vec![[x + 0.6, -0.8], [x + 0.6, 0.8], [x - 0.7, 0.0]];
        match self {
            Self::First => vec![bar(-0.8), backwards(0.15)],
            Self::StepBack => vec![backwards(-0.15), bar(0.8)],
            Self::Backwards => vec![backwards(0.0)],
            Self::Stop => vec![vec![[-0.7, -0.7], [0.7, -0.7], [0.7, 0.7], [-0.7, 0.7]]],
            Self::Pause => vec![bar(-0.4), bar(0.4)],
            Self::Play => vec![forwards(0.0)],
            Self::StepOn => vec![bar(-0.8), forwards(0.15)],
            Self::Last => vec![forwards(-0.15), bar(0.8)],
        }
    }
}

/// A button with a symbol, named `name`.
pub(super) fn symbol(ui: &mut Ui, symbol: Symbol, name: &str, is_on: bool) -> Response {
    let response = ui.add(egui::Button::selectable(is_on, "").min_size(egui::vec2(28.0, 22.0)).frame(true));
    let (color, center) = (ui.style().interact_selectable(&response, is_on).text_color(), response.rect.center());
    for polygon in symbol.polygons() {
        let points = polygon.into_iter().map(|[x, y]| center + 6.0 * egui::vec2(x, y)).collect();
        ui.painter().add(egui::Shape::convex_polygon(points, color, egui::Stroke::NONE));
    }
    response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_on, name));
    response.on_hover_text(name)
}

/// Lays out widgets in the available width; wider ones are cut off. Otherwise a panel grows with its content, and the picture beside it
/// changes its size.
pub(super) fn within_width(ui: &mut Ui, show: impl FnOnce(&mut Ui)) {
    let room = ui.available_rect_before_wrap();
    let mut part = ui.new_child(egui::UiBuilder::new().max_rect(room));
    let seen = egui::Rect::from_x_y_ranges(room.x_range(), ui.clip_rect().y_range());
    part.shrink_clip_rect(seen);
    show(&mut part);
    ui.advance_cursor_after_rect(part.min_rect().with_max_x(room.right()).with_min_x(room.left()));
}

/// A plot that ignores the mouse.
pub(super) fn still_plot<'a>(id: &str) -> egui_plot::Plot<'a> {
    egui_plot::Plot::new(id)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_double_click_reset(false)
        .allow_axis_zoom_drag(false)
}

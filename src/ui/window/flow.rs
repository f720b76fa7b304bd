//! Flow: vectors, pattern, splats and colours.

use super::overlay;
use super::widgets::{choice, chosen, labelled, number};
use crate::field::Association;
use crate::look::FlowLook;
use crate::pipeline::{FlowLayer, vector_fields};
use crate::render::flow::{FlowVolume, Icon};
use crate::render::surfaces::ByField;
use crate::ui::tracks::{KeyValue, Track};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{
    Button, Color32, ColorImage, DragValue, Id, Image, Role, Slider, TextureHandle, TextureOptions, Ui, WidgetInfo,
    vec2,
};

/// Colour map of a field that is chosen here.
const MAP: &str = "viridis";

/// Side of the picture of an icon.
const PICTURE: f32 = 40.0;

/// Shows this part of the side panel.
pub(super) fn show(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let fields = vector_fields(session.store().fields());
    let flow = session.look().flow.as_ref();
    if fields.is_empty() {
        ui.label("The series has no vectors in cells or at their vertices.");
        return;
    }
    let mut options = vec![(None, "no flow")];
    options.extend(fields.iter().map(|&field| (Some(field), field)));
    let shown = flow.map(|flow| flow.layer.field.as_str());
    if let Some(field) = chosen(ui, "Flow (F)", shown, &options) {
        let style = |field: &str| flow.map_or_else(|| session.few_splats(field), |flow| flow.layer.style);
        let look = |field: &str| Box::new(FlowLook::new(field.to_owned(), style(field)));
        actions.push(Action::Flow(field.map(look)));
    }
    let Some(before) = flow else { return };
    let mut flow = before.clone();
    pattern(ui, session, &mut flow);
    splats(ui, session, &mut flow.layer, actions);
    if flow != *before {
        actions.push(Action::Flow(Some(Box::new(flow))));
    }
    colors(ui, session, before, actions);
}

/// The icon, its length and its rate.
fn pattern(ui: &mut Ui, session: &Session, flow: &mut FlowLook) {
    let measure = session.flow_measure();
    icons(ui, flow);
    ui.horizontal(|ui| {
        let before = flow.layer.style.length.or(measure.map(|of| of.period(&flow.layer.style))).unwrap_or_default();
        let mut length = before;
        let value = DragValue::new(&mut length).range(1e-30..=f64::MAX).speed(0.01 * before);
        ui.add_enabled_ui(before > 0.0, |ui| {
            number(ui, value.custom_formatter(|x, _| overlay::number(x)), "Length of a period of the pattern");
            ui.label("length of the pattern");
        });
        if length != before {
            flow.layer.style.length = Some(length);
        }
    });
    ui.horizontal(|ui| {
        let before = session.flow_rate().unwrap_or_default();
        let mut rate = before;
        let usual = measure.map_or(1.0, |of| of.rate(&flow.layer.style, Session::NOMINAL_FPS));
        let value = DragValue::new(&mut rate).range(0.0..=f64::MAX).speed(0.01 * usual);
        ui.add_enabled_ui(session.flow_rate().is_some(), |ui| {
            let name = "Time of the series a second with which a held step flows on; 0: it stands still";
            number(ui, value.custom_formatter(|x, _| overlay::number(x)), name);
            ui.label("rate while held");
        });
        if rate != before {
            flow.rate = Some(rate);
        }
    });
}

/// The icons, as pictures, and what the options or the project name in place of one.
fn icons(ui: &mut Ui, flow: &mut FlowLook) {
    let named = flow.icons.as_ref().map(ToString::to_string);
    let shown = named.is_none().then_some(flow.layer.style.icon);
    ui.horizontal(|ui| {
        for icon in Icon::ALL {
            let picture = Image::from_texture(&picture(ui, icon)).fit_to_exact_size(vec2(PICTURE, PICTURE));
            let is_shown = shown == Some(icon);
            let response = ui.add(Button::selectable(is_shown, picture));
            let name = format!("Icon of {icon}");
            response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_shown, &name));
            if response.on_hover_text(name).clicked() {
                flow.set_icon(icon);
            }
        }
        ui.label("Icon (G)");
    });
    if let Some(named) = named {
        ui.label(named);
    }
}

/// The picture of an icon, made when it is shown first.
fn picture(ui: &Ui, icon: Icon) -> TextureHandle {
    let id = Id::unique(("picture of an icon", icon));
    if let Some(known) = ui.data(|data| data.get_temp(id)) {
        return known;
    }
    let rows = icon.texels();
    let side = rows.len();
    let ink = |texel: f64| Color32::from_gray((255.0 * texel).round() as u8);
    let pixels = rows.into_iter().flatten().map(ink).collect();
    let made = ui.ctx().load_texture("icon", ColorImage::new([side, side], pixels), TextureOptions::LINEAR);
    ui.data_mut(|data| data.insert_temp(id, made.clone()));
    made
}

/// What has the vectors of a field.
fn sites(session: &Session, field: &str) -> Option<Association> {
    let component = format!("{field}:0");
    session.store().fields().iter().find(|field| field.name == component).map(|field| field.values_of)
}

/// Number, size and opacity of splats, and what shows the scalars.
fn splats(ui: &mut Ui, session: &Session, FlowLayer { field, style, .. }: &mut FlowLayer, actions: &mut Vec<Action>) {
    let mesh = session.series().mesh();
    let most = match sites(session, field) {
        Some(Association::Cell) => mesh.topology.tets.len(),
        Some(Association::Point) | None => mesh.positions.local.len(),
    };
    let most = most.try_into().unwrap_or(u32::MAX);
    let mut count = style.splats.unwrap_or(most).min(most);
    let slider = Slider::new(&mut count, 1..=most.max(1)).logarithmic(true);
    if labelled(ui.add(slider), "Splats").on_hover_text("Number of splats, evenly through the volume").changed() {
        style.splats = Some(count).filter(|count| *count < most);
    }
    let volumes = [(FlowVolume::Exact, "cells"), (FlowVolume::Splats, "splats"), (FlowVolume::None, "nothing")];
    choice(ui, "The scalar is shown by", &mut style.volume, &volumes);
    ui.horizontal(|ui| {
        // What was chosen elsewhere stays as it is, whatever can be dragged to here.
        let value = DragValue::new(&mut style.size).range(0.05..=10.0).clamp_existing_to_range(false);
        let value = value.speed(0.01).max_decimals(2);
        number(ui, value.prefix("x "), "Size of splats, in edges of the cells around");
        ui.label("size");
        // That of the timeline, until another is chosen.
        let shown = session.value_shown(Track::Flow);
        let opacity = if let Ok(KeyValue::Number(opacity)) = shown { opacity } else { style.opacity };
        let mut percent = 100.0 * opacity;
        let value = DragValue::new(&mut percent).range(0.0..=100.0).speed(0.5).max_decimals(0).suffix(" %");
        if number(ui, value, "Opacity of the flow").changed() {
            actions.push(Action::FlowOpacity(0.01 * percent));
        }
        ui.label("opacity");
    });
}

/// The field that colours splats.
fn colors(ui: &mut Ui, session: &Session, flow: &FlowLook, actions: &mut Vec<Action>) {
    // Vectors of cells have the colours of fields of cells, and those of vertices of vertices.
    let sites = sites(session, &flow.layer.field);
    let fields = session.store().fields().iter().filter(|field| Some(field.values_of) == sites);
    let names: Vec<&str> = fields.map(|field| field.name.as_str()).collect();
    let shown = flow.layer.colors.as_ref().map(|colors| colors.field.as_str());
    let mut options = vec![(None, "orange")];
    options.extend(names.into_iter().map(|name| (Some(name), name)));
    if let Some(field) = chosen(ui, "Colours of the flow", shown, &options) {
        let by = field.and_then(|name| Some(ByField { field: name.parse().ok()?, map: Some(MAP.to_owned()) }));
        actions.push(Action::FlowColors(by));
    }
}

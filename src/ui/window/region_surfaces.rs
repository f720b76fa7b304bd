//! Surfaces of regions: around which, how they are drawn, their colours and opacities.

use super::regions;
use super::widgets::{choice, color_button, icon, number};
use crate::field::Regions;
use crate::render::domain::{DomainStyle, DomainSurface};
use crate::store::StoredField;
use eframe::egui;
use egui::{DragValue, Ui};

/// Lines for each surface of regions among these surfaces, and a button that adds one.
pub(super) fn show(ui: &mut Ui, fields: &[StoredField], surfaces: &mut Vec<DomainSurface>) {
    let ranges = regions::ranges(fields);
    let Some(&(field, range)) = ranges.first() else { return };
    let mut removed = None;
    let of_regions = surfaces.iter_mut().enumerate().filter(|(_, surface)| surface.regions.is_some());
    for (count, (at, surface)) in of_regions.enumerate() {
        let name = |what: &str| if count == 0 { what.to_owned() } else { format!("{what} {}", count + 1) };
        ui.push_id(("surface of regions", at), |ui| {
            if let Some(chosen) = &mut surface.regions {
                regions::choose(ui, &ranges, chosen, &name);
            }
            ui.horizontal(|ui| colors(ui, surface, &name));
            ui.horizontal(|ui| {
                if opacity(ui, surface, &name) {
                    removed = Some(at);
                }
            });
        });
    }
    if let Some(at) = removed {
        surfaces.remove(at);
    }
    if ui.button("Add surface of regions").clicked() {
        let regions = Some(Regions { field: field.to_owned(), values: vec![range] });
        surfaces.push(DomainSurface { regions, ..DomainSurface::of_style(DomainStyle::Solid, true) });
    }
}

/// How a surface is drawn, and its colour.
fn colors(ui: &mut Ui, surface: &mut DomainSurface, name: &impl Fn(&str) -> String) {
    let styles =
        [(DomainStyle::Solid, "solid"), (DomainStyle::Wireframe, "wireframe"), (DomainStyle::Edges, "feature edges")];
    choice(ui, &name("Style of the regions' surface"), &mut surface.style, &styles);
    let shown = surface.color.unwrap_or([0.5; 3]).map(|c| c as f32);
    if let Some(rgb) = color_button(ui, shown, &name("Colour of the regions' surface")) {
        surface.color = Some(rgb.map(|c| f64::from(c) / 255.0));
    }
    let auto = "The colours of the transfer function, where there are finite scalars";
    if surface.color.is_some() && ui.small_button("auto").on_hover_text(auto).clicked() {
        surface.color = None;
    }
}

/// The opacity of a surface; whether it is to be removed.
fn opacity(ui: &mut Ui, surface: &mut DomainSurface, name: &impl Fn(&str) -> String) -> bool {
    let mut percent = 100.0 * surface.opacity;
    let value = DragValue::new(&mut percent).range(0.0..=100.0).speed(0.5).max_decimals(0).suffix(" %");
    if number(ui, value, &name("Opacity of the regions' surface")).changed() {
        surface.opacity = (0.01 * percent).clamp(0.0, 1.0);
    }
    icon(ui, "x", &name("Remove the regions' surface"), true).clicked()
}

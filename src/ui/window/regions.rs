//! The regions that are shown: a field of cells, and which of its values.

use super::overlay;
use super::widgets::{chosen, labelled};
use crate::field::Association;
use crate::pipeline::Regions;
use crate::store::StoredField;
use eframe::egui;
use egui::Ui;

/// The field by which regions are chosen, or none, and the chosen values as text, in the form of the option.
pub(super) fn show(ui: &mut Ui, fields: &[StoredField], shown: &mut Option<Regions>) {
    let of_cells = fields.iter().filter(|field| field.values_of == Association::Cell);
    let ranges: Vec<(&str, [f32; 2])> =
        of_cells.filter_map(|field| Some((field.name.as_str(), field.range?))).collect();
    if ranges.is_empty() {
        return;
    }
    let names = ranges.iter().map(|&(name, _)| (name, name));
    let options: Vec<(&str, &str)> = std::iter::once(("", "all regions")).chain(names).collect();
    let before = shown.as_ref().map_or("", |regions| regions.field.as_str());
    if let Some(name) = chosen(ui, "Field of the regions", before, &options) {
        let chosen = ranges.iter().find(|range| range.0 == name);
        *shown = chosen.map(|&(name, range)| Regions { field: name.to_owned(), values: vec![range] });
    }
    let Some(regions) = shown else { return };
    let range = ranges.iter().find(|(name, _)| *name == regions.field).map(|&(_, range)| range);
    values(ui, regions, range);
}

/// The values of the regions. What is typed stays as it is while it is no choice; the one before stays chosen.
fn values(ui: &mut Ui, shown: &mut Regions, range: Option<[f32; 2]>) {
    let id = ui.scope_id().with("values of the regions as typed");
    let typed: Option<(Regions, String)> = ui.data(|data| data.get_temp(id));
    let mut text = typed.filter(|(of, _)| of == shown).map_or_else(|| shown.values_as_text(), |(_, text)| text);
    let response = labelled(ui.text_edit_singleline(&mut text), "Values of the regions");
    if let Some(range) = range {
        let [least, greatest] = range.map(|value| overlay::number(value.into()));
        response.on_hover_text(format!("Values and ranges, as in 0,3..5; there are those from {least} to {greatest}"));
    }
    match Regions::of_field(&shown.field, &text) {
        Ok(regions) => *shown = regions,
        Err(problem) => _ = ui.label(problem),
    }
    if range.is_some_and(|range| !shown.meet(range)) {
        ui.label("No cell has such a value");
    }
    ui.data_mut(|data| data.insert_temp(id, (shown.clone(), text)));
}

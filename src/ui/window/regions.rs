//! Regions of the mesh: a field of cells, and which of its values.

use super::overlay;
use super::widgets::{chosen, labelled};
use crate::field::{Association, Regions};
use crate::store::StoredField;
use eframe::egui;
use egui::Ui;

/// The fields by which regions may be chosen, with their least and greatest values.
pub(super) fn ranges(fields: &[StoredField]) -> Vec<(&str, [f32; 2])> {
    let of_cells = fields.iter().filter(|field| field.values_of == Association::Cell);
    of_cells.filter_map(|field| Some((field.name.as_str(), field.range?))).collect()
}

/// The field by which the regions that are shown are chosen, or none, and the chosen values as text, in the form of the option.
pub(super) fn show(ui: &mut Ui, fields: &[StoredField], shown: &mut Option<Regions>) {
    let ranges = ranges(fields);
    if ranges.is_empty() {
        return;
    }
    let names = ranges.iter().map(|&(name, _)| (name, name));
    let options: Vec<(&str, &str)> = std::iter::once(("", "all regions")).chain(names).collect();
    let before = shown.as_ref().map_or("", |regions| regions.field.as_str());
    if let Some(name) = chosen(ui, "Field of the regions", before, &options) {
        *shown = whole(&ranges, name);
    }
    let Some(regions) = shown else { return };
    values(ui, &ranges, regions, "Values of the regions");
}

/// The field and the values of regions; `name` makes the names of widgets.
pub(super) fn choose(ui: &mut Ui, ranges: &[(&str, [f32; 2])], regions: &mut Regions, name: &impl Fn(&str) -> String) {
    let options: Vec<(&str, &str)> = ranges.iter().map(|&(field, _)| (field, field)).collect();
    if let Some(field) = chosen(ui, &name("Field of the regions' surface"), regions.field.as_str(), &options)
        && let Some(whole) = whole(ranges, field)
    {
        *regions = whole;
    }
    values(ui, ranges, regions, &name("Values of the regions' surface"));
}

/// All values of a field.
fn whole(ranges: &[(&str, [f32; 2])], field: &str) -> Option<Regions> {
    let found = ranges.iter().find(|(name, _)| *name == field);
    found.map(|&(name, range)| Regions { field: name.to_owned(), values: vec![range] })
}

/// The values of regions. What is typed stays as it is while it is no choice; the one before stays chosen.
fn values(ui: &mut Ui, ranges: &[(&str, [f32; 2])], shown: &mut Regions, name: &str) {
    let id = ui.scope_id().with("values of the regions as typed");
    let typed: Option<(Regions, String)> = ui.data(|data| data.get_temp(id));
    let mut text = typed.filter(|(of, _)| of == shown).map_or_else(|| shown.values_as_text(), |(_, text)| text);
    let response = labelled(ui.text_edit_singleline(&mut text), name);
    let range = ranges.iter().find(|(name, _)| *name == shown.field).map(|&(_, range)| range);
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

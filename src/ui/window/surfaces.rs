//! Isosurfaces and cuts: values, positions and colours.

use super::widgets::{choice, color_button, icon, labelled, named, number, toggle};
use super::{overlay, region_surfaces, regions};
use crate::pipeline::{Shown, SurfaceLook};
use crate::render::domain::{DomainStyle, DomainSurface};
use crate::render::surfaces::{Cut, Isosurface, Normals, SURFACES_MAX};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{DragValue, Slider, Ui};
use glam::DVec3;

/// Shows this part of the side panel.
pub(super) fn show(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let Some((lo, hi)) = session.range_of_field() else {
        ui.label("The field has no finite value");
        return;
    };
    let before = session.shown_surfaces();
    let mut look = before.clone();
    let kinds = [(Shown::Volume, "volume"), (Shown::Surfaces, "isosurfaces"), (Shown::Both, "volume and isosurfaces")];
    // Collapsed, since all parts would push down the controls below.
    let id = ui.scope_id().with("cuts are open");
    let is_used = !look.cuts.is_empty() || !look.domain.is_empty() || look.regions.is_some();
    let mut is_open = ui.data(|data| data.get_temp(id)).unwrap_or(is_used);
    ui.horizontal(|ui| {
        if choice(ui, "What is shown (M)", &mut look.shown, &kinds)
            && look.shown != Shown::Volume
            && look.isosurfaces.is_empty()
        {
            look.isosurfaces.push(Isosurface::new(0.5 * lo + 0.5 * hi));
        }
        if toggle(ui, "cuts", "Cuts, light on the volume, surface of the domain, regions", is_open).clicked() {
            is_open = !is_open;
            ui.data_mut(|data| data.insert_temp(id, is_open));
        }
    });
    if look.shown != Shown::Volume {
        isosurfaces(ui, session, &mut look, (lo, hi));
        let kinds = [
            (Normals::Cell, "flat: a facet a cell"),
            (Normals::Vertex, "smooth"),
            (Normals::Screen, "by depths of neighbours"),
            (Normals::Depth, "the farther the darker"),
            (Normals::None, "colours without light"),
        ];
        choice(ui, "Light on surfaces", &mut look.shading.normals, &kinds);
        ui.checkbox(&mut look.shading.ambient_occlusion, "ambient occlusion");
    }
    if is_open {
        if look.shown != Shown::Surfaces {
            ui.checkbox(&mut look.shading.volume, "light on the volume");
        }
        domain(ui, &mut look);
        parts(ui, session.part_sizes(), &mut look.parts);
        let fields = session.store().fields();
        regions::show(ui, fields, &mut look.regions);
        region_surfaces::show(ui, fields, &mut look.domain);
        cuts(ui, session, &mut look);
    }
    if look != before {
        actions.push(Action::Surfaces(Box::new(look)));
    }
}

/// A line for each surface, and one more to add another.
fn isosurfaces(ui: &mut Ui, session: &Session, look: &mut SurfaceLook, (lo, hi): (f64, f64)) {
    let mut removed = None;
    for (at, surface) in look.isosurfaces.iter_mut().enumerate() {
        let name = |what: &str| if at == 0 { what.to_owned() } else { format!("{what} {}", at + 1) };
        let slider = Slider::new(&mut surface.value, lo..=hi).custom_formatter(|x, _| overlay::number(x));
        labelled(ui.add(slider), &name("Isovalue")).on_hover_text("J, K");
        ui.horizontal(|ui| {
            colors(ui, session, surface, &name("Colour of the surface"));
            let mut percent = 100.0 * surface.opacity;
            let value = DragValue::new(&mut percent).range(0.0..=100.0).speed(0.5).max_decimals(0).suffix(" %");
            if number(ui, value, &name("Opacity of the surface")).changed() {
                surface.opacity = (0.01 * percent).clamp(0.0, 1.0);
            }
            if icon(ui, "x", &name("Remove the isosurface"), true).clicked() {
                removed = Some(at);
            }
        });
    }
    if let Some(at) = removed {
        look.isosurfaces.remove(at);
    }
    let has_room = look.isosurfaces.len() < SURFACES_MAX;
    if ui.add_enabled(has_room, egui::Button::new("Add isosurface")).clicked() {
        // Between the last value and the farther end of the range.
        let last = look.isosurfaces.last().map_or(lo, |surface| surface.value);
        let end = if last - lo > hi - last { lo } else { hi };
        look.isosurfaces.push(Isosurface::new(0.5 * last + 0.5 * end));
    }
    if look.isosurfaces.is_empty() {
        look.shown = Shown::Volume;
    }
}

/// The surface of the domain, in one way or none.
fn domain(ui: &mut Ui, look: &mut SurfaceLook) {
    let styles = [
        (None, "domain: not drawn"),
        (Some((DomainStyle::Solid, false)), "domain: solid"),
        (Some((DomainStyle::Solid, true)), "domain: translucent"),
        (Some((DomainStyle::Wireframe, false)), "domain: wireframe"),
        (Some((DomainStyle::Edges, false)), "domain: feature edges"),
    ];
    let drawn = look.domain.iter().find(|surface| surface.regions.is_none());
    let mut style = drawn.map(|of| (of.style, of.style == DomainStyle::Solid && of.opacity < 1.0));
    if choice(ui, "Surface of the domain", &mut style, &styles) {
        look.domain.retain(|surface| surface.regions.is_some());
        if let Some((style, is_translucent)) = style {
            look.domain.insert(0, DomainSurface::of_style(style, is_translucent));
        }
    }
}

/// The connected parts of the mesh, if there are several: the shown ones; empty: all.
fn parts(ui: &mut Ui, sizes: &[usize], shown: &mut Vec<u32>) {
    /// Number of largest parts listed.
    const LISTED: usize = 100;
    if sizes.len() < 2 {
        return;
    }
    let mut is_shown = vec![shown.is_empty(); sizes.len()];
    for &part in &*shown {
        is_shown.get_mut(part as usize).into_iter().for_each(|is_shown| *is_shown = true);
    }
    let count = is_shown.iter().filter(|&&is_shown| is_shown).count();
    let text = if count == sizes.len() { "all parts".to_owned() } else { format!("{count} of {} parts", sizes.len()) };
    let combo = egui::ComboBox::from_id_salt("parts").selected_text(text);
    let combo = combo.close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside);
    let response = combo.show_ui(ui, |ui| {
        for (part, size) in sizes.iter().enumerate().take(LISTED) {
            let is_last = is_shown[part] && count == 1;
            let cells = if *size == 1 { "1 cell".to_owned() } else { format!("{size} cells") };
            if ui.add_enabled(!is_last, egui::Checkbox::new(&mut is_shown[part], format!("{part}: {cells}"))).changed()
            {
                let now = (0..).zip(&is_shown).filter_map(|(part, &is_shown)| is_shown.then_some(part));
                *shown = if is_shown.contains(&false) { now.collect() } else { Vec::new() };
            }
        }
        if sizes.len() > LISTED {
            ui.label(format!("and {} smaller ones", sizes.len() - LISTED));
        }
    });
    named(response.response, egui::Role::ComboBox, "Connected parts");
}

/// Cuts; each is moved along its normal between the ends of the mesh's box.
fn cuts(ui: &mut Ui, session: &Session, look: &mut SurfaceLook) {
    let (lo, hi) = session.series().mesh().frame();
    let middle = 0.5 * lo + 0.5 * hi;
    let mut removed = None;
    for (at, cut) in look.cuts.iter_mut().enumerate() {
        let name = |what: &str| if at == 0 { what.to_owned() } else { format!("{what} {}", at + 1) };
        choice(ui, &name("Kind of the cut"), &mut cut.clips, &[(false, "section"), (true, "clip")]);
        ui.horizontal(|ui| {
            for (axis, word) in [(DVec3::X, "x"), (DVec3::Y, "y"), (DVec3::Z, "z")] {
                let is_along = DVec3::from(cut.normal).normalize_or_zero().dot(axis).abs() > 1.0 - 1e-9;
                if toggle(ui, word, &name(&format!("Cut across {word}")), is_along).clicked() {
                    (cut.normal, cut.point) = (axis.to_array(), middle.to_array());
                }
            }
            if icon(ui, "turn", &name("Keep the other side"), cut.clips).clicked() {
                cut.normal = cut.normal.map(|x| -x);
            }
            if icon(ui, "x", &name("Remove the cut"), true).clicked() {
                removed = Some(at);
            }
        });
        let normal = DVec3::from(cut.normal).normalize_or_zero();
        let reach = 0.5 * (hi - lo).dot(normal.abs());
        let before = normal.dot(DVec3::from(cut.point) - middle);
        let mut after = before;
        let slider = Slider::new(&mut after, -reach..=reach).custom_formatter(|x, _| overlay::number(x));
        labelled(ui.add(slider), &name("Place of the cut"))
            .on_hover_text("Distance from the middle of the mesh; Ctrl drag in the picture moves the last cut");
        if after != before {
            *cut = cut.moved(after - before);
        }
    }
    if let Some(at) = removed {
        look.cuts.remove(at);
    }
    ui.horizontal(|ui| {
        for (word, clips) in [("Add section", false), ("Add clip", true)] {
            if ui.button(word).clicked() {
                look.cuts.push(Cut { point: middle.to_array(), normal: [0.0, 0.0, 1.0], clips, by: None });
            }
        }
    });
}

/// The colour of a surface: its own, or that of the transfer function.
fn colors(ui: &mut Ui, session: &Session, surface: &mut Isosurface, name: &str) {
    let shown = surface.front.unwrap_or_else(|| session.color_at(surface.value));
    if let Some(rgb) = color_button(ui, shown.map(|c| c as f32), name) {
        surface.front = Some(rgb.map(|c| f64::from(c) / 255.0));
    }
    if surface.front.is_some() && ui.small_button("auto").on_hover_text("The colour of the transfer function").clicked()
    {
        surface.front = None;
    }
}

//! The quality of the picture: how much is left out while something moves, and which faces or points are drawn at rest.

use super::widgets::{labelled, number, staying_menu};
use crate::lod::Partition;
use crate::moments::CovDenominator;
use crate::pipeline::{RenderMode, Sampling};
use crate::playback::quality::Family;
use crate::ui::{Action, Session, TARGET_FPS};
use eframe::egui;
use egui::{Align2, DragValue, Role, Sense, TextStyle, Ui, WidgetInfo, vec2};

/// Width of the slider, of its box with a margin, and of the text beside both: that must not move what follows.
const SLIDER: f32 = 84.0;
const BOX: f32 = 72.0;
const TEXT: f32 = 128.0;

/// What is left out while something moves: on the button of the menu, and in it.
const FAMILIES: [(Option<Family>, &str, &str); 6] = [
    (None, "auto", "what costs least"),
    (Some(Family::Rays), "rays", "rays"),
    (Some(Family::Scaled), "pixels", "pixels of the image"),
    (Some(Family::Details), "details", "rays, with details of earlier steps"),
    (Some(Family::Faces), "faces", "faces"),
    (Some(Family::Points), "points", "points"),
];

/// Orders of faces; the last three have a number of intervals. Of points there are those by chance and by changes over time.
const SAMPLINGS: [(Sampling, &str); 7] = [
    (Sampling::Error, "first where omitted ones show"),
    (Sampling::Random, "at random"),
    (Sampling::Global(CovDenominator::Floored { share: 0.01 }), "first what changes over time"),
    (Sampling::Global(CovDenominator::Plain), "the same, over the mean"),
    (Sampling::Local(Partition::Regular(Partition::USUAL)), "by strata of equal intervals"),
    (Sampling::Local(Partition::Logarithmic(Partition::USUAL)), "by strata of growing intervals"),
    (Sampling::Local(Partition::Greedy(Partition::USUAL)), "by strata of equal changes"),
];

/// The slider from exact to fast, what is left out, and what the picture on the screen has.
pub(super) fn show(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    // A slider and the box behind it do not begin a new row by themselves.
    if ui.available_size_before_wrap().x < SLIDER + BOX {
        ui.end_row();
    }
    rate(ui, session, actions);
    let short = FAMILIES.iter().find(|(family, ..)| *family == session.family()).map_or("", |(_, short, _)| short);
    let menu = staying_menu(ui, short, |ui| {
        ui.label("Fewer while moving:");
        for (family, _, text) in FAMILIES {
            if ui.selectable_label(family == session.family(), text).clicked() {
                actions.push(Action::GiveUp(family));
            }
        }
        ui.separator();
        levels(ui, session, actions);
    });
    let name = "What is left out for speed";
    menu.widget_info(|| WidgetInfo::labeled(Role::Button, true, name));
    menu.on_hover_text(name);
    let drawn = session.drawn();
    let (place, response) = ui.allocate_exact_size(vec2(TEXT, ui.spacing().interact_size.y), Sense::hover());
    let (font, ink) = (TextStyle::Body.resolve(ui.style()), ui.visuals().text_color());
    ui.painter().with_clip_rect(place).text(place.left_center(), Align2::LEFT_CENTER, &drawn, font, ink);
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, format!("Drawn: {drawn}")));
    response.on_hover_text(session.lacks().unwrap_or(drawn));
}

/// The frame rate to hold while something moves.
fn rate(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let before = session.target_fps().unwrap_or(0.0);
    let mut fps = before;
    ui.spacing_mut().slider_width = SLIDER;
    let text = |fps: f64, _| if fps < *TARGET_FPS.start() { "exact".to_owned() } else { format!("{fps:.0} fps") };
    let number = |text: &str| match text.trim() {
        "exact" => Some(0.0),
        text => text.trim_end_matches("fps").trim().parse().ok(),
    };
    let slider = egui::Slider::new(&mut fps, 0.0..=*TARGET_FPS.end()).logarithmic(true);
    let slider = slider.smallest_positive(*TARGET_FPS.start()).custom_formatter(text).custom_parser(number);
    labelled(ui.add(slider), "Quality while moving").on_hover_text(
        "From exact to fast (D, E): frames per second to hold while something moves; at rest all is drawn",
    );
    if fps != before {
        actions.push(Action::TargetRate((fps >= *TARGET_FPS.start()).then_some(fps)));
    }
}

/// Which faces or points are drawn at rest.
fn levels(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let look = session.look();
    let mode = look.mode.on(session.series().mesh());
    let are_points = mode == RenderMode::Points;
    let has_levels = are_points || matches!(mode, RenderMode::Auto | RenderMode::Havs);
    let before = if has_levels { 100.0 * look.faces.lod } else { 100.0 };
    let mut percent = before;
    ui.horizontal(|ui| {
        ui.label(if are_points { "Points at rest:" } else { "Faces at rest:" });
        let value = DragValue::new(&mut percent).range(0.0..=100.0).speed(0.5).max_decimals(1).suffix(" %");
        labelled(ui.add_enabled(has_levels, value), "Level of detail")
            .on_hover_text(match are_points {
                true => "The share of what rays meet that is drawn: fewer points, larger ones",
                false => "The share of the faces inside the volume that is drawn at most",
            })
            .on_disabled_hover_text("This renderer always draws all cells");
    });
    if percent != before {
        actions.push(Action::LevelOfDetail(percent / 100.0));
    }
    let sampling = match look.faces.sampling {
        sampling if are_points && !is_of_points(sampling) => Sampling::Random,
        sampling => sampling,
    };
    ui.add_enabled_ui(has_levels, |ui| {
        for (kind, text) in SAMPLINGS.into_iter().filter(|(kind, _)| !are_points || is_of_points(*kind)) {
            let is_chosen = is_alike(kind, sampling);
            if ui.selectable_label(is_chosen, text).clicked() && !is_chosen {
                actions.push(Action::Sampling(kind));
            }
        }
        if let Sampling::Local(partition) = sampling {
            let mut intervals = partition.count();
            let most = session.state().steps.max(1);
            let value = DragValue::new(&mut intervals).range(1..=most).speed(0.1).suffix(" intervals");
            if number(ui, value, "Number of intervals of time").changed() {
                actions.push(Action::Sampling(Sampling::Local(partition.of(intervals))));
            }
        }
    });
}

/// Whether points have an order of their own by this one of faces.
fn is_of_points(sampling: Sampling) -> bool {
    sampling == Sampling::Random || sampling.importance().is_some()
}

/// Whether two orders differ in numbers at most.
fn is_alike(a: Sampling, b: Sampling) -> bool {
    use std::mem::discriminant;
    match (a, b) {
        (Sampling::Global(a), Sampling::Global(b)) => discriminant(&a) == discriminant(&b),
        (Sampling::Local(a), Sampling::Local(b)) => discriminant(&a) == discriminant(&b),
        (a, b) => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_family_and_every_order_can_be_chosen() {
        let families: Vec<_> = FAMILIES.iter().filter_map(|(family, ..)| *family).collect();
        assert_eq!(families, Family::ALL);
        for text in ["error", "random", "global", "plain", "regular:9", "logarithmic:9", "greedy:9"] {
            let sampling: Sampling = text.parse().unwrap();
            assert_eq!(SAMPLINGS.iter().filter(|(kind, _)| is_alike(*kind, sampling)).count(), 1, "{text}");
        }
        let usual = SAMPLINGS.map(|(kind, _)| kind.to_string().parse::<Sampling>().unwrap());
        assert_eq!(usual, SAMPLINGS.map(|(kind, _)| kind), "the numbers are the usual ones");
    }
}

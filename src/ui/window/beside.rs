//! Two views: the part of the side panel that opens and arranges them, and the picture of their difference.

use super::overlay::{self, Overlays, number, shortened};
use super::path_field::OpenDialog;
use super::preview::Upload;
use super::project::NAME;
use super::viewport;
use super::welcome::{self, Data, PathBox, Wish};
use super::widgets::staying_menu;
use crate::transfer::MappedRange;
use crate::ui::Action;
use crate::ui::settings::RecentFile;
use crate::ui::views::difference::{Difference, color};
use crate::ui::views::{ViewAction, Views};
use eframe::egui;
use egui::{Color32, Rect, Role, Sense, TextureId, Ui, WidgetInfo, pos2, vec2};
use std::sync::Arc;

/// A difference with its picture on the GPU.
pub(super) struct Shown {
    difference: Arc<Difference>,
    texture: TextureId,
}

/// State of the part of the panel.
pub(super) struct BesidePanel {
    path_box: PathBox,
    picture: Upload,
    /// Whether there was a second view at the last call.
    had_two: bool,
}

impl BesidePanel {
    pub(super) fn new(open: &OpenDialog) -> Self {
        Self { path_box: PathBox::new(open), picture: Upload::default(), had_two: false }
    }

    /// Whether the second view has come since the last call.
    pub(super) fn is_new(&mut self, views: &Views) -> bool {
        let has_two = views.beside().is_some();
        !std::mem::replace(&mut self.had_two, has_two) && has_two
    }

    /// Shows the part of the side panel; returns the data of a view to be opened.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        views: &Views,
        recent: &[RecentFile],
        actions: &mut Vec<Action>,
    ) -> Option<Wish> {
        if views.beside().is_some() {
            arrange(ui, views, actions);
            return None;
        }
        self.open(ui, views, recent).map(Wish::Beside)
    }

    /// What can be shown beside the view.
    fn open(&mut self, ui: &mut Ui, views: &Views, recent: &[RecentFile]) -> Option<Data> {
        let mut wanted = self.path_box.take_chosen().map(|path| Data::Files(vec![path]));
        ui.horizontal_wrapped(|ui| {
            let hint = "The same data a second time, to be given another look";
            if ui.button("Same data").on_hover_text(hint).clicked() {
                wanted = Some(Data::Same);
            }
            staying_menu(ui, "Field...", |ui| {
                for field in views.active().store().fields() {
                    if ui.button(shortened(&field.name, NAME)).clicked() {
                        wanted = field.name.parse().ok().map(Data::Field);
                        ui.close();
                    }
                }
            });
            staying_menu(ui, "File...", |ui| {
                let mut path = self.path_box.show(ui);
                if !recent.is_empty() {
                    ui.separator();
                    path = welcome::recent(ui, recent).or(path.take());
                }
                if let Some(path) = path {
                    wanted = Some(Data::Files(vec![path]));
                    ui.close();
                }
            });
        });
        wanted
    }

    /// The difference to be painted, if it is shown and known.
    pub(super) fn difference_of(&mut self, ctx: &egui::Context, views: &Views) -> Option<Shown> {
        let difference = views.difference()?.ok()?;
        let texture = self.picture.of(ctx, "difference", &difference.picture).id();
        Some(Shown { difference, texture })
    }
}

/// Which view is used, and how both are shown.
fn arrange(ui: &mut Ui, views: &Views, actions: &mut Vec<Action>) {
    let mut act = |action| actions.push(Action::View(action));
    let sides = if views.place() == 0 { ["left", "right"] } else { ["right", "left"] };
    ui.horizontal_wrapped(|ui| {
        ui.label(format!("The {} view is edited.", sides[0]));
        if ui.button(format!("Turn to the {} one", sides[1])).on_hover_text("T, or a click in its picture").clicked() {
            act(ViewAction::Turn);
        }
    });
    let mut are_linked = views.are_linked();
    if ui.checkbox(&mut are_linked, "cameras together").changed() {
        act(ViewAction::Link(are_linked));
    }
    let mut shows_difference = views.shows_difference();
    let hint = "Colours of left minus right, drawn in full";
    if ui.checkbox(&mut shows_difference, "difference").on_hover_text(hint).changed() {
        act(ViewAction::Difference(shows_difference));
    }
    if let Some(found) = views.difference() {
        ui.label(found.map_or_else(|problem| problem, |difference| in_words(&difference)));
    }
    if ui.button(format!("Close the {} view", sides[1])).clicked() {
        act(ViewAction::Close);
    }
}

/// Largest and mean difference.
fn in_words(difference: &Difference) -> String {
    let raw = &difference.raw;
    match raw.max {
        0.0 => "no difference".to_owned(),
        max => format!("largest {}, RMSE {}", number(max), number(raw.rmse)),
    }
}

/// Shows the difference in the rest of `ui`, with its numbers and the meaning of its colours. Returns its place.
pub(super) fn show_difference(
    ui: &mut Ui,
    views: &Views,
    shown: Option<&Shown>,
    overlays: Overlays,
    actions: &mut Vec<Action>,
) -> Rect {
    let rect = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    let text = match (shown, views.difference()) {
        (Some(Shown { difference, .. }), _) => in_words(difference),
        (None, Some(Err(problem))) => problem,
        (None, _) => "comparing the first pictures".to_owned(),
    };
    if rect.is_positive() {
        let session = views.active();
        let mut lines = vec!["Difference: left minus right".to_owned(), text.clone()];
        if let Some(Shown { difference, texture }) = shown {
            let [width, height] = difference.picture.size;
            let place = viewport::placed(rect, vec2(width as f32, height as f32));
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().with_clip_rect(rect).image(*texture, place, uv, Color32::WHITE);
            lines.push(format!("t = {}", number(difference.time)));
        }
        // The colour of no difference is behind it.
        let behind = if shown.is_some() { color(0.0).map(|c| c as f32) } else { session.background() };
        overlay::lines(ui, rect, behind, &lines);
        let span = shown.map(|shown| shown.difference.span).filter(|_| overlays.legend);
        if let Some(range) = span.and_then(|span| MappedRange::new(-span, span, false).ok()) {
            let share = |position: f64| 2.0 * position - 1.0;
            overlay::color_bar(ui, rect, (0, 1), behind, &range, "difference", |position| color(share(position)));
        }
        viewport::mouse(ui, &response, rect, actions);
    }
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, format!("Picture of the difference: {text}")));
    rect
}

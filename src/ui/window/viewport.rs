//! The picture, and mouse actions in it.

use super::axes::place_of;
use super::painted::Painted;
use super::{overlay, point};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::emath::GuiRounding;
use egui::{Pos2, Rect, Role, Sense, Ui, WidgetInfo, vec2};
use glam::DVec2;

/// Shows the overlays in the rest of `ui`; what it returns has the picture's rectangle.
pub(super) fn show(
    ui: &mut Ui,
    session: &Session,
    painted: Option<Painted>,
    overlays: overlay::Overlays,
    actions: &mut Vec<Action>,
) -> egui::Response {
    let pixels_per_point = ui.pixels_per_point();
    let rect = ui.available_rect_before_wrap().round_to_pixels(pixels_per_point);
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    if rect.is_positive() {
        overlay::show(ui, rect, session, painted, overlays);
        let place = painted.map(|painted| placed(rect, painted.size));
        mouse(ui, &response, rect, actions);
        point_at(&response, place, session, actions);
        if let Some(picked) = session.picked()
            && let Some(at) = place_of(rect, &session.camera(), picked.position)
        {
            overlay::cross(ui, rect, at, session.background());
        }
    }
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, overlay::description(session, painted)));
    response
}

/// Rectangle of an image of this size: the view angle is vertical, so heights fit; the sides are cut off or leave room, except for a
/// rounding to whole pixels.
pub(super) fn placed(rect: Rect, image: egui::Vec2) -> Rect {
    let width = rect.height() * image.x / image.y;
    // Half a pixel of either side of the image, seen in the width.
    let rounding = width * (0.5 / image.x + 0.5 / image.y);
    let width = if (width - rect.width()).abs() <= rounding { rect.width() } else { width };
    Rect::from_center_size(rect.center(), vec2(width, rect.height()))
}

/// Reports the point under the mouse; a click picks it.
fn point_at(response: &egui::Response, place: Option<Rect>, session: &Session, actions: &mut Vec<Action>) {
    // A picture that moves with the mouse has no point under it.
    let at = response.hover_pos().filter(|_| !response.dragged()).zip(place);
    let share = |at: Pos2, place: Rect| {
        let from_corner = (at - place.min) / place.size();
        (f64::from(from_corner.x), f64::from(from_corner.y))
    };
    let place = at.map(|(at, place)| share(at, place));
    if place != session.mouse() {
        actions.push(Action::PointAt(place));
    }
    if response.clicked() {
        actions.push(Action::Pick);
    }
    if let Some(text) = point::hovered(session).filter(|_| at.is_some()) {
        let (layer, id) = (response.layer_id, response.id.with("under the mouse"));
        let tip = egui::Tooltip::always_open(response.ctx.clone(), layer, id, egui::PopupAnchor::Pointer);
        tip.gap(14.0).show(|ui| ui.label(text));
    }
}

/// Moves the camera with the mouse.
pub(super) fn mouse(ui: &Ui, response: &egui::Response, rect: Rect, actions: &mut Vec<Action>) {
    use egui::PointerButton::{Middle, Primary, Secondary};
    let height = f64::from(rect.height());
    let drag = response.drag_delta();
    // In heights of the image, upwards.
    let by = DVec2::new(f64::from(drag.x), -f64::from(drag.y)) / height;
    let (shift, command) = ui.input(|input| (input.modifiers.shift, input.modifiers.command));
    if by != DVec2::ZERO {
        if response.dragged_by(Primary) && command {
            actions.push(Action::MoveCut(by));
        } else if response.dragged_by(Middle) || (response.dragged_by(Primary) && shift) {
            actions.push(Action::Pan(2.0 * by));
        } else if response.dragged_by(Primary) {
            actions.push(Action::Orbit(by));
        } else if response.dragged_by(Secondary) {
            actions.push(Action::Zoom { factor: 16.0_f64.powf(by.y), cursor: DVec2::ZERO });
        }
    }
    if response.double_clicked() {
        actions.push(Action::ResetView);
    }
    if let Some(at) = response.hover_pos() {
        let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
        // A notch of most wheels is 40 to 50 points: a quarter larger.
        let factor = f64::from(scroll / 200.0).exp() * f64::from(pinch);
        if factor != 1.0 {
            let from_center = at - rect.center();
            let cursor = 2.0 * DVec2::new(f64::from(from_center.x), -f64::from(from_center.y)) / height;
            actions.push(Action::Zoom { factor, cursor });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    #[test]
    fn pictures_fill_the_height_and_keep_their_shape() {
        let rect = Rect::from_min_size(pos2(10.0, 20.0), vec2(200.0, 100.0));
        assert_eq!(placed(rect, vec2(200.0, 100.0)), rect);
        assert_eq!(placed(rect, vec2(67.0, 33.0)), rect, "rounded to pixels");
        let square = placed(rect, vec2(50.0, 50.0));
        assert_eq!((square.size(), square.center()), (vec2(100.0, 100.0), rect.center()));
    }
}

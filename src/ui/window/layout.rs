//! The window with its views: panels around pictures, and the effects of user input.

use super::blit::Backdrop;
use super::overlay::Overlays;
use super::painted::Painted;
use super::screen::Screen;
use super::welcome::Wish;
use super::{PlayerWindow, beside, input, popups, side, timeline, viewport, widgets};
use crate::ui::views::{Ticked, ViewAction, Views};
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{Color32, Rect, Shape, Stroke, StrokeKind, Ui, UiBuilder};

/// Space between two pictures, points.
const GAP: f32 = 2.0;

/// Where the pictures are, and what the user did in that of the view that is not active.
struct Pictures {
    /// Places of the left, or only, and of the right picture; that of the difference is in both.
    places: [Rect; 2],
    /// Actions for the other view, which does not become active by them.
    beside: Vec<Action>,
}

impl PlayerWindow {
    pub(super) fn show_views(&mut self, ui: &mut Ui, wish: &mut Option<Wish>) {
        let Some(views) = &mut self.views else { return };
        let ctx = ui.ctx().clone();
        // Behind all widgets, whose positions are not known yet.
        let backdrops = [(); 2].map(|()| ui.painter().add(Shape::Noop));
        let whole = ui.available_rect_before_wrap();
        let panel = egui::Frame::side_top_panel(ui.style()).fill(Color32::TRANSPARENT);
        hold(&ctx, views);
        let session = views.active_mut();
        let mut actions = input::pressed(&ctx, session.selected_key().is_some());
        popups::notices(ui, session, &mut actions);
        let shows_side = &mut self.keeper.settings_mut().shows_side;
        egui::Panel::bottom("timeline").frame(panel).show(ui, |ui| {
            timeline::show(ui, session, shows_side, &mut self.timeline, &mut actions);
        });
        if *shows_side {
            let side = egui::Panel::right("side").frame(panel).default_size(side::WIDTH).min_size(side::WIDTH);
            side.resizable(true).show(ui, |ui| {
                let settings = self.keeper.settings_mut();
                let files = (&mut self.path_box, settings.recent.as_slice());
                *wish = self.side.files(ui, files, views.active(), &mut actions).or(wish.take());
                *wish = self.side.show(ui, views, &mut self.overlays, settings, &mut actions).or(wish.take());
            });
        }
        views.active_mut().want_histogram(self.side.take_histogram());
        let painted = [0, 1].map(|place| self.screens[place].painted());
        let difference = self.side.difference_of(&ctx, views);
        let pictures = egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| {
            let has_turned = &mut self.has_turned;
            show_pictures(ui, views, (painted, difference.as_ref()), self.overlays, has_turned, &mut actions)
        });
        let Pictures { places, beside } = pictures.inner;
        let shapes = self.behind(whole, places, ui.visuals().panel_fill);
        backdrops.into_iter().zip(shapes).for_each(|(index, shape)| ui.painter().set(index, shape));
        let Some(views) = &mut self.views else { return };
        popups::help(&ctx, views.active(), &mut actions);
        self.export.show(&ctx, views.active_mut(), &mut actions);
        if !self.is_laid_out {
            // Panels do not know their sizes before their first layout, and a frame of another size would be discarded.
            self.is_laid_out = true;
            ctx.request_discard("panels have sizes now");
            ctx.request_repaint();
            return;
        }
        if ctx.current_pass_index() > 0 {
            // The first pass has applied the input; this one shows the effect.
            return;
        }
        let own = views.place();
        for (session, place) in views.sessions_mut().zip([own, 1 - own]) {
            let size = (places[place].size() * ctx.pixels_per_point()).round().max(egui::Vec2::ZERO);
            session.set_viewport(size.x as usize, size.y as usize);
        }
        self.apply(&ctx, actions, beside);
    }

    /// What is painted behind the widgets: the pictures, and the colour of the panels around them.
    fn behind(&self, whole: Rect, places: [Rect; 2], panels: Color32) -> Vec<Shape> {
        let Some(views) = &self.views else { return Vec::new() };
        let background = |session: &Session| widgets::color(session.background());
        if views.shows_difference() {
            let fills = [(whole, panels), (places[0], background(views.active()))];
            return fills.map(|(rect, color)| Shape::rect_filled(rect, 0.0, color)).into();
        }
        let own = views.place();
        let split = if views.beside().is_some() { 0.5 * (places[0].right() + places[1].left()) } else { whole.right() };
        let parts = [whole.with_max_x(split), whole.with_min_x(split)];
        let behind = |(session, place): (&Session, usize)| {
            let (viewport, background) = (places[place], background(session));
            let around = around(viewport, parts[place]).map(|rect| Shape::rect_filled(rect, 0.0, panels));
            let picture = self.screens[place].behind(&Backdrop { viewport, background });
            Shape::Vec(around.into_iter().chain([picture]).collect())
        };
        views.sessions().zip([own, 1 - own]).map(behind).collect()
    }

    /// Applies user actions, shows what is due, and requests the next repaint.
    fn apply(&mut self, ctx: &egui::Context, actions: Vec<Action>, beside: Vec<Action>) {
        let Some(views) = &mut self.views else { return };
        let now = self.started.elapsed();
        if !actions.is_empty() || !beside.is_empty() {
            // The widgets show the old state: they are laid out again before painting, if there may be another pass.
            ctx.request_discard("the user did something");
            if !ctx.will_discard() {
                ctx.request_repaint();
            }
        }
        let was_fullscreen = views.active().is_fullscreen();
        if let Some(session) = views.beside_mut() {
            beside.into_iter().for_each(|action| session.act(action, now));
        }
        let (place, had_two) = (views.place(), views.beside().is_some());
        actions.into_iter().for_each(|action| views.act(action, now));
        if had_two && views.beside().is_none() {
            // The one that is left has the first place.
            self.screens.swap(0, place);
            self.screens[1].forget();
        }
        let is_fullscreen = views.active().is_fullscreen();
        if is_fullscreen != was_fullscreen {
            ctx.send_viewport_cmd(egui::ViewportCommand::Fullscreen(is_fullscreen));
        }
        let Ticked { active, beside, wait } = views.tick(now);
        let own = views.place();
        for (session, (place, is_new)) in views.sessions_mut().zip([(own, active), (1 - own, beside)]) {
            if self.screens[place].update(ctx, session, is_new) {
                session.ask_again();
                ctx.request_repaint();
            }
        }
        // A picture that is being made wakes the window when it is there: until then there is nothing new to paint.
        if (active || beside) && self.screens.iter().all(Screen::is_up_to_date) {
            ctx.request_repaint();
        }
        if let Some(wait) = wait {
            ctx.request_repaint_after(wait);
        }
    }
}

/// What of `part` lies around `inner`, above and below, left and right.
fn around(inner: Rect, part: Rect) -> [Rect; 4] {
    let beside = part.with_min_y(inner.top()).with_max_y(inner.bottom());
    [
        part.with_max_y(inner.top()),
        part.with_min_y(inner.bottom()),
        beside.with_max_x(inner.left()),
        beside.with_min_x(inner.right()),
    ]
}

/// Begins and ends gestures with the mouse button.
fn hold(ctx: &egui::Context, views: &mut Views) {
    if ctx.current_pass_index() > 0 {
        return;
    }
    let [begins, goes_on] = ctx.input(|input| {
        // What a widget does with the release belongs to the gesture.
        [input.pointer.any_pressed(), input.pointer.any_down() || input.pointer.any_released()]
    });
    for session in views.sessions_mut() {
        if begins {
            session.hold(false);
        }
        session.hold(goes_on);
    }
}

/// Shows what lies over the pictures: one, two, or the difference of two.
fn show_pictures(
    ui: &mut Ui,
    views: &Views,
    (painted, difference): ([Option<Painted>; 2], Option<&beside::Shown>),
    overlays: Overlays,
    has_turned: &mut bool,
    actions: &mut Vec<Action>,
) -> Pictures {
    let room = ui.available_rect_before_wrap();
    let active = views.active();
    let Some(other) = views.beside() else {
        let place = viewport::show(ui, active, painted[0], overlays, actions).rect;
        return Pictures { places: [place; 2], beside: Vec::new() };
    };
    if views.shows_difference() {
        let place = beside::show_difference(ui, views, difference, overlays, actions);
        return Pictures { places: [place; 2], beside: Vec::new() };
    }
    let width = (0.5 * (room.width() - GAP)).max(0.0);
    let halves = [room.with_max_x(room.left() + width), room.with_min_x(room.right() - width)];
    let (own, mut of_other) = (views.place(), Vec::new());
    let mut places = halves;
    // A press makes a view active, and picks no point.
    *has_turned &= ui.input(|input| input.pointer.any_down() || input.pointer.any_released());
    for (index, (half, place)) in halves.into_iter().zip(&mut places).enumerate() {
        let mut part = ui.new_child(UiBuilder::new().id_salt(("view", index)).max_rect(half));
        let mut found = Vec::new();
        let is_active = index == own;
        let session = if is_active { active } else { other };
        let response = viewport::show(&mut part, session, painted[index], overlays, &mut found);
        *place = response.rect;
        if is_active {
            let stroke = Stroke::new(GAP, ui.visuals().selection.bg_fill);
            part.painter().rect_stroke(*place, 0.0, stroke, StrokeKind::Inside);
            actions.extend(found.into_iter().filter(|action| !(*has_turned && *action == Action::Pick)));
        } else {
            let (pointing, used): (Vec<_>, Vec<_>) =
                found.into_iter().partition(|action| matches!(action, Action::PointAt(_)));
            of_other.extend(pointing);
            // Not through what lies over the picture.
            let is_pressed = response.is_pointer_button_down_on();
            if is_pressed || !used.is_empty() {
                *has_turned = true;
                actions.push(Action::View(ViewAction::Turn));
                actions.extend(used);
            }
        }
    }
    ui.advance_cursor_after_rect(room);
    Pictures { places, beside: of_other }
}

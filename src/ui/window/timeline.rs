//! The timeline: steps, which of them are in memory, and playback controls.

use super::preview::Preview;
use super::strip::{self, Strip};
use super::widgets::{Symbol, chosen, icon, labelled, number, symbol, toggle, wide_number};
use super::{export, key_boxes, quality, tracks};
use crate::playback::{Command, Direction, Loop, Mode, State, StepRange};
use crate::ui::exporting::ExportAction;
use crate::ui::tracks::place_of;
use crate::ui::{Action, Session};
use eframe::egui;
use egui::{DragValue, Pos2, Rangef, Rect, Role, Slider, Stroke, Ui, WidgetInfo, pos2};

/// Height of the strips for steps in memory and for the range.
const STRIP: f32 = 4.0;

/// Pictures of the timeline.
#[derive(Default)]
pub(super) struct Pictures {
    preview: Preview,
    strip: Strip,
}

/// Shows the timeline; `shows_side` is toggled by its button.
pub(super) fn show(
    ui: &mut Ui,
    session: &mut Session,
    shows_side: &mut bool,
    pictures: &mut Pictures,
    actions: &mut Vec<Action>,
) {
    let state = session.state();
    ui.add_space(4.0);
    let names = egui::Margin { left: tracks::names_width(session) as i8, ..egui::Margin::ZERO };
    let (slider, way) =
        egui::Frame::NONE.inner_margin(names).show(ui, |ui| scrub(ui, session, &state, pictures, actions)).inner;
    tracks::show(ui, session, way, actions);
    playhead(ui, session, way, slider.bottom()..=ui.min_rect().bottom());
    key_boxes::show(ui, session, actions);
    ui.horizontal_wrapped(|ui| {
        transport(ui, &state, actions);
        ui.separator();
        place(ui, session, &state, actions);
        tracks::add_menu(ui, session, actions);
        ui.separator();
        quality::show(ui, session, actions);
        ui.separator();
        pace(ui, &state, actions);
        ui.separator();
        range(ui, &state, actions);
        ui.separator();
        if toggle(ui, "panel", "Side panel", *shows_side).clicked() {
            *shows_side = !*shows_side;
        }
        if icon(ui, "save picture", "Screenshot (S)", true).clicked() {
            actions.push(Action::Screenshot);
        }
        if icon(ui, "export", "Export images or a movie (Ctrl E)", true).clicked() {
            actions.push(Action::Export(ExportAction::Dialog));
        }
        if icon(ui, "?", "Help (H)", true).clicked() {
            actions.push(Action::Help);
        }
        export::progress(ui, session, actions);
    });
    ui.add_space(4.0);
}

/// A line through strips and tracks at the moment shown.
fn playhead(ui: &Ui, session: &Session, way: Rangef, range: std::ops::RangeInclusive<f32>) {
    let times = &session.series().times().values;
    if let Some(at) = session.moment() {
        let share = place_of(times, at) / times.len().saturating_sub(1).max(1) as f64;
        let stroke = Stroke::new(1.0, ui.visuals().warn_fg_color.gamma_multiply(0.7));
        ui.painter().vline(egui::lerp(way, share as f32), range, stroke);
    }
}

/// The slider over all steps, and below it the strips. Returns the slider's place, and the way of its handle.
fn scrub(
    ui: &mut Ui,
    session: &mut Session,
    state: &State,
    pictures: &mut Pictures,
    actions: &mut Vec<Action>,
) -> (Rect, Rangef) {
    let last = state.steps.saturating_sub(1);
    let at = state.frame.map_or(0, |frame| frame.step());
    let mut step = at;
    ui.spacing_mut().slider_width = ui.available_width() - ui.spacing().item_spacing.x;
    let slider = Slider::new(&mut step, 0..=last.max(1)).show_value(false).step_by(1.0);
    let response = labelled(ui.add_enabled(last > 0, slider), "Step slider");
    // The handle's track is shorter than the slider by its size, as egui draws it.
    let inset = response.rect.height() / 2.5;
    let way = response.rect.x_range().shrink(inset);
    let size = egui::vec2(ui.available_width(), 2.0 * STRIP + strip::HEIGHT);
    let (place, values) = ui.allocate_exact_size(size, egui::Sense::click_and_drag());
    values.widget_info(|| {
        WidgetInfo::labeled(Role::Image, true, "Least, mean and greatest value of each step, over its histogram")
    });
    let memory = place.with_max_y(place.top() + 2.0 * STRIP);
    strip::draw(ui, &mut pictures.strip, place.with_min_y(memory.bottom()), way, session);
    strips(ui, memory, way, session, state);
    let step_at = |at: Pos2| {
        let share = ((at.x - way.min) / way.span().max(1.0)).clamp(0.0, 1.0);
        (f64::from(share) * last as f64).round() as usize
    };
    // A slider only detects drags, and there is none if the button is released before the next pass.
    let click = ui.interact(response.rect, response.id.with("click"), egui::Sense::CLICK);
    let is_short = click.clicked() && last > 0 && !response.drag_stopped();
    let is_held = values.is_pointer_button_down_on() || values.clicked();
    let on_slider = click.interact_pointer_pos().filter(|_| is_short);
    if let Some(at) = on_slider.or(values.interact_pointer_pos().filter(|_| is_held)) {
        step = step_at(at);
    }
    if step != at || (is_held && state.frame.is_none()) {
        actions.push(Action::Play(Command::SeekStep(step)));
    }
    let under = response.hover_pos().or(values.hover_pos()).filter(|_| last > 0).map(step_at);
    let place = response.rect;
    pictures.preview.show(session, under, &response.union(values));
    (place, way)
}

/// Strips for steps in memory and for the played range; the first step is at the start of `way`, the last one at its end.
fn strips(ui: &Ui, place: Rect, way: Rangef, session: &Session, state: &State) {
    let last = state.steps.saturating_sub(1);
    let x = |step: f64| egui::lerp(way, (step / last.max(1) as f64).clamp(0.0, 1.0) as f32);
    let visuals = ui.visuals();
    let (there, played, missing) =
        (visuals.selection.bg_fill, visuals.warn_fg_color, visuals.widgets.noninteractive.bg_fill);
    let bar = |from: f64, to: f64, row: f32, color| {
        let (top, min_width) = (place.top() + row * STRIP, 1.0);
        let (left, right) = (x(from), x(to).max(x(from) + min_width));
        ui.painter().rect_filled(Rect::from_min_max(pos2(left, top), pos2(right, top + STRIP - 1.0)), 0.0, color);
    };
    bar(0.0, last as f64, 0.0, missing);
    let pixels = (way.span() * ui.pixels_per_point()).max(1.0) as usize;
    for (from, to) in resident_runs(state.steps, pixels, |step| session.series().is_resident(step)) {
        bar(from as f64 - 0.5, to as f64 + 0.5, 0.0, there);
    }
    if let Some(StepRange { a, b }) = state.settings.range {
        bar(a as f64, b as f64, 1.0, played);
    }
}

/// Runs of steps in memory, first and last; of more steps than pixels, only as many are checked.
fn resident_runs(steps: usize, pixels: usize, is_resident: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let stride = steps.div_ceil(pixels.max(1)).max(1);
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for step in (0..steps).step_by(stride).filter(|&step| is_resident(step)) {
        let end = (step + stride - 1).min(steps - 1);
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == step => *last = end,
            _ => runs.push((step, end)),
        }
    }
    runs
}

/// Buttons: first, back, reverse play, stop, play or pause, forward, last.
fn transport(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    let play = |direction, drawn, name| match state.playing && state.heading == direction {
        true => (Symbol::Pause, "Pause (Space)", true, vec![Command::Pause]),
        false => (drawn, name, false, vec![Command::Direction(direction), Command::Play]),
    };
    let buttons = [
        (Symbol::First, "First step (Home)", false, vec![Command::SeekStep(0)]),
        (Symbol::StepBack, "One step back (Left)", false, vec![Command::Step(-1)]),
        play(Direction::Backward, Symbol::Backwards, "Play backwards"),
        (Symbol::Stop, "Stop", false, vec![Command::Stop]),
        play(Direction::Forward, Symbol::Play, "Play"),
        (Symbol::StepOn, "One step on (Right)", false, vec![Command::Step(1)]),
        (Symbol::Last, "Last step (End)", false, vec![Command::SeekStep(usize::MAX)]),
    ];
    for (drawn, name, is_on, commands) in buttons {
        if symbol(ui, drawn, name, is_on).clicked() {
            actions.extend(commands.into_iter().map(Action::Play));
        }
    }
}

/// Boxes that show and edit step and time.
fn place(ui: &mut Ui, session: &Session, state: &State, actions: &mut Vec<Action>) {
    let last = state.steps.saturating_sub(1);
    let at = state.frame.map_or(0, |frame| frame.step());
    let mut step = at;
    ui.label("step");
    let width = 24.0 + 15.0 * last.to_string().len() as f32;
    wide_number(ui, width, DragValue::new(&mut step).range(0..=last).suffix(format!(" / {last}")), "Step");
    if step != at {
        actions.push(Action::Play(Command::SeekStep(step)));
    }
    let times = &session.series().times().values;
    if let (Some(shown), Some(first), Some(last)) = (state.time, times.first(), times.last()) {
        let mut time = shown;
        ui.label("time");
        let speed = ((last - first) / 500.0).max(f64::MIN_POSITIVE);
        // While playing, the box would move away from the mouse.
        let value = DragValue::new(&mut time)
            .speed(speed)
            .range(*first..=*last)
            .custom_formatter(|t, _| super::overlay::number(t));
        let response = wide_number(ui, 76.0, value, "Time");
        if response.changed() && time != shown {
            actions.push(Action::Play(Command::SeekTime(time)));
        }
    }
}

/// Controls of mode, speed, stride and loop.
fn pace(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    let settings = state.settings;
    let modes = [
        (Mode::EveryStep, "every step"),
        (Mode::RealTime, "real time"),
        (Mode::AsFastAsPossible, "as fast as possible"),
    ];
    let mode = chosen(ui, "Mode", settings.mode, &modes);
    actions.extend(mode.map(Command::Mode).map(Action::Play));
    if let Some(shown) = state.speed {
        let mut speed = shown;
        let suffix = if settings.mode == Mode::RealTime { " time/s" } else { " fps" };
        let value = DragValue::new(&mut speed).speed(shown / 100.0).range(shown.min(1e-9)..=1e9).suffix(suffix);
        let response = number(ui, value.custom_formatter(|x, _| super::overlay::number(x)), "Speed ([ and ])");
        if response.changed() && speed != shown {
            actions.push(Action::Play(Command::Speed(speed)));
        }
    }
    if settings.mode == Mode::RealTime {
        let mut interpolate = settings.interpolate;
        if ui.checkbox(&mut interpolate, "interpolate").on_hover_text("Show mixtures of two steps in between").clicked()
        {
            actions.push(Action::Play(Command::Interpolate(interpolate)));
        }
    }
    let mut stride = settings.stride;
    let value = DragValue::new(&mut stride).range(1..=state.steps.max(1)).prefix("stride ").speed(0.05);
    number(ui, value, "Stride: only every so many-th step");
    if stride != settings.stride {
        actions.push(Action::Play(Command::Stride(stride)));
    }
    let loops =
        [(Loop::Off, "no loop"), (Loop::All, "loop all"), (Loop::Range, "loop range"), (Loop::PingPong, "ping-pong")];
    let repeat = chosen(ui, "Loop", settings.repeat, &loops);
    actions.extend(repeat.map(Command::Loop).map(Action::Play));
}

/// Controls of the played range.
fn range(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    if icon(ui, "A", "Play from here (I)", true).clicked() {
        actions.push(Action::RangeFromHere);
    }
    if icon(ui, "B", "Play up to here (O)", true).clicked() {
        actions.push(Action::RangeToHere);
    }
    if let Some(StepRange { a, b }) = state.settings.range {
        ui.label(format!("{a}..{b}"));
        if icon(ui, "×", "Play all steps", true).clicked() {
            actions.push(Action::Play(Command::Range(None)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_what_is_in_memory() {
        let there = |step: usize| (2..5).contains(&step) || step == 9;
        assert_eq!(resident_runs(10, 100, there), [(2, 4), (9, 9)]);
        assert_eq!(resident_runs(10, 5, |step| step < 4), [(0, 3)]);
        assert_eq!(resident_runs(0, 100, |_| true), []);
        assert_eq!(resident_runs(7, 3, |_| true), [(0, 6)]);
    }
}

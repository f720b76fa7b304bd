//! Text over the picture: the field and its error, the time, the legend.

use super::painted::Painted;
use super::{axes, widgets};
use crate::export::annotate::ticks::ticks;
use crate::pipeline::FrameTime;
use crate::store::StoredField;
use crate::transfer::MappedRange;
use crate::ui::{Session, shortfall};
use eframe::egui;
use egui::{Align2, Color32, FontId, Mesh, Painter, Pos2, Rect, Shape, Stroke, StrokeKind, Ui, pos2, vec2};

const MARGIN: f32 = 12.0;
const TEXT: f32 = 14.0;
const LINE: f32 = 1.3 * TEXT;
/// Width of the colour bar, and its height as a share of the picture's.
const BAR: (f32, f32) = (16.0, 0.5);
/// Smallest picture with a legend, points.
const LEGEND_ROOM: (f32, f32) = (260.0, 160.0);
/// Smallest height of a picture with legend and axes, points.
const AXES_ROOM: f32 = 420.0;
/// Largest length of field names over the picture and at the legend; longer ones are cut.
const NAME: (usize, usize) = (60, 20);

/// Shortens a text to at most `most` characters.
pub(super) fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    text.chars().take(most.saturating_sub(1)).chain(['…']).collect()
}

/// The error of a field's values against the source, as text.
pub(super) fn quality(field: &StoredField) -> String {
    match &field.quality {
        Some(quality) => {
            let units = field.units.as_deref().map_or(String::new(), |units| format!(" {units}"));
            format!("errors up to {}{units}", number(quality.max_error))
        }
        None if field.magnitude_of.is_empty() => "lossless".to_owned(),
        None => format!("computed from {}", field.magnitude_of.join(", ")),
    }
}

/// A number as a short text.
pub(super) fn number(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{x:.3e}");
    }
    // Four significant digits.
    let decimals = (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Time and step of a picture.
fn moment(session: &Session, frame: FrameTime) -> String {
    let state = session.state();
    let time = number(frame.time(session.series().times()));
    match frame.toward() {
        None => format!("t = {time}   step {} of {}", frame.step(), state.steps.saturating_sub(1)),
        Some((next, _)) => format!("t = {time}   between steps {} and {next}", frame.step()),
    }
}

/// A text that describes the picture.
pub(super) fn description(session: &Session, painted: Option<Painted>) -> String {
    let field = session.series().field();
    let moment = painted.map_or("no step".to_owned(), |painted| moment(session, painted.time));
    format!("Picture of {}, {moment}, {}", field.titled(), quality(field))
}

/// Optional overlays of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Overlays {
    pub(super) axes: bool,
    pub(super) bounding_box: bool,
    pub(super) legend: bool,
}

impl Default for Overlays {
    fn default() -> Self {
        // Only the box shows where a mostly transparent volume ends.
        Self { axes: true, bounding_box: true, legend: true }
    }
}

/// Draws over the picture at `rect`.
pub(super) fn show(ui: &Ui, rect: Rect, session: &Session, painted: Option<Painted>, overlays: Overlays) {
    let painter = ui.painter().with_clip_rect(rect);
    let (ink, halo) = inks(session.background());
    let write = |at: Pos2, align: Align2, text: &str| write(&painter, session.background(), at, align, text);
    let field = session.series().field();
    let inner = rect.shrink(MARGIN);
    write(inner.left_top(), Align2::LEFT_TOP, &shortened(&field.titled(), NAME.0));
    write(inner.left_top() + vec2(0.0, LINE), Align2::LEFT_TOP, &quality(field));
    let camera = &session.camera();
    if overlays.bounding_box {
        axes::bounding_box(&painter, rect, camera, session.series().mesh().frame(), ink);
    }
    // Below the legend.
    if overlays.axes && rect.width() >= LEGEND_ROOM.0 && rect.height() >= AXES_ROOM {
        let room = vec2(axes::ORIENTATION_ROOM, axes::ORIENTATION_ROOM);
        axes::orientation(&painter, inner.right_bottom() - room, camera, halo);
    }
    match painted {
        Some(painted) => write(inner.left_bottom(), Align2::LEFT_BOTTOM, &moment(session, painted.time)),
        None if session.state().steps == 0 => write(rect.center(), Align2::CENTER_CENTER, "this series has no steps"),
        None if session.notices().is_empty() => {
            write(rect.center(), Align2::CENTER_CENTER, "rendering the first frame");
        }
        None => write(rect.center(), Align2::CENTER_CENTER, "no picture of this step"),
    }
    let lines = shortfall(&session.state()).into_iter().chain(session.lacks().filter(|_| painted.is_some()));
    for (above, line) in (1_u8..).zip(lines) {
        write(inner.left_bottom() - vec2(0.0, f32::from(above) * LINE), Align2::LEFT_BOTTOM, &line);
    }
    if overlays.legend {
        legends(ui, rect, session);
    }
}

/// The meaning of the field's colours, and below of those of the flow.
fn legends(ui: &Ui, rect: Rect, session: &Session) {
    let flow = session.flow_bar().filter(|_| rect.height() >= 2.0 * LEGEND_ROOM.1);
    let (count, background) = (1 + usize::from(flow.is_some()), session.background());
    if let Some((range, color)) = session.legend() {
        color_bar(ui, rect, (0, count), background, &range, &session.series().field().titled(), color);
    }
    if let Some(bar) = flow {
        color_bar(ui, rect, (1, count), background, &bar.range, &bar.title, |position| bar.map.eval(position));
    }
}

/// Writes a text over a background, with a halo.
fn write(painter: &Painter, background: [f32; 3], at: Pos2, align: Align2, text: &str) {
    let ((ink, halo), font) = (inks(background), FontId::proportional(TEXT));
    for offset in [vec2(1.0, 1.0), vec2(-1.0, 1.0), vec2(1.0, -1.0), vec2(-1.0, -1.0)] {
        painter.text(at + offset, align, text, font.clone(), halo.gamma_multiply(0.5));
    }
    painter.text(at, align, text, font, ink);
}

/// Writes lines of text into the upper left corner of a picture.
pub(super) fn lines(ui: &Ui, rect: Rect, background: [f32; 3], lines: &[String]) {
    let painter = ui.painter().with_clip_rect(rect);
    let mut at = rect.shrink(MARGIN).left_top();
    for line in lines {
        write(&painter, background, at, Align2::LEFT_TOP, line);
        at.y += LINE;
    }
}

/// The meaning of colours by positions 0..=1 of a range, on the right of a picture that has the room: one of several bars, one below the
/// other.
pub(super) fn color_bar(
    ui: &Ui,
    rect: Rect,
    (index, count): (usize, usize),
    background: [f32; 3],
    range: &MappedRange,
    title: &str,
    color: impl Fn(f64) -> [f64; 3],
) {
    if rect.width() < LEGEND_ROOM.0 || rect.height() < LEGEND_ROOM.1 {
        return;
    }
    let (painter, inner) = (ui.painter().with_clip_rect(rect), rect.shrink(MARGIN));
    let (ink, _) = inks(background);
    let height = BAR.1 * rect.height() / count as f32;
    // The lines above a bar are between it and the one before.
    let from_middle = (index as f32 - 0.5 * (count as f32 - 1.0)) * (height + 3.0 * LINE);
    let center = pos2(inner.right() - 0.5 * BAR.0, rect.center().y + from_middle);
    let bar = Rect::from_center_size(center, vec2(BAR.0, height));
    painter.add(vertical_strip(bar, color));
    painter.rect_stroke(bar, 0.0, Stroke::new(1.0, ink), StrokeKind::Outside);
    let write = |at: Pos2, align: Align2, text: &str| write(&painter, background, at, align, text);
    legend(&painter, ink, bar, range, &shortened(title, NAME.1), &write);
}

/// The legend: a colour bar with numbers beside it, and above it the quantity and the numbers' common factor.
fn legend(
    painter: &Painter,
    ink: Color32,
    bar: Rect,
    range: &MappedRange,
    title: &str,
    write: &dyn Fn(Pos2, Align2, &str),
) {
    let found = ticks(range);
    let mut free_below = f32::INFINITY;
    for tick in &found.ticks {
        let y = bar.bottom() - range.position_of(tick.scalar).clamp(0.0, 1.0) as f32 * bar.height();
        painter.hline(bar.left() - 4.0..=bar.left(), y, Stroke::new(1.0, ink));
        // Skipped if it would touch the number below.
        if y < free_below {
            write(pos2(bar.left() - 7.0, y), Align2::RIGHT_CENTER, &tick.label);
            free_below = y - LINE;
        }
    }
    let factor = found.factor();
    let mut y = bar.top() - 8.0;
    for line in [factor.as_str(), title].into_iter().filter(|line| !line.is_empty()) {
        write(pos2(bar.right(), y), Align2::RIGHT_BOTTOM, line);
        y -= LINE;
    }
}

/// Marks a position in the picture.
pub(super) fn cross(ui: &Ui, rect: Rect, at: Pos2, background: [f32; 3]) {
    let painter = ui.painter().with_clip_rect(rect);
    let (ink, halo) = inks(background);
    for (width, color) in [(3.0, halo.gamma_multiply(0.6)), (1.0, ink)] {
        painter.hline(at.x - 7.0..=at.x + 7.0, at.y, Stroke::new(width, color));
        painter.vline(at.x, at.y - 7.0..=at.y + 7.0, Stroke::new(width, color));
    }
}

/// A text colour readable over a background, and its halo.
fn inks([r, g, b]: [f32; 3]) -> (Color32, Color32) {
    let is_dark = 0.299 * r + 0.587 * g + 0.114 * b < 0.5;
    if is_dark { (Color32::WHITE, Color32::BLACK) } else { (Color32::BLACK, Color32::WHITE) }
}

/// A strip of colours, upwards.
fn vertical_strip(rect: Rect, rgb: impl Fn(f64) -> [f64; 3]) -> Shape {
    strip(rect, rgb, |position| {
        let y = rect.bottom() - position * rect.height();
        [pos2(rect.left(), y), pos2(rect.right(), y)]
    })
}

/// A strip of colours, from left to right.
pub(super) fn horizontal_strip(rect: Rect, rgb: impl Fn(f64) -> [f64; 3]) -> Shape {
    strip(rect, rgb, |position| {
        let x = rect.left() + position * rect.width();
        [pos2(x, rect.top()), pos2(x, rect.bottom())]
    })
}

fn strip(rect: Rect, rgb: impl Fn(f64) -> [f64; 3], corners: impl Fn(f32) -> [Pos2; 2]) -> Shape {
    let mut mesh = Mesh::default();
    let parts = (rect.width().max(rect.height()).ceil().clamp(1.0, 512.0)) as u32;
    for i in 0..=parts {
        let position = i as f32 / parts as f32;
        let color = widgets::color(rgb(f64::from(position)).map(|c| c as f32));
        corners(position).into_iter().for_each(|corner| mesh.colored_vertex(corner, color));
        if i > 0 {
            let first = 2 * i - 2;
            mesh.add_triangle(first, first + 1, first + 2);
            mesh.add_triangle(first + 1, first + 2, first + 3);
        }
    }
    Shape::mesh(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_are_cut() {
        assert_eq!((shortened("pressure", 8), shortened("pressure_total", 8)), ("pressure".into(), "pressur…".into()));
    }

    #[test]
    fn numbers_have_four_digits_that_count() {
        let texts = [0.0, 1.0, -12.345678, 99999.0, 123456.0, 0.0123456, 1e-5, 0.5].map(number);
        assert_eq!(texts, ["0", "1", "-12.35", "99999", "1.235e5", "0.01235", "1.000e-5", "0.5"]);
    }
}

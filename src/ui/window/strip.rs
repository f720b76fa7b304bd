//! The values of each step below the timeline: least, mean and greatest, before an image of the histogram of each step.

use crate::ui::Session;
use crate::ui::strip::StripImage;
use crate::ui::survey::{STEP_BINS, Surveyed};
use eframe::egui;
use egui::{Color32, ColorImage, Mesh, Pos2, Rangef, Rect, Shape, Stroke, TextureHandle, TextureOptions, Ui, pos2};
use std::sync::Arc;

/// Height of the strip in points.
pub(super) const HEIGHT: f32 = 30.0;

/// Values of the steps in one column of pixels: least and greatest, and the mean of their means.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Column {
    lo: f64,
    hi: f64,
    mean: Option<f64>,
}

/// The image: not made again before there is another survey.
#[derive(Default)]
pub(super) struct Strip {
    made: Option<Made>,
}

/// An image on the GPU, and its survey; without steps there is no image.
struct Made {
    survey: Arc<Surveyed>,
    image: Option<(StripImage, TextureHandle)>,
}

/// Opacity of the band from least to greatest value, and of the most frequent values of the image.
const BAND: f32 = 0.15;
const IMAGE: f32 = 0.75;

impl Strip {
    /// Draws the image into `rect`, with the first and the last step at the ends of `way`.
    fn draw_image(&mut self, ui: &Ui, rect: Rect, way: Rangef, survey: &Arc<Surveyed>) {
        if self.made.as_ref().is_none_or(|made| !Arc::ptr_eq(&made.survey, survey)) {
            let image = StripImage::of(survey).map(|image| {
                let pixels = image.shades.iter().map(|&shade| Color32::from_white_alpha(shade)).collect();
                let pixels = ColorImage::new([image.columns, STEP_BINS], pixels);
                let texture = ui.ctx().load_texture("histograms of the steps", pixels, TextureOptions::LINEAR);
                (image, texture)
            });
            self.made = Some(Made { survey: survey.clone(), image });
        }
        let Some(Made { image: Some((image, texture)), .. }) = &self.made else { return };
        let [first, last] = image.ends(survey.steps.len());
        let uv = Rect::from_min_max(pos2(first, 0.0), pos2(last, 1.0));
        let place = Rect::from_x_y_ranges(way, rect.y_range()).shrink2(egui::vec2(0.0, 1.0));
        ui.painter().image(texture.id(), place, uv, ui.visuals().text_color().gamma_multiply(IMAGE));
    }
}

/// Draws the strip into `rect`; the first step is at the start of `way`, the last one at its end.
pub(super) fn draw(ui: &Ui, strip: &mut Strip, rect: Rect, way: Rangef, session: &Session) {
    let series = session.series();
    let Some([lo, hi]) = series.field().range.map(|range| range.map(f64::from)) else { return };
    let steps = series.times().len();
    let columns = (way.span() * ui.pixels_per_point()).max(1.0) as usize;
    let survey = session.survey();
    strip.draw_image(ui, rect, way, &survey);
    let found = columns_of(steps, columns, |step| value(session, &survey, step));
    let y = |value: f64| {
        let place = if hi > lo { (value - lo) / (hi - lo) } else { 0.5 };
        egui::lerp(rect.bottom() - 1.0..=rect.top() + 1.0, place.clamp(0.0, 1.0) as f32)
    };
    let x = |step: f64| egui::lerp(way, (step / steps.saturating_sub(1).max(1) as f64) as f32);
    let ink = ui.visuals().text_color();
    let mut band = Mesh::default();
    let mut means: Vec<Pos2> = Vec::new();
    let flush = |band: &mut Mesh, means: &mut Vec<Pos2>| {
        if let [top, bottom] = &*band.vertices {
            // A single step between gaps.
            ui.painter().line_segment([top.pos, bottom.pos], Stroke::new(2.0, top.color));
        }
        ui.painter().add(Shape::mesh(std::mem::take(band)));
        ui.painter().line(std::mem::take(means), Stroke::new(1.5, ink));
    };
    for (at, column) in found {
        let Some(column) = column else {
            // A step without values is a gap.
            flush(&mut band, &mut means);
            continue;
        };
        add_column(&mut band, x(at), [y(column.hi) - 0.5, y(column.lo) + 0.5], ink.gamma_multiply(BAND));
        means.extend(column.mean.map(|mean| pos2(x(at), y(mean))));
    }
    flush(&mut band, &mut means);
}

fn add_column(band: &mut Mesh, x: f32, ends: [f32; 2], color: Color32) {
    let first = band.vertices.len() as u32;
    ends.into_iter().for_each(|y| band.colored_vertex(pos2(x, y), color));
    if first > 0 {
        band.add_triangle(first - 2, first - 1, first);
        band.add_triangle(first - 1, first, first + 1);
    }
}

/// Values of a step, as far as known.
fn value(session: &Session, survey: &Surveyed, step: usize) -> Option<Column> {
    let field = session.series().field();
    let [lo, hi] = field.range_per_step.get(step).copied().flatten()?.map(f64::from);
    let surveyed = survey.steps.get(step).and_then(Option::as_ref);
    Some(Column { lo, hi, mean: surveyed.map(|step| step.mean) })
}

/// Groups steps into at most `columns` columns: position of each, in steps, and its values.
fn columns_of(
    steps: usize,
    columns: usize,
    value: impl Fn(usize) -> Option<Column>,
) -> impl Iterator<Item = (f64, Option<Column>)> {
    let per_column = steps.div_ceil(columns.max(1)).max(1);
    (0..steps).step_by(per_column).map(move |first| {
        let last = (first + per_column - 1).min(steps - 1);
        let known: Vec<Column> = (first..=last).filter_map(&value).collect();
        let means: Vec<f64> = known.iter().filter_map(|column| column.mean).collect();
        let all = known.into_iter().reduce(|a, b| Column { lo: a.lo.min(b.lo), hi: a.hi.max(b.hi), mean: None });
        let mean = (!means.is_empty()).then(|| means.iter().sum::<f64>() / means.len() as f64);
        ((first + last) as f64 / 2.0, all.map(|all| Column { mean, ..all }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_that_share_a_pixel_keep_their_least_and_greatest_value() {
        let value = |step: usize| {
            let s = step as f64;
            (step != 4).then_some(Column { lo: -s, hi: s, mean: step.is_multiple_of(2).then_some(s) })
        };
        let all: Vec<_> = columns_of(5, 10, value).collect();
        assert_eq!(all.len(), 5);
        assert_eq!((all[3], all[4]), ((3.0, Some(Column { lo: -3.0, hi: 3.0, mean: None })), (4.0, None)));
        let two: Vec<_> = columns_of(5, 2, value).collect();
        assert_eq!(two[0], (1.0, Some(Column { lo: -2.0, hi: 2.0, mean: Some(1.0) })));
        assert_eq!(two[1], (3.5, Some(Column { lo: -3.0, hi: 3.0, mean: None })));
        assert_eq!(columns_of(0, 10, value).count(), 0);
    }
}

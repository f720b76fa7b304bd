//! The picture of a histogram, and positions on it.

use crate::histograms::Histogram;
use crate::moments::{Bins, Histogram1d};
use crate::transfer::{MappedRange, RangeMap, Space};
use crate::ui::Session;
use crate::ui::bars::{self, DrawnAxis};
use crate::ui::histograms::{Shown, Steps};
use crate::ui::window::overlay::number;
use eframe::egui;
use egui::{Color32, ColorImage, Mesh, Painter, Pos2, Rect, Shape, TextureHandle, TextureOptions, Ui, pos2};
use std::sync::Arc;

/// Room at the edges of a canvas for handles at its ends, points.
pub(super) const MARGIN: f32 = 4.0;

/// A rectangle of the screen for positions 0..=1 of two axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Canvas {
    pub(super) rect: Rect,
}

impl Canvas {
    /// The canvas within a rectangle, with room for handles at its edges.
    pub(super) fn in_rect(rect: Rect) -> Self {
        Self { rect: rect.shrink(MARGIN) }
    }

    /// The point on the screen of a position.
    pub(super) fn point(&self, [x, y]: [f64; 2]) -> Pos2 {
        let Rect { min, max } = self.rect;
        pos2(egui::lerp(min.x..=max.x, x as f32), egui::lerp(max.y..=min.y, y as f32))
    }

    /// The position of a point on the screen; outside of 0..=1 beyond the edges.
    pub(super) fn position(&self, at: Pos2) -> [f64; 2] {
        [
            f64::from((at.x - self.rect.left()) / self.rect.width().max(1.0)),
            f64::from((self.rect.bottom() - at.y) / self.rect.height().max(1.0)),
        ]
    }

    /// So many points of the screen along both axes.
    pub(super) fn reach(&self, points: f32) -> [f64; 2] {
        [self.rect.width(), self.rect.height()].map(|length| f64::from(points / length.max(1.0)))
    }
}

/// How positions along the first axis are scalars.
#[derive(Clone, Copy)]
pub(super) struct Scales<'a> {
    pub(super) range: &'a MappedRange,
    pub(super) map: &'a RangeMap,
}

impl Scales<'_> {
    /// The first axis of a histogram as it is drawn.
    fn axis(&self, space: Space) -> DrawnAxis<'_> {
        match space {
            Space::Cov => DrawnAxis::Bins(self.map),
            Space::Scalar | Space::ScalarGradient | Space::ScalarCov => DrawnAxis::Values(self.range, self.map),
        }
    }

    /// The value at a position of the first axis, whose bins are needed for all but scalars.
    pub(super) fn value_at(&self, position: f64, space: Space, bins: Option<&Bins>) -> Option<f64> {
        let position = self.map.inverse(position.clamp(0.0, 1.0));
        match space {
            Space::Cov => bins.map(|bins| bins.value_at(position)),
            Space::Scalar | Space::ScalarGradient | Space::ScalarCov => Some(self.range.scalar_at(position)),
        }
    }
}

/// Inputs of a picture; it is made again when one of them changes.
struct Key {
    histogram: Arc<Shown>,
    range: MappedRange,
    map: RangeMap,
    size_px: [usize; 2],
    color: Color32,
}

impl Key {
    fn is_same(&self, other: &Self) -> bool {
        let key = |key: &Self| (key.range, key.size_px, key.color);
        // Compares histograms by pointer, not by content.
        Arc::ptr_eq(&self.histogram, &other.histogram) && key(self) == key(other) && self.map == other.map
    }
}

enum Painted {
    /// Columns over one axis: heights 0..=1.
    Columns(Vec<f32>),
    /// An image over two.
    Image(TextureHandle),
}

/// The picture of the last histogram.
#[derive(Default)]
pub(super) struct HistogramPicture(Option<(Key, Painted)>);

impl HistogramPicture {
    /// Paints a histogram into a canvas.
    pub(super) fn paint(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        canvas: &Canvas,
        (histogram, scales): (&Arc<Shown>, Scales<'_>),
    ) {
        let color = ui.visuals().weak_text_color().gamma_multiply(0.6);
        let size_px =
            [canvas.rect.width(), canvas.rect.height()].map(|s| (s * ui.pixels_per_point()).max(1.0) as usize);
        let (range, map) = (*scales.range, scales.map.clone());
        let key = Key { histogram: histogram.clone(), range, map, size_px, color };
        if !self.0.as_ref().is_some_and(|(last, _)| last.is_same(&key)) {
            let painted = made(ui, &key, scales);
            self.0 = Some((key, painted));
        }
        match &self.0 {
            Some((_, Painted::Columns(heights))) => {
                painter.add(Shape::mesh(columns(canvas, heights, color)));
            }
            Some((_, Painted::Image(texture))) => {
                let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                painter.image(texture.id(), canvas.rect, whole, Color32::WHITE);
            }
            None => {}
        }
    }
}

fn made(ui: &Ui, key: &Key, scales: Scales<'_>) -> Painted {
    let Key { histogram, size_px, color, .. } = key;
    let axis = scales.axis(histogram.kind);
    match &histogram.histogram {
        Histogram::One(one) => Painted::Columns(bars::columns(one, axis, size_px[0]).heights),
        Histogram::Two(two) => {
            let identity = RangeMap::default();
            let shades = bars::image(two, [axis, DrawnAxis::Bins(&identity)], *size_px).heights;
            let pixels = shades.into_iter().map(|shade| color.gamma_multiply(shade)).collect();
            let image = ColorImage::new(*size_px, pixels);
            Painted::Image(ui.ctx().load_texture("histogram", image, TextureOptions::NEAREST))
        }
    }
}

fn columns(canvas: &Canvas, heights: &[f32], color: Color32) -> Mesh {
    let mut mesh = Mesh::default();
    let count = heights.len() as f64;
    for (i, &height) in heights.iter().enumerate().filter(|(_, height)| **height > 0.0) {
        let ends = [canvas.point([i as f64 / count, f64::from(height)]), canvas.point([(i + 1) as f64 / count, 0.0])];
        mesh.add_colored_rect(Rect::from_min_max(ends[0], ends[1]), color);
    }
    mesh
}

/// The values at a position, as text, and how many there are in its bin.
pub(super) fn values_at([x, y]: [f64; 2], histogram: Option<&Shown>, scales: Scales<'_>, space: Space) -> String {
    let counted = histogram.map(|shown| &shown.histogram);
    let bins = counted.map(|counted| match counted {
        Histogram::One(one) => one.bins(),
        Histogram::Two(two) => two.x(),
    });
    let Some(value) = scales.value_at(x, space, bins) else { return String::new() };
    match (space, counted) {
        (Space::Scalar, Some(Histogram::One(one))) => format!("{}: {}", number(value), count_at(one, value)),
        (Space::Cov, Some(Histogram::One(one))) => format!("CoV {}: {}", number(value), count_at(one, value)),
        (_, Some(Histogram::Two(two))) => {
            let second = two.y().value_at(y);
            let bin = two.x().bin(value as f32).zip(two.y().bin(second as f32));
            let count = bin.and_then(|(x, y)| two.counts().get(y * two.x().count() + x)).copied().unwrap_or(0);
            let name = if space == Space::ScalarCov { "CoV" } else { "gradient" };
            format!("{}, {name} {}: {}", number(value), number(second), values(count))
        }
        _ => number(value),
    }
}

/// The number of values in the bin of a value.
fn count_at(histogram: &Histogram1d, value: f64) -> String {
    let bin = histogram.bins().bin(value as f32);
    values(bin.and_then(|bin| histogram.counts().get(bin)).copied().unwrap_or(0))
}

fn values(count: u64) -> String {
    match count {
        1 => "1 value".to_owned(),
        count if count < 100_000 => format!("{count} values"),
        count => format!("{} values", number(count as f64)),
    }
}

/// What the histogram counts, or why there is none.
pub(super) fn status(session: &Session, histogram: Option<&Shown>) -> String {
    if let Some(problem) = session.histogram_problem() {
        return problem.to_owned();
    }
    match histogram.map(|shown| shown.of) {
        Some(Steps::Series { counted, steps }) if counted < steps => format!("values of {counted} of {steps} steps"),
        Some(Steps::Series { steps, .. }) => format!("values of all {steps} steps"),
        Some(Steps::Step(step)) => format!("values of step {step}"),
        None => "counting values".to_owned(),
    }
}

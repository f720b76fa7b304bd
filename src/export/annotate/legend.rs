//! The colour bar: its layout and drawing.

use super::canvas::{Ink, RectPx, fill};
use super::text::{self, CAPITAL_HEIGHT_EM};
use super::ticks::{Ticks, ticks};
use super::{Label, Sizes};
use crate::image::RgbaImage;
use crate::look::ColorBar;
use crate::transfer::{ColorMap, MappedRange};

/// Least height of a bar, in lines of text.
const BAR_LINES_MIN: f32 = 4.0;

/// Largest share of the image's width for the legend.
const WIDTH_SHARE_MAX: f32 = 0.4;

/// A colour bar that fits: vertical, at the right side of the image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Legend {
    /// The coloured rectangle, without its outline.
    pub(super) bar: RectPx,
    /// Labels for field and unit, factor, and numbers.
    pub(super) labels: Vec<Label>,
    /// Rows of the tick marks' centres.
    pub(super) marks: Vec<i64>,
}

impl Legend {
    /// Places the legends of bars one below the other between two rows; those that do not fit are left out, the last ones first.
    pub(super) fn place_all(bars: &[ColorBar], sizes: &Sizes, top: f32, bottom: f32) -> Vec<Self> {
        let place = |bars: &[ColorBar]| -> Option<Vec<Self>> {
            let part = (bottom - top) / bars.len() as f32;
            let place = |(i, bar): (usize, &ColorBar)| {
                let (above, below) = (i as f32 * part, (bars.len() - 1 - i) as f32 * part);
                Self::place(&bar.title, &bar.range, sizes, top + above, bottom - below)
            };
            bars.iter().enumerate().map(place).collect()
        };
        let mut placed = (1..=bars.len()).rev().find_map(|count| place(&bars[..count])).unwrap_or_default();
        let left = placed.iter().map(|legend| legend.bar.left).min().unwrap_or_default();
        placed.iter_mut().for_each(|legend| legend.move_to(left));
        placed
    }

    /// Moves the legend to the left.
    fn move_to(&mut self, left: i64) {
        let by = left - self.bar.left;
        self.bar.left += by;
        self.bar.right += by;
        self.labels.iter_mut().for_each(|label| label.x += by);
    }

    /// Places the legend between rows `top` and `bottom`; `None` if it does not fit.
    fn place(title: &str, range: &MappedRange, sizes: &Sizes, top: f32, bottom: f32) -> Option<Self> {
        let size_px = sizes.text_px;
        let found = ticks(range);
        let widest = found.ticks.iter().map(|t| text::width_px(&t.label, size_px)).fold(0.0, f32::max);
        let (bar_width, gap) = (size_px.round(), (0.55 * size_px).round());
        let column_width = bar_width + gap + widest;
        let width_max = WIDTH_SHARE_MAX * sizes.width_px;
        if column_width > width_max {
            return None;
        }
        let title = text::shorten(title, size_px, width_max).unwrap_or_default();
        let factor = found.factor();
        let width =
            [&title, &factor].map(|line| text::width_px(line, size_px)).iter().fold(column_width, |a, b| a.max(*b));
        let left = (sizes.width_px - sizes.margin_px - width).floor();
        let mut labels = Vec::new();
        let mut baseline = top + sizes.line_px;
        for line in [title, factor].into_iter().filter(|line| !line.is_empty()) {
            labels.push(Label { text: line, x: left as i64, baseline: baseline.round() as i64, size_px });
            baseline += sizes.line_px;
        }
        let has_lines = !labels.is_empty();
        // The numbers extend half a line above and below the bar.
        let bar_top = if has_lines { baseline - 0.4 * sizes.line_px } else { top + 0.5 * sizes.line_px };
        let bar_bottom = bottom - 0.5 * sizes.line_px;
        if bar_bottom - bar_top < BAR_LINES_MIN * sizes.line_px {
            return None;
        }
        let bar = RectPx {
            left: left as i64,
            top: bar_top.round() as i64,
            right: (left + bar_width) as i64,
            bottom: bar_bottom.round() as i64,
        };
        let mut legend = Self { bar, labels, marks: Vec::new() };
        legend.place_ticks(&found, range, sizes, bar.right + gap as i64);
        Some(legend)
    }

    /// Adds a mark per tick, and its label unless that would touch the one below.
    fn place_ticks(&mut self, found: &Ticks, range: &MappedRange, sizes: &Sizes, x: i64) {
        let height = (self.bar.bottom - self.bar.top) as f64;
        let mut free_below = f64::INFINITY;
        for tick in &found.ticks {
            let from_top = (1.0 - range.position_of(tick.scalar).clamp(0.0, 1.0)) * height;
            let row = (self.bar.top + from_top.floor() as i64).min(self.bar.bottom - 1);
            self.marks.push(row);
            if from_top > free_below {
                continue;
            }
            free_below = from_top - f64::from(sizes.line_px);
            let baseline = row + (0.5 * CAPITAL_HEIGHT_EM * sizes.text_px).round() as i64;
            self.labels.push(Label { text: tick.label.clone(), x, baseline, size_px: sizes.text_px });
        }
    }

    /// Draws the legend. The bar has the map's colours, opaque, as in ParaView: opacity depends on distance in a volume, and a bar has no
    /// depth.
    pub(super) fn draw(&self, image: &mut RgbaImage, map: &ColorMap, ink: Ink, sizes: &Sizes) {
        let line = sizes.stroke_px;
        let mark = |row: i64| RectPx {
            left: self.bar.right,
            top: row - (line - 1) / 2 - (1 - line % 2),
            right: self.bar.right + line + (0.3 * sizes.text_px).round() as i64,
            bottom: row + (line - 1) / 2 + 1,
        };
        for &row in &self.marks {
            fill(image, mark(row).grown(sizes.halo_stroke_px()), ink.halo);
        }
        fill(image, self.bar.grown(line + sizes.halo_stroke_px()), ink.halo);
        fill(image, self.bar.grown(line), ink.text);
        self.marks.iter().for_each(|&row| fill(image, mark(row), ink.text));
        let height = (self.bar.bottom - self.bar.top) as f64;
        for row in self.bar.top..self.bar.bottom {
            let position = 1.0 - ((row - self.bar.top) as f64 + 0.5) / height;
            let rgb = map.eval(position).map(|c| c as f32);
            fill(image, RectPx { top: row, bottom: row + 1, ..self.bar }, rgb);
        }
        self.labels.iter().for_each(|label| label.draw(image, ink, sizes));
    }
}

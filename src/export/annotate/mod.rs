//! Time, legend and title, drawn onto frames.
//!
//! [`Annotations`] selects the parts; an [`Annotator`] holds their texts for one series and draws them over its frames: [`Annotator::draw`]
//! composites onto raw accumulators (premultiplied, display-referred), so every output of the colour plane, PNG with or without alpha, a
//! movie or EXR, has the same annotations. Depth is unchanged.
//!
//! Text is 1/36 of the image's height (of three quarters of its width, if that is less) and at least 11 pixels. Parts that do not fit at
//! that size are left out: the legend first (its last bars before the others; if fewer than four lines of text are left for the bar, or its numbers need more than 2/5 of
//! the width), then the title (if it and the time do not fit one above the other, or a few letters side by side), the time last. Texts
//! other than numbers are shortened with an ellipsis.

mod canvas;
mod legend;
mod text;
pub(crate) mod ticks;
mod time;

use crate::image::RgbaImage;
use crate::look::ColorBar;
use canvas::Ink;
use legend::Legend;
use std::fmt;
use std::str::FromStr;
use time::{PREFIX, TimeFormat};

/// Selection of annotations.
///
/// As text: `time`, `legend`, `title` or `title=TEXT`, separated by commas, or `none`. A text may contain commas,
/// unless one of these words follows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Annotations {
    /// Whether to draw the time, bottom left.
    pub time: bool,
    /// Whether to draw the colour bars with field and unit, right.
    pub legend: bool,
    /// The title, top centre.
    pub title: Option<Title>,
}

/// The text of the title.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Title {
    /// Field and dataset.
    FieldAndDataset,
    /// A given text.
    Text(String),
}

/// No annotations.
const NONE: &str = "none";

impl fmt::Display for Annotations {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let title = self.title.as_ref().map(|title| match title {
            Title::FieldAndDataset => "title".to_owned(),
            Title::Text(text) => format!("title={text}"),
        });
        // The title comes last, as its text may contain commas.
        let parts = [self.time.then(|| "time".to_owned()), self.legend.then(|| "legend".to_owned()), title];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        if parts.is_empty() { f.write_str(NONE) } else { f.write_str(&parts.join(",")) }
    }
}

impl FromStr for Annotations {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parsed = Self::default();
        if text == NONE {
            return Ok(parsed);
        }
        for part in text.split(',') {
            let is_repeated = match part.trim() {
                "time" => std::mem::replace(&mut parsed.time, true),
                "legend" => std::mem::replace(&mut parsed.legend, true),
                "title" => parsed.title.replace(Title::FieldAndDataset).is_some(),
                word => match (word.strip_prefix("title="), &mut parsed.title) {
                    (Some(title), before) => before.replace(Title::Text(title.to_owned())).is_some(),
                    (None, Some(Title::Text(title))) => {
                        title.push(',');
                        title.push_str(part);
                        false
                    }
                    _ => {
                        return Err(format!(
                            "'{word}' is no annotation; known are time, legend, title, title=TEXT and none"
                        ));
                    }
                },
            };
            if is_repeated {
                return Err(format!("'{}' is asked for twice", part.trim()));
            }
        }
        Ok(parsed)
    }
}

/// The texts about a series in its annotations.
#[derive(Clone, Copy, Debug)]
pub struct AboutSeries<'a> {
    /// Name of the dataset.
    pub dataset: &'a str,
    /// Name of the field.
    pub field: &'a str,
    /// Times of all steps, increasing.
    pub times: &'a [f64],
    /// Unit of times, if known.
    pub time_units: Option<&'a str>,
}

/// Draws the annotations of a series.
#[derive(Clone, Debug)]
pub struct Annotator {
    time: Option<TimeFormat>,
    /// Whether to draw the colour bars.
    legend: bool,
    title: Option<String>,
    ink: Ink,
}

impl Annotator {
    /// An annotator for frames over `background` (display-referred; `None` if they stay transparent).
    pub fn new(annotations: &Annotations, about: &AboutSeries<'_>, background: Option<[f32; 3]>) -> Self {
        let title = annotations.title.as_ref().map(|title| match title {
            Title::FieldAndDataset => format!("{}, {}", about.field, about.dataset),
            Title::Text(text) => text.clone(),
        });
        Self {
            time: annotations.time.then(|| TimeFormat::new(about.times, about.time_units)),
            legend: annotations.legend,
            title,
            ink: Ink::over(background),
        }
    }

    /// Draws over an image of raw accumulators. Pixels outside of letters, lines and halos are unchanged, bit for bit.
    pub fn draw(&self, image: &mut RgbaImage, time: f64, bars: &[ColorBar]) {
        let sizes = Sizes::of(image.width, image.height);
        let layout = self.layout(&sizes, time, bars);
        for (legend, bar) in layout.legends.iter().zip(bars) {
            legend.draw(image, &bar.map, self.ink, &sizes);
        }
        layout.labels.iter().for_each(|label| label.draw(image, self.ink, &sizes));
    }

    /// The layout of all parts that fit.
    fn layout(&self, sizes: &Sizes, time: f64, bars: &[ColorBar]) -> Layout {
        let mut layout = Layout::default();
        let (mut top, mut bottom) = (sizes.margin_px, sizes.height_px - sizes.margin_px);
        if let Some(format) = &self.time
            && bottom - top >= sizes.line_px
            && let Some(labels) = time_labels(format, sizes, time)
        {
            layout.labels.extend(labels);
            bottom -= sizes.line_px + sizes.margin_px;
        }
        let title_px = 1.25 * sizes.text_px;
        if let Some(title) = &self.title
            && bottom - top >= 1.25 * sizes.line_px
            && let Some(text) = text::shorten(title, title_px, sizes.width_px - 2.0 * sizes.margin_px)
        {
            let x = (0.5 * (sizes.width_px - text::width_px(&text, title_px))).round() as i64;
            let baseline = (top + title_px).round() as i64;
            layout.labels.push(Label { text, x, baseline, size_px: title_px });
            top += 1.25 * sizes.line_px + sizes.margin_px;
        }
        if self.legend {
            // Centred vertically, and no higher than needed.
            let (top, bottom) = (top.max(0.12 * sizes.height_px), bottom.min(0.88 * sizes.height_px));
            layout.legends = Legend::place_all(bars, sizes, top, bottom);
        }
        layout
    }
}

/// The prefix of the time, its number aligned right, and its suffix; `None` if they are wider than the image.
fn time_labels(format: &TimeFormat, sizes: &Sizes, time: f64) -> Option<[Label; 3]> {
    let size_px = sizes.text_px;
    let number = format.number(time);
    let number_start = sizes.margin_px + text::width_px(PREFIX, size_px);
    let number_end = number_start + format.number_width_px(size_px);
    let end = number_end + text::width_px(format.suffix(), size_px);
    if end > sizes.width_px - sizes.margin_px {
        return None;
    }
    let baseline = (sizes.height_px - sizes.margin_px - 0.25 * size_px).round() as i64;
    let label = |text: &str, x: f32| Label { text: text.to_owned(), x: x.round() as i64, baseline, size_px };
    let number_x = number_end - text::width_px(&number, size_px);
    Some([label(PREFIX, sizes.margin_px), label(&number, number_x), label(format.suffix(), number_end)])
}

/// The layout of all parts, without colours.
#[derive(Clone, Debug, Default, PartialEq)]
struct Layout {
    labels: Vec<Label>,
    /// Those of the first bars.
    legends: Vec<Legend>,
}

/// A line of text and its pen position.
#[derive(Clone, Debug, PartialEq)]
struct Label {
    text: String,
    x: i64,
    baseline: i64,
    size_px: f32,
}

impl Label {
    fn draw(&self, image: &mut RgbaImage, ink: Ink, sizes: &Sizes) {
        text::coverage(&self.text, self.size_px).draw(image, (self.x, self.baseline), ink, sizes.halo_px);
    }
}

/// Lengths derived from the size of the image.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    width_px: f32,
    height_px: f32,
    /// Font size: one em.
    text_px: f32,
    /// Line spacing, from baseline to baseline.
    line_px: f32,
    /// Margin at the sides of the image.
    margin_px: f32,
    /// Radius of halos.
    halo_px: f32,
    /// Thickness of lines.
    stroke_px: i64,
}

/// Text height as a share of the image's height.
const TEXT_SHARE: f32 = 1.0 / 36.0;

/// The smallest font size that is legible without hinting.
const TEXT_PX_MIN: f32 = 11.0;

impl Sizes {
    fn of(width: usize, height: usize) -> Self {
        let (width_px, height_px) = (width as f32, height as f32);
        let text_px = (TEXT_SHARE * height_px.min(0.75 * width_px)).max(TEXT_PX_MIN).round();
        Self {
            width_px,
            height_px,
            text_px,
            line_px: 1.3 * text_px,
            margin_px: (0.8 * text_px).round(),
            halo_px: (text_px / 14.0).max(1.0),
            stroke_px: ((text_px / 16.0).round() as i64).max(1),
        }
    }

    /// Thickness of the halo of lines.
    fn halo_stroke_px(&self) -> i64 {
        self.halo_px.round() as i64
    }
}

#[cfg(test)]
mod tests;

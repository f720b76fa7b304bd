//! Widgets (dissertation 7.1): shapes over a histogram that give colour and opacity.
//!
//! Plain values in axis positions 0..=1: x to the right, y upwards. A shape includes its left and lower edges, but its right and upper ones
//! only at the end of the axis: positions outside of 0..=1 count as its ends. So adjacent shapes neither overlap nor leave a gap. Outside
//! of its shape a widget is transparent and black.

mod polyline;
mod rectangle;
mod triangle;

pub use polyline::{Polyline, PolylinePoint};
pub use rectangle::Rectangle;
pub use triangle::Triangle;

use super::blend::MoreOpaque;
use super::curve::Curve;
use super::opacity::OpacityKind;
use super::pieces::{ColorWeighting, Pieces};
use super::profile::{ProfilePoint, Side};
use serde::{Deserialize, Serialize};

/// A shape with colour and opacity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Widget {
    /// One colour, and a ramp of opacity from left to right; on one axis (y is ignored) or two.
    Rectangle(Rectangle),
    /// One colour and one opacity; on two axes.
    Triangle(Triangle),
    /// One colour; opacity falls off linearly from the centre line to the sides, as the widget of Kniss et al. does. On two
    /// axes.
    TriangleWithFallOff(Triangle),
    /// Points with a colour and, as their height, an opacity; linear between them. On one axis.
    Polyline(Polyline),
}

/// The part of a widget under the pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A handle, by its index in [`Widget::handles`].
    Handle(usize),
    /// The edge from the handle of this index to the next one.
    Edge(usize),
    /// The inside.
    Body,
}

/// Least distance between two edges of a widget after editing: far below a pixel of any screen.
pub(super) const GAP: f64 = 1.0 / 1_048_576.0;

impl Widget {
    /// Colour and opacity at a position (x, y), on two axes.
    pub fn eval(&self, x: f64, y: f64) -> ([f64; 3], f64) {
        let side = self.side(x, Some(y));
        (side.rgb, side.value)
    }

    /// Colour and opacity at a position, on one axis.
    pub fn eval_on_line(&self, x: f64) -> ([f64; 3], f64) {
        let side = self.side(x, None);
        (side.rgb, side.value)
    }

    fn side(&self, x: f64, y: Option<f64>) -> Side {
        let (x, y) = (x.clamp(0.0, 1.0), y.map(|y| y.clamp(0.0, 1.0)));
        match self {
            Self::Rectangle(r) if y.is_none_or(|y| covers(r.y, y)) => r.side(x),
            Self::Polyline(p) => p.side(x),
            Self::Triangle(t) => y.map_or(Side::TRANSPARENT, |y| t.side(x, y, false)),
            Self::TriangleWithFallOff(t) => y.map_or(Side::TRANSPARENT, |y| t.side(x, y, true)),
            Self::Rectangle(_) => Side::TRANSPARENT,
        }
    }

    /// Whether it can be used on this many axes.
    pub fn suits(&self, axes: usize) -> bool {
        match self {
            Self::Rectangle(_) => axes == 1 || axes == 2,
            Self::Triangle(_) | Self::TriangleWithFallOff(_) => axes == 2,
            Self::Polyline(_) => axes == 1,
        }
    }

    /// The fault of the widget, if any. Editing introduces none.
    pub fn problem(&self) -> Option<&'static str> {
        match self {
            Self::Rectangle(r) => r.problem(),
            Self::Triangle(t) | Self::TriangleWithFallOff(t) => t.problem(),
            Self::Polyline(p) => p.problem(),
        }
    }

    /// Its extent along the second axis, and whether it changes within it or only at its ends.
    pub(super) fn extent_of_y(&self) -> ([f64; 2], bool) {
        match self {
            Self::Rectangle(r) => (r.y, false),
            Self::Triangle(t) | Self::TriangleWithFallOff(t) => ([t.base[1], t.top], true),
            Self::Polyline(_) => ([0.0, 1.0], false),
        }
    }

    /// Handles: corners of a rectangle (from the lower left one, counterclockwise), base and upper corners of a triangle, points of a
    /// polyline.
    pub fn handles(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Rectangle(r) => r.corners().to_vec(),
            Self::Triangle(t) | Self::TriangleWithFallOff(t) => t.corners().to_vec(),
            Self::Polyline(p) => p.points.iter().map(|p| [p.position, p.opacity]).collect(),
        }
    }

    /// The part at `point`: the nearest handle within `tolerance`, or else the nearest edge, or else the body (of a polyline the area below
    /// it). The tolerance is per axis, since pixels are not square in positions.
    pub fn hit(&self, point: [f64; 2], tolerance: [f64; 2]) -> Option<Part> {
        let scale = |p: [f64; 2]| std::array::from_fn(|i| (p[i] - point[i]) / tolerance[i]);
        let handles: Vec<[f64; 2]> = self.handles().into_iter().map(scale).collect();
        let near = |distances: Vec<f64>| {
            let nearest = distances.into_iter().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            nearest.filter(|(_, distance)| *distance <= 1.0).map(|(index, _)| index)
        };
        let is_closed = !matches!(self, Self::Polyline(_));
        let edges = handles
            .iter()
            .zip(handles.iter().cycle().skip(1))
            .take(handles.len().saturating_sub(usize::from(!is_closed)));
        let is_inside = || match self {
            Self::Rectangle(r) => covers(r.x, point[0]) && covers(r.y, point[1]),
            Self::Triangle(t) | Self::TriangleWithFallOff(t) => t.place(point[0], point[1]).is_some(),
            Self::Polyline(p) => point[1] >= 0.0 && point[1] <= p.side(point[0]).value,
        };
        near(handles.iter().map(|h| h[0].hypot(h[1])).collect())
            .map(Part::Handle)
            .or_else(|| near(edges.map(|(a, b)| distance_to_origin(*a, *b)).collect()).map(Part::Edge))
            .or_else(|| is_inside().then_some(Part::Body))
    }

    /// The widget with a handle dragged to `to`, or as near as the axes and its other handles allow.
    #[must_use]
    pub fn moved(&self, handle: usize, to: [f64; 2]) -> Self {
        let mut widget = self.clone();
        if to.iter().any(|c| c.is_nan()) {
            return widget;
        }
        match &mut widget {
            Self::Rectangle(r) => r.move_corner(handle, to),
            Self::Triangle(t) | Self::TriangleWithFallOff(t) => t.move_corner(handle, to),
            Self::Polyline(p) => p.move_point(handle, to),
        }
        widget
    }

    /// The whole widget shifted, as far as the axes allow.
    #[must_use]
    pub fn shifted(&self, by: [f64; 2]) -> Self {
        let mut widget = self.clone();
        if by.iter().any(|c| c.is_nan()) || self.problem().is_some() {
            return widget;
        }
        let handles = self.handles();
        let by: [f64; 2] = std::array::from_fn(|i| {
            let ends = handles.iter().fold((1.0_f64, 0.0_f64), |(lo, hi), h| (lo.min(h[i]), hi.max(h[i])));
            by[i].clamp(-ends.0, 1.0 - ends.1)
        });
        let shift = |i: usize, c: &mut f64| *c = (*c + by[i]).clamp(0.0, 1.0);
        match &mut widget {
            Self::Rectangle(r) => {
                r.x.iter_mut().for_each(|c| shift(0, c));
                r.y.iter_mut().for_each(|c| shift(1, c));
            }
            Self::Triangle(t) | Self::TriangleWithFallOff(t) => {
                [&mut t.base[0], &mut t.left, &mut t.right].into_iter().for_each(|c| shift(0, c));
                [&mut t.base[1], &mut t.top].into_iter().for_each(|c| shift(1, c));
            }
            Self::Polyline(p) => p.points.iter_mut().for_each(|p| {
                shift(0, &mut p.position);
                shift(1, &mut p.opacity);
            }),
        }
        // Where rounding would merge two coordinates the widget stays unchanged.
        if widget.problem().is_some() { self.clone() } else { widget }
    }

    /// The curve over the first axis, at a position of the second if there is one: values just left of each of its points, and there.
    fn line(&self, y: Option<f64>) -> Vec<ProfilePoint> {
        let mut points = match (self, y) {
            (Self::Rectangle(r), _) if y.is_none_or(|y| covers(r.y, y)) => r.line(),
            (Self::Polyline(p), _) => p.line(),
            (Self::Triangle(t), Some(y)) => t.line(y, false),
            (Self::TriangleWithFallOff(t), Some(y)) => t.line(y, true),
            (Self::Rectangle(_) | Self::Triangle(_) | Self::TriangleWithFallOff(_), _) => Vec::new(),
        };
        // A shape that touches an end of the axis continues beyond it.
        if let Some(first) = points.first_mut().filter(|p| p.scalar <= 0.0) {
            first.left = first.right;
        }
        if let Some(last) = points.last_mut().filter(|p| p.scalar >= 1.0) {
            last.right = last.left;
        }
        points
    }
}

/// Colour and opacity of several widgets at a position: those of the one with the highest opacity, of the later one where they are equal.
/// So the opacity is never above one that was drawn; to add shapes up, put them into two members.
pub(super) fn topmost(widgets: &[Widget], x: f64, y: Option<f64>) -> Side {
    let over = |below: Side, side: Side| if side.value >= below.value { side } else { below };
    widgets.iter().map(|w| w.side(x, y)).fold(Side::TRANSPARENT, over)
}

/// The exact curve of several widgets over the first axis, at a position of the second if there is one; [`topmost`] is its formula.
pub(super) fn line_of(widgets: &[Widget], y: Option<f64>, kind: OpacityKind) -> Curve {
    let pieces = |widget: &Widget| Pieces::of(Curve::new(widget.line(y), kind).points(), ColorWeighting::Plain);
    let over = |below: Pieces, above: Pieces| below.combine(&above, &MoreOpaque);
    let all = widgets.iter().map(pieces).reduce(over);
    Curve::new(all.map(|p| p.plain_points()).unwrap_or_default(), kind)
}

/// Whether an extent contains a position: it includes its lower end, and its upper one only at the end of the axis.
fn covers(extent: [f64; 2], at: f64) -> bool {
    extent[0] <= at && (at < extent[1] || (extent[1] == 1.0 && at <= 1.0))
}

fn is_color(rgb: &[f64; 3]) -> bool {
    rgb.iter().all(|c| (0.0..=1.0).contains(c))
}

/// Distance of the segment from `a` to `b` from the origin.
fn distance_to_origin(a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    let f = if squared > 0.0 { (-(a[0] * along[0] + a[1] * along[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (a[0] + f * along[0]).hypot(a[1] + f * along[1])
}

#[cfg(test)]
mod tests;

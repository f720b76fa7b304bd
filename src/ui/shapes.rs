//! Shapes over a histogram, for the editor: new ones, and what the mouse and number boxes do to them.
//!
//! All functions return valid widgets ([`Widget::problem`]).

use crate::transfer::{Part, Polyline, PolylinePoint, Rectangle, Triangle, Widget};

/// Least distance between points of a polyline that is made here: far below a pixel of any screen.
const GAP: f64 = 1.0 / 1_048_576.0;

/// Colours of new shapes, one after the other.
const COLORS: [[f64; 3]; 6] =
    [[0.9, 0.35, 0.2], [0.25, 0.55, 0.95], [0.95, 0.8, 0.25], [0.35, 0.8, 0.4], [0.8, 0.4, 0.85], [0.9, 0.9, 0.9]];

/// Opacity of new shapes.
const OPACITY: f64 = 0.3;

/// A kind of shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One colour, and a ramp of opacity.
    Rectangle,
    /// One colour and one opacity.
    Triangle,
    /// One colour; opacity falls off to the sides.
    TriangleWithFallOff,
    /// Points with colour and opacity.
    Polyline,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Polyline, Self::Rectangle, Self::Triangle, Self::TriangleWithFallOff];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rectangle => "rectangle",
            Self::Triangle => "triangle",
            Self::TriangleWithFallOff => "triangle with fall-off",
            Self::Polyline => "polyline",
        }
    }

    /// The kind of a widget.
    pub fn of(widget: &Widget) -> Self {
        match widget {
            Widget::Rectangle(_) => Self::Rectangle,
            Widget::Triangle(_) => Self::Triangle,
            Widget::TriangleWithFallOff(_) => Self::TriangleWithFallOff,
            Widget::Polyline(_) => Self::Polyline,
        }
    }

    /// The usual kind on so many axes.
    pub fn first_of(axes: usize) -> Self {
        if axes == 1 { Self::Polyline } else { Self::Rectangle }
    }

    /// A new shape in the middle of the axes; `number` chooses its colour.
    pub fn shape(self, number: usize) -> Widget {
        let rgb = COLORS[number % COLORS.len()];
        let triangle = Triangle { base: [0.5, 0.1], top: 0.7, left: 0.35, right: 0.65, rgb, opacity: OPACITY };
        let point = |position, opacity| PolylinePoint { position, rgb, opacity };
        match self {
            Self::Rectangle => {
                let [x, y] = [[0.35, 0.65], [0.3, 0.7]];
                Widget::Rectangle(Rectangle { x, y, rgb, opacity: [OPACITY; 2] })
            }
            Self::Triangle => Widget::Triangle(triangle),
            Self::TriangleWithFallOff => Widget::TriangleWithFallOff(triangle),
            Self::Polyline => polyline(vec![point(0.35, 0.0), point(0.5, OPACITY), point(0.65, 0.0)]),
        }
    }
}

/// A polyline through points sorted by position; those nearer than a gap to the last one are moved on, or left out at the end of the axis.
pub(super) fn polyline(points: Vec<PolylinePoint>) -> Widget {
    let mut apart: Vec<PolylinePoint> = Vec::with_capacity(points.len());
    for point in points {
        let least = apart.last().map_or(0.0, |last| last.position + GAP);
        if least <= 1.0 {
            apart.push(PolylinePoint { position: point.position.clamp(least, 1.0), ..point });
        } else if let Some(last) = apart.last_mut() {
            (last.rgb, last.opacity) = (point.rgb, point.opacity);
        }
    }
    Widget::Polyline(Polyline { points: apart })
}

/// The shape on so many axes: one that cannot be used there becomes a rectangle of its extent, colour and greatest opacity.
#[must_use]
pub fn on_axes(widget: &Widget, axes: usize) -> Widget {
    if widget.suits(axes) {
        return widget.clone();
    }
    let handles = widget.handles();
    let extent = |i: usize| {
        let ends = handles.iter().fold([1.0_f64, 0.0_f64], |[lo, hi], handle| [lo.min(handle[i]), hi.max(handle[i])]);
        if ends[0] + GAP <= ends[1] { ends } else { [0.0, 1.0] }
    };
    let opacity = opacities(widget).into_iter().map(|(_, opacity)| opacity).fold(0.0, f64::max);
    let y = if matches!(widget, Widget::Polyline(_)) { [0.0, 1.0] } else { extent(1) };
    Widget::Rectangle(Rectangle { x: extent(0), y, rgb: color(widget), opacity: [opacity; 2] })
}

/// Its colour; of a polyline, that of its highest point.
pub fn color(widget: &Widget) -> [f64; 3] {
    match widget {
        Widget::Rectangle(shape) => shape.rgb,
        Widget::Triangle(shape) | Widget::TriangleWithFallOff(shape) => shape.rgb,
        Widget::Polyline(shape) => {
            let highest = shape.points.iter().max_by(|a, b| a.opacity.total_cmp(&b.opacity));
            highest.map_or([1.0; 3], |point| point.rgb)
        }
    }
}

/// The shape in another colour; of a polyline, one point or all.
#[must_use]
pub fn with_color(widget: &Widget, point: Option<usize>, rgb: [f64; 3]) -> Widget {
    let mut changed = widget.clone();
    let rgb = rgb.map(|c| c.clamp(0.0, 1.0));
    match &mut changed {
        Widget::Rectangle(shape) => shape.rgb = rgb,
        Widget::Triangle(shape) | Widget::TriangleWithFallOff(shape) => shape.rgb = rgb,
        Widget::Polyline(shape) => {
            let chosen = |index: usize| point.is_none_or(|point| point == index);
            let points = shape.points.iter_mut().enumerate().filter(|(index, _)| chosen(*index));
            points.for_each(|(_, point)| point.rgb = rgb);
        }
    }
    changed
}

/// Its opacities with their names.
pub fn opacities(widget: &Widget) -> Vec<(String, f64)> {
    match widget {
        Widget::Rectangle(shape) => {
            vec![("left opacity".to_owned(), shape.opacity[0]), ("right opacity".to_owned(), shape.opacity[1])]
        }
        Widget::Triangle(shape) | Widget::TriangleWithFallOff(shape) => vec![("opacity".to_owned(), shape.opacity)],
        Widget::Polyline(shape) => {
            let named = |(i, point): (usize, &PolylinePoint)| (format!("opacity of point {}", i + 1), point.opacity);
            shape.points.iter().enumerate().map(named).collect()
        }
    }
}

/// The shape with another of its [`opacities`].
#[must_use]
pub fn with_opacity(widget: &Widget, index: usize, opacity: f64) -> Widget {
    let mut changed = widget.clone();
    let to = match &mut changed {
        Widget::Rectangle(shape) => shape.opacity.get_mut(index),
        Widget::Triangle(shape) | Widget::TriangleWithFallOff(shape) => Some(&mut shape.opacity),
        Widget::Polyline(shape) => shape.points.get_mut(index).map(|point| &mut point.opacity),
    };
    if let Some(to) = to.filter(|_| !opacity.is_nan()) {
        *to = opacity.clamp(0.0, 1.0);
    }
    changed
}

/// The shape with a part of it dragged, as far as the axes and its other parts allow.
#[must_use]
pub fn dragged(widget: &Widget, part: Part, by: [f64; 2]) -> Widget {
    let handles = widget.handles();
    let moved = |widget: &Widget, index: usize, by: [f64; 2]| match handles.get(index) {
        Some(at) => widget.moved(index, [at[0] + by[0], at[1] + by[1]]),
        None => widget.clone(),
    };
    match (part, widget) {
        (Part::Handle(index), _) => moved(widget, index, by),
        // The lower and the upper edge of a rectangle are those after its corners 0 and 2.
        (Part::Edge(edge @ (0 | 2)), Widget::Rectangle(_)) => moved(widget, edge, [0.0, by[1]]),
        (Part::Edge(edge), Widget::Rectangle(_)) => moved(widget, edge, [by[0], 0.0]),
        // The upper edge of a triangle.
        (Part::Edge(1), Widget::Triangle(_) | Widget::TriangleWithFallOff(_)) => moved(widget, 1, [0.0, by[1]]),
        (Part::Edge(edge), Widget::Polyline(_)) => {
            // The one in front makes room for the other.
            let order = if by[0] > 0.0 { [edge + 1, edge] } else { [edge, edge + 1] };
            order.into_iter().fold(widget.clone(), |widget, index| moved(&widget, index, by))
        }
        (Part::Edge(_) | Part::Body, _) => widget.shifted(by),
    }
}

/// The polyline with another point on it, at a position between its ends, or beyond them at `at`; `None` if there is no room, or for other
/// shapes.
pub fn with_point(widget: &Widget, at: [f64; 2]) -> Option<Widget> {
    let Widget::Polyline(shape) = widget else { return None };
    let position = at[0].clamp(0.0, 1.0);
    let index = shape.points.partition_point(|point| point.position <= position);
    let (before, after) = (index.checked_sub(1).and_then(|i| shape.points.get(i)), shape.points.get(index));
    let is_apart = |point: &PolylinePoint| (point.position - position).abs() >= GAP;
    if at[0].is_nan() || !before.into_iter().chain(after).all(is_apart) {
        return None;
    }
    let rgb = match (before, after) {
        (Some(a), Some(b)) => {
            let f = (position - a.position) / (b.position - a.position);
            std::array::from_fn(|c| a.rgb[c] * (1.0 - f) + b.rgb[c] * f)
        }
        (Some(only), None) | (None, Some(only)) => only.rgb,
        (None, None) => [1.0; 3],
    };
    let opacity = if at[1].is_nan() { 0.0 } else { at[1].clamp(0.0, 1.0) };
    let mut points = shape.points.clone();
    points.insert(index, PolylinePoint { position, rgb, opacity });
    Some(Widget::Polyline(Polyline { points }))
}

/// The polyline without a point; `None` if it has two only, or for other shapes.
pub fn without_point(widget: &Widget, index: usize) -> Option<Widget> {
    let Widget::Polyline(shape) = widget else { return None };
    let mut points = shape.points.clone();
    if points.len() <= 2 || index >= points.len() {
        return None;
    }
    points.remove(index);
    Some(Widget::Polyline(Polyline { points }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_part() -> impl Strategy<Value = Part> {
        prop_oneof![(0..5_usize).prop_map(Part::Handle), (0..5_usize).prop_map(Part::Edge), Just(Part::Body)]
    }

    #[test]
    fn new_shapes_are_valid_and_suit_their_axes() {
        for (number, kind) in Kind::ALL.into_iter().enumerate() {
            let shape = kind.shape(number + 4);
            assert_eq!((shape.problem(), Kind::of(&shape)), (None, kind));
        }
        assert!([1, 2].iter().all(|&axes| Kind::first_of(axes).shape(0).suits(axes)));
    }

    #[test]
    fn an_edge_moves_alone() {
        let rectangle = Kind::Rectangle.shape(0);
        let Widget::Rectangle(before) = rectangle.clone() else { panic!() };
        let after = [0, 1, 2, 3].map(|edge| dragged(&rectangle, Part::Edge(edge), [0.1, 0.1]));
        let expected = [
            Rectangle { y: [before.y[0] + 0.1, before.y[1]], ..before },
            Rectangle { x: [before.x[0], before.x[1] + 0.1], ..before },
            Rectangle { y: [before.y[0], before.y[1] + 0.1], ..before },
            Rectangle { x: [before.x[0] + 0.1, before.x[1]], ..before },
        ];
        assert_eq!(after, expected.map(Widget::Rectangle));
        let triangle = Kind::Triangle.shape(0);
        let Widget::Triangle(Triangle { top, .. }) = dragged(&triangle, Part::Edge(1), [0.3, 0.1]) else { panic!() };
        assert!((top - 0.8).abs() < 1e-12, "the upper edge goes up, not to the side");
    }

    #[test]
    fn an_edge_of_a_polyline_takes_both_its_points_with_it() {
        let before = Kind::Polyline.shape(0);
        for by in [[0.1, 0.05], [-0.1, 0.05]] {
            let after = dragged(&before, Part::Edge(0), by).handles();
            let moved = |i: usize| std::array::from_fn(|c| after[i][c] - before.handles()[i][c]);
            let (first, second): ([f64; 2], [f64; 2]) = (moved(0), moved(1));
            assert!((0..2).all(|c| (first[c] - by[c]).abs() < 1e-12 && (second[c] - by[c]).abs() < 1e-12), "{after:?}");
        }
    }

    #[test]
    fn points_of_polylines_come_and_go_but_two_stay() {
        let three = Kind::Polyline.shape(0);
        let four = with_point(&three, [0.4, 0.2]).unwrap();
        assert_eq!(four.handles()[1], [0.4, 0.2]);
        assert_eq!(with_point(&four, [0.4, 0.9]), None, "there is one");
        let two = without_point(&without_point(&four, 0).unwrap(), 0).unwrap();
        assert_eq!((two.handles().len(), without_point(&two, 0)), (2, None));
        assert_eq!(with_point(&Kind::Rectangle.shape(0), [0.5, 0.5]), None);
    }

    proptest! {
        #[test]
        fn whatever_is_done_shapes_stay_valid(
            kind in 0..4_usize,
            edits in prop::collection::vec((0..5_u8, any_part(), -1.5..1.5_f64, -1.5..1.5_f64), 1..30),
        ) {
            let mut shape = Kind::ALL[kind].shape(kind);
            for (edit, part, x, y) in edits {
                shape = match edit {
                    0 => with_point(&shape, [x, y]).unwrap_or(shape),
                    1 => without_point(&shape, (x * 4.0).abs() as usize).unwrap_or(shape),
                    2 => with_color(&shape, Some((y * 3.0).abs() as usize), [x, y, 0.5]),
                    3 => with_opacity(&shape, (y * 3.0).abs() as usize, x),
                    _ => dragged(&shape, part, [x, y]),
                };
                prop_assert_eq!(shape.problem(), None);
                for axes in [1, 2] {
                    let there = on_axes(&shape, axes);
                    prop_assert!(there.suits(axes) && there.problem().is_none(), "{:?}", there);
                }
            }
        }
    }
}

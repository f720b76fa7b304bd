use super::*;
use crate::transfer::color_map::lerp;
use proptest::prelude::*;

const RED: [f64; 3] = [1.0, 0.0, 0.0];
const BLUE: [f64; 3] = [0.0, 0.0, 1.0];

fn rectangle(x: [f64; 2], rgb: [f64; 3], opacity: [f64; 2]) -> Widget {
    Widget::Rectangle(Rectangle { x, y: [0.25, 0.75], rgb, opacity })
}

fn triangle() -> Triangle {
    Triangle { base: [0.5, 0.0], top: 0.5, left: 0.25, right: 0.75, rgb: RED, opacity: 0.8 }
}

fn polyline(points: &[(f64, f64)]) -> Widget {
    let point = |&(position, opacity): &(f64, f64)| PolylinePoint { position, rgb: [opacity; 3], opacity };
    Widget::Polyline(Polyline { points: points.iter().map(point).collect() })
}

#[test]
fn a_rectangle_has_its_left_and_lower_edge_only() {
    let widget = rectangle([0.25, 0.5], RED, [0.5, 1.0]);
    assert_eq!(widget.eval(0.25, 0.25), (RED, 0.5));
    assert_eq!(widget.eval(0.375, 0.5), (RED, 0.75));
    for (x, y) in [(0.5, 0.5), (0.3, 0.75), (0.3, 0.2), (0.2, 0.5), (-1.0, 0.5), (2.0, 0.5)] {
        assert_eq!(widget.eval(x, y), ([0.0; 3], 0.0), "{x} {y}");
    }
    assert_eq!(widget.eval_on_line(0.375), (RED, 0.75), "its height does not matter on a line");
    let to_the_end = rectangle([0.5, 1.0], RED, [0.5, 1.0]);
    assert_eq!((to_the_end.eval_on_line(1.0), to_the_end.eval_on_line(7.0)), ((RED, 1.0), (RED, 1.0)));
}

#[test]
fn triangles_stand_on_their_corner_and_fall_off_to_their_sides() {
    let (even, falling) = (Widget::Triangle(triangle()), Widget::TriangleWithFallOff(triangle()));
    assert_eq!((even.eval(0.5, 0.25), falling.eval(0.5, 0.25)), ((RED, 0.8), (RED, 0.8)));
    // At half its height it reaches from 3/8 to 5/8.
    assert_eq!((even.eval(0.4375, 0.25).1, falling.eval(0.4375, 0.25).1), (0.8, 0.4));
    assert_eq!((even.eval(0.375, 0.25).1, falling.eval(0.375, 0.25).1), (0.8, 0.0));
    for (x, y) in [(0.625, 0.25), (0.5, 0.0), (0.5, 0.5), (0.3, 0.1), (0.5, 0.9)] {
        assert_eq!((even.eval(x, y).1, falling.eval(x, y).1), (0.0, 0.0), "{x} {y}");
    }
    let high = Triangle { top: 1.0, right: 1.0, ..triangle() };
    assert_eq!((high.side(1.0, 1.0, false).value, high.side(0.5, 9.0_f64.min(1.0), false).value), (0.8, 0.8));
    assert_eq!(even.eval_on_line(0.5).1, 0.0);
    assert!(!even.suits(1) && even.suits(2) && !polyline(&[]).suits(2));
}

#[test]
fn a_polyline_is_clear_beyond_its_points_unless_they_end_the_axis() {
    let widget = polyline(&[(0.25, 0.5), (0.5, 1.0), (0.75, 0.5)]);
    assert_eq!(widget.eval_on_line(0.375), ([0.75; 3], 0.75));
    assert_eq!([0.2, 0.75, 0.25].map(|x| widget.eval_on_line(x).1), [0.0, 0.0, 0.5]);
    let whole = polyline(&[(0.0, 0.5), (1.0, 0.25)]);
    assert_eq!([-1.0, 0.0, 1.0, 3.0].map(|x| whole.eval_on_line(x).1), [0.5, 0.5, 0.25, 0.25]);
}

#[test]
fn the_more_opaque_of_two_widgets_holds_and_the_later_of_equals() {
    let (a, b) = (rectangle([0.0, 1.0], RED, [0.0, 1.0]), rectangle([0.0, 1.0], BLUE, [0.5, 0.5]));
    let widgets = [a, b];
    assert_eq!(topmost(&widgets, 0.25, None), Side { rgb: BLUE, value: 0.5 });
    assert_eq!(topmost(&widgets, 0.75, None), Side { rgb: RED, value: 0.75 });
    assert_eq!(topmost(&widgets, 0.5, None).rgb, BLUE);
    let line = line_of(&widgets, None, OpacityKind::Alpha);
    // The colour changes where they cross; opacity has a bend there, no step.
    let [left, right] = line.sides(0.5);
    assert_eq!((left.rgb, right.rgb, left.value, right.value), (BLUE, RED, 0.5, 0.5));
}

#[test]
fn handles_come_before_edges_and_edges_before_the_inside() {
    let widget = rectangle([0.25, 0.5], RED, [1.0; 2]);
    let hit = |x, y| widget.hit([x, y], [0.01, 0.02]);
    assert_eq!(widget.handles(), [[0.25, 0.25], [0.5, 0.25], [0.5, 0.75], [0.25, 0.75]]);
    assert_eq!(hit(0.505, 0.745), Some(Part::Handle(2)));
    assert_eq!(hit(0.4, 0.735), Some(Part::Edge(2)));
    assert_eq!(hit(0.241, 0.5), Some(Part::Edge(3)));
    assert_eq!(hit(0.4, 0.5), Some(Part::Body));
    assert_eq!((hit(0.52, 0.5), hit(0.4, 0.78), hit(f64::NAN, 0.5)), (None, None, None));
    let line = polyline(&[(0.0, 0.5), (0.5, 1.0), (1.0, 0.5)]);
    let hit = |x, y| line.hit([x, y], [0.01, 0.01]);
    assert_eq!(hit(0.25, 0.75), Some(Part::Edge(0)));
    assert_eq!(hit(0.995, 0.5), Some(Part::Handle(2)));
    assert_eq!((hit(0.5, 0.5), hit(0.5, 1.5), hit(0.02, 0.6)), (Some(Part::Body), None, None), "its last edge is open");
    let pointed = Widget::Triangle(triangle());
    assert_eq!(pointed.hit([0.5, 0.25], [0.01; 2]), Some(Part::Body));
    assert_eq!(pointed.hit([0.375, 0.25], [0.01; 2]), Some(Part::Edge(2)));
    assert_eq!(pointed.hit([0.25, 0.25], [0.01; 2]), None);
}

#[test]
fn problems_are_named() {
    let bad = [
        rectangle([0.5, 0.5], RED, [1.0; 2]),
        rectangle([0.5, 1.5], RED, [1.0; 2]),
        rectangle([0.0, f64::NAN], RED, [1.0; 2]),
        rectangle([0.0, 1.0], [2.0; 3], [1.0; 2]),
        rectangle([0.0, 1.0], RED, [f64::NAN; 2]),
        Widget::Triangle(Triangle { left: 0.8, ..triangle() }),
        Widget::Triangle(Triangle { top: 0.0, ..triangle() }),
        Widget::TriangleWithFallOff(Triangle { opacity: 1.5, ..triangle() }),
        polyline(&[(0.5, 0.5)]),
        polyline(&[(0.5, 0.5), (0.5, 0.7)]),
        polyline(&[(0.5, 0.5), (0.7, 1.7)]),
    ];
    assert!(bad.iter().all(|w| w.problem().is_some()));
    assert!(
        [rectangle([0.0, 1.0], RED, [0.0; 2]), Widget::Triangle(triangle()), polyline(&[(0.0, 0.0), (1.0, 1.0)])]
            .iter()
            .all(|w| w.problem().is_none())
    );
    let text = r#"{"rectangle": {"x": [0, 1], "y": [0, 1], "rgb": [0, 0, 0], "opacity": [0, 1], "angle": 3}}"#;
    assert!(serde_json::from_str::<Widget>(text).unwrap_err().to_string().contains("angle"));
}

fn widget() -> impl Strategy<Value = Widget> {
    let extent = || (0.0..0.9_f64, 0.01..1.0_f64).prop_map(|(a, w)| [a, (a + w).min(1.0)]);
    let rgb = || [0.0..=1.0_f64, 0.0..=1.0, 0.0..=1.0];
    let rect = (extent(), extent(), rgb(), [0.0..=1.0_f64, 0.0..=1.0])
        .prop_map(|(x, y, rgb, opacity)| Widget::Rectangle(Rectangle { x, y, rgb, opacity }));
    let tri = (0.0..=1.0_f64, extent(), extent(), rgb(), any::<bool>()).prop_map(|(x, y, top, rgb, falls_off)| {
        let shape = Triangle { base: [x, y[0]], top: y[1], left: top[0], right: top[1], rgb, opacity: 0.7 };
        if falls_off { Widget::TriangleWithFallOff(shape) } else { Widget::Triangle(shape) }
    });
    prop_oneof![rect, tri, line_widget()]
}

fn line_widget() -> impl Strategy<Value = Widget> {
    prop::collection::vec((0.05..1.0_f64, 0.0..=1.0_f64), 2..6).prop_map(|steps| {
        let total = steps.iter().map(|s| s.0).sum::<f64>();
        let mut at = 0.0;
        let point = |s: &(f64, f64)| {
            at += s.0;
            ((at / total).min(1.0), s.1)
        };
        polyline(&steps.iter().map(point).collect::<Vec<_>>())
    })
}

proptest! {
    #[test]
    fn editing_keeps_widgets_right(widget in widget(), edits in prop::collection::vec((0_usize..8, [-2.0..3.0_f64, -2.0..3.0_f64], any::<bool>()), 1..10)) {
        let mut edited = widget;
        prop_assert_eq!(edited.problem(), None);
        for (handle, to, shift) in edits {
            edited = if shift { edited.shifted(to) } else { edited.moved(handle, to) };
            prop_assert_eq!(edited.problem(), None);
        }
        prop_assert_eq!(edited.moved(0, [f64::NAN, 0.5]).shifted([0.1, f64::NAN]), edited);
    }

    #[test]
    fn a_handle_that_is_dragged_where_there_is_room_is_there(at in [0.0..0.4_f64, 0.0..0.4_f64]) {
        prop_assert_eq!(rectangle([0.5, 0.9], RED, [1.0; 2]).moved(0, [at[0], at[1] * 0.5]).handles()[0], [at[0], at[1] * 0.5]);
        prop_assert_eq!(polyline(&[(0.45, 0.0), (0.9, 1.0)]).moved(0, at).handles()[0], at);
        prop_assert_eq!(Widget::Triangle(triangle()).moved(0, at).handles()[0], at);
    }

    #[test]
    fn the_curve_of_widgets_on_a_line_is_what_they_give(
        widgets in prop::collection::vec(prop_oneof![widget(), line_widget()], 0..5), at in prop::collection::vec(-0.2..1.2_f64, 60),
    ) {
        let widgets: Vec<Widget> = widgets.into_iter().filter(|w| w.suits(1)).collect();
        let line = line_of(&widgets, None, OpacityKind::Alpha);
        let near_a_knot = |x: f64| line.knots().any(|k| (k - x).abs() < 1e-9);
        for x in at.into_iter().filter(|&x| !near_a_knot(x)) {
            let (expected, got) = (topmost(&widgets, x, None), line.sides(x)[1]);
            // Slopes are below 2^10 (a polyline's points are a hundredth apart), rounding of a cut below 2^-52.
            let off = |expected: &Side| {
                let colors = (0..3).map(|c| (expected.rgb[c] - got.rgb[c]).abs());
                colors.fold((expected.value - got.value).abs(), f64::max)
            };
            prop_assert!(off(&expected) <= 1e-11, "{x}: {expected:?} {got:?}");
            // A line without a widget that is a millionth more opaque would be noticed.
            let lid = rectangle([0.0, 1.0], expected.rgb, [(expected.value + 1e-6).min(1.0); 2]);
            let lost = topmost(&[widgets.clone(), vec![lid]].concat(), x, None);
            prop_assert!(off(&lost) > 1e-11 || expected.value > 0.999_999 || !(0.0..1.0).contains(&x), "{x}: {lost:?}");
        }
        for k in line.knots() {
            // A knot is a point of a widget, at which the right side holds, or a crossing, at which opacities agree.
            prop_assert!((topmost(&widgets, k, None).value - line.sides(k)[1].value).abs() <= 1e-11, "{k}");
        }
    }

    #[test]
    fn two_triangles_are_one_shape(x in 0.0..=1.0_f64, y in 0.0..=1.0_f64) {
        let (even, falling) = (Widget::Triangle(triangle()), Widget::TriangleWithFallOff(triangle()));
        let (a, b) = (even.eval(x, y).1, falling.eval(x, y).1);
        let height = y / 0.5;
        let half = lerp(0.0, 0.25, height);
        let expected = |x: f64| if height < 1.0 { 0.8 * (1.0 - (x - 0.5).abs() / half).max(0.0) } else { 0.0 };
        let is_even = b == 0.0 || a == 0.8;
        // Both sides and what lies between them and a place are rounded, by 2^-53 at most.
        let bound = 4.0 * f64::EPSILON / half;
        prop_assert!((b - expected(x)).abs() <= bound && is_even);
        prop_assert!(b == 0.0 || (b - expected(x + 1e-9)).abs() > bound, "a place off by 1e-9");
    }

    #[test]
    fn data_comes_back_as_it_went_in(widget in widget()) {
        let text = serde_json::to_string(&widget).unwrap();
        prop_assert_eq!(serde_json::from_str::<Widget>(&text).unwrap(), widget);
    }
}

//! The editor of members: curves, shapes, range maps, histograms.

use egui::{Key, Modifiers, PointerButton, Pos2, Rect, pos2};
use egui_kittest::kittest::Queryable;
use tetreel::transfer::{Function, Member, Space, Widget};
use tetreel::ui::window::Start;
use tetreel_ui_tests::desk::{Desk, options, store};

fn open(size: [f32; 2]) -> Option<Desk> {
    let folder = tempfile::tempdir().unwrap();
    let start = Start::Open(vec![store(folder.path())]);
    let mut desk = Desk::with(size, 1.0, options(folder.path(), start), folder)?;
    desk.begin();
    desk.settle();
    // The sections above the editor.
    for section in ["Field", "Colours"] {
        desk.click(section);
    }
    desk.settle();
    Some(desk)
}

fn member(desk: &Desk) -> Member {
    desk.session().member().unwrap().clone()
}

fn shapes(desk: &Desk) -> Vec<Widget> {
    match member(desk).function {
        Function::Widgets(shapes) => shapes,
        Function::TransferFunction(_) => Vec::new(),
    }
}

fn choose(desk: &mut Desk, what: &str, option: &str) {
    desk.click(what);
    desk.click(option);
    desk.settle();
}

/// The point of positions 0..=1 in the picture of the editor, which has a margin.
fn on(rect: Rect, [x, y]: [f64; 2]) -> Pos2 {
    let inner = rect.shrink(4.0);
    pos2(egui::lerp(inner.x_range(), x as f32), egui::lerp(inner.bottom()..=inner.top(), y as f32))
}

fn undo_all(desk: &mut Desk) {
    while desk.session().changes().0 > 0 {
        desk.press_with(Modifiers::COMMAND, Key::Z);
    }
    desk.settle();
}

#[test]
fn a_curve_becomes_shapes_which_are_dragged_and_typed_and_undone() {
    let Some(mut desk) = open([1280.0, 1000.0]) else { return };
    let first = desk.session().project().clone();
    let picture = desk.session().shown().unwrap().request.clone();
    choose(&mut desk, "Curve or shapes", "shapes over");
    assert!(matches!(&shapes(&desk)[..], [Widget::Polyline(_)]));
    desk.click("Add shape");
    desk.click("rectangle");
    desk.settle();
    let [_, Widget::Rectangle(before)] = &shapes(&desk)[..] else { panic!("two shapes") };
    let before = *before;
    let canvas = desk.place("2 shapes over a histogram");
    // The upper right corner.
    desk.drag(on(canvas, [before.x[1], before.y[1]]), on(canvas, [before.x[1] + 0.2, before.y[1] + 0.1]));
    desk.settle();
    let [_, Widget::Rectangle(after)] = &shapes(&desk)[..] else { panic!("two shapes") };
    let near = |a: f64, b: f64| (a - b).abs() < 0.01;
    assert!(near(after.x[1], before.x[1] + 0.2) && near(after.y[1], before.y[1] + 0.1), "{after:?}");
    assert_eq!((after.x[0], after.y[0]), (before.x[0], before.y[0]));
    // The whole of it, further than there is room.
    desk.drag(on(canvas, [0.5, 0.5]), on(canvas, [-2.0, 0.5]));
    desk.settle();
    let [_, Widget::Rectangle(moved)] = &shapes(&desk)[..] else { panic!("two shapes") };
    assert!(
        moved.x[0] == 0.0 && near(moved.x[1], after.x[1] - after.x[0]) && near(moved.y[0], after.y[0]),
        "{moved:?}"
    );
    desk.click("Shape: left opacity");
    desk.harness.get_by_label("Shape: left opacity").type_text("0.75");
    desk.press(Key::Enter);
    desk.settle();
    let [_, Widget::Rectangle(typed)] = &shapes(&desk)[..] else { panic!("two shapes") };
    assert_eq!(typed.opacity, [0.75, before.opacity[1]]);
    assert!(desk.session().shown().unwrap().request.tets().unwrap().table != picture.tets().unwrap().table);
    desk.save("editor_shapes.png");
    desk.click("Move the shape up");
    assert!(matches!(&shapes(&desk)[..], [Widget::Rectangle(_), Widget::Polyline(_)]));
    desk.click("Move the shape down");
    assert!(matches!(&shapes(&desk)[..], [Widget::Polyline(_), Widget::Rectangle(_)]));
    desk.click("Remove shape");
    assert_eq!(shapes(&desk).len(), 1);
    // Back to a curve: the opacities are those of the polyline, which has them from the curve.
    choose(&mut desk, "Curve or shapes", "a curve over");
    assert!(desk.session().function().is_some());
    undo_all(&mut desk);
    assert_eq!(**desk.session().project(), *first);
    assert!(desk.session().shown().unwrap().request.tets().unwrap().table == picture.tets().unwrap().table);
}

#[test]
fn over_two_quantities_there_is_an_image_and_shapes_on_it() {
    let Some(mut desk) = open([1280.0, 1000.0]) else { return };
    desk.click("Project");
    desk.settle();
    for (space, quantities) in
        [(Space::ScalarGradient, "over scalar and gradient"), (Space::ScalarCov, "over scalar and CoV")]
    {
        choose(&mut desk, "Quantities", quantities);
        desk.until("a histogram", |session| {
            session.histogram().is_some_and(|shown| shown.kind == space && shown.histogram.two().is_some())
        });
        assert_eq!((member(&desk).space, shapes(&desk).len()), (space, 1));
    }
    desk.click("Add shape");
    desk.click("triangle with fall-off");
    desk.settle();
    assert!(matches!(&shapes(&desk)[..], [Widget::Rectangle(_), Widget::TriangleWithFallOff(_)]));
    desk.harness.hover_at(desk.place("2 shapes over a histogram").center());
    desk.harness.step();
    desk.save("editor_two_axes.png");
    choose(&mut desk, "Histogram", "step shown");
    // Under the mouse are values, not what is counted.
    desk.harness.hover_at(pos2(200.0, 200.0));
    desk.harness.step();
    desk.until_there("values of step 0");
    desk.press(Key::ArrowRight);
    desk.until_there("values of step 1");
    assert!(desk.session().notices().is_empty(), "{:?}", desk.session().notices());
}

#[test]
fn the_axis_is_stretched_by_handles_and_equalised() {
    let Some(mut desk) = open([1280.0, 1000.0]) else { return };
    let strip = desk.place("Range map of 0 handles");
    let at = pos2(on(strip, [0.25, 0.0]).x, strip.center().y);
    desk.double_click(at);
    desk.settle();
    let map = || member(&desk).map.points().to_vec();
    let points = map();
    assert!(points.len() == 3 && (points[1][0] - 0.25).abs() < 0.01 && points[1][0] == points[1][1], "{points:?}");
    desk.drag(at, at + egui::vec2(0.25 * strip.width(), 0.0));
    desk.settle();
    let moved = member(&desk).map.points().to_vec();
    assert!(moved[1][0] == points[1][0] && (moved[1][1] - 0.5).abs() < 0.03, "{moved:?}");
    desk.save("editor_stretched.png");
    desk.click("Axis and units");
    desk.settle();
    desk.until("a histogram", |session| session.histogram().is_some());
    desk.click("Equalise");
    desk.settle();
    assert!(member(&desk).map.points().len() > 4, "{:?}", member(&desk).map);
    desk.save("editor_equalised.png");
    desk.click("Reset");
    assert_eq!(member(&desk).map, Default::default());
    desk.click("Add handle");
    assert_eq!(member(&desk).map.points()[1], [0.5, 0.5]);
    // A handle with the right button is no handle any more.
    let middle = pos2(on(strip, [0.5, 0.0]).x, strip.center().y);
    desk.harness.hover_at(middle);
    for pressed in [true, false] {
        let modifiers = Modifiers::NONE;
        desk.harness.event(egui::Event::PointerButton {
            pos: middle,
            button: PointerButton::Secondary,
            pressed,
            modifiers,
        });
    }
    desk.harness.step();
    desk.settle();
    assert_eq!(member(&desk).map, Default::default());
}

#[test]
fn members_are_added_copied_moved_and_removed() {
    let Some(mut desk) = open([1280.0, 1000.0]) else { return };
    let first = desk.session().project().clone();
    desk.click("Project");
    desk.settle();
    let names = |desk: &Desk| -> Vec<String> {
        let ensemble = &desk.session().project().ensembles[desk.session().edited_ensemble()];
        ensemble.members.iter().map(|member| member.name.clone()).collect()
    };
    desk.click("Add a member");
    desk.settle();
    assert_eq!(
        (names(&desk), member(&desk).name.as_str()),
        (vec!["colours".to_owned(), "member".to_owned()], "member")
    );
    desk.click("Copy the member");
    assert_eq!(names(&desk), ["colours", "member", "member 2"]);
    desk.click("Move the member up");
    assert_eq!(
        (names(&desk), member(&desk).name.as_str()),
        (["colours", "member 2", "member"].map(str::to_owned).to_vec(), "member 2")
    );
    desk.click("Name of the member");
    desk.press_with(Modifiers::COMMAND, Key::A);
    desk.harness.get_by_label("Name of the member").type_text("core");
    desk.press(Key::Enter);
    desk.settle();
    assert_eq!(names(&desk), ["colours", "core", "member"]);
    desk.click("Use the member core");
    assert!(!member(&desk).enabled);
    desk.save("editor_members.png");
    desk.click("Remove the member");
    assert_eq!(names(&desk), ["colours", "member"]);
    desk.click("Copy the ensemble");
    desk.settle();
    assert_eq!(desk.session().project().ensembles.len(), 2);
    assert!(desk.harness.query_by_label("timeline").is_some(), "there is a choice now");
    undo_all(&mut desk);
    assert_eq!(**desk.session().project(), *first);
}

#[test]
fn at_small_sizes_nothing_is_cut_off() {
    for size in [[640.0, 480.0], [800.0, 600.0]] {
        let Some(mut desk) = open(size) else { return };
        choose(&mut desk, "Curve or shapes", "shapes over");
        desk.save(&format!("editor_{}.png", size[0]));
        let panel = desk.place("1 shapes over a histogram");
        for label in ["Curve or shapes", "Histogram", "Add shape", "Colour of the shape"] {
            let rect = desk.harness.get_by_label(label).rect();
            assert!(
                rect.right() <= panel.right() + 1.0 && rect.left() >= panel.left() - 1.0,
                "{label}: {rect:?} in {panel:?}"
            );
        }
    }
}

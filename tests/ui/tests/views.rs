//! Two views in one window.

use egui::{Key, Pos2, Rect, vec2};
use egui_kittest::kittest::Queryable;
use std::time::{Duration, Instant};
use tetreel::ui::Session;
use tetreel::ui::views::Views;
use tetreel::ui::window::{Start, WindowOptions};
use tetreel_ui_tests::desk::{Desk, STEPS, options, store};

/// Opens the part of the side panel and the second view by a button in it.
fn open_second(desk: &mut Desk, button: &str) {
    desk.click("Second view");
    desk.settle();
    desk.click(button);
    desk.settle();
}

fn views(desk: &Desk) -> &Views {
    desk.window().views().unwrap()
}

fn both(desk: &Desk) -> [&Session; 2] {
    [views(desk).active(), views(desk).beside().unwrap()]
}

/// Steps on the screen of the active view and the other one.
fn steps(desk: &Desk) -> [usize; 2] {
    both(desk).map(|session| session.shown().unwrap().request.time.step())
}

/// Places of the pictures, from left to right.
fn pictures(desk: &Desk) -> Vec<Rect> {
    let nodes = desk.harness.get_all_by(|node| node.label().is_some_and(|label| label.starts_with("Picture of")));
    let mut places: Vec<Rect> = nodes.map(|node| node.rect()).collect();
    places.sort_by(|a, b| a.left().total_cmp(&b.left()));
    places
}

/// Paints until there is a second view.
fn until_two(desk: &mut Desk) {
    let begin = Instant::now();
    while desk.window().views().is_none_or(|views| views.beside().is_none()) {
        desk.harness.step();
        assert!(begin.elapsed() < Duration::from_secs(60), "no second view; {:?}", desk.session().notices());
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn click_at(desk: &mut Desk, at: Pos2) {
    desk.harness.hover_at(at);
    desk.harness.step();
    desk.harness.drag_at(at);
    desk.harness.step();
    desk.harness.drop_at(at);
    desk.harness.step();
    desk.settle();
}

#[test]
fn two_views_stand_side_by_side_and_the_one_that_is_clicked_is_edited() {
    let Some(mut desk) = Desk::open() else { return };
    let alone = pictures(&desk);
    open_second(&mut desk, "Same data");
    let [left, right] = pictures(&desk)[..] else { panic!("two pictures") };
    assert!(left.right() < right.left() && (left.width() - right.width()).abs() < 2.0);
    assert!((left.union(right).width() - alone[0].width()).abs() < 2.0);
    desk.press(Key::ArrowRight);
    desk.settle();
    assert_eq!((steps(&desk), views(&desk).place()), ([1, 1], 0));
    click_at(&mut desk, right.center());
    assert_eq!(views(&desk).place(), 1);
    assert!(both(&desk).iter().all(|session| session.picked().is_none()), "the click only turned to it");
    click_at(&mut desk, right.center());
    assert!(views(&desk).active().picked().is_some() && views(&desk).beside().unwrap().picked().is_none());
    desk.harness.get_by_label("Turn to the left one");
    desk.press(Key::T);
    desk.settle();
    assert_eq!(views(&desk).place(), 0);
    // A press on what lies over the other picture is none in it.
    desk.press(Key::H);
    desk.settle();
    let over = desk.place_of("ten steps back or on").center();
    assert!(right.contains(over), "the help lies over it");
    click_at(&mut desk, over);
    assert_eq!(views(&desk).place(), 0);
    desk.press(Key::H);
    desk.settle();
    // A drag in either turns both, and makes it active.
    let before = both(&desk).map(|session| session.camera());
    desk.drag(right.center(), right.center() + vec2(40.0, 10.0));
    desk.settle();
    let after = both(&desk).map(|session| session.camera());
    assert!(after[0] == after[1] && after[0] != before[0] && views(&desk).place() == 1);
    desk.click("cameras together");
    desk.drag(left.center(), left.center() + vec2(40.0, 10.0));
    desk.settle();
    assert_ne!(both(&desk)[0].camera(), both(&desk)[1].camera());
    desk.save("views.png");
    desk.click("Close the right view");
    desk.settle();
    assert!(views(&desk).beside().is_none());
    assert_eq!(pictures(&desk), alone);
    desk.harness.get_by_label("Same data");
}

#[test]
fn the_difference_of_two_looks_has_colours_and_numbers() {
    let Some(mut desk) = Desk::open() else { return };
    open_second(&mut desk, "Same data");
    desk.click("difference");
    desk.settle();
    let there = desk.harness.get_by_label("Picture of the difference: no difference").rect();
    assert!(there.width() > pictures(&desk)[0].width() - 1.0);
    // Another range: other colours.
    desk.click("Colour map");
    desk.settle();
    desk.click("turbo");
    desk.settle();
    let found = views(&desk).difference().unwrap().unwrap();
    assert!(found.raw.max > 0.01 && found.raw.rmse < found.raw.max);
    let text = "Picture of the difference: largest";
    assert_eq!(desk.harness.get_all_by(|node| node.label().is_some_and(|label| label.starts_with(text))).count(), 1);
    desk.save("difference.png");
    desk.press(Key::ArrowRight);
    desk.settle();
    assert_ne!(views(&desk).difference().unwrap().unwrap().time, found.time);
    desk.click("difference");
    desk.settle();
    assert_eq!(pictures(&desk).len(), 2);
}

#[test]
fn another_field_and_another_file_are_shown_on_the_same_clock() {
    let folder = tempfile::tempdir().unwrap();
    let path = store(folder.path());
    let other = tempfile::tempdir().unwrap();
    let beside = store(other.path());
    let start = Start::Open(vec![path]);
    let options = WindowOptions { beside: Some(beside), ..options(folder.path(), start) };
    let Some(mut desk) = Desk::with([1280.0, 800.0], 1.0, options, folder) else { return };
    desk.begin();
    until_two(&mut desk);
    desk.settle();
    assert_eq!(desk.session().notices(), &[]);
    let sources = both(&desk).map(|session| session.source().to_owned());
    assert_ne!(sources[0], sources[1]);
    desk.press(Key::End);
    desk.settle();
    assert_eq!(steps(&desk), [STEPS - 1; 2]);
    desk.click("difference");
    desk.settle();
    assert_eq!(views(&desk).difference().unwrap().unwrap().raw.max, 0.0, "the same values at the same colours");
    let fields: Vec<String> = desk.session().store().fields().iter().map(|field| field.name.clone()).collect();
    desk.click("Close the right view");
    desk.settle();
    desk.click("Field...");
    let name = fields.iter().find(|name| **name != desk.session().series().field().name).unwrap();
    desk.harness.get_all_by_label(name).last().unwrap().click();
    until_two(&mut desk);
    desk.settle();
    assert_eq!(both(&desk)[1].series().field().name, *name);
}

#[test]
fn in_a_small_window_nothing_lies_over_anything() {
    for size in [[640.0, 480.0], [800.0, 600.0], [1920.0, 1080.0]] {
        let folder = tempfile::tempdir().unwrap();
        let start = Start::Open(vec![store(folder.path())]);
        let options = options(folder.path(), start);
        let Some(mut desk) = Desk::with(size, 1.0, options, folder) else { return };
        desk.begin();
        desk.settle();
        open_second(&mut desk, "Same data");
        let places = pictures(&desk);
        let timeline = desk.place_of("Step slider");
        assert_eq!(places.len(), 2);
        assert!(
            places.iter().all(|place| place.width() > 100.0 && place.bottom() <= timeline.top() + 1.0),
            "{places:?}"
        );
        desk.save(&format!("views_{}.png", size[0]));
        desk.click("difference");
        desk.settle();
        assert_eq!(pictures(&desk).len(), 1);
        desk.save(&format!("views_difference_{}.png", size[0]));
    }
}

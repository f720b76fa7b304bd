//! Two sessions on one clock.

use super::super::desk::{Desk, slow, store};
use super::super::worker::tests::wait_for;
use super::*;
use crate::camera::Axis;
use crate::look::FlowLook;
use crate::pipeline::Series;
use crate::pipeline::test_series::logged;
use crate::playback::quality::Quality;
use crate::playback::{Command, Direction, Loop, Mode, StepRange};
use crate::render::flow::FlowStyle;
use crate::transfer::ColorMap;
use glam::DVec2;
use std::path::Path;

/// Two views and the clock of both.
struct Pair {
    views: Views,
    now: Duration,
}

impl Pair {
    fn of(left: Desk, right: Desk) -> Self {
        let mut views = Views::of(left.session, Arc::new(|| ()));
        views.put_beside(right.session, Duration::ZERO);
        Self { views, now: Duration::ZERO }
    }

    fn open() -> Self {
        let series = Arc::new(Series::open(store(), None).unwrap());
        let desk = || Desk::of(series.clone(), Path::new("."));
        Self::of(desk(), desk())
    }

    fn fake(steps: usize) -> Self {
        let (series, _) = logged(steps);
        let desk = || Desk::of(series.clone(), Path::new("."));
        Self::of(desk(), desk())
    }

    fn act(&mut self, action: Action) {
        self.views.act(action, self.now);
    }

    fn view(&mut self, action: ViewAction) {
        self.act(Action::View(action));
    }

    /// Ticks until nothing is pending and nothing new comes without time passing.
    fn settle(&mut self) {
        let mut at_rest = 0;
        wait_for("rest", || {
            let ticked = self.views.tick(self.now);
            let is_at_rest = !ticked.active && !ticked.beside && !self.views.is_waiting();
            at_rest = if is_at_rest { at_rest + 1 } else { 0 };
            (at_rest > 2).then_some(())
        });
    }

    /// Steps on the screen, of the active view and of the other.
    fn steps(&self) -> [usize; 2] {
        [self.views.active(), self.views.beside().unwrap()].map(|view| view.shown().unwrap().request.time.step())
    }

    fn cameras(&self) -> [crate::camera::Camera; 2] {
        [self.views.active(), self.views.beside().unwrap()].map(|view| view.shown().unwrap().request.camera)
    }

    /// Whether the pictures on the screen are equal to the bit.
    fn are_equal(&self) -> bool {
        let color = |view: &Session| view.shown().unwrap().frame.planes.color.clone();
        color(self.views.active()) == color(self.views.beside().unwrap())
    }
}

#[test]
fn both_show_the_same_moment_wherever_the_clock_is_sent() {
    let mut pair = Pair::open();
    pair.settle();
    assert!(pair.steps() == [0, 0] && pair.are_equal());
    for (command, step) in [(Command::Step(1), 1), (Command::SeekStep(3), 3), (Command::Step(-1), 2)] {
        pair.act(Action::Play(command));
        pair.settle();
        assert_eq!(pair.steps(), [step; 2], "{command:?}");
    }
}

#[test]
fn while_it_plays_no_frame_is_shown_before_the_other_view_has_the_last() {
    // On a slow machine the next step is due as soon as one is shown.
    for ms in [7, 400] {
        let mut pair = Pair::fake(12);
        pair.settle();
        pair.act(Action::Play(Command::Play));
        let mut seen = Vec::new();
        wait_for("end", || {
            pair.now += Duration::from_millis(ms);
            pair.views.tick(pair.now);
            let steps = pair.steps();
            if seen.last() != Some(&steps) {
                seen.push(steps);
            }
            (!pair.views.active().state().playing && steps == [11, 11]).then_some(())
        });
        // Either may be the first with a step; the clock goes on when both have it.
        assert!(seen.iter().all(|[active, beside]| active.abs_diff(*beside) <= 1), "{seen:?}");
        for step in 0..12 {
            assert!(seen.iter().any(|steps| steps[1] == step), "{ms} ms: step {step} was left out: {seen:?}");
        }
    }
}

#[test]
fn a_time_axis_of_its_own_is_met_at_the_time_and_not_at_the_number_of_the_step() {
    // Steps of the first are at 0, 1, .., of the second at the same times and further ones.
    let (left, right) = (logged(3).0, logged(9).0);
    let mut pair = Pair::of(Desk::of(left, Path::new(".")), Desk::of(right, Path::new(".")));
    pair.act(Action::Play(Command::SeekStep(2)));
    pair.settle();
    assert_eq!(pair.steps(), [2, 2]);
    pair.view(ViewAction::Turn);
    pair.act(Action::Play(Command::SeekStep(7)));
    pair.settle();
    assert_eq!(pair.steps(), [7, 2], "the shorter one stays at its end");
}

#[test]
fn turning_hands_over_the_playback_and_the_place_stays() {
    let mut pair = Pair::fake(20);
    pair.settle();
    let range = StepRange { a: 2, b: 15 };
    for command in [
        Command::Speed(3.0),
        Command::Range(Some(range)),
        Command::Stride(2),
        Command::Loop(Loop::Range),
        Command::Direction(Direction::Backward),
        Command::SeekStep(8),
        Command::Play,
    ] {
        pair.act(Action::Play(command));
    }
    assert_eq!(pair.views.place(), 0);
    let before = pair.views.active().state();
    pair.view(ViewAction::Turn);
    let after = pair.views.active().state();
    assert_eq!((pair.views.place(), after.playing, after.settings), (1, true, before.settings));
    let led = pair.views.beside().unwrap().state();
    assert!(!led.playing, "one clock runs");
    pair.act(Action::Play(Command::Pause));
    pair.settle();
    let [active, beside] = pair.steps();
    assert_eq!(active, beside);
    pair.act(Action::Play(Command::Mode(Mode::RealTime)));
    pair.act(Action::Play(Command::Interpolate(true)));
    pair.act(Action::Play(Command::SeekTime(4.25)));
    pair.settle();
    let times = [pair.views.active(), pair.views.beside().unwrap()].map(|view| view.shown().unwrap().request.time);
    assert!(times[0] == times[1] && times[0].toward().is_some(), "{times:?}");
    pair.view(ViewAction::Turn);
    pair.settle();
    assert_eq!((pair.views.place(), pair.views.active().state().settings.interpolate), (0, true));
}

#[test]
fn cameras_move_together_until_they_are_told_not_to() {
    let mut pair = Pair::open();
    pair.settle();
    pair.act(Action::Orbit(DVec2::new(0.3, 0.1)));
    pair.now += Duration::from_secs(1);
    pair.settle();
    let [active, beside] = pair.cameras();
    assert!(active == beside && pair.views.are_linked());
    pair.view(ViewAction::Link(false));
    pair.act(Action::ViewAlong { axis: Axis::X, from_positive: true });
    pair.settle();
    let [moved, stays] = pair.cameras();
    assert!(moved != stays && stays == beside);
    pair.view(ViewAction::Turn);
    pair.settle();
    assert_eq!(pair.cameras(), [stays, moved], "each view keeps its own");
    pair.view(ViewAction::Link(true));
    pair.settle();
    assert_eq!(pair.cameras(), [stays; 2], "the active one leads");
}

#[test]
fn each_view_has_changes_of_its_own_and_undo_is_of_the_active_one() {
    let mut pair = Pair::open();
    pair.settle();
    let gray = ColorMap::built_in("gray").unwrap().clone();
    pair.act(Action::Colors(gray.clone()));
    pair.settle();
    assert!(!pair.are_equal());
    let changes = |pair: &Pair| [pair.views.active(), pair.views.beside().unwrap()].map(|view| view.changes().0);
    assert_eq!(changes(&pair), [1, 0]);
    pair.view(ViewAction::Turn);
    pair.act(Action::Undo);
    assert_eq!(changes(&pair), [0, 1], "nothing to undo in this one");
    pair.act(Action::Colors(gray));
    pair.settle();
    assert!(pair.are_equal());
}

#[test]
fn the_difference_of_two_pictures_is_found_and_follows_every_change() {
    let mut pair = Pair::open();
    pair.view(ViewAction::Difference(true));
    pair.settle();
    let found = |pair: &Pair| pair.views.difference().unwrap().unwrap();
    assert_eq!(found(&pair).raw.max, 0.0);
    pair.act(Action::Colors(ColorMap::built_in("gray").unwrap().clone()));
    pair.settle();
    let first = found(&pair);
    let [left, right] = [pair.views.active(), pair.views.beside().unwrap()];
    let color = |view: &Session| view.shown().unwrap().frame.planes.color.clone();
    let raw = crate::image::compare_raw(&color(left), &color(right)).unwrap();
    assert!(first.raw == raw && raw.max > 0.0);
    pair.act(Action::Play(Command::SeekStep(2)));
    pair.settle();
    let times = &pair.views.active().series().times().values;
    assert_eq!((first.time, found(&pair).time), (times[0], times[2]));
    // Left minus right, whichever is active.
    let before = found(&pair);
    pair.view(ViewAction::Turn);
    pair.settle();
    assert_eq!(found(&pair).picture, before.picture);
    pair.view(ViewAction::Difference(false));
    assert!(pair.views.difference().is_none() && !pair.views.shows_difference());
}

#[test]
fn pictures_that_are_compared_are_drawn_in_full_even_while_something_moves() {
    let series = Arc::new(Series::open(store(), None).unwrap());
    let desk = || {
        let mut desk = Desk::of(series.clone(), Path::new("."));
        desk.act(Action::TargetRate(Some(25.0)));
        slow(&mut desk, 400.0);
        desk
    };
    let mut pair = Pair::of(desk(), desk());
    pair.settle();
    let drawn = |pair: &mut Pair| {
        pair.act(Action::Orbit(DVec2::new(0.1, 0.0)));
        pair.settle();
        let qualities = [pair.views.active(), pair.views.beside().unwrap()].map(|view| view.shown().unwrap().quality);
        pair.now += Duration::from_secs(1);
        pair.settle();
        qualities
    };
    let in_motion = drawn(&mut pair);
    assert!(in_motion.iter().all(|quality| *quality != Quality::Exact), "{in_motion:?}");
    pair.view(ViewAction::Difference(true));
    assert_eq!(drawn(&mut pair), [Quality::Exact; 2]);
}

#[test]
fn a_view_that_cannot_be_drawn_does_not_hold_up_the_clock() {
    let (series, log) = logged(6);
    let (other, _) = logged(6);
    log.fail_at(2);
    let mut pair = Pair::of(Desk::of(other, Path::new(".")), Desk::of(series, Path::new(".")));
    pair.settle();
    pair.act(Action::Play(Command::Play));
    wait_for("end", || {
        pair.now += Duration::from_millis(50);
        pair.views.tick(pair.now);
        (!pair.views.active().state().playing).then_some(())
    });
    pair.settle();
    assert_eq!(pair.steps(), [5, 5]);
    let notices = pair.views.active().notices();
    assert!(notices.iter().any(|n| n.text.contains("right view") && n.text.contains("damaged")), "{notices:?}");
}

#[test]
fn the_view_that_is_closed_is_the_other_one_and_what_is_left_goes_on() {
    let mut pair = Pair::fake(8);
    pair.settle();
    pair.act(Action::Help);
    pair.view(ViewAction::Turn);
    pair.act(Action::Play(Command::SeekStep(5)));
    pair.settle();
    assert!(!pair.views.active().help_is_open());
    pair.view(ViewAction::Close);
    assert!(pair.views.beside().is_none() && pair.views.place() == 0);
    for action in [ViewAction::Turn, ViewAction::Link(true), ViewAction::Difference(true), ViewAction::Close] {
        pair.view(action);
    }
    pair.settle();
    let active = pair.views.active();
    assert_eq!((active.shown().unwrap().request.time.step(), active.state().steps), (5, 8));
    assert!(!pair.views.shows_difference());
}

#[test]
fn a_camera_that_frames_the_mesh_does_so_in_half_of_the_window_too() {
    let series = Arc::new(Series::open(store(), None).unwrap());
    let desk = || Desk::of(series.clone(), Path::new("."));
    let (mut left, right) = (desk(), desk());
    left.session.set_viewport(60, 20);
    let wide = left.session.camera();
    let mut pair = Pair::of(left, right);
    pair.views.sessions_mut().for_each(|session| session.set_viewport(15, 20));
    let narrow = pair.views.active().camera();
    assert_ne!(narrow, wide, "it stands further off");
    pair.view(ViewAction::Close);
    pair.views.active_mut().set_viewport(60, 20);
    assert_eq!(pair.views.active().camera(), wide);
    // One that was moved stays.
    pair.act(Action::Orbit(DVec2::new(0.1, 0.0)));
    let moved = pair.views.active().camera();
    pair.views.put_beside(Desk::of(series.clone(), Path::new(".")).session, Duration::ZERO);
    pair.views.active_mut().set_viewport(15, 20);
    assert_eq!(pair.views.active().camera(), moved);
}

#[test]
fn the_flow_of_both_views_is_blurred_while_one_of_them_plays() {
    let mut pair = Pair::open();
    pair.settle();
    for session in pair.views.sessions_mut() {
        let still = FlowLook { rate: Some(0.0), ..FlowLook::new("velocity".to_owned(), FlowStyle::default()) };
        session.act(Action::Flow(Some(Box::new(still))), Duration::ZERO);
    }
    pair.settle();
    let shutters = |pair: &Pair| {
        let layers = |view: &Session| view.shown().unwrap().request.layers.clone();
        [pair.views.active(), pair.views.beside().unwrap()]
            .map(|view| layers(view).iter().find_map(|layer| layer.flow()).unwrap().shutter)
    };
    assert_eq!(shutters(&pair), [0.0; 2]);
    pair.act(Action::Play(Command::Play));
    pair.settle();
    pair.now += Duration::from_millis(40);
    pair.settle();
    let times = &store().times().values;
    assert_eq!((pair.steps(), shutters(&pair)), ([1; 2], [times[2] - times[1]; 2]));
    pair.act(Action::Play(Command::Pause));
    pair.settle();
    assert_eq!((pair.steps(), shutters(&pair)), ([1; 2], [0.0; 2]));
}

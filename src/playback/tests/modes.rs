//! The modes that show each step.

use super::*;

const PLAY: Command = Command::Play;

#[test]
fn the_first_frame_is_due_before_anything_is_played() {
    let mut player = Player::with(3, &[]);
    player.run(100.0, secs(1.0));
    assert_eq!(player.steps(), [0]);
    assert!(!player.state().playing && !player.state().ended);
}

#[test]
fn n_steps_are_n_frames_whether_the_first_was_shown_before_or_not() {
    for shown_before in [false, true] {
        let mut player = Player::with(5, &[]);
        if shown_before {
            player.refresh();
        }
        player.apply(PLAY);
        player.show(99);
        assert_eq!(player.steps(), [0, 1, 2, 3, 4]);
        assert!(player.state().ended && !player.state().playing);
        assert_eq!(player.state().dropped, 0);
    }
}

#[test]
fn played_again_at_the_end_it_begins_at_the_start() {
    let mut player = Player::with(3, &[PLAY]);
    player.show(99);
    player.apply(PLAY);
    assert!(!player.state().ended);
    player.show(99);
    assert_eq!(player.steps(), [0, 1, 2, 0, 1, 2]);
    player.apply(Command::Reverse);
    assert!(!player.state().ended, "there is a way to go again");
    player.apply(PLAY);
    player.show(99);
    assert_eq!(player.steps()[6..], [1, 0]);
}

#[test]
fn frames_come_at_the_rate_from_when_the_first_is_on_the_screen() {
    let mut player = Player::with(4, &[Command::Speed(4.0), PLAY]);
    player.now = secs(7.0);
    player.show(99);
    let at: Vec<f64> = player.shown.iter().map(|&(at, _)| at - 7.0).collect();
    // Up to EARLY (a thousandth of the interval, a quarter of a millisecond) and a nanosecond for each rounding.
    assert!(at.iter().zip([0.0, 0.25, 0.5, 0.75]).all(|(at, expected)| (at - expected).abs() < 0.26e-3), "{at:?}");
}

#[test]
fn a_renderer_that_does_not_keep_up_slows_the_playback_and_drops_nothing() {
    let mut player = Player::with(30, &[Command::Speed(50.0), PLAY]);
    player.render = secs(0.1);
    player.run(2.95, Duration::ZERO);
    assert_eq!(player.steps(), (0..30).collect::<Vec<_>>());
    let measured = player.state().frames_per_second.unwrap();
    assert!(is_same(measured, 10.0), "the rate reported is the one achieved: {measured}");
    assert_eq!(player.state().dropped, 0);
}

#[test]
fn after_a_hiccup_one_interval_is_made_up_for_and_no_more() {
    let mut player = Player::with(100, &[Command::Speed(10.0), PLAY]);
    player.show(10);
    player.render = secs(3.0);
    player.show(11);
    player.render = Duration::ZERO;
    let before = player.now;
    player.show(14);
    let after: Vec<f64> = player.shown[11..].iter().map(|&(at, _)| at - before.as_secs_f64()).collect();
    // Measured: a nanosecond.
    assert!(
        after.iter().zip([0.0, 0.1, 0.2]).all(|(at, expected)| (at - expected).abs() < FEW_NANOSECONDS),
        "{after:?}"
    );
}

#[test]
fn as_fast_as_possible_never_waits() {
    let mut player = Player::with(100, &[Command::Mode(Mode::AsFastAsPossible), PLAY]);
    player.render = secs(0.001);
    while player.state().playing {
        assert!(player.clock.due(player.now).frame.is_some());
        player.refresh();
    }
    assert_eq!(player.steps(), (0..100).collect::<Vec<_>>());
    assert_eq!(player.now, secs(0.1));
    assert_eq!(player.state().speed, None);
}

#[test]
fn a_frame_is_due_until_it_is_shown_and_the_next_one_is_not_before() {
    let mut player = Player::with(5, &[PLAY]);
    for hour in 0..3 {
        let due = player.clock.due(secs(3600.0 * f64::from(hour)));
        assert_eq!((due.frame, due.wait), (Some(0.into()), None));
    }
    player.now = secs(3.0 * 3600.0);
    player.clock.frame_shown(0.into(), player.now);
    assert_eq!(player.clock.due(player.now).frame, None);
}

#[test]
fn pausing_keeps_what_has_passed_of_the_interval() {
    let mut player = Player::with(5, &[Command::Speed(1.0), PLAY]);
    player.refresh();
    player.now = secs(0.75);
    player.apply(Command::Pause);
    player.run(1000.0, secs(7.0));
    assert_eq!(player.steps(), [0]);
    player.apply(Command::Toggle);
    let wait = player.refresh().unwrap().as_secs_f64();
    assert!(is_same(wait, 0.25), "{wait}");
}

#[test]
fn changing_the_speed_keeps_the_share_that_has_passed() {
    let mut player = Player::with(5, &[Command::Speed(1.0), PLAY]);
    player.refresh();
    player.now = secs(0.75);
    player.apply(Command::Speed(0.1));
    let wait = player.refresh().unwrap().as_secs_f64();
    assert!(is_same(wait, 2.5), "{wait}");
    assert_eq!(player.steps(), [0]);
}

#[test]
fn turning_round_in_between_keeps_the_frame_and_its_time() {
    let mut player = Player::with(5, &[Command::Speed(1.0), Command::SeekStep(2), PLAY]);
    player.refresh();
    player.now = secs(0.75);
    player.apply(Command::Reverse);
    let wait = player.refresh().unwrap().as_secs_f64();
    assert!(is_same(wait, 0.25), "{wait}");
    player.show(99);
    assert_eq!(player.steps(), [2, 1, 0]);
}

#[test]
fn loops_go_on_until_they_are_switched_off() {
    let mut player = Player::with(3, &[Command::Loop(Loop::All), PLAY]);
    player.show(8);
    player.apply(Command::Loop(Loop::Off));
    player.show(99);
    assert_eq!(player.steps(), [0, 1, 2, 0, 1, 2, 0, 1, 2]);
}

#[test]
fn ping_pong_says_where_it_goes_and_remembers_the_direction_asked_for() {
    let mut player = Player::with(3, &[Command::Loop(Loop::PingPong), PLAY]);
    player.show(4);
    let state = player.state();
    assert_eq!((state.heading, state.settings.direction), (Direction::Backward, Direction::Forward));
    player.show(7);
    assert_eq!(player.steps(), [0, 1, 2, 1, 0, 1, 2]);
    player.show(8);
    player.apply(Command::Stop);
    player.refresh();
    assert_eq!(player.steps()[7..], [1, 0], "stopped at the start, not at the turn");
}

#[test]
fn one_step_ends_at_once_or_waits_in_a_loop_for_a_longer_range() {
    let mut single = Player::with(1, &[PLAY]);
    single.show(99);
    assert_eq!((single.steps(), single.state().ended), (vec![0], true));
    let range = |a, b| Command::Range(Some(StepRange { a, b }));
    let mut player = Player::with(9, &[range(4, 4), Command::Loop(Loop::Range), PLAY]);
    player.run(60.0, secs(1.0));
    assert_eq!((player.steps(), player.state().playing), (vec![4], true));
    player.apply(range(5, 4));
    player.show(4);
    assert_eq!(player.steps(), [4, 5, 4, 5]);
}

#[test]
fn nothing_is_due_in_an_empty_series() {
    let mut player = Player::with(0, &[Command::SeekTime(3.0), Command::SeekStep(3), Command::Step(-2), Command::Stop]);
    for mode in [Mode::EveryStep, Mode::RealTime, Mode::AsFastAsPossible] {
        for command in [Command::Mode(mode), Command::Interpolate(true), Command::Loop(Loop::All), PLAY] {
            player.apply(command);
        }
        assert_eq!(player.clock.due(secs(1.0)), Due::default());
        assert!(player.upcoming(3).is_empty());
    }
    assert_eq!((player.state().frame, player.state().time), (None, None));
}

#[test]
fn a_caller_with_a_refresh_rate_of_its_own_gets_the_rate_on_average() {
    for (fps, refresh) in [(24.0, 60.0), (50.0, 60.0), (59.0, 60.0), (60.0, 60.0), (25.0, 144.0), (60.0, 59.94)] {
        let mut player = Player::with(10, &[Command::Loop(Loop::All), Command::Speed(fps), PLAY]);
        player.run(10.0, secs(1.0 / refresh));
        // In ten seconds one frame more or less is up to a two hundred and fortieth. Measured: 0.42 %.
        let rate = (player.shown.len() - 1) as f64 / 10.0;
        assert!((rate / fps - 1.0).abs() < 0.01, "{fps} at {refresh} Hz: {rate}");
        let reported = player.state().frames_per_second.unwrap();
        assert!((reported / fps - 1.0).abs() < 0.01, "{fps} at {refresh} Hz: {reported}");
    }
}

#[test]
fn time_that_goes_back_stands_still_and_goes_on_from_there() {
    let mut player = Player::with(5, &[Command::Speed(1.0), PLAY]);
    player.now = secs(1e6);
    player.refresh();
    player.now = secs(1e6 + 0.5);
    player.refresh();
    player.now = secs(3.0);
    let wait = player.refresh().unwrap().as_secs_f64();
    assert!(is_same(wait, 0.5), "{wait}");
    player.now = secs(3.5);
    player.refresh();
    assert_eq!(player.steps(), [0, 1]);
}

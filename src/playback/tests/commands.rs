//! Seeking, stepping, ranges, and commands as data.

use super::*;

fn range(a: usize, b: usize) -> Command {
    Command::Range(Some(StepRange { a, b }))
}

#[test]
fn a_seek_storm_ends_at_the_last_frame_asked_for() {
    for mode in [Mode::EveryStep, Mode::RealTime, Mode::AsFastAsPossible] {
        let mut player = Player::with(5000, &[Command::Mode(mode), Command::Play]);
        player.refresh();
        let mut in_flight = Vec::new();
        for i in 0..1000 {
            player.now += secs(0.001);
            player.apply(Command::SeekStep((i + 1) * 7919 % 5000));
            // A renderer that is seven seeks behind.
            in_flight.push(player.clock.due(player.now).frame.unwrap());
            if i >= 7 {
                player.clock.frame_shown(in_flight[i - 7], player.now);
            }
        }
        assert_eq!(player.state().frame, Some((1000 * 7919 % 5000).into()));
        let due = player.clock.due(player.now);
        assert_eq!((due.frame, due.dropped), (Some((1000 * 7919 % 5000).into()), 0));
        player.apply(Command::Pause);
        player.refresh();
        assert_eq!(player.steps().last(), Some(&(1000 * 7919 % 5000)));
        player.run(10.0, secs(0.1));
        assert_eq!(player.shown.len(), 2, "the first frame and the last");
    }
}

#[test]
fn seeking_out_of_range_goes_to_the_ends() {
    let mut player = Player::with(5, &[]);
    for (command, step) in [
        (Command::SeekStep(99), 4),
        (Command::SeekStep(usize::MAX), 4),
        (Command::SeekTime(-1e300), 0),
        (Command::SeekTime(f64::INFINITY), 4),
        (Command::SeekTime(f64::NEG_INFINITY), 0),
        (Command::Step(i64::MAX), 4),
        (Command::Step(i64::MIN), 0),
    ] {
        player.apply(command);
        assert_eq!(player.state().frame, Some(step.into()), "{command:?}");
    }
}

#[test]
fn seeking_to_a_time_shows_the_step_that_holds_it_or_the_mixture() {
    let times = TimeAxis { values: vec![0.0, 0.333333, 0.666667, 1.0, 3.0] };
    let mut player = Player::new(times);
    for (time, step) in [(0.3, 0), (1.0 / 3.0, 1), (2.0 / 3.0, 2), (2.9, 3), (3.0, 4)] {
        player.apply(Command::SeekTime(time));
        assert_eq!(player.state().frame, Some(step.into()), "{time}");
    }
    player.apply(Command::Mode(Mode::RealTime));
    player.apply(Command::SeekTime(1.5));
    assert_eq!((player.state().frame, player.state().time), (Some(3.into()), Some(1.5)));
    player.apply(Command::Interpolate(true));
    assert_eq!(player.state().frame, Some(FrameTime::between(3, 4, 0.25)));
    player.apply(Command::Reverse);
    assert_eq!(player.state().frame, Some(FrameTime::between(3, 4, 0.25)), "either way");
}

#[test]
fn stepping_pauses_and_ignores_direction_and_stride() {
    let mut player = Player::with(9, &[Command::Direction(Direction::Backward), Command::Stride(3), Command::Play]);
    player.apply(Command::SeekStep(4));
    for (count, step) in [(1, 5), (-2, 3), (0, 3), (10, 8), (-10, 0)] {
        player.apply(Command::Step(count));
        assert_eq!((player.state().frame, player.state().playing), (Some(step.into()), false), "{count}");
    }
}

#[test]
fn stepping_from_between_two_steps_goes_to_them_first() {
    let between = [Command::Mode(Mode::RealTime), Command::Interpolate(true), Command::SeekTime(2.5)];
    for (count, step) in [(1, 3), (-1, 2), (2, 4), (-2, 1)] {
        let mut player = Player::with(9, &between);
        player.apply(Command::Step(count));
        assert_eq!(player.state().frame, Some(step.into()), "{count}");
    }
}

#[test]
fn seeking_while_playing_goes_on_from_there_once_the_frame_is_on_the_screen() {
    for mode in [Mode::EveryStep, Mode::RealTime] {
        let mut player = Player::with(9, &[Command::Mode(mode), Command::Speed(1.0), Command::Play]);
        player.refresh();
        player.now = secs(0.9);
        player.apply(Command::SeekStep(5));
        player.now = secs(5.0);
        player.refresh();
        let wait = player.refresh().unwrap().as_secs_f64();
        assert!(is_same(wait, 1.0), "{mode:?}: a whole interval: {wait}");
        player.show(4);
        assert_eq!(player.steps(), [0, 5, 6, 7], "{mode:?}");
    }
}

#[test]
fn a_range_bounds_what_is_played_but_not_where_one_can_go() {
    let mut player = Player::with(20, &[range(8, 2), Command::Stride(4), Command::Play]);
    player.show(99);
    assert_eq!(player.steps(), [2, 6], "begins at A; B is not on the stride");
    assert!(player.state().ended);
    player.apply(Command::SeekStep(15));
    assert_eq!(player.state().frame, Some(15.into()));
    assert_eq!(player.upcoming(3), [2, 6]);
    player.apply(Command::Play);
    player.show(99);
    assert_eq!(player.steps(), [2, 6, 2, 6], "15 was left before it was shown");
    player.apply(Command::Range(None));
    assert_eq!(player.state().settings.range, None);
    assert!(!player.state().ended, "the series goes on");
}

#[test]
fn backwards_it_begins_at_the_last_step() {
    let settings = Settings { direction: Direction::Backward, stride: 2, ..Settings::default() };
    let mut player = Player::new(uniform(0));
    player.clock = Clock::with_settings(uniform(6), settings).unwrap();
    player.apply(Command::Play);
    player.show(99);
    assert_eq!(player.steps(), [4, 2, 0]);
}

#[test]
fn what_makes_no_sense_is_refused_and_changes_nothing() {
    let mut player = Player::with(5, &[Command::Play, Command::SeekStep(2)]);
    let before = player.state();
    for (command, named) in [
        (Command::Speed(0.0), "0"),
        (Command::Speed(-1.0), "-1"),
        (Command::Speed(f64::NAN), "NaN"),
        (Command::Speed(f64::INFINITY), "inf"),
        (Command::Stride(0), "stride"),
        (Command::SeekTime(f64::NAN), "NaN"),
    ] {
        let error = player.clock.apply(command, secs(1.0)).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
        assert_eq!(player.state(), before);
    }
    assert!(Clock::with_settings(uniform(3), Settings { stride: 0, ..Settings::default() }).is_err());
    let slow = Settings { time_per_second: Some(0.0), ..Settings::default() };
    assert!(Clock::with_settings(uniform(3), slow).is_err());
}

#[test]
fn commands_and_settings_are_the_same_after_a_file() {
    let written = [
        (Command::Play, r#""play""#),
        (Command::Step(-1), r#"{"step":-1}"#),
        (Command::SeekTime(0.1), r#"{"seek-time":0.1}"#),
        (Command::Loop(Loop::PingPong), r#"{"loop":"ping-pong"}"#),
        (range(1, 2), r#"{"range":{"a":1,"b":2}}"#),
        (Command::Mode(Mode::EveryStep), r#"{"mode":"every-step"}"#),
    ];
    for (command, json) in written {
        assert_eq!(serde_json::to_string(&command).unwrap(), json);
        assert_eq!(serde_json::from_str::<Command>(json).unwrap(), command);
    }
    let settings = Settings { time_per_second: Some(0.1), repeat: Loop::Range, ..Settings::default() };
    let json = serde_json::to_string(&settings).unwrap();
    assert_eq!(serde_json::from_str::<Settings>(&json).unwrap(), settings);
    assert_eq!(serde_json::from_str::<Settings>("{}").unwrap(), Settings::default());
    assert!(serde_json::from_str::<Settings>(r#"{"sped":1}"#).is_err());
    let state = serde_json::to_value(Player::with(3, &[]).state()).unwrap();
    assert_eq!(state["settings"]["loop"], "off");
}

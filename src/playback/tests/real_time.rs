//! The mode in which the file's times lead.

use super::*;

const REAL_TIME: Command = Command::Mode(Mode::RealTime);
const PLAY: Command = Command::Play;

fn playing(values: &[f64], commands: &[Command]) -> Player {
    let mut player = Player::new(TimeAxis { values: values.to_vec() });
    [&[REAL_TIME], commands, &[PLAY]].concat().into_iter().for_each(|command| player.apply(command));
    player
}

/// Steps and when they were shown, rounded to a hundredth of a second.
fn shown(player: &Player) -> Vec<(usize, f64)> {
    player.shown.iter().map(|&(at, frame)| (frame.step(), (at * 100.0).round() / 100.0)).collect()
}

#[test]
fn a_series_lasts_ten_seconds_unless_a_speed_is_asked_for() {
    for scale in [1e-9, 1.0, 1e9] {
        let mut player = playing(&[5.0 * scale, 6.0 * scale, 7.0 * scale, 9.0 * scale], &[]);
        player.show(99);
        assert_eq!(shown(&player), [(0, 0.0), (1, 2.5), (2, 5.0), (3, 10.0)]);
        assert!(player.state().ended);
    }
}

#[test]
fn the_times_of_the_file_are_kept_at_an_offset_of_a_billion() {
    let mut player = playing(&[1e9, 1e9 + 0.25, 1e9 + 2.0, 1e9 + 2.5], &[Command::Speed(0.5)]);
    player.show(99);
    assert_eq!(shown(&player), [(0, 0.0), (1, 0.5), (2, 4.0), (3, 5.0)]);
}

#[test]
fn the_end_of_a_loop_is_seen_as_long_as_the_interval_before_it() {
    let mut player = playing(&[0.0, 1.0, 1.5], &[Command::Speed(1.0), Command::Loop(Loop::All)]);
    player.show(6);
    assert_eq!(shown(&player), [(0, 0.0), (1, 1.0), (2, 1.5), (0, 2.0), (1, 3.0), (2, 3.5)]);
    let backward = [Command::Speed(1.0), Command::Loop(Loop::All), Command::Direction(Direction::Backward)];
    let mut player = playing(&[0.0, 1.0, 1.5], &[&backward[..], &[Command::Stop]].concat());
    player.show(5);
    assert_eq!(shown(&player), [(2, 0.0), (1, 0.5), (0, 1.5), (2, 2.5), (1, 3.0)]);
}

#[test]
fn steps_that_no_frame_can_show_are_dropped_and_counted() {
    let mut player = playing(&uniform(100).values, &[Command::Speed(10.0)]);
    player.refresh();
    for (at, step, dropped) in [(0.1, 1, 0), (0.45, 4, 2), (0.5, 5, 0), (2.05, 20, 14)] {
        player.now = secs(at);
        let due = player.clock.due(player.now);
        assert_eq!((due.frame, due.dropped), (Some(step.into()), dropped), "{at}");
        player.refresh();
    }
    assert_eq!(player.state().dropped, 16);
    player.render = secs(0.35);
    player.show(99);
    assert_eq!(player.steps().last(), Some(&99), "the last one is never dropped");
    assert_eq!(player.state().dropped as usize + player.shown.len(), 100, "each step is either shown or counted");
}

#[test]
fn frames_that_come_late_while_newer_ones_are_due_count_as_shown() {
    let mut player = playing(&uniform(100).values, &[Command::Speed(10.0)]);
    player.refresh();
    assert_eq!(player.clock.due(secs(0.1)).frame, Some(1.into()));
    assert_eq!(player.clock.due(secs(0.4)).dropped, 3);
    player.clock.frame_shown(1.into(), secs(0.45));
    let due = player.clock.due(secs(0.45));
    assert_eq!((due.frame, due.dropped), (Some(4.into()), 2));
}

#[test]
fn interpolated_frames_lie_between_the_steps_as_the_times_do() {
    let mut player = playing(&[0.0, 1.0, 3.0], &[Command::Speed(1.0), Command::Interpolate(true)]);
    player.run(3.2, secs(0.25));
    let between = FrameTime::between;
    let frames: Vec<FrameTime> = player.shown.iter().map(|&(_, frame)| frame).collect();
    assert_eq!(frames[..5], [0.into(), between(0, 1, 0.25), between(0, 1, 0.5), between(0, 1, 0.75), 1.into()]);
    assert_eq!(frames[5..8], [between(1, 2, 0.125), between(1, 2, 0.25), between(1, 2, 0.375)]);
    assert_eq!((frames.len(), frames[12]), (13, 2.into()));
    assert!(player.state().ended);
}

#[test]
fn mixtures_are_of_steps_that_are_played_and_never_across_the_end_of_a_loop() {
    let commands = [Command::Speed(1.0), Command::Interpolate(true), Command::Stride(3), Command::Loop(Loop::All)];
    let mut player = playing(&uniform(8).values, &commands);
    player.run(20.0, secs(0.1));
    for (_, frame) in &player.shown {
        let pair = (frame.step(), frame.toward().map(|(next, _)| next));
        assert!([(0, None), (3, None), (6, None), (0, Some(3)), (3, Some(6))].contains(&pair), "{pair:?}");
    }
    player.apply(Command::SeekStep(4));
    assert_eq!(player.state().frame, Some(4.into()), "a step that was asked for is itself");
}

#[test]
fn turning_round_in_between_goes_back_in_the_same_time() {
    let mut player = playing(&[0.0, 1.0, 3.0, 4.0], &[Command::Speed(1.0)]);
    player.run(1.5, Duration::ZERO);
    player.apply(Command::Reverse);
    assert!(is_same(player.state().time.unwrap(), 1.5));
    assert_eq!(player.upcoming(9), [0]);
    player.show(99);
    assert_eq!(shown(&player), [(0, 0.0), (1, 1.0), (0, 3.0)], "1 stays until the time of 0");
    assert_eq!(player.state().dropped, 0);
}

#[test]
fn speed_stride_and_pause_in_between_do_not_move_the_time() {
    let mut player = playing(&uniform(20).values, &[Command::Speed(1.0), Command::Interpolate(true)]);
    player.run(4.5, secs(0.1));
    let commands = [
        Command::Speed(3.0),
        Command::Stride(3),
        Command::Loop(Loop::PingPong),
        Command::Range(Some(StepRange { a: 2, b: 17 })),
        Command::Reverse,
        Command::Pause,
        Command::Stride(1),
        Command::Interpolate(false),
        Command::Play,
    ];
    for command in commands {
        player.apply(command);
        // The position goes through shares of an interval and back: roundings of 4.5, 9e-16 each. Measured: none.
        assert!((player.state().time.unwrap() - 4.5).abs() < 1e-14, "{command:?} {:?}", player.state());
    }
}

#[test]
fn a_machine_that_slept_goes_on_where_it_was() {
    for mode in [Mode::EveryStep, Mode::RealTime] {
        let mut player = Player::with(100_000, &[Command::Mode(mode), Command::Speed(1.0), PLAY]);
        player.run(5.5, secs(0.1));
        player.now += secs(8.0 * 3600.0);
        player.refresh();
        player.run(1.0, secs(0.1));
        assert_eq!(player.steps(), [0, 1, 2, 3, 4, 5, 6], "{mode:?}");
    }
}

#[test]
fn waiting_as_long_as_the_clock_said_is_no_sleep() {
    let mut player = playing(&[0.0, 3600.0, 3601.0], &[Command::Speed(1.0)]);
    player.show(99);
    assert_eq!(shown(&player), [(0, 0.0), (1, 3600.0), (2, 3601.0)]);
}

#[test]
fn times_at_the_ends_of_a_double_are_played() {
    let mut player = playing(&[-f64::MAX, 0.0, f64::MAX], &[]);
    player.show(99);
    assert_eq!(shown(&player), [(0, 0.0), (1, 5.0), (2, 10.0)]);
    let mut player = playing(&[-f64::MAX, f64::MAX], &[Command::Interpolate(true)]);
    player.run(5.05, secs(0.25));
    assert_eq!(player.state().frame, Some(FrameTime::between(0, 1, 0.5)));
    assert_eq!(player.state().time, Some(0.0), "as far from one end as from the other");
    let mut player = playing(&[0.0, 5e-324, 1e300], &[Command::Speed(5e-324), Command::Loop(Loop::All)]);
    player.run(3.0, secs(0.1));
    assert_eq!(player.steps()[..2], [0, 1]);
    let wait = player.refresh();
    assert!(wait.is_some_and(|wait| wait > secs(1e14)), "{wait:?}");
}

#[test]
fn rounds_of_a_loop_that_nobody_can_see_are_counted_not_walked() {
    for repeat in [Loop::All, Loop::PingPong] {
        let mut player = playing(&uniform(5).values, &[Command::Loop(repeat), Command::Speed(1e6)]);
        player.refresh();
        // One step more than whole rounds of 5 or of 8.
        player.now = secs(9.000_001);
        let due = player.clock.due(player.now);
        assert!((9e6 - 2.0..9e6 + 2.0).contains(&(due.dropped as f64)), "{due:?}");
    }
    // Speed is limited to a step per nanosecond: ten seconds of that take no time to compute.
    let mut player = playing(&uniform(5).values, &[Command::Loop(Loop::All), Command::Speed(f64::MAX)]);
    player.refresh();
    player.now = secs(9.0);
    while player.clock.due(player.now).frame.is_none() {
        player.now += Duration::from_nanos(1);
    }
    assert!(player.clock.due(player.now).dropped > 8_999_999_000);
}

#[test]
fn the_time_does_not_depend_on_how_often_the_clock_is_asked() {
    let commands = [Command::Loop(Loop::PingPong), Command::Speed(0.7)];
    let times: Vec<f64> = (0..30).map(|i| f64::from(i * i) * 0.01).collect();
    let (mut often, mut rarely) = (playing(&times, &commands), playing(&times, &commands));
    often.run(60.0, secs(0.001));
    rarely.run(60.0, secs(4.0));
    for player in [&mut often, &mut rarely] {
        player.clock.due(secs(60.0));
    }
    let (often, rarely) = (often.state(), rarely.state());
    // A few roundings of a minute in f64, at 0.7 units a second. Measured: 1.8e-15.
    let bound = 1e-14;
    assert!((often.time.unwrap() - rarely.time.unwrap()).abs() < bound);
    let mut slower = playing(&times, &[Command::Loop(Loop::PingPong), Command::Speed(0.700_001)]);
    slower.run(60.0, secs(4.0));
    slower.clock.due(secs(60.0));
    let other = slower.state().time.unwrap();
    assert!((often.time.unwrap() - other).abs() > bound, "a millionth of the speed is not noticed");
}

#[test]
fn changing_the_mode_keeps_the_step_and_each_mode_its_speed() {
    let mut player = Player::with(20, &[Command::Speed(5.0), REAL_TIME, Command::Speed(0.5), PLAY]);
    player.run(3.0, secs(0.1));
    assert_eq!(player.state().speed, Some(0.5));
    player.apply(Command::Mode(Mode::EveryStep));
    assert_eq!((player.state().speed, player.state().frame), (Some(5.0), Some(1.into())));
    player.run(0.5, secs(0.01));
    assert_eq!(player.steps(), [0, 1, 2, 3]);
}

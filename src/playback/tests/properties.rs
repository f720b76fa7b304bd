//! Random playbacks compared with naive ones, and random commands.

use super::*;
use proptest::prelude::*;

/// The naive order: the first `count` steps from the start.
fn naive_order(steps: usize, settings: &Settings, count: usize) -> Vec<usize> {
    let range = settings.range.filter(|_| settings.repeat != Loop::All);
    let range = range.unwrap_or(StepRange { a: 0, b: steps - 1 });
    let mut once: Vec<usize> = (range.a.min(range.b)..=range.a.max(range.b)).step_by(settings.stride).collect();
    if settings.direction == Direction::Backward {
        once.reverse();
    }
    let turn = once.len();
    match settings.repeat {
        _ if turn == 1 => once,
        Loop::Off => once,
        Loop::All | Loop::Range => once.into_iter().cycle().take(count).collect(),
        Loop::PingPong => {
            once.extend((1..turn - 1).rev().map(|i| once[i]).collect::<Vec<_>>());
            once.into_iter().cycle().take(count).collect()
        }
    }
}

/// Times at which the steps are reached at a speed, from 0 on: the intervals summed up naively.
fn naive_times(order: &[usize], times: &[f64], settings: &Settings, speed: f64) -> Vec<f64> {
    let mut at = vec![0.0];
    let adjacent = |a: usize, b: usize| a.abs_diff(b) == settings.stride;
    for (i, pair) in order.windows(2).enumerate() {
        // At the end of a loop of three steps or more, the interval before counts.
        let wraps = settings.repeat != Loop::PingPong && i > 0 && (pair[1] > pair[0]) != (order[1] > order[0]);
        let (a, b) = if wraps { (order[i - 1], pair[0]) } else { (pair[0], pair[1]) };
        assert!(adjacent(a, b));
        at.push(at[i] + (times[b] - times[a]).abs() / speed);
    }
    at
}

fn any_settings(steps: usize) -> impl Strategy<Value = Settings> {
    let repeat = prop_oneof![Just(Loop::Off), Just(Loop::All), Just(Loop::Range), Just(Loop::PingPong)];
    let range = prop::option::of((0..steps, 0..steps).prop_map(|(a, b)| StepRange { a, b }));
    let direction = any_direction();
    (repeat, range, direction, 1usize..5).prop_map(|(repeat, range, direction, stride)| Settings {
        repeat,
        range,
        direction,
        stride,
        ..Settings::default()
    })
}

fn any_direction() -> impl Strategy<Value = Direction> {
    prop_oneof![Just(Direction::Forward), Just(Direction::Backward)]
}

fn any_playback() -> impl Strategy<Value = (usize, Settings)> {
    (1usize..30).prop_flat_map(|steps| (Just(steps), any_settings(steps)))
}

/// Times with intervals from a thousandth to one, with an offset.
fn any_times(steps: std::ops::Range<usize>) -> impl Strategy<Value = Vec<f64>> {
    let offset = prop_oneof![Just(0.0), Just(-3.5), Just(1e9)];
    (offset, prop::collection::vec(0.001f64..1.0, steps)).prop_map(|(offset, intervals)| {
        let sum = |time: &mut f64, interval: f64| {
            *time += interval;
            Some(*time)
        };
        intervals.into_iter().scan(offset, sum).collect()
    })
}

fn any_command() -> impl Strategy<Value = Command> {
    let mode = prop_oneof![Just(Mode::EveryStep), Just(Mode::RealTime), Just(Mode::AsFastAsPossible)];
    let repeat = prop_oneof![Just(Loop::Off), Just(Loop::All), Just(Loop::Range), Just(Loop::PingPong)];
    prop_oneof![
        4 => Just(Command::Play),
        1 => Just(Command::Pause),
        1 => Just(Command::Toggle),
        1 => Just(Command::Stop),
        1 => (-40i64..40).prop_map(Command::Step),
        1 => (0usize..40).prop_map(Command::SeekStep),
        1 => any::<f64>().prop_map(Command::SeekTime),
        1 => (-2.0f64..30.0).prop_map(Command::SeekTime),
        1 => any::<f64>().prop_map(Command::Speed),
        1 => (0.1f64..240.0).prop_map(Command::Speed),
        1 => any_direction().prop_map(Command::Direction),
        1 => Just(Command::Reverse),
        1 => repeat.prop_map(Command::Loop),
        1 => prop::option::of((0usize..40, 0usize..40).prop_map(|(a, b)| StepRange { a, b })).prop_map(Command::Range),
        1 => (0usize..9).prop_map(Command::Stride),
        1 => mode.prop_map(Command::Mode),
        1 => any::<bool>().prop_map(Command::Interpolate),
    ]
}

/// An input to a clock, commands included.
#[derive(Clone, Debug)]
enum Event {
    Command(Command),
    Passed(Duration),
    Back(Duration),
    Asked,
    Shown,
    /// A frame that the clock may never have asked for.
    Stray(usize),
}

fn any_event() -> impl Strategy<Value = Event> {
    prop_oneof![
        3 => any_command().prop_map(Event::Command),
        3 => (0.0f64..0.5).prop_map(|s| Event::Passed(secs(s))),
        1 => (-9i32..16).prop_map(|e| Event::Passed(secs(10f64.powi(e)))),
        1 => (0.0f64..100.0).prop_map(|s| Event::Back(secs(s))),
        3 => Just(Event::Asked),
        4 => Just(Event::Shown),
        1 => (0usize..40).prop_map(Event::Stray),
    ]
}

/// Less than half of the shortest interval of [`any_times`] at the highest speed, 10.
const ROUNDING_SECS: f64 = 2e-5;

/// Compares the frames of a clock in real time, asked at these times, with the naively due ones.
fn compare_with_naive(
    times: &[f64],
    played: &[f64],
    settings: &Settings,
    speed: f64,
    pauses: &[f64],
) -> Result<(), TestCaseError> {
    let settings = Settings { mode: Mode::RealTime, time_per_second: Some(speed), ..*settings };
    // Intervals are a thousandth at least, which bounds the number of steps.
    let total: f64 = pauses.iter().sum();
    let order = naive_order(times.len(), &settings, (total * speed * 1000.0) as usize + 3);
    let reached = naive_times(&order, times, &settings, speed);
    let mut player = Player::new(uniform(0));
    player.clock = Clock::with_settings(TimeAxis { values: played.to_vec() }, settings).unwrap();
    player.apply(Command::Play);
    player.refresh();
    let mut last = 0;
    for &pause in pauses {
        player.now += secs(pause);
        let now = player.now.as_secs_f64();
        let due_at = |now: f64| reached.partition_point(|&at| at <= now).saturating_sub(1);
        // Times are rounded to nanoseconds, sums of times at an offset of 1e9 to a tenth of a microsecond each; and the clock may be early
        // by a thousandth of an interval or a millisecond.
        let least = due_at(now - ROUNDING_SECS).max(last);
        let interval = reached.get(least + 1).map_or(0.0, |next| next - reached[least]);
        let most = due_at(now + (1e-3 * interval).min(1e-3) + ROUNDING_SECS);
        let due = player.clock.due(player.now);
        let frame = player.state().frame.unwrap();
        let index = (least..=most).find(|&i| order[i] == frame.step());
        prop_assert!(index.is_some(), "at {now}: {frame:?}, not {:?}", &order[least..=most]);
        let index = index.unwrap();
        // After whole rounds of a loop the due frame is already on the screen.
        if due.frame.is_some() {
            prop_assert_eq!(due.dropped, (index - last).saturating_sub(1) as u64);
            last = index;
        }
        player.refresh();
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn every_step_is_played_once_in_order_at_any_speed_of_the_renderer(
        (steps, settings) in any_playback(),
        renders in prop::collection::vec(0.0f64..0.2, 1..9),
        fast: bool,
    ) {
        let mode = if fast { Mode::AsFastAsPossible } else { Mode::EveryStep };
        let mut player = Player::new(uniform(0));
        player.clock = Clock::with_settings(uniform(steps), Settings { mode, ..settings }).unwrap();
        player.apply(Command::Play);
        let mut render = renders.iter().cycle();
        for n in 1..70 {
            player.render = secs(*render.next().unwrap());
            player.show(n);
        }
        prop_assert_eq!(player.steps(), naive_order(steps, &settings, 69));
        prop_assert_eq!(player.state().ended, settings.repeat == Loop::Off);
        prop_assert_eq!(player.state().dropped, 0);
    }

    #[test]
    fn in_real_time_each_step_comes_when_the_naive_sum_says(
        times in any_times(2..30),
        settings in any_settings(2),
        speed in 0.1f64..10.0,
        pauses in prop::collection::vec(0.0f64..0.3, 1..60),
    ) {
        let last = times.len() - 1;
        let range = settings.range.map(|range| StepRange { a: range.a * last / 2, b: last - range.b });
        let settings = Settings { range, ..settings };
        compare_with_naive(&times, &times, &settings, speed, &pauses)?;
    }

    #[test]
    fn the_rate_is_the_one_asked_for_within_a_hundredth_over_ten_seconds(
        fps in 0.1f64..240.0,
        asked in 0.05f64..1.0,
        start in 0.0f64..1e9,
    ) {
        let mut player = Player::with(7, &[Command::Loop(Loop::All), Command::Speed(fps), Command::Play]);
        player.now = secs(start);
        player.refresh();
        // A screen of 60 Hz or more, and more than one refresh a frame.
        let period = secs(asked * (1.0 / fps).min(1.0 / 60.0));
        player.run(10.0 + 1.0 / fps, period);
        let (first, last) = (player.shown[0].0, player.shown[player.shown.len() - 1].0);
        let rate = (player.shown.len() - 1) as f64 / (last - first);
        prop_assert!((rate / fps - 1.0).abs() < 0.01, "{} frames: {rate}, not {fps}", player.shown.len());
        let reported = player.state().frames_per_second.unwrap();
        prop_assert!((reported / fps - 1.0).abs() < 0.01, "reported {reported}, not {fps}");
    }

    #[test]
    fn in_real_time_ten_seconds_are_ten_seconds_of_the_file(
        times in any_times(2..60),
        share in 0.001f64..0.0999,
        asked in 0.001f64..0.1,
        interpolate: bool,
    ) {
        // Ten seconds are a share of the series, or nearly all of it.
        let extent = times[times.len() - 1] - times[0];
        let speed = share * extent;
        let mut player = Player::new(TimeAxis { values: times.clone() });
        let commands = [Command::Mode(Mode::RealTime), Command::Speed(speed), Command::Interpolate(interpolate)];
        commands.into_iter().chain([Command::Play]).for_each(|command| player.apply(command));
        player.run(10.0, secs(asked));
        player.clock.due(player.now);
        let passed = player.state().time.unwrap() - times[0];
        // The clock may be early by a millisecond, a ten-thousandth, where it stands still at a step.
        prop_assert!((passed / (10.0 * speed) - 1.0).abs() < 0.001, "{passed}, not {}", 10.0 * speed);
    }

    #[test]
    fn nothing_breaks_a_clock_and_what_it_announces_is_what_it_plays(
        times in any_times(0..25),
        events in prop::collection::vec(any_event(), 1..120),
    ) {
        let axis = TimeAxis { values: times.clone() };
        let mut player = Player::new(axis.clone());
        player.now = secs(1000.0);
        for event in events {
            match event {
                Event::Command(command) => {
                    let before = player.state();
                    if player.clock.apply(command, player.now).is_err() {
                        prop_assert_eq!(player.state(), before);
                    }
                }
                Event::Passed(passed) => player.now = player.now.saturating_add(passed),
                Event::Back(passed) => player.now = player.now.saturating_sub(passed),
                Event::Asked => {
                    let due = player.clock.due(player.now);
                    prop_assert!(due.frame.is_none() || due.frame == player.state().frame);
                    let steady = player.state().settings.mode != Mode::RealTime;
                    prop_assert!(!steady || due.dropped == 0, "{due:?}");
                }
                Event::Shown => drop(player.refresh()),
                Event::Stray(step) => player.clock.frame_shown(step.into(), player.now),
            }
            let state = player.state();
            prop_assert_eq!(state.frame.is_some(), !times.is_empty());
            prop_assert!(!(state.playing && state.ended));
            if let (Some(frame), Some(time)) = (state.frame, state.time) {
                prop_assert!(frame.step().max(frame.toward().map_or(0, |(next, _)| next)) < times.len());
                prop_assert!(times[0] <= time && time <= times[times.len() - 1], "{state:?}");
            }
        }
        announced_is_played(&mut player)?;
    }
}

/// From any state of a clock, showing each frame at once plays the announced steps.
fn announced_is_played(player: &mut Player) -> Result<(), TestCaseError> {
    player.apply(Command::Interpolate(false));
    if player.state().settings.mode == Mode::RealTime {
        // Slow enough for none to be dropped, and for a wait to be no sleep.
        player.apply(Command::Speed(1.0));
    } else {
        player.apply(Command::Speed(10.0));
    }
    player.refresh();
    let announced = player.upcoming(40);
    if !player.state().playing {
        if announced.is_empty() {
            return Ok(());
        }
        player.apply(Command::Play);
    }
    player.shown.clear();
    player.show(40);
    prop_assert_eq!(player.steps(), announced);
    Ok(())
}

#[test]
fn the_naive_sum_notices_an_interval_that_is_a_fiftieth_too_long() {
    let times: Vec<f64> = uniform(20).values;
    let wrong: Vec<f64> = times.iter().map(|t| if *t > 7.0 { t + 0.02 } else { *t }).collect();
    let pauses = vec![0.01; 1500];
    let compare = |played: &[f64]| compare_with_naive(&times, played, &Settings::default(), 1.0, &pauses);
    assert!(compare(&times).is_ok());
    assert!(compare(&wrong).is_err());
}

#[test]
fn the_naive_order_notices_another_stride_and_another_turn() {
    let played = |repeat| {
        let mut player = Player::with(9, &[Command::Loop(repeat), Command::Stride(2), Command::Play]);
        player.show(20);
        player.steps()
    };
    let naive = |stride, repeat| naive_order(9, &Settings { stride, repeat, ..Settings::default() }, 20);
    assert_eq!(played(Loop::PingPong), naive(2, Loop::PingPong));
    assert_ne!(played(Loop::PingPong), naive(3, Loop::PingPong));
    assert_ne!(played(Loop::All), naive(2, Loop::PingPong));
}

//! A series that grows while it is played.

use super::*;

const PLAY: Command = Command::Play;

impl Player {
    fn extend(&mut self, steps: usize) {
        self.clock.extend(uniform(steps)).unwrap();
    }
}

#[test]
fn playing_forwards_goes_on_into_the_new_steps() {
    for mode in [Mode::EveryStep, Mode::RealTime, Mode::AsFastAsPossible] {
        let mut player = Player::with(3, &[Command::Mode(mode), PLAY]);
        player.show(2);
        player.extend(5);
        assert_eq!(player.upcoming(9), [2, 3, 4], "{mode:?}");
        player.show(99);
        assert_eq!(player.steps(), [0, 1, 2, 3, 4], "{mode:?}");
        assert!(player.state().ended && player.state().steps == 5);
    }
}

#[test]
fn a_last_frame_that_is_on_its_way_is_no_longer_the_last() {
    let mut player = Player::with(3, &[Command::Mode(Mode::AsFastAsPossible), PLAY]);
    player.show(2);
    assert_eq!(player.clock.due(player.now).frame, Some(2.into()));
    player.extend(4);
    player.show(99);
    assert_eq!(player.steps(), [0, 1, 2, 3]);
}

#[test]
fn a_playback_that_had_ended_stays_ended_until_play_and_then_goes_on() {
    for mode in [Mode::EveryStep, Mode::RealTime, Mode::AsFastAsPossible] {
        let mut player = Player::with(3, &[Command::Mode(mode), PLAY]);
        player.show(99);
        player.extend(5);
        player.run(100.0, secs(1.0));
        assert_eq!(player.steps(), [0, 1, 2], "{mode:?}");
        assert!(player.state().ended && !player.state().playing, "{mode:?}");
        player.apply(PLAY);
        assert!(!player.state().ended);
        player.show(99);
        assert_eq!(player.steps(), [0, 1, 2, 3, 4], "{mode:?}");
    }
}

#[test]
fn a_paused_one_stays_where_it_is() {
    let mut player = Player::with(5, &[Command::SeekStep(2)]);
    player.refresh();
    let before = player.state();
    player.extend(9);
    assert_eq!(player.state(), State { steps: 9, ..before });
    assert_eq!((player.clock.due(player.now).frame, player.upcoming(2)), (None, vec![3, 4]));
}

#[test]
fn a_loop_goes_back_to_its_start_from_the_new_end() {
    for mode in [Mode::EveryStep, Mode::RealTime] {
        let mut player = Player::with(3, &[Command::Mode(mode), Command::Loop(Loop::All), PLAY]);
        player.show(3);
        // On the old last step, on the way back to the start.
        player.extend(4);
        player.show(6);
        assert_eq!(player.steps(), [0, 1, 2, 3, 0, 1], "{mode:?}");
    }
}

#[test]
fn ping_pong_turns_at_the_new_end_unless_it_is_on_its_way_back() {
    let played = |shown: usize| {
        let mut player = Player::with(3, &[Command::Loop(Loop::PingPong), PLAY]);
        player.show(shown);
        player.extend(4);
        player.show(8);
        player.steps()
    };
    assert_eq!(played(3), [0, 1, 2, 3, 2, 1, 0, 1]);
    assert_eq!(played(4), [0, 1, 2, 1, 0, 1, 2, 3]);
}

#[test]
fn backwards_it_goes_on_backwards_and_the_next_round_begins_at_the_new_end() {
    let mut player = Player::with(3, &[Command::Direction(Direction::Backward), Command::Loop(Loop::All)]);
    [Command::Stop, PLAY].into_iter().for_each(|command| player.apply(command));
    player.show(2);
    player.extend(5);
    player.show(6);
    assert_eq!(player.steps(), [2, 1, 0, 4, 3, 2]);
}

#[test]
fn a_range_and_a_stride_stay_as_they_are() {
    let range = Command::Range(Some(StepRange { a: 1, b: 3 }));
    let mut player = Player::with(4, &[range, Command::Loop(Loop::Range), PLAY]);
    player.show(3);
    player.extend(9);
    player.show(6);
    assert_eq!(player.steps(), [1, 2, 3, 1, 2, 3]);
    let mut player = Player::with(4, &[Command::Stride(2), PLAY]);
    player.show(1);
    player.extend(8);
    player.show(99);
    assert_eq!(player.steps(), [0, 2, 4, 6]);
}

#[test]
fn the_share_of_the_interval_is_kept_and_a_speed_that_was_asked_for_too() {
    // Ten steps in 10 s; twenty-one steps in 10 s.
    let mut player = Player::with(11, &[Command::Mode(Mode::RealTime), PLAY]);
    player.refresh();
    player.now = secs(0.5);
    player.refresh();
    player.extend(21);
    let wait = player.refresh().unwrap().as_secs_f64();
    assert!(is_same(wait, 0.25), "{wait}");
    let mut player = Player::with(11, &[Command::Mode(Mode::RealTime), Command::Speed(1.0), PLAY]);
    player.refresh();
    player.now = secs(0.75);
    player.refresh();
    player.extend(21);
    let wait = player.refresh().unwrap().as_secs_f64();
    assert!(is_same(wait, 0.25) && player.state().time == Some(0.75), "{wait}");
}

#[test]
fn a_mixture_of_two_steps_does_not_jump() {
    let mut player = Player::with(5, &[Command::Mode(Mode::RealTime), Command::Speed(1.0), Command::Interpolate(true)]);
    [Command::SeekTime(2.25), PLAY].into_iter().for_each(|command| player.apply(command));
    player.refresh();
    let before = player.state();
    player.extend(6);
    let after = player.state();
    assert_eq!((after.frame, after.time), (before.frame, before.time));
    assert_eq!(before.frame, Some(FrameTime::between(2, 3, 0.25)));
}

#[test]
fn the_same_times_change_nothing_and_a_series_of_none_begins_at_its_first_step() {
    let mut player = Player::with(4, &[Command::Loop(Loop::PingPong), PLAY]);
    player.show(4);
    let before = player.state();
    player.extend(4);
    assert_eq!(player.state(), before);
    let mut player = Player::with(0, &[PLAY]);
    assert_eq!(player.refresh(), None);
    player.extend(2);
    player.show(1);
    assert_eq!(player.steps(), [0]);
}

#[test]
fn another_series_is_refused_and_the_clock_is_as_it_was() {
    let mut player = Player::with(4, &[PLAY]);
    player.show(2);
    let before = player.state();
    let mut other = uniform(9);
    other.values[2] += 1e-9;
    for times in [uniform(3), uniform(0), other] {
        assert_eq!(player.clock.extend(times), Err(CommandError::OtherSeries));
    }
    assert_eq!(player.state(), before);
    player.show(99);
    assert_eq!(player.steps(), [0, 1, 2, 3]);
}

//! After any commands, the frame shown is the one that is due.

use super::super::{Direction, Loop, Settings};
use super::*;
use crate::camera::Camera;
use crate::field::TimeAxis;
use crate::node_table::{Node, NodeTable};
use crate::pipeline::test_series::{Log, logged};
use crate::pipeline::{Pipeline, PipelinedOptions, Series};
use crate::render::Contrast;
use proptest::prelude::*;
use std::sync::Arc;

const LONG: Duration = Duration::from_secs(60);

/// A player of a synthetic series whose step s has the value s, its fake time, and the frames it has shown.
struct Theatre {
    player: Player,
    log: Log,
    now: Duration,
    /// Fake time to wait for a frame.
    cost: Duration,
    base: FrameRequest,
    shown: Vec<(Duration, FrameTime)>,
    dropped: u64,
    /// How many calls for a request return `None` first, and how many calls there were.
    in_vain: usize,
    tries: Vec<(FrameTime, usize)>,
}

fn base(series: &Series) -> FrameRequest {
    let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
    let node = |scalar| Node { scalar, rgb: [1.0, 0.5, 0.2], tau: 5.0 };
    let table = NodeTable::new(vec![node(0.0), node(10.0)]).unwrap();
    FrameRequest::new(0, camera, Arc::new(table), (9, 7))
}

impl Theatre {
    fn open(times: Vec<f64>, settings: Settings) -> Self {
        let (series, log) = logged(times.len());
        let options = PipelinedOptions { threads: Some(1), frame_cache_bytes: 0, ..Default::default() };
        let pipelined = Pipelined::start(Pipeline::new(series.clone()), &options, || ()).unwrap();
        let clock = Clock::with_settings(TimeAxis { values: times }, settings).unwrap();
        let base = base(&series);
        let player = Player::new(clock, pipelined);
        let (now, cost, shown, dropped, in_vain, tries) = Default::default();
        Self { player, log, now, cost, base, shown, dropped, in_vain, tries }
    }

    fn uniform(steps: usize, settings: Settings) -> Self {
        Self::open((0..steps).map(|s| s as f64).collect(), settings)
    }

    fn apply(&mut self, command: Command) {
        self.player.apply(command, self.now).unwrap();
    }

    /// One tick; checks that the shown frame is that of its request.
    fn tick(&mut self) -> Tick {
        let Self { base, tries, in_vain, .. } = self;
        let tick = self.player.tick(self.now, &mut |time| {
            if !tries.iter().any(|(tried, _)| *tried == time) {
                tries.push((time, 0));
            }
            let (_, count) = tries.iter_mut().find(|(tried, _)| *tried == time)?;
            *count += 1;
            (*count > *in_vain).then(|| FrameRequest { time, ..base.clone() })
        });
        self.dropped += tick.dropped;
        if let Some(delivery) = &tick.shown {
            assert!(delivery.frame.is_ok());
            self.shown.push((self.now, delivery.request.time));
        }
        tick
    }

    /// Ticks, and lets time pass as the player asks, until `end` or until nothing more happens.
    fn run_until(&mut self, end: Duration) {
        while self.now < end {
            let tick = self.tick();
            if tick.shown.is_some() && tick.wait.is_none_or(|wait| wait.is_zero()) {
                continue;
            }
            // A due frame that is not ready is waited for; that costs time.
            let is_due = self.player.clock.due(self.now).frame.is_some();
            if (is_due || tick.wait.is_none()) && self.player.wait(LONG) {
                self.now += self.cost;
                continue;
            }
            match tick.wait {
                Some(wait) => self.now += wait,
                None => return,
            }
        }
    }

    fn steps(&self) -> Vec<usize> {
        self.shown.iter().map(|(_, time)| time.step()).collect()
    }
}

fn every_step(frames_per_second: f64) -> Settings {
    Settings { frames_per_second, ..Settings::default() }
}

#[test]
fn n_steps_are_n_frames_in_order_the_first_included() {
    for (mode, cost_ms) in [(Mode::EveryStep, 0), (Mode::EveryStep, 700), (Mode::AsFastAsPossible, 0)] {
        let mut theatre = Theatre::uniform(50, Settings { mode, ..every_step(10.0) });
        theatre.cost = Duration::from_millis(cost_ms);
        theatre.apply(Command::Play);
        theatre.run_until(Duration::from_secs(1000));
        assert_eq!(theatre.steps(), (0..50).collect::<Vec<_>>(), "{mode:?} {cost_ms}");
        assert!(theatre.player.clock().state().ended && theatre.dropped == 0);
    }
}

#[test]
fn a_moment_that_is_not_known_yet_is_waited_for_and_none_is_left_out() {
    for (mode, in_vain) in [(Mode::EveryStep, 1), (Mode::AsFastAsPossible, 3)] {
        let mut theatre = Theatre::uniform(20, Settings { mode, ..every_step(10.0) });
        theatre.in_vain = in_vain;
        theatre.apply(Command::Play);
        while !theatre.player.clock().state().ended {
            theatre.tick();
            theatre.player.wait(LONG);
            theatre.now += Duration::from_millis(20);
        }
        assert_eq!(theatre.steps(), (0..20).collect::<Vec<_>>(), "{mode:?}");
        assert!(theatre.tries.iter().all(|(_, count)| *count > in_vain), "the test can fail");
    }
}

#[test]
fn while_moments_become_known_more_slowly_than_time_passes_there_is_still_something_to_see() {
    for interpolate in [false, true] {
        let settings =
            Settings { mode: Mode::RealTime, time_per_second: Some(10.0), interpolate, ..Settings::default() };
        let mut theatre = Theatre::uniform(100, settings);
        theatre.in_vain = 9;
        theatre.apply(Command::Play);
        // Each tick is half a step later.
        for _ in 0..80 {
            theatre.tick();
            theatre.player.wait(LONG);
            theatre.now += Duration::from_millis(50);
        }
        // 40 steps pass. A time is asked for once or twice a tick, and is known at the tenth call: after 5 to 10 ticks of 80, of which one
        // more shows it.
        assert!((7..=16).contains(&theatre.shown.len()), "{:?}", theatre.shown);
        let axis = TimeAxis { values: (0..100_u8).map(f64::from).collect() };
        let times: Vec<f64> = theatre.shown.iter().map(|(_, time)| time.time(&axis)).collect();
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
    }
}

#[test]
fn what_was_not_known_before_a_seek_is_not_waited_for_after_it() {
    let mut theatre = Theatre::uniform(20, every_step(10.0));
    theatre.run_until(LONG);
    theatre.in_vain = 1;
    theatre.apply(Command::SeekStep(5));
    assert!(theatre.tick().shown.is_none());
    theatre.apply(Command::SeekStep(9));
    theatre.tick();
    theatre.tick();
    assert!(theatre.player.wait(LONG));
    theatre.tick();
    assert_eq!(theatre.steps(), [0, 9]);
}

#[test]
fn backwards_strides_ranges_and_ping_pong_are_followed_step_by_step() {
    let mut theatre = Theatre::uniform(7, Settings { direction: Direction::Backward, ..every_step(10.0) });
    theatre.apply(Command::Play);
    theatre.run_until(LONG);
    assert_eq!(theatre.steps(), [6, 5, 4, 3, 2, 1, 0]);
    let range = Some(super::super::StepRange { a: 1, b: 5 });
    let settings = Settings { stride: 2, range, repeat: Loop::PingPong, ..every_step(10.0) };
    let mut theatre = Theatre::uniform(7, settings);
    theatre.apply(Command::Play);
    theatre.run_until(Duration::from_millis(850));
    assert_eq!(theatre.steps(), [1, 3, 5, 3, 1, 3, 5, 3, 1]);
}

#[test]
fn the_rate_is_that_asked_for_within_a_hundredth_over_ten_seconds() {
    for rate in [1.0, 7.3, 24.0, 60.0, 144.0] {
        let mut theatre = Theatre::uniform(30, Settings { repeat: Loop::All, ..every_step(rate) });
        theatre.apply(Command::Play);
        theatre.run_until(Duration::from_secs(10));
        let frames = theatre.shown.len() as f64;
        // The first frame is at 0, the last one at 10 s or up to an interval before.
        assert!((frames - 1.0 - 10.0 * rate).abs() <= (0.01 * 10.0 * rate).max(1.0), "{rate}: {frames}");
        let measured = theatre.player.clock().state().frames_per_second.unwrap();
        assert!((measured / rate - 1.0).abs() < 0.01, "{rate}: {measured}");
    }
}

#[test]
fn real_time_follows_the_files_times_and_drops_what_a_slow_renderer_cannot_show() {
    let times = vec![0.0, 0.1, 0.2, 1.0, 1.05, 1.1, 4.0];
    let settings = Settings { mode: Mode::RealTime, time_per_second: Some(1.0), ..Settings::default() };
    let mut theatre = Theatre::open(times.clone(), settings);
    theatre.apply(Command::Play);
    theatre.run_until(LONG);
    assert_eq!(theatre.steps(), [0, 1, 2, 3, 4, 5, 6]);
    for ((at, _), time) in theatre.shown.iter().zip(&times) {
        // Times are rounded to nanoseconds. Measured: one.
        assert!((at.as_secs_f64() - time).abs() < 1e-8, "{at:?} {time}");
    }
    // A renderer that takes 0.9 s a frame.
    let mut theatre = Theatre::uniform(100, Settings { time_per_second: Some(10.0), ..settings });
    theatre.cost = Duration::from_millis(900);
    theatre.apply(Command::Play);
    theatre.run_until(LONG);
    let steps = theatre.steps();
    assert!(steps.is_sorted() && steps.len() < 30 && steps.last() == Some(&99), "{steps:?}");
    // Never further behind than rendering takes for one frame, the one under way, and those ahead: real threads had these ready long before
    // the fake time that they take.
    for &(at, time) in &theatre.shown[1..] {
        let due = (at.as_secs_f64() - theatre.shown[0].0.as_secs_f64()) * 10.0;
        assert!(time.step() == 99 || due - time.step() as f64 <= (2 + AHEAD) as f64 * 9.0 + 1.0, "{at:?} {time:?}");
    }
}

#[test]
fn frames_that_take_longer_to_prepare_than_they_are_due_are_shown_nevertheless() {
    for interpolate in [false, true] {
        let settings = Settings {
            mode: Mode::RealTime,
            time_per_second: Some(100.0),
            repeat: Loop::All,
            interpolate,
            ..Settings::default()
        };
        let mut theatre = Theatre::uniform(100, settings);
        theatre.log.take(Duration::from_millis(20));
        theatre.apply(Command::Play);
        // Another frame is due at every tick.
        for _ in 0..400 {
            theatre.tick();
            theatre.now += Duration::from_millis(11);
            std::thread::sleep(Duration::from_millis(1));
        }
        // At least 400 ms have passed, enough for 20 preparations; dropped each time, they would leave the first frame.
        assert!(theatre.shown.len() >= 5, "{} frames", theatre.shown.len());
    }
}

#[test]
fn mixtures_follow_the_refreshes_of_the_screen() {
    let settings =
        Settings { mode: Mode::RealTime, time_per_second: Some(1.0), interpolate: true, ..Settings::default() };
    let mut theatre = Theatre::uniform(4, settings);
    theatre.apply(Command::Play);
    for _ in 0..200 {
        theatre.tick();
        while theatre.player.wait(LONG) {}
        theatre.now += Duration::from_millis(16);
    }
    theatre.tick();
    assert!(theatre.shown.windows(2).all(|pair| pair[0].1 != pair[1].1));
    // 3 s of file time are 187 refreshes, of which four show a step itself.
    let between = theatre.shown.iter().filter(|(_, time)| time.toward().is_some()).count();
    assert!(between > 150, "{between}");
    for &(at, time) in &theatre.shown {
        let shown = time.mix(time.step() as f64, |next| next as f64);
        let lag = at.as_secs_f64() - shown;
        // Requested at one refresh, shown at the next, after a first frame that time waited for: three refreshes at most.
        assert!((-1e-9..0.05).contains(&lag) || shown == 3.0, "{at:?} {time:?}");
    }
}

#[test]
fn five_thousand_frames_need_no_more_memory_than_fifty() {
    let mut theatre = Theatre::uniform(5000, every_step(1000.0));
    theatre.apply(Command::Play);
    theatre.run_until(Duration::from_secs(100));
    assert_eq!(theatre.steps(), (0..5000).collect::<Vec<_>>());
    assert!(theatre.player.asked.capacity() <= 16 && theatre.player.ready.capacity() <= 16);
    assert!(theatre.player.pipelined().preparations().most <= 2);
}

#[test]
fn a_paused_player_asks_for_nothing_until_something_changes() {
    let mut theatre = Theatre::uniform(5, every_step(10.0));
    theatre.run_until(LONG);
    assert_eq!(theatre.steps(), [0]);
    for _ in 0..3 {
        assert!(theatre.tick().shown.is_none());
        assert_eq!(theatre.player.pipelined().wanted(), 0);
        theatre.now += Duration::from_secs(1);
    }
    theatre.base.size_px = (12, 8);
    theatre.player.redraw();
    theatre.run_until(LONG);
    assert_eq!(theatre.steps(), [0, 0]);
    assert_eq!(theatre.player.pipelined().wanted(), 0);
}

#[test]
fn a_paused_player_shows_previews_ends_on_the_exact_frame_and_asks_for_nothing_more() {
    let mut theatre = Theatre::uniform(5, every_step(10.0));
    theatre.run_until(LONG);
    let exact = FrameRequest { size_px: (90, 70), ..theatre.base.clone() };
    let alone = Pipeline::new(theatre.player.pipelined().series().clone()).render(&exact).unwrap().planes.clone();
    let mut previews = 0;
    for round in 0..20 {
        // A change of look forces a redraw: the first and last looks are the same.
        theatre.base.size_px = (80 + round, 60);
        theatre.player.redraw();
        theatre.run_until(LONG);
        theatre.base =
            FrameRequest { previews: [0.1, 0.01].map(|c| Contrast::new(c).unwrap()).into(), ..exact.clone() };
        theatre.player.redraw();
        let mut is_final = false;
        while theatre.player.pipelined().wanted() > 0 || !is_final {
            theatre.player.wait(Duration::from_millis(1));
            if let Some(Delivery { frame, is_final: is_last, .. }) = theatre.tick().shown {
                assert!(!is_final, "nothing comes after the frame itself");
                is_final = is_last;
                previews += usize::from(!is_last);
                assert!(!is_last || frame.unwrap().planes == alone);
            }
        }
        for _ in 0..3 {
            assert!(theatre.tick().shown.is_none());
            assert_eq!(theatre.player.pipelined().wanted(), 0);
            theatre.now += Duration::from_secs(1);
        }
        theatre.base.previews.clear();
    }
    assert!(previews > 0, "none was there in time");
}

#[test]
fn a_view_that_changes_all_the_time_neither_stops_the_playback_nor_is_left_behind() {
    let mut theatre = Theatre::uniform(20, every_step(10.0));
    theatre.cost = Duration::from_millis(80);
    theatre.apply(Command::Play);
    let mut widths = 9;
    for _ in 0..400 {
        widths += 1;
        theatre.base.size_px.0 = widths;
        theatre.player.redraw();
        theatre.tick();
        if theatre.player.wait(LONG) {
            theatre.now += theatre.cost;
        }
    }
    let mut steps = theatre.steps();
    steps.dedup();
    assert_eq!(steps, (0..20).collect::<Vec<_>>());
    let mut last = None;
    loop {
        if let Some(shown) = theatre.tick().shown {
            last = Some(shown.request.size_px.0);
        }
        if !theatre.player.wait(LONG) {
            break;
        }
    }
    assert_eq!(last, Some(widths), "the newest view is seen in the end");
}

#[test]
fn a_series_that_grows_is_played_to_its_new_end() {
    let mut theatre = Theatre::uniform(5, every_step(10.0));
    theatre.apply(Command::Play);
    theatre.run_until(Duration::from_millis(250));
    let (grown, log) = logged(9);
    theatre.player.grow(grown).unwrap();
    theatre.run_until(LONG);
    let mut steps = theatre.steps();
    steps.dedup();
    assert_eq!(steps, (0..9).collect::<Vec<_>>());
    assert!(log.decoded().ends_with(&[7, 8]), "the new steps are those of the new series: {:?}", log.decoded());
    assert!(theatre.player.grow(logged(3).0).is_err(), "fewer steps are another series");
    assert_eq!(theatre.player.clock().state().steps, 9);
}

fn command(steps: usize) -> impl Strategy<Value = Command> {
    prop_oneof![
        3 => Just(Command::Play),
        1 => Just(Command::Pause),
        1 => Just(Command::Stop),
        1 => Just(Command::Toggle),
        1 => Just(Command::Reverse),
        2 => (-3i64..4).prop_map(Command::Step),
        3 => (0..steps).prop_map(Command::SeekStep),
        2 => (0.0..steps as f64).prop_map(Command::SeekTime),
        1 => (0.5f64..200.0).prop_map(Command::Speed),
        1 => prop_oneof![Just(Loop::Off), Just(Loop::All), Just(Loop::Range), Just(Loop::PingPong)].prop_map(Command::Loop),
        1 => (1usize..4).prop_map(Command::Stride),
        1 => prop_oneof![Just(Mode::EveryStep), Just(Mode::RealTime), Just(Mode::AsFastAsPossible)].prop_map(Command::Mode),
        1 => any::<bool>().prop_map(Command::Interpolate),
        1 => (0..steps, 0..steps).prop_map(|(a, b)| Command::Range(Some(super::super::StepRange { a, b }))),
    ]
}

#[derive(Clone, Debug)]
enum Act {
    Command(Command),
    Redraw,
    Tick,
    Wait,
    Pass(u64),
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn what_is_shown_in_the_end_is_where_the_clock_stands_and_looks_as_it_should(
        acts in prop::collection::vec(prop_oneof![
            3 => command(12).prop_map(Act::Command),
            1 => Just(Act::Redraw),
            4 => Just(Act::Tick),
            3 => Just(Act::Wait),
            3 => (0u64..300).prop_map(Act::Pass),
        ], 1..60),
    ) {
        let mut theatre = Theatre::uniform(12, every_step(20.0));
        let mut last = None;
        for act in acts {
            match act {
                Act::Command(command) => {
                    theatre.apply(command);
                    let mut clock = theatre.player.clock().clone();
                    let due = clock.due(theatre.now).frame.or(clock.state().frame);
                    // Never a frame from before: only the due one, or none.
                    if let Some(delivery) = theatre.tick().shown {
                        prop_assert_eq!(Some(delivery.request.time), due);
                        last = Some(delivery.request);
                    }
                }
                Act::Redraw => {
                    theatre.base.size_px.0 += 1;
                    theatre.player.redraw();
                }
                Act::Tick => last = theatre.tick().shown.map(|d| d.request).or(last),
                Act::Wait => drop(theatre.player.wait(LONG)),
                Act::Pass(ms) => theatre.now += Duration::from_millis(ms),
            }
            prop_assert!(theatre.player.pipelined().preparations().most <= 2);
            prop_assert!(theatre.player.ready.len() + theatre.player.asked.len() <= 8);
        }
        theatre.apply(Command::Pause);
        for _ in 0..20 {
            last = theatre.tick().shown.map(|d| d.request).or(last);
            theatre.player.wait(LONG);
        }
        let last = last.unwrap();
        prop_assert_eq!(Some(last.time), theatre.player.clock().state().frame);
        prop_assert_eq!(last.size_px, theatre.base.size_px);
        prop_assert_eq!(theatre.player.pipelined().wanted(), 0);
    }
}

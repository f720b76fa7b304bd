//! The clock: commands and times in, due frames out.

mod growth;
mod interval;

use super::command::{Command, CommandError, Direction, Mode, Settings};
use super::course::{Course, Score, default_speed, heading, speed};
use super::measure::{Elapsed, RateMeter, Stopwatch};
use super::screen::Screen;
use super::sequence::{Sequence, Successor};
use crate::field::TimeAxis;
use crate::pipeline::FrameTime;
use serde::Serialize;
use std::time::Duration;

/// An interval counts as over when all but this share of it, at most a millisecond, has passed: a caller that polls at the frame rate is
/// not refused because of rounding. The next interval begins when this one should have ended.
const EARLY: f64 = 1e-3;

/// The playback of one series. See [the module](super) for what it promises.
#[derive(Clone, Debug)]
pub struct Clock {
    times: TimeAxis,
    settings: Settings,
    /// `None` if the series has no step.
    sequence: Option<Sequence>,
    course: Course,
    phase: Phase,
    playing: bool,
    ended: bool,
    elapsed: Elapsed,
    screen: Screen,
    rate: RateMeter,
}

/// Progress of time between two steps.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Time stands still at this share of the interval.
    Resting { progress: f64 },
    /// Time runs; the stopwatch started when the step was left.
    Running { left: Stopwatch },
    /// Time stands still until the frame is on the screen. `due`: time since the frame was due, in the modes that show each step.
    Waiting { progress: f64, due: Option<Stopwatch> },
}

/// The frame to show now, and when to ask again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Due {
    /// The frame to show; `None` if it is on the screen. Repeated at each call, or replaced by a newer one, until [`Clock::frame_shown`].
    pub frame: Option<FrameTime>,
    /// Time until another frame may be due; `None`: not before a command or [`Clock::frame_shown`]. Zero while steps are interpolated: a
    /// new frame with every refresh of the screen.
    pub wait: Option<Duration>,
    /// Steps passed over between the frame that was shown last and `frame`. Always 0 unless in [`Mode::RealTime`].
    pub dropped: u64,
}

/// State of a playback, for display.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct State {
    /// Whether time goes on, or would if there were more than one step.
    pub playing: bool,
    /// Whether playback reached the end, with the last frame on the screen.
    pub ended: bool,
    /// The frame that is or should be on the screen; `None` if there are no steps.
    pub frame: Option<FrameTime>,
    /// The time in the file's unit; in [`Mode::RealTime`] it runs on while a step is held.
    pub time: Option<f64>,
    /// Number of steps of the series.
    pub steps: usize,
    /// Current direction: differs from `settings` on the way back of ping-pong.
    pub heading: Direction,
    /// Speed in the unit of the mode; `None` in [`Mode::AsFastAsPossible`].
    pub speed: Option<f64>,
    /// Frames per second actually shown in the last two seconds of playing.
    pub frames_per_second: Option<f64>,
    /// Steps dropped since playing began.
    pub dropped: u64,
    /// All settings.
    pub settings: Settings,
}

impl Clock {
    /// A clock paused at the first step, whose frame is due.
    pub fn new(times: TimeAxis) -> Self {
        Self::ready(times, Settings::default())
    }

    /// A clock with other settings; if they play backwards, it is at the last step.
    ///
    /// # Errors
    /// If a speed or the stride is invalid.
    pub fn with_settings(times: TimeAxis, settings: Settings) -> Result<Self, CommandError> {
        let settings = settings.checked(times.len())?;
        Ok(Self::ready(times, settings))
    }

    fn ready(times: TimeAxis, settings: Settings) -> Self {
        let mut clock = Self {
            sequence: Sequence::new(times.len(), &settings),
            times,
            settings,
            course: Course { held: 0, from: 0, next: None, returning: false },
            phase: Phase::Waiting { progress: 0.0, due: None },
            playing: false,
            ended: false,
            elapsed: Elapsed::default(),
            screen: Screen::default(),
            rate: RateMeter::default(),
        };
        clock.begin_again();
        clock
    }

    /// Carries out a command at the caller's monotonic time `now`.
    ///
    /// # Errors
    /// If a number in the command is invalid; the clock is then unchanged.
    pub fn apply(&mut self, command: Command, now: Duration) -> Result<(), CommandError> {
        command.check()?;
        self.elapsed.tick(now, self.wait());
        if self.settings.mode == Mode::RealTime {
            self.pass_steps();
        }
        let waited = matches!(self.phase, Phase::Waiting { .. });
        let before = self.screen.moves();
        let progress = self.follow(command);
        let moved = self.screen.moves() != before;
        if self.course.next.is_some() {
            self.ended = false;
        }
        let due = match self.phase {
            Phase::Waiting { due, .. } if !moved => due,
            _ => None,
        };
        let wait = waited || moved || self.settings.mode != Mode::RealTime;
        self.phase = if wait { Phase::Waiting { progress, due } } else { self.resting_or_running(progress) };
        self.settle();
        Ok(())
    }

    /// The frame to show at the caller's monotonic time `now`.
    pub fn due(&mut self, now: Duration) -> Due {
        self.elapsed.tick(now, self.wait());
        match self.settings.mode {
            Mode::RealTime => self.pass_steps(),
            Mode::EveryStep | Mode::AsFastAsPossible => self.next_step(),
        }
        self.settle();
        let (frame, dropped) = match self.frame().filter(|&frame| !self.screen.shows(frame)) {
            Some(frame) => (Some(frame), self.screen.hand_out(frame)),
            None => (None, 0),
        };
        Due { frame, wait: self.wait(), dropped }
    }

    /// Reports that `frame` is on the screen at the caller's monotonic time `now`, even if a seek has superseded it.
    pub fn frame_shown(&mut self, frame: FrameTime, now: Duration) {
        self.elapsed.tick(now, self.wait());
        if self.screen.show(frame) && self.playing {
            self.rate.frame(self.elapsed.total());
        }
        self.settle();
    }

    /// State as of the last call.
    pub fn state(&self) -> State {
        let score = self.score();
        State {
            playing: self.playing,
            ended: self.ended,
            frame: self.frame(),
            time: score.map(|score| self.course.time(self.progress(), &score)),
            steps: self.times.len(),
            heading: heading(&self.settings, self.course.returning),
            speed: match self.settings.mode {
                Mode::EveryStep => Some(self.settings.frames_per_second),
                Mode::RealTime => Some(score.map_or_else(|| default_speed(&self.times), |score| speed(&score))),
                Mode::AsFastAsPossible => None,
            },
            frames_per_second: self.rate.rate(),
            dropped: self.screen.dropped(),
            settings: self.settings,
        }
    }

    /// The next `n` steps, fewer at the end: what is played after [`State::frame`] if nothing changes and nothing is dropped. While paused,
    /// what [`Command::Play`] would play, but nothing at the end. For prefetching.
    pub fn upcoming(&self, n: usize) -> impl Iterator<Item = FrameTime> {
        let score = self.score();
        let mut course = self.course;
        if let Some(score) = score.filter(|score| !self.playing && !score.sequence.covers(course.from)) {
            // The start is reached by a jump, which ends the way back of ping-pong.
            let step = Course::start(&score).from;
            course.next = Some(Successor { step, jump: true, turned: course.returning });
        }
        let next = move || {
            let score = score?;
            // Only the step held after a turn is reached without a change; another follows it.
            while course.next.is_some() {
                if course.arrive(&score) {
                    return Some(course.held.into());
                }
            }
            None
        };
        std::iter::from_fn(next).take(n)
    }

    /// Changes what the command asks for; returns the share of the interval that has passed then.
    fn follow(&mut self, command: Command) -> f64 {
        let progress = self.progress();
        match command {
            Command::Play => return self.play(progress),
            Command::Toggle if !self.playing => return self.play(progress),
            Command::Pause | Command::Toggle => self.pause(),
            Command::Stop => {
                self.pause();
                return self.begin_again();
            }
            Command::Step(count) => {
                self.pause();
                return self.step(count, progress);
            }
            Command::SeekStep(step) => return self.place(step),
            Command::SeekTime(time) => return self.seek_time(time),
            Command::Speed(speed) => {
                match self.settings.mode {
                    Mode::RealTime => self.settings.time_per_second = Some(speed),
                    Mode::EveryStep | Mode::AsFastAsPossible => self.settings.frames_per_second = speed,
                }
                self.rate.restart();
            }
            Command::Mode(mode) => return self.change_mode(mode, progress),
            Command::Interpolate(on) => self.settings.interpolate = on,
            Command::Direction(direction) => {
                return self.reroute(progress, |clock| {
                    clock.settings.direction = direction;
                    clock.course.returning = false;
                });
            }
            Command::Reverse => {
                let direction = heading(&self.settings, self.course.returning).reversed();
                return self.follow(Command::Direction(direction));
            }
            Command::Loop(repeat) => {
                return self.reroute(progress, |clock| {
                    clock.course.returning &= repeat == clock.settings.repeat;
                    clock.settings.repeat = repeat;
                });
            }
            Command::Range(range) => {
                return self.reroute(progress, |clock| {
                    clock.settings.range = range.and_then(|range| range.within(clock.times.len()));
                });
            }
            Command::Stride(stride) => return self.reroute(progress, |clock| clock.settings.stride = stride),
        }
        progress
    }

    fn play(&mut self, progress: f64) -> f64 {
        if self.playing {
            return progress;
        }
        self.playing = true;
        self.ended = false;
        self.rate.restart();
        self.screen.forget_dropped();
        let outside = self.sequence.is_some_and(|sequence| !sequence.covers(self.course.from));
        let at_end = self.course.next.is_none() && self.sequence.is_some_and(|sequence| sequence.ends());
        if outside || at_end { self.begin_again() } else { progress }
    }

    fn pause(&mut self) {
        self.playing = false;
        self.rate.restart();
    }

    fn step(&mut self, count: i64, progress: f64) -> f64 {
        if count == 0 {
            return progress;
        }
        let Some(frame) = self.frame() else { return 0.0 };
        let base = frame.toward().map_or(frame.step(), |(next, _)| if count < 0 { next } else { frame.step() });
        let distance = usize::try_from(count.unsigned_abs()).unwrap_or(usize::MAX);
        self.place(if count < 0 { base.saturating_sub(distance) } else { base.saturating_add(distance) })
    }

    fn change_mode(&mut self, mode: Mode, progress: f64) -> f64 {
        if mode == self.settings.mode {
            return progress;
        }
        self.settings.mode = mode;
        let Some(score) = self.score() else { return 0.0 };
        // The interval of the held step begins anew, once it is on the screen.
        self.jump_to(Course::at_step(self.course.held, self.course.returning, &score), 0.0)
    }

    fn seek_time(&mut self, time: f64) -> f64 {
        let (Some(&first), Some(&last)) = (self.times.values.first(), self.times.values.last()) else { return 0.0 };
        let Some(score) = self.score() else { return 0.0 };
        let (course, progress) = Course::at_time(time.max(first).min(last), None, self.course.returning, &score);
        if self.settings.mode != Mode::RealTime {
            return self.place(course.held);
        }
        self.jump_to(course, progress)
    }

    /// Jumps exactly to a step, at most the last one.
    fn place(&mut self, step: usize) -> f64 {
        let Some(score) = self.score() else { return 0.0 };
        let step = step.min(self.times.len().saturating_sub(1));
        let course = Course::at_step(step, self.course.returning, &score);
        self.jump_to(course, 0.0)
    }

    fn begin_again(&mut self) -> f64 {
        let Some(score) = self.score() else { return 0.0 };
        let course = Course::start(&score);
        self.jump_to(course, 0.0)
    }

    fn jump_to(&mut self, course: Course, progress: f64) -> f64 {
        self.course = course;
        self.ended = false;
        self.rate.restart();
        self.screen.moved();
        progress
    }

    /// Changes the order of steps. The frame on the screen stays until the next step of the new order is reached: in real time at that
    /// step's time, otherwise after the rest of the interval.
    fn reroute(&mut self, progress: f64, change: impl FnOnce(&mut Self)) -> f64 {
        let real_time = self.settings.mode == Mode::RealTime;
        let jumped = self.course.next.is_some_and(|next| next.jump);
        let between = real_time && !jumped && progress > 0.0 && self.course.next.is_some();
        let time = self.score().map(|score| self.course.time(progress, &score));
        change(self);
        self.sequence = Sequence::new(self.times.len(), &self.settings);
        let (Some(score), Some(time)) = (self.score(), time) else { return 0.0 };
        let Course { held, from, returning, .. } = self.course;
        if between {
            let (course, progress) = Course::at_time(time, Some(held), returning, &score);
            self.course = course;
            return progress;
        }
        self.course = Course { held, ..Course::at_step(from, returning, &score) };
        let jumps = self.course.next.is_some_and(|next| next.jump);
        if real_time && jumps != jumped { 0.0 } else { progress }
    }

    fn resting_or_running(&self, progress: f64) -> Phase {
        match self.duration_secs() {
            Some(duration) if self.playing => Phase::Running { left: self.elapsed.stopwatch(progress * duration) },
            _ => Phase::Resting { progress },
        }
    }

    /// Updates the phase after a frame is on the screen: waiting ends, and so may the playback.
    fn settle(&mut self) {
        let on_screen = self.frame().is_none_or(|frame| self.screen.shows(frame));
        if !on_screen {
            return;
        }
        if let Phase::Waiting { progress, due } = self.phase {
            self.screen.caught_up();
            self.phase = match (self.resting_or_running(progress), due, self.duration_secs()) {
                // A late frame is compensated for, up to one interval: frames alternately early and late keep the rate.
                (Phase::Running { .. }, Some(due), Some(duration)) => {
                    Phase::Running { left: self.elapsed.stopwatch(self.elapsed.secs(due).min(duration)) }
                }
                (phase, ..) => phase,
            };
        }
        if self.playing && self.course.next.is_none() && self.sequence.is_none_or(|sequence| sequence.ends()) {
            self.playing = false;
            self.ended = true;
        }
    }

    /// In the modes that show each step: advances one step at the end of the interval, then waits until it is shown.
    fn next_step(&mut self) {
        let (Phase::Running { left }, Some(score)) = (self.phase, self.score()) else { return };
        let mut course = self.course;
        let Some(duration) = course.duration_secs(&score) else { return };
        let since_secs = self.elapsed.secs(left);
        if is_over(since_secs, duration) {
            let passed = u64::from(course.arrive(&score));
            self.screen.passed(passed);
            self.course = course;
            self.phase = Phase::Waiting { progress: 0.0, due: Some(self.elapsed.stopwatch(since_secs - duration)) };
        }
    }

    /// In real time: passes all steps whose time has come.
    ///
    /// Whole rounds of a loop are not walked: a state seen before ends one. The state to compare with is renewed after 1, 2, 4, 8, .. steps
    /// (Brent's algorithm), since the first ones may not belong to the round.
    fn pass_steps(&mut self) {
        let (Phase::Running { left }, Some(score)) = (self.phase, self.score()) else { return };
        let (mut course, mut passed, mut walked) = (self.course, 0_u64, 0_u64);
        let mut since_secs = self.elapsed.secs(left);
        let mut mark = (course, since_secs, passed);
        while let Some(duration) = course.duration_secs(&score).filter(|&duration| is_over(since_secs, duration)) {
            since_secs -= duration;
            passed = passed.saturating_add(u64::from(course.arrive(&score)));
            walked += 1;
            let round_secs = mark.1 - since_secs;
            if mark.0 == course && round_secs > 0.0 && since_secs > round_secs {
                let rounds = (since_secs / round_secs).floor();
                since_secs -= rounds * round_secs;
                passed = passed.saturating_add((rounds as u64).saturating_mul(passed - mark.2));
            }
            if walked.is_power_of_two() {
                mark = (course, since_secs, passed);
            }
        }
        if walked > 0 {
            self.phase = match course.next {
                Some(_) => Phase::Running { left: self.elapsed.stopwatch(since_secs) },
                None => Phase::Resting { progress: 0.0 },
            };
            self.course = course;
            self.screen.passed(passed);
        }
    }

    fn score(&self) -> Option<Score<'_>> {
        Some(Score { times: &self.times, settings: &self.settings, sequence: self.sequence? })
    }

    fn duration_secs(&self) -> Option<f64> {
        self.course.duration_secs(&self.score()?)
    }

    fn frame(&self) -> Option<FrameTime> {
        Some(self.course.frame(self.progress(), &self.score()?))
    }

    /// Share of the interval that has passed.
    fn progress(&self) -> f64 {
        match self.phase {
            Phase::Resting { progress } | Phase::Waiting { progress, .. } => progress,
            Phase::Running { left } => {
                let share = |duration: f64| (self.elapsed.secs(left) / duration).clamp(0.0, 1.0);
                self.duration_secs().filter(|&duration| duration > 0.0).map_or(0.0, share)
            }
        }
    }

    /// See [`Due::wait`].
    fn wait(&self) -> Option<Duration> {
        let (Phase::Running { left }, Some(score)) = (self.phase, self.score()) else { return None };
        if score.mixes() && self.course.next.is_some_and(|next| !next.jump) {
            return Some(Duration::ZERO);
        }
        let rest = self.course.duration_secs(&score)? - self.elapsed.secs(left);
        // Rounded up: the frame must be due then, not a nanosecond later.
        Some(
            Duration::try_from_secs_f64(rest.max(0.0)).unwrap_or(Duration::MAX).saturating_add(Duration::from_nanos(1)),
        )
    }
}

fn is_over(passed_secs: f64, duration_secs: f64) -> bool {
    passed_secs >= duration_secs - (EARLY * duration_secs).min(EARLY)
}

//! A session beside another one, whose clock leads.

use super::Session;
use super::quality::SETTLE;
use crate::playback::{Command, Mode, Settings, State};
use crate::ui::notice::Notice;
use std::time::Duration;

/// How a session shares the window with others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Share {
    /// Number of views that have the time of a frame together.
    pub(super) views: usize,
    /// Whether its frames are compared with those of another view: they are drawn in full, and come to the CPU.
    pub(super) is_compared: bool,
}

impl Default for Share {
    fn default() -> Self {
        Self { views: 1, is_compared: false }
    }
}

impl Session {
    /// Tells with how many views, itself included, the time of a frame is shared, and whether frames are compared with another view's.
    pub(in crate::ui) fn share(&mut self, views: usize, is_compared: bool) {
        self.shared = Share { views, is_compared };
        if views == 1 {
            self.led_shutter = 0.0;
        }
    }

    /// The viewport is about to change its shape: a camera that still frames the whole mesh does so afterwards, too.
    pub(in crate::ui) fn refit(&mut self) {
        self.refits = true;
    }

    /// Takes the messages to the user.
    pub(in crate::ui) fn take_notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// Goes to the time that `leader` shows, or at rest is about to show, and if `is_linked` to its camera. While the leader moves, this
    /// session counts as moving.
    pub(in crate::ui) fn led_by(&mut self, leader: &Self, is_linked: bool, now: Duration) {
        let state = leader.state();
        // A clock that runs may be ahead of the picture already: the step shown would be left out here.
        let shown = leader.shown().filter(|_| state.playing).map(|shown| shown.request.time);
        let open = shown.map(|frame| leader.shutter(&state).of(leader.series(), frame));
        self.led_shutter = open.unwrap_or(0.0);
        if let Some(time) = shown.or(state.frame).map(|frame| frame.time(leader.series().times())) {
            self.go_to(time, &state.settings, now);
        }
        if is_linked {
            let camera = leader.camera();
            if self.camera() != camera || self.follows_path() {
                self.look.camera = camera;
                self.look.followed.camera = false;
            }
            self.moving_until = self.moving_until.max(leader.moving_until);
        }
        if state.playing {
            self.moving_until = self.moving_until.max(Some(now.saturating_add(SETTLE)));
        }
    }

    /// Rests at a time in the file's unit, between two steps if the settings interpolate.
    fn go_to(&mut self, time: f64, settings: &Settings, now: Duration) {
        if self.led_to == Some((time, *settings)) {
            return;
        }
        let interpolates = Command::Interpolate(settings.interpolate);
        for command in [Command::Pause, Command::Mode(settings.mode), interpolates, Command::SeekTime(time)] {
            self.command(command, now);
        }
        self.led_to = Some((time, *settings));
    }

    /// Takes over the playback of `leader`, which rests from then on and is led.
    pub(in crate::ui) fn take_over(&mut self, leader: &mut Self, now: Duration) {
        let state = leader.state();
        let has_same_steps = self.series().times() == leader.series().times();
        for command in commands(&state, has_same_steps) {
            self.command(command, now);
        }
        (self.led_to, self.led_shutter) = (None, 0.0);
        leader.command(Command::Pause, now);
    }
}

/// The commands that bring about settings and motion of a playback. Ranges and strides are of steps: they are those of another series only
/// if it has the same ones.
fn commands(state: &State, has_same_steps: bool) -> Vec<Command> {
    let settings = &state.settings;
    let mut all = vec![Command::Mode(Mode::EveryStep), Command::Speed(settings.frames_per_second)];
    if let Some(speed) = settings.time_per_second {
        all.extend([Command::Mode(Mode::RealTime), Command::Speed(speed)]);
    }
    all.extend([
        Command::Mode(settings.mode),
        Command::Interpolate(settings.interpolate),
        Command::Loop(settings.repeat),
        Command::Direction(state.heading),
    ]);
    if has_same_steps {
        all.extend([Command::Range(settings.range), Command::Stride(settings.stride)]);
    }
    all.extend(state.playing.then_some(Command::Play));
    all
}

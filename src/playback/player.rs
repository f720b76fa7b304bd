//! A clock and a pipeline: frames are requested ahead of time, and shown when due.
//!
//! A player requests the due frame and the next two, and after a seek never shows one from before it. In real-time mode on a slow machine
//! it finishes the frame being rendered, shows it, and goes on with the one due then.
//!
//! ```text
//! Command, time -> Clock -> Player -> push, replace, seek -> [queue] -> decode -> order -> render -> [frames] -> Player -> screen
//!                                     expect -> read ahead -> [blocks]
//! ```

use super::{Clock, Command, CommandError, Mode};
use crate::pipeline::{Delivery, FrameId, FrameRequest, FrameTime, Pipelined, Series};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

/// Frames rendered ahead: the next one, and another so that the renderer never waits.
const AHEAD: usize = 2;

/// Steps whose blocks are read ahead: four blocks of 64 steps.
const EXPECTED: usize = 256;

/// Plays a series: turns the clock's times into requests, and hands out frames when they are due.
///
/// Call [`Player::tick`] whenever a frame is delivered, a command was given, or [`Tick::wait`] is over. It never blocks.
///
/// - After a seek, no frame from before is shown any more.
/// - In the modes that show each step, frames come in order, each once, none before its time.
/// - In [`Mode::RealTime`] on a machine that is too slow, the frame being rendered is finished and shown late; the next one is the one that
///   is due then.
pub struct Player {
    clock: Clock,
    pipelined: Pipelined,
    /// Number of times that the look of frames has changed.
    look: u64,
    /// `look` of the frame on the screen.
    shown_look: u64,
    /// Number of the frame on the screen, in the order of showing; a frame redrawn with another look keeps it. A frame with a smaller
    /// number is too late.
    shown_number: u64,
    /// Requested frames not delivered yet, in order.
    asked: VecDeque<Asked>,
    /// Delivered frames not shown yet, in order.
    ready: VecDeque<Ready>,
    /// Preview of a frame that is not delivered yet.
    preview: Option<Ready>,
    /// Whether a command may have moved the clock since the last tick.
    is_redirected: bool,
    /// A due time for which no request was known yet. It comes first once there is one: by then the clock may be past it, and past every
    /// later time when that one's request is known.
    unknown: Option<FrameTime>,
}

#[derive(Clone, Copy, Debug)]
struct Asked {
    id: FrameId,
    time: FrameTime,
    look: u64,
    /// See [`Player::shown_number`].
    number: u64,
}

#[derive(Debug)]
struct Ready {
    delivery: Delivery,
    look: u64,
    number: u64,
}

/// Result of a tick.
#[derive(Debug, Default)]
pub struct Tick {
    /// The new frame on the screen; `None`: no change.
    pub shown: Option<Delivery>,
    /// Tick again after this time, or when a frame is delivered; `None`: only then, or after a command.
    pub wait: Option<Duration>,
    /// Steps passed over since the frame before.
    pub dropped: u64,
}

impl Player {
    /// A player of the frames of `pipelined`. The first frame is due at once.
    pub fn new(clock: Clock, pipelined: Pipelined) -> Self {
        Self {
            clock,
            pipelined,
            look: 0,
            shown_look: 0,
            shown_number: 0,
            asked: VecDeque::new(),
            ready: VecDeque::new(),
            preview: None,
            is_redirected: false,
            unknown: None,
        }
    }

    /// Read access to the clock.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Read access to the pipeline.
    pub fn pipelined(&self) -> &Pipelined {
        &self.pipelined
    }

    /// Returns the pipeline for another use; pending requests are cancelled.
    pub fn into_pipelined(self) -> Pipelined {
        self.pipelined.clear();
        self.pipelined
    }

    /// Carries out a command at the caller's monotonic time `now`.
    ///
    /// # Errors
    /// If a number in the command is invalid; nothing has changed then.
    pub fn apply(&mut self, command: Command, now: Duration) -> Result<(), CommandError> {
        self.clock.apply(command, now)?;
        self.is_redirected = true;
        Ok(())
    }

    /// Requests the frame on the screen again after its look has changed (camera, colours, size). A frame being rendered is still shown, as
    /// feedback while a slow renderer follows a mouse.
    pub fn redraw(&mut self) {
        self.look += 1;
    }

    /// Plays another series with as many steps, at the same position; no frame of the old one is shown any more.
    pub fn set_series(&mut self, series: Arc<Series>) {
        self.forget_all();
        self.pipelined.set_series(series);
        self.redraw();
    }

    /// Replaces a series that has grown: `series` has the same steps and more ([`Store::refreshed`](crate::store::Store::refreshed),
    /// [`Series::reopened`]). The frame on the screen is requested again: its step may have been encoded anew.
    ///
    /// # Errors
    /// If `series` is another series; nothing has changed then.
    pub fn grow(&mut self, series: Arc<Series>) -> Result<(), CommandError> {
        self.clock.extend(series.times().clone())?;
        self.pipelined.set_series(series);
        self.redraw();
        Ok(())
    }

    /// Shows the frame due at the caller's monotonic time `now`, and requests the next ones; `request` makes the request for a time. If it
    /// returns `None`, that is not known yet; tick again when it is.
    pub fn tick(&mut self, now: Duration, request: &mut dyn FnMut(FrameTime) -> Option<FrameRequest>) -> Tick {
        self.collect();
        let due = self.clock.due(now);
        self.ask(due.frame, due.dropped, request);
        let Some(Ready { delivery, look, number }) = self.next_to_show(due.frame) else {
            return Tick { shown: self.preview_to_show(), wait: due.wait, ..Tick::default() };
        };
        self.preview = None;
        (self.shown_look, self.shown_number) = (look, number);
        self.clock.frame_shown(delivery.request.time, now);
        // The next frame is requested at once; if it is already due and ready, it waits for the next tick.
        let next = self.clock.due(now);
        self.ask(next.frame, next.dropped, request);
        self.expect();
        let is_there = next.frame.is_some() && !self.ready.is_empty();
        Tick {
            shown: Some(delivery),
            wait: if is_there { Some(Duration::ZERO) } else { next.wait },
            dropped: due.dropped,
        }
    }

    /// Waits for a requested frame, at most `longest`; returns whether one came.
    pub fn wait(&mut self, longest: Duration) -> bool {
        let delivery = self.pipelined.wait(longest);
        delivery.map(|delivery| self.receive(delivery)).is_some()
    }

    /// Takes all delivered frames.
    fn collect(&mut self) {
        while let Some(delivery) = self.pipelined.take() {
            self.receive(delivery);
        }
    }

    fn receive(&mut self, delivery: Delivery) {
        if !delivery.is_final {
            let asked = self.asked.iter().find(|asked| asked.id == delivery.id);
            self.preview = asked.map(|asked| Ready { delivery, look: asked.look, number: asked.number });
            return;
        }
        // Earlier requests were dropped by the pipeline.
        while let Some(asked) = self.asked.pop_front_if(|asked| asked.id <= delivery.id) {
            if asked.id == delivery.id {
                self.ready.push_back(Ready { delivery, look: asked.look, number: asked.number });
                return;
            }
        }
    }

    /// Requests the due frame, or the one on the screen if its look changed, and those after it.
    fn ask(
        &mut self,
        due: Option<FrameTime>,
        dropped: u64,
        request: &mut dyn FnMut(FrameTime) -> Option<FrameRequest>,
    ) {
        let state = self.clock.state();
        let redirected = std::mem::take(&mut self.is_redirected);
        let unknown = self.unknown.take().filter(|_| due.is_some() && !redirected);
        let is_late = unknown.is_some() && unknown != due;
        let due = unknown.or(due);
        let wanted = due.or(state.frame.filter(|_| self.shown_look != self.look));
        let is_mixing = state.settings.mode == Mode::RealTime && state.settings.interpolate;
        // When late, nothing is rendered ahead.
        let ahead = if state.playing && !is_mixing && !is_late && dropped == 0 { AHEAD } else { 0 };
        let expected: Vec<FrameTime> = wanted.into_iter().chain(self.clock.upcoming(ahead)).take(1 + ahead).collect();
        // A redrawn frame on the screen keeps its number.
        let first_number = self.shown_number + u64::from(due.is_some() || wanted.is_none());
        let mut on_their_way: Vec<(FrameTime, u64)> =
            self.ready.iter().map(|r| (r.delivery.request.time, r.look)).collect();
        on_their_way.extend(self.asked.iter().map(|asked| (asked.time, asked.look)));
        // Frames before the first expected one are late or have an old look.
        let is_first = |&(time, look): &(FrameTime, u64)| look == self.look && Some(&time) == expected.first();
        let before = on_their_way.iter().position(is_first).unwrap_or(on_their_way.len());
        let fitting = &on_their_way[before..];
        let fits = fitting.len() <= expected.len()
            && fitting.iter().zip(&expected).all(|(&(time, look), &e)| time == e && look == self.look);
        let is_known = fits && !fitting.is_empty();
        let mut missing = &expected[if is_known { fitting.len() } else { 0 }..];
        let must_seek = redirected && (before > 0 || !fits);
        if must_seek || (!is_known && !on_their_way.is_empty()) {
            let Some((&first, rest)) = expected.split_first() else {
                if redirected {
                    self.forget_all();
                }
                return;
            };
            if must_seek {
                self.forget_all();
            }
            let Some(request) = request(first) else {
                self.unknown = due;
                return;
            };
            let id = if must_seek {
                self.pipelined.seek(request)
            } else {
                let id = self.pipelined.replace(request);
                self.asked.retain(|asked| self.pipelined.is_wanted(asked.id));
                id
            };
            self.asked.extend(id.map(|id| Asked { id, time: first, look: self.look, number: first_number }));
            missing = rest;
        }
        let room = expected.len().saturating_sub(self.asked.len() + self.ready.len());
        let number = first_number + (expected.len() - missing.len()) as u64;
        for (number, &time) in (number..).zip(missing.iter().take(room)) {
            let Some(request) = request(time) else {
                self.unknown = due.filter(|&due| due == time);
                return;
            };
            let id = self.pipelined.push(request);
            self.asked.extend(id.map(|id| Asked { id, time, look: self.look, number }));
        }
    }

    /// The preview of a pending frame, if its look is current. The clock counts frames only, not previews.
    fn preview_to_show(&mut self) -> Option<Delivery> {
        let Ready { delivery, look, number } = self.preview.take()?;
        let is_on_its_way = self.asked.iter().any(|asked| asked.id == delivery.id);
        (is_on_its_way && look == self.look && number >= self.shown_number).then_some(delivery)
    }

    fn forget_all(&mut self) {
        self.preview = None;
        self.pipelined.clear();
        self.asked.clear();
        self.ready.clear();
    }

    /// The ready frame to show: the one that is due, else the newest one that is late.
    fn next_to_show(&mut self, due: Option<FrameTime>) -> Option<Ready> {
        let on_screen = self.clock.state().frame;
        let look = self.look;
        let shown_number = self.shown_number;
        self.ready.retain(|r| {
            // Frames ahead of time with the old look will be requested again.
            let is_of_use = r.look == look || Some(r.delivery.request.time) == on_screen || due.is_some();
            r.number >= shown_number && is_of_use
        });
        let at = match due {
            Some(due) => match self.ready.iter().rposition(|r| r.delivery.request.time == due) {
                Some(at) => at,
                // Frames after the due one are not late.
                None => self.ready.iter().rposition(|r| r.number <= shown_number + 1)?,
            },
            // Only the redrawn frame; others are ahead of their time.
            None if self.shown_look != self.look => {
                self.ready.iter().rposition(|r| Some(r.delivery.request.time) == on_screen)?
            }
            None => return None,
        };
        self.ready.drain(..=at).next_back()
    }

    /// Tells the pipeline which steps to read ahead.
    fn expect(&self) {
        let present = self.clock.state().frame;
        let times = present.into_iter().chain(self.clock.upcoming(EXPECTED));
        let steps = times.flat_map(|time| [Some(time.step()), time.toward().map(|(next, _)| next)]);
        self.pipelined.expect(&steps.flatten().collect::<Vec<usize>>());
    }
}

#[cfg(test)]
#[path = "player_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "player_family_tests.rs"]
mod family_tests;

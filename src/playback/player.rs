//! A clock and a pipeline: what is due is asked for in time, and shown when it is.
//!
//! A player asks for what is due and for the next two moments, shows frames when their time has come, and after a command that goes
//! elsewhere never one from before. In real-time mode on a slow machine it finishes the frame at hand, shows it, and goes on with what is
//! due then.
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

/// Frames that are rendered before their time: the next one, and one so that the renderer never waits.
const AHEAD: usize = 2;

/// Steps whose blocks are read ahead: four blocks of 64 steps.
const EXPECTED: usize = 256;

/// Plays a series: turns the clock's moments into requests, and hands out frames when their time has come.
///
/// Call [`Player::tick`] whenever a frame is delivered, a command was given, or the time that it named is over. It never waits.
///
/// - After a command that goes elsewhere, no frame from before is shown any more.
/// - In the modes that show each step, frames come in order, each once, none before its time.
/// - In [`Mode::RealTime`] on a machine that is too slow, the frame being rendered is finished and shown although its time has
///   passed; the next one is the one that is due then.
pub struct Player {
    clock: Clock,
    pipelined: Pipelined,
    /// Counts the changes of what frames look like.
    look: u64,
    /// That of the frame on the screen.
    shown_look: u64,
    /// The number of its moment: moments are counted in the order in which they are to be shown, the same one with different
    /// looks once. Whatever has a lesser one comes too late.
    shown_number: u64,
    /// Asked for, in order, not delivered yet.
    asked: VecDeque<Asked>,
    /// Delivered, in order, not shown yet.
    ready: VecDeque<Ready>,
    /// Delivered, of a frame that is still on its way.
    preview: Option<Ready>,
    /// A command may have gone elsewhere since the last tick.
    is_redirected: bool,
    /// What was due when nobody knew yet what it looks like. It comes first when that is known: the clock may be past it by then,
    /// and past every other moment when that one's time comes.
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

/// What a tick brings.
#[derive(Debug, Default)]
pub struct Tick {
    /// Shown from now on; `None`: what was.
    pub shown: Option<Delivery>,
    /// Tick again after so long, or when a frame is delivered; `None`: only then, or after a command.
    pub wait: Option<Duration>,
    /// Steps passed over since the frame before.
    pub dropped: u64,
}

impl Player {
    /// A player of what `pipelined` renders. The first frame is due at once.
    pub fn new(clock: Clock, pipelined: Pipelined) -> Self {
        let (asked, ready, preview, is_redirected, unknown) = Default::default();
        Self {
            clock,
            pipelined,
            look: 0,
            shown_look: 0,
            shown_number: 0,
            asked,
            ready,
            preview,
            is_redirected,
            unknown,
        }
    }

    /// The clock, to be read.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// The pipeline, to be read.
    pub fn pipelined(&self) -> &Pipelined {
        &self.pipelined
    }

    /// The pipeline, for another use; requests on their way are not wanted any more.
    pub fn into_pipelined(self) -> Pipelined {
        self.pipelined.clear();
        self.pipelined
    }

    /// Follows a command at the caller's monotonic time `now`.
    ///
    /// # Errors
    /// If a number in it makes no sense; nothing has changed then.
    pub fn apply(&mut self, command: Command, now: Duration) -> Result<(), CommandError> {
        self.clock.apply(command, now)?;
        self.is_redirected = true;
        Ok(())
    }

    /// Frames look different from now on (camera, colours, size): what is on the screen is asked for again. A frame that is
    /// being rendered is still shown, so that there is something to see while a slow renderer follows a mouse.
    pub fn redraw(&mut self) {
        self.look += 1;
    }

    /// Another series with as many steps is played from now on, at the same place; nothing of the one before is shown any
    /// more.
    pub fn set_series(&mut self, series: Arc<Series>) {
        self.forget_all();
        self.pipelined.set_series(series);
        self.redraw();
    }

    /// The series has grown: `series` has the same steps and more ([`Store::refreshed`](crate::store::Store::refreshed),
    /// [`Series::reopened`]). What is on the screen is asked for again: its step may have been encoded anew.
    ///
    /// # Errors
    /// If it is another series; nothing has changed then.
    pub fn grow(&mut self, series: Arc<Series>) -> Result<(), CommandError> {
        self.clock.extend(series.times().clone())?;
        self.pipelined.set_series(series);
        self.redraw();
        Ok(())
    }

    /// Shows what is due at the caller's monotonic time `now`, and asks for what comes next; `request` says what a moment
    /// looks like. `None`: that is not known yet; tick again when it is.
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
        // The next one is asked for at once; if it is due and there already, it waits for the next tick.
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

    /// Waits until a frame that was asked for is there, `longest` at most; whether one came.
    pub fn wait(&mut self, longest: Duration) -> bool {
        let delivery = self.pipelined.wait(longest);
        delivery.map(|delivery| self.receive(delivery)).is_some()
    }

    /// Takes what has been delivered: no more than was asked for.
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
        // Those before it were dropped on their way.
        while let Some(asked) = self.asked.pop_front_if(|asked| asked.id <= delivery.id) {
            if asked.id == delivery.id {
                self.ready.push_back(Ready { delivery, look: asked.look, number: asked.number });
                return;
            }
        }
    }

    /// Asks for what is due, or for what is on the screen if that looks different now, and for what comes after it.
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
        // Who comes late has no use for what comes later.
        let ahead = if state.playing && !is_mixing && !is_late && dropped == 0 { AHEAD } else { 0 };
        let expected: Vec<FrameTime> = wanted.into_iter().chain(self.clock.upcoming(ahead)).take(1 + ahead).collect();
        // What is on the screen keeps its number when it is asked for again.
        let first_number = self.shown_number + u64::from(due.is_some() || wanted.is_none());
        let mut on_their_way: Vec<(FrameTime, u64)> =
            self.ready.iter().map(|r| (r.delivery.request.time, r.look)).collect();
        on_their_way.extend(self.asked.iter().map(|asked| (asked.time, asked.look)));
        // What comes before the first that is expected is late, or looks as before.
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

    /// A preview of what is on its way, unless that looks different now. The clock goes by frames: to it nothing has been shown.
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

    /// The frame to show, of those that are ready: the one that is due, or if it is not there the newest one that is late.
    fn next_to_show(&mut self, due: Option<FrameTime>) -> Option<Ready> {
        let on_screen = self.clock.state().frame;
        let look = self.look;
        let shown_number = self.shown_number;
        self.ready.retain(|r| {
            // What is not due yet but looks as before will be asked for again, too.
            let is_of_use = r.look == look || Some(r.delivery.request.time) == on_screen || due.is_some();
            r.number >= shown_number && is_of_use
        });
        let at = match due {
            Some(due) => match self.ready.iter().rposition(|r| r.delivery.request.time == due) {
                Some(at) => at,
                // Those that come after the one that is due are not late.
                None => self.ready.iter().rposition(|r| r.number <= shown_number + 1)?,
            },
            // What was drawn again; others are ahead of their time.
            None if self.shown_look != self.look => {
                self.ready.iter().rposition(|r| Some(r.delivery.request.time) == on_screen)?
            }
            None => return None,
        };
        self.ready.drain(..=at).next_back()
    }

    /// Has the blocks read ahead that will be needed.
    fn expect(&self) {
        let present = self.clock.state().frame;
        let moments = present.into_iter().chain(self.clock.upcoming(EXPECTED));
        let steps = moments.flat_map(|time| [Some(time.step()), time.toward().map(|(next, _)| next)]);
        self.pipelined.expect(&steps.flatten().collect::<Vec<usize>>());
    }
}

#[cfg(test)]
#[path = "player_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "player_family_tests.rs"]
mod family_tests;

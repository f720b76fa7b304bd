//! The playback clock: which frame is due.
//!
//! [`Clock`] is a pure state machine. Keys, buttons, scripts and tests send it the same [`Command`]s; the caller passes the time
//! (`now`, from any monotonic origin), asks [`Clock::due`] which frame to show, and calls [`Clock::frame_shown`] when it is on the
//! screen. It has no thread, reads no clock and touches no file.
//!
//! ```
//! # use std::time::Duration;
//! use tetreel::field::TimeAxis;
//! use tetreel::playback::{Clock, Command};
//!
//! let mut clock = Clock::new(TimeAxis { values: vec![0.0, 0.1, 0.4] });
//! let mut now = Duration::ZERO; // or from an Instant
//! clock.apply(Command::Speed(10.0), now)?;
//! clock.apply(Command::Play, now)?;
//! let mut played = Vec::new();
//! while clock.state().playing {
//!     let due = clock.due(now);
//!     if let Some(frame) = due.frame {
//!         played.push(frame.step()); // render it
//!         clock.frame_shown(frame, now);
//!     }
//!     now += due.wait.unwrap_or_default(); // sleep, or look at the user's events
//! }
//! assert_eq!(played, [0, 1, 2]);
//! assert!(now >= Duration::from_millis(199) && now <= Duration::from_millis(201));
//! # Ok::<(), tetreel::playback::CommandError>(())
//! ```
//!
//! # Modes
//!
//! | mode | speed | guarantee |
//! |---|---|---|
//! | [`Mode::EveryStep`] | frames per second, 25 unless told | each step once, the first included; if a frame comes late, the next ones wait |
//! | [`Mode::RealTime`] | file time per second; unless told, the series lasts 10 s | each step at its time; those that the renderer cannot keep up with are dropped and counted |
//! | [`Mode::AsFastAsPossible`] | none | each step once, as soon as the one before is shown |
//!
//! Each mode keeps its speed. A speed that is not finite and above 0 is refused: use [`Command::Pause`] or [`Direction::Backward`].
//!
//! # What happens when
//!
//! - **The first frame** is due at once, playing or not. After it, as after a seek, time stands still until the frame is on the
//!   screen: a slow first frame drops nothing.
//! - **The end.** Without a loop, the last frame ends the playback ([`State::ended`]); [`Command::Play`] begins again. Going back
//!   to the start of a loop takes as long as the interval before it, so that the last step is seen.
//! - **Backwards** a step is held, as forwards, from when its time is reached until the next one's is.
//! - **Ping-pong** goes 0 1 2 1 0 1. [`State::heading`] is the current direction; the one that was set stays.
//! - **The range** bounds playback with every loop except [`Loop::All`]; seeking goes anywhere. From before the range, or from after it in
//!   a loop, playing goes on with its start (ping-pong: with the nearer end); [`Command::Play`] goes there at once.
//! - **The stride** counts from A in both directions; if it does not divide the range, B is not shown.
//! - **One step** in a loop: nothing to show after it, but the playback goes on, so that the range can be dragged open again.
//! - **Changes while playing** keep the frame and the share of its interval that has passed (speed), or the time
//!   reached (direction, loop, range, stride in real time); a change of mode begins the interval anew.
//! - **Late frames** are compensated for, up to one interval: the rate holds although a screen refreshes at its own times. No further delay
//!   accumulates.
//! - **A series that grows** ([`Clock::extend`]): the frame on the screen and all settings stay. From the old last step, playing goes on
//!   into the new ones, instead of returning to the start of a loop or turning round; a playback that had ended does so at the next
//!   [`Command::Play`].
//! - **Interpolation** is only in real time, between steps that are played; a loop does not interpolate from its last step to its first.
//! - **Time that goes back** stands still; a leap of 10 s more than the announced wait is taken for a suspended machine, and no time passes
//!   in it.

mod clock;
mod command;
mod course;
mod measure;
mod player;
pub mod quality;
mod screen;
mod sequence;
#[cfg(test)]
mod tests;

pub use clock::{Clock, Due, State};
pub use command::{Command, CommandError, Direction, Loop, Mode, Settings, StepRange};
pub use player::{Player, Tick};

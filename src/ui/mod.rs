//! The player window.
//!
//! The state of the window is plain data: a [`Session`] holds player, camera and colours, and everything that keys, mouse and
//! widgets do to it is an [`Action`] ([`keys`] is the one table of keys, and the help). It has no window, and its tests need
//! none. With the feature `gui`, `window` shows it.
//!
//! While nothing changes, no frame is requested and the window is not painted.
//!
//! ```text
//! keys, mouse, widgets -> Action -> Session -> Player -> frames -> Screen -> painted
//!                                   Session -> Prober, Survey, Thumbnails, Exports, Jobs -> what they find, with the next tick
//! ```
//!
//! - **The thread of the window** does not decode, render, convert or read; it waits a millisecond at most, for a project's table. Slow
//!   work has threads: the pipeline; `picture` (pixels for the screen); `probe` (the point under the mouse: in the cell on the ray that
//!   contributes most to the pixel's opacity; and a point's value at every step); `survey` (means and histograms, coarse to fine, paused
//!   while the user acts or frames come late); `histograms` (of four kinds, of the series or of a step; `bars` makes pixels of them);
//!   `thumbnails`; `opening` (a store, or a source that is imported to the cache first, and a picture of
//!   some cells of it until then: `first_picture`);
//!   `following` (a store that grows); `settings`; `exporting` (images and movies, and the preview of its dialog); fields and images in
//!   `jobs`. Each ends with its owner; those that read data catch their panics and report them in a message.
//! - **One state.** What the window shows is a project (`document.rs`), be it one of a look without a file; a transfer function is an ensemble of one
//!   member. States before a change are kept whole, for undo.
//! - **A project** is an `Animation` on a thread of its own (`ui/project_worker.rs`, the one place where tables of a project are made for
//!   the window). A caller waits a millisecond; a frame whose table takes longer is not requested until that is known (`Player::tick`), and
//!   comes first then, so that a running clock does not pass over all of them. Results of the last frames are kept.
//! - **One core is the window's** while the user acts and for 250 ms after: renderers on the CPU ask `ThreadLimit` for a turn before each
//!   tile, so that this also holds for the frame being rendered. At all times rendering and preparing threads give way to the window's
//!   (`PipelinedOptions::give_way`).
//! - **Two views** are two sessions on one clock ([`views`]): the active one leads, the other one is sent after it. Which one is active is
//!   where the user acts.
//! - **Painted once for each input.** User actions are applied in the first layout of a pass; a second layout, before painting, shows their
//!   effect.
//! - **Painted where it changed** (`window/retained.rs`): a texture keeps the window's pixels, and a pass paints the rectangles whose shapes are
//!   not those of the last one. A picture that is still the same is the same callback.
//! - **One device.** The window is painted with the device that frames are rendered on. `FrameRequest::for_window` leaves such a frame
//!   there: a compute pass (`present.wgsl`) writes the accumulators, still premultiplied, in half precision to a texture that the window's
//!   own shader (`picture.wgsl`) puts over the background. No pixel passes through the CPU, and another background costs nothing. A texture
//!   comes back to the pool when the next one is bound: never while it is painted. A frame of the CPU becomes 8-bit pixels on the picture
//!   thread.
//! - **Only the last request.** `Session::turns` counts commands that jump in time; a picture begun before the last one is not shown any
//!   more. Time and description over the picture are those of the picture, not of the request.
//! - **A lost device** fails the current frame, which another device renders; the window itself is closed and opened again with the same
//!   session, since everything it has painted is lost.
//! - **While something moves**, `playback::quality` (no clock, no threads) is given frame times and chooses how the next frame is drawn: in
//!   full, by fewer rays, smaller, by few rays with details of an earlier step, or by fewer faces. **At rest** the request has previews
//!   (`FrameRequest::previews`): the ray caster shows its image at falling contrasts on the way, and yields to a newer request. Caches and
//!   files take only frames with `Delivery::is_final`.
//!
//! The package `tests/ui` is the only one with egui's test harness: it finds widgets by their names in the accessibility tree, so that
//! every control has one. `real_window` opens the window on a virtual screen and operates it through X, as a user would.

mod action;
pub mod bars;
mod camera_history;
#[cfg(test)]
mod camera_tests;
#[cfg(test)]
pub(crate) mod desk;
mod document;
#[cfg(test)]
mod drag_tests;
#[cfg(test)]
mod editor_tests;
pub mod exporting;
mod first_picture;
#[cfg(test)]
mod flow_tests;
pub mod following;
pub mod histograms;
mod history;
mod insight;
mod jobs;
mod keeper;
pub mod keys;
pub mod members;
mod motion;
mod notice;
pub mod opacity;
pub mod opening;
mod pace;
pub mod picture;
#[cfg(test)]
mod points_tests;
pub mod probe;
#[cfg(test)]
mod project_tests;
mod project_worker;
#[cfg(test)]
mod quality_tests;
mod requests;
#[cfg(test)]
mod saving_tests;
mod session;
#[cfg(test)]
mod session_tests;
pub mod settings;
pub mod shapes;
mod still;
pub mod strip;
pub mod survey;
pub mod thumbnails;
pub mod tracks;
pub mod views;
#[cfg(feature = "gui")]
pub mod window;
mod worker;

pub use action::{Action, FunctionFile};
pub use camera_history::CameraTurn;
pub use history::{Cost, HISTORY_FRAMES, History};
pub use insight::Picked;
pub use keeper::SettingsKeeper;
pub use motion::MotionError;
pub use notice::{Notice, NoticeKind};
pub use pace::shortfall;
pub use session::{DEFAULT_TARGET_FPS, ExportCommand, IMAGE_SCALES, Session, SessionOptions, Shown, TARGET_FPS};

//! The player window.
//!
//! What the window *is* is plain data: a [`Session`] holds player, camera and colours, and everything that keys, mouse and
//! widgets do to it is an [`Action`] ([`keys`] is the one table of keys, and the help). It has no window, and its tests need
//! none. With the feature `gui`, `window` shows it.
//!
//! The thread of the window never decodes, renders, converts an image or touches a file: the pipeline has its own threads, so
//! have [`picture`], [`mod@probe`], [`survey`] and [`thumbnails`], what a project shows is worked out beside it, and fields are opened and images written on threads of their
//! own. While nothing changes, nothing is asked of the pipeline and the window is not painted.

mod action;
#[cfg(test)]
mod drag_tests;
pub mod following;
mod history;
mod insight;
mod jobs;
mod keeper;
pub mod keys;
mod look;
mod moments;
mod notice;
pub mod opacity;
pub mod opening;
mod pace;
pub mod picture;
pub mod probe;
#[cfg(test)]
mod project_tests;
mod session;
#[cfg(test)]
mod session_tests;
pub mod settings;
mod still;
pub mod survey;
pub mod thumbnails;
#[cfg(feature = "gui")]
pub mod window;
mod worker;

pub use action::Action;
pub use history::{Cost, HISTORY_FRAMES, History};
pub use insight::Picked;
pub use keeper::SettingsKeeper;
pub use look::{DEFAULT_TF, Look, mapped_range};
pub use moments::{EnsembleChoice, Followed};
pub use notice::{Notice, NoticeKind};
pub use pace::shortfall;
pub use session::{DEFAULT_TARGET_FPS, IMAGE_SCALES, MotionError, Session, SessionOptions, Shown, TARGET_FPS};

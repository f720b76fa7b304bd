//! Values at times, and the interpolation between them: [`Keyframed`] and [`Transition`].

mod keyframed;
mod transition;

pub use keyframed::{At, Key, Keyframed};
pub use transition::Transition;

use crate::short::Short;

/// Why keys or a transition are invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TimelineError {
    /// A time that is NaN or infinite.
    #[error("the time {0} of a key must be finite")]
    BadTime(f64),
    /// Keys that are not sorted by time.
    #[error("the key at time {} lies before the one in front of it; times must increase", Short(.0))]
    NotSorted(f64),
    /// Two keys at one time.
    #[error("there are two keys at time {}; give one of them another time", Short(.0))]
    TimeTaken(f64),
    /// No key of that index.
    #[error("there is no key {0}")]
    NoKey(usize),
    /// A step or handle outside of the unit square.
    #[error("a transition's step and handles lie between 0 and 1")]
    BadTransition,
}

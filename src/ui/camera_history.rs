//! The way back from movements of the camera.
//!
//! The camera has a history of its own: a change of colours is undone without turning the volume, and looking round buries no change.

use crate::camera::Camera;
use std::collections::VecDeque;

/// Largest number of cameras to go back to.
const KEPT: usize = 1000;

/// What a view looks through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Seen {
    /// The camera path of the project.
    Path,
    /// A camera.
    Through(Camera),
}

/// What a movement belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// The gesture of this number, such as a drag.
    Gesture(u64),
    /// Notches of a wheel that follow each other.
    Wheel,
    /// Nothing but itself.
    Alone,
}

/// Which way to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraTurn {
    /// Back to the camera before the last movement.
    Back,
    /// On to the camera that was left by going back.
    On,
}

/// The cameras before the one of now, and those that were left by going back.
#[derive(Debug, Default)]
pub(super) struct CameraHistory {
    before: VecDeque<Seen>,
    after: Vec<Seen>,
    /// What the last movement belonged to.
    motion: Option<Motion>,
}

impl CameraHistory {
    /// Records that the camera moved from `before` to `now`, if it did. Movements of one gesture are one; notches of a wheel are one while
    /// the camera `is_moving` from the last of them.
    pub(super) fn record(&mut self, [before, now]: [Seen; 2], motion: Motion, is_moving: bool) {
        if before == now {
            return;
        }
        self.after.clear();
        let goes_on = match motion {
            Motion::Gesture(_) => self.motion == Some(motion),
            Motion::Wheel => self.motion == Some(motion) && is_moving,
            Motion::Alone => false,
        };
        if !goes_on {
            if self.before.len() == KEPT {
                self.before.pop_front();
            }
            self.before.push_back(before);
        }
        self.motion = Some(motion);
    }

    /// Turns back or on from `now`; `None`: there is nothing there.
    pub(super) fn turn(&mut self, turn: CameraTurn, now: Seen) -> Option<Seen> {
        self.motion = None;
        match turn {
            CameraTurn::Back => {
                let before = self.before.pop_back()?;
                self.after.push(now);
                Some(before)
            }
            CameraTurn::On => {
                let after = self.after.pop()?;
                self.before.push_back(now);
                Some(after)
            }
        }
    }

    /// Numbers of cameras to go back and on to.
    pub(super) fn counts(&self) -> [usize; 2] {
        [self.before.len(), self.after.len()]
    }
}

//! What the screen paints.

use crate::pipeline::FrameTime;
use eframe::egui::Vec2;

/// A picture to be painted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Painted {
    /// Size in its own pixels.
    pub(super) size: Vec2,
    /// Time of its frame.
    pub(super) time: FrameTime,
}

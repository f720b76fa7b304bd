//! A rectangle with one colour and a ramp of opacity.

use super::{GAP, covers, is_color};
use crate::transfer::color_map::lerp;
use crate::transfer::profile::{ProfilePoint, Side};
use serde::{Deserialize, Serialize};

/// One colour in a rectangle; opacity is linear from its left end to its right one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    /// Left and right end.
    pub x: [f64; 2],
    /// Lower and upper end. On one axis only used for drawing.
    pub y: [f64; 2],
    /// Display-referred colour, 0..=1.
    pub rgb: [f64; 3],
    /// Opacity at the left and at the right end, 0..=1.
    pub opacity: [f64; 2],
}

impl Rectangle {
    pub(super) fn problem(&self) -> Option<&'static str> {
        let is_extent = |e: [f64; 2]| 0.0 <= e[0] && e[0] < e[1] && e[1] <= 1.0;
        if !(is_extent(self.x) && is_extent(self.y)) {
            return Some("a rectangle lies within 0..1 and is not empty");
        }
        let is_opacity = self.opacity.iter().all(|a| (0.0..=1.0).contains(a));
        (!is_opacity || !is_color(&self.rgb)).then_some("colours and opacities are between 0 and 1")
    }

    /// The corners, from the lower left one, counterclockwise.
    pub(super) fn corners(&self) -> [[f64; 2]; 4] {
        let ([x0, x1], [y0, y1]) = (self.x, self.y);
        [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    }

    pub(super) fn side(&self, x: f64) -> Side {
        if !covers(self.x, x) {
            return Side::TRANSPARENT;
        }
        let [x0, x1] = self.x;
        Side { rgb: self.rgb, value: lerp(self.opacity[0], self.opacity[1], (x - x0) / (x1 - x0)) }
    }

    pub(super) fn line(&self) -> Vec<ProfilePoint> {
        let [start, end] = self.opacity.map(|value| Side { rgb: self.rgb, value });
        vec![
            ProfilePoint { scalar: self.x[0], left: Side::TRANSPARENT, right: start },
            ProfilePoint { scalar: self.x[1], left: end, right: Side::TRANSPARENT },
        ]
    }

    pub(super) fn move_corner(&mut self, corner: usize, to: [f64; 2]) {
        if corner >= 4 {
            return;
        }
        move_end(&mut self.x, usize::from(corner == 1 || corner == 2), to[0]);
        move_end(&mut self.y, usize::from(corner >= 2), to[1]);
    }
}

/// Moves an end of an extent, within the axis and not past the other end.
fn move_end(extent: &mut [f64; 2], end: usize, to: f64) {
    if end == 0 {
        extent[0] = to.clamp(0.0, (extent[1] - GAP).max(0.0));
    } else {
        extent[1] = to.clamp((extent[0] + GAP).min(1.0), 1.0);
    }
}

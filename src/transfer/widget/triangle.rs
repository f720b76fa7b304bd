//! A triangle that stands on its corner.

use super::{GAP, is_color};
use crate::transfer::color_map::lerp;
use crate::transfer::profile::{ProfilePoint, Side};
use serde::{Deserialize, Serialize};

/// One colour in a triangle that stands on a corner, its base; the opposite edge is level. Over scalar and gradient magnitude its base is
/// put where the arc of a boundary begins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Triangle {
    /// The lower corner [x, y].
    pub base: [f64; 2],
    /// y of the upper edge.
    pub top: f64,
    /// x of the left end of the upper edge.
    pub left: f64,
    /// x of the right end of the upper edge.
    pub right: f64,
    /// Display-referred colour, 0..=1.
    pub rgb: [f64; 3],
    /// Opacity 0..=1: everywhere, or with fall-off at the centre line, from the base to the middle of the upper edge.
    pub opacity: f64,
}

impl Triangle {
    pub(super) fn problem(&self) -> Option<&'static str> {
        let in_axis = [self.base[0], self.base[1], self.top, self.left, self.right];
        if !in_axis.iter().all(|c| (0.0..=1.0).contains(c)) || self.left >= self.right || self.base[1] >= self.top {
            return Some("a triangle lies within 0..1, its base below its top and its left end before its right one");
        }
        let is_opacity = (0.0..=1.0).contains(&self.opacity);
        (!is_opacity || !is_color(&self.rgb)).then_some("colours and opacities are between 0 and 1")
    }

    /// Base, right and left end of the upper edge.
    pub(super) fn corners(&self) -> [[f64; 2]; 3] {
        [self.base, [self.right, self.top], [self.left, self.top]]
    }

    /// Position of a point between the left side, at -1, and the right one, at 1, if it is inside. The right side and the upper edge are
    /// inside only at the end of the axis; the base, a single point, never is.
    pub(super) fn place(&self, x: f64, y: f64) -> Option<f64> {
        let [left, right] = self.sides_at(y)?;
        let is_inside = left <= x && (x < right || (x == 1.0 && right == 1.0));
        is_inside.then(|| ((x - left) - (right - x)) / (right - left))
    }

    /// x of the left and right sides at height y; `None` outside of the triangle.
    fn sides_at(&self, y: f64) -> Option<[f64; 2]> {
        let height = (y - self.base[1]) / (self.top - self.base[1]);
        let is_inside = height > 0.0 && (height < 1.0 || (height == 1.0 && self.top == 1.0));
        let [left, right] = [self.left, self.right].map(|end| lerp(self.base[0], end, height));
        (is_inside && left < right).then_some([left, right])
    }

    /// The curve over x at height y.
    pub(super) fn line(&self, y: f64, falls_off: bool) -> Vec<ProfilePoint> {
        let Some([left, right]) = self.sides_at(y.clamp(0.0, 1.0)) else { return Vec::new() };
        let side = |value: f64| Side { rgb: self.rgb, value };
        let (edge, top) = (side(if falls_off { 0.0 } else { self.opacity }), side(self.opacity));
        let middle = 0.5 * (left + right);
        let mut points = vec![ProfilePoint { scalar: left, left: Side::TRANSPARENT, right: edge }];
        if falls_off && left < middle && middle < right {
            points.push(ProfilePoint { scalar: middle, left: top, right: top });
        }
        points.push(ProfilePoint { scalar: right, left: edge, right: Side::TRANSPARENT });
        points
    }

    pub(super) fn side(&self, x: f64, y: f64, falls_off: bool) -> Side {
        let Some(place) = self.place(x, y) else { return Side::TRANSPARENT };
        let share = if falls_off { (1.0 - place.abs()).max(0.0) } else { 1.0 };
        Side { rgb: self.rgb, value: self.opacity * share }
    }

    pub(super) fn move_corner(&mut self, corner: usize, to: [f64; 2]) {
        let x = to[0].clamp(0.0, 1.0);
        match corner {
            0 => self.base = [x, to[1].clamp(0.0, (self.top - GAP).max(0.0))],
            1 => self.right = x.max((self.left + GAP).min(1.0)),
            2 => self.left = x.min((self.right - GAP).max(0.0)),
            _ => return,
        }
        if corner > 0 {
            self.top = to[1].clamp((self.base[1] + GAP).min(1.0), 1.0);
        }
    }
}

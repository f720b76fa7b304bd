//! Points with colour and opacity.

use super::{GAP, is_color};
use crate::transfer::profile::{ProfilePoint, Side};
use serde::{Deserialize, Serialize};

/// A point of a [`Polyline`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolylinePoint {
    /// Position on the axis, 0..=1.
    pub position: f64,
    /// Display-referred colour, 0..=1.
    pub rgb: [f64; 3],
    /// Opacity, 0..=1, drawn as height.
    pub opacity: f64,
}

/// Colour and opacity linear between points; transparent before the first and behind the last, unless these are the ends of the
/// axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Polyline {
    /// At least two, at increasing positions.
    pub points: Vec<PolylinePoint>,
}

impl PolylinePoint {
    fn side(&self) -> Side {
        Side { rgb: self.rgb, value: self.opacity }
    }
}

impl Polyline {
    pub(super) fn problem(&self) -> Option<&'static str> {
        let increases = self.points.windows(2).all(|p| p[0].position < p[1].position);
        let is_point = |p: &PolylinePoint| {
            is_color(&p.rgb) && (0.0..=1.0).contains(&p.opacity) && (0.0..=1.0).contains(&p.position)
        };
        if self.points.len() < 2 || !increases {
            return Some("a polyline has two points or more, at increasing positions");
        }
        (!self.points.iter().all(is_point)).then_some("positions, colours and opacities are between 0 and 1")
    }

    pub(super) fn side(&self, x: f64) -> Side {
        let after = self.points.partition_point(|p| p.position <= x);
        match (after.checked_sub(1).and_then(|i| self.points.get(i)), self.points.get(after)) {
            (Some(a), Some(b)) => Side::mix(&a.side(), &b.side(), (x - a.position) / (b.position - a.position)),
            (Some(last), None) if last.position == 1.0 && x == 1.0 => last.side(),
            _ => Side::TRANSPARENT,
        }
    }

    pub(super) fn line(&self) -> Vec<ProfilePoint> {
        let point = |p: &PolylinePoint| ProfilePoint { scalar: p.position, left: p.side(), right: p.side() };
        let mut points: Vec<ProfilePoint> = self.points.iter().map(point).collect();
        if let Some(first) = points.first_mut() {
            first.left = Side::TRANSPARENT;
        }
        if let Some(last) = points.last_mut() {
            last.right = Side::TRANSPARENT;
        }
        points
    }

    pub(super) fn move_point(&mut self, index: usize, to: [f64; 2]) {
        let position = |i: Option<usize>| i.and_then(|i| self.points.get(i)).map(|p| p.position);
        let least = position(index.checked_sub(1)).map_or(0.0, |p| p + GAP);
        let most = position(Some(index + 1)).map_or(1.0, |p| p - GAP);
        if let Some(point) = self.points.get_mut(index) {
            point.opacity = to[1].clamp(0.0, 1.0);
            if least <= most {
                point.position = to[0].clamp(least, most);
            }
        }
    }
}

//! [`RangeMap`]: stretches crowded parts of an axis (dissertation 7.2).

use super::TransferError;
use super::color_map::lerp;
use serde::{Deserialize, Serialize};

/// A strictly increasing, piecewise linear map of positions 0..=1 to positions 0..=1, with f(0) = 0 and f(1) = 1 exactly (equations 7.3 and
/// 7.4); the identity outside of 0..=1.
///
/// The position x of a scalar on its range becomes the position f(x) on the axis of a transfer function. Flat pieces are
/// not allowed: all their scalars would have one position, and a curve over the scalar would have no point for it.
/// Editing keeps points [`RangeMap::GAP`] apart in x and y, so slopes stay between 2^-32 and 2^32.
///
/// As data: `{ points: [[x, y], ...] }`, without the two ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "InnerPoints", into = "InnerPoints")]
pub struct RangeMap {
    /// [x, y], from [0, 0] to [1, 1]; both increase strictly.
    points: Vec<[f64; 2]>,
}

/// The serialized form of a map.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct InnerPoints {
    points: Vec<[f64; 2]>,
}

/// The share of the axis that [`RangeMap::equalised`] spreads evenly, so that no part without values becomes flat.
const EVEN_SHARE: f64 = 1.0 / 256.0;

/// Largest error in y, at omitted points, of the map that [`RangeMap::equalised`] simplifies.
const EQUALISED_TOLERANCE: f64 = 1.0 / 512.0;

impl Default for RangeMap {
    /// The identity.
    fn default() -> Self {
        Self { points: vec![[0.0; 2], [1.0; 2]] }
    }
}

impl TryFrom<InnerPoints> for RangeMap {
    type Error = TransferError;

    fn try_from(inner: InnerPoints) -> Result<Self, TransferError> {
        Self::new(&inner.points)
    }
}

impl From<RangeMap> for InnerPoints {
    fn from(map: RangeMap) -> Self {
        Self { points: map.points.get(1..map.points.len() - 1).unwrap_or_default().to_vec() }
    }
}

impl RangeMap {
    /// Least distance between neighbours after editing, in x and in y. Positions near 1 are multiples of 2^-53, so that two million of them
    /// still lie in between.
    pub const GAP: f64 = 1.0 / 4_294_967_296.0;

    /// A map through its inner points [x, y], sorted.
    ///
    /// # Errors
    /// If the points do not lie between 0 and 1, or x or y does not increase.
    pub fn new(inner: &[[f64; 2]]) -> Result<Self, TransferError> {
        let mut points = vec![[0.0; 2]];
        points.extend_from_slice(inner);
        points.push([1.0; 2]);
        let increases = |p: &[[f64; 2]]| p[0][0] < p[1][0] && p[0][1] < p[1][1];
        match points.windows(2).position(|p| !increases(p)) {
            None => Ok(Self { points }),
            Some(index) => Err(TransferError::BadRangeMap { index }),
        }
    }

    /// The map that gives equally many values to equal parts of the axis (histogram equalisation, equations 7.1 and 7.2),
    /// from the counts of values in equally wide bins of 0..=1. Without counts it is the identity.
    ///
    /// Equation 7.1 as printed sums over x_j < x_i: it begins at 0, but ends at 1 less the share of the last value. Here
    /// the sum is taken up to each edge between bins, so that f(1) = 1. A 256th of the axis is spread evenly, and points
    /// are left out where the map stays within 1/512 of them.
    pub fn equalised(counts: &[u64]) -> Self {
        let (total, bins) = (counts.iter().map(|&n| n as f64).sum::<f64>(), counts.len() as f64);
        if total == 0.0 {
            return Self::default();
        }
        let mut below = 0.0;
        let edge = |(i, &n): (usize, &u64)| {
            below += n as f64;
            let x = (i + 1) as f64 / bins;
            [x, lerp(below / total, x, EVEN_SHARE)]
        };
        let edges: Vec<[f64; 2]> = std::iter::once([0.0; 2]).chain(counts.iter().enumerate().map(edge)).collect();
        let mut points = vec![[0.0; 2]];
        for end in simplified(&edges) {
            if points.last().is_none_or(|last| are_apart(last, &end)) {
                points.push(end);
            }
        }
        points.pop_if(|last| !are_apart(last, &[1.0; 2]));
        points.push([1.0; 2]);
        Self { points }
    }

    /// All points [x, y], from [0, 0] to [1, 1].
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// f(x), by equation 7.4: exact at points, never outside its segment, never falling.
    pub fn eval(&self, x: f64) -> f64 {
        self.along(x, 0, 1)
    }

    /// The position that the map moves to `y`.
    pub fn inverse(&self, y: f64) -> f64 {
        self.along(y, 1, 0)
    }

    /// Interpolates coordinate `to` where coordinate `from` is `at`.
    fn along(&self, at: f64, from: usize, to: usize) -> f64 {
        let after = self.points.partition_point(|p| p[from] <= at);
        match (after.checked_sub(1).and_then(|i| self.points.get(i)), self.points.get(after)) {
            // Every operation of 7.4 keeps the order of two numbers, rounding included; only the end may be exceeded.
            (Some(a), Some(b)) => ((at - a[from]) / (b[from] - a[from]) * (b[to] - a[to]) + a[to]).min(b[to]),
            _ => at,
        }
    }

    /// The same map with one more point, at `x`, and the point's index. `None` if it is nearer than [`RangeMap::GAP`] to another one.
    pub fn with_point(&self, x: f64) -> Option<(Self, usize)> {
        let point = [x, self.eval(x)];
        let index = self.points.partition_point(|p| p[0] <= x);
        let (before, after) = (self.points.get(index.checked_sub(1)?)?, self.points.get(index)?);
        if !(are_apart(before, &point) && are_apart(&point, after)) {
            return None;
        }
        let mut map = self.clone();
        map.points.insert(index, point);
        Some((map, index))
    }

    /// The map without a point; the ends cannot be removed.
    #[must_use]
    pub fn without_point(&self, index: usize) -> Self {
        let mut map = self.clone();
        if self.is_inner(index) {
            map.points.remove(index);
        }
        map
    }

    fn is_inner(&self, index: usize) -> bool {
        index > 0 && index + 1 < self.points.len()
    }

    /// The map with a point dragged to `to`, or as near as its neighbours allow; the ends stay.
    #[must_use]
    pub fn with_moved(&self, index: usize, to: [f64; 2]) -> Self {
        let mut map = self.clone();
        if !self.is_inner(index) || to.iter().any(|c| c.is_nan()) {
            return map;
        }
        let (before, after) = (self.points[index - 1], self.points[index + 1]);
        for c in 0..2 {
            let (least, most) = (before[c] + Self::GAP, after[c] - Self::GAP);
            if least <= most {
                map.points[index][c] = to[c].clamp(least, most);
            }
        }
        map
    }

    /// The map with points `i` < `j` dragged along the axis to the positions `to`: away from each other to give their part
    /// of the range more room, towards each other to take it away. Points between them and outside of them follow in
    /// proportion; the ends stay.
    #[must_use]
    pub fn pulled_apart(&self, i: usize, j: usize, to: [f64; 2]) -> Self {
        let (last, count) = (self.points.len() - 1, self.points.len() as f64);
        let mut map = self.clone();
        if i >= j || j > last || to.iter().any(|c| c.is_nan()) {
            return map;
        }
        // Room for all points, each a gap from the next.
        let room = (count * Self::GAP).min(0.25);
        let (from_i, from_j) = (self.points[i][1], self.points[j][1]);
        let to_i = if i == 0 { 0.0 } else { to[0].clamp(room, 1.0 - 2.0 * room) };
        let to_j = if j == last { 1.0 } else { to[1].clamp(to_i + room, 1.0 - room) };
        for (k, p) in map.points.iter_mut().enumerate().take(last).skip(1) {
            let y = p[1];
            p[1] = if k <= i {
                y / from_i * to_i
            } else if k >= j {
                1.0 - (1.0 - y) / (1.0 - from_j) * (1.0 - to_j)
            } else {
                lerp(to_i, to_j, (y - from_i) / (from_j - from_i))
            };
        }
        map.keep_apart();
        map
    }

    /// Moves points in y that are nearer than a gap to their neighbours.
    fn keep_apart(&mut self) {
        let last = self.points.len() - 1;
        for k in 1..last {
            self.points[k][1] = self.points[k][1].max(self.points[k - 1][1] + Self::GAP);
        }
        for k in (1..last).rev() {
            self.points[k][1] = self.points[k][1].min(self.points[k + 1][1] - Self::GAP);
        }
    }

    /// Interpolates from `a` at 0 to `b` at 1: f(x) is (1 - f) a(x) + f b(x) at every x. Exactly `a` and `b` at both ends.
    #[must_use]
    pub fn mix(a: &Self, b: &Self, f: f64) -> Self {
        if f.is_nan() || f <= 0.0 || a == b {
            return a.clone();
        }
        if f >= 1.0 {
            return b.clone();
        }
        let mut xs: Vec<f64> = a.points.iter().chain(&b.points).map(|p| p[0]).collect();
        xs.sort_by(f64::total_cmp);
        let mut points: Vec<[f64; 2]> = Vec::with_capacity(xs.len());
        for x in xs {
            let point = [x, lerp(a.eval(x), b.eval(x), f)];
            // Points that differ only by rounding are merged.
            if points.last().is_none_or(|last| last[0] < point[0] && last[1] < point[1]) {
                points.push(point);
            }
        }
        points.pop_if(|last| *last != [1.0; 2]);
        if points.last() != Some(&[1.0; 2]) {
            points.push([1.0; 2]);
        }
        Self { points }
    }
}

/// Whether a point lies at least a gap to the left of another, and below it.
fn are_apart(a: &[f64; 2], b: &[f64; 2]) -> bool {
    a[0] + RangeMap::GAP <= b[0] && a[1] + RangeMap::GAP <= b[1]
}

/// The points, from the second one on, of a simplified polyline that passes all others within [`EQUALISED_TOLERANCE`].
fn simplified(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    let mut start = 0;
    while start + 1 < points.len() {
        // Range of slopes from the start that pass all points so far within tolerance.
        let (mut least, mut most, mut end) = (f64::NEG_INFINITY, f64::INFINITY, start + 1);
        for (i, p) in points.iter().enumerate().skip(start + 1) {
            let (dx, dy) = (p[0] - points[start][0], p[1] - points[start][1]);
            if (least..=most).contains(&(dy / dx)) {
                end = i;
            }
            least = least.max((dy - EQUALISED_TOLERANCE) / dx);
            most = most.min((dy + EQUALISED_TOLERANCE) / dx);
            if least > most {
                break;
            }
        }
        kept.push(points[end]);
        start = end;
    }
    kept
}

#[cfg(test)]
#[path = "range_map_tests.rs"]
mod tests;

//! Builds the fewest nodes that follow a transfer function.
//!
//! The curve ([`profile`](super::profile)) is cut at its *kept* points: steps, ends, and each point at which opacity stops rising or
//! falling, or changes its slope. So no spike is lost, however low or narrow, and extinction is zero exactly where the curve is. In a piece
//! between two of them the table goes, from a node on the curve, to the farthest place on the curve to which a straight line stays within
//! the tolerance ([`tolerance`](super::tolerance)) of it everywhere; that place is the next node. Whether it does is decided without
//! sampling: colours are compared at the points of the curve; optical depths of the line against those of the curve also at the one place
//! between two points where their difference is stationary, which has a closed form.
//!
//! Nodes inside a piece may be off the curve by the tolerance, which makes lines longer by up to the square root of two: colours to either
//! side, optical depths only where the curve is convex, away from the lines.
//!
//! Opacity 1 would be infinite extinction. Where it holds over an interval the table has [`OPAQUE_DEPTH`]; where the curve
//! only touches it, extinction ends at [`RAMP_DEPTH`].

use super::TransferError;
use super::color_map::lerp;
use super::function::{OpacityValues, TransferFunction};
use super::opacity::{OPAQUE_DEPTH, OpacityKind};
use super::profile::{Axis, Precision, ProfilePoint, Side, profile};
use super::range::MappedRange;
use super::range_map::RangeMap;
use super::tolerance::{Lengths, Tolerance};
use crate::node_table::{Node, NodeTable};
use crate::slowdown::{Slow, waste};
use std::cmp::Ordering;

/// Largest optical depth of a unit distance elsewhere: a transmittance of 2^-24, the smallest that an f32 opacity distinguishes from 0.
const RAMP_DEPTH: f64 = 24.0 * std::f64::consts::LN_2;

/// The opacity of [`RAMP_DEPTH`].
const RAMP_OPACITY: f64 = 1.0 - 1.0 / (1 << 24) as f64;

/// The part of the tolerance that curves may use: for refinement of logarithmic axes, and division by opacities. Small, since most curves
/// are exact.
pub(super) const CURVE_PART: f64 = 1.0 / 16.0;

/// Relative difference of two slopes of opacity that makes a kink. Points of a refined logarithmic axis are none.
const KINK: f64 = 1.0 / 64.0;

/// Least length of a line inside a piece, as a share of its scalar: far below the f32 spacing that scalars have. In a ramp to opacity 1
/// that is some million f64 scalars wide no longer line is close enough.
const SHORTEST: f64 = 1.0 / (1_u64 << 40) as f64;

/// How far nodes lie below a convex curve, as a part of the tolerance: less than 1 as a margin for rounding.
const BELOW: f64 = 15.0 / 16.0;

/// Rounding of an opacity on a ramp, as a part of its larger end: of the interpolation, and of its scalar as a part of the width.
const RAMP_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Precision of the farthest end of a line, as a part of its length.
const LENGTH_PRECISION: f64 = 1.0 / 256.0;

/// Most bisections to find it.
const MOST_BISECTIONS: u32 = 44;

/// The table of `tf` over `range`: on every path of up to `lengths.longest_path` its optical depth is within
/// [`DEPTH_TOLERANCE`](super::DEPTH_TOLERANCE) or within [`DEPTH_SHARE`](super::DEPTH_SHARE) of that of the transfer function, and visible
/// colours are within [`COLOR_TOLERANCE`](super::COLOR_TOLERANCE).
///
/// Extinctions ([`OpacityValues::Extinction`]) are used unchanged, whatever `kind` and unit distance.
///
/// # Errors
/// If a length is not positive and finite or the unit distance so small that extinction overflows, an opacity is above 1 (alpha),
/// or a position is not positive on a logarithmic range.
pub fn build_node_table(
    tf: &TransferFunction,
    range: &MappedRange,
    kind: OpacityKind,
    lengths: &Lengths,
) -> Result<NodeTable, TransferError> {
    lengths.check()?;
    let kind = if tf.values() == OpacityValues::Extinction { OpacityKind::Extinction } else { kind };
    let map = RangeMap::default();
    let tolerance = Tolerance::of_paths(lengths);
    let precision = Precision { kind, tolerance: tolerance.part(CURVE_PART), where_transparent: false };
    let curve = profile(tf, &Axis::new(range, &map), &precision, lengths.unit_distance)?;
    node_table(&curve, kind, lengths.unit_distance, &tolerance)
}

/// The table of a curve: at least one point, all scalars different.
pub(super) fn node_table(
    curve: &[ProfilePoint],
    kind: OpacityKind,
    unit_distance: f64,
    tolerance: &Tolerance,
) -> Result<NodeTable, TransferError> {
    waste(Slow::NodeTable, curve.len());
    let ramps = if kind == OpacityKind::Alpha { with_ramp_ends(curve) } else { curve.to_vec() };
    let vertices = vertices(&ramps, kind, &tolerance.part(1.0 - CURVE_PART));
    let node =
        |v: &Vertex| Node { scalar: v.scalar, rgb: v.rgb.map(|c| c.clamp(0.0, 1.0)), tau: v.depth / unit_distance };
    let nodes: Vec<Node> = vertices.iter().map(node).collect();
    if nodes.iter().any(|n| !n.tau.is_finite()) {
        return Err(TransferError::BadUnitDistance(unit_distance));
    }
    Ok(NodeTable::new(nodes)?)
}

/// A node with the optical depth of a unit distance instead of extinction.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Vertex {
    scalar: f64,
    rgb: [f64; 3],
    depth: f64,
}

/// All vertices of the table, sorted by scalar.
fn vertices(curve: &[ProfilePoint], kind: OpacityKind, tolerance: &Tolerance) -> Vec<Vertex> {
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut add = |v: Vertex| {
        if vertices.last() != Some(&v) {
            vertices.push(v);
        }
    };
    let (first, last) = (curve[0], curve[curve.len() - 1]);
    // Below and above the curve its end values continue, so that opacity 1 there is an interval.
    let outside = |scalar, side: Side| Vertex { scalar, rgb: side.rgb, depth: constant_depth(side.value, kind) };
    add(outside(first.scalar, first.left));
    let kept: Vec<usize> = (0..curve.len()).filter(|&i| is_kept(curve, i)).collect();
    for pair in kept.windows(2) {
        let piece = &curve[pair[0]..=pair[1]];
        if piece[0].right.value == 0.0 && piece[piece.len() - 1].left.value == 0.0 {
            transparent_piece(piece).into_iter().for_each(&mut add);
        } else {
            Piece::new(piece, kind, *tolerance).simplify().into_iter().for_each(&mut add);
        }
    }
    add(outside(last.scalar, last.right));
    // Of the transparent vertices at each end only the innermost stays.
    let is_transparent = |v: &Vertex| v.depth == 0.0;
    let seen = |v: &Vertex| !is_transparent(v);
    let end = vertices.iter().rposition(seen).map_or(1, |i| i + 2).min(vertices.len());
    let start = vertices.iter().position(seen).map_or(0, |i| i.saturating_sub(1));
    vertices[start..end].to_vec()
}

/// Adds a point where a ramp reaches the opacity at which its depth is capped: a kink of the depth, not of the opacity.
fn with_ramp_ends(curve: &[ProfilePoint]) -> Vec<ProfilePoint> {
    let mut points = Vec::with_capacity(curve.len());
    for (i, point) in curve.iter().enumerate() {
        points.push(*point);
        let Some(next) = curve.get(i + 1) else { break };
        let (a, b) = (point.right.value, next.left.value);
        if a.min(b) < RAMP_OPACITY && RAMP_OPACITY < a.max(b) {
            let f = (RAMP_OPACITY - a) / (b - a);
            let (scalar, mixed) = (lerp(point.scalar, next.scalar, f), Side::mix(&point.right, &next.left, f));
            let side = Side { value: RAMP_OPACITY, ..mixed };
            if point.scalar < scalar && scalar < next.scalar {
                points.push(ProfilePoint { scalar, left: side, right: side });
            }
        }
    }
    points
}

/// Optical depth of a unit distance where opacity is constant over an interval.
fn constant_depth(value: f64, kind: OpacityKind) -> f64 {
    if kind == OpacityKind::Alpha && value == 1.0 { OPAQUE_DEPTH } else { kind.depth(value) }
}

/// Optical depth of a unit distance at a value of a ramp, capped at [`RAMP_DEPTH`].
fn curve_depth(value: f64, kind: OpacityKind) -> f64 {
    match kind {
        OpacityKind::Alpha => kind.depth(value).min(RAMP_DEPTH),
        OpacityKind::Extinction => value,
    }
}

/// Whether the table keeps this point of the curve: ends, steps, and where opacity stops rising or falling or has a kink.
fn is_kept(curve: &[ProfilePoint], i: usize) -> bool {
    if i == 0 || i + 1 == curve.len() || curve[i].left.value == RAMP_OPACITY {
        return true;
    }
    let (before, here, after) = (&curve[i - 1], &curve[i], &curve[i + 1]);
    let is_transparent = |a: &Side, b: &Side| a.value == 0.0 && b.value == 0.0;
    if is_transparent(&before.right, &here.left) && is_transparent(&here.right, &after.left) {
        return false; // Colours do not matter where it is transparent.
    }
    let trend = |a: &Side, b: &Side| b.value.partial_cmp(&a.value).unwrap_or(Ordering::Equal);
    here.left != here.right || trend(&before.right, &here.left) != trend(&here.right, &after.left) || {
        let slope = |a: f64, a_side: &Side, b: f64, b_side: &Side| (b_side.value - a_side.value) / (b - a);
        let rise = slope(before.scalar, &before.right, here.scalar, &here.left);
        let goes_on = slope(here.scalar, &here.right, after.scalar, &after.left);
        (rise - goes_on).abs() > KINK * rise.abs().max(goes_on.abs())
    }
}

/// The vertices of a transparent piece: its ends, with the colours of the neighbouring pieces, so that they are no steps.
fn transparent_piece(piece: &[ProfilePoint]) -> [Vertex; 2] {
    let (a, b) = (piece[0], piece[piece.len() - 1]);
    let start = Vertex { scalar: a.scalar, rgb: a.left.rgb, depth: 0.0 };
    [start, Vertex { scalar: b.scalar, rgb: b.right.rgb, depth: 0.0 }]
}

/// A place on the curve.
#[derive(Clone, Copy)]
struct Place {
    scalar: f64,
    side: Side,
    /// The largest optical depth of a unit distance between the neighbouring points of the curve.
    depth_around: f64,
}

/// A piece of the curve without steps, in which opacity only rises, only falls, or is constant.
struct Piece {
    places: Vec<Place>,
    kind: OpacityKind,
    tolerance: Tolerance,
    /// Optical depth of a unit distance, if opacity is constant.
    constant_depth: Option<f64>,
    /// Whether opacity is linear from end to end: its optical depth is then convex.
    is_ramp: bool,
}

/// Start of a line of the table: a place on the curve, and the vertex there, whose colour may be off the curve.
struct Start {
    place: Place,
    vertex: Vertex,
}

impl Piece {
    /// The points of a piece of the curve, its ends included.
    fn new(curve: &[ProfilePoint], kind: OpacityKind, tolerance: Tolerance) -> Self {
        let mut sides: Vec<Side> = curve.iter().map(|p| p.right).collect();
        let end = curve.len() - 1;
        sides[end] = curve[end].left;
        let (first, last) = (sides[0].value, sides[end].value);
        let constant_depth = (first == last).then(|| constant_depth(first, kind));
        let (from, to) = (curve[0].scalar, curve[end].scalar);
        let width = to - from;
        let rounding = RAMP_ROUNDING * (1.0 + from.abs().max(to.abs()) / width);
        let is_on_ramp = |(point, side): (&ProfilePoint, &Side)| {
            let value = lerp(first, last, (point.scalar - from) / width);
            (side.value - value).abs() <= rounding * first.max(last)
        };
        let is_ramp = kind == OpacityKind::Alpha && curve.iter().zip(&sides).all(is_on_ramp);
        let place = |i: usize| {
            let around = sides[i.saturating_sub(1)..=(i + 1).min(end)].iter();
            let depth_around = around.map(|side| curve_depth(side.value, kind)).fold(0.0, f64::max);
            Place { scalar: curve[i].scalar, side: sides[i], depth_around }
        };
        Self { places: (0..=end).map(place).collect(), kind, tolerance, constant_depth, is_ramp }
    }

    /// The vertices of this piece, both ends included.
    fn simplify(&self) -> Vec<Vertex> {
        let end = self.places.len() - 1;
        let place = self.places[0];
        let mut start = Start { place, vertex: self.vertex(&place, place.side.rgb) };
        let mut vertices = vec![start.vertex];
        let mut next = 1; // the first point behind the start
        loop {
            let reached = self.farthest_point(&start, next);
            if reached == Some(end) {
                vertices.push(self.vertex(&self.places[end], self.places[end].side.rgb));
                return vertices;
            }
            let (from, into) = reached.map_or((start.place, next), |i| (self.places[i], i + 1));
            start = self.farthest_place(&start, next, from, into);
            next = into;
            vertices.push(start.vertex);
            if start.place.scalar == self.places[into].scalar {
                next += 1;
                if into == end {
                    return vertices;
                }
            }
        }
    }

    /// The last point of the curve, from `next` on, to which a line from `start` fits; doubles its stride, then bisects.
    fn farthest_point(&self, start: &Start, next: usize) -> Option<usize> {
        let end = self.places.len() - 1;
        let fits = |i: usize| self.line_end(start, &self.places[next..i], &self.places[i], i == end).is_some();
        let (mut good, mut stride) = (None, 1);
        let mut bad = loop {
            let i = good.map_or(next, |g: usize| g + stride).min(end);
            if !fits(i) {
                break i;
            }
            if i == end {
                return Some(end);
            }
            good = Some(i);
            stride *= 2;
        };
        while let Some(g) = good
            && bad - g > 1
        {
            let middle = g + (bad - g) / 2;
            if fits(middle) { good = Some(middle) } else { bad = middle }
        }
        good
    }

    /// The farthest place between `from` (the start, or a point to which a line fits) and point `into` to which a line from
    /// `start` fits.
    fn farthest_place(&self, start: &Start, next: usize, from: Place, into: usize) -> Start {
        let to = self.places[into];
        let depth_around = curve_depth(from.side.value.max(to.side.value), self.kind);
        let between = |scalar: f64, f: f64| Place { scalar, side: Side::mix(&from.side, &to.side, f), depth_around };
        let at = |f: f64| between(lerp(from.scalar, to.scalar, f), f);
        let line_to = |f: f64| self.line_end(start, &self.places[next..into], &at(f), false);
        let (mut good, mut bad) = (0.0, 1.0);
        let offset = (from.scalar - start.place.scalar) / (to.scalar - from.scalar);
        for _ in 0..MOST_BISECTIONS {
            if bad - good <= (offset + good) * LENGTH_PRECISION {
                break;
            }
            let middle = 0.5 * (good + bad);
            if line_to(middle).is_some() { good = middle } else { bad = middle }
        }
        let here = start.place.scalar;
        let shortest = here.next_up().max(here + SHORTEST * here.abs());
        if let Some(rgb) = line_to(good).filter(|_| at(good).scalar >= shortest.min(to.scalar)) {
            return Start { place: at(good), vertex: self.vertex(&at(good), rgb) };
        }
        // No f64 scalar lies between the start and the farthest place: the shortest line is taken.
        let share = (shortest - from.scalar) / (to.scalar - from.scalar);
        let place = if shortest < to.scalar { between(shortest, share) } else { to };
        Start { place, vertex: self.vertex(&place, place.side.rgb) }
    }

    fn vertex(&self, place: &Place, rgb: [f64; 3]) -> Vertex {
        let depth = self.constant_depth.unwrap_or_else(|| self.depth(place));
        Vertex { scalar: place.scalar, rgb, depth }
    }

    /// Optical depth of a node: on the curve at the ends of the piece; lower in between where lines lie above the curve.
    fn depth(&self, place: &Place) -> f64 {
        let depth = curve_depth(place.side.value, self.kind);
        let ends = [0, self.places.len() - 1].map(|end| self.places[end].scalar);
        if !self.is_ramp || ends.contains(&place.scalar) {
            return depth;
        }
        let tolerance = self.tolerance.depth.max(self.tolerance.share * depth);
        (depth - BELOW * tolerance).max(0.0)
    }

    /// The colour at place `b` of a line from `start` that passes the points `between` within tolerance, if there is one: that of the curve
    /// if possible (with `exact`, only that), otherwise the nearest to it.
    fn line_end(&self, start: &Start, between: &[Place], b: &Place, exact: bool) -> Option<[f64; 3]> {
        let (a, end_depth) = (start.vertex, self.vertex(b, b.side.rgb).depth);
        let width = b.scalar - a.scalar;
        if width <= 0.0 {
            return None;
        }
        // Per channel the range of colours at b whose line passes all points within tolerance.
        let (mut least, mut most) = ([0.0_f64; 3], [1.0_f64; 3]);
        let mut previous = (a.depth, start.place.side.value);
        for place in between.iter().chain([b]) {
            let f = (place.scalar - a.scalar) / width;
            // Errors of colours are linear from place to place, and so within that of the largest depth in between.
            let tolerance = self.tolerance.of_color(place.depth_around);
            for c in 0..3 {
                let off = place.side.rgb[c] - a.rgb[c];
                least[c] = least[c].max(a.rgb[c] + (off - tolerance) / f);
                most[c] = most[c].min(a.rgb[c] + (off + tolerance) / f);
            }
            let here = (lerp(a.depth, end_depth, f), place.side.value);
            let opacity_fits = self.constant_depth.is_some() || self.opacity_fits(previous, here);
            if !opacity_fits || (0..3).any(|c| least[c] > most[c]) {
                return None;
            }
            previous = here;
        }
        let rgb = std::array::from_fn(|c| b.side.rgb[c].clamp(least[c], most[c]));
        (!exact || rgb == b.side.rgb).then_some(rgb)
    }

    /// Whether between two neighbouring places the line's depth, from `a.0` to `b.0`, fits the curve's value, from `a.1` to `b.1`; both are
    /// linear there. Either the absolute or the relative tolerance must hold throughout.
    fn opacity_fits(&self, a: (f64, f64), b: (f64, f64)) -> bool {
        self.is_within(a, b, self.tolerance.depth, 0.0) || self.is_within(a, b, 0.0, self.tolerance.share)
    }

    /// Whether the line is nowhere off the curve's depth d by more than `absolute + share * d`.
    ///
    /// The line is farthest below the curve at an end, since d is linear or convex. For opacities it may be farthest above also at the one
    /// stationary point of the difference: where (1 + share) d' = line', and d' = a' / (1 - a).
    fn is_within(&self, a: (f64, f64), b: (f64, f64), absolute: f64, share: f64) -> bool {
        let fits = |(line, value): (f64, f64)| {
            let depth = curve_depth(value, self.kind);
            (line - depth).abs() <= absolute + share * depth
        };
        let inner_fits = || {
            let (rise_of_depth, rise_of_opacity) = (b.0 - a.0, b.1 - a.1);
            let opacity = 1.0 - (1.0 + share) * rise_of_opacity / rise_of_depth;
            let f = (opacity - a.1) / rise_of_opacity;
            !(f > 0.0 && f < 1.0) || fits((lerp(a.0, b.0, f), opacity))
        };
        fits(a) && fits(b) && (self.kind == OpacityKind::Extinction || inner_fits())
    }
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;

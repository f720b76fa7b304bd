//! From a transfer function to the fewest nodes that follow it.
//!
//! The curve ([`profile`](super::profile)) is cut at its *kept* points: steps, ends, and each point at which opacity stops
//! rising or falling. So no spike is lost, however low or narrow, and extinction is zero exactly where the curve is. In a
//! piece between two of them the table goes, from a node on the curve, to the farthest place on the curve to which a
//! straight line stays within [`TOLERANCE`] of it everywhere; that place is the next node. Whether it does is decided
//! without sampling: colours are compared at the points of the curve (those of a node may be off it by the tolerance, which
//! makes lines longer by up to the square root of two); opacity 1 - exp(-tau u) of the line against opacity of
//! the curve also at the one place between two points where their difference is stationary, which has a closed form.
//!
//! Opacity 1 would be infinite extinction. Where it holds over an interval the table has [`OPAQUE_DEPTH`]; where the curve
//! only touches it, extinction ends at [`RAMP_DEPTH`].

use super::TransferError;
use super::color_map::lerp;
use super::function::{OpacityValues, TransferFunction};
use super::profile::{AXIS_TOLERANCE, Axis, Precision, ProfilePoint, Side, profile};
use super::range::MappedRange;
use super::range_map::RangeMap;
use crate::node_table::{Node, NodeTable};
use crate::slowdown::{Slow, waste};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

/// What the values of opacity points mean, a, over the unit distance u.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OpacityKind {
    /// a is the opacity of a layer of thickness u, 0..=1; between two points opacity is linear. tau = -ln(1 - a) / u.
    #[default]
    Alpha,
    /// a is the optical depth of such a layer, unbounded; between two points extinction is linear. tau = a / u. This is
    /// what the unstructured-grid mappers of VTK and ParaView do.
    Extinction,
}

impl fmt::Display for OpacityKind {
    /// As it is read.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Alpha => "alpha",
            Self::Extinction => "extinction",
        })
    }
}

impl FromStr for OpacityKind {
    type Err = TransferError;

    fn from_str(text: &str) -> Result<Self, TransferError> {
        match text {
            "alpha" => Ok(Self::Alpha),
            "extinction" => Ok(Self::Extinction),
            _ => Err(TransferError::BadText {
                part: text.to_owned(),
                problem: "is no opacity kind; known are alpha and extinction".to_owned(),
            }),
        }
    }
}

/// How far a table may be from its transfer function: 2^-12 in each colour channel, and 2^-12 in the opacity of a unit
/// distance (alpha) or 2^-12 (1 + tau u) in the optical depth tau u of one (extinction).
pub const TOLERANCE: f64 = 1.0 / 4096.0;

/// Optical depth of a unit distance where opacity is 1 over an interval. So large that a ray that meets the interval at all is
/// opaque: with 2^20 a ray that clipped an edge of the mesh for 1.5e-6 of a unit distance had an opacity of 0.8 that hung on the tenth
/// digit of its length, which single precision does not have.
const OPAQUE_DEPTH: f64 = (1u64 << 40) as f64;

/// Largest optical depth of a unit distance elsewhere: a transmittance of 2^-24, the last that an opacity in f32 tells
/// from none.
const RAMP_DEPTH: f64 = 24.0 * std::f64::consts::LN_2;

/// What is left of the tolerance after the refinement of a logarithmic axis.
const LINE_TOLERANCE: f64 = TOLERANCE - AXIS_TOLERANCE;

/// Bisections that find the farthest end of a line inside a piece of the curve.
const BISECTIONS: u32 = 24;

/// The table of `tf` over `range`, for world units in which `unit_distance` is the length that opacities refer to (by
/// default 1 % of the diagonal of the mesh's bounding box).
///
/// Values of the transfer function that are extinctions already ([`OpacityValues::Extinction`]) are taken as they are,
/// whatever `kind` and `unit_distance`.
///
/// # Errors
/// If the unit distance is not positive and finite or so small that extinction overflows, an opacity is above 1 (alpha), or
/// a position is not positive on a logarithmic range.
pub fn build_node_table(
    tf: &TransferFunction,
    range: &MappedRange,
    kind: OpacityKind,
    unit_distance: f64,
) -> Result<NodeTable, TransferError> {
    check_unit_distance(unit_distance)?;
    let kind = if tf.values() == OpacityValues::Extinction { OpacityKind::Extinction } else { kind };
    let map = RangeMap::default();
    let precision = Precision { kind, tolerance: AXIS_TOLERANCE, where_clear: false };
    let curve = profile(tf, &Axis::new(range, &map), &precision, unit_distance)?;
    node_table(&curve, kind, unit_distance)
}

fn check_unit_distance(unit_distance: f64) -> Result<(), TransferError> {
    let is_usable = unit_distance > 0.0 && unit_distance.is_finite() && (OPAQUE_DEPTH / unit_distance).is_finite();
    if is_usable { Ok(()) } else { Err(TransferError::BadUnitDistance(unit_distance)) }
}

/// The table of a curve: at least one point, all scalars different.
pub(super) fn node_table(
    curve: &[ProfilePoint],
    kind: OpacityKind,
    unit_distance: f64,
) -> Result<NodeTable, TransferError> {
    check_unit_distance(unit_distance)?;
    waste(Slow::NodeTable, curve.len());
    let vertices = vertices(curve, kind);
    let node =
        |v: &Vertex| Node { scalar: v.scalar, rgb: v.rgb.map(|c| c.clamp(0.0, 1.0)), tau: v.depth / unit_distance };
    let nodes: Vec<Node> = vertices.iter().map(node).collect();
    if nodes.iter().any(|n| !n.tau.is_finite()) {
        return Err(TransferError::BadUnitDistance(unit_distance));
    }
    Ok(NodeTable::new(nodes)?)
}

/// A node with the optical depth of a unit distance in place of extinction.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Vertex {
    scalar: f64,
    rgb: [f64; 3],
    depth: f64,
}

/// All vertices of the table, sorted by scalar.
fn vertices(curve: &[ProfilePoint], kind: OpacityKind) -> Vec<Vertex> {
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut add = |v: Vertex| {
        if vertices.last() != Some(&v) {
            vertices.push(v);
        }
    };
    let (first, last) = (curve[0], curve[curve.len() - 1]);
    // Below and above the curve its end values hold on, so that opacity 1 there is an interval.
    let outside = |scalar, side: Side| Vertex { scalar, rgb: side.rgb, depth: constant_depth(side.value, kind) };
    add(outside(first.scalar, first.left));
    let kept: Vec<usize> = (0..curve.len()).filter(|&i| is_kept(curve, i)).collect();
    for pair in kept.windows(2) {
        let piece = &curve[pair[0]..=pair[1]];
        if piece[0].right.value == 0.0 && piece[piece.len() - 1].left.value == 0.0 {
            clear_piece(piece).into_iter().for_each(&mut add);
        } else {
            Piece::new(piece, kind).simplify().into_iter().for_each(&mut add);
        }
    }
    add(outside(last.scalar, last.right));
    // Where nothing is seen, one vertex says so.
    let is_clear = |v: &Vertex| v.depth == 0.0;
    let seen = |v: &Vertex| !is_clear(v);
    let end = vertices.iter().rposition(seen).map_or(1, |i| i + 2).min(vertices.len());
    let start = vertices.iter().position(seen).map_or(0, |i| i.saturating_sub(1));
    vertices[start..end].to_vec()
}

/// Optical depth of a unit distance where opacity is constant over an interval.
fn constant_depth(value: f64, kind: OpacityKind) -> f64 {
    match kind {
        OpacityKind::Alpha if value == 1.0 => OPAQUE_DEPTH,
        OpacityKind::Alpha => -(-value).ln_1p(),
        OpacityKind::Extinction => value,
    }
}

/// Whether the table keeps this point of the curve: ends, steps, and where opacity stops rising or falling.
fn is_kept(curve: &[ProfilePoint], i: usize) -> bool {
    if i == 0 || i + 1 == curve.len() {
        return true;
    }
    let (before, here, after) = (&curve[i - 1], &curve[i], &curve[i + 1]);
    let is_clear = |a: &Side, b: &Side| a.value == 0.0 && b.value == 0.0;
    if is_clear(&before.right, &here.left) && is_clear(&here.right, &after.left) {
        return false; // Colours do not matter there.
    }
    let trend = |a: &Side, b: &Side| b.value.partial_cmp(&a.value).unwrap_or(Ordering::Equal);
    here.left != here.right || trend(&before.right, &here.left) != trend(&here.right, &after.left)
}

/// The vertices of a piece without opacity: its ends, in the colours of the pieces next to it, so that they are no steps.
fn clear_piece(piece: &[ProfilePoint]) -> [Vertex; 2] {
    let (a, b) = (piece[0], piece[piece.len() - 1]);
    let start = Vertex { scalar: a.scalar, rgb: a.left.rgb, depth: 0.0 };
    [start, Vertex { scalar: b.scalar, rgb: b.right.rgb, depth: 0.0 }]
}

/// A place on the curve: scalar and side.
type Place = (f64, Side);

/// A piece of the curve without steps, in which opacity only rises, only falls, or is constant.
struct Piece {
    places: Vec<Place>,
    kind: OpacityKind,
    /// Depth where opacity is constant: the table's is the same.
    constant_depth: Option<f64>,
}

/// Where a line of the table starts: a place on the curve, and the vertex there, whose colour may be off it.
struct Start {
    place: Place,
    vertex: Vertex,
}

impl Piece {
    /// The points of a piece of the curve, its ends included.
    fn new(curve: &[ProfilePoint], kind: OpacityKind) -> Self {
        let mut places: Vec<Place> = curve.iter().map(|p| (p.scalar, p.right)).collect();
        let end = curve.len() - 1;
        places[end].1 = curve[end].left;
        let (first, last) = (places[0].1.value, places[end].1.value);
        let constant_depth = (first == last).then(|| constant_depth(first, kind));
        Self { places, kind, constant_depth }
    }

    /// The vertices of this piece, both ends included.
    fn simplify(&self) -> Vec<Vertex> {
        let end = self.places.len() - 1;
        let place = self.places[0];
        let mut start = Start { place, vertex: self.vertex(&place, place.1.rgb) };
        let mut vertices = vec![start.vertex];
        let mut next = 1; // the first point behind the start
        loop {
            let reached = self.farthest_point(&start, next);
            if reached == Some(end) {
                vertices.push(self.vertex(&self.places[end], self.places[end].1.rgb));
                return vertices;
            }
            let (from, into) = reached.map_or((start.place, next), |i| (self.places[i], i + 1));
            start = self.farthest_place(&start, next, from, into);
            next = into;
            vertices.push(start.vertex);
            if start.place.0 == self.places[into].0 {
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
        let at = |f: f64| (lerp(from.0, to.0, f), Side::mix(&from.1, &to.1, f));
        let line_to = |f: f64| self.line_end(start, &self.places[next..into], &at(f), false);
        let (mut good, mut bad) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (good + bad);
            if line_to(middle).is_some() { good = middle } else { bad = middle }
        }
        if let Some(rgb) = line_to(good).filter(|_| at(good).0 > start.place.0) {
            return Start { place: at(good), vertex: self.vertex(&at(good), rgb) };
        }
        // No double lies between the start and the farthest place: the table takes the next one.
        let scalar = start.place.0.next_up();
        let place = if scalar < to.0 { (scalar, at((scalar - from.0) / (to.0 - from.0)).1) } else { to };
        Start { place, vertex: self.vertex(&place, place.1.rgb) }
    }

    fn vertex(&self, &(scalar, side): &Place, rgb: [f64; 3]) -> Vertex {
        let depth = self.constant_depth.unwrap_or_else(|| match self.kind {
            OpacityKind::Alpha => (-(-side.value).ln_1p()).min(RAMP_DEPTH),
            OpacityKind::Extinction => side.value,
        });
        Vertex { scalar, rgb, depth }
    }

    /// The colour at place `b` of a line from `start` that passes the points `between` within tolerance, if there is one:
    /// that of the curve if possible (and if `exact`, nothing else), otherwise the nearest to it.
    fn line_end(&self, start: &Start, between: &[Place], b: &Place, exact: bool) -> Option<[f64; 3]> {
        let (a, end_depth) = (start.vertex, self.vertex(b, b.1.rgb).depth);
        let width = b.0 - a.scalar;
        if width <= 0.0 {
            return None;
        }
        // Per channel the colours at b whose line passes all points within tolerance.
        let (mut least, mut most) = ([0.0_f64; 3], [1.0_f64; 3]);
        let mut previous = (a.depth, start.place.1.value);
        for place in between.iter().chain([b]) {
            let f = (place.0 - a.scalar) / width;
            for c in 0..3 {
                let off = place.1.rgb[c] - a.rgb[c];
                least[c] = least[c].max(a.rgb[c] + (off - LINE_TOLERANCE) / f);
                most[c] = most[c].min(a.rgb[c] + (off + LINE_TOLERANCE) / f);
            }
            let here = (lerp(a.depth, end_depth, f), place.1.value);
            let opacity_fits = self.constant_depth.is_some() || self.opacity_fits(previous, here);
            if !opacity_fits || (0..3).any(|c| least[c] > most[c]) {
                return None;
            }
            previous = here;
        }
        let rgb = std::array::from_fn(|c| b.1.rgb[c].clamp(least[c], most[c]));
        (!exact || rgb == b.1.rgb).then_some(rgb)
    }

    /// Whether between two neighbouring places the line's depth, from `a.0` to `b.0`, fits the curve's value, from `a.1` to
    /// `b.1`; both are linear there.
    fn opacity_fits(&self, a: (f64, f64), b: (f64, f64)) -> bool {
        match self.kind {
            // Both sides of the comparison are linear, so the ends decide.
            OpacityKind::Extinction => {
                [a, b].iter().all(|(line, curve)| (line - curve).abs() <= LINE_TOLERANCE * (1.0 + curve))
            }
            OpacityKind::Alpha => {
                let error = |(depth, opacity): (f64, f64)| ((-depth).exp() - (1.0 - opacity)).abs();
                let (rise_of_depth, rise_of_opacity) = (b.0 - a.0, b.1 - a.1);
                // d exp(-depth) = d (1 - opacity): the transmittance at which the difference is stationary.
                let stationary = -(rise_of_opacity / rise_of_depth).ln();
                let f = (stationary - a.0) / rise_of_depth;
                let inner = (stationary, a.1 + f * rise_of_opacity);
                let inner_fits = !(f > 0.0 && f < 1.0) || error(inner) <= LINE_TOLERANCE;
                error(a) <= LINE_TOLERANCE && error(b) <= LINE_TOLERANCE && inner_fits
            }
        }
    }
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;

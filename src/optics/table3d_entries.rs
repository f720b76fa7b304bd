//! Computation of the entries of a pre-integrated table: mean extinction and colour of segments, from exact pieces.

use super::{Accumulator, piece_weights};
use crate::node_table::Node;
use glam::Vec4;

/// Largest extinction per unit of length, 2^120; larger ones are equally opaque. Its product with a length, and its reciprocal, are normal
/// f32 numbers.
pub(super) const TAU_MAX: f64 = 1.329_227_995_784_916e36;

/// Below this optical depth a segment is treated as of length zero: its colour differs by at most half of it.
const DEPTH_MIN: f64 = 1e-7;

/// The entry (tau r, tau g, tau b, tau) of a node.
fn entry(n: &Node) -> Vec4 {
    Vec4::new((n.rgb[0] * n.tau) as f32, (n.rgb[1] * n.tau) as f32, (n.rgb[2] * n.tau) as f32, n.tau as f32)
}

/// The entries of a constant segment just below and just above a scalar.
pub(super) struct Limits {
    pub(super) left: Vec4,
    pub(super) right: Vec4,
}

impl Limits {
    pub(super) fn at(nodes: &[Node], scalar: f64) -> Self {
        let before = nodes.partition_point(|n| n.scalar < scalar);
        let after = nodes.partition_point(|n| n.scalar <= scalar);
        Self { left: entry(&between(nodes, before, scalar)), right: entry(&between(nodes, after, scalar)) }
    }
}

/// The table at a scalar in the interval before node `after`, or behind the last node.
fn between(nodes: &[Node], after: usize, scalar: f64) -> Node {
    match (after.checked_sub(1).map(|i| &nodes[i]), nodes.get(after)) {
        (Some(lo), Some(hi)) if hi.scalar > lo.scalar => Node::lerp(lo, hi, scalar),
        (Some(n), _) | (None, Some(n)) => *n,
        (None, None) => Node { scalar, rgb: [0.0; 3], tau: 0.0 },
    }
}

/// A part of a segment on which the table is linear: its share of the length and the table at its ends.
struct Piece {
    share: f64,
    near: Node,
    far: Node,
}

/// The pieces of a segment from `s0` to a different `s1`, in order.
fn pieces(nodes: &[Node], s0: f64, s1: f64, out: &mut Vec<Piece>) {
    out.clear();
    let (lo, hi) = (s0.min(s1), s0.max(s1));
    let mut after = nodes.partition_point(|n| n.scalar <= lo);
    let mut from = lo;
    while from < hi {
        let to = nodes.get(after).map_or(hi, |n| n.scalar.min(hi));
        if to > from {
            let (near, far) = (between(nodes, after, from), between(nodes, after, to));
            out.push(Piece { share: (to - from) / (hi - lo), near, far });
        }
        from = to;
        after += 1;
    }
    if s1 < s0 {
        out.reverse();
        out.iter_mut().for_each(|p| std::mem::swap(&mut p.near, &mut p.far));
    }
}

/// Computes entries of all `s0` in `scalars` for one `s1`, those of one `s0` side by side, one for each of `lengths`; only for segments
/// that meet the scalars from `changed.0` to `changed.1`. Returns how many these are.
pub(super) fn fill_row(
    nodes: &[Node],
    scalars: &[f64],
    s1: f64,
    lengths: &[f64],
    changed: (f64, f64),
    row: &mut [Vec4],
) -> usize {
    let mut found = Vec::new();
    let mut filled = 0;
    let meets = |s0: f64| s0.min(s1) <= changed.1 && s0.max(s1) >= changed.0;
    for (&s0, entries) in scalars.iter().zip(row.chunks_exact_mut(lengths.len())).filter(|(s0, _)| meets(**s0)) {
        filled += entries.len();
        if s0 == s1 {
            entries.fill(diagonal(nodes, scalars, s0));
            continue;
        }
        pieces(nodes, s0, s1, &mut found);
        let short = without_length(&found);
        for (entry, &length) in entries.iter_mut().zip(lengths) {
            *entry = of_length(&found, short, length);
        }
    }
    filled
}

/// The entry of a constant segment: at a step the mean of both sides, at the ends of the range the inner side.
fn diagonal(nodes: &[Node], scalars: &[f64], scalar: f64) -> Vec4 {
    let Limits { left, right } = Limits::at(nodes, scalar);
    if scalar == scalars[0] {
        right
    } else if scalar == scalars[scalars.len() - 1] {
        left
    } else {
        0.5 * (left + right)
    }
}

/// The entry for length zero: the means of colour times extinction (products of two linear functions) and of extinction.
fn without_length(pieces: &[Piece]) -> Vec4 {
    let mut sum = [0.0; 4];
    for Piece { share, near, far } in pieces {
        for (c, sum) in sum.iter_mut().take(3).enumerate() {
            let (a, b) = (near.rgb[c], far.rgb[c]);
            *sum += share / 6.0 * (a * (2.0 * near.tau + far.tau) + b * (near.tau + 2.0 * far.tau));
        }
        sum[3] += share * 0.5 * (near.tau + far.tau);
    }
    Vec4::from_array(sum.map(|v| v as f32))
}

/// The entry of a length, given the one of length zero: its mean extinction, times the colour of the pieces.
fn of_length(pieces: &[Piece], short: Vec4, length: f64) -> Vec4 {
    let mean = f64::from(short.w);
    if mean * length < DEPTH_MIN {
        return short;
    }
    let mut light = Accumulator::TRANSPARENT;
    let color = |n: &Node| Vec4::new(n.rgb[0] as f32, n.rgb[1] as f32, n.rgb[2] as f32, 1.0);
    for Piece { share, near, far } in pieces {
        let depth = |n: &Node| (n.tau * share * length).min(TAU_MAX) as f32;
        let weights = piece_weights(depth(near), depth(far));
        light.add(weights, color(near), color(far));
        if light.is_opaque() {
            break;
        }
    }
    // Colour channels and opacity are sums with the same weights: if all have one colour, the quotient is that colour.
    let [r, g, b, alpha] = light.pixel();
    if alpha > 0.0 { (Vec4::new(r, g, b, alpha) * (short.w / alpha)).with_w(short.w) } else { short }
}

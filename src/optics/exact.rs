//! The exact integrator: segments are split at the nodes of the transfer function, each piece integrated by
//! [`piece_weights`](super::piece_weights).
//!
//! Along a ray the scalar is continuous, so the interval of the table that holds it is known from the segment before:
//! [`ExactRay`] walks up and down the intervals and never searches. The values of table and scalar at the end of a piece
//! are those at the start of the next.

use super::{Accumulator, piece_weights};
use crate::node_table::NodeTable;

/// One interval of a piecewise linear table in the form `value(s) = base + slope * (s - lo)`.
#[derive(Clone, Copy, Debug)]
struct Interval {
    /// Scalars from `lo` to `hi`; the first and last interval reach to infinity.
    lo: f64,
    hi: f64,
    /// Where the linear form is anchored: the finite end of the interval.
    anchor: f64,
    /// Red, green, blue, extinction at the anchor.
    base: [f64; 4],
    slope: [f64; 4],
    /// Extinction is zero throughout.
    clear: bool,
}

/// A [`NodeTable`] prepared for integration along rays, extinction per unit of the ray's length parameter.
#[derive(Clone, Debug)]
pub struct ExactTable {
    intervals: Vec<Interval>,
}

impl ExactTable {
    /// Prepares `table`; `world_per_length` is the world length of one unit in which segment lengths will be given.
    pub fn new(table: &NodeTable, world_per_length: f64) -> Self {
        let nodes = table.nodes();
        let value = |i: usize| {
            let n = &nodes[i];
            [n.rgb[0], n.rgb[1], n.rgb[2], n.tau * world_per_length]
        };
        let constant = |lo, hi, i: usize| {
            let base = value(i);
            Interval { lo, hi, anchor: nodes[i].scalar, base, slope: [0.0; 4], clear: base[3] == 0.0 }
        };
        let last = nodes.len() - 1;
        let mut intervals = vec![constant(f64::NEG_INFINITY, nodes[0].scalar, 0)];
        for i in 0..last {
            let (lo, hi) = (nodes[i].scalar, nodes[i + 1].scalar);
            if hi > lo {
                let (base, end) = (value(i), value(i + 1));
                let slope = std::array::from_fn(|c| (end[c] - base[c]) / (hi - lo));
                intervals.push(Interval { lo, hi, anchor: lo, base, slope, clear: base[3] == 0.0 && end[3] == 0.0 });
            }
        }
        intervals.push(constant(nodes[last].scalar, f64::INFINITY, last));
        Self { intervals }
    }

    /// Whether any scalar has extinction.
    pub fn is_clear(&self) -> bool {
        self.intervals.iter().all(|i| i.clear)
    }
}

/// What is known of the ray's position in the table.
#[derive(Clone, Copy, Debug)]
pub struct ExactRay {
    interval: usize,
}

impl ExactRay {
    /// A ray that enters the volume at a place with this scalar.
    #[inline]
    pub fn enter(table: &ExactTable, scalar: f64) -> Self {
        Self { interval: table.intervals.partition_point(|i| i.hi <= scalar) }
    }

    /// Composites a segment of length `length` (> 0) along which the scalar goes linearly from `s0` to `s1` (both finite).
    /// `s0` is the scalar at which the ray entered or the `s1` of the segment before. Returns the number of pieces that
    /// were integrated.
    #[inline]
    pub fn segment(&mut self, table: &ExactTable, s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        let mut pieces = 0;
        let mut s = s0;
        let mut piece = |interval: &Interval, from: f64, to: f64, length: f64| {
            if interval.clear || length <= 0.0 {
                return;
            }
            let at = |s: f64| -> [f32; 4] {
                let d = s - interval.anchor;
                std::array::from_fn(|c| (interval.base[c] + interval.slope[c] * d) as f32)
            };
            let (near, far, length) = (at(from), at(to), length as f32);
            // Rounding may leave a tiny negative extinction where a ramp reaches zero.
            let weights = piece_weights((near[3] * length).max(0.0), (far[3] * length).max(0.0));
            out.add(weights, [near[0], near[1], near[2]], [far[0], far[1], far[2]]);
            pieces += 1;
        };
        if s1 >= s0 {
            while s >= table.intervals[self.interval].hi {
                self.interval += 1;
            }
            let per_scalar = if s1 > s0 { length / (s1 - s0) } else { 0.0 };
            while s1 > table.intervals[self.interval].hi {
                let interval = &table.intervals[self.interval];
                piece(interval, s, interval.hi, (interval.hi - s) * per_scalar);
                s = interval.hi;
                self.interval += 1;
            }
            let rest = if s == s0 { length } else { (s1 - s) * per_scalar };
            piece(&table.intervals[self.interval], s, s1, rest);
        } else {
            while s <= table.intervals[self.interval].lo {
                self.interval -= 1;
            }
            let per_scalar = length / (s0 - s1);
            while s1 < table.intervals[self.interval].lo {
                let interval = &table.intervals[self.interval];
                piece(interval, s, interval.lo, (s - interval.lo) * per_scalar);
                s = interval.lo;
                self.interval -= 1;
            }
            let rest = if s == s0 { length } else { (s - s1) * per_scalar };
            piece(&table.intervals[self.interval], s, s1, rest);
        }
        pieces
    }
}

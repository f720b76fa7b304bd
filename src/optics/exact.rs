//! The exact integrator: segments are split at the nodes of the transfer function, each piece integrated by
//! [`piece_weights`].
//!
//! Along a ray the scalar is continuous, so the interval of the table that holds it is known from the segment before:
//! [`ExactRay`] walks up and down the intervals and never searches. The values of table and scalar at the end of a piece
//! are those at the start of the next.

use super::{Accumulator, Integrator, ScalarMap, piece_weights};
use crate::node_table::{Node, NodeTable};
use glam::Vec4;

/// Colour (red, green, blue, 1) and extinction per unit of length at one scalar.
#[derive(Clone, Copy, Debug)]
struct Optical {
    color: Vec4,
    tau: f32,
}

/// One interval of a piecewise linear table.
#[derive(Clone, Copy, Debug)]
struct Interval {
    /// Scalars from `lo` to `hi`; the first and last interval reach to infinity and are constant.
    lo: f64,
    hi: f64,
    /// 1 / (hi - lo), or 0 where constant.
    per_width: f64,
    at_lo: Optical,
    /// Value at `hi` less that at `lo`.
    rise: Optical,
    /// Extinction is zero throughout.
    clear: bool,
}

impl Interval {
    fn new(lo: f64, hi: f64, a: &Node, b: &Node, world_per_length: f64) -> Self {
        let color = |n: &Node| Vec4::new(n.rgb[0] as f32, n.rgb[1] as f32, n.rgb[2] as f32, 1.0);
        // The largest extinction that stays finite when it is averaged.
        let tau = |n: &Node| (n.tau * world_per_length).min(f64::from(f32::MAX / 4.0)) as f32;
        let at_lo = Optical { color: color(a), tau: tau(a) };
        let rise = Optical { color: color(b) - at_lo.color, tau: tau(b) - at_lo.tau };
        let per_width = if lo.is_finite() && hi.is_finite() { 1.0 / (hi - lo) } else { 0.0 };
        Self { lo, hi, per_width, at_lo, rise, clear: a.tau == 0.0 && b.tau == 0.0 }
    }

    #[inline]
    fn at(&self, scalar: f64) -> Optical {
        let share = if self.per_width == 0.0 { 0.0 } else { ((scalar - self.lo) * self.per_width) as f32 };
        Optical { color: self.at_lo.color + self.rise.color * share, tau: self.at_lo.tau + self.rise.tau * share }
    }
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
        let (first, last) = (&nodes[0], &nodes[nodes.len() - 1]);
        let mut intervals = vec![Interval::new(f64::NEG_INFINITY, first.scalar, first, first, world_per_length)];
        for pair in nodes.windows(2).filter(|pair| pair[1].scalar > pair[0].scalar) {
            intervals.push(Interval::new(pair[0].scalar, pair[1].scalar, &pair[0], &pair[1], world_per_length));
        }
        intervals.push(Interval::new(last.scalar, f64::INFINITY, last, last, world_per_length));
        Self { intervals }
    }

    /// The share (0..=1) of a segment from scalar `s0` to `s1` before its first piece with extinction; 1 if there is none.
    pub fn clear_share(&self, s0: f64, s1: f64) -> f64 {
        // As the walk along the segment: at a node the side that it goes to holds.
        let share = |s: f64| if s1 == s0 { 0.0 } else { ((s - s0) / (s1 - s0)).clamp(0.0, 1.0) };
        if s1 >= s0 {
            let first = self.intervals.partition_point(|i| i.hi <= s0);
            let visible = self.intervals[first..].iter().take_while(|i| i.lo < s1 || i.lo <= s0).find(|i| !i.clear);
            visible.map_or(1.0, |i| share(i.lo.max(s0)))
        } else {
            let end = self.intervals.partition_point(|i| i.lo < s0);
            let visible = self.intervals[..end].iter().rev().take_while(|i| i.hi > s1).find(|i| !i.clear);
            visible.map_or(1.0, |i| share(i.hi.min(s0)))
        }
    }

    /// The table as `shaders/lib/optics_exact.wgsl` reads it, over scalars seen through `map`: per interval (lo, hi,
    /// width, 1 / width or 0), colour and extinction at lo, their rise to hi. Widths are those before rounding: an
    /// interval too narrow for f32 at its place still has one.
    pub fn packed(&self, map: ScalarMap) -> Vec<[f32; 4]> {
        const FAR: f64 = 3e38;
        let vector = |o: &Optical| [o.color.x, o.color.y, o.color.z, o.tau];
        let pack = |i: &Interval| {
            let [lo, hi] = [i.lo, i.hi].map(|s| map.apply(s).clamp(-FAR, FAR) as f32);
            let width = if i.per_width == 0.0 { 0.0 } else { (i.hi - i.lo) * map.prescale * map.scale };
            let per_width = if width > 0.0 { 1.0 / width } else { 0.0 };
            [[lo, hi, width as f32, per_width.min(FAR) as f32], vector(&i.at_lo), vector(&i.rise)]
        };
        self.intervals.iter().flat_map(pack).collect()
    }

    /// Whether no scalar has extinction.
    pub fn is_clear(&self) -> bool {
        self.intervals.iter().all(|i| i.clear)
    }
}

/// What is known of a ray's place in the table: the interval, and the values at the scalar where its last segment ended.
#[derive(Clone, Copy, Debug)]
pub struct ExactRay {
    interval: usize,
    here: Optical,
}

impl ExactRay {
    /// A ray that enters the volume at a place with this scalar.
    #[inline]
    pub fn enter(table: &ExactTable, scalar: f64) -> Self {
        let interval = table.intervals.partition_point(|i| i.hi <= scalar);
        Self { interval, here: table.intervals[interval].at(scalar) }
    }

    /// Composites a segment of length `length` (> 0) along which the scalar goes linearly from `s0` to `s1` (both finite).
    /// `s0` is the scalar at which the ray entered or the `s1` of the segment before. Returns the number of pieces that
    /// were integrated.
    #[inline(always)]
    pub fn segment(&mut self, table: &ExactTable, s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        let intervals = table.intervals.as_slice();
        let interval = &intervals[self.interval];
        // The usual case: no node on the way.
        if s1 < interval.hi && s1 > interval.lo && s0 < interval.hi {
            return self.piece(interval, s1, length, out);
        }
        self.across_nodes(intervals, s0, s1, length, out)
    }

    #[inline(always)]
    fn piece(&mut self, interval: &Interval, to: f64, length: f64, out: &mut Accumulator) -> u64 {
        let near = self.here;
        self.here = interval.at(to);
        if interval.clear {
            return 0;
        }
        let (far, length) = (self.here, length as f32);
        // Rounding may leave a tiny negative extinction where a ramp reaches zero.
        let weights = piece_weights((near.tau * length).max(0.0), (far.tau * length).max(0.0));
        out.add(weights, near.color, far.color);
        1
    }

    #[inline]
    fn across_nodes(&mut self, intervals: &[Interval], s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        let mut pieces = 0;
        let mut s = s0;
        let mut rest = length;
        if s1 >= s0 {
            // At a node the side that the ray goes to holds; a constant segment takes the right one.
            while s >= intervals[self.interval].hi {
                self.move_to(intervals, self.interval + 1, s);
            }
            let per_scalar = if s1 > s0 { length / (s1 - s0) } else { 0.0 };
            while s1 > intervals[self.interval].hi {
                let interval = &intervals[self.interval];
                pieces += self.piece(interval, interval.hi, (interval.hi - s) * per_scalar, out);
                s = interval.hi;
                rest = (s1 - s) * per_scalar;
                self.move_to(intervals, self.interval + 1, s);
            }
        } else {
            while s <= intervals[self.interval].lo {
                self.move_to(intervals, self.interval - 1, s);
            }
            let per_scalar = length / (s0 - s1);
            while s1 < intervals[self.interval].lo {
                let interval = &intervals[self.interval];
                pieces += self.piece(interval, interval.lo, (s - interval.lo) * per_scalar, out);
                s = interval.lo;
                rest = (s - s1) * per_scalar;
                self.move_to(intervals, self.interval - 1, s);
            }
        }
        pieces + self.piece(&intervals[self.interval], s1, rest, out)
    }

    /// Crosses a node: values may jump.
    #[inline]
    fn move_to(&mut self, intervals: &[Interval], interval: usize, scalar: f64) {
        self.interval = interval;
        self.here = intervals[interval].at(scalar);
    }
}

impl Integrator for ExactTable {
    type Place = ExactRay;

    #[inline(always)]
    fn enter(&self, scalar: f64) -> ExactRay {
        ExactRay::enter(self, scalar)
    }

    #[inline(always)]
    fn segment(&self, place: &mut ExactRay, s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        place.segment(self, s0, s1, length, out)
    }

    fn clear_share(&self, s0: f64, s1: f64) -> f64 {
        self.clear_share(s0, s1)
    }

    fn is_clear(&self) -> bool {
        self.is_clear()
    }
}

//! The exact integrator: segments are split at the nodes of the transfer function, each piece integrated by
//! [`piece_weights`].
//!
//! Along a ray the scalar is continuous, so the table interval that contains it is known from the segment before: [`ExactRay`] walks up and
//! down the intervals and never searches. The values of table and scalar at the end of a piece are those at the start of the next.
//!
//! Values within an interval are interpolated from its foot, the end with less extinction: both summands are positive, so that the extinction
//! keeps its digits all the way down a steep ramp. From the other end it would be off by 2^-24 of the extinction at the top.

mod run;
mod whole;

use super::weights::{DEPTH_MAX, WEIGHED_AT_ONCE, weigh};
use super::{Accumulator, Integrator, PieceWeights, ScalarMap, piece_weights};
use crate::node_table::{Node, NodeTable};
use arrayvec::ArrayVec;
use glam::Vec4;
pub(crate) use run::RUN;
use run::Run;
use whole::WholePieces;

/// Red, green, blue and extinction per unit of length at one scalar, in one vector, as all are interpolated alike.
#[derive(Clone, Copy, Debug)]
pub(super) struct Optical(Vec4);

impl Optical {
    #[inline(always)]
    fn tau(self) -> f32 {
        self.0.w
    }

    /// Red, green, blue, 1.
    #[inline(always)]
    pub(super) fn color(self) -> Vec4 {
        self.0.with_w(1.0)
    }
}

/// Interval of a piecewise linear table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval {
    /// Scalars from `lo` to `hi`; the first and last interval reach to infinity and are constant.
    pub(crate) lo: f64,
    pub(crate) hi: f64,
    /// 1 / (hi - lo), negative where the foot is `hi`, or 0 where constant.
    per_width: f64,
    /// The foot, from which shares of the width are counted: that of `lo` and `hi` with less extinction, or 0 where constant.
    origin: f64,
    at_foot: Optical,
    /// Value at the other end less that at the foot.
    rise: Optical,
    /// Whether extinction is zero throughout.
    pub(super) transparent: bool,
}

impl Interval {
    fn new(lo: f64, hi: f64, a: &Node, b: &Node, world_per_length: f64) -> Self {
        // The largest extinction that stays finite when it is averaged.
        let tau = |n: &Node| (n.tau * world_per_length).min(f64::from(f32::MAX / 4.0)) as f32;
        let optical = |n: &Node| Vec4::new(n.rgb[0] as f32, n.rgb[1] as f32, n.rgb[2] as f32, tau(n));
        let (foot, top, sign) = if b.tau < a.tau { (b, a, -1.0) } else { (a, b, 1.0) };
        let (at_foot, rise) = (Optical(optical(foot)), Optical(optical(top) - optical(foot)));
        let per_width = if lo.is_finite() && hi.is_finite() { sign / (hi - lo) } else { 0.0 };
        let origin = if per_width == 0.0 { 0.0 } else { foot.scalar };
        Self { lo, hi, per_width, origin, at_foot, rise, transparent: a.tau == 0.0 && b.tau == 0.0 }
    }

    /// The distance of a scalar from the foot, in widths; 0 where constant.
    #[inline(always)]
    pub(super) fn share(&self, scalar: f64) -> f64 {
        if self.per_width == 0.0 { 0.0 } else { (scalar - self.origin) * self.per_width }
    }

    #[inline]
    pub(super) fn at(&self, scalar: f64) -> Optical {
        Optical(self.at_foot.0 + self.rise.0 * self.share(scalar) as f32)
    }

    /// The values at `lo` and at `hi`.
    fn ends(&self) -> [Vec4; 2] {
        let (foot, top) = (self.at_foot.0, self.at_foot.0 + self.rise.0);
        if self.per_width < 0.0 { [top, foot] } else { [foot, top] }
    }
}

/// An [`Interval`] in the layout that vector lanes read.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct IntervalRow {
    /// `lo`, `hi`, `origin` and `per_width`.
    pub(crate) bounds: [f64; 4],
    /// Red, green, blue and extinction at the foot, then their rise to the other end.
    pub(crate) values: [f32; 8],
    /// `lo` of the interval below, and `hi` of that above; two unused numbers.
    pub(crate) around: [f64; 4],
}

impl IntervalRow {
    /// The row of the interval `at`.
    fn of(intervals: &[Interval], at: usize) -> Self {
        let Interval { lo, hi, origin, per_width, at_foot, rise, .. } = intervals[at];
        let values = bytemuck::cast([at_foot.0.to_array(), rise.0.to_array()]);
        let (below, above) = (at.checked_sub(1), at + 1);
        let below = below.and_then(|below| intervals.get(below)).map_or(f64::NEG_INFINITY, |interval| interval.lo);
        let above = intervals.get(above).map_or(f64::INFINITY, |interval| interval.hi);
        Self { bounds: [lo, hi, origin, per_width], values, around: [below, above, 0.0, 0.0] }
    }
}

/// A [`NodeTable`] prepared for integration along rays, extinction per unit of the ray's length parameter.
#[derive(Clone, Debug)]
pub struct ExactTable {
    intervals: Vec<Interval>,
    rows: Vec<IntervalRow>,
    whole: WholePieces,
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
        let whole = WholePieces::new(&intervals);
        let rows = (0..intervals.len()).map(|at| IntervalRow::of(&intervals, at)).collect();
        Self { intervals, rows, whole }
    }

    /// The share (0..=1) of a segment from scalar `s0` to `s1` before its first piece with extinction; 1 if there is none.
    pub fn transparent_share(&self, s0: f64, s1: f64) -> f64 {
        // At a node the side that the segment goes to holds, as in [`ExactRay`].
        if s1 == s0 {
            let interval = &self.intervals[self.interval_at(s0)];
            return if interval.at(s0).tau() > 0.0 { 0.0 } else { 1.0 };
        }
        let share = |s: f64| ((s - s0) / (s1 - s0)).clamp(0.0, 1.0);
        if s1 > s0 {
            let first = self.intervals.partition_point(|i| i.hi <= s0);
            let visible = self.intervals[first..].iter().take_while(|i| i.lo < s1).find(|i| !i.transparent);
            visible.map_or(1.0, |i| share(i.lo.max(s0)))
        } else {
            let end = self.intervals.partition_point(|i| i.lo < s0);
            let visible = self.intervals[..end].iter().rev().take_while(|i| i.hi > s1).find(|i| !i.transparent);
            visible.map_or(1.0, |i| share(i.hi.min(s0)))
        }
    }

    /// The table as `shaders/lib/optics_intervals.wgsl` reads it, over scalars seen through `map`: per interval (lo, hi, width,
    /// 1 / width or 0, negative where the foot is hi), colour and extinction at the foot, their rise to the other end. Widths are those
    /// before rounding: an interval too narrow for f32 at its place still has one.
    pub fn packed(&self, map: ScalarMap) -> Vec<[f32; 4]> {
        const FAR: f64 = 3e38;
        let pack = |i: &Interval| {
            let [lo, hi] = [i.lo, i.hi].map(|s| map.place(s));
            let width = if i.per_width == 0.0 { 0.0 } else { (i.hi - i.lo) * map.prescale * map.scale };
            let per_width = if width > 0.0 { (1.0 / width).min(FAR).copysign(i.per_width) } else { 0.0 };
            [[lo, hi, width as f32, per_width as f32], i.at_foot.0.to_array(), i.rise.0.to_array()]
        };
        self.intervals.iter().flat_map(pack).collect()
    }

    /// The interval that contains a scalar; at a node the right one.
    #[inline]
    pub(crate) fn interval_at(&self, scalar: f64) -> usize {
        self.intervals.partition_point(|i| i.hi <= scalar)
    }

    /// All intervals, in ascending order.
    pub(super) fn intervals(&self) -> &[Interval] {
        &self.intervals
    }

    #[inline(always)]
    pub(crate) fn interval(&self, index: usize) -> &Interval {
        &self.intervals[index]
    }

    /// The interval's layout for vector lanes.
    #[inline(always)]
    pub(crate) fn row(&self, index: usize) -> &IntervalRow {
        &self.rows[index]
    }

    /// Pieces from node to node.
    #[inline(always)]
    pub(crate) fn whole(&self) -> &WholePieces {
        &self.whole
    }

    /// Whether no scalar has extinction.
    pub fn is_transparent(&self) -> bool {
        self.intervals.iter().all(|i| i.transparent)
    }
}

/// State of a ray in the table: the interval, and the values at the scalar where its last segment ended.
#[derive(Clone, Copy, Debug)]
pub struct ExactRay {
    interval: usize,
    /// Whether that interval is transparent. As a `bool` it gives an `Option` of this type room for `None`.
    transparent: bool,
    here: Optical,
}

impl ExactRay {
    #[inline]
    fn in_interval(intervals: &[Interval], interval: usize, scalar: f64) -> Self {
        let &Interval { transparent, .. } = &intervals[interval];
        Self { interval, transparent, here: intervals[interval].at(scalar) }
    }

    /// Passes the pieces of a segment that have extinction to `into`.
    #[inline(always)]
    fn split(&mut self, table: &ExactTable, s0: f64, s1: f64, length: f64, into: &mut impl TakePiece) {
        let intervals = table.intervals.as_slice();
        let interval = &intervals[self.interval];
        // The usual case: no node is crossed.
        if s1 < interval.hi && s1 > interval.lo && s0 < interval.hi {
            self.piece(interval, s1, length, into, None);
        } else {
            self.across_nodes(intervals, s0, s1, length, into);
        }
    }

    /// Passes on one piece of a segment; returns whether anything behind it can be visible.
    #[inline(always)]
    fn piece(
        &mut self,
        interval: &Interval,
        to: f64,
        length: f64,
        into: &mut impl TakePiece,
        place: Option<usize>,
    ) -> bool {
        let near = self.here;
        self.here = interval.at(to);
        if !self.transparent {
            let (far, length) = (self.here, length as f32);
            // Rounding may leave a tiny negative extinction where a ramp reaches zero.
            let [near_depth, far_depth] = [near, far].map(|end| (end.tau() * length).max(0.0));
            // A constant piece at the foot of a ramp is invisible.
            if near_depth > 0.0 || far_depth > 0.0 {
                into.take(Piece { near: near.color(), far: far.color(), near_depth, far_depth }, place);
            }
            return near_depth + far_depth <= 2.0 * DEPTH_MAX;
        }
        true
    }

    #[inline(always)]
    fn across_nodes(&mut self, intervals: &[Interval], s0: f64, s1: f64, length: f64, into: &mut impl TakePiece) {
        let mut s = s0;
        let mut rest = length;
        let mut to_nodes = ToNodes::default();
        if s1 >= s0 {
            // At a node the side that the ray goes to holds; a constant segment takes the right one.
            while s >= intervals[self.interval].hi {
                self.move_to(intervals, self.interval + 1, s);
            }
            let per_scalar = if s1 > s0 { length / (s1 - s0) } else { 0.0 };
            while s1 > intervals[self.interval].hi {
                let interval = &intervals[self.interval];
                let place = to_nodes.next(into);
                if !self.piece(interval, interval.hi, (interval.hi - s) * per_scalar, into, place) {
                    return self.leave_out_rest(intervals, s1);
                }
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
                let place = to_nodes.next(into);
                if !self.piece(interval, interval.lo, (s - interval.lo) * per_scalar, into, place) {
                    return self.leave_out_rest(intervals, s1);
                }
                s = interval.lo;
                rest = (s - s1) * per_scalar;
                self.move_to(intervals, self.interval - 1, s);
            }
        }
        self.piece(&intervals[self.interval], s1, rest, into, None);
    }

    /// Moves to the end of a segment whose rest is invisible.
    #[cold]
    fn leave_out_rest(&mut self, intervals: &[Interval], s1: f64) {
        self.move_to(intervals, intervals.partition_point(|i| i.hi <= s1), s1);
    }

    /// Crosses a node: values may jump.
    #[inline]
    fn move_to(&mut self, intervals: &[Interval], interval: usize, scalar: f64) {
        *self = Self::in_interval(intervals, interval, scalar);
    }
}

/// A part of a segment that crosses no node.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Colours at the near and the far end.
    near: Vec4,
    far: Vec4,
    /// Extinctions at both ends, times the length.
    near_depth: f32,
    far_depth: f32,
}

/// Consumer of pieces.
trait TakePiece {
    /// Takes a piece, with its place in its [`Run`] if it is whole.
    fn take(&mut self, piece: Piece, place: Option<usize>);

    /// The whole pieces that follow are another run.
    fn end_run(&mut self);
}

/// Pieces of a segment that end at nodes: all but the first one are whole, and each [`RUN`] of these, visible or not, are a run.
#[derive(Default)]
struct ToNodes {
    /// Pieces so far.
    count: usize,
}

impl ToNodes {
    /// The place of the next piece in its run, if it is whole.
    #[inline(always)]
    fn next(&mut self, into: &mut impl TakePiece) -> Option<usize> {
        let whole = self.count.checked_sub(1);
        self.count += 1;
        let place = whole? % RUN;
        if place == 0 {
            into.end_run();
        }
        Some(place)
    }
}

/// Composites each piece immediately, or each run.
struct OneByOne<'a> {
    out: &'a mut Accumulator,
    run: Run,
    count: u64,
}

impl TakePiece for OneByOne<'_> {
    #[inline(always)]
    fn take(&mut self, piece: Piece, place: Option<usize>) {
        let weights = piece_weights(piece.near_depth, piece.far_depth);
        match place {
            Some(place) => self.run.put(place, weights, [piece.near, piece.far]),
            None => {
                self.end_run();
                self.out.add(weights, piece.near, piece.far);
            }
        }
        self.count += 1;
    }

    #[inline(always)]
    fn end_run(&mut self) {
        self.run.end(self.out);
    }
}

/// Most buffered pieces: a renderer composites a score of segments at a time, most of one piece or two.
const ROOM: usize = 4 * WEIGHED_AT_ONCE;

/// Buffer of pieces to be weighed side by side.
struct Pieces<'a> {
    out: &'a mut Accumulator,
    run: Run,
    /// Whether the next whole piece is one of another run.
    ends_run: bool,
    /// Pieces taken so far.
    count: u64,
    near_depth: [f32; ROOM],
    far_depth: [f32; ROOM],
    /// Not an array: clearing one takes as long as compositing some pieces.
    waiting: ArrayVec<Waiting, ROOM>,
}

/// A piece to be weighed: colours at both ends, its place in a run, and whether the run before ends in front of it.
struct Waiting {
    colors: [Vec4; 2],
    place: Option<usize>,
    ends_run: bool,
}

impl TakePiece for Pieces<'_> {
    #[inline(always)]
    fn take(&mut self, piece: Piece, place: Option<usize>) {
        if self.waiting.is_full() {
            self.make_room();
        }
        let at = self.waiting.len() % ROOM;
        (self.near_depth[at], self.far_depth[at]) = (piece.near_depth, piece.far_depth);
        let ends_run = place.is_none() | std::mem::take(&mut self.ends_run);
        self.waiting.push(Waiting { colors: [piece.near, piece.far], place, ends_run });
        self.count += 1;
    }

    #[inline(always)]
    fn end_run(&mut self) {
        self.ends_run = true;
    }
}

impl<'a> Pieces<'a> {
    #[inline(always)]
    fn new(out: &'a mut Accumulator) -> Self {
        let (none, waiting) = ([0.0; ROOM], ArrayVec::new_const());
        Self { out, run: Run::EMPTY, ends_run: false, count: 0, near_depth: none, far_depth: none, waiting }
    }

    #[cold]
    #[inline(never)]
    fn make_room(&mut self) {
        self.composite();
        self.waiting.clear();
    }

    /// Weighs the buffered pieces side by side and composites them one after the other.
    #[inline(always)]
    fn composite(&mut self) {
        // A copy stays in registers, from one piece to the next.
        let mut out = *self.out;
        let depths = self.near_depth.as_chunks().0.iter().zip(self.far_depth.as_chunks().0);
        for (waiting, (near, far)) in self.waiting.chunks(WEIGHED_AT_ONCE).zip(depths) {
            let weights = weigh(near, far);
            for (i, piece) in waiting.iter().enumerate() {
                let [near, far] = weights.map(|w| w[i]);
                let weights = PieceWeights { near, far };
                if piece.ends_run {
                    self.run.end(&mut out);
                }
                match piece.place {
                    Some(place) => self.run.put(place, weights, piece.colors),
                    None => out.add(weights, piece.colors[0], piece.colors[1]),
                }
            }
        }
        *self.out = out;
    }
}

impl Integrator for ExactTable {
    type Place = ExactRay;

    #[inline(always)]
    fn enter(&self, scalar: f64) -> ExactRay {
        ExactRay::in_interval(&self.intervals, self.interval_at(scalar), scalar)
    }

    #[inline(always)]
    fn segment(&self, place: &mut ExactRay, s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        let mut pieces = OneByOne { out, run: Run::EMPTY, count: 0 };
        place.split(self, s0, s1, length, &mut pieces);
        pieces.end_run();
        pieces.count
    }

    #[inline(always)]
    fn segments(
        &self,
        place: &mut ExactRay,
        mut s0: f64,
        segments: impl Iterator<Item = (f64, f64)>,
        out: &mut Accumulator,
    ) -> u64 {
        let (mut pieces, mut ray) = (Pieces::new(out), *place);
        for (s1, length) in segments {
            ray.split(self, s0, s1, length, &mut pieces);
            s0 = s1;
        }
        *place = ray;
        pieces.composite();
        pieces.run.end(pieces.out);
        pieces.count
    }

    fn exact(&self) -> &ExactTable {
        self
    }

    #[inline(always)]
    fn as_exact(&self) -> Option<&ExactTable> {
        Some(self)
    }
}

#[cfg(test)]
mod tests;

//! Splits segments of eight rays at the nodes of the transfer function.

use super::super::super::super::medium::{RayLine, Segment};
use super::super::cut::Cuts;
use super::super::rows::{Out, Rows};
use super::super::vector::{LANES, Lanes};
use super::intervals::InRegisters;
use super::steps::Step;
use super::{ExactLights, Optics};
use crate::mesh::NONE;
use crate::optics::DEPTH_MAX;
use crate::optics::exact::ExactTable;
use pulp::cast;

/// Segments of the lanes `todo`: scalars at their ends, lengths, and bits of the lanes whose scalars fall.
struct Segments<F> {
    todo: u8,
    descends: u8,
    from: F,
    to: F,
    length: F,
}

/// Segments of the lanes `which` that cross nodes.
pub(super) struct Crossing<F> {
    pub(super) which: u8,
    /// Bits of those that cross more than one.
    pub(super) farther: u8,
    /// Bits of those whose scalars fall.
    pub(super) descends: u8,
    /// Scalars at the far ends, and lengths per scalar.
    pub(super) to: F,
    pub(super) per_scalar: F,
}

impl<L: Lanes> ExactLights<'_, L> {
    /// Splits the segments of a row at nodes, and ends the row.
    #[inline(always)]
    pub(super) fn split_row(&mut self, intervals: &mut InRegisters<L>, rows: &mut Rows, row: usize, out: &mut Out<'_>) {
        self.split_segments(intervals, rows, row, out);
        if let Some(cuts) = &rows.cuts
            && cuts.fragments[row] != 0
        {
            self.pass_fragments(rows, cuts, row, out);
        }
        if let Some(last) = self.steps.about[..self.steps.count].last_mut()
            && last.row == row
        {
            last.ends_row = true;
        }
    }

    /// Moves `front` to the fragments of a row, which composites them at its end: it has a step, if without pieces.
    #[inline(always)]
    fn pass_fragments(&mut self, rows: &Rows, cuts: &Cuts, row: usize, out: &mut Out<'_>) {
        let lanes = self.optics.lanes;
        let (which, front) = (cuts.fragments[row], lanes.load(&self.front));
        let reached = lanes.greater(front, lanes.load(&cuts.depth[row]));
        self.front = lanes.store(lanes.select(lanes.mask(which), reached, front));
        self.composited |= which;
        let has_step = self.steps.about[..self.steps.count].last().is_some_and(|last| last.row == row);
        if !has_step {
            let at = self.new_step(rows, out);
            (self.steps.near_depth[at], self.steps.far_depth[at]) = ([0.0; LANES], [0.0; LANES]);
            self.steps.about[at] = Step { row, ..Step::default() };
        }
    }

    #[inline(always)]
    fn split_segments(&mut self, intervals: &mut InRegisters<L>, rows: &mut Rows, row: usize, out: &mut Out<'_>) {
        let lanes = self.optics.lanes;
        let (to_depth, to_scalar) = (lanes.load(&rows.to_depth[row]), lanes.load(&rows.to_scalar[row]));
        let (mut from_depth, mut s) = (lanes.load(&rows.from_depth[row]), lanes.load(&rows.from_scalar[row]));
        let mut todo = rows.alive[row] & !self.closed & lanes.bits(lanes.lt(from_depth, to_depth));
        if todo == 0 {
            return;
        }
        let is_hidden = lanes.bits(lanes.lt(from_depth, lanes.load(&self.front)));
        if todo & is_hidden != 0 {
            todo = self.cut_hidden(rows, row, todo & is_hidden, out) ^ todo;
            (from_depth, s) = (lanes.load(&rows.from_depth[row]), lanes.load(&rows.from_scalar[row]));
        }
        let depth = lanes.sub(to_depth, from_depth);
        let length = lanes.mul(depth, lanes.load(&self.length_per_depth));
        let (lo, hi) = (intervals.lo, intervals.hi);
        // The common case: no node in between.
        let above = lanes.and(lanes.lt(lo, to_scalar), lanes.lt(to_scalar, hi));
        let from = lanes.and_not(lanes.lt(s, hi), lanes.lt(s, lo));
        let within = lanes.bits(lanes.and(above, from));
        let visible = if todo & !within == 0 {
            self.piece(intervals, rows, row, (todo, s, to_scalar, length), out).0
        } else {
            let descends = lanes.lt(to_scalar, s);
            self.find_intervals(intervals, todo & !within, lanes.bits(descends), s);
            let segments = Segments { todo, descends: lanes.bits(descends), from: s, to: to_scalar, length };
            self.split_at_nodes(intervals, rows, row, &segments, out)
        };
        if visible != 0 {
            let front = lanes.select(lanes.mask(visible), to_depth, lanes.load(&self.front));
            self.front = lanes.store(front);
            self.composited |= visible;
        }
    }

    /// Adds the pieces of segments some of which cross nodes: first ones, whole ones (lane by lane), last ones. Returns the lanes with
    /// visible pieces.
    #[inline(always)]
    fn split_at_nodes(
        &mut self,
        intervals: &mut InRegisters<L>,
        rows: &Rows,
        row: usize,
        segments: &Segments<L::F>,
        out: &mut Out<'_>,
    ) -> u8 {
        let lanes = self.optics.lanes;
        let &Segments { todo, descends, from, to, length } = segments;
        let falls = lanes.mask(descends);
        let rise = lanes.abs(lanes.sub(to, from));
        let is_constant = lanes.lt(lanes.splat(0.0), rise);
        let per_scalar = lanes.select(is_constant, lanes.div(length, rise), lanes.splat(0.0));
        let beyond =
            lanes.bits(lanes.lt(intervals.hi, to)) & !descends | lanes.bits(lanes.lt(to, intervals.lo)) & descends;
        let crosses = lanes.mask(todo & beyond);
        let end = lanes.select(crosses, lanes.select(falls, intervals.lo, intervals.hi), to);
        let part = lanes.mul(lanes.abs(lanes.sub(end, from)), per_scalar);
        let part = lanes.select(crosses, part, length);
        let (visible, deep) = self.piece(intervals, rows, row, (todo, from, end, part), out);
        // Nothing behind a deep piece is visible.
        let crosses = todo & beyond & !deep;
        if crosses == 0 {
            return visible;
        }
        let (below, above) = (lanes.lt(to, intervals.below), lanes.lt(intervals.above, to));
        let farther = lanes.bits(below) & descends | lanes.bits(above) & !descends;
        let crossing = Crossing { which: crosses, farther: crosses & farther, descends, to, per_scalar };
        let (of_whole, left) = self.whole_pieces(intervals, rows, row, &crossing, out);
        let from = lanes.select(falls, intervals.hi, intervals.lo);
        let rest = lanes.mul(lanes.abs(lanes.sub(to, from)), per_scalar);
        let (of_last, _) = self.piece(intervals, rows, row, (left, from, to, rest), out);
        visible | of_whole | of_last
    }

    /// Cuts the segments of the lanes `which`, which begin in front of `front`; returns the lanes whose segments also end there.
    #[cold]
    #[inline(never)]
    fn cut_hidden(&mut self, rows: &mut Rows, row: usize, mut which: u8, out: &mut Out<'_>) -> u8 {
        let (mut all, mut hidden) = (0, 0);
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            let to = rows.to(row, lane);
            if to.depth <= self.front[lane] {
                hidden |= self.composited & 1 << lane;
                all |= 1 << lane;
            } else {
                let whole = rows.cuts.as_ref().and_then(|cuts| cuts.whole(row, lane));
                let [from, to] = whole.unwrap_or_else(|| [rows.from(row, lane), to]);
                let (_, behind) = Segment::of_scalars(NONE, from, to, RayLine::default()).split(self.front[lane]);
                (rows.from_depth[row][lane], rows.from_scalar[row][lane]) = (behind.part[0], behind.part_scalar[0]);
            }
        }
        if hidden != 0 {
            let at = self.new_step(rows, out);
            (self.steps.near_depth[at], self.steps.far_depth[at]) = ([0.0; LANES], [0.0; LANES]);
            self.steps.about[at] = Step { row, hidden, ..Step::default() };
        }
        all
    }

    /// Finds the intervals in which the segments of lanes begin.
    #[inline(always)]
    fn find_intervals(&mut self, intervals: &mut InRegisters<L>, mut which: u8, descends: u8, scalar: L::F) {
        let Optics { lanes, table } = self.optics;
        let (lo, hi) = (lanes.bits(lanes.lt(scalar, intervals.lo)), lanes.bits(lanes.lt(intervals.hi, scalar)));
        let at_lo = !lo & !lanes.bits(lanes.lt(intervals.lo, scalar));
        let at_hi = !hi & !lanes.bits(lanes.lt(scalar, intervals.hi));
        which &= lo | hi | at_lo & descends | at_hi & !descends;
        let scalar = lanes.store(scalar);
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            let index = find_interval(table, self.interval[lane], scalar[lane], descends >> lane & 1 == 0);
            self.interval[lane] = index;
            intervals.set(lanes, lane, table.row(index));
        }
    }

    /// Adds one piece for each lane in `todo`, between two scalars, as a step if any is visible. Returns the visible lanes, and those
    /// with nothing visible behind.
    #[inline(always)]
    fn piece(
        &mut self,
        intervals: &InRegisters<L>,
        rows: &Rows,
        row: usize,
        (todo, from, to, length): (u8, L::F, L::F, L::F),
        out: &mut Out<'_>,
    ) -> (u8, u8) {
        let lanes = self.optics.lanes;
        let mask = lanes.mask(todo);
        let near_share = intervals.share(lanes, mask, from);
        let far_share = intervals.share(lanes, mask, to);
        let length = lanes.to_f32(lanes.select(mask, length, lanes.splat(0.0)));
        let zero = lanes.splat_f32(0.0);
        let near = lanes.greater_f32(lanes.mul_f32(intervals.value(lanes, 3, near_share), length), zero);
        let far = lanes.greater_f32(lanes.mul_f32(intervals.value(lanes, 3, far_share), length), zero);
        let visible = lanes.less_f32(zero, near) | lanes.less_f32(zero, far);
        if visible == 0 {
            return (0, 0);
        }
        let at = self.new_step(rows, out);
        (self.steps.near_depth[at], self.steps.far_depth[at]) = (cast(near), cast(far));
        for i in 0..3 {
            self.steps.near[at][i] = cast(intervals.value(lanes, i, near_share));
            self.steps.far[at][i] = cast(intervals.value(lanes, i, far_share));
        }
        self.steps.about[at] = Step { row, visible, ..Step::default() };
        let deep = lanes.less_f32(lanes.splat_f32(2.0 * DEPTH_MAX), lanes.add_f32(near, far));
        self.closed |= deep;
        (visible, deep)
    }
}

/// The interval that holds a scalar, at a node the one towards which the segment goes (the right one for a constant scalar), starting
/// from `index`.
#[inline(never)]
fn find_interval(table: &ExactTable, mut index: usize, scalar: f64, ascends: bool) -> usize {
    let guess = table.interval(index);
    if scalar < guess.lo || scalar > guess.hi {
        index = table.interval_at(scalar);
    }
    while ascends && scalar >= table.interval(index).hi {
        index += 1;
    }
    while !ascends && scalar <= table.interval(index).lo {
        index -= 1;
    }
    index
}

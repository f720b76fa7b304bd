//! Pieces from node to node, side by side within a segment of one ray ([`WholePieces`](crate::optics::exact::ExactTable::whole)).

use super::super::rows::{Out, Rows};
use super::super::vector::{LANES, Lanes};
use super::intervals::{InRegisters, Intervals};
use super::split::Crossing;
use super::steps::Step;
use super::{ExactLights, Optics};
use crate::optics::exact::RUN;
use crate::optics::{Accumulator, DEPTH_MAX};
use glam::Vec4;
use pulp::cast;
use std::arch::x86_64::__m256;

const _: () = assert!(RUN == LANES);

/// Whole pieces of a lane's segment, from a place on, up to the scalar `end` (negated where scalars fall).
struct WholeRun {
    lane: usize,
    first: usize,
    end: f64,
    per_scalar: f64,
}

impl<L: Lanes> ExactLights<'_, L> {
    /// Adds the whole pieces of segments that cross nodes, behind the piece in the current interval: the lanes move to the intervals in which
    /// their segments end. Returns the lanes with visible pieces, and those that still let light through.
    #[inline(always)]
    pub(super) fn whole_pieces(
        &mut self,
        intervals: &mut InRegisters<L>,
        rows: &Rows,
        row: usize,
        crossing: &Crossing<L::F>,
        out: &mut Out<'_>,
    ) -> (u8, u8) {
        let &Crossing { which, farther, descends, .. } = crossing;
        for (lane, interval) in self.interval.iter_mut().enumerate() {
            let up = usize::from(which & !descends & 1 << lane != 0);
            let down = usize::from(which & descends & 1 << lane != 0);
            *interval = *interval + up - down;
        }
        let visible = if farther == 0 { 0 } else { self.runs(rows, row, crossing, out) };
        self.go_to_intervals(intervals, which);
        (visible, which & !self.closed)
    }

    /// Adds the runs of segments that cross more than one node, from the intervals of their lanes on, which move. Returns the lanes with
    /// visible ones.
    #[inline(always)]
    fn runs(&mut self, rows: &Rows, row: usize, crossing: &Crossing<L::F>, out: &mut Out<'_>) -> u8 {
        let lanes = self.optics.lanes;
        let pieces = self.optics.table.whole();
        let &Crossing { farther, descends, to, per_scalar, .. } = crossing;
        let end = lanes.select(lanes.mask(descends), lanes.neg(to), to);
        let (end, per_scalar) = (lanes.store(end), lanes.store(per_scalar));
        let mut first = [0; LANES];
        for (lane, first) in first.iter_mut().enumerate() {
            *first = pieces.place_of(self.interval[lane], descends >> lane & 1 == 1);
        }
        let (mut visible, mut todo) = (0, farther);
        // One run of each lane, then the next: a run waits for the one before of its lane.
        while todo != 0 {
            let mut left = todo;
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                let run = WholeRun { lane, first: first[lane], end: end[lane], per_scalar: per_scalar[lane] };
                let (count, is_visible) = self.run(rows, row, &run, out);
                visible |= u8::from(is_visible) << lane;
                first[lane] += count;
                if count < RUN || self.closed >> lane & 1 == 1 {
                    todo ^= 1 << lane;
                    self.interval[lane] = pieces.place_of(first[lane], descends >> lane & 1 == 1);
                }
            }
        }
        visible
    }

    /// Moves lanes to other intervals: above a few lanes all at once, which costs as much.
    #[inline(always)]
    fn go_to_intervals(&mut self, intervals: &mut InRegisters<L>, mut which: u8) {
        const ALL_AT_ONCE: u32 = 4;
        let Optics { lanes, table } = self.optics;
        if which.count_ones() >= ALL_AT_ONCE {
            let [a, b, c, d, e, f, g, h] = self.interval;
            let row = |index: usize| table.row(index);
            *intervals = Intervals::of_all(lanes, [row(a), row(b), row(c), row(d), row(e), row(f), row(g), row(h)]);
            return;
        }
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            intervals.set(lanes, lane, table.row(self.interval[lane]));
        }
    }

    /// Adds a run of whole pieces; returns how many there are, and whether one is visible.
    #[inline(always)]
    fn run(&mut self, rows: &Rows, row: usize, run: &WholeRun, out: &mut Out<'_>) -> (usize, bool) {
        let lanes = self.optics.lanes;
        let &WholeRun { lane, first, end, per_scalar } = run;
        let Some(pieces) = self.optics.table.whole().run(first) else { return (0, false) };
        let ends = lanes.load(pieces.ends);
        let mut whole = lanes.bits(lanes.lt(ends, lanes.splat(end)));
        if whole == 0 {
            return (0, false);
        }
        let zero = lanes.splat_f32(0.0);
        let length = lanes.mul(lanes.sub(ends, lanes.load(pieces.begins)), lanes.splat(per_scalar));
        let length = lanes.to_f32(lanes.select(lanes.mask(whole), length, lanes.splat(0.0)));
        let [near, far] = pieces.extinctions;
        let mut near = lanes.greater_f32(lanes.mul_f32(cast(*near), length), zero);
        let mut far = lanes.greater_f32(lanes.mul_f32(cast(*far), length), zero);
        let deep = lanes.less_f32(lanes.splat_f32(2.0 * DEPTH_MAX), lanes.add_f32(near, far));
        if deep != 0 {
            // Nothing behind the first of them is visible.
            self.closed |= 1 << lane;
            whole &= u8::MAX >> (LANES as u32 - 1 - deep.trailing_zeros());
            let seen = lanes.mask(whole);
            (near, far) = (lanes.select_f32(seen, near, zero), lanes.select_f32(seen, far, zero));
        }
        let visible = lanes.less_f32(zero, near) | lanes.less_f32(zero, far);
        if visible != 0 {
            let at = self.new_step(rows, out);
            (self.steps.near_depth[at], self.steps.far_depth[at]) = (cast(near), cast(far));
            self.steps.about[at] = Step { row, visible, run: Some((lane, first)), ..Step::default() };
        }
        (whole.count_ones() as usize, visible != 0)
    }

    /// Composites the pieces of a run with these weights.
    #[inline(always)]
    pub(super) fn add_run(
        &mut self,
        at: usize,
        (lane, first): (usize, usize),
        [near, far]: [__m256; 2],
        out: &mut Out<'_>,
    ) {
        if self.opaque >> lane & 1 == 1 {
            return;
        }
        let Some(colors) = self.optics.table.whole().colors(first) else { return };
        let of_run = light_of_run(self.optics.lanes, [near, far], colors);
        let [r, g, b, a] = &self.rgba;
        let rgba = [r[lane], g[lane], b[lane], a[lane]];
        let mut light = Accumulator::of_parts(rgba, self.transmittance[lane], self.carried[lane]);
        light.add_premultiplied(of_run, of_run.w);
        let (rgba, transmittance, carried) = light.parts();
        for (i, channel) in rgba.into_iter().enumerate() {
            self.rgba[i][lane] = channel;
        }
        (self.transmittance[lane], self.carried[lane]) = (transmittance, carried);
        out.stats.segments += u64::from(self.steps.about[at].visible.count_ones());
        self.row_visible |= 1 << lane;
    }
}

/// Premultiplied red, green, blue, and opacity of a run with these weights and colours, as in [`Run`](crate::optics::exact::Run).
#[inline(always)]
fn light_of_run<L: Lanes>(lanes: L, [near, far]: [__m256; 2], [r, g, b]: [[&[f32; RUN]; 2]; 3]) -> Vec4 {
    let opacity = lanes.add_f32(near, far);
    let through = lanes.sub_f32(lanes.splat_f32(1.0), opacity);
    // Of the piece in front of each, of two, of four, of all.
    let one = lanes.one_after::<1>(through);
    let two = lanes.mul_f32(one, lanes.one_after::<1>(one));
    let four = lanes.mul_f32(two, lanes.one_after::<2>(two));
    let all = lanes.mul_f32(four, lanes.one_after::<4>(four));
    let (near, far) = (lanes.mul_f32(all, near), lanes.mul_f32(all, far));
    let r = lanes.add_f32(lanes.mul_f32(cast(*r[0]), near), lanes.mul_f32(cast(*r[1]), far));
    let g = lanes.add_f32(lanes.mul_f32(cast(*g[0]), near), lanes.mul_f32(cast(*g[1]), far));
    let b = lanes.add_f32(lanes.mul_f32(cast(*b[0]), near), lanes.mul_f32(cast(*b[1]), far));
    Vec4::from_array(lanes.sums_f32([r, g, b, lanes.mul_f32(all, opacity)]))
}

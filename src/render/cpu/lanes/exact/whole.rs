//! Pieces from node to node, side by side within a segment of one ray ([`WholePieces`](crate::optics::exact::WholePieces)).

use super::super::rows::{Out, Rows};
use super::super::vector::{Eight, LANES, Lanes};
use super::intervals::{InRegisters, Intervals};
use super::steps::{Run, Step};
use super::{ExactLights, Optics};
use crate::optics::exact::AT_ONCE;
use crate::optics::{Accumulator, DEPTH_MAX, PieceWeights};
use pulp::cast;

const _: () = assert!(AT_ONCE == LANES);

impl<L: Lanes> ExactLights<'_, L> {
    /// Adds the whole pieces of segments that cross nodes, in the lanes `which`, behind the piece in the current interval: the lanes move
    /// to the intervals in which their segments end. `ends` are the scalars there, and lengths per scalar. Returns the lanes with visible
    /// pieces, and those that still let light through.
    #[inline(always)]
    pub(super) fn whole_pieces(
        &mut self,
        intervals: &mut InRegisters<L>,
        rows: &Rows,
        row: usize,
        (which, descends, ends): (u8, u8, (Eight, Eight)),
        out: &mut Out<'_>,
    ) -> (u8, u8) {
        let (mut visible, mut todo) = (0, which);
        while todo != 0 {
            let lane = todo.trailing_zeros() as usize;
            todo &= todo - 1;
            let falls = descends >> lane & 1 == 1;
            let is_visible = self.run(rows, row, (lane, falls), (ends.0[lane], ends.1[lane]), out);
            visible |= u8::from(is_visible) << lane;
        }
        self.go_to_intervals(intervals, which);
        (visible, which & !self.closed)
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

    /// Adds the whole pieces of one lane's segment up to scalar `to`; true if one of them is visible.
    #[inline(always)]
    fn run(
        &mut self,
        rows: &Rows,
        row: usize,
        (lane, falls): (usize, bool),
        (to, per_scalar): (f64, f64),
        out: &mut Out<'_>,
    ) -> bool {
        let lanes = self.optics.lanes;
        let table = self.optics.table;
        let to = lanes.splat(if falls { -to } else { to });
        let zero = lanes.splat_f32(0.0);
        let mut first = table.place_of(self.interval[lane], falls) + 1;
        let mut is_visible = false;
        while let Some(some) = table.whole(falls).some(first) {
            let whole = lanes.bits(lanes.lt(lanes.load(some.ends), to));
            if whole == 0 {
                break;
            }
            let length = lanes.mul(lanes.load(some.widths), lanes.splat(per_scalar));
            let length = lanes.to_f32(lanes.select(lanes.mask(whole), length, lanes.splat(0.0)));
            let [near, far] = some.extinctions;
            let near = lanes.greater_f32(lanes.mul_f32(cast(*near), length), zero);
            let far = lanes.greater_f32(lanes.mul_f32(cast(*far), length), zero);
            let mut visible = lanes.less_f32(zero, near) | lanes.less_f32(zero, far);
            let mut count = whole.trailing_ones();
            let deep = lanes.less_f32(lanes.splat_f32(2.0 * DEPTH_MAX), lanes.add_f32(near, far));
            if deep != 0 {
                // Nothing behind the first of them is visible.
                self.closed |= 1 << lane;
                count = deep.trailing_zeros() + 1;
                visible &= u8::MAX >> (LANES as u32 - count);
            }
            if visible != 0 {
                is_visible = true;
                let at = self.new_step(rows, out);
                (self.steps.near_depth[at], self.steps.far_depth[at]) = (cast(near), cast(far));
                let run = Run { lane, falls, first, count: count as usize };
                self.steps.about[at] = Step { row, visible, run: Some(run), ..Step::default() };
            }
            first += count as usize;
            if deep != 0 || count < LANES as u32 {
                break;
            }
        }
        self.interval[lane] = table.place_of(first, falls);
        is_visible
    }

    /// Composites the pieces of a run with these weights.
    #[inline(always)]
    pub(super) fn add_run(&mut self, at: usize, run: Run, [near, far]: [&[f32; LANES]; 2], out: &mut Out<'_>) {
        let Run { lane, falls, first, count } = run;
        if self.opaque >> lane & 1 == 1 {
            return;
        }
        let [r, g, b, a] = &self.rgba;
        let rgba = [r[lane], g[lane], b[lane], a[lane]];
        let mut light = Accumulator::of_parts(rgba, self.transmittance[lane], self.carried[lane]);
        let colors = self.optics.table.whole(falls).colors(first);
        for ((&near, &far), &[near_color, far_color]) in near.iter().zip(far).zip(colors).take(count) {
            light.add(PieceWeights { near, far }, near_color, far_color);
        }
        let (rgba, transmittance, carried) = light.parts();
        for (i, channel) in rgba.into_iter().enumerate() {
            self.rgba[i][lane] = channel;
        }
        (self.transmittance[lane], self.carried[lane]) = (transmittance, carried);
        out.stats.segments += u64::from(self.steps.about[at].visible.count_ones());
        self.row_visible |= 1 << lane;
    }
}

//! The light of eight rays side by side, for the exact integrator.
//!
//! ```text
//! for each row of segments
//!     drop those behind a piece that nothing shines through
//!     cut those that begin in front of what there is, drop those that end there
//!     while a lane has a piece left: the part of its segment up to the next node of the transfer function
//!         a step: two optical depths and two colours for each lane, zero where a lane has no piece
//! for each pair of steps
//!     weigh their pieces side by side
//!     add them to the light of their lanes, one step after the other
//!     at the end of a row: lanes that have become opaque take no more
//! ```
//!
//! Every operation is one of [`RayLight`](super::super::super::light::RayLight) and [`ExactTable`], on the same numbers. Pieces of no
//! optical depth have no weight: a lane without a piece is one with such a piece. An opaque ray is one with no
//! transmittance left.

use super::super::super::super::medium::{RayLine, Segment, first_visible};
use super::super::super::tiles::TilePixel;
use super::rows::{Lights, Out, Rows};
use super::vector::{Eight, LANES, Lanes};
use crate::mesh::NONE;
use crate::optics::exact::{ExactTable, Interval};
use crate::optics::{DEPTH_MAX, OPAQUE_TRANSMITTANCE, WEIGHED_AT_ONCE, weigh_thick, weigh_thin};
use pulp::{NullaryFnOnce, cast};
use std::arch::x86_64::__m256;

/// An f32 for each lane.
type EightF32 = [f32; LANES];

/// Steps that wait to be weighed, at most.
const ROOM: usize = 96;
const _: () = assert!(2 * LANES == WEIGHED_AT_ONCE && ROOM.is_multiple_of(2));

/// The intervals of the table that hold the last scalars.
#[derive(Clone, Copy)]
struct Intervals<F, G> {
    lo: F,
    hi: F,
    /// Where shares are counted from: `lo`, if that is finite.
    origin: F,
    per_width: F,
    /// Red, green, blue and extinction at `lo`, and how much more at `hi`.
    at_lo: [G; 4],
    rise: [G; 4],
}

/// The intervals of [`ExactLights`] in registers.
type InRegisters<L> = Intervals<<L as Lanes>::F, __m256>;

impl Intervals<Eight, EightF32> {
    #[inline(always)]
    fn load<L: Lanes>(&self, lanes: L) -> InRegisters<L> {
        Intervals {
            lo: lanes.load(&self.lo),
            hi: lanes.load(&self.hi),
            origin: lanes.load(&self.origin),
            per_width: lanes.load(&self.per_width),
            at_lo: cast(self.at_lo),
            rise: cast(self.rise),
        }
    }
}

impl<F: Copy> Intervals<F, __m256> {
    #[inline(always)]
    fn store<L: Lanes<F = F>>(&self, lanes: L) -> Intervals<Eight, EightF32> {
        Intervals {
            lo: lanes.store(self.lo),
            hi: lanes.store(self.hi),
            origin: lanes.store(self.origin),
            per_width: lanes.store(self.per_width),
            at_lo: cast(self.at_lo),
            rise: cast(self.rise),
        }
    }

    /// How far through their intervals scalars are; 0 in other lanes than those of `mask`.
    #[inline(always)]
    fn share<L: Lanes<F = F>>(&self, lanes: L, mask: L::M, scalar: F) -> __m256 {
        let share = lanes.mul(lanes.sub(scalar, self.origin), self.per_width);
        lanes.to_f32(lanes.select(mask, share, lanes.splat(0.0)))
    }

    /// Red, green, blue or extinction there.
    #[inline(always)]
    fn value<L: Lanes<F = F>>(&self, lanes: L, i: usize, share: __m256) -> __m256 {
        lanes.add_f32(self.at_lo[i], lanes.mul_f32(self.rise[i], share))
    }

    /// A lane goes to another interval. Whole vectors are written, since they are read as such right behind.
    #[inline(always)]
    fn set<L: Lanes<F = F>>(&mut self, lanes: L, lane: usize, interval: &Interval) {
        let mask = lanes.mask(1 << lane);
        self.lo = lanes.select(mask, lanes.splat(interval.lo), self.lo);
        self.hi = lanes.select(mask, lanes.splat(interval.hi), self.hi);
        self.origin = lanes.select(mask, lanes.splat(interval.origin), self.origin);
        self.per_width = lanes.select(mask, lanes.splat(interval.per_width), self.per_width);
        let (at_lo, rise) = interval.values();
        for i in 0..4 {
            self.at_lo[i] = lanes.select_f32(mask, lanes.splat_f32(at_lo[i]), self.at_lo[i]);
            self.rise[i] = lanes.select_f32(mask, lanes.splat_f32(rise[i]), self.rise[i]);
        }
    }
}

/// The interval that holds a scalar, at a node on the side to which a segment goes (a constant one takes the right one); perhaps
/// this one.
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

/// Pieces of all lanes that wait to be weighed.
#[repr(C, align(64))]
struct Steps {
    near_depth: [EightF32; ROOM],
    far_depth: [EightF32; ROOM],
    /// Red, green and blue.
    near: [[EightF32; 3]; ROOM],
    far: [[EightF32; 3]; ROOM],
    about: [Step; ROOM],
    count: usize,
}

#[derive(Clone, Copy, Default)]
struct Step {
    row: usize,
    /// Bits of the lanes that have a piece.
    visible: u8,
    /// Bits of the lanes that have a segment in front of what there is.
    hidden: u8,
    /// Whether it is the last one of its row.
    ends_row: bool,
}

/// The light of eight rays in registers.
struct Sum {
    rgba: [__m256; 4],
    transmittance: __m256,
    /// What rounding has left out of that, as in [`Accumulator`](crate::optics::Accumulator).
    carried: __m256,
}

/// What is the same for all rays.
#[derive(Clone, Copy)]
pub(super) struct Optics<'a, L> {
    pub(super) lanes: L,
    pub(super) table: &'a ExactTable,
}

/// A call of [`ExactLights::add_steps`].
struct AddSteps<'a, 'o, 'p, L> {
    lights: &'a mut ExactLights<'o, L>,
    rows: &'a Rows,
    out: &'a mut Out<'p>,
}

impl<L: Lanes> NullaryFnOnce for AddSteps<'_, '_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.lights.add_steps(self.rows, self.out);
    }
}

/// A call of [`weigh_thick`].
struct WeighThick<'a> {
    near: &'a [f32; WEIGHED_AT_ONCE],
    far: &'a [f32; WEIGHED_AT_ONCE],
    weights: &'a mut [[f32; WEIGHED_AT_ONCE]; 2],
}

impl NullaryFnOnce for WeighThick<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        weigh_thick(self.near, self.far, self.weights);
    }
}

/// The light of eight rays.
#[repr(C, align(64))]
pub(super) struct ExactLights<'a, L> {
    optics: Optics<'a, L>,
    intervals: Intervals<Eight, EightF32>,
    /// Which intervals of the table these are.
    interval: [usize; LANES],
    steps: Steps,
    length_per_depth: Eight,
    /// Depth up to which rays have been composited, or the near distance.
    front: Eight,
    /// Bits of the lanes where that is the end of a segment.
    composited: u8,
    /// Bits of the lanes that have passed through a piece that nothing shines through: nothing is split for them.
    closed: u8,
    near_distance: f64,
    /// Red, green, blue and opacity.
    rgba: [EightF32; 4],
    transmittance: EightF32,
    carried: EightF32,
    /// Depth of the first visible place.
    visible_from: Eight,
    /// Bits of the lanes whose rays have seen something, and of those that are opaque.
    seen: u8,
    opaque: u8,
    /// Lanes that have a piece in the present row of steps.
    row_visible: u8,
    /// Ends of rays that have been passed.
    ends_passed: usize,
}

impl<'a, L: Lanes> ExactLights<'a, L> {
    pub(super) fn new(optics: Optics<'a, L>, near_distance: f64) -> Self {
        let zero = [0.0; LANES];
        // An interval that holds nothing.
        let intervals = Intervals {
            lo: [f64::INFINITY; LANES],
            hi: [f64::NEG_INFINITY; LANES],
            origin: zero,
            per_width: zero,
            at_lo: [[0.0; LANES]; 4],
            rise: [[0.0; LANES]; 4],
        };
        let empty = [[0.0; LANES]; ROOM];
        let steps = Steps {
            near_depth: empty,
            far_depth: empty,
            near: [[[0.0; LANES]; 3]; ROOM],
            far: [[[0.0; LANES]; 3]; ROOM],
            about: [Step::default(); ROOM],
            count: 0,
        };
        Self {
            optics,
            intervals,
            interval: [0; LANES],
            steps,
            length_per_depth: zero,
            front: [near_distance; LANES],
            composited: 0,
            closed: 0,
            near_distance,
            rgba: [[0.0; LANES]; 4],
            transmittance: [1.0; LANES],
            carried: [0.0; LANES],
            visible_from: [f64::INFINITY; LANES],
            seen: 0,
            opaque: 0,
            row_visible: 0,
            ends_passed: 0,
        }
    }

    /// What there is of a new ray before its first segment, as far as splitting goes.
    #[inline(always)]
    fn change_ray(&mut self, lane: usize, line: RayLine) {
        self.length_per_depth[lane] = line.length_per_depth;
        self.front[lane] = self.near_distance;
        self.composited &= !(1 << lane);
        self.closed &= !(1 << lane);
    }

    /// Splits the segments of a row at nodes.
    #[inline(always)]
    fn split_row(&mut self, intervals: &mut InRegisters<L>, rows: &mut Rows, row: usize, out: &mut Out<'_>) {
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
        let mut length = lanes.mul(depth, lanes.load(&self.length_per_depth));
        let (lo, hi) = (intervals.lo, intervals.hi);
        // The usual case: no node on the way.
        let above = lanes.and(lanes.lt(lo, to_scalar), lanes.lt(to_scalar, hi));
        let from = lanes.and_not(lanes.lt(s, hi), lanes.lt(s, lo));
        let within = lanes.bits(lanes.and(above, from));
        let mut visible = 0;
        if todo & !within == 0 {
            (visible, _) = self.piece(intervals, rows, row, (todo, s, to_scalar, length), out);
        } else {
            let descends = lanes.lt(to_scalar, s);
            let rise = lanes.abs(lanes.sub(to_scalar, s));
            let is_constant = lanes.lt(lanes.splat(0.0), rise);
            let per_scalar = lanes.select(is_constant, lanes.div(length, rise), lanes.splat(0.0));
            self.find_intervals(intervals, todo & !within, lanes.bits(descends), s);
            loop {
                let (lo, hi) = (intervals.lo, intervals.hi);
                let node = lanes.select(descends, lo, hi);
                let beyond = lanes.bits(lanes.lt(hi, to_scalar)) & !lanes.bits(descends)
                    | lanes.bits(lanes.lt(to_scalar, lo)) & lanes.bits(descends);
                let beyond = todo & beyond;
                let crosses = lanes.mask(beyond);
                let end = lanes.select(crosses, node, to_scalar);
                let part = lanes.mul(lanes.abs(lanes.sub(end, s)), per_scalar);
                let part = lanes.select(crosses, part, length);
                let (seen, deep) = self.piece(intervals, rows, row, (todo, s, end, part), out);
                visible |= seen;
                // Nothing behind a deep piece is seen.
                let beyond = beyond & !deep;
                if beyond == 0 {
                    break;
                }
                s = end;
                length = lanes.mul(lanes.abs(lanes.sub(to_scalar, s)), per_scalar);
                self.cross_nodes(intervals, beyond, lanes.bits(descends));
                todo = beyond;
            }
        }
        if visible != 0 {
            let front = lanes.select(lanes.mask(visible), to_depth, lanes.load(&self.front));
            self.front = lanes.store(front);
            self.composited |= visible;
        }
        if let Some(last) = self.steps.about[..self.steps.count].last_mut()
            && last.row == row
        {
            last.ends_row = true;
        }
    }

    /// Lanes in `which` begin in front of what there is: those that end there, too, are returned.
    #[cold]
    #[inline(never)]
    fn cut_hidden(&mut self, rows: &mut Rows, row: usize, mut which: u8, out: &mut Out<'_>) -> u8 {
        let (mut all, mut hidden) = (0, 0);
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            let to = (rows.to_depth[row][lane], rows.to_scalar[row][lane]);
            if to.0 <= self.front[lane] {
                hidden |= self.composited & 1 << lane;
                all |= 1 << lane;
            } else {
                let from = (rows.from_depth[row][lane], rows.from_scalar[row][lane]);
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

    /// Lanes find the intervals in which their segments begin.
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
            intervals.set(lanes, lane, table.interval(index));
        }
    }

    /// Lanes go to the intervals behind the next node.
    #[inline(always)]
    fn cross_nodes(&mut self, intervals: &mut InRegisters<L>, mut which: u8, descends: u8) {
        let Optics { lanes, table } = self.optics;
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            let index = self.interval[lane];
            let next = if descends >> lane & 1 == 1 { index - 1 } else { index + 1 };
            self.interval[lane] = next;
            intervals.set(lanes, lane, table.interval(next));
        }
    }

    /// Pieces of the lanes `todo`, from scalar to scalar, of a length: a step, if any can be seen. Returns those that can, and those
    /// behind which nothing can.
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

    /// Room for another step.
    #[inline(always)]
    fn new_step(&mut self, rows: &Rows, out: &mut Out<'_>) -> usize {
        if self.steps.count == ROOM {
            self.optics.lanes.vectorize(AddSteps { lights: self, rows, out });
        }
        self.steps.count += 1;
        self.steps.count - 1
    }

    /// Composites the steps that wait.
    #[inline(always)]
    fn add_steps(&mut self, rows: &Rows, out: &mut Out<'_>) {
        let count = std::mem::take(&mut self.steps.count);
        if count % 2 == 1 {
            (self.steps.near_depth[count], self.steps.far_depth[count]) = ([0.0; LANES], [0.0; LANES]);
        }
        let mut sum = self.load_sum();
        for pair in 0..count.div_ceil(2) {
            let near: &[[f32; WEIGHED_AT_ONCE]] = bytemuck::cast_slice(&self.steps.near_depth);
            let far: &[[f32; WEIGHED_AT_ONCE]] = bytemuck::cast_slice(&self.steps.far_depth);
            let (thin, has_thick) = weigh_thin(&near[pair], &far[pair]);
            // A copy, so that weights of thin pieces stay in registers.
            let weights = if has_thick {
                let mut weights = thin;
                self.optics.lanes.vectorize(WeighThick { near: &near[pair], far: &far[pair], weights: &mut weights });
                weights
            } else {
                thin
            };
            let [near, far]: [[__m256; 2]; 2] = cast(weights);
            self.add(rows, 2 * pair, &mut sum, [near[0], far[0]], out);
            if 2 * pair + 1 < count {
                self.add(rows, 2 * pair + 1, &mut sum, [near[1], far[1]], out);
            }
        }
        self.store_sum(&sum);
    }

    #[inline(always)]
    fn load_sum(&self) -> Sum {
        Sum { rgba: cast(self.rgba), transmittance: cast(self.transmittance), carried: cast(self.carried) }
    }

    #[inline(always)]
    fn store_sum(&mut self, sum: &Sum) {
        (self.rgba, self.transmittance) = (cast(sum.rgba), cast(sum.transmittance));
        self.carried = cast(sum.carried);
    }

    /// Composites the pieces of one step with these weights.
    #[inline(always)]
    fn add(&mut self, rows: &Rows, at: usize, sum: &mut Sum, [near, far]: [__m256; 2], out: &mut Out<'_>) {
        let lanes = self.optics.lanes;
        let about = self.steps.about[at];
        if rows.ends.get(self.ends_passed).is_some_and(|end| end.row < about.row) {
            self.store_sum(sum);
            self.pass_ends(rows, about.row, out);
            *sum = self.load_sum();
        }
        let gathered = lanes.mul_f32(sum.transmittance, lanes.add_f32(near, far));
        let (near, far) = (lanes.mul_f32(sum.transmittance, near), lanes.mul_f32(sum.transmittance, far));
        for i in 0..3 {
            let near = lanes.mul_f32(cast(self.steps.near[at][i]), near);
            let both = lanes.add_f32(near, lanes.mul_f32(cast(self.steps.far[at][i]), far));
            sum.rgba[i] = lanes.add_f32(sum.rgba[i], both);
        }
        sum.rgba[3] = lanes.add_f32(sum.rgba[3], lanes.add_f32(near, far));
        let change = lanes.sub_f32(sum.carried, gathered);
        let left = lanes.add_f32(sum.transmittance, change);
        sum.carried = lanes.sub_f32(change, lanes.sub_f32(left, sum.transmittance));
        sum.transmittance = left;
        let visible = about.visible & !self.opaque;
        out.stats.segments += u64::from(visible.count_ones());
        out.stats.out_of_order += u64::from((about.hidden & !self.opaque).count_ones());
        self.row_visible |= visible;
        if about.ends_row {
            if self.row_visible & !self.seen != 0 {
                self.see(rows, about.row);
            }
            self.row_visible = 0;
            let opaque = lanes.less_f32(sum.transmittance, lanes.splat_f32(OPAQUE_TRANSMITTANCE)) & !self.opaque;
            if opaque != 0 {
                self.close(rows, about.row, opaque, out);
                let clear = lanes.splat_f32(0.0);
                sum.transmittance = lanes.select_f32(lanes.mask(opaque), clear, sum.transmittance);
                sum.carried = lanes.select_f32(lanes.mask(opaque), clear, sum.carried);
            }
        }
    }

    /// Rays that have seen nothing before see something in this row. A table may show light before the transfer function
    /// has any: the ray is then asked again.
    #[cold]
    #[inline(never)]
    fn see(&mut self, rows: &Rows, row: usize) {
        let mut which = self.row_visible & !self.seen;
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            let from = (rows.from_depth[row][lane], rows.from_scalar[row][lane]);
            let to = (rows.to_depth[row][lane], rows.to_scalar[row][lane]);
            self.visible_from[lane] = first_visible(self.optics.table, from, to);
            self.seen |= u8::from(self.visible_from[lane] < f64::INFINITY) << lane;
        }
    }

    /// Rays become opaque at the end of this row.
    #[cold]
    #[inline(never)]
    fn close(&mut self, rows: &Rows, row: usize, mut which: u8, out: &mut Out<'_>) {
        self.opaque |= which;
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            out.stop_early(rows, lane, row);
        }
    }

    /// Rays are at their ends before this row.
    #[inline(never)]
    fn pass_ends(&mut self, rows: &Rows, row: usize, out: &mut Out<'_>) {
        while let Some(end) = rows.ends.get(self.ends_passed)
            && end.row < row
        {
            self.finish(end.lane, out, end.pixel);
            self.ends_passed += 1;
        }
    }
}

impl<L: Lanes> Lights for ExactLights<'_, L> {
    const CELLS: bool = false;

    #[inline(always)]
    fn composite(&mut self, rows: &mut Rows, out: &mut Out<'_>) {
        let lanes = self.optics.lanes;
        let mut ends = 0;
        self.ends_passed = 0;
        let mut intervals = self.intervals.load(lanes);
        for row in 0..rows.count {
            while let Some(end) = rows.ends.get(ends)
                && end.row < row
            {
                self.change_ray(end.lane, end.line);
                ends += 1;
            }
            self.split_row(&mut intervals, rows, row, out);
        }
        self.intervals = intervals.store(lanes);
        for end in &rows.ends[ends..] {
            self.change_ray(end.lane, end.line);
        }
        self.add_steps(rows, out);
        self.pass_ends(rows, rows.count, out);
        debug_assert!(self.closed & !self.opaque == 0, "what is not split is not seen");
    }

    fn begin(&mut self, lane: usize, line: RayLine) {
        self.change_ray(lane, line);
    }

    fn finish(&mut self, lane: usize, out: &mut Out<'_>, pixel: usize) {
        out.stats.rays_hit += 1;
        let rgba = self.rgba.map(|channel| channel[lane]);
        out.pixels[pixel] = TilePixel { rgba, depth: self.visible_from[lane] };
        self.rgba.iter_mut().for_each(|channel| channel[lane] = 0.0);
        (self.transmittance[lane], self.carried[lane]) = (1.0, 0.0);
        self.visible_from[lane] = f64::INFINITY;
        self.seen &= !(1 << lane);
        self.opaque &= !(1 << lane);
    }

    fn opaque(&self) -> u8 {
        self.opaque
    }
}

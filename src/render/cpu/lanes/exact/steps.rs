//! Steps of eight rays: queued pieces, weighed side by side and composited one after the other.

use super::super::super::super::medium::first_visible;
use super::super::cut::Cuts;
use super::super::rows::{Lights, Out, Rows};
use super::super::vector::{LANES, Lanes};
use super::{EightF32, ExactLights};
use crate::optics::{OPAQUE_TRANSMITTANCE, WEIGHED_AT_ONCE, weigh_thick, weigh_thin};
use pulp::{NullaryFnOnce, cast};
use std::arch::x86_64::__m256;

/// Capacity of the queue of steps.
pub(super) const ROOM: usize = 96;
const _: () = assert!(2 * LANES == WEIGHED_AT_ONCE && ROOM.is_multiple_of(2));

/// Queued pieces of all lanes.
#[repr(C, align(64))]
pub(super) struct Steps {
    pub(super) near_depth: [EightF32; ROOM],
    pub(super) far_depth: [EightF32; ROOM],
    /// Red, green and blue, for pieces that are not in a run.
    pub(super) near: [[EightF32; 3]; ROOM],
    pub(super) far: [[EightF32; 3]; ROOM],
    pub(super) about: [Step; ROOM],
    pub(super) count: usize,
}

#[derive(Clone, Copy, Default)]
pub(super) struct Step {
    pub(super) row: usize,
    /// Bits of the lanes that have a piece, or of a run's visible pieces.
    pub(super) visible: u8,
    /// Bits of the lanes whose segment lies in front of what was already composited.
    pub(super) hidden: u8,
    /// Whether it is the last step of its row.
    pub(super) ends_row: bool,
    /// The lane, and the place of the first one in the [`WholePieces`](crate::optics::exact::ExactTable::whole), if its pieces are a run.
    pub(super) run: Option<(usize, usize)>,
}

/// The light of eight rays in registers.
struct Sum {
    rgba: [__m256; 4],
    transmittance: __m256,
    /// Rounding error of the transmittance, as in [`Accumulator`](crate::optics::Accumulator).
    carried: __m256,
}

/// Call arguments of [`ExactLights::add_steps`].
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

/// Call arguments of [`weigh_thick`].
struct WeighThick<'a> {
    pub(super) near: &'a [f32; WEIGHED_AT_ONCE],
    pub(super) far: &'a [f32; WEIGHED_AT_ONCE],
    weights: &'a mut [[f32; WEIGHED_AT_ONCE]; 2],
}

impl NullaryFnOnce for WeighThick<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        weigh_thick(self.near, self.far, self.weights);
    }
}

impl<L: Lanes> ExactLights<'_, L> {
    /// Appends a step, compositing the queue if full; returns its index.
    #[inline(always)]
    pub(super) fn new_step(&mut self, rows: &Rows, out: &mut Out<'_>) -> usize {
        if self.steps.count == ROOM {
            self.optics.lanes.vectorize(AddSteps { lights: self, rows, out });
        }
        self.steps.count += 1;
        self.steps.count - 1
    }

    /// Composites the queued steps.
    #[inline(always)]
    pub(super) fn add_steps(&mut self, rows: &Rows, out: &mut Out<'_>) {
        let count = std::mem::take(&mut self.steps.count);
        if count % 2 == 1 {
            (self.steps.near_depth[count], self.steps.far_depth[count]) = ([0.0; LANES], [0.0; LANES]);
        }
        let mut sum = self.load_sum();
        // Runs are added in memory, since each is of one lane.
        let mut in_registers = true;
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
            let [near, far]: [[EightF32; 2]; 2] = cast(weights);
            for (half, (near, far)) in near.iter().zip(&far).enumerate().take(count - 2 * pair) {
                let at = 2 * pair + half;
                let about = self.steps.about[at];
                let ends = rows.ends.get(self.ends_passed).is_some_and(|end| end.row < about.row);
                if in_registers && (ends || about.run.is_some()) {
                    self.store_sum(&sum);
                    in_registers = false;
                }
                if ends {
                    self.pass_ends(rows, about.row, out);
                }
                match about.run {
                    Some(run) => {
                        self.add_run(at, run, [cast(*near), cast(*far)], out);
                    }
                    None => {
                        if !in_registers {
                            (sum, in_registers) = (self.load_sum(), true);
                        }
                        self.add(at, &mut sum, [cast(*near), cast(*far)], out);
                    }
                }
                if about.ends_row {
                    if !in_registers {
                        (sum, in_registers) = (self.load_sum(), true);
                    }
                    self.end_row(rows, about.row, &mut sum, out);
                }
            }
        }
        if in_registers {
            self.store_sum(&sum);
        }
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
    fn add(&mut self, at: usize, sum: &mut Sum, [near, far]: [__m256; 2], out: &mut Out<'_>) {
        let lanes = self.optics.lanes;
        let about = self.steps.about[at];
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
    }

    /// Ends a row: lanes that have become opaque receive no more light. Fragments of other layers lie at the ends of segments.
    #[inline(always)]
    fn end_row(&mut self, rows: &Rows, row: usize, sum: &mut Sum, out: &mut Out<'_>) {
        if self.row_visible & !self.seen != 0 {
            self.see(rows, row);
        }
        self.row_visible = 0;
        self.close_opaque(rows, row, sum, out);
        if let Some(cuts) = &rows.cuts
            && cuts.fragments[row] != 0
        {
            self.meet(cuts, row, sum);
            self.close_opaque(rows, row, sum, out);
        }
    }

    #[inline(always)]
    fn close_opaque(&mut self, rows: &Rows, row: usize, sum: &mut Sum, out: &mut Out<'_>) {
        let lanes = self.optics.lanes;
        let opaque = lanes.less_f32(sum.transmittance, lanes.splat_f32(OPAQUE_TRANSMITTANCE)) & !self.opaque;
        if opaque != 0 {
            self.close(rows, row, opaque, out);
            let transparent = lanes.splat_f32(0.0);
            sum.transmittance = lanes.select_f32(lanes.mask(opaque), transparent, sum.transmittance);
            sum.carried = lanes.select_f32(lanes.mask(opaque), transparent, sum.carried);
        }
    }

    /// Composites the fragments of a row.
    #[inline(always)]
    fn meet(&mut self, cuts: &Cuts, row: usize, sum: &mut Sum) {
        let lanes = self.optics.lanes;
        let which = lanes.mask(cuts.fragments[row]);
        let through = lanes.select_f32(which, sum.transmittance, lanes.splat_f32(0.0));
        for (channel, light) in sum.rgba.iter_mut().zip(&cuts.rgba[row]) {
            *channel = lanes.add_f32(*channel, lanes.mul_f32(cast(*light), through));
        }
        let change = lanes.sub_f32(sum.carried, lanes.mul_f32(through, cast(cuts.rgba[row][3])));
        let left = lanes.add_f32(sum.transmittance, change);
        sum.carried = lanes.sub_f32(change, lanes.sub_f32(left, sum.transmittance));
        sum.transmittance = left;
        let mut first = cuts.fragments[row] & !self.seen & !self.opaque;
        self.seen |= first;
        while first != 0 {
            let lane = first.trailing_zeros() as usize;
            first &= first - 1;
            self.visible_from[lane] = cuts.depth[row][lane];
        }
    }

    /// Sets the first visible depth of rays whose first visible piece is in this row. A table may show light before the transfer function
    /// has any: the ray is then tested again later.
    #[cold]
    #[inline(never)]
    fn see(&mut self, rows: &Rows, row: usize) {
        let mut which = self.row_visible & !self.seen;
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            self.visible_from[lane] = first_visible(self.optics.table, rows.from(row, lane), rows.to(row, lane));
            self.seen |= u8::from(self.visible_from[lane] < f64::INFINITY) << lane;
        }
    }

    /// Marks rays as opaque at the end of this row.
    #[cold]
    #[inline(never)]
    fn close(&mut self, rows: &Rows, row: usize, mut which: u8, out: &mut Out<'_>) {
        self.opaque |= which;
        while which != 0 {
            let lane = which.trailing_zeros() as usize;
            which &= which - 1;
            self.opaque_from[lane] = rows.to_depth[row][lane];
            out.stop_early(rows, lane, row);
        }
    }

    /// Finishes rays that end before this row.
    #[inline(never)]
    pub(super) fn pass_ends(&mut self, rows: &Rows, row: usize, out: &mut Out<'_>) {
        while let Some(end) = rows.ends.get(self.ends_passed)
            && end.row < row
        {
            self.finish(end.lane, out, end.pixel);
            self.take_up(end.lane, end.next, out);
            self.ends_passed += 1;
        }
    }
}

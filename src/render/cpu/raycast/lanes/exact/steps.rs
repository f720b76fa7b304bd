//! Steps of eight rays: pieces that wait, are weighed side by side and composited one after the other.

use super::super::super::super::super::medium::first_visible;
use super::super::rows::{Lights, Out, Rows};
use super::super::vector::{LANES, Lanes};
use super::{EightF32, ExactLights};
use crate::optics::{OPAQUE_TRANSMITTANCE, WEIGHED_AT_ONCE, weigh_thick, weigh_thin};
use pulp::{NullaryFnOnce, cast};
use std::arch::x86_64::__m256;

/// Steps that wait to be weighed, at most.
pub(super) const ROOM: usize = 96;
const _: () = assert!(2 * LANES == WEIGHED_AT_ONCE && ROOM.is_multiple_of(2));

/// Pieces of all lanes that wait to be weighed.
#[repr(C, align(64))]
pub(super) struct Steps {
    pub(super) near_depth: [EightF32; ROOM],
    pub(super) far_depth: [EightF32; ROOM],
    /// Red, green and blue, of pieces that are not of a run.
    pub(super) near: [[EightF32; 3]; ROOM],
    pub(super) far: [[EightF32; 3]; ROOM],
    pub(super) about: [Step; ROOM],
    pub(super) count: usize,
}

#[derive(Clone, Copy, Default)]
pub(super) struct Step {
    pub(super) row: usize,
    /// Bits of the lanes that have a piece, or of the pieces of a run that can be seen.
    pub(super) visible: u8,
    /// Bits of the lanes that have a segment in front of what there is.
    pub(super) hidden: u8,
    /// Whether it is the last one of its row.
    pub(super) ends_row: bool,
    /// If its pieces are of one lane, one behind the other.
    pub(super) run: Option<Run>,
}

/// Whole pieces of a segment, as many as there are lanes at most.
#[derive(Clone, Copy)]
pub(super) struct Run {
    pub(super) lane: usize,
    pub(super) falls: bool,
    /// Place of the first one in the [`WholePieces`](crate::optics::exact::WholePieces).
    pub(super) first: usize,
    pub(super) count: usize,
}

/// The light of eight rays in registers.
struct Sum {
    rgba: [__m256; 4],
    transmittance: __m256,
    /// What rounding has left out of that, as in [`Accumulator`](crate::optics::Accumulator).
    carried: __m256,
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
    /// Room for another step.
    #[inline(always)]
    pub(super) fn new_step(&mut self, rows: &Rows, out: &mut Out<'_>) -> usize {
        if self.steps.count == ROOM {
            self.optics.lanes.vectorize(AddSteps { lights: self, rows, out });
        }
        self.steps.count += 1;
        self.steps.count - 1
    }

    /// Composites the steps that wait.
    #[inline(always)]
    pub(super) fn add_steps(&mut self, rows: &Rows, out: &mut Out<'_>) {
        let count = std::mem::take(&mut self.steps.count);
        if count % 2 == 1 {
            (self.steps.near_depth[count], self.steps.far_depth[count]) = ([0.0; LANES], [0.0; LANES]);
        }
        let mut sum = self.load_sum();
        // Runs are added in memory, since they are of one lane.
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
                        self.add_run(at, run, [near, far], out);
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

    /// At the end of a row: lanes that have become opaque take no more.
    #[inline(always)]
    fn end_row(&mut self, rows: &Rows, row: usize, sum: &mut Sum, out: &mut Out<'_>) {
        let lanes = self.optics.lanes;
        if self.row_visible & !self.seen != 0 {
            self.see(rows, row);
        }
        self.row_visible = 0;
        let opaque = lanes.less_f32(sum.transmittance, lanes.splat_f32(OPAQUE_TRANSMITTANCE)) & !self.opaque;
        if opaque != 0 {
            self.close(rows, row, opaque, out);
            let transparent = lanes.splat_f32(0.0);
            sum.transmittance = lanes.select_f32(lanes.mask(opaque), transparent, sum.transmittance);
            sum.carried = lanes.select_f32(lanes.mask(opaque), transparent, sum.carried);
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
            self.visible_from[lane] = first_visible(self.optics.table, rows.from(row, lane), rows.to(row, lane));
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
    pub(super) fn pass_ends(&mut self, rows: &Rows, row: usize, out: &mut Out<'_>) {
        while let Some(end) = rows.ends.get(self.ends_passed)
            && end.row < row
        {
            self.finish(end.lane, out, end.pixel);
            self.ends_passed += 1;
        }
    }
}

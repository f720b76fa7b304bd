//! Slices: how much work is submitted to the GPU at once.

use std::time::Duration;

/// Slices under way at a time, so that the GPU never waits for the next one.
pub(super) const IN_FLIGHT: usize = 2;
/// WebGPU's limit on the workgroups of a dispatch in one dimension.
pub(super) const GROUPS_MAX: u32 = 65_535;
/// Target length of a slice: a cancelled job ends within it, and other users of the GPU get their turn.
pub(super) const SLICE: Duration = Duration::from_millis(15);

/// Measured milliseconds per unit of work (a tile, a group of faces). Units differ: tiles at the rim of an image are mostly empty.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UnitCost {
    /// Mean over the last slice.
    last: Option<f64>,
    /// Mean over the last frame.
    mean: Option<f64>,
    /// Sums of milliseconds and units over the frame under way.
    ms: f64,
    units: usize,
}

impl UnitCost {
    /// Units of a slice if the slices under way share `budget`; `first` while the cost is unknown. At most `most`.
    pub(super) fn units_for(self, budget: Duration, first: usize, most: usize) -> usize {
        if budget == Duration::MAX {
            return most;
        }
        self.units_in(budget.as_secs_f64() * 1e3 / IN_FLIGHT as f64, first, most)
    }

    /// Units that take no longer than `ms`, by the larger of both means: a slice of empty units says little about the next one.
    fn units_in(self, ms: f64, first: usize, most: usize) -> usize {
        let per_unit = self.last.into_iter().chain(self.mean).reduce(f64::max);
        let units = per_unit.map_or(first as f64, |per_unit| ms / per_unit.max(1e-6));
        // Before a whole frame is measured, slices grow to twice `first` at most.
        let most = if self.mean.is_some() { most } else { most.min(2 * first) };
        (units as usize).clamp(1, most.max(1))
    }

    /// Resets the frame's sums.
    pub(super) fn begin_frame(&mut self) {
        (self.ms, self.units) = (0.0, 0);
    }

    /// Adds a slice that has come back.
    pub(super) fn add(&mut self, ms: f64, units: usize) {
        self.last = Some(ms / units.max(1) as f64);
        self.ms += ms;
        self.units += units;
    }

    /// Ends a frame: its mean becomes the estimate for the next one.
    pub(super) fn end_frame(&mut self) {
        if self.units > 0 {
            self.mean = Some(self.ms / self.units as f64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_tiles_do_not_make_the_next_slice_long() {
        let units_in = |cost: UnitCost, ms: f64| cost.units_in(ms, 32, GROUPS_MAX as usize);
        let new = UnitCost::default();
        assert_eq!(units_in(new, 7.5), 32);
        let empty = Some(1e-4);
        assert_eq!(units_in(UnitCost { last: empty, ..new }, 7.5), 64);
        assert_eq!(units_in(UnitCost { last: empty, mean: Some(0.5), ..new }, 7.5), 15);
        assert_eq!(units_in(UnitCost { last: Some(3.0), mean: Some(0.5), ..new }, 7.5), 2);
        assert_eq!(units_in(UnitCost { last: Some(100.0), ..new }, 7.5), 1);
        assert_eq!(units_in(UnitCost { last: empty, mean: Some(0.0), ..new }, 1e9), GROUPS_MAX as usize);
    }

    #[test]
    fn a_step_makes_no_leaps_before_a_whole_frame_is_done() {
        let mut cost = UnitCost::default();
        let units = |cost: UnitCost| cost.units_for(SLICE, 32, GROUPS_MAX as usize);
        for _ in 0..10 {
            assert!(units(cost) <= 64);
            cost.add(1e-3, 64);
        }
        cost.end_frame();
        assert_eq!(units(cost), GROUPS_MAX as usize);
        // A dear slice of the next frame counts at once, and in the end the whole frame does.
        cost.begin_frame();
        cost.add(15.0, 10);
        assert_eq!(units(cost), 5);
        cost.add(3.0, 5);
        cost.end_frame();
        assert_eq!((cost.last, cost.mean), (Some(0.6), Some(1.2)));
    }
}

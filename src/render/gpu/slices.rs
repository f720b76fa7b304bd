//! Work in slices: how much of it is given to the GPU at once.

use std::time::Duration;

/// Slices under way at a time: the GPU has the next when it is done with one.
pub(super) const IN_FLIGHT: usize = 2;
/// Workgroups of a dispatch in one dimension; WebGPU's limit.
pub(super) const GROUPS_MAX: u32 = 65_535;
/// The longest that the GPU is given work at once: what is cancelled ends after it, and other users of the GPU have a turn.
pub(super) const SLICE: Duration = Duration::from_millis(15);

/// Milliseconds of a unit of work (a tile, a group of faces), as far as they are known. Units differ: tiles at the rim of
/// an image are mostly empty.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UnitCost {
    /// Of the last slice.
    pub(super) last: Option<f64>,
    /// On average over the last frame.
    pub(super) mean: Option<f64>,
}

impl UnitCost {
    /// Units for `budget`, shared by the slices under way; `first` of them in the first slice of all, before anything is known
    /// of their cost. At most `most`.
    pub(super) fn units_for(self, budget: Duration, first: usize, most: usize) -> usize {
        if budget == Duration::MAX {
            return most;
        }
        self.units_in(budget.as_secs_f64() * 1e3 / IN_FLIGHT as f64, first, most)
    }

    /// Units that take no longer than `ms`. A slice of empty units says little about the next one.
    fn units_in(self, ms: f64, first: usize, most: usize) -> usize {
        let per_unit = self.last.into_iter().chain(self.mean).reduce(f64::max);
        let units = per_unit.map_or(first as f64, |per_unit| ms / per_unit.max(1e-6));
        // Without a whole frame to go by, no leaps.
        let most = if self.mean.is_some() { most } else { most.min(2 * first) };
        (units as usize).clamp(1, most.max(1))
    }
}

/// What a step of a frame costs, slice by slice.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StepCost {
    unit: UnitCost,
    /// Milliseconds and units of the frame under way.
    ms: f64,
    units: usize,
}

impl StepCost {
    /// Of a unit.
    pub(super) fn unit(self) -> UnitCost {
        self.unit
    }

    /// Begins a frame.
    pub(super) fn begin_frame(&mut self) {
        (self.ms, self.units) = (0.0, 0);
    }

    /// Counts a slice that has come back.
    pub(super) fn add(&mut self, ms: f64, units: usize) {
        self.unit.last = Some(ms / units.max(1) as f64);
        self.ms += ms;
        self.units += units;
    }

    /// The frame is done: what its step has cost is what the next one's is expected to.
    pub(super) fn end_frame(&mut self) {
        if self.units > 0 {
            self.unit.mean = Some(self.ms / self.units as f64);
        }
    }
}

/// Starts at least so many workgroups, in rows if there are more than a row may have.
pub(super) fn dispatch(pass: &mut wgpu::ComputePass<'_>, workgroups: u32) {
    let rows = workgroups.div_ceil(GROUPS_MAX).max(1);
    pass.dispatch_workgroups(workgroups.div_ceil(rows), rows, 1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_tiles_do_not_make_the_next_slice_long() {
        let units_in = |cost: UnitCost, ms: f64| cost.units_in(ms, 32, GROUPS_MAX as usize);
        assert_eq!(units_in(UnitCost::default(), 7.5), 32);
        let empty = Some(1e-4);
        assert_eq!(units_in(UnitCost { last: empty, mean: None }, 7.5), 64);
        assert_eq!(units_in(UnitCost { last: empty, mean: Some(0.5) }, 7.5), 15);
        assert_eq!(units_in(UnitCost { last: Some(3.0), mean: Some(0.5) }, 7.5), 2);
        assert_eq!(units_in(UnitCost { last: Some(100.0), mean: None }, 7.5), 1);
        assert_eq!(units_in(UnitCost { last: empty, mean: Some(0.0) }, 1e9), GROUPS_MAX as usize);
    }

    #[test]
    fn a_step_makes_no_leaps_before_a_whole_frame_is_done() {
        let mut cost = StepCost::default();
        let units = |cost: StepCost| cost.unit().units_for(SLICE, 32, GROUPS_MAX as usize);
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
        assert_eq!((cost.unit().last, cost.unit().mean), (Some(0.6), Some(1.2)));
    }
}

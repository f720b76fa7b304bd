//! Whole pieces, from node to node: all but the first and the last one of a segment that crosses many nodes. Their end values are those of
//! the table and only their lengths depend on the segment, so that many can be computed side by side.
//!
//! Tables for the longest path have many nodes: of three tents over viridis 530, of a ramp of opacity 233, most of them the 256 colours of the
//! map.

use super::Interval;
use super::run::RUN;
use glam::Vec4;

/// The intervals of a table in the order in which rising scalars traverse them, then in that of falling ones, each padded with pieces whose
/// ends no scalar reaches.
#[derive(Clone, Debug, Default)]
pub(crate) struct WholePieces {
    /// Scalars at the far ends, negated where scalars fall, so that they ascend.
    ends: Vec<f64>,
    /// Red, green, blue and extinction at the near ends, then at the far ends.
    values: [Vec<f32>; 8],
}

impl WholePieces {
    pub(super) fn new(intervals: &[Interval]) -> Self {
        let mut all = Self::default();
        intervals.iter().for_each(|i| all.push(i.hi, i.ends()));
        all.pad();
        for i in intervals.iter().rev() {
            let [lo, hi] = i.ends();
            all.push(-i.lo, [hi, lo]);
        }
        all.pad();
        all
    }

    fn push(&mut self, end: f64, values: [Vec4; 2]) {
        self.ends.push(end);
        for (channel, value) in self.values.iter_mut().zip(values.iter().flat_map(|end| end.to_array())) {
            channel.push(value);
        }
    }

    fn pad(&mut self) {
        (0..RUN).for_each(|_| self.push(f64::INFINITY, [Vec4::ZERO; 2]));
    }

    /// Where the piece of an interval is, followed by those that the scalar traverses next; of a place, its interval.
    #[inline(always)]
    pub(crate) fn place_of(&self, interval: usize, falls: bool) -> usize {
        // The last ones are padding.
        if falls { self.ends.len() - 1 - RUN - interval } else { interval }
    }

    /// The pieces from a place on that make a run; `None` where there are no more.
    #[inline(always)]
    pub(crate) fn run(&self, first: usize) -> Option<RunOfPieces<'_>> {
        // A piece begins where the one before ends.
        let [begins, ends] = [of_run(&self.ends, first.checked_sub(1)?)?, of_run(&self.ends, first)?];
        let [.., near, _, _, _, far] = &self.values;
        Some(RunOfPieces { begins, ends, extinctions: [of_run(near, first)?, of_run(far, first)?] })
    }

    /// Red, green and blue at the near and at the far ends of these pieces.
    #[inline(always)]
    pub(crate) fn colors(&self, first: usize) -> Option<[[Eight<'_, f32>; 2]; 3]> {
        let [r, g, b, _, far_r, far_g, far_b, _] = &self.values;
        let both = |near, far| Some([of_run(near, first)?, of_run(far, first)?]);
        Some([both(r, far_r)?, both(g, far_g)?, both(b, far_b)?])
    }
}

/// [`WholePieces`] that make a run.
pub(crate) struct RunOfPieces<'a> {
    /// Scalars at the near and at the far ends, negated where scalars fall.
    pub(crate) begins: Eight<'a, f64>,
    pub(crate) ends: Eight<'a, f64>,
    /// Extinctions at the near and at the far ends.
    pub(crate) extinctions: [Eight<'a, f32>; 2],
}

/// One number for each piece of a run.
type Eight<'a, T> = &'a [T; RUN];

#[inline(always)]
fn of_run<T>(all: &[T], first: usize) -> Option<Eight<'_, T>> {
    all.get(first..)?.first_chunk()
}

//! Scalar ranges of the chunks of a step's vertices or cells, as far as they are known.
//!
//! They are learned when a step is first decoded. From then on chunks without a visible cell need not be decoded again: when a loop
//! restarts, when playback goes back, when the transfer function changes.

use super::kept::StepRanges;
use super::series::Series;
use super::time::FrameTime;
use crate::field::Association;
use crate::visibility::{Clusters, Label, TransparentIntervals};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Arc, MutexGuard, PoisonError};

/// The chunks needed at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Needed {
    /// Whether each chunk is needed.
    pub(super) chunks: Vec<bool>,
    /// Labels of the chunks that are not needed.
    pub(super) labels: Vec<Option<Label>>,
}

impl Series {
    /// The clusters of its mesh.
    pub(super) fn clusters(&self) -> &Arc<Clusters> {
        if let Some(clusters) = self.ranges.clusters.get() {
            return clusters;
        }
        // Computed outside of the once-cell: a thread that waits in rayon may be given a task that asks for the clusters, too.
        let clusters = Arc::new(Clusters::new(&self.mesh));
        self.ranges.clusters.get_or_init(|| clusters)
    }

    fn known_ranges(&self) -> MutexGuard<'_, HashMap<usize, StepRanges>> {
        self.ranges.steps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Least and greatest scalar of each chunk of a step; `None` if not learned.
    pub(super) fn ranges_of(&self, step: usize) -> Option<StepRanges> {
        self.known_ranges().get(&step).cloned()
    }

    /// Learns the ranges of a step from all of its scalars.
    pub(super) fn learn_ranges(&self, step: usize, scalars: &[f32]) {
        let steps_max = self.ranges.steps_max(scalars.len());
        let is_learned = |steps: &HashMap<_, _>| steps.len() < steps_max && !steps.contains_key(&step);
        if !is_learned(&self.known_ranges()) {
            return;
        }
        // Computed without the lock, for the same reason as above.
        let ranges = scalars.par_chunks(Clusters::SCALARS).map(range).collect::<Vec<_>>();
        let mut steps = self.known_ranges();
        if is_learned(&steps) {
            steps.insert(step, ranges.into());
        }
    }

    /// The chunks needed at a time where the table is not transparent; `None` if all are needed, or no ranges are known.
    pub(super) fn needed_chunks(&self, time: FrameTime, transparent: &TransparentIntervals) -> Option<Needed> {
        let ranges = self.ranges_of(time.step())?;
        // A mixed scalar lies between the two that it is mixed from.
        let others = match time.toward() {
            None => ranges.clone(),
            Some((next, _)) => self.ranges_of(next)?,
        };
        let hull = |(&[a, b], &[c, d]): (&[f32; 2], &[f32; 2])| {
            let is_known = ![a, b, c, d].iter().any(|end| end.is_nan());
            transparent.label_of_range(a.min(c), b.max(d)).filter(|_| is_known)
        };
        let mut labels: Vec<Option<Label>> = ranges.iter().zip(&*others).map(hull).collect();
        let chunks = match self.values_of() {
            Association::Point => self.clusters().needed_scalars(&labels),
            // A cell shows its own scalar alone.
            Association::Cell => labels.iter().map(Option::is_none).collect(),
        };
        if chunks.iter().all(|&needed| needed) {
            return None;
        }
        labels.iter_mut().zip(&chunks).filter(|(_, needed)| **needed).for_each(|(label, _)| *label = None);
        Some(Needed { chunks, labels })
    }
}

/// Least and greatest of some scalars; NaN if one is not finite.
fn range(scalars: &[f32]) -> [f32; 2] {
    let all_finite = scalars.iter().all(|s| s.is_finite());
    let fold = |[lo, hi]: [f32; 2], &s: &f32| [lo.min(s), hi.max(s)];
    if all_finite { scalars.iter().fold([f32::INFINITY, f32::NEG_INFINITY], fold) } else { [f32::NAN; 2] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::kept::ChunkRanges;

    #[test]
    fn as_many_steps_are_learned_as_have_room() {
        let ranges = ChunkRanges::default();
        assert_eq!([1, 256, 257, 1 << 31].map(|n| ranges.steps_max(n)), [8 << 20, 8 << 20, 4 << 20, 1]);
    }

    #[test]
    fn steps_beyond_the_room_for_them_are_not_learned() {
        let (series, _) = super::super::test_series::logged(5);
        let mut series = Arc::into_inner(series).unwrap();
        series.ranges.bytes_max = 2 * size_of::<[f32; 2]>();
        for step in [3, 1, 3, 0, 2] {
            series.learn_ranges(step, &[1.0, 2.0]);
        }
        let mut known: Vec<usize> = series.known_ranges().keys().copied().collect();
        known.sort_unstable();
        assert_eq!(known, [1, 3], "those that were decoded first");
    }
}

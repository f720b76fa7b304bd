//! Reuses active cells when the transparent intervals change and the scalars stay: a moved isovalue, an edited table.
//!
//! A cell's visibility depends only on the intervals between its least and greatest scalar. If old and new intervals are equal over the
//! scalar range of the 64 cells in a word of a set, the word is unchanged.

use super::{TransparentIntervals, VISIBLE};
use crate::mesh::Topology;
use rayon::prelude::*;
use std::sync::{Arc, Weak};

/// Above this number of differences all cells are classified again: each word is compared with each difference.
const DIFFERENCES_MAX: usize = 16;

/// Differences of two lists of intervals, as pairs: a range `least..=greatest` is affected by a pair only if `least` is at most its first
/// and `greatest` at least its second number.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Differences(Vec<[f32; 2]>);

impl Differences {
    /// The differences between two lists; `None` if there are too many to be of use.
    pub(super) fn between(before: &TransparentIntervals, now: &TransparentIntervals) -> Option<Self> {
        let [a, b] = [before, now].map(TransparentIntervals::steps);
        let has = |steps: &[f32], step: f32| steps.binary_search_by(|other| other.total_cmp(&step)).is_ok();
        let mut steps = [a.clone(), b.clone()].concat();
        steps.sort_unstable_by(f32::total_cmp);
        steps.dedup();
        let only_one = steps.iter().filter(|&&step| !has(&a, step) || !has(&b, step));
        let mut found: Vec<[f32; 2]> = only_one.map(|step| [step.next_down(), *step]).collect();
        // Between two steps each list has a single label.
        let begins = std::iter::once(f32::MIN).chain(steps.iter().copied());
        let ends = steps.iter().map(|step| step.next_down()).chain(std::iter::once(f32::MAX));
        let is_shown = |transparent: &TransparentIntervals, scalar| transparent.label(scalar) == VISIBLE;
        let differ = |&(begin, end): &(f32, f32)| begin <= end && is_shown(before, begin) != is_shown(now, begin);
        found.extend(std::iter::zip(begins, ends).filter(differ).map(|(begin, end)| [end, begin]));
        (found.len() <= DIFFERENCES_MAX).then_some(Self(found))
    }

    /// Whether cells with scalars from `least` to `greatest` are unchanged.
    pub(super) fn leave(&self, [least, greatest]: [f32; 2]) -> bool {
        self.0.iter().all(|&[below, from]| least > below || greatest < from)
    }
}

/// Scalar range at the corners of the cells in each word of a set, cached while the scalars stay. Words with a non-finite scalar have an
/// infinite range.
#[derive(Debug, Default)]
pub(super) struct WordRanges {
    of: Weak<Vec<f32>>,
    ranges: Vec<[f32; 2]>,
}

impl WordRanges {
    /// The ranges for these scalars, computed anew if the scalars differ (by pointer).
    pub(super) fn of(&mut self, topology: &Topology, scalars: &Arc<Vec<f32>>) -> &[[f32; 2]] {
        if self.of.as_ptr() != Arc::as_ptr(scalars) {
            let ranges = topology.tets.par_chunks(64).with_min_len(64).map(|tets| range(tets, scalars));
            ranges.collect_into_vec(&mut self.ranges);
            self.of = Arc::downgrade(scalars);
        }
        &self.ranges
    }
}

/// Least and greatest scalar of some cells; -infinity to infinity if one is not finite.
fn range(tets: &[[u32; 4]], scalars: &[f32]) -> [f32; 2] {
    // Per corner, so that the comparisons are independent.
    let (mut least, mut greatest, mut largest) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4], [0; 4]);
    for tet in tets {
        for (corner, &vertex) in tet.iter().enumerate() {
            let scalar = scalars[vertex as usize];
            least[corner] = if scalar < least[corner] { scalar } else { least[corner] };
            greatest[corner] = if scalar > greatest[corner] { scalar } else { greatest[corner] };
            largest[corner] = scalar.abs().to_bits().max(largest[corner]);
        }
    }
    if largest.iter().any(|&bits| bits >= f32::INFINITY.to_bits()) {
        return [f32::NEG_INFINITY, f32::INFINITY];
    }
    [least.into_iter().fold(f32::INFINITY, f32::min), greatest.into_iter().fold(f32::NEG_INFINITY, f32::max)]
}

//! What a change of the transparent intervals changes while the scalars stay: an isovalue that is moved, a table that is edited.
//!
//! A cell shows something or not by the intervals between its least scalar and its greatest. Where the intervals of before and now are the
//! same between the least and the greatest scalar of the 64 cells in a word of a set, the word is the same.

use super::{TransparentIntervals, VISIBLE};
use crate::mesh::Topology;
use rayon::prelude::*;
use std::sync::{Arc, Weak};

/// Differences beyond which all cells are looked at: each word is compared with each difference.
const DIFFERENCES_MAX: usize = 16;

/// Where two lists of intervals differ: one of them alone tells scalars from `least` to `greatest` apart, or shows one of them, only if
/// `least` is at most the first and `greatest` at least the second number of a pair.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Differences(Vec<[f32; 2]>);

impl Differences {
    /// Those between two lists; `None` if there are too many to be of use.
    pub(super) fn between(before: &TransparentIntervals, now: &TransparentIntervals) -> Option<Self> {
        let [a, b] = [before, now].map(TransparentIntervals::steps);
        let has = |steps: &[f32], step: f32| steps.binary_search_by(|other| other.total_cmp(&step)).is_ok();
        let mut steps = [a.clone(), b.clone()].concat();
        steps.sort_unstable_by(f32::total_cmp);
        steps.dedup();
        let only_one = steps.iter().filter(|&&step| !has(&a, step) || !has(&b, step));
        let mut found: Vec<[f32; 2]> = only_one.map(|step| [step.next_down(), *step]).collect();
        // Between two steps both lists have one label each.
        let begins = std::iter::once(f32::MIN).chain(steps.iter().copied());
        let ends = steps.iter().map(|step| step.next_down()).chain(std::iter::once(f32::MAX));
        let is_shown = |transparent: &TransparentIntervals, scalar| transparent.label(scalar) == VISIBLE;
        let differ = |&(begin, end): &(f32, f32)| begin <= end && is_shown(before, begin) != is_shown(now, begin);
        found.extend(std::iter::zip(begins, ends).filter(differ).map(|(begin, end)| [end, begin]));
        (found.len() <= DIFFERENCES_MAX).then_some(Self(found))
    }

    /// Whether cells with scalars from `least` to `greatest` are as before.
    pub(super) fn leave(&self, [least, greatest]: [f32; 2]) -> bool {
        self.0.iter().all(|&[below, from]| least > below || greatest < from)
    }
}

/// The least and the greatest scalar at the corners of the cells in each word of a set, while the scalars stay. Words with a scalar that is
/// not finite have all scalars.
#[derive(Debug, Default)]
pub(super) struct WordRanges {
    of: Weak<Vec<f32>>,
    ranges: Vec<[f32; 2]>,
}

impl WordRanges {
    /// The ranges for these scalars, found if they are not those of the last ones.
    pub(super) fn of(&mut self, topology: &Topology, scalars: &Arc<Vec<f32>>) -> &[[f32; 2]] {
        if self.of.as_ptr() != Arc::as_ptr(scalars) {
            let ranges = topology.tets.par_chunks(64).with_min_len(64).map(|tets| range(tets, scalars));
            ranges.collect_into_vec(&mut self.ranges);
            self.of = Arc::downgrade(scalars);
        }
        &self.ranges
    }
}

/// The least and the greatest scalar of some cells; from -infinity to infinity if one is not finite.
fn range(tets: &[[u32; 4]], scalars: &[f32]) -> [f32; 2] {
    // Corners do not wait for each other's comparisons.
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

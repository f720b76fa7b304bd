//! The steps of a frame.

use super::bands::Band;
use crate::render::RenderJob;
use crate::render::gpu::layout::{DEEP, ELEMENTS_PER_GROUP, ListParams, Lists, Params};
use crate::render::gpu::readback::Sent;
use crate::render::gpu::shaders::{FragmentKind, Stage};
use crate::render::gpu::slices::GROUPS_MAX;
use crate::render::gpu::target::Target;
use std::ops::Range;
use std::sync::Arc;

/// The steps of a frame, in order; those from `Store` on are repeated for each band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render::gpu) enum Step {
    Count,
    CountStarts,
    CountPieces,
    Scan,
    Store,
    StoreStarts,
    StorePieces,
    Sort,
    Resolve,
    /// All work has been submitted.
    End,
}

/// Number of steps before the end.
pub(in crate::render::gpu) const STEPS: usize = 9;

impl Step {
    /// Units of the very first slice, whose cost is unknown.
    pub(in crate::render::gpu) fn first_units(self) -> usize {
        match self {
            Self::Count | Self::Store => 64,
            Self::Sort => 1,
            _ => 32,
        }
    }

    /// Fewest units of a slice, whatever they cost: fewer would leave most of the GPU idle, and a slice has a cost of its own.
    pub(in crate::render::gpu) fn least_units(self) -> usize {
        match self {
            Self::Count | Self::Store => 32,
            Self::Sort => 1,
            _ => 4,
        }
    }

    /// Most units of a slice.
    pub(in crate::render::gpu) fn most_units(self) -> usize {
        match self {
            Self::Resolve => GROUPS_MAX as usize,
            // The mask of a round is in the parameters of its slice.
            Self::Sort => 1,
            _ => u32::MAX as usize,
        }
    }
}

/// Rounds of a sorting network for `count` fragments: level l, from 1 to ceil(log2 `count`), has l rounds.
fn sort_rounds(count: u32) -> usize {
    let levels = count.max(1).next_power_of_two().ilog2() as usize;
    levels * (levels + 1) / 2
}

/// The bits in which the places of two compared fragments differ in round `round` of a sorting network: in the first round of a level
/// all bits of the level (one sorted half against the other, reversed), then single bits, highest first.
fn sort_mask(round: usize) -> u32 {
    let (mut level, mut first) = (1, 0);
    while first + level <= round {
        first += level;
        level += 1;
    }
    match round - first {
        0 => (1 << level) - 1,
        next => 1 << (level - 1 - next),
    }
}

/// Work that has been submitted.
pub(in crate::render::gpu) struct Flight {
    pub(in crate::render::gpu) step: Step,
    pub(in crate::render::gpu) units: usize,
    pub(in crate::render::gpu) work: Work,
}

/// How a slice comes back.
pub(in crate::render::gpu) enum Work {
    /// Nothing is read back.
    Plain(wgpu::SubmissionIndex),
    /// Resolved pixels; `ends_tiles` if they are the last of their tiles.
    Pixels { sent: Sent, ends_tiles: bool },
}

/// The stages that a job's steps run.
#[derive(Clone, Copy, Debug)]
pub(in crate::render::gpu) struct Stages {
    /// Count and store the fragments of elements.
    pub(in crate::render::gpu) find: [Stage; 2],
    /// Count and store those of elements with large boxes, tile by tile.
    pub(in crate::render::gpu) pieces: [Stage; 2],
    /// Count and store the rays that begin in a cell, if there are such fragments.
    pub(in crate::render::gpu) starts: Option<[Stage; 2]>,
    pub(in crate::render::gpu) sort: Stage,
    pub(in crate::render::gpu) resolve: Stage,
}

impl Stages {
    /// All of them.
    pub(in crate::render::gpu) fn all(self) -> impl Iterator<Item = Stage> {
        let found = [self.find, self.pieces].into_iter().chain(self.starts).flatten();
        found.chain([Stage::FragmentScan, self.sort, self.resolve])
    }

    /// The stage of a step; `None` if it has none.
    pub(in crate::render::gpu) fn of(self, step: Step) -> Option<Stage> {
        let Self { find: [count, store], pieces: [count_pieces, store_pieces], starts, sort, resolve } = self;
        match step {
            Step::Count => Some(count),
            Step::CountStarts => starts.map(|[count, _]| count),
            Step::CountPieces => Some(count_pieces),
            Step::Scan => Some(Stage::FragmentScan),
            Step::Store => Some(store),
            Step::StoreStarts => starts.map(|[_, store]| store),
            Step::StorePieces => Some(store_pieces),
            Step::Sort => Some(sort),
            Step::Resolve => Some(resolve),
            Step::End => None,
        }
    }
}

/// A job of [`FragmentLists`](super::FragmentLists).
pub struct ListJob {
    pub(in crate::render::gpu) job: RenderJob,
    pub(in crate::render::gpu) stages: Stages,
    pub(in crate::render::gpu) kind: FragmentKind,
    pub(in crate::render::gpu) params: Params,
    pub(in crate::render::gpu) list_params: ListParams,
    pub(in crate::render::gpu) target: Arc<Target>,
    pub(in crate::render::gpu) lists: Lists,
    pub(in crate::render::gpu) step: Step,
    /// First unit of the step that has not been submitted.
    pub(in crate::render::gpu) next: usize,
    /// Number of pieces of large elements.
    pub(in crate::render::gpu) pieces: u32,
    /// Index of the band under way.
    pub(in crate::render::gpu) band: usize,
}

impl ListJob {
    /// Sets `next` to the step's first unit.
    pub(in crate::render::gpu) fn begin_step(&mut self, bands: &[Band]) {
        self.next = self.units(self.step, bands).start;
    }

    /// Units of a step.
    pub(in crate::render::gpu) fn units(&self, step: Step, bands: &[Band]) -> Range<usize> {
        let band = || bands.get(self.band).cloned().unwrap_or_default();
        let is_empty = || band().fragments == 0;
        let has_starts = self.stages.starts.is_some() && self.list_params.eye_count > 0;
        let groups = self.list_params.drawn_count.div_ceil(ELEMENTS_PER_GROUP) as usize;
        match step {
            Step::Count => 0..groups,
            Step::CountStarts if has_starts => 0..self.params.tile_count(),
            Step::CountPieces => 0..self.pieces as usize,
            Step::Scan => 0..1,
            Step::Store if !is_empty() => 0..groups,
            Step::StoreStarts if has_starts && !is_empty() => band().tiles,
            Step::StorePieces if !is_empty() => 0..self.pieces as usize,
            Step::Sort if band().deepest > DEEP => 0..sort_rounds(band().deepest),
            Step::Resolve => band().tiles,
            Step::Sort | Step::CountStarts | Step::Store | Step::StoreStarts | Step::StorePieces | Step::End => 0..0,
        }
    }

    /// Writes the next units of a step to the parameters. Returns the number of workgroups.
    pub(in crate::render::gpu) fn choose(&mut self, step: Step, units: &Range<usize>) -> u32 {
        let list_params = &mut self.list_params;
        let tiles = self.params.tile_count() as u32;
        match step {
            Step::Count | Step::Store => {
                let element = |group: usize| (group as u32).saturating_mul(ELEMENTS_PER_GROUP);
                list_params.first = element(units.start);
                list_params.end = element(units.end).min(list_params.drawn_count);
            }
            Step::Scan => (list_params.first, list_params.end) = (0, tiles),
            Step::Sort => list_params.sort_mask = sort_mask(units.start),
            _ => (list_params.first, list_params.end) = (units.start as u32, units.end as u32),
        }
        match step {
            Step::Scan => tiles,
            Step::Sort => list_params.end_tile - list_params.first_tile,
            _ => units.len() as u32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sorts as `fragments_sort.wgsl` does it.
    fn sorted(mut list: Vec<u32>, rounds: usize) -> Vec<u32> {
        for mask in (0..rounds).map(sort_mask) {
            let (below, count) = ((1usize << mask.ilog2()) - 1, list.len());
            for near in (0..count).map(|i| ((i & !below) << 1) | (i & below)).take_while(|near| *near < count) {
                let far = near ^ mask as usize;
                if far < count && list[far] < list[near] {
                    list.swap(near, far);
                }
            }
        }
        list
    }

    #[test]
    fn a_network_sorts_lists_of_any_length_and_without_its_last_round_does_not() {
        let mut lazy = 0;
        for count in (0..70).chain([127, 128, 129, 1000, 1025]) {
            // Numbers of a multiplicative generator, without any order.
            let list: Vec<u32> = (1..=count).map(|i: u32| i.wrapping_mul(2_654_435_761) >> 12).collect();
            let mut right = list.clone();
            right.sort_unstable();
            assert_eq!(sorted(list.clone(), sort_rounds(count)), right, "{count}");
            // A network for more sorts fewer as well.
            assert_eq!(sorted(list.clone(), sort_rounds(2048)), right, "{count}");
            lazy += usize::from(count > 1 && sorted(list, sort_rounds(count) - 1) != right);
        }
        assert!(lazy > 50, "{lazy} lists need the last round");
    }
}

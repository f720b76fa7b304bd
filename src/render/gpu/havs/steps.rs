//! The steps of a frame.

use super::bands::Band;
use crate::render::RenderJob;
use crate::render::gpu::layout::{DEEP, FACES_PER_GROUP, FaceParams, Lists, Params};
use crate::render::gpu::readback::Sent;
use crate::render::gpu::shaders::{FragmentKind, Gathering, Inside, Pass, Precision, Stage};
use crate::render::gpu::slices::GROUPS_MAX;
use crate::render::gpu::target::Target;
use std::ops::Range;
use std::sync::Arc;

/// The steps of a frame, in order; those from `StoreFaces` on are repeated for each band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    CountFaces,
    CountStarts,
    CountPieces,
    Scan,
    StoreFaces,
    StoreStarts,
    StorePieces,
    Sort,
    Resolve,
    /// All work has been submitted.
    End,
}

/// Number of steps before the end.
pub(super) const STEPS: usize = 9;

impl Step {
    /// Units of the very first slice, whose cost is unknown.
    pub(super) fn first_units(self) -> usize {
        match self {
            Self::CountFaces | Self::StoreFaces => 64,
            Self::Sort => 1,
            _ => 32,
        }
    }

    /// Fewest units of a slice, whatever they cost: fewer would leave most of the GPU idle, and a slice has a cost of its own.
    pub(super) fn least_units(self) -> usize {
        match self {
            Self::CountFaces | Self::StoreFaces => 32,
            Self::Sort => 1,
            _ => 4,
        }
    }

    /// Most units of a slice.
    pub(super) fn most_units(self) -> usize {
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
pub(super) struct Flight {
    pub(super) step: Step,
    pub(super) units: usize,
    pub(super) work: Work,
}

/// How a slice comes back.
pub(super) enum Work {
    /// Nothing is read back.
    Plain(wgpu::SubmissionIndex),
    /// Resolved pixels; `ends_tiles` if they are the last of their tiles.
    Pixels { sent: Sent, ends_tiles: bool },
}

/// A job of [`FaceLists`](super::FaceLists).
pub struct FaceJob {
    pub(super) job: RenderJob,
    pub(super) precision: Precision,
    pub(super) params: Params,
    pub(super) face_params: FaceParams,
    pub(super) target: Arc<Target>,
    pub(super) lists: Lists,
    pub(super) step: Step,
    /// First unit of the step that has not been submitted.
    pub(super) next: usize,
    /// Number of pieces of large faces.
    pub(super) pieces: u32,
    /// Index of the band under way.
    pub(super) band: usize,
}

impl FaceJob {
    /// Sets `next` to the step's first unit.
    pub(super) fn begin_step(&mut self, bands: &[Band]) {
        self.next = self.units(self.step, bands).start;
    }

    /// Units of a step.
    pub(super) fn units(&self, step: Step, bands: &[Band]) -> Range<usize> {
        let band = || bands.get(self.band).cloned().unwrap_or_default();
        let is_empty = || band().fragments == 0;
        let has_starts = self.face_params.eye_count > 0;
        let groups = self.face_params.drawn_count.div_ceil(FACES_PER_GROUP) as usize;
        match step {
            Step::CountFaces => 0..groups,
            Step::CountStarts if has_starts => 0..self.params.tile_count(),
            Step::CountPieces => 0..self.pieces as usize,
            Step::Scan => 0..1,
            Step::StoreFaces if !is_empty() => 0..groups,
            Step::StoreStarts if has_starts && !is_empty() => band().tiles,
            Step::StorePieces if !is_empty() => 0..self.pieces as usize,
            Step::Sort if band().deepest > DEEP => 0..sort_rounds(band().deepest),
            Step::Resolve => band().tiles,
            Step::Sort | Step::CountStarts | Step::StoreFaces | Step::StoreStarts | Step::StorePieces | Step::End => {
                0..0
            }
        }
    }

    /// Writes the next units of a step to the parameters. Returns the number of workgroups.
    pub(super) fn choose(&mut self, step: Step, units: &Range<usize>) -> u32 {
        let face_params = &mut self.face_params;
        let tiles = self.params.tile_count() as u32;
        match step {
            Step::CountFaces | Step::StoreFaces => {
                let face = |group: usize| (group as u32).saturating_mul(FACES_PER_GROUP);
                face_params.first = face(units.start);
                face_params.end = face(units.end).min(face_params.drawn_count);
            }
            Step::Scan => (face_params.first, face_params.end) = (0, tiles),
            Step::Sort => face_params.sort_mask = sort_mask(units.start),
            _ => (face_params.first, face_params.end) = (units.start as u32, units.end as u32),
        }
        match step {
            Step::Scan => tiles,
            Step::Sort => face_params.end_tile - face_params.first_tile,
            _ => units.len() as u32,
        }
    }
}

/// The stage of a job's step; `None` for `End`.
pub(super) fn stage(step: Step, job: &RenderJob, precision: Precision) -> Option<Stage> {
    let kind = FragmentKind::of(job);
    let (count, store) = (Pass::Count, Pass::Store(kind, Inside::of(job).of_fragments()));
    Some(match step {
        Step::CountFaces => Stage::Faces(count, precision),
        Step::CountStarts => Stage::FaceStarts(count, precision),
        Step::CountPieces => Stage::FacePieces(count, precision),
        Step::Scan => Stage::FaceScan,
        Step::StoreFaces => Stage::Faces(store, precision),
        Step::StoreStarts => Stage::FaceStarts(store, precision),
        Step::StorePieces => Stage::FacePieces(store, precision),
        Step::Sort => Stage::FaceSort(kind),
        Step::Resolve => Stage::FaceResolve(Gathering::of(job), Inside::of(job), precision),
        Step::End => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sorts as `face_sort.wgsl` does it.
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

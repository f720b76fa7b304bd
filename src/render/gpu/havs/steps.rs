//! What is done for a frame, step by step.

use super::bands::Band;
use super::pipelines::Pipelines;
use super::scene::Groups;
use crate::optics::OpticsKind;
use crate::render::RenderJob;
use crate::render::gpu::layout::{FaceParams, Lists, Params};
use crate::render::gpu::shaders::{Pass, Precision};
use crate::render::gpu::slices::UnitCost;
use std::ops::Range;
use std::time::Instant;

/// Faces of a workgroup.
pub(super) const FACES_PER_GROUP: u32 = 64;

/// What the GPU is given to do, in this order; those from `StoreFaces` on again for each band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    CountFaces,
    CountStarts,
    CountPieces,
    Scan,
    StoreFaces,
    StoreStarts,
    StorePieces,
    Resolve,
    /// All has been submitted.
    End,
}

/// Number of steps before the end.
pub(super) const STEPS: usize = 8;

impl Step {
    /// Units of the first slice of all, before anything is known of their cost.
    pub(super) fn first_units(self) -> usize {
        match self {
            Self::CountFaces | Self::StoreFaces => 64,
            _ => 32,
        }
    }

    /// Fewest units of a slice, whatever they cost: with less, most of the GPU has nothing to do, and a slice costs more than
    /// what is in it.
    pub(super) fn least_units(self) -> usize {
        match self {
            Self::CountFaces | Self::StoreFaces => 32,
            _ => 4,
        }
    }
}

/// What a step costs: a unit is a workgroup.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StepCost {
    pub(super) unit: UnitCost,
    /// Of the frame under way.
    pub(super) ms: f64,
    pub(super) units: usize,
}

/// Work that has been submitted.
pub(super) struct Flight {
    pub(super) step: Step,
    pub(super) units: usize,
    pub(super) submission: wgpu::SubmissionIndex,
    /// Of pixels on their way: which slot has them, and whether they are the last of their tiles.
    pub(super) slot: Option<(usize, bool)>,
}

/// What a job under way needs beyond the buffers.
pub(super) struct ActiveJob {
    pub(super) job: RenderJob,
    pub(super) precision: Precision,
    pub(super) params: Params,
    pub(super) face_params: FaceParams,
    pub(super) lists: Lists,
    pub(super) step: Step,
    /// First unit of the step that has not been submitted.
    pub(super) next: usize,
    /// Pieces of large faces.
    pub(super) pieces: u32,
    /// Band under way.
    pub(super) band: usize,
    pub(super) started: Instant,
    /// Milliseconds that the frame took before it came here.
    pub(super) ms_before: f64,
}

impl ActiveJob {
    /// Units of a step.
    pub(super) fn units(&self, step: Step, bands: &[Band]) -> Range<usize> {
        let band =
            || bands.get(self.band).cloned().unwrap_or(Band { tiles: 0..0, pixels: 0..0, fragments: 0, skipped: 0 });
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
            Step::Resolve => band().tiles,
            Step::CountStarts | Step::StoreFaces | Step::StoreStarts | Step::StorePieces | Step::End => 0..0,
        }
    }
}

/// The pipeline of a step of a job, and what it binds.
pub(super) fn stage<'a>(
    step: Step,
    pipelines: &'a Pipelines,
    groups: &'a Groups,
    optics: OpticsKind,
    precision: Precision,
) -> Option<(&'a wgpu::ComputePipeline, &'a wgpu::BindGroup)> {
    let count = || pipelines.finding(Pass::Count, precision);
    let store = || pipelines.finding(Pass::Store, precision);
    match step {
        Step::CountFaces => count().map(|count| (&count.faces, &groups.count)),
        Step::CountStarts => count().map(|count| (&count.starts, &groups.count)),
        Step::CountPieces => count().map(|count| (&count.pieces, &groups.count)),
        Step::Scan => Some((&pipelines.scan, &groups.scan)),
        Step::StoreFaces => store().map(|store| (&store.faces, &groups.store)),
        Step::StoreStarts => store().map(|store| (&store.starts, &groups.store)),
        Step::StorePieces => store().map(|store| (&store.pieces, &groups.store)),
        Step::Resolve => pipelines.resolve(optics, precision).map(|pipeline| (pipeline, &groups.resolve)),
        Step::End => None,
    }
}

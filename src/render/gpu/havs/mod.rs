//! The face renderer on the GPU: what [`crate::render::cpu::havs`] does, in WGSL, with lists of all fragments ([`super::lists`]).
//!
//! A fragment is depth, scalar, rank (place in the list) and the cells in front of the face and behind it. Rays that begin in a cell have a
//! fragment there (`face_starts.wgsl`).
//!
//! Order: the fragments of a pixel are sorted by depth and rank. With a complete list in exact order they are then followed from cell to
//! cell, which makes depths within rounding harmless. Without exact order they are sorted by rank and fed through a window of k, with the
//! same errors as on the CPU. In exact order no fragment is ever out of order: there is no first try with a small buffer.
//!
//! Deviations from the CPU path beside those of [`super::raycast`]:
//! 1. Depths are sums of two f32, right to 2^-22 of the face's extent in depth, the error of f32 weights. Closer fragments may be
//!    in the wrong order, and cells decide (`ListParams::tie`). With thin, visible cells depths are computed in f64.
//! 2. Fragments behind the place where a ray has become opaque are stored and sorted all the same, but not integrated.

mod faces;
#[cfg(test)]
mod stage_tests;

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::full_size::AtFullSize;
use super::layout::{EYE_WORDS, ListParams, TILE_PIXELS, flags};
use super::lists::steps::Stages;
use super::lists::{Elements, FragmentLists, Plan};
use super::shaders::{Along, Element, FragmentKind, Pass, Precision, Stage};
use super::surfaces::CornerBuffer;
use crate::camera::View;
use crate::render::cpu::havs::checked_faces;
use crate::render::{FrameRun, RenderError, RenderJob};
use crate::stats::FrameStats;
use crate::visibility::Drawn;
use faces::FaceBuffers;
use std::sync::Arc;

/// Error of a depth: weights are right to 2^-23 of themselves, and there are two; a depth is two weights times differences of
/// the corners' depths, below 2 for a mesh within [-1, 1]. In f64 the error is that of storing a sum of two f32: 2^-48 of it.
fn depth_error(precision: Precision) -> f64 {
    match precision {
        Precision::Single => 1.0 / (1u64 << 22) as f64,
        Precision::Double => 1.0 / (1u64 << 44) as f64,
    }
}
/// Error of view coordinates, relative to the distance (`raycast::stage_tests`).
const TRANSFORM_ERROR: f64 = 1.0 / (1u64 << 40) as f64;

/// The face renderer.
pub type Havs = FrameRun<AtFullSize<FragmentLists<Faces>>>;

/// The faces of a job, and the cells at the eye.
pub struct Faces {
    corners: CornerBuffer,
    faces: FaceBuffers,
    eye_cells: Vec<[u32; EYE_WORDS]>,
}

impl Default for Faces {
    fn default() -> Self {
        Self { corners: CornerBuffer::new(), faces: FaceBuffers::new(), eye_cells: Vec::new() }
    }
}

impl Elements for Faces {
    fn check(&mut self, _: &Context, job: &RenderJob, stats: &mut FrameStats) -> Result<Arc<Drawn>, RenderError> {
        stats.faces_total = job.mesh.topology.connectivity().faces.len() as u64;
        checked_faces(job)
    }

    fn plan(&mut self, job: &RenderJob, drawn: &Drawn, view: &View, precision: Precision) -> Plan {
        self.eye_cells = faces::eye_cells(job, view);
        let (kind, along) = (FragmentKind::of(job), Along::of(job));
        let passes = [Pass::Count, Pass::Store(kind, Element::Face.inside_of_fragments(along.inside))];
        let stages = Stages {
            find: passes.map(|pass| Stage::Find(Element::Face, pass, precision)),
            pieces: passes.map(|pass| Stage::FindPieces(Element::Face, pass, precision)),
            starts: Some(passes.map(|pass| Stage::FaceStarts(pass, precision))),
            sort: Stage::FragmentSort(Element::Face, kind),
            resolve: Stage::Resolve(Element::Face, along, precision),
        };
        let list_params = ListParams {
            drawn_count: drawn.ids.len() as u32,
            eye_count: self.eye_cells.len() as u32,
            end_pixel: TILE_PIXELS as u32,
            k: u32::from(job.k_buffer.k),
            tie: (depth_error(precision) + TRANSFORM_ERROR * (view.eye.length() + 2.0)) as f32,
            flags: if drawn.is_complete { flags::COMPLETE } else { 0 }
                | if job.k_buffer.exact_order { flags::EXACT_ORDER } else { 0 },
            ..ListParams::default()
        };
        Plan { stages, kind, precision, list_params }
    }

    fn upload(
        &mut self,
        context: &Context,
        job: &RenderJob,
        list_params: &mut ListParams,
    ) -> Result<(bool, u64), RenderError> {
        let (made, sent) = self.corners.upload(context, job, job.surfaces.is_some())?;
        let (new, bytes) = self.faces.upload(context, &job.mesh)?;
        list_params.face_part = self.faces.part as u32;
        Ok((made | new, sent + bytes))
    }

    fn behind_list(&self) -> &[u8] {
        bytemuck::cast_slice(&self.eye_cells)
    }

    fn buffers(&self) -> Vec<&GrowingBuffer> {
        self.faces.parts.iter().chain([&self.corners.buffer]).collect()
    }

    fn count(stats: &mut FrameStats, drawn: u64, _: u32, _: u32) {
        stats.faces_drawn = drawn;
    }
}

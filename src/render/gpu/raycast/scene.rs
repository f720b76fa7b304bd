//! The parts of a job in the GPU's memory, each sent only when it changes.

use super::rays::RayScene;
use super::records::Records;
use crate::mesh::Mesh;
use crate::render::cpu::raycast::entries;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::layout::{PAIR_WORDS, Params};
use crate::render::gpu::pipelines::Pipelines;
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::{Along, FLOW, Precision, RecordSplit, Stage};
use crate::render::gpu::shared_scene::SharedScene;
use crate::render::gpu::target::Target;
use crate::render::{RenderError, RenderJob};
use crate::visibility::CellSet;
use std::sync::Arc;

/// Entry faces.
struct Domain {
    of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    /// Entry faces as cell << 2 | opposite vertex, then the cells at the eye, each followed by its sides.
    items: GrowingBuffer,
    faces: Vec<entries::EntryFace>,
    packed: Vec<u32>,
}

/// All that the stages read and write.
pub(super) struct Scene {
    pub(super) shared: SharedScene,
    records: Records,
    domain: Domain,
    pub(super) pipelines: Pipelines,
    /// Ends of the tiles' lists, their sum, the lists.
    pub(super) bins: GrowingBuffer,
    /// Resources of contrast-adaptive sampling.
    pub(super) rays: RayScene,
}

impl Scene {
    pub(super) fn new() -> Self {
        Self {
            shared: SharedScene::new(),
            records: Records::new(),
            domain: Domain {
                of: None,
                items: GrowingBuffer::new(Resource::Items),
                faces: Vec::new(),
                packed: Vec::new(),
            },
            pipelines: Pipelines::new(),
            bins: GrowingBuffer::new(Resource::Bins),
            rays: RayScene::new(),
        }
    }

    /// Uploads what is not on the GPU yet, completes the parameters, and returns the target. The caller has asked
    /// [`Table::is_transparent`](crate::render::gpu::table::Table::is_transparent). `how` is the geometry's precision, and whether sampling
    /// is adaptive.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        how: (Precision, bool),
        eye_cells: &[[u32; 2]],
        params: &mut Params,
    ) -> Result<Arc<Target>, RenderError> {
        let updated = self.update_parts(context, job, how, eye_cells, params);
        if updated.is_err() {
            // Buffers may have been reallocated before one was refused: the old ones are bound.
            self.unbind();
        }
        updated
    }

    fn update_parts(
        &mut self,
        context: &Context,
        job: &RenderJob,
        (precision, is_sampled): (Precision, bool),
        eye_cells: &[[u32; 2]],
        params: &mut Params,
    ) -> Result<Arc<Target>, RenderError> {
        let cells = job.mesh.topology.tets.len();
        let split = RecordSplit::new(cells, context.binding_bytes());
        let split = split.ok_or_else(|| context.beyond(format!("a mesh of {cells} cells is too large for it")))?;
        let stages = [Stage::ViewTransform, Stage::EntriesCount, Stage::EntriesScan, Stage::EntriesStore];
        let along = Along::of(job);
        let walk = (!is_sampled).then_some(Stage::Walk(along, precision));
        let flow = if job.flow.is_some() { &FLOW[..] } else { &[] };
        self.pipelines.prepare(context, split, stages.into_iter().chain(walk).chain(flow.iter().copied()))?;
        self.shared.upload(context, job, params)?;
        self.shared.note(self.records.upload(context, &job.mesh, split)?);
        self.update_domain(context, job, eye_cells)?;
        self.shared.upload_active(context, job)?;
        let (target, is_resized) = self.shared.resize(context, params)?;
        if is_sampled {
            self.rays.update(context, target.size_px, Stage::WalkRays(along, precision), split)?;
        } else {
            self.rays.forget_other(target.size_px);
        }
        params.face_count = self.domain.faces.len() as u32;
        params.eye_count = eye_cells.len() as u32;
        params.item_count = params.face_count + params.eye_count;
        // Every face in two tiles, every cell at the eye in all: often enough, and corrected if not.
        let ends = params.tile_count() as u64 + 1;
        let pairs = 2 * u64::from(params.face_count) + params.tile_count() as u64 * (eye_cells.len() as u64 + 1);
        if is_resized || self.bins.list_capacity(ends, PAIR_WORDS) == 0 {
            self.shared.made |= self.bins.reserve_list(context, ends, PAIR_WORDS, pairs)?;
        }
        params.pair_capacity = self.bins.list_capacity(ends, PAIR_WORDS);
        if self.shared.made {
            self.unbind();
        }
        self.bind(context, is_sampled)?;
        Ok(target)
    }

    /// Makes room for `pairs` pairs of tile and item, and for what was told of splats, and a quarter more, as far as it does not fit.
    pub(super) fn grow_lists(
        &mut self,
        context: &Context,
        (pairs, told): (u64, [u32; 2]),
        is_sampled: bool,
        params: &mut Params,
    ) -> Result<(), RenderError> {
        if pairs > u64::from(params.pair_capacity) {
            let ends = params.tile_count() as u64 + 1;
            self.bins.reserve_list(context, ends, PAIR_WORDS, pairs + pairs / 4)?;
            params.pair_capacity = self.bins.list_capacity(ends, PAIR_WORDS);
        }
        self.shared.grow_flow(context, told)?;
        self.unbind();
        self.bind(context, is_sampled)
    }

    fn update_domain(&mut self, context: &Context, job: &RenderJob, eye_cells: &[[u32; 2]]) -> Result<(), RenderError> {
        let domain = &mut self.domain;
        let same = |(mesh, active): &(Arc<Mesh>, Arc<CellSet>)| {
            Arc::ptr_eq(mesh, &job.mesh) && Arc::ptr_eq(active, &job.active)
        };
        let changed = !domain.of.as_ref().is_some_and(same);
        if changed {
            domain.of = None;
            entries::collect(&job.mesh.topology, &job.active, &job.cancel, &mut domain.faces);
            domain.packed.clear();
            domain.packed.extend(domain.faces.iter().map(|f| f.cell << 2 | f.opposite));
        }
        let faces = domain.packed.len();
        let made = domain.items.reserve(context, 4 * (faces + 2 * eye_cells.len()) as u64)?;
        let mut sent = domain.items.write(context, 4 * faces as u64, bytemuck::cast_slice(eye_cells))?;
        if made || changed {
            sent += domain.items.write(context, 0, bytemuck::cast_slice(&domain.packed))?;
        }
        if changed && !job.cancel.is_cancelled() {
            domain.of = Some((job.mesh.clone(), job.active.clone()));
        }
        self.shared.note((made, sent));
        Ok(())
    }

    /// Drops the bind groups: bound buffers have been reallocated.
    fn unbind(&mut self) {
        self.pipelines.unbind();
        self.rays.pipelines.unbind();
    }

    /// Makes the bind groups that are missing.
    fn bind(&mut self, context: &Context, is_sampled: bool) -> Result<(), RenderError> {
        let (mut buffers, planes) = (self.shared.buffers(), self.shared.planes());
        buffers.extend([&self.domain.items, &self.bins]);
        buffers.extend(&self.records.parts);
        self.pipelines.bind(context, &buffers, &planes)?;
        if is_sampled { self.rays.bind(context, &buffers, &planes) } else { Ok(()) }
    }
}

//! The parts of a job in the GPU's memory, each sent only when it changes.

use super::rays::RayScene;
use super::records::Records;
use crate::mesh::Mesh;
use crate::render::cpu::raycast::entries;
use crate::render::gpu::buffers::{GpuScalars, GrowingBuffer, VertexBuffers};
use crate::render::gpu::context::Context;
use crate::render::gpu::layout::{PAIR_WORDS, Params, flags};
use crate::render::gpu::pipelines::Pipelines;
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::{Gathering, Inside, Precision, RecordSplit, Stage};
use crate::render::gpu::surfaces::{SurfaceBuffer, scalar_map};
use crate::render::gpu::table::Table;
use crate::render::gpu::target::Target;
use crate::render::{RenderError, RenderJob};
use crate::visibility::CellSet;
use std::sync::Arc;

/// Entry faces and active cells.
struct Domain {
    of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    /// Entry faces as cell << 2 | opposite vertex, then the cells at the eye, each followed by its sides.
    items: GrowingBuffer,
    active: GrowingBuffer,
    faces: Vec<entries::EntryFace>,
    packed: Vec<u32>,
}

/// All that the stages read and write.
pub(super) struct Scene {
    pub(super) params: GrowingBuffer,
    pub(super) vertices: VertexBuffers,
    records: Records,
    pub(super) scalars: GpuScalars,
    domain: Domain,
    pub(super) table: Table,
    surfaces: SurfaceBuffer,
    pub(super) pipelines: Pipelines,
    pub(super) target: Option<Arc<Target>>,
    /// Ends of the tiles' lists, their sum, the lists.
    pub(super) bins: GrowingBuffer,
    /// Resources of contrast-adaptive sampling.
    pub(super) rays: RayScene,
    /// Bytes sent for the present job.
    pub(super) bytes_sent: u64,
}

impl Scene {
    pub(super) fn new() -> Self {
        Self {
            params: GrowingBuffer::new(Resource::Params),
            vertices: VertexBuffers::new(),
            records: Records::new(),
            scalars: GpuScalars::new(),
            domain: Domain {
                of: None,
                items: GrowingBuffer::new(Resource::Items),
                active: GrowingBuffer::new(Resource::ActiveCells),
                faces: Vec::new(),
                packed: Vec::new(),
            },
            table: Table::new(),
            surfaces: SurfaceBuffer::new(),
            pipelines: Pipelines::new(),
            target: None,
            bins: GrowingBuffer::new(Resource::Bins),
            rays: RayScene::new(),
            bytes_sent: 0,
        }
    }

    /// Uploads what is not on the GPU yet, completes the parameters, and returns the target. The caller has asked
    /// [`Table::is_transparent`]. `how` is the geometry's precision, and whether sampling is adaptive.
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
        self.bytes_sent = 0;
        let cells = job.mesh.topology.tets.len();
        let split = RecordSplit::new(cells, context.binding_bytes());
        let split = split.ok_or_else(|| context.beyond(format!("a mesh of {cells} cells is too large for it")))?;
        let mut stale = self.params.reserve(context, size_of::<Params>() as u64)?;
        let stages = [Stage::ViewTransform, Stage::EntriesCount, Stage::EntriesScan, Stage::EntriesStore];
        let (how, inside) = (Gathering::of(job), Inside::of(job));
        let walk = (!is_sampled).then_some(Stage::Walk(how, inside, precision));
        self.pipelines.prepare(context, split, stages.into_iter().chain(walk))?;
        let (made, sent) = self.vertices.upload(context, &job.mesh)?;
        if made {
            self.scalars.forget();
        }
        stale |= made;
        self.bytes_sent += sent;
        let (made, sent) = self.vertices.upload_values(context, job)?;
        stale |= made;
        self.bytes_sent += sent;
        let (made, sent) = self.records.upload(context, &job.mesh, split)?;
        stale |= made;
        self.bytes_sent += sent;
        let (prescale, sent) = self.scalars.scalars_to_gpu(context, job, &self.vertices.scalars)?;
        self.bytes_sent += sent;
        let map = scalar_map(job, prescale, self.scalars.largest());
        let (made, sent) = self.table.update(context, job, map, params)?;
        stale |= made;
        self.bytes_sent += sent;
        let (gradients, has_volume) = (VertexBuffers::first_gradient(job) as u32, !self.table.is_transparent(job));
        let (made, sent) = self.surfaces.update(context, job, map, gradients, has_volume)?;
        stale |= made;
        self.bytes_sent += sent;
        stale |= self.update_domain(context, job, eye_cells)?;
        let size_px = (params.size_px[0] as usize, params.size_px[1] as usize);
        let (target, is_resized) = Target::kept(&mut self.target, context, size_px)?;
        stale |= is_resized;
        if is_sampled {
            self.rays.update(context, size_px, Stage::WalkRays(how, inside, precision), split)?;
        } else {
            self.rays.forget_other(size_px);
        }
        params.vertex_count = job.mesh.positions.local.len() as u32;
        params.face_count = self.domain.faces.len() as u32;
        params.eye_count = eye_cells.len() as u32;
        params.item_count = params.face_count + params.eye_count;
        if job.skip.opaque {
            params.flags |= flags::EARLY_TERMINATION;
        }
        if job.active.count() == job.active.universe() {
            params.flags |= flags::ALL_ACTIVE;
        }
        // Every face in two tiles, every cell at the eye in all: often enough, and corrected if not.
        let tiles = params.tile_count() as u64;
        let pairs = 2 * u64::from(params.face_count) + tiles * (eye_cells.len() as u64 + 1);
        if is_resized || self.pair_capacity(tiles) == 0 {
            stale |= self.reserve_pairs(context, tiles, pairs)?;
        }
        params.pair_capacity = self.pair_capacity(tiles);
        if stale {
            self.unbind();
        }
        self.bind(context, is_sampled)?;
        Ok(target)
    }

    /// Makes room for `pairs` pairs of tile and item, and a quarter more.
    pub(super) fn grow_lists(
        &mut self,
        context: &Context,
        pairs: u64,
        is_sampled: bool,
        params: &mut Params,
    ) -> Result<(), RenderError> {
        let tiles = params.tile_count() as u64;
        self.reserve_pairs(context, tiles, pairs + pairs / 4)?;
        params.pair_capacity = self.pair_capacity(tiles);
        self.unbind();
        self.bind(context, is_sampled)
    }

    /// Makes room for `pairs` pairs of tile and item behind the ends of `tiles`. Returns whether the buffer was reallocated.
    fn reserve_pairs(&mut self, context: &Context, tiles: u64, pairs: u64) -> Result<bool, RenderError> {
        self.bins.reserve(context, 4 * (tiles + 1 + PAIR_WORDS * pairs))
    }

    /// Capacity in pairs.
    fn pair_capacity(&self, tiles: u64) -> u32 {
        let words = (self.bins.bytes() / 4).saturating_sub(tiles + 1);
        u32::try_from(words / PAIR_WORDS).unwrap_or(u32::MAX)
    }

    fn update_domain(
        &mut self,
        context: &Context,
        job: &RenderJob,
        eye_cells: &[[u32; 2]],
    ) -> Result<bool, RenderError> {
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
        let mut made = domain.items.reserve(context, 4 * (faces + 2 * eye_cells.len()) as u64)?;
        if made || changed {
            self.bytes_sent += domain.items.write(context, 0, bytemuck::cast_slice(&domain.packed))?;
        }
        self.bytes_sent += domain.items.write(context, 4 * faces as u64, bytemuck::cast_slice(eye_cells))?;
        if changed {
            let words = job.active.words();
            made |= domain.active.reserve(context, size_of_val(words) as u64)?;
            // Words of 64 bits as pairs of 32, lower first: the same bits on a little-endian GPU, as all are.
            let halves: Vec<u32> = words.iter().flat_map(|&w| [w as u32, (w >> 32) as u32]).collect();
            self.bytes_sent += domain.active.write(context, 0, bytemuck::cast_slice(&halves))?;
            let is_complete = !job.cancel.is_cancelled();
            domain.of = is_complete.then(|| (job.mesh.clone(), job.active.clone()));
        }
        Ok(made)
    }

    /// Drops the bind groups: bound buffers have been reallocated.
    fn unbind(&mut self) {
        self.pipelines.unbind();
        self.rays.unbind();
    }

    /// Makes the bind groups that are missing.
    fn bind(&mut self, context: &Context, is_sampled: bool) -> Result<(), RenderError> {
        let mut buffers = vec![&self.params, &self.domain.items, &self.domain.active, &self.bins];
        buffers.push(self.surfaces.buffer());
        buffers.extend(self.vertices.buffers());
        buffers.extend(&self.records.parts);
        buffers.extend(self.table.buffers());
        buffers.extend(self.target.iter().map(|target| &target.counters));
        let planes: Vec<_> = self.target.iter().flat_map(|target| target.planes()).collect();
        self.pipelines.bind(context, &buffers, &planes)?;
        if is_sampled { self.rays.bind(context, &buffers, &planes) } else { Ok(()) }
    }
}

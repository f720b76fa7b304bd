//! The parts of a job in the GPU's memory, each sent only when it changes.

use super::faces::{DrawnBuffer, FaceBuffers};
use crate::mesh::Mesh;
use crate::render::gpu::buffers::{GpuScalars, GrowingBuffer, VertexBuffers};
use crate::render::gpu::context::Context;
use crate::render::gpu::layout::{EYE_WORDS, FRAGMENT_BYTES, FaceParams, Lists, PIECE_WORDS, Params, flags};
use crate::render::gpu::pipelines::{NO_RECORDS, Pipelines};
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::{FragmentKind, Gathering, Inside, Pass, Precision, Stage};
use crate::render::gpu::surfaces::{CornerBuffer, SurfaceBuffer, scalar_map};
use crate::render::gpu::table::Table;
use crate::render::gpu::target::Target;
use crate::render::{RenderError, RenderJob};
use crate::visibility::{CellSet, DrawnFaces};
use std::sync::Arc;

/// Initial capacity for pieces of large faces, per tile: a few faces in all tiles.
const FIRST_PIECES_PER_TILE: u64 = 8;
/// Least capacity for fragments.
const FRAGMENTS_MIN: u32 = 1 << 16;

/// All that the stages read and write.
pub(super) struct Scene {
    pub(super) params: GrowingBuffer,
    pub(super) face_params: GrowingBuffer,
    pub(super) vertices: VertexBuffers,
    pub(super) scalars: GpuScalars,
    pub(super) table: Table,
    surfaces: SurfaceBuffer,
    corners: CornerBuffer,
    faces: FaceBuffers,
    drawn: DrawnBuffer,
    active_of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    active: GrowingBuffer,
    /// Counts, places and pieces: [`Lists`].
    pub(super) lists: GrowingBuffer,
    pub(super) fragments: [GrowingBuffer; 2],
    pub(super) pipelines: Pipelines,
    pub(super) target: Option<Arc<Target>>,
    /// Bytes sent for the present job.
    pub(super) bytes_sent: u64,
}

impl Scene {
    pub(super) fn new() -> Self {
        Self {
            params: GrowingBuffer::new(Resource::Params),
            face_params: GrowingBuffer::new(Resource::FaceParams),
            vertices: VertexBuffers::new(),
            scalars: GpuScalars::new(),
            table: Table::new(),
            surfaces: SurfaceBuffer::new(),
            corners: CornerBuffer::new(),
            faces: FaceBuffers::new(),
            drawn: DrawnBuffer::new(),
            active_of: None,
            active: GrowingBuffer::new(Resource::ActiveCells),
            lists: GrowingBuffer::new(Resource::Lists),
            fragments: Resource::FRAGMENTS.map(GrowingBuffer::new),
            pipelines: Pipelines::new(),
            target: None,
            bytes_sent: 0,
        }
    }

    /// Uploads what is not on the GPU yet, completes the parameters, and returns the target. The caller has asked
    /// [`Table::is_transparent`].
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        drawn: &Arc<DrawnFaces>,
        eye_cells: &[[u32; EYE_WORDS]],
        params: &mut Params,
        face_params: &mut FaceParams,
    ) -> Result<Arc<Target>, RenderError> {
        self.bytes_sent = 0;
        let made = self.update_buffers(context, job, drawn, eye_cells, params, face_params);
        // Buffers may have been reallocated before one was refused: the old ones are bound.
        if !matches!(made, Ok((_, false))) {
            self.pipelines.unbind();
        }
        let (target, _) = made?;
        self.bind(context)?;
        Ok(target)
    }

    /// Compiles a job's stages unless that has been done; before [`Self::update`].
    pub(super) fn make_pipelines(
        &mut self,
        context: &Context,
        job: &RenderJob,
        precision: Precision,
    ) -> Result<(), RenderError> {
        let (how, kind, inside) = (Gathering::of(job), FragmentKind::of(job), Inside::of(job));
        let later = [Stage::FaceScan, Stage::FaceSort(kind), Stage::FaceResolve(how, inside, precision)];
        let finding = [Pass::Count, Pass::Store(kind, inside)].into_iter().flat_map(|pass| {
            [Stage::Faces(pass, precision), Stage::FacePieces(pass, precision), Stage::FaceStarts(pass, precision)]
        });
        self.pipelines.prepare(context, NO_RECORDS, [Stage::ViewTransform].into_iter().chain(finding).chain(later))
    }

    /// Returns the target, and whether a buffer or a plane was made.
    fn update_buffers(
        &mut self,
        context: &Context,
        job: &RenderJob,
        drawn: &Arc<DrawnFaces>,
        eye_cells: &[[u32; EYE_WORDS]],
        params: &mut Params,
        face_params: &mut FaceParams,
    ) -> Result<(Arc<Target>, bool), RenderError> {
        let mut made = self.params.reserve(context, size_of::<Params>() as u64)?;
        made |= self.face_params.reserve(context, size_of::<FaceParams>() as u64)?;
        let (new_vertices, sent) = self.vertices.upload(context, &job.mesh)?;
        if new_vertices {
            self.scalars.forget();
        }
        self.bytes_sent += sent;
        let (prescale, sent) = self.scalars.scalars_to_gpu(context, job, &self.vertices.scalars)?;
        self.bytes_sent += sent;
        let map = scalar_map(job, prescale, self.scalars.largest());
        let (gradients, has_volume) = (VertexBuffers::first_gradient(job) as u32, !self.table.is_transparent(job));
        let sent = [
            self.vertices.upload_values(context, job)?,
            self.table.update(context, job, map, params)?,
            self.surfaces.update(context, job, map, gradients, has_volume)?,
            self.corners.upload(context, job)?,
            self.faces.upload(context, &job.mesh)?,
            self.drawn.upload(context, drawn, eye_cells)?,
            self.upload_active(context, job)?,
        ];
        made |= new_vertices;
        for (new, bytes) in sent {
            made |= new;
            self.bytes_sent += bytes;
        }
        let size_px = (params.size_px[0] as usize, params.size_px[1] as usize);
        let (target, is_resized) = Target::kept(&mut self.target, context, size_px)?;
        made |= is_resized;
        let lists = Lists { tiles: params.tile_count() as u64 };
        made |= self.reserve_pieces(context, lists, FIRST_PIECES_PER_TILE * lists.tiles)?;
        for fragments in &mut self.fragments {
            made |= fragments.reserve(context, FRAGMENT_BYTES)?;
        }
        params.vertex_count = job.mesh.positions.local.len() as u32;
        if job.skip.opaque {
            params.flags |= flags::EARLY_TERMINATION;
        }
        if job.active.count() == job.active.universe() {
            params.flags |= flags::ALL_ACTIVE;
        }
        face_params.face_part = self.faces.part as u32;
        face_params.piece_capacity = self.piece_capacity(lists);
        Ok((target, made))
    }

    fn upload_active(&mut self, context: &Context, job: &RenderJob) -> Result<(bool, u64), RenderError> {
        let same = |(mesh, active): &(Arc<Mesh>, Arc<CellSet>)| {
            Arc::ptr_eq(mesh, &job.mesh) && Arc::ptr_eq(active, &job.active)
        };
        if self.active_of.as_ref().is_some_and(same) {
            return Ok((false, 0));
        }
        self.active_of = None;
        let words = job.active.words();
        let made = self.active.reserve(context, size_of_val(words) as u64)?;
        // Words of 64 bits as pairs of 32, lower first: the same bits on a little-endian GPU, as all are.
        let halves: Vec<u32> = words.iter().flat_map(|&w| [w as u32, (w >> 32) as u32]).collect();
        let sent = self.active.write(context, 0, bytemuck::cast_slice(&halves))?;
        self.active_of = Some((job.mesh.clone(), job.active.clone()));
        Ok((made, sent))
    }

    /// Makes room for `pieces` behind the lists. Returns whether the buffer was reallocated.
    fn reserve_pieces(&mut self, context: &Context, lists: Lists, pieces: u64) -> Result<bool, RenderError> {
        self.lists.reserve(context, 4 * (lists.pieces() + PIECE_WORDS * pieces))
    }

    /// Capacity in pieces.
    fn piece_capacity(&self, lists: Lists) -> u32 {
        let words = (self.lists.bytes() / 4).saturating_sub(lists.pieces());
        u32::try_from(words / PIECE_WORDS).unwrap_or(u32::MAX)
    }

    /// Makes room for `pieces` and a quarter more.
    pub(super) fn grow_pieces(
        &mut self,
        context: &Context,
        lists: Lists,
        pieces: u64,
        face_params: &mut FaceParams,
    ) -> Result<(), RenderError> {
        self.reserve_pieces(context, lists, pieces + pieces / 4)?;
        face_params.piece_capacity = self.piece_capacity(lists);
        self.pipelines.unbind();
        self.bind(context)
    }

    /// Largest number of fragments within `bytes` and two bindings.
    pub(super) fn fragment_capacity(context: &Context, kind: FragmentKind, bytes: u64) -> u32 {
        let both = 2 * (context.binding_bytes() / kind.bytes());
        u32::try_from((bytes / kind.bytes()).min(both)).unwrap_or(u32::MAX).max(1)
    }

    /// Makes room for `fragments`, at most `capacity`.
    pub(super) fn reserve_fragments(
        &mut self,
        context: &Context,
        kind: FragmentKind,
        fragments: u32,
        capacity: u32,
        face_params: &mut FaceParams,
    ) -> Result<(), RenderError> {
        let room = |buffer: &GrowingBuffer| buffer.bytes() / kind.bytes();
        let [first, second] = &self.fragments;
        if room(first) + room(second) < u64::from(fragments) {
            // Powers of two, so that a moving camera seldom reallocates.
            let wanted = fragments.checked_next_power_of_two().unwrap_or(capacity);
            let wanted = u64::from(wanted.max(FRAGMENTS_MIN).min(capacity));
            let in_first = wanted.min(context.binding_bytes() / kind.bytes());
            let [first, second] = &mut self.fragments;
            let mut made = first.reserve(context, kind.bytes() * in_first)?;
            made |= second.reserve(context, kind.bytes() * (wanted - in_first))?;
            if made {
                self.pipelines.unbind();
                self.bind(context)?;
            }
        }
        face_params.fragment_part = u32::try_from(room(&self.fragments[0])).unwrap_or(u32::MAX);
        Ok(())
    }

    /// Makes the bind groups that are missing.
    fn bind(&mut self, context: &Context) -> Result<(), RenderError> {
        let mut buffers = vec![&self.params, &self.face_params, &self.lists, &self.drawn.buffer, &self.active];
        buffers.extend([self.surfaces.buffer(), self.corners.buffer()]);
        buffers.extend(self.vertices.buffers());
        buffers.extend(&self.faces.parts);
        buffers.extend(&self.fragments);
        buffers.extend(self.table.buffers());
        buffers.extend(self.target.iter().map(|target| &target.counters));
        let planes: Vec<_> = self.target.iter().flat_map(|target| target.planes()).collect();
        self.pipelines.bind(context, &buffers, &planes)
    }
}

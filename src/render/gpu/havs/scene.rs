//! The parts of a job in the GPU's memory: each is sent when it changes, and only then.

use super::faces::{DrawnBuffer, FaceBuffers};
use super::pipelines::Pipelines;
use crate::mesh::Mesh;
use crate::render::gpu::buffers::{GpuScalars, GrowingBuffer, VertexBuffers};
use crate::render::gpu::context::Context;
use crate::render::gpu::layout::{EYE_WORDS, FRAGMENT_BYTES, FaceParams, Lists, PIECE_WORDS, Params, flags};
use crate::render::gpu::pipelines::{Transform, bind_group};
use crate::render::gpu::shaders::{FragmentKind, Precision};
use crate::render::gpu::table::Table;
use crate::render::gpu::target::Target;
use crate::render::{RenderError, RenderJob};
use crate::visibility::{CellSet, DrawnFaces};
use std::sync::Arc;

/// Pieces of large faces that there is room for at first: a few faces in all tiles.
const FIRST_PIECES_PER_TILE: u64 = 8;
/// Fewest fragments that room is made for.
const FRAGMENTS_MIN: u32 = 1 << 16;

/// Groups of what the stages bind.
pub(super) struct Groups {
    pub(super) transform: wgpu::BindGroup,
    pub(super) count: wgpu::BindGroup,
    pub(super) scan: wgpu::BindGroup,
    pub(super) store: wgpu::BindGroup,
    pub(super) resolve: wgpu::BindGroup,
}

/// All that the stages read and write.
pub(super) struct Scene {
    pub(super) params: GrowingBuffer,
    pub(super) face_params: GrowingBuffer,
    pub(super) vertices: VertexBuffers,
    pub(super) scalars: GpuScalars,
    pub(super) table: Table,
    faces: FaceBuffers,
    drawn: DrawnBuffer,
    active_of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    active: GrowingBuffer,
    /// Counts, places and pieces: [`Lists`].
    pub(super) lists: GrowingBuffer,
    pub(super) fragments: [GrowingBuffer; 2],
    pub(super) transform: Option<Transform>,
    pub(super) pipelines: Option<Pipelines>,
    pub(super) target: Option<Target>,
    pub(super) groups: Option<Groups>,
    /// Bytes sent for the present job.
    pub(super) bytes_sent: u64,
}

impl Scene {
    pub(super) fn new() -> Self {
        let storage = GrowingBuffer::storage;
        Self {
            params: GrowingBuffer::uniform("parameters"),
            face_params: GrowingBuffer::uniform("parameters of the faces"),
            vertices: VertexBuffers::new(),
            scalars: GpuScalars::new(),
            table: Table::new(),
            faces: FaceBuffers::new(),
            drawn: DrawnBuffer::new(),
            active_of: None,
            active: storage("active cells"),
            lists: storage("fragments of each pixel"),
            fragments: ["fragments, first part", "fragments, second part"].map(storage),
            transform: None,
            pipelines: None,
            target: None,
            groups: None,
            bytes_sent: 0,
        }
    }

    /// Brings everything to the GPU that is not there yet, and completes the parameters. [`Table::is_clear`] has been asked.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        drawn: &Arc<DrawnFaces>,
        eye_cells: &[[u32; EYE_WORDS]],
        params: &mut Params,
        face_params: &mut FaceParams,
    ) -> Result<(), RenderError> {
        self.bytes_sent = 0;
        let made = self.update_buffers(context, job, drawn, eye_cells, params, face_params);
        // Buffers may have been made anew before one was refused: the groups bind the old ones.
        if !matches!(made, Ok(false)) {
            self.groups = None;
        }
        made?;
        if self.groups.is_none() {
            self.make_groups(context)?;
        }
        Ok(())
    }

    /// Compiles what a job needs unless that has been done; before [`Self::update`].
    pub(super) fn make_pipelines(
        &mut self,
        context: &Context,
        job: &RenderJob,
        precision: Precision,
    ) -> Result<(), RenderError> {
        if self.pipelines.is_none() {
            self.pipelines = Some(Pipelines::new(context)?);
        }
        if self.transform.is_none() {
            self.transform = Some(Transform::new(context)?);
        }
        match &mut self.pipelines {
            Some(pipelines) => pipelines.prepare(context, job, precision),
            None => Ok(()),
        }
    }

    /// Whether a buffer or a plane was made.
    fn update_buffers(
        &mut self,
        context: &Context,
        job: &RenderJob,
        drawn: &Arc<DrawnFaces>,
        eye_cells: &[[u32; EYE_WORDS]],
        params: &mut Params,
        face_params: &mut FaceParams,
    ) -> Result<bool, RenderError> {
        let mut made = self.params.reserve(context, size_of::<Params>() as u64)?;
        made |= self.face_params.reserve(context, size_of::<FaceParams>() as u64)?;
        let (new_vertices, sent) = self.vertices.upload(context, &job.mesh)?;
        if new_vertices {
            self.scalars.forget();
        }
        self.bytes_sent += sent;
        let (prescale, sent) = self.scalars.scalars_to_gpu(context, job, &self.vertices.scalars)?;
        self.bytes_sent += sent;
        let sent = [
            self.vertices.upload_values(context, job)?,
            self.table.update(context, job, prescale, params)?,
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
        if self.target.as_ref().is_none_or(|t| t.size_px != size_px) {
            self.target = None;
            self.target = Some(Target::new(context, size_px)?);
            made = true;
        }
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
        Ok(made)
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

    /// Room for so many pieces behind the lists; whether the buffer was made for that.
    fn reserve_pieces(&mut self, context: &Context, lists: Lists, pieces: u64) -> Result<bool, RenderError> {
        self.lists.reserve(context, 4 * (lists.pieces() + PIECE_WORDS * pieces))
    }

    /// Pieces that there is room for.
    fn piece_capacity(&self, lists: Lists) -> u32 {
        let words = (self.lists.bytes() / 4).saturating_sub(lists.pieces());
        u32::try_from(words / PIECE_WORDS).unwrap_or(u32::MAX)
    }

    /// Room for more pieces than there was.
    pub(super) fn grow_pieces(
        &mut self,
        context: &Context,
        lists: Lists,
        pieces: u64,
        face_params: &mut FaceParams,
    ) -> Result<(), RenderError> {
        self.reserve_pieces(context, lists, pieces + pieces / 4)?;
        face_params.piece_capacity = self.piece_capacity(lists);
        self.make_groups(context)
    }

    /// Fragments that there may be at a time, if they may take `bytes`.
    pub(super) fn fragment_capacity(context: &Context, kind: FragmentKind, bytes: u64) -> u32 {
        let both = 2 * (context.binding_bytes() / kind.bytes());
        u32::try_from((bytes / kind.bytes()).min(both)).unwrap_or(u32::MAX).max(1)
    }

    /// Room for so many fragments, of at most `capacity`.
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
            // Steps of a factor of two: a camera that moves does not make buffers all the time.
            let wanted = fragments.checked_next_power_of_two().unwrap_or(capacity);
            let wanted = u64::from(wanted.max(FRAGMENTS_MIN).min(capacity));
            let in_first = wanted.min(context.binding_bytes() / kind.bytes());
            let [first, second] = &mut self.fragments;
            let mut made = first.reserve(context, kind.bytes() * in_first)?;
            made |= second.reserve(context, kind.bytes() * (wanted - in_first))?;
            if made {
                self.make_groups(context)?;
            }
        }
        face_params.fragment_part = u32::try_from(room(&self.fragments[0])).unwrap_or(u32::MAX);
        Ok(())
    }

    fn make_groups(&mut self, context: &Context) -> Result<(), RenderError> {
        self.groups = None;
        let (Some(transform), Some(pipelines), Some(target)) = (&self.transform, &self.pipelines, &self.target) else {
            return Ok(());
        };
        let whole = |buffer: &GrowingBuffer| buffer.get(context).cloned();
        let [params, face_params] = [whole(&self.params)?, whole(&self.face_params)?];
        let [lists, vertices, drawn] =
            [whole(&self.lists)?, whole(&self.vertices.vertices)?, whole(&self.drawn.buffer)?];
        let [first, second, third] = &self.faces.parts;
        let faces = [whole(first)?, whole(second)?, whole(third)?];
        let fragments = [whole(&self.fragments[0])?, whole(&self.fragments[1])?];
        let [positions, scalars] = [whole(&self.vertices.positions)?, whole(&self.vertices.scalars)?];
        let [active, table, counters] = [whole(&self.active)?, whole(&self.table.buffer)?, whole(&target.counters)?];
        let table_parameters = whole(&self.table.parameters)?;
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (color, depth) = (view(&target.color), view(&target.depth));
        let [first, second, third] = &faces;
        let find =
            [&params, &face_params, &lists, &vertices, &drawn, first, second, third, &fragments[0], &fragments[1]];
        let find = find.map(wgpu::Buffer::as_entire_binding);
        self.groups = Some(Groups {
            transform: transform
                .group(context, &[&params, &positions, &scalars, &vertices].map(wgpu::Buffer::as_entire_binding)),
            count: bind_group(context, "count fragments", &pipelines.count_layout, &find[..8]),
            scan: bind_group(context, "scan fragments", &pipelines.scan_layout, &find[..3]),
            store: bind_group(context, "store fragments", &pipelines.store_layout, &find),
            resolve: bind_group(
                context,
                "resolve fragments",
                &pipelines.resolve_layout,
                &[
                    params.as_entire_binding(),
                    face_params.as_entire_binding(),
                    lists.as_entire_binding(),
                    fragments[0].as_entire_binding(),
                    fragments[1].as_entire_binding(),
                    active.as_entire_binding(),
                    table.as_entire_binding(),
                    counters.as_entire_binding(),
                    wgpu::BindingResource::TextureView(&color),
                    wgpu::BindingResource::TextureView(&depth),
                    table_parameters.as_entire_binding(),
                ],
            ),
        });
        context.check()
    }
}

//! The parts of a job in the GPU's memory that both renderers have, each sent only when it changes.

use super::buffers::{GpuScalars, GrowingBuffer, NUMBERS_PER_VERTEX, VertexBuffers};
use super::context::Context;
use super::flow_textures::FlowTextures;
use super::layer_fragments::LayerTexture;
use super::layout::{Params, flags};
use super::pipelines::Pipelines;
use super::resources::Resource;
use super::shaders::Stage;
use super::surfaces::{SurfaceBuffer, scalar_map};
use super::table::Table;
use super::target::Target;
use crate::mesh::Mesh;
use crate::render::{RenderError, RenderJob};
use crate::stats::FrameStats;
use crate::visibility::CellSet;
use std::sync::Arc;

/// Parameters, vertices, transfer function, surfaces and active cells of a job, and the target of its image.
pub(super) struct SharedScene {
    pub(super) params: GrowingBuffer,
    pub(super) vertices: VertexBuffers,
    pub(super) scalars: GpuScalars,
    pub(super) table: Table,
    surfaces: SurfaceBuffer,
    layers: LayerTexture,
    pub(super) flow: FlowTextures,
    active_of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    active: GrowingBuffer,
    target: Option<Arc<Target>>,
    /// Whether a buffer or a plane was made for the present job.
    pub(super) made: bool,
    /// Bytes sent for the present job.
    pub(super) bytes_sent: u64,
}

impl SharedScene {
    pub(super) fn new() -> Self {
        Self {
            params: GrowingBuffer::new(Resource::Params),
            vertices: VertexBuffers::new(),
            scalars: GpuScalars::new(),
            table: Table::new(),
            surfaces: SurfaceBuffer::new(),
            layers: LayerTexture::new(),
            flow: FlowTextures::new(),
            active_of: None,
            active: GrowingBuffer::new(Resource::ActiveCells),
            target: None,
            made: false,
            bytes_sent: 0,
        }
    }

    /// Notes whether a buffer was made for the present job, and the bytes sent.
    pub(super) fn note(&mut self, (made, bytes): (bool, u64)) {
        self.made |= made;
        self.bytes_sent += bytes;
    }

    /// Begins a job: uploads its vertices, transfer function, surfaces and other layers unless they are on the GPU, and completes the parameters. The
    /// caller has asked [`Table::is_transparent`].
    pub(super) fn upload(
        &mut self,
        context: &Context,
        job: &RenderJob,
        params: &mut Params,
    ) -> Result<(), RenderError> {
        (self.made, self.bytes_sent) = (self.params.reserve(context, size_of::<Params>() as u64)?, 0);
        let vertices = self.vertices.upload(context, &job.mesh)?;
        let made = self.vertices.reserve_scalars(context, job.scalars.values().len())?;
        if vertices.0 || made {
            self.scalars.forget();
        }
        self.note((vertices.0 || made, vertices.1));
        let (prescale, sent) = self.scalars.scalars_to_gpu(context, job, &self.vertices.scalars)?;
        self.bytes_sent += sent;
        let map = scalar_map(job, prescale, self.scalars.largest());
        let (gradients, has_volume) = (VertexBuffers::first_gradient(job) as u32, !self.table.is_transparent(job));
        let uploaded = [
            self.vertices.upload_values(context, job)?,
            self.table.update(context, job, map, params)?,
            self.surfaces.update(context, job, map, gradients, has_volume)?,
            self.layers.update(context, job, params)?,
            self.flow.update(context, job, params)?,
        ];
        uploaded.into_iter().for_each(|uploaded| self.note(uploaded));
        params.vertex_count = job.mesh.positions.local.len() as u32;
        params.cell_count = job.scalars.of_cells().map_or(0, |scalars| scalars.len() as u32);
        if job.skip.opaque {
            params.flags |= flags::EARLY_TERMINATION;
        }
        if job.active.count() == job.active.universe() {
            params.flags |= flags::ALL_ACTIVE;
        }
        Ok(())
    }

    /// Uploads the active cells unless they are on the GPU.
    pub(super) fn upload_active(&mut self, context: &Context, job: &RenderJob) -> Result<(), RenderError> {
        let same = |(mesh, active): &(Arc<Mesh>, Arc<CellSet>)| {
            Arc::ptr_eq(mesh, &job.mesh) && Arc::ptr_eq(active, &job.active)
        };
        if self.active_of.as_ref().is_some_and(same) {
            return Ok(());
        }
        self.active_of = None;
        let words = job.active.words();
        let made = self.active.reserve(context, size_of_val(words) as u64)?;
        // Words of 64 bits as pairs of 32, lower first: the same bits on a little-endian GPU, as all are.
        let halves: Vec<u32> = words.iter().flat_map(|&w| [w as u32, (w >> 32) as u32]).collect();
        let sent = self.active.write(context, 0, bytemuck::cast_slice(&halves))?;
        self.note((made, sent));
        self.active_of = Some((job.mesh.clone(), job.active.clone()));
        Ok(())
    }

    /// The target of the image, and whether it is new.
    pub(super) fn resize(&mut self, context: &Context, params: &Params) -> Result<(Arc<Target>, bool), RenderError> {
        let (target, is_new) = Target::kept(&mut self.target, context, params.size_px.map(|px| px as usize).into())?;
        self.made |= is_new;
        Ok((target, is_new))
    }

    /// The buffers that stages may bind.
    pub(super) fn buffers(&self) -> Vec<&GrowingBuffer> {
        let mut buffers = vec![&self.params, &self.active, &self.surfaces.buffer];
        buffers.extend(self.vertices.buffers());
        buffers.extend(self.table.buffers());
        buffers.extend(self.target.iter().map(|target| &target.counters));
        buffers.extend(self.flow.lists.buffers());
        buffers
    }

    /// The planes that stages may bind.
    pub(super) fn planes(&self) -> Vec<(Resource, &wgpu::TextureView)> {
        let layers = self.layers.view().into_iter().chain(self.flow.views());
        self.target.iter().flat_map(|target| target.planes()).chain(layers).collect()
    }

    /// Makes room for lists of splats if what was told says that they are incomplete; bind groups are then to be made anew.
    pub(super) fn grow_flow(&mut self, context: &Context, told: [u32; 2]) -> Result<(), RenderError> {
        self.flow.lists.grow(context, told)
    }

    /// Writes the parameters, and records decoding, if the scalars are compressed, the view transform, and the stages of flow, if there is some.
    pub(super) fn record(
        &self,
        context: &Context,
        pipelines: &Pipelines,
        params: &Params,
        target: &Target,
        encoder: &mut wgpu::CommandEncoder,
        stats: &mut FrameStats,
    ) -> Result<(), RenderError> {
        self.params.write(context, 0, bytemuck::bytes_of(params))?;
        let decoder = &self.scalars.decoder;
        if decoder.pending_scalars() > 0 {
            stats.vertices_decoded_on_gpu = decoder.pending_scalars();
            decoder.record(context, &mut target.pass(encoder, "decode", Some(6)))?;
        }
        let threads = params.vertex_count + params.cell_count.div_ceil(NUMBERS_PER_VERTEX as u32);
        let mut pass = target.pass(encoder, "view transform", Some(0));
        pipelines.dispatch(context, Stage::ViewTransform, threads.div_ceil(256), &mut pass)?;
        drop(pass);
        self.flow.lists.record(context, pipelines, encoder)
    }

    /// Submits what [`Self::record`] has recorded, and what follows it.
    pub(super) fn submit(&mut self, context: &Context, encoder: wgpu::CommandEncoder) -> Result<(), RenderError> {
        context.queue.submit([encoder.finish()]);
        self.scalars.decoder.forget();
        context.check()
    }
}

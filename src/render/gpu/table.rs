//! The transfer function in the GPU's memory.

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::joint::JointBuffers;
use super::layout::{JointParams, Params};
use super::resources::Resource;
use crate::optics::ScalarMap;
use crate::optics::table3d::Table3dParams;
use crate::render::{OpticsTable, OpticsTables, RenderError, RenderJob};

/// The optics table in the GPU's memory.
pub(super) struct Table {
    /// Optics tables for jobs without one.
    tables: OpticsTables,
    /// Scalar map and table that the buffers hold.
    sent: Option<(ScalarMap, OpticsTable)>,
    buffer: GrowingBuffer,
    /// Parameters of a pre-integrated table.
    table3d_params: GrowingBuffer,
    /// Parameters of a joint table.
    joint_params: GrowingBuffer,
    interval_count: u32,
    joint: JointBuffers,
}

impl Table {
    pub(super) fn new() -> Self {
        Self {
            tables: OpticsTables::default(),
            sent: None,
            buffer: GrowingBuffer::new(Resource::Table),
            table3d_params: GrowingBuffer::new(Resource::Table3dParams),
            joint_params: GrowingBuffer::new(Resource::JointParams),
            interval_count: 0,
            joint: JointBuffers::default(),
        }
    }

    /// The buffers that stages may bind.
    pub(super) fn buffers(&self) -> [&GrowingBuffer; 3] {
        [&self.buffer, &self.table3d_params, &self.joint_params]
    }

    /// Whether the job's table makes all scalars transparent.
    pub(super) fn is_transparent(&mut self, job: &RenderJob) -> bool {
        self.tables.get(job).exact().is_transparent()
    }

    /// Whether neither cells nor other layers are visible.
    pub(super) fn shows_nothing(&mut self, job: &RenderJob) -> bool {
        let no_cells = job.active.count() == 0 || job.surfaces.is_none() && self.is_transparent(job);
        no_cells && !job.has_other_layers()
    }

    /// Uploads the table of the job's optics, over mapped scalars, and completes the parameters. Returns whether a buffer was made, and the
    /// bytes sent.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        map: ScalarMap,
        params: &mut Params,
    ) -> Result<(bool, u64), RenderError> {
        (params.scalar_offset, params.scalar_scale) = (map.offset as f32, map.scale as f32);
        let mut made = self.table3d_params.reserve(context, size_of::<Table3dParams>() as u64)?;
        made |= self.joint_params.reserve(context, size_of::<JointParams>() as u64)?;
        if let Some(scene) = &job.joint {
            self.sent = None;
            let buffers = [&mut self.buffer, &mut self.joint_params];
            let (new, bytes_sent) = self.joint.update(context, job, scene, map, buffers)?;
            return Ok((made || new, bytes_sent));
        }
        self.joint.forget();
        let mut bytes_sent = 0;
        let table = self.tables.get(job);
        let is_there = self.sent.as_ref().is_some_and(|(seen, sent)| *seen == map && sent.is_same(&table));
        if made || !is_there {
            self.sent = None;
            let packed;
            let words: &[[f32; 4]] = match &table {
                OpticsTable::Table3d(table) => {
                    bytes_sent += self.table3d_params.write(context, 0, bytemuck::bytes_of(&table.params(map)))?;
                    bytemuck::cast_slice(table.entries())
                }
                OpticsTable::Exact(exact) => {
                    packed = exact.packed(map);
                    self.interval_count = (packed.len() / 3) as u32;
                    &packed
                }
                OpticsTable::Partial(partial) => {
                    packed = partial.packed(map);
                    self.interval_count = partial.interval_count() as u32;
                    &packed
                }
            };
            made |= self.buffer.reserve(context, size_of_val(words) as u64)?;
            bytes_sent += self.buffer.write(context, 0, bytemuck::cast_slice(words))?;
            // A table whose integration was cancelled is incomplete.
            self.sent = (!job.cancel.is_cancelled()).then_some((map, table));
        }
        params.interval_count = self.interval_count;
        Ok((made, bytes_sent))
    }
}

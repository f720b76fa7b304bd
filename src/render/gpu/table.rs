//! The transfer function in the GPU's memory.

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::Params;
use crate::node_table::NodeTable;
use crate::optics::exact::ExactTable;
use crate::optics::table3d::Table3dParams;
use crate::optics::{OpticsKind, ScalarMap};
use crate::render::cpu::raycast::pre_integrated::PreIntegrated;
use crate::render::{RenderError, RenderJob};
use std::sync::Arc;

/// The transfer function.
pub(super) struct Table {
    of: Option<(Arc<NodeTable>, f64)>,
    exact: Option<ExactTable>,
    pre_integrated: PreIntegrated,
    /// What the buffers' contents are for.
    sent: Option<(ScalarMap, OpticsKind)>,
    pub(super) buffer: GrowingBuffer,
    /// What the pre-integrated table needs beside its entries.
    pub(super) parameters: GrowingBuffer,
    interval_count: u32,
}

impl Table {
    pub(super) fn new() -> Self {
        Self {
            of: None,
            exact: None,
            pre_integrated: PreIntegrated::default(),
            sent: None,
            buffer: GrowingBuffer::storage("table"),
            parameters: GrowingBuffer::uniform("parameters of the table"),
            interval_count: 0,
        }
    }

    /// Whether no scalar can be seen with the job's table.
    pub(super) fn is_clear(&mut self, job: &RenderJob) -> bool {
        let scale = job.mesh.positions.scale;
        let same = |(table, s): &(Arc<NodeTable>, f64)| Arc::ptr_eq(table, &job.table) && *s == scale;
        if !self.of.as_ref().is_some_and(same) {
            self.exact = Some(ExactTable::new(&job.table, scale));
            self.sent = None;
            self.of = Some((job.table.clone(), scale));
        }
        self.exact.as_ref().is_none_or(ExactTable::is_clear)
    }

    /// Brings the table of the job's optics to the GPU, seen through the map of its scalars, which have been multiplied by
    /// `prescale`; completes the parameters. [`Self::is_clear`] has been asked. Returns whether a buffer was made, and the
    /// bytes sent.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        prescale: f64,
        params: &mut Params,
    ) -> Result<(bool, u64), RenderError> {
        let map = ScalarMap::of_table(&job.table, prescale);
        (params.scalar_offset, params.scalar_scale) = (map.offset as f32, map.scale as f32);
        let mut made = self.parameters.reserve(context, size_of::<Table3dParams>() as u64)?;
        let mut bytes_sent = 0;
        if made || self.sent != Some((map, job.optics)) {
            self.sent = None;
            let pre_integrated;
            let packed;
            let words: &[[f32; 4]] = match (job.optics, &self.exact) {
                (OpticsKind::Table3d, _) => {
                    pre_integrated = self.pre_integrated.get(job);
                    let of_shader = pre_integrated.params(map);
                    bytes_sent += self.parameters.write(context, 0, bytemuck::bytes_of(&of_shader))?;
                    bytemuck::cast_slice(pre_integrated.entries())
                }
                (OpticsKind::Exact, Some(exact)) => {
                    packed = exact.packed(map);
                    self.interval_count = (packed.len() / 3) as u32;
                    &packed
                }
                (OpticsKind::Exact, None) => &[],
            };
            made |= self.buffer.reserve(context, size_of_val(words) as u64)?;
            bytes_sent += self.buffer.write(context, 0, bytemuck::cast_slice(words))?;
            // A table whose integration was cancelled is not one.
            self.sent = (!job.cancel.is_cancelled()).then_some((map, job.optics));
        }
        params.interval_count = self.interval_count;
        Ok((made, bytes_sent))
    }
}

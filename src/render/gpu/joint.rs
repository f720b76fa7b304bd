//! Joint tables (transfer functions of more than the scalar) in the GPU's memory: in the buffers of a table of the scalar, so that
//! stages need no more bindings.
//!
//! The table's buffer holds the layers of the cells first, then the table itself, which changes more often. The values of the
//! rows lie behind the view vertices ([`VertexBuffers`](super::buffers::VertexBuffers)).

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::JointParams;
use crate::field::Scalars;
use crate::node_table::JointTable;
use crate::optics::ScalarMap;
use crate::optics::joint::{packed, packed_len};
use crate::render::{JointScene, RenderError, RenderJob};
use rayon::prelude::*;
use std::sync::{Arc, Weak};

/// Cells per vector of four numbers.
const CELLS_PER_VECTOR: usize = 2;

/// The joint table and cell values that have been sent.
#[derive(Default)]
pub(super) struct JointBuffers {
    cells: Option<CellsSent>,
    table: Option<TableSent>,
}

/// The cell values that have been sent, as layers of a table.
struct CellsSent {
    of: Weak<Vec<f32>>,
    table: Arc<JointTable>,
}

struct TableSent {
    table: Arc<JointTable>,
    map: ScalarMap,
    /// World length of a local unit.
    scale: f64,
    /// First vector of the table in the buffer.
    first: usize,
    /// Cells that have a value.
    cells: usize,
}

impl TableSent {
    fn is_same(&self, other: &Self) -> bool {
        let key = |sent: &Self| (sent.map, sent.scale, sent.first, sent.cells);
        Arc::ptr_eq(&self.table, &other.table) && key(self) == key(other)
    }
}

impl JointBuffers {
    /// Uploads the table of a job to `buffer` and the places of its parts to `parameters`, unless they are there. Returns whether the
    /// buffer was made, and the bytes sent.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        scene: &JointScene,
        map: ScalarMap,
        [buffer, parameters]: [&mut GrowingBuffer; 2],
    ) -> Result<(bool, u64), RenderError> {
        let cells = scene.cell_values.as_ref().filter(|_| scene.table.cell_axis().len() > 1);
        let count = cells.map_or(0, |cells| cells.len());
        let first = count.div_ceil(CELLS_PER_VECTOR);
        let wanted =
            TableSent { table: scene.table.clone(), map, scale: job.mesh.positions.scale, first, cells: count };
        if !self.table.as_ref().is_some_and(|sent| sent.is_same(&wanted)) {
            self.table = None;
        }
        let bytes = 16 * (first + packed_len(&scene.table)) as u64;
        if buffer.bytes() < bytes {
            self.forget();
        }
        let made = buffer.reserve(context, bytes)?;
        let mut sent = 0;
        if self.table.is_none() {
            let rows = rows_map(&scene.table);
            let packed = packed(&scene.table, map, rows, wanted.scale);
            sent += buffer.write(context, 16 * first as u64, bytemuck::cast_slice(&packed.words))?;
            let (first, scalars) = (first as u32, packed.scalar_intervals);
            let params = JointParams {
                scalar_intervals: first,
                scalar_count: scalars,
                row_intervals: first + scalars,
                row_count: packed.row_intervals,
                values: first + scalars + packed.row_intervals,
                columns: scene.table.scalars().len() as u32,
                layer_values: (scene.table.scalars().len() * scene.table.vertex_axis().len()) as u32,
                cells: 0,
                cell_count: count as u32,
            };
            sent += parameters.write(context, 0, bytemuck::bytes_of(&params))?;
            self.table = Some(wanted);
        }
        sent += self.update_cells(context, cells, &scene.table, buffer)?;
        Ok((made, sent))
    }

    fn update_cells(
        &mut self,
        context: &Context,
        cells: Option<&Arc<Vec<f32>>>,
        table: &Arc<JointTable>,
        buffer: &GrowingBuffer,
    ) -> Result<u64, RenderError> {
        let Some(cells) = cells else {
            self.cells = None;
            return Ok(0);
        };
        let is_there = |sent: &CellsSent| {
            Weak::as_ptr(&sent.of) == Arc::as_ptr(cells) && sent.table.cell_axis() == table.cell_axis()
        };
        if self.cells.as_ref().is_some_and(is_there) {
            return Ok(0);
        }
        let layer = |value: &f32| {
            let ([below, _], share) = table.layer_at(f64::from(*value));
            [below as f32, share as f32]
        };
        let mut packed: Vec<[f32; 2]> = Vec::with_capacity(cells.len());
        cells.par_iter().map(layer).collect_into_vec(&mut packed);
        let sent = buffer.write(context, 0, bytemuck::cast_slice(&packed))?;
        self.cells = Some(CellsSent { of: Arc::downgrade(cells), table: table.clone() });
        Ok(sent)
    }

    /// Forgets what was sent: the buffer holds other data.
    pub(super) fn forget(&mut self) {
        (self.cells, self.table) = (None, None);
    }
}

/// The map that is applied to the values of the rows, which have no steps.
fn rows_map(table: &JointTable) -> ScalarMap {
    let rows = table.vertex_axis();
    ScalarMap::of_range(rows[0], rows[rows.len() - 1], 1.0)
}

/// The values of rows, of vertices or cells, that were sent last.
#[derive(Debug)]
pub(super) struct RowValues {
    of: Option<Weak<Vec<f32>>>,
    map: ScalarMap,
    /// Value of vertices or cells without one.
    lowest: f64,
    first: usize,
}

impl RowValues {
    /// Index of the first one among the numbers behind the view vertices.
    pub(super) fn first(&self) -> usize {
        self.first
    }

    /// Whether these are the values of a scene, and begin at `first`.
    pub(super) fn are_of(&self, scene: &JointScene, first: usize) -> bool {
        let sent = self.of.as_ref().map(Weak::as_ptr);
        let key = (rows_map(&scene.table), scene.table.vertex_axis()[0], first);
        let values = scene.row_values.as_ref().map(Scalars::values);
        sent == values.map(Arc::as_ptr) && (self.map, self.lowest, self.first) == key
    }

    /// The values of a scene, and the mapped numbers to be sent, one for each of the scalars, to begin at `first`.
    pub(super) fn of(scene: &JointScene, scalars: &Scalars, first: usize) -> (Self, Vec<f32>) {
        let map = rows_map(&scene.table);
        let value = |of: u32| match scalars {
            Scalars::Vertices(_) => scene.vertex_value(of),
            Scalars::Cells(_) => scene.value_in_cell(of),
        };
        // Clamped to stay finite, as scalars are in `view_transform.wgsl`.
        let seen = |of: usize| map.apply(value(of as u32)).clamp(-1e30, 1e30) as f32;
        let words = (0..scalars.values().len()).into_par_iter().map(seen).collect();
        let of = scene.row_values.as_ref().map(|values| Arc::downgrade(values.values()));
        (Self { of, map, lowest: scene.table.vertex_axis()[0], first }, words)
    }
}

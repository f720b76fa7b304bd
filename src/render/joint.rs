//! [`JointScene`]: the joint transfer function of a job with the values that it takes beside the scalar, and its medium.
//!
//! The order stage gives a job these values: coefficients of variation, computed once per series, and the gradient magnitudes of the
//! scalars shown, computed for each frame.
//!
//! - **The reference** clips the value at vertices as it clips the scalar, cuts segments at nodes, rows and diagonals
//!   (`reference/joint.rs`), and evaluates `JointTable::eval`; the fast paths' integrator counts rectangles from line to line.
//! - **On the CPU** (`cpu/values.rs`) the walk interpolates the value on each face from its edge functions; the face renderer keeps its
//!   fragments unchanged and evaluates the cell's faces at both ends of a gap again.
//! - **On the GPU** no further buffer is bound: values of rows lie behind the view vertices, table layers of cells and the table in the
//!   node table's buffer. Fragments carry their value, 32 bytes instead of 24, unless it is the cell's. Eight storage buffers are enough;
//!   a table larger than the binding is `BeyondGpu`.
//!
//! Accuracy against the reference (noise as the table, with steps; 48 x 48 pixels, an irregular mesh with a hole; all channels;
//! `tests/it/render/joint.rs` and `joint_gpu.rs`): RMSE 7e-8 and at most 9e-7 on the CPU, 1e-7 and 5e-6 on the GPU (llvmpipe). A spike of
//! extinction 300 between rows and nodes 0.1 apart: at most 6e-6 on the CPU, 7e-6 on the GPU.

use super::RenderError;
use super::medium::{Medium, Segment};
use crate::field::Scalars;
use crate::mesh::Mesh;
use crate::node_table::JointTable;
use crate::optics::Accumulator;
use crate::optics::joint::JointSegment;
use std::sync::Arc;

/// A transfer function of the scalar and of up to two values beside it, with these values. Cheap to clone.
#[derive(Clone, Debug)]
pub struct JointScene {
    /// The transfer function.
    pub table: Arc<JointTable>,
    /// Values in the unit of the table's rows: at vertices, linear in a cell, or of cells, as the scalars. NaN counts as the lowest row;
    /// `None` as NaN everywhere.
    pub row_values: Option<Scalars>,
    /// One value per cell of the mesh, in the unit of the table's layers. NaN counts as the lowest table layer; `None` as NaN everywhere.
    pub cell_values: Option<Arc<Vec<f32>>>,
}

impl JointScene {
    /// Checks that there is one value per vertex or cell of a mesh, and that rows are of what has the scalars.
    pub(super) fn check(&self, mesh: &Mesh, scalars: &Scalars) -> Result<(), RenderError> {
        let check = |values: &Option<Arc<Vec<f32>>>, of: &'static str, expected: usize| match values {
            Some(values) if values.len() != expected => {
                Err(RenderError::JointValueCount { given: values.len(), of, expected })
            }
            _ => Ok(()),
        };
        if self.row_values.as_ref().is_some_and(|values| values.association() != scalars.association()) {
            return Err(RenderError::JointAssociation);
        }
        match &self.row_values {
            Some(Scalars::Cells(values)) => check(&Some(values.clone()), "cells", mesh.topology.tets.len())?,
            values => {
                let values = values.as_ref().and_then(Scalars::of_vertices).cloned();
                check(&values, "vertices", mesh.positions.local.len())?;
            }
        }
        check(&self.cell_values, "cells", mesh.topology.tets.len())
    }

    /// Value at a vertex, if vertices have these values; infinities clamp to +-f32::MAX, NaN to the lowest row.
    pub(super) fn vertex_value(&self, vertex: u32) -> f64 {
        let values = self.row_values.as_ref().and_then(Scalars::of_vertices);
        self.row_value(values.map_or(f32::NAN, |values| values[vertex as usize]))
    }

    /// Values at the corners of a cell, as [`Self::vertex_value`].
    pub(super) fn values_at_corners(&self, cell: u32, tet: [u32; 4]) -> [f64; 4] {
        let values = self.row_values.as_ref().map_or([f32::NAN; 4], |values| values.at_corners(cell, tet));
        values.map(|value| self.row_value(value))
    }

    /// Value of the row in a cell, if cells have these values, as [`Self::vertex_value`].
    pub(super) fn value_in_cell(&self, cell: u32) -> f64 {
        let values = self.row_values.as_ref().and_then(Scalars::of_cells);
        self.row_value(values.map_or(f32::NAN, |values| values[cell as usize]))
    }

    fn row_value(&self, value: f32) -> f64 {
        if value.is_nan() { self.table.vertex_axis()[0] } else { f64::from(value.clamp(f32::MIN, f32::MAX)) }
    }

    /// Value of a cell; NaN selects the lowest table layer.
    pub(super) fn cell_value(&self, cell: u32) -> f64 {
        self.cell_values.as_ref().map_or(f64::NAN, |values| f64::from(values[cell as usize]))
    }
}

/// A [`JointScene`] as a medium.
pub(super) struct JointMedium<'a> {
    pub(super) scene: &'a JointScene,
    /// World length per unit of a ray's length.
    pub(super) scale: f64,
}

impl Medium for JointMedium<'_> {
    type Ray = ();
    type Light = Accumulator;
    const HAS_VALUES: bool = true;

    #[inline(never)]
    fn pass(&self, (): &mut (), segment: &Segment, light: &mut Accumulator) -> u32 {
        let Segment { cell, depth: [enter, exit], scalar, value, .. } = *segment;
        let [from, to] = segment.shares();
        let line = JointSegment::new(&self.scene.table, scalar, value, self.scene.cell_value(cell));
        let pieces = line.composite(from, to, segment.length() * self.scale, light) as u32;
        if pieces > 0 && light.visible_from == f64::INFINITY {
            let share = line.first_visible(from, to);
            light.visible_from = share.map_or(f64::INFINITY, |share| enter + share * (exit - enter));
        }
        pieces
    }

    fn vertex_value(&self, vertex: u32) -> f64 {
        self.scene.vertex_value(vertex)
    }

    fn value_in_cell(&self, cell: u32) -> f64 {
        self.scene.value_in_cell(cell)
    }
}

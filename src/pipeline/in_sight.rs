//! The visible cells of a request.

use super::series::Series;
use super::{PipelineError, TetLayer};
use crate::field::Scalars;
use crate::task::Cancel;
use crate::visibility::{ActiveCells, Activity, CutCells, CutPlanes, Label, PartCells, TransparentIntervals};
use std::sync::Arc;

/// Finds the visible cells from request to request.
#[derive(Debug, Default)]
pub(super) struct CellsInSight {
    cells: ActiveCells,
    part_cells: PartCells,
    cut_cells: CutCells,
}

/// Inputs that decide which cells are visible.
#[derive(Clone, Copy, Debug)]
pub(super) struct InSight<'a> {
    pub(super) layer: &'a TetLayer,
    pub(super) scalars: &'a Scalars,
    /// Labels of chunks that were not decoded; empty if all were.
    pub(super) known: &'a [Option<Label>],
    /// Scalar intervals where the volume is transparent.
    pub(super) transparent: &'a Arc<TransparentIntervals>,
    pub(super) planes: &'a CutPlanes,
    /// Whether cells that clips remove are kept.
    pub(super) keep_away: bool,
}

impl CellsInSight {
    /// The visible cells of a series, and how many would be visible without clips. With `forget`, earlier results are not used.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(super) fn find(
        &mut self,
        series: &Series,
        InSight { layer, scalars, known, transparent, planes, keep_away }: InSight<'_>,
        forget: bool,
        cancel: &Cancel,
    ) -> Result<(Activity, u64), PipelineError> {
        if forget {
            (self.part_cells, self.cut_cells) = Default::default();
        }
        let found = self.cells.update(&series.mesh, series.clusters(), scalars, (transparent, known), forget, cancel);
        let mut found = found.ok_or(PipelineError::Cancelled)?;
        if !layer.parts.is_empty() {
            found = self.part_cells.restrict(&series.mesh, &layer.parts, found);
        }
        if planes.is_empty() {
            return Ok((found, 0));
        }
        Ok(self.cut_cells.update(&series.mesh, planes, keep_away, found))
    }
}

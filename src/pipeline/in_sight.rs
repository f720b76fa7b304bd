//! The cells of which something is to be seen.

use super::series::Series;
use super::{PipelineError, TetLayer};
use crate::task::Cancel;
use crate::visibility::{ActiveCells, Activity, CutCells, CutPlanes, Label, PartCells, TransparentIntervals};
use std::sync::Arc;

/// Finds the cells in sight from request to request.
#[derive(Debug, Default)]
pub(super) struct CellsInSight {
    cells: ActiveCells,
    part_cells: PartCells,
    cut_cells: CutCells,
}

/// What decides which cells are in sight.
#[derive(Clone, Copy, Debug)]
pub(super) struct InSight<'a> {
    pub(super) layer: &'a TetLayer,
    pub(super) scalars: &'a Arc<Vec<f32>>,
    /// The labels of chunks whose scalars are not there; empty if all are.
    pub(super) known: &'a [Option<Label>],
    /// Where nothing is to be seen of the volume.
    pub(super) transparent: &'a Arc<TransparentIntervals>,
    pub(super) planes: &'a CutPlanes,
    /// Whether cells stay that clips cut away.
    pub(super) keep_away: bool,
}

impl CellsInSight {
    /// The cells of a series that are in sight, and how many would be without clips. With `forget`, nothing that is known from before is used.
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

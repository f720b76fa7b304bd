//! The visible cells of a request.

use super::series::Series;
use super::{PipelineError, Regions, TetLayer};
use crate::field::Scalars;
use crate::task::Cancel;
use crate::visibility::{
    ActiveCells, Activity, CellSet, CutCells, CutPlanes, Label, PartCells, Restricted, TransparentIntervals,
};
use std::sync::{Arc, Weak};

/// Finds the visible cells from request to request.
#[derive(Debug, Default)]
pub(super) struct CellsInSight {
    cells: ActiveCells,
    part_cells: PartCells,
    region_cells: RegionCells,
    cut_cells: CutCells,
}

/// The cells of some regions, kept while values and regions stay.
#[derive(Debug, Default)]
struct RegionCells {
    /// The values, compared by pointer.
    of: Weak<Vec<f32>>,
    regions: Option<Regions>,
    cells: Arc<CellSet>,
    restricted: Restricted,
}

impl RegionCells {
    /// The cells of `activity` that belong to these regions.
    fn restrict(&mut self, regions: &Regions, values: &Arc<Vec<f32>>, activity: Activity) -> Activity {
        if self.of.as_ptr() != Arc::as_ptr(values) || self.regions.as_ref() != Some(regions) {
            let cells = CellSet::of(values.len(), |cell| regions.show(values[cell]));
            // The same set is the same memory, by which renderers know it again.
            if *self.cells != cells {
                self.cells = Arc::new(cells);
            }
            (self.of, self.regions) = (Arc::downgrade(values), Some(regions.clone()));
        }
        self.restricted.to(&self.cells, activity)
    }
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
    /// Values of the cells by which regions are chosen, if they are.
    pub(super) region_values: Option<&'a Arc<Vec<f32>>>,
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
        InSight { layer, scalars, known, transparent, region_values, planes, keep_away }: InSight<'_>,
        forget: bool,
        cancel: &Cancel,
    ) -> Result<(Activity, u64), PipelineError> {
        if forget {
            (self.part_cells, self.region_cells, self.cut_cells) = Default::default();
        }
        let found = self.cells.update(&series.mesh, series.clusters(), scalars, (transparent, known), forget, cancel);
        let mut found = found.ok_or(PipelineError::Cancelled)?;
        if !layer.parts.is_empty() {
            found = self.part_cells.restrict(&series.mesh, &layer.parts, found);
        }
        if let (Some(regions), Some(values)) = (&layer.regions, region_values) {
            found = self.region_cells.restrict(regions, values, found);
        }
        if planes.is_empty() {
            return Ok((found, 0));
        }
        Ok(self.cut_cells.update(&series.mesh, planes, keep_away, found))
    }
}

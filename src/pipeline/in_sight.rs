//! The visible cells of a request.

use super::region_values::RegionValues;
use super::series::Series;
use super::{PipelineError, TetLayer};
use crate::field::{Regions, Scalars};
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
pub(super) struct RegionCells {
    /// The values, compared by pointer.
    of: Weak<Vec<f32>>,
    regions: Option<Regions>,
    cells: Arc<CellSet>,
    restricted: Restricted,
}

impl RegionCells {
    /// The cells of `activity` that belong to these regions.
    pub(super) fn restrict(&mut self, regions: &Regions, values: &Arc<Vec<f32>>, activity: Activity) -> Activity {
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
    /// Values of the cells by which regions are chosen.
    pub(super) region_values: &'a RegionValues,
    pub(super) planes: &'a CutPlanes,
    /// Whether cells that clips remove are kept.
    pub(super) keep_away: bool,
}

/// The visible cells of a request.
#[derive(Debug)]
pub(super) struct Sight {
    pub(super) activity: Activity,
    /// How many cells clips remove.
    pub(super) clipped: u64,
    /// The cells with finite scalars in the parts that are shown, of all regions and unclipped.
    pub(super) of_all_regions: Arc<CellSet>,
}

impl CellsInSight {
    /// The visible cells of a series. With `forget`, earlier results are not used.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(super) fn find(
        &mut self,
        series: &Series,
        InSight { layer, scalars, known, transparent, region_values, planes, keep_away }: InSight<'_>,
        forget: bool,
        cancel: &Cancel,
    ) -> Result<Sight, PipelineError> {
        if forget {
            (self.part_cells, self.region_cells, self.cut_cells) = Default::default();
        }
        let found = self.cells.update(&series.mesh, series.clusters(), scalars, (transparent, known), forget, cancel);
        let mut found = found.ok_or(PipelineError::Cancelled)?;
        if !layer.parts.is_empty() {
            found = self.part_cells.restrict(&series.mesh, &layer.parts, found);
        }
        let of_all_regions = found.finite.clone();
        if let Some(regions) = &layer.regions
            && let Some(values) = region_values.of(regions)
        {
            found = self.region_cells.restrict(regions, values, found);
        }
        if planes.is_empty() {
            return Ok(Sight { activity: found, clipped: 0, of_all_regions });
        }
        let (activity, clipped) = self.cut_cells.update(&series.mesh, planes, keep_away, found);
        Ok(Sight { activity, clipped, of_all_regions })
    }
}

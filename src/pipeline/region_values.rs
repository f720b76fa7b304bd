//! Values of the cells by which a layer chooses regions, and around which it draws surfaces.

use super::series::Series;
use super::steps::StepCaches;
use super::{FrameTime, PipelineError, RequestError, TetLayer};
use crate::field::{Association, Blocks, FieldSelector, Regions};
use crate::stats::FrameStats;
use crate::task::Cancel;
use std::sync::Arc;

/// The values of each cell, by the names of their fields.
#[derive(Clone, Debug, Default)]
pub(super) struct RegionValues {
    by_field: Vec<(String, Arc<Vec<f32>>)>,
}

impl RegionValues {
    /// The values by which these regions are chosen.
    pub(super) fn of(&self, regions: &Regions) -> Option<&Arc<Vec<f32>>> {
        self.by_field.iter().find(|(field, _)| *field == regions.field).map(|(_, values)| values)
    }
}

/// Decoded steps of the fields by which regions are chosen, by name.
#[derive(Debug, Default)]
pub(super) struct RegionFields {
    steps: StepCaches,
}

impl RegionFields {
    /// The values for all regions of a layer, at the last step that was reached: mixtures of numbers of regions are none.
    ///
    /// # Errors
    /// If there is no such field of cells, or it cannot be read, or `Cancelled`.
    pub(super) fn values(
        &mut self,
        series: &Series,
        layer: &TetLayer,
        time: FrameTime,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<RegionValues, PipelineError> {
        let mut fields: Vec<&str> = layer.all_regions().map(|regions| regions.field.as_str()).collect();
        fields.sort_unstable();
        fields.dedup();
        self.steps.keep(|field| fields.contains(&field));
        let mut by_field = Vec::with_capacity(fields.len());
        for field in fields {
            by_field.push((field.to_owned(), self.of_field(series, field, time, cancel, stats)?));
        }
        Ok(RegionValues { by_field })
    }

    fn of_field(
        &mut self,
        series: &Series,
        field: &str,
        time: FrameTime,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<Arc<Vec<f32>>, PipelineError> {
        let Ok(selector) = field.parse::<FieldSelector>();
        let of = match series.beside(&selector) {
            Ok(of) => of,
            // The mesh has numbers of blocks, whatever fields were imported.
            Err(error) if field == Blocks::FIELD => return series.block_numbers().map_err(|_| error.into()),
            Err(error) => return Err(error.into()),
        };
        if of.values_of() == Association::Point {
            let problem = "has values of vertices; regions are chosen by a field of cells";
            return Err(RequestError::NoRegions(format!("'{field}' {problem}")).into());
        }
        let values = self.steps.of(field).show(&of, time.step().into(), None, cancel, stats)?;
        values.ok_or(PipelineError::Cancelled)
    }
}

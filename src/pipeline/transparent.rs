//! The scalar intervals where a request is transparent.

use super::{DrawnBy, TetLayer};
use crate::node_table::NodeTable;
use crate::optics::OpticsKind;
use crate::optics::table3d::Table3dResolution;
use crate::visibility::{Skip, TransparentIntervals};
use std::sync::Arc;

/// Cache of the last request's transparent intervals.
#[derive(Debug, Default)]
pub(super) struct TransparentCache {
    last: Option<TransparentOf>,
    nowhere: Arc<TransparentIntervals>,
}

/// Intervals and their inputs.
#[derive(Debug)]
struct TransparentOf {
    table: Arc<NodeTable>,
    /// Number of samples of a sampled table.
    samples: Option<usize>,
    isovalues: Vec<f64>,
    intervals: Arc<TransparentIntervals>,
}

impl TransparentCache {
    pub(super) fn of(&mut self, layer: &TetLayer, by: DrawnBy, skip: Skip) -> Arc<TransparentIntervals> {
        if !skip.transparent_cells || by.needs_all_cells() {
            // The reference skips nothing.
            return self.nowhere.clone();
        }
        // A sampled table is visible slightly beyond the transfer function's opaque intervals.
        let samples = match layer.optics {
            OpticsKind::Exact | OpticsKind::Partial => None,
            OpticsKind::Table3d => Some(Table3dResolution::default().scalars),
        };
        let table = layer.table.over_scalars();
        let isovalues: Vec<f64> = layer.surfaces.iter().map(|surface| surface.value).collect();
        let is_same = |last: &&TransparentOf| {
            Arc::ptr_eq(&last.table, table) && last.samples == samples && last.isovalues == isovalues
        };
        if let Some(last) = self.last.as_ref().filter(is_same) {
            return last.intervals.clone();
        }
        let of_table = match samples {
            None => TransparentIntervals::of(table),
            Some(samples) => TransparentIntervals::of_sampled(table, samples),
        };
        let intervals = Arc::new(of_table.cut_at(&isovalues));
        self.last = Some(TransparentOf { table: table.clone(), samples, isovalues, intervals: intervals.clone() });
        intervals
    }
}

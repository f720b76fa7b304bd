//! What transfer functions of more than the scalar look at beside it ([`GridTable`](crate::node_table::GridTable)).

use super::series::Series;
use crate::error::FileResult;
use crate::mesh::Mesh;
use crate::moments::CovDenominator;
use crate::node_table::GridTable;
use crate::render::GridScene;
use crate::task::Cancel;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// Cells whose gradients a task computes at a time.
const CELLS: usize = 1 << 14;

/// Quantities of a series that do not change over time, once they were asked for.
#[derive(Debug, Default)]
pub(super) struct Quantities {
    cov: OnceLock<Arc<Vec<f32>>>,
}

impl Series {
    /// The coefficient of variation of every vertex over all steps, with the usual denominator: those that the series' histograms
    /// count. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If the store has none and a step cannot be decoded.
    pub fn coefficients_of_variation(&self, cancel: &Cancel) -> FileResult<Option<Arc<Vec<f32>>>> {
        if let Some(cov) = self.quantities.cov.get() {
            return Ok(Some(cov.clone()));
        }
        let Some(cov) = self.vertex_importance(CovDenominator::default(), cancel)? else { return Ok(None) };
        Ok(Some(self.quantities.cov.get_or_init(|| Arc::new(cov)).clone()))
    }

    /// The transfer function of a frame with what it looks at: coefficients of variation as its rows, if it has any but one, and the
    /// magnitudes of the gradients of these scalars as its layers. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// As [`Self::coefficients_of_variation`].
    pub(super) fn grid_scene(
        &self,
        table: &Arc<GridTable>,
        scalars: &[f32],
        cancel: &Cancel,
    ) -> FileResult<Option<GridScene>> {
        let vertex_values = if table.rows().len() > 1 {
            let Some(cov) = self.coefficients_of_variation(cancel)? else { return Ok(None) };
            Some(cov)
        } else {
            None
        };
        let cell_values = (table.layers().len() > 1).then(|| Arc::new(gradient_magnitudes(&self.mesh, scalars)));
        Ok(Some(GridScene { table: table.clone(), vertex_values, cell_values }))
    }
}

fn gradient_magnitudes(mesh: &Mesh, scalars: &[f32]) -> Vec<f32> {
    let mut magnitudes = vec![0.0; mesh.topology.tets.len()];
    magnitudes.par_chunks_mut(CELLS).enumerate().for_each(|(chunk, out)| {
        let first = chunk * CELLS;
        out.iter_mut().zip(first..).for_each(|(out, cell)| *out = mesh.gradient_magnitude(cell, scalars));
    });
    magnitudes
}

//! The quantities beside the scalar that joint transfer functions read ([`JointTable`](crate::node_table::JointTable)).

use super::series::Series;
use crate::error::FileResult;
use crate::field::Scalars;
use crate::histograms::Histogram;
use crate::mesh::Mesh;
use crate::moments::CovDenominator;
use crate::node_table::JointTable;
use crate::render::JointScene;
use crate::task::Cancel;
use std::sync::{Arc, PoisonError};

/// Gradient magnitudes of the last scalars: a paused series has the same in each frame.
#[derive(Debug, Default)]
pub(super) struct Gradients {
    /// The scalars and their gradient magnitudes.
    last: Option<(Scalars, Arc<Vec<f32>>)>,
}

impl Gradients {
    /// One magnitude per cell, in scalars per world length; of scalars of cells that of their means at the vertices.
    fn of(&mut self, mesh: &Mesh, scalars: &Scalars) -> Arc<Vec<f32>> {
        if let Some((of, magnitudes)) = &self.last
            && of.is_same(scalars)
        {
            return magnitudes.clone();
        }
        let mut magnitudes = vec![0.0; mesh.topology.tets.len()];
        match scalars {
            Scalars::Vertices(scalars) => mesh.gradient_magnitudes(scalars, &mut magnitudes),
            Scalars::Cells(scalars) => mesh.gradient_magnitudes(&mesh.means_at_vertices(scalars), &mut magnitudes),
        };
        let magnitudes = Arc::new(magnitudes);
        self.last = Some((scalars.clone(), magnitudes.clone()));
        magnitudes
    }
}

impl Series {
    /// The coefficient of variation of every scalar over all steps, with the usual denominator, as in the series' histograms. `None` if
    /// `cancel` was raised.
    ///
    /// # Errors
    /// If the store has none and a step cannot be decoded.
    pub fn coefficients_of_variation(&self, cancel: &Cancel) -> FileResult<Option<Arc<Vec<f32>>>> {
        if let Some(cov) = self.quantities.cov.get() {
            return Ok(Some(cov.clone()));
        }
        let Some(cov) = self.variation(CovDenominator::default(), cancel)? else { return Ok(None) };
        Ok(Some(self.quantities.cov.get_or_init(|| Arc::new(cov)).clone()))
    }

    /// Histograms over all steps, one for each of [`Kind::ALL`](crate::histograms::Kind::ALL); `None` if there are none, or `cancel` was
    /// raised. A store without them is counted once, which takes as long as decoding every step.
    ///
    /// # Errors
    /// If a step has to be decoded and cannot be.
    pub fn histograms(&self, cancel: &Cancel) -> FileResult<Option<Arc<[Histogram]>>> {
        let mut known = self.quantities.histograms.lock().unwrap_or_else(PoisonError::into_inner);
        if known.is_none() {
            *known = self.source.histograms(&self.mesh, cancel)?.map(Into::into);
        }
        Ok(known.clone())
    }

    /// The transfer function of a frame with its quantities: coefficients of variation for its rows, if it has more than one, and gradient
    /// magnitudes of these scalars for its layers. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// As [`Self::coefficients_of_variation`].
    pub(super) fn joint_scene(
        &self,
        table: &Arc<JointTable>,
        scalars: &Scalars,
        gradients: &mut Gradients,
        cancel: &Cancel,
    ) -> FileResult<Option<JointScene>> {
        let row_values = if table.vertex_axis().len() > 1 {
            let Some(cov) = self.coefficients_of_variation(cancel)? else { return Ok(None) };
            Some(self.scalars(cov))
        } else {
            None
        };
        let cell_values = (table.cell_axis().len() > 1).then(|| gradients.of(&self.mesh, scalars));
        Ok(Some(JointScene { table: table.clone(), row_values, cell_values }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::test_series;

    #[test]
    fn what_does_not_change_over_time_is_computed_once_whoever_asks() {
        let series = test_series::jet();
        let (apart, cancel) = (series.apart(1 << 20), Cancel::new());
        let cov = [&apart, &series].map(|series| series.coefficients_of_variation(&cancel).unwrap().unwrap());
        assert!(Arc::ptr_eq(&cov[0], &cov[1]));
        let histograms = [&apart, &series].map(|series| series.histograms(&cancel).unwrap().unwrap());
        assert!(Arc::ptr_eq(&histograms[0], &histograms[1]));
        // Read from the store: no step was decoded for either.
        assert_eq!((series.blocks().statistics().loads, apart.blocks().statistics().loads), (0, 0));
        let other = test_series::jet().histograms(&cancel).unwrap().unwrap();
        assert!(!Arc::ptr_eq(&histograms[0], &other) && histograms[0] == other);
    }

    #[test]
    fn gradients_are_computed_once_for_the_same_scalars() {
        let mesh = test_series::mesh();
        let scalars = |slope: f32| -> Scalars {
            Arc::new(mesh.positions.local.iter().map(|p| slope * p.x).collect::<Vec<f32>>()).into()
        };
        let (one, two) = (scalars(1.0), scalars(2.0));
        let mut gradients = Gradients::default();
        let first = gradients.of(&mesh, &one);
        assert!(Arc::ptr_eq(&first, &gradients.of(&mesh, &one)));
        let second = gradients.of(&mesh, &two);
        // A factor of two is exact in every operation.
        assert!(first.iter().zip(&*second).all(|(a, b)| 2.0 * a == *b) && first[0] > 0.0);
        let copied = Arc::new(one.values().to_vec()).into();
        assert!(*gradients.of(&mesh, &copied) == *first, "others with the same values");
    }
}

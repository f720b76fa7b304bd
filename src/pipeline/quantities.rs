//! The quantities beside the scalar that joint transfer functions read ([`JointTable`](crate::node_table::JointTable)).

use super::series::Series;
use crate::error::FileResult;
use crate::field::Scalars;
use crate::histograms::{Counted, Histogram, Kind, SeriesView, divides_evenly};
use crate::mesh::Mesh;
use crate::moments::CovDenominator;
use crate::node_table::JointTable;
use crate::render::JointScene;
use crate::task::Cancel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

/// How often a caller looks whether another one has counted histograms.
const WAIT: Duration = Duration::from_millis(5);

/// Locks what is valid at all times.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

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

    /// Histograms over all steps, one for each of [`Kind::ALL`]; `None` if there are none, or `cancel` was raised. A store without them is
    /// counted once, which takes as long as decoding every step.
    ///
    /// # Errors
    /// If a step has to be decoded and cannot be.
    pub fn histograms(&self, cancel: &Cancel) -> FileResult<Option<Arc<[Histogram]>>> {
        let counted = self.count_histograms(cancel, &mut |_| true)?;
        Ok(counted.map(|counted| counted.histograms.clone()))
    }

    /// As [`Self::histograms`], step by step from coarse to fine ([`spread`](crate::histograms::spread)): the first three steps are both ends
    /// of the series and its middle. `told` is called after each step with what is counted so far, and returns whether to go on; otherwise
    /// the result is `None`. Whoever asks next goes on from there. While another caller counts, `told` gets what that one has, or has had.
    ///
    /// # Errors
    /// If a step has to be decoded and cannot be. What is counted until then stays ([`Self::counted_histograms`]).
    pub fn count_histograms(
        &self,
        cancel: &Cancel,
        told: &mut dyn FnMut(&Counted) -> bool,
    ) -> FileResult<Option<Arc<Counted>>> {
        let Some(mut counting) = self.turn_to_count(cancel, told) else { return Ok(None) };
        // Copies share the histograms: what is counted next has them to itself at the first step.
        let publish = |counted: &Counted| *lock(&self.quantities.counted) = Some(Arc::new(counted.clone()));
        let ended = self.source.go_on_counting(&mut counting, &self.mesh, cancel, &mut |counted| {
            let goes_on = told(counted);
            if divides_evenly(counted.steps) {
                publish(counted);
            }
            goes_on
        });
        counting.iter().for_each(publish);
        Ok(if ended? { self.counted_histograms() } else { None })
    }

    /// Histograms of the steps counted so far, without counting any; `None` if nobody has asked for them. Cheap.
    pub fn counted_histograms(&self) -> Option<Arc<Counted>> {
        lock(&self.quantities.counted).clone()
    }

    /// Waits until nobody else counts histograms. `None` if `cancel` was raised or `told` said so.
    fn turn_to_count(
        &self,
        cancel: &Cancel,
        told: &mut dyn FnMut(&Counted) -> bool,
    ) -> Option<MutexGuard<'_, Option<Counted>>> {
        let mut seen = 0;
        loop {
            match self.quantities.counting.try_lock() {
                Ok(counting) => return Some(counting),
                Err(TryLockError::Poisoned(poisoned)) => {
                    // A step may be counted in part.
                    let mut counting = poisoned.into_inner();
                    *counting = None;
                    self.quantities.counting.clear_poison();
                    return Some(counting);
                }
                Err(TryLockError::WouldBlock) => {}
            }
            if cancel.is_cancelled() {
                return None;
            }
            if let Some(counted) = self.counted_histograms().filter(|counted| counted.steps != seen) {
                seen = counted.steps;
                if !told(&counted) {
                    return None;
                }
            }
            std::thread::sleep(WAIT);
        }
    }

    /// The histogram of a step, one of [`Kind::ALL`], over the axes of the series as far as these are known
    /// ([`Self::counted_histograms`]); octaves are widened to cover the step. `None` if `cancel` was raised before the step was decoded.
    ///
    /// # Errors
    /// If the step cannot be decoded, or another one on the way to coefficients of variation that the store does not have.
    pub fn histogram_of_step(&self, kind: &Kind<'_>, step: usize, cancel: &Cancel) -> FileResult<Option<Histogram>> {
        let cov = if kind.needs_cov() { self.coefficients_of_variation(cancel)? } else { Some(Arc::default()) };
        let Some(cov) = cov else { return Ok(None) };
        let mut scalars = vec![0.0; self.scalar_count()];
        if !self.decode_step(step, &mut scalars, cancel)? {
            return Ok(None);
        }
        let (values_of, scalar_range) = (self.values_of(), self.field.range);
        let series = SeriesView { mesh: &self.mesh, values_of, scalar_range, cov: &cov };
        let counted = self.counted_histograms();
        let known = counted.as_ref().and_then(|counted| counted.of_kind(kind)).map(Histogram::ranges);
        let ranges = known.unwrap_or_else(|| series.known_ranges(kind));
        Ok(Some(series.with_step(&scalars, |view| kind.of_step_widened(ranges, view))))
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

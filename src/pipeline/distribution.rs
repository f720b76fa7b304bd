//! The share of a series' volume that each scalar occupies, from some of its steps.

use super::series::Series;
use crate::error::FileResult;
use crate::field::Association;
use crate::moments::Distribution;
use crate::task::Cancel;
use crate::transfer::{FirstLook, Lengths, RangePolicy};
use std::sync::{Arc, PoisonError};

/// Steps sampled, evenly over the series, the first and the last among them.
const STEPS: usize = 5;

/// Scalars sampled per step: with this many, a share of 1 % has a relative error of a twentieth.
const SCALARS: usize = 1 << 16;

impl Series {
    /// The share of the volume per scalar, over at most five steps of the series and 65,536 scalars of each; the same ones in every call.
    /// A vertex has a quarter of each of its cells. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If none of these steps can be decoded.
    pub fn distribution(&self, cancel: &Cancel) -> FileResult<Option<Arc<Distribution>>> {
        let mut known = self.quantities.distribution.lock().unwrap_or_else(PoisonError::into_inner);
        if known.is_none() {
            *known = sampled([self], |[value]| value, cancel)?.map(Arc::new);
        }
        Ok(known.clone())
    }

    /// The default look of a series, optionally with a given range. Mean chords are those of the box of the mesh, 4 V / S of a convex body
    /// (Cauchy), of which the mesh fills a part. Unreadable steps are reported when they are shown.
    pub fn first_look(&self, range: Option<RangePolicy>, cancel: &Cancel) -> FirstLook {
        let values = self.distribution(cancel).ok().flatten().unwrap_or_default();
        let ends = self.field.range.map_or((f64::NAN, f64::NAN), |[lo, hi]| (f64::from(lo), f64::from(hi)));
        let (lo, hi) = self.mesh.frame();
        // In local units, so that no product overflows.
        let side = (hi - lo) / self.mesh.positions.scale;
        let surface = 2.0 * (side.x * side.y + side.y * side.z + side.z * side.x);
        // No longer than the diagonal, whatever is far away.
        let chord = (4.0 * self.mesh.total_volume() / surface).min(side.length())
            / Lengths::of_diagonal(side.length()).unit_distance;
        FirstLook::new(ends, &values, chord, range)
    }

    /// A range policy with scalars in place of percentiles ([`RangePolicy::settled`]); any other one as it is.
    ///
    /// # Errors
    /// As [`Self::distribution`].
    pub fn settled(&self, policy: &RangePolicy) -> FileResult<RangePolicy> {
        if !policy.has_percentiles() {
            return Ok(*policy);
        }
        let values = self.distribution(&Cancel::new())?;
        Ok(policy.settled(&values.unwrap_or_default()))
    }
}

/// The share of the volume per length of the vectors with these components, as [`Series::distribution`].
///
/// # Errors
/// As [`Series::distribution`].
pub(super) fn speeds(components: &[Arc<Series>; 3], cancel: &Cancel) -> FileResult<Option<Distribution>> {
    let length = |vector: [f32; 3]| vector.map(|c| f64::from(c).powi(2)).iter().sum::<f64>().sqrt() as f32;
    sampled(components.each_ref().map(|of| &**of), length, cancel)
}

/// The share of the volume per scalar that is made of the values of some fields of one mesh; `None` if `cancel` was raised.
fn sampled<const N: usize>(
    fields: [&Series; N],
    scalar: impl Fn([f32; N]) -> f32,
    cancel: &Cancel,
) -> FileResult<Option<Distribution>> {
    let volumes = volumes(fields[0]);
    let chosen: Vec<usize> = evenly(volumes.len(), SCALARS).collect();
    let (mut values, mut samples) = ([(); N].map(|()| vec![0.0; volumes.len()]), Vec::new());
    let mut problem = None;
    for step in evenly(fields[0].times.len(), STEPS) {
        let mut each = fields.iter().zip(&mut values);
        match each.try_fold(true, |all, (field, values)| Ok(all && field.decode_step(step, values, cancel)?)) {
            Ok(true) => {
                let sample = |&at: &usize| (scalar(values.each_ref().map(|values| values[at])), volumes[at]);
                samples.extend(chosen.iter().map(sample));
            }
            Ok(false) => return Ok(None),
            Err(error) => problem = Some(error),
        }
    }
    // Whoever shows an unreadable step gets its error.
    match problem.filter(|_| samples.is_empty()) {
        Some(error) => Err(error),
        None => Ok(Some(Distribution::new(samples))),
    }
}

/// At most `most` of the numbers below `count`, with both ends.
fn evenly(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let chosen = count.min(most);
    (0..chosen).map(move |i| if chosen < 2 { 0 } else { i * (count - 1) / (chosen - 1) })
}

/// Volume per scalar in local units: that of a cell, or a quarter of each of a vertex's cells.
fn volumes(series: &Series) -> Vec<f64> {
    let mesh = &series.mesh;
    if series.values_of() == Association::Cell {
        return (0..mesh.topology.tets.len() as u32).map(|cell| mesh.cell_volume(cell)).collect();
    }
    let mut volumes = vec![0.0; mesh.positions.local.len()];
    for (cell, tet) in mesh.topology.tets.iter().enumerate() {
        let volume = 0.25 * mesh.cell_volume(cell as u32);
        tet.iter().for_each(|&vertex| volumes[vertex as usize] += volume);
    }
    volumes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::test_series::{jet, logged};

    #[test]
    fn it_is_that_of_all_values_of_a_short_series_of_few_vertices() {
        let series = jet();
        let volumes = volumes(&series);
        let total: f64 = volumes.iter().sum();
        assert!((total / series.mesh().total_volume() - 1.0).abs() < 1e-12);
        let mut samples = Vec::new();
        for step in 0..series.times().len() {
            let mut values = vec![0.0; volumes.len()];
            assert!(series.decode_step(step, &mut values, &Cancel::new()).unwrap());
            samples.extend(values.into_iter().zip(volumes.iter().copied()));
        }
        assert_eq!(*series.distribution(&Cancel::new()).unwrap().unwrap(), Distribution::new(samples));
    }

    #[test]
    fn of_a_long_series_a_few_steps_are_decoded_once() {
        let (series, log) = logged(1000);
        let first = series.distribution(&Cancel::new()).unwrap().unwrap();
        assert_eq!(log.decoded(), [0, 249, 499, 749, 999]);
        let again = series.apart(0).distribution(&Cancel::new()).unwrap().unwrap();
        assert!(Arc::ptr_eq(&first, &again));
        assert_eq!(log.decoded().len(), 5);
    }

    #[test]
    fn what_cannot_be_read_is_an_error_and_cancelling_ends_it() {
        let (series, log) = logged(9);
        let cancelled = Cancel::new();
        cancelled.cancel();
        assert!(series.distribution(&cancelled).unwrap().is_none());
        log.fail_at(4);
        assert!(!series.distribution(&Cancel::new()).unwrap().unwrap().is_empty(), "there are other steps");
        let (series, log) = logged(1);
        log.fail_at(0);
        assert!(series.distribution(&Cancel::new()).unwrap_err().to_string().contains("damaged"));
    }

    #[test]
    fn numbers_are_spread_with_both_ends() {
        assert_eq!(evenly(9, 5).collect::<Vec<_>>(), [0, 2, 4, 6, 8]);
        assert_eq!(evenly(3, 5).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!([evenly(1, 5).count(), evenly(0, 5).count()], [1, 0]);
    }
}

//! The histograms of a whole series.
//!
//! The range of bins is known when all steps have been seen. For the scalar it is given, and octaves are widened while counting without
//! losing counts; for kinds with another linear axis steps are read twice, for ranges and to count.

use super::{Axis, Histogram, Kind, Ranges, StepView};
use crate::field::Association;
use crate::mesh::Mesh;
use crate::moments::{AxisScale, StepSummary};

/// The histograms of `kinds` over `steps` steps. `read` loads the scalars of a step, or returns `false` if cancelled: then there is no
/// result. `cov` has the coefficients of variation of the scalars; `values_of` and `scalar_range` say
/// what has these, and their range.
///
/// # Errors
/// The error of `read`.
///
/// # Panics
/// If there is not one coefficient of variation per vertex or cell.
pub fn of_series<E>(
    kinds: &[Kind<'_>],
    mesh: &Mesh,
    cov: &[f32],
    (values_of, scalar_range): (Association, Option<[f32; 2]>),
    steps: usize,
    mut read: impl FnMut(usize, &mut [f32]) -> Result<bool, E>,
) -> Result<Option<Vec<Histogram>>, E> {
    let mut scalars = vec![0.0; cov.len()];
    let mut first_steps = |steps: usize, visit: &mut dyn FnMut(usize, &StepView<'_>)| {
        for step in 0..steps {
            if !read(step, &mut scalars)? {
                return Ok(false);
            }
            let means = match values_of {
                Association::Point => None,
                Association::Cell => Some(mesh.means_at_vertices(&scalars)),
            };
            let at_vertices = means.as_deref().unwrap_or(&scalars);
            visit(step, &StepView { mesh, values_of, scalars: &scalars, at_vertices, cov });
        }
        Ok(true)
    };
    let start = |axis: &dyn Axis| if axis.is_scalar() { scalar_range } else { None };
    let mut all: Vec<Ranges> = kinds.iter().map(|kind| [start(kind.x), kind.y.and_then(start)]).collect();
    let is_open = |axis: &dyn Axis| !axis.is_scalar() && axis.scale() == AxisScale::Linear;
    let open = || kinds.iter().flat_map(|kind| kind.axes()).filter(|axis| is_open(*axis));
    if open().next().is_some() {
        let needed = if open().any(|axis| axis.changes()) { steps } else { steps.min(1) };
        let whole = first_steps(needed, &mut |step, view| {
            for (ranges, kind) in all.iter_mut().zip(kinds) {
                for (range, axis) in ranges.iter_mut().zip(kind.axes()).filter(|(_, axis)| is_open(*axis)) {
                    if step == 0 || axis.changes() {
                        *range = wider(*range, kind.range(axis, view));
                    }
                }
            }
        })?;
        if !whole {
            return Ok(None);
        }
    }
    let mut histograms: Vec<Histogram> = kinds.iter().zip(all).map(|(kind, ranges)| kind.empty(ranges)).collect();
    let whole = first_steps(steps, &mut |step, view| {
        for (histogram, kind) in histograms.iter_mut().zip(kinds) {
            if step == 0 || kind.changes() {
                kind.add_and_widen(histogram, view);
            }
        }
    })?;
    Ok(whole.then_some(histograms))
}

/// The union of both ranges.
fn wider(a: Option<[f32; 2]>, b: Option<[f32; 2]>) -> Option<[f32; 2]> {
    let of = |range| StepSummary { range, nonfinite: 0 };
    of(a).merge(of(b)).range
}

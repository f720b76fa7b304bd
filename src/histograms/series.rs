//! The histograms of a whole series.
//!
//! What bins cover is known when all steps have been seen. The range of the scalar is, and octaves are widened while counting
//! without a count being lost; for kinds of another linear axis steps are read twice, for ranges and to count.

use super::{Axis, Histogram, Kind, Ranges, StepView};
use crate::mesh::Mesh;
use crate::moments::{AxisScale, StepSummary};

/// The histograms of `kinds` over `steps` steps. `read` brings the scalars of a step, or says that somebody asked to stop
/// (`false`): then there is none. `scalar_range` is that of the series, `cov` are the coefficients of variation of the vertices.
///
/// # Errors
/// If `read` fails: its error.
///
/// # Panics
/// If there is not one coefficient of variation a vertex.
pub fn of_series<E>(
    kinds: &[Kind<'_>],
    mesh: &Mesh,
    cov: &[f32],
    scalar_range: Option<[f32; 2]>,
    steps: usize,
    mut read: impl FnMut(usize, &mut [f32]) -> Result<bool, E>,
) -> Result<Option<Vec<Histogram>>, E> {
    let mut scalars = vec![0.0; mesh.vertex_source.len()];
    let mut first_steps = |steps: usize, visit: &mut dyn FnMut(usize, &StepView<'_>)| {
        for step in 0..steps {
            if !read(step, &mut scalars)? {
                return Ok(false);
            }
            visit(step, &StepView { mesh, scalars: &scalars, cov });
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

/// The range of both.
fn wider(a: Option<[f32; 2]>, b: Option<[f32; 2]>) -> Option<[f32; 2]> {
    let of = |range| StepSummary { range, nonfinite: 0 };
    of(a).merge(of(b)).range
}

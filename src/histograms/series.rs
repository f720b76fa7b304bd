//! The histograms of a whole series, and of some of its steps.
//!
//! The range of bins is known when all steps have been seen. For the scalar it is given, and octaves are widened while counting without
//! losing counts; for kinds with another linear axis steps are read twice, for ranges and to count.
//!
//! Counts are sums, and octaves end where those of the greatest value do: histograms do not depend on the order of the steps. So a sample of
//! steps that is shown early is the beginning of the whole ([`Counted`]). Its scalars have the bins of the whole, and so do its
//! coefficients of variation; gradient magnitudes begin with the octaves of its own steps, and move by whole bins where a steeper one comes.

use super::{Axis, Histogram, Kind, Ranges, StepView};
use crate::field::Association;
use crate::mesh::Mesh;
use crate::moments::{AxisScale, StepSummary};
use std::sync::Arc;

/// What a series has beside the scalars of its steps.
#[derive(Clone, Copy, Debug)]
pub struct SeriesView<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// What has the scalars.
    pub values_of: Association,
    /// Least and greatest finite scalar of all steps.
    pub scalar_range: Option<[f32; 2]>,
    /// The coefficient of variation of each scalar; empty where no axis needs it.
    pub cov: &'a [f32],
}

impl SeriesView<'_> {
    /// Number of scalars of a step.
    fn scalar_count(&self) -> usize {
        match self.values_of {
            Association::Point => self.mesh.vertex_source.len(),
            Association::Cell => self.mesh.topology.tets.len(),
        }
    }

    /// Passes a step to `visit`.
    pub fn with_step<T>(&self, scalars: &[f32], visit: impl FnOnce(&StepView<'_>) -> T) -> T {
        let means = match self.values_of {
            Association::Point => None,
            Association::Cell => Some(self.mesh.means_at_vertices(scalars)),
        };
        let at_vertices = means.as_deref().unwrap_or(scalars);
        visit(&StepView { mesh: self.mesh, values_of: self.values_of, scalars, at_vertices, cov: self.cov })
    }

    /// The ranges of a kind that are known beforehand.
    pub fn known_ranges(&self, kind: &Kind<'_>) -> Ranges {
        let known = |axis: &dyn Axis| if axis.is_scalar() { self.scalar_range } else { None };
        [known(kind.x), kind.y.and_then(known)]
    }
}

/// Histograms of some steps of a series, to which others may be added.
#[derive(Clone, Debug, PartialEq)]
pub struct Counted {
    /// One for each kind.
    pub histograms: Arc<[Histogram]>,
    /// Number of steps counted.
    pub steps: usize,
    /// Number of steps of the series.
    pub of: usize,
    /// Why the store does not keep the histograms of the whole series.
    pub not_kept: Option<String>,
}

impl Counted {
    /// The histograms of all steps.
    pub fn whole(histograms: Vec<Histogram>, steps: usize) -> Self {
        Self { histograms: histograms.into(), steps, of: steps, not_kept: None }
    }

    /// No step of a series of `of` steps. Linear axes must have their range, as those of [`Kind::ALL`] have.
    pub fn none(kinds: &[Kind<'_>], ranges: &[Ranges], of: usize) -> Self {
        let histograms = kinds.iter().zip(ranges).map(|(kind, &ranges)| kind.empty(ranges)).collect();
        Self { histograms, steps: 0, of, not_kept: None }
    }

    /// Whether all steps are counted.
    pub fn is_whole(&self) -> bool {
        self.steps == self.of
    }

    /// The histogram of a kind, if these are those of [`Kind::ALL`].
    pub fn of_kind(&self, kind: &Kind<'_>) -> Option<&Histogram> {
        let name = kind.name();
        let index = Kind::ALL.iter().position(|other| other.name() == name)?;
        self.histograms.get(index)
    }

    /// Counts the steps `order[self.steps..]`. `read` loads the scalars of a step, or returns `false` if cancelled; `told` is called after
    /// each step, and returns whether to go on. Returns whether all are counted; otherwise, also after an error, another call goes on.
    ///
    /// # Errors
    /// The error of `read`.
    ///
    /// # Panics
    /// If `kinds` are others than those of the steps before, or needed coefficients of variation are missing.
    pub fn go_on<E>(
        &mut self,
        kinds: &[Kind<'_>],
        series: &SeriesView<'_>,
        order: &[usize],
        mut read: impl FnMut(usize, &mut [f32]) -> Result<bool, E>,
        mut told: impl FnMut(&Self) -> bool,
    ) -> Result<bool, E> {
        let mut scalars = vec![0.0; series.scalar_count()];
        while let Some(&step) = order.get(self.steps) {
            if !read(step, &mut scalars)? {
                return Ok(false);
            }
            series.with_step(&scalars, |view| self.add(kinds, view));
            if !told(self) && !self.is_whole() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Counts a step. What does not change is counted with the first one.
    pub(super) fn add(&mut self, kinds: &[Kind<'_>], view: &StepView<'_>) {
        for (histogram, kind) in Arc::make_mut(&mut self.histograms).iter_mut().zip(kinds) {
            if self.steps == 0 || kind.changes() {
                kind.add_and_widen(histogram, view);
            }
        }
        self.steps += 1;
    }
}

/// The histograms of `kinds` over `steps` steps. `read` loads the scalars of a step, or returns `false` if cancelled: then there is no
/// result.
///
/// # Errors
/// The error of `read`.
///
/// # Panics
/// If there is not one coefficient of variation per vertex or cell, and one is needed.
pub fn of_series<E>(
    kinds: &[Kind<'_>],
    series: &SeriesView<'_>,
    steps: usize,
    mut read: impl FnMut(usize, &mut [f32]) -> Result<bool, E>,
) -> Result<Option<Vec<Histogram>>, E> {
    let mut all: Vec<Ranges> = kinds.iter().map(|kind| series.known_ranges(kind)).collect();
    let is_open = |axis: &dyn Axis| !axis.is_scalar() && axis.scale() == AxisScale::Linear;
    let open = || kinds.iter().flat_map(|kind| kind.axes()).filter(|axis| is_open(*axis));
    let needed = match (open().next(), open().any(|axis| axis.changes())) {
        (None, _) => 0,
        (Some(_), false) => steps.min(1),
        (Some(_), true) => steps,
    };
    let mut scalars = vec![0.0; series.scalar_count()];
    for step in 0..needed {
        if !read(step, &mut scalars)? {
            return Ok(None);
        }
        series.with_step(&scalars, |view| {
            for (ranges, kind) in all.iter_mut().zip(kinds) {
                for (range, axis) in ranges.iter_mut().zip(kind.axes()).filter(|(_, axis)| is_open(*axis)) {
                    if step == 0 || axis.changes() {
                        *range = wider(*range, kind.range(axis, view));
                    }
                }
            }
        });
    }
    let order: Vec<usize> = (0..steps).collect();
    let mut counted = Counted::none(kinds, &all, steps);
    Ok(counted.go_on(kinds, series, &order, read, |_| true)?.then(|| counted.histograms.to_vec()))
}

/// The union of both ranges.
fn wider(a: Option<[f32; 2]>, b: Option<[f32; 2]>) -> Option<[f32; 2]> {
    let of = |range| StepSummary { range, nonfinite: 0 };
    of(a).merge(of(b)).range
}

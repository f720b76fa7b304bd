//! Histograms of a series, over which transfer functions are edited (dissertation 7.1).
//!
//! | kind | a sample is | axes |
//! |---|---|---|
//! | `scalar` | a vertex at a step | its scalar |
//! | `scalar_gradient` | a cell at a step | the mean of its four scalars; magnitude of its gradient |
//! | `cov` | a vertex | its coefficient of variation over time |
//! | `scalar_cov` | a vertex at a step | its scalar; its coefficient of variation over time |
//!
//! A field of cells has cells in place of vertices; its gradients are those of its means at the vertices.
//!
//! 256 bins along x, 64 along y. The scalar's bins are of equal width over the range of the series. Gradient magnitudes and coefficients of
//! variation are often 0 and span decades: in Utah's torso 99 % of all gradients are in the first of 64 equal bins, 68 % in that of 64 of
//! equal roots, 9 % in the fullest of four bins an octave, which they therefore use ([`AxisScale::Octaves`]); their last edge is the same
//! for a quarter and a sixteenth of an octave. Counts are exact: those of a direct count over the range of all steps, for any number of
//! threads.
//!
//! To add a kind, implement [`Axis`] and use it in a [`Kind`]; no other code changes.

mod axes;
mod order;
mod series;
#[cfg(test)]
mod tests;

pub use axes::{Axis, CoefficientOfVariation, GradientMagnitude, Place, Scalar};
pub use order::{divides_evenly, spread};
pub use series::{Counted, SeriesView, of_series};

use crate::field::Association;
use crate::mesh::Mesh;
use crate::moments::{AxisScale, Bins, Histogram1d, Histogram2d, StepSummary};
use rayon::prelude::*;

/// Samples that a task takes at a time: values of both axes fit into a core's cache.
const CHUNK: usize = 4096;

/// Fewest samples of a task, which has its own histogram.
const LEAST_SAMPLES: usize = 1 << 16;

/// Data of one step.
#[derive(Clone, Copy, Debug)]
pub struct StepView<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// What has the scalars.
    pub values_of: Association,
    /// The scalar of each vertex or cell at the step.
    pub scalars: &'a [f32],
    /// The scalars at the vertices: those of cells are averaged.
    pub at_vertices: &'a [f32],
    /// The coefficient of variation of each scalar over all steps, with the usual denominator; empty where no axis needs it.
    pub cov: &'a [f32],
}

impl StepView<'_> {
    fn count(&self, place: Place) -> usize {
        match place {
            Place::Scalars => self.scalars.len(),
            Place::Cells => self.mesh.topology.tets.len(),
        }
    }
}

/// What a histogram counts: values along one axis, or pairs of two.
#[derive(Clone, Copy)]
pub struct Kind<'a> {
    /// The horizontal axis.
    pub x: &'a dyn Axis,
    /// The vertical axis, for pairs.
    pub y: Option<&'a dyn Axis>,
}

/// The ranges of values along the axes of a kind.
pub type Ranges = [Option<[f32; 2]>; 2];

impl Kind<'static> {
    /// Counts of scalars.
    pub const SCALAR: Self = Self { x: &Scalar, y: None };
    /// Counts of scalars and gradient magnitudes.
    pub const SCALAR_GRADIENT: Self = Self { x: &Scalar, y: Some(&GradientMagnitude) };
    /// Counts of coefficients of variation over time.
    pub const COV: Self = Self { x: &CoefficientOfVariation, y: None };
    /// Counts of scalars and coefficients of variation over time.
    pub const SCALAR_COV: Self = Self { x: &Scalar, y: Some(&CoefficientOfVariation) };

    /// The kinds that a store keeps.
    pub const ALL: [Self; 4] = [Self::SCALAR, Self::SCALAR_GRADIENT, Self::COV, Self::SCALAR_COV];
}

impl<'a> Kind<'a> {
    /// Bins of pairs along y; along x there are [`Histogram1d::BINS`].
    pub const ROWS: usize = 64;

    /// The names of the axes, joined by `_`.
    pub fn name(&self) -> String {
        self.axes().map(|axis| axis.name()).collect::<Vec<_>>().join("_")
    }

    /// The axes: one or two.
    pub fn axes(&self) -> impl Iterator<Item = &'a dyn Axis> {
        std::iter::once(self.x).chain(self.y)
    }

    /// What has the samples: cells if an axis has its values there. Values of vertices are then averaged over each cell.
    pub fn place(&self) -> Place {
        if self.axes().any(|axis| axis.place() == Place::Cells) { Place::Cells } else { Place::Scalars }
    }

    /// Whether samples differ from step to step. Otherwise a series counts them once.
    pub fn changes(&self) -> bool {
        self.axes().any(|axis| axis.changes())
    }

    /// Whether coefficients of variation are needed.
    pub fn needs_cov(&self) -> bool {
        self.axes().any(|axis| axis.needs_cov())
    }

    /// An empty histogram over ranges of this kind's axes.
    ///
    /// # Panics
    /// If a range is invalid ([`Bins::new`]).
    pub fn empty(&self, [x, y]: Ranges) -> Histogram {
        let x = Bins::new(x, self.x.scale(), Histogram1d::BINS);
        match self.y {
            None => Histogram::One(Histogram1d::over(x)),
            Some(axis) => Histogram::Two(Histogram2d::over(x, Bins::new(y, axis.scale(), Self::ROWS))),
        }
    }

    /// The least and greatest finite value of a step along each axis; octaves begin at 0.
    ///
    /// # Panics
    /// As [`Self::add`].
    pub fn ranges(&self, step: &StepView<'_>) -> Ranges {
        [self.range(self.x, step), self.y.and_then(|y| self.range(y, step))]
    }

    /// [`Self::ranges`] of one of the axes.
    fn range(&self, axis: &dyn Axis, step: &StepView<'_>) -> Option<[f32; 2]> {
        let of_chunk = |chunk: usize| {
            let mut values = [0.0; CHUNK];
            StepSummary::of(self.values(axis, step, chunk * CHUNK, &mut values))
        };
        let chunks = step.count(self.place()).div_ceil(CHUNK);
        let all = (0..chunks).into_par_iter().map(of_chunk).reduce(|| StepSummary::EMPTY, StepSummary::merge);
        Bins::new(all.range, axis.scale(), Self::ROWS).range()
    }

    /// Counts the samples of a step. Values beyond the ranges of the histogram are in the bins at their ends. The result is the same for
    /// any number of threads.
    ///
    /// # Panics
    /// If `histogram` is of another kind, or the step does not have one scalar per vertex or cell, and one coefficient of variation if these
    /// are needed.
    pub fn add(&self, histogram: &mut Histogram, step: &StepView<'_>) {
        let parts = self.parts(histogram, step, false);
        parts.iter().for_each(|part| histogram.merge(part));
    }

    /// As [`Self::add`], but axes of octaves are widened to cover all samples first.
    fn add_and_widen(&self, histogram: &mut Histogram, step: &StepView<'_>) {
        for mut part in self.parts(histogram, step, true) {
            histogram.widen(part.ranges());
            part.widen(histogram.ranges());
            histogram.merge(&part);
        }
    }

    /// The samples of a step in one histogram per task; their sum is the same for any number of tasks.
    fn parts(&self, histogram: &Histogram, step: &StepView<'_>, widens: bool) -> Vec<Histogram> {
        let count = match step.values_of {
            Association::Point => step.mesh.vertex_source.len(),
            Association::Cell => step.mesh.topology.tets.len(),
        };
        let cov = if self.needs_cov() { step.cov.len() } else { count };
        assert_eq!([step.scalars.len(), cov], [count; 2], "one value a vertex or cell");
        let count = step.count(self.place());
        let parts = (count / LEAST_SAMPLES).clamp(1, rayon::current_num_threads());
        let chunks = count.div_ceil(CHUNK);
        let part = |i: usize| {
            let mut part = histogram.emptied();
            let chunks = i * chunks / parts..(i + 1) * chunks / parts;
            chunks.for_each(|chunk| self.add_chunk(&mut part, step, chunk * CHUNK, widens));
            part
        };
        (0..parts).into_par_iter().map(part).collect()
    }

    /// As [`Self::add`], into a new histogram.
    ///
    /// # Panics
    /// As [`Self::add`].
    pub fn of_step(&self, ranges: Ranges, step: &StepView<'_>) -> Histogram {
        let mut histogram = self.empty(ranges);
        self.add(&mut histogram, step);
        histogram
    }

    /// As [`Self::of_step`], but axes of octaves are widened to cover all samples.
    ///
    /// # Panics
    /// As [`Self::add`].
    pub fn of_step_widened(&self, ranges: Ranges, step: &StepView<'_>) -> Histogram {
        let mut histogram = self.empty(ranges);
        self.add_and_widen(&mut histogram, step);
        histogram
    }

    fn add_chunk(&self, histogram: &mut Histogram, step: &StepView<'_>, first: usize, widens: bool) {
        let mut buffers = [[0.0; CHUNK]; 2];
        let [xs, ys] = &mut buffers;
        let xs = self.values(self.x, step, first, xs);
        let ys = self.y.map(|y| self.values(y, step, first, ys));
        if widens {
            let top = |axis: &dyn Axis, values: &[f32]| match axis.scale() {
                AxisScale::Octaves => StepSummary::of(values).range,
                AxisScale::Linear => None,
            };
            histogram.widen([top(self.x, xs), self.y.zip(ys).and_then(|(y, ys)| top(y, ys))]);
        }
        match (histogram, ys) {
            (Histogram::One(histogram), None) => histogram.add(xs),
            (Histogram::Two(histogram), Some(ys)) => histogram.add(xs, ys),
            _ => panic!("a histogram of another kind than {}", self.name()),
        }
    }

    /// The values along an axis from sample `first` on, as many as exist and fit.
    fn values<'b>(&self, axis: &dyn Axis, step: &StepView<'_>, first: usize, out: &'b mut [f32]) -> &'b [f32] {
        let place = self.place();
        let count = step.count(place).saturating_sub(first).min(out.len());
        let out = &mut out[..count];
        match (place, axis.place()) {
            (Place::Cells, Place::Scalars) if step.values_of == Association::Point => axis.fill_means(step, first, out),
            _ => axis.fill(step, first, out),
        }
        out
    }
}

/// The histogram of a [`Kind`].
#[derive(Clone, Debug, PartialEq)]
pub enum Histogram {
    /// Counts of values along one axis.
    One(Histogram1d),
    /// Counts of pairs of values.
    Two(Histogram2d),
}

impl Histogram {
    /// The histogram of values; `None` if it counts pairs.
    pub fn one(&self) -> Option<&Histogram1d> {
        match self {
            Self::One(histogram) => Some(histogram),
            Self::Two(_) => None,
        }
    }

    /// The histogram of pairs; `None` if it counts values.
    pub fn two(&self) -> Option<&Histogram2d> {
        match self {
            Self::One(_) => None,
            Self::Two(histogram) => Some(histogram),
        }
    }

    /// The ranges that the bins cover.
    pub fn ranges(&self) -> Ranges {
        match self {
            Self::One(histogram) => [histogram.range(), None],
            Self::Two(histogram) => [histogram.x().range(), histogram.y().range()],
        }
    }

    /// The counts; of pairs `[y][x]`, row by row.
    pub fn counts(&self) -> &[u64] {
        match self {
            Self::One(histogram) => histogram.counts(),
            Self::Two(histogram) => histogram.counts(),
        }
    }

    /// Number of samples that are in no bin.
    pub fn nonfinite(&self) -> u64 {
        match self {
            Self::One(histogram) => histogram.nonfinite(),
            Self::Two(histogram) => histogram.nonfinite(),
        }
    }

    /// Adds the counts of another histogram.
    ///
    /// # Panics
    /// If its bins differ.
    pub fn merge(&mut self, other: &Self) {
        match (self, other) {
            (Self::One(all), Self::One(more)) => all.merge(more),
            (Self::Two(all), Self::Two(more)) => all.merge(more),
            _ => panic!("histograms of one kind"),
        }
    }

    fn widen(&mut self, [x, y]: Ranges) {
        match self {
            Self::One(histogram) => histogram.widen(x),
            Self::Two(histogram) => histogram.widen(x, y),
        }
    }

    /// The histogram with other counts; `None` if there is not one for each bin.
    #[must_use]
    pub fn with_counts(&self, counts: Vec<u64>, nonfinite: u64) -> Option<Self> {
        match self {
            Self::One(h) => Histogram1d::from_counts(h.bins().clone(), counts, nonfinite).map(Self::One),
            Self::Two(h) => Histogram2d::from_counts(h.x().clone(), h.y().clone(), counts, nonfinite).map(Self::Two),
        }
    }

    fn emptied(&self) -> Self {
        match self {
            Self::One(h) => Self::One(Histogram1d::over(h.bins().clone())),
            Self::Two(h) => Self::Two(Histogram2d::over(h.x().clone(), h.y().clone())),
        }
    }
}

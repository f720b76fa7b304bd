//! Axes of histograms.

use super::StepView;
use crate::moments::AxisScale;

/// What has the values of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// One value for each scalar, of vertices or of cells.
    Scalars,
    /// One value for each cell.
    Cells,
}

/// A quantity at the vertices or cells of a step.
pub trait Axis: Send + Sync {
    /// A short, unique name of letters, digits and dashes; part of a folder's name.
    fn name(&self) -> &str;

    /// Unit of the values, given the scalar's unit `scalar`; empty without a unit.
    fn unit(&self, scalar: &str) -> String;

    /// What has the values.
    fn place(&self) -> Place;

    /// The value of scalar or cell `index`; NaN if it has none.
    fn value(&self, step: &StepView<'_>, index: usize) -> f32;

    /// How the axis is divided.
    fn scale(&self) -> AxisScale {
        AxisScale::Linear
    }

    /// Whether values differ from step to step.
    fn changes(&self) -> bool {
        true
    }

    /// Whether this is the scalar itself, whose range is known beforehand.
    fn is_scalar(&self) -> bool {
        false
    }

    /// Whether values need coefficients of variation, which are found from all steps.
    fn needs_cov(&self) -> bool {
        false
    }

    /// Fills `out` with the values from index `first` on.
    fn fill(&self, step: &StepView<'_>, first: usize, out: &mut [f32]) {
        out.iter_mut().zip(first..).for_each(|(out, index)| *out = self.value(step, index));
    }

    /// Fills `out` with the means over the vertices of the cells from `first` on, in f64, rounded once.
    fn fill_means(&self, step: &StepView<'_>, first: usize, out: &mut [f32]) {
        for (out, &[a, b, c, d]) in out.iter_mut().zip(&step.mesh.topology.tets[first..]) {
            let value = |v: u32| f64::from(self.value(step, v as usize));
            *out = (0.25 * (value(a) + value(b) + value(c) + value(d))) as f32;
        }
    }
}

/// The scalar of a vertex or cell.
#[derive(Clone, Copy, Debug)]
pub struct Scalar;

impl Axis for Scalar {
    fn name(&self) -> &str {
        "scalar"
    }

    fn unit(&self, scalar: &str) -> String {
        scalar.to_owned()
    }

    fn place(&self) -> Place {
        Place::Scalars
    }

    fn value(&self, step: &StepView<'_>, index: usize) -> f32 {
        step.scalars[index]
    }

    fn is_scalar(&self) -> bool {
        true
    }
}

/// The magnitude of the gradient of a cell ([`Mesh::gradient_magnitude`](crate::mesh::Mesh::gradient_magnitude)); of scalars of cells that of
/// their means at the vertices.
#[derive(Clone, Copy, Debug)]
pub struct GradientMagnitude;

impl Axis for GradientMagnitude {
    fn name(&self) -> &str {
        "gradient"
    }

    fn unit(&self, scalar: &str) -> String {
        let scalar = if scalar.is_empty() { "1" } else { scalar };
        format!("{scalar} per length")
    }

    fn place(&self) -> Place {
        Place::Cells
    }

    fn value(&self, step: &StepView<'_>, index: usize) -> f32 {
        step.mesh.gradient_magnitude(index, step.at_vertices)
    }

    fn scale(&self) -> AxisScale {
        AxisScale::Octaves
    }
}

/// The coefficient of variation of a scalar over time.
#[derive(Clone, Copy, Debug)]
pub struct CoefficientOfVariation;

impl Axis for CoefficientOfVariation {
    fn name(&self) -> &str {
        "cov"
    }

    fn unit(&self, _scalar: &str) -> String {
        String::new()
    }

    fn place(&self) -> Place {
        Place::Scalars
    }

    fn value(&self, step: &StepView<'_>, index: usize) -> f32 {
        step.cov[index]
    }

    fn scale(&self) -> AxisScale {
        AxisScale::Octaves
    }

    fn changes(&self) -> bool {
        false
    }

    fn needs_cov(&self) -> bool {
        true
    }
}

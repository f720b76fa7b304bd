//! What histograms are made over.

use super::StepView;
use crate::moments::AxisScale;

/// Where values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// One for each vertex.
    Vertices,
    /// One for each cell.
    Cells,
}

/// Values of the vertices or cells of a step.
pub trait Axis: Send + Sync {
    /// A short name, unlike those of other axes: letters, digits and dashes, for it is part of a folder's name.
    fn name(&self) -> &str;

    /// The unit of the values, if that of the scalar is `scalar`; empty if they have none.
    fn unit(&self, scalar: &str) -> String;

    /// Where the values are.
    fn place(&self) -> Place;

    /// The value of the vertex or cell `index`; NaN if it has none.
    fn value(&self, step: &StepView<'_>, index: usize) -> f32;

    /// How the axis is divided.
    fn scale(&self) -> AxisScale {
        AxisScale::Linear
    }

    /// Whether values of one step are not those of every other one.
    fn changes(&self) -> bool {
        true
    }

    /// Whether this is the scalar itself, the range of which is known beforehand.
    fn is_scalar(&self) -> bool {
        false
    }

    /// The values from `first` on.
    fn fill(&self, step: &StepView<'_>, first: usize, out: &mut [f32]) {
        out.iter_mut().zip(first..).for_each(|(out, index)| *out = self.value(step, index));
    }

    /// The means over the vertices of the cells from `first` on, in f64, rounded once.
    fn fill_means(&self, step: &StepView<'_>, first: usize, out: &mut [f32]) {
        for (out, &[a, b, c, d]) in out.iter_mut().zip(&step.mesh.topology.tets[first..]) {
            let value = |v: u32| f64::from(self.value(step, v as usize));
            *out = (0.25 * (value(a) + value(b) + value(c) + value(d))) as f32;
        }
    }
}

/// The scalar of a vertex.
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
        Place::Vertices
    }

    fn value(&self, step: &StepView<'_>, index: usize) -> f32 {
        step.scalars[index]
    }

    fn is_scalar(&self) -> bool {
        true
    }
}

/// The magnitude of the gradient of a cell ([`Mesh::gradient_magnitude`](crate::mesh::Mesh::gradient_magnitude)).
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
        step.mesh.gradient_magnitude(index, step.scalars)
    }

    fn scale(&self) -> AxisScale {
        AxisScale::Octaves
    }
}

/// The coefficient of variation of a vertex over time.
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
        Place::Vertices
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
}

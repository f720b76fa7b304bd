//! [`JointTable`]: a transfer function of the scalar and up to two more quantities.
//!
//! Values are continuous across the diagonals of its rectangles, with a fold along them; finer rows are the remedy where it shows.

use super::{Node, NodeTable};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A transfer function of three quantities, with an axis for each: the scalar; a value at vertices, linear in a cell like the scalar
/// (`vertex_axis`, whose positions are the table's *rows*); and a value of a cell, constant in it (`cell_axis`, whose positions are the
/// table's *layers*).
///
/// There is a value for each scalar node, row and layer. Between two layers values are linear. In the plane of scalar and rows each
/// rectangle between neighbouring nodes and rows is cut into two triangles by the diagonal from its (lower scalar, lower row) to its (upper
/// scalar, upper row), and values are linear on each: so along a straight line through the plane, as of a ray in a cell, colour and
/// extinction are piecewise linear, and a segment of a ray is integrated exactly by pieces, as with a [`NodeTable`]. Bilinear interpolation
/// would make them quadratic.
///
/// Two nodes at one scalar make a step, as in a [`NodeTable`] (at the scalar itself the right one holds), and so do two layers at one
/// position. Rows have no steps: a ramp between two close rows serves as one. Beyond the ends of an axis the end values continue; on an
/// axis with one position the quantity has no effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts")]
pub struct JointTable {
    scalars: Vec<f64>,
    #[serde(rename = "rows")]
    vertex_axis: Vec<f64>,
    #[serde(rename = "layers")]
    cell_axis: Vec<f64>,
    values: Vec<[f32; 4]>,
    /// Derived from all of these.
    #[serde(skip)]
    projection: Arc<NodeTable>,
}

/// The serialized form of a table.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts {
    scalars: Vec<f64>,
    #[serde(rename = "rows")]
    vertex_axis: Vec<f64>,
    #[serde(rename = "layers")]
    cell_axis: Vec<f64>,
    values: Vec<[f32; 4]>,
}

impl TryFrom<Parts> for JointTable {
    type Error = JointTableError;

    fn try_from(Parts { scalars, vertex_axis, cell_axis, values }: Parts) -> Result<Self, JointTableError> {
        Self::new(scalars, vertex_axis, cell_axis, values)
    }
}

/// An axis of a [`JointTable`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointAxis {
    /// The scalar.
    Scalar,
    /// The value at vertices.
    Vertex,
    /// The value of a cell.
    Cell,
}

/// Why axes and values do not make a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JointTableError {
    /// An axis without positions.
    #[error("a joint transfer function has no place on its {0:?} axis")]
    Empty(JointAxis),
    /// Positions are not sorted, or too many are equal: two make a step, not on the vertex axis.
    #[error("place {1} of the {0:?} axis is not behind the one before it, or the third at one place")]
    NotSorted(JointAxis, usize),
    /// A position, or the distance of two, is not finite.
    #[error("the {0:?} axis is not finite")]
    NotFinite(JointAxis),
    /// The number of values is not that of scalars times rows times layers.
    #[error("{given} values for a joint table of {expected}")]
    ValueCount {
        /// Values given.
        given: usize,
        /// Scalars times rows times layers.
        expected: usize,
    },
    /// A number is NaN or infinite, an extinction negative, or a colour outside 0..=1.
    #[error("value {0} is not finite, has a negative extinction or a colour outside 0..1")]
    BadValue(usize),
}

/// Position of a value on an axis: the nodes below and above it, and its share of the way between them. NaN lies below all.
fn place_on(axis: &[f64], at: f64) -> ([usize; 2], f64) {
    let above = axis.partition_point(|&place| place <= at);
    match above {
        0 => ([0, 0], 0.0),
        _ if above == axis.len() => ([above - 1, above - 1], 0.0),
        _ => ([above - 1, above], (at - axis[above - 1]) / (axis[above] - axis[above - 1])),
    }
}

impl JointTable {
    /// A table of `values` (red, green, blue: display-referred, not premultiplied, 0..=1; extinction per world unit of length),
    /// the one of scalar i, row j and layer k at `(k * vertex_axis.len() + j) * scalars.len() + i`.
    ///
    /// # Errors
    /// If an axis is empty, not sorted or not finite, or values are too few, too many, not finite or out of range.
    pub fn new(
        scalars: Vec<f64>,
        vertex_axis: Vec<f64>,
        cell_axis: Vec<f64>,
        values: Vec<[f32; 4]>,
    ) -> Result<Self, JointTableError> {
        check_axis(JointAxis::Scalar, &scalars, 2)?;
        check_axis(JointAxis::Vertex, &vertex_axis, 1)?;
        check_axis(JointAxis::Cell, &cell_axis, 2)?;
        let expected = scalars.len().saturating_mul(vertex_axis.len()).saturating_mul(cell_axis.len());
        if values.len() != expected {
            return Err(JointTableError::ValueCount { given: values.len(), expected });
        }
        let is_good = |[r, g, b, tau]: &[f32; 4]| {
            [r, g, b].iter().all(|c| (0.0..=1.0).contains(*c)) && tau.is_finite() && *tau >= 0.0
        };
        match values.iter().position(|value| !is_good(value)) {
            Some(bad) => Err(JointTableError::BadValue(bad)),
            None => {
                let projection = Arc::new(projection(&scalars, &values));
                Ok(Self { scalars, vertex_axis, cell_axis, values, projection })
            }
        }
    }

    /// The scalar nodes, sorted, two at a step.
    pub fn scalars(&self) -> &[f64] {
        &self.scalars
    }

    /// Positions on the vertex axis, one for each row, in the unit of the value at vertices, sorted.
    pub fn vertex_axis(&self) -> &[f64] {
        &self.vertex_axis
    }

    /// Positions on the cell axis, one for each layer, in the unit of the value of cells, sorted, two at a step.
    pub fn cell_axis(&self) -> &[f64] {
        &self.cell_axis
    }

    /// All values, in the order of [`Self::new`].
    pub fn values(&self) -> &[[f32; 4]] {
        &self.values
    }

    /// Red, green, blue and extinction at a scalar node, a row and a layer, given by their indices.
    pub fn value(&self, scalar: usize, row: usize, layer: usize) -> [f32; 4] {
        self.values[(layer * self.vertex_axis.len() + row) * self.scalars.len() + scalar]
    }

    /// The layers below and above a cell's value, and its share of the way between them; the first layer for NaN.
    pub fn layer_at(&self, cell_value: f64) -> ([usize; 2], f64) {
        place_on(&self.cell_axis, cell_value)
    }

    /// Colour and extinction at a scalar, a value at vertices and a value of a cell; NaN lies below all.
    pub fn eval(&self, scalar: f64, vertex_value: f64, cell_value: f64) -> Node {
        let ([left, right], x) = place_on(&self.scalars, scalar);
        let ([lower, upper], y) = place_on(&self.vertex_axis, vertex_value);
        let ([below, above], z) = place_on(&self.cell_axis, cell_value);
        // Values at the two ends of the diagonal, and at the third corner of the triangle.
        let corners = if x >= y {
            [(left, lower, 1.0 - x), (right, lower, x - y), (right, upper, y)]
        } else {
            [(left, lower, 1.0 - y), (left, upper, y - x), (right, upper, x)]
        };
        let mut sum = [0.0; 4];
        for (layer, share) in [(below, 1.0 - z), (above, z)] {
            for (scalar, row, weight) in corners {
                let value = self.value(scalar, row, layer);
                sum = std::array::from_fn(|c| sum[c] + share * weight * f64::from(value[c]));
            }
        }
        // Weights add up to 1 but for rounding.
        let [r, g, b, tau] = sum;
        Node { scalar, rgb: [r, g, b].map(|c| c.min(1.0)), tau }
    }

    /// The table over the scalar alone with, at each node, the value of largest extinction over all rows and layers; always the same
    /// [`Arc`]. It bounds extinction: where it is transparent, so is this table.
    pub fn projection(&self) -> &Arc<NodeTable> {
        &self.projection
    }
}

/// The values of largest extinction at each scalar node.
fn projection(scalars: &[f64], values: &[[f32; 4]]) -> NodeTable {
    let most = |i: usize| {
        let column = values.iter().skip(i).step_by(scalars.len());
        let [r, g, b, tau] =
            column.fold([0.0; 4], |most: [f32; 4], value| if value[3] > most[3] { *value } else { most });
        Node { scalar: scalars[i], rgb: [r, g, b].map(f64::from), tau: f64::from(tau) }
    };
    NodeTable { nodes: (0..scalars.len()).map(most).collect() }
}

/// Checks an axis, on which at most `most` positions may be equal.
fn check_axis(axis: JointAxis, places: &[f64], most: usize) -> Result<(), JointTableError> {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return Err(JointTableError::Empty(axis)) };
    if !places.iter().all(|place| place.is_finite()) || !(last - first).is_finite() {
        return Err(JointTableError::NotFinite(axis));
    }
    let is_wrong = |i: usize| places[i] < places[i - 1] || i >= most && places[i] == places[i - most];
    match (1..places.len()).find(|&i| is_wrong(i)) {
        Some(i) => Err(JointTableError::NotSorted(axis, i)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Extinction encodes the position: 1 for each scalar node, 10 for each row, 100 for each layer.
    fn numbered(scalars: &[f64], rows: &[f64], layers: &[f64]) -> JointTable {
        let mut values = Vec::new();
        for layer in 0..layers.len() {
            for row in 0..rows.len() {
                values.extend((0..scalars.len()).map(|i| [0.5, 0.5, 0.5, (i + 10 * row + 100 * layer) as f32]));
            }
        }
        JointTable::new(scalars.to_vec(), rows.to_vec(), layers.to_vec(), values).unwrap()
    }

    #[test]
    fn values_are_linear_on_two_triangles_and_between_layers() {
        let table = numbered(&[0.0, 1.0, 2.0], &[0.0, 4.0], &[0.0, 1.0]);
        let tau = |s: f64, row: f64, layer: f64| table.eval(s, row, layer).tau;
        assert_eq!((tau(0.5, 0.0, 0.0), tau(1.25, 0.0, 0.0), tau(0.0, 1.0, 0.0)), (0.5, 1.25, 2.5));
        // On the diagonal, below it and above it: these values lie on a plane, without a fold.
        assert_eq!((tau(0.5, 2.0, 0.0), tau(0.75, 1.0, 0.0), tau(0.25, 3.0, 0.0)), (5.5, 3.25, 7.75));
        assert_eq!((tau(0.0, 0.0, 0.25), tau(1.5, 4.0, 1.0)), (25.0, 111.5));
        // Raising one corner below the diagonal makes a fold.
        let value = |i: usize| [1.0, 0.0, 0.0, if i == 1 { 8.0 } else { 0.0 }];
        let corner = JointTable::new(vec![0.0, 1.0], vec![0.0, 1.0], vec![0.0], (0..4).map(value).collect()).unwrap();
        let tau = |s: f64, row: f64| corner.eval(s, row, 0.0).tau;
        assert_eq!((tau(0.75, 0.25), tau(0.5, 0.5), tau(0.25, 0.75), tau(1.0, 0.5)), (4.0, 0.0, 0.0, 4.0));
    }

    #[test]
    fn beyond_its_ends_an_axis_holds_and_no_number_lies_below_all() {
        let table = numbered(&[-1.0, 1.0], &[-1.0, 1.0], &[-1.0, 1.0]);
        for low in [f64::NAN, f64::NEG_INFINITY, f64::MIN, -1.0, -1.5] {
            assert_eq!(table.eval(low, low, low).tau, 0.0, "{low}");
        }
        for high in [f64::INFINITY, f64::MAX, 1.0, 1.5] {
            assert_eq!(table.eval(high, high, high).tau, 111.0, "{high}");
            assert_eq!(table.layer_at(high), ([1, 1], 0.0));
        }
        let single = numbered(&[3.0], &[4.0], &[5.0]);
        for at in [f64::NAN, -9.0, 4.0, f64::INFINITY] {
            assert_eq!(single.eval(at, at, at).tau, 0.0);
        }
    }

    #[test]
    fn at_a_step_the_upper_side_holds() {
        let table = numbered(&[0.0, 1.0, 1.0, 2.0], &[0.0], &[0.0, 0.0, 3.0, 3.0]);
        let below = 1.0 - f64::EPSILON / 2.0;
        assert_eq!(table.eval(1.0, 0.0, -1.0).tau, 2.0);
        assert!((table.eval(below, 0.0, -1.0).tau - 1.0).abs() < 1e-15);
        let layers = [-1e-300, 0.0, 1.5, 3.0].map(|at| table.layer_at(at));
        assert_eq!(layers, [([0, 0], 0.0), ([1, 2], 0.0), ([1, 2], 0.5), ([3, 3], 0.0)]);
    }

    #[test]
    fn denormal_and_huge_axes_are_as_good_as_others() {
        for unit in [5e-324, 1e-310, 1e-30, 1e30, 8e307] {
            let table = numbered(&[0.0, 2.0 * unit], &[-unit, unit], &[-unit, unit]);
            assert_eq!(table.eval(unit, 0.0, 0.0).tau, 0.5 + 5.0 + 50.0, "{unit:e}");
        }
    }

    #[test]
    fn the_projection_has_the_largest_extinctions() {
        let table = numbered(&[0.0, 1.0], &[0.0, 1.0], &[0.0, 1.0]);
        let taus: Vec<_> = table.projection().nodes().iter().map(|node| (node.scalar, node.tau)).collect();
        assert_eq!(taus, [(0.0, 110.0), (1.0, 111.0)]);
    }
}

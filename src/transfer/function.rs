//! [`TransferFunction`]: a colour map and opacity points.

use super::TransferError;
use super::color_map::ColorMap;
use super::file::TransferFunctionFile;
use serde::{Deserialize, Serialize};

/// A point of the opacity curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct OpacityPoint {
    /// Fraction of the mapped range, or scalar: see [`PositionKind`].
    pub position: f64,
    /// Opacity, or extinction: see [`OpacityValues`].
    pub value: f64,
}

impl From<[f64; 2]> for OpacityPoint {
    fn from([position, value]: [f64; 2]) -> Self {
        Self { position, value }
    }
}

impl From<OpacityPoint> for [f64; 2] {
    fn from(point: OpacityPoint) -> Self {
        [point.position, point.value]
    }
}

/// Unit of the positions of opacity points. The colour map always covers the mapped range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PositionKind {
    /// Fractions of the mapped range, 0..=1.
    #[default]
    Relative,
    /// Scalars, in the field's unit.
    Absolute,
}

/// Meaning of the values of opacity points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OpacityValues {
    /// Opacity per unit distance, which [`OpacityKind`](super::OpacityKind) turns into extinction.
    #[default]
    Opacity,
    /// Extinction per world unit of length.
    #[serde(alias = "tau")]
    Extinction,
}

/// A colour map and an opacity curve: linear between its points, constant outside; two points at one position make a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "TransferFunctionFile", into = "TransferFunctionFile")]
pub struct TransferFunction {
    color_map: ColorMap,
    points: Vec<OpacityPoint>,
    positions: PositionKind,
    values: OpacityValues,
}

impl TransferFunction {
    /// A transfer function of a colour map and opacity points.
    ///
    /// # Errors
    /// If there is no point, a number is not finite, a value negative, positions do not increase, are outside 0..=1 where
    /// they are relative, or more than two are equal.
    pub fn new(
        color_map: ColorMap,
        points: Vec<OpacityPoint>,
        positions: PositionKind,
        values: OpacityValues,
    ) -> Result<Self, TransferError> {
        if points.is_empty() {
            return Err(TransferError::NoPoints);
        }
        for (index, point) in points.iter().enumerate() {
            if let Some(problem) = problem_of(&points, index, positions) {
                return Err(TransferError::BadPoint { index, position: point.position, value: point.value, problem });
            }
        }
        Ok(Self { color_map, points, positions, values })
    }

    /// A map with the opacity curve that it gets if nobody gives one: a ramp from transparent at the lower end of the range
    /// to 0.15 per unit distance at the upper one, at which a mesh is translucent throughout.
    pub fn ramp(color_map: ColorMap) -> Self {
        let points = vec![OpacityPoint { position: 0.0, value: 0.0 }, OpacityPoint { position: 1.0, value: 0.15 }];
        Self { color_map, points, positions: PositionKind::Relative, values: OpacityValues::Opacity }
    }

    /// The colours.
    pub fn color_map(&self) -> &ColorMap {
        &self.color_map
    }

    /// The opacity points, sorted by position.
    pub fn points(&self) -> &[OpacityPoint] {
        &self.points
    }

    /// Unit of the positions.
    pub fn positions(&self) -> PositionKind {
        self.positions
    }

    /// Meaning of the values.
    pub fn values(&self) -> OpacityValues {
        self.values
    }
}

/// What is wrong with a point, if anything.
fn problem_of(points: &[OpacityPoint], index: usize, positions: PositionKind) -> Option<&'static str> {
    let OpacityPoint { position, value } = points[index];
    let earlier = |back: usize| index.checked_sub(back).map(|i| points[i].position);
    if !position.is_finite() || !value.is_finite() {
        return Some("position and value must be finite");
    }
    if value < 0.0 {
        return Some("the value must not be negative");
    }
    if positions == PositionKind::Relative && !(0.0..=1.0).contains(&position) {
        return Some("the position is a fraction of the range, 0..1");
    }
    if earlier(1).is_some_and(|p| p > position) {
        return Some("lies before the point in front of it; positions must increase");
    }
    if earlier(2).is_some_and(|p| p == position) {
        return Some("is the third point at one position; two make a step, more have no meaning");
    }
    None
}

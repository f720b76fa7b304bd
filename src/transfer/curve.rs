//! [`Curve`]: colour and opacity over the scalar, linear between points.

use super::TransferError;
use super::blend::Mix;
use super::opacity::OpacityKind;
use super::pieces::{ColorWeighting, Pieces};
use super::profile::{ProfilePoint, Side};
use super::table::node_table;
use super::tolerance::{Lengths, Tolerance};
use crate::node_table::NodeTable;

/// A transfer function or an ensemble of them over the scalar: colour and opacity, linear between points, constant before
/// the first and behind the last. A point has two sides; where they differ, it is a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Sorted by scalar, all scalars different, at least one.
    points: Vec<ProfilePoint>,
    kind: OpacityKind,
}

impl Curve {
    /// A curve of points sorted by scalar; transparent if there are none.
    pub(super) fn new(points: Vec<ProfilePoint>, kind: OpacityKind) -> Self {
        if points.is_empty() {
            let point = ProfilePoint { scalar: 0.0, left: Side::TRANSPARENT, right: Side::TRANSPARENT };
            return Self { points: vec![point], kind };
        }
        Self { points, kind }
    }

    pub(super) fn points(&self) -> &[ProfilePoint] {
        &self.points
    }

    /// Whether values are opacities or optical depths, of a unit distance.
    pub fn kind(&self) -> OpacityKind {
        self.kind
    }

    /// Whether it is transparent at every scalar.
    pub(super) fn is_transparent(&self) -> bool {
        self.points.iter().all(|p| p.left.value == 0.0 && p.right.value == 0.0)
    }

    /// The scalars of its points, sorted.
    pub fn knots(&self) -> impl Iterator<Item = f64> + '_ {
        self.points.iter().map(|p| p.scalar)
    }

    /// Display-referred colour and value at a scalar; at a step, those of the right side.
    pub fn eval(&self, scalar: f64) -> ([f64; 3], f64) {
        let [_, side] = self.sides(scalar);
        (side.rgb, side.value)
    }

    /// Colour and value just left of a scalar, and at it.
    pub(super) fn sides(&self, scalar: f64) -> [Side; 2] {
        let at = self.points.partition_point(|p| p.scalar < scalar);
        let before = at.checked_sub(1).and_then(|i| self.points.get(i));
        match (before, self.points.get(at)) {
            (_, Some(point)) if point.scalar == scalar => [point.left, point.right],
            (Some(a), Some(b)) => [Side::mix(&a.right, &b.left, (scalar - a.scalar) / (b.scalar - a.scalar)); 2],
            (Some(last), None) => [last.right; 2],
            (None, Some(first)) => [first.left; 2],
            (None, None) => [Side::TRANSPARENT; 2], // not reached: a curve has a point
        }
    }

    /// Interpolates from `a` (`f` = 0) to `b` (`f` = 1): C = C1 (1 - f) + C2 f, and opacity alike (dissertation 7.4); exact at both ends.
    /// With [`ColorWeighting::Opacity`] that holds for colours times opacity, and the result is divided by its opacity, within 7.9e-8 of
    /// the quotient.
    ///
    /// A curve that is transparent everywhere can be mixed with either kind of values.
    ///
    /// # Errors
    /// If one has opacities and the other optical depths, or both together are too wide or have too many points.
    pub fn mix(a: &Curve, b: &Curve, f: f64, weighting: ColorWeighting) -> Result<Curve, TransferError> {
        let kind = if a.is_transparent() { b.kind } else { a.kind };
        if kind != b.kind && !b.is_transparent() {
            return Err(TransferError::MixedKinds);
        }
        if f.is_nan() || f <= 0.0 || a == b {
            return Ok(a.clone());
        }
        if f >= 1.0 {
            return Ok(b.clone());
        }
        check_span([a, b])?;
        let mixed = Pieces::of(&a.points, weighting).combine(&Pieces::of(&b.points, weighting), &Mix(f));
        Ok(Curve::new(mixed.to_curve(weighting)?, kind))
    }

    /// The curve's table, like that of a transfer function ([`build_node_table`](super::build_node_table)).
    ///
    /// # Errors
    /// If a length is not positive and finite or the unit distance so small that extinction overflows.
    pub fn node_table(&self, lengths: &Lengths) -> Result<NodeTable, TransferError> {
        lengths.check()?;
        node_table(&self.points, self.kind, lengths.unit_distance, &Tolerance::of_paths(lengths))
    }

    /// The curve as a line of a joint table: within [`JOINT_TOLERANCE`](super::tolerance::JOINT_TOLERANCE).
    pub(super) fn line_of_joint_table(&self, lengths: &Lengths) -> Result<NodeTable, TransferError> {
        lengths.check()?;
        node_table(&self.points, self.kind, lengths.unit_distance, &Tolerance::of_joint())
    }
}

/// Fails if the differences of the scalars of all curves overflow.
pub(super) fn check_span<'a>(curves: impl IntoIterator<Item = &'a Curve>) -> Result<(), TransferError> {
    let ends = curves.into_iter().flat_map(Curve::knots);
    let (lo, hi) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), s| (lo.min(s), hi.max(s)));
    if lo < hi && !(hi - lo).is_finite() {
        return Err(TransferError::BadRange { lo, hi, problem: "all ranges together are too wide for a double" });
    }
    Ok(())
}

#[cfg(test)]
#[path = "curve_tests.rs"]
mod tests;

//! Edits the points of the opacity curve, for the mouse and the number boxes.
//!
//! All functions return valid points of a transfer function: ascending positions in 0..=1, at most two at one position, values of 0 or
//! more.

use crate::transfer::{MappedRange, OpacityKind, OpacityPoint, OpacityValues, PositionKind, TransferFunction};

/// The points of a transfer function as fractions of the range.
pub fn relative_points(tf: &TransferFunction, range: &MappedRange) -> Vec<OpacityPoint> {
    let points = tf.points();
    match tf.positions() {
        PositionKind::Relative => points.to_vec(),
        PositionKind::Absolute => {
            let relative =
                |p: &OpacityPoint| OpacityPoint { position: range.position_of(p.position).clamp(0.0, 1.0), ..*p };
            without_triples(points.iter().map(relative).collect())
        }
    }
}

/// Upper limit of values: 1 for opacities, else twice the curve's maximum.
pub fn highest_value(tf: &TransferFunction, kind: OpacityKind) -> f64 {
    let is_opacity = tf.values() == OpacityValues::Opacity && kind == OpacityKind::Alpha;
    if is_opacity { 1.0 } else { tf.points().iter().map(|p| 2.0 * p.value).fold(1.0, f64::max) }
}

/// Moves a point, clamped between its neighbours and between 0 and `highest`.
pub fn moved(points: &[OpacityPoint], index: usize, to: OpacityPoint, highest: f64) -> Vec<OpacityPoint> {
    let mut points = points.to_vec();
    let before = index.checked_sub(1).and_then(|i| points.get(i)).map_or(0.0, |p| p.position);
    let after = points.get(index + 1).map_or(1.0, |p| p.position);
    if let Some(point) = points.get_mut(index)
        && to.position.is_finite()
        && to.value.is_finite()
    {
        let position = to.position.clamp(before.min(after), after.max(before));
        *point = OpacityPoint { position, value: to.value.clamp(0.0, highest) };
    }
    without_triples(points)
}

/// Adds a point; returns its index.
pub fn inserted(points: &[OpacityPoint], at: OpacityPoint, highest: f64) -> (Vec<OpacityPoint>, usize) {
    let mut points = points.to_vec();
    let position = if at.position.is_finite() { at.position.clamp(0.0, 1.0) } else { 0.0 };
    let value = if at.value.is_finite() { at.value.clamp(0.0, highest) } else { 0.0 };
    let index = points.partition_point(|p| p.position <= position);
    points.insert(index, OpacityPoint { position, value });
    (without_triples(points), index)
}

/// Removes a point; the last one stays.
pub fn removed(points: &[OpacityPoint], index: usize) -> Vec<OpacityPoint> {
    let mut points = points.to_vec();
    if points.len() > 1 && index < points.len() {
        points.remove(index);
    }
    points
}

/// The point nearest to a position, if it is within `reach` (in the same units, position and value / `highest`).
pub fn nearest(points: &[OpacityPoint], at: OpacityPoint, highest: f64, reach: (f64, f64)) -> Option<usize> {
    let distance = |p: &OpacityPoint| {
        let (x, y) = ((p.position - at.position) / reach.0, (p.value - at.value) / (highest * reach.1));
        x * x + y * y
    };
    let nearest = points.iter().enumerate().min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
    nearest.filter(|(_, p)| distance(p) <= 1.0).map(|(index, _)| index)
}

/// The values of points just left of a position, and at it: linear between points, constant outside of them.
pub fn sides_at(points: &[OpacityPoint], position: f64) -> [f64; 2] {
    let between = |after: usize| {
        let (before, next) = (after.checked_sub(1).and_then(|i| points.get(i)), points.get(after));
        match (before, next) {
            (Some(a), Some(b)) if a.position < b.position => {
                let f = (position - a.position) / (b.position - a.position);
                a.value * (1.0 - f) + b.value * f
            }
            (_, Some(only)) | (Some(only), None) => only.value,
            (None, None) => 0.0,
        }
    };
    [points.partition_point(|p| p.position < position), points.partition_point(|p| p.position <= position)].map(between)
}

/// Keeps the first and the last of three or more points at one position.
fn without_triples(points: Vec<OpacityPoint>) -> Vec<OpacityPoint> {
    let is_inner = |i: usize| {
        let at = |i: usize| points.get(i).map(|p| p.position);
        i > 0 && at(i - 1) == at(i) && at(i + 1) == at(i)
    };
    let inner: Vec<bool> = (0..points.len()).map(is_inner).collect();
    points.into_iter().zip(inner).filter(|(_, inner)| !inner).map(|(point, _)| point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::{ColorMap, TransferFunction};
    use proptest::prelude::*;

    fn points(list: &[(f64, f64)]) -> Vec<OpacityPoint> {
        list.iter().map(|&(position, value)| OpacityPoint { position, value }).collect()
    }

    fn point(position: f64, value: f64) -> OpacityPoint {
        OpacityPoint { position, value }
    }

    #[test]
    fn a_point_stays_between_its_neighbours() {
        let ramp = points(&[(0.0, 0.0), (0.5, 0.2), (1.0, 0.4)]);
        assert_eq!(moved(&ramp, 1, point(2.0, 3.0), 1.0), points(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.4)]));
        assert_eq!(moved(&ramp, 1, point(-2.0, -3.0), 1.0), points(&[(0.0, 0.0), (0.0, 0.0), (1.0, 0.4)]));
        assert_eq!(moved(&ramp, 1, point(f64::NAN, 0.1), 1.0), ramp);
        assert_eq!(moved(&ramp, 9, point(0.5, 0.1), 1.0), ramp);
    }

    #[test]
    fn points_come_and_go_but_the_last_stays() {
        let (two, index) = inserted(&points(&[(0.5, 0.2)]), point(0.7, 0.3), 1.0);
        assert_eq!((two.clone(), index), (points(&[(0.5, 0.2), (0.7, 0.3)]), 1));
        assert_eq!(removed(&two, 0), points(&[(0.7, 0.3)]));
        assert_eq!(removed(&removed(&two, 0), 0), points(&[(0.7, 0.3)]));
        assert_eq!(nearest(&two, point(0.69, 0.3), 1.0, (0.05, 0.05)), Some(1));
        assert_eq!(nearest(&two, point(0.9, 0.3), 1.0, (0.05, 0.05)), None);
    }

    proptest! {
        #[test]
        fn whatever_is_dragged_where_it_is_a_transfer_function(
            edits in prop::collection::vec((0..3_u8, 0..6_usize, -0.5..1.5_f64, -0.5..1.5_f64), 1..40)
        ) {
            let mut curve = points(&[(0.0, 0.0), (1.0, 0.15)]);
            for (kind, index, position, value) in edits {
                // Coarse positions, so that points meet.
                let at = point((position * 4.0).round() / 4.0, value);
                curve = match kind {
                    0 => inserted(&curve, at, 1.0).0,
                    1 => removed(&curve, index),
                    _ => moved(&curve, index, at, 1.0),
                };
                let map = ColorMap::built_in("gray").unwrap().clone();
                let tf = TransferFunction::new(map, curve.clone(), PositionKind::Relative, OpacityValues::Opacity);
                prop_assert!(tf.is_ok(), "{:?}", tf);
            }
        }
    }
}

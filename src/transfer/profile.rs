//! A transfer function over its mapped range, as a curve that is linear in the scalar between points.

use super::TransferError;
use super::color_map::{lerp, mix};
use super::function::{OpacityPoint, OpacityValues, PositionKind, TransferFunction};
use super::range::MappedRange;
use super::table::{OpacityKind, TOLERANCE};

/// Colour and opacity at one side of a scalar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Side {
    /// Display-referred colour.
    pub rgb: [f64; 3],
    /// Opacity per unit distance (alpha), or optical depth of a unit distance (extinction).
    pub value: f64,
}

/// A point of the curve; a step where its sides differ.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProfilePoint {
    /// The scalar, in the field's unit.
    pub scalar: f64,
    /// Just below the scalar.
    pub left: Side,
    /// At the scalar and just above.
    pub right: Side,
}

impl Side {
    pub(super) fn mix(a: &Side, b: &Side, f: f64) -> Side {
        Side { rgb: mix(a.rgb, b.rgb, f), value: lerp(a.value, b.value, f) }
    }
}

/// What refinement of a logarithmic axis may use up of the table's tolerance.
pub(super) const AXIS_TOLERANCE: f64 = TOLERANCE / 16.0;

/// A place where the curve has a point: its position on the axis and its scalar.
#[derive(Clone, Copy)]
struct Knot {
    position: f64,
    scalar: f64,
}

/// The curve of `tf` over `range`: sorted by scalar, at least two points, all scalars different.
///
/// On a logarithmic axis the curve is linear in the logarithm; it is refined until within [`AXIS_TOLERANCE`].
pub(super) fn profile(
    tf: &TransferFunction,
    range: &MappedRange,
    kind: OpacityKind,
    unit_distance: f64,
) -> Result<Vec<ProfilePoint>, TransferError> {
    let opacity = opacity_on_axis(tf, range, kind, unit_distance)?;
    let mut points: Vec<ProfilePoint> = Vec::new();
    let mut previous: Option<(Knot, ProfilePoint)> = None;
    for knot in knots(tf, range) {
        let [left_rgb, right_rgb] = tf.color_map().eval_sides(knot.position);
        let [left_value, right_value] = value_sides(&opacity, knot.position);
        let point = ProfilePoint {
            scalar: knot.scalar,
            left: Side { rgb: left_rgb, value: left_value },
            right: Side { rgb: right_rgb, value: right_value },
        };
        if range.is_log()
            && let Some((before, p)) = previous
        {
            refine(range, kind, (before, p.right), (knot, point.left), &mut points);
        }
        match points.last_mut() {
            // Two positions nearer to each other than doubles are at this magnitude: one point, with the outer sides.
            Some(last) if last.scalar >= point.scalar => last.right = point.right,
            _ => points.push(point),
        }
        previous = Some((knot, point));
    }
    Ok(points)
}

/// All places where colour or opacity have a point, sorted.
fn knots(tf: &TransferFunction, range: &MappedRange) -> Vec<Knot> {
    let relative = |position: f64| Knot { position, scalar: range.scalar_at(position) };
    let mut knots: Vec<Knot> = tf.color_map().points().iter().map(|p| relative(p.position)).collect();
    knots.extend([relative(0.0), relative(1.0)]);
    knots.extend(tf.points().iter().map(|p| match tf.positions() {
        PositionKind::Relative => relative(p.position),
        PositionKind::Absolute => Knot { position: range.position_of(p.position), scalar: p.position },
    }));
    knots.sort_by(|a, b| a.position.total_cmp(&b.position));
    knots.dedup_by(|next, kept| next.position == kept.position);
    knots
}

/// The opacity points with their positions on the axis and their values per unit distance.
fn opacity_on_axis(
    tf: &TransferFunction,
    range: &MappedRange,
    kind: OpacityKind,
    unit_distance: f64,
) -> Result<Vec<OpacityPoint>, TransferError> {
    let convert = |(index, point): (usize, &OpacityPoint)| {
        let OpacityPoint { position, value } = *point;
        let bad = |problem| Err(TransferError::BadPoint { index, position, value, problem });
        let on_axis = match tf.positions() {
            PositionKind::Relative => position,
            PositionKind::Absolute => range.position_of(position),
        };
        if !on_axis.is_finite() {
            return bad("the position cannot be reached from this range (a logarithmic one is positive)");
        }
        let value = match tf.values() {
            OpacityValues::Extinction => value * unit_distance,
            OpacityValues::Opacity if kind == OpacityKind::Alpha && value > 1.0 => {
                return bad("an opacity is at most 1; the opacity kind 'extinction' has no bound");
            }
            OpacityValues::Opacity => value,
        };
        if value.is_finite() { Ok(OpacityPoint { position: on_axis, value }) } else { bad("the extinction overflows") }
    };
    tf.points().iter().enumerate().map(convert).collect()
}

/// Value just left of a position, and at it.
fn value_sides(points: &[OpacityPoint], position: f64) -> [f64; 2] {
    let left = points.partition_point(|p| p.position < position);
    let right = points.partition_point(|p| p.position <= position);
    let between = |after: usize| match (after.checked_sub(1).and_then(|i| points.get(i)), points.get(after)) {
        (Some(a), Some(b)) => {
            let f = (position - a.position) / (b.position - a.position);
            lerp(a.value, b.value, f)
        }
        (Some(end), None) | (None, Some(end)) => end.value,
        (None, None) => 0.0, // not reached: a transfer function has a point
    };
    [between(left), between(right)]
}

/// Appends the points that make a piece of a logarithmic axis, linear in the logarithm, linear in the scalar.
fn refine(
    range: &MappedRange,
    kind: OpacityKind,
    (a, a_side): (Knot, Side),
    (b, b_side): (Knot, Side),
    points: &mut Vec<ProfilePoint>,
) {
    if a_side.value == 0.0 && b_side.value == 0.0 {
        return;
    }
    let position = 0.5 * (a.position + b.position);
    let middle = Knot { position, scalar: range.scalar_at(position) };
    let splits = a.scalar < middle.scalar && middle.scalar < b.scalar;
    let bow = chord_error_of_log(a.scalar, b.scalar);
    let allowance = match kind {
        OpacityKind::Alpha => 1.0,
        OpacityKind::Extinction => 1.0 + a_side.value.min(b_side.value),
    };
    let colour_ok = a_side.rgb.iter().zip(b_side.rgb).all(|(x, y)| bow * (x - y).abs() <= AXIS_TOLERANCE);
    let value_ok = bow * (a_side.value - b_side.value).abs() <= AXIS_TOLERANCE * allowance;
    if (colour_ok && value_ok) || !splits {
        return;
    }
    let side = Side::mix(&a_side, &b_side, 0.5);
    refine(range, kind, (a, a_side), (middle, side), points);
    points.push(ProfilePoint { scalar: middle.scalar, left: side, right: side });
    refine(range, kind, (middle, side), (b, b_side), points);
}

/// Largest distance between the logarithm and its chord from `a` to `b`, as a share of the logarithm's rise.
fn chord_error_of_log(a: f64, b: f64) -> f64 {
    let rise = (b / a).ln();
    // For a small rise the difference below cancels; the series of it starts like this.
    if rise < 1e-2 {
        return rise / 8.0;
    }
    // The tangent has the slope of the chord at (b - a) / rise.
    let farthest = (b / a - 1.0) / rise;
    farthest.ln() / rise - (farthest - 1.0) / (b / a - 1.0)
}

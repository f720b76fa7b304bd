//! A transfer function as a curve that is linear in the scalar between points.

use super::TransferError;
use super::color_map::{lerp, mix, sides_at};
use super::function::{OpacityPoint, OpacityValues, PositionKind, TransferFunction};
use super::opacity::OpacityKind;
use super::range::MappedRange;
use super::range_map::RangeMap;
use super::tolerance::Tolerance;

/// Colour and opacity at one side of a scalar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Side {
    /// Display-referred colour.
    pub rgb: [f64; 3],
    /// Opacity per unit distance (alpha), or optical depth of a unit distance (extinction).
    pub value: f64,
}

/// A point of the curve; a step where its sides differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ProfilePoint {
    /// The scalar, in the field's unit.
    pub scalar: f64,
    /// Colour and value just below the scalar.
    pub left: Side,
    /// Colour and value at the scalar and just above.
    pub right: Side,
}

impl Side {
    /// Black, and without opacity.
    pub(super) const TRANSPARENT: Side = Side { rgb: [0.0; 3], value: 0.0 };

    pub(super) fn mix(a: &Side, b: &Side, f: f64) -> Side {
        Side { rgb: mix(a.rgb, b.rgb, f), value: lerp(a.value, b.value, f) }
    }
}

/// How closely a curve that is linear on a logarithmic axis is approximated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Precision {
    pub kind: OpacityKind,
    /// Largest errors.
    pub tolerance: Tolerance,
    /// Whether colours also count where the curve is transparent: where they are blended with others.
    pub where_transparent: bool,
}

/// The axis of a transfer function: a mapped range, whose positions a range map moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis<'a> {
    range: &'a MappedRange,
    map: &'a RangeMap,
}

/// A knot of the curve: its position on the axis and its scalar.
#[derive(Clone, Copy)]
pub(super) struct Knot {
    position: f64,
    pub scalar: f64,
}

impl<'a> Axis<'a> {
    pub(super) fn new(range: &'a MappedRange, map: &'a RangeMap) -> Self {
        Self { range, map }
    }

    /// The scalar at a position 0..=1.
    pub(super) fn scalar_at(&self, position: f64) -> f64 {
        self.range.scalar_at(self.map.inverse(position))
    }

    /// The position of a scalar, also outside of 0..=1.
    pub(super) fn position_of(&self, scalar: f64) -> f64 {
        self.map.eval(self.range.position_of(scalar))
    }

    pub(super) fn knot(&self, position: f64) -> Knot {
        Knot { position, scalar: self.scalar_at(position) }
    }

    /// The points of the colour map and of the opacities of a transfer function.
    pub(super) fn knots(&self, tf: &TransferFunction) -> impl Iterator<Item = Knot> {
        let of_colors = tf.color_map().points().iter().map(move |p| self.knot(p.position));
        of_colors.chain(tf.points().iter().map(move |p| match tf.positions() {
            PositionKind::Relative => self.knot(p.position),
            PositionKind::Absolute => Knot { position: self.position_of(p.position), scalar: p.position },
        }))
    }

    /// The curve with colour and value `sides` at a position, linear between these knots: sorted by scalar, at least two points, all
    /// scalars different.
    ///
    /// On a logarithmic axis such a curve is linear in the logarithm between two knots; it is refined to `precision`.
    pub(super) fn curve(
        &self,
        knots: impl Iterator<Item = Knot>,
        sides: impl Fn(f64) -> [Side; 2],
        precision: &Precision,
    ) -> Vec<ProfilePoint> {
        // The ends of the axis are points of the map.
        let mut knots: Vec<Knot> = knots.chain(self.map.points().iter().map(|p| self.knot(p[1]))).collect();
        knots.sort_by(|a, b| a.position.total_cmp(&b.position));
        knots.dedup_by(|next, kept| next.position == kept.position);
        let refinement = Refinement { axis: self, precision };
        let mut points: Vec<ProfilePoint> = Vec::new();
        let mut previous: Option<(Knot, ProfilePoint)> = None;
        for knot in knots {
            let [left, right] = sides(knot.position);
            let point = ProfilePoint { scalar: knot.scalar, left, right };
            if self.range.is_log()
                && let Some((before, p)) = previous
            {
                refinement.append((before, p.right), (knot, point.left), &mut points);
            }
            match points.last_mut() {
                // Two positions that round to one scalar: one point, with the outer sides.
                Some(last) if last.scalar >= point.scalar => last.right = point.right,
                _ => points.push(point),
            }
            previous = Some((knot, point));
        }
        points
    }
}

/// The curve of `tf` over `axis`: sorted by scalar, at least two points, all scalars different.
pub(super) fn profile(
    tf: &TransferFunction,
    axis: &Axis,
    precision: &Precision,
    unit_distance: f64,
) -> Result<Vec<ProfilePoint>, TransferError> {
    let on_axis = OnAxis::new(tf, axis, precision.kind, unit_distance)?;
    Ok(axis.curve(axis.knots(tf), |position| on_axis.sides(position), precision))
}

/// A transfer function whose opacity points are at axis positions and have values per unit distance.
#[derive(Debug)]
pub(super) struct OnAxis<'a> {
    tf: &'a TransferFunction,
    opacity: Vec<OpacityPoint>,
}

impl<'a> OnAxis<'a> {
    pub(super) fn new(
        tf: &'a TransferFunction,
        axis: &Axis,
        kind: OpacityKind,
        unit_distance: f64,
    ) -> Result<Self, TransferError> {
        let convert = |(index, point): (usize, &OpacityPoint)| {
            let OpacityPoint { position, value } = *point;
            let bad = |problem| Err(TransferError::BadPoint { index, position, value, problem });
            let on_axis = match tf.positions() {
                PositionKind::Relative => position,
                PositionKind::Absolute => axis.position_of(position),
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
            if value.is_finite() {
                Ok(OpacityPoint { position: on_axis, value })
            } else {
                bad("the extinction overflows")
            }
        };
        Ok(Self { tf, opacity: tf.points().iter().enumerate().map(convert).collect::<Result<_, _>>()? })
    }

    /// Colour and value just left of a position, and at it.
    pub(super) fn sides(&self, position: f64) -> [Side; 2] {
        let rgb = self.tf.color_map().eval_sides(position);
        let value = sides_at(&self.opacity, position, |p| (p.position, p.value), lerp);
        std::array::from_fn(|i| Side { rgb: rgb[i], value: value[i] })
    }
}

/// Refines pieces that are linear in the logarithm to pieces linear in the scalar.
struct Refinement<'a> {
    axis: &'a Axis<'a>,
    precision: &'a Precision,
}

impl Refinement<'_> {
    /// Appends the points needed between two knots.
    fn append(&self, (a, a_side): (Knot, Side), (b, b_side): (Knot, Side), points: &mut Vec<ProfilePoint>) {
        let Precision { kind, tolerance, where_transparent } = *self.precision;
        if a_side.value == 0.0 && b_side.value == 0.0 && !where_transparent {
            return;
        }
        let middle = self.axis.knot(0.5 * (a.position + b.position));
        let splits = a.scalar < middle.scalar && middle.scalar < b.scalar;
        let bow = chord_error_of_log(a.scalar, b.scalar);
        let (least, most) = (a_side.value.min(b_side.value), a_side.value.max(b_side.value));
        let of_color = if where_transparent { tolerance.everywhere() } else { tolerance }.of_color(kind.depth(most));
        let colour_ok = a_side.rgb.iter().zip(b_side.rgb).all(|(x, y)| bow * (x - y).abs() <= of_color);
        let value_ok = bow * (most - least) <= tolerance.of_value(kind, least, most);
        if (colour_ok && value_ok) || !splits {
            return;
        }
        let side = Side::mix(&a_side, &b_side, 0.5);
        self.append((a, a_side), (middle, side), points);
        points.push(ProfilePoint { scalar: middle.scalar, left: side, right: side });
        self.append((middle, side), (b, b_side), points);
    }
}

/// Largest distance between the logarithm and its chord from `a` to `b`, as a share of the logarithm's rise.
fn chord_error_of_log(a: f64, b: f64) -> f64 {
    let rise = (b / a).ln();
    // For a small rise the difference below cancels; this is the start of its series.
    if rise < 1e-2 {
        return rise / 8.0;
    }
    // The tangent has the slope of the chord at (b - a) / rise.
    let farthest = (b / a - 1.0) / rise;
    farthest.ln() / rise - (farthest - 1.0) / (b / a - 1.0)
}

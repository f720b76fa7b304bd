//! Evaluation of an ensemble: the values at a sample, and the curve over the scalar.

use super::{Counts2d, Ensemble, Function, Member, Reduction, Space};
use crate::slowdown::{Slow, waste};
use crate::transfer::TransferError;
use crate::transfer::curve::{Curve, check_span};
use crate::transfer::opacity::OpacityKind;
use crate::transfer::pieces::ColorWeighting;
use crate::transfer::pieces::{MOST_POINTS, Piece, Pieces, VALUE};
use crate::transfer::profile::{Axis, OnAxis, Precision, ProfilePoint, Side, profile};
use crate::transfer::range::{MappedRange, RangePolicy};
use crate::transfer::table::CURVE_PART;
use crate::transfer::tolerance::{Lengths, Tolerance};
use crate::transfer::widget::{Widget, line_of, topmost};

/// The data ranges, opacity kind, lengths and histograms for which an ensemble is evaluated.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Smallest and largest scalar of the series.
    pub series: (f64, f64),
    /// Smallest and largest scalar of the step shown.
    pub step: (f64, f64),
    /// Meaning of opacity values.
    pub kind: OpacityKind,
    /// The unit distance of opacities, and the longest path.
    pub lengths: Lengths,
    /// Counts over scalar and gradient magnitude, by which members on both are reduced to the scalar.
    pub scalar_gradient: Option<&'a dyn Counts2d>,
    /// Counts over scalar and coefficient of variation, by which members on the latter are reduced.
    pub scalar_cov: Option<&'a dyn Counts2d>,
}

impl Context<'_> {
    /// A context without histograms.
    pub fn new(series: (f64, f64), step: (f64, f64), kind: OpacityKind, lengths: Lengths) -> Self {
        Self { series, step, kind, lengths, scalar_gradient: None, scalar_cov: None }
    }
}

/// The quantities at which an ensemble is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The scalar, in the field's unit.
    pub scalar: f64,
    /// Position of the gradient's magnitude on its axis, 0..=1.
    pub gradient: f64,
    /// Position of the coefficient of variation on its axis, 0..=1.
    pub cov: f64,
}

/// A line along the scalar, given by its positions 0..=1 on the other axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Position on the axis of the gradient's magnitude.
    pub gradient: f64,
    /// Position on the axis of the coefficient of variation.
    pub cov: f64,
}

/// An ensemble prepared for evaluation at samples.
#[derive(Debug)]
pub struct Evaluator<'a> {
    members: Vec<Resolved<'a>>,
    colors: ColorWeighting,
    kind: OpacityKind,
}

/// A member with its resolved range.
#[derive(Debug)]
struct Resolved<'a> {
    member: &'a Member,
    range: MappedRange,
    function: Shape<'a>,
}

/// A member's function on its axes.
#[derive(Debug)]
enum Shape<'a> {
    Points(OnAxis<'a>),
    Widgets(&'a [Widget]),
}

impl<'a> Resolved<'a> {
    fn new(member: &'a Member, context: &Context, kind: OpacityKind) -> Result<Self, TransferError> {
        let range = member.checked(kind)?.range.resolve(context.series, context.step)?;
        let function = match &member.function {
            Function::TransferFunction(tf) => {
                Shape::Points(OnAxis::new(tf, &Axis::new(&range, &member.map), kind, context.lengths.unit_distance)?)
            }
            Function::Widgets(widgets) => Shape::Widgets(widgets),
        };
        Ok(Self { member, range, function })
    }

    fn axis(&self) -> Axis<'_> {
        Axis::new(&self.range, &self.member.map)
    }

    /// The scalars at which a function of the scalar may have a step or a kink.
    fn knots(&self, kind: OpacityKind) -> Vec<f64> {
        let axis = self.axis();
        let mut knots: Vec<f64> = self.member.map.points().iter().map(|p| axis.scalar_at(p[1])).collect();
        match &self.member.function {
            Function::TransferFunction(tf) => knots.extend(axis.knots(tf).map(|knot| knot.scalar)),
            Function::Widgets(widgets) => {
                knots.extend(line_of(widgets, None, kind).knots().map(|position| axis.scalar_at(position)));
            }
        }
        knots
    }

    /// The member's values at a sample, before weighting.
    fn eval(&self, sample: &Sample) -> Side {
        let on_scalar = || self.axis().position_of(sample.scalar);
        let (x, y) = match self.member.space {
            Space::Scalar => (on_scalar(), None),
            Space::Cov => (self.member.map.eval(sample.cov), None),
            Space::ScalarGradient => (on_scalar(), Some(sample.gradient)),
            Space::ScalarCov => (on_scalar(), Some(sample.cov)),
        };
        match &self.function {
            Shape::Points(points) => points.sides(x)[1],
            Shape::Widgets(widgets) => topmost(widgets, x, y),
        }
    }

    /// The curve over the scalar, before weighting: on `line`, if there is one and the member keeps its axes.
    fn curve(
        &self,
        context: &Context,
        line: Option<&Line>,
        precision: &Precision,
    ) -> Result<Vec<ProfilePoint>, TransferError> {
        let Member { space, function, .. } = self.member;
        let line = line.filter(|_| self.member.reduction == Reduction::Keep);
        let of_widgets = |widgets: &[Widget], y: Option<f64>| {
            let (axis, line) = (self.axis(), line_of(widgets, y, precision.kind));
            Ok(axis.curve(line.knots().map(|x| axis.knot(x)), |x| line.sides(x), precision))
        };
        let counts = match (space, function, line) {
            (Space::Scalar, Function::TransferFunction(tf), _) => {
                return profile(tf, &self.axis(), precision, context.lengths.unit_distance);
            }
            (Space::Scalar, Function::Widgets(widgets), _) => return of_widgets(widgets, None),
            (Space::ScalarGradient, Function::Widgets(widgets), Some(line)) => {
                return of_widgets(widgets, Some(line.gradient));
            }
            (Space::ScalarCov, Function::Widgets(widgets), Some(line)) => return of_widgets(widgets, Some(line.cov)),
            (Space::Cov, _, Some(line)) => {
                // Constant over the scalar.
                let side = self.eval(&Sample { scalar: 0.0, gradient: line.gradient, cov: line.cov });
                return Ok(vec![ProfilePoint { scalar: self.axis().scalar_at(0.0), left: side, right: side }]);
            }
            (Space::ScalarGradient, ..) => context.scalar_gradient,
            (Space::Cov | Space::ScalarCov, ..) => context.scalar_cov,
        };
        let Some(counts) = counts else {
            return self.member.bad("has no histogram of its space by which it could be reduced to the scalar");
        };
        let series = RangePolicy::Series.resolve(context.series, context.step)?;
        // All values of a constant field are in its first bin, which has no width.
        let (lo, hi) = context.series;
        let scalar_at = |position: f64| if lo == hi { lo } else { series.scalar_at(position) };
        let side = |scalar: f64, second: f64| self.eval(&Sample { scalar, gradient: second, cov: second });
        Ok(self.member.reduction.curve(counts, scalar_at, side))
    }
}

impl Evaluator<'_> {
    /// Colour (display-referred, not premultiplied) and opacity (or optical depth of a unit distance) at a sample: the values of all
    /// members there, blended. The reference for tables and curves. A NaN scalar is transparent; a NaN gradient or coefficient of variation
    /// counts as 0.
    pub fn eval(&self, sample: &Sample) -> ([f64; 3], f64) {
        let side = self.eval_side(sample);
        (side.rgb, side.value)
    }

    pub(in crate::transfer) fn eval_side(&self, sample: &Sample) -> Side {
        if sample.scalar.is_nan() {
            return Side::TRANSPARENT;
        }
        let known = |position: f64| if position.is_nan() { 0.0 } else { position };
        let sample = &Sample { scalar: sample.scalar, gradient: known(sample.gradient), cov: known(sample.cov) };
        let mut result = None;
        for resolved in &self.members {
            let (side, weight) = (resolved.eval(sample), resolved.member.weight);
            let weighed = Side { rgb: side.rgb.map(|c| c * weight), value: side.value * weight };
            result = Some(match result {
                None => weighed.alone(self.colors),
                Some(before) => resolved.member.blend.sides(&before, &weighed, self.colors, self.kind),
            });
        }
        result.unwrap_or(Side::TRANSPARENT)
    }

    /// The scalars at which members that are functions of the scalar may have a step or a kink.
    pub(in crate::transfer) fn knots(&self) -> Vec<f64> {
        self.members.iter().flat_map(|member| member.knots(self.kind)).collect()
    }

    /// Whether values of the result are opacities or optical depths.
    pub fn kind(&self) -> OpacityKind {
        self.kind
    }
}

impl Ensemble {
    /// Prepares the ensemble for evaluation at samples.
    ///
    /// # Errors
    /// If a member is at fault or its range cannot be resolved.
    pub fn evaluator(&self, context: &Context) -> Result<Evaluator<'_>, TransferError> {
        let kind = self.kind(context.kind);
        let members = self.enabled_members().map(|m| Resolved::new(m, context, kind)).collect::<Result<_, _>>()?;
        self.enabled_members().skip(1).try_for_each(|m| m.check_blend(kind))?;
        Ok(Evaluator { members, colors: self.colors, kind })
    }

    /// The curve over the scalar; members on other axes are reduced to it ([`Reduction`](super::Reduction)). On linear ranges it is exact
    /// but for rounding, except that quotients of weighted colours and opacity are within 7.9e-8. Members on logarithmic ranges are
    /// refined, so that all together use at most 1/32 of the tolerance of tables; with XOR on levels, the scalars at which levels
    /// change may move by as much.
    ///
    /// # Errors
    /// As [`Ensemble::evaluator`], and if a histogram is missing, extinctions overflow, all ranges together are too wide, or
    /// the curve has too many points.
    pub fn curve(&self, context: &Context) -> Result<Curve, TransferError> {
        self.blended(context, None)
    }

    /// The curve over the scalar at one gradient magnitude and one coefficient of variation: as [`Self::curve`], but members that keep
    /// their axes ([`Reduction::Keep`]) are not reduced.
    ///
    /// # Errors
    /// As [`Ensemble::curve`].
    pub fn curve_on(&self, context: &Context, line: &Line) -> Result<Curve, TransferError> {
        self.blended(context, Some(line))
    }

    fn blended(&self, context: &Context, line: Option<&Line>) -> Result<Curve, TransferError> {
        let Evaluator { members, colors, kind } = self.evaluator(context)?;
        let tolerance = self.member_tolerance(members.len(), &context.lengths);
        let precision = Precision { kind, tolerance, where_transparent: colors == ColorWeighting::Plain };
        let curves = members.iter().map(|m| Ok(Curve::new(m.curve(context, line, &precision)?, kind)));
        let curves: Vec<Curve> = curves.collect::<Result<_, TransferError>>()?;
        check_span(&curves)?;
        let mut result: Option<Pieces> = None;
        for (Resolved { member, .. }, curve) in members.iter().zip(&curves) {
            let pieces = weigh(&Pieces::of(curve.points(), colors), member.weight, colors);
            let blended = match &result {
                None => pieces,
                Some(before) => member.blend.pieces(before, &pieces, colors, kind),
            };
            if !blended.is_finite() {
                return member.bad("the sum of extinctions overflows");
            }
            if blended.0.len() > MOST_POINTS {
                return Err(TransferError::TooManyPoints { most: MOST_POINTS });
            }
            result = Some(blended);
        }
        let points = result.map(|pieces| pieces.to_curve(colors)).transpose()?;
        let points = points.unwrap_or_default();
        waste(Slow::Ensemble, points.len());
        Ok(Curve::new(points, kind))
    }

    /// Tolerance for refining one of `count` members on logarithmic axes: half of what curves may be off, shared by all, since blending
    /// rules at most add errors up. A weighted colour has the errors of two factors.
    fn member_tolerance(&self, count: usize, lengths: &Lengths) -> Tolerance {
        let share = match self.colors {
            ColorWeighting::Plain => 0.5,
            ColorWeighting::Opacity => 0.25,
        };
        Tolerance::of_paths(lengths).part(share * CURVE_PART / count.max(1) as f64)
    }
}

/// Multiplies colours and values by the weight; weighted colours, products of both, by its square.
fn weigh(pieces: &Pieces, weight: f64, colors: ColorWeighting) -> Pieces {
    let factor = |c: usize| if c == VALUE || colors == ColorWeighting::Plain { weight } else { weight * weight };
    pieces.map(|p: &Piece| p.with(|c| p.channels[c].map(|x| x * factor(c))))
}

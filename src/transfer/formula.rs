//! [`TransferSource`]: the definition of a table; [`Formula`]: its colour and extinction at a scalar.
//!
//! The reference for tables and renderers: it uses neither curves nor nodes, and simplifies nothing.

use super::TransferError;
use super::blend::mix_sides;
use super::ensemble::{Context, Ensemble, Evaluator, Sample, Space};
use super::function::{OpacityValues, TransferFunction};
use super::opacity::OpacityKind;
use super::pieces::ColorWeighting;
use super::profile::{Axis, OnAxis, Side};
use super::range::MappedRange;
use super::range_map::RangeMap;
use super::tolerance::{COLOR_TOLERANCE, Lengths};
use crate::node_table::{Node, NodeTable, NodeTableError};
use serde::{Deserialize, Serialize};

/// The definition of a table, as plain data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TransferSource {
    /// The function, and the scalars that it covers.
    pub content: TransferContent,
    /// Meaning of opacity values.
    pub kind: OpacityKind,
    /// The lengths for which the table is made.
    pub lengths: Lengths,
}

/// A transfer function or blended ensembles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum TransferContent {
    /// One function over a range.
    Function {
        /// Colours and opacities.
        function: TransferFunction,
        /// The scalars that it covers.
        range: MappedRange,
    },
    /// An ensemble, blended with the next one of a timeline.
    Ensembles(Box<BlendedEnsembles>),
}

/// An ensemble whose members are functions of the scalar, blended with the next one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlendedEnsembles {
    /// The ensemble, with the range maps that its members have.
    pub ensemble: Ensemble,
    /// The next ensemble and its weight, 0..=1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub toward: Option<(Ensemble, f64)>,
    /// Whether colours are weighted by opacity when the two are blended.
    pub colors: ColorWeighting,
    /// Smallest and largest scalar of the series; NaN, and not serialized, if unknown.
    #[serde(default = "unknown", skip_serializing_if = "is_unknown")]
    pub series: (f64, f64),
    /// Smallest and largest scalar of the step shown; NaN, and not serialized, if unknown.
    #[serde(default = "unknown", skip_serializing_if = "is_unknown")]
    pub step: (f64, f64),
}

fn unknown() -> (f64, f64) {
    (f64::NAN, f64::NAN)
}

fn is_unknown((lo, hi): &(f64, f64)) -> bool {
    lo.is_nan() && hi.is_nan()
}

/// A transfer function, ready to be evaluated.
#[derive(Debug)]
pub struct Formula<'a> {
    parts: Parts<'a>,
    kind: OpacityKind,
    unit_distance: f64,
    knots: Vec<f64>,
}

#[derive(Debug)]
enum Parts<'a> {
    Function { range: &'a MappedRange, map: RangeMap, function: OnAxis<'a> },
    Ensembles { from: Evaluator<'a>, toward: Option<(Evaluator<'a>, f64)>, colors: ColorWeighting },
}

impl BlendedEnsembles {
    fn all(&self) -> impl Iterator<Item = &Ensemble> {
        std::iter::once(&self.ensemble).chain(self.toward.as_ref().map(|(ensemble, _)| ensemble))
    }

    /// Whether all members are functions of the scalar. Others are reduced by counts of values, or make joint tables.
    pub fn is_of_scalars(&self) -> bool {
        self.all().flat_map(|ensemble| &ensemble.members).all(|member| !member.enabled || member.space == Space::Scalar)
    }
}

impl TransferSource {
    /// Prepares the function for evaluation.
    ///
    /// # Errors
    /// As [`build_node_table`](super::build_node_table) and [`Ensemble::evaluator`], and for an ensemble with a member that is no
    /// function of the scalar.
    pub fn formula(&self) -> Result<Formula<'_>, TransferError> {
        self.lengths.check()?;
        let (parts, kind, mut knots) = match &self.content {
            TransferContent::Function { function, range } => self.of_function(function, range)?,
            TransferContent::Ensembles(blended) => self.of_ensembles(blended)?,
        };
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        Ok(Formula { parts, kind, unit_distance: self.lengths.unit_distance, knots })
    }

    fn of_function<'a>(
        &self,
        tf: &'a TransferFunction,
        range: &'a MappedRange,
    ) -> Result<(Parts<'a>, OpacityKind, Vec<f64>), TransferError> {
        let kind = if tf.values() == OpacityValues::Extinction { OpacityKind::Extinction } else { self.kind };
        let map = RangeMap::default();
        let axis = Axis::new(range, &map);
        let function = OnAxis::new(tf, &axis, kind, self.lengths.unit_distance)?;
        let knots = axis.knots(tf).map(|knot| knot.scalar).collect();
        Ok((Parts::Function { range, map, function }, kind, knots))
    }

    fn of_ensembles<'a>(
        &self,
        blended: &'a BlendedEnsembles,
    ) -> Result<(Parts<'a>, OpacityKind, Vec<f64>), TransferError> {
        let context = Context::new(blended.series, blended.step, self.kind, self.lengths);
        let evaluator = |ensemble: &'a Ensemble| ensemble.evaluator(&context);
        let from = evaluator(&blended.ensemble)?;
        let toward = match &blended.toward {
            Some((next, share)) => Some((evaluator(next)?, *share)),
            None => None,
        };
        blended.all().try_for_each(Ensemble::check_scalars)?;
        let mut knots = from.knots();
        let mut kind = from.kind();
        if let Some((next, _)) = &toward {
            knots.extend(next.knots());
            // An ensemble that is transparent everywhere can be blended with either kind.
            if kind != next.kind() && blended.ensemble.curve(&context)?.is_transparent() {
                kind = next.kind();
            }
        }
        Ok((Parts::Ensembles { from, toward, colors: blended.colors }, kind, knots))
    }
}

impl Formula<'_> {
    /// The scalars at which it may have a step or a kink, sorted. Blended functions may have more of both in between.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// The colours alone as a table without extinction, also where the function is transparent. Intervals between knots are halved until
    /// colours in the middle and at the quarters are within half a tolerance; the table that is rendered omits invisible colours.
    ///
    /// # Errors
    /// If there are more nodes than a table has, or a node is invalid.
    pub fn colors(&self) -> Result<NodeTable, NodeTableError> {
        let node = |scalar: f64, rgb: [f64; 3]| Node { scalar, rgb: rgb.map(|c| c.clamp(0.0, 1.0)), tau: 0.0 };
        let at = |scalar: f64| self.eval(scalar).0;
        let mut nodes = Vec::new();
        for (number, &knot) in self.knots.iter().enumerate() {
            let below = at(knot.next_down());
            if let Some(&before) = number.checked_sub(1).and_then(|before| self.knots.get(before)) {
                halve((before, at(before)), (knot, below), HALVINGS, &at, &mut |scalar, rgb| {
                    nodes.push(node(scalar, rgb))
                });
            }
            nodes.push(node(knot, below));
            if at(knot) != below {
                nodes.push(node(knot, at(knot)));
            }
        }
        if nodes.is_empty() { NodeTable::new(vec![node(0.0, at(0.0))]) } else { NodeTable::new(nodes) }
    }

    /// Display-referred colour and extinction per world unit of length at a scalar; infinite where opacity is 1. At a step, those of
    /// its right side.
    pub fn eval(&self, scalar: f64) -> ([f64; 3], f64) {
        let side = self.side(scalar);
        (side.rgb, self.kind.depth(side.value) / self.unit_distance)
    }

    fn side(&self, scalar: f64) -> Side {
        match &self.parts {
            Parts::Function { range, map, function } => function.sides(Axis::new(range, map).position_of(scalar))[1],
            Parts::Ensembles { from, toward, colors } => {
                let at = |evaluator: &Evaluator| evaluator.eval_side(&Sample { scalar, gradient: 0.0, cov: 0.0 });
                match toward {
                    Some((next, share)) => mix_sides(&at(from), &at(next), *share, *colors),
                    None => at(from),
                }
            }
        }
    }
}

/// Most halvings of an interval between two knots.
const HALVINGS: u32 = 12;

/// Adds colours at midpoints between `a` and `b`, in ascending order, until linear interpolation fits.
fn halve(
    a: (f64, [f64; 3]),
    b: (f64, [f64; 3]),
    halvings: u32,
    at: &impl Fn(f64) -> [f64; 3],
    add: &mut impl FnMut(f64, [f64; 3]),
) {
    let place = |share: f64| a.0 + share * (b.0 - a.0);
    let off = |share: f64| {
        let found = at(place(share));
        (0..3).map(|c| (found[c] - (a.1[c] + share * (b.1[c] - a.1[c]))).abs()).fold(0.0, f64::max)
    };
    let is_between = a.0 < place(0.5) && place(0.5) < b.0;
    if halvings == 0 || !is_between || [0.25, 0.5, 0.75].into_iter().all(|share| off(share) <= 0.5 * COLOR_TOLERANCE) {
        return;
    }
    let middle = (place(0.5), at(place(0.5)));
    halve(a, middle, halvings - 1, at, add);
    add(middle.0, middle.1);
    halve(middle, b, halvings - 1, at, add);
}

#[cfg(test)]
#[path = "formula_tests.rs"]
mod tests;

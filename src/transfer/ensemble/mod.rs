//! [`Ensemble`]: several transfer functions, blended one after the other (dissertation 7.3).

mod evaluate;
mod joint;
mod places;
mod reduce;

pub use evaluate::{Context, Evaluator, Line, Sample};
pub use joint::joint_table;
pub use reduce::{Counts2d, Reduction};

use super::TransferError;
use super::blend::Blend;
use super::function::{OpacityValues, PositionKind, TransferFunction};
use super::opacity::OpacityKind;
use super::pieces::ColorWeighting;
use super::range::RangePolicy;
use super::range_map::RangeMap;
use super::widget::Widget;
use crate::short::Short;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

/// The quantities on which a member's function is defined. Axis positions are 0..=1: for the scalar over the member's range, for the others
/// over the histogram in which they are edited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Space {
    /// The scalar.
    #[default]
    Scalar,
    /// The coefficient of variation of a vertex over time.
    Cov,
    /// The scalar (x) and the magnitude of its gradient in a cell (y).
    ScalarGradient,
    /// The scalar (x) and the coefficient of variation (y).
    ScalarCov,
}

impl Space {
    /// Number of axes, 1 or 2.
    pub fn axes(self) -> usize {
        match self {
            Self::Scalar | Self::Cov => 1,
            Self::ScalarGradient | Self::ScalarCov => 2,
        }
    }
}

/// The source of a member's colours and opacities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Function {
    /// A colour map and opacity points, on one axis.
    TransferFunction(TransferFunction),
    /// Shapes over a histogram. Where several overlap, the one with the highest opacity holds, the later one of equal ones.
    Widgets(#[serde(deserialize_with = "widgets_as_data")] Vec<Widget>),
}

/// A transfer function in an [`Ensemble`], and how it is blended with those before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Member {
    /// Name given by the user.
    pub name: String,
    /// Whether the member is used.
    #[serde(default = "enabled")]
    pub enabled: bool,
    /// The quantities on which its function is defined.
    #[serde(default)]
    pub space: Space,
    /// Its colours and opacities.
    pub function: Function,
    /// The scalars that its axis covers.
    #[serde(default)]
    pub range: RangePolicy,
    /// How the first axis of its space is stretched.
    #[serde(default)]
    pub map: RangeMap,
    /// Its colours and opacities (or optical depths) are multiplied by this before they are blended, 0..=1.
    #[serde(default = "full_weight", deserialize_with = "weight_as_data")]
    pub weight: f64,
    /// How it is blended with the result of those before it; ignored for the first enabled member.
    #[serde(default)]
    pub blend: Blend,
    /// How it is reduced to the scalar, if its space has another axis.
    #[serde(default)]
    pub reduction: Reduction,
}

/// Transfer functions that are blended one after the other, beginning with the first. Without an enabled member the result is transparent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ensemble {
    /// Name given by the user.
    pub name: String,
    /// Whether colours are weighted by opacity while they are blended. One choice for all members: a weighted colour that
    /// is divided by its opacity and weighted again is no longer exact.
    #[serde(default)]
    pub colors: ColorWeighting,
    /// Members in the order of blending.
    #[serde(default)]
    pub members: Vec<Member>,
}

fn enabled() -> bool {
    true
}

fn full_weight() -> f64 {
    1.0
}

fn is_weight(weight: f64) -> bool {
    (0.0..=1.0).contains(&weight)
}

/// Rejects a weight outside 0..=1 while reading, where the error has a line number.
fn weight_as_data<'de, D: Deserializer<'de>>(data: D) -> Result<f64, D::Error> {
    let weight = f64::deserialize(data)?;
    let wrong = || D::Error::custom(format!("a weight of {}; it is a share, 0 to 1", Short(weight)));
    if is_weight(weight) { Ok(weight) } else { Err(wrong()) }
}

/// Rejects faulty widgets while reading, as [`weight_as_data`] does.
fn widgets_as_data<'de, D: Deserializer<'de>>(data: D) -> Result<Vec<Widget>, D::Error> {
    let widgets = Vec::<Widget>::deserialize(data)?;
    match widgets.iter().enumerate().find_map(|(i, widget)| Some((i, widget.problem()?))) {
        Some((i, problem)) => Err(D::Error::custom(format!("widget {i}: {problem}"))),
        None => Ok(widgets),
    }
}

impl Member {
    /// A member on the scalar with full weight, added to those before it.
    pub fn new(name: impl Into<String>, function: Function) -> Self {
        Self {
            name: name.into(),
            enabled: true,
            space: Space::default(),
            function,
            range: RangePolicy::default(),
            map: RangeMap::default(),
            weight: full_weight(),
            blend: Blend::default(),
            reduction: Reduction::default(),
        }
    }

    /// The member, or its fault in an ensemble of this opacity kind.
    fn checked(&self, kind: OpacityKind) -> Result<&Self, TransferError> {
        let axes = self.space.axes();
        if !is_weight(self.weight) {
            return self.bad("a weight is between 0 and 1");
        }
        match &self.function {
            _ if self.gives_extinction() && kind == OpacityKind::Alpha => {
                self.bad("gives extinctions and is blended with opacities; use the opacity kind 'extinction'")
            }
            Function::TransferFunction(_) if axes == 2 => self.bad("on two axes a member needs widgets"),
            Function::TransferFunction(tf) if self.space == Space::Cov && tf.positions() == PositionKind::Absolute => {
                self.bad("absolute positions are scalars; on the coefficient of variation give relative ones")
            }
            Function::Widgets(widgets) => {
                let problem = |w: &Widget| w.problem().or((!w.suits(axes)).then_some("has another number of axes"));
                match widgets.iter().enumerate().find_map(|(i, w)| Some((i, problem(w)?))) {
                    Some((i, problem)) => self.bad(&format!("widget {i}: {problem}")),
                    None => Ok(self),
                }
            }
            Function::TransferFunction(_) => Ok(self),
        }
    }

    /// Whether it can be blended with others in an ensemble of this opacity kind.
    fn check_blend(&self, kind: OpacityKind) -> Result<(), TransferError> {
        if self.blend == Blend::Xor8 && kind == OpacityKind::Extinction {
            return self.bad("xor8 works on levels 0..255 of opacity, which an extinction has not; use xor");
        }
        Ok(())
    }

    /// Whether its values are extinctions, whatever the opacity kind.
    fn gives_extinction(&self) -> bool {
        match &self.function {
            Function::TransferFunction(tf) => tf.values() == OpacityValues::Extinction,
            Function::Widgets(_) => false,
        }
    }

    fn bad<T>(&self, problem: &str) -> Result<T, TransferError> {
        Err(TransferError::BadMember { member: self.name.clone(), problem: problem.to_owned() })
    }
}

impl Ensemble {
    fn enabled_members(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().filter(|m| m.enabled)
    }

    /// Fails if a member is defined on more than the scalar.
    pub(super) fn check_scalars(&self) -> Result<(), TransferError> {
        match self.enabled_members().find(|member| member.space != Space::Scalar) {
            Some(member) => member.bad("is defined on more than the scalar"),
            None => Ok(()),
        }
    }

    /// The opacity kind of the result: `kind`, but extinction if all members give extinctions.
    fn kind(&self, kind: OpacityKind) -> OpacityKind {
        let mut members = self.enabled_members().peekable();
        if members.peek().is_some() && members.all(Member::gives_extinction) { OpacityKind::Extinction } else { kind }
    }
}

#[cfg(test)]
mod tests;

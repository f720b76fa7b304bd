//! How fields of functions are drawn: [`SheetStyle`], and the functions of a job, [`FunctionScene`]. The renderer is
//! [`cpu::functions`](super::cpu::functions), the judge is in [`reference`](mod@super::reference).

use super::surfaces::brightness;
use super::{RenderError, RenderJob};
use crate::camera::View;
use crate::field::Association;
use crate::functions::Kernels;
use crate::functions::coverage::Coverage;
use crate::short::Short;
use crate::words::words;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How far apart sheets are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum SheetSpacing {
    /// As far as this error of the scalar between two sheets allows, a share of the field's range; sheets are closer where the field
    /// changes more.
    Error(f64),
    /// This number of sheets through the whole mesh, evenly.
    Count(u32),
}

/// How functions are splatted onto sheets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SheetStyle {
    /// How far apart sheets are.
    pub spacing: SheetSpacing,
}

impl SheetStyle {
    /// Least and greatest error between sheets.
    pub const ERRORS: std::ops::RangeInclusive<f64> = 1e-7..=0.5;
    /// Largest number of sheets.
    pub const MOST_SHEETS: u32 = 1 << 16;

    /// Checks the spacing.
    ///
    /// # Errors
    /// If it is out of range; says what the range is.
    pub fn check(&self) -> Result<(), String> {
        match self.spacing {
            SheetSpacing::Error(error) if !Self::ERRORS.contains(&error) => {
                let (least, most) = Self::ERRORS.into_inner();
                let [error, least, most] = [error, least, most].map(Short);
                Err(format!("an error of {error} between sheets; it is a share of the range, from {least} to {most}"))
            }
            SheetSpacing::Count(count) if !(2..=Self::MOST_SHEETS).contains(&count) => {
                Err(format!("{count} sheets; from 2 to {} can be drawn", Self::MOST_SHEETS))
            }
            _ => Ok(()),
        }
    }
}

impl Default for SheetStyle {
    /// A thousandth of the range: not visible in transfer functions without steps.
    fn default() -> Self {
        Self { spacing: SheetSpacing::Error(1e-3) }
    }
}

/// Where a field of functions is: they reach beyond the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FunctionDomain {
    /// Inside the mesh.
    Mesh,
    /// In the box of the functions' centres, wherever one reaches.
    Box,
    /// Where functions are dense, fading out around ([`crate::functions::coverage`]).
    Coverage,
}

words!(FunctionDomain, "there is no domain", ["mesh" = Mesh, "box" = Box, "coverage" = Coverage]);

/// What the sum of values is divided by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Normalise {
    /// The sum of weights: f is the weighted mean.
    #[default]
    Sum,
    /// The sum of weights, or 1 if that is more (Neophytou and Mueller 2006, eq. 20): where functions are thin values fall towards zero, which
    /// need not be clear.
    Eq20,
}

words!(Normalise, "there is no way to normalise", ["sum" = Sum, "eq20" = Eq20]);

impl Normalise {
    /// The value of sums of v phi and of phi, the second above zero.
    #[inline(always)]
    pub(in crate::render) fn value(self, sum: f64, weights: f64) -> f64 {
        match self {
            Self::Sum => sum / weights,
            Self::Eq20 => sum / weights.max(1.0),
        }
    }

    /// Least and greatest value of a field of functions whose values are between these.
    pub(in crate::render) fn values(self, [least, most]: [f32; 2]) -> [f32; 2] {
        match self {
            Self::Sum => [least, most],
            // Values fall towards zero.
            Self::Eq20 => [least.min(0.0), most.max(0.0)],
        }
    }
}

/// What a field of functions is, beside its values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FunctionForm {
    /// Where it is; `None`: inside the mesh, or by coverage where points have no cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<FunctionDomain>,
    /// What the sum of values is divided by.
    #[serde(default)]
    pub normalise: Normalise,
}

impl FunctionForm {
    /// Whether nothing is chosen.
    pub(crate) fn is_usual(&self) -> bool {
        *self == Self::default()
    }
}

/// A [`FunctionDomain`] of some functions; local coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum FieldDomain {
    /// Inside the active cells.
    #[default]
    Cells,
    /// In a box, wherever a function reaches.
    Box([DVec3; 2]),
    /// By coverage; functions end in the box.
    Coverage(Coverage, [DVec3; 2]),
}

impl FieldDomain {
    /// The domain of some functions. Without one there is no field.
    pub fn of(domain: FunctionDomain, kernels: &Kernels) -> Self {
        let nowhere = [DVec3::ZERO; 2];
        match domain {
            FunctionDomain::Mesh => Self::Cells,
            FunctionDomain::Box => Self::Box(kernels.box_of_centers().unwrap_or(nowhere)),
            FunctionDomain::Coverage => {
                Self::Coverage(Coverage::of(kernels), kernels.box_of_reach().unwrap_or(nowhere))
            }
        }
    }

    /// The box that it is in; `None` inside of cells.
    pub(crate) fn within(&self) -> Option<[DVec3; 2]> {
        match self {
            Self::Cells => None,
            Self::Box(within) | Self::Coverage(_, within) => Some(*within),
        }
    }

    /// The coverage, if it is by that.
    pub(in crate::render) fn coverage(&self) -> Option<Coverage> {
        match self {
            Self::Cells | Self::Box(_) => None,
            Self::Coverage(coverage, _) => Some(*coverage),
        }
    }
}

/// The depths between which the ray of an image-plane point is in a box, in front of the near distance; `None` if it is not.
pub(in crate::render) fn depths_in_box(view: &View, (px, py): (f64, f64), [lo, hi]: [DVec3; 2]) -> Option<[f64; 2]> {
    let beside = px * view.right + py * view.up;
    let (origin, direction) =
        if view.perspective { (view.eye, view.forward + beside) } else { (view.eye + beside, view.forward) };
    let mut ends = [view.near_depth(), f64::INFINITY];
    for axis in 0..3 {
        let (from, along) = (origin[axis], direction[axis]);
        if along == 0.0 {
            if from < lo[axis] || from > hi[axis] {
                return None;
            }
            continue;
        }
        let [a, b] = [lo, hi].map(|side| (side[axis] - from) / along);
        ends = [ends[0].max(a.min(b)), ends[1].min(a.max(b))];
    }
    (ends[0] < ends[1]).then_some(ends)
}

/// Light on a field of functions, by its slope: as surfaces have it, but that it fades to none where the slope, through which no surface
/// passes that one could see, is small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeLight {
    /// Unit vector towards the light, world coordinates; `None`: from the eye.
    towards: Option<DVec3>,
    /// Slope from which on the light counts whole, value per local unit.
    whole_from: f64,
}

impl SlopeLight {
    /// The light counts whole where the field changes by this share of its range, or more, over the longest side of the box of centres.
    pub const WHOLE_FROM: f64 = 0.25;

    /// Light on a field with a range of this length, of functions with centres in this box, local coordinates. `towards`: unit vector towards
    /// the light, world coordinates, `None` from the eye.
    pub(crate) fn new(towards: Option<DVec3>, [lo, hi]: [DVec3; 2], range: f64) -> Self {
        let size = (hi - lo).max_element();
        Self { towards, whole_from: Self::WHOLE_FROM * range / size.max(f64::MIN_POSITIVE) }
    }

    /// What colours are multiplied by where the field has this gradient, per local unit, on a ray in this direction, of any length.
    pub(in crate::render) fn share(&self, gradient: DVec3, along: DVec3) -> f64 {
        let slope = gradient.length() / self.whole_from;
        if slope > 0.0 {
            let rising = slope.min(1.0);
            let whole = rising * rising * (3.0 - 2.0 * rising);
            1.0 + whole * (brightness(gradient, along, self.towards) - 1.0)
        } else {
            // Without a slope, or NaN of a field without a range.
            1.0
        }
    }
}

/// The functions of a job. The job's scalars are their values; its active cells are where the field is, unless its domain is another.
#[derive(Clone, Debug)]
pub struct FunctionScene {
    /// The functions, one per vertex of the job's mesh.
    pub kernels: Arc<Kernels>,
    /// How they are drawn.
    pub style: SheetStyle,
    /// Length of the field's range, to which errors are relative.
    pub range: f64,
    /// Where the field is.
    pub domain: FieldDomain,
    /// What the sum of values is divided by.
    pub normalise: Normalise,
    /// Light on it; `None`: it has its colours everywhere.
    pub light: Option<SlopeLight>,
}

impl FunctionScene {
    /// The functions of a job, checked.
    ///
    /// # Errors
    /// If there are none or not one per vertex, if the style is out of range, or if the job has what functions cannot be drawn with.
    pub(in crate::render) fn of_job(job: &RenderJob) -> Result<Self, RenderError> {
        let bad = |problem: &str| RenderError::BadFunctions(problem.to_owned());
        let functions = job.functions.clone().ok_or_else(|| bad("the job has none"))?;
        if functions.kernels.len() != job.mesh.positions.local.len() {
            let (count, vertices) = (functions.kernels.len(), job.mesh.positions.local.len());
            return Err(RenderError::BadFunctions(format!("{count} functions for {vertices} vertices")));
        }
        functions.style.check().map_err(RenderError::BadFunctions)?;
        if job.scalars.association() != Association::Point {
            return Err(bad("the values are of cells"));
        }
        if job.surfaces.is_some() || job.joint.is_some() {
            return Err(bad("surfaces, cuts, and transfer functions of more than the scalar need cells"));
        }
        if job.mesh.is_cloud() && functions.domain == FieldDomain::Cells {
            return Err(bad("points without cells have no mesh to be inside of"));
        }
        Ok(functions)
    }

    /// Normalised functions inside the mesh.
    pub fn new(kernels: Arc<Kernels>, style: SheetStyle, range: f64) -> Self {
        Self { kernels, style, range, domain: FieldDomain::default(), normalise: Normalise::default(), light: None }
    }
}

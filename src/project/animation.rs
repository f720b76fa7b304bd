//! [`Animation`]: a project evaluated at a time of a series.

use super::{Project, ProjectError};
use crate::histograms::{Histogram, Kind};
use crate::look::{Colors, Keyed};
use crate::moments::Distribution;
use crate::pipeline::{FrameTime, KeyedSurfaces, Series};
use crate::task::Cancel;
use crate::timeline::At;
use crate::transfer::{
    BlendedEnsembles, Context, Counts2d, Curve, Ensemble, Lengths, Member, OpacityKind, RangePolicy, Space,
    TransferContent, TransferError, TransferSource, joint_table,
};
use std::sync::Arc;

/// Evaluates a project over a series. Colours are recomputed only where something has changed.
pub struct Animation {
    project: Arc<Project>,
    series: Arc<Series>,
    kind: OpacityKind,
    lengths: Lengths,
    /// Histograms of the series, once a member needs them.
    histograms: Option<Arc<[Histogram]>>,
    last: Option<(Shown, Colors)>,
}

/// All inputs of a table.
#[derive(Clone, Debug, PartialEq)]
struct Shown {
    /// The ensemble, with its range maps at that time.
    ensemble: Ensemble,
    /// The ensemble that it blends into, and that one's weight.
    toward: Option<(Ensemble, f64)>,
    /// Smallest and largest scalar of the step, if a member asks for them.
    step: Option<(f64, f64)>,
}

impl Shown {
    fn ensembles(&self) -> impl Iterator<Item = &Ensemble> {
        std::iter::once(&self.ensemble).chain(self.toward.as_ref().map(|(ensemble, _)| ensemble))
    }
}

impl Animation {
    /// An animation of `project` over the field of a series, with the kind of opacities and the lengths of its tables.
    pub fn new(project: Arc<Project>, series: Arc<Series>, kind: OpacityKind, lengths: Lengths) -> Self {
        Self { project, series, kind, lengths, histograms: None, last: None }
    }

    /// The project.
    pub fn project(&self) -> &Arc<Project> {
        &self.project
    }

    /// Changes the kind of opacities and the lengths.
    pub fn set_opacities(&mut self, kind: OpacityKind, lengths: Lengths) {
        if (self.kind, self.lengths) != (kind, lengths) {
            (self.kind, self.lengths, self.last) = (kind, lengths, None);
        }
    }

    /// Replaces the project by another over the same field; data of the field stay.
    pub fn set_project(&mut self, project: Arc<Project>) {
        self.project = project;
        self.last = None;
    }

    /// The project's settings for the time `moment` of the series, at a time `at` of the timeline, in the unit of the series: mostly equal;
    /// `at` is later while a step is held. If the store has no histograms and a member needs them they are counted first, which takes as
    /// long as decoding every step; `cancel` ends that with an error.
    ///
    /// # Errors
    /// If an ensemble cannot be evaluated over the field, or the cameras interpolate to an invalid view.
    pub fn at(&mut self, moment: FrameTime, at: f64, cancel: &Cancel) -> Result<Keyed, ProjectError> {
        let timeline = &self.project.timeline;
        let camera = timeline.camera(at).transpose();
        let camera = camera.map_err(|problem| ProjectError::Camera { time: at, problem })?;
        let lod = timeline.lod.number(at);
        let [isovalue, opacity, cut] =
            [&timeline.isovalue, &timeline.iso_opacity, &timeline.cut].map(|track| track.number(at));
        let surfaces = KeyedSurfaces { isovalue, opacity, cut };
        let (optics, flow_opacity) = (timeline.optics(at), timeline.flow.number(at));
        let colors = self.colors(moment, at, cancel)?;
        Ok(Keyed { colors, camera, lod, surfaces, flow_opacity, optics })
    }

    fn colors(&mut self, moment: FrameTime, at: f64, cancel: &Cancel) -> Result<Option<Colors>, ProjectError> {
        let field = self.series.field();
        let (of_series, of_step) = moment.scalar_ranges(field);
        let of_percentiles = |member: &Member| member.enabled && member.range.has_percentiles();
        let values = match self.project.ensembles.iter().flat_map(|ensemble| &ensemble.members).any(of_percentiles) {
            true => self.series.distribution(cancel)?,
            false => None,
        };
        let Some(shown) = self.shown(at, of_step, values.as_deref()) else { return Ok(None) };
        if let Some((last, colors)) = &self.last
            && *last == shown
        {
            return Ok(Some(colors.clone()));
        }
        if self.histograms.is_none() && shown.ensembles().any(needs_histograms) {
            self.histograms = self.series.histograms(cancel)?;
        }
        let context = Context {
            scalar_gradient: self.counts(&Kind::SCALAR_GRADIENT),
            scalar_cov: self.counts(&Kind::SCALAR_COV),
            ..Context::new(of_series, of_step, self.kind, self.lengths)
        };
        let colors = self.blended(&shown, &context).map_err(|problem| {
            let names: Vec<&str> = shown.ensembles().map(|ensemble| ensemble.name.as_str()).collect();
            ProjectError::Ensemble { ensemble: names.join("' and '"), problem: Box::new(problem) }
        })?;
        self.last = Some((shown, colors.clone()));
        Ok(Some(colors))
    }

    /// Joint histogram of a kind; `None` if not known.
    fn counts(&self, kind: &Kind<'_>) -> Option<&dyn Counts2d> {
        let at = Kind::ALL.iter().position(|other| other.name() == kind.name())?;
        self.histograms.as_ref()?.get(at)?.two().map(|counts| counts as &dyn Counts2d)
    }

    fn blended(&self, shown: &Shown, context: &Context) -> Result<Colors, TransferError> {
        let mixed_by = self.project.timeline.colors;
        let mix = |curve: &dyn Fn(&Ensemble) -> Result<Curve, TransferError>| match &shown.toward {
            Some((next, weight)) => Curve::mix(&curve(&shown.ensemble)?, &curve(next)?, *weight, mixed_by),
            None => curve(&shown.ensemble),
        };
        if !shown.ensembles().any(Ensemble::keeps_axes) {
            let table = mix(&|ensemble| ensemble.curve(context))?.node_table(&self.lengths)?;
            let blended = BlendedEnsembles {
                ensemble: shown.ensemble.clone(),
                toward: shown.toward.clone(),
                colors: mixed_by,
                series: context.series,
                step: context.step,
            };
            let formula = blended.is_of_scalars().then(|| {
                let content = TransferContent::Ensembles(Box::new(blended));
                Arc::new(TransferSource { content, kind: self.kind, lengths: self.lengths })
            });
            return Ok(Colors { table: Arc::new(table).into(), formula });
        }
        let ensembles: Vec<&Ensemble> = shown.ensembles().collect();
        let table = joint_table(&ensembles, context, |line| mix(&|ensemble| ensemble.curve_on(context, line)))?;
        Ok(Colors { table: Arc::new(table).into(), formula: None })
    }

    /// Inputs of the table at a time; `None` if the project has no ensemble.
    fn shown(&self, at: f64, of_step: (f64, f64), values: Option<&Distribution>) -> Option<Shown> {
        let project = &self.project;
        let named = |name: &String| project.ensemble(name);
        let (ensemble, toward) = match project.timeline.ensembles.at(at) {
            None => (project.shown_without_keys()?, None),
            Some(At::One(name)) => (named(name)?, None),
            Some(At::Between { a, b, weight }) => (named(a)?, Some((named(b)?, weight))),
        };
        let toward = toward.map(|(ensemble, weight)| (self.with_maps(ensemble, at, values), weight));
        let mut shown = Shown { ensemble: self.with_maps(ensemble, at, values), toward, step: None };
        let follows_step = |ensemble: &Ensemble| {
            ensemble.members.iter().any(|member| member.enabled && member.range == RangePolicy::Step)
        };
        if shown.ensembles().any(follows_step) {
            shown.step = Some(of_step);
        }
        Some(shown)
    }

    /// An ensemble with the range maps that its members have at a time, and scalars in place of percentiles.
    fn with_maps(&self, ensemble: &Ensemble, at: f64, values: Option<&Distribution>) -> Ensemble {
        let mut ensemble = ensemble.clone();
        if let Some(values) = values {
            ensemble.members.iter_mut().for_each(|member| member.range = member.range.settled(values));
        }
        for track in self.project.timeline.maps.iter().filter(|track| track.ensemble == ensemble.name) {
            // A track without keys changes nothing.
            let Some(map) = track.keys.map(at) else { continue };
            for member in ensemble.members.iter_mut().filter(|member| member.name == track.member) {
                member.map.clone_from(&map);
            }
        }
        ensemble
    }
}

/// Whether a member is defined on more than the scalar.
fn needs_histograms(ensemble: &Ensemble) -> bool {
    ensemble.members.iter().any(|member| member.enabled && member.space != Space::Scalar)
}

#[cfg(test)]
#[path = "animation_tests.rs"]
mod tests;

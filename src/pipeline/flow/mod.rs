//! Layers of flow: their vectors at a time, the way that these have travelled, and their fragments in a view.

mod decode;
#[cfg(test)]
#[cfg(feature = "gpu")]
mod gpu_tests;
mod order;
mod travel;

pub(super) use decode::{DecodeFlow, FlowValues};
pub(super) use order::{FlowBy, OrderFlow};

use super::distribution::speeds;
use super::series::Series;
use super::{ColorsBeside, PipelineError, RequestError};
use crate::field::{Association, Component, FieldSelector};
use crate::render::flow::{self, FlowIcons, FlowStyle, FlowVolume, Pattern, Thresholds};
use crate::store::{StoredField, StoredTravel};
use crate::task::Cancel;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A field of vectors as textured splats ([`crate::render::flow`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlowLayer {
    /// Name of the field, which has three components.
    pub field: String,
    /// How its splats look.
    pub style: FlowStyle,
    /// Icons in place of the style's: the user's, or several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub icons: Option<FlowIcons>,
    /// The field and colour table that colour them; `None`: [`FlowStyle::COLOR`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colors: Option<ColorsBeside>,
    /// The time for which the flow of the frame's moment has gone on, in the series' unit: patterns drift while the moment is held.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub held: f64,
    /// The time over which patterns are averaged, in the series' unit: that until the next frame, while the moment is held or the series
    /// plays. What is too fast for the frame rate is then blurred, and does not seem to run backwards.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub shutter: f64,
}

fn is_zero(time: &f64) -> bool {
    *time == 0.0
}

impl FlowLayer {
    /// The flow of a field.
    pub fn new(field: String, style: FlowStyle) -> Self {
        Self { field, style, icons: None, colors: None, held: 0.0, shutter: 0.0 }
    }

    /// Whether something of it may be seen: its icons have an opacity, or its splats show the scalars.
    pub fn is_seen(&self) -> bool {
        self.style.opacity > 0.0 || self.style.volume == FlowVolume::Splats
    }

    /// Whether both look the same but for their shutters, which change with the frames around.
    pub(super) fn looks_like(&self, other: &Self) -> bool {
        let Self { field, style, icons, colors, held, shutter: _ } = self;
        (field, style, icons, colors, held) == (&other.field, &other.style, &other.icons, &other.colors, &other.held)
    }

    /// Why it cannot be drawn, whatever the series holds.
    pub(super) fn check_style(&self) -> Result<(), String> {
        self.style.check()?;
        self.icons.as_ref().map_or(Ok(()), FlowIcons::check)?;
        for (name, time) in [("is held for a time", self.held), ("has a shutter", self.shutter)] {
            if !(time >= 0.0 && time.is_finite()) {
                return Err(format!("flow {name} of {time}; it must be zero or above"));
            }
        }
        Ok(())
    }

    /// The layer with icons in place of its style's, chosen by a field, or by the length of its vectors. Cross-fades are a share of the range of
    /// that field over the series, of lengths over some steps of it.
    ///
    /// # Errors
    /// If thresholds do not ascend, there is no such field beside the vectors, it has no finite value, or the vectors cannot be read, or
    /// `Cancelled`.
    pub fn with_icons(
        self,
        series: &Series,
        icons: Thresholds<Pattern>,
        by: Option<&FieldSelector>,
        cancel: &Cancel,
    ) -> Result<Self, PipelineError> {
        icons.check().map_err(RequestError::Flow)?;
        let range = match by {
            // There is nothing to choose.
            _ if icons.further.is_empty() => [0.0; 2],
            Some(field) => {
                let [vectors, ..] = vector_components(series, &self.field)?;
                let range = beside(series, field, &vectors)?.field().range.map(|range| range.map(f64::from));
                range.ok_or_else(|| {
                    RequestError::Flow(format!("'{field}' has no finite value; choose icons by another field"))
                })?
            }
            None => {
                let speeds =
                    speeds(&vector_components(series, &self.field)?, cancel)?.ok_or(PipelineError::Cancelled)?;
                [0.0, 1.0].map(|share| speeds.value_at(share).map_or(0.0, f64::from))
            }
        };
        let icons = FlowIcons::new(icons, by.map(ToString::to_string), range);
        Ok(Self { icons: Some(icons), ..self })
    }

    /// All fields that it reads: components of its vectors, and those of its colours and icons.
    pub fn fields(&self) -> Vec<FieldSelector> {
        let colors = self.colors.as_ref().map(|of| &of.field);
        let icons = self.icons.as_ref().and_then(|of| of.by.as_ref());
        let beside = colors.into_iter().chain(icons).map(|name| selector(name));
        [0, 1, 2].map(|index| component(&self.field, index)).into_iter().chain(beside).collect()
    }

    /// What is usual for its vectors; `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If the series has no such vectors, or none of them can be read.
    pub fn measure(&self, series: &Series, cancel: &Cancel) -> Result<Option<FlowMeasure>, PipelineError> {
        let components = vector_components(series, &self.field)?;
        let Some(speeds) = speeds(&components, cancel)? else { return Ok(None) };
        let speed =
            [0.9, 1.0].map(|share| speeds.value_at(share).map_or(0.0, f64::from)).into_iter().find(|&v| v > 0.0);
        let period = flow::usual_period(&series.mesh, components[0].values_of()) * series.mesh.positions.scale;
        Ok(Some(FlowMeasure { speed: speed.unwrap_or(0.0), period }))
    }

    /// The ways of its vectors that the store of a series has; `None` if that has no such vectors, or keeps none.
    pub(crate) fn travel(&self, series: &Series) -> Option<StoredTravel> {
        decode::stored_travel(&vector_components(series, &self.field).ok()?)
    }

    /// Why a series cannot show it.
    ///
    /// # Errors
    /// If the series has no such vectors, or no cells around them, or what has the colours' scalars does not have them.
    pub fn check(&self, series: &Series) -> Result<(), RequestError> {
        let [vectors, ..] = vector_components(series, &self.field)?;
        let colors = self.colors.as_ref();
        colors.map_or(Ok(()), |ColorsBeside { field, .. }| beside(series, &selector(field), &vectors).map(drop))
    }
}

/// What is usual for a field of vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowMeasure {
    /// The length below which vectors are in nine tenths of the volume, over some steps of the series; the greatest one if that is 0.
    speed: f64,
    /// World length of a period of the pattern where a style has none.
    period: f64,
}

impl FlowMeasure {
    /// World length of a period of the pattern.
    pub fn period(&self, style: &FlowStyle) -> f64 {
        style.length.unwrap_or(self.period)
    }

    /// The time of the series a second with which the flow of a held moment goes on, if none is chosen: nine tenths of the volume move by
    /// less than a quarter of a period from one of `fps` frames a second to the next. 1 where nothing flows.
    pub fn rate(&self, style: &FlowStyle, fps: f64) -> f64 {
        let rate = flow::FOLLOWED * self.period(style) * fps / (self.speed * style.speed);
        if rate.is_finite() { rate } else { 1.0 }
    }
}

/// The fields of a store that flow can show, in its order: with three components.
pub fn vector_fields(fields: &[StoredField]) -> Vec<&str> {
    let has = |name: &str, component| fields.iter().any(|field| field.name == format!("{name}:{component}"));
    let names = fields.iter().filter_map(|field| field.name.strip_suffix(":0"));
    names.filter(|name| has(name, 1) && has(name, 2) && !has(name, 3)).collect()
}

/// The field that options name so.
fn selector(name: &str) -> FieldSelector {
    let Ok(field) = name.parse();
    field
}

/// A component of a field of vectors.
fn component(field: &str, index: usize) -> FieldSelector {
    FieldSelector { name: field.to_owned(), component: Some(Component::Index(index)) }
}

/// Another field of a series, with values of what has the vectors.
fn beside(series: &Series, field: &FieldSelector, vectors: &Series) -> Result<Arc<Series>, RequestError> {
    let other = series.beside(field).map_err(|error| RequestError::NoFieldBeside(format!("'{field}': {error}")))?;
    if other.values_of() == vectors.values_of() {
        return Ok(other);
    }
    let word = |of: &Series| if of.values_of() == Association::Point { "vertices" } else { "cells" };
    let (of, needed) = (word(&other), word(vectors));
    Err(RequestError::Flow(format!(
        "'{field}' has values of {of}, and the vectors of {needed}; choose a field of {needed} for the flow"
    )))
}

/// The components of a field of vectors, with cells around.
pub(crate) fn vector_components(series: &Series, field: &str) -> Result<[Arc<Series>; 3], RequestError> {
    if series.mesh.is_cloud() {
        let problem = "splats are as wide as the cells around, and the series is of points alone; leave flow out";
        return Err(RequestError::Flow(problem.to_owned()));
    }
    let component = |index| series.beside(&component(field, index));
    let none = |error| {
        RequestError::Flow(format!(
            "'{field}' is no field of vectors with three components: {error}; choose one that the source has as a vector, whose components are imported unless --field names others"
        ))
    };
    let found = [component(0).map_err(none)?, component(1).map_err(none)?, component(2).map_err(none)?];
    if found.iter().any(|of| of.values_of() != found[0].values_of()) {
        let problem =
            "some components have values of vertices, and others of cells; choose one whose components are alike";
        return Err(RequestError::Flow(format!("'{field}' is no field of vectors: {problem}")));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::{IngestOptions, ingest};
    use crate::render::flow::{Icon, Picture};
    use crate::store::Store;
    use crate::synth::{SeriesName, SynthSpec, generate};
    use crate::task::Silent;

    #[test]
    fn usual_speeds_are_those_of_the_components_whether_their_lengths_are_stored_or_not() {
        let folder = tempfile::tempdir().unwrap();
        let tornado = generate(&SynthSpec { cells: 600, steps: 3, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
        let all = ["pressure", "velocity"].as_slice();
        let measures = [all, &["velocity:0", "velocity:1", "velocity:2"]].map(|fields| {
            let path = folder.path().join(format!("{}.zarr", fields.len()));
            let fields = fields.iter().map(|name| name.parse().unwrap()).collect();
            let options = IngestOptions { fields, ..IngestOptions::default() };
            ingest(&tornado, &path, &options, &Silent, &Cancel::new()).unwrap();
            let store = Store::open(&path).unwrap();
            assert_eq!(vector_fields(store.fields()), ["velocity"]);
            let series = Series::open(&store, None).unwrap();
            let layer = FlowLayer::new("velocity".to_owned(), FlowStyle::default());
            let stored = series.beside(&"velocity:mag".parse().unwrap()).ok();
            let stored = stored.map(|of| of.distribution(&Cancel::new()).unwrap().unwrap().value_at(0.9).unwrap());
            (layer.measure(&series, &Cancel::new()).unwrap().unwrap(), stored)
        });
        let [(measure, stored), (of_components, none)] = measures;
        assert_eq!((measure, none), (of_components, None));
        // Both are lengths rounded to f32 once.
        let stored = f64::from(stored.unwrap());
        assert!((measure.speed / stored - 1.0).abs() <= f64::from(f32::EPSILON), "{} {stored}", measure.speed);
        let style = FlowStyle { speed: 2.0, length: Some(3.0), ..FlowStyle::default() };
        // At this rate a vector of that length moves a quarter of a period from frame to frame.
        assert!((2.0 * measure.speed * measure.rate(&style, 25.0) / 25.0 / 3.0 - 0.25).abs() < 1e-12);
        let still = FlowMeasure { speed: 0.0, ..measure };
        assert_eq!(still.rate(&style, 25.0), 1.0);
    }

    #[test]
    fn cross_fades_are_a_share_of_a_range_over_the_series_and_a_request_has_the_icons_themselves() {
        let folder = tempfile::tempdir().unwrap();
        let tornado = generate(&SynthSpec { cells: 600, steps: 3, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
        let path = folder.path().join("t.zarr");
        ingest(&tornado, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        let series = Series::open(&Store::open(&path).unwrap(), Some(&selector("pressure"))).unwrap();
        let row = |wide| (0..64).map(|at| if at % 32 < wide { 60_000 } else { 9 }).collect::<Vec<u16>>();
        let picture = |wide| Pattern::Picture(Arc::new(Picture::try_from(vec![row(wide); 64]).unwrap()));
        let icons = |wide| Thresholds { first: picture(wide), further: vec![(1.0, Pattern::Icon(Icon::Arrows))] };
        let layer = FlowLayer::new("velocity".to_owned(), FlowStyle::default());
        let by = |field: Option<&str>| {
            layer.clone().with_icons(&series, icons(5), field.map(selector).as_ref(), &Cancel::new())
        };
        let fade = |layer: &FlowLayer| layer.icons.as_ref().unwrap().fade;
        let width = |series: &Series| {
            let [least, greatest] = series.field().range.unwrap().map(f64::from);
            0.02 * (greatest - least)
        };
        let [by_pressure, by_speed] = [by(Some("pressure")), by(None)].map(Result::unwrap);
        assert_eq!(fade(&by_pressure), width(&series));
        // All values of so short a series are sampled; lengths are rounded to f32 once.
        let lengths = width(&series.beside(&selector("velocity:mag")).unwrap());
        assert!((fade(&by_speed) / lengths - 1.0).abs() < 1e-6, "{} {lengths}", fade(&by_speed));
        assert!(by(Some("wind")).unwrap_err().to_string().contains("'wind'"));
        let fields = ["velocity:0", "velocity:1", "velocity:2", "pressure"].map(selector);
        assert_eq!((by_pressure.fields(), by_speed.fields()), (fields.to_vec(), fields[..3].to_vec()));
        let text = |layer: &FlowLayer| serde_json::to_string(layer).unwrap();
        assert_eq!(serde_json::from_str::<FlowLayer>(&text(&by_pressure)).unwrap(), by_pressure);
        let other = layer.clone().with_icons(&series, icons(6), Some(&selector("pressure")), &Cancel::new()).unwrap();
        assert!(other != by_pressure && text(&other) != text(&by_pressure));
        let bad = FlowIcons { fade: -1.0, ..other.icons.unwrap() };
        assert!(FlowLayer { icons: Some(bad), ..layer }.check_style().unwrap_err().contains("cross-faded"));
    }
}

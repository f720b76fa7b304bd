//! Layers of flow: their vectors at a time, the way that these have travelled, and their fragments in a view.

use super::distribution::speeds;
use super::series::Series;
use super::steps::{StepCache, StepCaches};
use super::travel::{Speeds, Travel};
use super::{ColorsBeside, FrameTime, PipelineError, RequestError, TetLayer};
use crate::camera::View;
use crate::field::{Association, Component, FieldSelector, Scalars};
use crate::mesh::{Mesh, Plane};
use crate::node_table::NodeTable;
use crate::render::LayerFragments;
use crate::render::flow::{
    self, FlowColors, FlowIcons, FlowScene, FlowStyle, FlowVolume, HeldFlow, Kernels, Mixture, Pattern, Shapes,
    Thresholds,
};
use crate::render::reference::flow_fragments;
use crate::render::surfaces::FieldBeside;
use crate::stats::FrameStats;
use crate::store::{StoredField, StoredTravel};
use crate::task::Cancel;
use crate::visibility::CellSet;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Weak};
use std::time::Instant;

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
    /// The time over which patterns are averaged, in the series' unit: that until the next frame, while the moment is held. What is too fast
    /// for the frame rate is then blurred, and does not seem to run backwards.
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

/// What a layer of flow shows at a time.
#[derive(Clone, Debug)]
pub(super) struct FlowValues {
    style: FlowStyle,
    held: HeldFlow,
    sites: Association,
    vectors: [Arc<Vec<f32>>; 3],
    travel: Arc<Vec<f64>>,
    mixture: Option<Mixture>,
    colors: FlowColors,
}

impl FlowValues {
    /// Refuses kernels without a scalar at each site, or without colours of their own.
    pub(super) fn check_volume(&self, series: &Series, layer: &TetLayer) -> Result<(), RequestError> {
        if self.style.volume != FlowVolume::Splats {
            return Ok(());
        }
        let refused = |problem: &str| Err(RequestError::Flow(format!("{problem}; choose the volume 'exact'")));
        if series.values_of() != self.sites {
            return refused(
                "splats can be the volume only where vectors and scalars are both of vertices or both of cells",
            );
        }
        if layer.table.joint().is_some() {
            return refused("splats cannot be the volume with a transfer function of more than the scalar");
        }
        Ok(())
    }
}

/// The first stage of flow: decodes.
#[derive(Debug, Default)]
pub(super) struct DecodeFlow {
    /// Field of `components` and `travel`.
    field: String,
    of: Weak<Mesh>,
    components: [StepCache; 3],
    /// The series of the first component of `travel`.
    travel_of: Weak<Series>,
    travel: Travel,
    beside: StepCaches,
}

impl DecodeFlow {
    /// The values of a layer at a time; `None` if it is transparent, of which nothing is decoded.
    ///
    /// # Errors
    /// If the series has no such vectors, or no such colours beside them, or they cannot be read, or `Cancelled`.
    pub(super) fn run(
        &mut self,
        series: &Arc<Series>,
        layer: &FlowLayer,
        time: FrameTime,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<Option<FlowValues>, PipelineError> {
        if !layer.is_seen() {
            return Ok(layer.check(series).map(|()| None)?);
        }
        self.turn_to(series, layer);
        let fields = vector_components(series, &layer.field)?;
        if self.travel_of.as_ptr() != Arc::as_ptr(&fields[0]) {
            self.travel.turn_to(stored_travel(&fields));
            self.travel_of = Arc::downgrade(&fields[0]);
        }
        let sites = fields[0].values_of();
        let of_beside = [layer.colors.as_ref().map(|of| &of.field), layer.icons.as_ref().and_then(|of| of.by.as_ref())];
        self.beside.keep(|field| of_beside.into_iter().flatten().any(|of| of == field));
        let colors = self.colors(series, (layer, &fields[0]), time, cancel, stats)?;
        let mixture = self.mixture(series, (layer, &fields[0]), time, cancel, stats)?;
        let Self { components, travel, .. } = self;
        let mut vectors = |time: FrameTime| vectors(components, &fields, time, cancel, stats);
        let mut speeds = |step: usize| Ok::<_, PipelineError>(vectors(step.into())?.map(|vectors| speeds_of(&vectors)));
        let way = travel.at(&series.times, time, &mut speeds);
        // Sums that were made before it was cancelled, too.
        travel.keep();
        let travel = way?.ok_or(PipelineError::Cancelled)?;
        let vectors = vectors(time)?.ok_or(PipelineError::Cancelled)?;
        stats.flow_still = is_still(&vectors);
        let held = HeldFlow { time: layer.held, shutter: layer.shutter };
        Ok(Some(FlowValues { style: layer.style, held, sites, vectors, travel, mixture, colors }))
    }

    /// The vector at a point of a cell: linear between its vertices, NaN where one of them is, or that of the cell.
    ///
    /// # Errors
    /// As [`Self::run`], and if there is no such cell.
    pub(super) fn vector(
        &mut self,
        series: &Arc<Series>,
        layer: &FlowLayer,
        time: FrameTime,
        (cell, weights): (u32, [f64; 4]),
        cancel: &Cancel,
    ) -> Result<DVec3, PipelineError> {
        self.turn_to(series, layer);
        let fields = vector_components(series, &layer.field)?;
        let found = vectors(&mut self.components, &fields, time, cancel, &mut FrameStats::default())?;
        let vectors = found.ok_or(PipelineError::Cancelled)?;
        let no_cell = || RequestError::Flow(format!("there is no cell {cell}"));
        let [x, y, z] = vectors.map(|of| fields[0].value_at(&of, cell, weights));
        Ok(DVec3::new(x.ok_or_else(no_cell)?, y.ok_or_else(no_cell)?, z.ok_or_else(no_cell)?))
    }

    /// Forgets what is of another mesh or field.
    fn turn_to(&mut self, series: &Series, layer: &FlowLayer) {
        if self.of.as_ptr() != Arc::as_ptr(&series.mesh) || self.field != layer.field {
            *self = Self { field: layer.field.clone(), of: Arc::downgrade(&series.mesh), ..Self::default() };
        }
    }

    fn colors(
        &mut self,
        series: &Series,
        (layer, vectors): (&FlowLayer, &Series),
        time: FrameTime,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<FlowColors, PipelineError> {
        let Some(ColorsBeside { field, colors }) = &layer.colors else { return Ok(FlowColors::One(FlowStyle::COLOR)) };
        let scalars = self.scalars(series, (field, vectors), time, cancel, stats)?;
        Ok(FlowColors::Of(FieldBeside { scalars, colors: colors.clone() }))
    }

    fn mixture(
        &mut self,
        series: &Series,
        (layer, vectors): (&FlowLayer, &Series),
        time: FrameTime,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<Option<Mixture>, PipelineError> {
        let Some(icons) = &layer.icons else { return Ok(None) };
        let mut values = |field: &String| self.scalars(series, (field, vectors), time, cancel, stats);
        let values = icons.by.as_ref().map(&mut values).transpose()?;
        Ok(Some(Mixture { icons: icons.clone(), values }))
    }

    /// The values of another field at a time, of what has the vectors.
    fn scalars(
        &mut self,
        series: &Series,
        (field, vectors): (&str, &Series),
        time: FrameTime,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<Scalars, PipelineError> {
        let other = beside(series, &selector(field), vectors)?;
        let values = self.beside.of(field).show(&other, time, None, cancel, stats)?.ok_or(PipelineError::Cancelled)?;
        Ok(other.scalars(values))
    }
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

/// The components of vectors at a time, decoded by these; `None` if `cancel` was raised.
fn vectors(
    components: &mut [StepCache; 3],
    fields: &[Arc<Series>; 3],
    time: FrameTime,
    cancel: &Cancel,
    stats: &mut FrameStats,
) -> Result<Option<[Arc<Vec<f32>>; 3]>, PipelineError> {
    let mut found = [const { None }; 3];
    for ((found, steps), field) in found.iter_mut().zip(components).zip(fields) {
        *found = steps.show(field, time, None, cancel, stats)?;
    }
    let [Some(x), Some(y), Some(z)] = found else { return Ok(None) };
    Ok(Some([x, y, z]))
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

/// Whether all vectors are 0, or not finite.
fn is_still([x, y, z]: &[Arc<Vec<f32>>; 3]) -> bool {
    let flows = |vector: [f32; 3]| vector.iter().all(|c| c.is_finite()) && vector.iter().any(|c| *c != 0.0);
    !x.iter().zip(&**y).zip(&**z).any(|((x, y), z)| flows([*x, *y, *z]))
}

/// The ways of vectors that their store has; `None` if they are of no store that keeps any.
fn stored_travel(components: &[Arc<Series>; 3]) -> Option<StoredTravel> {
    let [x, y, z] = components.each_ref().map(|of| of.source.reader());
    StoredTravel::of([x?, y?, z?], &components[0].times)
}

/// The lengths of vectors; 0 where they are not finite.
fn speeds_of([x, y, z]: &[Arc<Vec<f32>>; 3]) -> Speeds {
    let length = |((x, y), z): ((&f32, &f32), &f32)| {
        let length = [x, y, z].iter().map(|&&c| f64::from(c).powi(2)).sum::<f64>().sqrt();
        if length.is_finite() { length } else { 0.0 }
    };
    Arc::new(x.iter().zip(&**y).zip(&**z).map(length).collect())
}

/// The second stage of flow: fragments, and what they are found by from request to request.
#[derive(Debug, Default)]
pub(super) struct OrderFlow {
    of: Weak<Mesh>,
    sites: Option<Association>,
    shapes: Option<Arc<Shapes>>,
    chosen: Option<(u32, Arc<Vec<u32>>)>,
    /// The volumes that splats stand for, for a number of them.
    volumes: Option<(Option<u32>, Arc<Vec<f64>>)>,
    cells: Weak<CellSet>,
    shown: Arc<Vec<bool>>,
}

impl OrderFlow {
    /// The fragments of a view, by the judge if the frame is the judge's. Splats are in the cells that are shown, or at their vertices.
    ///
    /// # Errors
    /// If they are too many.
    pub(super) fn fragments(
        &mut self,
        values: FlowValues,
        (mesh, cells): (&Arc<Mesh>, &Arc<CellSet>),
        (scalars, table): (&Scalars, &Arc<NodeTable>),
        clips: &[Plane],
        (local_view, is_judged): (&View, bool),
        stats: &mut FrameStats,
    ) -> Result<LayerFragments, PipelineError> {
        let started = Instant::now();
        let FlowValues { style, held, sites, vectors, travel, mixture, colors } = values;
        if self.of.as_ptr() != Arc::as_ptr(mesh) || self.sites != Some(sites) {
            *self = Self { of: Arc::downgrade(mesh), sites: Some(sites), ..Self::default() };
        }
        if self.cells.as_ptr() != Arc::as_ptr(cells) {
            self.shown = Arc::new(shown(mesh, sites, cells));
            self.cells = Arc::downgrade(cells);
        }
        let shapes = self.shapes.get_or_insert_with(|| Arc::new(Shapes::of(mesh, sites))).clone();
        let chosen = style.splats.map(|count| match self.chosen.take() {
            Some((of, chosen)) if of == count => (count, chosen),
            _ => (count, Arc::new(flow::chosen(mesh, sites, count))),
        });
        self.chosen.clone_from(&chosen);
        let kernels = (style.volume == FlowVolume::Splats).then(|| {
            let (count, volumes) =
                self.volumes.take().filter(|(count, _)| *count == style.splats).unwrap_or_else(|| {
                    (
                        style.splats,
                        Arc::new(flow::volumes_of_splats(mesh, sites, style.splats.map(|count| count as usize))),
                    )
                });
            self.volumes = Some((count, volumes.clone()));
            Kernels { scalars: scalars.clone(), table: table.clone(), volumes }
        });
        let scene = FlowScene {
            style,
            mixture,
            mesh: mesh.clone(),
            vectors,
            travel,
            held,
            colors,
            kernels,
            shapes,
            shown: self.shown.clone(),
            chosen: chosen.map(|(_, chosen)| chosen),
            clips: clips.to_vec(),
        };
        let (fragments, counts) =
            if is_judged { flow_fragments(&scene, local_view)? } else { scene.fragments(local_view)? };
        (stats.flow_splats, stats.flow_fast) = (counts.splats, counts.fast);
        stats.flow_fragments = fragments.count() as u64;
        stats.ms_flow = started.elapsed().as_secs_f64() * 1e3;
        Ok(fragments)
    }
}

/// Whether each site is a cell of a set, or a vertex of one.
fn shown(mesh: &Mesh, sites: Association, cells: &CellSet) -> Vec<bool> {
    if sites == Association::Cell {
        return (0..mesh.topology.tets.len() as u32).map(|cell| cells.contains(cell)).collect();
    }
    let mut shown = vec![false; mesh.positions.local.len()];
    for (_, tet) in mesh.topology.tets.iter().enumerate().filter(|(cell, _)| cells.contains(*cell as u32)) {
        tet.iter().for_each(|&vertex| shown[vertex as usize] = true);
    }
    shown
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

//! Layers of flow: their vectors at a time, the way that these have travelled, and their fragments in a view.

use super::distribution::speeds;
use super::series::Series;
use super::steps::{StepCache, StepCaches};
use super::travel::{Speeds, Travel};
use super::{ColorsBeside, FrameTime, PipelineError, RequestError};
use crate::camera::View;
use crate::field::{Association, Component, FieldSelector};
use crate::mesh::{Mesh, Plane};
use crate::render::LayerFragments;
use crate::render::flow::{self, FlowColors, FlowScene, FlowStyle, HeldFlow, Shapes};
use crate::render::probe::interpolate;
use crate::render::reference::flow_fragments;
use crate::render::surfaces::FieldBeside;
use crate::stats::FrameStats;
use crate::store::StoredField;
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
        Self { field, style, colors: None, held: 0.0, shutter: 0.0 }
    }

    /// Whether it has an opacity.
    pub fn is_seen(&self) -> bool {
        self.style.opacity > 0.0
    }

    /// Why it cannot be drawn, whatever the series holds.
    pub(super) fn check_style(&self) -> Result<(), String> {
        self.style.check()?;
        for (name, time) in [("is held for a time", self.held), ("has a shutter", self.shutter)] {
            if !(time >= 0.0 && time.is_finite()) {
                return Err(format!("flow {name} of {time}; it must be zero or above"));
            }
        }
        Ok(())
    }

    /// What is usual for its vectors; `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If the series has no such vectors, or none of them can be read.
    pub fn measure(&self, series: &Series, cancel: &Cancel) -> Result<Option<FlowMeasure>, PipelineError> {
        let Some(speeds) = speeds(&vector_components(series, &self.field)?, cancel)? else { return Ok(None) };
        let speed =
            [0.9, 1.0].map(|share| speeds.value_at(share).map_or(0.0, f64::from)).into_iter().find(|&v| v > 0.0);
        let period = flow::usual_period(&series.mesh) * series.mesh.positions.scale;
        Ok(Some(FlowMeasure { speed: speed.unwrap_or(0.0), period }))
    }

    /// Why a series cannot show it.
    ///
    /// # Errors
    /// If the series has no such vectors at its vertices, or no cells around them.
    pub fn check(&self, series: &Series) -> Result<(), RequestError> {
        vector_components(series, &self.field).map(drop)
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

/// The fields of a store that flow can show, in its order: of vertices, with three components.
pub fn vector_fields(fields: &[StoredField]) -> Vec<&str> {
    let has = |name: &str, component| fields.iter().any(|field| field.name == format!("{name}:{component}"));
    let of_vertices = fields.iter().filter(|field| field.values_of == Association::Point);
    let names = of_vertices.filter_map(|field| field.name.strip_suffix(":0"));
    names.filter(|name| has(name, 1) && has(name, 2) && !has(name, 3)).collect()
}

/// What a layer of flow shows at a time.
#[derive(Clone, Debug)]
pub(super) struct FlowValues {
    style: FlowStyle,
    held: HeldFlow,
    vectors: [Arc<Vec<f32>>; 3],
    travel: Arc<Vec<f64>>,
    colors: FlowColors,
}

/// The first stage of flow: decodes.
#[derive(Debug, Default)]
pub(super) struct DecodeFlow {
    /// Field of `components` and `travel`.
    field: String,
    of: Weak<Mesh>,
    components: [StepCache; 3],
    travel: Travel,
    colors: StepCaches,
}

impl DecodeFlow {
    /// The values of a layer at a time; `None` if it is transparent, of which nothing is decoded.
    ///
    /// # Errors
    /// If the series has no such vectors at its vertices, or no such colours, or they cannot be read, or `Cancelled`.
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
        let colors = self.colors(series, layer, time, cancel, stats)?;
        let Self { components, travel, .. } = self;
        let mut vectors = |time: FrameTime| vectors(components, &fields, time, cancel, stats);
        let mut speeds = |step: usize| Ok::<_, PipelineError>(vectors(step.into())?.map(|vectors| speeds_of(&vectors)));
        let travel = travel.at(&series.times, time, &mut speeds)?.ok_or(PipelineError::Cancelled)?;
        let vectors = vectors(time)?.ok_or(PipelineError::Cancelled)?;
        let held = HeldFlow { time: layer.held, shutter: layer.shutter };
        Ok(Some(FlowValues { style: layer.style, held, vectors, travel, colors }))
    }

    /// The vector at a point of a cell, linear between its vertices; NaN where one of them is.
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
        let tet = *series.mesh.topology.tets.get(cell as usize).ok_or_else(no_cell)?;
        Ok(vectors.map(|of| interpolate(weights, tet.map(|vertex| of[vertex as usize]))).into())
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
        layer: &FlowLayer,
        time: FrameTime,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<FlowColors, PipelineError> {
        self.colors.keep(|field| layer.colors.as_ref().is_some_and(|of| of.field == field));
        let Some(ColorsBeside { field, colors }) = &layer.colors else { return Ok(FlowColors::One(FlowStyle::COLOR)) };
        let no_field = |error| RequestError::NoFieldBeside(format!("'{field}': {error}"));
        let other = series.beside(&field.parse().map_err(no_field)?)?;
        if other.values_of() == Association::Cell {
            return Err(RequestError::Flow(of_cells(field)).into());
        }
        let scalars = self.colors.of(field).show(&other, time, None, cancel, stats)?.ok_or(PipelineError::Cancelled)?;
        Ok(FlowColors::Of(FieldBeside { scalars: other.scalars(scalars), colors: colors.clone() }))
    }
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

fn of_cells(field: &str) -> String {
    format!("'{field}' has values of cells, and splats are at vertices; import the series with --cells-to-points")
}

/// The components of a field of vectors of vertices, with cells around.
pub(crate) fn vector_components(series: &Series, field: &str) -> Result<[Arc<Series>; 3], RequestError> {
    if series.mesh.is_cloud() {
        let problem = "splats are as wide as the cells around, and the series is of points alone; leave flow out";
        return Err(RequestError::Flow(problem.to_owned()));
    }
    let component = |index| {
        let selector = FieldSelector { name: field.to_owned(), component: Some(Component::Index(index)) };
        series.beside(&selector)
    };
    let none = |error| {
        RequestError::Flow(format!(
            "'{field}' is no field of vectors with three components: {error}; choose one that the source has as a vector, whose components are imported unless --field names others"
        ))
    };
    let found = [component(0).map_err(none)?, component(1).map_err(none)?, component(2).map_err(none)?];
    match found[0].values_of() {
        Association::Cell => Err(RequestError::Flow(of_cells(field))),
        Association::Point => Ok(found),
    }
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
    shapes: Option<Arc<Shapes>>,
    chosen: Option<(u32, Arc<Vec<u32>>)>,
    cells: Weak<CellSet>,
    shown: Arc<Vec<bool>>,
}

impl OrderFlow {
    /// The fragments of a view, by the judge if the frame is the judge's. Splats are at vertices of the cells that are shown.
    ///
    /// # Errors
    /// If they are too many.
    pub(super) fn fragments(
        &mut self,
        values: FlowValues,
        (mesh, cells): (&Arc<Mesh>, &Arc<CellSet>),
        clips: &[Plane],
        (local_view, is_judged): (&View, bool),
        stats: &mut FrameStats,
    ) -> Result<LayerFragments, PipelineError> {
        let started = Instant::now();
        if self.of.as_ptr() != Arc::as_ptr(mesh) {
            *self = Self { of: Arc::downgrade(mesh), ..Self::default() };
        }
        if self.cells.as_ptr() != Arc::as_ptr(cells) {
            self.shown = Arc::new(vertices_of(mesh, cells));
            self.cells = Arc::downgrade(cells);
        }
        let shapes = self.shapes.get_or_insert_with(|| Arc::new(Shapes::of(mesh))).clone();
        let chosen = values.style.splats.map(|count| match self.chosen.take() {
            Some((of, chosen)) if of == count => (count, chosen),
            _ => (count, Arc::new(flow::chosen(mesh, count))),
        });
        self.chosen.clone_from(&chosen);
        let FlowValues { style, held, vectors, travel, colors } = values;
        let scene = FlowScene {
            style,
            mesh: mesh.clone(),
            vectors,
            travel,
            held,
            colors,
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

/// Whether each vertex belongs to a cell of a set.
fn vertices_of(mesh: &Mesh, cells: &CellSet) -> Vec<bool> {
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
}

//! The first stage of flow: what a layer shows at a time.

use super::travel::{Speeds, Travel};
use super::{FlowLayer, beside, selector, vector_components};
use crate::field::{Association, Scalars};
use crate::mesh::Mesh;
use crate::pipeline::series::Series;
use crate::pipeline::steps::{StepCache, StepCaches};
use crate::pipeline::{ColorsBeside, FrameTime, PipelineError, RequestError, TetLayer};
use crate::render::flow::{FlowColors, FlowStyle, FlowVolume, HeldFlow, Mixture};
use crate::render::surfaces::FieldBeside;
use crate::stats::FrameStats;
use crate::store::StoredTravel;
use crate::task::Cancel;
use glam::DVec3;
use std::sync::{Arc, Weak};

/// What a layer of flow shows at a time.
#[derive(Clone, Debug)]
pub(in crate::pipeline) struct FlowValues {
    pub(super) style: FlowStyle,
    pub(super) held: HeldFlow,
    pub(super) sites: Association,
    pub(super) vectors: [Arc<Vec<f32>>; 3],
    pub(super) travel: Arc<Vec<f64>>,
    pub(super) mixture: Option<Mixture>,
    pub(super) colors: FlowColors,
}

impl FlowValues {
    /// Refuses kernels without a scalar at each site, or without colours of their own.
    pub(in crate::pipeline) fn check_volume(&self, series: &Series, layer: &TetLayer) -> Result<(), RequestError> {
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
pub(in crate::pipeline) struct DecodeFlow {
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
    pub(in crate::pipeline) fn run(
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
    pub(in crate::pipeline) fn vector(
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

/// Whether all vectors are 0, or not finite.
fn is_still([x, y, z]: &[Arc<Vec<f32>>; 3]) -> bool {
    let flows = |vector: [f32; 3]| vector.iter().all(|c| c.is_finite()) && vector.iter().any(|c| *c != 0.0);
    !x.iter().zip(&**y).zip(&**z).any(|((x, y), z)| flows([*x, *y, *z]))
}

/// The ways of vectors that their store has; `None` if they are of no store that keeps any.
pub(super) fn stored_travel(components: &[Arc<Series>; 3]) -> Option<StoredTravel> {
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

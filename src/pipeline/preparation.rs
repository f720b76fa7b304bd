//! The first two stages of a frame: decode its scalars, then find and sort the cells and faces to draw.

use super::enlarging::Enlarge;
use super::flow::{DecodeFlow, FlowBy, FlowValues, OrderFlow};
use super::functions;
use super::in_sight::{CellsInSight, InSight, Sight};
use super::points::PointLists;
use super::quantities::Gradients;
use super::region_values::{RegionFields, RegionValues};
use super::residual::AddDetails;
use super::series::Series;
use super::shells::{ShellCells, Shells};
use super::steps::{StepCache, StepCaches};
use super::transparent::TransparentCache;
use super::unconnected;
use super::{
    Backend, DrawnBy, FaceDetail, FrameRequest, FrameTime, PipelineError, RequestError, SampleSet, TetLayer, Upsampling,
};
use crate::camera::{Samples, View};
use crate::field::{Association, Scalars};
use crate::lod::Selector;
use crate::node_table::NodeTable;
use crate::optics::OpticsKind;
use crate::render::cpu::Placer;
use crate::render::functions::SheetStyle;
use crate::render::residual::lattice;
use crate::render::surfaces::screen::{Screen, set_guides};
use crate::render::surfaces::{FieldBeside, Normals, SurfaceScene, SurfaceShading, VertexGradients, cut_planes};
use crate::render::upsampling::small_view;
use crate::render::{CompressedScalars, KBuffer, OpticsTables, Planes, RenderError, RenderJob};
use crate::slowdown::{Slow, waste};
use crate::stats::FrameStats;
use crate::task::Cancel;
use crate::transfer::TransferSource;
use crate::visibility::{
    Activity, CellSet, CutPlanes, DepthOrder, Drawn, Label, Selection, Skip, TransparentIntervals,
};
use glam::DVec3;
use std::sync::{Arc, LazyLock};
use std::time::Instant;

/// Output of the first stage, input of the second.
#[derive(Debug)]
pub(super) struct Decoded {
    layer: TetLayer,
    by: DrawnBy,
    scalars: Scalars,
    compressed: Option<CompressedScalars>,
    /// Scalar intervals where the table is transparent.
    transparent: Arc<TransparentIntervals>,
    /// The colours of surfaces and sections.
    colors: SurfaceColors,
    /// Other fields at the same time.
    beside: Vec<FieldBeside>,
    /// The flow in the cells.
    flow: Option<FlowValues>,
    /// Values of the cells by which regions are chosen.
    region_values: RegionValues,
    /// Labels of chunks that were not decoded; empty if all were.
    known: Vec<Option<Label>>,
    stats: FrameStats,
}

/// The first stage: decodes.
#[derive(Debug, Default)]
pub(super) struct Decode {
    steps: StepCache,
    transparent: TransparentCache,
    colors: Option<SurfaceColors>,
    /// Decoded steps of other fields, by name.
    beside: StepCaches,
    region_fields: RegionFields,
    flow: DecodeFlow,
    blank: Option<Blank>,
}

impl Decode {
    /// Number of scalar buffers.
    #[cfg(test)]
    pub(super) fn buffers(&self) -> usize {
        self.steps.buffers()
    }

    /// The vector of a request's flow at a point of a cell; `None` without flow.
    ///
    /// # Errors
    /// If the series has no such vectors, they cannot be read, or there is no such cell, or `Cancelled`.
    pub(super) fn flow_vector(
        &mut self,
        series: &Arc<Series>,
        request: &FrameRequest,
        point: (u32, [f64; 4]),
        cancel: &Cancel,
    ) -> Result<Option<DVec3>, PipelineError> {
        request.flow()?.map(|layer| self.flow.vector(series, layer, request.time, point, cancel)).transpose()
    }

    /// Decodes the scalars of a request.
    ///
    /// # Errors
    /// If the request is at fault or a step cannot be read, or `Cancelled`.
    pub(super) fn run(
        &mut self,
        series: &Arc<Series>,
        request: &FrameRequest,
        cancel: &Cancel,
    ) -> Result<Decoded, PipelineError> {
        let started = Instant::now();
        let mut stats = FrameStats::default();
        if !request.skip.unchanged {
            (self.steps, self.transparent, self.colors, self.beside, self.blank) = Default::default();
            (self.region_fields, self.flow) = Default::default();
        }
        let flow = match request.flow()? {
            Some(layer) => self.flow.run(series, layer, request.time, cancel, &mut stats)?,
            None => None,
        };
        let layer = request.tets_of(&series.field.name)?;
        if let Some((flow, layer)) = flow.as_ref().zip(layer) {
            flow.check_volume(series, layer)?;
        }
        let by = layer.map_or(DrawnBy::Raycast, |layer| layer.draw.on(&series.mesh).drawn_by());
        if let Some(layer) = layer {
            unconnected::check(&series.mesh, layer, by, request)?;
            if by.is_of_functions() {
                functions::check(series, layer, request)?;
            }
        }
        let Some(layer) = layer.filter(|layer| !layer.is_empty() || flow.is_some()) else {
            return Ok(Decoded { flow, ..Blank::of(&mut self.blank, series).decoded(by) });
        };
        if series.values_of() == Association::Cell && !layer.surfaces.is_empty() {
            return Err(RequestError::IsosurfacesOfCells(series.field.name.clone()).into());
        }
        if by.points().is_some_and(|style| !style.is_exact()) && !layer.surfaces.is_empty() {
            return Err(RequestError::IsosurfacesOfPoints.into());
        }
        let colors = SurfaceColors::of(&mut self.colors, layer)?;
        let layer = in_sight(layer);
        let transparent = self.transparent.of(&layer, by, request.skip);
        // Smooth normals and sections also use invisible cells.
        let has_sections = layer.cuts.iter().any(|cut| !cut.clips);
        // A splat at a hole is not drawn.
        let is_beside_cells = has_sections || !layer.domain.is_empty() || flow.is_some();
        // Gradients of cells' scalars come from the cells around.
        let needs_neighbours = series.values_of() == Association::Cell && layer.table.joint().is_some();
        let are_all_needed =
            !request.skip.transparent_chunks || has_smooth_surfaces(&layer) || is_beside_cells || needs_neighbours;
        let needed = if !are_all_needed { series.needed_chunks(request.time, &transparent) } else { None };
        let chunks = needed.as_ref().map(|needed| &*needed.chunks);
        let scalars = self.steps.show(series, request.time, chunks, cancel, &mut stats)?;
        let scalars = series.scalars(scalars.ok_or(PipelineError::Cancelled)?);
        let beside = self.beside(series, &layer, request.time, cancel, &mut stats)?;
        let region_values = self.region_fields.values(series, &layer, request.time, cancel, &mut stats)?;
        let known = needed.map(|needed| needed.labels).unwrap_or_default();
        stats.chunks_skipped = known.iter().filter(|label| label.is_some()).count() as u64;
        let is_for_gpu = request.backend != Backend::Cpu && !by.is_reference() && !by.is_of_functions();
        let compressed = if is_for_gpu { series.compressed(request.time)? } else { None };
        stats.ms_decode = started.elapsed().as_secs_f64() * 1e3;
        Ok(Decoded { layer, by, scalars, compressed, transparent, colors, beside, flow, region_values, known, stats })
    }

    /// The other fields of a layer at a time.
    fn beside(
        &mut self,
        series: &Series,
        layer: &TetLayer,
        time: FrameTime,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<Vec<FieldBeside>, PipelineError> {
        self.beside.keep(|field| layer.beside.iter().any(|of| of.field == field));
        let decoded = layer.beside.iter().map(|of| {
            let no_field = |error| RequestError::NoFieldBeside(format!("'{}': {error}", of.field));
            let other = series.beside(&of.field.parse().map_err(no_field)?)?;
            let scalars = self.beside.of(&of.field).show(&other, time, None, cancel, stats)?;
            let scalars = other.scalars(scalars.ok_or(PipelineError::Cancelled)?);
            Ok(FieldBeside { scalars, colors: of.colors.clone() })
        });
        decoded.collect()
    }
}

/// The layer with a transparent transfer function if its volume is not drawn.
fn in_sight(layer: &TetLayer) -> TetLayer {
    let mut layer = layer.clone();
    if !layer.volume {
        static TRANSPARENT: LazyLock<Arc<NodeTable>> = LazyLock::new(|| Arc::new(NodeTable::transparent()));
        (layer.table, layer.formula) = (TRANSPARENT.clone().into(), None);
    }
    layer
}

fn has_smooth_surfaces(layer: &TetLayer) -> bool {
    (!layer.surfaces.is_empty() || layer.shading.volume) && layer.shading.normals == Normals::Vertex
}

/// The colours of a transfer function, also where it is transparent: its table has no colours there.
#[derive(Clone, Debug)]
struct SurfaceColors {
    table: Arc<NodeTable>,
    /// Source of the colours, if known; otherwise the table's colours are used.
    source: Option<Arc<TransferSource>>,
}

impl SurfaceColors {
    /// The colours of a layer's surfaces; `last` while they are unchanged.
    fn of(last: &mut Option<Self>, layer: &TetLayer) -> Result<Self, RenderError> {
        let source = layer.formula.as_ref().filter(|_| layer.has_colored_surfaces());
        let Some(source) = source else { return Ok(Self { table: layer.table.over_scalars().clone(), source: None }) };
        let is_same = |last: &&mut Self| last.source.as_ref().is_some_and(|of| Arc::ptr_eq(of, source) || of == source);
        if let Some(last) = last.as_mut().filter(is_same) {
            return Ok(last.clone());
        }
        let colors = source.formula().map_err(|error| error.to_string());
        let table = colors.and_then(|formula| formula.colors().map_err(|error| error.to_string()));
        let table = Arc::new(table.map_err(RenderError::NoFormula)?);
        Ok(last.insert(Self { table, source: Some(source.clone()) }).clone())
    }
}

/// Stand-in for a request that draws nothing: a transparent table, for which nothing is decoded and every renderer has nothing to draw.
#[derive(Debug)]
struct Blank {
    scalars: Scalars,
    table: Arc<NodeTable>,
    transparent: Arc<TransparentIntervals>,
}

impl Blank {
    /// The stand-in for a series; `last` until another one has other numbers of vertices or cells.
    fn of<'a>(last: &'a mut Option<Self>, series: &Series) -> &'a Self {
        let (of, count) = (series.values_of(), series.scalar_count());
        let is_fitting = |blank: &Self| blank.scalars.association() == of && blank.scalars.values().len() == count;
        let fitting = last.take().filter(is_fitting);
        last.insert(fitting.unwrap_or_else(|| {
            let table = Arc::new(NodeTable::transparent());
            Self {
                scalars: series.scalars(Arc::new(vec![0.0; count])),
                transparent: Arc::new(TransparentIntervals::of(&table)),
                table,
            }
        }))
    }

    /// Output of the first stage; the reference stays the reference, since it needs no device.
    fn decoded(&self, by: DrawnBy) -> Decoded {
        Decoded {
            layer: TetLayer::new(self.table.clone()),
            by: if by.is_reference() { by } else { DrawnBy::Raycast },
            scalars: self.scalars.clone(),
            compressed: None,
            transparent: self.transparent.clone(),
            colors: SurfaceColors { table: self.table.clone(), source: None },
            beside: Vec::new(),
            flow: None,
            region_values: RegionValues::default(),
            known: Vec::new(),
            stats: FrameStats::default(),
        }
    }
}

/// Output of the second stage, input of the third.
#[derive(Debug)]
pub(super) struct Ordered {
    pub(super) job: RenderJob,
    pub(super) by: DrawnBy,
    /// Post-processing of the rendered image; `None` if there is none.
    pub(super) on_image: Option<OnImage>,
    /// Enlargement of the image to the size of the frame; `None` if it has this size.
    pub(super) enlarge: Option<Enlarge>,
    /// Details to add to the image; `None` if rays are cast for all pixels.
    pub(super) add_details: Option<AddDetails>,
}

/// Screen-space light, normals and numbers of surfaces, found on the rendered image.
#[derive(Debug)]
pub(super) struct OnImage {
    screen: Screen,
    /// Whether the frame keeps normals and numbers.
    keeps_guides: bool,
}

impl OnImage {
    fn of(request: &FrameRequest, job: &RenderJob, shading: SurfaceShading, by: DrawnBy) -> Option<Self> {
        let scene = job.surfaces.as_ref().filter(|scene| !scene.is_empty())?;
        (shading.is_of_screen() || request.guides).then(|| {
            let (lo, hi) = job.mesh.positions.world_bounds();
            let (view, middle) = (job.view.clone(), 0.5 * lo + 0.5 * hi);
            let (depth, radius) = (view.forward.dot(middle - view.eye), 0.5 * (hi - lo).length());
            let depth_range = (depth - radius, depth + radius);
            let is_thinned = by.faces().is_some_and(|detail| detail.lod < 1.0);
            let isosurfaces = scene.isosurfaces();
            let screen = Screen { view, shading, depth_range, isosurfaces, is_thinned };
            Self { screen, keeps_guides: request.guides }
        })
    }

    /// Lights surfaces from their planes of normals, numbers and depths.
    pub(super) fn finish(self, planes: &mut Planes, guides: &Planes) {
        let depth = set_guides(planes, guides);
        if self.screen.shading.is_of_screen() {
            self.screen.light(planes, depth);
        }
        if !self.keeps_guides {
            (planes.normal, planes.id) = Default::default();
        }
    }
}

/// Refuses requests that cannot be enlarged.
fn check_upsampling(request: &FrameRequest, upsampling: Upsampling, by: DrawnBy) -> Result<(), RequestError> {
    upsampling.check().map_err(RequestError::Upsampling)?;
    let problem = match (by, &request.samples) {
        (DrawnBy::Reference | DrawnBy::Judge, _) => "choose another mode, or leave the scale of the image out",
        (_, SampleSet::All) => return Ok(()),
        _ => "cast all rays, or leave the scale of the image out",
    };
    Err(RequestError::Upsampling(problem.to_owned()))
}

/// The second stage: finds and sorts.
#[derive(Debug, Default)]
pub(super) struct Order {
    in_sight: CellsInSight,
    /// Cells for contrast-adaptive sampling, which must not depend on what is skipped.
    domain_in_sight: CellsInSight,
    transparent: TransparentCache,
    /// Selects faces in modes that draw faces.
    selector: Selector,
    depth: DepthOrder,
    points: PointLists,
    /// Prepared here, not in the renderer: a table takes longer than a frame.
    tables: OpticsTables,
    gradients: Gradients,
    /// Gradients for smooth normals of surfaces.
    vertex_gradients: VertexGradients,
    shells: Shells,
    flow: OrderFlow,
    placer: Placer,
}

impl Order {
    /// Places the primitives of a CPU job in its view, while the renderer is busy with the frame before.
    pub(super) fn place_ahead(&mut self, Ordered { job, by, .. }: &mut Ordered) {
        if !by.is_reference() {
            let table = self.tables.get(job);
            self.placer.place(job, &table);
        }
    }

    /// The job of a request whose scalars are decoded: its view and its active cells. Where a GPU probably draws the splats of flow, they have
    /// no fragments.
    ///
    /// # Errors
    /// If the camera has no valid view, or `Cancelled`.
    pub(super) fn run(
        &mut self,
        series: &Series,
        request: &FrameRequest,
        decoded: Decoded,
        draws_flow: bool,
        cancel: &Cancel,
    ) -> Result<Ordered, PipelineError> {
        let started = Instant::now();
        let mut view = request.camera.view(request.size_px.0, request.size_px.1)?;
        view.samples = request.samples.samples(request.size_px)?;
        let full_view = view.clone();
        if let Some(upsampling) = request.upsampling {
            check_upsampling(request, upsampling, decoded.by)?;
            view = small_view(&upsampling.enlarging(request.size_px), &full_view);
        }
        AddDetails::check(request, decoded.by)?;
        if request.residual.is_some() {
            view.samples = Samples::Lattice(lattice());
        }
        let has_edges = request.upsampling.is_some_and(|upsampling| upsampling.filter.edges().is_some());
        let contrast = request.samples.contrast();
        let is_adaptive = contrast.is_some() || !request.previews.is_empty();
        if contrast.is_some() && decoded.by != DrawnBy::Raycast {
            return Err(RequestError::AdaptiveBy(decoded.by.name()).into());
        }
        let planes = cut_planes(&decoded.layer.cuts, &series.mesh.positions).map_err(RequestError::from)?;
        let Decoded { layer, scalars, known, transparent, region_values, .. } = &decoded;
        let forget = !request.skip.unchanged;
        // A ball may reach out of what clips remove.
        let keep_away = !request.skip.outside || decoded.by.needs_all_cells() || series.mesh.is_cloud();
        let in_sight = InSight { layer, scalars, known, transparent, region_values, planes: &planes, keep_away };
        let Sight { activity, clipped, of_all_regions } = self.in_sight.find(series, in_sight, forget, cancel)?;
        let goes_through_more = !request.skip.transparent_cells || keep_away && !planes.clips.is_empty();
        let domain = if (is_adaptive || has_edges) && goes_through_more {
            let transparent = &self.transparent.of(layer, decoded.by, Skip { transparent_cells: true, ..request.skip });
            let in_sight = InSight { transparent, keep_away: false, ..in_sight };
            Some(self.domain_in_sight.find(series, in_sight, forget, cancel)?.activity.active)
        } else {
            None
        };
        let Activity { finite, active, classified } = activity;
        let Decoded { layer, by, scalars, compressed, colors, beside, flow, region_values, known, mut stats, .. } =
            decoded;
        (stats.cells_classified, stats.cells_clipped) = (classified, clipped);
        waste(Slow::Skipping, if request.skip == Skip::ALL { active.universe() } else { 0 });
        if !request.skip.unchanged {
            (self.selector, self.depth, self.gradients, self.vertex_gradients) = Default::default();
            (self.shells, self.points, self.flow) = Default::default();
        }
        let (faces, k_buffer) = match by.faces() {
            Some(detail) => {
                let selection = self.selected(series, request.time.step(), detail, &active, cancel)?;
                (Some(self.sorted(series, &view, &selection, cancel, &mut stats)?), detail.k_buffer)
            }
            None => (None, KBuffer::default()),
        };
        let points = match by.points() {
            Some(style) => {
                let ranking = match style.lod < 1.0 {
                    true => Some(series.cell_ranking(style.importance, cancel)?.ok_or(PipelineError::Cancelled)?),
                    false => None,
                };
                let of = (&series.mesh, &active, ranking.as_ref());
                Some(self.points.find(of, style, &view, cancel, &mut stats)?)
            }
            None => None,
        };
        let functions = match by {
            DrawnBy::Sheets(style) => Some(series.functions(style, layer.functions, &layer.shading)?),
            DrawnBy::Judge => Some(series.functions(SheetStyle::default(), layer.functions, &layer.shading)?),
            _ => None,
        };
        // The cells of a cloud are its vertices.
        let scalars = match functions.is_some() && series.mesh.is_cloud() {
            true => Scalars::Vertices(scalars.values().clone()),
            false => scalars,
        };
        let joint = match layer.table.joint() {
            None => None,
            Some(table) => {
                let scene = series.joint_scene(table, &scalars, &mut self.gradients, cancel)?;
                Some(scene.ok_or(PipelineError::Cancelled)?)
            }
        };
        let shading = layer.shading;
        let (domain_colors, clips) = (colors.table.clone(), planes.clips.clone());
        let of_scene = (colors, planes, beside);
        let surfaces = match functions {
            // Their light is their own.
            Some(_) => None,
            None => self.surfaces(series, &layer, of_scene, (&scalars, &active), cancel)?,
        };
        let of_shells = ShellCells { domain: &finite, of_all_regions: &of_all_regions, region_values: &region_values };
        let shells = self.shells.update(&layer, &series.mesh, of_shells);
        let mut job = RenderJob {
            compressed,
            // The renderers do not enter cells whose scalars were not decoded.
            finite: Some(finite.clone()).filter(|finite| known.is_empty() && !Arc::ptr_eq(finite, &active)),
            contrast,
            previews: if by == DrawnBy::Raycast { request.previews.clone() } else { Vec::new() },
            domain,
            // A joint table is integrated exactly: no other optics need preparing.
            optics: if joint.is_some() { OpticsKind::Exact } else { layer.optics },
            formula: layer.formula.filter(|_| joint.is_none()),
            joint,
            surfaces,
            shells,
            faces,
            points,
            functions,
            k_buffer,
            clusters: Some(series.clusters().clone()),
            skip: request.skip,
            cancel: cancel.clone(),
            for_window: request.for_window,
            stats,
            ..RenderJob::new(series.mesh.clone(), scalars, active, view, layer.table.over_scalars().clone())
        };
        if !by.is_reference() {
            self.prepare_table(&mut job)?;
        }
        job.fragments = self.shells.fragments(&job, shading, &domain_colors, &clips)?;
        if let Some(flow) = flow {
            let (cells, view) = ((&series.mesh, &finite), job.local_view());
            let seen = (&job.scalars, &domain_colors);
            // The GPU leaves the rest to the CPU.
            let may_be_of_gpu = matches!(by, DrawnBy::Raycast | DrawnBy::Faces(_)) && !is_adaptive;
            let draws = draws_flow && may_be_of_gpu && matches!(view.samples, Samples::Lattice(_));
            let how = if by.is_reference() { FlowBy::Judge } else { FlowBy::Renderer { draws } };
            let (of_view, told) = ((&view, how, job.fragments.take()), (&mut job.stats, cancel));
            (job.flow, job.fragments) = self.flow.draw(flow, cells, seen, &clips, of_view, told)?;
        } else {
            self.flow.release();
        }
        job.stats.ms_order = started.elapsed().as_secs_f64() * 1e3;
        let on_image = OnImage::of(request, &job, shading, by);
        if on_image.is_some() && request.samples != SampleSet::All && shading.is_of_screen() {
            return Err(RequestError::ScreenOfSome.into());
        }
        let enlarge = request.upsampling.map(|upsampling| Enlarge::of(upsampling, &job, full_view));
        let add_details = request.residual.as_ref().map(|residual| AddDetails::of(residual, &job)).transpose()?;
        // The following steps need planes.
        let is_done = on_image.is_none() && add_details.is_none();
        job.for_window &= is_done;
        if !is_done || enlarge.is_some() {
            job.previews.clear();
        }
        if is_done {
            job.enlarge = enlarge.as_ref().map(Enlarge::enlargement);
        }
        Ok(Ordered { job, by, on_image, enlarge, add_details })
    }

    /// The surfaces and cuts of a layer; `None` without any.
    fn surfaces(
        &mut self,
        series: &Series,
        layer: &TetLayer,
        (colors, planes, beside): (SurfaceColors, CutPlanes, Vec<FieldBeside>),
        (scalars, active): (&Scalars, &Arc<CellSet>),
        cancel: &Cancel,
    ) -> Result<Option<SurfaceScene>, PipelineError> {
        if layer.surfaces.is_empty() && planes.is_empty() && !layer.shading.volume {
            return Ok(None);
        }
        let scene = SurfaceScene::new(&layer.surfaces, layer.shading, &colors.table).map_err(RequestError::from)?;
        let section_by = layer.cuts.iter().filter(|cut| !cut.clips).map(|cut| cut.by).collect();
        let scene = scene.with_planes(planes).with_beside(beside, section_by).with_source(colors.source);
        // Scalars of cells have no gradient in a cell.
        let Some(scalars) = scalars.of_vertices().filter(|_| scene.lacks_gradients()) else { return Ok(Some(scene)) };
        let gradients = self.vertex_gradients.update(&series.mesh, scalars, active, cancel);
        Ok(Some(scene.with_gradients(gradients.ok_or(PipelineError::Cancelled)?)))
    }

    /// The transfer function in the renderers' form, the same [`Arc`] until it or its optics change.
    fn prepare_table(&mut self, job: &mut RenderJob) -> Result<(), PipelineError> {
        let built = self.tables.entries_built();
        let prepared = self.tables.prepare(job);
        if job.cancel.is_cancelled() {
            return Err(PipelineError::Cancelled);
        }
        job.stats.table_entries_built = self.tables.entries_built() - built;
        job.prepared = Some(prepared);
        Ok(())
    }

    /// The faces to draw.
    fn selected(
        &mut self,
        series: &Series,
        step: usize,
        detail: FaceDetail,
        active: &Arc<CellSet>,
        cancel: &Cancel,
    ) -> Result<Arc<Selection>, PipelineError> {
        let FaceDetail { lod, sampling, .. } = detail;
        let ranking = if lod < 1.0 {
            series.ranking(step, sampling, cancel)?.ok_or(PipelineError::Cancelled)?
        } else {
            series.any_ranking()
        };
        Ok(self.selector.select(&series.mesh, &ranking, lod, active))
    }

    /// The selected faces, front to back.
    fn sorted(
        &mut self,
        series: &Series,
        view: &View,
        selection: &Arc<Selection>,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<Arc<Drawn>, PipelineError> {
        let (sorts, skipped) = (self.depth.sorts(), self.depth.sorts_skipped());
        let drawn = self.depth.order(&series.mesh, view.forward, selection, cancel);
        stats.face_sorts = self.depth.sorts() - sorts;
        stats.face_sorts_skipped = self.depth.sorts_skipped() - skipped;
        drawn.ok_or(PipelineError::Cancelled)
    }
}

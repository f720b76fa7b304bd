//! The ground truth: float64, brute force, no adjacency, no tables.
//!
//! For every pixel every tet is clipped against the ray; the segments are sorted by depth and integrated one after the other. Slow and
//! simple. Nothing is shared with the fast paths except the stored coordinates. A job without the
//! [source](crate::transfer::TransferSource) of its transfer function is integrated by its table, and its statistics say so.
//!
//! 1. A tet is clipped by its barycentric coordinates, which are linear along the ray: the ray is inside where all four
//!    are >= 0, or, if nowhere, where they are >= -[`INFLATION`] over more than [`GRAZING_LENGTH`]: rays that run in a
//!    face or along an edge do not fall between two cells, and a cell that is only touched does not count.
//! 2. Inflated cells overlap slightly, and cells of invalid meshes more: segments are sorted by their near end, each starting where
//!    the last one ended, so that a point of the ray is in one cell.
//! 3. A segment is split where the formula of the transfer function has a knot, and integrated by the definition
//!    (dissertation 1.1.2, eq. 1.2) with Gauss-Legendre on sub-pieces of small optical depth. With a table it is split at its nodes, in
//!    a joint table at all lines of its rectangles.
//!
//! A field of functions takes the place of the scalars inside the cells ([`functions`]).
//!
//! Rows are processed in bands, so that the segments of 512 x 512 pixels through 2M cells fit in memory.

pub(super) mod clip;
mod cuts;
mod flow;
mod formula;
mod functions;
pub(super) mod integrate;
mod joint;
mod surfaces;

use super::surfaces::Normals;
use super::{Frame, FrameRun, LayerFragment, LayerRenderer, RenderError, RenderJob};
use crate::camera::{Samples, View};
use crate::render::functions::FunctionScene;
use crate::render::medium::{Medium, Segment};
use crate::transfer::Formula;
use clip::Cell;
use cuts::WithCuts;
pub(crate) use flow::flow_fragments;
use functions::{Lit, Pieces};
use glam::DVec3;
use rayon::prelude::*;
use std::time::{Duration, Instant};
use surfaces::{WithSurfaces, gradients_at_vertices};

/// Cells clipped between two checks of the cancel flag.
const CELLS_AT_ONCE: usize = 1024;

/// Rows of a band.
const BAND_ROWS: usize = 8;

/// Pixels of a band of listed pixels.
const BAND_PIXELS: usize = 4096;

/// Inflation of cells in barycentric coordinates: far above f64's rounding of them except on slivers of 1:10^5, far below what an image
/// can resolve.
const INFLATION: f64 = 1e-10;

/// Least length, in local units, of a segment that exists by inflation alone: a cell touched in a point has a segment of about
/// [`INFLATION`], one along whose face the ray runs of about the cell's size.
const GRAZING_LENGTH: f64 = 1e-5;

/// The reference renderer. Renders 1M cells to 512 x 512 pixels in seconds.
pub type Reference = FrameRun<Judge>;

/// Clips every cell against every ray.
#[derive(Default)]
pub struct Judge;

/// A job of [`Judge`].
pub struct JudgedJob {
    job: RenderJob,
    view: View,
    cells: Vec<Cell>,
    /// The direction of the gradient at each vertex, if surfaces have smooth normals.
    gradients: Vec<DVec3>,
    /// The field of functions that is drawn in the cells, if any.
    field: Option<functions::Field>,
    /// Pixels of a band.
    band: usize,
    next_band: usize,
}

impl Reference {
    /// A renderer without a job.
    pub fn new() -> Self {
        Self::default()
    }
}

impl LayerRenderer for Judge {
    type Job = JudgedJob;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<JudgedJob>, RenderError> {
        if let Some(source) = &job.formula {
            source.formula().map_err(|error| RenderError::NoFormula(error.to_string()))?;
        }
        frame.stats.by_formula = job.formula.is_some();
        let view = job.local_view();
        frame.clear(view.plane_px());
        let positions = &job.mesh.positions.local;
        let to_view = |v: u32| view.to_view(positions[v as usize].as_dvec3());
        let topology = &job.mesh.topology;
        let field = match job.functions {
            Some(_) => Some(functions::Field::of(&job, FunctionScene::of_job(&job)?, &view)),
            None => None,
        };
        // A field that is elsewhere asks no cell.
        let asked =
            if field.as_ref().is_none_or(functions::Field::is_in_cells) { topology.tets.len() as u32 } else { 0 };
        let cells: Vec<Cell> = (0..asked)
            .into_par_iter()
            .filter(|&c| job.active.contains(c))
            .filter_map(|c| Cell::new(&job, &view, c, topology.tets[c as usize].map(to_view)))
            .collect();
        let band = match view.samples {
            Samples::Lattice(_) => BAND_ROWS * view.plane_px().0,
            Samples::Pixels(_) => BAND_PIXELS,
        };
        let is_smooth = job.surfaces.as_ref().is_some_and(|scene| scene.shading().normals == Normals::Vertex);
        let gradients = if is_smooth { gradients_at_vertices(&job) } else { Vec::new() };
        Ok(Some(JudgedJob { job, view, cells, gradients, field, band, next_band: 0 }))
    }

    fn advance(&mut self, budget: Duration, judged: &mut JudgedJob, frame: &mut Frame) -> Result<bool, RenderError> {
        let slice_started = Instant::now();
        let Frame { planes, stats, .. } = frame;
        let (pixels, band) = (planes.color.pixels.len(), judged.band);
        let bands = pixels.div_ceil(band);
        let batch = 2 * rayon::current_num_threads();
        while judged.next_band < bands && !judged.job.cancel.is_cancelled() {
            let range = judged.next_band..(judged.next_band + batch).min(bands);
            judged.next_band = range.end;
            let pixels_at = range.start * band..(range.end * band).min(pixels);
            stats.steps += planes.color.pixels[pixels_at.clone()]
                .par_chunks_mut(band)
                .zip(planes.depth.pixels[pixels_at].par_chunks_mut(band))
                .enumerate()
                .map(|(i, (pixels, depths))| render_band(judged, (range.start + i) * band, pixels, depths))
                .sum::<u64>();
            if slice_started.elapsed() >= budget {
                break;
            }
        }
        Ok(judged.next_band >= bands)
    }
}

impl JudgedJob {
    /// Integrates the ray at an index of the plane, through a medium with the job's surfaces and cuts in it.
    fn integrate<M: Medium<Ray = (), Light = integrate::Sum>>(
        &self,
        medium: &M,
        colors: Option<&Formula<'_>>,
        place: usize,
        chain: impl Iterator<Item = Segment>,
        fragments: &[LayerFragment],
    ) -> integrate::Light {
        let (view, scale) = (&self.view, self.job.mesh.positions.scale);
        let Some(scene) = &self.job.surfaces else {
            return integrate::integrate(medium, chain, fragments, scale);
        };
        let (column, row) = view.pixel_at(place);
        let (px, py) = view.ray(column, row);
        let beside = px * view.right + py * view.up;
        let (origin, direction) =
            if view.perspective { (view.eye, view.forward + beside) } else { (view.eye + beside, view.forward) };
        let medium =
            WithSurfaces { volume: medium, gradients: &self.gradients, job: &self.job, scene, origin, direction };
        let color = |behind: &Segment, section: usize| match (scene.beside_section(section), colors) {
            (Some(beside), _) => medium.color_by(beside, behind.cell, behind.part[0]),
            (None, Some(colors)) => colors.eval(behind.part_scalar[0]).0,
            (None, None) => scene.section_color(behind.part_scalar[0]),
        };
        let (first_number, guides) = (scene.sheets().len() as u32 + 1, scene.shows_guides());
        let medium =
            WithCuts { inner: &medium, planes: scene.planes(), first_number, guides, color, origin, direction };
        integrate::integrate(&medium, chain, fragments, scale)
    }
}

/// Renders the pixels from index `first` of the plane on, unless the job is cancelled; returns the number of segments.
fn render_band(active: &JudgedJob, first: usize, pixels: &mut [[f32; 4]], depths: &mut [f32]) -> u64 {
    let _turn = active.job.thread_limit.turn();
    let (view, scale) = (&active.view, active.job.mesh.positions.scale);
    let places = first..first + pixels.len();
    let rows = view.rows_of(places.clone());
    // The formula was validated when the job began.
    let formula = active.job.formula.as_ref().and_then(|source| source.formula().ok());
    let colors = active.job.surfaces.as_ref().and_then(|scene| scene.source()?.formula().ok());
    let mut segments: Vec<(u32, Segment)> = Vec::new();
    for (i, cell) in active.cells.iter().enumerate() {
        if i.is_multiple_of(CELLS_AT_ONCE) && active.job.cancel.is_cancelled() {
            return 0;
        }
        for row in cell.tet.rows.start.max(rows.start)..cell.tet.rows.end.min(rows.end) {
            for (column, place) in view.rendered_in(row, cell.tet.columns.clone()) {
                let (px, py) = view.ray(column, row);
                if places.contains(&place)
                    && let Some(segment) = cell.clip(view, scale, px, py)
                {
                    segments.push(((place - first) as u32, segment));
                }
            }
        }
    }
    segments.sort_by(|a, b| {
        a.0.cmp(&b.0).then(a.1.part[0].total_cmp(&b.1.part[0])).then(a.1.part[1].total_cmp(&b.1.part[1]))
    });
    let near = view.near_depth();
    let mut of_pixels = segments.chunk_by(|a, b| a.0 == b.0).peekable();
    for pixel in 0..pixels.len() {
        if active.job.cancel.is_cancelled() {
            return 0;
        }
        let of_pixel = of_pixels.next_if(|of_pixel| of_pixel[0].0 as usize == pixel).unwrap_or_default();
        let fragments = active.job.fragments.as_ref().map_or(&[][..], |f| f.of_pixel(first + pixel));
        let before_near = fragments.iter().take_while(|fragment| fragment.depth / scale < near).count();
        let fragments = &fragments[before_near..];
        if of_pixel.is_empty()
            && fragments.is_empty()
            && active.field.as_ref().is_none_or(functions::Field::is_in_cells)
        {
            continue;
        }
        let chain: Vec<Segment> = clip::without_overlap(near, of_pixel.iter().map(|(_, s)| *s)).collect();
        let transfer = integrate::Transfer::of(&active.job);
        let light = if let Some(field) = &active.field {
            let (column, row) = view.pixel_at(first + pixel);
            let ray = view.ray(column, row);
            let inside = field.inside(view, scale, ray).map_or(chain, |inside| inside.into_iter().collect());
            let Pieces { segments, lights } = field.pieces(view, ray, &inside);
            let (chain, lights) = (segments.into_iter(), &lights);
            match &formula {
                Some(inner) => integrate::integrate(&Lit { inner, lights }, chain, fragments, scale),
                None => integrate::integrate(&Lit { inner: &transfer, lights }, chain, fragments, scale),
            }
        } else {
            let chain = chain.into_iter();
            match &formula {
                Some(formula) => active.integrate(formula, colors.as_ref(), first + pixel, chain, fragments),
                None => active.integrate(&transfer, colors.as_ref(), first + pixel, chain, fragments),
            }
        };
        pixels[pixel] = light.rgba.map(|v| v as f32);
        depths[pixel] = (light.visible_from * scale) as f32;
    }
    segments.len() as u64
}

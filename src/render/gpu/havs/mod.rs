//! The face renderer on the GPU: what [`crate::render::cpu::havs`] does, in WGSL, with lists of all fragments.
//!
//! 0. **decode**, if the scalars are compressed, and **view transform**, as in [`super::raycast`].
//! 1. **count**: a thread a face looks at the pixels of the face's box and counts its fragments for each pixel. A face with a
//!    large box is cut into pieces, one a tile, which are looked at one by one (`faces.wgsl`, `face_pieces.wgsl`). Rays that
//!    begin in a cell have a fragment there (`face_starts.wgsl`).
//! 2. **scan**: from counts to the place of each pixel's first fragment within its tile. The CPU reads the tiles' sums before a
//!    fragment is written, so that no list is too short.
//! 3. For one band of tiles after the other, as large as there is memory for: **store**, the same stages again, which now
//!    write depth, scalar, rank and cells; **sort**, of pixels with more than a thousand fragments (`face_sort.wgsl`); then
//!    **resolve**, a workgroup a tile, a thread a pixel: fragments are put in order and composited.
//!
//! Order: the fragments of a pixel are stored in any order, then sorted by depth and rank (place in the list), so that images are
//! reproducible. With a complete list in exact order they are then followed from cell to cell, which makes depths within
//! rounding harmless. Without exact order they are sorted by rank and fed through a window of k, with the same errors as on the
//! CPU. In exact order no fragment is ever out of order: there is no first try with a small buffer.
//!
//! Deviations from the CPU path beside those of [`super::raycast`]:
//! 1. Depths are sums of two f32, right to 2^-22 of the face's extent in depth, the error of f32 weights. Closer fragments may be
//!    in the wrong order, and cells decide (`FaceParams::tie`). With thin, visible cells depths are computed in f64.
//! 2. Fragments behind the place where a ray has become opaque are stored and sorted all the same, but not integrated.
//!
//! **Memory.** Fragments of a band fit a budget (256 MiB, two bindings). A tile that does not fit is done in parts; a single pixel that
//! does not is refused with `BeyondGpu`. Bands cost time and change no bit of the image.

mod bands;
mod faces;
mod scene;
#[cfg(test)]
mod stage_tests;
mod steps;

use super::context::Context;
use super::eye;
use super::full_size::{AtFullSize, ImageLeft, LeavesImage, reads_pixels};
use super::layout::{FaceParams, Lists, TILE_PIXELS, flags};
use super::precision::PrecisionChoice;
use super::presenter::Presenter;
use super::readback::{Readback, Words, wait_for};
use super::shaders::{FragmentKind, Precision};
use super::slices::{IN_FLIGHT, SLICE, UnitCost};
use crate::render::cpu::havs::checked_faces;
use crate::render::{Frame, FrameRun, LayerRenderer, RenderError, RenderJob};
use crate::stats::FrameStats;
use crate::visibility::Drawn;
use bands::{Band, Places, bands};
use scene::Scene;
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};
pub use steps::FaceJob;
use steps::{Flight, STEPS, Step, Work, stage};

/// Default bound on the bytes of a band's fragments.
const FRAGMENT_BYTES_MAX: u64 = 256 << 20;
/// Error of a depth: weights are right to 2^-23 of themselves, and there are two; a depth is two weights times differences of
/// the corners' depths, below 2 for a mesh within [-1, 1]. In f64 the error is that of storing a sum of two f32: 2^-48 of it.
fn depth_error(precision: Precision) -> f64 {
    match precision {
        Precision::Single => 1.0 / (1u64 << 22) as f64,
        Precision::Double => 1.0 / (1u64 << 44) as f64,
    }
}
/// Error of view coordinates, relative to the distance (`raycast::stage_tests`).
const TRANSFORM_ERROR: f64 = 1.0 / (1u64 << 40) as f64;

/// The face renderer.
pub type Havs = FrameRun<AtFullSize<FaceLists>>;

/// Draws faces by lists of their fragments, on the GPU.
pub struct FaceLists {
    context: Arc<Context>,
    scene: Scene,
    readback: Readback,
    words: Words,
    /// Submitted slices, oldest first.
    in_flight: VecDeque<Flight>,
    presenter: Presenter,
    precision: PrecisionChoice,
    /// Cost of each step per unit: a workgroup, or a round of sorting.
    costs: [UnitCost; STEPS],
    fragment_bytes: u64,
    /// Fragments of each tile, then of each tile's deepest pixel.
    sums: Vec<u32>,
    bands: Vec<Band>,
    bases: Vec<u32>,
}

impl Havs {
    /// A renderer without a job.
    pub fn new(context: Arc<Context>) -> Self {
        Self::with_fragment_bytes(context, FRAGMENT_BYTES_MAX)
    }

    /// A renderer whose fragments take at most `fragment_bytes` at a time: fewer bytes mean more bands and the same image.
    pub fn with_fragment_bytes(context: Arc<Context>, fragment_bytes: u64) -> Self {
        Self::of(AtFullSize::of(FaceLists {
            context,
            scene: Scene::new(),
            readback: Readback::default(),
            words: Words::new(),
            in_flight: VecDeque::with_capacity(IN_FLIGHT),
            presenter: Presenter::default(),
            precision: PrecisionChoice::default(),
            costs: [UnitCost::default(); STEPS],
            fragment_bytes,
            sums: Vec::new(),
            bands: Vec::new(),
            bases: Vec::new(),
        }))
    }

    /// Number of bands of the last frame.
    pub fn band_count(&self) -> usize {
        self.layer.layer.bands.len()
    }
}

impl FaceLists {
    /// Submits decoding and view transform, and empties the lists.
    fn submit_preparation(&mut self, active: &FaceJob, stats: &mut FrameStats) -> Result<(), RenderError> {
        let Scene { shared, pipelines, lists, .. } = &self.scene;
        let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(lists.get(&self.context)?, 0, Some(4 * active.lists.pieces()));
        shared.record(&self.context, pipelines, &active.params, &active.target, &mut encoder, stats)?;
        self.scene.shared.submit(&self.context, encoder)
    }

    /// Submits some units of the present step.
    fn submit_units(&mut self, active: &mut FaceJob, units: Range<usize>, has_pixels: bool) -> Result<(), RenderError> {
        let pipelines = &self.scene.pipelines;
        let (step, context) = (active.step, &self.context);
        let workgroups = active.choose(step, &units);
        self.scene.face_params.write(context, 0, bytemuck::bytes_of(&active.face_params))?;
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = active.target.pass(&mut encoder, "faces", (step == Step::Resolve).then_some(4));
            let stage = stage(step, &active.job, active.precision)
                .ok_or_else(|| context.beyond("a stage has not been prepared".to_owned()))?;
            pipelines.dispatch(context, stage, workgroups, &mut pass)?;
        }
        active.next = units.end;
        let count = units.len();
        let work = if step == Step::Resolve {
            let ends_tiles = self.bands.get(active.band).is_none_or(Band::ends_tiles);
            let slice = (units, has_pixels && ends_tiles);
            Work::Pixels { sent: self.readback.send(context, encoder, &active.target, slice, None)?, ends_tiles }
        } else {
            Work::Plain(context.queue.submit([encoder.finish()]))
        };
        self.in_flight.push_back(Flight { step, units: count, work });
        self.context.check()
    }

    /// Goes on to the next step.
    fn next_step(&mut self, active: &mut FaceJob, stats: &mut FrameStats) -> Result<(), RenderError> {
        active.step = match active.step {
            Step::CountFaces => Step::CountStarts,
            Step::CountStarts => return self.pieces_are_known(active, stats),
            Step::CountPieces => Step::Scan,
            Step::Scan => return self.counts_are_known(active, stats),
            Step::StoreFaces => Step::StoreStarts,
            Step::StoreStarts => Step::StorePieces,
            Step::StorePieces => Step::Sort,
            Step::Sort => Step::Resolve,
            Step::Resolve => {
                active.band += 1;
                return self.begin_band(active);
            }
            Step::End => Step::End,
        };
        active.begin_step(&self.bands);
        Ok(())
    }

    /// Reads the number of pieces of large faces. If not all fitted, the frame begins again with more room.
    fn pieces_are_known(&mut self, active: &mut FaceJob, stats: &mut FrameStats) -> Result<(), RenderError> {
        let mut pieces = [0];
        self.words.read(&self.context, self.scene.lists.get(&self.context)?, 0, &mut pieces)?;
        let [pieces] = pieces;
        if pieces <= active.face_params.piece_capacity {
            (active.pieces, active.step) = (pieces, Step::CountPieces);
            active.begin_step(&self.bands);
            return Ok(());
        }
        self.scene.grow_pieces(&self.context, active.lists, u64::from(pieces), &mut active.face_params)?;
        stats.entry_retries += 1;
        active.step = Step::CountFaces;
        active.begin_step(&self.bands);
        self.abandon()?;
        self.submit_preparation(active, stats)
    }

    /// Reads how many fragments each tile has, and divides the image into bands.
    fn counts_are_known(&mut self, active: &mut FaceJob, stats: &mut FrameStats) -> Result<(), RenderError> {
        let (context, lists) = (&self.context, self.scene.lists.get(&self.context)?);
        let tiles = active.lists.tiles as usize;
        self.sums.resize(2 * tiles, 0);
        // Behind the sums, the fragments of the deepest pixels.
        self.words.read(context, lists, active.lists.sums(), &mut self.sums)?;
        let (sums, deepest) = self.sums.split_at(tiles);
        stats.fragments = sums.iter().map(|&sum| u64::from(sum)).sum();
        let kind = FragmentKind::of(&active.job);
        let capacity = Scene::fragment_capacity(context, kind, self.fragment_bytes);
        let (words, places_at) = (&mut self.words, active.lists.pixels());
        let places = |tile: usize| -> Result<Places, RenderError> {
            let mut places = [0; TILE_PIXELS];
            words.read(context, lists, places_at + (TILE_PIXELS * tile) as u64, &mut places)?;
            Ok(places)
        };
        let refused = |fragments: u32| {
            context.beyond(format!("a pixel has {fragments} fragments, and there is memory for {capacity}"))
        };
        bands(sums, deepest, capacity, places, refused, &mut self.bands)?;
        let most = self.bands.iter().map(|band| band.fragments).max().unwrap_or_default();
        self.scene.reserve_fragments(context, kind, most, capacity, &mut active.face_params)?;
        active.band = 0;
        self.begin_band(active)
    }

    /// Writes the first slots of the next band's tiles, and begins the band.
    fn begin_band(&mut self, active: &mut FaceJob) -> Result<(), RenderError> {
        let Some(band) = self.bands.get(active.band) else {
            active.step = Step::End;
            return Ok(());
        };
        self.bases.clear();
        let mut base = 0u32.wrapping_sub(band.skipped);
        for &sum in &self.sums[band.tiles.clone()] {
            self.bases.push(base);
            base = base.wrapping_add(sum);
        }
        let at = 4 * (active.lists.bases() + band.tiles.start as u64);
        self.scene.lists.write(&self.context, at, bytemuck::cast_slice(&self.bases))?;
        let face_params = &mut active.face_params;
        (face_params.first_tile, face_params.end_tile) = (band.tiles.start as u32, band.tiles.end as u32);
        (face_params.first_pixel, face_params.end_pixel) = (band.pixels.start as u32, band.pixels.end as u32);
        active.step = Step::StoreFaces;
        active.begin_step(&self.bands);
        Ok(())
    }

    /// Waits for submitted work and takes its pixels, if any.
    fn collect(&mut self, flight: Flight, active: &FaceJob, frame: &mut Frame) -> Result<(), RenderError> {
        let context = &self.context;
        let waiting = Instant::now();
        let times = match flight.work {
            Work::Plain(submission) => {
                wait_for(context, submission)?;
                None
            }
            Work::Pixels { sent, ends_tiles } => self.readback.collect(context, sent, |slice| {
                if ends_tiles && reads_pixels(&active.job, frame) {
                    slice.copy_pixels(&mut frame.planes, &active.params, active.job.mesh.positions.scale);
                }
                frame.stats.add_counts(&slice.counts());
                slice.add_times_to(&mut frame.stats, context)
            })?,
        };
        let ms = times.map_or_else(|| waiting.elapsed().as_secs_f64() * 1e3, |[_, resolve]| resolve);
        self.costs[flight.step as usize % STEPS].add(ms, flight.units);
        Ok(())
    }

    /// The face parameters that are known before the upload.
    fn face_params(job: &RenderJob, drawn: &Drawn, precision: Precision, eye_distance: f64) -> FaceParams {
        FaceParams {
            drawn_count: drawn.ids.len() as u32,
            end_pixel: TILE_PIXELS as u32,
            k: u32::from(job.k_buffer.k),
            tie: (depth_error(precision) + TRANSFORM_ERROR * (eye_distance + 2.0)) as f32,
            flags: if drawn.is_complete { flags::COMPLETE } else { 0 }
                | if job.k_buffer.exact_order { flags::EXACT_ORDER } else { 0 },
            ..FaceParams::default()
        }
    }
}

impl LeavesImage for FaceLists {
    fn context(&self) -> &Arc<Context> {
        &self.context
    }

    fn left<'a>(&'a self, job: &'a FaceJob) -> ImageLeft<'a> {
        ImageLeft { target: &job.target, params: &job.params, vertices: &self.scene.shared.vertices.vertices }
    }
}

impl LayerRenderer for FaceLists {
    type Job = FaceJob;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<FaceJob>, RenderError> {
        let drawn = checked_faces(&job)?;
        let view = job.local_view();
        frame.stats.on_gpu = true;
        frame.stats.faces_total = job.mesh.topology.connectivity().faces.len() as u64;
        self.context.check_job(&job)?;
        let mut params = eye::params(&self.context, &view)?;
        self.bands.clear();
        if self.scene.shared.table.shows_nothing(&job) || job.active.count() == 0 || drawn.ids.is_empty() {
            // All pixels are transparent: the frame is complete.
            frame.clear(view.plane_px());
            return Ok(None);
        }
        self.presenter.prepare(&self.context, &job, frame)?;
        let eye_cells = faces::eye_cells(&job, &view);
        let precision = self.precision.of(self.context.has_f64(), &job);
        let mut face_params = Self::face_params(&job, &drawn, precision, view.eye.length());
        face_params.eye_count = eye_cells.len() as u32;
        self.scene.make_pipelines(&self.context, &job, precision)?;
        let target = self.scene.update(&self.context, &job, &drawn, &eye_cells, &mut params, &mut face_params)?;
        frame.stats.faces_drawn = drawn.ids.len() as u64;
        frame.stats.in_f64 = precision == Precision::Double;
        frame.stats.bytes_uploaded = self.scene.shared.bytes_sent;
        self.costs.iter_mut().for_each(UnitCost::begin_frame);
        let lists = Lists { tiles: params.tile_count() as u64 };
        let step = Step::CountFaces;
        let active = FaceJob { job, precision, params, face_params, target, lists, step, next: 0, pieces: 0, band: 0 };
        self.submit_preparation(&active, &mut frame.stats)?;
        Ok(Some(active))
    }

    fn advance(&mut self, budget: Duration, active: &mut FaceJob, frame: &mut Frame) -> Result<bool, RenderError> {
        let slice_started = Instant::now();
        loop {
            let (step, end) = (active.step, active.units(active.step, &self.bands).end);
            if step != Step::End && active.next >= end {
                self.next_step(active, &mut frame.stats)?;
                continue;
            }
            if step != Step::End && self.in_flight.len() < IN_FLIGHT {
                let cost = self.costs[step as usize % STEPS];
                let count = cost.units_for(budget, step.first_units(), step.most_units()).max(step.least_units());
                let units = active.next..end.min(active.next.saturating_add(count));
                self.submit_units(active, units, reads_pixels(&active.job, frame))?;
                continue;
            }
            if let Some(flight) = self.in_flight.pop_front() {
                self.collect(flight, active, frame)?;
            }
            if step == Step::End && self.in_flight.is_empty() {
                self.costs.iter_mut().for_each(UnitCost::end_frame);
                self.presenter.present(&self.context, &active.target.planes.color, frame)?;
                return Ok(true);
            }
            if slice_started.elapsed() >= budget {
                return Ok(false);
            }
        }
    }

    fn abandon(&mut self) -> Result<(), RenderError> {
        let sent = self.in_flight.drain(..).filter_map(|flight| match flight.work {
            Work::Pixels { sent, .. } => Some(sent),
            Work::Plain(_) => None,
        });
        self.readback.abandon(&self.context, sent)
    }

    fn slice(&self) -> Duration {
        SLICE
    }
}

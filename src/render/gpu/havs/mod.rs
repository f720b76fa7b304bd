//! The face renderer on the GPU: what [`crate::render::cpu::havs`] does, in WGSL, with lists of all fragments.
//!
//! 0. **decode**, if the step is compressed, and **view transform**, as in [`super::raycast`].
//! 1. **count**: a thread a face looks at the pixels of the face's box and counts its fragments for each pixel. A face with a
//!    large box is cut into pieces, one a tile, which are looked at one by one (`faces.wgsl`, `face_pieces.wgsl`). Rays that
//!    begin in a cell have a fragment there (`face_starts.wgsl`).
//! 2. **scan**: from counts to the place of each pixel's first fragment within its tile. The CPU reads the tiles' sums: so
//!    much is known of the frame before a fragment is written, and no list is too short.
//! 3. For one band of tiles after the other, as large as there is memory for: **store**, the same stages again, which now
//!    write depth, scalar, rank and cells; **sort**, of pixels with more than a thousand fragments (`face_sort.wgsl`); then
//!    **resolve**, a workgroup a tile, a thread a pixel: fragments are put in order and composited.
//!
//! Order: the fragments of a pixel are stored in any order, and sorted by depth and rank (place in the list); so images are the
//! same each time. With a complete list in exact order they are then followed from cell to cell, which makes depths within
//! rounding harmless. Without exact order they are sorted by rank and fed through a window of k, as the CPU does it: the same
//! mistakes. In exact order no fragment is ever out of order: there is no first try with a small buffer.
//!
//! Deviations from the CPU path beside those of [`super::raycast`]:
//! 1. Depths are sums of two f32. They are right to what f32 knows of the weights: 2^-22 of the face's extent in depth. Closer
//!    ones may be in the wrong order, and cells decide (`FaceParams::tie`). With thin, visible cells they are computed in f64.
//! 2. Rays that have become opaque cost their fragments all the same, but no integration.

mod bands;
mod faces;
mod scene;
#[cfg(test)]
mod stage_tests;
mod steps;

use super::context::Context;
use super::layout::{FaceParams, Lists, Params, TILE_PIXELS, depth_of, flags};
use super::precision::PrecisionChoice;
use super::presenter::Presenter;
use super::readback::{Slot, Words};
use super::shaders::{FragmentKind, Precision, Stage};
use super::slices::{IN_FLIGHT, SLICE, SLOTS, dispatch};
use crate::render::cpu::havs::checked_faces;
use crate::render::{Advance, Frame, RenderError, RenderJob, Renderer};
use crate::stats::FrameStats;
use bands::{Band, Places, bands};
use scene::Scene;
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};
use steps::{ActiveJob, Flight, STEPS, Step, StepCost, stage};

/// Bytes that all fragments of a band take at most, unless told otherwise.
const FRAGMENT_BYTES_MAX: u64 = 256 << 20;
/// Error of a depth: weights are right to 2^-23 of themselves, and there are two; a depth is two weights times differences of
/// the corners' depths, below 2 for a mesh within [-1, 1]. In f64 what is stored, a sum of two f32, decides: 2^-48 of it.
fn depth_error(precision: Precision) -> f64 {
    match precision {
        Precision::Single => 1.0 / (1u64 << 22) as f64,
        Precision::Double => 1.0 / (1u64 << 44) as f64,
    }
}
/// Error of view coordinates, relative to the distance (`raycast::stage_tests`).
const TRANSFORM_ERROR: f64 = 1.0 / (1u64 << 40) as f64;

/// The face renderer.
pub struct Havs {
    context: Arc<Context>,
    scene: Scene,
    slots: [Slot; SLOTS],
    words: Words,
    /// Oldest first.
    in_flight: VecDeque<Flight>,
    frame: Frame,
    active_job: Option<ActiveJob>,
    presenter: Presenter,
    precision: PrecisionChoice,
    costs: [StepCost; STEPS],
    fragment_bytes: u64,
    /// Fragments of each tile.
    sums: Vec<u32>,
    bands: Vec<Band>,
    bases: Vec<u32>,
}

impl Havs {
    /// A renderer without a job.
    pub fn new(context: Arc<Context>) -> Self {
        Self::with_fragment_bytes(context, FRAGMENT_BYTES_MAX)
    }

    /// A renderer whose fragments take so many bytes at a time at most: the less, the more bands, and the same image.
    pub fn with_fragment_bytes(context: Arc<Context>, fragment_bytes: u64) -> Self {
        Self {
            context,
            scene: Scene::new(),
            slots: std::array::from_fn(|_| Slot::new()),
            words: Words::new(),
            in_flight: VecDeque::with_capacity(SLOTS),
            frame: Frame::default(),
            active_job: None,
            presenter: Presenter::new(),
            precision: PrecisionChoice::default(),
            costs: [StepCost::default(); STEPS],
            fragment_bytes,
            sums: Vec::new(),
            bands: Vec::new(),
            bases: Vec::new(),
        }
    }

    /// The GPU that it renders on.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// Bands of the last frame.
    pub fn band_count(&self) -> usize {
        self.bands.len()
    }

    /// Waits for what is under way and forgets it.
    fn drain(&mut self) -> Result<(), RenderError> {
        while let Some(flight) = self.in_flight.pop_front() {
            if let (Some((slot, _)), Some(target)) = (flight.slot, &self.scene.target) {
                self.slots[slot].collect(&self.context, |_| (), target)?;
            }
        }
        Ok(())
    }

    /// Submits view transform and empty lists.
    fn submit_preparation(&mut self) -> Result<(), RenderError> {
        let Some(active) = &self.active_job else { return Ok(()) };
        let Scene { pipelines, target: Some(target), params, lists, .. } = &self.scene else { return Ok(()) };
        params.write(&self.context, 0, bytemuck::bytes_of(&active.params))?;
        let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(lists.get(&self.context)?, 0, Some(4 * active.lists.pieces()));
        let decoder = &self.scene.scalars.decoder;
        if decoder.pending_vertices() > 0 {
            self.frame.stats.vertices_decoded_on_gpu = u64::from(decoder.pending_vertices());
            let timestamp_writes = target.stamps(6);
            let descriptor = wgpu::ComputePassDescriptor { label: Some("decode"), timestamp_writes };
            decoder.record(&self.context, &mut encoder.begin_compute_pass(&descriptor))?;
        }
        {
            let timestamp_writes = target.stamps(0);
            let descriptor = wgpu::ComputePassDescriptor { label: Some("view transform"), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pipelines.set(&self.context, Stage::ViewTransform, &mut pass)?;
            dispatch(&mut pass, active.params.vertex_count.div_ceil(256));
        }
        self.context.queue.submit([encoder.finish()]);
        self.scene.scalars.decoder.forget();
        self.context.check()
    }

    /// Submits some units of the present step.
    fn submit_units(&mut self, units: Range<usize>) -> Result<(), RenderError> {
        let Some(active) = &mut self.active_job else { return Ok(()) };
        let Scene { pipelines, target: Some(target), .. } = &self.scene else { return Ok(()) };
        let (step, context) = (active.step, &self.context);
        let workgroups = active.choose(step, &units);
        let face_params = &active.face_params;
        self.scene.face_params.write(context, 0, bytemuck::bytes_of(face_params))?;
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let timestamp_writes = if step == Step::Resolve { target.stamps(4) } else { None };
            let descriptor = wgpu::ComputePassDescriptor { label: Some("faces"), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            let stage = stage(step, &active.job, active.precision)
                .ok_or_else(|| context.beyond("a stage has not been prepared".to_owned()))?;
            pipelines.set(context, stage, &mut pass)?;
            dispatch(&mut pass, workgroups);
        }
        let mut slot = None;
        if step == Step::Resolve {
            let is_free = |slot: &usize| !self.in_flight.iter().any(|f| f.slot.is_some_and(|(used, _)| used == *slot));
            let free = (0..SLOTS).find(is_free).unwrap_or_default();
            let ends_tiles = self.bands.get(active.band).is_none_or(Band::ends_tiles);
            let has_pixels = self.frame.texture.is_none() && ends_tiles;
            self.slots[free].record(context, &mut encoder, target, units.clone(), has_pixels, None)?;
            slot = Some((free, ends_tiles));
        }
        let submission = context.queue.submit([encoder.finish()]);
        if let Some((slot, _)) = slot {
            self.slots[slot].submitted(context, submission.clone())?;
        }
        active.next = units.end;
        self.in_flight.push_back(Flight { step, units: units.len(), submission, slot });
        self.context.check()
    }

    /// Goes on to the next step that has something to do.
    fn next_step(&mut self) -> Result<(), RenderError> {
        let Some(active) = &mut self.active_job else { return Ok(()) };
        active.step = match active.step {
            Step::CountFaces => Step::CountStarts,
            Step::CountStarts => return self.pieces_are_known(),
            Step::CountPieces => Step::Scan,
            Step::Scan => return self.counts_are_known(),
            Step::StoreFaces => Step::StoreStarts,
            Step::StoreStarts => Step::StorePieces,
            Step::StorePieces => Step::Sort,
            Step::Sort => Step::Resolve,
            Step::Resolve => {
                active.band += 1;
                return self.begin_band();
            }
            Step::End => Step::End,
        };
        self.begin_step();
        Ok(())
    }

    fn begin_step(&mut self) {
        if let Some(active) = &mut self.active_job {
            active.next = active.units(active.step, &self.bands).start;
        }
    }

    /// Reads how many pieces the large faces have been cut into. If there was no room for them, the frame begins again.
    fn pieces_are_known(&mut self) -> Result<(), RenderError> {
        let Some(active) = &mut self.active_job else { return Ok(()) };
        self.sums.clear();
        self.words.read(&self.context, self.scene.lists.get(&self.context)?, 0, 1, &mut self.sums)?;
        let pieces = self.sums.first().copied().unwrap_or_default();
        if pieces <= active.face_params.piece_capacity {
            (active.pieces, active.step) = (pieces, Step::CountPieces);
            self.begin_step();
            return Ok(());
        }
        self.scene.grow_pieces(&self.context, active.lists, u64::from(pieces), &mut active.face_params)?;
        self.frame.stats.entry_retries += 1;
        active.step = Step::CountFaces;
        self.begin_step();
        self.drain()?;
        self.submit_preparation()
    }

    /// Reads how many fragments each tile has, and divides the image into bands.
    fn counts_are_known(&mut self) -> Result<(), RenderError> {
        let Some(active) = &mut self.active_job else { return Ok(()) };
        let (context, lists) = (&self.context, self.scene.lists.get(&self.context)?);
        self.sums.clear();
        // Behind the sums, what the deepest pixels have.
        self.words.read(context, lists, active.lists.sums(), 2 * active.lists.tiles, &mut self.sums)?;
        let (sums, deepest) = self.sums.split_at_checked(active.lists.tiles as usize).unwrap_or_default();
        self.frame.stats.fragments = sums.iter().map(|&sum| u64::from(sum)).sum();
        let kind = FragmentKind::of(&active.job);
        let capacity = Scene::fragment_capacity(context, kind, self.fragment_bytes);
        let (words, places_at) = (&mut self.words, active.lists.pixels());
        let places = |tile: usize| -> Result<Places, RenderError> {
            let mut places = Vec::with_capacity(TILE_PIXELS);
            words.read(context, lists, places_at + (TILE_PIXELS * tile) as u64, TILE_PIXELS as u64, &mut places)?;
            Ok(Places::try_from(places).unwrap_or([0; TILE_PIXELS]))
        };
        let refused = |fragments: u32| {
            context.beyond(format!("a pixel has {fragments} fragments, and there is memory for {capacity}"))
        };
        bands(sums, deepest, capacity, places, refused, &mut self.bands)?;
        let most = self.bands.iter().map(|band| band.fragments).max().unwrap_or_default();
        self.scene.reserve_fragments(context, kind, most, capacity, &mut active.face_params)?;
        active.band = 0;
        self.begin_band()
    }

    /// Tells the GPU where the fragments of the tiles of the next band are.
    fn begin_band(&mut self) -> Result<(), RenderError> {
        let Some(active) = &mut self.active_job else { return Ok(()) };
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
        self.begin_step();
        Ok(())
    }

    /// Waits for the oldest slice and takes its pixels, if it has some.
    fn collect_slice(&mut self) -> Result<(), RenderError> {
        let (Some(flight), Some(active), Some(target)) =
            (self.in_flight.pop_front(), &self.active_job, &self.scene.target)
        else {
            return Ok(());
        };
        let context = &self.context;
        let waiting = Instant::now();
        let mut measured = None;
        if let Some((slot, ends_tiles)) = flight.slot {
            let frame = &mut self.frame;
            let origin = depth_of(active.params.depth_origin) + f64::from(active.params.pivot);
            let scale = active.job.mesh.positions.scale;
            let times = self.slots[slot].collect(
                context,
                |slice| {
                    if frame.texture.is_none() && ends_tiles {
                        slice.copy_pixels(frame, |depth| ((f64::from(depth) + origin) * scale) as f32);
                    }
                    frame.stats.add_counts(&slice.counts());
                    slice.milliseconds(context)
                },
                target,
            )?;
            if let Some([transform, _, resolve, decode]) = times {
                let stats = &mut frame.stats;
                if stats.vertices_decoded_on_gpu > 0 {
                    stats.ms_gpu_decode = Some(decode);
                }
                stats.ms_gpu_transform = Some(transform);
                *stats.ms_gpu_walk.get_or_insert(0.0) += resolve;
                measured = Some(resolve);
            }
        } else {
            let submission_index = Some(flight.submission);
            let waited = context.device.poll(wgpu::PollType::Wait { submission_index, timeout: None });
            context.check()?;
            waited.map_err(|e| RenderError::Gpu { adapter: context.adapter().name.clone(), problem: e.to_string() })?;
        }
        let ms = measured.unwrap_or_else(|| waiting.elapsed().as_secs_f64() * 1e3);
        let cost = &mut self.costs[flight.step as usize % STEPS];
        cost.unit.last = Some(ms / flight.units.max(1) as f64);
        cost.ms += ms;
        cost.units += flight.units;
        Ok(())
    }

    /// The frame is done: what its steps have cost is what the next one's are expected to.
    fn finish(&mut self) -> Result<(), RenderError> {
        for cost in &mut self.costs {
            if cost.units > 0 {
                cost.unit.mean = Some(cost.ms / cost.units as f64);
            }
        }
        match &self.scene.target {
            Some(target) => self.presenter.present(&self.context, &target.color, &mut self.frame),
            None => Ok(()),
        }
    }

    fn work(&mut self, budget: Duration) -> Result<bool, RenderError> {
        let slice_started = Instant::now();
        loop {
            let Some(active) = &self.active_job else { return Ok(true) };
            let (step, end) = (active.step, active.units(active.step, &self.bands).end);
            if step != Step::End && active.next >= end {
                self.next_step()?;
                continue;
            }
            if step != Step::End && self.in_flight.len() < IN_FLIGHT {
                let cost = self.costs[step as usize % STEPS].unit;
                let count = cost.units_for(budget, step.first_units(), step.most_units()).max(step.least_units());
                let units = active.next..end.min(active.next.saturating_add(count));
                self.submit_units(units)?;
                continue;
            }
            if self.in_flight.is_empty() {
                self.finish()?;
                return Ok(true);
            }
            self.collect_slice()?;
            if self.in_flight.is_empty() && step == Step::End {
                continue;
            }
            if slice_started.elapsed() >= budget {
                return Ok(false);
            }
        }
    }
}

impl Renderer for Havs {
    fn begin(&mut self, job: RenderJob) -> Result<(), RenderError> {
        job.check()?;
        let job = job.with_optics_of_joint_table();
        let drawn = checked_faces(&job)?;
        self.context.check()?;
        self.active_job = None;
        self.drain()?;
        let started = Instant::now();
        let view = job.local_view();
        let cells_active = job.active.count();
        let is_empty = self.scene.table.is_clear(&job) || cells_active == 0 || drawn.faces.is_empty();
        self.frame.stats = FrameStats {
            cells_active: cells_active as u64,
            cells_total: job.active.universe() as u64,
            faces_drawn: if is_empty { 0 } else { drawn.faces.len() as u64 },
            faces_total: job.mesh.topology.faces.len() as u64,
            on_gpu: true,
            ..job.stats.clone()
        };
        let far = || {
            self.context
                .beyond("the eye is too far from the mesh, or the view too wide, for single precision".to_owned())
        };
        let mut params = Params::of_view(&view).ok_or_else(far)?;
        self.bands.clear();
        if is_empty {
            // All pixels are clear, and here.
            self.frame.clear(view.width_px, view.height_px);
        } else {
            self.presenter.prepare(&self.context, &job, &mut self.frame)?;
            let eye_cells = faces::eye_cells(&job, &view);
            let precision = self.precision.of(self.context.has_f64(), &job);
            self.frame.stats.in_f64 = precision == Precision::Double;
            let mut face_params = FaceParams {
                drawn_count: drawn.faces.len() as u32,
                eye_count: eye_cells.len() as u32,
                end_pixel: TILE_PIXELS as u32,
                k: u32::from(job.k_buffer.k),
                tie: (depth_error(precision) + TRANSFORM_ERROR * (view.eye.length() + 2.0)) as f32,
                flags: if drawn.is_complete { flags::COMPLETE } else { 0 }
                    | if job.k_buffer.exact_order { flags::EXACT_ORDER } else { 0 },
                ..FaceParams::default()
            };
            self.scene.make_pipelines(&self.context, &job, precision)?;
            self.scene.update(&self.context, &job, &drawn, &eye_cells, &mut params, &mut face_params)?;
            self.frame.stats.bytes_uploaded = self.scene.bytes_sent;
            for cost in &mut self.costs {
                (cost.ms, cost.units) = (0.0, 0);
            }
            let ms_before = job.stats.ms_decode + job.stats.ms_order;
            let lists = Lists { tiles: params.tile_count() as u64 };
            let step = Step::CountFaces;
            let active = ActiveJob {
                job,
                precision,
                params,
                face_params,
                lists,
                step,
                next: 0,
                pieces: 0,
                band: 0,
                started,
                ms_before,
            };
            self.active_job = Some(active);
            self.submit_preparation()?;
        }
        self.frame.stats.ms_order += started.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    fn advance(&mut self, budget: Duration) -> Result<Advance<'_>, RenderError> {
        if self.active_job.is_none() {
            return Ok(Advance::Done(&self.frame));
        }
        if self.active_job.as_ref().is_some_and(|active| active.job.cancel.is_cancelled()) {
            return Ok(Advance::Partial(&self.frame));
        }
        let slice_started = Instant::now();
        let worked = self.work(budget);
        if worked.is_err() {
            // Nothing of the job is wanted any more; what failed has been said.
            self.active_job = None;
            let _ = self.drain();
            self.in_flight.clear();
        }
        let done = worked?;
        self.frame.stats.ms_render += slice_started.elapsed().as_secs_f64() * 1e3;
        if let Some(active) = &self.active_job {
            self.frame.stats.ms_frame = active.ms_before + active.started.elapsed().as_secs_f64() * 1e3;
        }
        if done {
            self.active_job = None;
            return Ok(Advance::Done(&self.frame));
        }
        Ok(Advance::Partial(&self.frame))
    }

    fn take_frame(&mut self, replacement: Frame) -> Frame {
        std::mem::replace(&mut self.frame, replacement)
    }

    fn slice(&self) -> Duration {
        SLICE
    }
}

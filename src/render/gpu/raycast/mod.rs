//! The ray caster on the GPU: the stages of [`crate::render::cpu::raycast`] in WGSL.
//!
//! 0. **decode**, if the step is compressed: a thread a vertex.
//! 1. **view transform**: a thread a vertex.
//! 2. **entries**: a thread an entry face. Counted per tile, places summed, stored: lists of any length in one buffer. If
//!    it is too small the frame is begun again with a larger one.
//! 3. **walk**, with **composite** inside: a workgroup a tile, a thread a pixel.
//!
//! Deviations from the CPU path:
//! 1. f32: view coordinates are sums of two, sheared coordinates are right to the last bits near the ray, edge functions that
//!    lose digits are computed again with the rounding errors of their products (`shaders/lib/ray.wgsl`). Places in meshes
//!    with thin, visible cells are computed in f64 if the device has it ([`super::precision`]).
//! 2. Starts of paths are not sorted in a list: a thread looks for the nearest four, and again for the next four.
//! 3. Scalars and nodes are seen through a [`ScalarMap`](crate::optics::ScalarMap).
//!
//! Images go back through a ring of buffers. Nothing is allocated on the GPU, and no bind group made, in a frame that
//! differs from the last in camera, step or table only.

mod records;
mod scene;
#[cfg(test)]
pub(super) mod stage_tests;

use super::context::Context;
use super::eye::{self, sides};
use super::layout::{Params, depth_of};
use super::precision::PrecisionChoice;
use super::presenter::Presenter;
use super::readback::Slot;
use super::shaders::{Gathering, Precision, Stage};
use super::slices::{GROUPS_MAX, IN_FLIGHT, SLICE, SLOTS, UnitCost, dispatch};
use crate::render::cpu::raycast::skips::CellChoice;
use crate::render::{Advance, Frame, RenderError, RenderJob, Renderer};
use crate::stats::FrameStats;
use scene::Scene;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Tiles of the first slice of all, before anything is known of their cost.
const FIRST_TILES: usize = 32;

/// The GPU ray caster.
pub struct Raycast {
    context: Arc<Context>,
    scene: Scene,
    slots: [Slot; SLOTS],
    /// Slots under way, oldest first.
    in_flight: VecDeque<usize>,
    frame: Frame,
    active_job: Option<ActiveJob>,
    presenter: Presenter,
    choice: CellChoice,
    precision: PrecisionChoice,
    /// Of a tile.
    cost: UnitCost,
}

/// What a job under way needs beyond the buffers.
struct ActiveJob {
    job: RenderJob,
    precision: Precision,
    params: Params,
    tile_count: usize,
    /// First tile that has not been submitted.
    next_tile: usize,
    /// Tiles that have come back.
    tiles_done: usize,
    /// Milliseconds that these took.
    walk_ms: f64,
    started: Instant,
    /// Milliseconds that the frame took before it came here.
    ms_before: f64,
}

impl Raycast {
    /// A renderer without a job.
    pub fn new(context: Arc<Context>) -> Self {
        Self {
            context,
            scene: Scene::new(),
            slots: std::array::from_fn(|_| Slot::new()),
            in_flight: VecDeque::with_capacity(SLOTS),
            frame: Frame::default(),
            active_job: None,
            choice: CellChoice::default(),
            precision: PrecisionChoice::default(),
            presenter: Presenter::new(),
            cost: UnitCost::default(),
        }
    }

    /// The GPU that it renders on.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// Waits for what is under way and forgets it.
    fn drain(&mut self) -> Result<(), RenderError> {
        while let Some(slot) = self.in_flight.pop_front() {
            if let Some(target) = &self.scene.target {
                self.slots[slot].collect(&self.context, |_| (), target)?;
            }
        }
        Ok(())
    }

    /// Submits view transform and entries.
    fn submit_preparation(&mut self) -> Result<(), RenderError> {
        let Some(active) = &self.active_job else { return Ok(()) };
        let Scene { pipelines, target: Some(target), params, bins, .. } = &self.scene else { return Ok(()) };
        params.write(&self.context, 0, bytemuck::bytes_of(&active.params))?;
        let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(bins.get(&self.context)?, 0, Some(4 * (target.tile_count() as u64 + 1)));
        let decoder = &self.scene.scalars.decoder;
        if decoder.pending_vertices() > 0 {
            self.frame.stats.vertices_decoded_on_gpu = u64::from(decoder.pending_vertices());
            let timestamp_writes = target.stamps(6);
            let descriptor = wgpu::ComputePassDescriptor { label: Some("decode"), timestamp_writes };
            decoder.record(&self.context, &mut encoder.begin_compute_pass(&descriptor))?;
        }
        let (vertices, items) = (active.params.vertex_count, active.params.item_count);
        for (label, timestamp_writes, stages) in [
            ("view transform", target.stamps(0), &[(Stage::ViewTransform, vertices.div_ceil(256))][..]),
            (
                "entries",
                target.stamps(2),
                &[
                    (Stage::EntriesCount, items.div_ceil(64)),
                    (Stage::EntriesScan, 1),
                    (Stage::EntriesStore, items.div_ceil(64)),
                ][..],
            ),
        ] {
            let descriptor = wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            for &(stage, workgroups) in stages {
                pipelines.set(&self.context, stage, &mut pass)?;
                dispatch(&mut pass, workgroups);
            }
        }
        self.context.queue.submit([encoder.finish()]);
        self.scene.scalars.decoder.forget();
        self.context.check()
    }

    /// Submits the walk of the next `count` tiles.
    fn submit_tiles(&mut self, count: usize) -> Result<(), RenderError> {
        let Some(active) = &mut self.active_job else { return Ok(()) };
        let Scene { pipelines, target: Some(target), params, bins, .. } = &self.scene else { return Ok(()) };
        let tiles = active.next_tile..(active.next_tile + count).min(active.tile_count);
        active.params.first_tile = tiles.start as u32;
        params.write(&self.context, 0, bytemuck::bytes_of(&active.params))?;
        let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let timestamp_writes = target.stamps(4);
        {
            let descriptor = wgpu::ComputePassDescriptor { label: Some("walk"), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            let walk = Stage::Walk(Gathering::of(&active.job), active.precision);
            pipelines.set(&self.context, walk, &mut pass)?;
            pass.dispatch_workgroups(tiles.len() as u32, 1, 1);
        }
        let free = (0..SLOTS).find(|slot| !self.in_flight.contains(slot)).unwrap_or_default();
        let slot = &mut self.slots[free];
        active.next_tile = tiles.end;
        let total = Some((bins.get(&self.context)?, 4 * active.tile_count as u64));
        slot.record(&self.context, &mut encoder, target, tiles, self.frame.texture.is_none(), total)?;
        let submission = self.context.queue.submit([encoder.finish()]);
        slot.submitted(&self.context, submission)?;
        self.in_flight.push_back(free);
        self.context.check()
    }

    /// Waits for the oldest slice and takes its pixels; whether the frame has to begin again with longer lists.
    fn collect_slice(&mut self) -> Result<bool, RenderError> {
        let (Some(slot), Some(active), Some(target)) =
            (self.in_flight.pop_front(), &mut self.active_job, &self.scene.target)
        else {
            return Ok(false);
        };
        let (context, frame, cost) = (&self.context, &mut self.frame, &mut self.cost);
        let capacity = u64::from(active.params.pair_capacity);
        let origin = depth_of(active.params.depth_origin) + f64::from(active.params.pivot);
        let scale = active.job.mesh.positions.scale;
        let waiting = Instant::now();
        let short = self.slots[slot].collect(
            context,
            |slice| {
                let needed = slice.total();
                if needed > capacity {
                    return Some(needed);
                }
                if frame.texture.is_none() {
                    slice.copy_pixels(frame, |depth| ((f64::from(depth) + origin) * scale) as f32);
                }
                frame.stats.add_counts(&slice.counts());
                let times = slice.milliseconds(context);
                if let Some([transform, entries, walk, decode]) = times {
                    if frame.stats.vertices_decoded_on_gpu > 0 {
                        frame.stats.ms_gpu_decode = Some(decode);
                    }
                    frame.stats.ms_gpu_transform = Some(transform);
                    frame.stats.ms_gpu_entries = Some(entries);
                    *frame.stats.ms_gpu_walk.get_or_insert(0.0) += walk;
                }
                let ms = times.map_or_else(|| waiting.elapsed().as_secs_f64() * 1e3, |t| t[2]);
                cost.last = Some(ms / slice.tiles.len().max(1) as f64);
                active.walk_ms += ms;
                active.tiles_done += slice.tiles.len();
                if active.tiles_done >= active.tile_count {
                    cost.mean = Some(active.walk_ms / active.tile_count.max(1) as f64);
                }
                None
            },
            target,
        )?;
        let Some(needed) = short else { return Ok(false) };
        self.begin_again(needed)?;
        Ok(true)
    }

    /// The lists were too short for what was found: room for all, and the frame from its start.
    fn begin_again(&mut self, pairs_needed: u64) -> Result<(), RenderError> {
        self.drain()?;
        let Some(active) = &mut self.active_job else { return Ok(()) };
        self.scene.grow_lists(&self.context, pairs_needed, &mut active.params)?;
        (active.next_tile, active.tiles_done, active.walk_ms) = (0, 0, 0.0);
        self.frame.stats.entry_retries += 1;
        self.submit_preparation()
    }

    fn work(&mut self, budget: Duration) -> Result<bool, RenderError> {
        let slice_started = Instant::now();
        loop {
            let tiles = self.cost.units_for(budget, FIRST_TILES, GROUPS_MAX as usize);
            let Some(active) = &self.active_job else { return Ok(true) };
            if active.next_tile < active.tile_count && self.in_flight.len() < IN_FLIGHT {
                self.submit_tiles(tiles)?;
                continue;
            }
            if self.in_flight.is_empty() {
                return Ok(true);
            }
            self.collect_slice()?;
            let Some(active) = &self.active_job else { return Ok(true) };
            let done = active.tiles_done >= active.tile_count;
            if done && let Some(target) = &self.scene.target {
                self.presenter.present(&self.context, &target.color, &mut self.frame)?;
            }
            if done || slice_started.elapsed() >= budget {
                return Ok(done);
            }
        }
    }
}

impl Renderer for Raycast {
    fn begin(&mut self, job: RenderJob) -> Result<(), RenderError> {
        job.check()?;
        let job = job.with_optics_of_joint_table();
        self.context.check()?;
        self.active_job = None;
        self.drain()?;
        let started = Instant::now();
        let view = job.local_view();
        let cells_active = job.active.count();
        self.frame.stats = FrameStats {
            cells_active: cells_active as u64,
            cells_total: job.active.universe() as u64,
            on_gpu: true,
            ..job.stats.clone()
        };
        let far = || {
            self.context
                .beyond("the eye is too far from the mesh, or the view too wide, for single precision".to_owned())
        };
        let mut params = Params::of_view(&view).ok_or_else(far)?;
        let is_empty = self.scene.table.is_clear(&job) || cells_active == 0;
        if is_empty {
            // All pixels are clear, and here.
            self.frame.clear(view.width_px, view.height_px);
        } else {
            let job = RenderJob { active: self.choice.cells(&job), ..job };
            self.presenter.prepare(&self.context, &job, &mut self.frame)?;
            let eye_cells: Vec<_> =
                eye::cells(&job, &view).into_iter().map(|cell| [cell, sides(&job, &view, cell)]).collect();
            let precision = self.precision.of(self.context.has_f64(), &job);
            self.scene.update(&self.context, &job, precision, &eye_cells, &mut params)?;
            self.frame.stats.in_f64 = precision == Precision::Double;
            self.frame.stats.entry_faces = u64::from(params.face_count);
            self.frame.stats.bytes_uploaded = self.scene.bytes_sent;
            let tile_count = params.tile_count();
            let ms_before = job.stats.ms_decode + job.stats.ms_order;
            let active = ActiveJob {
                job,
                precision,
                params,
                tile_count,
                next_tile: 0,
                tiles_done: 0,
                walk_ms: 0.0,
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

//! The ray caster on the GPU: the stages of [`crate::render::cpu::raycast`] in WGSL.
//!
//! 0. **decode**, if the scalars are compressed: a thread a vertex, or a cell if cells have them.
//! 1. **view transform**: a thread a vertex, or the scalars of eight cells.
//! 2. **entries**: a thread an entry face. Entries are counted per tile, the counts summed to places, and the entries stored: lists of any
//!    length in one buffer. If it is too small the frame is begun again with a larger one.
//! 3. **walk**, with **composite** inside: a workgroup a tile, a thread a pixel; or, where contrast decides which rays are cast, a
//!    thread a ray of a list ([`sampling`]).
//!
//! Deviations from the CPU path:
//! 1. f32: view coordinates are sums of two, sheared coordinates are right to the last bits near the ray, edge functions that
//!    lose digits are computed again with the rounding errors of their products (`shaders/lib/ray.wgsl`). Geometry of meshes
//!    with thin, visible cells is computed in f64 if the device has it ([`super::precision`]).
//! 2. Starts of paths are not sorted in a list: a thread searches for the nearest four, and again for the next four.
//! 3. Scalars and nodes are mapped by a [`ScalarMap`](crate::optics::ScalarMap).
//!
//! On llvmpipe, 1M cells at 512 x 512, view transform and entries take 4 ms of a frame and the walk the rest; one loop for all pieces of a
//! segment takes 0.65 of the time of a short and a long path, since eight rays share a vector.
//!
//! Images go back through a ring of buffers. Nothing is allocated on the GPU, and no bind group made, in a frame that
//! differs from the last in camera, step or table only.

mod rays;
mod records;
mod sampling;
mod scene;
#[cfg(test)]
pub(super) mod stage_tests;

use super::context::Context;
use super::eye::{self, sides};
use super::full_size::{AtFullSize, ImageLeft, LeavesImage, reads_pixels};
use super::layout::Params;
use super::precision::PrecisionChoice;
use super::presenter::Presenter;
use super::readback::{Readback, Sent};
use super::shaders::{Along, Precision, Stage};
use super::slices::{GROUPS_MAX, IN_FLIGHT, SLICE, UnitCost};
use super::target::Target;
use crate::render::adaptive::LAST;
use crate::render::cpu::raycast::skips::CellChoice;
use crate::render::{Contrast, Frame, FrameRun, LayerRenderer, RenderError, RenderJob};
use crate::stats::FrameStats;
use sampling::{Sampling, SamplingCosts};
use scene::Scene;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Tiles of the very first slice, whose cost is unknown.
const FIRST_TILES: usize = 32;

/// The GPU ray caster.
pub type Raycast = FrameRun<AtFullSize<CellWalk>>;

/// Walks from cell to cell, on the GPU.
pub struct CellWalk {
    context: Arc<Context>,
    scene: Scene,
    readback: Readback,
    /// Submitted slices, oldest first.
    in_flight: VecDeque<Sent>,
    presenter: Presenter,
    choice: CellChoice,
    precision: PrecisionChoice,
    /// Estimated milliseconds per tile.
    cost: UnitCost,
    sampling_costs: SamplingCosts,
    /// Contrast of the image just completed, if finer ones follow.
    preview: Option<Contrast>,
}

/// A job of [`CellWalk`].
pub struct WalkJob {
    job: RenderJob,
    precision: Precision,
    params: Params,
    target: Arc<Target>,
    tile_count: usize,
    /// First tile that has not been submitted.
    next_tile: usize,
    /// Number of tiles that have come back.
    tiles_done: usize,
    /// Contrast-adaptive sampling; `None` if all rays are cast at once.
    sampling: Option<Sampling>,
}

impl Raycast {
    /// A renderer without a job.
    pub fn new(context: Arc<Context>) -> Self {
        Self::of(AtFullSize::of(CellWalk {
            context,
            scene: Scene::new(),
            readback: Readback::default(),
            in_flight: VecDeque::with_capacity(IN_FLIGHT),
            choice: CellChoice::default(),
            precision: PrecisionChoice::default(),
            presenter: Presenter::default(),
            cost: UnitCost::default(),
            sampling_costs: SamplingCosts::default(),
            preview: None,
        }))
    }
}

impl CellWalk {
    /// Submits decoding, view transform and entries.
    fn submit_preparation(&mut self, active: &WalkJob, stats: &mut FrameStats) -> Result<(), RenderError> {
        let target = &active.target;
        let Scene { shared, pipelines, bins, .. } = &self.scene;
        let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(bins.get(&self.context)?, 0, Some(4 * (target.tile_count() as u64 + 1)));
        if let Some(sampling) = &active.sampling {
            self.scene.rays.begin(&self.context, &mut encoder, target.size_px, sampling.contrast())?;
        }
        shared.record(&self.context, pipelines, &active.params, target, &mut encoder, stats)?;
        {
            let mut pass = target.pass(&mut encoder, "entries", Some(2));
            let groups = active.params.item_count.div_ceil(64);
            for (stage, workgroups) in
                [(Stage::EntriesCount, groups), (Stage::EntriesScan, 1), (Stage::EntriesStore, groups)]
            {
                pipelines.dispatch(&self.context, stage, workgroups, &mut pass)?;
            }
        }
        self.scene.shared.submit(&self.context, encoder)
    }

    /// Uploads a job that may be visible, and submits the stages before the walk.
    fn begin_walk(&mut self, job: RenderJob, frame: &mut Frame) -> Result<WalkJob, RenderError> {
        let contrasts = job.contrasts();
        let sampling = (!contrasts.is_empty()).then(|| Sampling::new(&job, contrasts));
        if sampling.is_none() {
            frame.stats.rays_by_level[LAST] = job.view.ray_count();
        }
        // Which rays meet a cell decides which others are cast: the domain has no transparent cells, whatever is skipped.
        let domain = job.domain.clone().filter(|_| sampling.is_some());
        let job = RenderJob { active: domain.unwrap_or_else(|| self.choice.cells(&job)), ..job };
        let view = job.local_view();
        let mut params = eye::params(&self.context, &view)?;
        self.presenter.prepare(&self.context, &job, frame)?;
        let eye_cells: Vec<_> =
            eye::cells(&job, &view).into_iter().map(|cell| [cell, sides(&job, &view, cell)]).collect();
        let precision = self.precision.of(self.context.has_f64(), &job);
        let is_sampled = sampling.is_some();
        let target = self.scene.update(&self.context, &job, (precision, is_sampled), &eye_cells, &mut params)?;
        frame.stats.in_f64 = precision == Precision::Double;
        frame.stats.entry_faces = u64::from(params.face_count);
        frame.stats.bytes_uploaded = self.scene.shared.bytes_sent;
        let tile_count = params.tile_count();
        let active = WalkJob { job, precision, params, target, tile_count, next_tile: 0, tiles_done: 0, sampling };
        self.begin_costs();
        self.submit_preparation(&active, &mut frame.stats)?;
        Ok(active)
    }

    /// Begins an image's costs, whether its rays are cast tile by tile or from a list.
    fn begin_costs(&mut self) {
        self.cost.begin_frame();
        self.sampling_costs.group.begin_frame();
    }

    /// Works on an image of all rays for about `budget`. Returns whether it is done.
    fn advance_tiles(
        &mut self,
        budget: Duration,
        active: &mut WalkJob,
        frame: &mut Frame,
    ) -> Result<bool, RenderError> {
        let slice_started = Instant::now();
        loop {
            if active.next_tile < active.tile_count && self.in_flight.len() < IN_FLIGHT {
                self.submit_tiles(active, budget, reads_pixels(&active.job, frame))?;
                continue;
            }
            let Some(sent) = self.in_flight.pop_front() else { return Ok(true) };
            self.collect_tiles(sent, active, frame)?;
            let is_done = active.tiles_done >= active.tile_count;
            if is_done {
                self.presenter.present(&self.context, &active.target.planes.color, frame)?;
            }
            if is_done || slice_started.elapsed() >= budget {
                return Ok(is_done);
            }
        }
    }

    /// Submits the next tiles: their walk, or, if sampling is adaptive, the filling between their rays.
    fn submit_tiles(&mut self, active: &mut WalkJob, budget: Duration, has_pixels: bool) -> Result<(), RenderError> {
        let fills = active.sampling.is_some();
        let cost = if fills { self.sampling_costs.fill } else { self.cost };
        let count = cost.units_for(budget, FIRST_TILES, GROUPS_MAX as usize);
        let target = &active.target;
        let Scene { shared, pipelines, bins, rays, .. } = &self.scene;
        let tiles = active.next_tile..(active.next_tile + count).min(active.tile_count);
        active.params.first_tile = tiles.start as u32;
        shared.params.write(&self.context, 0, bytemuck::bytes_of(&active.params))?;
        let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = target.pass(&mut encoder, if fills { "fill" } else { "walk" }, Some(4));
            if fills {
                rays.record_fill(&self.context, tiles.len(), &mut pass)?;
            } else {
                let walk = Stage::Walk(Along::of(&active.job), active.precision);
                pipelines.dispatch(&self.context, walk, tiles.len() as u32, &mut pass)?;
            }
        }
        active.next_tile = tiles.end;
        let total = if fills { None } else { Some((bins.get(&self.context)?, 4 * active.tile_count as u64, 1)) };
        let words = total.into_iter().chain(shared.flow.lists.told(&self.context)?);
        let sent = self.readback.send(&self.context, encoder, target, (tiles, has_pixels), words)?;
        self.in_flight.push_back(sent);
        Ok(())
    }

    /// Waits for tiles and takes their pixels, or begins the frame again if its lists were too short.
    fn collect_tiles(&mut self, sent: Sent, active: &mut WalkJob, frame: &mut Frame) -> Result<(), RenderError> {
        let fills = active.sampling.is_some();
        let (context, cost) = (&self.context, if fills { &mut self.sampling_costs.fill } else { &mut self.cost });
        let waiting = Instant::now();
        let lists = &self.scene.shared.flow.lists;
        let needed = self.readback.collect(context, sent, |slice| {
            let [pairs, told @ ..] = [0, 1, 2].map(|word| if fills { 0 } else { slice.word_sent(word) });
            if pairs > active.params.pair_capacity || lists.is_incomplete(told) {
                return Some((u64::from(pairs), told));
            }
            if reads_pixels(&active.job, frame) {
                slice.copy_pixels(&mut frame.planes, &active.params, active.job.mesh.positions.scale);
            }
            if !fills {
                frame.stats.add_counts(&slice.counts());
            }
            let times = slice.add_times_to(&mut frame.stats, context);
            if let Some([entries, _]) = times {
                frame.stats.ms_gpu_entries = Some(entries);
            }
            let ms = times.map_or_else(|| waiting.elapsed().as_secs_f64() * 1e3, |[_, ms]| ms);
            cost.add(ms, slice.tiles.len());
            active.tiles_done += slice.tiles.len();
            if active.tiles_done >= active.tile_count {
                cost.end_frame();
            }
            None
        })?;
        needed.map_or(Ok(()), |needed| self.begin_again(needed, active, &mut frame.stats))
    }

    /// Begins the frame again with longer lists: of so many pairs, and of what was told of splats.
    fn begin_again(
        &mut self,
        needed: (u64, [u32; 2]),
        active: &mut WalkJob,
        stats: &mut FrameStats,
    ) -> Result<(), RenderError> {
        self.abandon()?;
        self.scene.grow_lists(&self.context, needed, active.sampling.is_some(), &mut active.params)?;
        (active.next_tile, active.tiles_done) = (0, 0);
        active.sampling.iter_mut().for_each(|sampling| sampling.fills = false);
        self.begin_costs();
        stats.entry_retries += 1;
        self.submit_preparation(active, stats)
    }
}

impl LeavesImage for CellWalk {
    fn context(&self) -> &Arc<Context> {
        &self.context
    }

    fn left<'a>(&'a self, job: &'a WalkJob) -> ImageLeft<'a> {
        ImageLeft { target: &job.target, params: &job.params, vertices: &self.scene.shared.vertices.vertices }
    }
}

impl LayerRenderer for CellWalk {
    type Job = WalkJob;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<WalkJob>, RenderError> {
        frame.stats.on_gpu = true;
        let view = job.local_view();
        self.context.check_job(&job)?;
        self.preview = None;
        eye::params(&self.context, &view)?;
        if self.scene.shared.table.shows_nothing(&job) {
            // All pixels are transparent: the frame is complete.
            frame.clear(view.plane_px());
            return Ok(None);
        }
        self.begin_walk(job, frame).map(Some)
    }

    fn advance(&mut self, budget: Duration, active: &mut WalkJob, frame: &mut Frame) -> Result<bool, RenderError> {
        if self.preview.take().is_some() {
            self.go_on(active, frame)?;
        }
        if active.sampling.is_some() {
            self.advance_rays(budget, active, frame)
        } else {
            self.advance_tiles(budget, active, frame)
        }
    }

    fn draws_flow(&self) -> bool {
        self.context.draws_flow()
    }

    fn preview(&self) -> Option<Contrast> {
        self.preview
    }

    fn abandon(&mut self) -> Result<(), RenderError> {
        self.readback.abandon(&self.context, self.in_flight.drain(..))
    }

    fn slice(&self) -> Duration {
        SLICE
    }
}

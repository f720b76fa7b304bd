//! Contrast-adaptive sampling on the GPU ([`crate::render::adaptive`]).
//!
//! ```text
//! each slice, as often as there are steps:
//!     plan     the next step, if the walk has been given all rays of the last one
//!     decide   which blocks of that step are split by their own corners
//!     append   blocks beside them are split, too; rays in split blocks are appended to the list
//!     slice    workgroups for the walk: as many as the rays need and the slice may still start
//!     walk     these rays
//! once a slice comes back as the last: the image is filled, tile by tile
//! ```
//!
//! The image's progress and the numbers of workgroups are in the GPU's memory: the CPU submits one slice after the other, all of them
//! alike, and reads nothing in between. A slice reads back counts, and whether it was the last; slices behind the last do nothing. A ray is
//! appended once, by the thread that sets its bit first, so that the list has no more places than the image has pixels.
//!
//! Colours and depths of rays lie in planes of their own: `fill` cannot read the texture that it writes. Which rays are cast depends on
//! these and on the bits of rays that met a cell, and on neither slices nor the order of the list.
//! Boxes of faces are found by the CPU's rules in sums of two f32 (`lib/close_boxes.wgsl`); of 104,000 blocks of small images none was split
//! otherwise (`stage_tests/rays.rs`). At a contrast of 0, and behind previews, the shader of images without contrast draws all rays.

use super::{CellWalk, FIRST_TILES, WalkJob};
use crate::render::gpu::context::Context;
use crate::render::gpu::full_size::reads_pixels;
use crate::render::gpu::layout::RayLists;
use crate::render::gpu::readback::{Sent, SliceData, counted};
use crate::render::gpu::shaders::{Along, Stage};
use crate::render::gpu::slices::{GROUPS_MAX, IN_FLIGHT, UnitCost};
use crate::render::{Contrast, Frame, LayerRenderer, RenderError, RenderJob};
use crate::stats::FrameStats;
use std::time::{Duration, Instant};

/// Progress of an image's sampling.
pub(super) struct Sampling {
    /// Contrast thresholds that are still to be reached, the next one last; at least one.
    contrasts: Vec<f32>,
    /// The job of all rays, if it follows the last threshold.
    exact: Option<Box<RenderJob>>,
    /// Whether all rays have been cast, and the image is being filled.
    pub(super) fills: bool,
}

/// Milliseconds per workgroup of rays and per filled tile, kept from frame to frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SamplingCosts {
    pub(super) group: UnitCost,
    pub(super) fill: UnitCost,
}

/// What a slice of rays reads back.
struct Told {
    pairs: u64,
    is_done: bool,
    groups: usize,
    ms: f64,
    counts: FrameStats,
}

impl Sampling {
    /// The sampling of a job with contrasts, the greatest first; a last one of 0 means all rays.
    pub(super) fn new(job: &RenderJob, mut contrasts: Vec<f32>) -> Self {
        let is_whole = contrasts.last() == Some(&0.0);
        if is_whole {
            contrasts.pop();
        }
        contrasts.reverse();
        let exact = || RenderJob { contrast: None, previews: Vec::new(), domain: None, ..job.clone() };
        let exact = is_whole.then(|| Box::new(exact()));
        Self { contrasts, exact, fills: false }
    }

    /// The threshold that is being reached.
    pub(super) fn contrast(&self) -> f32 {
        self.contrasts.last().copied().unwrap_or(0.0)
    }
}

impl Told {
    fn new(slice: &SliceData<'_>, stats: &mut FrameStats, context: &Context) -> Self {
        let count = |i: usize| u64::from(slice.word_sent(i));
        let sum = |i: usize| count(RayLists::SUMS + 2 * i) | count(RayLists::SUMS + 2 * i + 1) << 32;
        let times = slice.add_times_to(stats, context);
        if let Some([entries, _]) = times {
            stats.ms_gpu_entries = Some(entries);
        }
        Self {
            pairs: count(RayLists::PAIRS),
            is_done: count(RayLists::IS_DONE) == 1,
            groups: slice.word_sent(RayLists::GROUPS_DONE) as usize,
            ms: times.map_or(0.0, |[_, walk]| walk),
            counts: FrameStats {
                rays_by_level: [0, 1, 2, 3].map(|level| count(RayLists::RAYS_BY_LEVEL + level)),
                // The GPU has no layers beside the cells.
                blocks_split: [0, 1, 2, 3, 4]
                    .map(|reason| if reason < 4 { count(RayLists::BLOCKS + reason) } else { 0 }),
                blocks_filled: count(RayLists::BLOCKS + 4),
                ..counted(std::array::from_fn(sum))
            },
        }
    }
}

impl CellWalk {
    /// Works on an adaptively sampled image for about `budget`. Returns whether it is done.
    pub(super) fn advance_rays(
        &mut self,
        budget: Duration,
        active: &mut WalkJob,
        frame: &mut Frame,
    ) -> Result<bool, RenderError> {
        let started = Instant::now();
        while let Some(sampling) = &active.sampling {
            let (fills, has_room) = (sampling.fills, self.in_flight.len() < IN_FLIGHT);
            if !fills && has_room {
                self.submit_rays(active, budget)?;
                continue;
            }
            if fills && has_room && active.next_tile < active.tile_count {
                self.submit_tiles(active, budget, reads_pixels(&active.job, frame))?;
                continue;
            }
            let Some(sent) = self.in_flight.pop_front() else { return Ok(true) };
            if !fills {
                self.collect_rays(sent, active, frame)?;
            } else {
                self.collect_tiles(sent, active, frame)?;
                if active.tiles_done >= active.tile_count {
                    return self.end_contrast(active, frame);
                }
            }
            if started.elapsed() >= budget {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Submits the next rays.
    fn submit_rays(&mut self, active: &WalkJob, budget: Duration) -> Result<(), RenderError> {
        let groups = self.sampling_costs.group.units_for(budget, FIRST_TILES, GROUPS_MAX as usize);
        let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = active.target.pass(&mut encoder, "walk of rays", Some(4));
            let walk = Stage::WalkRays(Along::of(&active.job), active.precision);
            self.scene.rays.record(&self.context, walk, groups, &mut pass)?;
        }
        let head = [(self.scene.rays.rays.get(&self.context)?, 0, RayLists::HEAD)];
        let sent = self.readback.send(&self.context, encoder, &active.target, (0..0, false), head)?;
        self.in_flight.push_back(sent);
        Ok(())
    }

    /// Waits for a slice of rays; after the last one filling begins.
    fn collect_rays(&mut self, sent: Sent, active: &mut WalkJob, frame: &mut Frame) -> Result<(), RenderError> {
        let waiting = Instant::now();
        let context = self.context.clone();
        let told = |slice: &SliceData<'_>| Told::new(slice, &mut frame.stats, &context);
        let mut told = self.readback.collect(&context, sent, told)?;
        if told.pairs > u64::from(active.params.pair_capacity) {
            return self.begin_again((told.pairs, [0; 2]), active, &mut frame.stats);
        }
        if context.timestamp_period_ns().is_none() {
            told.ms = waiting.elapsed().as_secs_f64() * 1e3;
        }
        let Some(sampling) = &mut active.sampling else { return Ok(()) };
        if told.groups > 0 {
            self.sampling_costs.group.add(told.ms, told.groups);
        }
        if !told.is_done {
            return Ok(());
        }
        self.sampling_costs.group.end_frame();
        self.sampling_costs.fill.begin_frame();
        (sampling.fills, active.next_tile, active.tiles_done) = (true, 0, 0);
        let (stats, counts) = (&mut frame.stats, told.counts);
        stats.add_counts(&counts);
        stats.rays_by_level.iter_mut().zip(counts.rays_by_level).for_each(|(sum, count)| *sum += count);
        (stats.blocks_split, stats.blocks_filled) = (counts.blocks_split, counts.blocks_filled);
        // Slices submitted behind the last one do nothing.
        self.abandon()
    }

    /// Presents the image of a contrast. Returns whether it was the last.
    fn end_contrast(&mut self, active: &mut WalkJob, frame: &mut Frame) -> Result<bool, RenderError> {
        self.presenter.present(&self.context, &active.target.planes.color, frame)?;
        let Some(sampling) = &mut active.sampling else { return Ok(true) };
        let reached = sampling.contrasts.pop();
        if sampling.contrasts.is_empty() && sampling.exact.is_none() {
            return Ok(true);
        }
        self.preview = reached.and_then(Contrast::new);
        Ok(false)
    }

    /// Goes on to the next contrast; the last image may still be shown.
    pub(super) fn go_on(&mut self, active: &mut WalkJob, frame: &mut Frame) -> Result<(), RenderError> {
        let Some(sampling) = &mut active.sampling else { return Ok(()) };
        self.presenter.renew(&self.context, frame)?;
        if sampling.contrasts.is_empty() {
            return sampling.exact.take().map_or(Ok(()), |exact| self.begin_exact(*exact, active, frame));
        }
        sampling.fills = false;
        self.sampling_costs.group.begin_frame();
        self.scene.rays.sharpen(&self.context, active.target.size_px, sampling.contrast())
    }

    /// Begins the image of all rays with the walk by tiles: the walk of a list may round otherwise.
    fn begin_exact(&mut self, job: RenderJob, active: &mut WalkJob, frame: &mut Frame) -> Result<(), RenderError> {
        // Counts are those of the final image alone.
        let stats = &mut frame.stats;
        (stats.entries, stats.steps, stats.segments, stats.rays_hit) = Default::default();
        (stats.rays_stopped_early, stats.out_of_order, stats.broken_paths) = Default::default();
        (stats.rays_by_level, stats.blocks_split, stats.blocks_filled) = Default::default();
        *active = self.begin_walk(job, frame)?;
        Ok(())
    }
}

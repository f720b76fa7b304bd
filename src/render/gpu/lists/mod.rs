//! Fragment lists: what is drawn element by element, faces ([`super::havs`]) or cells as points ([`super::points`]), with lists of all
//! fragments.
//!
//! 0. **decode**, if the scalars are compressed, and **view transform**, as in [`super::raycast`].
//! 1. **count**: a thread an element looks at the pixels of the element's box and counts its fragments for each pixel. An element with a
//!    large box is cut into pieces, one a tile, which are looked at one by one (`fragments_find.wgsl`, `fragments_pieces.wgsl`).
//! 2. **scan**: from counts to the place of each pixel's first fragment within its tile. The CPU reads the tiles' sums before a
//!    fragment is written, so that no list is too short.
//! 3. For one band of tiles after the other, as large as there is memory for: **store**, the same stages again, which now
//!    write fragments; **sort**, of pixels with more than a thousand fragments (`fragments_sort.wgsl`); then **resolve**
//!    (`fragments_resolve.wgsl`), a workgroup a tile, a thread a pixel: fragments are put in order and composited.
//!
//! The fragments of a pixel are stored in any order, then sorted by what does not depend on it, so that images are reproducible.
//!
//! **Memory.** Fragments of a band fit a budget (256 MiB, two bindings). A tile that does not fit is done in parts; a single pixel that
//! does not is refused with `BeyondGpu`. Bands cost time and change no bit of the image.

pub(super) mod bands;
mod drawn;
mod scene;
pub(super) mod steps;

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::eye;
use super::full_size::{AtFullSize, ImageLeft, LeavesImage, reads_pixels};
use super::layout::{ListParams, Lists, TILE_PIXELS};
use super::precision::PrecisionChoice;
use super::presenter::Presenter;
use super::readback::{Readback, Words, wait_for};
use super::shaders::{FragmentKind, Precision};
use super::slices::{IN_FLIGHT, SLICE, UnitCost};
use crate::camera::View;
use crate::render::{Frame, FrameRun, LayerRenderer, RenderError, RenderJob};
use crate::stats::FrameStats;
use crate::visibility::Drawn;
use bands::{Band, Places, bands};
use scene::Scene;
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};
pub use steps::ListJob;
use steps::{Flight, STEPS, Stages, Step, Work};

/// Default bound on the bytes of a band's fragments.
const FRAGMENT_BYTES_MAX: u64 = 256 << 20;

/// What fragments are of: faces, or cells as points.
pub trait Elements: Default + Send {
    /// Checks a job, and notes in the statistics how many elements there are; returns those to draw.
    ///
    /// # Errors
    /// If the job lacks them, they are not in the mesh, or the GPU cannot draw them.
    fn check(&mut self, context: &Context, job: &RenderJob, stats: &mut FrameStats) -> Result<Arc<Drawn>, RenderError>;

    /// How a job is drawn; the geometry of its cells asks for `precision`.
    fn plan(&mut self, job: &RenderJob, drawn: &Drawn, view: &View, precision: Precision) -> Plan;

    /// Uploads what is not on the GPU yet, and completes the parameters. Returns whether a buffer was made, and the bytes sent.
    ///
    /// # Errors
    /// If it does not fit.
    fn upload(
        &mut self,
        context: &Context,
        job: &RenderJob,
        list_params: &mut ListParams,
    ) -> Result<(bool, u64), RenderError>;

    /// What comes behind the list of elements.
    fn behind_list(&self) -> &[u8];

    /// The buffers that stages may bind.
    fn buffers(&self) -> Vec<&GrowingBuffer>;

    /// Notes in the statistics that `drawn` elements are drawn, of which `culled` have no pixel and `enlarged` were widened.
    fn count(stats: &mut FrameStats, drawn: u64, culled: u32, enlarged: u32);
}

/// How a job is drawn.
pub struct Plan {
    pub(in crate::render::gpu) stages: Stages,
    pub(in crate::render::gpu) kind: FragmentKind,
    pub(in crate::render::gpu) precision: Precision,
    /// The parameters that are known before the upload.
    pub(in crate::render::gpu) list_params: ListParams,
}

/// Draws elements by lists of their fragments, on the GPU.
pub struct FragmentLists<E> {
    context: Arc<Context>,
    pub(in crate::render::gpu) scene: Scene<E>,
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
    pub(in crate::render::gpu) bands: Vec<Band>,
    bases: Vec<u32>,
}

impl<E: Elements> FrameRun<AtFullSize<FragmentLists<E>>> {
    /// A renderer without a job.
    pub fn new(context: Arc<Context>) -> Self {
        Self::with_fragment_bytes(context, FRAGMENT_BYTES_MAX)
    }

    /// A renderer whose fragments take at most `fragment_bytes` at a time: fewer bytes mean more bands and the same image.
    pub fn with_fragment_bytes(context: Arc<Context>, fragment_bytes: u64) -> Self {
        Self::of(AtFullSize::of(FragmentLists {
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

impl<E: Elements> FragmentLists<E> {
    /// Submits decoding and view transform, and empties the lists.
    fn submit_preparation(&mut self, active: &ListJob, stats: &mut FrameStats) -> Result<(), RenderError> {
        let Scene { shared, pipelines, lists, .. } = &self.scene;
        let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(lists.get(&self.context)?, 0, Some(4 * active.lists.pieces()));
        shared.record(&self.context, pipelines, &active.params, &active.target, &mut encoder, stats)?;
        self.scene.shared.submit(&self.context, encoder)
    }

    /// Submits some units of the present step.
    pub(in crate::render::gpu) fn submit_units(
        &mut self,
        active: &mut ListJob,
        units: Range<usize>,
        has_pixels: bool,
    ) -> Result<(), RenderError> {
        let pipelines = &self.scene.pipelines;
        let (step, context) = (active.step, &self.context);
        let workgroups = active.choose(step, &units);
        self.scene.list_params.write(context, 0, bytemuck::bytes_of(&active.list_params))?;
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = active.target.pass(&mut encoder, "fragments", (step == Step::Resolve).then_some(4));
            let stage = active.stages.of(step);
            let stage = stage.ok_or_else(|| context.beyond("a step has no stage".to_owned()))?;
            pipelines.dispatch(context, stage, workgroups, &mut pass)?;
        }
        active.next = units.end;
        let count = units.len();
        let work = if step == Step::Resolve {
            let ends_tiles = self.bands.get(active.band).is_none_or(Band::ends_tiles);
            let slice = (units, has_pixels && ends_tiles);
            Work::Pixels { sent: self.readback.send(context, encoder, &active.target, slice, [])?, ends_tiles }
        } else {
            Work::Plain(context.queue.submit([encoder.finish()]))
        };
        self.in_flight.push_back(Flight { step, units: count, work });
        self.context.check()
    }

    /// Goes on to the next step.
    pub(in crate::render::gpu) fn next_step(
        &mut self,
        active: &mut ListJob,
        stats: &mut FrameStats,
    ) -> Result<(), RenderError> {
        active.step = match active.step {
            Step::Count => Step::CountStarts,
            Step::CountStarts => return self.pieces_are_known(active, stats),
            Step::CountPieces => Step::Scan,
            Step::Scan => return self.counts_are_known(active, stats),
            Step::Store => Step::StoreStarts,
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

    /// Reads the number of pieces of large elements, and of places of splats. If not all fitted, the frame begins again with more room.
    fn pieces_are_known(&mut self, active: &mut ListJob, stats: &mut FrameStats) -> Result<(), RenderError> {
        let mut head = [0; 3];
        self.words.read(&self.context, self.scene.lists.get(&self.context)?, 0, &mut head)?;
        let [pieces, culled, enlarged] = head;
        E::count(stats, u64::from(active.list_params.drawn_count), culled, enlarged);
        let mut told = [0; 2];
        if let Some((bins, at, _)) = self.scene.shared.flow.lists.told(&self.context)? {
            self.words.read(&self.context, bins, at / 4, &mut told)?;
        }
        let has_flow = !self.scene.shared.flow.lists.is_incomplete(told);
        if pieces <= active.list_params.piece_capacity && has_flow {
            (active.pieces, active.step) = (pieces, Step::CountPieces);
            active.begin_step(&self.bands);
            return Ok(());
        }
        self.scene.grow(&self.context, active.lists, (pieces, told), &mut active.list_params)?;
        stats.entry_retries += 1;
        active.step = Step::Count;
        active.begin_step(&self.bands);
        self.abandon()?;
        self.submit_preparation(active, stats)
    }

    /// Reads how many fragments each tile has, and divides the image into bands.
    fn counts_are_known(&mut self, active: &mut ListJob, stats: &mut FrameStats) -> Result<(), RenderError> {
        let (context, lists) = (&self.context, self.scene.lists.get(&self.context)?);
        let tiles = active.lists.tiles as usize;
        self.sums.resize(2 * tiles, 0);
        // Behind the sums, the fragments of the deepest pixels.
        self.words.read(context, lists, active.lists.sums(), &mut self.sums)?;
        let (sums, deepest) = self.sums.split_at(tiles);
        stats.fragments = sums.iter().map(|&sum| u64::from(sum)).sum();
        let kind = active.kind;
        let capacity = Scene::<E>::fragment_capacity(context, kind, self.fragment_bytes);
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
        self.scene.reserve_fragments(context, kind, most, capacity, &mut active.list_params)?;
        active.band = 0;
        self.begin_band(active)
    }

    /// Writes the first slots of the next band's tiles, and begins the band.
    fn begin_band(&mut self, active: &mut ListJob) -> Result<(), RenderError> {
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
        let list_params = &mut active.list_params;
        (list_params.first_tile, list_params.end_tile) = (band.tiles.start as u32, band.tiles.end as u32);
        (list_params.first_pixel, list_params.end_pixel) = (band.pixels.start as u32, band.pixels.end as u32);
        active.step = Step::Store;
        active.begin_step(&self.bands);
        Ok(())
    }

    /// Waits for submitted work and takes its pixels, if any.
    fn collect(&mut self, flight: Flight, active: &ListJob, frame: &mut Frame) -> Result<(), RenderError> {
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
}

impl<E: Elements> LeavesImage for FragmentLists<E> {
    fn context(&self) -> &Arc<Context> {
        &self.context
    }

    fn left<'a>(&'a self, job: &'a ListJob) -> ImageLeft<'a> {
        ImageLeft { target: &job.target, params: &job.params, vertices: &self.scene.shared.vertices.vertices }
    }
}

impl<E: Elements> LayerRenderer for FragmentLists<E> {
    type Job = ListJob;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<ListJob>, RenderError> {
        frame.stats.on_gpu = true;
        let drawn = self.scene.elements.check(&self.context, &job, &mut frame.stats)?;
        let view = job.local_view();
        self.context.check_job(&job)?;
        let mut params = eye::params(&self.context, &view)?;
        self.bands.clear();
        if self.scene.shared.table.shows_nothing(&job) || drawn.ids.is_empty() && !job.has_other_layers() {
            // All pixels are transparent: the frame is complete.
            frame.clear(view.plane_px());
            return Ok(None);
        }
        self.presenter.prepare(&self.context, &job, frame)?;
        let precision = self.precision.of(self.context.has_f64(), &job);
        let plan = self.scene.elements.plan(&job, &drawn, &view, precision);
        let Plan { stages, kind, precision, mut list_params } = plan;
        self.scene.make_pipelines(&self.context, stages, job.flow.is_some())?;
        let target = self.scene.update(&self.context, &job, &drawn, &mut params, &mut list_params)?;
        E::count(&mut frame.stats, drawn.ids.len() as u64, 0, 0);
        frame.stats.in_f64 = precision == Precision::Double;
        frame.stats.bytes_uploaded = self.scene.shared.bytes_sent;
        self.costs.iter_mut().for_each(UnitCost::begin_frame);
        let lists = Lists { tiles: params.tile_count() as u64 };
        let step = Step::Count;
        let active =
            ListJob { job, stages, kind, params, list_params, target, lists, step, next: 0, pieces: 0, band: 0 };
        self.submit_preparation(&active, &mut frame.stats)?;
        Ok(Some(active))
    }

    fn advance(&mut self, budget: Duration, active: &mut ListJob, frame: &mut Frame) -> Result<bool, RenderError> {
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

    fn draws_flow(&self) -> bool {
        self.context.draws_flow()
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

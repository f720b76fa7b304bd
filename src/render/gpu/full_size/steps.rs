//! The steps that enlarge an image, and their slices.

use super::limits::{self, Refused};
use super::scene::{BEFORE_JOINT, Scene, last_stage};
use super::{ImageLeft, Sizing};
use crate::render::gpu::FrameTexture;
use crate::render::gpu::context::Context;
use crate::render::gpu::layout::{LayerLists, Params, TILE_PIXELS};
use crate::render::gpu::presenter::Presenter;
use crate::render::gpu::readback::{Readback, Sent};
use crate::render::gpu::slices::{GROUPS_MAX, IN_FLIGHT, UnitCost};
use crate::render::gpu::target::Target;
use crate::render::upsampling::{Enlargement, UpsampleFilter};
use crate::render::{Frame, RenderError, RenderJob};
use crate::stats::FrameStats;
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A step of enlarging; steps of depth layers have the index of their view, 0 for the full image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Faces(usize),
    Pieces(usize),
    Range,
    Reference(usize),
    Bilinear,
    Filter,
}

/// Pairs of pixels that the first slice of a filter weighs at most: in software, where a pair took 6 ns, 50 ms.
const FIRST_PAIRS: usize = 1 << 23;
/// Pairs that a slice weighs at most. Drivers give a GPU up that works on one submission for two seconds; at ten operations a pair this is
/// less than half a second's work of a GPU of 10^11 operations a second, and those built into processors have more.
const PAIRS_MAX: usize = 1 << 32;

/// Pairs of pixels that a filter weighs in a tile.
fn pairs_of_tile(filter: UpsampleFilter) -> usize {
    let side = if let UpsampleFilter::Joint { kernel_px, .. } = filter { 2 * (kernel_px / 2) + 1 } else { 2 };
    TILE_PIXELS * side * side
}

/// Whether the cost of one filter holds for another.
fn cost_alike(a: UpsampleFilter, b: UpsampleFilter) -> bool {
    a.kind() == b.kind() && pairs_of_tile(a) == pairs_of_tile(b)
}

/// Number of step kinds, each with a cost of its own.
const KINDS: usize = 6;

impl Step {
    /// The steps of a filter, in order.
    fn of(filter: UpsampleFilter) -> &'static [Self] {
        use Step::*;
        match filter {
            UpsampleFilter::Nearest | UpsampleFilter::Bilinear => &[Filter],
            UpsampleFilter::Joint { .. } => &[Faces(0), Pieces(0), Range, Reference(0), Bilinear, Filter],
            UpsampleFilter::Joint2x2 { .. } => {
                &[Faces(0), Pieces(0), Range, Reference(0), Faces(1), Pieces(1), Reference(1), Filter]
            }
        }
    }

    fn kind(self) -> usize {
        match self {
            Self::Faces(_) => 0,
            Self::Pieces(_) => 1,
            Self::Range => 2,
            Self::Reference(_) => 3,
            Self::Bilinear => 4,
            Self::Filter => 5,
        }
    }

    /// Whether it draws depth layers.
    fn is_of_layers(self) -> bool {
        !matches!(self, Self::Bilinear | Self::Filter)
    }

    /// Units (workgroups) of the very first slice, whose cost is unknown.
    fn first_units(self, filter: UpsampleFilter) -> usize {
        match self {
            Self::Faces(_) => 64,
            Self::Pieces(_) => 256,
            Self::Filter => (FIRST_PAIRS / pairs_of_tile(filter)).clamp(self.least_units(), 32),
            _ => 32,
        }
    }

    /// Most units of a slice, whatever the budget.
    fn most_units(self, filter: UpsampleFilter) -> usize {
        match self {
            Self::Filter => (PAIRS_MAX / pairs_of_tile(filter)).min(GROUPS_MAX as usize),
            _ => GROUPS_MAX as usize,
        }
    }

    /// Fewest units of a slice, whatever they cost: fewer would leave most of the GPU idle.
    fn least_units(self) -> usize {
        match self {
            Self::Faces(_) | Self::Pieces(_) => 32,
            _ => 4,
        }
    }
}

/// Work that has been submitted.
struct Flight {
    step: Step,
    units: Range<usize>,
    sent: Sent,
}

/// Progress of an image.
pub struct Work {
    enlargement: Arc<Enlargement>,
    params: Params,
    target: Arc<Target>,
    /// World length of a local unit.
    scale: f64,
    /// Index of the step in [`Step::of`].
    at: usize,
    /// First unit of the step that has not been submitted.
    next: usize,
    tiles_done: usize,
}

impl Work {
    fn step(&self) -> Option<Step> {
        Step::of(self.enlargement.filter).get(self.at).copied()
    }

    /// Whether some pieces of large faces have been submitted, and others not.
    #[cfg(test)]
    pub(super) fn is_within_pieces(&self) -> bool {
        matches!(self.step(), Some(Step::Pieces(_))) && self.next > 0
    }

    fn go_to(&mut self, at: usize) {
        (self.at, self.next) = (at, 0);
    }
}

/// What a slice reads back.
struct Told {
    ms: Option<f64>,
    pieces: u32,
    pieces_from: u32,
    pieces_to: u32,
    fell_back: u64,
}

/// Enlarges images to the size of their frames.
pub(super) struct Enlarger {
    pub(super) scene: Scene,
    readback: Readback,
    /// Submitted slices, oldest first.
    in_flight: VecDeque<Flight>,
    presenter: Presenter,
    /// The texture of the last frame, until the next one has its own.
    texture: Option<FrameTexture>,
    costs: [UnitCost; KINDS],
    /// The filter that the cost of step `Filter` belongs to.
    costed: Option<UpsampleFilter>,
    /// The last image that did not fit.
    refused: Option<Refused>,
}

impl Enlarger {
    pub(super) fn new() -> Self {
        Self {
            scene: Scene::new(),
            readback: Readback::default(),
            in_flight: VecDeque::with_capacity(IN_FLIGHT),
            presenter: Presenter::default(),
            texture: None,
            costs: [UnitCost::default(); KINDS],
            costed: None,
            refused: None,
        }
    }

    /// Takes the texture of a frame before the renderer of the small image sees it. A frame whose last job was abandoned has none: that
    /// texture is still here.
    pub(super) fn keep_texture(&mut self, frame: &mut Frame) {
        self.texture = frame.texture.take().or(self.texture.take());
    }

    /// Gives the kept texture to a frame without one.
    pub(super) fn give_texture(&mut self, frame: &mut Frame) {
        frame.texture = frame.texture.take().or(self.texture.take());
    }

    /// Whether an image can be enlarged here, as far as that is known beforehand; `full` is its job.
    pub(super) fn can_do(&self, context: &Context, full: &RenderJob, enlargement: &Enlargement) -> bool {
        let is_refused = self.refused.as_ref().is_some_and(|refused| refused.holds_for(full, enlargement));
        !is_refused && limits::are_kept(context, full, enlargement)
    }

    /// Remembers that an image did not fit, and frees what had been allocated.
    pub(super) fn refuse(&mut self, full: &RenderJob) {
        self.refused = full.enlarge.as_ref().map(|enlargement| Refused::new(full, enlargement));
        self.release();
    }

    /// Frees buffers and planes; the frame's texture stays.
    pub(super) fn release(&mut self) {
        self.scene.release();
        self.readback = Readback::default();
    }

    /// Works on an image for about `budget`. Returns whether the frame is done.
    pub(super) fn enlarge(
        &mut self,
        budget: Duration,
        sizing: &mut Sizing,
        context: &Arc<Context>,
        left: &ImageLeft<'_>,
        frame: &mut Frame,
    ) -> Result<bool, RenderError> {
        let _span = tracing::info_span!("upsample").entered();
        let work = match &mut sizing.work {
            Some(work) => work,
            None => match self.begin(context, &sizing.full, left, frame)? {
                Some(work) => sizing.work.insert(work),
                // The job is cancelled.
                None => return Ok(false),
            },
        };
        self.advance(context, budget, work, left, frame)
    }

    /// Uploads what enlarging needs, and resizes the frame. `full` is the job; `None` if it is cancelled.
    fn begin(
        &mut self,
        context: &Arc<Context>,
        full: &RenderJob,
        left: &ImageLeft<'_>,
        frame: &mut Frame,
    ) -> Result<Option<Work>, RenderError> {
        let started = Instant::now();
        let Some(enlargement) = full.enlarge.clone() else {
            return Err(context.beyond("an image of another size has no size to come to".to_owned()));
        };
        let _span = enlargement.filter.edges().map(|_| layers_span());
        frame.texture = self.texture.take();
        self.presenter.prepare(context, full, frame)?;
        let updated = self.scene.update(context, full, &enlargement, left)?;
        let Some((params, target, sent)) = updated else { return Ok(None) };
        self.begin_costs(enlargement.filter);
        let views = Step::of(enlargement.filter).iter().filter(|step| matches!(step, Step::Faces(_))).count();
        let stats = &mut frame.stats;
        stats.bytes_uploaded += sent;
        (stats.upsample_fallbacks, stats.ms_depth_layers, stats.ms_upsample) = Default::default();
        stats.depth_layers = (views * enlargement.filter.edges().map_or(0, |edges| edges.layers)) as u64;
        let scale = full.mesh.positions.scale;
        let work = Work { enlargement, params, target, scale, at: 0, next: 0, tiles_done: 0 };
        (0..views).try_for_each(|view| self.clear(context, view))?;
        add_time(stats, work.step(), started);
        Ok(Some(work))
    }

    /// Begins a frame's costs; another filter's cost is dropped.
    fn begin_costs(&mut self, filter: UpsampleFilter) {
        if !self.costed.is_some_and(|last| cost_alike(last, filter)) {
            self.costs[Step::Filter.kind()] = UnitCost::default();
        }
        self.costed = Some(filter);
        self.costs.iter_mut().for_each(UnitCost::begin_frame);
    }

    /// Submits the clearing of the layers of a view.
    fn clear(&self, context: &Context, view: usize) -> Result<(), RenderError> {
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.scene.layers[view].begin(context, &mut encoder)?;
        context.queue.submit([encoder.finish()]);
        context.check()
    }

    /// Works for about `budget`. Returns whether the frame is done.
    fn advance(
        &mut self,
        context: &Arc<Context>,
        budget: Duration,
        work: &mut Work,
        left: &ImageLeft<'_>,
        frame: &mut Frame,
    ) -> Result<bool, RenderError> {
        let started = Instant::now();
        let mut since = started;
        loop {
            let next = self.next_units(work, budget);
            if let (Some((step, units)), true) = (next, self.in_flight.len() < IN_FLIGHT) {
                self.submit(context, work, step, units, frame.texture.is_none())?;
                continue;
            }
            let Some(flight) = self.in_flight.pop_front() else {
                self.presenter.present(context, &work.target.planes.color, frame)?;
                self.costs.iter_mut().for_each(UnitCost::end_frame);
                add_time(&mut frame.stats, Some(Step::Filter), since);
                return Ok(true);
            };
            let step = flight.step;
            let _span = step.is_of_layers().then(layers_span);
            self.collect(context, flight, work, left, frame)?;
            since = add_time(&mut frame.stats, Some(step), since);
            if started.elapsed() >= budget && work.tiles_done < work.params.tile_count() {
                return Ok(false);
            }
        }
    }

    /// The next step and units to submit, if any; after a step's last unit goes on to the next step.
    fn next_units(&self, work: &mut Work, budget: Duration) -> Option<(Step, Range<usize>)> {
        loop {
            let step = work.step()?;
            let end = match step {
                Step::Faces(_) => self.scene.boundary.groups(),
                // A slice that comes back tells the number of pieces.
                Step::Pieces(_) => usize::MAX,
                Step::Range => 1,
                Step::Reference(view) => self.scene.layers[view].params.tile_count(),
                Step::Bilinear | Step::Filter => work.params.tile_count(),
            };
            if work.next < end {
                let (cost, filter) = (self.costs[step.kind()], work.enlargement.filter);
                let count = cost.units_for(budget, step.first_units(filter), step.most_units(filter));
                let count = count.max(step.least_units());
                return Some((step, work.next..end.min(work.next.saturating_add(count))));
            }
            work.go_to(work.at + 1);
        }
    }

    fn submit(
        &mut self,
        context: &Context,
        work: &mut Work,
        step: Step,
        units: Range<usize>,
        has_pixels: bool,
    ) -> Result<(), RenderError> {
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let scene = &mut self.scene;
        {
            let pass = &mut work.target.pass(&mut encoder, "full size", Some(4));
            match step {
                Step::Faces(view) => scene.layers[view].record_faces(context, &units, pass)?,
                Step::Pieces(view) => scene.layers[view].record_pieces(context, units.len(), pass)?,
                Step::Range => scene.layers[0].record_range(context, pass)?,
                Step::Reference(view) => scene.layers[view].record_reference(context, &units, pass)?,
                Step::Bilinear | Step::Filter => {
                    work.params.first_tile = units.start as u32;
                    let filter = work.enlargement.filter;
                    let stage = if step == Step::Filter { last_stage(filter) } else { BEFORE_JOINT };
                    scene.record(context, stage, &work.params, units.len(), pass)?;
                }
            }
        }
        let words = match step {
            Step::Pieces(view) => Some((scene.layers[view].head(context)?, 0, LayerLists::HEAD as usize)),
            _ => None,
        };
        let slice = if step == Step::Filter { (units.clone(), has_pixels) } else { (0..0, false) };
        let sent = self.readback.send(context, encoder, &work.target, slice, words)?;
        work.next = units.end;
        self.in_flight.push_back(Flight { step, units, sent });
        Ok(())
    }

    /// Waits for a slice and takes its pixels, counts and times.
    fn collect(
        &mut self,
        context: &Context,
        flight: Flight,
        work: &mut Work,
        left: &ImageLeft<'_>,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        let waiting = Instant::now();
        let Flight { step, units, sent } = flight;
        let told = self.readback.collect(context, sent, |slice| {
            if step == Step::Filter && frame.texture.is_none() {
                slice.copy_pixels(&mut frame.planes, &work.params, work.scale);
            }
            let counts = step == Step::Filter && matches!(work.enlargement.filter, UpsampleFilter::Joint2x2 { .. });
            Told {
                ms: slice.milliseconds(context).map(|[_, _, ms, _]| ms),
                pieces: slice.word_sent(LayerLists::PIECE_COUNT),
                pieces_from: slice.word_sent(LayerLists::PIECES_FROM),
                pieces_to: slice.word_sent(LayerLists::PIECES_TO),
                fell_back: if counts { slice.counter(0) } else { 0 },
            }
        })?;
        let ms = told.ms.unwrap_or_else(|| waiting.elapsed().as_secs_f64() * 1e3);
        frame.stats.upsample_fallbacks += told.fell_back;
        let mut done = units.len();
        if let Step::Pieces(view) = step {
            done = (told.pieces_to - told.pieces_from) as usize;
            self.pieces_told(context, view, &told, work, left, &mut frame.stats)?;
        } else if step == Step::Filter {
            work.tiles_done += units.len();
        }
        if done > 0 {
            self.costs[step.kind()].add(ms, done);
        }
        Ok(())
    }

    /// Goes on after the last piece of a view's large faces, or draws the boundary again if not all pieces fit.
    fn pieces_told(
        &mut self,
        context: &Context,
        view: usize,
        told: &Told,
        work: &mut Work,
        left: &ImageLeft<'_>,
        stats: &mut FrameStats,
    ) -> Result<(), RenderError> {
        if work.step() != Some(Step::Pieces(view)) {
            return Ok(());
        }
        if told.pieces > self.scene.layers[view].piece_capacity() {
            self.abandon(context)?;
            self.scene.layers[view].grow_pieces(context, u64::from(told.pieces))?;
            self.scene.bind(context, work.enlargement.filter, left)?;
            self.clear(context, view)?;
            stats.entry_retries += 1;
            work.go_to(work.at - 1);
        } else if told.pieces_to >= told.pieces {
            work.go_to(work.at + 1);
        }
        Ok(())
    }

    /// Waits for the slices under way and drops them.
    pub(super) fn abandon(&mut self, context: &Context) -> Result<(), RenderError> {
        self.readback.abandon(context, self.in_flight.drain(..).map(|flight| flight.sent))
    }
}

/// The trace span of the CPU's depth layers.
fn layers_span() -> tracing::span::EnteredSpan {
    tracing::info_span!("depth layers").entered()
}

/// Adds the time since `since` to the step's statistic. Returns the present time.
fn add_time(stats: &mut FrameStats, step: Option<Step>, since: Instant) -> Instant {
    let now = Instant::now();
    let ms = (now - since).as_secs_f64() * 1e3;
    if step.is_some_and(Step::is_of_layers) {
        stats.ms_depth_layers += ms
    } else {
        stats.ms_upsample += ms
    }
    now
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::upsampling::DepthEdges;

    #[test]
    fn no_slice_is_all_of_a_large_image_and_a_filter_does_not_go_by_the_cost_of_another() {
        let edges = DepthEdges::USUAL;
        let [wide, usual] = [64, 8].map(|kernel_px| UpsampleFilter::Joint { kernel_px, edges });
        // 3840 x 2160 pixels.
        let tiles = 240 * 135;
        assert_eq!([wide, usual].map(|filter| Step::Filter.first_units(filter)), [7, 32]);
        assert!(Step::Filter.most_units(wide) < tiles / 8 && Step::Filter.most_units(usual) == GROUPS_MAX as usize);
        let mut enlarger = Enlarger::new();
        let units = |enlarger: &Enlarger, step: Step| {
            enlarger.costs[step.kind()].units_for(Duration::from_millis(15), 32, GROUPS_MAX as usize)
        };
        enlarger.begin_costs(UpsampleFilter::Nearest);
        for step in [Step::Filter, Step::Range] {
            enlarger.costs[step.kind()].add(1.0, tiles);
            enlarger.costs[step.kind()].end_frame();
        }
        enlarger.begin_costs(UpsampleFilter::Nearest);
        assert!(units(&enlarger, Step::Filter) > tiles);
        for (filter, of) in [(wide, "another filter"), (usual, "another kernel")] {
            enlarger.begin_costs(filter);
            assert_eq!(units(&enlarger, Step::Filter), 32, "{of}");
            assert!(units(&enlarger, Step::Range) > tiles, "other steps cost as before");
            enlarger.costs[Step::Filter.kind()].add(1.0, tiles);
            enlarger.costs[Step::Filter.kind()].end_frame();
        }
    }
}

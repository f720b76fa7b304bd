//! A pipeline whose stages work at the same time.
//!
//! ```text
//! push, replace, seek -> [queue] -> decode -> order -> render -> [deliveries] -> take, wait
//!                           2 preparations at most  |   1 frame  |  1 frame
//! ```
//!
//! Decode and order have a thread each and a pool of threads of their own; the renderer has one thread and, on the CPU, the
//! pool that everything else uses. So the next frame is prepared while one is rendered, and never waits for a tile.
//!
//! Every frame depends on its request alone, and is bit for bit the one that [`Pipeline`] renders: stages keep buffers and selected faces
//! between frames, but no state that an image depends on.
//!
//! - **Errors and panics** are delivered in place of the frame: channels are bounded, and all requests pass all stages in order. After a
//!   panic the stage is reset.
//! - **Buffers** are recycled. Scalars and frames are reference-counted; the last holder returns the buffer. Memory is bounded by two
//!   preparations, one frame that is rendered and three that are shown or waiting, whatever the playback speed.
//! - **Blocks** are loaded in the order in which the player expects to need them ([`crate::codec::blocks`]), on a thread of its own.
//! - **Frames** of an unchanged view are cached within a budget, keyed by the whole request: a loop over a fixed view is rendered once.

use super::frames::{FrameBudget, FrameCache, FramePool};
use super::prefetch::Prefetcher;
use super::priority::give_way;
use super::queue::{Before, FrameId, PREPARATIONS, Preparations, Queue};
use super::series::Series;
use super::stages::{Delivery, Shared, decode_all, order_all, render_all};
use super::{Decode, FrameRequest, Order, Pipeline, Renderers};
use crate::task::ThreadLimit;
use crossbeam::channel::{Receiver, bounded};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::io;
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// How a pipeline's threads are set up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PipelinedOptions {
    /// Threads that render on the CPU, and as many that prepare; `None`: rayon's global pool renders, and as many threads prepare.
    pub threads: Option<usize>,
    /// Whether these threads run at a lower priority than the one that paints a window (with feature `gui`, else at the same). They then
    /// form a pool of their own.
    pub give_way: bool,
    /// Budget in bytes for frames of an unchanged view, cached for the next round of a loop; 0 caches none.
    pub frame_cache_bytes: u64,
}

impl Default for PipelinedOptions {
    fn default() -> Self {
        Self { threads: None, give_way: false, frame_cache_bytes: 256 << 20 }
    }
}

/// A pipeline whose stages run concurrently. Dropped, it stops within milliseconds, whatever it was doing.
///
/// One thread requests and takes frames; of its calls only [`Self::wait`] blocks on a stage.
pub struct Pipelined {
    series: Arc<Series>,
    shared: Shared,
    deliveries: Option<Receiver<Delivery>>,
    threads: Option<Threads>,
    prefetcher: Prefetcher,
    pools: Pools,
}

/// The threads that stages compute on. Clones are the same threads.
#[derive(Clone)]
struct Pools {
    preparing: Arc<ThreadPool>,
    /// `None`: rayon's global pool.
    rendering: Option<Arc<ThreadPool>>,
    /// Threads that render on the CPU.
    render_threads: usize,
}

impl Pools {
    fn new(options: &PipelinedOptions) -> io::Result<Self> {
        let has_its_own = options.threads.is_some() || options.give_way;
        let rendering = has_its_own.then(|| pool(options, "render")).transpose()?;
        Ok(Self {
            preparing: Arc::new(pool(options, "prepare")?),
            rendering: rendering.map(Arc::new),
            render_threads: options.threads.unwrap_or_else(rayon::current_num_threads),
        })
    }
}

struct Threads {
    decode: JoinHandle<Decode>,
    order: JoinHandle<Order>,
    render: JoinHandle<Renderers>,
}

fn pool(options: &PipelinedOptions, name: &'static str) -> io::Result<ThreadPool> {
    let count = options.threads.unwrap_or_else(rayon::current_num_threads);
    let builder = ThreadPoolBuilder::new().num_threads(count).thread_name(move |i| format!("{name} {i}"));
    let gives_way = options.give_way;
    let builder = builder.start_handler(move |_| {
        if gives_way {
            give_way();
        }
    });
    builder.build().map_err(io::Error::other)
}

impl Pipelined {
    /// Starts the threads of a pipeline. One of them calls `delivered` whenever there is a delivery to take, to wake up an event loop.
    ///
    /// # Errors
    /// If the system cannot start the threads.
    pub fn start(
        pipeline: Pipeline,
        options: &PipelinedOptions,
        delivered: impl Fn() + Send + Sync + 'static,
    ) -> io::Result<Self> {
        Self::start_on(Pools::new(options)?, FrameBudget::new(options.frame_cache_bytes), pipeline, delivered)
    }

    /// Starts a pipeline beside this one, which computes on the same threads. The frames that each keeps share the budget of one.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_beside(&self, pipeline: Pipeline, delivered: impl Fn() + Send + Sync + 'static) -> io::Result<Self> {
        let frames = self.shared.kept().budget();
        Self::start_on(self.pools.clone(), frames, pipeline, delivered)
    }

    fn start_on(
        pools: Pools,
        frames: FrameBudget,
        pipeline: Pipeline,
        delivered: impl Fn() + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let Pipeline { series, decode, order, renderers } = pipeline;
        let shared = Shared {
            queue: Arc::new(Queue::default()),
            kept: Arc::new(Mutex::new(FrameCache::new(frames))),
            pool: FramePool::default(),
            thread_limit: ThreadLimit::none(),
            was_on_cpu: Arc::default(),
            gpu_draws_flow: Arc::new(renderers.gpu_draws_flow().into()),
        };
        let Pools { preparing, rendering, .. } = pools.clone();
        let (to_order, from_decode) = bounded(PREPARATIONS);
        let (to_render, from_order) = bounded(PREPARATIONS);
        let (to_owner, deliveries) = bounded(1);
        let prefetcher = Prefetcher::start()?;
        let spawn = || -> io::Result<Threads> {
            Ok(Threads {
                decode: Builder::new().name("decode".to_owned()).spawn({
                    let (shared, preparing) = (shared.clone(), preparing.clone());
                    move || decode_all(decode, &shared, &preparing, &to_order)
                })?,
                order: Builder::new().name("order".to_owned()).spawn({
                    let shared = shared.clone();
                    move || order_all(order, &shared, &preparing, &from_decode, &to_render)
                })?,
                render: Builder::new().name("render".to_owned()).spawn({
                    let shared = shared.clone();
                    move || render_all(renderers, &shared, rendering.as_deref(), &from_order, &to_owner, &delivered)
                })?,
            })
        };
        // Threads already started must end: nobody can make requests.
        let threads = spawn().inspect_err(|_| shared.queue.close())?;
        Ok(Self { pools, series, shared, deliveries: Some(deliveries), threads: Some(threads), prefetcher })
    }

    /// Leaves a core to other threads while `leave` is set, effective within the frame being rendered on the CPU; a single core is used
    /// anyway.
    pub fn leave_a_core(&self, leave: bool) {
        self.shared.thread_limit.set(leave.then(|| self.pools.render_threads.saturating_sub(1)));
    }

    /// The series that requests refer to.
    pub fn series(&self) -> &Arc<Series> {
        &self.series
    }

    /// Sets the series of later requests; earlier ones keep theirs.
    pub fn set_series(&mut self, series: Arc<Series>) {
        self.series = series;
    }

    /// Queues a request behind all others; `None` if 64 are waiting. Each is delivered once, in order.
    #[must_use]
    pub fn push(&self, request: FrameRequest) -> Option<FrameId> {
        self.ask(request, Before::Keep)
    }

    /// Requests a frame in place of those not being rendered yet, or with previews. Other frames that are being or have been rendered are
    /// delivered first, or if there is none, the next one: a slow machine still shows a new frame now and then, however fast requests come.
    pub fn replace(&self, request: FrameRequest) -> Option<FrameId> {
        self.ask(request, Before::DropPrepared)
    }

    /// Requests a frame in place of all others: none of these is delivered any more, not even a finished one.
    pub fn seek(&self, request: FrameRequest) -> Option<FrameId> {
        self.ask(request, Before::DropAll)
    }

    fn ask(&self, request: FrameRequest, before: Before) -> Option<FrameId> {
        self.shared.queue.push(self.series.clone(), request, before)
    }

    /// Cancels all requests.
    pub fn clear(&self) {
        self.shared.queue.clear();
    }

    /// Number of requested frames that are still wanted and have not been taken.
    pub fn wanted(&self) -> usize {
        self.shared.queue.wanted()
    }

    /// Whether a requested frame is still on its way.
    pub fn is_wanted(&self, id: FrameId) -> bool {
        self.shared.queue.is_wanted(id)
    }

    /// Number of frames that are being prepared: two at most, however fast requests come.
    pub fn preparations(&self) -> Preparations {
        self.shared.queue.preparations()
    }

    /// Takes the next frame or preview; `None` if none is ready.
    pub fn take(&self) -> Option<Delivery> {
        let deliveries = self.deliveries.as_ref()?;
        deliveries.try_iter().find(|delivery| self.takes(delivery))
    }

    /// Whether a delivery is still wanted; a final one then counts as taken.
    fn takes(&self, delivery: &Delivery) -> bool {
        let queue = &self.shared.queue;
        if delivery.is_final { queue.take(delivery.id) } else { queue.is_wanted(delivery.id) }
    }

    /// Whether all stage threads run. One that has ended has a fault that it could not report: no frame will come any more.
    pub fn is_alive(&self) -> bool {
        self.threads.as_ref().is_some_and(|threads| {
            !threads.decode.is_finished() && !threads.order.is_finished() && !threads.render.is_finished()
        })
    }

    /// Waits for the next frame or preview, `longest` at most; `None` at once if none is wanted.
    pub fn wait(&self, longest: Duration) -> Option<Delivery> {
        let deliveries = self.deliveries.as_ref()?;
        let started = Instant::now();
        while self.wanted() > 0 {
            let left = longest.saturating_sub(started.elapsed());
            let delivery = deliveries.recv_timeout(left).ok()?;
            if self.takes(&delivery) {
                return Some(delivery);
            }
        }
        None
    }

    /// Announces the steps that will be shown, in order: their blocks are read ahead within the budget.
    pub fn expect(&self, upcoming: &[usize]) {
        self.prefetcher.expect(&self.series, upcoming);
    }

    /// Stops the threads; the pipeline keeps its buffers, and can render alone or be started again.
    pub fn stop(mut self) -> Pipeline {
        let (decode, order, renderers) = self.end();
        Pipeline { series: self.series.clone(), decode, order, renderers }
    }

    fn end(&mut self) -> (Decode, Order, Renderers) {
        self.shared.queue.close();
        self.prefetcher.stop();
        // Wakes a render thread that is blocked on a delivery.
        self.deliveries = None;
        let Some(threads) = self.threads.take() else { return Default::default() };
        let Threads { decode, order, render } = threads;
        // Stages catch panics; if a thread still dies of one, a new stage replaces it.
        (decode.join().unwrap_or_default(), order.join().unwrap_or_default(), render.join().unwrap_or_default())
    }
}

impl Drop for Pipelined {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(test)]
#[path = "pipelined_tests.rs"]
mod tests;

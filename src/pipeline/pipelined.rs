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
//! Every frame is that of its request, bit for bit the one that [`Pipeline`] renders: a stage keeps buffers and sets from frame
//! to frame, but nothing that an image depends on.
//!
//! - **Errors and panics** come out where the frame would have: channels are bounded, and all requests pass all stages in order. After a
//!   panic the stage begins afresh.
//! - **Memory goes round.** Scalars and frames are counted references; the last holder gives the buffer back. Memory is that of two
//!   preparations, one frame that is rendered and three that are shown or waiting, however long or fast one plays.
//! - **Blocks** come in the order in which whoever plays says that it needs them ([`crate::codec::blocks`]), on a thread of its own.
//! - **Frames** of an unchanged view are kept within a budget, by the whole request: a loop over a view that nobody moves is rendered once.

use super::frames::{FrameCache, FramePool, SharedFrame};
use super::prefetch::Prefetcher;
use super::priority::give_way;
use super::queue::{Before, FrameId, PREPARATIONS, Preparations, Queue};
use super::series::Series;
use super::stages::{Shared, decode_all, order_all, render_all};
use super::{Decode, FrameRequest, Order, Pipeline, PipelineError, Renderers};
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
    /// Threads that render on the CPU, and as many that prepare; `None`: as many as rayon's own pool has, which then renders.
    pub threads: Option<usize>,
    /// Whether those threads give way to others (a lower priority): to the one that paints a window. They are then no other
    /// work's.
    pub give_way: bool,
    /// Bytes for frames of an unchanged view, kept for the next round of a loop; 0 keeps none.
    pub frame_cache_bytes: u64,
}

impl Default for PipelinedOptions {
    fn default() -> Self {
        Self { threads: None, give_way: false, frame_cache_bytes: 256 << 20 }
    }
}

/// What becomes of a request.
#[derive(Clone, Debug)]
pub struct Delivery {
    /// Which one.
    pub id: FrameId,
    /// What was asked for; of a preview, the request that has it as its frame.
    pub request: FrameRequest,
    /// Its frame, or why there is none. Never [`PipelineError::Cancelled`]: of requests that are not wanted any more nothing
    /// is heard.
    pub frame: Result<SharedFrame, PipelineError>,
    /// Whether it was rendered for an earlier request; its counts and times are those of then.
    pub is_kept: bool,
    /// Whether it is the frame that was asked for. Otherwise a preview of it ([`FrameRequest::previews`]). The frame follows, or one of a newer request.
    pub is_final: bool,
}

/// A pipeline whose stages work at the same time. Dropped, it stops within milliseconds, whatever it was doing.
///
/// One thread asks and takes; none of its calls waits for a stage, but [`Self::wait`].
pub struct Pipelined {
    series: Arc<Series>,
    shared: Shared,
    deliveries: Option<Receiver<Delivery>>,
    threads: Option<Threads>,
    prefetcher: Prefetcher,
    /// Threads that render on the CPU.
    render_threads: usize,
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
    /// Starts the threads of a pipeline. `delivered` is called by one of them whenever there is something to take: to wake up
    /// an event loop.
    ///
    /// # Errors
    /// If the system gives no threads.
    pub fn start(
        pipeline: Pipeline,
        options: &PipelinedOptions,
        delivered: impl Fn() + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let Pipeline { series, decode, order, renderers } = pipeline;
        let shared = Shared {
            queue: Arc::new(Queue::default()),
            kept: Arc::new(Mutex::new(FrameCache::new(options.frame_cache_bytes))),
            pool: FramePool::default(),
            thread_limit: ThreadLimit::none(),
            was_on_cpu: Arc::default(),
        };
        let preparing = Arc::new(pool(options, "prepare")?);
        let has_its_own = options.threads.is_some() || options.give_way;
        let rendering = has_its_own.then(|| pool(options, "render")).transpose()?;
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
                    move || render_all(renderers, &shared, rendering.as_ref(), &from_order, &to_owner, &delivered)
                })?,
            })
        };
        // Threads that were started must not wait for requests that nobody can make.
        let threads = spawn().inspect_err(|_| shared.queue.close())?;
        let render_threads = options.threads.unwrap_or_else(rayon::current_num_threads);
        Ok(Self { render_threads, series, shared, deliveries: Some(deliveries), threads: Some(threads), prefetcher })
    }

    /// Leaves a core to others while `leave` is set, also of what is being rendered on the CPU; if there is but one core, it
    /// is used.
    pub fn leave_a_core(&self, leave: bool) {
        self.shared.thread_limit.set(leave.then(|| self.render_threads.saturating_sub(1)));
    }

    /// What requests are about.
    pub fn series(&self) -> &Arc<Series> {
        &self.series
    }

    /// Requests from now on are about another series; those before stay what they are.
    pub fn set_series(&mut self, series: Arc<Series>) {
        self.series = series;
    }

    /// Asks for a frame after all others that were asked for; `None` if 64 of them have not been begun. Each is delivered
    /// once, in order.
    #[must_use]
    pub fn push(&self, request: FrameRequest) -> Option<FrameId> {
        self.ask(request, Before::Keep)
    }

    /// Asks for a frame instead of those that are not being rendered yet, or have previews. Other frames that are being rendered or have been are
    /// delivered first, and if there is none, the one that is next: on a slow machine there is something new to see now and
    /// then, however fast requests come.
    pub fn replace(&self, request: FrameRequest) -> Option<FrameId> {
        self.ask(request, Before::DropPrepared)
    }

    /// Asks for a frame instead of all others: no other one is delivered any more, not even one that is there already.
    pub fn seek(&self, request: FrameRequest) -> Option<FrameId> {
        self.ask(request, Before::DropAll)
    }

    fn ask(&self, request: FrameRequest, before: Before) -> Option<FrameId> {
        self.shared.queue.push(self.series.clone(), request, before)
    }

    /// Nothing is wanted any more.
    pub fn clear(&self) {
        self.shared.queue.clear();
    }

    /// Frames that were asked for, are still wanted and have not been taken.
    pub fn wanted(&self) -> usize {
        self.shared.queue.wanted()
    }

    /// Whether a frame that was asked for is still on its way.
    pub fn is_wanted(&self, id: FrameId) -> bool {
        self.shared.queue.is_wanted(id)
    }

    /// Frames that are being prepared: two at most, however fast requests come.
    pub fn preparations(&self) -> Preparations {
        self.shared.queue.preparations()
    }

    /// Takes the next frame or preview if it is there.
    pub fn take(&self) -> Option<Delivery> {
        let deliveries = self.deliveries.as_ref()?;
        deliveries.try_iter().find(|delivery| self.takes(delivery))
    }

    /// Whether a frame is still wanted; if it is what was asked for, it then counts as taken.
    fn takes(&self, delivery: &Delivery) -> bool {
        let queue = &self.shared.queue;
        if delivery.is_final { queue.take(delivery.id) } else { queue.is_wanted(delivery.id) }
    }

    /// Whether all stages work. A stage that does not has a fault that it could not even report: nothing will come any more.
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

    /// Steps that will be shown, in their order: what they are decoded from is read ahead, as far as the budget for it goes.
    pub fn expect(&self, upcoming: &[usize]) {
        self.prefetcher.expect(&self.series, upcoming);
    }

    /// Stops the threads; the pipeline can go on alone or be started again, and has kept its buffers.
    pub fn stop(mut self) -> Pipeline {
        let (decode, order, renderers) = self.end();
        Pipeline { series: self.series.clone(), decode, order, renderers }
    }

    fn end(&mut self) -> (Decode, Order, Renderers) {
        self.shared.queue.close();
        self.prefetcher.stop();
        // A renderer that waits for somebody to take its frame learns that nobody will.
        self.deliveries = None;
        let Some(threads) = self.threads.take() else { return Default::default() };
        let Threads { decode, order, render } = threads;
        // Stages catch panics; if one dies of another, a new one is as good.
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

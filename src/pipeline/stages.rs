//! The threads of a pipeline: what each stage does with a request.
//!
//! All requests pass all three stages in order: an error is handed on and delivered in place of the frame. A panic is an error of its
//! frame; its stage is reset for the next one.

use super::backend::Renderers;
use super::frames::{FrameCache, FramePool, SharedFrame};
use super::preparation::{Decode, Decoded, Order, Ordered};
use super::queue::{FrameId, Queue, Ticket};
use super::{Backend, FrameRequest, PipelineError, SampleSet};
use crate::render::{Contrast, Frame};
use crate::slowdown::{Slow, waste};
use crate::task::{ThreadLimit, panic_message};
use crossbeam::channel::{Receiver, Sender};
use rayon::ThreadPool;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The frame, preview or error of a request.
#[derive(Clone, Debug)]
pub struct Delivery {
    /// Id of the request.
    pub id: FrameId,
    /// The request; for a preview, the request of the final frame.
    pub request: FrameRequest,
    /// Its frame, or why there is none. Never [`PipelineError::Cancelled`]: cancelled requests deliver nothing.
    pub frame: Result<SharedFrame, PipelineError>,
    /// Whether the frame comes from the cache; its counts and times are then those of its rendering.
    pub is_kept: bool,
    /// Whether it is the requested frame rather than a preview of it ([`FrameRequest::previews`]), which its frame or one of a newer
    /// request follows.
    pub is_final: bool,
}

/// State shared by all stages.
#[derive(Clone)]
pub(super) struct Shared {
    pub(super) queue: Arc<Queue>,
    pub(super) kept: Arc<Mutex<FrameCache>>,
    pub(super) pool: FramePool,
    pub(super) thread_limit: ThreadLimit,
    /// Whether the last frame was drawn on the CPU.
    pub(super) was_on_cpu: Arc<AtomicBool>,
    /// Whether the last frame was drawn on a GPU that draws splats of flow.
    pub(super) gpu_draws_flow: Arc<AtomicBool>,
}

impl Shared {
    /// Predicts whether a frame will be drawn on the CPU; with [`Backend::Auto`], as the last frame was.
    fn will_be_on_cpu(&self, backend: Backend) -> bool {
        match backend {
            Backend::Cpu => true,
            Backend::Gpu => false,
            Backend::Auto => self.was_on_cpu.load(Ordering::Relaxed),
        }
    }

    pub(super) fn kept(&self) -> MutexGuard<'_, FrameCache> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A request and its state: a `T`, a frame from the cache, or a failure.
pub(super) type Passed<T> = (Ticket, Result<Content<T>, PipelineError>);

pub(super) enum Content<T> {
    New(T),
    Kept(SharedFrame),
}

/// Runs a stage; a panic becomes an error, after which the caller must reset the stage.
fn guarded<T>(stage: &'static str, work: impl FnOnce() -> Result<T, PipelineError>) -> Result<T, PipelineError> {
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|panic| Err(PipelineError::Panicked { stage, message: panic_message(&*panic) }))
}

fn has_panicked<T>(result: &Result<T, PipelineError>) -> bool {
    matches!(result, Err(PipelineError::Panicked { .. }))
}

/// A trace span: a stage's work on a frame.
fn span(stage: &'static str, ticket: &Ticket) -> tracing::span::EnteredSpan {
    let (frame, time) = (ticket.id.number(), ticket.request.time);
    let toward = time.toward().map_or_else(String::new, |(next, weight)| format!("{next} by {weight}"));
    match stage {
        "decode" => tracing::info_span!("decode", frame, step = time.step(), toward).entered(),
        "order" => tracing::info_span!("order", frame, step = time.step(), toward).entered(),
        _ => tracing::info_span!("render", frame, step = time.step(), toward).entered(),
    }
}

/// Runs the first stage until the queue is closed.
pub(super) fn decode_all(
    mut decode: Decode,
    shared: &Shared,
    threads: &ThreadPool,
    to: &Sender<Passed<Decoded>>,
) -> Decode {
    while let Some(ticket) = shared.queue.next() {
        let span = span("decode", &ticket);
        let kept = shared.kept().get(&ticket.series, &ticket.request);
        let decoded = match kept {
            Some(frame) => Ok(Content::Kept(frame)),
            None => guarded("decode", || {
                threads.install(|| decode.run(&ticket.series, &ticket.request, &ticket.cancel)).map(Content::New)
            }),
        };
        if has_panicked(&decoded) {
            decode = Decode::default();
        }
        drop(span);
        if to.send((ticket, decoded)).is_err() {
            break;
        }
    }
    decode
}

/// Runs the second stage until the first one has ended.
pub(super) fn order_all(
    mut order: Order,
    shared: &Shared,
    threads: &ThreadPool,
    from: &Receiver<Passed<Decoded>>,
    to: &Sender<Passed<Ordered>>,
) -> Order {
    for (ticket, decoded) in from {
        let span = span("order", &ticket);
        let ordered = decoded.and_then(|content| match content {
            Content::Kept(frame) => Ok(Content::Kept(frame)),
            Content::New(decoded) => guarded("order", || {
                let draws_flow =
                    shared.gpu_draws_flow.load(Ordering::Relaxed) && ticket.request.backend != Backend::Cpu;
                let run = || order.run(&ticket.series, &ticket.request, decoded, draws_flow, &ticket.cancel);
                let mut ordered = threads.install(run)?;
                // One frame is placed ahead, no more: the lists of faces are large.
                if shared.will_be_on_cpu(ticket.request.backend) && shared.queue.wait_to_be_next(&ticket) {
                    threads.install(|| order.place_ahead(&mut ordered));
                }
                Ok(Content::New(ordered))
            }),
        });
        waste(Slow::Pipelined, ticket.series.mesh.topology.tets.len());
        if has_panicked(&ordered) {
            order = Order::default();
        }
        drop(span);
        if to.send((ticket, ordered)).is_err() {
            break;
        }
    }
    order
}

/// Runs the last stage until the second one has ended.
pub(super) fn render_all(
    mut renderers: Renderers,
    shared: &Shared,
    threads: Option<&ThreadPool>,
    from: &Receiver<Passed<Ordered>>,
    to: &Sender<Delivery>,
    delivered: &(dyn Fn() + Sync),
) -> Renderers {
    for (ticket, ordered) in from {
        if !shared.queue.begin_render(&ticket) {
            continue;
        }
        let span = span("render", &ticket);
        let rendered = ordered.and_then(|content| match content {
            Content::Kept(frame) => Ok((frame, true)),
            Content::New(ordered) => guarded("render", || {
                let mut previewed = |frame: &Frame, contrast| {
                    let mut copy = shared.pool.spare();
                    copy.clone_from(frame);
                    let (frame, samples) = (Ok(shared.pool.share(copy)), SampleSet::Adaptive { contrast });
                    let request = FrameRequest { samples, previews: Vec::new(), ..ticket.request.clone() };
                    let preview = Delivery { id: ticket.id, request, frame, is_kept: false, is_final: false };
                    // Previews never block: without room this one is dropped, and a better one follows.
                    if to.try_send(preview).is_ok() {
                        delivered();
                    }
                };
                render(&mut renderers, shared, threads, &ticket, ordered, &mut previewed)
            }),
        });
        if has_panicked(&rendered) {
            renderers.begin_afresh();
        }
        drop(span);
        if !shared.queue.end_render(&ticket) {
            continue;
        }
        let is_kept = matches!(rendered, Ok((_, true)));
        let frame = rendered.map(|(frame, _)| frame);
        let Ticket { id, request, .. } = ticket;
        if to.send(Delivery { id, request, frame, is_kept, is_final: true }).is_err() {
            break;
        }
        delivered();
    }
    renderers
}

/// The frame of a job, and whether it came from the cache: an earlier, equal request may have been rendered meanwhile.
fn render(
    renderers: &mut Renderers,
    shared: &Shared,
    threads: Option<&ThreadPool>,
    ticket: &Ticket,
    mut ordered: Ordered,
    previewed: &mut (dyn FnMut(&Frame, Contrast) + Send),
) -> Result<(SharedFrame, bool), PipelineError> {
    let Ticket { request, series, .. } = ticket;
    if let Some(frame) = shared.kept().get(series, request) {
        return Ok((frame, true));
    }
    ordered.job.thread_limit = shared.thread_limit.clone();
    let work = || renderers.render_to_keep(ordered, request.backend, previewed, || shared.pool.spare());
    let rendered = match threads {
        Some(threads) => threads.install(work),
        None => work(),
    };
    let frame = rendered?.ok_or(PipelineError::Cancelled)?;
    shared.was_on_cpu.store(!frame.stats.on_gpu, Ordering::Relaxed);
    shared.gpu_draws_flow.store(frame.stats.on_gpu && renderers.gpu_draws_flow(), Ordering::Relaxed);
    let frame = shared.pool.share(frame);
    shared.kept().put(series, request, &frame);
    Ok((frame, false))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_any_stage_is_an_error_that_names_it() {
        let plain = guarded::<()>("order", || panic!("what it says"));
        let formatted = guarded::<()>("render", || panic!("number {}", 7));
        for (result, stage, says) in [(plain, "order", "what it says"), (formatted, "render", "number 7")] {
            assert!(has_panicked(&result));
            let said = result.unwrap_err().to_string();
            assert!(said.contains(stage) && said.contains(says), "{said}");
        }
        assert!(!has_panicked(&guarded("order", || Ok(()))));
        assert!(!has_panicked(&guarded("order", || Err::<(), _>(PipelineError::Cancelled))));
    }
}

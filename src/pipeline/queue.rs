//! The queue of requests on their way; only requests of the newest generation are wanted.
//!
//! It coordinates the threads of a pipeline with the requesting thread. A request is first *waiting*, then *preparing* (decoded,
//! ordered, ready to be rendered), then *rendering*, then *rendered* until its frame is taken. At most [`PREPARATIONS`] are preparing:
//! memory does not grow however fast requests come.
//!
//! A new request queues behind the others. One that replaces others drops those that are not being rendered; if none is, all but the first,
//! so that some frame comes out however fast requests come. A seek drops all, finished frames included. A dropped request raises its
//! `Cancel`: decoding checks it every 32,768 vertices and every mebibyte read, the ray caster before each tile, the GPU between slices of
//! 15 ms.

use super::FrameRequest;
use super::series::Series;
use crate::task::Cancel;
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Most frames in preparation: one ready for the renderer, one behind it.
pub(super) const PREPARATIONS: usize = 2;

/// Most requests that may wait.
pub(super) const WAITING_MAX: usize = 64;

/// Id of a request in its pipeline; later ones are greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId(u64);

impl FrameId {
    /// Number of earlier requests of the same pipeline.
    pub fn number(self) -> u64 {
        self.0
    }
}

/// A request on its way.
#[derive(Clone, Debug)]
pub(super) struct Ticket {
    pub(super) id: FrameId,
    pub(super) request: FrameRequest,
    pub(super) series: Arc<Series>,
    /// Raised when the frame is no longer wanted.
    pub(super) cancel: Cancel,
}

/// Number of frames in preparation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Preparations {
    /// Current number, including cancelled ones that are still running.
    pub now: usize,
    /// Maximum so far.
    pub most: usize,
}

/// The fate of earlier requests when a new one is queued.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Before {
    /// All are kept, and come first.
    Keep,
    /// Requests not yet being rendered are dropped, and one with previews; but if no other is being rendered, the next one to be is kept.
    /// Otherwise requests that come faster than they can be prepared would never bring a frame.
    DropPrepared,
    /// All are dropped.
    DropAll,
}

#[derive(Debug, Default)]
struct State {
    next_id: u64,
    waiting: VecDeque<Ticket>,
    preparing: Vec<(FrameId, Cancel)>,
    /// The request that is being rendered.
    rendering: Option<Ticket>,
    /// Requests whose frames are wanted and have not been taken, oldest first.
    wanted: VecDeque<FrameId>,
    is_closed: bool,
    preparing_max: usize,
}

/// The request queue; see the module.
#[derive(Debug, Default)]
pub(super) struct Queue {
    state: Mutex<State>,
    /// Signals a new or dropped request, the end of a preparation, or the close of the queue.
    changed: Condvar,
}

impl Queue {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Queues a request; `None` if [`WAITING_MAX`] wait already.
    pub(super) fn push(&self, series: Arc<Series>, request: FrameRequest, before: Before) -> Option<FrameId> {
        let mut state = self.state();
        state.drop_requests(before);
        if state.waiting.len() >= WAITING_MAX {
            return None;
        }
        let id = FrameId(state.next_id);
        state.next_id += 1;
        state.waiting.push_back(Ticket { id, request, series, cancel: Cancel::new() });
        state.wanted.push_back(id);
        self.changed.notify_all();
        Some(id)
    }

    /// Drops all requests.
    pub(super) fn clear(&self) {
        self.state().drop_requests(Before::DropAll);
        self.changed.notify_all();
    }

    /// Number of frames that are wanted and have not been taken.
    pub(super) fn wanted(&self) -> usize {
        self.state().wanted.len()
    }

    /// Whether a frame is wanted and has not been taken.
    pub(super) fn is_wanted(&self, id: FrameId) -> bool {
        self.state().wanted.contains(&id)
    }

    /// Takes the next request for preparation, once there is one and a free preparation; `None` once the queue is closed.
    pub(super) fn next(&self) -> Option<Ticket> {
        let mut state = self.state();
        loop {
            if state.is_closed {
                return None;
            }
            if state.preparing.len() < PREPARATIONS
                && let Some(ticket) = state.waiting.pop_front()
            {
                state.preparing.push((ticket.id, ticket.cancel.clone()));
                state.preparing_max = state.preparing_max.max(state.preparing.len());
                return Some(ticket);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Waits until a request in preparation is the next wanted one to be rendered; false if it is no longer wanted itself.
    pub(super) fn wait_to_be_next(&self, ticket: &Ticket) -> bool {
        let mut state = self.state();
        loop {
            if ticket.cancel.is_cancelled() {
                return false;
            }
            let next = state.preparing.iter().find(|(_, cancel)| !cancel.is_cancelled());
            if next.is_none_or(|(id, _)| *id == ticket.id) {
                return true;
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Ends a preparation: true if its request is being rendered now, false if it was cancelled and dropped.
    pub(super) fn begin_render(&self, ticket: &Ticket) -> bool {
        let mut state = self.state();
        state.preparing.retain(|(id, _)| *id != ticket.id);
        let goes_on = !ticket.cancel.is_cancelled();
        state.rendering = goes_on.then(|| ticket.clone());
        self.changed.notify_all();
        goes_on
    }

    /// Ends a rendering, successful or not: whether the frame is still wanted.
    pub(super) fn end_render(&self, ticket: &Ticket) -> bool {
        self.state().rendering = None;
        !ticket.cancel.is_cancelled()
    }

    /// Takes a delivered frame: whether it is still wanted.
    pub(super) fn take(&self, id: FrameId) -> bool {
        let mut state = self.state();
        let at = state.wanted.iter().position(|&wanted| wanted == id);
        at.and_then(|at| state.wanted.remove(at)).is_some()
    }

    /// Closes the queue and drops all requests.
    pub(super) fn close(&self) {
        let mut state = self.state();
        state.drop_requests(Before::DropAll);
        state.is_closed = true;
        self.changed.notify_all();
    }

    pub(super) fn preparations(&self) -> Preparations {
        let state = self.state();
        Preparations { now: state.preparing.len(), most: state.preparing_max }
    }
}

impl State {
    fn drop_requests(&mut self, which: Before) {
        if which == Before::Keep {
            return;
        }
        // A request with previews may take long, and a newer one may drop it.
        let stays = |rendering: &Ticket| which == Before::DropPrepared && rendering.request.previews.is_empty();
        let is_idle =
            self.rendering.as_ref().is_none_or(|rendering| rendering.cancel.is_cancelled() || !stays(rendering));
        let first = self.preparing.iter().find(|(_, cancel)| !cancel.is_cancelled()).map(|(id, _)| *id);
        let kept = first.filter(|_| which == Before::DropPrepared && is_idle);
        let dropped = self.waiting.drain(..).map(|ticket| (ticket.id, ticket.cancel));
        let preparing = self.preparing.iter().filter(|(id, _)| Some(*id) != kept).cloned();
        let mut dropped: Vec<(FrameId, Cancel)> = dropped.chain(preparing).collect();
        let rendering = self.rendering.iter().filter(|rendering| !stays(rendering));
        dropped.extend(rendering.map(|rendering| (rendering.id, rendering.cancel.clone())));
        if which == Before::DropAll {
            self.wanted.clear();
        }
        for (id, cancel) in dropped {
            cancel.cancel();
            self.wanted.retain(|&wanted| wanted != id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_series::jet;
    use super::*;
    use crate::camera::Camera;
    use crate::node_table::NodeTable;
    use crate::render::Contrast;
    use crossbeam::channel::{RecvTimeoutError, bounded};
    use std::time::Duration;

    /// Whether the second of two prepared requests gets its turn when `end` ends its wait.
    fn wait_ends(end: impl FnOnce(&Queue, &Ticket, &FrameRequest)) -> bool {
        let (series, queue) = (jet(), Queue::default());
        let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
        let request = FrameRequest::new(0, camera, Arc::new(NodeTable::transparent()), (8, 8));
        for _ in 0..PREPARATIONS {
            queue.push(series.clone(), request.clone(), Before::Keep).unwrap();
        }
        let [first, second] = [queue.next().unwrap(), queue.next().unwrap()];
        assert!(queue.wait_to_be_next(&first));
        std::thread::scope(|scope| {
            let (to, ended) = bounded(1);
            let queue = &queue;
            scope.spawn(move || to.send(queue.wait_to_be_next(&second)));
            assert_eq!(ended.recv_timeout(Duration::from_millis(20)), Err(RecvTimeoutError::Timeout));
            end(queue, &first, &request);
            ended.recv_timeout(Duration::from_secs(60)).unwrap()
        })
    }

    #[test]
    fn a_prepared_request_waits_for_those_before_it_as_long_as_they_are_wanted() {
        assert!(wait_ends(|queue, first, _| assert!(queue.begin_render(first))));
        // An idle renderer: the first one is kept, the second is not.
        assert!(!wait_ends(|queue, _, request| {
            queue.push(jet(), request.clone(), Before::DropPrepared).unwrap();
        }));
        assert!(!wait_ends(|queue, _, _| queue.clear()));
        assert!(!wait_ends(|queue, _, _| queue.close()));
        assert!(wait_ends(|queue, first, _| {
            first.cancel.cancel();
            queue.changed.notify_all();
        }));
    }

    #[test]
    fn a_frame_with_previews_gives_way_to_a_newer_one_while_it_is_rendered_and_another_does_not() {
        let series = jet();
        let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
        let plain = FrameRequest::new(0, camera, Arc::new(NodeTable::transparent()), (8, 8));
        let previewed = FrameRequest { previews: vec![Contrast::default()], ..plain.clone() };
        for (request, gives_way) in [(plain.clone(), false), (previewed, true)] {
            let queue = Queue::default();
            let push = |request| queue.push(series.clone(), request, Before::DropPrepared).unwrap();
            push(request);
            let rendering = queue.next().unwrap();
            assert!(queue.begin_render(&rendering));
            push(plain.clone());
            let second = queue.next().unwrap();
            assert_eq!((rendering.cancel.is_cancelled(), queue.is_wanted(rendering.id)), (gives_way, !gives_way));
            // With nothing being rendered, the next request is kept.
            push(plain.clone());
            assert_eq!(second.cancel.is_cancelled(), !gives_way);
        }
    }
}

//! One view, or two side by side on one clock.
//!
//! Each view is a [`Session`]: its own series, project, undo and player. The *active* one is used: its project is edited, its timeline is
//! shown, and its clock leads. The other one has its clock at rest and is sent to the time that the active one shows
//! ([`Session::led_by`]); while the active one plays, its next frame waits until the other one shows the last. Turning to the other view
//! hands the playback over.
//!
//! Both pipelines compute on the same threads and share the budgets of kept frames
//! ([`Pipelined::start_beside`](crate::pipeline::Pipelined::start_beside)) and of blocks. While something moves each has half of the time
//! of a frame.

pub mod difference;

use super::notice::Notice;
use super::{Action, Session};
use difference::{Comparer, Difference, Pair};
use std::io;
use std::sync::Arc;
use std::time::Duration;

/// A user action on two views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewAction {
    /// Turns to the other view.
    Turn,
    /// Sets whether the cameras move together.
    Link(bool),
    /// Sets whether the difference of both is shown.
    Difference(bool),
    /// Closes the view that is not active.
    Close,
}

/// The view beside the active one.
struct Beside {
    session: Session,
    /// Whether it is the left one of the two.
    is_left: bool,
    /// Whether both have the same camera.
    are_linked: bool,
    /// While their difference is shown.
    comparer: Option<Comparer>,
}

/// One view, or two.
pub struct Views {
    active: Session,
    beside: Option<Beside>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ticked {
    /// Whether the active view has something new to show.
    pub active: bool,
    /// Whether the other one has.
    pub beside: bool,
    /// Tick again after this time at the latest; `None`: after an action, or when woken.
    pub wait: Option<Duration>,
}

impl Views {
    /// One view. `wake` is called when there is a new difference to show.
    pub fn of(session: Session, wake: Arc<dyn Fn() + Send + Sync>) -> Self {
        Self { active: session, beside: None, wake }
    }

    /// The active view.
    pub fn active(&self) -> &Session {
        &self.active
    }

    /// The active view.
    pub fn active_mut(&mut self) -> &mut Session {
        &mut self.active
    }

    /// The view beside it.
    pub fn beside(&self) -> Option<&Session> {
        self.beside.as_ref().map(|beside| &beside.session)
    }

    /// The view beside it.
    pub fn beside_mut(&mut self) -> Option<&mut Session> {
        self.beside.as_mut().map(|beside| &mut beside.session)
    }

    /// All views, the active one first.
    pub fn sessions(&self) -> impl Iterator<Item = &Session> {
        [&self.active].into_iter().chain(self.beside())
    }

    /// As [`Self::sessions`].
    pub fn sessions_mut(&mut self) -> impl Iterator<Item = &mut Session> {
        [&mut self.active].into_iter().chain(self.beside.as_mut().map(|beside| &mut beside.session))
    }

    /// Place of the active view: 0, or 1 if it is the right one of two.
    pub fn place(&self) -> usize {
        usize::from(self.beside.as_ref().is_some_and(|beside| beside.is_left))
    }

    /// Whether both views have the same camera.
    pub fn are_linked(&self) -> bool {
        self.beside.as_ref().is_some_and(|beside| beside.are_linked)
    }

    /// Whether the difference of both views is shown instead of them.
    pub fn shows_difference(&self) -> bool {
        self.beside.as_ref().is_some_and(|beside| beside.comparer.is_some())
    }

    /// The last difference that was found, left minus right, or why there is none. `None`: not shown, or pending.
    pub fn difference(&self) -> Option<Result<Arc<Difference>, String>> {
        self.beside.as_ref()?.comparer.as_ref()?.found()
    }

    /// Shows a session beside the active one, to its right, in place of one that is there.
    pub fn put_beside(&mut self, mut session: Session, now: Duration) {
        self.close();
        self.active.refit();
        session.refit();
        // Meshes in other places have cameras of their own.
        let [(lo, hi), (other_lo, other_hi)] =
            [&self.active, &session].map(|session| session.series().mesh().positions.world_bounds());
        let are_linked = lo.cmple(other_hi).all() && other_lo.cmple(hi).all();
        self.beside = Some(Beside { session, is_left: false, are_linked, comparer: None });
        self.share();
        self.lead(now);
    }

    /// Applies a user action: to the active view, or to both.
    pub fn act(&mut self, action: Action, now: Duration) {
        match action {
            Action::View(action) => self.arrange(action, now),
            action => self.active.act(action, now),
        }
    }

    fn arrange(&mut self, action: ViewAction, now: Duration) {
        let Some(beside) = &mut self.beside else { return };
        match action {
            ViewAction::Turn => {
                beside.session.take_over(&mut self.active, now);
                std::mem::swap(&mut self.active, &mut beside.session);
                beside.is_left = !beside.is_left;
            }
            ViewAction::Link(are_linked) => beside.are_linked = are_linked,
            ViewAction::Difference(false) => beside.comparer = None,
            ViewAction::Difference(true) => match Comparer::start(self.wake.clone()) {
                Ok(comparer) => beside.comparer = Some(comparer),
                Err(error) => self.active.fail(no_threads(&error)),
            },
            ViewAction::Close if beside.session.exports().progress().is_some() => {
                self.active.fail("the other view exports: cancel that first, or turn to it and wait".to_owned());
            }
            ViewAction::Close => self.close(),
        }
        self.share();
    }

    fn close(&mut self) {
        if let Some(Beside { session, .. }) = self.beside.take() {
            self.active.refit();
            // Joins its threads and frees its memory in the background.
            std::thread::spawn(move || drop(session));
        }
        self.share();
    }

    /// Tells the sessions how they are shown.
    fn share(&mut self) {
        let (count, is_compared) = (self.sessions().count(), self.shows_difference());
        self.sessions_mut().for_each(|session| session.share(count, is_compared));
    }

    /// Shows the due frames and requests the next ones; see [`Session::tick`].
    pub fn tick(&mut self, now: Duration) -> Ticked {
        let Some(beside) = &mut self.beside else {
            let (active, wait) = self.active.tick(now);
            return Ticked { active, beside: false, wait };
        };
        let (mut is_new, _) = beside.session.tick(now);
        // Both show the same moment: a clock that runs waits for the other view, and until a frame of that was seen.
        let (active, wait) = match self.active.state().playing {
            true if is_new => (false, Some(Duration::ZERO)),
            true if beside.session.is_waiting() => (false, None),
            _ => self.active.tick(now),
        };
        self.lead(now);
        let Some(beside) = &mut self.beside else { return Ticked { active, beside: is_new, wait } };
        let (is_new_now, wait_beside) = beside.session.tick(now);
        is_new |= is_new_now;
        // Messages are shown where the user is.
        let side = if beside.is_left { "left" } else { "right" };
        for Notice { kind, text, .. } in beside.session.take_notices() {
            self.active.tell(kind, format!("{side} view: {text}"));
        }
        if let Some(comparer) = &mut beside.comparer {
            let [left, right] =
                if beside.is_left { [&beside.session, &self.active] } else { [&self.active, &beside.session] };
            if let Some(pair) = Pair::of(left, right) {
                comparer.compare(pair);
            }
        }
        Ticked { active, beside: is_new, wait: wait.into_iter().chain(wait_beside).min() }
    }

    /// Sends the other view to the time, and if they are linked to the camera, of the active one.
    fn lead(&mut self, now: Duration) {
        if let Some(beside) = &mut self.beside {
            beside.session.led_by(&self.active, beside.are_linked, now);
        }
    }

    /// Whether a frame of either is pending, or their difference.
    pub fn is_waiting(&self) -> bool {
        let is_comparing = || {
            let beside = self.beside.as_ref();
            beside.and_then(|beside| beside.comparer.as_ref()).is_some_and(Comparer::is_waiting)
        };
        self.sessions().any(Session::is_waiting) || is_comparing()
    }
}

fn no_threads(error: &io::Error) -> String {
    format!("the system gives no threads: {error}")
}

#[cfg(test)]
mod tests;

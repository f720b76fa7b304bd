//! Evaluates a project at times of a series, off the thread of the window.

use super::worker::{BLOCK_BYTES, Worker, lock};
use crate::look::{EnsembleChoice, Keyed, Look};
use crate::pipeline::{FrameTime, Series};
use crate::project::{Animation, Project};
use crate::task::Cancel;
use crate::transfer::{Lengths, OpacityKind};
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// How long the window's thread may block for a table: one of a few members takes less, and is then shown in the same pass. Longer would be
/// felt: a frame at 60 a second has 16 ms. Measured, medians between two ensembles of unlike members (a build for tests, four times as many
/// busy threads as cores): 0.7 ms with one and two members, 1.2 ms with ten, 12 ms with ten on histograms.
const PATIENCE: Duration = Duration::from_millis(1);

/// Number of results kept: those of pending frames, of the one on the screen, and of a picture being saved.
const KEPT: usize = 8;

/// Inputs of an animation. The thread keeps data of the field as long as the series is the same.
struct Subject {
    /// The whole project.
    whole: Arc<Project>,
    /// The project, reduced to the chosen ensembles.
    project: Arc<Project>,
    choice: EnsembleChoice,
    series: Arc<Series>,
    kind: OpacityKind,
    lengths: Lengths,
}

impl Subject {
    fn of(project: &Arc<Project>, look: &Look, series: &Arc<Series>) -> Self {
        let choice = look.followed.ensembles;
        let (series, kind, lengths) = (series.clone(), look.opacity_kind, look.lengths);
        Self { whole: project.clone(), project: chosen(project, choice), choice, series, kind, lengths }
    }

    fn is_of(&self, project: &Arc<Project>, look: &Look, series: &Arc<Series>) -> bool {
        Arc::ptr_eq(&self.whole, project)
            && self.choice == look.followed.ensembles
            && Arc::ptr_eq(&self.series, series)
            && self.kind == look.opacity_kind
            && self.lengths == look.lengths
    }

    /// Whether two subjects differ in the project only.
    fn is_beside(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.series, &other.series) && self.kind == other.kind && self.lengths == other.lengths
    }
}

/// A project with other ensembles than those of its timeline.
fn chosen(project: &Arc<Project>, choice: EnsembleChoice) -> Arc<Project> {
    let EnsembleChoice::One(index) = choice else { return project.clone() };
    let mut project = Project::clone(project);
    project.timeline.ensembles = Default::default();
    project.look.ensemble = project.ensembles.get(index).map(|ensemble| ensemble.name.clone());
    Arc::new(project)
}

/// A time to evaluate.
#[derive(Clone)]
struct Job {
    subject: Arc<Subject>,
    time: FrameTime,
}

impl Job {
    fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.subject, &other.subject) && self.time == other.time
    }
}

/// Settings at a time, or why they cannot be evaluated.
type Made = Result<Keyed, String>;

/// Results not taken yet, and whether the owner waits for one.
#[derive(Default)]
struct Shelf {
    made: Vec<(Job, Made)>,
    is_awaited: bool,
}

/// The shelf, and a condition variable notified when it is filled.
#[derive(Default)]
struct Shared {
    shelf: Mutex<Shelf>,
    filled: Condvar,
}

/// Evaluates a project at times of a series.
pub(super) struct ProjectWorker {
    worker: Worker<Job>,
    shared: Arc<Shared>,
    subject: Option<Arc<Subject>>,
    /// Results of the subject, the most recently used last.
    kept: VecDeque<(FrameTime, Made)>,
    wanted: Option<FrameTime>,
}

impl ProjectWorker {
    /// Starts the thread, which ends with its owner. `wake` is called for a result that was not available at once.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub(super) fn start(wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let put = {
            let shared = shared.clone();
            move |made, cancel: &Cancel| {
                let mut shelf = lock(&shared.shelf);
                if cancel.is_cancelled() {
                    return;
                }
                shelf.made.push(made);
                let is_awaited = shelf.is_awaited;
                drop(shelf);
                shared.filled.notify_all();
                if !is_awaited {
                    wake();
                }
            }
        };
        let work = |last: &mut _, job: Job, cancel: &Cancel, put: &dyn Fn((Job, Made))| {
            let made = work_out(last, &job, cancel);
            put((job, made));
        };
        let worker = Worker::start("project", put, work, |job, text| (job, Err(text)))?;
        Ok(Self { worker, shared, subject: None, kept: VecDeque::new(), wanted: None })
    }

    /// Whether a result is pending.
    pub(super) fn is_waiting(&self) -> bool {
        self.wanted.is_some()
    }

    /// The settings of a project at a time, or why they cannot be evaluated; `None`: pending.
    pub(super) fn at(
        &mut self,
        project: &Arc<Project>,
        look: &Look,
        series: &Arc<Series>,
        time: FrameTime,
    ) -> Option<Made> {
        let subject = self.turn_to(project, look, series);
        self.collect();
        if let Some(found) = self.find(time) {
            return Some(found);
        }
        if self.wanted != Some(time) {
            self.wanted = Some(time);
            let job = Job { subject, time };
            lock(&self.shared.shelf).is_awaited = true;
            self.worker.give(job.clone());
            let is_missing = |shelf: &mut Shelf| !shelf.made.iter().any(|(made, _)| made.is(&job));
            let waited = self.shared.filled.wait_timeout_while(lock(&self.shared.shelf), PATIENCE, is_missing);
            waited.unwrap_or_else(PoisonError::into_inner).0.is_awaited = false;
            self.collect();
        }
        self.find(time)
    }

    /// The current subject; if it changes, kept results are dropped.
    fn turn_to(&mut self, project: &Arc<Project>, look: &Look, series: &Arc<Series>) -> Arc<Subject> {
        if let Some(subject) = self.subject.as_ref().filter(|subject| subject.is_of(project, look, series)) {
            return subject.clone();
        }
        let subject = Arc::new(Subject::of(project, look, series));
        if self.subject.as_ref().is_some_and(|before| !before.is_beside(&subject)) {
            // Counts over another field are of no use.
            self.worker.stop();
        }
        self.subject = Some(subject.clone());
        (self.kept, self.wanted) = Default::default();
        subject
    }

    /// Takes finished results.
    pub(super) fn collect(&mut self) {
        let Some(subject) = &self.subject else { return };
        let made = std::mem::take(&mut lock(&self.shared.shelf).made);
        for (job, made) in made.into_iter().filter(|(job, _)| Arc::ptr_eq(&job.subject, subject)) {
            if self.wanted == Some(job.time) {
                self.wanted = None;
            }
            if self.kept.len() == KEPT {
                self.kept.pop_front();
            }
            self.kept.push_back((job.time, made));
        }
    }

    /// The settings at a time for which they were asked lately.
    pub(super) fn known(&self, time: FrameTime) -> Option<&Keyed> {
        self.kept.iter().find(|(kept, _)| *kept == time).and_then(|(_, made)| made.as_ref().ok())
    }

    fn find(&mut self, time: FrameTime) -> Option<Made> {
        let at = self.kept.iter().position(|(kept, _)| *kept == time)?;
        let found = self.kept.remove(at)?;
        let made = found.1.clone();
        self.kept.push_back(found);
        Some(made)
    }
}

/// The work of the thread.
fn work_out(last: &mut Option<(Arc<Subject>, Animation)>, job: &Job, cancel: &Cancel) -> Made {
    let Subject { project, series, kind, lengths, .. } = &*job.subject;
    let (_, mut animation) = last.take().filter(|(subject, _)| subject.is_beside(&job.subject)).unwrap_or_else(|| {
        let animation = Animation::new(project.clone(), series.apart(BLOCK_BYTES), *kind, *lengths);
        (job.subject.clone(), animation)
    });
    if !Arc::ptr_eq(animation.project(), project) {
        animation.set_project(project.clone());
    }
    let made = animation.at(job.time, job.time.time(series.times()), cancel);
    *last = Some((job.subject.clone(), animation));
    made.map_err(|error| error.to_string())
}

//! An export on a thread of its own.

use super::NewPipeline;
use crate::error::{FileError, FileErrorKind};
use crate::export::Written;
use crate::export::run::{Naming, OptionsError, RunError, RunOptions, Target};
use crate::files;
use crate::look::Look;
use crate::pipeline::{Pipeline, PipelinedOptions, Series, give_way};
use crate::project::Project;
use crate::scene::Scene;
use crate::task::{Cancel, Progress, panic_message};
use crate::ui::worker::{BLOCK_BYTES, lock};
use rayon::ThreadPoolBuilder;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What is exported: a copy of what a session shows, and how it is written.
#[derive(Clone)]
pub(in crate::ui) struct Job {
    pub(in crate::ui) series: Arc<Series>,
    /// Settings of the frames, where the project has none.
    pub(in crate::ui) look: Look,
    pub(in crate::ui) project: Arc<Project>,
    pub(in crate::ui) options: RunOptions,
    /// Name of the dataset.
    pub(in crate::ui) dataset: String,
    /// Name of the project.
    pub(in crate::ui) name: String,
    pub(in crate::ui) new_pipeline: NewPipeline,
}

impl Job {
    /// The scene of the frames.
    pub(super) fn scene(&self, pipeline: Pipeline, cancel: &Cancel) -> Scene {
        let mut scene = Scene::new(pipeline, self.look.clone(), cancel);
        scene.size_px = self.options.size_px;
        scene.set_project(self.project.clone());
        scene
    }

    /// Whether it can be resumed: its images that are there are kept then.
    pub(super) fn can_be_resumed(&self) -> bool {
        matches!(self.options.target, Target::Images(_))
    }

    /// The job that keeps the images that this one has written.
    pub(super) fn resumed(self) -> Self {
        Self { options: RunOptions { resume: true, ..self.options }, ..self }
    }

    /// Renders and writes all frames; returns what was written.
    fn run(&self, shared: &Shared, cancel: &Cancel) -> Result<String, Failure> {
        self.options.check_place()?;
        let ffmpeg = self.options.ffmpeg()?;
        let plan = self.options.plan(self.series.times())?;
        self.options.check_memory(plan.frames.len())?;
        let mut scene = self.scene((self.new_pipeline)(self.series.apart(BLOCK_BYTES)), cancel);
        scene.pipeline.check_backend(self.look.backend).map_err(|error| Failure(error.to_string()))?;
        scene.check().map_err(RunError::from)?;
        let made_by = format!("{}: {}", self.name, scene.transfer_function());
        let naming = Naming { dataset: &self.dataset, made_by: &made_by };
        let mut run = self.options.run(plan, ffmpeg, &scene, &naming)?;
        run.threads = PipelinedOptions { threads: Some(rayon::current_num_threads()), give_way: true, ..run.threads };
        run.written = shared.written.clone();
        let records = run.render(&mut scene, shared)?;
        Ok(run.output.summary(&records))
    }
}

/// Number of threads of an export: one core is left to the player.
fn threads() -> usize {
    rayon::current_num_threads().saturating_sub(1).max(1)
}

/// Why an export failed, for the user.
struct Failure(String);

impl From<OptionsError> for Failure {
    fn from(error: OptionsError) -> Self {
        match error {
            OptionsError::File(error) => Self(with_remedy(error).to_string()),
            OptionsError::Refused(_) | OptionsError::Plan(_) => Self(error.to_string()),
        }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::File(error) => Self(with_remedy(error).to_string()),
            error => Self(error.to_string()),
        }
    }
}

/// Adds a remedy to an error of the operating system that has none, such as of a full disk.
fn with_remedy(error: FileError) -> FileError {
    if error.kind == FileErrorKind::Io && error.remedy.is_empty() {
        return error.remedy(files::PLACE_REMEDY);
    }
    error
}

/// How an export ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum End {
    /// Success; the text names the files.
    Done(String),
    /// It was cancelled.
    Cancelled,
    /// The problem and its remedy.
    Failed(String),
}

/// Progress of an export.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExportProgress {
    /// Current stage, for the user.
    pub stage: String,
    /// Completed units of the stage.
    pub done: u64,
    /// Units of the stage; 0 before they are known.
    pub total: u64,
    /// Name of the units, in the plural.
    pub unit: String,
    /// Bytes of the files.
    pub bytes: u64,
    /// Estimated time left in the stage, once known.
    pub left: Option<Duration>,
}

/// Shortest time between two wake-ups for progress.
const WAKE_PAUSE: Duration = Duration::from_millis(100);

/// State shared by the thread and its owner.
struct Shared {
    state: Mutex<State>,
    written: Written,
    wake: Arc<dyn Fn() + Send + Sync>,
}

#[derive(Default)]
struct State {
    now: ExportProgress,
    begun: Option<Instant>,
    woken: Option<Instant>,
    /// Lines for the user.
    said: Vec<String>,
    end: Option<End>,
}

impl Shared {
    fn change(&self, is_urgent: bool, change: impl FnOnce(&mut State)) {
        let mut state = lock(&self.state);
        change(&mut state);
        let is_due = is_urgent || state.woken.is_none_or(|woken| woken.elapsed() >= WAKE_PAUSE);
        if is_due {
            state.woken = Some(Instant::now());
        }
        drop(state);
        if is_due {
            (self.wake)();
        }
    }

    fn finish(&self, end: End) {
        self.change(true, |state| {
            let end = match end {
                End::Failed(problem) => End::Failed(with_lines(problem, &state.said)),
                End::Done(text) => End::Done(with_lines(text, &state.said)),
                End::Cancelled => End::Cancelled,
            };
            state.end = Some(end);
        });
    }
}

/// A text, followed by lines.
fn with_lines(text: String, lines: &[String]) -> String {
    lines.iter().fold(text, |text, line| format!("{text}; {line}"))
}

impl Progress for Shared {
    fn begin(&self, stage: &str, total: u64, unit: &str) {
        self.change(true, |state| {
            let (stage, unit) = (stage.to_owned(), unit.to_owned());
            state.now = ExportProgress { stage, total, unit, ..Default::default() };
            state.begun = Some(Instant::now());
        });
    }

    fn advance(&self, n: u64) {
        self.change(false, |state| {
            state.now.done = state.now.done.saturating_add(n).min(state.now.total);
        });
    }

    fn end(&self) {
        self.change(true, |_| ());
    }

    fn say(&self, line: &str) {
        self.change(false, |state| state.said.push(line.to_owned()));
    }
}

/// An export under way. Dropping it cancels it and waits until its files are whole or gone.
pub(super) struct Running {
    pub(super) job: Job,
    shared: Arc<Shared>,
    cancel: Cancel,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    /// Starts an export. `wake` is called, from another thread, on progress and at the end.
    ///
    /// # Errors
    /// If the system gives no threads.
    pub(super) fn start(job: Job, wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let (shared, cancel) =
            (Arc::new(Shared { state: Mutex::default(), written: Written::default(), wake }), Cancel::new());
        let pool = ThreadPoolBuilder::new().num_threads(threads()).thread_name(|_| "export".to_owned());
        let pool = pool.start_handler(|_| give_way()).build().map_err(io::Error::other)?;
        let (inner, flag, own) = (shared.clone(), cancel.clone(), job.clone());
        let work = move || {
            let ended = catch_unwind(AssertUnwindSafe(|| pool.install(|| own.run(&inner, &flag))));
            inner.finish(match ended {
                Ok(Ok(written)) => End::Done(written),
                Ok(Err(_)) if flag.is_cancelled() => End::Cancelled,
                Ok(Err(Failure(problem))) => End::Failed(problem),
                Err(panic) => {
                    End::Failed(format!("tetreel failed at this: {}; please report this", panic_message(&*panic)))
                }
            });
        };
        let thread = std::thread::Builder::new().name("export".to_owned()).spawn(work)?;
        Ok(Self { job, shared, cancel, thread: Some(thread) })
    }

    /// Progress so far.
    pub(super) fn progress(&self) -> ExportProgress {
        let state = lock(&self.shared.state);
        let elapsed = state.begun.map(|begun| begun.elapsed()).filter(|_| state.now.done > 0);
        let share = state.now.done as f64 / state.now.total.max(1) as f64;
        let left = elapsed.map(|elapsed| elapsed.mul_f64((1.0 - share) / share));
        ExportProgress { left, bytes: self.shared.written.bytes(), ..state.now.clone() }
    }

    /// Requests a cancel.
    pub(super) fn cancel(&self) {
        self.cancel.cancel();
    }

    /// Whether a cancel was requested.
    pub(super) fn is_cancelled(&self) -> bool {
        self.cancel.is_cancelled()
    }

    /// Whether it has written a file.
    pub(super) fn has_written(&self) -> bool {
        self.shared.written.bytes() > 0
    }

    /// How it ended; `None`: it is under way.
    pub(super) fn end(&self) -> Option<End> {
        lock(&self.shared.state).end.clone()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.cancel.cancel();
        if let Some(thread) = self.thread.take() {
            // Panics are caught on the thread.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_has_a_remedy_and_other_remedies_stay() {
        let full = FileError::io("/a/f_3.png", "write", &io::ErrorKind::StorageFull.into());
        let Failure(text) = RunError::File(full).into();
        assert!(text.starts_with("/a/f_3.png: cannot write: ") && text.ends_with("with room on its disk"), "{text}");
        let taken = crate::files::taken("/a/f_3.png".as_ref());
        let Failure(text) = OptionsError::File(taken).into();
        assert!(text.ends_with("choose another name, or replace it"), "{text}");
    }
}

//! Exports of what a session shows: the choices of the dialog, and one export at a time on a thread of its own.
//!
//! A [`Job`] is a copy of what is shown when it begins, and renders by [`Run`](crate::export::run::Run), as the command line does: later
//! changes have no effect on its files, and they are those of `tetreel render` on the saved project.

mod choices;
mod command_line;
mod job;
mod preview;
#[cfg(test)]
mod tests;

pub(super) use choices::Beginning;
pub use choices::{Choices, Frames};
pub use job::ExportProgress;
pub(super) use job::Job;
pub use preview::PreviewOutcome;

use crate::export::run::{Plan, PlannedFrame, RunOptions};
use crate::field::TimeAxis;
use crate::look::Look;
use crate::pipeline::{FrameTime, Pipeline, Series};
use crate::project::{Output, Project};
use job::{End, Running};
use preview::{Preview, PreviewJob};
use std::ffi::OsString;
use std::io;
use std::sync::Arc;

/// Makes the pipeline of an export.
pub type NewPipeline = Arc<dyn Fn(Arc<Series>) -> Pipeline + Send + Sync>;

/// A user action about exports.
#[derive(Clone, Debug, PartialEq)]
pub enum ExportAction {
    /// Shows the dialog, or hides it.
    Dialog,
    /// Changes the choices.
    Choose(Box<Choices>),
    /// Starts an export with the choices.
    Start,
    /// Cancels the export.
    Cancel,
    /// Goes on with the last export, which was cancelled or failed: images that it has written are kept.
    Resume,
}

/// Choices at a moment, with this number of steps.
type PlanOf = (Choices, Option<FrameTime>, usize);

/// The frames of the choices, or why there are none.
type Planned = Result<(RunOptions, Plan), String>;

/// What a preview shows.
#[derive(Clone)]
pub(super) struct PreviewOf {
    pub(super) series: Arc<Series>,
    pub(super) project: Arc<Project>,
    pub(super) look: Look,
    pub(super) choices: Choices,
    pub(super) moment: Option<FrameTime>,
    /// Colour behind the volume.
    pub(super) background: [f32; 3],
}

impl PreviewOf {
    fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.series, &other.series)
            && Arc::ptr_eq(&self.project, &other.project)
            && self.look == other.look
            && self.choices == other.choices
            && (self.moment, self.background) == (other.moment, other.background)
    }
}

/// The exports of a session.
pub struct Exports {
    is_open: bool,
    choices: Option<Choices>,
    planned: Option<(PlanOf, Planned)>,
    running: Option<Running>,
    /// The last export, if it came to no end.
    left: Option<Job>,
    preview: Option<Preview>,
    previewed: Option<PreviewOf>,
    pub(super) new_pipeline: NewPipeline,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Exports {
    /// Without an export. `wake` is called on progress, for previews and at the end of exports.
    pub(super) fn new(wake: Arc<dyn Fn() + Send + Sync>) -> Self {
        Self {
            is_open: false,
            choices: None,
            planned: None,
            running: None,
            left: None,
            preview: None,
            previewed: None,
            new_pipeline: Arc::new(Pipeline::new),
            wake,
        }
    }

    /// Whether the dialog is on the screen.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// The choices, once the dialog was open.
    pub fn choices(&self) -> Option<&Choices> {
        self.choices.as_ref()
    }

    /// Number of frames of the choices, or why there are none; `None`: not known yet.
    pub fn frames(&self) -> Option<Result<usize, &str>> {
        let (_, planned) = self.planned.as_ref()?;
        Some(planned.as_ref().map(|(_, plan)| plan.frames.len()).map_err(String::as_str))
    }

    /// Progress of the export; `None`: there is none.
    pub fn progress(&self) -> Option<ExportProgress> {
        self.running.as_ref().map(Running::progress)
    }

    /// Whether the export is about to end because it was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.running.as_ref().is_some_and(Running::is_cancelled)
    }

    /// Whether the last export can be resumed.
    pub fn can_resume(&self) -> bool {
        self.running.is_none() && self.left.is_some()
    }

    /// The preview; `None`: it is being made.
    pub fn preview(&self) -> Option<PreviewOutcome> {
        self.preview.as_ref()?.get()
    }

    /// Opens the dialog or closes it; returns whether it is open.
    pub(super) fn toggle(&mut self) -> bool {
        self.is_open = !self.is_open;
        if !self.is_open {
            (self.preview, self.previewed) = (None, None);
        }
        self.is_open
    }

    /// Changes the choices.
    pub(super) fn choose(&mut self, choices: Choices) {
        self.choices = Some(choices);
    }

    /// The options and frames of the choices at a moment.
    pub(super) fn plan(&mut self, moment: Option<FrameTime>, times: &TimeAxis) -> Option<&Planned> {
        let key = (self.choices.clone()?, moment, times.len());
        if self.planned.as_ref().is_none_or(|(known, _)| *known != key) {
            let planned = key.0.options(moment, times).and_then(|options| {
                let plan = options.plan(times).map_err(|error| error.to_string())?;
                Ok((options, plan))
            });
            self.planned = Some((key, planned));
        }
        self.planned.as_ref().map(|(_, planned)| planned)
    }

    /// Starts an export, unless there is one.
    ///
    /// # Errors
    /// If there is one, or the system gives no threads.
    pub(super) fn start(&mut self, job: Job) -> Result<(), String> {
        if self.running.is_some() {
            return Err("an export is under way; wait for its end, or cancel it".to_owned());
        }
        let no_threads = |error: io::Error| format!("the system gives no threads: {error}");
        self.running = Some(Running::start(job, self.wake.clone()).map_err(no_threads)?);
        self.left = None;
        Ok(())
    }

    /// Cancels the export, if there is one.
    pub(super) fn cancel(&self) {
        if let Some(running) = &self.running {
            running.cancel();
        }
    }

    /// Goes on with the last export.
    ///
    /// # Errors
    /// As [`Self::start`], or if there is nothing to go on with.
    pub(super) fn resume(&mut self) -> Result<(), String> {
        let Some(job) = self.left.clone().filter(|_| self.running.is_none()) else {
            return Err("there is no export to go on with".to_owned());
        };
        self.start(job.resumed())
    }

    /// Takes the end of the export: what was written, or the problem.
    pub(super) fn take_end(&mut self) -> Option<Result<String, String>> {
        let end = self.running.as_ref()?.end()?;
        let running = self.running.take()?;
        let can_resume = running.job.can_be_resumed() && (running.has_written() || end == End::Cancelled);
        self.left = Some(running.job.clone()).filter(|_| can_resume && !matches!(end, End::Done(_)));
        Some(match end {
            End::Done(text) => Ok(text),
            End::Cancelled if can_resume => Ok("the export was cancelled; Resume goes on with it".to_owned()),
            End::Cancelled => Ok("the export was cancelled".to_owned()),
            End::Failed(problem) => Err(problem),
        })
    }

    /// The options of a preview that has to be made; `None`: the last one shows the same, or there are no frames.
    pub(super) fn options_of_preview(&mut self, of: &PreviewOf) -> Option<RunOptions> {
        if self.previewed.as_ref().is_some_and(|last| last.is(of)) {
            return None;
        }
        let (options, _) = self.plan(of.moment, of.series.times())?.as_ref().ok()?;
        Some(options.clone())
    }

    /// Requests the preview of a job.
    pub(super) fn request_preview(&mut self, of: PreviewOf, job: Job) {
        let Some(Ok((_, plan))) = self.plan(of.moment, of.series.times()) else { return };
        let at = of.moment.map_or(0.0, |moment| moment.time(of.series.times()));
        let Some(frame) = nearest(plan, at) else { return };
        let job = PreviewJob { job, frame, background: of.background };
        if self.preview.is_none() {
            self.preview = Preview::start(self.wake.clone()).ok();
        }
        if let Some(preview) = &self.preview {
            preview.want(job);
        }
        self.previewed = Some(of);
    }
}

/// The frame of a plan whose time is nearest.
fn nearest(plan: &Plan, at: f64) -> Option<PlannedFrame> {
    let off = |frame: &PlannedFrame| (frame.at - at).abs();
    plan.frames.iter().min_by(|a, b| off(a).total_cmp(&off(b))).copied()
}

/// The options of `render` for a run, as words, and notes about what they cannot say.
pub(super) fn options_of(
    choices: &Choices,
    options: &RunOptions,
    output: &Output,
) -> Result<(Vec<OsString>, Vec<String>), String> {
    let mut notes = Vec::new();
    let words = command_line::words(&choices.path()?, options, output, &mut notes);
    Ok((words, notes))
}

/// Words as a line for a shell.
pub(super) fn line(words: &[OsString]) -> String {
    command_line::line(words)
}

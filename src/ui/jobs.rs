//! Slow jobs that touch files, on threads of their own.

use super::document::{State, Turn};
use super::motion::MotionError;
use crate::error::{FileError, FileResult};
use crate::export::still::{Background, FrameAttributes, OutputFrame, StillOptions, write_still};
use crate::field::FieldSelector;
use crate::files;
use crate::image::Planes;
use crate::look::{BesideError, Look};
use crate::pipeline::{ColorsBeside, FlowMeasure, FrameRequest, Series, SharedFrame};
use crate::project::{Project, ProjectError};
use crate::render::surfaces::ByField;
use crate::store::Store;
use crate::task::{Cancel, panic_message};
use crate::transfer::{FirstLook, TransferError, TransferFunction};
use crossbeam::channel::{Receiver, Sender, unbounded};
use std::fs::OpenOptions;
use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Result of a job.
pub(super) enum Done {
    /// An image or a transfer function was written.
    Written(FileResult<PathBuf>),
    /// A transfer function was read, whose colours alone are wanted, or all of it.
    Function(Result<TransferFunction, TransferError>, bool),
    /// A field was opened, for a state of another field or as a change; first looks of the field before it and of this one.
    Series(Arc<Series>, Option<Turn>, Box<[FirstLook; 2]>),
    /// Error of the last picture of a motion against the one in full, and the number of the comparison.
    Compared(MotionError, u64),
    /// A project was written, that of this state; or why not.
    Project(Result<PathBuf, ProjectError>, Box<State>),
    /// What is usual for the vectors of a field; `None` if they cannot be read.
    Flow(String, Option<FlowMeasure>),
    /// The colours of a field for the flow.
    FlowColors(ByField, Box<Result<ColorsBeside, BesideError>>),
    /// A field cannot be opened, or a job failed through a fault of this program or for want of a thread.
    Failed(String),
}

/// Runs jobs; `wake` is called whenever one is done.
pub(super) struct Jobs {
    wake: Arc<dyn Fn() + Send + Sync>,
    to: Sender<Done>,
    done: Receiver<Done>,
    /// Number of comparisons that were begun.
    comparisons: u64,
}

impl Jobs {
    pub(super) fn new(wake: Arc<dyn Fn() + Send + Sync>) -> Self {
        let (to, done) = unbounded();
        Self { wake, to, done, comparisons: 0 }
    }

    /// The next result. Comparisons may end in another order than they began in: only the result of the last one begun is taken.
    pub(super) fn take(&self) -> Option<Done> {
        self.done.try_iter().find(|done| !matches!(done, Done::Compared(_, number) if *number != self.comparisons))
    }

    /// Opens another field of the series' store: that of the state that `turn` leads to, or one that is chosen.
    pub(super) fn open(&self, store: &Arc<Store>, series: &Arc<Series>, field: FieldSelector, turn: Option<Turn>) {
        let (store, series) = (store.clone(), series.clone());
        self.run(move || {
            let opened = series.reopened(&store, Some(&field)).map(|other| {
                let other = Arc::new(other);
                let looks = [&series, &other].map(|series| series.first_look(None, &Cancel::new()));
                Done::Series(other, turn, Box::new(looks))
            });
            opened.unwrap_or_else(|error| Done::Failed(error.to_string()))
        });
    }

    /// Writes an image into a folder.
    pub(super) fn write(&self, shot: Screenshot, folder: PathBuf) {
        self.run(move || Done::Written(shot.write(&folder)));
    }

    /// Writes a project, that of a state; replaces a file that is there only if it `may_replace` it.
    pub(super) fn write_project(&self, project: Project, path: PathBuf, may_replace: bool, state: State) {
        self.run(move || {
            let is_free = may_replace || !path.exists();
            let written = if is_free { project.write(&path) } else { Err(files::taken(&path).into()) };
            Done::Project(written.map(|()| path), Box::new(state))
        });
    }

    /// Reads a transfer function.
    pub(super) fn read_function(&self, from: PathBuf, colors_only: bool) {
        self.run(move || Done::Function(TransferFunction::parse(from), colors_only));
    }

    /// Writes a text; replaces a file that is there only if it `may_replace` it.
    pub(super) fn write_text(&self, text: String, path: PathBuf, may_replace: bool) {
        self.run(move || {
            let is_free = may_replace || !path.exists();
            let written = if is_free { files::replace_with(&path, text.as_bytes()) } else { Err(files::taken(&path)) };
            Done::Written(written.map(|()| path))
        });
    }

    /// Computes the error of a picture.
    pub(super) fn compare(&mut self, found: impl FnOnce() -> MotionError + Send + 'static) {
        self.comparisons += 1;
        let number = self.comparisons;
        self.run(move || Done::Compared(found(), number));
    }

    /// Runs a job.
    pub(super) fn run(&self, job: impl FnOnce() -> Done + Send + 'static) {
        let (to, wake) = (self.to.clone(), self.wake.clone());
        let failed = self.to.clone();
        let work = move || {
            let done = catch_unwind(AssertUnwindSafe(job));
            let done = done.unwrap_or_else(|panic| {
                Done::Failed(format!("tetreel failed: {}; please report this", panic_message(&*panic)))
            });
            // The receiver is gone if the window is closed.
            let _ = to.send(done);
            wake();
        };
        if let Err(error) = std::thread::Builder::new().name("job".to_owned()).spawn(work) {
            let _ = failed.send(Done::Failed(format!("the system gives no thread: {error}")));
        }
    }
}

/// An image to be written.
pub(super) struct Screenshot {
    pub(super) frame: SharedFrame,
    pub(super) background: [f32; 3],
    pub(super) attributes: FrameAttributes,
}

impl Screenshot {
    /// The image of a frame of this request.
    pub(super) fn of(
        frame: SharedFrame,
        request: &FrameRequest,
        look: &Look,
        series: &Series,
        background: [f32; 3],
    ) -> Self {
        let field = series.field();
        let attributes = FrameAttributes {
            time: request.time.time(series.times()),
            step: request.time.step(),
            field: field.name.clone(),
            units: field.units.clone(),
            camera: request.camera.to_string(),
            opacity_kind: look.opacity_kind,
            unit_distance: look.lengths.unit_distance,
            software: FrameAttributes::SOFTWARE.to_owned(),
            ..FrameAttributes::default()
        };
        Self { frame, background, attributes }
    }

    /// Writes a new PNG file, and returns its path.
    fn write(&self, folder: &Path) -> FileResult<PathBuf> {
        let path = claim(folder, &stem(&self.attributes.field, self.attributes.step))?;
        let frame = OutputFrame {
            planes: Planes { color: self.frame.planes.color.clone(), ..Planes::default() },
            attributes: self.attributes.clone(),
        };
        let options = StillOptions { background: Background::Color(self.background), ..Default::default() };
        write_still(&path, &frame, &options).inspect_err(|_| {
            // The empty file that reserved the name.
            let _ = std::fs::remove_file(&path);
        })?;
        Ok(path)
    }
}

/// File name of an image without number and extension: field and step, in characters valid in every file system.
fn stem(field: &str, step: usize) -> String {
    let safe = |c: char| if c.is_alphanumeric() || c == '-' || c == '_' { c } else { '-' };
    format!("{}_step{step:04}", field.chars().map(safe).collect::<String>())
}

/// Creates the first of `stem.png`, `stem_2.png`, `stem_3.png`, .. that does not exist, to reserve its name.
fn claim(folder: &Path, stem: &str) -> FileResult<PathBuf> {
    let mut number = 1_u64;
    loop {
        let name = if number == 1 { format!("{stem}.png") } else { format!("{stem}_{number}.png") };
        let path = folder.join(name);
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(_) => return Ok(path),
            Err(e) if e.kind() == ErrorKind::AlreadyExists => number += 1,
            Err(e) => {
                let error = FileError::io(&path, "write the image", &e);
                return Err(error.remedy("start tetreel in a folder that you may write to"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::playback::quality::Quality;
    use crate::ui::worker::tests::{counted, wait_for};
    use std::sync::atomic::Ordering;

    #[test]
    fn a_comparison_that_ends_after_a_later_one_is_not_taken() {
        let (woken, wake) = counted();
        let mut jobs = Jobs::new(wake);
        let (go, gone) = unbounded();
        let error = |ms| MotionError { quality: Quality::Exact, ms, rays: None, error: None };
        jobs.compare(move || {
            gone.recv().unwrap();
            error(1.0)
        });
        jobs.compare(move || error(2.0));
        wait_for("the second comparison", || (woken.load(Ordering::SeqCst) == 1).then_some(()));
        go.send(()).unwrap();
        wait_for("the first comparison", || (woken.load(Ordering::SeqCst) == 2).then_some(()));
        let taken: Vec<_> = std::iter::from_fn(|| jobs.take()).collect();
        assert!(matches!(&taken[..], [Done::Compared(error, _)] if error.ms == 2.0), "{} results", taken.len());
    }

    #[test]
    fn names_say_field_and_step_and_are_never_taken_twice() {
        let dir = tempfile::tempdir().unwrap();
        let stem = stem("velocity:mag/°", 12);
        assert_eq!(stem, "velocity-mag--_step0012");
        let names: Vec<_> = (0..3).map(|_| claim(dir.path(), &stem).unwrap()).collect();
        let expected = ["", "_2", "_3"].map(|end| dir.path().join(format!("velocity-mag--_step0012{end}.png")));
        assert_eq!(names, expected);
        let error = claim(&dir.path().join("nowhere"), "x").unwrap_err().to_string();
        assert!(error.contains("nowhere") && error.contains("start tetreel"), "{error}");
    }
}

//! Exports of what a session shows.

use super::Session;
use crate::export::run::RunOptions;
use crate::files::name_of;
use crate::look::{EnsembleChoice, Followed, Look};
use crate::pipeline::{FrameTime, Shown};
use crate::project::{Project, Timeline};
use crate::timeline::Keyframed;
use crate::ui::exporting::{self, Beginning, Choices, ExportAction, Exports, Job, NewPipeline, PreviewOf};
use crate::ui::notice::{self, NoticeKind};
use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;

/// The command line of an export.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportCommand {
    /// Its words, from the program's name on.
    pub words: Vec<OsString>,
    /// The words as a line for a shell.
    pub line: String,
    /// What has to be done or known before its files are the same.
    pub notes: Vec<String>,
}

impl Session {
    /// The exports.
    pub fn exports(&self) -> &Exports {
        &self.exports
    }

    /// Sets how exports get their pipelines.
    pub fn export_with(&mut self, new_pipeline: NewPipeline) {
        self.exports.new_pipeline = new_pipeline;
    }

    /// Applies a user action about exports.
    pub(super) fn export(&mut self, action: ExportAction) {
        let done = match action {
            ExportAction::Dialog => {
                if self.exports.toggle() && self.exports.choices().is_none() {
                    let choices = self.first_choices();
                    self.exports.choose(choices);
                }
                Ok(())
            }
            ExportAction::Choose(choices) => {
                self.exports.choose(*choices);
                Ok(())
            }
            ExportAction::Start => self.start_export(),
            ExportAction::Cancel => {
                self.exports.cancel();
                Ok(())
            }
            ExportAction::Resume => self.exports.resume(),
        };
        if let Err(problem) = done {
            self.fail(problem);
        }
    }

    fn first_choices(&self) -> Choices {
        let project = self.project();
        let range = self.state().settings.range.map(|range| (range.a, range.b));
        let beginning = Beginning {
            folder: self.project_file().and_then(Path::parent).unwrap_or(&self.screenshot_folder),
            here: &self.screenshot_folder,
            name: &self.project_name(),
            size_px: self.size_px().unwrap_or((1280, 720)),
            background: self.background.map(|c| (255.0 * c).round() as u8),
            range,
        };
        Choices::of(&project.output, &beginning)
    }

    /// Name of the project: that of its file, else of the dataset.
    fn project_name(&self) -> String {
        name_of(self.project_file().unwrap_or(self.source()))
    }

    fn start_export(&mut self) -> Result<(), String> {
        let (moment, series) = (self.frame_time(), self.series().clone());
        let planned = self.exports.plan(moment, series.times()).ok_or("the dialog of exports has not been open")?;
        let options = planned.as_ref().map_err(Clone::clone)?.0.clone();
        // What a project file may not have, a render refuses.
        let file = self.project_file().unwrap_or(Path::new("project.toml"));
        let mut project = self.to_project(file);
        leave_out(&mut project.timeline, &self.look);
        project.check().map_err(|error| error.to_string())?;
        let job = self.export_job(options);
        self.exports.start(job)
    }

    /// The time on the screen, or the next one that will be.
    fn frame_time(&self) -> Option<FrameTime> {
        self.shown.as_ref().map(|shown| shown.request.time).or(self.state().frame)
    }

    /// The export of what is shown now.
    fn export_job(&self, options: RunOptions) -> Job {
        let mut project = Project::clone(self.project());
        if let EnsembleChoice::One(index) = self.look.followed.ensembles {
            project.look.ensemble = project.ensembles.get(index).map(|ensemble| ensemble.name.clone());
        }
        leave_out(&mut project.timeline, &self.look);
        Job {
            series: self.series().clone(),
            look: Look { camera: self.camera(), followed: Followed::default(), ..self.look.clone() },
            project: Arc::new(project),
            options,
            dataset: name_of(self.source()),
            name: self.project_name(),
            new_pipeline: self.exports.new_pipeline.clone(),
        }
    }

    /// Takes the end of an export, and requests the preview of the dialog.
    pub(super) fn tick_exports(&mut self) {
        match self.exports.take_end() {
            Some(Ok(text)) => notice::add(&mut self.notices, NoticeKind::Done, text),
            Some(Err(problem)) => self.fail(problem),
            None => {}
        }
        let Some(choices) = self.exports.choices().filter(|_| self.exports.is_open()).cloned() else { return };
        let color = |rgb: [u8; 3]| rgb.map(|c| f32::from(c) / 255.0);
        // A movie has no opacity.
        let behind = if choices.still_format().is_some() { self.background } else { [0.0; 3] };
        let of = PreviewOf {
            series: self.series().clone(),
            project: self.project().clone(),
            look: self.look.clone(),
            background: choices.background.map_or(behind, color),
            choices,
            moment: self.frame_time(),
        };
        if let Some(options) = self.exports.options_of_preview(&of) {
            let job = self.export_job(options);
            self.exports.request_preview(of, job);
        }
    }

    /// The command line that exports the same; `None` if the choices are none that can be exported.
    pub fn export_command(&mut self) -> Option<ExportCommand> {
        let (moment, series) = (self.frame_time(), self.series().clone());
        let options = self.exports.plan(moment, series.times())?.as_ref().ok()?.0.clone();
        let choices = self.exports.choices()?;
        let (of_run, mut notes) = exporting::options_of(choices, &options, &self.project().output).ok()?;
        let file = self.project_file();
        match file {
            None => notes.push("save the project first, and write its file for PROJECT.toml".to_owned()),
            Some(_) if self.is_changed() => notes.push("save the project first: its file lacks changes".to_owned()),
            Some(_) => {}
        }
        let mut timeline = self.project().timeline.clone();
        let left = leave_out(&mut timeline, &self.look);
        if !left.is_empty() {
            notes.push(format!("the project's timeline has other {}", left.join(" and ")));
        }
        let project = file.map_or_else(|| OsString::from("PROJECT.toml"), |file| file.as_os_str().to_owned());
        let mut words = vec!["tetreel".into(), "render".into(), project];
        words.extend(of_run);
        if timeline.cameras.keys().is_empty() {
            words.extend(["--camera".into(), self.camera().to_string().into()]);
        }
        words.extend(["--backend".into(), self.look.backend.to_string().into()]);
        Some(ExportCommand { line: exporting::line(&words), words, notes })
    }
}

/// Leaves out of a timeline what the window does not follow. Returns what that is, but for the camera, which the command line can name.
fn leave_out(timeline: &mut Timeline, look: &Look) -> Vec<&'static str> {
    fn clear<T>(track: &mut Keyframed<T>, is_left: bool) -> bool
    where
        Keyframed<T>: Default,
    {
        let had_keys = is_left && !track.keys().is_empty();
        if is_left {
            *track = Keyframed::default();
        }
        had_keys
    }
    let followed = &look.followed;
    let has_no_surfaces = !followed.surfaces || look.surfaces.shown == Shown::Volume;
    clear(&mut timeline.cameras, !followed.camera);
    let left = [
        ("ensembles", clear(&mut timeline.ensembles, followed.ensembles != EnsembleChoice::Project)),
        ("levels of detail", clear(&mut timeline.lod, !followed.lod)),
        ("optics", clear(&mut timeline.optics, !followed.optics)),
        ("isovalues", clear(&mut timeline.isovalue, has_no_surfaces)),
        ("opacities of surfaces", clear(&mut timeline.iso_opacity, has_no_surfaces)),
        ("opacities of flow", clear(&mut timeline.flow, !followed.flow || look.flow.is_none())),
        ("positions of cuts", clear(&mut timeline.cut, !followed.surfaces)),
    ];
    left.into_iter().filter_map(|(name, is_left)| is_left.then_some(name)).collect()
}

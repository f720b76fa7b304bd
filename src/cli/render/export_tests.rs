//! What the window exports is what this command writes for the saved project, bit for bit.

use super::super::progress::Terminal;
use super::super::{Cli, Command};
use crate::camera::Camera;
use crate::export::movie::{Ffmpeg, MovieFormat};
use crate::image::{ExrColor, ExrCompression};
use crate::look::{EnsembleChoice, Look};
use crate::pipeline::{Backend, Series};
use crate::project::Project;
use crate::task::Cancel;
use crate::ui::desk::{Desk, store};
use crate::ui::exporting::{Choices, ExportAction, Frames};
use crate::ui::{Action, ExportCommand, NoticeKind};
use glam::DVec2;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Two ensembles and a camera path, with output settings that are not those of the dialog.
const PROJECT: &str = r#"
version = 1
[data]
source = "tornado.zarr"
[look]
backend = "cpu"
[output]
output = "other_%d.png"
size = "10x10"
steps = "1..2"
times = "0..1"
fps = "10"
duration = 3.0
turntable = 90.0
rays = "exact"
image-scale = "1/2"
upsample = "joint"
kernel = 3
background = "white"
annotate = "legend"
bit-depth = 16
[[ensembles]]
name = "a"
[[ensembles.members]]
name = "one"
function = { transfer-function = { color_map = "viridis", points = [[0, 0.1], [1, 0.6]] } }
[[ensembles]]
name = "b"
[[ensembles.members]]
name = "one"
function = { transfer-function = { color_map = "inferno", points = [[0.5, 0.0], [1, 0.9]] } }
[[timeline.ensembles]]
time = 0.0
value = "a"
[[timeline.ensembles]]
time = 1.0
value = "b"
[[timeline.cameras]]
time = 0.0
[timeline.cameras.value]
position = [22.0, -28.0, 20.0]
focal_point = [0.0, 0.0, 5.0]
view_up = [0.0, 0.0, 1.0]
near = 0.0
projection = { perspective = { view_angle = 30.0 } }
"#;

/// A session that was saved as a project in a folder, with an open dialog.
struct Place {
    folder: tempfile::TempDir,
    desk: Desk,
}

impl Place {
    fn of(project: Option<&str>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let series = Arc::new(Series::open(store(), None).unwrap());
        let look = Look::first_for(&series, &Cancel::new()).unwrap();
        let look = Look { backend: Backend::Cpu, camera: look.camera.fit_to_aspect(40, 20), ..look };
        let project = project.map(|text| Arc::new(Project::parse(text, Path::new("p.toml")).unwrap()));
        let mut desk = Desk::with_look(series, folder.path(), look, project);
        desk.settle();
        let mut place = Self { folder, desk };
        let file = place.folder.path().join("case.toml");
        place.desk.act(Action::SaveProject { to: Some(file), may_replace: false });
        place.until("the project", |desk| !desk.session.is_saving());
        assert!(place.desk.session.project_file().is_some(), "{:?}", place.desk.session.notices());
        place.act(ExportAction::Dialog);
        place
    }

    fn until(&mut self, what: &str, holds: impl Fn(&Desk) -> bool) {
        let begun = Instant::now();
        while !holds(&self.desk) {
            self.desk.session.tick(self.desk.now);
            assert!(begun.elapsed() < Duration::from_secs(60), "no {what}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn act(&mut self, action: ExportAction) {
        self.desk.act(Action::Export(action));
    }

    fn choose(&mut self, file: &str, change: impl FnOnce(&mut Choices)) {
        let mut choices = self.desk.session.exports().choices().unwrap().clone();
        choices.file = self.folder.path().join("out").join(file).display().to_string();
        change(&mut choices);
        self.act(ExportAction::Choose(Box::new(choices)));
    }

    /// Exports by the window and by the command line; the files of both are the same, and there are so many. Returns the command line.
    fn compare(&mut self, count: usize) -> ExportCommand {
        let out = self.folder.path().join("out");
        std::fs::create_dir_all(&out).unwrap();
        let command = self.desk.session.export_command().unwrap();
        self.act(ExportAction::Start);
        self.until("end of the export", |desk| desk.session.exports().progress().is_none());
        let notice = self.desk.session.notices().last().unwrap();
        assert_eq!(notice.kind, NoticeKind::Done, "{}", notice.text);
        let of_window = take_all(&out);
        assert_eq!(of_window.len(), count, "{}", notice.text);
        run(&command.words);
        let of_command = take_all(&out);
        assert!(of_window == of_command, "{}", command.line);
        let other = [command.words.clone(), vec!["--unit-distance".into(), "0.5".into()]].concat();
        run(&other);
        assert!(take_all(&out) != of_window, "the test can fail");
        command
    }
}

/// Runs a command line.
fn run(words: &[OsString]) {
    let cli = Cli::of(words.iter().cloned());
    let Command::Render(args) = &cli.command else { panic!("not render") };
    super::run(args, &cli.words, &Terminal::silent()).unwrap();
}

/// The files of a folder, which are removed.
fn take_all(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let take = |path: PathBuf| {
        let bytes = std::fs::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        (path, bytes)
    };
    files.into_iter().map(take).collect()
}

#[test]
fn images_of_a_look_are_those_of_its_project() {
    let mut place = Place::of(None);
    place.choose("f_%02d.png", |choices| {
        (choices.frames, choices.steps, choices.size_px) = (Frames::Steps, "0..3:2".to_owned(), (48, 36));
        (choices.time, choices.legend, choices.title) = (true, true, true);
        choices.title_text = "it's a tornado, small".to_owned();
    });
    assert_eq!(place.compare(2).notes, [] as [&str; 0]);
    place.choose("moment.png", |choices| {
        (choices.frames, choices.deep_png, choices.background) = (Frames::Moment, true, None);
    });
    place.compare(1);
    place.choose("f.exr", |choices| {
        (choices.exr, choices.exr_compression, choices.half_exr) = (ExrColor::Raw, ExrCompression::Piz, true);
    });
    place.compare(1);
    place.desk.act(Action::Orbit(DVec2::new(0.1, 0.2)));
    place.choose("f_%d.png", |choices| {
        (choices.frames, choices.steps, choices.duration) = (Frames::Steps, String::new(), "0.2".to_owned());
        (choices.interpolate, choices.turntable, choices.times) = (true, "-30".to_owned(), "0..".to_owned());
        choices.background = Some([255, 128, 0]);
    });
    place.compare(5);
}

#[test]
fn output_settings_of_the_project_do_not_come_through() {
    let mut place = Place::of(Some(PROJECT));
    let first = place.desk.session.exports().choices().unwrap().clone();
    assert_eq!((first.frames, first.size_px, &*first.steps), (Frames::Steps, (10, 10), "1..2"));
    assert!(first.legend && first.deep_png && first.background == Some([255; 3]) && first.duration == "3");
    assert_eq!(Path::new(&first.file), place.folder.path().join("other_%d.png"));
    place.choose("f_%d.png", |choices| {
        (choices.size_px, choices.steps) = ((40, 30), "0..".to_owned());
        for text in [&mut choices.times, &mut choices.duration, &mut choices.turntable] {
            text.clear();
        }
        (choices.legend, choices.deep_png, choices.background) = (false, false, None);
    });
    assert_eq!(place.compare(4).notes, [] as [&str; 0]);
    place.choose("f.exr", |choices| choices.frames = Frames::Moment);
    place.compare(1);
    // A camera that has left its path is named; for other ensembles there is no option.
    place.desk.act(Action::Orbit(DVec2::new(0.3, 0.0)));
    let turned = place.desk.session.camera();
    place.choose("moment.png", |_| ());
    let command = place.compare(1);
    assert!(command.notes.is_empty(), "{:?}", command.notes);
    let named = command.words.iter().position(|word| word == "--camera").unwrap();
    let text = command.words[named + 1].to_str().unwrap();
    assert_eq!(Camera::parse(text, &place.desk.session.look().camera).unwrap(), turned);
    place.desk.act(Action::Ensembles(EnsembleChoice::One(1)));
    let command = place.desk.session.export_command().unwrap();
    assert!(command.notes.iter().any(|note| note.contains("timeline has other ensembles")), "{:?}", command.notes);
}

#[test]
fn a_movie_is_that_of_the_command_line() {
    if let Err(why) = Ffmpeg::find(MovieFormat::Mp4) {
        eprintln!("SKIPPED (ffmpeg): {why}");
        return;
    }
    let mut place = Place::of(None);
    place.choose("a.mp4", |choices| {
        (choices.frames, choices.size_px, choices.time) = (Frames::Steps, (41, 30), true);
        choices.fps = "5".to_owned();
    });
    place.compare(1);
}

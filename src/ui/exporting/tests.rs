//! Exports of a session.

use super::{Choices, ExportAction, Frames};
use crate::camera::Axis;
use crate::image::read_png;
use crate::pipeline::test_series::{Log, logged};
use crate::pipeline::{RenderMode, Series};
use crate::playback::Command;
use crate::project::Project;
use crate::transfer::ColorMap;
use crate::ui::desk::{Desk, store};
use crate::ui::picture::over_background;
use crate::ui::worker::tests::wait_for;
use crate::ui::{Action, NoticeKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A session with an open dialog.
fn open(series: &Arc<Series>, folder: &Path, project: Option<Arc<Project>>) -> Desk {
    let mut desk = Desk::with(series.clone(), folder, project);
    desk.settle();
    export(&mut desk, ExportAction::Dialog);
    desk
}

fn fake(folder: &Path, steps: usize) -> (Desk, Log) {
    let (series, log) = logged(steps);
    (open(&series, folder, None), log)
}

fn real(folder: &Path) -> Desk {
    open(&Arc::new(Series::open(store(), None).unwrap()), folder, None)
}

fn export(desk: &mut Desk, action: ExportAction) {
    desk.act(Action::Export(action));
}

fn choose(desk: &mut Desk, change: impl FnOnce(&mut Choices)) {
    let mut choices = desk.session.exports().choices().unwrap().clone();
    change(&mut choices);
    export(desk, ExportAction::Choose(Box::new(choices)));
    desk.session.tick(desk.now);
}

/// Chooses all steps, in small images of this pattern.
fn choose_all(desk: &mut Desk, file: &Path) {
    choose(desk, |choices| {
        choices.frames = Frames::Steps;
        choices.file = file.display().to_string();
        choices.size_px = (24, 16);
    });
}

/// Ticks until there is no export any more; returns its message.
fn end(desk: &mut Desk) -> (NoticeKind, String) {
    wait_for("end of the export", || {
        desk.session.tick(desk.now);
        desk.session.exports().progress().is_none().then_some(())
    });
    let notice = desk.session.notices().last().unwrap();
    (notice.kind, notice.text.clone())
}

fn run(desk: &mut Desk) -> (NoticeKind, String) {
    export(desk, ExportAction::Start);
    end(desk)
}

fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.into_iter().map(|path| (path.file_name().unwrap().into(), std::fs::read(&path).unwrap())).collect()
}

#[test]
fn files_are_those_of_the_state_before_an_edit_while_they_are_made() {
    let [before, edited, after] = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let (mut desk, log) = fake(before.path(), 3);
    let into = |folder: &tempfile::TempDir| folder.path().join("f_%d.png");
    choose_all(&mut desk, &into(&before));
    let (kind, text) = run(&mut desk);
    assert!(kind == NoticeKind::Done && text.starts_with("wrote 3 frames, ") && text.contains("f_2.png"), "{text}");
    log.hang(true);
    choose_all(&mut desk, &into(&edited));
    export(&mut desk, ExportAction::Start);
    desk.act(Action::Colors(ColorMap::built_in("inferno").unwrap().clone()));
    desk.act(Action::ViewAlong { axis: Axis::X, from_positive: true });
    desk.act(Action::Renderer(RenderMode::Raycast));
    choose_all(&mut desk, &into(&after));
    assert!(desk.session.exports().progress().is_some());
    log.hang(false);
    end(&mut desk);
    assert_eq!(files(edited.path()), files(before.path()));
    run(&mut desk);
    assert_eq!(files(after.path()).len(), 3);
    assert_ne!(files(after.path()), files(before.path()), "the test can fail");
}

#[test]
fn a_cancelled_export_leaves_what_was_there_and_is_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let (mut desk, log) = fake(folder.path(), 4);
    let place = folder.path().join("f_%d.png");
    std::fs::write(folder.path().join("f_0.png"), "mine").unwrap();
    choose_all(&mut desk, &place);
    choose(&mut desk, |choices| choices.replaces = true);
    log.hang(true);
    export(&mut desk, ExportAction::Start);
    assert!(!desk.session.exports().can_resume());
    export(&mut desk, ExportAction::Cancel);
    assert!(desk.session.exports().is_cancelled());
    let (kind, text) = end(&mut desk);
    assert!(kind == NoticeKind::Done && text.contains("cancelled"), "{text}");
    assert_eq!(files(folder.path()), [("f_0.png".into(), b"mine".to_vec())]);
    log.hang(false);
    assert!(desk.session.exports().can_resume());
    export(&mut desk, ExportAction::Resume);
    let (_, text) = end(&mut desk);
    assert!(text.starts_with("wrote 4 frames"), "{text}");
    assert!(!desk.session.exports().can_resume(), "it is complete");
    let whole = files(folder.path());
    // Some of the images are there.
    std::fs::remove_file(folder.path().join("f_1.png")).unwrap();
    choose(&mut desk, |choices| (choices.resume, choices.replaces) = (true, false));
    let (_, text) = run(&mut desk);
    assert!(text.starts_with("wrote 1 of 4 frames") && text.ends_with("3 were there already"), "{text}");
    assert_eq!(files(folder.path()), whole);
    // An image of another request is no frame of it.
    std::fs::copy(folder.path().join("f_2.png"), folder.path().join("f_3.png")).unwrap();
    let (kind, text) = run(&mut desk);
    assert!(kind == NoticeKind::Error && text.contains("f_3.png: there is a file of that name"), "{text}");
    assert_eq!(files(folder.path())[3].1, whole[2].1);
}

#[test]
fn what_ends_early_says_how_far_it_came() {
    let folder = tempfile::tempdir().unwrap();
    let (mut desk, log) = fake(folder.path(), 40);
    choose_all(&mut desk, &folder.path().join("f_%02d.png"));
    log.take(Duration::from_millis(20));
    export(&mut desk, ExportAction::Start);
    let seen = wait_for("frames", || {
        desk.session.tick(desk.now);
        desk.session.exports().progress().filter(|now| now.stage == "render" && now.done > 1 && now.bytes > 0)
    });
    assert!(seen.total == 40 && seen.left.is_some() && seen.unit == "frames", "{seen:?}");
    export(&mut desk, ExportAction::Start);
    assert!(desk.session.notices().last().unwrap().text.contains("an export is under way"));
    export(&mut desk, ExportAction::Cancel);
    end(&mut desk);
    let written = files(folder.path());
    assert!((1..40).contains(&written.len()), "{}", written.len());
    for (name, _) in &written {
        assert!(read_png(&folder.path().join(name)).is_ok(), "{} is whole", name.display());
    }
    drop(desk);
}

#[test]
fn what_cannot_be_exported_is_said_in_one_message() {
    let folder = tempfile::tempdir().unwrap();
    let mut desk = real(folder.path());
    let taken = folder.path().join("taken.png");
    std::fs::write(&taken, "mine").unwrap();
    let refused = |desk: &mut Desk, file: &Path| {
        choose(desk, |choices| choices.file = file.display().to_string());
        let (kind, text) = run(desk);
        assert_eq!(kind, NoticeKind::Error, "{text}");
        text
    };
    let text = refused(&mut desk, &taken);
    assert!(text.contains("taken.png: there is a file of that name; choose another name"), "{text}");
    assert_eq!(std::fs::read_to_string(&taken).unwrap(), "mine");
    let text = refused(&mut desk, &taken.join("a.png"));
    assert!(text.contains("is not a folder; choose another name"), "{text}");
    let text = refused(&mut desk, &folder.path().join("a.jpg"));
    assert!(text.contains("neither an image") && text.contains("a.jpg"), "{text}");
    assert!(refused(&mut desk, Path::new(" ")).contains("frame_%04d.png"));
    let movie = refused(&mut desk, &folder.path().join("nowhere/a.mp4"));
    assert!(movie.contains("nowhere: is not a folder; create it first"), "{movie}");
    assert_eq!(files(folder.path()).len(), 1);
    export(&mut desk, ExportAction::Resume);
    assert_eq!(desk.session.notices().len(), 4, "the oldest have gone");
}

#[test]
fn what_no_project_file_may_have_is_refused() {
    let ensemble = "[[ensembles]]\nname = \"a\"\n[[ensembles.members]]\nname = \"one\"\n\
        function = { transfer-function = { color_map = \"viridis\", points = [[0, 0.01], [1, 0.3]] } }\n";
    let text =
        format!("version = 1\n[data]\nsource = \"x.zarr\"\n{ensemble}[[timeline.lod]]\ntime = 0.0\nvalue = 0.5\n");
    let project = Arc::new(Project::parse(&text, Path::new("p.toml")).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let mut desk = open(&Arc::new(Series::open(store(), None).unwrap()), folder.path(), Some(project));
    choose_all(&mut desk, &folder.path().join("f_%d.png"));
    desk.act(Action::Renderer(RenderMode::Raycast));
    let (kind, text) = run(&mut desk);
    assert!(
        kind == NoticeKind::Error && text.contains("mode 'raycast' always draws all cells; leave it out"),
        "{text}"
    );
    // Without the keys there is nothing to refuse.
    desk.act(Action::LevelOfDetail(1.0));
    let (kind, text) = run(&mut desk);
    assert!(kind == NoticeKind::Done && files(folder.path()).len() == 4, "{text}");
}

#[test]
fn choices_without_a_meaning_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut desk = real(folder.path());
    let problem = |desk: &mut Desk, change: fn(&mut Choices)| {
        let whole = desk.session.exports().choices().unwrap().clone();
        choose(desk, |choices| {
            choices.frames = Frames::Steps;
            choices.file = "f_%d.png".to_owned();
            change(choices);
        });
        let problem = desk.session.exports().frames().unwrap().map_err(ToOwned::to_owned);
        choose(desk, |choices| *choices = whole);
        problem
    };
    assert_eq!(problem(&mut desk, |_| ()), Ok(4));
    assert_eq!(problem(&mut desk, |choices| choices.steps = "1..99:2".to_owned()), Ok(2));
    assert_eq!(problem(&mut desk, |choices| choices.duration = "2".to_owned()), Ok(50));
    let said = |desk: &mut Desk, change: fn(&mut Choices)| problem(desk, change).unwrap_err();
    assert!(said(&mut desk, |choices| choices.steps = "x".to_owned()).starts_with("steps: 'x' is no range"));
    assert!(said(&mut desk, |choices| choices.steps = "9..".to_owned()).contains("reach beyond the series"));
    assert!(said(&mut desk, |choices| choices.duration = "-1".to_owned()).starts_with("duration: "));
    assert!(said(&mut desk, |choices| choices.turntable = "round".to_owned()).starts_with("turntable: "));
    assert!(said(&mut desk, |choices| choices.times = "2..1".to_owned()).starts_with("times: "));
    assert!(said(&mut desk, |choices| choices.file = "f.png".to_owned()).contains("4 frames need a number"));
    assert!(said(&mut desk, |choices| choices.size_px = (0, 10)).starts_with("size: "));
    assert!(
        said(&mut desk, |choices| (choices.title, choices.title_text) = (true, "a, time".to_owned())).contains("title")
    );
    assert!(
        said(&mut desk, |choices| (choices.file, choices.fps) = ("a.mp4".to_owned(), "0".to_owned()))
            .contains("frame rate")
    );
}

#[test]
fn names_follow_the_choice_of_frames() {
    let folder = tempfile::tempdir().unwrap();
    let desk = real(folder.path());
    let first = desk.session.exports().choices().unwrap().clone();
    assert_eq!(first.file, folder.path().join("tornado.png").display().to_string());
    assert!(first.frames == Frames::Moment && first.size_px == (40, 20));
    let steps = first.with_frames(Frames::Steps);
    assert_eq!(steps.file, folder.path().join("tornado_%04d.png").display().to_string());
    assert_eq!(steps.with_frames(Frames::Moment), first);
    let movie = Choices { file: "a.mp4".to_owned(), ..first };
    assert_eq!(movie.with_frames(Frames::Steps).file, "a.mp4");
}

#[test]
fn a_moment_between_two_steps_is_exported_as_it_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let mut desk = real(folder.path());
    let file = folder.path().join("between.png");
    choose(&mut desk, |choices| (choices.file, choices.background) = (file.display().to_string(), Some([0; 3])));
    desk.act(Action::Play(Command::Mode(crate::playback::Mode::RealTime)));
    desk.act(Action::Play(Command::Interpolate(true)));
    let times = desk.session.series().times().values.clone();
    desk.act(Action::Play(Command::SeekTime(0.75 * times[1] + 0.25 * times[2])));
    desk.settle();
    assert!(desk.shown().request.time.toward().is_some(), "{:?}", desk.shown().request.time);
    let shown = over_background(&desk.shown().frame.planes.color.pixels, [0.0; 3]);
    run(&mut desk);
    let written = over_background(&read_png(&file).unwrap().pixels, [0.0; 3]);
    assert_eq!(written, shown);
}

#[test]
fn the_preview_is_a_small_picture_of_the_export_and_follows_the_choices() {
    let folder = tempfile::tempdir().unwrap();
    let mut desk = real(folder.path());
    let file = folder.path().join("a.png");
    let preview = |desk: &mut Desk, change: fn(&mut Choices)| {
        let before = desk.session.exports().preview();
        choose(desk, change);
        let is_new = |made: &super::PreviewOutcome| before.as_ref() != Some(made);
        wait_for("preview", || desk.session.exports().preview().filter(is_new)).unwrap()
    };
    choose(&mut desk, |choices| choices.file = file.display().to_string());
    let plain = preview(&mut desk, |choices| (choices.size_px, choices.background) = ((120, 90), Some([255; 3])));
    assert_eq!(plain.size, [120, 90]);
    run(&mut desk);
    assert_eq!(over_background(&read_png(&file).unwrap().pixels, [0.0; 3]), plain.pixels);
    let noted = preview(&mut desk, |choices| (choices.legend, choices.title) = (true, true));
    assert_ne!(noted.pixels, plain.pixels);
    let large = preview(&mut desk, |choices| choices.size_px = (3840, 2160));
    assert_eq!(large.size, [704, 396]);
    let before = desk.session.exports().preview();
    desk.act(Action::ViewAlong { axis: Axis::X, from_positive: true });
    desk.settle();
    let turned = wait_for("preview", || desk.session.exports().preview().filter(|made| Some(made) != before.as_ref()));
    assert!(turned.is_ok());
}

//! The window plays a project.

use egui::Key;
use egui_kittest::kittest::{NodeT, Queryable};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tetreel::pipeline::{FrameRequest, Series};
use tetreel::playback::{Loop, StepRange};
use tetreel::project::Project;
use tetreel::ui::window::{Answer, Choice, Dressed, Start, WindowOptions};
use tetreel_ui_tests::desk::{Desk, options, store};

const PROJECT: &str = r#"
version = 1
[data]
source = "tornado.zarr"
[playback]
loop = "ping-pong"
frames-per-second = 12.5
range = { a = 1, b = 3 }
[[ensembles]]
name = "overview"
[[ensembles.members]]
name = "one"
function = { transfer-function = { color_map = "viridis", points = [[0, 0.1], [1, 0.6]] } }
[[ensembles]]
name = "core"
[[ensembles.members]]
name = "one"
function = { transfer-function = { color_map = "inferno", points = [[0.5, 0.0], [1, 0.9]] } }
[[timeline.ensembles]]
time = 0.0
value = "overview"
[[timeline.cameras]]
time = 0.0
[timeline.cameras.value]
position = [22.0, -28.0, 20.0]
focal_point = [0.0, 0.0, 5.0]
view_up = [0.0, 0.0, 1.0]
near = 0.0
projection = { perspective = { view_angle = 30.0 } }
"#;

fn open(text: &str) -> Option<Desk> {
    let folder = tempfile::tempdir().unwrap();
    let project = Arc::new(Project::parse(text, Path::new("p.toml")).unwrap());
    let plain = options(folder.path(), Start::Open(vec![store(folder.path())]));
    let dress = plain.dress.clone();
    let dress = move |series: &Series| Ok(Dressed { project: Some(project.clone()), ..dress(series)? });
    let options = WindowOptions { dress: Arc::new(dress), ..plain };
    let mut desk = Desk::with([1280.0, 1000.0], 1.0, options, folder)?;
    desk.begin();
    desk.settle();
    Some(desk)
}

/// Opens a file by its path, typed over what the box has.
fn open_typed(desk: &mut Desk, path: &Path) {
    desk.click("Open...");
    desk.click("Path to open");
    desk.click("Path to open");
    desk.press_with(egui::Modifiers::COMMAND, Key::A);
    desk.harness.get_by_label("Path to open").type_text(path.to_str().unwrap());
    desk.harness.step();
    desk.press(Key::Enter);
}

/// Which rows of the list are marked.
fn marked(desk: &Desk) -> Vec<&'static str> {
    let is_marked = |row: &&str| {
        let toggled = desk.harness.get_by_label(row).accesskit_node().toggled();
        toggled == Some(egui::accesskit::Toggled::True)
    };
    ["timeline", "overview", "core"].into_iter().filter(is_marked).collect()
}

#[test]
fn the_ensembles_of_a_project_are_listed_and_chosen_by_click_and_by_key() {
    let Some(mut desk) = open(PROJECT) else { return };
    assert_eq!(marked(&desk), ["timeline"]);
    desk.until_there("shown: overview");
    let on_timeline = desk.session().shown().unwrap().request.clone();
    assert_eq!(on_timeline.camera.position.x, 22.0);
    desk.save("project_timeline.png");
    desk.click("core");
    desk.settle();
    assert_eq!(marked(&desk), ["core"]);
    let core = desk.session().shown().unwrap().request.clone();
    let table = |request: &FrameRequest| request.tets().unwrap().table.clone();
    assert!(table(&core) != table(&on_timeline) && core.camera == on_timeline.camera);
    desk.save("project_core.png");
    desk.press(Key::Num1);
    desk.settle();
    assert_eq!(marked(&desk), ["overview"]);
    assert_eq!(table(&desk.session().shown().unwrap().request), table(&on_timeline));
    desk.click("reversed");
    desk.settle();
    assert_eq!(marked(&desk), ["overview"], "the ensemble itself is edited");
    assert_ne!(table(&desk.session().shown().unwrap().request), table(&on_timeline));
    desk.save("project_edited.png");
    desk.click("Undo");
    desk.settle();
    assert_eq!(table(&desk.session().shown().unwrap().request), table(&on_timeline));
    desk.press_with(egui::Modifiers::CTRL | egui::Modifiers::SHIFT, Key::Z);
    desk.settle();
    assert_ne!(table(&desk.session().shown().unwrap().request), table(&on_timeline));
    desk.press_with(egui::Modifiers::CTRL, Key::Z);
    desk.press(Key::Num0);
    desk.settle();
    assert_eq!(marked(&desk), ["timeline"]);
    assert_eq!(table(&desk.session().shown().unwrap().request), table(&on_timeline));
}

#[test]
fn a_turned_camera_leaves_its_path_and_a_key_or_a_click_returns() {
    let Some(mut desk) = open(PROJECT) else { return };
    let is_on = |desk: &Desk| desk.harness.get_by_label("camera path").accesskit_node().toggled();
    let on = is_on(&desk);
    for returns in [0, 1] {
        let middle = desk.place("Picture of").center();
        desk.drag(middle, middle + egui::vec2(80.0, 0.0));
        desk.settle();
        assert!(is_on(&desk) != on && !desk.session().follows_path());
        assert_ne!(desk.session().shown().unwrap().request.camera.position.x, 22.0);
        if returns == 0 {
            desk.press(Key::C)
        } else {
            desk.click("camera path")
        }
        desk.settle();
        assert!(is_on(&desk) == on && desk.session().follows_path());
        assert_eq!(desk.session().shown().unwrap().request.camera.position.x, 22.0);
    }
}

#[test]
fn it_is_played_as_the_project_says_and_what_is_opened_next_is_not() {
    let Some(mut desk) = open(PROJECT) else { return };
    let settings = desk.session().state().settings;
    assert_eq!((settings.repeat, settings.frames_per_second), (Loop::PingPong, 12.5));
    assert_eq!((settings.range, desk.step()), (Some(StepRange { a: 1, b: 3 }), 1));
    let path = desk.folder.path().join("tornado.zarr");
    desk.click("Open...");
    desk.click("Path to open");
    desk.click("Path to open");
    desk.harness.get_by_label("Path to open").type_text(path.to_str().unwrap());
    desk.harness.step();
    desk.press(Key::Enter);
    let begin = std::time::Instant::now();
    while desk.session().project().ensembles.len() > 1 {
        desk.harness.step();
        assert!(begin.elapsed().as_secs() < 60);
    }
    desk.begin();
    desk.settle();
    assert_eq!((desk.session().state().settings.repeat, desk.step()), (Loop::Off, 0));
    assert!(desk.harness.query_by_label("core").is_none());
}

#[test]
fn what_is_shown_is_saved_as_a_project_and_opened_again() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    desk.click("reversed");
    desk.settle();
    let picture = desk.session().shown().unwrap().request.clone();
    let path = desk.folder.path().join("seen.toml");
    let saves = |desk: &mut Desk, path: &Path| {
        desk.click("Save...");
        desk.settle();
        desk.save("project_save.png");
        desk.click("Path of the project file");
        desk.press_with(egui::Modifiers::COMMAND, Key::A);
        desk.harness.get_by_label("Path of the project file").type_text(path.to_str().unwrap());
        desk.harness.step();
        desk.click("Save to this file");
        desk.until("a message", |session| !session.notices().is_empty());
        let text = desk.session().notices()[0].text.clone();
        desk.until_there("Dismiss message 1");
        desk.click("Dismiss message 1");
        text
    };
    assert!(saves(&mut desk, &path).starts_with("saved "));
    assert!(!desk.session().is_changed() && desk.session().project_file() == Some(&path));
    let other = desk.folder.path().join("other.toml");
    std::fs::write(&other, "mine").unwrap();
    assert!(saves(&mut desk, &other).contains("there is a file of that name"));
    assert_eq!(std::fs::read_to_string(&other).unwrap(), "mine");
    desk.click("reversed");
    desk.click("Save...");
    desk.until_there("seen.toml, changed");
    desk.click("Save...");
    open_typed(&mut desk, &path);
    desk.until_there("Unsaved changes");
    desk.save("project_unsaved.png");
    desk.click("Stay here");
    desk.harness.step();
    assert!(desk.harness.query_by_label("Unsaved changes").is_none() && desk.session().is_changed());
    open_typed(&mut desk, &path);
    desk.until_there("Unsaved changes");
    desk.click("Discard them");
    let begin = std::time::Instant::now();
    while desk.session().is_changed() {
        desk.harness.step();
        assert!(begin.elapsed().as_secs() < 60);
    }
    desk.begin();
    desk.settle();
    let again = desk.session().shown().unwrap().request.clone();
    assert_eq!(again.tets().unwrap().table, picture.tets().unwrap().table);
    desk.click("Save...");
    desk.until_there("seen.toml");
}

#[test]
fn a_project_without_ensembles_has_no_list() {
    let text = &PROJECT[..PROJECT.find("[[ensembles]]").unwrap()];
    let Some(mut desk) = open(text) else { return };
    assert!(desk.harness.query_by_label("timeline").is_none() && desk.harness.query_by_label("camera path").is_none());
    desk.press(Key::Num1);
    desk.settle();
    assert!(desk.session().notices().is_empty());
}

#[test]
fn every_shipped_project_is_opened_through_the_dialog_of_the_system() {
    let folder = tempfile::tempdir().unwrap();
    let projects = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/projects");
    let mut files: Vec<_> = std::fs::read_dir(projects).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 11);
    let (answers, asked) = (Arc::new(Mutex::new(files.clone())), Arc::new(Mutex::new(Vec::new())));
    let (next, log) = (answers.clone(), asked.clone());
    let dialogs = move |choice: Choice, _: Option<&Path>| -> Answer {
        log.lock().unwrap().push(choice);
        let file = next.lock().unwrap().pop();
        Box::new(move || file)
    };
    let options = WindowOptions { dialogs: Arc::new(dialogs), ..options(folder.path(), Start::Nothing) };
    let Some(mut desk) = Desk::with([1280.0, 1000.0], 1.0, options, folder) else { return };
    desk.harness.run_steps(3);
    for file in files.iter().rev() {
        let was_open = desk.window().session().is_some();
        if was_open {
            desk.click("Open...");
        }
        desk.click("Choose file");
        let begun = Instant::now();
        let is_open = |desk: &Desk| {
            desk.window()
                .session()
                .is_some_and(|session| session.project_file() == Some(file) && session.shown().is_some())
        };
        while !is_open(&desk) {
            desk.harness.step();
            assert!(begun.elapsed() < Duration::from_secs(60), "{}: {:?}", file.display(), desk.window().notices());
            std::thread::sleep(Duration::from_millis(5));
        }
        desk.settle();
        assert_eq!(desk.session().notices(), &[], "{}", file.display());
        assert!(!desk.session().is_changed(), "{}", file.display());
    }
    // An answer without a path changes nothing.
    desk.click("Open...");
    desk.click("Choose folder");
    desk.until_there("nothing was chosen; where no dialog opens, type the path");
    assert_eq!(desk.session().project_file(), Some(&*files[0]));
    assert_eq!(asked.lock().unwrap().iter().filter(|choice| **choice == Choice::File).count(), files.len());
}

#[test]
fn a_project_that_cannot_be_opened_is_one_message_and_what_was_shown_stays() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let shown = desk.session().shown().unwrap().request.clone();
    let folder = desk.folder.path().to_owned();
    let bad = [
        (
            "key",
            "version = 1\n[data]\nsource = \"tornado.zarr\"\n[look]\nsharpness = 3\n",
            &["line 5", "sharpness"][..],
        ),
        ("source", "version = 1\n[data]\nsource = \"gone.zarr\"\n", &["gone.zarr", "moved or renamed"]),
        ("field", "version = 1\n[data]\nsource = \"tornado.zarr\"\nfield = \"gone\"\n", &["tornado.zarr", "'gone'"]),
        ("text", "Dear diary,", &["line 1"]),
    ];
    for (name, text, said) in bad {
        let path = folder.join(format!("{name}.toml"));
        std::fs::write(&path, text).unwrap();
        open_typed(&mut desk, &path);
        desk.until("a message", |session| !session.notices().is_empty());
        let texts: Vec<&str> = desk.session().notices().iter().map(|notice| &*notice.text).collect();
        assert!(texts.len() == 1 && said.iter().all(|part| texts[0].contains(part)), "{name}: {texts:?}");
        desk.until_there("Dismiss message 1");
        desk.click("Dismiss message 1");
        // While a file is opened a bar above the picture says so.
        desk.until("the same picture", |session| session.shown().is_some_and(|now| now.request == shown));
        assert!(desk.session().project_file().is_none(), "{name}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }
}

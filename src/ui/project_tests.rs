//! Sessions with a project.

use super::desk::{Desk, store};
use super::keys;
use super::picture::over_background;
use super::worker::tests::wait_for;
use super::*;
use crate::ingest::{IngestOptions, ingest};
use crate::look::{Colors, EnsembleChoice, Keyed};
use crate::node_table::TransferTable;
use crate::optics::OpticsKind;
use crate::pipeline::test_series::{logged, without_values};
use crate::pipeline::{Backend, FrameRequest, FrameTime, Pipeline, RenderMode, Series, TetDraw};
use crate::playback::{Command, Mode};
use crate::project::{Animation, Edit, Project};
use crate::store::Store;
use crate::synth::{SeriesName, SynthSpec, generate};
use crate::task::{Cancel, Silent};
use crate::transfer::{ColorMap, Lengths, Member, OpacityPoint, RangePolicy};
use glam::DVec2;
use std::path::Path;
use std::sync::Arc;

/// The unit distance of the sessions.
const UNIT: f64 = 0.01;

fn series() -> Arc<Series> {
    Arc::new(Series::open(store(), None).unwrap())
}

fn project(text: &str) -> Arc<Project> {
    let text = format!("version = 1\n[data]\nsource = \"x.zarr\"\n{text}");
    Arc::new(Project::parse(&text, Path::new("p.toml")).unwrap())
}

fn ensemble(name: &str, map: &str) -> String {
    format!(
        "[[ensembles]]\nname = \"{name}\"\n[[ensembles.members]]\nname = \"one\"\n\
         function = {{ transfer-function = {{ color_map = \"{map}\", points = [[0, 0.01], [1, 0.3]] }} }}\n"
    )
}

fn camera(time: f64, x: f64) -> String {
    format!(
        "[[timeline.cameras]]\ntime = {time:?}\n[timeline.cameras.value]\nposition = [{x:?}, -30.0, 1.5]\n\
         focal_point = [0.0, 0.0, 0.0]\nview_up = [0.0, 0.0, 1.0]\nnear = 0.0\n\
         projection = {{ perspective = {{ view_angle = 30.0 }} }}\n"
    )
}

fn ensembles() -> String {
    ensemble("a", "viridis") + &ensemble("b", "gray") + &ensemble("c", "inferno")
}

/// A project with one setting of each kind changing from the first step to the last.
fn keyed(series: &Series) -> Arc<Project> {
    let times = &series.times().values;
    let (first, last) = (times[0], times[times.len() - 1]);
    let keys = |track: &str, a: &str, b: &str| {
        format!(
            "[[timeline.{track}]]\ntime = {first:?}\nvalue = {a}\n[[timeline.{track}]]\ntime = {last:?}\nvalue = {b}\n"
        )
    };
    let tracks = keys("ensembles", "\"a\"", "\"b\"")
        + &keys("lod", "0.25", "0.75")
        + &keys("optics", "\"exact\"", "\"partial\"");
    project(&(ensembles() + &tracks + &camera(first, -10.0) + &camera(last, 20.0)))
}

fn open(series: &Arc<Series>, project: &Arc<Project>) -> Desk {
    let mut desk = Desk::with(series.clone(), Path::new("."), Some(project.clone()));
    // The renderer that uses the level of detail.
    desk.act(Action::Renderer(RenderMode::Havs));
    desk.settle();
    desk
}

fn at(animation: &mut Animation, series: &Series, time: FrameTime) -> Keyed {
    animation.at(time, time.time(series.times()), &Cancel::new()).unwrap()
}

fn animation(series: &Arc<Series>, project: &Arc<Project>) -> Animation {
    Animation::new(project.clone(), series.clone(), Default::default(), Lengths::of_unit_distance(UNIT))
}

/// The table of one ensemble at all times.
fn table_of(series: &Arc<Series>, project: &Project, name: &str) -> TransferTable {
    let mut project = project.clone();
    (project.timeline, project.look.ensemble) = (Default::default(), Some(name.to_owned()));
    at(&mut animation(series, &Arc::new(project)), series, 0.into()).colors.unwrap().table
}

fn press(desk: &mut Desk, key: char) {
    desk.act(keys::action(&key.to_string(), [false; 2]).unwrap());
    desk.later(1000);
    desk.settle();
}

fn go_to(desk: &mut Desk, step: usize) {
    desk.act(Action::Play(Command::SeekStep(step)));
    desk.settle();
}

fn said(request: &FrameRequest) -> Keyed {
    Keyed {
        surfaces: Default::default(),
        flow_opacity: None,
        colors: Some(Colors {
            table: request.tets().unwrap().table.clone(),
            formula: request.tets().unwrap().formula.clone(),
        }),
        camera: Some(request.camera),
        lod: Some(request.lod()),
        optics: Some(request.tets().unwrap().optics),
    }
}

#[test]
fn every_frame_of_a_keyed_timeline_is_what_the_animation_says() {
    let series = series();
    let project = keyed(&series);
    let (mut desk, mut animation) = (open(&series, &project), animation(&series, &project));
    let mut seen: Vec<Keyed> = Vec::new();
    // Also while playing, and in any order.
    for step in [0, 2, 1, 3] {
        go_to(&mut desk, step);
        seen.push(said(&desk.shown().request));
        assert_eq!(seen.last(), Some(&at(&mut animation, &series, step.into())), "step {step}");
    }
    for (i, moment) in seen.iter().enumerate() {
        let differs = |other: &Keyed| other.colors != moment.colors && other.camera != moment.camera;
        assert!(seen[..i].iter().all(differs), "the test can fail");
    }
    desk.act(Action::Play(Command::SeekStep(0)));
    desk.act(Action::Play(Command::Play));
    let mut steps = Vec::new();
    while !desk.session.state().ended {
        if desk.settle() > 0 {
            let request = desk.shown().request.clone();
            assert_eq!(said(&request), at(&mut animation, &series, request.time), "{:?}", request.time);
            steps.push(request.time.step());
        }
        desk.later(40);
    }
    assert_eq!(steps, [0, 1, 2, 3]);
    assert!(desk.session.notices().is_empty(), "{:?}", desk.session.notices());
}

#[test]
fn between_two_steps_it_is_the_moment_that_counts() {
    let series = series();
    let project = keyed(&series);
    let (mut desk, mut animation) = (open(&series, &project), animation(&series, &project));
    for command in [Command::Mode(Mode::RealTime), Command::Interpolate(true), Command::Play] {
        desk.act(Action::Play(command));
    }
    let mut between = 0;
    // The whole series takes ten seconds.
    for _ in 0..30 {
        desk.later(300);
        desk.session.tick(desk.now);
        desk.settle();
        let request = desk.shown().request.clone();
        assert_eq!(said(&request), at(&mut animation, &series, request.time), "{:?}", request.time);
        between += usize::from(request.time.toward().is_some());
    }
    assert!(between > 5, "{between}");
}

#[test]
fn a_table_that_does_not_change_stays_the_same_one() {
    let series = series();
    let project = project(&(ensembles() + &camera(series.times().values[0], -10.0)));
    let mut desk = open(&series, &project);
    let first = desk.shown().request.tets().unwrap().table.over_scalars().clone();
    for step in [1, 3, 2] {
        go_to(&mut desk, step);
        assert!(Arc::ptr_eq(desk.shown().request.tets().unwrap().table.over_scalars(), &first), "step {step}");
    }
    desk.act(Action::Orbit(DVec2::new(0.1, 0.0)));
    desk.later(1000);
    desk.settle();
    assert!(Arc::ptr_eq(desk.shown().request.tets().unwrap().table.over_scalars(), &first), "a camera has no table");
}

#[test]
fn a_key_swaps_the_ensembles_and_another_returns_to_the_timeline() {
    let series = series();
    let project = keyed(&series);
    let (mut desk, mut animation) = (open(&series, &project), animation(&series, &project));
    go_to(&mut desk, 1);
    let on_timeline = at(&mut animation, &series, 1.into());
    for (key, name) in [('2', "b"), ('3', "c"), ('1', "a")] {
        press(&mut desk, key);
        let table = table_of(&series, &project, name);
        assert!(
            desk.shown().request.tets().unwrap().table == table
                && Some(&table) != on_timeline.colors.as_ref().map(|colors| &colors.table),
            "{name}"
        );
        assert_eq!(Some(desk.shown().request.camera), on_timeline.camera, "the camera stays on its path");
    }
    press(&mut desk, '9');
    assert_eq!(desk.session.look().followed.ensembles, EnsembleChoice::One(0), "there is no ninth");
    go_to(&mut desk, 2);
    assert_eq!(desk.shown().request.tets().unwrap().table, table_of(&series, &project, "a"), "at all times");
    press(&mut desk, '0');
    assert_eq!(said(&desk.shown().request), at(&mut animation, &series, 2.into()));
}

#[test]
fn range_maps_of_the_timeline_go_with_an_ensemble_that_was_chosen() {
    let series = series();
    let times = &series.times().values;
    let key = |time: f64, map: &str| format!("[[timeline.maps.keys]]\ntime = {time:?}\nvalue = {map}\n");
    let track = "[[timeline.maps]]\nensemble = \"b\"\nmember = \"one\"\n".to_owned()
        + &key(times[0], "{ points = [] }")
        + &key(times[3], "{ points = [[0.5, 0.1]] }");
    let mut desk = open(&series, &project(&(ensembles() + &track)));
    press(&mut desk, '2');
    let first = desk.shown().request.tets().unwrap().table.over_scalars().clone();
    go_to(&mut desk, 2);
    assert_ne!(*desk.shown().request.tets().unwrap().table.over_scalars(), first);
}

#[test]
fn colours_are_edited_in_the_ensemble_that_is_shown_and_come_back() {
    let series = series();
    let project = keyed(&series);
    let gray = ColorMap::built_in("gray").unwrap().clone();
    let points = vec![OpacityPoint { position: 0.0, value: 0.3 }, OpacityPoint { position: 1.0, value: 0.4 }];
    for edit in [Action::Colors(gray), Action::Opacities(points), Action::Range(RangePolicy::Manual(0.0, 3.0))] {
        let mut desk = open(&series, &project);
        let before = at(&mut animation(&series, &project), &series, 0.into());
        desk.act(edit.clone());
        desk.settle();
        let edited = desk.session.project().clone();
        assert!(edited.ensembles[0] != project.ensembles[0] && edited.ensembles[1..] == project.ensembles[1..]);
        let now = at(&mut animation(&series, &edited), &series, 0.into());
        assert!(now.colors != before.colors && now.camera == before.camera, "the rest is followed");
        assert_eq!(said(&desk.shown().request), now, "{edit:?}");
        assert!(desk.session.is_changed());
        desk.act(Action::Undo);
        desk.settle();
        assert_eq!((said(&desk.shown().request), desk.session.project()), (before, &project), "{edit:?}");
        desk.act(Action::Redo);
        desk.settle();
        assert_eq!((said(&desk.shown().request), desk.session.project()), (now, &edited), "{edit:?}");
    }
}

#[test]
fn the_ensemble_that_weighs_more_is_edited() {
    let series = series();
    let mut desk = open(&series, &keyed(&series));
    let edited: Vec<usize> = (0..4)
        .map(|step| {
            go_to(&mut desk, step);
            desk.session.edited_ensemble()
        })
        .collect();
    assert_eq!(edited, [0, 0, 1, 1]);
    press(&mut desk, '3');
    assert_eq!(desk.session.edited_ensemble(), 2);
    desk.act(Action::Range(RangePolicy::Manual(0.0, 3.0)));
    assert_eq!(desk.session.project().ensembles[2].members[0].range, RangePolicy::Manual(0.0, 3.0));
}

#[test]
fn another_field_is_a_change_of_the_file() {
    let series = series();
    let mut desk = open(&series, &project(&ensembles()));
    let file = tempfile::tempdir().unwrap();
    let path = file.path().join("a.b");
    desk.act(Action::SaveProject { to: Some(path.clone()), may_replace: false });
    assert!(desk.session.is_saving());
    wait_for("the file", || {
        desk.session.tick(desk.now);
        desk.session.project_file().map(Path::to_owned)
    });
    assert!(!desk.session.is_changed() && !desk.session.is_saving());
    assert_eq!(desk.session.project_file(), Some(&*file.path().join("a.b.toml")), "the name of a project");
    let other = store().fields().iter().find(|field| field.name != series.field().name).expect("a second field");
    desk.act(Action::Field(other.name.parse().unwrap()));
    wait_for("the field", || {
        desk.settle();
        (!desk.session.opens_field()).then_some(())
    });
    assert!(desk.session.is_changed());
    assert_eq!(desk.session.to_project(&path).data.field, other.name.parse().ok());
}

#[test]
fn a_gesture_is_undone_at_once() {
    let series = series();
    let mut desk = open(&series, &project(&ensembles()));
    let before = (desk.session.project().clone(), desk.session.changes());
    let range = |to: f64| Action::Range(RangePolicy::Manual(0.0, to));
    for _ in 0..2 {
        desk.session.hold(true);
        for to in [1.0, 2.0, 3.0] {
            desk.session.hold(true);
            desk.act(range(to));
        }
        desk.session.hold(false);
        desk.act(range(4.0));
    }
    assert_eq!(desk.session.changes(), (before.1.0 + 4, 0));
    (0..4).for_each(|_| desk.act(Action::Undo));
    assert_eq!((desk.session.project(), desk.session.changes()), (&before.0, (before.1.0, 4)));
    desk.act(range(9.0));
    assert_eq!(desk.session.changes(), (before.1.0 + 1, 0), "a change ends what could be done again");
}

#[test]
fn a_camera_that_is_turned_leaves_its_path_until_a_key_returns_to_it() {
    let series = series();
    let project = keyed(&series);
    let (mut desk, mut animation) = (open(&series, &project), animation(&series, &project));
    go_to(&mut desk, 1);
    let path = |animation: &mut Animation, step: usize| at(animation, &series, step.into()).camera.unwrap();
    let on_path = path(&mut animation, 1);
    assert_eq!(desk.session.camera(), on_path);
    desk.act(Action::Orbit(DVec2::new(0.25, 0.0)));
    assert!(!desk.session.follows_path());
    let turned = on_path.orbit(-45.0, 0.0).unwrap();
    assert_eq!(desk.session.camera(), turned, "from where it was");
    desk.later(1000);
    go_to(&mut desk, 3);
    assert_eq!((desk.shown().request.camera, desk.shown().request.lod()), (turned, 0.75), "the rest goes on");
    press(&mut desk, 'C');
    assert_eq!(desk.shown().request.camera, path(&mut animation, 3));
    for action in [Action::ResetView, Action::OtherProjection, Action::CameraPath(false)] {
        go_to(&mut desk, 3);
        press(&mut desk, 'C');
        desk.act(action.clone());
        desk.later(1000);
        go_to(&mut desk, 0);
        assert_ne!(desk.shown().request.camera, path(&mut animation, 0), "{action:?}");
        desk.act(Action::TurnCamera(CameraTurn::Back));
        assert!(desk.session.follows_path(), "{action:?} is taken back: the path goes on");
    }
}

#[test]
fn the_users_own_level_of_detail_and_optics_hold_until_the_timeline_is_back() {
    let series = series();
    let project = keyed(&series);
    let mut desk = open(&series, &project);
    desk.act(Action::LevelOfDetail(0.5));
    desk.act(Action::Optics(OpticsKind::Table3d));
    desk.settle();
    let request = desk.shown().request.clone();
    assert_eq!((request.lod(), request.tets().unwrap().optics), (0.5, OpticsKind::Table3d));
    press(&mut desk, '0');
    let request = desk.shown().request.clone();
    assert_eq!((request.lod(), request.tets().unwrap().optics), (0.25, OpticsKind::Exact));
}

#[test]
fn a_project_without_ensembles_has_the_colours_of_the_look() {
    let series = series();
    let project = project(&camera(series.times().values[0], -10.0));
    let mut desk = open(&series, &project);
    let table = desk.session.look().table(&desk.session.shown_range().unwrap()).unwrap();
    assert_eq!(**desk.shown().request.tets().unwrap().table.over_scalars(), table);
    assert_eq!(desk.shown().request.camera.position.x, -10.0);
    press(&mut desk, '1');
    press(&mut desk, '0');
    assert_eq!(**desk.shown().request.tets().unwrap().table.over_scalars(), table);
}

#[test]
fn without_a_project_its_keys_do_nothing() {
    let (series, _) = logged(3);
    let mut desk = Desk::of(series, Path::new("."));
    desk.settle();
    let look = desk.session.look().clone();
    for key in ['0', '1', 'C'] {
        desk.act(keys::action(&key.to_string(), [false; 2]).unwrap());
        assert_eq!(desk.settle(), 0, "{key}");
    }
    assert_eq!(*desk.session.look(), look);
}

/// A project with members on more than the scalar.
fn on_gradients() -> Arc<Project> {
    let widget = "rectangle = { x = [0.1, 1.0], y = [0.1, 1.0], rgb = [1.0, 0.5, 0.2], opacity = [0.1, 0.6] }";
    project(&format!(
        "[[ensembles]]\nname = \"fronts\"\n[[ensembles.members]]\nname = \"one\"\nspace = \"scalar-gradient\"\n\
         [[ensembles.members.function.widgets]]\n{widget}\n"
    ))
}

#[test]
fn histograms_that_a_store_does_not_have_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let source = generate(&SynthSpec { cells: 600, steps: 4, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
    let series = |name: &str| {
        let path = folder.path().join(name);
        ingest(&source, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        Arc::new(Series::open(&Store::open(path).unwrap(), None).unwrap())
    };
    let (with, without) = (series("with.zarr"), series("without.zarr"));
    with.histograms(&Cancel::new()).unwrap();
    let desk = open(&without, &on_gradients());
    assert!(desk.session.notices().is_empty(), "{:?}", desk.session.notices());
    let table = table_of(&with, &on_gradients(), "fronts");
    assert!(
        desk.shown().request.tets().unwrap().table == table
            && table.over_scalars().nodes().iter().any(|node| node.tau > 0.0)
    );
}

#[test]
fn nothing_waits_for_what_takes_long_to_work_out() {
    let (series, log) = logged(3);
    log.hang(true);
    let mut desk = Desk::with(series.clone(), Path::new("."), Some(on_gradients()));
    for _ in 0..20 {
        desk.later(100);
        assert_eq!(desk.session.tick(desk.now), (false, None));
    }
    assert!(desk.session.is_working_out() && desk.session.is_waiting());
    assert_eq!(desk.session.player.pipelined().wanted(), 0, "a frame is not asked for before its table is there");
    // A member that is not used needs no histograms.
    let off = |enabled: bool, session: &Session| {
        let member = Box::new(Member { enabled, ..session.member().unwrap().clone() });
        Action::Edit(Box::new(Edit::SetMember { ensemble: 0, index: 0, member }))
    };
    desk.act(off(false, &desk.session));
    log.hang(false);
    desk.settle();
    assert!(desk.session.notices().is_empty() && !desk.session.is_working_out());
    desk.act(off(true, &desk.session));
    desk.settle();
    assert!(desk.session.notices()[0].text.contains("histogram"), "{:?}", desk.session.notices());
    desk.act(Action::Undo);
    desk.settle();
    log.hang(true);
    desk.act(Action::Redo);
    desk.session.tick(desk.now);
    assert!(desk.session.is_working_out());
    drop(desk);
    wait_for("end of all threads", || (Arc::strong_count(&series) == 1).then_some(()));
}

#[test]
fn an_ensemble_that_cannot_be_had_is_said_and_shows_nothing() {
    // A series without histograms, and one without values.
    for (series, project, problem) in
        [(logged(3).0, on_gradients(), "histogram"), (without_values(3), project(&ensembles()), "values missing")]
    {
        let mut desk = open(&series, &project);
        let notices = desk.session.notices().to_vec();
        assert!(notices[0].text.contains(problem), "{notices:?}");
        assert!(desk.shown().frame.planes.color.pixels.iter().all(|p| p[3] == 0.0));
        go_to(&mut desk, 1);
        assert_eq!(desk.shown().request.time, FrameTime::from(1), "it goes on");
        press(&mut desk, '1');
        let picture = wait_for("small picture", || desk.session.thumbnail(Some(2)));
        let nothing = over_background(&vec![[0.0; 4]; picture.size[0] * picture.size[1]], [0.0; 3]);
        assert_eq!(picture.pixels, nothing);
    }
}

#[test]
fn small_pictures_of_other_moments_have_the_table_and_the_camera_of_theirs() {
    let series = series();
    let project = keyed(&series);
    let mut desk = open(&series, &project);
    let mut animation = animation(&series, &project);
    let mut seen = Vec::new();
    for step in [3, 1, 2, 3] {
        let picture = wait_for("small picture", || desk.session.thumbnail(Some(step)));
        let Keyed { colors, camera, optics, .. } = at(&mut animation, &series, step.into());
        let size = (picture.size[0], picture.size[1]);
        let request = FrameRequest::new(step, camera.unwrap(), colors.unwrap().table, size);
        let request = request.with_tets(|tets| (tets.draw, tets.optics) = (TetDraw::Raycast, optics.unwrap()));
        let request = FrameRequest { backend: Backend::Cpu, ..request };
        let frame = Pipeline::new(series.clone()).render(&request).unwrap().planes.color.clone();
        assert_eq!(picture.pixels, over_background(&frame.pixels, [0.0; 3]), "step {step}");
        seen.push(picture);
    }
    assert!(seen[0] != seen[1] && seen[1] != seen[2] && seen[0].pixels == seen[3].pixels, "the test can fail");
    assert_eq!(desk.shown().request.time, FrameTime::from(0), "the picture itself is where it was");
}

#[test]
fn the_legend_has_the_colours_of_the_ensemble() {
    let series = series();
    let mut desk = open(&series, &project(&ensembles()));
    press(&mut desk, '2');
    let legend =
        |desk: &Desk| desk.session.legend().map(|(range, color)| (range.lo(), range.hi(), color(0.5))).unwrap();
    let (lo, hi, [r, g, b]) = legend(&desk);
    assert_eq!([lo, hi], series.field().range.unwrap().map(f64::from));
    assert!(r == g && g == b, "gray");
    desk.act(Action::Colors(ColorMap::built_in("viridis").unwrap().clone()));
    desk.settle();
    assert_eq!(legend(&desk).2, ColorMap::built_in("viridis").unwrap().eval(0.5));
}

#[test]
fn a_picture_of_a_project_can_be_saved() {
    let dir = tempfile::tempdir().unwrap();
    let series = series();
    let mut desk = Desk::with(series.clone(), dir.path(), Some(keyed(&series)));
    desk.settle();
    go_to(&mut desk, 2);
    desk.act(Action::Screenshot);
    let text = wait_for("message", || {
        desk.session.tick(desk.now);
        desk.session.notices().first().map(|notice| (notice.kind, notice.text.clone()))
    });
    assert!(text.0 == NoticeKind::Done && text.1.contains("step0002"), "{text:?}");
}

#[test]
fn another_field_has_the_ensembles_over_its_own_values() {
    let series = series();
    let project = keyed(&series);
    let mut desk = open(&series, &project);
    let names: Vec<String> = store().fields().iter().map(|f| f.name.clone()).collect();
    let other = names.iter().find(|name| **name != series.field().name).expect("a second field");
    desk.act(Action::Field(other.parse().unwrap()));
    wait_for("the field", || {
        desk.settle();
        (!desk.session.opens_field()).then_some(())
    });
    desk.settle();
    let other = desk.session.series().clone();
    assert_eq!(said(&desk.shown().request), at(&mut animation(&other, &project), &other, 0.into()));
    assert_ne!(other.field().name, series.field().name);
}

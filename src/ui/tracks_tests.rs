//! Keys of all tracks: the model, and what a session does with them.

use super::*;
use crate::look::{EnsembleChoice, FlowLook};
use crate::pipeline::{FrameTime, RenderMode, Series, Shown};
use crate::playback::Command;
use crate::project::{Data, FlowSettings, Timeline};
use crate::render::flow::FlowStyle;
use crate::render::surfaces::{Cut, Isosurface};
use crate::transfer::{ColorMap, Ensemble, Function, Member, TransferFunction};
use crate::ui::Action;
use crate::ui::desk::{Desk, store};
use glam::{DVec2, DVec3};
use proptest::prelude::*;
use std::path::Path;
use std::sync::Arc;

const ALL: [Track; 10] = [
    Track::Ensembles,
    Track::Map { ensemble: 0, member: 0 },
    Track::Map { ensemble: 1, member: 0 },
    Track::Cameras,
    Track::Lod,
    Track::Optics,
    Track::Isovalue,
    Track::IsoOpacity,
    Track::Cut,
    Track::Flow,
];

/// Two ensembles, a surface, a cut and flow, without keys.
fn project() -> Project {
    let member = |map: &str| {
        let function = TransferFunction::ramp(ColorMap::built_in(map).unwrap().clone());
        Member::new("one", Function::TransferFunction(function))
    };
    let ensemble =
        |name: &str, map: &str| Ensemble { name: name.into(), members: vec![member(map)], ..Default::default() };
    let mut project = Project::new(Data { source: "x.zarr".into(), field: None });
    project.ensembles = vec![ensemble("a", "gray"), ensemble("b", "viridis")];
    project.look.iso = vec!["-20".into()];
    project.look.cut = vec!["point=0,0,1 normal=0,0,1".into()];
    project.flow = Some(FlowSettings::of(&flow()));
    project.check().unwrap();
    project
}

fn flow() -> FlowLook {
    FlowLook::new("velocity".to_owned(), FlowStyle::default())
}

fn camera(x: f64) -> Camera {
    Camera { position: DVec3::new(x, -8.0, 3.0), ..Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap() }
}

fn map(y: f64) -> RangeMap {
    RangeMap::new(&[[0.5, y]]).unwrap()
}

/// A value of a track.
fn value(track: Track, share: f64) -> KeyValue {
    match track {
        Track::Ensembles => KeyValue::Ensemble(if share < 0.5 { "a" } else { "b" }.to_owned()),
        Track::Map { .. } => KeyValue::Map(map(0.1 + 0.8 * share)),
        Track::Cameras => KeyValue::Camera(camera(share)),
        Track::Optics => KeyValue::Optics(if share < 0.5 { OpticsKind::Exact } else { OpticsKind::Partial }),
        _ => KeyValue::Number(share),
    }
}

fn key(track: Track, time: f64, share: f64) -> TrackKey {
    Key { time, transition: Transition::Linear, value: value(track, share) }
}

/// Changes of keys, some of them invalid.
fn edits() -> impl Strategy<Value = (Track, TrackEdit<KeyValue>)> {
    let track = prop::sample::select(ALL.to_vec());
    let time = prop_oneof![Just(0.0), Just(1.0), -5.0..5.0_f64, Just(f64::NAN)];
    let transition = prop_oneof![
        Just(Transition::Smooth),
        (-0.1..1.1_f64).prop_map(|at| Transition::Step { at }),
        [[0.0..1.1_f64, 0.0..1.0], [0.0..1.0, 0.0..1.0]].prop_map(|handles| Transition::Cubic { handles }),
    ];
    (track.clone(), track, time, 0.0..1.0_f64, 0..4_usize, transition, 0..5).prop_map(
        |(track, of, time, share, index, transition, kind)| {
            let edit = match kind {
                0 => TrackEdit::Insert(key(track, time, share)),
                1 => TrackEdit::Insert(key(of, time, share)),
                2 => TrackEdit::Remove { index },
                3 => TrackEdit::Move { index, time },
                _ => TrackEdit::SetTransition { index, transition },
            };
            (track, edit)
        },
    )
}

proptest! {
    #[test]
    fn whatever_is_done_to_keys_the_project_stays_consistent_and_comes_back_from_its_text(
        edits in prop::collection::vec(edits(), 1..40),
    ) {
        let mut project = project();
        for (track, edit) in edits {
            let before = project.clone();
            let is_done = track.edit(&project, edit).is_some_and(|edit| edit.apply(&mut project).is_ok());
            prop_assert!(is_done || project == before, "what fails changes nothing");
            prop_assert!(project.check().is_ok());
            let times: Vec<f64> = track.keys(&project).iter().map(|key| key.time).collect();
            prop_assert!(times.is_sorted());
        }
        let read = Project::parse(&project.to_toml().unwrap(), Path::new("p.toml")).unwrap();
        prop_assert_eq!(read, project);
    }

    #[test]
    fn a_place_and_its_time_are_each_others_inverse(steps in prop::collection::btree_set(-1000..1000_i32, 1..9), share in 0.0..1.0_f64) {
        let times: Vec<f64> = steps.into_iter().map(f64::from).collect();
        let place = share * (times.len() - 1) as f64;
        let again = place_of(&times, time_at(&times, place).unwrap());
        prop_assert!((again - place).abs() < 1e-9, "{} {}", again, place);
    }
}

#[test]
fn each_track_has_a_name_its_keys_and_their_values() {
    let mut project = project();
    for track in ALL {
        for (time, share) in [(0.0, 0.0), (2.0, 1.0)] {
            let edit = track.insert(&project, key(track, time, share)).unwrap();
            edit.apply(&mut project).unwrap();
        }
        assert_eq!(track.keys(&project), [key(track, 0.0, 0.0), key(track, 2.0, 1.0)]);
        assert_eq!(track.value_at(&project, -1.0), Some(value(track, 0.0)));
        let middle = track.value_at(&project, 0.5);
        match track {
            Track::Ensembles | Track::Optics => assert_eq!(middle, Some(value(track, 0.0))),
            Track::Cameras | Track::Map { .. } => assert!(middle.is_some() && middle != Some(value(track, 0.0))),
            _ => assert_eq!(middle, Some(KeyValue::Number(0.25))),
        }
    }
    let mut shown = Track::with_keys(&project);
    shown.sort_by_key(|track| ALL.iter().position(|other| other == track));
    assert_eq!(shown, ALL);
    let names: std::collections::BTreeSet<String> = ALL.iter().map(|track| track.name(&project)).collect();
    assert!(names.len() == ALL.len() && names.contains("range map of one, b"), "{names:?}");
    // A track of range maps goes with its last key.
    for track in ALL {
        for _ in 0..2 {
            track.edit(&project, TrackEdit::Remove { index: 0 }).unwrap().apply(&mut project).unwrap();
        }
        assert!(track.keys(&project).is_empty() && track.value_at(&project, 0.0).is_none());
    }
    assert_eq!(project.timeline, Timeline::default());
    assert!(Track::with_keys(&project).is_empty());
    assert!(Track::Lod.insert(&project, key(Track::Cameras, 0.0, 0.0)).is_none(), "of another kind");
    let gone = Track::Map { ensemble: 0, member: 7 };
    assert!(gone.insert(&project, key(gone, 0.0, 0.5)).is_none());
}

#[test]
fn a_replaced_key_keeps_its_transition() {
    let mut project = project();
    let smooth = Key { transition: Transition::Smooth, ..key(Track::Lod, 1.0, 0.2) };
    Track::Lod.insert(&project, smooth).unwrap().apply(&mut project).unwrap();
    Track::Lod.insert(&project, key(Track::Lod, 1.0, 0.8)).unwrap().apply(&mut project).unwrap();
    assert_eq!(Track::Lod.keys(&project), [Key { transition: Transition::Smooth, ..key(Track::Lod, 1.0, 0.8) }]);
}

#[test]
fn a_moved_key_stays_between_its_neighbours_and_snaps_to_steps() {
    let mut project = project();
    let times = [0.0, 1.0, 2.5, 3.0, 10.0];
    for time in [1.0, 2.6, 3.0] {
        Track::Lod.insert(&project, key(Track::Lod, time, 0.5)).unwrap().apply(&mut project).unwrap();
    }
    let to = |index, time, snaps| Track::Lod.free_time(&project, index, &times, time, snaps);
    assert_eq!((to(1, 2.0, false), to(1, 2.0, true), to(1, 2.7, true)), (Some(2.0), Some(2.5), Some(2.5)));
    assert!(to(1, 7.0, false).is_some_and(|time| time > 2.99 && time < 3.0));
    assert!(to(1, -7.0, false).is_some_and(|time| time > 1.0 && time < 1.01));
    assert_eq!(to(1, 7.0, true), Some(2.5), "the next step has a key");
    assert_eq!((to(0, -7.0, true), to(2, 99.0, true), to(2, 99.0, false)), (Some(0.0), Some(10.0), Some(99.0)));
    assert_eq!((to(0, 1.7, true), to(0, f64::NAN, false)), (Some(1.0), None));
    // Between 2.6 and 3 is no step.
    Track::Lod.insert(&project, key(Track::Lod, 2.8, 0.5)).unwrap().apply(&mut project).unwrap();
    assert_eq!(Track::Lod.free_time(&project, 2, &times, 2.9, true), None);
    assert_eq!(Track::Lod.free_time(&project, 9, &[], 2.9, true), None);
}

#[test]
fn places_are_those_of_the_steps() {
    let times = [0.0, 1.0, 3.0];
    let places = [-1.0, 0.0, 0.25, 1.0, 2.0, 3.0, 9.0].map(|time| place_of(&times, time));
    assert_eq!(places, [0.0, 0.0, 0.25, 1.0, 1.5, 2.0, 2.0]);
    assert_eq!(place_of(&[-f64::MAX, f64::MAX], 0.0), 0.5);
    assert_eq!(
        (time_at(&times, 1.5), time_at(&times, 9.0), time_at(&times, f64::NAN)),
        (Some(2.0), Some(3.0), Some(0.0))
    );
    assert_eq!((time_at(&[], 0.0), place_of(&[], 1.0)), (None, 0.0));
}

fn desk() -> Desk {
    let series = Arc::new(Series::open(store(), None).unwrap());
    let mut desk = Desk::with(series, Path::new("."), Some(Arc::new(project())));
    // As the command line makes a look of such a project.
    let mut surfaces = desk.session.look().surfaces.clone();
    surfaces.isosurfaces = vec![Isosurface::new(-20.0)];
    surfaces.shown = Shown::Both;
    surfaces.cuts = vec![Cut { point: [0.0, 0.0, 1.0], normal: [0.0, 0.0, 1.0], clips: false, by: None }];
    desk.act(Action::Surfaces(Box::new(surfaces)));
    desk.act(Action::Flow(Some(Box::new(flow()))));
    desk.settle();
    desk
}

fn keys(desk: &mut Desk, action: KeyAction) {
    desk.act(Action::Keys(action));
}

fn go_to(desk: &mut Desk, step: usize) {
    desk.act(Action::Play(Command::SeekStep(step)));
    desk.settle();
}

fn time_of(desk: &Desk, step: usize) -> f64 {
    FrameTime::from(step).time(desk.session.series().times())
}

#[test]
fn a_key_of_each_track_has_what_is_shown_at_that_moment_and_one_undo_takes_it_back() {
    let mut desk = desk();
    go_to(&mut desk, 2);
    for track in ALL {
        let (before, changes) = (desk.session.project().clone(), desk.session.changes().0);
        let shown = desk.session.value_shown(track).unwrap();
        let picture = desk.shown().request.clone();
        keys(&mut desk, KeyAction::Add(track));
        let (of, index, key) = desk.session.selected_key().unwrap();
        assert_eq!((of, index, key.time, key.value), (track, 0, time_of(&desk, 2), shown));
        desk.settle();
        let [now, before_it] = [&desk.shown().request, &picture].map(|request| {
            let tets = request.tets().unwrap();
            (request.camera, &tets.table, &tets.surfaces, &tets.cuts, tets.optics, tets.draw)
        });
        assert!(now == before_it, "{track:?}: the picture stays");
        desk.act(Action::Undo);
        assert_eq!((desk.session.project(), desk.session.changes().0), (&before, changes));
        assert_eq!(desk.session.selected_key(), None);
        desk.act(Action::Redo);
    }
    assert_eq!(Track::with_keys(desk.session.project()).len(), ALL.len());
    assert!(desk.session.notices().is_empty(), "{:?}", desk.session.notices());
}

#[test]
fn a_camera_off_its_path_becomes_a_key_and_returns_to_the_path() {
    let mut desk = desk();
    keys(&mut desk, KeyAction::Add(Track::Cameras));
    let first = desk.session.camera();
    go_to(&mut desk, 3);
    desk.act(Action::Orbit(DVec2::new(0.1, 0.0)));
    desk.later(1000);
    desk.settle();
    let turned = desk.session.camera();
    assert!(turned != first && !desk.session.follows_path());
    keys(&mut desk, KeyAction::Add(Track::Cameras));
    desk.settle();
    assert!(desk.session.follows_path() && desk.session.camera() == turned);
    go_to(&mut desk, 0);
    assert_eq!(desk.session.camera(), first);
    // Off the path again: selecting returns, taking the view shown does, too.
    desk.act(Action::Orbit(DVec2::new(0.0, 0.1)));
    keys(&mut desk, KeyAction::Select(Track::Cameras, 1));
    desk.settle();
    assert_eq!(
        (desk.session.follows_path(), desk.session.camera(), desk.session.moment()),
        (true, turned, Some(time_of(&desk, 3)))
    );
    desk.act(Action::Orbit(DVec2::new(0.0, 0.1)));
    let view = desk.session.camera();
    keys(&mut desk, KeyAction::TakeShown);
    desk.settle();
    assert!(desk.session.follows_path() && desk.session.camera() == view);
    assert_eq!(desk.session.selected_key().unwrap().2.value, KeyValue::Camera(view));
}

#[test]
fn a_view_with_a_name_is_returned_to_and_leaves_the_path() {
    let mut desk = desk();
    let first = desk.session.camera();
    let camera = crate::project::NamedCamera { name: "front".to_owned(), camera: first };
    desk.act(Action::Edit(Box::new(Edit::InsertCamera { index: 0, camera })));
    desk.act(Action::Orbit(DVec2::new(0.1, 0.0)));
    keys(&mut desk, KeyAction::Add(Track::Cameras));
    desk.later(1000);
    desk.settle();
    assert!(desk.session.follows_path() && desk.session.camera() != first);
    desk.act(Action::GoToCamera(0));
    desk.act(Action::GoToCamera(7));
    desk.settle();
    assert!(!desk.session.follows_path() && desk.session.camera() == first);
    assert_eq!(desk.session.to_project(Path::new("/p.toml")).cameras.len(), 1);
}

#[test]
fn a_cut_that_was_moved_off_the_timeline_becomes_a_key_and_the_other_keys_stay() {
    let mut desk = desk();
    keys(&mut desk, KeyAction::Add(Track::Cut));
    keys(&mut desk, KeyAction::SetValue(KeyValue::Number(-0.5)));
    desk.settle();
    let first = desk.session.shown_surfaces().cuts[0].point;
    assert_eq!(first, [0.0, 0.0, 0.5]);
    go_to(&mut desk, 2);
    let mut surfaces = desk.session.shown_surfaces();
    surfaces.cuts[0] = surfaces.cuts[0].moved(1.25);
    desk.act(Action::Surfaces(Box::new(surfaces)));
    keys(&mut desk, KeyAction::Add(Track::Cut));
    desk.settle();
    assert_eq!(desk.session.shown_surfaces().cuts[0].point, [0.0, 0.0, 1.75]);
    go_to(&mut desk, 0);
    assert_eq!(desk.session.shown_surfaces().cuts[0].point, first);
    assert_eq!(desk.session.project().look.cut, project().look.cut);
    // What is saved, and the key 0, go by the keys, too.
    let mut surfaces = desk.session.shown_surfaces();
    surfaces.cuts[0] = surfaces.cuts[0].moved(7.0);
    desk.act(Action::Surfaces(Box::new(surfaces)));
    assert_eq!(desk.session.to_project(Path::new("/p.toml")).look.cut, project().look.cut);
    desk.act(Action::Ensembles(EnsembleChoice::Project));
    desk.settle();
    assert_eq!(desk.session.shown_surfaces().cuts[0].point, first);
}

#[test]
fn keys_without_their_subject_are_refused_with_a_reason() {
    let series = Arc::new(Series::open(store(), None).unwrap());
    let mut desk = Desk::of(series, Path::new("."));
    for (track, reason) in [(Track::Isovalue, "isosurface"), (Track::Cut, "cut"), (Track::Flow, "show flow first (F)")]
    {
        keys(&mut desk, KeyAction::Add(track));
        assert!(desk.session.notices().last().unwrap().text.contains(reason));
    }
    desk.act(Action::Renderer(RenderMode::Raycast));
    desk.act(Action::LevelOfDetail(0.5));
    keys(&mut desk, KeyAction::Add(Track::Lod));
    let text = &desk.session.notices().last().unwrap().text;
    assert!(text.contains("'raycast' always draws all cells; choose"), "{text}");
    assert_eq!(desk.session.project().timeline, Timeline::default());
    // A surface of the user's goes into the project with its key, also if it is hidden.
    for _ in 0..3 {
        desk.act(Action::NextShown);
    }
    assert_eq!(desk.session.look().surfaces.shown, Shown::Volume);
    keys(&mut desk, KeyAction::Add(Track::Isovalue));
    assert_eq!(
        (desk.session.project().look.iso.len(), Track::with_keys(desk.session.project())),
        (1, vec![Track::Isovalue])
    );
}

#[test]
fn a_key_is_copied_to_another_moment_and_changes_of_a_drag_are_undone_together() {
    let mut desk = desk();
    desk.act(Action::LevelOfDetail(0.25));
    keys(&mut desk, KeyAction::Add(Track::Lod));
    keys(&mut desk, KeyAction::SetTransition(Transition::Smooth));
    keys(&mut desk, KeyAction::Copy);
    go_to(&mut desk, 3);
    keys(&mut desk, KeyAction::Paste);
    let (_, index, key) = desk.session.selected_key().unwrap();
    assert_eq!(
        (index, key.time, key.transition, key.value),
        (1, time_of(&desk, 3), Transition::Smooth, KeyValue::Number(0.25))
    );
    let before = desk.session.project().clone();
    let changes = desk.session.changes().0;
    desk.session.hold(true);
    for step in [2, 1, 0] {
        let time = time_of(&desk, step);
        keys(&mut desk, KeyAction::Move { time, snaps: true });
    }
    desk.session.hold(false);
    assert_eq!(desk.session.selected_key().unwrap().2.time, time_of(&desk, 1), "not onto the first key");
    assert_eq!(desk.session.changes().0, changes + 1);
    desk.act(Action::Undo);
    assert_eq!(desk.session.project(), &before);
    keys(&mut desk, KeyAction::Remove);
    assert_eq!((Track::Lod.keys(desk.session.project()).len(), desk.session.selected_key()), (1, None));
    keys(&mut desk, KeyAction::Remove);
    assert_eq!(Track::Lod.keys(desk.session.project()).len(), 1, "none is selected");
}

#[test]
fn whatever_the_user_does_to_keys_is_undone_step_by_step_and_done_again() {
    let mut desk = desk();
    let first = desk.session.project().clone();
    // A fixed sequence that mixes all of them.
    let mut state = 1_u64;
    let mut next = |most: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % most
    };
    for _ in 0..400 {
        let (track, share) = (ALL[next(ALL.len())], next(100) as f64 / 99.0);
        let time = time_of(&desk, next(4)) + share;
        let action = match next(9) {
            0 | 1 => KeyAction::Add(track),
            2 => KeyAction::Select(track, next(3)),
            3 => KeyAction::Move { time, snaps: next(2) == 0 },
            4 => KeyAction::SetValue(value(track, share)),
            5 => KeyAction::SetTransition(Transition::Step { at: share }),
            6 => [KeyAction::Copy, KeyAction::TakeShown][next(2)].clone(),
            7 => KeyAction::Paste,
            _ => KeyAction::Remove,
        };
        keys(&mut desk, action);
        if next(4) == 0 {
            desk.act(Action::Play(Command::SeekStep(next(4))));
        }
        if next(8) == 0 {
            desk.act(Action::Ensembles(EnsembleChoice::One(next(2))));
        }
        assert!(desk.session.project().check().is_ok());
    }
    let last = desk.session.project().clone();
    assert_ne!(last, first);
    let saved = desk.session.to_project(Path::new("/nowhere/p.toml"));
    assert_eq!(Project::parse(&saved.to_toml().unwrap(), Path::new("p.toml")).unwrap(), saved);
    assert_eq!(saved.timeline, last.timeline);
    let count = desk.session.changes().0;
    (0..count - 2).for_each(|_| desk.act(Action::Undo));
    assert_eq!(desk.session.project(), &first, "the first changes were those of surfaces and flow");
    (0..count - 2).for_each(|_| desk.act(Action::Redo));
    assert_eq!(desk.session.project(), &last);
}

//! Sessions in which transfer functions are edited.

use super::desk::{Desk, store};
use super::worker::tests::wait_for;
use super::*;
use crate::look::EnsembleChoice;
use crate::pipeline::Series;
use crate::project::{Edit, Project};
use crate::transfer::{ColorMap, Function, OpacityKind, OpacityPoint, RangeMap, RangePolicy, Space};
use proptest::prelude::*;
use std::path::Path;
use std::sync::Arc;

fn open(folder: &Path) -> Desk {
    let mut desk = Desk::of(Arc::new(Series::open(store(), None).unwrap()), folder);
    desk.settle();
    desk
}

fn said(desk: &mut Desk) -> String {
    let text = wait_for("message", || {
        desk.session.tick(desk.now);
        desk.session.notices().first().map(|notice| notice.text.clone())
    });
    desk.act(Action::Dismiss(0));
    text
}

#[test]
fn transfer_functions_are_saved_and_loaded_and_that_is_undone() {
    let dir = tempfile::tempdir().unwrap();
    let mut desk = open(dir.path());
    let first = desk.session.function().unwrap().clone();
    let other = ColorMap::built_in("inferno").unwrap().clone();
    for format in [FunctionFile::Tetreel, FunctionFile::ParaView] {
        while desk.session.changes().0 > 0 {
            desk.act(Action::Undo);
        }
        let to = dir.path().join(format!("{format:?}.json"));
        let save = |may_replace| Action::SaveFunction { to: to.clone(), format, may_replace };
        desk.act(save(false));
        assert_eq!(said(&mut desk), format!("saved {}", to.display()));
        desk.act(save(false));
        assert!(said(&mut desk).contains("there is a file of that name"));
        desk.act(save(true));
        assert!(said(&mut desk).starts_with("saved"));
        for colors_only in [false, true] {
            desk.act(Action::Colors(other.clone()));
            let changed = OpacityPoint { position: 0.5, value: 0.5 };
            desk.act(Action::Opacities(vec![changed]));
            let before = desk.session.changes();
            desk.act(Action::LoadFunction { from: to.clone(), colors_only });
            wait_for("function", || {
                desk.session.tick(desk.now);
                (desk.session.function().unwrap().color_map() != &other).then_some(())
            });
            let loaded = desk.session.function().unwrap().clone();
            assert_eq!(loaded.color_map().points(), first.color_map().points());
            assert_eq!(loaded.points() == first.points(), !colors_only);
            assert_eq!(desk.session.changes().0, before.0 + 1);
            desk.act(Action::Undo);
            assert_eq!(desk.session.function().unwrap().color_map(), &other);
        }
    }
    desk.act(Action::LoadFunction { from: dir.path().join("no.json"), colors_only: false });
    assert!(said(&mut desk).contains("no.json"));
    let broken = dir.path().join("broken.json");
    std::fs::write(&broken, "{\"color_map\": 7").unwrap();
    desk.act(Action::LoadFunction { from: broken, colors_only: false });
    let text = said(&mut desk);
    assert!(text.contains("broken.json") && text.contains("line 1"), "{text}");
    assert_eq!(desk.session.function().unwrap().color_map(), &other, "what was shown stays");
}

#[test]
fn shapes_over_two_quantities_take_no_curve() {
    let mut desk = open(Path::new("."));
    let member = members::in_space(desk.session.member().unwrap(), Space::ScalarCov, None);
    desk.act(Action::Edit(Box::new(Edit::SetMember { ensemble: 0, index: 0, member: Box::new(member.clone()) })));
    assert!(desk.session.function().is_none());
    desk.act(Action::LoadFunction { from: "viridis".into(), colors_only: false });
    assert!(said(&mut desk).contains("over two quantities"));
    desk.act(Action::SaveFunction { to: "x.json".into(), format: FunctionFile::Tetreel, may_replace: false });
    assert!(said(&mut desk).contains("shapes are no transfer function"));
    assert_eq!(desk.session.member(), Some(&member));
}

#[test]
fn histograms_of_the_series_and_of_the_step_shown_are_found() {
    let mut desk = open(Path::new("."));
    for space in [Space::Scalar, Space::Cov, Space::ScalarGradient, Space::ScalarCov] {
        for is_of_step in [false, true] {
            let shown = wait_for("histogram", || {
                desk.session.want_histogram(Some((space, is_of_step)));
                desk.session.tick(desk.now);
                let found = desk.session.histogram().filter(|shown| shown.kind == space);
                let is_wanted = |shown: &&Arc<histograms::Shown>| match shown.of {
                    histograms::Steps::Series { counted, steps } => !is_of_step && counted == steps,
                    histograms::Steps::Step(step) => is_of_step && step == 0,
                };
                found.filter(is_wanted).cloned()
            });
            assert!(shown.histogram.counts().iter().sum::<u64>() > 0);
        }
    }
    assert_eq!(desk.session.histogram_problem(), None);
}

#[test]
fn what_opacities_mean_is_drawn_and_undone() {
    let mut desk = open(Path::new("."));
    let before = desk.shown().request.clone();
    for action in [Action::OpacityKind(OpacityKind::Extinction), Action::UnitDistance(0.5)] {
        desk.act(action);
        desk.settle();
        assert!(desk.shown().request.tets().unwrap().table != before.tets().unwrap().table);
        desk.act(Action::Undo);
        desk.settle();
        assert!(desk.shown().request.tets().unwrap().table == before.tets().unwrap().table);
    }
    for distance in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        desk.act(Action::UnitDistance(distance));
    }
    assert_eq!(desk.session.changes().0, 0);
}

#[test]
fn an_ensemble_that_was_chosen_and_removed_leaves_one_that_is_shown_and_edited() {
    let mut desk = open(Path::new("."));
    let edit = |desk: &mut Desk, edit: Option<Edit>| desk.act(Action::Edit(Box::new(edit.unwrap())));
    let copied = members::copied_ensemble(desk.session.project(), 0);
    edit(&mut desk, copied);
    let copied = members::copied_ensemble(desk.session.project(), 1);
    edit(&mut desk, copied);
    for (index, map) in ["inferno", "gray"].into_iter().enumerate() {
        desk.act(Action::Ensembles(EnsembleChoice::One(index + 1)));
        desk.act(Action::Colors(ColorMap::built_in(map).unwrap().clone()));
    }
    let removed = members::removed_ensemble(desk.session.project(), 2);
    edit(&mut desk, removed);
    desk.settle();
    assert_eq!(desk.session.look().followed.ensembles, EnsembleChoice::One(1));
    assert_eq!((desk.session.edited_ensemble(), desk.session.function().unwrap().color_map().name()), (1, "inferno"));
    let shown = desk.shown().request.tets().unwrap().table.clone();
    desk.act(Action::Colors(ColorMap::built_in("viridis").unwrap().clone()));
    desk.settle();
    assert!(desk.shown().request.tets().unwrap().table != shown, "what is edited is what is shown");
    desk.act(Action::Undo);
    desk.act(Action::Undo);
    assert_eq!((desk.session.look().followed.ensembles, desk.session.edited_ensemble()), (EnsembleChoice::One(2), 2));
}

/// An action of the editor, from numbers.
fn action(session: &Session, [kind, a, b]: [u8; 3], x: f64, y: f64) -> Option<Action> {
    let place = session.edited_member()?;
    let (project, member) = (session.project(), session.member()?.clone());
    let edit = |edit: Option<Edit>| edit.map(|edit| Action::Edit(Box::new(edit)));
    let set = |member| {
        let (ensemble, index) = place;
        edit(Some(Edit::SetMember { ensemble, index, member: Box::new(member) }))
    };
    let spaces = [Space::Scalar, Space::Cov, Space::ScalarGradient, Space::ScalarCov];
    let kinds = shapes::Kind::ALL;
    match kind {
        0 => edit(members::added(project, place)),
        1 => edit(members::copied(project, place)),
        2 => edit(members::removed(project, place)),
        3 => edit(members::copied_ensemble(project, place.0)),
        4 => edit(members::removed_ensemble(project, place.0)),
        5 => Some(Action::Member(usize::from(a))),
        6 => set(members::in_space(&member, spaces[usize::from(a) % 4], session.shown_range().as_ref())),
        7 => Some(Action::Opacities(vec![OpacityPoint { position: x, value: y }])),
        8 => edit(session.range_map_edit(RangeMap::default().with_point(x)?.0.with_moved(1, [x, y]))),
        9 => {
            let Function::Widgets(mut all) = member.function.clone() else { return None };
            match all.get_mut(usize::from(b)) {
                Some(shape) => *shape = shapes::dragged(shape, crate::transfer::Part::Handle(usize::from(a)), [x, y]),
                None => all
                    .extend([kinds[usize::from(a) % 4].shape(1)].into_iter().filter(|s| s.suits(member.space.axes()))),
            }
            set(crate::transfer::Member { function: Function::Widgets(all), ..member })
        }
        10 => set(crate::transfer::Member { name: format!("m{a}"), weight: x, enabled: b > 2, ..member }),
        _ => Some(Action::Range(RangePolicy::Manual(x, x + 1.0 + y))),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever is done in the editor, the project is consistent, saved and read it is itself, and undone it is the first one.
    #[test]
    fn edits_are_undone_to_the_bit(
        edits in prop::collection::vec((prop::array::uniform3(0..12_u8), 0.0..1.0_f64, 0.0..1.0_f64), 1..25),
    ) {
        let mut desk = open(Path::new("."));
        let mut states: Vec<Arc<Project>> = vec![desk.session.project().clone()];
        for (numbers, x, y) in edits {
            let Some(action) = action(&desk.session, numbers, x, y) else { continue };
            desk.act(action);
            let project = desk.session.project();
            prop_assert!(project.check().is_ok());
            if **project != **states.last().unwrap() {
                states.push(project.clone());
            }
        }
        let last = desk.session.project();
        let read = Project::parse(&last.to_toml().unwrap(), Path::new("p.toml")).unwrap();
        prop_assert!(read == **last);
        while let Some(state) = states.pop() {
            prop_assert!(**desk.session.project() == *state);
            desk.act(Action::Undo);
        }
        prop_assert_eq!(desk.session.changes().0, 0);
    }
}
